//! How good the alarm system was: the journal, day by day, through the monitor that also measures the running plant.

use std::{collections::HashSet, time::Duration};

use duckdb::params;
use jiff::Timestamp;

use super::{
    read::{ROWS_MAX, check_span, within},
    sql,
    store::{Store, engine, instant, utc},
    stored::Stored,
};
use crate::{
    history::{
        HistoryError,
        recorded::{Epochs, Leg},
    },
    plant::{
        alarm::{
            AlarmMonitor, PeriodMetrics,
            manager::name_of,
            monitor::{LEAD, RUNNING},
        },
        record::AlarmRecord,
    },
    report::figures::EventLeg,
};

/// The journal in memory at a time.
const CHUNK: Duration = Duration::from_secs(86_400);
/// Alarm events behind the figures of one answer: years of a plant that is run well.
const EVENTS_MAX: u64 = 2_000_000;

/// What the monitor of a plant that starts again must know.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recent {
    /// The raising events of the alarms that were active before the last day.
    pub active: Vec<AlarmRecord>,
    /// The events of the last day, oldest first.
    pub events: Vec<AlarmRecord>,
    /// The windows of the last day in which a station ran, see [`AlarmMonitor::watched`].
    pub watched: Vec<i64>,
}

impl Store {
    /// The figures of the alarm system from `from` to `to`, or to `now` if that is earlier. The journal is read a day at
    /// a time, so that months of it need no more memory than a day.
    pub fn alarm_metrics(&self, from: Timestamp, to: Timestamp, now: Timestamp) -> Result<PeriodMetrics, HistoryError> {
        let until = to.min(now);
        check_span(from, until)?;
        let known = from.checked_sub(LEAD).unwrap_or(Timestamp::MIN);
        let mut monitor = AlarmMonitor::of_period(from, until);
        self.standing_at(known)?.iter().for_each(|event| monitor.already(event));
        self.watched(from, until)?.into_iter().for_each(|window| monitor.watched(window));
        let journaled = |row: &duckdb::Row| Ok((row.get(0)?, row.get(1)?));
        let (first, last): (Option<i64>, Option<i64>) =
            self.db.query_row(sql::JOURNALED, [], journaled).map_err(engine)?;
        // Only days that have rows are asked for.
        let (first, last) = (first.and_then(instant).unwrap_or(until), last.map(|last| last + 1).and_then(instant));
        let (mut next, mut rows) = (known.max(first), 0);
        let end = until.min(last.unwrap_or(known));
        while next < end {
            let to = next.checked_add(CHUNK).unwrap_or(end).min(end);
            let events = self.events(next, to)?;
            rows += events.len() as u64;
            within(rows, EVENTS_MAX)?;
            events.iter().for_each(|event| monitor.on_event(event));
            next = to;
        }
        Ok(monitor.figures())
    }

    /// What the monitor of a plant that starts `now` must know of the time before.
    pub fn recent(&self, now: Timestamp) -> Result<Recent, HistoryError> {
        let since = now.checked_sub(RUNNING).unwrap_or(Timestamp::MIN);
        if now <= since {
            return Ok(Recent::default());
        }
        let (active, events) = (self.standing_at(since)?, self.events(since, now)?);
        Ok(Recent { active, events, watched: self.watched(since, now)?.into_iter().collect() })
    }

    /// The raising events of the alarms that were active at an instant and not suppressed: a suppressed alarm is not stale.
    pub(super) fn standing_at(&self, at: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        let standing = self.whole_list(
            &sql::standing_at(&Epochs::All.before()),
            params![utc(at), ROWS_MAX + 1],
            AlarmRecord::read,
        )?;
        self.without_lost(standing, &Epochs::All, at)
    }

    /// Without the alarms of which nothing is heard any more because a plant file took them away: earlier versions stored no
    /// end of them.
    fn without_lost(
        &self,
        mut raised: Vec<AlarmRecord>,
        epochs: &Epochs,
        at: Timestamp,
    ) -> Result<Vec<AlarmRecord>, HistoryError> {
        let known: HashSet<(&str, &str)> = self.def.alarms.iter().map(|alarm| name_of(&self.def, alarm)).collect();
        let is_known = |event: &AlarmRecord| known.contains(&(&*event.subject, &*event.message));
        if raised.iter().all(is_known) {
            return Ok(raised);
        }
        let named = |row: &duckdb::Row| Ok((row.get(0)?, row.get(1)?));
        let later: HashSet<(String, String)> = self
            .whole_list(&sql::named_since(&epochs.before()), params![utc(at), ROWS_MAX + 1], named)?
            .into_iter()
            .collect();
        raised
            .retain(|event| is_known(event) || later.contains(&(event.subject.to_string(), event.message.to_string())));
        Ok(raised)
    }

    /// The events of alarms in a span, in the order in which they were stored.
    pub(super) fn events(&self, from: Timestamp, to: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        Ok(self.event_legs(from, to)?.into_iter().flat_map(|leg| leg.events).collect())
    }

    /// The same with what was active before, in parts in order of time: several where the clock was set back.
    pub(super) fn event_legs(&self, from: Timestamp, to: Timestamp) -> Result<Vec<EventLeg>, HistoryError> {
        self.events_of(self.legs(from, to)?)
    }

    /// The same of some legs.
    pub(super) fn events_of(&self, legs: Vec<Leg>) -> Result<Vec<EventLeg>, HistoryError> {
        let mut all = Vec::new();
        for Leg { from, to, epochs, began, ended } in legs {
            let (Some(begin), Some(end)) = (instant(from), instant(to)) else { continue };
            let from = began.and_then(instant).map_or(begin, |began| began.max(begin));
            let until = ended.and_then(instant).map_or(end, |ended| ended.min(end));
            let before = |sql: &str| self.whole_list(sql, params![utc(from), ROWS_MAX + 1], AlarmRecord::read);
            let mut active = self.without_lost(before(&sql::active_at(&epochs.before()))?, &epochs, from)?;
            let mut suppressing = before(&sql::suppressing_at(&epochs.before()))?;
            // By another setting of the clock.
            active.iter_mut().chain(&mut suppressing).for_each(|event| event.at = event.at.min(from));
            let sql = sql::journal(&epochs.condition(), sql::OLDEST);
            let events = self.whole_list(&sql, params![utc(begin), utc(end), ROWS_MAX + 1], AlarmRecord::read)?;
            all.push(EventLeg { from, until, active, suppressing, events, skipped: Vec::new() });
        }
        let ends = all.iter().map(|leg| leg.from).min().zip(all.iter().map(|leg| leg.until).max());
        let pauses = ends.map_or(Ok(Vec::new()), |(from, until)| self.pauses(from, until))?;
        let of_clock = pauses.into_iter().filter(|(.., is_of_clock)| *is_of_clock);
        let skipped: Vec<_> = of_clock.map(|(begin, end, _)| (begin, end)).collect();
        all.iter_mut().for_each(|leg| leg.skipped.clone_from(&skipped));
        Ok(all)
    }
}
