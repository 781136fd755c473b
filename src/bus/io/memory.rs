//! What a line remembers of its wire from one opening of its port to the next.

use tokio::time::Instant;

use super::clock::Clock;
use crate::{
    bus::{
        late_reply::LineReplies, other_master::OtherMaster, plan::Block, request_gap::RequestGaps,
        wide_addresses::WideAddresses,
    },
    plant::{def::LineDef, line_finding::OtherMasterHeard, line_state::LineCounters, number::to_u16},
};

/// What a line remembers from one opening of its port to the next.
#[derive(Debug, Clone)]
pub struct LineMemory {
    /// Totals; `utilisation`, `opens` and `missed` are the task's.
    pub counters: LineCounters,
    /// Outstanding replies of each unit.
    pub(super) replies: LineReplies,
    pub(super) other_master: OtherMaster,
    /// How soon each unit hears the next request.
    pub(super) request_gaps: RequestGaps,
    pub(super) created_at: Instant,
    /// The last request was cut off with its connection.
    pub(super) is_cut: bool,
}

impl LineMemory {
    /// Nothing has gone over the line yet.
    pub fn new(line: &LineDef, clock: Clock) -> LineMemory {
        let seed = to_u16(clock.now().as_microsecond().rem_euclid(0x1_0000));
        LineMemory {
            counters: LineCounters::default(),
            replies: LineReplies::new(line.timeout, seed),
            other_master: OtherMaster::default(),
            request_gaps: RequestGaps::default(),
            created_at: Instant::now(),
            is_cut: false,
        }
    }

    /// See [`OtherMaster::heard`].
    pub fn other_master(&mut self) -> Option<OtherMasterHeard> {
        self.other_master.heard(self.created_at.elapsed())
    }

    /// These blocks will be asked for, and these addresses hold 32 bits each.
    pub fn expect(mut self, blocks: &[Block], wide: WideAddresses) -> LineMemory {
        self.replies.set_wide(wide);
        self.replies.expect(blocks);
        self
    }
}
