//! How a device stands, by NAMUR NE 107: one of four letters with its reason, or nothing while all is well.

use crate::t;
use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

pub use super::signal::Signal;
use super::{
    device_time::DeviceTime,
    fault::ExceptionCode,
    line_state::{DeviceState, LineState},
    request_stats::RequestStats,
};

/// Why a device has a signal. Its text is for the operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// An operator has closed the line.
    LineClosed,
    /// A test has the line.
    LineTesting,
    /// The port or connection is gone.
    NotConnected,
    /// The master of its line, which is only listened to, is silent.
    NoTraffic,
    /// It has stopped answering.
    Down,
    /// It is left alone after an action that takes it some time.
    Settling,
    /// Answers come so late that the next ones may come too late.
    Slow {
        /// 99 of 100 answers come within this time.
        p99: Duration,
        /// How long is waited for an answer.
        timeout: Duration,
    },
    /// It takes longer itself than its profile states: the worst case of its polls is no longer what it was at load.
    AboveStated {
        /// The greatest of its latest responses.
        measured: Duration,
        /// What the profile states.
        stated: Duration,
    },
    /// Too many of the latest requests failed.
    Failing {
        /// How many.
        failed: u32,
        /// Out of how many.
        of: u32,
    },
    /// It answers, and none of its latest answers held a value.
    NoValues,
    /// Corrupt or repeated requests.
    Corrupt {
        /// How many.
        corrupt: u64,
        /// Out of how many.
        of: u64,
    },
    /// Answers to requests that had been given up.
    Late(u64),
    /// The device says that its memory has failed (exception 08).
    MemoryParity(u64),
}

impl Reason {
    /// A device that is slower than its profile states.
    pub fn above_stated(time: DeviceTime) -> Option<Reason> {
        Some(Reason::AboveStated { measured: time.above_stated?, stated: time.stated? })
    }

    /// Which signal it gives.
    pub fn signal(self) -> Signal {
        match self {
            Reason::NotConnected | Reason::NoTraffic | Reason::Down | Reason::NoValues => Signal::Failure,
            Reason::LineClosed | Reason::LineTesting | Reason::Settling => Signal::FunctionCheck,
            Reason::Slow { .. } | Reason::AboveStated { .. } | Reason::Failing { .. } => Signal::OutOfSpecification,
            Reason::Corrupt { .. } | Reason::Late(_) | Reason::MemoryParity(_) => Signal::Maintenance,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::LineClosed => f.write_str(t!("line disconnected by an operator")),
            Reason::LineTesting => f.write_str(t!("line in use by a test")),
            Reason::NotConnected => f.write_str(t!("line not connected")),
            Reason::NoTraffic => f.write_str(t!("no traffic heard")),
            Reason::Down => f.write_str(t!("not responding")),
            Reason::Settling => f.write_str(t!("pause after an action")),
            Reason::Slow { p99, timeout } => f.write_str(&t!(
                "responses take {p99} of {timeout} ms",
                p99 = p99.as_millis(),
                timeout = timeout.as_millis()
            )),
            Reason::AboveStated { measured, stated } => f.write_str(&t!(
                "takes up to {measured} ms for a response, its profile states {stated} ms",
                measured = measured.as_millis(),
                stated = stated.as_millis()
            )),
            Reason::Failing { failed, of } => f.write_str(&t!("{failed} of {of} requests failed", failed, of)),
            Reason::NoValues => f.write_str(t!("responds without valid values")),
            Reason::Corrupt { corrupt, of } => {
                f.write_str(&t!("{corrupt} of {of} responses corrupt or repeated", corrupt, of))
            }
            Reason::Late(count) => f.write_str(&t!("{count} late responses", count)),
            Reason::MemoryParity(count) => f.write_str(&t!("memory parity error ({count})", count)),
        }
    }
}

/// What a diagnosis is made from.
#[derive(Debug, Clone, Copy)]
pub struct DiagnosisInput<'a> {
    /// The device.
    pub device: DeviceState,
    /// Its line.
    pub line: &'a LineState,
    /// It is left alone after an action.
    pub settling: bool,
    /// What it has answered lately. Reads that its line had no time for are not its fault, so they do not count.
    pub lately: &'a RequestStats,
    /// How long is waited for an answer; `None` on the line of another master, whose timeout is not known.
    pub timeout: Option<Duration>,
    /// What it takes itself, as far as known.
    pub time: Option<DeviceTime>,
}

