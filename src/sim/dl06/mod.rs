//! The PLC KOYO DL06: inputs, outputs, relays and V memory at their true addresses, and the scan that runs the plant.

mod memory;
pub mod sequence;

use std::time::Duration;

use memory::{Kind, Memory};
use sequence::{Conditions, Sequence, Step};

use super::pdu::{Identity, Registers};
use super::tank::{Actuators, Readings, control_level_cm};
use crate::plant::fault::ExceptionCode;
use crate::plant::{def::Limits, number::to_u16, tag::Table};

/// Time of one scan.
pub const SCAN: Duration = Duration::from_millis(100);

/// No heating below this level of TK-1, in cm.
const HEAT_MIN_CM: f64 = 5.0;
/// No filling above this level of TK-1, in cm; a batch that is larger than this moves the limit to just above itself.
const FILL_MAX_CM: f64 = 28.0;
const FILL_MARGIN_CM: f64 = 0.3;

/// Panel switch X0–X3 and the controller's signal X4.
const X_AT_SV: u16 = 4;
/// Our allocation of the C relays. Levels, not pulses: a write can be verified by reading it back.
const C_RUN: u16 = 0;
const C_AUTO: u16 = 1;
const C_PUMP: u16 = 2;
const C_AGITATOR: u16 = 3;
const C_DRAIN: u16 = 4;
const C_FILL: u16 = 5;
const C_HEATER: u16 = 6;
const C_FAULT: u16 = 7;
/// V2000 step, V2001 seconds left in a timed step, V2002 batches done: BCD, as ladder programs keep numbers.
const V_STEP: u16 = 0o2000;
/// V2003: what the interlocks block now, wanted or not, one bit each (see [`Blocked`]).
const V_BLOCKED: u16 = 0o2003;
/// V2004: litres of the next fill in tenths, BCD. A master may write it; the programme corrects what is out of bounds.
const V_FILL: u16 = 0o2004;
/// Least, usual and greatest fill in tenths of a litre: three litres cover the heater, twenty are all the water there is.
const FILL_DL: (u16, u16, u16) = (30, 50, 200);
/// V2010 and on: measurements that the real rig lacks, as plain binary words.
const V_SIGNALS: u16 = 0o2010;

/// The last object is long, so that all of them do not fit into one answer.
const OBJECTS: [(u8, &str); 7] = [
    (0x00, "KOYO"),
    (0x01, "D0-06DD1"),
    (0x02, env!("CARGO_PKG_VERSION")),
    (0x03, "https://www.koyoele.co.jp"),
    (0x04, "DirectLOGIC 06 (simulated)"),
    (0x05, "DL06"),
    (
        0x06,
        "water tank: fills TK-1 from TK-2 through valve SV-2, heats while agitator M-1 turns, holds at the setpoint of \
             TIC-1 for three minutes, drains to TK-3 through valve SV-1, cools, pumps back to TK-2 with P-1, begins again",
    ),
];

/// The outputs as the lamps show them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outputs {
    /// Y0: pump P-1.
    pub pump: bool,
    /// Y1: agitator M-1.
    pub agitator: bool,
    /// Y2: valve SV-1, drains TK-1.
    pub drain_valve: bool,
    /// Y3: valve SV-2, fills TK-1.
    pub fill_valve: bool,
    /// Y4: contactor of the heater; the controller sets its power.
    pub heater: bool,
}

/// What the interlocks block, from the levels alone: an operator can read why before a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Blocked {
    /// Bit 0: no heating, the water of TK-1 does not cover the heater.
    pub heating: bool,
    /// Bit 1: no filling, TK-1 is full.
    pub filling: bool,
    /// Bit 2: no pumping, TK-2 is full.
    pub pumping: bool,
}

impl Blocked {
    /// The word in V2003.
    pub fn word(self) -> u16 {
        u16::from(self.heating) | u16::from(self.filling) << 1 | u16::from(self.pumping) << 2
    }
}

/// The PLC with its memory and its programme.
#[derive(Debug, Clone)]
pub struct Dl06 {
    memory: Memory,
    sequence: Sequence,
    driving: bool,
    /// Litres of a fill, in tenths, as last understood.
    fill_dl: u16,
}

