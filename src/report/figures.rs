//! The figures of a period: from stored samples and alarm events to the rows of a report.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    time::Duration,
};

use jiff::{Timestamp, ToSpan, tz::TimeZone};

use super::{
    DECIMALS_UNKNOWN, Outage, RecordRow, RunFigures, SuppressedSummary, TagFigures,
    step_series::{IntervalStats, good_exact},
};
use crate::plant::{
    alarm::manager::subject_name,
    counter,
    def::{Condition, PlantDef, TagId},
    exact::Exact,
    record::{AlarmEvent, AlarmRecord},
    sample::{Cause, Quality, Sample},
    tag::{Decimals, TagDef},
    time::elapsed,
};

/// What a tag is called in a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TagDescription {
    /// `TIC-1.PV`.
    pub tag: String,
    /// `°C`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// Whether it is a counter.
    pub counts: bool,
}

impl TagDescription {
    /// Name, unit and decimals of a tag, where the device may have chosen the last two: `latest` has the latest good values
    /// of the tags that hold them.
    pub fn new(def: &TagDef, latest: &HashMap<TagId, f64>) -> TagDescription {
        let decimals = match def.decimals {
            Decimals::Fixed(decimals) => decimals,
            Decimals::From(tag) | Decimals::PowerFrom(tag) => {
                let scaling = latest.get(&tag).and_then(|value| def.decimals.announced(*value));
                scaling.map_or(DECIMALS_UNKNOWN, Decimals::shown)
            }
        };
        let unit = def.unit_by(|tag| latest.get(&tag).copied()).unwrap_or(&def.unit).to_owned();
        let counts = counter::counts_in(def, &unit);
        TagDescription { tag: def.name.clone(), unit, decimals, counts }
    }
}

/// The tags that hold decimals and unit of a tag.
pub fn scaling_tags(def: &TagDef) -> impl Iterator<Item = TagId> + use<> {
    def.decimals.source().into_iter().chain(def.unit_from.as_ref().map(|(tag, _)| *tag))
}

/// Computes the figures of one tag over a period, from stretches of good values in order of time.
#[derive(Debug, Clone, Copy)]
pub struct Figures {
    seconds: f64,
    first: Option<Exact>,
    stats: Option<IntervalStats>,
}

impl Figures {
    /// Over this many seconds; nothing has come yet.
    pub fn new(seconds: f64) -> Figures {
        Figures { seconds, first: None, stats: None }
    }

    /// The next stretch, by its first value and its figures.
    pub fn add(&mut self, first: Exact, stats: IntervalStats) {
        self.first.get_or_insert(first);
        IntervalStats::add(&mut self.stats, stats);
    }

    /// How long the tag, 0 or 1, was on, and how often it was switched on.
    pub fn runs(self, tag: String, starts: Exact) -> RunFigures {
        let two_states = self.stats.filter(|stats| 0.0 <= stats.min.near() && stats.max.near() <= 1.0);
        RunFigures {
            tag,
            on: two_states.map(|stats| Duration::from_secs_f64((stats.mean * stats.seconds).max(0.0))),
            starts: two_states.map(|_| starts.near()),
            good: self.stats.map_or(0.0, |stats| (stats.seconds / self.seconds).clamp(0.0, 1.0)),
        }
    }

    /// The figures, when the last stretch has come, with what a counter counted.
    pub fn end(self, label: TagDescription, counted: Exact, in_alarm: Duration) -> TagFigures {
        let Figures { seconds, first, stats } = self;
        let (mean, difference) = match label.counts {
            true => (None, stats.map(|_| counted)),
            false => (stats.map(|stats| stats.shown_mean()), None),
        };
        TagFigures {
            tag: label.tag,
            unit: label.unit,
            decimals: label.decimals,
            first,
            min: stats.map(|stats| stats.min),
            mean,
            difference,
            max: stats.map(|stats| stats.max),
            last: stats.map(|stats| stats.last),
            in_alarm,
            good: stats.map_or(0.0, |stats| (stats.seconds / seconds).clamp(0.0, 1.0)),
        }
    }
}

