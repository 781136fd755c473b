//! The faults and their spelling, the same in a scenario file and on screen.

use super::table::{ROWS, Row};
use crate::plant::number::{to_u8, to_u32, to_u64};
use std::{fmt, str::FromStr, time::Duration};

/// What is wrong with a line, a unit on it, its values, or the process behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum InjectedFault {
    /// This many of 100 messages on the line have a wrong bit.
    Noise(u8),
    /// The unit receives nothing and does nothing.
    Silent,
    /// The unit executes requests and answers this much late (plant time).
    Late(Duration),
    /// The unit executes requests; the answer has a wrong CRC or LRC.
    BadCrc,
    /// The unit executes requests; the answer is cut in the middle.
    Cut,
    /// The unit does nothing and answers with this exception code.
    Exception(u8),
    /// What the unit measures stays as it was; everything else goes on.
    Stuck,
    /// The two words of each 32-bit value are of different instants.
    Torn,
    /// The words of each 32-bit value come in the wrong order.
    WordOrder,
    /// The wire of the sensor is broken.
    SensorBurnout,
    /// The heating element is broken.
    HeaterBurnout,
    /// A valve does not move any more.
    ValveStuck(Valve, Position),
    /// TK-1 leaks, this many millilitres a minute.
    Leak(u32),
    /// Pump P-1 does not turn.
    PumpFailed,
    /// Agitator M-1 does not turn.
    AgitatorFailed,
    /// A switch on the panel of the PLC is on, which no command knows of.
    Switch(PanelSwitch),
}

/// A switch on the panel, by the input that it is wired to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PanelSwitch {
    /// X0, the pump P-1.
    Pump,
    /// X1, the agitator M-1.
    Agitator,
    /// X2, valve SV-1.
    Drain,
    /// X3, valve SV-2.
    Fill,
}

/// A fault of values inside good answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueFault {
    /// [`InjectedFault::Stuck`].
    Stuck,
    /// [`InjectedFault::Torn`].
    Torn,
    /// [`InjectedFault::WordOrder`].
    WordOrder,
    /// [`InjectedFault::SensorBurnout`].
    SensorBurnout,
}

/// A valve of the tank.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Valve {
    /// SV-1 empties TK-1.
    Drain,
    /// SV-2 fills TK-1.
    Fill,
}

/// Where a valve is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Position {
    /// Water runs.
    Open,
    /// No water runs.
    Closed,
}

/// What a fault is a fault of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum TargetKind {
    /// A serial line.
    Line,
    /// A unit on a line: what comes back, or does not.
    Unit,
    /// Values inside good answers of a unit.
    Value,
    /// The simulated process.
    Process,
}

/// The number that a fault has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its unit; empty for none.
    pub unit: &'static str,
    /// Least that makes sense.
    pub min: f64,
    /// Most that makes sense.
    pub max: f64,
    /// What a key steps through.
    pub steps: &'static [f64],
}

/// Why a text is no fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FaultSyntaxError {
    /// No fault has this name.
    #[error("unknown fault `{0}`")]
    Unknown(String),
    /// It has no number behind its name where one is needed, one where none is, or one that cannot be.
    #[error("found `{found}`, expected {expected}")]
    Number {
        /// The text.
        found: String,
        /// `late and a time from 50ms to 60s`.
        expected: String,
    },
}

impl InjectedFault {
    /// Every fault, with its usual number, in the order of the page.
    pub fn all() -> impl Iterator<Item = InjectedFault> {
        ROWS.iter().map(|row| row.fault)
    }

