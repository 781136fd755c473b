//! Whether this process has room for the engine, which ends the process where it gets a descriptor or memory half-way.

use std::{hint::black_box, io::pipe};

use rustix::io::Errno;

use crate::history::HistoryError;

/// Descriptors that an opening, a checkpoint or a file of the archive needs at most, in pairs; measured are 9.
const DESCRIPTOR_PAIRS: usize = 8;
/// Memory that the engine may ask for at once: its own limit, and half of that for what it does not count.
const MEMORY: usize = 96 << 20;

/// [`HistoryError::Engine`] where descriptors or memory are short now.
pub fn check() -> Result<(), HistoryError> {
    let pairs: Result<Vec<_>, _> = (0..DESCRIPTOR_PAIRS).map(|_| pipe()).collect();
    let short = pairs.map_err(|error| error.to_string()).and_then(|_| {
        // Address space is what a limit counts: nothing is written to it.
        let mut memory = Vec::<u8>::new();
        let reserved = memory.try_reserve_exact(MEMORY);
        black_box(memory);
        reserved.map_err(|_| std::io::Error::from(Errno::NOMEM).to_string())
    });
    short.map_err(HistoryError::Engine)
}