/// The events of alarms in a part of a period in which no clock was set back.
#[derive(Debug, Clone, PartialEq)]
pub struct EventLeg {
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub until: Timestamp,
    /// The raising events of the alarms that were active at its begin.
    pub active: Vec<AlarmRecord>,
    /// The events that suppressed any alarm then.
    pub suppressing: Vec<AlarmRecord>,
    /// The events in it, in order.
    pub events: Vec<AlarmRecord>,
    /// What of it never was: a clock was set forward over it.
    pub skipped: Vec<(Timestamp, Timestamp)>,
}

impl EventLeg {
    /// The raising events, and those in it.
    pub fn all(&self) -> impl Iterator<Item = &AlarmRecord> {
        self.active.iter().chain(&self.events)
    }
}

/// How long an alarm of each subject was active.
pub fn times_in_alarm(legs: &[EventLeg]) -> HashMap<&str, Duration> {
    let mut times: HashMap<&str, Duration> = HashMap::new();
    for leg in legs {
        let mut by_subject: HashMap<&str, Vec<&AlarmRecord>> = HashMap::new();
        leg.all().for_each(|event| by_subject.entry(&event.subject).or_default().push(event));
        for (subject, events) in by_subject {
            *times.entry(subject).or_default() +=
                time_in_alarm(events.into_iter(), (leg.from, leg.until), &leg.skipped);
        }
    }
    times
}

/// The alarms that were active while they were not annunciated, of all parts of a period.
pub fn suppressed_in(legs: &[EventLeg]) -> Vec<SuppressedSummary> {
    let mut all: Vec<SuppressedSummary> = Vec::new();
    for EventLeg { from, until, active, suppressing, events, .. } in legs {
        for found in suppressed(active, suppressing, events, *from, *until) {
            let is_same =
                |other: &&mut SuppressedSummary| (&other.subject, &other.message) == (&found.subject, &found.message);
            match all.iter_mut().find(is_same) {
                Some(same) => (same.raised, same.active) = (same.raised + found.raised, same.active + found.active),
                None => all.push(found),
            }
        }
    }
    all.sort_by(|one, other| (&one.subject, &one.message).cmp(&(&other.subject, &other.message)));
    all
}

/// Since when a tag has had no value because its device did not answer, by its samples in order; and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Trace(Option<(Timestamp, Cause)>);

impl Trace {
    /// The next sample.
    pub fn next(&mut self, sample: Sample) {
        self.0 = match (sample.quality, self.0) {
            // Requests fail before a device counts as silent.
            (Quality::Bad(cause), since) if cause.is_of_connection() => {
                let telling = since.map(|(_, cause)| cause).filter(|cause| *cause == Cause::NotConnected);
                Some((since.map_or(sample.at, |(since, _)| since), telling.unwrap_or(cause)))
            }
            (Quality::Good | Quality::Uncertain(_) | Quality::Bad(_), _) => None,
        };
    }
}

impl Outage {
    /// As its tags show it: from when on none of them has had a value, not before an instant; and whether the line was lost.
    pub fn traced(self, traces: &[Trace], not_before: Timestamp) -> Outage {
        let known: Option<Vec<(Timestamp, Cause)>> = traces.iter().map(|trace| trace.0).collect();
        let Some((since, cause)) = known.into_iter().flatten().max_by_key(|(since, _)| *since) else { return self };
        let why = if cause == Cause::NotConnected { cause.word().to_owned() } else { self.why };
        Outage { from: since.max(not_before).min(self.from), why, ..self }
    }
}

/// Why there are no values of a station.
pub const NOT_RUNNING: &str = "not running";
/// The same, where it ran, but its clock was set over a time.
pub const CLOCK_SET_FORWARD: &str = "clock set forward";

