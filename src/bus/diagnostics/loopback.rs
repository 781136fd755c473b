//! The loopback by function 08/00: what came back, in words.

use std::time::Duration;

use super::{Fault, Finding};

/// How many words came back of those sent, and how fast.
pub(super) fn conclusion(findings: &[Finding], sent: u32) -> String {
    let replies: Vec<Duration> = findings
        .iter()
        .filter_map(|finding| match finding {
            Finding::Exchange(exchange) => exchange.outcome.is_ok().then_some(exchange.response_time).flatten(),
            _ => None,
        })
        .collect();
    let ms = |span: Option<&Duration>| span.map_or(0.0, |span| span.as_secs_f64() * 1e3);
    let (least, most) = (ms(replies.iter().min()), ms(replies.iter().max()));
    let refused = findings.iter().any(|finding| matches!(finding, Finding::Failed { fault: Fault::Exception(_), .. }));
    match replies.len() {
        0 if refused => "the unit responds, but does not support loopback: line and unit work".to_owned(),
        0 => format!("none of {sent} came back"),
        back => format!("{back} of {sent} came back, {least:.1} to {most:.1} ms"),
    }
}
