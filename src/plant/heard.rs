//! The line of another master: how long a value stands without being heard again, and what is refused there.

use std::{collections::BTreeSet, time::Duration};

use jiff::Timestamp;

use super::{
    command::{CommandKind, Refusal},
    def::{PlantDef, TagId},
    sample::{Cause, Sample},
    tag::{Poll, TagDef},
    time::elapsed,
};

/// A master that reads a value less often is not followed: the period must stand in the profile.
const PERIOD_MAX: Duration = Duration::from_secs(60);
/// The period of a value that has none in its profile, until it was heard twice.
const UNKNOWN: Duration = Duration::from_secs(20);

/// Why a command is refused that would send something on a line which is only listened to; the port itself may be closed and
/// opened.
pub fn refusal(def: &PlantDef, kind: &CommandKind) -> Option<Refusal> {
    let refused = match kind {
        CommandKind::Refresh(device) => def.listens_on(def.device(*device).line),
        CommandKind::Configure(settings) => def.listens_on(settings.id),
        CommandKind::SaveSettings(line) | CommandKind::Test(line, _) | CommandKind::StopTest(line) => {
            def.listens_on(*line)
        }
        CommandKind::Write { .. }
        | CommandKind::WriteText { .. }
        | CommandKind::Restore(_)
        | CommandKind::StartProcedure(_) => kind.writes(def).any(|(tag, _)| def.listens_to(tag)),
        CommandKind::Connect(..)
        | CommandKind::Alarm(_)
        | CommandKind::ReadSets
        | CommandKind::SaveSet { .. }
        | CommandKind::StopRestore(_)
        | CommandKind::AbortProcedure(_)
        | CommandKind::CorrectCounter { .. }
        | CommandKind::HandOver
        | CommandKind::TakeOver => false,
    };
    refused.then_some(Refusal::OnlyListens)
}

/// When a value has come last, and the last two intervals: one alone may be a pause of the master.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Heard {
    last: Option<Timestamp>,
    intervals: [Option<Duration>; 2],
    /// Why it has not come since.
    pub missed: Option<Cause>,
}

impl Heard {
    /// It has come.
    pub fn hear(&mut self, at: Timestamp) {
        self.missed = None;
        if let Some(last) = self.last.replace(at) {
            self.intervals = [Some(elapsed(last, at)), self.intervals[0]];
        }
    }

    /// It should have come.
    pub fn miss(&mut self, cause: Cause) {
        self.missed = Some(cause);
    }

    /// The period by which its age is measured: that of the profile, or the one at which it is heard, if that is longer.
    pub fn period(&self, poll: Poll) -> Duration {
        let heard = self.intervals.iter().flatten().min().map(|interval| (*interval).min(PERIOD_MAX));
        let stated = match poll {
            Poll::Every(period) => Some(period),
            Poll::Once | Poll::Never => None,
        };
        heard.max(stated).unwrap_or(UNKNOWN)
    }
}

/// What the plant file states of registers that the other master may never read: the tags of which the device has last said
/// something else.
#[derive(Debug, Clone, Default)]
pub(super) struct Stated(BTreeSet<TagId>);

impl Stated {
    /// What was known of a tag under the id that it had before.
    pub fn take_over(&mut self, tag: TagId, before: &Stated, was: TagId) {
        if before.0.contains(&was) {
            self.0.insert(tag);
        }
    }

    /// The sample that a tag gets: what is stated stands for what is not good, until the device contradicts it.
    pub fn instead_of(&mut self, tag: &TagDef, sample: Sample) -> Sample {
        let Some(stated) = tag.stated else { return sample };
        match sample.good_value() {
            Some(value) if value == stated => _ = self.0.remove(&tag.id),
            Some(_) => _ = self.0.insert(tag.id),
            None if !self.0.contains(&tag.id) => return Sample::good(stated, sample.at).uncertain(Cause::Stated),
            None => {}
        }
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        def::LineId,
        diagnostics::{Diagnostic, Scan},
        fixture::{self, SV, TIC},
    };

    #[test]
    fn what_would_send_something_is_refused_on_a_listening_line() {
        let mut def = fixture::plant();
        let line = LineId(0);
        let scan = Scan { first: 1, last: 2, serials: Vec::new(), timeout: Duration::from_secs(1) };
        let sending = [
            CommandKind::Write { tag: SV, value: 1.0.into() },
            CommandKind::Refresh(TIC),
            CommandKind::Configure(Box::new(def.lines[0].clone())),
            CommandKind::SaveSettings(line),
            CommandKind::Test(line, Diagnostic::Scan(scan)),
            CommandKind::StopTest(line),
        ];
        let silent = [CommandKind::Connect(line, false), CommandKind::ReadSets, CommandKind::HandOver];
        for kind in sending.iter().chain(&silent) {
            assert_eq!(refusal(&def, kind), None, "{kind:?} of a line that is polled");
        }
        def.lines[0].listens = true;
        for kind in &sending {
            assert_eq!(refusal(&def, kind), Some(Refusal::OnlyListens), "{kind:?}");
        }
        for kind in &silent {
            assert_eq!(refusal(&def, kind), None, "{kind:?} sends nothing");
        }
    }

    #[test]
    fn a_value_is_measured_by_the_longer_period() {
        let second = Duration::from_secs;
        let check = |times: &[i64], poll: Poll, expect: Duration| {
            let mut heard = Heard::default();
            times.iter().for_each(|at| heard.hear(Timestamp::from_second(*at).expect("a small number")));
            assert_eq!(heard.period(poll), expect, "{times:?} {poll:?}");
        };
        let every = |seconds| Poll::Every(second(seconds));
        check(&[], every(2), second(2));
        check(&[], Poll::Once, second(20));
        check(&[0, 5], every(2), second(5));
        check(&[0, 1, 2], every(2), second(2));
        check(&[0, 5, 10], Poll::Never, second(5));
        // A pause of the master does not let old values stand, nor does one that reads hardly ever.
        check(&[0, 5, 3_600], every(2), second(5));
        check(&[0, 5, 3_600, 3_605], every(2), second(5));
        check(&[0, 3_600, 7_200], every(2), second(60));
        check(&[0, 3_600, 7_200], every(300), second(300));
    }
}
