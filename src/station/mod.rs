//! The station: links, plant, history, wired together. Polls whether or not anybody looks.
//!
//! There is exactly one awaited send (link → plant). Everything else is `try_send` or `watch`, so the plant task never
//! blocks. Shutdown runs downstream: the links stop, the plant ends because nobody can send any more, the history
//! thread drains, flushes and ends.

pub mod session;
mod deeds;
mod door;
mod past;
mod plant_task;
pub mod pulse;
mod sets;
mod supervisor;
pub mod teller;
mod toil;
pub mod io;

#[cfg(test)]
mod tests;

pub use door::{Command, Entrance};
pub use session::{Request, Session};
