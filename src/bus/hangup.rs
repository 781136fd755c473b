//! What the end of a connection over a network means: whether a request has caused it, and whether another connection is as good.
//!
//! ```text
//!   ended with nothing under way, after answers ──> another one when something is due; nothing is lost
//!   ended on the only request of a connection ──> that block is at fault and waits alone
//!   ended on others ──> each is made again as the first of a connection, until one has ended it or all are answered
//!   three in a row without any answer ──> the host is at fault: the line waits
//! ```

use super::plan::Block;

/// This many connections in a row that end without any answer are no fault of a request.
const BARREN_MAX: u32 = 3;
/// Connections that end after the same few answers show that the other side allows no more on one …
const USED_UP_AFTER: u32 = 3;
/// … if they are no more than this.
const FEW: u64 = 4;
/// Now and then one is kept, to see whether that still holds.
const KEPT_EVERY: u32 = 100;

/// What is to be done about a connection that has ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Hangup {
    /// The other side ends the connection on this request.
    pub guilty: Option<Block>,
    /// Another connection may take its place at once, and the values stay.
    pub is_quiet: bool,
}

/// How the connections of a line have ended.
#[derive(Debug, Clone, Default)]
pub struct Hangups {
    /// In a row, without any answer.
    barren: u32,
    /// Were under way when a connection ended, and have not been answered since.
    suspects: Vec<Block>,
    /// How many requests were under way together when one ended on them.
    together: usize,
    /// In a row, with the number of answers before each.
    alike: (u64, u32),
    /// Connections since one was kept.
    used_up: u32,
}

impl Hangups {
    /// A connection has ended with these requests under way, and this number of answers before.
    pub fn on_end(&mut self, under_way: &[Block], answers: u64) -> Hangup {
        self.barren = if 0 < answers { 0 } else { self.barren.saturating_add(1) };
        self.alike = match self.alike {
            (same, count) if same == answers => (same, count.saturating_add(1)),
            _ => (answers, 1),
        };
        let guilty = match under_way {
            [only] if answers == 0 => Some(only.clone()),
            [] | [..] => None,
        };
        match &guilty {
            // What was under way beside it is cleared.
            Some(block) => {
                self.suspects.retain(|suspect| suspect != block);
                self.together = 0;
            }
            None => {
                self.together = self.together.max(if 1 < under_way.len() { under_way.len() } else { 0 });
                let new = under_way.iter().filter(|block| !self.suspects.contains(block)).cloned();
                self.suspects.extend(new.collect::<Vec<_>>());
            }
        }
        Hangup { guilty, is_quiet: self.barren < BARREN_MAX }
    }

    /// A block was answered. If with it all are cleared that were under way together, it was their number that was too much.
    pub fn answered(&mut self, block: &Block) -> Option<usize> {
        if self.suspects.is_empty() {
            return None;
        }
        self.suspects.retain(|suspect| suspect != block);
        self.suspects.is_empty().then(|| std::mem::take(&mut self.together)).filter(|together| 0 < *together)
    }

    /// A block was not answered on a connection that has not ended in all the time: it does not end connections.
    pub fn outlived(&mut self, block: &Block) {
        self.suspects.retain(|suspect| suspect != block);
        if self.suspects.is_empty() {
            self.together = 0;
        }
    }

    /// Blocks have other names; those without one are no longer asked for.
    pub fn rename(&mut self, renamed: impl Fn(Block) -> Option<Block>) {
        self.suspects = std::mem::take(&mut self.suspects).into_iter().filter_map(renamed).collect();
    }

    /// The plan has changed: what is read no more is no suspect.
    pub fn keep(&mut self, blocks: &[Block]) {
        self.suspects.retain(|suspect| blocks.contains(suspect));
    }

    /// What is asked first on the next connection: if that ends as well, it is at fault.
    pub fn suspect(&self) -> Option<&Block> {
        self.suspects.first()
    }

    /// May requests be under way together?
    pub fn is_clear(&self) -> bool {
        self.suspects.is_empty()
    }

