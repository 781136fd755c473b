//! The schema as numbered migrations.

/// The migrations; the schema's version is their number. Each runs in one transaction, followed by a checkpoint before
/// any data, because data definitions among data in the log are what DuckDB's known recovery bugs need.
///
/// No keys and no indexes: they cost eight times the file. `utc` is a TIMESTAMP, not a BIGINT: both are 64 bits of
/// microseconds and take the same space on disk (measured), but a TIMESTAMP can be read by a person and by `time_bucket`.
/// `value` is a DOUBLE because a FLOAT would turn 123456.7 into 123456.703. `quality` is `Quality::code`.
///
/// `last_commit` has one row: who the file is, how many commits it has, the first and last instant stored; each commit
/// changes it. So a start need not scan the file, and sees what is missing, see `last`.
///
/// `rest` is what the DOUBLE in `value` lacks of a number of more than 15 digits, NULL for all others: together they are
/// what a 64-bit register holds. Of a file of the archive, `rests` says whether it has such columns.
///
/// `epoch` counts how often the clock was set while this history was written: rows of one epoch are in the order of their
/// times, rows of two need not be.
///
/// `utc` of `line_minute` is the end of the minute; a line goes by its name, as everything that outlives the plant file.
///
/// `batch` has the changes of batches; `place` is their order within one.
///
/// `control_run` has the runs as they stood when they were stored, the last one of a number counts; `utc` is the begin; of a
/// time NULL is not yet, -1 unknown, else it is in seconds.
///
/// `report` has the events of automatic reports; the last one of a period and format is its state.
///
/// Samples of a file have the epoch [`IMPORTED`](super::IMPORTED), and `import` has a row for each file.
///
/// `archive` is the manifest of the files in the archive, see there; `deleted` are the files that the rules of the plant have
/// deleted.
///
/// `recorded` are the times in which a station recorded, by the clock of each epoch, from the first to the last instant that it
/// stored. Of a file that had no such table they are those of its rows, and of windows of ten minutes (`watched`) where nothing
/// else is known of what was archived: there, the epoch is NULL.
pub const MIGRATIONS: [&str; 16] = [
    "
CREATE TABLE tag (id USMALLINT NOT NULL, name VARCHAR NOT NULL, unit VARCHAR NOT NULL);
CREATE TABLE sample (utc TIMESTAMP NOT NULL, tag USMALLINT NOT NULL, value DOUBLE, quality UTINYINT NOT NULL);
CREATE TABLE alarm_journal (
    utc TIMESTAMP NOT NULL, subject VARCHAR NOT NULL, text VARCHAR NOT NULL, priority UTINYINT NOT NULL,
    step VARCHAR NOT NULL, value DOUBLE, limit_value DOUBLE, by_whom VARCHAR);
CREATE TABLE operator_action (
    utc TIMESTAMP NOT NULL, by_whom VARCHAR NOT NULL, action VARCHAR NOT NULL, target VARCHAR NOT NULL,
    old_value VARCHAR, new_value VARCHAR, outcome VARCHAR NOT NULL);
",
    "
CREATE TABLE line_minute (
    utc TIMESTAMP NOT NULL, line VARCHAR NOT NULL, requests UINTEGER NOT NULL, ok UINTEGER NOT NULL,
    timeouts UINTEGER NOT NULL, corrupt UINTEGER NOT NULL, exceptions UINTEGER NOT NULL, retries UINTEGER NOT NULL,
    late UINTEGER NOT NULL, missed UINTEGER NOT NULL, sent_bytes UINTEGER NOT NULL, received_bytes UINTEGER NOT NULL,
    utilisation FLOAT NOT NULL, reply_p99_ms FLOAT, reply_max_ms FLOAT);
",
    "
ALTER TABLE operator_action ADD COLUMN from_where VARCHAR;
ALTER TABLE operator_action ADD COLUMN note VARCHAR;
ALTER TABLE operator_action ADD COLUMN number UBIGINT;
ALTER TABLE operator_action ADD COLUMN hash BLOB;
",
    "
ALTER TABLE alarm_journal ADD COLUMN reason VARCHAR;
ALTER TABLE alarm_journal ADD COLUMN until_utc TIMESTAMP;
ALTER TABLE alarm_journal ADD COLUMN burst_utc TIMESTAMP;
ALTER TABLE alarm_journal ADD COLUMN burst_rank UINTEGER;
",
    "
CREATE TABLE last_commit (
    identity UBIGINT NOT NULL, number UBIGINT NOT NULL, first_utc TIMESTAMP, last_utc TIMESTAMP);
INSERT INTO last_commit SELECT (random() * 9007199254740992)::UBIGINT, 0, min(a), max(z) FROM (
    SELECT min(utc) AS a, max(utc) AS z FROM sample UNION ALL SELECT min(utc), max(utc) FROM alarm_journal);
",
    "
ALTER TABLE sample ADD COLUMN epoch USMALLINT DEFAULT 0;
ALTER TABLE alarm_journal ADD COLUMN epoch USMALLINT DEFAULT 0;
ALTER TABLE operator_action ADD COLUMN epoch USMALLINT DEFAULT 0;
ALTER TABLE line_minute ADD COLUMN epoch USMALLINT DEFAULT 0;
ALTER TABLE last_commit ADD COLUMN epoch USMALLINT DEFAULT 0;
",
    "
ALTER TABLE alarm_journal RENAME COLUMN step TO event;
ALTER TABLE alarm_journal RENAME COLUMN text TO message;
ALTER TABLE alarm_journal RENAME COLUMN burst_utc TO first_out_utc;
ALTER TABLE alarm_journal RENAME COLUMN burst_rank TO first_out_rank;
",
    "
UPDATE alarm_journal SET event = CASE event
    WHEN 'returned' THEN 'RTN' WHEN 'raised' || ' quietly' THEN 'raised (suppressed)'
    WHEN 'returned' || ' quietly' THEN 'RTN (suppressed)' WHEN 'raised again' THEN 're-alarmed'
    WHEN 'suppressed' THEN 'suppressed by design' WHEN 'released' THEN 'unsuppressed' ELSE event END;
",
    "
CREATE TABLE archive (
    tier VARCHAR NOT NULL, path VARCHAR NOT NULL, from_utc TIMESTAMP NOT NULL, to_utc TIMESTAMP NOT NULL,
    rows UBIGINT NOT NULL, bytes UBIGINT NOT NULL, sha256 VARCHAR NOT NULL);
CREATE TABLE watched (ten_minutes BIGINT NOT NULL);
",
    "
CREATE TABLE deleted (tier VARCHAR NOT NULL, path VARCHAR NOT NULL, until_utc TIMESTAMP NOT NULL);
",
    "
CREATE TABLE import (
    utc TIMESTAMP NOT NULL, file VARCHAR NOT NULL, from_utc TIMESTAMP NOT NULL, to_utc TIMESTAMP NOT NULL,
    rows UBIGINT NOT NULL);
",
    "
CREATE TABLE batch (
    utc TIMESTAMP NOT NULL, name VARCHAR NOT NULL, number UINTEGER NOT NULL, place UINTEGER NOT NULL,
    event VARCHAR NOT NULL, phase VARCHAR, epoch USMALLINT NOT NULL);
",
    "
CREATE TABLE report (
    utc TIMESTAMP NOT NULL, period VARCHAR NOT NULL, name VARCHAR NOT NULL, from_utc TIMESTAMP NOT NULL,
    to_utc TIMESTAMP NOT NULL, format VARCHAR NOT NULL, file VARCHAR NOT NULL, sha256 VARCHAR NOT NULL,
    event VARCHAR NOT NULL, attempts UINTEGER NOT NULL, error VARCHAR, epoch USMALLINT NOT NULL);
",
    "
CREATE TABLE control_run (
    utc TIMESTAMP NOT NULL, controller VARCHAR NOT NULL, number UINTEGER NOT NULL, place UINTEGER NOT NULL,
    state VARCHAR NOT NULL, cause VARCHAR NOT NULL, detail VARCHAR NOT NULL, begin_seen BOOLEAN NOT NULL,
    until_utc TIMESTAMP NOT NULL, sv_before DOUBLE, sv DOUBLE NOT NULL, pv DOUBLE, unit VARCHAR NOT NULL,
    decimals UTINYINT NOT NULL, band DOUBLE NOT NULL, settings VARCHAR NOT NULL, settings_changed BOOLEAN NOT NULL,
    at_sv DOUBLE, steady DOUBLE, rise DOUBLE, overshoot DOUBLE, final_offset DOUBLE, iae DOUBLE NOT NULL, kwh DOUBLE,
    kwh_good DOUBLE, good DOUBLE NOT NULL, epoch USMALLINT NOT NULL);
",
    "
ALTER TABLE sample ADD COLUMN rest DOUBLE;
ALTER TABLE alarm_journal ADD COLUMN value_rest DOUBLE;
ALTER TABLE archive ADD COLUMN rests BOOLEAN DEFAULT false;
",
    "
CREATE TABLE recorded (epoch USMALLINT, from_utc TIMESTAMP NOT NULL, to_utc TIMESTAMP NOT NULL);
INSERT INTO recorded SELECT epoch, min(a), max(z) FROM (
    SELECT epoch, a, z, sum(begins) OVER (PARTITION BY epoch ORDER BY a, z ROWS UNBOUNDED PRECEDING) AS part FROM (
        SELECT epoch, a, z, CASE WHEN a <= max(z) OVER (PARTITION BY epoch ORDER BY a, z
            ROWS BETWEEN UNBOUNDED PRECEDING AND 1 PRECEDING) + INTERVAL 150 SECONDS THEN 0 ELSE 1 END AS begins FROM (
            SELECT DISTINCT epoch, date_trunc('second', utc) AS a, date_trunc('second', utc) AS z FROM sample
                WHERE epoch IS DISTINCT FROM 65535
            UNION ALL SELECT epoch, utc, utc FROM alarm_journal
            UNION ALL SELECT epoch, utc - INTERVAL 1 MICROSECOND, utc - INTERVAL 1 MICROSECOND FROM line_minute
            UNION ALL SELECT NULL, make_timestamp(ten_minutes * 600000000), make_timestamp((ten_minutes + 1) * 600000000)
                FROM watched WHERE ten_minutes NOT IN (SELECT epoch_us(utc - INTERVAL 1 MICROSECOND) // 600000000 FROM line_minute))))
    GROUP BY epoch, part ORDER BY epoch, min(a);
DROP TABLE watched;
",
];
