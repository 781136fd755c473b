//! A drill on a simulated plant: faults at their times, and what is expected of alarms and operator. Plain data.
//!
//! ```text
//!  scenario file ── read ──> Scenario ──> timeline: inject and clear faults, (headless) act as a good operator
//!                                │
//!  journal, snapshots, actual ───┴─ judge ──> DrillResult
//! ```

pub mod judge;
pub mod read;

use std::time::Duration;

use super::faults::{FaultTarget, InjectedFault};
use crate::plant::{
    Snapshot,
    alarm::ActiveAlarm,
    command::CommandKind,
    def::{AlarmId, TagId},
    keyword::keyword_enum,
    record::AlarmEvent,
};

/// A drill. Times count from its start, in plant time.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The stem of its file: `sensor_burnout`.
    pub name: String,
    /// What the screens show.
    pub title: String,
    /// Description for the trainer.
    pub description: String,
    /// The plant it is for, as the file names it.
    pub plant: String,
    /// How the process stands at the start.
    pub start: Start,
    /// Plant time that the process runs before the start.
    pub warm_up: Duration,
    /// How long it takes.
    pub duration: Duration,
    /// Points of 100 that are needed to pass.
    pub pass_percent: u32,
    /// What goes wrong, in order of time.
    pub events: Vec<FaultEvent>,
    /// What a good operator does, in order of time.
    pub operator: Vec<OperatorStep>,
    /// What is expected.
    pub expect: Vec<Expect>,
}

keyword_enum! {
    /// How the process stands at the start.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Start: "start" {
        /// In the middle of work.
        #[default]
        Running => "running",
        Rest => "rest",
    }
}

/// A fault is injected or cleared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultEvent {
    /// When.
    pub at: Duration,
    /// Where.
    pub target: FaultTarget,
    pub fault: InjectedFault,
    /// `false`: the fault is cleared.
    pub begins: bool,
}

/// What a good operator does.
#[derive(Debug, Clone, PartialEq)]
pub struct OperatorStep {
    /// When.
    pub at: Duration,
    pub action: OperatorAction,
}

/// A scripted operator action; alarms are acknowledged as they are seen at that moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OperatorAction {
    /// Acknowledge this alarm.
    Acknowledge(AlarmId),
    /// Acknowledge all that wait.
    AcknowledgeAll,
    /// Write this value.
    Write(TagId, f64),
}

impl OperatorAction {
    /// The command for the displayed state; `None` if there is nothing to do.
    pub fn command_kind(self, seen: &Snapshot) -> Option<CommandKind> {
        match self {
            OperatorAction::Acknowledge(id) => {
                seen.alarms.iter().find(|alarm| alarm.id == id).map(ActiveAlarm::acknowledge)
            }
            OperatorAction::AcknowledgeAll => seen.acknowledge_all(),
            OperatorAction::Write(tag, value) => Some(CommandKind::Write { tag, value: value.into() }),
        }
    }
}

/// One thing that is expected, and what it is worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Expect {
    /// In words for the trainee.
    pub text: String,
    /// What it is worth.
    pub points: u32,
    /// From when.
    pub from: Duration,
    /// Until when.
    pub until: Duration,
    pub expectation: Expectation,
}

/// What can be expected between two times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Expectation {
    /// This alarm makes this step.
    Alarm(AlarmId, AlarmEvent),
    /// This alarm is never raised.
    NoAlarm(AlarmId),
    /// An operator writes this value, and it is verified.
    Written(TagId, f64),
    /// The value is shown as not good.
    NotGood(TagId),
    /// The value is shown as good.
    Good(TagId),
    /// The process stays inside these bounds, whatever is shown.
    Within {
        /// What is measured there.
        tag: TagId,
        /// Never below, in the tag's unit.
        low: f64,
        /// Never above.
        high: f64,
    },
    /// What is shown as good is so, give or take this much.
    True(TagId, f64),
}

/// An entry of the timeline.
#[derive(Debug, Clone, PartialEq)]
pub enum ScenarioEvent {
    /// A fault begins or ends.
    Fault(FaultEvent),
    /// A good operator acts.
    OperatorStep(OperatorStep),
}

impl ScenarioEvent {
    /// When.
    pub fn at(&self) -> Duration {
        match self {
            ScenarioEvent::Fault(event) => event.at,
            ScenarioEvent::OperatorStep(step) => step.at,
        }
    }
}

impl Scenario {
    /// Everything that happens, in order of time; with the actions of the scripted operator, or without where a person sits.
    pub fn timeline(&self, with_operator: bool) -> Vec<ScenarioEvent> {
        let steps = self.operator.iter().filter(|_| with_operator).cloned().map(ScenarioEvent::OperatorStep);
        let mut timeline: Vec<ScenarioEvent> =
            self.events.iter().copied().map(ScenarioEvent::Fault).chain(steps).collect();
        timeline.sort_by_key(ScenarioEvent::at);
        timeline
    }

    pub fn points(&self) -> u32 {
        self.expect.iter().map(|expect| expect.points).sum()
    }
}