/// Fewer requests than these say nothing about shares.
const REQUESTS_MIN: u64 = 20;
/// Share of the timeout that answers may take, in hundredths.
const SLOW_PERCENT: u32 = 80;
/// Share of the recent requests that may fail, in hundredths.
const FAILING_PERCENT: u32 = 10;
/// After this many failures in a row a device is of no use, whatever it answers.
pub const NO_VALUES_AFTER: u32 = 12;
/// Share of requests that may be corrupt or repeated, in hundredths.
const CORRUPT_PERCENT: u64 = 1;

/// The worst that can be said of a device; `None` while it is well, or nothing is known.
pub fn evaluate(input: DiagnosisInput) -> Option<Reason> {
    match input.line {
        LineState::Disconnected => return Some(Reason::LineClosed),
        LineState::Testing => return Some(Reason::LineTesting),
        LineState::Waiting { .. } => return Some(Reason::NotConnected),
        LineState::NoTraffic => return Some(Reason::NoTraffic),
        LineState::Connecting | LineState::Connected => {}
    }
    // A device that is busy with a command has not failed.
    if input.settling {
        return Some(Reason::Settling);
    }
    match input.device {
        DeviceState::Down { .. } => Some(Reason::Down),
        DeviceState::Unknown => None,
        DeviceState::Responding | DeviceState::Failing(_) => {
            let above_stated = || input.time.and_then(Reason::above_stated);
            let out_of_specification = out_of_specification(input.lately, input.timeout).or_else(above_stated);
            out_of_specification.or_else(|| maintenance(input.lately))
        }
    }
}

fn out_of_specification(lately: &RequestStats, timeout: Option<Duration>) -> Option<Reason> {
    let enough = REQUESTS_MIN <= lately.requests;
    let times = timeout.filter(|_| enough).zip(lately.response_time.p99());
    let slow = times.filter(|(timeout, p99)| *timeout * SLOW_PERCENT < *p99 * 100);
    if lately.fails_since(NO_VALUES_AFTER) {
        return Some(Reason::NoValues);
    }
    let (failed, of) = lately.recent();
    if let Some((timeout, p99)) = slow {
        Some(Reason::Slow { p99, timeout })
    } else if enough && of * FAILING_PERCENT <= failed * 100 {
        Some(Reason::Failing { failed, of })
    } else {
        None
    }
}

