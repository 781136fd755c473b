//! The temperature controller FUJI PXR4: settings and measurements at their true addresses, control behind them.
//!
//! ```text
//!  sensor ── filter ── PV ──┬── alarms ── 31007                       one sample of 0.5 s
//!                           ▼
//!  SV ── ramp/soak ── limits ── standby? fault? ── tuning? ── on/off, PID, fuzzy, self ── MV
//! ```

mod alarm;
mod control;
mod display;
mod fuzzy;
pub(super) mod map;
mod program;
mod registers;
mod rule;
mod selftune;
mod tuning;

use std::time::Duration;

use crate::plant::number::to_i16;
use alarm::{Alarm, Setup};
use control::{Control, Law, Settings};
use program::{Mode, Plan, Program, ProgramCommand, Segment};
pub use registers::DECIMALS_AT;
use rule::PidSettings;
use selftune::SelfTuner;
use tuning::{Tuner, TuningStatus};

/// The controller samples, computes and outputs once in this time (data sheet).
pub const SAMPLE: Duration = Duration::from_millis(500);
const SAMPLE_S: f64 = 0.5;

/// What a Pt100 can measure, and the narrowest range, in °C.
const SENSOR_C: (f64, f64) = (-150.0, 600.0);
const NARROWEST_K: f64 = 10.0;
/// Fault word 31008: input open on the upper side, below the range, above it.
const OPEN_UPPER: u16 = 1 << 1;
const BELOW_RANGE: u16 = 1 << 2;
const ABOVE_RANGE: u16 = 1 << 3;
/// Alarm word 31007: alarms 1 to 3, and the burnt-out heater, whose bit is not published: this position is a guess.
const HEATER_BREAK: u16 = 1 << 3;
/// The heater current is evaluated only above this output, after this many samples: it needs some seconds to warm up.
const JUDGED_PERCENT: f64 = 20.0;
const JUDGED_AFTER: u32 = 60;
/// PV runs from −5 to 105 % of the range.
const OVER_RANGE: f64 = 0.05;
/// Mains voltage, to turn the heater's power into the current of the CT input.
const MAINS_V: f64 = 220.0;
/// Saving takes this many samples, 5 s.
const SAVING_SAMPLES: u32 = 10;

/// What is connected to the sensor terminals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sensor {
    /// A Pt100 at this temperature in °C.
    Pt100(f64),
    /// A broken wire: the input drifts to the top of the range.
    Open,
}

/// The controller with its settings, its measurements and its laws.
#[derive(Debug, Clone)]
pub struct Pxr {
    settings: [i16; map::COUNT],
    saves: u32,
    /// Samples until the settings are saved; 0 while nothing is being saved.
    saving: u32,
    pv_c: f64,
    sv_c: f64,
    mv_percent: f64,
    heater_a: f64,
    faults: u16,
    alarms: [Alarm; 3],
    weak_heater: u32,
    control: Control,
    tuner: Option<Tuner>,
    self_tuner: Option<SelfTuner>,
    program: Program,
    command: ProgramCommand,
}

impl Pxr {
    /// As it leaves the workshop of the thesis: SV 70.0 °C, P 5.0 %, I 240 s, D 60 s, running.
    pub fn new(start_c: f64) -> Pxr {
        Pxr {
            settings: map::initial(),
            saves: 0,
            saving: 0,
            pv_c: start_c,
            sv_c: 70.0,
            mv_percent: 0.0,
            heater_a: 0.0,
            faults: 0,
            alarms: <[Alarm; 3]>::default(),
            weak_heater: 0,
            control: Control::default(),
            tuner: None,
            self_tuner: None,
            program: Program::default(),
            command: ProgramCommand::Off,
        }
    }

    /// One sample of [`SAMPLE`]: measures, decides, sets the output.
    pub fn sample(&mut self, sensor: Sensor, heater_w: f64) {
        self.heater_a = heater_w / MAINS_V;
        self.save();
        self.measure(sensor);
        self.sv_c = self.set_value();
        self.mv_percent = self.output();
        self.evaluate_alarms();
    }

    /// Output 1 in percent.
    pub fn mv_percent(&self) -> f64 {
        self.mv_percent
    }

    /// Process value in °C as the controller has it; at the end of the range when the sensor is open.
    pub fn pv_c(&self) -> f64 {
        self.pv_c
    }

    /// Setpoint in use in °C.
    pub fn sv_c(&self) -> f64 {
        self.sv_c
    }

    /// The digital output to the PLC: PV is known and within 1 °C of SV.
    pub fn at_sv(&self) -> bool {
        self.faults == 0 && (self.pv_c - self.sv_c).abs() <= 1.0
    }

    /// How often settings were saved: the memory is good for about 100 000 times.
    pub fn saves(&self) -> u32 {
        self.saves
    }

    fn saving(&self) -> bool {
        self.saving > 0
    }

