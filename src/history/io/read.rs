//! What the store answers: curves, journal, deeds, reports, and the alarms to restore.

use std::{cell::RefCell, sync::Arc, time::Duration};

use duckdb::{Row, params};
use jiff::Timestamp;

use super::{
    sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::{Answer, HistoryError, Question, Series, series},
    plant::{
        def::{DeviceId, Priority, TagId},
        line_minute::LineMinute,
        record::{ActionRecord, AlarmRecord, AlarmStep, Burst, Seal},
        sample::{Cause, Quality, Sample},
        tag::Decimals,
    },
    report::{
        DECIMALS_UNKNOWN, Period, RecordRow, ShiftReport,
        figures::{self, Label},
        hold::HOLD_MAX,
    },
};

/// Rows of a list or of a record in one answer; an answer that would be longer is refused, never cut.
pub const ROWS_MAX: u64 = 200_000;
/// Stored samples behind the curves of one answer (measured: ten million take about three seconds,
/// in which no commit is made).
pub const SAMPLES_MAX: u64 = 10_000_000;
/// The same behind one report, which reads each of them once more for the record: years of a small plant.
pub const REPORTED_MAX: u64 = 20_000_000;
/// Stored samples in memory at a time: those of one tag in this span.
pub(super) const CHUNK: Duration = Duration::from_secs(86_400);

impl Store {
    /// Answers a question; nothing after `now` is known.
    pub fn answer(&self, question: &Question, now: Timestamp) -> Result<Answer, HistoryError> {
        match question {
            Question::Series { tags, from, to, buckets } => {
                self.curves(tags, series::Span { from: *from, to: *to, until: now }, *buckets).map(Answer::Series)
            }
            Question::Journal { from, to, limit } => {
                check_span(*from, *to)?;
                self.list(&sql::journal_newest(), params![utc(*from), utc(*to), capped(*limit)], alarm)
                    .map(Answer::Journal)
            }
            Question::Actions { from, to, limit } => {
                check_span(*from, *to)?;
                self.list(&sql::actions_newest(), params![utc(*from), utc(*to), capped(*limit)], action)
                    .map(Answer::Actions)
            }
            Question::Audit { from, to, words, by, action: what, limit } => {
                check_span(*from, *to)?;
                self.list(&sql::audit(), params![utc(*from), utc(*to), capped(*limit), by, what, words], action)
                    .map(Answer::Actions)
            }
            Question::LineMinutes { line, from, to, limit } => {
                check_span(*from, *to)?;
                let name = self.def.lines.get(line.index()).map_or("", |line| &line.name);
                self.list(sql::LINE_MINUTES, params![name, utc(*from), utc(*to), capped(*limit)], line_minute)
                    .map(Answer::LineMinutes)
            }
            Question::Report { period } => self.report(period, now).map(|report| Answer::Report(Box::new(report))),
            Question::AlarmQuality { from, to } => {
                self.alarm_quality(*from, *to, now).map(|figures| Answer::AlarmQuality(Box::new(figures)))
            }
        }
    }

