//! Alarms: when a condition holds, what state follows, the manager of all of them, and how good the alarm system is.

pub mod manager;
pub mod command;
pub mod condition;
pub mod def;
pub mod lists;
pub mod meter;
pub mod quality;
pub mod rate;
pub mod state;
#[cfg(test)]
mod tests;

pub use command::{AlarmCommand, AlarmRefusal};
pub use manager::AlarmManager;
pub use meter::Meter;
pub use quality::{AlarmQuality, Figures};
pub use state::AlarmState;
