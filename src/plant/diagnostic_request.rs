//! What a technician can ask of a line beyond polling.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{
    line::{LineDef, Serial},
    line_check::{TIMEOUT_MIN, WAIT_MAX},
    port_signals::{HOLD_MAX_S, SignalTest},
    sweep::Sweep,
    tag::{Point, Table},
};
use crate::{t, text::translate};

/// Most bytes of a test: the longest frame that Modbus knows, in ASCII.
const SEND_MAX: usize = 513;
/// Most loopbacks of one test.
pub const LOOPBACKS_MAX: u16 = 1_000;
/// Most patterns of one test: each is a finding.
pub const PATTERNS_MAX: u16 = 500;
/// Most serial parameters of one scan: eight baud rates with each of the usual characters, twice.
const SERIALS_MAX: usize = 64;

/// A test of a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Diagnostic {
    /// Sends these bytes as they are, check included, and receives whatever comes back.
    Send(Vec<u8>),
    /// Diagnostics 08/00, return query data, this many times.
    Loopback {
        /// Who is asked.
        unit: u8,
        /// The word that must come back.
        data: u16,
        /// How often.
        count: u16,
    },
    /// Sends patterns that are no frames and expects each back: a loopback plug returns them, or local echo does.
    Pattern {
        /// Data bits of a character: 7 or 8.
        bits: u8,
        /// How many patterns.
        count: u16,
    },
    /// Device identification 2B/0E, and 11 report server id where that is unknown.
    Identify {
        /// Who is asked.
        unit: u8,
    },
    /// Reads registers or bits at once, and one by one if the device does not have them all.
    Read {
        /// Who is asked.
        unit: u8,
        /// Which table.
        table: Table,
        /// First address, 0-based.
        address: u16,
        /// Registers or bits.
        count: u16,
    },
    /// Looks for units.
    Scan(Scan),
    /// Looks for what answers in a table of a unit.
    Sweep(Sweep),
    /// Writes registers or bits once, and reads them back.
    Write(RegisterWrite),
    /// Sets a signal of the port by hand, and puts it back.
    Signal(SignalTest),
}

impl Diagnostic {
    /// Does it need the line for itself? Then nothing is polled meanwhile.
    pub fn is_exclusive(&self) -> bool {
        match self {
            Diagnostic::Scan(scan) => !scan.serials.is_empty(),
            Diagnostic::Signal(_) => true,
            Diagnostic::Send(_)
            | Diagnostic::Loopback { .. }
            | Diagnostic::Pattern { .. }
            | Diagnostic::Identify { .. }
            | Diagnostic::Read { .. }
            | Diagnostic::Sweep(_)
            | Diagnostic::Write(_) => false,
        }
    }

    /// The same as [`Diagnostic::check`], and whether a line with these settings can carry it.
    pub fn check_on(&self, line: &LineDef) -> Result<(), String> {
        self.check()?;
        match self {
            Diagnostic::Signal(test) => test.check_on(line),
            _ => Ok(()),
        }
    }

    /// Can a line carry it? `Err` says why not. A line is never busy with one step for longer than `WAIT_MAX`.
    pub fn check(&self) -> Result<(), String> {
        let within = |what: &str, found: usize, most: usize| match found {
            0 => Err(t!("{what}: none, expected 1 to {most}", what, most)),
            found if most < found => Err(t!("{what}: {found}, expected 1 to {most}", what, found, most)),
            _ => Ok(()),
        };
        match self {
            Diagnostic::Send(bytes) => within(t!("bytes to send"), bytes.len(), SEND_MAX),
            Diagnostic::Loopback { count, .. } => {
                within(t!("loopbacks"), usize::from(*count), usize::from(LOOPBACKS_MAX))
            }
            Diagnostic::Pattern { count, .. } => within(t!("patterns"), usize::from(*count), usize::from(PATTERNS_MAX)),
            Diagnostic::Identify { .. } => Ok(()),
            Diagnostic::Read { table, address, count, .. } => {
                within(t!("registers"), usize::from(*count), if table.is_bits() { 2_000 } else { 125 })?;
                let last = u32::from(*address) + u32::from(*count) - 1;
                if last <= 0xFFFF { Ok(()) } else { Err(t!("address {last}: the last is 65535", last)) }
            }
            Diagnostic::Scan(scan) => scan.check(),
            Diagnostic::Sweep(sweep) => sweep.check(),
            Diagnostic::Write(write) => write.check(),
            Diagnostic::Signal(test) => within(t!("seconds"), usize::from(test.seconds), usize::from(HOLD_MAX_S)),
        }
    }
}