    /// Of each alarm the last step of every kind, oldest first: from these the plant restores what is active and
    /// what is acknowledged.
    pub fn restore(&self) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::restore(), params![ROWS_MAX + 1], alarm)
    }

    fn curves(&self, tags: &[TagId], span: series::Span, buckets: usize) -> Result<Vec<Series>, HistoryError> {
        check_span(span.from, span.to)?;
        self.bounded(tags, span.from, span.to, SAMPLES_MAX)?;
        let curve = |tag: &TagId| {
            let samples = self.samples(*tag, span.from, span.to)?;
            sound(samples, |samples| series::series(*tag, samples, span, buckets))
        };
        tags.iter().map(curve).collect()
    }

    /// The report of a period, up to `now`.
    pub fn report(&self, period: &Period, now: Timestamp) -> Result<ShiftReport, HistoryError> {
        let (from, until) = (period.from, period.to.min(now));
        check_span(from, until)?;
        self.bounded(&self.reported_tags(), from, until, REPORTED_MAX)?;
        let active = self.active_at(from)?;
        let span = params![utc(from), utc(until), ROWS_MAX + 1];
        let alarms = self.steps(from, until)?;
        let actions = self.whole_list(&sql::actions_oldest(), span, action)?;
        let mut tags = Vec::new();
        for tag in self.reported_tags() {
            let label = self.label(tag, from, until)?;
            let in_alarm = figures::time_in_alarm(active.iter().chain(&alarms), &label.tag, from, until);
            let samples = self.samples(tag, from, until)?;
            tags.push(sound(samples, |samples| figures::figures(label, samples, from, until, in_alarm))?);
        }
        let (record, record_of) = match self.def.report.record {
            Some((device, interval)) => self.record(device, interval, from, until)?,
            None => (Vec::new(), None),
        };
        let quality = self.alarm_quality(from, until, now)?;
        Ok(ShiftReport { period: period.clone(), until, tags, alarms, quality, actions, record, record_of })
    }

    /// The tags that the plant file asks for, or every stored tag with a unit.
    fn reported_tags(&self) -> Vec<TagId> {
        match self.def.report.tags.as_slice() {
            [] => self.def.tags.iter().filter(|tag| tag.store && !tag.unit.is_empty()).map(|tag| tag.id).collect(),
            tags => tags.to_vec(),
        }
    }

    /// Name, unit and decimals of a tag as they stood at the end of a period; the device may choose the last two.
    fn label(&self, tag: TagId, from: Timestamp, until: Timestamp) -> Result<Label, HistoryError> {
        let def = self.def.tag(tag);
        let decimals = match def.decimals {
            Decimals::Fixed(decimals) => decimals,
            Decimals::From(tag) => match self.latest_good(tag, from, until)? {
                Some(decimals) if (0.0..=9.0).contains(&decimals) => decimals as u8,
                Some(_) | None => DECIMALS_UNKNOWN,
            },
        };
        let chosen = match &def.unit_from {
            Some((chooser, units)) => {
                let value = self.latest_good(*chooser, from, until)?;
                units.iter().find(|(number, _)| value == Some(*number as f64)).map(|(_, unit)| unit.clone())
            }
            None => None,
        };
        Ok(Label { tag: def.name.clone(), unit: chosen.unwrap_or_else(|| def.unit.clone()), decimals })
    }

    fn record(
        &self,
        device: DeviceId,
        interval: Duration,
        from: Timestamp,
        until: Timestamp,
    ) -> Result<(Vec<RecordRow>, Option<NameAndUnit>), HistoryError> {
        let def = self.def.device(device);
        let Some(face) = &def.faceplate else { return Ok((Vec::new(), None)) };
        let rows =
            until.duration_since(from).as_millis() / i128::try_from(interval.as_millis().max(1)).unwrap_or(i128::MAX);
        within(u64::try_from(rows).unwrap_or(u64::MAX), ROWS_MAX)?;
        let (sv, pv) = (self.samples(face.sv, from, until)?, self.samples(face.pv, from, until)?);
        let zone = &self.def.time_zone;
        let rows = sound(sv, |sv| sound(pv, |pv| figures::record(sv, pv, interval, zone, from, until)))??;
        Ok((rows, Some((def.name.clone(), self.label(face.pv, from, until)?.unit))))
    }

    /// The samples of a tag that matter in a span, in order of time, beginning [`HOLD_MAX`] before it.
    fn samples(&self, tag: TagId, from: Timestamp, to: Timestamp) -> Result<Samples<'_>, HistoryError> {
        let extent = self.extent().filter(|_| self.id(tag).is_some());
        let from = from.checked_sub(HOLD_MAX).unwrap_or(Timestamp::MIN);
        // Only days that have rows are asked for.
        let (next, end) = extent.map_or((0, 0), |(first, last)| {
            (from.max(first).as_microsecond(), to.as_microsecond().min(last.as_microsecond() + 1))
        });
        let off = self.ended.map(|at| Sample::bad(Cause::StationOff, at));
        Ok(Samples { store: self, id: self.id(tag), next, end, rows: Vec::new().into_iter(), off })
    }

    /// Refuses what would keep the thread, and with it every commit, for too long.
    pub(super) fn bounded(&self, tags: &[TagId], from: Timestamp, to: Timestamp, max: u64) -> Result<(), HistoryError> {
        let rows = tags.iter().map(|tag| self.count(*tag, from, to)).sum::<Result<u64, _>>()?;
        within(rows, max)
    }

    fn count(&self, tag: TagId, from: Timestamp, to: Timestamp) -> Result<u64, HistoryError> {
        let params = params![self.id(tag), utc(from), utc(to)];
        self.db.query_row(sql::COUNT_SAMPLES, params, |row| row.get(0)).map_err(engine)
    }

    fn latest_good(&self, tag: TagId, from: Timestamp, until: Timestamp) -> Result<Option<f64>, HistoryError> {
        let since = from.checked_sub(HOLD_MAX).unwrap_or(Timestamp::MIN);
        let params = params![self.id(tag), utc(since), utc(until)];
        self.db.query_row(sql::LATEST_GOOD, params, |row| row.get(0)).map_err(engine)
    }

    fn id(&self, tag: TagId) -> Option<u16> {
        self.ids.get(tag.index()).copied().flatten()
    }

    fn list<T>(
        &self,
        sql: &str,
        params: &[&dyn duckdb::ToSql],
        read: fn(&Row) -> duckdb::Result<T>,
    ) -> Result<Vec<T>, HistoryError> {
        let mut statement = self.db.prepare_cached(sql).map_err(engine)?;
        let rows = statement.query_map(params, read).map_err(engine)?;
        rows.collect::<duckdb::Result<_>>().map_err(engine)
    }

    /// A list that must not be cut; its SQL asks for one row more than is permitted.
    pub(super) fn whole_list<T>(
        &self,
        sql: &str,
        params: &[&dyn duckdb::ToSql],
        read: fn(&Row) -> duckdb::Result<T>,
    ) -> Result<Vec<T>, HistoryError> {
        let rows = self.list(sql, params, read)?;
        within(rows.len() as u64, ROWS_MAX)?;
        Ok(rows)
    }
}