    /// The other side allows no more than this many answers on one connection.
    pub fn answers_max(&self) -> Option<u64> {
        let (answers, count) = self.alike;
        (USED_UP_AFTER <= count && (1..=FEW).contains(&answers)).then_some(answers)
    }

    /// Is a connection used up after this number of answers? The next one is opened before a request is lost on this one.
    pub fn is_used_up(&mut self, answers: u64) -> bool {
        if self.answers_max().is_none_or(|most| answers < most) {
            return false;
        }
        self.used_up = (self.used_up + 1) % KEPT_EVERY;
        0 < self.used_up
    }

    /// A connection has given more than the ones before it.
    pub fn on_answers(&mut self, answers: u64) {
        if self.answers_max().is_some_and(|most| most < answers) {
            self.alike = (0, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bus::plan::{UnreadableRanges, blocks},
        plant::{def::LineId, fixture},
    };

    fn some_blocks() -> Vec<Block> {
        let mut all = blocks(&fixture::plant(), LineId(0), &UnreadableRanges::default());
        all.truncate(2);
        assert_eq!(all.len(), 2);
        all
    }

    #[test]
    fn a_request_that_ends_a_fresh_connection_is_at_fault() {
        let (mut hangups, all) = (Hangups::default(), some_blocks());
        assert_eq!(hangups.on_end(&all[..1], 0), Hangup { guilty: Some(all[0].clone()), is_quiet: true });
        // After answers it may have been the end of a short life: it is made again.
        assert_eq!(hangups.on_end(&all[1..], 3), Hangup { guilty: None, is_quiet: true });
        assert!(!hangups.is_clear());
        assert_eq!(hangups.suspect(), Some(&all[1]));
        assert_eq!(hangups.on_end(&all[1..], 0).guilty, Some(all[1].clone()), "alone on the next it is");
        assert!(hangups.is_clear());
    }

    #[test]
    fn requests_that_were_under_way_together_are_cleared_one_by_one() {
        let (mut hangups, all) = (Hangups::default(), some_blocks());
        assert_eq!(hangups.on_end(&all, 5).guilty, None);
        assert_eq!(hangups.answered(&all[0]), None);
        assert_eq!(hangups.answered(&all[1]), Some(2), "two at once were too much");
        assert_eq!(hangups.on_end(&all, 5).guilty, None);
        assert_eq!(hangups.on_end(&all[..1], 0).guilty, Some(all[0].clone()));
        assert_eq!(hangups.answered(&all[1]), None, "one was at fault, not that there were two");
    }

    #[test]
    fn a_host_that_never_answers_is_no_fault_of_a_request() {
        let mut hangups = Hangups::default();
        let quiet = [(); 4].map(|()| hangups.on_end(&[], 0).is_quiet);
        assert_eq!(quiet, [true, true, false, false]);
        assert!(hangups.on_end(&[], 1).is_quiet);
    }

    #[test]
    fn a_host_that_allows_few_answers_gets_a_new_connection_in_time() {
        let mut hangups = Hangups::default();
        assert!(!hangups.is_used_up(1));
        for _ in 0..3 {
            hangups.on_end(&[], 1);
        }
        assert_eq!(hangups.answers_max(), Some(1));
        assert!(!hangups.is_used_up(0));
        let kept = (0..200).filter(|_| !hangups.is_used_up(1)).count();
        assert_eq!(kept, 2, "now and then one is kept");
        hangups.on_answers(2);
        assert_eq!(hangups.answers_max(), None, "it allows more now");
    }

    #[test]
    fn a_host_that_gives_many_answers_allows_as_many_as_it_likes() {
        let allowed_after = |answers| {
            let mut hangups = Hangups::default();
            for _ in 0..3 {
                hangups.on_end(&[], answers);
            }
            hangups.answers_max()
        };
        assert_eq!([0, FEW, FEW + 1].map(allowed_after), [None, Some(FEW), None]);
    }
}
