//! What a counter counted: the one rule by which reports, batches, control runs and trends form the difference of a counter.
//!
//! ```text
//!   read      100  104   0  107       100  104   0   3        65531  2         100  104  900 903
//!   counted     0   +4   0   +3         0   +4   0  +3            0  +7          0   +4    0  +3
//!                     false reading          reset              rollover           replacement
//! ```
//!
//! A difference is never negative, and belongs to the time of the reading that showed it. A reading that plain counting does
//! not explain counts nothing; the next good ones tell what it was, and what it counted after all is counted then.

pub mod pace;
mod rule;
#[cfg(test)]
mod tests;

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use self::pace::Pace;
use super::{exact::Exact, keyword::keyword_enum, tag::TagDef, time::elapsed};

pub use rule::{CounterRule, Reading, ReadingSummary};

/// Units in which only counters of energy and charge count.
const COUNTED: [&str; 12] = ["Wh", "kWh", "MWh", "GWh", "varh", "kvarh", "Mvarh", "VAh", "kVAh", "MVAh", "Ah", "kAh"];
/// A reading that was not plain counting is decided after this time at the latest; one that comes back sooner was false.
pub const DECIDED_AFTER: Duration = Duration::from_secs(1_800);
/// A value may be older than it is known, and younger.
const SLACK: Duration = Duration::from_secs(300);
/// A counter has rolled over within this share of its range.
const ROLLS_WITHIN: f64 = 0.25;
/// While no hour is over, this many of its greatest steps are not too much to have rolled over.
const NO_HISTORY: f64 = 100.0;
/// Without any history, what a reset counter shows is at most this share of what it showed, or this many last digits.
const NEAR_ZERO: (f64, f64) = (0.01, 10.0);

keyword_enum! {
    /// What a step that is not plain counting was. The words are what the history and CSV hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
    pub enum CounterEvent: "counter event" {
        /// A reading that did not last: nothing is counted by it.
        FalseReading => "false reading",
        /// It went on at its lowest number: what is between is counted.
        Rollover => "rollover",
        /// It began again near zero: what it shows is counted.
        Reset => "reset",
        /// It goes on elsewhere, as another meter does: the step is not counted.
        Replaced => "replaced",
        /// Not decided yet: the step is not counted so far.
        Held => "not decided",
        /// A user corrected what is counted.
        Corrected => "corrected",
    }
}

/// Is a tag a counter, if that is its unit?
pub fn counts_in(tag: &TagDef, unit: &str) -> bool {
    tag.counter.unwrap_or_else(|| COUNTED.contains(&unit))
}

/// Is it a counter in any of the units that its device may choose?
pub fn may_count(tag: &TagDef) -> bool {
    let chosen = tag.unit_from.iter().flat_map(|(_, units)| units).map(|(_, unit)| unit.as_str());
    chosen.chain([tag.unit.as_str()]).any(|unit| counts_in(tag, unit))
}

/// A step that is not plain counting.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CounterStep {
    /// When it was read.
    pub at: Timestamp,
    /// What it was.
    pub event: CounterEvent,
    /// What the counter showed before.
    pub old: Exact,
    /// What it showed then.
    pub new: Exact,
    /// What is counted for the step itself.
    pub counted: Exact,
}

/// What the next reading adds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Counted {
    /// What was counted.
    pub gain: Exact,
    /// A step that is now known for what it was.
    pub step: Option<CounterStep>,
}

/// A reading that plain counting does not explain.
#[derive(Debug, Clone, Copy)]
struct Held {
    at: Timestamp,
    /// What it showed, and the most that it has shown since.
    shown: Exact,
    value: Exact,
    until: Timestamp,
}

/// What a counter showed before a step that was decided lately, and what was counted from there on.
#[derive(Debug, Clone, Copy)]
struct Left {
    held: Held,
    before: Reading,
    counted: Exact,
}

/// Follows one counter, reading by reading.
#[derive(Debug, Clone)]
pub struct Counter {
    rule: CounterRule,
    /// The most that it has shown since it last began again.
    last: Option<Reading>,
    held: Option<Held>,
    left: Option<Left>,
    pace: Pace,
}

impl Counter {
    /// Nothing was read yet.
    pub fn new(rule: CounterRule) -> Counter {
        Counter { rule, last: None, held: None, left: None, pace: Pace::default() }
    }

    /// Has anything been read?
    pub fn is_known(&self) -> bool {
        self.last.is_some()
    }

    /// What it showed is not what it goes on from: how fast it counts is still known.
    pub fn forget(&mut self) {
        (self.last, self.held, self.left) = (None, None, None);
    }

    /// What is not decided yet.
    pub fn held(&self) -> Option<CounterStep> {
        let (held, last) = (self.held?, self.last?);
        Some(step(CounterEvent::Held, &held, last.value, Exact::default()))
    }