/// Name and unit of the recorded controller.
type NameAndUnit = (String, String);

/// The samples of a tag, read a day at a time.
struct Samples<'a> {
    store: &'a Store,
    id: Option<u16>,
    /// Microseconds: the next day to read begins here, the last ends at `end`.
    next: i64,
    end: i64,
    rows: std::vec::IntoIter<Sample>,
    /// The end of all records, if the station is not running.
    off: Option<Sample>,
}

impl Samples<'_> {
    fn read(&self, from: i64, to: i64) -> Result<Vec<Sample>, HistoryError> {
        let (Some(from), Some(to)) = (instant(from), instant(to)) else { return Ok(Vec::new()) };
        self.store.list(sql::SAMPLES, params![self.id, utc(from), utc(to)], sample)
    }
}

impl Iterator for Samples<'_> {
    type Item = Result<Sample, HistoryError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(sample) = self.rows.next() {
                return Some(Ok(sample));
            }
            if self.next >= self.end {
                return self.off.take().map(Ok);
            }
            let to = self.next.saturating_add(CHUNK.as_micros() as i64).min(self.end);
            match self.read(self.next, to) {
                Ok(rows) => self.rows = rows.into_iter(),
                Err(error) => {
                    self.next = self.end;
                    return Some(Err(error));
                }
            }
            self.next = to;
        }
    }
}

/// Hands the items of a fallible sequence to `work` as far as they are sound; an error makes the whole an error.
fn sound<T, R>(
    mut items: impl Iterator<Item = Result<T, HistoryError>>,
    work: impl FnOnce(&mut dyn Iterator<Item = T>) -> R,
) -> Result<R, HistoryError> {
    let failed = RefCell::new(None);
    let result = work(&mut std::iter::from_fn(|| match items.next()? {
        Ok(item) => Some(item),
        Err(error) => {
            *failed.borrow_mut() = Some(error);
            None
        }
    }));
    failed.into_inner().map_or(Ok(result), Err)
}

pub(super) fn check_span(from: Timestamp, to: Timestamp) -> Result<(), HistoryError> {
    if from < to { Ok(()) } else { Err(HistoryError::EmptyPeriod) }
}

