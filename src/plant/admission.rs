//! Whether the polls of a line can all meet their periods: the schedulability, the interval that is overloaded, and warnings, as plain data.

use crate::t;
use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use super::id::{DeviceId, LineId};

/// What the admission test says about a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Admission {
    pub line: LineId,
    /// Share of the line's time that its periodic reads take, 0–1 and beyond.
    pub utilisation: f64,
    /// Can all polls meet their periods?
    pub schedulability: Schedulability,
    /// Can those of the alarm inputs, if all others are left out?
    pub critical: Schedulability,
    /// By what the periods of process values grow where the line has too much to do; 1 is not at all. `None`: the critical
    /// polls leave nothing for them.
    pub factor: Option<f64>,
    /// Time of one read of every periodic block.
    pub cycle: Duration,
    /// What each device costs while it does not answer, in the order of the plant.
    pub dead: Vec<DeadDevice>,
    /// What an engineer should know before the plant runs.
    pub warnings: Vec<Warning>,
}

impl Admission {
    /// What one probe of a device costs the others while it does not answer.
    pub fn dead_cost(&self, device: DeviceId) -> Option<Duration> {
        self.dead.iter().find(|dead| dead.device == device).map(|dead| dead.probe)
    }

    /// Nothing is polled.
    pub fn of_nothing(line: LineId) -> Admission {
        Admission {
            line,
            utilisation: 0.0,
            schedulability: Schedulability::Fits,
            critical: Schedulability::Fits,
            factor: Some(1.0),
            cycle: Duration::ZERO,
            dead: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// Can the polls of a line meet their periods?
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Schedulability {
    /// Each of them, always.
    Fits,
    /// They want more time than there is.
    TooMuch {
        /// Share of the time that they want, above 1.
        utilisation: f64,
    },
    /// There is time enough, but a transaction cannot be interrupted: once in a while one comes in the way of others.
    Blocked(OverloadInterval),
}

impl Schedulability {
    /// Do the polls fit?
    pub fn fits(&self) -> bool {
        match self {
            Schedulability::Fits => true,
            Schedulability::TooMuch { .. } | Schedulability::Blocked(_) => false,
        }
    }
}

/// A span of time in which the demand exceeds the capacity of a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverloadInterval {
    /// How long the span is.
    pub span: Duration,
    /// The time on the wire that it demands.
    pub demand: Duration,
    /// The poll that has just begun and cannot be interrupted.
    pub blocker: PollWords,
    /// The polls that are due meanwhile, the one with the shortest period first; at most three are named.
    pub due: Vec<PollWords>,
    /// How many more are due.
    pub more: usize,
}

/// A poll as an engineer knows it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PollWords {
    /// `TIC-1 input 1000–1007`.
    pub name: String,
    pub period: Duration,
    /// Worst time on the wire.
    pub cost: Duration,
}

/// A device that does not answer: it is probed each 30 s at most, and each probe takes the line until its timeout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeadDevice {
    pub device: DeviceId,
    /// `TIC-1`.
    pub name: String,
    /// What one probe costs the others.
    pub probe: Duration,
    /// What its silence leaves of the line's time to the others: their reads and its probes, 0–1 and beyond.
    pub utilisation: f64,
    /// Can the polls of the others still meet their periods?
    pub schedulability: Schedulability,
}

/// Something that works, or seems to, and is better otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Warning {
    /// A character without parity has two stop bits by the standard (Modbus over serial line V1.02, 2.5.1).
    NoParityOneStopBit,
    /// An answer takes longer on the wire than the timeout of the line.
    TimeoutBelowAnswer { timeout: Duration, answer: Duration, poll: String },
    /// The reads leave less than the share that is kept for operators' writes.
    NoRoomForWrites {
        /// The share, 0–1.
        share: f64,
    },
    /// A serial server passes frames on over a line of which nothing is known here.
    SerialServer,
    /// A serial line has more units than it carries: each is a load, the master too.
    TooManyUnits {
        /// The devices of the plant on it.
        units: u16,
        /// How many there may be.
        most: u16,
        /// The device that permits no more; `None`: RS-485 does not.
        device: Option<String>,
    },
}

/// `fits`, or what does not, in a sentence.
impl fmt::Display for Schedulability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Schedulability::Fits => f.write_str(t!("every poll meets its period")),
            Schedulability::TooMuch { utilisation } => {
                let share = format!("{:.1}", utilisation * 100.0);
                f.write_str(&t!("at worst the polls need {share} % of the line's time", share))
            }
            Schedulability::Blocked(overload) => overload.fmt(f),
        }
    }
}

impl fmt::Display for OverloadInterval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OverloadInterval { span, demand, blocker, due, more } = self;
        let poll = |poll: &PollWords| {
            t!("{name} every {period} ({cost})", name = poll.name, period = seconds(poll.period), cost = ms(poll.cost))
        };
        let due_polls = due.iter().map(poll).collect::<Vec<_>>().join(", ");
        let others = if *more > 0 { t!(" and {more} more", more) } else { String::new() };
        let (span, demand, name, cost) = (ms(*span), ms(*demand), &blocker.name, ms(blocker.cost));
        let when =
            t!("in {span} the line must transfer {demand}: while {name} ({cost}) is read", span, demand, name, cost);
        f.write_str(&match due.len() + more {
            1 => t!("{when}, {due_polls}{others} cannot meet its period", when, due_polls, others),
            _ => t!("{when}, {due_polls}{others} cannot meet their period", when, due_polls, others),
        })
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::NoParityOneStopBit => f.write_str(t!(
                "no parity and one stop bit: fewer errors are detected; the standard requires E or O, or two stop bits"
            )),
            Warning::TimeoutBelowAnswer { timeout, answer, poll } => {
                let (timeout, answer) = (ms(*timeout), ms(*answer));
                f.write_str(&t!(
                    "timeout {timeout} is shorter than a response takes on the wire: {poll} needs {answer}",
                    timeout,
                    poll,
                    answer
                ))
            }
            Warning::NoRoomForWrites { share } => f.write_str(&t!(
                "less than {share} % of the time is left for writes: poll periods stretch during operator writes",
                share = format!("{:.0}", share * 100.0)
            )),
            Warning::SerialServer => {
                f.write_str(t!("a serial server: the time on the line behind it is unknown and not counted"))
            }
            Warning::TooManyUnits { units, most, device: Some(device) } => {
                f.write_str(&t!("{units} units on the line: {device} permits {most} (help wiring)", units, device, most))
            }
            Warning::TooManyUnits { units, most, device: None } => f.write_str(&t!(
                "{units} units and the master on the line: RS-485 carries {most} units of one load (help wiring; units_max for others)",
                units,
                most
            )),
        }
    }
}

/// `150.1 ms`, rounded up.
fn ms(span: Duration) -> String {
    let tenths = span.as_micros().div_ceil(100);
    if tenths.is_multiple_of(10) {
        format!("{} ms", tenths / 10)
    } else {
        format!("{}.{} ms", tenths / 10, tenths % 10)
    }
}

fn seconds(span: Duration) -> String {
    if span < Duration::from_secs(1) { ms(span) } else { format!("{} s", span.as_secs_f64()) }
}
