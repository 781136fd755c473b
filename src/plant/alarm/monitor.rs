//! The alarm monitor: a fold over the events of alarms that counts them for the last 24 hours, or for any past period.
//!
//! One fold for both, so that what the screen shows now is what the report says tomorrow. Memory is bounded: counts per
//! second of the last hour, at most 24 sums, and a few times for each alarm.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;

use super::{
    metrics::{AlarmMetrics, Frequent, Named, PeriodMetrics, TOP, place},
    rate::Rate,
};
use crate::plant::record::{AlarmEvent, AlarmRecord};
use crate::plant::time::elapsed;

/// Width of a window, seconds: windows begin at its multiples since 1970 UTC.
const WINDOW_S: i64 = 600;
/// A window with more activations than this counts as above.
const WINDOW_MAX: u64 = 10;
const HOUR_S: i64 = 3_600;
/// Hours of the running figures, the running one included.
const HOURS: i64 = 24;
/// Chattering: this many activations within this time. ISA-18.2 names three in a minute as the usual test.
const CHATTER: usize = 3;
const CHATTER_TIME: Duration = Duration::from_secs(60);
/// Fleeting: active for a short time without repeating (ISA-18.2, terms). The standard gives no number; ten seconds
/// without an acknowledgement is less than anybody needs to read an alarm.
const FLEETING: Duration = Duration::from_secs(10);
/// Stale: active for longer (ISA-18.2).
const STALE_S: i64 = 86_400;
/// Events so long before a period are read too: a flood may be under way when it begins.
pub const LEAD: Duration = Duration::from_secs(86_400);
/// How far back a monitor that starts again reads the journal: the hours of the running figures.
pub const RUNNING: Duration = Duration::from_secs((HOURS * HOUR_S) as u64);
/// The running figures are computed again after this many seconds.
const REFRESH_S: i64 = 10;

/// Counts activations. Steps come in order of time.
#[derive(Debug, Clone)]
pub struct AlarmMonitor {
    span: Counted,
    rate: Rate,
    alarms: BTreeMap<Named, AlarmHistory>,
    /// By the second in which they begin, oldest first: the only one of a period, or one an hour.
    sums: VecDeque<(i64, Sum)>,
    /// Times (from, until), in seconds, in which an alarm was stale that is not any more.
    stale: Vec<(i64, i64)>,
    /// The numbers of the windows in which a station ran.
    watched: BTreeSet<i64>,
    /// The latest figures of the running day.
    day: Arc<PeriodMetrics>,
}

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Counted {
    /// The running hour and those before it.
    Running,
    /// What lies in a period.
    Period { from: Timestamp, until: Timestamp },
}

/// What is remembered of an alarm.
#[derive(Debug, Clone, Default)]
struct AlarmHistory {
    /// Since when it is active.
    active: Option<Timestamp>,
    acknowledged: bool,
    /// The latest activations, newest last; at most [`CHATTER`].
    raised: VecDeque<Timestamp>,
}

/// The counts of a span.
#[derive(Debug, Clone, Default)]
struct Sum {
    by_priority: [u64; 4],
    suppressed: u64,
    windows_over: u64,
    most: u64,
    /// The latest window with an activation (its number), and how many it has.
    window: (i64, u64),
    flood_s: u64,
    raised: BTreeMap<Named, u64>,
    chattering: BTreeSet<Named>,
    fleeting: BTreeSet<Named>,
}

impl AlarmMonitor {
    /// Counts from now on, for as long as the plant runs.
    pub fn running(at: Timestamp) -> AlarmMonitor {
        AlarmMonitor::new(Counted::Running, second(at))
    }

    /// Counts what lies from `from` until before `until`. It is fed from `LEAD` before `from` on.
    pub fn of_period(from: Timestamp, until: Timestamp) -> AlarmMonitor {
        let start = second(from) - LEAD.as_secs() as i64;
        let mut monitor = AlarmMonitor::new(Counted::Period { from, until }, start);
        monitor.sums.push_back((second(from), Sum::default()));
        monitor
    }