    /// Its name, without its number.
    pub fn word(self) -> &'static str {
        self.row().word
    }

    /// What it is a fault of.
    pub fn target_kind(self) -> TargetKind {
        self.row().target_kind
    }

    /// Whether two faults of the same thing cannot both be: the later one takes the place of the earlier.
    pub fn excludes(self, other: InjectedFault) -> bool {
        match (self, other) {
            (InjectedFault::ValveStuck(one, _), InjectedFault::ValveStuck(two, _)) => one == two,
            _ => {
                self.word() == other.word()
                    || (self.target_kind() == TargetKind::Unit && other.target_kind() == TargetKind::Unit)
            }
        }
    }

    /// What its number may be, if it has one.
    pub fn parameter(self) -> Option<Parameter> {
        self.row().parameter
    }

    /// What it does to values; `None` for a fault that leaves them alone.
    pub fn of_values(self) -> Option<ValueFault> {
        match self {
            InjectedFault::Stuck => Some(ValueFault::Stuck),
            InjectedFault::Torn => Some(ValueFault::Torn),
            InjectedFault::WordOrder => Some(ValueFault::WordOrder),
            InjectedFault::SensorBurnout => Some(ValueFault::SensorBurnout),
            InjectedFault::Noise(_)
            | InjectedFault::Silent
            | InjectedFault::Late(_)
            | InjectedFault::BadCrc
            | InjectedFault::Cut
            | InjectedFault::Exception(_)
            | InjectedFault::HeaterBurnout
            | InjectedFault::ValveStuck(..)
            | InjectedFault::Leak(_)
            | InjectedFault::PumpFailed
            | InjectedFault::AgitatorFailed
            | InjectedFault::Switch(_) => None,
        }
    }

    /// Its number, in the unit of [`InjectedFault::parameter`].
    pub fn number(self) -> Option<f64> {
        match self {
            InjectedFault::Noise(percent) => Some(f64::from(percent)),
            InjectedFault::Late(by) => Some(by.as_secs_f64()),
            InjectedFault::Exception(code) => Some(f64::from(code)),
            InjectedFault::Leak(ml_per_min) => Some(f64::from(ml_per_min) / 1e3),
            InjectedFault::Silent
            | InjectedFault::BadCrc
            | InjectedFault::Cut
            | InjectedFault::Stuck
            | InjectedFault::Torn
            | InjectedFault::WordOrder
            | InjectedFault::SensorBurnout
            | InjectedFault::HeaterBurnout
            | InjectedFault::ValveStuck(..)
            | InjectedFault::PumpFailed
            | InjectedFault::AgitatorFailed
            | InjectedFault::Switch(_) => None,
        }
    }

    /// The same fault with another number; `None` if it has none or this one cannot be.
    pub fn with(self, number: f64) -> Option<InjectedFault> {
        let parameter = self.parameter().filter(|parameter| (parameter.min..=parameter.max).contains(&number))?;
        let whole = number.fract() == 0.0 || matches!(parameter.unit, "s" | "l/min");
        whole.then_some(match self {
            InjectedFault::Noise(_) => InjectedFault::Noise(to_u8(number)),
            InjectedFault::Late(_) => InjectedFault::Late(Duration::from_millis(to_u64((number * 1e3).round()))),
            InjectedFault::Exception(_) => InjectedFault::Exception(to_u8(number)),
            InjectedFault::Leak(_) => InjectedFault::Leak(to_u32((number * 1e3).round())),
            other => other,
        })
    }

    /// The same fault with the next greater or smaller of its usual numbers; itself at the end or without a number.
    pub fn step(self, greater: bool) -> InjectedFault {
        let (Some(parameter), Some(number)) = (self.parameter(), self.number()) else { return self };
        let next = if greater {
            parameter.steps.iter().find(|step| **step > number)
        } else {
            parameter.steps.iter().rev().find(|step| **step < number)
        };
        next.and_then(|next| self.with(*next)).unwrap_or(self)
    }
}

/// `silent`, `late 2s`, `leak 0.5 l/min`: what a scenario file has and a screen shows.
impl fmt::Display for InjectedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())?;
        match (self, self.number(), self.parameter()) {
            (InjectedFault::Late(by), ..) if by.subsec_millis() == 0 => write!(f, " {}s", by.as_secs()),
            (InjectedFault::Late(by), ..) => write!(f, " {}ms", by.as_millis()),
            (_, Some(number), Some(Parameter { unit: "", .. })) => write!(f, " {number}"),
            (_, Some(number), Some(parameter)) => write!(f, " {number} {}", parameter.unit),
            (_, None, _) | (_, _, None) => Ok(()),
        }
    }
}

impl FromStr for InjectedFault {
    type Err = FaultSyntaxError;

