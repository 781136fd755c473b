//! What a terminal sees of a simulator: available and active faults, actual values, the running drill.

use std::{sync::Arc, time::Duration};

use super::{
    faults::{ActiveFault, AvailableFaults, FaultTarget, InjectedFault},
    scenario::judge::{ActualValues, DrillResult},
};

/// A command to the simulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimCommand {
    /// Inject a fault, or change its parameter.
    Inject(FaultTarget, InjectedFault),
    /// Clear a fault, whatever its parameter.
    Clear(FaultTarget, InjectedFault),
    /// Clear all faults.
    ClearAll,
}

/// State of the simulator.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// The faults that can be injected, by target.
    pub available: Arc<[AvailableFaults]>,
    pub active: Vec<ActiveFault>,
    /// Actual values by tag.
    pub actual: ActualValues,
    /// Faults and result are hidden until the drill is over.
    pub exam: bool,
    /// The drill, running or over.
    pub scenario: Option<Progress>,
}

/// Progress of a drill.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Description for the trainer.
    pub description: String,
    /// Time since its start.
    pub elapsed: Duration,
    /// How long it takes.
    pub duration: Duration,
    /// Points by now.
    pub verdict: DrillResult,
}

impl Status {
    /// Whether faults may be shown and changed: always, except in an exam that is not over.
    pub fn is_open(&self) -> bool {
        !self.exam || self.scenario.as_ref().is_some_and(|progress| progress.verdict.over)
    }

    /// The active fault of this name in a target.
    pub fn find(&self, target: FaultTarget, fault: InjectedFault) -> Option<&ActiveFault> {
        self.active.iter().find(|active| active.target == target && active.fault.word() == fault.word())
    }
}
