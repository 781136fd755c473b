//! Alarms: when a condition holds, what state follows, the book of all of them, and how good the alarm system is.

pub mod book;
pub mod condition;
pub mod meter;
pub mod quality;
pub mod rate;
pub mod state;

pub use book::Book;
pub use meter::Meter;
pub use quality::{AlarmQuality, Figures};
pub use state::AlarmState;
