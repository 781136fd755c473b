//! What is true. No I/O, no clock: events and time come in as arguments, effects go out as values.
//!
//! ```text
//!  Event ──┐                       ┌──> Effects { bus requests, records }
//!  Order ──┼──> Plant (reducer) ───┤
//!  tick  ──┘    board book desk    └──> Snapshot
//!               values alarms orders
//! ```

pub mod id;
pub mod sample;
pub mod line;
pub mod def;
pub mod tag;
pub mod class;
pub mod scale;
pub mod admission;
pub mod event;
pub mod command;
pub mod record;
pub mod alarm;
pub mod snapshot;
pub mod board;
pub mod orders;
pub mod reducer;

#[cfg(test)]
pub mod fixture;

pub use def::PlantDef;
pub use reducer::{Effects, Plant};
pub use snapshot::Snapshot;