impl Dl06 {
    /// Stopped, in manual, everything off.
    pub fn new() -> Dl06 {
        let mut memory = Memory::new();
        memory.set_block(V_FILL, &[bcd(FILL_DL.1)]);
        Dl06 { memory, sequence: Sequence::default(), driving: false, fill_dl: FILL_DL.1 }
    }

    /// Sets RUN and AUTO, as an operator would.
    pub fn start(&mut self) {
        self.memory.bank_mut(Kind::C).set(C_RUN, true);
        self.memory.bank_mut(Kind::C).set(C_AUTO, true);
    }

    /// Turns a panel switch X0–X3 (pump, agitator, valve SV-1, valve SV-2); others do not exist.
    pub fn set_switch(&mut self, switch: u16, on: bool) {
        if switch < X_AT_SV {
            self.memory.bank_mut(Kind::X).set(switch, on);
        }
    }

    /// One scan: reads inputs, runs the programme, writes outputs and V memory. While stopped, outputs stay as written.
    pub fn scan(&mut self, at_sv: bool, readings: &Readings) {
        self.memory.bank_mut(Kind::X).set(X_AT_SV, at_sv);
        self.accept_fill();
        let fill_cm = self.fill_cm();
        let c = |relay| self.memory.bank(Kind::C).get(relay);
        let (run, auto) = (c(C_RUN), c(C_AUTO));
        if run && auto {
            self.sequence.advance(SCAN, &Conditions { at_sv, fill_cm, readings });
        } else if !run {
            self.sequence.stop();
        }
        if run {
            let wanted = if auto { self.sequence.outputs() } else { self.manual() };
            self.set_outputs(permit(wanted, self.blocked(readings)));
        } else if self.driving {
            self.set_outputs(Outputs::default());
        }
        self.driving = run;
        self.memory.bank_mut(Kind::C).set(C_FAULT, self.sequence.fault());
        self.publish(readings);
    }

    /// What reaches the plant. The interlocks are wired behind the outputs: they hold even where lamps were forced on.
    pub fn actuators(&self, readings: &Readings, mv_percent: f64) -> Actuators {
        let outputs = permit(self.outputs(), self.blocked(readings));
        Actuators {
            pump: outputs.pump,
            agitator: outputs.agitator,
            drain_valve: outputs.drain_valve,
            fill_valve: outputs.fill_valve,
            heater_percent: if outputs.heater { mv_percent } else { 0.0 },
        }
    }

    /// The outputs as they are now.
    pub fn outputs(&self) -> Outputs {
        let y = |output| self.memory.bank(Kind::Y).get(output);
        Outputs { pump: y(0), agitator: y(1), drain_valve: y(2), fill_valve: y(3), heater: y(4) }
    }

    /// The step of the sequence.
    pub fn step(&self) -> Step {
        self.sequence.step()
    }

    /// Whether the sequence stands because a step took too long.
    pub fn fault(&self) -> bool {
        self.sequence.fault()
    }

    /// What the interlocks block at these levels.
    pub fn blocked(&self, readings: &Readings) -> Blocked {
        Blocked {
            heating: readings.level_cm < HEAT_MIN_CM,
            filling: readings.level_cm > FILL_MAX_CM.max(self.fill_cm() + FILL_MARGIN_CM),
            pumping: readings.cold_full,
        }
    }

    /// Takes V2004 over, within its bounds; what is not a number there is put right again.
    fn accept_fill(&mut self) {
        let written = self.memory.word(V_FILL).ok().and_then(from_bcd);
        self.fill_dl = written.unwrap_or(self.fill_dl).clamp(FILL_DL.0, FILL_DL.2);
        self.memory.set_block(V_FILL, &[bcd(self.fill_dl)]);
    }

    /// The level that a batch is filled to.
    fn fill_cm(&self) -> f64 {
        control_level_cm(f64::from(self.fill_dl) / 10.0)
    }

