//! The loopback by function 08/00: what came back, and how fast.

use std::time::Duration;

use super::{Conclusion, Fault, Finding};

/// How many words came back of those sent, and how fast.
pub(super) fn conclusion(findings: &[Finding], sent: u32) -> Conclusion {
    let replies: Vec<Duration> = findings
        .iter()
        .filter_map(|finding| match finding {
            Finding::Exchange(exchange) => exchange.outcome.is_ok().then_some(exchange.response_time).flatten(),
            _ => None,
        })
        .collect();
    let times = (replies.iter().min().copied().unwrap_or_default(), replies.iter().max().copied().unwrap_or_default());
    let refused = findings.iter().any(|finding| matches!(finding, Finding::Failed { fault: Fault::Exception(_), .. }));
    match replies.len() {
        0 if refused => Conclusion::LoopbackRefused,
        back => Conclusion::Loopback { back, sent, times },
    }
}
