//! What the plant file says of commands: interlocks, actuators, sequences.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{
    condition::is_set,
    exact::Exact,
    id::TagId,
    sample::{Cause, Sample},
};

/// What the plant file says about commands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ControlLogic {
    /// What keeps a command from acting.
    pub interlocks: Vec<InterlockDef>,
    /// What is commanded, and which output confirms it.
    pub actuators: Vec<ActuatorDef>,
    /// Sequences that are started and stopped.
    pub sequences: Vec<SequenceDef>,
}

/// A reason for which a command has no effect. The device blocks it; the station says so before the write.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InterlockDef {
    /// The command.
    pub tag: TagId,
    /// The value of it that is blocked, as the device holds it.
    pub value: f64,
    /// The tag that decides.
    pub of: TagId,
    /// When it blocks.
    pub when: InterlockCondition,
    /// `no heating below 5 cm of water`.
    pub message: String,
    /// The station refuses the command while it is certainly blocked; else it only warns the operator.
    pub refuse: bool,
}

/// When an interlock blocks; limits are in the unit of the tag that decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum InterlockCondition {
    /// Below this.
    Below(f64),
    /// Above this.
    Above(f64),
    /// While it is this.
    Is(f64),
    /// While this bit of a status word is set.
    Bit(u8),
}

/// How an interlock stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum InterlockStatus {
    /// It does not block.
    Free,
    /// It blocks.
    Blocked,
    /// Unknown: the tag that decides is not good.
    Unknown(Cause),
}

impl InterlockDef {
    /// How it stands with this sample of the tag that decides.
    pub fn status(&self, sample: Sample) -> InterlockStatus {
        let Some(value) = sample.good_exact() else {
            return InterlockStatus::Unknown(sample.quality.cause().unwrap_or(Cause::NotRead));
        };
        let blocked = match self.when {
            InterlockCondition::Below(limit) => value < Exact::from(limit),
            InterlockCondition::Above(limit) => value > Exact::from(limit),
            InterlockCondition::Is(state) => value == state,
            InterlockCondition::Bit(bit) => is_set(value, bit),
        };
        if blocked { InterlockStatus::Blocked } else { InterlockStatus::Free }
    }
}

/// A valve, pump, agitator or heater: its command, and the output that shows what it does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActuatorDef {
    /// Its state; 0 is off.
    pub output: TagId,
    /// What commands it by hand.
    pub command: TagId,
    /// The value of the command that switches off.
    pub off: f64,
    /// States without which the command has no effect, the first to be changed first.
    pub needs: Vec<(TagId, f64)>,
    /// The output follows the command within this time; `None` if it need not (a heater that a controller cycles).
    pub travel: Option<Duration>,
}

/// A sequence in a PLC.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SequenceDef {
    /// Starts it, and stops it with zero.
    pub run: TagId,
    /// The tag and the state in which it works by itself.
    pub auto: Option<(TagId, f64)>,
    /// Its step.
    pub step: TagId,
    /// The step that it starts with.
    pub first: f64,
}

impl ControlLogic {
    /// The actuator that a tag is the output or the command of.
    pub fn actuator(&self, tag: TagId) -> Option<(usize, &ActuatorDef)> {
        self.actuators.iter().enumerate().find(|(_, actuator)| actuator.output == tag || actuator.command == tag)
    }

    /// Does the actuator certainly not follow its command?
    pub(super) fn differs(&self, actuator: &ActuatorDef, sample: &impl Fn(TagId) -> Sample) -> bool {
        let (Some(command), Some(output)) =
            (sample(actuator.command).good_value(), sample(actuator.output).good_value())
        else {
            return false;
        };
        let is_effective = actuator.needs.iter().all(|(tag, state)| sample(*tag).good_value() == Some(*state));
        let mut locks = self.interlocks.iter().filter(|lock| lock.tag == actuator.command && lock.value == command);
        let blocked = locks.any(|lock| lock.status(sample(lock.of)) == InterlockStatus::Blocked);
        actuator.travel.is_some() && is_effective && !blocked && (command != actuator.off) != (output != 0.0)
    }
}
