//! How a line does, in three questions that header and Bus tab ask alike.

use jiff::Timestamp;

use super::ViewContext;
use crate::plant::{def::LineDef, line_state::LineState, snapshot::LineStatus, time::elapsed};

/// Is a line connected, does it reply, and has it time for its polls?
pub fn is_well(cx: &ViewContext, line: &LineDef) -> bool {
    let status = cx.snapshot.line(line.id);
    status.state == LineState::Connected && !is_overloaded(status) && replies(cx, status)
}

/// Without a request no reply is missed.
pub fn replies(cx: &ViewContext, status: &LineStatus) -> bool {
    let counters = &status.counters;
    let recent = |at: Option<Timestamp>| {
        at.is_some_and(|at| elapsed(at, cx.now).as_secs_f64() < 3.0 * cx.snapshot.speed.max(1.0))
    };
    recent(counters.last_rx) || counters.last_tx <= counters.last_rx
}

/// Has it no time for all of its polls?
pub fn is_overloaded(line: &LineStatus) -> bool {
    line.report.as_ref().is_some_and(|report| report.strain.is_some())
}
