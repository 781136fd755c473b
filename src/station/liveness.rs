//! Liveness of the station for a watchdog, derived from the reports of its lines, not from a timer.

use std::{sync::Arc, time::Duration};

use crate::plant::{
    Snapshot, diagnostics::DiagnosticState, line_check::WAIT_MAX, line_report::LineReport, line_state::LineState,
    snapshot::LineStatus,
};

/// A connected line that has reported nothing for so long (real time) hangs; it reports about once a second, but not while it
/// waits for answers: see [`stall_max`].
const LINE_MAX: Duration = Duration::from_secs(15);
/// Answers that one turn of a line may wait for in vain: a probe, a loopback and a block, each of them twice.
const WAITS_MAX: u32 = 6;

/// The last report of each line, and when it came.
#[derive(Debug, Default)]
pub struct Liveness {
    lines: Vec<(Option<Arc<LineReport>>, Duration)>,
}

impl Liveness {
    /// Whether every connected line still reports. `now` is real time since any fixed instant.
    pub fn check(&mut self, snapshot: &Snapshot, now: Duration) -> bool {
        self.lines.resize_with(snapshot.lines.len(), || (None, now));
        let alive = snapshot.lines.iter().zip(&mut self.lines).map(|(line, (last, since))| {
            let same = match (&line.report, &*last) {
                (Some(new), Some(old)) => Arc::ptr_eq(new, old),
                (None, None) => true,
                (Some(_), None) | (None, Some(_)) => false,
            };
            // Nothing is polled on a line that is closed, waits, or is given to a test.
            if !same || line.state != LineState::Connected {
                (*last, *since) = (line.report.clone(), now);
            }
            now.saturating_sub(*since) < stall_max(line)
        });
        // Checks every line: stopping at the first silent one would not update the others.
        alive.filter(|alive| !alive).count() == 0
    }
}

/// How long a line may be silent: one turn of its task, with every answer that it waits for missing.
fn stall_max(line: &LineStatus) -> Duration {
    let timeout = line.report.as_ref().map_or(Duration::ZERO, |report| report.settings.timeout);
    let tested = line.test.as_ref().is_some_and(|run| run.state == DiagnosticState::Running);
    LINE_MAX + WAITS_MAX * if tested { timeout.max(WAIT_MAX) } else { timeout }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{Plant, def::LineId, event::Event, fixture};

    #[test]
    fn a_silent_connected_line_fails_the_check() {
        let at = Timestamp::UNIX_EPOCH;
        let mut plant = Plant::new(fixture::shared(), at, 1.0);
        let mut liveness = Liveness::default();
        let mut beats = |plant: &Plant, second| liveness.check(&plant.snapshot(), Duration::from_secs(second));
        assert!(beats(&plant, 0) && beats(&plant, 100), "a line that is not connected yet");
        plant.on_event(Event::Line { at, line: LineId(0), state: LineState::Connected });
        assert!(beats(&plant, 101));
        let report = |plant: &mut Plant| {
            let report = Arc::new(LineReport::new(fixture::plant().lines[0].clone()));
            plant.on_event(Event::Report { at, line: LineId(0), report });
        };
        for second in (102..140).step_by(10) {
            report(&mut plant);
            assert!(beats(&plant, second));
        }
        let timeout = fixture::plant().lines[0].timeout.as_secs_f64();
        let end = 132 + (15.0 + 6.0 * timeout).ceil() as u64;
        assert!(beats(&plant, end - 1));
        assert!(!beats(&plant, end), "15 s and six timeouts after the last report");
        plant.on_event(Event::Line { at, line: LineId(0), state: LineState::Testing });
        assert!(beats(&plant, end + 1));
    }
}
