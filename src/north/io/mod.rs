//! The connection to the broker, the cursor file, and the task that moves samples from the history to the broker.

mod broker;
mod cursor;
pub mod task;
