//! What follows from all findings of a diagnostic, as figures; their words are in the language of who reads them.

use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use super::FINDINGS_MAX;
use crate::{
    plant::{
        fault::ExceptionCode,
        port_signals::{PortSignals, SignalTest},
    },
    t,
};

/// What follows from all findings of a diagnostic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Conclusion {
    /// The unit refuses the loopback: it is there.
    LoopbackRefused,
    /// How many words came back of those sent, and how fast.
    Loopback {
        /// Came back.
        back: usize,
        /// Sent.
        sent: u32,
        /// The fastest and the slowest of them.
        times: (Duration, Duration),
    },
    /// Units that a scan has found, each waited for so long.
    Units(usize, Duration),
    /// What became of the patterns.
    Patterns(PatternTally),
    /// What that says of plug, line and adapter.
    Plug(PatternTally),
    /// How the signals stood while one was held, and after it was put back.
    Signals {
        /// What was asked.
        test: SignalTest,
        /// While it was held.
        held: PortSignals,
        /// Afterwards.
        after: PortSignals,
    },
    /// The addresses of a sweep.
    Sweep {
        /// Why it ended before its last address.
        ended: Option<SweepEnd>,
        /// Ranges that answer.
        ranges: u32,
        /// Addresses that answer, are refused, are silent.
        answers: u32,
        /// See above.
        refused: u32,
        /// See above.
        silent: u32,
        /// How close the probes of a refused block stood.
        every: u8,
        /// Not all ranges are among the findings.
        cut: bool,
    },
    /// The device has answered nothing for so long after it had accepted the connection.
    Deaf(Duration),
}

/// Why a sweep ended before its last address.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum SweepEnd {
    /// The unit refuses the function.
    #[error("{}", t!("the unit refuses function {function} with {code}: it has no such table", function = .function, code = .code))]
    NoTable {
        /// The function that reads the table.
        function: u8,
        /// How it is refused.
        code: ExceptionCode,
    },
    /// This many blocks in a row were not answered, and none before.
    #[error("{}", t!("no response to {count} blocks: what this unit has is unknown", count = .0))]
    Silent(u32),
    /// The unit has fallen silent at this address.
    #[error("{}", t!("no more responses, last request at address {address}: the rest is unknown", address = .0))]
    FellSilent(u16),
}

impl fmt::Display for Conclusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&match self {
            Conclusion::LoopbackRefused => {
                t!("the unit responds, but does not support loopback: line and unit work").to_owned()
            }
            Conclusion::Loopback { back: 0, sent, .. } => t!("none of {sent} came back", sent),
            Conclusion::Loopback { back, sent, times: (least, most) } => {
                let [least, most] = [least, most].map(|span| format!("{:.1}", span.as_secs_f64() * 1e3));
                t!("{back} of {sent} came back, {least} to {most} ms", back, sent, least, most)
            }
            Conclusion::Units(0, timeout) => t!("no unit answers within {ms} ms", ms = timeout.as_millis()),
            Conclusion::Units(1, _) => t!("1 answer").to_owned(),
            Conclusion::Units(count, _) => t!("{count} answers", count),
            Conclusion::Patterns(tally) => return tally.fmt(f),
            Conclusion::Plug(tally) => match (tally.received, tally.faults()) {
                (0, _) => t!("nothing came back: no plug and no local echo, or a faulty transmitter or receiver"),
                (_, 0) => {
                    t!("every byte came back: plug and adapter work. Without a plug this is local echo: the adapter receives what it sends")
                }
                (_, _) => t!("bytes are lost or changed: bad contact or cable, baud rate too high, or another unit sending"),
            }
            .to_owned(),
            Conclusion::Signals { test, held, after } => signals(*test, *held, *after),
            Conclusion::Deaf(span) => {
                let seconds = format!("{:.1}", span.as_secs_f64());
                t!("the device did not respond for the first {seconds} s of the connection", seconds)
            }
            Conclusion::Sweep { ended: Some(ended), answers: 0, refused: 0, silent: 0, .. } => return ended.fmt(f),
            Conclusion::Sweep { ended: Some(ended), .. } => format!("{ended}; {}", self.swept()),
            Conclusion::Sweep { ended: None, .. } => self.swept(),
        })
    }
}

impl Conclusion {
    /// What the addresses of a sweep show.
    fn swept(&self) -> String {
        let Conclusion::Sweep { ranges, answers, refused, silent, every, cut, .. } = *self else {
            return String::new();
        };
        let mut words = match (answers, refused, silent) {
            (0, 0, _) => t!("no response, not even a refusal: what this unit has is unknown").to_owned(),
            (0, _, 0) => t!("only exceptions: none of the requested addresses can be read").to_owned(),
            (0, ..) => t!("nothing can be read; {refused} are refused, {silent} silent", refused, silent),
            (_, 0, 0) => t!("all {answers} answer: this unit does not refuse addresses that it lacks", answers),
            (_, _, 0) => t!("{answers} answer in {ranges} ranges, {refused} are refused", answers, ranges, refused),
            (..) => t!(
                "{answers} answer in {ranges} ranges, {refused} are refused, {silent} silent",
                answers,
                ranges,
                refused,
                silent
            ),
        };
        if 0 < refused && 1 < every {
            words += &t!("; a refused block was read at every {every}th address only", every);
        }
        if cut {
            words += &t!("; only the first {count} ranges are listed", count = FINDINGS_MAX - 1);
        }
        words
    }
}

/// Whether the port did as it was asked, and what followed.
fn signals(test: SignalTest, held: PortSignals, after: PortSignals) -> String {
    let signal = test.signal.word();
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

/// Bytes of a pattern test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct PatternTally {
    /// Sent, and received.
    pub sent: usize,
    /// See above.
    pub received: usize,
    /// Received as another byte.
    pub wrong: usize,
    /// Not received.
    pub missing: usize,
    /// Received without being sent.
    pub extra: usize,
}

impl PatternTally {
    /// Bytes that did not come back as they were sent.
    pub fn faults(&self) -> usize {
        self.wrong + self.missing + self.extra
    }
}

/// `320 bytes sent, 318 received: 1 wrong, 2 missing, 0 more than sent; 0.9 % faults`.
impl fmt::Display for PatternTally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PatternTally { sent, received, wrong, missing, extra } = self;
        let share = format!("{:.1}", 100.0 * self.faults() as f64 / (*sent).max(1) as f64);
        f.write_str(&t!(
            "{sent} bytes sent, {received} received: {wrong} wrong, {missing} missing, {extra} more than sent; {share} % faults",
            sent,
            received,
            wrong,
            missing,
            extra,
            share
        ))
    }
}
