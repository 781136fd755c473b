//! What the plant file says of a procedure.

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use super::{
    expr::Expr,
    id::{DeviceId, TagId},
};

/// A `[[procedure]]` of the plant file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProcedureDef {
    /// `fill-5l`; the history knows its measurements by it.
    pub name: Arc<str>,
    /// What it does, for its operator.
    pub about: String,
    /// In order; those of other procedures that it names are among them.
    pub steps: Vec<ProcedureStep>,
    /// The writes of the safe state, in order.
    pub safe: Vec<(TagId, f64)>,
    /// What its measurement is compared with.
    pub reference: Option<Reference>,
}

impl ProcedureDef {
    /// What it may write: in its steps, and for its safe state.
    pub fn writes(&self) -> impl Iterator<Item = (TagId, f64)> + '_ {
        let written = self.steps.iter().filter_map(|step| match step {
            ProcedureStep::Write { tag, value } => Some((*tag, *value)),
            ProcedureStep::WaitUntil { .. }
            | ProcedureStep::Hold(_)
            | ProcedureStep::BeginMeasurement { .. }
            | ProcedureStep::EndMeasurement { .. } => None,
        });
        written.chain(self.safe.iter().copied())
    }

    /// The controllers whose control runs it measures, each with the name under which the run is kept.
    pub fn measured(&self) -> impl Iterator<Item = (DeviceId, &Arc<str>)> {
        self.steps.iter().filter_map(|step| match step {
            ProcedureStep::BeginMeasurement { controller, label } => Some((*controller, label)),
            ProcedureStep::Write { .. }
            | ProcedureStep::WaitUntil { .. }
            | ProcedureStep::Hold(_)
            | ProcedureStep::EndMeasurement { .. } => None,
        })
    }
}

/// One step of a procedure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ProcedureStep {
    /// Write a value and verify it.
    Write {
        /// What.
        tag: TagId,
        /// The value, in its unit.
        value: f64,
    },
    /// Wait until a condition is true.
    WaitUntil {
        /// As it is written.
        text: Arc<str>,
        /// What that means.
        condition: Expr,
        /// The procedure fails where it is not true within this time.
        limit: Duration,
    },
    /// Let this time pass.
    Hold(Duration),
    /// Begin a control run of a controller.
    BeginMeasurement {
        /// The controller.
        controller: DeviceId,
        /// The name of the run: of the procedure that has the step.
        label: Arc<str>,
    },
    /// End it: its figures are the result.
    EndMeasurement {
        /// The controller.
        controller: DeviceId,
    },
}

/// Figures of another control run, to compare with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// Where they come from.
    pub source: String,
    /// First time at SV; `None` is never, and so it is with the others.
    pub at_sv: Option<Duration>,
    /// Steady from this time on.
    pub steady: Option<Duration>,
    /// Overshoot, in the unit of PV.
    pub overshoot: Option<f64>,
}