    /// A fault as [`InjectedFault`] is displayed; a number that is left out is the usual one. Units may be left out but for a time.
    fn from_str(text: &str) -> Result<InjectedFault, FaultSyntaxError> {
        let text = text.trim();
        // The longest name first: `SV-1 stuck open` before any that it might begin with.
        let named =
            |row: &&Row| text.strip_prefix(row.word).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '));
        let longest = ROWS.iter().filter(named).max_by_key(|row| row.word.len());
        let Some(Row { fault, word, .. }) = longest.copied() else {
            return Err(FaultSyntaxError::Unknown(text.to_owned()));
        };
        let rest = text[word.len()..].trim();
        if rest.is_empty() {
            return Ok(fault);
        }
        let number = match fault {
            InjectedFault::Late(_) => rest.parse::<jiff::SignedDuration>().ok().map(|span| span.as_secs_f64()),
            _ => {
                let unit = fault.parameter().map_or("", |parameter| parameter.unit);
                rest.strip_suffix(unit).unwrap_or(rest).trim().parse().ok()
            }
        };
        number
            .and_then(|number| fault.with(number))
            .ok_or_else(|| FaultSyntaxError::Number { found: text.to_owned(), expected: fault.expected() })
    }
}

impl InjectedFault {
    fn expected(self) -> String {
        let word = self.word();
        match (self, self.parameter()) {
            (_, None) => format!("only `{word}`: it has no number"),
            (InjectedFault::Late(_), Some(_)) => "a time from 50ms to 60s, such as `late 2s`".to_owned(),
            (_, Some(Parameter { unit, min, max, .. })) => {
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                let usual = self.number().unwrap_or(min);
                format!("a number from {min} to {max}, such as `{word} {usual}{unit}`")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_written_as_it_is_shown() {
        for fault in InjectedFault::all() {
            assert_eq!(fault.to_string().parse(), Ok(fault));
            assert_eq!(fault.word().parse(), Ok(fault), "its usual number may be left out");
            assert!(fault.excludes(fault), "{fault} twice is once");
            for step in [fault.step(true), fault.step(false)] {
                assert_eq!(step.word(), fault.word());
                assert_eq!(step.to_string().parse(), Ok(step), "{step}");
            }
            assert_eq!(fault.parameter().is_some(), fault.number().is_some());
        }
    }

    #[test]
    fn a_number_may_be_written_in_several_ways_and_is_checked() {
        let check = |text: &str, expect: Result<InjectedFault, &str>| {
            let found = text.parse::<InjectedFault>().map_err(|error| error.to_string());
            assert_eq!(found, expect.map_err(str::to_owned), "{text}");
        };
        check("late 1.5s", Ok(InjectedFault::Late(Duration::from_millis(1500))));
        check("late 700 ms", Ok(InjectedFault::Late(Duration::from_millis(700))));
        check("exception 11", Ok(InjectedFault::Exception(11)));
        check("leak 0.5 l/min", Ok(InjectedFault::Leak(500)));
        check("leak 0.5", Ok(InjectedFault::Leak(500)));
        check("noise 20%", Ok(InjectedFault::Noise(20)));
        check("SV-1 stuck closed", Ok(InjectedFault::ValveStuck(Valve::Drain, Position::Closed)));
        check("late 5", Err("found `late 5`, expected a time from 50ms to 60s, such as `late 2s`"));
        check("noise 101 %", Err("found `noise 101 %`, expected a number from 1 to 100, such as `noise 10 %`"));
        check("exception 2.5", Err("found `exception 2.5`, expected a number from 1 to 255, such as `exception 4`"));
        check("silent 3", Err("found `silent 3`, expected only `silent`: it has no number"));
        check("latency 2s", Err("unknown fault `latency 2s`"));
    }

    #[test]
    fn one_unit_has_one_fault_on_the_line_and_one_valve_one_place() {
        let check = |one: &str, other: &str, expect: bool| {
            let fault = |text: &str| text.parse::<InjectedFault>().expect("a fault");
            assert_eq!(fault(one).excludes(fault(other)), expect, "{one} and {other}");
        };
        check("silent", "late 2s", true);
        check("late 1s", "late 2s", true);
        check("silent", "stuck value", false);
        check("stuck value", "torn value", false);
        check("SV-1 stuck open", "SV-1 stuck closed", true);
        check("SV-1 stuck open", "SV-2 stuck closed", false);
        check("leak 1", "leak 2", true);
        check("leak", "pump failed", false);
    }
}
