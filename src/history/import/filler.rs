//! Which rows of a file fill a gap.

use jiff::Timestamp;

use crate::{
    plant::{sample::Sample, time::elapsed},
    report::step_series::HOLD_MAX,
};

/// Decides which rows of a tag fill a gap: those at which no stored value is in force. What a station recorded itself is
/// never changed by a file. The last sample of an earlier file is in force up to the next stored one, and without such a
/// one not at all: a file that was split gives the same as the whole.
#[derive(Debug, Default)]
pub struct Filler {
    rows: Vec<Sample>,
    next: usize,
    last: Option<Stored>,
    accepted: Vec<Sample>,
}

/// A stored sample of the tag.
#[derive(Debug, Clone, Copy)]
pub struct Stored {
    /// The sample.
    pub sample: Sample,
    /// It came from a file.
    pub imported: bool,
}

impl Filler {
    /// For the rows of a tag, in order of time.
    pub fn new(rows: Vec<Sample>) -> Filler {
        Filler { rows, ..Filler::default() }
    }

    /// The next stored sample of the tag.
    pub fn stored(&mut self, stored: Stored) {
        let at = stored.sample.at;
        self.decide(|row| row.at < at, Some(at));
        // There is one of this instant already.
        self.next += usize::from(self.rows.get(self.next).is_some_and(|row| row.at == at));
        self.last = Some(stored);
    }

    /// The rows that fill a gap; the others are of no use.
    pub fn end(mut self) -> Vec<Sample> {
        self.decide(|_| true, None);
        self.accepted
    }

    /// Decides on the rows between the last stored sample and the next one.
    fn decide(&mut self, is_due: impl Fn(&Sample) -> bool, next: Option<Timestamp>) {
        let held = |last: Timestamp, at: Timestamp| elapsed(last, at) < HOLD_MAX;
        let last = self.last.filter(|last| {
            let at = last.sample.at;
            last.sample.value.is_some() && (!last.imported || next.is_some_and(|next| held(at, next)))
        });
        while let Some(row) = self.rows.get(self.next).filter(|row| is_due(row)) {
            let in_force = last.is_some_and(|last| held(last.sample.at, row.at));
            self.accepted.extend((!in_force).then_some(*row));
            self.next += 1;
        }
    }
}