fn maintenance(lately: &RequestStats) -> Option<Reason> {
    let parity = |(code, count): &(ExceptionCode, u64)| (code.0 == 0x08).then_some(*count);
    let parity: u64 = lately.exceptions.iter().filter_map(parity).sum();
    // What is repeated was corrupt: the greater of the two, not their sum.
    let (corrupt, of) = (lately.corrupt().max(lately.retries), lately.requests);
    if 0 < parity {
        Some(Reason::MemoryParity(parity))
    } else if REQUESTS_MIN <= of && of * CORRUPT_PERCENT <= corrupt * 100 {
        Some(Reason::Corrupt { corrupt, of })
    } else {
        (0 < lately.late).then_some(Reason::Late(lately.late))
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{device_time::SeenTime, fault::Fault};

    const UP: DeviceState = DeviceState::Responding;
    const DOWN: DeviceState = DeviceState::Down { since: Timestamp::UNIX_EPOCH };

    /// `good` answers in `reply_ms`, then these faults.
    fn stats(good: usize, reply_ms: u64, faults: &[Fault]) -> RequestStats {
        let mut stats = RequestStats::default();
        for _ in 0..good {
            stats.count(Ok(()), Some(Duration::from_millis(reply_ms)));
        }
        for fault in faults {
            stats.count(Err(*fault), None);
        }
        stats
    }

    fn check(line: &LineState, device: DeviceState, settling: bool, lately: &RequestStats, expect: &str) {
        let timeout = Some(Duration::from_millis(300));
        let reason = evaluate(DiagnosisInput { device, line, settling, lately, timeout, time: None });
        let words = reason.map(|reason| format!("{} {reason}", reason.signal().word()));
        assert_eq!(words.as_deref().unwrap_or(""), expect);
    }

    #[test]
    fn a_device_slower_than_stated_is_out_of_specification() {
        let ms = Duration::from_millis;
        let of = |times: [u64; 40]| {
            let mut seen = SeenTime::new(Some(ms(30)));
            times.iter().for_each(|time| seen.add(ms(*time)));
            evaluate(DiagnosisInput {
                device: UP,
                line: &LineState::Connected,
                settling: false,
                lately: &stats(30, 12, &[]),
                timeout: Some(ms(300)),
                time: Some(DeviceTime::new(&seen)),
            })
        };
        let mut one_slow = [10; 40];
        one_slow[20] = 90;
        assert_eq!(of(one_slow), None, "one slow response");
        assert_eq!(of([45; 40]), Some(Reason::AboveStated { measured: ms(45), stated: ms(30) }));
    }

    #[test]
    fn the_worst_comes_first() {
        let well = stats(1_000, 12, &[]);
        let waiting = LineState::Waiting { why: "gone".into(), retry_at: Timestamp::UNIX_EPOCH };
        check(&LineState::Connected, UP, false, &well, "");
        check(&LineState::Connected, DeviceState::Unknown, false, &RequestStats::default(), "");
        check(&LineState::Connecting, DeviceState::Unknown, false, &RequestStats::default(), "");
        check(&LineState::Connected, DOWN, false, &well, "F not responding");
        check(&waiting, DOWN, false, &well, "F line not connected");
        check(&LineState::Disconnected, DeviceState::Unknown, false, &well, "C line disconnected by an operator");
        check(&LineState::Testing, DeviceState::Unknown, false, &well, "C line in use by a test");
        check(&LineState::Connected, UP, true, &well, "C pause after an action");
        check(&LineState::Connected, DOWN, true, &well, "C pause after an action");
    }

    #[test]
    fn late_and_missing_answers_are_out_of_specification() {
        let check = |lately: &RequestStats, expect: &str| check(&LineState::Connected, UP, false, lately, expect);
        check(&stats(1_000, 200, &[]), "");
        check(&stats(1_000, 260, &[]), "S responses take 260 of 300 ms");
        check(&stats(10, 260, &[]), "");
        let (device, line, lately) = (UP, &LineState::Connected, &stats(1_000, 260, &[]));
        let unknown = DiagnosisInput { device, line, settling: false, lately, timeout: None, time: None };
        assert_eq!(evaluate(unknown), None, "the timeout of another master is not known");
        check(&stats(94, 12, &[Fault::Timeout; 6]), "");
        check(&stats(93, 12, &[Fault::Timeout; 7]), "S 7 of 64 requests failed");
        check(&stats(3, 12, &[Fault::Timeout; 3]), "");
    }

    #[test]
    fn a_device_that_answers_without_values_has_failed() {
        let check = |lately: &RequestStats, expect: &str| check(&LineState::Connected, UP, false, lately, expect);
        check(&stats(0, 12, &[Fault::Exception(ExceptionCode(4)); 12]), "F responds without valid values");
        check(&stats(100, 12, &[Fault::Exception(ExceptionCode(4)); 12]), "F responds without valid values");
        check(&stats(0, 12, &[Fault::Exception(ExceptionCode(4)); 11]), "");
    }

    #[test]
    fn what_still_works_but_not_as_it_should_asks_for_maintenance() {
        let check = |lately: &RequestStats, expect: &str| check(&LineState::Connected, UP, false, lately, expect);
        let crc = Fault::Crc { got: 1, computed: 2 };
        check(&stats(199, 12, &[crc]), "");
        check(&stats(198, 12, &[crc, crc]), "M 2 of 200 responses corrupt or repeated");
        check(&RequestStats { retries: 1, ..stats(100, 12, &[]) }, "M 1 of 100 responses corrupt or repeated");
        check(&RequestStats { late: 1, ..stats(100, 12, &[]) }, "M 1 late responses");
        check(&stats(100, 12, &[Fault::Exception(ExceptionCode(0x08))]), "M memory parity error (1)");
        check(&stats(100, 12, &[Fault::Exception(ExceptionCode(0x06))]), "");
    }
}
