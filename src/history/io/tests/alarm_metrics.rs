//! The figures of the alarm system against an independent count in SQL over the same journal.

use std::time::Duration;

use duckdb::params;
use proptest::prelude::*;

use super::*;
use crate::{
    history::io::store::utc,
    plant::{
        alarm::{
            PeriodMetrics,
            metrics::{Frequent, Named, place},
        },
        def::{AlarmDef, AlarmId, Condition, Subject},
    },
};

/// A Saturday, 06:00 UTC.
const START: i64 = 1_795_240_800;

/// Activations of each priority, the most urgent first.
const BY_PRIORITY: &str = "SELECT count(*) FILTER (priority = 1), count(*) FILTER (priority = 2),
        count(*) FILTER (priority = 3), count(*) FILTER (priority = 4)
    FROM alarm_journal WHERE event = 'raised' AND utc >= $1 AND utc < $2";

/// All windows of ten minutes in which a station recorded, those with more than ten alarms, the worst, and their microseconds.
const WINDOWS: &str = "WITH ten AS (
        SELECT DISTINCT unnest(range(time_bucket(INTERVAL 10 MINUTES, greatest(from_utc, $1::TIMESTAMP)),
            least(to_utc + INTERVAL 1 MICROSECOND, $2::TIMESTAMP), INTERVAL 10 MINUTES)) AS begins
        FROM recorded WHERE to_utc >= $1 AND from_utc < $2),
    counts AS (
        SELECT begins, count(j.utc) AS raised FROM ten
        LEFT JOIN (SELECT utc FROM alarm_journal WHERE event = 'raised' AND utc >= $1 AND utc < $2) j
            ON time_bucket(INTERVAL 10 MINUTES, j.utc) = begins GROUP BY begins)
    SELECT count(*), count(*) FILTER (raised > 10), coalesce(max(raised), 0),
        coalesce(sum(epoch_us(least(begins + INTERVAL 10 MINUTES, $2::TIMESTAMP))
            - epoch_us(greatest(begins, $1::TIMESTAMP))), 0)::UBIGINT FROM counts";

/// Seconds in flood: the count of the last 600 s has been above 10 more lately than below 5.
const FLOOD: &str = "WITH seconds AS (
        SELECT unnest(range(epoch_us($1::TIMESTAMP) // 1000000 - 86400, epoch_us($2::TIMESTAMP) // 1000000)) AS s),
    raised AS (
        SELECT epoch_us(utc) // 1000000 AS s, count(*) AS n FROM alarm_journal
        WHERE event = 'raised' AND utc >= $1::TIMESTAMP - INTERVAL 24 HOURS AND utc < $2 GROUP BY 1),
    rates AS (
        SELECT s, sum(coalesce(n, 0)) OVER (ORDER BY s ROWS BETWEEN 599 PRECEDING AND CURRENT ROW) AS rate
        FROM seconds LEFT JOIN raised USING (s)),
    states AS (
        SELECT s, max(CASE WHEN rate > 10 THEN s END) OVER (ORDER BY s ROWS UNBOUNDED PRECEDING) AS above,
            max(CASE WHEN rate < 5 THEN s END) OVER (ORDER BY s ROWS UNBOUNDED PRECEDING) AS below
        FROM rates)
    SELECT count(*) FROM states WHERE above > coalesce(below, -1) AND s >= epoch_us($1::TIMESTAMP) // 1000000";

const TOP_TEN: &str = "SELECT subject, message, count(*) FROM alarm_journal
    WHERE event = 'raised' AND utc >= $1 AND utc < $2 GROUP BY ALL ORDER BY 3 DESC, 1, 2 LIMIT 10";

const CHATTERING: &str = "SELECT DISTINCT subject, message FROM (
        SELECT *, lag(utc, 2) OVER (PARTITION BY subject, message ORDER BY utc, rowid) AS third
        FROM alarm_journal WHERE event = 'raised')
    WHERE utc - third < INTERVAL 60 SECONDS AND utc >= $1 AND utc < $2 ORDER BY ALL";

const FLEETING: &str = "SELECT DISTINCT subject, message FROM (
        SELECT *, rowid AS place, lag(event) OVER alarm AS before, lag(utc) OVER alarm AS began, lag(rowid) OVER alarm AS first
        FROM alarm_journal WHERE event IN ('raised', 'RTN') WINDOW alarm AS (PARTITION BY subject, message ORDER BY rowid)) r
    WHERE event = 'RTN' AND before = 'raised' AND utc - began < INTERVAL 10 SECONDS AND utc >= $1 AND utc < $2
        AND NOT EXISTS (SELECT 1 FROM alarm_journal a WHERE a.event = 'acknowledged' AND a.subject = r.subject
            AND a.message = r.message AND a.rowid BETWEEN first AND place) ORDER BY ALL";

