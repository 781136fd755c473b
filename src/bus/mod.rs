//! How it is read and written: frames, codecs, blocks, the schedule; bytes move only in [`io`].

pub mod frame;
pub mod gather;
pub mod codec;
pub mod plan;
pub mod backoff;
pub mod schedule;
pub mod admission;
pub mod debt;
pub mod io;
