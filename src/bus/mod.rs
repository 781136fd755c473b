//! How it is read and written: frames, codecs, blocks, the schedule; bytes move only in [`io`].

pub mod ascii;
pub mod frame;
pub mod gather;
pub mod names;
pub mod complaint;
pub mod explain;
pub mod typed;
pub mod filter;
pub mod capture;
pub mod codec;
pub mod plan;
pub mod backoff;
pub mod schedule;
pub mod admission;
pub mod debt;
pub mod tool;
pub mod books;
pub mod evidence;
pub mod io;
