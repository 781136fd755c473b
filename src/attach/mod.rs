//! The station's socket: terminals of other processes, each with what it may see and no more.

pub mod callers;
pub mod check;
pub mod delta;
pub mod protocol;
pub mod sight;
pub mod own;
pub mod io;
