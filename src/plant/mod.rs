//! What is true. No I/O, no clock: events and time come in as arguments, effects go out as values.

pub mod alarm;
pub mod command;
pub mod def;
pub mod event;
pub mod record;
pub mod sample;
pub mod snapshot;
pub mod tag;