/// The times in which alarms say that a device does not answer, in order of their begins. `events` begin with those of the alarms that
/// were active at `from`; what has not ended lasts until `until`.
pub fn not_responding<'a>(
    def: &PlantDef,
    events: impl Iterator<Item = &'a AlarmRecord>,
    from: Timestamp,
    until: Timestamp,
) -> Vec<Outage> {
    let of_devices = def.alarms.iter().filter(|alarm| alarm.condition == Condition::NotResponding);
    let known: HashMap<(&str, &str), Duration> =
        of_devices.map(|alarm| ((subject_name(def, alarm.subject), alarm.message.as_str()), alarm.on_delay)).collect();
    let mut open: BTreeMap<(&str, &str), Timestamp> = BTreeMap::new();
    let mut outages = Vec::new();
    let outage = |(what, why): (&str, &str), begun: Timestamp, ended: Timestamp| Outage {
        from: begun,
        to: ended,
        what: Some(what.to_owned()),
        why: why.to_owned(),
    };
    for event in events {
        let Some((&name, _)) = known.get_key_value(&(&*event.subject, &*event.message)) else { continue };
        match event.event.active() {
            Some(true) => {
                let begun = event.at.checked_sub(known[&name]).unwrap_or(event.at);
                open.entry(name).or_insert(begun.max(from));
            }
            Some(false) => outages.extend(open.remove(&name).map(|begun| outage(name, begun, event.at))),
            None => {}
        }
    }
    outages.extend(open.into_iter().map(|(name, begun)| outage(name, begun, until)));
    outages.retain(|outage| outage.from < outage.to);
    outages
}

/// Time within `from..until` in which at least one alarm of a subject was active. The events are all of this subject, in
/// order, and begin with those of the alarms that were active at `from`; an alarm still active at the end counts to the end.
/// Nothing counts that lies in the `skipped` spans.
pub fn time_in_alarm<'a>(
    events: impl Iterator<Item = &'a AlarmRecord>,
    (from, until): (Timestamp, Timestamp),
    skipped: &[(Timestamp, Timestamp)],
) -> Duration {
    let lasted = |from: Timestamp, to: Timestamp| {
        let within = skipped.iter().map(|(begin, end)| elapsed(from.max(*begin), to.min(*end)));
        elapsed(from, to).saturating_sub(within.sum())
    };
    let mut active: HashSet<&str> = HashSet::new();
    let mut since = from;
    let mut total = Duration::ZERO;
    for event in events.filter(|event| event.at < until) {
        let at = event.at.max(since);
        if !active.is_empty() {
            total += lasted(since, at);
        }
        since = at;
        match event.event.active() {
            Some(true) => drop(active.insert(&event.message)),
            Some(false) => drop(active.remove(&*event.message)),
            None => {}
        }
    }
    if !active.is_empty() {
        total += lasted(since, until);
    }
    total
}

/// The rows of the thesis's record, from what stood at each of its instants.
pub fn record(instants: &[Timestamp], sv: &[Option<Sample>], pv: &[Option<Sample>]) -> Vec<RecordRow> {
    let good = |sample: &Option<Sample>| sample.and_then(good_exact);
    let row = |((at, sv), pv): ((&Timestamp, &Option<Sample>), &Option<Sample>)| {
        let (sv, pv) = (good(sv), good(pv));
        RecordRow { at: *at, sv, pv, er: sv.zip(pv).map(|(sv, pv)| sv - pv) }
    };
    instants.iter().zip(sv).zip(pv).map(row).collect()
}

/// The alarms that were active over `from..until` while they were not annunciated. `active` are the raising events of those
/// active at `from`, `suppressing` the events that suppressed any alarm then; `events` are those of the period, in order.
pub fn suppressed(
    active: &[AlarmRecord],
    suppressing: &[AlarmRecord],
    events: &[AlarmRecord],
    from: Timestamp,
    until: Timestamp,
) -> Vec<SuppressedSummary> {
    let mut alarms: BTreeMap<(&str, &str), SuppressionTracker> = BTreeMap::new();
    for event in active.iter().chain(suppressing) {
        let alarm = alarms.entry((&event.subject, &event.message)).or_insert_with(|| SuppressionTracker::new(event));
        alarm.on_event(event.event, from);
    }
    for event in events {
        let alarm = alarms.entry((&event.subject, &event.message)).or_insert_with(|| SuppressionTracker::new(event));
        alarm.on_event(event.event, event.at);
        alarm.found.raised += u64::from(event.event == AlarmEvent::RaisedSuppressed);
    }
    let ended = alarms.into_values().map(|mut alarm| {
        alarm.count(until);
        alarm.found
    });
    ended.filter(|found| found.raised > 0 || !found.active.is_zero()).collect()
}

