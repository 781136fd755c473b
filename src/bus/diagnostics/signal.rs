//! The signal test: one signal is held by hand, the others are looked at, and what was held is put back.

use super::{Ask, Job, Step};
use crate::plant::{
    diagnostics::{Conclusion, Diagnostic, Finding},
    port_signals::{LOOK, PortSignals, SignalTest},
};

/// Step `n`: looks while the signal is held, then the putting back.
pub(super) fn step_of(test: &SignalTest, n: u32) -> Step {
    let ask = if n < test.looks() { Ask::Hold(test.signal, test.on) } else { Ask::PutBack };
    Step { serial: None, timeout: None, ask }
}

/// The signals of the first look and of the last, which is after the putting back.
fn ends(findings: &[Finding]) -> Option<(PortSignals, PortSignals)> {
    let mut signals = findings.iter().filter_map(|finding| match finding {
        Finding::Signals { signals, .. } => Some(*signals),
        _ => None,
    });
    let first = signals.next()?;
    Some((first, signals.next_back().unwrap_or(first)))
}

/// How the signals stood while one was held and afterwards; `None` where they were never seen.
pub(super) fn conclusion(test: &SignalTest, findings: &[Finding]) -> Option<Conclusion> {
    ends(findings).map(|(held, after)| Conclusion::Signals { test: *test, held, after })
}

impl Job {
    /// The first look, what is different from the one before, and the last are findings.
    pub(super) fn on_signals(&mut self, signals: PortSignals) {
        let Diagnostic::Signal(test) = self.run.diagnostic else { return };
        let last = self.run.findings.last();
        let same = matches!(last, Some(Finding::Signals { signals: before, .. }) if *before == signals);
        if !same || test.looks() < self.run.done {
            let after = LOOK * self.run.done.min(test.looks());
            self.found(Finding::Signals { after, signals });
        }
    }
}
