//! What is outstanding of the units of a line, as its link knows it.

use std::time::Duration;

use super::Link;
use crate::bus::{
    late_reply::{OutstandingReplies, Proof},
    plan::Block,
    wide_addresses::WideAddresses,
};

impl Link {
    /// Could the answer to this message be mistaken for an outstanding one?
    pub fn is_ambiguous(&self, message: &[u8]) -> bool {
        self.wire.replies.is_ambiguous(message)
    }

    /// See [`crate::bus::late_reply::LineReplies::proof`].
    pub fn proof(&self, unit: u8) -> Proof {
        self.wire.replies.proof(unit)
    }

    /// See [`crate::bus::late_reply::LineReplies::proof_given`].
    pub fn proof_given(&mut self, unit: u8) {
        self.wire.replies.proof_given(unit);
    }

    /// See [`crate::bus::late_reply::LineReplies::retry`].
    pub fn retry(&mut self, unit: u8) {
        self.wire.replies.retry(unit);
    }

    /// See [`crate::bus::late_reply::LineReplies::proof_failed`].
    pub fn proof_failed(&mut self, unit: u8) {
        self.wire.replies.proof_failed(unit);
    }

    /// See [`crate::bus::late_reply::LineReplies::settles_in`].
    pub fn settles_in(&self, unit: u8) -> Option<Duration> {
        self.wire.replies.settles_in(unit, self.wire.uptime())
    }

    /// See [`crate::bus::late_reply::LineReplies::must_wait`].
    pub fn must_wait(&self, message: &[u8]) -> bool {
        self.wire.replies.must_wait(message)
    }

    /// Outstanding replies of a unit.
    pub fn outstanding(&self, unit: u8) -> &OutstandingReplies {
        self.wire.replies.of(unit)
    }

    /// See [`crate::bus::late_reply::LineReplies::forget`].
    pub fn forget_outstanding(&mut self, unit: u8) -> Option<Duration> {
        self.wire.replies.forget(unit, self.wire.uptime())
    }

    /// See [`crate::bus::late_reply::LineReplies::is_unsettled`].
    pub fn is_unsettled(&self, unit: u8) -> bool {
        self.wire.replies.is_unsettled(unit, self.wire.uptime())
    }

    /// Other blocks are asked for from now on, and these addresses hold 32 bits each.
    pub fn expect(&mut self, blocks: &[Block], wide: WideAddresses) {
        self.wire.replies.set_wide(wide);
        self.wire.replies.expect(blocks);
    }
}
