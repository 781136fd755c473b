//! What the program itself takes of its computer.

use serde::{Deserialize, Serialize};

use crate::t;

/// The load of the last seconds, in real time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ProcessLoad {
    /// CPU time of the program, as a share of one processor: 1.5 is one and a half of them.
    pub cpu: f32,
    /// How often a second its threads went on after they had waited.
    pub wake_ups: f32,
    /// Idle share of all processors of the computer.
    pub idle: f32,
    /// Resident memory of the program, in bytes.
    pub memory: u64,
}

impl ProcessLoad {
    /// `CPU 2.1 % of a processor, 140 wake-ups/s, 86 MB; computer 96 % idle`.
    pub fn words(&self) -> String {
        t!(
            "CPU {cpu} % of a processor, {wake_ups} wake-ups/s, {megabytes} MB; computer {idle} % idle",
            cpu = format!("{:.1}", self.cpu * 100.0),
            wake_ups = format!("{:.0}", self.wake_ups),
            megabytes = self.memory / 1_000_000,
            idle = format!("{:.0}", self.idle * 100.0)
        )
    }
}
