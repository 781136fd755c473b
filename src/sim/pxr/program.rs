//! The ramp/soak programme: a setpoint that moves by itself through up to eight steps.

use crate::plant::number::to_u16;

/// What register 41082 asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProgramCommand {
    /// No programme: the SV of the front panel holds.
    Off,
    /// Run from the beginning, or on from a halt.
    Run,
    /// Stand still.
    Halt,
    /// It has run to its end, and the last SV holds.
    End,
}

/// One step: a ramp to a temperature, then a soak at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// SV at the end of the ramp.
    pub target_c: f64,
    /// Duration of the ramp.
    pub ramp_s: f64,
    /// Duration of the soak.
    pub soak_s: f64,
}

/// The selected steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Place of the first selected step, 0 or 4.
    pub first: usize,
    /// The steps in order.
    pub segments: Vec<Segment>,
    /// Begin again at the end.
    pub repeat: bool,
}

/// What happens at the ends (register 41081; the bits are remembered of the family).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Bit 0: standby when the programme has ended; else the last SV holds.
    pub standby_at_end: bool,
    /// Bit 1: standby when the programme is switched off; else the SV of the front panel holds.
    pub standby_at_off: bool,
    /// Bit 2: begin again at the end.
    pub repeat: bool,
}

impl Mode {
    /// From the word of 41081.
    pub fn from_word(word: i16) -> Mode {
        let bit = |number: u8| word >> number & 1 == 1;
        Mode { standby_at_end: bit(0), standby_at_off: bit(1), repeat: bit(2) }
    }
}

/// Where the programme is.
#[derive(Debug, Clone, Default)]
pub struct Program {
    position: u16,
    elapsed_s: f64,
    start_c: f64,
    sv_c: f64,
}

/// Position after the last soak (register 31009).
const END: u16 = 17;

impl Program {
    /// The setpoint in use, or `None` when the SV of the front panel holds. The first ramp begins at PV.
    pub fn step(&mut self, dt_s: f64, command: ProgramCommand, plan: &Plan, pv_c: f64) -> Option<f64> {
        match command {
            ProgramCommand::Off => *self = Program::default(),
            ProgramCommand::Run if self.position == 0 || self.ended() => {
                *self = Program { position: 1, elapsed_s: 0.0, start_c: pv_c, sv_c: pv_c };
                self.advance(dt_s, plan);
            }
            ProgramCommand::Run => self.advance(dt_s, plan),
            ProgramCommand::Halt | ProgramCommand::End => {}
        }
        (self.position != 0).then_some(self.sv_c)
    }

    /// Position for register 31009: 0 off, 1 ramp 1, 2 soak 1 … 16 soak 8, 17 end.
    pub fn position(&self) -> u16 {
        self.position
    }

    /// Whether the last soak is over.
    pub fn ended(&self) -> bool {
        self.position == END
    }

    /// Each pass leaves one ramp or soak behind; a repeated programme takes some time, so a sample comes to its end.
    fn advance(&mut self, dt_s: f64, plan: &Plan) {
        self.elapsed_s += dt_s;
        if self.position == 1 && plan.first != 0 {
            self.position = 1 + 2 * to_u16(plan.first);
        }
        let lasts = plan.segments.iter().any(|segment| segment.ramp_s + segment.soak_s > 0.0);
        while !self.ended() {
            // Another pattern may have been selected meanwhile; then the step is not in the plan, and that is the end.
            let index = (usize::from(self.position - 1) / 2).checked_sub(plan.first);
            let Some(segment) = index.and_then(|index| plan.segments.get(index)) else {
                if plan.repeat && lasts {
                    self.position = 1 + 2 * to_u16(plan.first);
                    continue;
                }
                self.position = END;
                return;
            };
            let ramping = self.position % 2 == 1;
            let length_s = if ramping { segment.ramp_s } else { segment.soak_s };
            let along = if ramping && length_s > 0.0 { (self.elapsed_s / length_s).min(1.0) } else { 1.0 };
            self.sv_c = self.start_c + (segment.target_c - self.start_c) * along;
            if self.elapsed_s < length_s {
                return;
            }
            self.elapsed_s -= length_s;
            self.start_c = segment.target_c;
            self.position += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(first: usize, at_s: f64, expect: (f64, u16)) {
        let segments = vec![
            Segment { target_c: 50.0, ramp_s: 60.0, soak_s: 120.0 },
            Segment { target_c: 80.0, ramp_s: 0.0, soak_s: 60.0 },
        ];
        let plan = Plan { first, segments, repeat: false };
        let mut program = Program::default();
        let mut sv_c = None;
        for _ in 0..(at_s / 0.5) as usize {
            let command = if program.ended() { ProgramCommand::End } else { ProgramCommand::Run };
            sv_c = program.step(0.5, command, &plan, 20.0);
        }
        let sv_c = sv_c.expect("a running programme has a setpoint");
        assert!((sv_c - expect.0).abs() < 1e-6 && program.position() == expect.1, "{at_s} s: {sv_c} {program:?}");
    }

    #[test]
    fn the_set_value_ramps_and_soaks() {
        check(0, 30.0, (35.0, 1));
        check(0, 90.0, (50.0, 2));
        check(0, 200.0, (80.0, 4));
        check(0, 300.0, (80.0, 17));
        check(4, 30.0, (35.0, 9));
    }

    #[test]
    fn halt_stands_still_and_off_gives_the_face_back() {
        let plan =
            Plan { first: 0, segments: vec![Segment { target_c: 50.0, ramp_s: 60.0, soak_s: 0.0 }], repeat: false };
        let mut program = Program::default();
        let running = program.step(0.5, ProgramCommand::Run, &plan, 20.0);
        assert_eq!(program.step(0.5, ProgramCommand::Halt, &plan, 20.0), running);
        assert_eq!(program.step(0.5, ProgramCommand::Off, &plan, 20.0), None);
    }

    #[test]
    fn a_repeated_programme_begins_again_and_an_empty_one_ends() {
        let segment = |minutes| Segment { target_c: 50.0, ramp_s: 60.0 * minutes, soak_s: 60.0 * minutes };
        let check = |minutes, positions: [u16; 3]| {
            let plan = Plan { first: 0, segments: vec![segment(minutes)], repeat: true };
            let mut program = Program::default();
            let mut seen = [0; 3];
            for place in &mut seen {
                for _ in 0..84 {
                    program.step(0.5, ProgramCommand::Run, &plan, 20.0);
                }
                *place = program.position();
            }
            assert_eq!(seen, positions, "{minutes} min");
        };
        check(0.5, [2, 1, 1]);
        check(0.0, [END; 3]);
    }
}
