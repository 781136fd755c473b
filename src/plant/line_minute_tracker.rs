//! Counts what a line did in each minute, from its running totals.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{id::DeviceId, line_minute::LineMinute, line_report::LineReport, request_stats::RequestStats};

/// The minute that ends `at`, from the totals before and after it. Counters that were reset count from zero.
pub fn minute(line: Arc<str>, before: &LineReport, after: &LineReport, at: Timestamp) -> LineMinute {
    let (old, new) = (&before.counters, &after.counters);
    let restarted = new.requests < old.requests || new.sent_bytes < old.sent_bytes;
    let since = |new: u64, old: u64| if restarted { new } else { new.saturating_sub(old) };
    let devices = devices(after, (!restarted).then_some(before));
    let ms = |span: Option<std::time::Duration>| span.map(|span| span.as_secs_f32() * 1e3);
    let sent_bytes = since(new.sent_bytes, old.sent_bytes);
    let received_bytes = since(new.received_bytes, old.received_bytes);
    LineMinute {
        at,
        line,
        requests: since(new.requests, old.requests),
        ok: since(new.ok, old.ok),
        timeouts: since(new.timeouts, old.timeouts),
        corrupt: since(new.corrupt, old.corrupt),
        exceptions: since(new.exceptions, old.exceptions),
        retries: devices.retries,
        late: since(new.late, old.late),
        missed: since(new.missed, old.missed),
        sent_bytes,
        received_bytes,
        // A line that is not connected reports nothing new: its last figure is not that of this minute.
        utilisation: if sent_bytes + received_bytes == 0 { 0.0 } else { new.utilisation_minute },
        reply_p99_ms: ms(devices.response_time.p99()),
        reply_max_ms: ms(devices.response_time.max()),
    }
}

/// Retries and reply times of all devices of a line since an earlier report.
fn devices(after: &LineReport, before: Option<&LineReport>) -> RequestStats {
    let mut all = RequestStats::default();
    for (device, stats) in &after.devices {
        let since = since(stats, before.and_then(|before| before.device(*device)));
        all.retries += since.retries;
        all.response_time.merge(&since.response_time);
    }
    all
}

fn since(stats: &RequestStats, before: Option<&RequestStats>) -> RequestStats {
    before.map_or_else(|| stats.clone(), |before| stats.since(before))
}

/// Earlier reports of a line, to count the difference.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct LineMinuteTracker {
    /// The running minute, and the totals at its beginning.
    minute: Option<(i64, Arc<LineReport>)>,
    /// The totals ten to twenty minutes ago, and those of at most ten minutes ago.
    older: Option<Arc<LineReport>>,
    newer: Option<(Timestamp, Arc<LineReport>)>,
}

/// "Lately" reaches back once to twice as far, seconds.
const LATELY_S: i64 = 600;

impl LineMinuteTracker {
    /// Time passes. At the end of a minute: its figures.
    pub fn tick(&mut self, at: Timestamp, line: &str, report: &Arc<LineReport>) -> Option<LineMinute> {
        match &self.newer {
            Some((since, _)) if at.as_second() - since.as_second() < LATELY_S => {}
            _ => {
                self.older = self.newer.take().map(|(_, report)| report);
                self.newer = Some((at, report.clone()));
            }
        }
        let number = at.as_second().div_euclid(60);
        let Some((_, before)) = self.minute.take_if(|(running, _)| *running != number) else {
            self.minute.get_or_insert_with(|| (number, report.clone()));
            return None;
        };
        self.minute = Some((number, report.clone()));
        let end = Timestamp::from_second(number * 60).unwrap_or(at);
        Some(minute(line.into(), &before, report, end))
    }