    /// Each output follows its panel switch or its relay.
    fn manual(&self) -> Outputs {
        let on = |switch, relay| self.memory.bank(Kind::X).get(switch) || self.memory.bank(Kind::C).get(relay);
        Outputs {
            pump: on(0, C_PUMP),
            agitator: on(1, C_AGITATOR),
            drain_valve: on(2, C_DRAIN),
            fill_valve: on(3, C_FILL),
            heater: self.memory.bank(Kind::C).get(C_HEATER),
        }
    }

    /// The ladder drives what is wired; what was written to the other outputs stays.
    fn set_outputs(&mut self, outputs: Outputs) {
        let lit = [outputs.pump, outputs.agitator, outputs.drain_valve, outputs.fill_valve, outputs.heater];
        for (output, on) in (0..).zip(lit) {
            self.memory.bank_mut(Kind::Y).set(output, on);
        }
    }

    fn publish(&mut self, readings: &Readings) {
        let bcd_words =
            [u16::from(self.step().number()), self.sequence.seconds_left(), self.sequence.batches()].map(bcd);
        let word = |value: f64, per_unit: f64| to_u16((value * per_unit).round().clamp(0.0, 65_535.0));
        let signals = [
            word(readings.level_cm, 10.0),
            word(readings.cold_l, 10.0),
            word(readings.hot_l, 10.0),
            word(readings.flow_in, 100.0),
            word(readings.flow_out, 100.0),
            word(readings.flow_pump, 100.0),
            word(readings.heater_w, 1.0),
        ];
        self.memory.set_block(V_STEP, &bcd_words);
        self.memory.set_block(V_BLOCKED, &[self.blocked(readings).word()]);
        self.memory.set_block(V_SIGNALS, &signals);
    }
}

impl Default for Dl06 {
    fn default() -> Dl06 {
        Dl06::new()
    }
}

/// The interlocks: no heating with too little water, no filling of a full TK-1, no pumping into a full TK-2.
fn permit(outputs: Outputs, blocked: Blocked) -> Outputs {
    Outputs {
        heater: outputs.heater && !blocked.heating,
        fill_valve: outputs.fill_valve && !blocked.filling,
        pump: outputs.pump && !blocked.pumping,
        ..outputs
    }
}

/// Four decimal digits in one word; 9999 is the most it can say.
fn bcd(value: u16) -> u16 {
    let digit = |weight: u16| value.min(9999) / weight % 10;
    digit(1000) << 12 | digit(100) << 8 | digit(10) << 4 | digit(1)
}

/// The number in four decimal digits, unless one of them is none.
fn from_bcd(word: u16) -> Option<u16> {
    [12, 8, 4, 0].iter().try_fold(0, |number, shift| {
        let digit = word >> shift & 0xF;
        (digit <= 9).then_some(number * 10 + digit)
    })
}

/// The PLC's manual names 01–06, 0F and 10; the simulator supports all others too, for diagnostic tools.
impl Registers for Dl06 {
    fn functions(&self) -> &[u8] {
        &[0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x0B, 0x0C, 0x0F, 0x10, 0x11, 0x16, 0x17, 0x18, 0x2B]
    }

    fn limits(&self) -> Limits {
        Limits::STANDARD
    }

    fn identity(&self) -> Identity {
        Identity { server_id: 6, objects: OBJECTS.map(|(id, text)| (id, text.to_owned())).to_vec() }
    }

    fn bit(&self, table: Table, address: u16) -> Result<bool, ExceptionCode> {
        self.memory.bit(table, address)
    }

    fn write_bit(&mut self, address: u16, on: bool) -> Result<(), ExceptionCode> {
        self.memory.write_coil(address, on)
    }

    /// Functions 03 and 04 both read V memory.
    fn word(&self, _: Table, address: u16) -> Result<u16, ExceptionCode> {
        self.memory.word(address)
    }

    fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode> {
        self.memory.write_word(address, value)
    }

    /// The relays C0–C7: run, automatic, four commands, fault.
    fn exception_status(&self) -> u8 {
        (C_RUN..=C_FAULT).fold(0, |status, relay| status | u8::from(self.memory.bank(Kind::C).get(relay)) << relay)
    }

    fn running(&self) -> bool {
        self.memory.bank(Kind::C).get(C_RUN)
    }
}

#[cfg(test)]
mod tests;