    fn new(span: Counted, start: i64) -> AlarmMonitor {
        AlarmMonitor {
            span,
            rate: Rate::new(start),
            alarms: BTreeMap::new(),
            sums: VecDeque::new(),
            stale: Vec::new(),
            watched: BTreeSet::new(),
            day: Arc::default(),
        }
    }

    /// A station ran in this window, by its number since 1970. A running monitor knows of those in which it runs itself.
    pub fn watched(&mut self, window: i64) {
        self.watched.insert(window);
    }

    /// Notes an alarm that was active before anything is counted.
    pub fn already(&mut self, event: &AlarmRecord) {
        let history = self.alarms.entry(named(event)).or_default();
        match event.event {
            AlarmEvent::Raised | AlarmEvent::CarriedOver => {
                (history.active, history.acknowledged) = (Some(event.at), false);
            }
            AlarmEvent::Acknowledged => history.acknowledged = true,
            ended if ended.ends_annunciation() => history.active = None,
            _ => {}
        }
    }

    /// Counts an event.
    pub fn on_event(&mut self, event: &AlarmRecord) {
        self.pass(event.at);
        match event.event {
            AlarmEvent::Raised => self.raised(event),
            AlarmEvent::Acknowledged => self.alarms.entry(named(event)).or_default().acknowledged = true,
            AlarmEvent::ReturnedToNormal => self.returned(event),
            // No activation: it is the same alarm under another name.
            AlarmEvent::CarriedOver => self.already(event),
            // A suppressed alarm burdens no operator: it is neither stale nor fleeting.
            ended if ended.ends_annunciation() => {
                self.alarms.entry(named(event)).or_default().acknowledged = true;
                self.returned(event);
            }
            AlarmEvent::RaisedSuppressed => {
                if let Some(sum) = self.sum(event.at) {
                    sum.suppressed += 1;
                }
            }
            _ => {}
        }
    }

    /// Time passes. The figures of the day are formed here, between two seconds, so that they hold every event before
    /// their end and none after it: events of the new second are taken afterwards.
    pub fn advance(&mut self, at: Timestamp) {
        self.pass(at);
        let now = self.rate.now;
        let fresh = (0..REFRESH_S).contains(&(now - second(self.day.until)));
        if self.span == Counted::Running && !(fresh && self.day.windows > 0) {
            let from = now.div_euclid(HOUR_S) * HOUR_S - (HOURS - 1) * HOUR_S;
            if let (Ok(from), Ok(until)) = (Timestamp::from_second(from), Timestamp::from_second(now)) {
                self.day = Arc::new(self.figures_of(from, until));
            }
        }
    }

    fn pass(&mut self, at: Timestamp) {
        for flooded in self.rate.advance(second(at)) {
            self.flooded(flooded);
        }
        if self.span == Counted::Running {
            self.watched.insert(self.rate.now.div_euclid(WINDOW_S));
            self.forget();
        }
    }

    /// The alarm system as of the last event; the figures of the day as of some seconds ago.
    pub fn metrics(&self) -> AlarmMetrics {
        AlarmMetrics {
            last_10_min: self.rate.in_window,
            last_hour: self.rate.in_hour,
            flood_since: self.rate.flood_since().and_then(|since| Timestamp::from_second(since).ok()),
            day: self.day.clone(),
        }
    }

    /// The figures of the period, once every event of it has been taken.
    pub fn figures(mut self) -> PeriodMetrics {
        match self.span {
            Counted::Period { from, until } => {
                self.advance(until);
                self.figures_of(from, until)
            }
            Counted::Running => Arc::unwrap_or_clone(self.day),
        }
    }

