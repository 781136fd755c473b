//! The signal test: one signal is held by hand, the others are looked at, and what was held is put back.

use super::{Ask, Job, Step};
use crate::{
    plant::{
        diagnostics::{Diagnostic, Finding},
        port_signals::{LOOK, PortSignals, SignalTest},
    },
    t,
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

/// Whether the port did as it was asked, and what followed.
pub(super) fn conclusion(test: &SignalTest, findings: &[Finding]) -> String {
    let signal = test.signal.word();
    let Some((held, after)) = ends(findings) else { return String::new() };
    if held.is_on(test.signal) != test.on {
        return t!("the port did not set {signal}: its driver or adapter has no such output", signal);
    }
    let of = |signals: PortSignals| signals.all().into_iter().skip(2);
    let followed = of(held).zip(of(after)).filter(|(held, after)| held != after).map(|((name, _), _)| name);
    match followed.collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => t!("{signal} was set and put back; no input changed with it", signal),
        inputs => t!("{signal} was set and put back; with it changed {inputs}", signal, inputs),
    }
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
