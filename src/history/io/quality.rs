//! How good the alarm system was: the journal, day by day, through the meter that also measures the running plant.

use std::time::Duration;

use duckdb::params;
use jiff::Timestamp;

use super::{
    read::{ROWS_MAX, alarm, check_span, within},
    samples::is_damage,
    sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::HistoryError,
    plant::{
        alarm::{
            Figures, Meter,
            meter::{LEAD, RUNNING},
        },
        record::AlarmRecord,
    },
};

/// The journal in memory at a time.
const CHUNK: Duration = Duration::from_secs(86_400);
/// Steps of alarms behind the figures of one answer: years of a plant that is run well.
const STEPS_MAX: u64 = 2_000_000;

/// What the meter of a plant that starts again must know.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recent {
    /// The raising steps of the alarms that were active before the last day.
    pub active: Vec<AlarmRecord>,
    /// The steps of the last day, oldest first.
    pub steps: Vec<AlarmRecord>,
    /// The windows of the last day in which a station ran, see [`Meter::watched`].
    pub watched: Vec<i64>,
}

impl Store {
    /// The figures of the alarm system from `from` to `to`, or to `now` if that is earlier. The journal is read a day at
    /// a time, so that months of it need no more memory than a day.
    pub fn alarm_quality(&self, from: Timestamp, to: Timestamp, now: Timestamp) -> Result<Figures, HistoryError> {
        let until = to.min(now);
        check_span(from, until)?;
        let known = from.checked_sub(LEAD).unwrap_or(Timestamp::MIN);
        let mut meter = Meter::of_period(from, until);
        self.standing_at(known)?.iter().for_each(|step| meter.already(step));
        let watched = match self.watched(from, until) {
            Err(error) if is_damage(&error) => {
                let span = params![utc(from), utc(until), ROWS_MAX + 1];
                self.whole_list(sql::WATCHED_BY_LINES, span, |row| row.get(0))?
            }
            watched => watched?,
        };
        watched.into_iter().for_each(|window| meter.watched(window));
        let journaled = |row: &duckdb::Row| Ok((row.get(0)?, row.get(1)?));
        let (first, last): (Option<i64>, Option<i64>) =
            self.db.query_row(sql::JOURNALED, [], journaled).map_err(engine)?;
        // Only days that have rows are asked for.
        let (first, last) = (first.and_then(instant).unwrap_or(until), last.map(|last| last + 1).and_then(instant));
        let (mut next, mut rows) = (known.max(first), 0);
        let end = until.min(last.unwrap_or(known));
        while next < end {
            let to = next.checked_add(CHUNK).unwrap_or(end).min(end);
            let steps = self.steps(next, to)?;
            rows += steps.len() as u64;
            within(rows, STEPS_MAX)?;
            steps.iter().for_each(|step| meter.take(step));
            next = to;
        }
        Ok(meter.figures())
    }

    /// What the meter of a plant that starts `now` must know of the time before.
    pub fn recent(&self, now: Timestamp) -> Result<Recent, HistoryError> {
        let since = now.checked_sub(RUNNING).unwrap_or(Timestamp::MIN);
        if now <= since {
            return Ok(Recent::default());
        }
        let (active, steps) = (self.standing_at(since)?, self.steps(since, now)?);
        Ok(Recent { active, steps, watched: self.watched(since, now)? })
    }

    /// The windows in which anything was stored.
    fn watched(&self, from: Timestamp, to: Timestamp) -> Result<Vec<i64>, HistoryError> {
        self.whole_list(sql::WATCHED, params![utc(from), utc(to), ROWS_MAX + 1], |row| row.get(0))
    }

    /// The raising steps of the alarms that were active at an instant and not put aside: what is aside is not stale.
    pub(super) fn standing_at(&self, at: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::standing_at(), params![utc(at), ROWS_MAX + 1], alarm)
    }

    /// The raising steps of the alarms that were active at an instant, also of those that were put aside.
    pub(super) fn active_at(&self, at: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::active_at(), params![utc(at), ROWS_MAX + 1], alarm)
    }

    /// The steps of alarms in a span, oldest first.
    pub(super) fn steps(&self, from: Timestamp, to: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::journal_oldest(), params![utc(from), utc(to), ROWS_MAX + 1], alarm)
    }
}
