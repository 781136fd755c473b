//! Judges a drill by what became true: alarm events, commands of operators, values shown and values that are really so.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{Expectation, Scenario};
use crate::plant::{
    Snapshot,
    alarm::manager::subject_name,
    command::CommandStatus,
    def::{AlarmId, PlantDef, TagId},
    exact::Exact,
    record::{AlarmEvent, AlarmRecord, Record},
};

/// What is really so in the simulated plant, in the units of the tags.
pub type ActualValues = BTreeMap<TagId, f64>;

/// A shown value may differ from the truth for so long: it was read a moment ago.
const GRACE: Duration = Duration::from_secs(5);

/// Takes in what happens and says at any time how the drill stands.
#[derive(Debug, Clone)]
pub struct Judge {
    scenario: Arc<Scenario>,
    def: Arc<PlantDef>,
    began: Timestamp,
    now: Duration,
    marks: Vec<Mark>,
    /// Alarm events that never came here.
    lost: u64,
}

/// What is known of one expectation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Mark {
    met: Option<Duration>,
    /// When and by which value it was violated.
    broken: Option<(Duration, Option<f64>)>,
    /// Whether the value was known at all.
    seen: bool,
    /// Since when what is shown differs from the truth.
    differs: Option<Duration>,
}

/// How one expectation stands.
#[derive(Debug, Clone, PartialEq)]
pub enum ExpectationStatus {
    /// Its time has not come, or is not over.
    Open,
    /// Fulfilled, at this time.
    Met(Duration),
    /// Not fulfilled, and why.
    Missed(String),
}

/// One row of a verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// What was expected.
    pub text: String,
    /// What it is worth.
    pub points: u32,
    /// How it stands.
    pub status: ExpectationStatus,
}

/// How a drill stands or ended.
#[derive(Debug, Clone, PartialEq)]
pub struct DrillResult {
    /// Title of the scenario.
    pub title: String,
    /// One for each expectation.
    pub rows: Vec<Row>,
    pub points: u32,
    /// Points that there are.
    pub of: u32,
    /// Points of 100 that are needed.
    pub pass_percent: u32,
    /// Whether its time is over.
    pub over: bool,
    /// Alarm events that were lost because too many came at once.
    pub lost: u64,
}

impl Judge {
    /// Begins now.
    pub fn new(scenario: Arc<Scenario>, def: Arc<PlantDef>, began: Timestamp) -> Judge {
        let marks = vec![Mark::default(); scenario.expect.len()];
        Judge { scenario, def, began, now: Duration::ZERO, marks, lost: 0 }
    }

    pub fn scenario(&self) -> &Arc<Scenario> {
        &self.scenario
    }

    /// Whether the time of the scenario has passed.
    pub fn is_over(&self) -> bool {
        self.now >= self.scenario.duration
    }

    /// Takes lines of the journal.
    pub fn on_records(&mut self, records: &[Record]) {
        for record in records {
            if let Record::Alarm(event) = record {
                self.on_alarm_event(event);
            }
        }
    }

    /// This many alarm events have been lost by now.
    pub fn on_lost(&mut self, lost: u64) {
        self.lost = self.lost.max(lost);
    }

    /// Takes what is shown now, and what is really so.
    pub fn on_values(&mut self, snapshot: &Snapshot, actual: &ActualValues) {
        let Some(at) = self.elapsed(snapshot.at) else { return };
        self.now = self.now.max(at);
        for command in snapshot.commands.iter().rev() {
            self.on_command(command);
        }
        for (expect, mark) in self.scenario.expect.iter().zip(&mut self.marks) {
            if expect.from <= at && at <= expect.until {
                mark.evaluate(at, expect.expectation, snapshot, actual);
            }
        }
    }

    /// Time since the start; `None` for what was before.
    fn elapsed(&self, at: Timestamp) -> Option<Duration> {
        Duration::try_from(at.duration_since(self.began)).ok()
    }

    fn on_alarm_event(&mut self, event: &AlarmRecord) {
        let Some(at) = self.elapsed(event.at) else { return };
        for (expect, mark) in self.scenario.expect.iter().zip(&mut self.marks) {
            let inside = expect.from <= at && at <= expect.until;
            match expect.expectation {
                Expectation::Alarm(alarm, wanted) if inside && wanted == event.event && is(&self.def, alarm, event) => {
                    mark.met.get_or_insert(at);
                }
                Expectation::NoAlarm(alarm)
                    if inside && event.event == AlarmEvent::Raised && is(&self.def, alarm, event) =>
                {
                    mark.broken.get_or_insert((at, event.value.map(Exact::near)));
                }
                Expectation::Alarm(..)
                | Expectation::NoAlarm(_)
                | Expectation::Written(..)
                | Expectation::NotGood(_)
                | Expectation::Good(_)
                | Expectation::Within { .. }
                | Expectation::True(..) => {}
            }
        }
    }

    fn on_command(&mut self, status: &CommandStatus) {
        let (Some(at), Some((tag, value))) = (self.elapsed(status.at), status.command.kind.written()) else { return };
        let done = status.outcome.is_success();
        for (expect, mark) in self.scenario.expect.iter().zip(&mut self.marks) {
            let Expectation::Written(wanted, number) = expect.expectation else { continue };
            if done && wanted == tag && value == number && expect.from <= at && at <= expect.until {
                mark.met.get_or_insert(at);
            }
        }
    }

