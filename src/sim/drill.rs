//! What a terminal sees of a simulator: available and active faults, actual values, the running drill.

use std::{sync::Arc, time::Duration};

use super::{
    faults::{AvailableFaults, Fault, FaultTarget, InForce},
    scenario::judge::{ActualValues, Verdict},
};

/// A command to the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimCommand {
    /// This goes wrong, or goes wrong in another measure.
    Set(FaultTarget, Fault),
    /// This is mended, whatever its measure.
    Clear(FaultTarget, Fault),
    /// All is well again.
    AllWell,
}

/// The simulation as it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// The faults that can be injected, by target.
    pub available: Arc<[AvailableFaults]>,
    /// What is wrong.
    pub in_force: Vec<InForce>,
    /// Actual values by tag.
    pub actual: ActualValues,
    /// Nothing of all this may be told before the drill is over.
    pub exam: bool,
    /// The drill at work, or the one that is over.
    pub scenario: Option<Progress>,
}

/// How a drill stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Description for the trainer.
    pub description: String,
    /// Time since its start.
    pub elapsed: Duration,
    /// How long it takes.
    pub duration: Duration,
    /// Points by now.
    pub verdict: Verdict,
}

impl Status {
    /// Whether faults may be told and changed: always but in an exam that is not over.
    pub fn is_open(&self) -> bool {
        !self.exam || self.scenario.as_ref().is_some_and(|progress| progress.verdict.over)
    }

    /// The fault of this name that is in force in a target.
    pub fn find(&self, target: FaultTarget, fault: Fault) -> Option<&InForce> {
        self.in_force.iter().find(|in_force| in_force.target == target && in_force.fault.word() == fault.word())
    }
}
