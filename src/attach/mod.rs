//! The station's socket: terminals of other processes, each with what it may see and no more.

pub(crate) mod assembly;
pub mod protocol;
pub mod check;
pub mod callers;
pub mod redaction;
pub mod command_id_map;
pub mod io;