/// Follows an alarm through a period.
struct SuppressionTracker {
    active: bool,
    /// The latest activation was not annunciated, whatever suppressed it.
    raised_suppressed: bool,
    /// What suppresses it, each for itself: the one ends while the other lasts.
    suppressed_by: Vec<AlarmEvent>,
    since: Timestamp,
    found: SuppressedSummary,
}

impl SuppressionTracker {
    fn new(event: &AlarmRecord) -> SuppressionTracker {
        let (subject, message) = (event.subject.clone(), event.message.clone());
        let found = SuppressedSummary { subject, message, priority: event.priority, raised: 0, active: Duration::ZERO };
        let (active, raised_suppressed, suppressed_by) = (false, false, Vec::new());
        SuppressionTracker { active, raised_suppressed, suppressed_by, since: event.at, found }
    }

    fn on_event(&mut self, event: AlarmEvent, at: Timestamp) {
        self.count(at);
        self.active = event.active().unwrap_or(self.active);
        match event {
            AlarmEvent::Raised | AlarmEvent::CarriedOver | AlarmEvent::Removed => {
                (self.raised_suppressed, self.suppressed_by) = (false, Vec::new());
            }
            AlarmEvent::RaisedSuppressed => self.raised_suppressed = true,
            AlarmEvent::Unshelved | AlarmEvent::Unsuppressed | AlarmEvent::InService => {
                self.suppressed_by.retain(|by| by.ended_by() != Some(event));
                self.raised_suppressed = false;
            }
            _ if event.ended_by().is_some() && !self.suppressed_by.contains(&event) => self.suppressed_by.push(event),
            _ => {}
        }
    }

    /// Counts what has passed since the last event.
    fn count(&mut self, at: Timestamp) {
        if self.active && (self.raised_suppressed || !self.suppressed_by.is_empty()) {
            self.found.active += elapsed(self.since, at);
        }
        self.since = at;
    }
}

/// The instants of the record over `from..until`: those whose local time of day is a multiple of `interval`.
pub fn record_grid(interval: Duration, zone: &TimeZone, from: Timestamp, until: Timestamp) -> Vec<Timestamp> {
    let after = |at: &Timestamp| on_grid(zone, interval, at.checked_add(1.microsecond()).ok()?);
    std::iter::successors(on_grid(zone, interval, from), after).take_while(|at| *at < until).collect()
}

/// The first instant not before `at` whose local time of day is a multiple of `interval`. The grid restarts at every
/// local midnight and follows the clocks over a change: an hour that happens twice has its rows twice.
fn on_grid(zone: &TimeZone, interval: Duration, at: Timestamp) -> Option<Timestamp> {
    const DAY: i64 = 86_400_000_000;
    let interval = i64::try_from(interval.as_micros()).ok().filter(|interval| *interval > 0)?;
    // Instants are whole microseconds in the history; what a period was typed or computed with may be finer.
    let micros = at.as_microsecond();
    let whole = Timestamp::from_microsecond(micros).ok()?;
    let mut at = if whole < at { Timestamp::from_microsecond(micros + 1).ok()? } else { whole };
    loop {
        let local = at.as_microsecond() + i64::from(zone.to_offset(at).seconds()) * 1_000_000;
        let of_day = local.rem_euclid(DAY);
        let past = of_day % interval;
        if past == 0 {
            return Some(at);
        }
        let candidate = at.checked_add((interval - past).min(DAY - of_day).microseconds()).ok()?;
        // A clock change on the way moves the grid: go on from there. Both branches move forward, so this ends.
        let change = zone.following(at).next().map(|change| change.timestamp());
        at = change.map_or(candidate, |change| change.min(candidate));
    }
}

#[cfg(test)]
mod tests;