    fn raised(&mut self, event: &AlarmRecord) {
        self.rate.raised();
        let name = named(event);
        self.end(&name, event.at);
        let history = self.alarms.entry(name.clone()).or_default();
        (history.active, history.acknowledged) = (Some(event.at), false);
        history.raised.push_back(event.at);
        if history.raised.len() > CHATTER {
            history.raised.pop_front();
        }
        let spread = history.raised.front().map(|first| elapsed(*first, event.at)).unwrap_or_default();
        let chatters = history.raised.len() == CHATTER && spread < CHATTER_TIME;
        let window = second(event.at).div_euclid(WINDOW_S);
        let Some(sum) = self.sum(event.at) else { return };
        sum.by_priority[place(event.priority)] += 1;
        sum.window = if sum.window.0 == window { (window, sum.window.1 + 1) } else { (window, 1) };
        sum.most = sum.most.max(sum.window.1);
        sum.windows_over += u64::from(sum.window.1 == WINDOW_MAX + 1);
        if chatters {
            sum.chattering.insert(name.clone());
        }
        *sum.raised.entry(name).or_default() += 1;
    }

    fn returned(&mut self, event: &AlarmRecord) {
        let name = named(event);
        let history = self.alarms.entry(name.clone()).or_default();
        let fleeting = history.active.is_some_and(|since| elapsed(since, event.at) < FLEETING) && !history.acknowledged;
        self.end(&name, event.at);
        if let Some(sum) = self.sum(event.at).filter(|_| fleeting) {
            sum.fleeting.insert(name);
        }
    }

    /// Ends the activation of an alarm, if there is one.
    fn end(&mut self, name: &Named, at: Timestamp) {
        let active = self.alarms.get_mut(name).and_then(|history| history.active.take());
        let stale = active.map(|since| second(since) + STALE_S).filter(|stale| *stale < second(at));
        self.stale.extend(stale.map(|from| (from, second(at))));
    }

    /// The sum that an instant belongs to; `None` outside the period.
    fn sum(&mut self, at: Timestamp) -> Option<&mut Sum> {
        match self.span {
            Counted::Period { from, until } => {
                let inside = from <= at && at < until;
                self.sums.back_mut().map(|(_, sum)| sum).filter(|_| inside)
            }
            Counted::Running => Some(self.hour(second(at))),
        }
    }

    /// The sum of the hour of a second. A clock that went back counts into the latest.
    fn hour(&mut self, second: i64) -> &mut Sum {
        let hour = second.div_euclid(HOUR_S) * HOUR_S;
        if self.sums.back().is_none_or(|(last, _)| *last < hour) {
            self.sums.push_back((hour, Sum::default()));
        }
        &mut self.sums.back_mut().expect("one was pushed if there was none").1
    }

    /// Counts a span of seconds (from, until) in which there was a flood.
    fn flooded(&mut self, (from, until): (i64, i64)) {
        match self.span {
            Counted::Period { from: first, until: end } => {
                let inside = until.min(second(end)) - from.max(second(first));
                if let Some((_, sum)) = self.sums.back_mut() {
                    sum.flood_s += u64::try_from(inside).unwrap_or(0);
                }
            }
            Counted::Running => {
                let mut from = from;
                while from < until {
                    let next = until.min((from.div_euclid(HOUR_S) + 1) * HOUR_S);
                    self.hour(from).flood_s += u64::try_from(next - from).unwrap_or(0);
                    from = next;
                }
            }
        }
    }

    /// Drops what is older than the running figures.
    fn forget(&mut self) {
        let first = (self.rate.now.div_euclid(HOUR_S) - (HOURS - 1)) * HOUR_S;
        // Nearly always none goes, and then nothing is looked through.
        while self.watched.first().is_some_and(|window| (window + 1) * WINDOW_S <= first) {
            self.watched.pop_first();
        }
        while self.sums.front().is_some_and(|(hour, _)| *hour < first) {
            self.sums.pop_front();
            self.stale.retain(|(_, until)| first < *until);
            // Nothing is lost with an alarm that has not come for an hour: it counts from 1 again.
            let recent = |at: &Timestamp| self.rate.now - HOUR_S < second(*at);
            self.alarms.retain(|_, history| history.active.is_some() || history.raised.back().is_some_and(recent));
        }
    }

