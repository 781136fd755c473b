//! The connection to the broker, the files beside the history, and the tasks that move samples and answers to the broker.

pub(crate) mod answers;
pub(crate) mod broker;
mod cursor;
pub(crate) mod request_file;
pub mod task;
