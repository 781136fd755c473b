//! The polls of devices that answer, in the order in which they may be read: a look at the first costs the same however many
//! there are.
//!
//! ```text
//!   waiting ──its time has come──> ready ──and has passed long ago (overload only)──> starved
//!   by time                        by rank                                            by deadline, and still ready
//! ```

use std::collections::BTreeSet;

use jiff::Timestamp;

/// When a poll may be read, and what counts against the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Spot {
    /// Not before this.
    pub from: Timestamp,
    /// The lower tier first.
    pub tier: u8,
    /// Then the nearer deadline.
    pub deadline: Timestamp,
    /// From then on it has waited too long.
    pub starves_at: Option<Timestamp>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct Queue {
    /// By poll; `None` for one that is not read now.
    spots: Vec<Option<Spot>>,
    waiting: BTreeSet<(Timestamp, usize)>,
    ready: BTreeSet<(u8, Timestamp, usize)>,
    /// Of the ready ones, when each starves.
    ages: BTreeSet<(Timestamp, usize)>,
    starved: BTreeSet<(Timestamp, usize)>,
}

impl Queue {
    /// Replaces all of them.
    pub fn fill(&mut self, spots: impl Iterator<Item = Option<Spot>>) {
        *self = Queue { spots: spots.collect(), ..Queue::default() };
        let from = |(index, spot): (usize, &Option<Spot>)| Some((spot.as_ref()?.from, index));
        self.waiting = self.spots.iter().enumerate().filter_map(from).collect();
    }

    /// A poll has another place, or none.
    pub fn put(&mut self, index: usize, spot: Option<Spot>) {
        if let Some(old) = std::mem::replace(&mut self.spots[index], spot) {
            if !self.waiting.remove(&(old.from, index)) {
                self.ready.remove(&(old.tier, old.deadline, index));
            }
            if let Some(starves_at) = old.starves_at
                && !self.ages.remove(&(starves_at, index))
            {
                self.starved.remove(&(old.deadline, index));
            }
        }
        if let Some(new) = spot {
            self.waiting.insert((new.from, index));
        }
    }

    /// Time has passed.
    pub fn advance(&mut self, now: Timestamp) {
        while let Some((_, index)) = self.waiting.pop_first_if(|(from, _)| *from <= now) {
            let Some(spot) = self.spots[index] else { continue };
            self.ready.insert((spot.tier, spot.deadline, index));
            self.ages.extend(spot.starves_at.map(|starves_at| (starves_at, index)));
        }
        while let Some((_, index)) = self.ages.pop_first_if(|(starves_at, _)| *starves_at <= now) {
            self.starved.extend(self.spots[index].map(|spot| (spot.deadline, index)));
        }
    }

    /// Those that may be read now, the first one first.
    pub fn ready(&self) -> impl Iterator<Item = ((u8, Timestamp), usize)> {
        self.ready.iter().map(|(tier, deadline, index)| ((*tier, *deadline), *index))
    }

    /// Of these, those that have waited too long, the nearest deadline first.
    pub fn starved(&self) -> impl Iterator<Item = (Timestamp, usize)> {
        self.starved.iter().copied()
    }

    /// When the next one may be read that may not yet.
    pub fn wakes_at(&self) -> Option<Timestamp> {
        self.waiting.first().map(|(from, _)| *from)
    }
}

/// The stable library has this for vectors only.
trait PopFirstIf<T> {
    fn pop_first_if(&mut self, condition: impl FnOnce(&T) -> bool) -> Option<T>;
}

impl<T: Ord> PopFirstIf<T> for BTreeSet<T> {
    fn pop_first_if(&mut self, condition: impl FnOnce(&T) -> bool) -> Option<T> {
        if condition(self.first()?) { self.pop_first() } else { None }
    }
}