/// The most alarms at one second that had been active for over a day.
const STALE: &str = "WITH activations AS (
        SELECT event, epoch_us(utc) // 1000000 AS began,
            epoch_us(least(lead(utc) OVER (PARTITION BY subject, message ORDER BY rowid), $2::TIMESTAMP)) // 1000000 AS ended
        FROM alarm_journal WHERE event IN ('raised', 'RTN') AND utc < $2),
    stale AS (
        SELECT greatest(began + 86400, epoch_us($1::TIMESTAMP) // 1000000) AS a,
            coalesce(ended, epoch_us($2::TIMESTAMP) // 1000000) AS z FROM activations WHERE event = 'raised'),
    spans AS (SELECT * FROM stale WHERE a < z)
    SELECT coalesce(max(n), 0) FROM (
        SELECT (SELECT count(*) FROM spans o WHERE o.a <= s.a AND s.a < o.z) AS n FROM spans s)";

/// Activations that were not annunciated.
const SUPPRESSED: &str =
    "SELECT count(*) FROM alarm_journal WHERE event = 'raised (suppressed)' AND utc >= $1 AND utc < $2";

/// The figures as SQL counts them.
fn counted(store: &Store, from: Timestamp, until: Timestamp) -> PeriodMetrics {
    let db = &store.db;
    let span = params![utc(from), utc(until)];
    let number = |sql: &str| db.query_row(sql, span, |row| row.get::<_, u64>(0)).unwrap();
    let named = |row: &duckdb::Row| {
        let column = |n| row.get::<_, String>(n).map(Arc::<str>::from);
        Ok(Named { subject: column(0)?, message: column(1)? })
    };
    let names = |sql: &str| -> Vec<Named> {
        db.prepare(sql).unwrap().query_map(span, named).unwrap().map(Result::unwrap).collect()
    };
    let top = |row: &duckdb::Row| Ok(Frequent { alarm: named(row)?, raised: row.get(2)? });
    let (windows, windows_over, most, micros) =
        db.query_row(WINDOWS, span, |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))).unwrap();
    PeriodMetrics {
        from,
        until,
        by_priority: db
            .query_row(BY_PRIORITY, span, |row| Ok([row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?]))
            .unwrap(),
        windows,
        watched: Duration::from_micros(micros),
        windows_over,
        most,
        flood: Duration::from_secs(number(FLOOD)),
        top: db.prepare(TOP_TEN).unwrap().query_map(span, top).unwrap().map(Result::unwrap).collect(),
        chattering: names(CHATTERING),
        fleeting: names(FLEETING),
        stale: number(STALE),
        suppressed: number(SUPPRESSED),
    }
}

fn at(second: f64) -> Timestamp {
    Timestamp::from_microsecond(START * 1_000_000 + (second * 1e6) as i64).unwrap()
}

/// Some hundred steps of fourteen alarms: floods, quiet hours, and now and then more than a day of nothing.
fn journal() -> impl Strategy<Value = Vec<AlarmRecord>> {
    use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};
    let gap = prop_oneof![60 => 0.0..15.0, 20 => 15.0..120.0, 8 => 120.0..4_000.0, 1 => 4_000.0..50_000.0f64];
    let kind = prop_oneof![4 => Just(Raised), 2 => Just(ReturnedToNormal), 1 => Just(Acknowledged)];
    let priority =
        prop_oneof![Just(Priority::Critical), Just(Priority::High), Just(Priority::Medium), Just(Priority::Low)];
    // The first few alarms come again and again, the last ones hardly ever.
    let name = prop_oneof![6 => 0..4u8, 3 => 4..10u8, 1 => 10..14u8];
    proptest::collection::vec((gap, name, kind, priority), 300..700).prop_map(|rows| {
        let mut now = 0.0;
        let mut list = Vec::new();
        for (gap, name, kind, priority) in rows {
            now += gap;
            let text = format!("alarm {name}");
            let subject = if name % 2 == 0 { "TIC-1.PV" } else { "PLC-1.LT-1" };
            list.push(AlarmRecord { at: at(now), priority, subject: subject.into(), ..step(0, &text, kind) });
        }
        list
    })
}