    /// The next good reading, in order of time.
    pub fn read(&mut self, reading: Reading) -> Counted {
        self.pace.note(reading.at, reading.value.near());
        let Some(last) = self.last else {
            self.last = Some(reading);
            return Counted::default();
        };
        self.left = self.left.filter(|left| elapsed(left.held.at, reading.at) < DECIDED_AFTER);
        match self.held {
            None => self.read_next(last, reading),
            Some(held) => self.decide(last, held, reading),
        }
    }

    /// Many readings at once; `None` where they must be read one by one.
    pub fn read_plain(&mut self, rows: &ReadingSummary) -> Option<Exact> {
        if self.held.is_some() || !rows.is_plain(&self.rule) {
            return None;
        }
        let left = self.left.filter(|left| elapsed(left.held.at, rows.from) < DECIDED_AFTER);
        let last = self.last.unwrap_or(Reading { value: rows.first, at: rows.from, until: rows.from });
        let jitter = self.rule.jitter(last.value.near());
        let first = Reading { value: rows.first, at: rows.from, until: rows.from };
        let within = (rows.last - rows.first).near();
        let begins = -jitter <= (rows.first - last.value).near() && self.may_follow(&last, &first);
        let steps = within <= self.rule.digit || self.hourly().is_some_and(|hourly| within <= hourly);
        if left.is_some() || !begins || !steps {
            return None;
        }
        let top = if rows.max > last.value { rows.max } else { last.value };
        self.pace.note(rows.from, rows.last.near());
        (self.left, self.last) = (None, Some(Reading { value: top, at: rows.from, until: rows.to }));
        Some(top - last.value)
    }

    /// Many readings of which no more is kept than this.
    pub fn read_rows(&mut self, rows: &ReadingSummary) -> (Exact, Vec<CounterStep>) {
        if let Some(gain) = self.read_plain(rows) {
            return (gain, Vec::new());
        }
        let (mut gain, mut steps) = (Exact::default(), Vec::new());
        for reading in rows.readings(self.rule.jitter(rows.last.near())) {
            let counted = self.read(reading);
            gain = gain + counted.gain;
            steps.extend(counted.step);
        }
        (gain, steps)
    }

    /// Readings of long ago, of which only matters where they left the counter.
    pub fn skim(&mut self, rows: &ReadingSummary) {
        self.pace.note(rows.from, rows.last.near());
        let jitter = self.rule.jitter(rows.last.near());
        let mut top = if (rows.max - rows.last).near() <= jitter { rows.max } else { rows.last };
        if let Some(last) = self.last.filter(|last| last.value > top && (last.value - top).near() <= jitter) {
            top = last.value;
        }
        (self.held, self.left) = (None, None);
        self.last = Some(Reading { value: top, at: rows.from, until: rows.to });
    }

    fn read_next(&mut self, last: Reading, reading: Reading) -> Counted {
        let rise = reading.value - last.value;
        if let Some(left) = self.left.filter(|left| self.is_back(left, &last, &reading)) {
            let all = reading.value - left.before.value - left.counted;
            let gain = if all.near() < 0.0 { Exact::default() } else { all };
            (self.left, self.last) = (None, Some(reading));
            let step = step(CounterEvent::FalseReading, &left.held, left.before.value, Exact::default());
            return Counted { gain, step: Some(step) };
        }
        if rise.near() < 0.0 {
            if -rise.near() <= self.rule.jitter(last.value.near()) {
                self.last = Some(Reading { until: reading.until, ..last });
            } else {
                self.hold(reading);
            }
            return Counted::default();
        }
        if !self.may_follow(&last, &reading) {
            self.hold(reading);
            return Counted::default();
        }
        self.pace.counted(rise.near());
        self.go_on(reading, rise)
    }

    fn hold(&mut self, reading: Reading) {
        let Reading { value, at, until } = reading;
        self.held = Some(Held { at, shown: value, value, until });
    }

    /// Counting goes on from a reading, which has counted something.
    fn go_on(&mut self, reading: Reading, gain: Exact) -> Counted {
        (self.held, self.last) = (None, Some(reading));
        if let Some(left) = &mut self.left {
            left.counted = left.counted + gain;
        }
        Counted { gain, step: None }
    }

    /// Was a step that has been decided a false reading after all, because its counter is back where it was?
    fn is_back(&self, left: &Left, last: &Reading, reading: &Reading) -> bool {
        let [from_old, from_new] = [left.before.value, last.value].map(|value| (reading.value - value).near().abs());
        // One that counts on from a low number comes to the old one some day.
        let is_leap = self.likely(elapsed(last.until, reading.at)).is_none_or(|likely| likely < from_new);
        is_leap && self.follows(&left.before, reading) && from_old < from_new
    }

    /// Does a reading go on where another one was, jitter permitted?
    fn follows(&self, last: &Reading, reading: &Reading) -> bool {
        let rise = (reading.value - last.value).near();
        -self.rule.jitter(last.value.near()) <= rise && self.may_follow(last, reading)
    }