    /// What a device has answered lately.
    pub fn lately(&self, report: &LineReport, device: DeviceId) -> RequestStats {
        // Since the start, as long as that is not long ago.
        let before = self.older.as_deref();
        let now = report.device(device).cloned().unwrap_or_default();
        since(&now, before.and_then(|before| before.device(device)))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::plant::{
        fault::Fault,
        fixture::{self, TIC},
        line_state::LineCounters,
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// This many good answers in `reply_ms`, this many timeouts.
    fn report(good: u64, reply_ms: u64, timeouts: u64) -> LineReport {
        let mut stats = RequestStats::default();
        for _ in 0..good {
            stats.count(Ok(()), Some(Duration::from_millis(reply_ms)));
        }
        for _ in 0..timeouts {
            stats.count(Err(Fault::Timeout), None);
        }
        let requests = good + timeouts;
        LineReport {
            counters: LineCounters {
                requests,
                ok: good,
                timeouts,
                sent_bytes: 8 * requests,
                received_bytes: 21 * good,
                utilisation_minute: 0.6,
                ..LineCounters::default()
            },
            devices: vec![(TIC, stats)],
            ..LineReport::new(fixture::plant().lines[0].clone())
        }
    }

    #[test]
    fn a_minute_is_the_difference_of_its_totals() {
        let minute = minute("L1".into(), &report(100, 10, 0), &report(155, 10, 5), at(120));
        assert_eq!((minute.requests, minute.ok, minute.timeouts), (60, 55, 5));
        assert_eq!((minute.sent_bytes, minute.received_bytes), (480, 55 * 21));
        assert_eq!(minute.failed(), Some(5.0 / 60.0));
        assert_eq!(minute.utilisation, 0.6);
        assert!(minute.reply_p99_ms.is_some_and(|ms| (10.0..12.1).contains(&ms)), "{:?}", minute.reply_p99_ms);
    }

    #[test]
    fn a_slow_past_does_not_slow_this_minute() {
        let (before, mut after) = (report(50, 400, 0), report(50, 400, 0));
        for _ in 0..10 {
            after.devices[0].1.count(Ok(()), Some(Duration::from_millis(10)));
        }
        after.counters = LineCounters { requests: 60, ok: 60, sent_bytes: 480, ..after.counters };
        let minute = minute("L1".into(), &before, &after, at(60));
        assert!(minute.reply_max_ms.is_some_and(|ms| ms < 12.1), "{:?}", minute.reply_max_ms);
    }

    #[test]
    fn counters_that_were_reset_count_from_zero() {
        let minute = minute("L1".into(), &report(1_000, 400, 9), &report(20, 10, 1), at(60));
        assert_eq!((minute.requests, minute.ok, minute.timeouts), (21, 20, 1));
        assert!(minute.reply_max_ms.is_some_and(|ms| ms < 12.1), "{:?}", minute.reply_max_ms);
    }

    #[test]
    fn a_line_that_says_nothing_new_is_idle() {
        let minute = minute("L1".into(), &report(10, 10, 0), &report(10, 10, 0), at(60));
        assert_eq!((minute.requests, minute.failed(), minute.reply_p99_ms), (0, None, None));
        assert_eq!(minute.utilisation, 0.0);
    }

    #[test]
    fn every_minute_is_reported_once_at_its_end() {
        let mut watch = LineMinuteTracker::default();
        let mut minutes = Vec::new();
        for second in 30..250 {
            let report = Arc::new(report(second as u64, 10, 0));
            minutes
                .extend(watch.tick(at(second), "L1", &report).map(|minute| (minute.at.as_second(), minute.requests)));
        }
        assert_eq!(minutes, [(60, 30), (120, 60), (180, 60), (240, 60)]);
    }

    #[test]
    fn lately_forgets_what_was_long_ago() {
        let mut watch = LineMinuteTracker::default();
        let lately = |watch: &LineMinuteTracker, report: &LineReport| watch.lately(report, TIC).timeouts;
        let bad = Arc::new(report(100, 10, 50));
        watch.tick(at(0), "L1", &Arc::new(report(0, 10, 0)));
        watch.tick(at(300), "L1", &bad);
        assert_eq!(lately(&watch, &bad), 50);
        watch.tick(at(601), "L1", &bad);
        assert_eq!(lately(&watch, &bad), 50, "not yet twice ten minutes");
        watch.tick(at(1_202), "L1", &bad);
        assert_eq!(lately(&watch, &bad), 0);
    }

    #[test]
    fn a_line_that_only_listens_has_a_load() {
        let heard = |requests: u64| {
            let mut report = report(requests, 10, 0);
            report.counters.sent_bytes = 0;
            report
        };
        let minute = minute("L1".into(), &heard(100), &heard(160), at(120));
        assert_eq!((minute.requests, minute.received_bytes), (60, 60 * 21));
        assert_eq!(minute.utilisation, 0.6);
    }
}
