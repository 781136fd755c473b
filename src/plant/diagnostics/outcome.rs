//! How a diagnostic has ended, in the words of the record.

use super::{Conclusion, Diagnostic, DiagnosticRun, DiagnosticState, Finding};
use crate::t;

impl DiagnosticRun {
    /// Did all that it was for go well?
    pub fn has_passed(&self) -> bool {
        let found = |is_it: fn(&Finding) -> bool| self.findings.iter().any(is_it);
        let passed = match &self.diagnostic {
            Diagnostic::Send(_)
            | Diagnostic::Loopback { .. }
            | Diagnostic::Pattern { .. }
            | Diagnostic::Read { .. } => self.errors == 0,
            Diagnostic::Identify { .. } => found(|finding| matches!(finding, Finding::Object { .. })),
            Diagnostic::Scan(_) => {
                found(|finding| matches!(finding, Finding::Unit { reply, .. } if reply.is_certain()))
            }
            Diagnostic::Sweep(_) => {
                matches!(self.conclusion(), Some(Conclusion::Sweep { ended: None, answers: 1.., .. }))
            }
            Diagnostic::Write(_) => {
                found(|finding| matches!(finding, Finding::Written(outcome) if outcome.is_success()))
            }
            Diagnostic::Signal(_) => {
                matches!(self.conclusion(), Some(Conclusion::Signals { test, held, .. }) if held.is_on(test.signal) == test.on)
            }
        };
        passed && self.state == DiagnosticState::Done
    }

    /// `passed: 11 requests, no errors; 10 of 10 came back, 3.1 to 4.0 ms`. Nothing of one at work.
    pub fn outcome_text(&self) -> String {
        let (word, why) = match &self.state {
            DiagnosticState::Running => return String::new(),
            DiagnosticState::Done if self.has_passed() => (t!("passed"), self.result(true)),
            DiagnosticState::Done => (t!("failed"), self.result(false)),
            DiagnosticState::Cancelled => (t!("cancelled"), self.written()),
            DiagnosticState::Failed(why) => (
                t!("failed"),
                Some([Some(why.to_string()), self.written()].into_iter().flatten().collect::<Vec<_>>().join("; ")),
            ),
        };
        let requests = match self.requests {
            1 => t!("1 request").to_owned(),
            count => t!("{count} requests", count),
        };
        let errors = match self.errors {
            0 => t!("no errors").to_owned(),
            1 => t!("1 error").to_owned(),
            count => t!("{count} errors", count),
        };
        // A signal is held without a request.
        let counts = (0 < self.requests).then(|| format!("{requests}, {errors}"));
        match counts.into_iter().chain(why).collect::<Vec<_>>().join("; ") {
            none if none.is_empty() => word.to_owned(),
            words => format!("{word}: {words}"),
        }
    }

    fn conclusion(&self) -> Option<&Conclusion> {
        let conclusions = self.findings.iter().filter_map(|finding| {
            let Finding::Conclusion(conclusion) = finding else { return None };
            Some(conclusion)
        });
        { conclusions }.find(|conclusion| !matches!(conclusion, Conclusion::Deaf(_)))
    }

    /// What became of its write.
    fn written(&self) -> Option<String> {
        self.findings.iter().find_map(|finding| {
            let Finding::Written(outcome) = finding else { return None };
            Some(outcome.to_string())
        })
    }

    /// What follows from all of it; else what became of its write, or why it failed.
    fn result(&self, has_passed: bool) -> Option<String> {
        let failed = self.findings.iter().rev().find_map(|finding| {
            let Finding::Failed { fault, .. } = finding else { return None };
            Some(fault.to_string())
        });
        self.conclusion().map(ToString::to_string).or_else(|| self.written()).or(failed.filter(|_| !has_passed))
    }
}