/// An instant of the journal: that of an event itself, or anywhere.
fn instant(journal: &[AlarmRecord], share: f64, on_a_step: bool) -> Timestamp {
    if on_a_step {
        return journal[(share * (journal.len() - 1) as f64) as usize].at;
    }
    let whole = journal[journal.len() - 1].at.duration_since(at(0.0)).as_secs_f64();
    at(whole * share)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn metrics_of_any_period_equal_those_counted_by_sql(
        journal in journal(),
        (a, b) in (0.0..0.7, 0.1..1.0f64),
        (from_step, until_step) in any::<(bool, bool)>(),
    ) {
        let (_folder, db) = folder();
        let store = open(&db, START);
        store.append(&journal.iter().cloned().map(Record::Alarm).collect::<Vec<_>>()).unwrap();
        let from = instant(&journal, a, from_step);
        let until = instant(&journal, a + (1.0 - a) * b, until_step).max(from + Duration::from_secs(1));
        let query = Query::AlarmMetrics { from, to: until };
        let answer = store.answer(&query, until).unwrap();
        prop_assert_eq!(answer, Answer::AlarmMetrics(Box::new(counted(&store, from, until))));
    }
}

#[test]
fn metrics_of_special_days_equal_those_counted_by_sql() {
    use AlarmEvent::{Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, START);
    let mut journal = vec![AlarmRecord { at: at(-90_000.0), ..step(0, "old", Raised) }];
    for i in 0..500 {
        let (name, second) = (format!("alarm {:03}", i % 250), f64::from(i) * 0.12);
        journal.push(AlarmRecord { at: at(second), ..step(0, &name, Raised) });
        journal.push(AlarmRecord { at: at(second + 0.06), ..step(0, &name, ReturnedToNormal) });
    }
    store.append(&journal.into_iter().map(Record::Alarm).collect::<Vec<_>>()).unwrap();
    // A station ran all the time but for the last hour.
    store.append(&(-48..42).map(|n| good(PV, START + n * 600, 27.0)).collect::<Vec<_>>()).unwrap();
    let (from, until) = (at(-28_800.0), at(28_800.0));
    let figures = store.alarm_metrics(from, until, until).unwrap();
    assert_eq!(figures, counted(&store, from, until));
    assert_eq!((figures.annunciated(), figures.windows, figures.windows_over, figures.most), (500, 90, 1, 500));
    assert_eq!(figures.watched.as_secs(), 15 * 3_600);
    assert_eq!((figures.stale, figures.fleeting.len(), figures.top.len()), (1, 250, 10));
    assert_eq!(figures.by_priority[place(Priority::High)], 500);
    // From second 1, the eleventh alarm, until the last but four are ten minutes old.
    assert_eq!(figures.flood.as_secs(), 658);
    assert_eq!(store.alarm_metrics(until, until, until), Err(HistoryError::EmptyPeriod));
}

/// The store of a plant that has these alarms.
fn watching(db: &Path, messages: &[&str]) -> Store {
    let condition = Condition::State { is: 1.0 };
    let alarm = |message: &&str| AlarmDef::new(AlarmId(0), Subject::Tag(PV), condition, *message);
    let mut def = PlantDef::clone(&def());
    def.alarms = messages.iter().map(alarm).collect();
    Store::open(db, &Arc::new(def), sec(START)).unwrap().store
}

#[test]
fn a_station_that_starts_again_knows_the_alarms_of_its_last_day() {
    use AlarmEvent::Raised;
    let (_folder, db) = folder();
    let store = watching(&db, &["alarm at -100000"]);
    let [old, before, late] = [-100_000.0, -80_000.0, -1.0].map(|second| (second, format!("alarm at {second}")));
    let steps = [old, before, late].map(|(second, text)| AlarmRecord { at: at(second), ..step(0, &text, Raised) });
    store.append(&steps.clone().map(Record::Alarm)).unwrap();
    let recent = store.recent(at(0.0)).unwrap();
    assert_eq!((recent.active.as_slice(), recent.events.as_slice()), (&steps[..1], &steps[1..]));
}

#[test]
fn an_alarm_suppressed_before_a_period_is_not_stale_in_it() {
    use AlarmEvent::{OutOfService, Raised, RaisedSuppressed, Shelved, SuppressedByDesign};
    let (_folder, db) = folder();
    let store = watching(&db, &["shelved", "suppressed", "out of service", "quiet", "back"]);
    let pair = |second: f64, text: &str, first, then| {
        [(second, first), (second + 1.0, then)]
            .map(|(second, kind)| Record::Alarm(AlarmRecord { at: at(second), ..step(0, text, kind) }))
    };
    let suppressed = [("shelved", Shelved), ("suppressed", SuppressedByDesign), ("out of service", OutOfService)];
    for (text, kind) in suppressed {
        store.append(&pair(-200_000.0, text, Raised, kind)).unwrap();
    }
    store.append(&pair(-200_000.0, "quiet", SuppressedByDesign, RaisedSuppressed)).unwrap();
    store.append(&pair(-200_000.0, "back", Shelved, Raised)).unwrap();
    assert_eq!(store.alarm_metrics(at(0.0), at(3_600.0), at(3_600.0)).unwrap().stale, 1);
    assert_eq!(store.recent(at(0.0)).unwrap().active.len(), 1);
}
