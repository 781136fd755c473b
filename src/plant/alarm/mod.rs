//! Alarms: when a condition holds, what state follows, the manager of all of them, and how well the alarm system performs.

pub mod manager;
pub mod command;
pub mod condition;
pub mod def;
pub mod lists;
pub mod monitor;
pub mod metrics;
pub mod rate;
pub mod state;
#[cfg(test)]
mod tests;

pub use command::{AlarmCommand, AlarmRefusal};
pub use manager::AlarmManager;
pub use metrics::{AlarmMetrics, PeriodMetrics};
pub use monitor::AlarmMonitor;
pub use state::AlarmState;
