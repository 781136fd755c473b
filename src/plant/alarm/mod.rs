//! Alarms: when a condition holds, what state follows, and the book of all of them.

pub mod book;
pub mod condition;
pub mod state;

pub use book::Book;
pub use state::AlarmState;