    fn begin_saving(&mut self) {
        self.saving = SAVING_SAMPLES;
    }

    /// Carries on with a saving.
    fn save(&mut self) {
        let was_saving = self.saving();
        self.saving = self.saving.saturating_sub(1);
        if was_saving && !self.saving() {
            self.settings[map::FIX] = 0;
            self.saves = self.saves.saturating_add(1);
        }
    }

    fn measure(&mut self, sensor: Sensor) {
        let (low_c, high_c) = self.range_c();
        let margin_c = (high_c - low_c) * OVER_RANGE;
        let input_c = match sensor {
            Sensor::Pt100(c) => c,
            Sensor::Open => f64::INFINITY,
        };
        self.faults = match sensor {
            Sensor::Open => OPEN_UPPER | ABOVE_RANGE,
            Sensor::Pt100(c) if c > high_c + margin_c => ABOVE_RANGE,
            Sensor::Pt100(c) if c < low_c - margin_c => BELOW_RANGE,
            Sensor::Pt100(_) => 0,
        };
        let inside = |c: f64| c.clamp(low_c - margin_c, high_c + margin_c);
        let seen_c = inside(input_c);
        let filter_s = self.tenths(map::FILTER);
        // The range may have become narrower since the last sample; the filter would still be outside.
        let before_c = inside(self.pv_c);
        self.pv_c =
            before_c + (seen_c - before_c) * if self.faults == 0 { SAMPLE_S / (SAMPLE_S + filter_s) } else { 1.0 };
    }

    /// The programme moves SV while it runs; in standby it stands still.
    fn set_value(&mut self) -> f64 {
        let command = match self.settings[map::PROGRAM] {
            1 if self.standby() => ProgramCommand::Halt,
            1 => ProgramCommand::Run,
            2 => ProgramCommand::Halt,
            3 => ProgramCommand::End,
            _ => ProgramCommand::Off,
        };
        let mode = self.mode();
        let before = std::mem::replace(&mut self.command, command);
        let plan = self.plan(mode);
        let moving_c = self.program.step(SAMPLE_S, command, &plan, self.pv_c);
        let ended = self.program.ended() && command == ProgramCommand::Run;
        if ended {
            self.settings[map::PROGRAM] = 3;
        }
        let switched_off = command == ProgramCommand::Off && before != ProgramCommand::Off;
        if ended && mode.standby_at_end || switched_off && mode.standby_at_off {
            self.settings[map::STANDBY] = 1;
        }
        // The limits of SV hold for a programme that was written before they were.
        let sv_c = moving_c.unwrap_or_else(|| self.temperature_c(map::SV));
        sv_c.clamp(self.temperature_c(map::SV_LOW), self.temperature_c(map::SV_HIGH))
    }

    /// Steps 1–4, 5–8 or 1–8, as register 41083 selects.
    fn plan(&self, mode: Mode) -> Plan {
        let (first, last) = match self.settings[map::PATTERN] {
            0 => (0, 4),
            1 => (4, 8),
            _ => (0, 8),
        };
        let segment = |step: usize| Segment {
            target_c: self.temperature_c(map::STEP_SV + step),
            ramp_s: f64::from(self.settings[map::STEP_TIMES + 2 * step]) * 60.0,
            soak_s: f64::from(self.settings[map::STEP_TIMES + 2 * step + 1]) * 60.0,
        };
        Plan { first, segments: (first..last).map(segment).collect(), repeat: mode.repeat }
    }

    /// Fail-safe and standby come first, then tuning, then the control law.
    fn output(&mut self) -> f64 {
        if self.faults != 0 || self.standby() {
            self.stop_tuning();
            self.self_tuner = None;
            self.control = Control::default();
            let full = self.settings[map::ACTION] & 1 == 1 && !self.standby();
            return if full { 100.0 } else { 0.0 };
        }
        if let Some(output) = self.tune() {
            return output;
        }
        let pushing = self.tune_itself();
        let settings = self.law();
        let output = self.control.step(SAMPLE_S, self.sv_c, self.pv_c, &settings);
        if pushing { 100.0 } else { output }
    }

    /// The output of the auto-tuning while it runs; at its end P, I and D are written and it is off.
    fn tune(&mut self) -> Option<f64> {
        let command = self.settings[map::TUNE];
        if command == 0 {
            self.tuner = None;
            return None;
        }
        let (sv_c, span_c) = (self.sv_c, self.span_c());
        // The low-PV type tunes 10 % of the range below SV, for processes that must not overshoot.
        let target_c = if command == 2 { sv_c - 0.1 * span_c } else { sv_c };
        match self.tuner.get_or_insert_with(|| Tuner::new(target_c, span_c)).step(SAMPLE_S, self.pv_c) {
            TuningStatus::Running(output) => return Some(if self.cools() { 100.0 - output } else { output }),
            TuningStatus::Failed => {}
            TuningStatus::Done(found) => self.set_pid(found),
        }
        self.stop_tuning();
        self.control = Control::default();
        None
    }

