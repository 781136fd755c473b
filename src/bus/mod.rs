//! How it is read and written: frames, codecs, blocks, the schedule; bytes move only in [`io`].

pub mod frame;
pub mod io;
