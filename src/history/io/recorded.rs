//! When stations recorded: a row for each run of a station and epoch of its clock, widened with each commit.

use std::collections::BTreeSet;

use duckdb::params;
use jiff::Timestamp;

use super::{
    sql,
    store::{Store, after, instant, utc},
};
use crate::{
    history::{
        HistoryError,
        recorded::{Doubled, Leg, Over, PAUSE_MAX, PAUSES_MAX, Recorded, doubled, legs, pauses},
        tiers::in_milliseconds,
    },
    plant::{
        record::Record,
        sample::{Cause, Quality},
    },
};

/// A window of the alarm monitor, in microseconds.
const WINDOW: i64 = 600_000_000;

/// What this store records.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Recording {
    /// The time that was stored last; `None` before anything was.
    pub last: Option<Recorded>,
    /// The next record goes on with it, unless there is a pause.
    pub goes_on: bool,
}

impl Store {
    /// When a station stored anything last, by its clock then.
    pub(super) fn last_written(&self) -> Option<Timestamp> {
        self.recording.get().last.and_then(|last| instant(last.to))
    }

    /// When the station ended that stored last: then, if it wrote so, else a second later.
    pub(super) fn ended(&self) -> duckdb::Result<Option<Timestamp>> {
        let Some(last) = self.last_written() else { return Ok(None) };
        let params = params![utc(last), Quality::Bad(Cause::StationOff).code()];
        let is_marked: bool = self.db.query_row(sql::IS_MARKED_OFF, params, |row| row.get(0))?;
        Ok(if is_marked { Some(last) } else { after(last) })
    }

    /// What was stored last, from the database.
    pub(super) fn read_recording(&self) -> duckdb::Result<()> {
        let mut statement = self.db.prepare(sql::LAST_RECORDED)?;
        let last = statement.query_map([], recorded)?.next().transpose()?;
        self.recording.set(Recording { last, goes_on: true });
        Ok(())
    }

    /// Enters the times of what is stored, within its transaction; returns what then is recorded.
    pub(super) fn enter_recorded(&self, all: &[Recorded]) -> duckdb::Result<Recording> {
        let Recording { mut last, mut goes_on } = self.recording.get();
        for next in all {
            let wider = last.filter(|_| goes_on).and_then(|last| last.widened(*next));
            match (wider, last) {
                (Some(wide), Some(before)) if wide != before => {
                    let params = params![micros(wide.from), micros(wide.to), before.epoch, micros(before.from)];
                    self.db.prepare_cached(sql::WIDEN_RECORDED)?.execute(params)?;
                }
                (Some(_), _) => {}
                (None, _) => {
                    self.db.execute(sql::ENTER_RECORDED, params![next.epoch, micros(next.from), micros(next.to)])?;
                }
            }
            // What comes late, from before a pause, is not what was stored last.
            let is_late = wider.is_none() && last.is_some_and(|last| last.epoch == next.epoch && next.to < last.from);
            last = if is_late { last } else { wider.or(Some(*next)) };
            goes_on = true;
        }
        Ok(Recording { last, goes_on })
    }

    /// All times in which a station recorded.
    fn recorded_times(&self) -> Result<Vec<Recorded>, HistoryError> {
        self.list(sql::RECORDED, &[], recorded)
    }

    /// The times to which clocks came back.
    pub(super) fn doubled(&self) -> Result<Vec<Doubled>, HistoryError> {
        Ok(doubled(&self.recorded_times()?))
    }

    /// The legs of a span, in the order in which what they hold was stored.
    pub(super) fn legs(&self, from: Timestamp, to: Timestamp) -> Result<Vec<Leg>, HistoryError> {
        Ok(legs(&self.doubled()?, from.as_microsecond(), to.as_microsecond()))
    }

    /// How an epoch gave way to the next one.
    pub(super) fn over(&self, epoch: u16) -> Result<Option<Over>, HistoryError> {
        let all = self.recorded_times()?;
        let next = all.iter().filter(|of| of.epoch > Some(epoch)).min_by_key(|of| (of.epoch, of.from));
        let next = next.and_then(|next| Some((next.epoch?, instant(next.from)?)));
        let ended = all.iter().filter(|of| of.epoch == Some(epoch)).map(|of| of.to).max().unwrap_or(i64::MIN);
        Ok(next.map(|next| Over { ended: instant(ended).unwrap_or(Timestamp::MIN), next }))
    }

    /// When no station recorded, and whether its clock only was set. The latest records of one that runs are on their way.
    pub(super) fn pauses(
        &self,
        from: Timestamp,
        to: Timestamp,
    ) -> Result<Vec<(Timestamp, Timestamp, bool)>, HistoryError> {
        let mut all = self.recorded_times()?;
        let last = all.iter_mut().filter(|recorded| recorded.epoch.is_some()).max_by_key(|of| (of.epoch, of.to));
        if let Some(last) = last {
            last.to = self.ended.map_or(last.to.saturating_add(PAUSE_MAX), |ended| ended.as_microsecond().max(last.to));
        }
        let pauses = pauses(&all, from.as_microsecond()..to.as_microsecond()).into_iter();
        Ok(pauses.filter_map(|of| Some((instant(of.span.start)?, instant(of.span.end)?, of.is_of_clock))).collect())
    }

    /// The latest times in which no station recorded since the first one did.
    pub(super) fn pauses_in_all(&self, now: Timestamp) -> Result<Vec<(Timestamp, Timestamp)>, HistoryError> {
        let first = self.recorded_times()?.iter().map(|recorded| recorded.from).min().and_then(instant);
        let Some(first) = first.filter(|first| *first < now) else { return Ok(Vec::new()) };
        let off = self.pauses(first, now)?.into_iter().filter(|(.., is_of_clock)| !is_of_clock);
        let mut pauses: Vec<_> = off.map(|(from, to, _)| (from, to)).collect();
        pauses.drain(..pauses.len().saturating_sub(PAUSES_MAX));
        Ok(pauses)
    }

    /// The windows of ten minutes in which a station recorded, by their number since 1970.
    pub(super) fn watched(&self, from: Timestamp, to: Timestamp) -> Result<BTreeSet<i64>, HistoryError> {
        let (from, to) = (from.as_microsecond(), to.as_microsecond() - 1);
        let recorded = self.recorded_times()?.into_iter().filter(|of| from <= of.to && of.from <= to);
        let windows = recorded.flat_map(|of| of.from.max(from).div_euclid(WINDOW)..=of.to.min(to).div_euclid(WINDOW));
        Ok(windows.collect())
    }
}

fn recorded(row: &duckdb::Row) -> duckdb::Result<Recorded> {
    Ok(Recorded { epoch: row.get(0)?, from: row.get(1)?, to: row.get(2)? })
}

fn micros(at: i64) -> duckdb::types::Value {
    duckdb::types::Value::Timestamp(duckdb::types::TimeUnit::Microsecond, at)
}

/// When a station recorded something, as far as it tells that a station ran.
pub(super) fn recorded_at(record: &Record) -> Option<i64> {
    match record {
        Record::Sample(_, sample) => Some(in_milliseconds(sample.at).as_microsecond()),
        Record::Alarm(alarm) => Some(alarm.at.as_microsecond()),
        // It ends then.
        Record::Line(minute) => Some(minute.at.as_microsecond() - 1),
        Record::Batch(batch) => Some(batch.at.as_microsecond()),
        Record::Action(_) | Record::Run(_) | Record::Report(_) | Record::ClockSet => None,
    }
}