/// In a few words, for the record.
impl std::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Diagnostic::Send(bytes) => {
                f.write_str(t!("send"))?;
                bytes.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
            }
            Diagnostic::Loopback { unit, count, .. } => {
                f.write_str(&t!("loopback unit {unit}, {count} times", unit, count))
            }
            Diagnostic::Pattern { count, .. } => f.write_str(&t!("loopback plug, {count} patterns", count)),
            Diagnostic::Identify { unit } => f.write_str(&t!("identify unit {unit}", unit)),
            Diagnostic::Read { unit, table, address, count } => {
                let (table, place) = (translate(table.word()), format!("{address} / 0x{address:04X}"));
                f.write_str(&t!("read unit {unit} {table} {place}, {count}", unit, table, place, count))
            }
            Diagnostic::Scan(scan) => {
                f.write_str(&t!("scan units {first} to {last}", first = scan.first, last = scan.last))?;
                match scan.serials.len() {
                    0 => Ok(()),
                    count => f.write_str(&t!(" at {count} settings", count)),
                }
            }
            Diagnostic::Sweep(Sweep { unit, table, first, last, .. }) => {
                let table = translate(table.word());
                f.write_str(&t!("map of unit {unit} {table} {first} to {last}", unit, table, first, last))
            }
            Diagnostic::Signal(test) => test.fmt(f),
            Diagnostic::Write(RegisterWrite { unit, table, address, words, expected, .. }) => {
                let text = |words: &[u16]| words.iter().map(u16::to_string).collect::<Vec<_>>().join(" ");
                let (place, old, new) = (table.modicon(*address), text(expected), text(words));
                f.write_str(&t!("write unit {unit} {place}: {old} to {new}", unit, place, old, new))
            }
        }
    }
}

/// A write past all plant files: what a technician sets on a device of which nothing else is known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegisterWrite {
    /// To whom; not 0, because a broadcast cannot be read back.
    pub unit: u8,
    /// Coils or holding registers.
    pub table: Table,
    /// First address, 0-based.
    pub address: u16,
    /// What is written, one a register or bit (0 or 1).
    pub words: Vec<u16>,
    /// What the operator saw there: over anything else nothing is written.
    pub expected: Vec<u16>,
    /// With function 15 or 16 also for one.
    pub multiple: bool,
    /// The registers are a date and time, which go on by themselves: they are set over whatever they show.
    pub clock: Option<Point>,
}

impl RegisterWrite {
    /// One holding register of unit 1 from `old` to `new`, for tests.
    #[cfg(test)]
    pub(crate) fn holding(address: u16, old: u16, new: u16) -> RegisterWrite {
        let (words, expected) = (vec![new], vec![old]);
        RegisterWrite { unit: 1, table: Table::Holding, address, words, expected, multiple: false, clock: None }
    }

    /// Function 5 or 6 for one, 15 or 16 for more, or where the device has only those.
    pub fn function(&self) -> u8 {
        match (self.table.is_bits(), self.words.len() == 1 && !self.multiple) {
            (true, true) => 5,
            (true, false) => 15,
            (false, true) => 6,
            (false, false) => 16,
        }
    }

    fn check(&self) -> Result<(), String> {
        let most = match self.table {
            Table::Coil => 1_968,
            Table::Holding => 123,
            Table::Discrete | Table::Input => return Err(t!("inputs cannot be written").to_owned()),
        };
        let count = self.words.len();
        if self.unit == 0 {
            return Err(t!("unit 0: a broadcast cannot be read back").to_owned());
        }
        if !(1..=most).contains(&count) || self.expected.len() != count {
            return Err(t!("{count} values, expected 1 to {most}", count, most));
        }
        if usize::from(u16::MAX - self.address) < count - 1 {
            return Err(t!("the last address is 65535").to_owned());
        }
        Ok(())
    }
}

/// Where to look for units: one request each, any answer counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    /// First unit address.
    pub first: u8,
    /// Last unit address.
    pub last: u8,
    /// Serial parameters to try; empty for those that the line has. While others are tried the line polls no device.
    pub serials: Vec<Serial>,
    /// How long an answer may take.
    pub timeout: Duration,
}

impl Scan {
    fn check(&self) -> Result<(), String> {
        if self.last < self.first {
            return Err(t!(
                "units {first} to {last}: the first is greater than the last",
                first = self.first,
                last = self.last
            ));
        }
        if !(TIMEOUT_MIN..=WAIT_MAX).contains(&self.timeout) {
            return Err(t!("timeout of the scan: expected 10 to 10000 ms").to_owned());
        }
        if SERIALS_MAX < self.serials.len() {
            return Err(t!(
                "{count} serial settings, expected at most {most}",
                count = self.serials.len(),
                most = SERIALS_MAX
            ));
        }
        match self.serials.iter().find(|serial| !serial.is_usual()) {
            Some(serial) => Err(t!("{serial}: no port supports these settings", serial)),
            None => Ok(()),
        }
    }
}