    /// Self-tuning watches and may set P, I and D; true while it wants full power to watch an approach.
    fn tune_itself(&mut self) -> bool {
        if self.settings[map::CONTROL] != 2 || self.cools() {
            self.self_tuner = None;
            return false;
        }
        let (sv_c, pv_c, span_c) = (self.sv_c, self.pv_c, self.span_c());
        let band_k = self.tenths(map::P) / 100.0 * span_c;
        let now = PidSettings { band_k, i_s: self.tenths(map::I), d_s: self.tenths(map::D) };
        let watcher = self.self_tuner.get_or_insert_default();
        let found = watcher.step(SAMPLE_S, sv_c, pv_c, span_c, now);
        let pushing = watcher.pushing();
        if let Some(found) = found {
            self.set_pid(found);
        }
        pushing
    }

    fn set_pid(&mut self, found: PidSettings) {
        let tenths = |value: f64, max: f64| to_i16((value * 10.0).round().clamp(1.0, max));
        self.settings[map::P] = tenths(100.0 * found.band_k / self.span_c(), 9_999.0);
        self.settings[map::I] = tenths(found.i_s, 32_000.0);
        self.settings[map::D] = tenths(found.d_s, 9_999.0);
    }

    fn stop_tuning(&mut self) {
        self.settings[map::TUNE] = 0;
        self.tuner = None;
    }

    /// Alarms rest in standby; the heater current is evaluated while the output asks for some.
    fn evaluate_alarms(&mut self) {
        if self.standby() {
            self.alarms = <[Alarm; 3]>::default();
            self.weak_heater = 0;
            return;
        }
        let sv_set_c = self.temperature_c(map::SV);
        for number in 0..self.alarms.len() {
            let setup = self.alarm_setup(number);
            self.alarms[number].step(SAMPLE_S, &setup, self.pv_c, self.sv_c, sv_set_c);
        }
        let least_a = self.tenths(map::HEATER_BREAK) * self.mv_percent / 100.0;
        let weak = self.mv_percent >= JUDGED_PERCENT && self.heater_a < least_a;
        self.weak_heater = if weak { (self.weak_heater + 1).min(JUDGED_AFTER) } else { 0 };
    }

    fn alarm_setup(&self, number: usize) -> Setup {
        let shape = alarm::shape(self.settings[map::ALARM_TYPE + number]);
        let point = |place: usize, from: Option<alarm::Base>| match from {
            Some(alarm::Base::Zero) => self.temperature_c(place),
            Some(alarm::Base::Sv) | None => self.difference_k(place),
        };
        let low = map::ALARM_POINT + 2 * number;
        Setup {
            shape,
            low: point(low, shape.and_then(|shape| shape.low)),
            high: point(low + 1, shape.and_then(|shape| shape.high)),
            hysteresis_k: self.difference_k(map::ALARM_HYSTERESIS + number),
            delay_s: f64::from(self.settings[map::ALARM_DELAY + number]),
            latch: self.settings[map::ALARM_LATCH + number] == 1,
        }
    }

    fn alarm_word(&self) -> u16 {
        let alarms = self.alarms.iter().enumerate();
        let word = alarms.fold(0, |word, (number, alarm)| word | u16::from(alarm.on()) << number);
        if self.weak_heater >= JUDGED_AFTER { word | HEATER_BREAK } else { word }
    }

    fn law(&self) -> Settings {
        Settings {
            law: if self.settings[map::CONTROL] == 1 { Law::Fuzzy } else { Law::Pid },
            span_c: self.span_c(),
            p_percent: self.tenths(map::P),
            i_s: self.tenths(map::I),
            d_s: self.tenths(map::D),
            hysteresis_c: self.difference_k(map::HYSTERESIS),
            cools: self.cools(),
        }
    }

    fn standby(&self) -> bool {
        self.settings[map::STANDBY] == 1
    }

    fn cools(&self) -> bool {
        self.settings[map::ACTION] & 2 == 2
    }

    fn mode(&self) -> Mode {
        Mode::from_word(self.settings[map::MODE])
    }

    /// A plain setting with one decimal: times, percent, amperes.
    fn tenths(&self, place: usize) -> f64 {
        f64::from(self.settings[place]) / 10.0
    }

    fn temperature_c(&self, place: usize) -> f64 {
        self.display().temperature_c(self.settings[place])
    }

    fn difference_k(&self, place: usize) -> f64 {
        self.display().difference_k(self.settings[place])
    }

    fn range_c(&self) -> (f64, f64) {
        (self.temperature_c(map::RANGE_LOW), self.temperature_c(map::RANGE_HIGH))
    }

    fn span_c(&self) -> f64 {
        let (low_c, high_c) = self.range_c();
        high_c - low_c
    }
}

#[cfg(test)]
mod tests;