    fn decide(&mut self, last: Reading, held: Held, reading: Reading) -> Counted {
        let on_held = Reading { value: held.value, at: held.at, until: held.until };
        let is_rise = held.shown > last.value;
        let goes_on = -self.rule.jitter(held.value.near()) <= (reading.value - held.value).near();
        // After a step up everything that goes on from there is above the old value too.
        if self.follows(&last, &reading) && !(is_rise && goes_on) {
            let rise = reading.value - last.value;
            let (reading, gain) = match rise.near() < 0.0 {
                true => (Reading { value: last.value, ..reading }, Exact::default()),
                false => (reading, rise),
            };
            let step = step(CounterEvent::FalseReading, &held, last.value, Exact::default());
            return Counted { step: Some(step), ..self.go_on(reading, gain) };
        }
        if !goes_on || !self.may_follow(&on_held, &reading) {
            // Neither: the one before was false, and what this is the next ones tell.
            self.hold(reading);
            let step = step(CounterEvent::FalseReading, &held, last.value, Exact::default());
            return Counted { step: Some(step), ..Counted::default() };
        }
        let rise = reading.value - held.value;
        let is_late = DECIDED_AFTER <= elapsed(held.at, reading.at);
        if rise.near() <= 0.0 && !is_late {
            self.held = Some(Held { until: reading.until, ..held });
            return Counted::default();
        }
        let (event, of_step) = self.judge(&last, &held, &reading);
        let since = reading.value - held.shown;
        let since = if since.near() < 0.0 { Exact::default() } else { since };
        let reading = if rise.near() < 0.0 { Reading { value: held.value, ..reading } } else { reading };
        let gain = of_step + since;
        let counted = self.go_on(reading, gain);
        let Some(event) = event else { return counted };
        if matches!(event, CounterEvent::Reset | CounterEvent::Replaced) {
            self.left = Some(Left { held, before: last, counted: gain });
        }
        Counted { step: Some(step(event, &held, last.value, of_step)), ..counted }
    }

    /// What a step was from which the counter goes on with the next reading, and what the step itself counted; no event is
    /// plain counting.
    fn judge(&self, last: &Reading, held: &Held, next: &Reading) -> (Option<CounterEvent>, Exact) {
        let rise = held.shown - last.value;
        if 0.0 <= rise.near() {
            // One that goes on so fast has only begun to.
            let (time, goes_on) = (elapsed(held.at, next.at).as_secs_f64(), (next.value - held.value).near());
            let times = (elapsed(last.until, held.at).as_secs_f64().max(60.0) / time.max(1.0)).max(1.0);
            let is_fast = self.rule.max_rate.is_none() && rise.near() <= goes_on * times * pace::UNUSUAL;
            return if is_fast { (None, rise) } else { (Some(CounterEvent::Replaced), Exact::default()) };
        }
        let time = elapsed(last.until, held.at);
        let likely = self.likely(time);
        for modulus in self.rule.moduli.into_iter().flatten() {
            let over = rise + Exact::from(modulus);
            // Without an hour of history anything that is not far from the end of its range.
            let known = self.rule.max_rate.or(self.pace.usual()).and(likely);
            let most = known.unwrap_or_else(|| likely.map_or(f64::MAX, |likely| likely * NO_HISTORY));
            if (0.0..=most.min(modulus * ROLLS_WITHIN)).contains(&over.near()) {
                return (Some(CounterEvent::Rollover), over);
            }
        }
        let near_zero = likely.unwrap_or(NEAR_ZERO.0 * last.value.near()).max(NEAR_ZERO.1 * self.rule.digit);
        if (0.0..=near_zero).contains(&held.shown.near()) {
            return (Some(CounterEvent::Reset), held.shown);
        }
        (Some(CounterEvent::Replaced), Exact::default())
    }

    /// What it counts in some time, usually; `None` where nothing is known of it.
    fn likely(&self, time: Duration) -> Option<f64> {
        match self.rule.max_rate.or(self.pace.usual()) {
            Some(hourly) => Some(hourly * pace::LIKELY * hours(time).max(0.25)),
            None => self.pace.greatest().map(|step| step * (time.as_secs_f64() / 60.0).max(1.0)),
        }
    }

    /// Can it have counted so far from one reading to another?
    fn may_follow(&self, last: &Reading, reading: &Reading) -> bool {
        let (rise, time) = ((reading.value - last.value).near(), elapsed(last.until, reading.at) + SLACK);
        if rise <= self.rule.jitter(last.value.near()) {
            return true;
        }
        match self.hourly() {
            Some(hourly) => rise <= hourly * hours(time).max(1.0),
            None => self
                .pace
                .greatest()
                .is_none_or(|step| rise <= step * pace::UNHEARD * (time.as_secs_f64() / 60.0).max(1.0)),
        }
    }

    /// The most that it counts at once and in an hour, if that is known.
    fn hourly(&self) -> Option<f64> {
        self.rule.max_rate.or_else(|| Some(self.pace.usual()? * pace::UNUSUAL))
    }
}

fn step(event: CounterEvent, held: &Held, old: Exact, counted: Exact) -> CounterStep {
    CounterStep { at: held.at, event, old, new: held.shown, counted }
}

fn hours(time: Duration) -> f64 {
    time.as_secs_f64() / 3_600.0
}