    fn figures_of(&self, from: Timestamp, until: Timestamp) -> PeriodMetrics {
        let mut all = Sum::default();
        self.sums.iter().for_each(|(_, sum)| all.add(sum));
        let (first, last) = (second(from), second(until));
        let (windows, watched) = self.watched_in(from, until);
        let now_stale = self.alarms.values().filter_map(|history| history.active);
        let now_stale = now_stale.map(|since| (second(since) + STALE_S, last));
        let stale = self.stale.iter().copied().chain(now_stale);
        let stale = stale.map(|(a, b)| (a.max(first), b.min(last))).filter(|(a, b)| a < b).collect();
        PeriodMetrics {
            from,
            until,
            by_priority: all.by_priority,
            windows,
            watched,
            windows_over: all.windows_over,
            most: all.most,
            flood: Duration::from_secs(all.flood_s),
            top: top(all.raised),
            chattering: all.chattering.into_iter().collect(),
            fleeting: all.fleeting.into_iter().collect(),
            stale: most_at_once(stale),
            suppressed: all.suppressed,
        }
    }

    /// The windows of a span in which a station ran, and the time of the span that lies in them.
    fn watched_in(&self, from: Timestamp, until: Timestamp) -> (u64, Duration) {
        let (from, until, width) = (from.as_microsecond(), until.as_microsecond(), WINDOW_S * 1_000_000);
        let inside = |window: &i64| ((window + 1) * width).min(until) - (window * width).max(from);
        let spans = self.watched.iter().map(inside).filter(|span| 0 < *span);
        let (windows, micros) = spans.fold((0, 0), |(windows, all), span| (windows + 1, all + span));
        (windows, Duration::from_micros(u64::try_from(micros).unwrap_or(0)))
    }
}

impl Sum {
    fn add(&mut self, other: &Sum) {
        for (all, more) in self.by_priority.iter_mut().zip(other.by_priority) {
            *all += more;
        }
        self.suppressed += other.suppressed;
        self.windows_over += other.windows_over;
        self.most = self.most.max(other.most);
        self.flood_s += other.flood_s;
        for (name, raised) in &other.raised {
            *self.raised.entry(name.clone()).or_default() += raised;
        }
        self.chattering.extend(other.chattering.iter().cloned());
        self.fleeting.extend(other.fleeting.iter().cloned());
    }
}

/// The most frequent first; equally frequent ones by name.
fn top(raised: BTreeMap<Named, u64>) -> Vec<Frequent> {
    let mut list: Vec<_> = raised.into_iter().map(|(alarm, raised)| Frequent { alarm, raised }).collect();
    list.sort_by_key(|alarm| std::cmp::Reverse(alarm.raised));
    list.truncate(TOP);
    list
}

/// The most spans that hold one instant.
fn most_at_once(spans: Vec<(i64, i64)>) -> u64 {
    // An end comes before a beginning of the same second: the one has gone when the other comes.
    let mut edges: Vec<(i64, i64)> = spans.into_iter().flat_map(|(from, until)| [(from, 1), (until, -1)]).collect();
    edges.sort_unstable();
    let mut now = 0;
    let most = edges.into_iter().map(|(_, event)| {
        now += event;
        now
    });
    most.max().map_or(0, |most| u64::try_from(most).unwrap_or(0))
}

fn named(event: &AlarmRecord) -> Named {
    Named { subject: event.subject.clone(), message: event.message.clone() }
}

fn second(at: Timestamp) -> i64 {
    at.as_microsecond().div_euclid(1_000_000)
}

#[cfg(test)]
mod tests;