    /// How it stands; `over` once the time of the scenario has passed.
    pub fn verdict(&self) -> DrillResult {
        let over = self.is_over();
        let rows: Vec<Row> = self
            .scenario
            .expect
            .iter()
            .zip(&self.marks)
            .map(|(expect, mark)| Row {
                text: expect.text.clone(),
                points: expect.points,
                status: mark.status(expect.expectation, over || self.now > expect.until, self.now.min(expect.until)),
            })
            .collect();
        let met = rows.iter().filter(|row| matches!(row.status, ExpectationStatus::Met(_)));
        DrillResult {
            title: self.scenario.title.clone(),
            points: met.map(|row| row.points).sum(),
            of: self.scenario.points(),
            pass_percent: self.scenario.pass_percent,
            over,
            lost: self.lost,
            rows,
        }
    }
}

/// Whether an event of the journal is of an alarm: the journal has names, not numbers.
fn is(def: &PlantDef, alarm: AlarmId, event: &AlarmRecord) -> bool {
    let alarm = def.alarm(alarm);
    *subject_name(def, alarm.subject) == *event.subject && *alarm.message == *event.message
}

impl Mark {
    fn evaluate(&mut self, at: Duration, expectation: Expectation, snapshot: &Snapshot, actual: &ActualValues) {
        match expectation {
            Expectation::NotGood(tag) if !snapshot.sample(tag).quality.is_good() => {
                self.met.get_or_insert(at);
            }
            Expectation::Good(tag) if snapshot.sample(tag).quality.is_good() => {
                self.met.get_or_insert(at);
            }
            Expectation::Within { tag, low, high } => {
                if let Some(value) = actual.get(&tag).copied() {
                    self.seen = true;
                    if value < low || high < value {
                        self.broken.get_or_insert((at, Some(value)));
                    }
                }
            }
            Expectation::True(tag, allowed) => {
                let (shown, truth) = (snapshot.sample(tag).good_value(), actual.get(&tag).copied());
                self.seen |= truth.is_some();
                match (shown, truth) {
                    (Some(shown), Some(truth)) if (shown - truth).abs() > allowed => {
                        let since = *self.differs.get_or_insert(at);
                        if at - since > GRACE {
                            self.broken.get_or_insert((since, Some(shown)));
                        }
                    }
                    _ => self.differs = None,
                }
            }
            Expectation::Alarm(..)
            | Expectation::NoAlarm(_)
            | Expectation::Written(..)
            | Expectation::NotGood(_)
            | Expectation::Good(_) => {}
        }
    }

    fn status(&self, expectation: Expectation, over: bool, now: Duration) -> ExpectationStatus {
        let value = |value: Option<f64>| value.map_or(String::new(), |value| format!(": {value:.1}"));
        match (expectation, self.met, self.broken) {
            (
                Expectation::Alarm(..) | Expectation::Written(..) | Expectation::NotGood(_) | Expectation::Good(_),
                Some(at),
                _,
            ) => ExpectationStatus::Met(at),
            (
                Expectation::Alarm(..) | Expectation::Written(..) | Expectation::NotGood(_) | Expectation::Good(_),
                None,
                _,
            ) if over => ExpectationStatus::Missed("did not happen in time".to_owned()),
            (Expectation::NoAlarm(_), _, Some((at, number))) => {
                ExpectationStatus::Missed(format!("raised at {}{}", clock(at), value(number)))
            }
            (Expectation::Within { .. }, _, Some((at, number))) => {
                ExpectationStatus::Missed(format!("left at {}{}", clock(at), value(number)))
            }
            (Expectation::True(..), _, Some((at, number))) => {
                ExpectationStatus::Missed(format!("shown as good and wrong from {}{}", clock(at), value(number)))
            }
            (Expectation::Within { .. } | Expectation::True(..), _, None) if over && !self.seen => {
                ExpectationStatus::Missed("not evaluated: the simulator has no such value".to_owned())
            }
            (Expectation::NoAlarm(_) | Expectation::Within { .. } | Expectation::True(..), _, None) if over => {
                ExpectationStatus::Met(now)
            }
            _ => ExpectationStatus::Open,
        }
    }
}

impl DrillResult {
    /// Whether the points suffice. Lost alarm events are never passed.
    pub fn passed(&self) -> bool {
        self.lost == 0 && self.points * 100 >= self.pass_percent * self.of
    }

    /// `PASSED 90 of 100 points`, `FAILED …`, or how many there are by now.
    pub fn summary(&self) -> String {
        let lost = match self.lost {
            0 => String::new(),
            1 => "; not evaluated: 1 alarm event lost".to_owned(),
            lost => format!("; not evaluated: {lost} alarm events lost"),
        };
        let points = format!("{} of {} points, {} % needed{lost}", self.points, self.of, self.pass_percent);
        match (self.over, self.passed()) {
            (false, _) => format!("so far {points}"),
            (true, true) => format!("PASSED  {points}"),
            (true, false) => format!("FAILED  {points}"),
        }
    }

    /// A table: one line for each expectation, then the sum.
    pub fn lines(&self) -> Vec<String> {
        let width = self.rows.iter().map(|row| row.text.chars().count()).max().unwrap_or(0);
        let row = |row: &Row| {
            let (word, points, rest) = match &row.status {
                ExpectationStatus::Open => ("open", 0, String::new()),
                ExpectationStatus::Met(at) => ("met", row.points, clock(*at)),
                ExpectationStatus::Missed(why) => ("MISSED", 0, why.clone()),
            };
            format!("{word:<6}  {points:>3}/{:<3}  {:<width$}  {rest}", row.points, row.text).trim_end().to_owned()
        };
        self.rows.iter().map(row).chain([self.summary()]).collect()
    }
}

/// Time since the start: `02:05`, `1:02:05`.
pub fn clock(time: Duration) -> String {
    let s = time.as_secs();
    match s / 3600 {
        0 => format!("{:02}:{:02}", s / 60, s % 60),
        hours => format!("{hours}:{:02}:{:02}", s / 60 % 60, s % 60),
    }
}

#[cfg(test)]
mod tests;