pub(super) fn within(rows: u64, max: u64) -> Result<(), HistoryError> {
    if rows <= max { Ok(()) } else { Err(HistoryError::TooManyRows { rows, max }) }
}

fn capped(limit: usize) -> u64 {
    (limit as u64).min(ROWS_MAX)
}

fn sample(row: &Row) -> duckdb::Result<Sample> {
    let at = time(row)?;
    let value: Option<f64> = row.get(1)?;
    // A number that no version wrote is no value.
    let quality = Quality::from_code(row.get(2)?).unwrap_or(Quality::Bad(Cause::Corrupt));
    Ok(match (value, quality) {
        (Some(_), Quality::Good | Quality::Uncertain(_)) => Sample { value, quality, at },
        (None, Quality::Good) => Sample::bad(Cause::Corrupt, at),
        (None, Quality::Uncertain(cause)) | (_, Quality::Bad(cause)) => Sample::bad(cause, at),
    })
}

pub(super) fn alarm(row: &Row) -> duckdb::Result<AlarmRecord> {
    Ok(AlarmRecord {
        at: time(row)?,
        subject: shared(row, 1)?,
        text: shared(row, 2)?,
        priority: match row.get::<_, u8>(3)? {
            1 => Priority::Critical,
            2 => Priority::High,
            3 => Priority::Medium,
            4 => Priority::Low,
            n => return Err(duckdb::Error::IntegralValueOutOfRange(3, i128::from(n))),
        },
        step: AlarmStep::from_word(&row.get::<_, String>(4)?).ok_or(duckdb::Error::InvalidQuery)?,
        value: row.get(5)?,
        limit: row.get(6)?,
        by: maybe_shared(row, 7)?,
        reason: maybe_shared(row, 8)?,
        until: maybe_time(row, 9)?,
        burst: match (maybe_time(row, 10)?, row.get(11)?) {
            (Some(began), Some(rank)) => Some(Burst { began, rank }),
            (_, None) | (None, _) => None,
        },
    })
}

fn action(row: &Row) -> duckdb::Result<ActionRecord> {
    Ok(ActionRecord {
        at: time(row)?,
        by: shared(row, 1)?,
        action: shared(row, 2)?,
        target: shared(row, 3)?,
        old: maybe_shared(row, 4)?,
        new: maybe_shared(row, 5)?,
        outcome: shared(row, 6)?,
        from: maybe_shared(row, 7)?.unwrap_or_default(),
        note: maybe_shared(row, 8)?,
        seal: seal(row.get(9)?, row.get(10)?),
    })
}

/// The seal of a deed; `None` for one that never came into the book.
fn seal(number: Option<u64>, hash: Option<Vec<u8>>) -> Option<Seal> {
    Some(Seal { number: number?, hash: hash?.try_into().ok()? })
}

fn line_minute(row: &Row) -> duckdb::Result<LineMinute> {
    let count = |column| row.get::<_, u32>(column).map(u64::from);
    Ok(LineMinute {
        at: time(row)?,
        line: shared(row, 1)?,
        requests: count(2)?,
        ok: count(3)?,
        timeouts: count(4)?,
        corrupt: count(5)?,
        exceptions: count(6)?,
        retries: count(7)?,
        late: count(8)?,
        missed: count(9)?,
        sent_bytes: count(10)?,
        received_bytes: count(11)?,
        utilisation: row.get(12)?,
        reply_p99_ms: row.get(13)?,
        reply_max_ms: row.get(14)?,
    })
}

fn time(row: &Row) -> duckdb::Result<Timestamp> {
    let micros: i64 = row.get(0)?;
    instant(micros).ok_or(duckdb::Error::IntegralValueOutOfRange(0, i128::from(micros)))
}

fn maybe_time(row: &Row, column: usize) -> duckdb::Result<Option<Timestamp>> {
    Ok(row.get::<_, Option<i64>>(column)?.and_then(instant))
}

fn shared(row: &Row, column: usize) -> duckdb::Result<Arc<str>> {
    row.get::<_, String>(column).map(Arc::from)
}

fn maybe_shared(row: &Row, column: usize) -> duckdb::Result<Option<Arc<str>>> {
    row.get::<_, Option<String>>(column).map(|text| text.map(Arc::from))
}
