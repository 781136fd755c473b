//! The rows of a list as they stand, to be compared with those that were drawn.

use std::hash::{DefaultHasher, Hash, Hasher};

/// The rows of a list that keys act on, each with its state, and the selected one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rows {
    pub all: u64,
    pub selected: u64,
}

impl Rows {
    /// The rows of a list, and the place of the selected one.
    pub fn of<T: Hash>(rows: impl IntoIterator<Item = T>, selected: usize) -> Rows {
        let mut all = DefaultHasher::new();
        let mut chosen = DefaultHasher::new();
        for (place, row) in rows.into_iter().enumerate() {
            row.hash(&mut all);
            if place == selected {
                row.hash(&mut chosen);
            }
        }
        Rows { all: all.finish(), selected: chosen.finish() }
    }
}
