//! Alarms: when a condition holds, what state follows, the manager of all of them, and how well the alarm system performs.

pub(crate) mod manager;
pub(crate) mod command;
pub(crate) mod lists;
pub(crate) mod monitor;
pub(crate) mod metrics;
pub(crate) mod rate;
pub(crate) mod state;
pub(crate) mod succession;
#[cfg(test)]
mod tests;

pub use command::{AlarmCommand, AlarmRefusal};
pub use lists::{ActiveAlarm, SuppressedAlarm};
pub use manager::AlarmManager;
pub use metrics::{AlarmMetrics, PeriodMetrics};
pub use monitor::AlarmMonitor;
pub use state::AlarmState;
pub use succession::Succession;
