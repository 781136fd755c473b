//! The temperature controller FUJI PXR4: settings and measurements at their true addresses, control behind them.

mod control;
mod map;
mod program;
mod registers;
mod tuning;

use std::time::Duration;

use control::{Control, Law, Settings};
use program::{Command, Plan, Program, Segment};
use tuning::{Tuner, Verdict};

/// The controller samples, computes and outputs once in this time (data sheet).
pub const SAMPLE: Duration = Duration::from_millis(500);
const SAMPLE_S: f64 = 0.5;

/// Deviation alarm 1: on above SV + 5 °C, off again 1 °C lower. Its registers are not known, so it is fixed here.
const ALARM_DEVIATION_C: f64 = 5.0;
const ALARM_HYSTERESIS_C: f64 = 1.0;
/// Fault word 31008: input open on the upper side, below the range, above it.
const OPEN_UPPER: u16 = 1 << 1;
const BELOW_RANGE: u16 = 1 << 2;
const ABOVE_RANGE: u16 = 1 << 3;
/// PV runs from −5 to 105 % of the range.
const OVER_RANGE: f64 = 0.05;
/// Mains voltage, to turn the heater's power into the current of the CT input.
const MAINS_V: f64 = 220.0;

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
    saved: [i16; map::COUNT],
    saves: u32,
    pv_c: f64,
    sv_c: f64,
    mv_percent: f64,
    heater_a: f64,
    faults: u16,
    alarm: bool,
    control: Control,
    tuner: Option<Tuner>,
    program: Program,
}

impl Pxr {
    /// As it leaves the workshop of the thesis: SV 70.0 °C, P 5.0 %, I 240 s, D 60 s, running, everything saved.
    pub fn new(start_c: f64) -> Pxr {
        let settings = map::initial();
        Pxr {
            settings,
            saved: settings,
            saves: 0,
            pv_c: start_c,
            sv_c: 70.0,
            mv_percent: 0.0,
            heater_a: 0.0,
            faults: 0,
            alarm: false,
            control: Control::default(),
            tuner: None,
            program: Program::default(),
        }
    }

    /// One sample of [`SAMPLE`]: measures, decides, sets the output.
    pub fn sample(&mut self, sensor: Sensor, heater_w: f64) {
        self.heater_a = heater_w / MAINS_V;
        self.measure(sensor);
        self.sv_c = self.set_value();
        self.mv_percent = self.output();
        let above_c = self.pv_c - self.sv_c;
        self.alarm = above_c > ALARM_DEVIATION_C || (self.alarm && above_c > ALARM_DEVIATION_C - ALARM_HYSTERESIS_C);
    }

    /// Output 1 in percent.
    pub fn mv_percent(&self) -> f64 {
        self.mv_percent
    }

    /// Process value in °C as the controller has it; at the end of the range when the sensor is open.
    pub fn pv_c(&self) -> f64 {
        self.pv_c
    }

    /// Set value in use in °C.
    pub fn sv_c(&self) -> f64 {
        self.sv_c
    }

    /// The digital output that tells the PLC: PV is known and within 1 °C of SV.
    pub fn at_sv(&self) -> bool {
        self.faults == 0 && (self.pv_c - self.sv_c).abs() <= 1.0
    }

    /// How often settings were saved: the memory is good for about 100 000 times.
    pub fn saves(&self) -> u32 {
        self.saves
    }

    /// Loses power and comes back: settings are those last saved, tuning and programme are off.
    pub fn power_cycle(&mut self) {
        let (settings, saves) = (self.saved, self.saves);
        *self = Pxr { settings, saved: settings, saves, ..Pxr::new(self.pv_c) };
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
        let seen_c = input_c.clamp(low_c - margin_c, high_c + margin_c);
        let filter_s = self.tenths(map::FILTER);
        self.pv_c += (seen_c - self.pv_c) * if self.faults == 0 { SAMPLE_S / (SAMPLE_S + filter_s) } else { 1.0 };
    }

    fn set_value(&mut self) -> f64 {
        let command = match self.settings[map::PROGRAM] {
            1 => Command::Run,
            2 => Command::Halt,
            3 => Command::End,
            _ => Command::Off,
        };
        let plan = self.plan();
        let moving_c = self.program.step(SAMPLE_S, command, &plan, self.pv_c);
        if self.program.ended() && command == Command::Run {
            self.settings[map::PROGRAM] = 3;
        }
        // The limits of SV hold for a programme that was written before they were.
        let sv_c = moving_c.unwrap_or_else(|| self.tenths(map::SV));
        sv_c.clamp(self.tenths(map::SV_LOW), self.tenths(map::SV_HIGH))
    }

    /// Steps 1–4, 5–8 or 1–8, as register 41083 selects.
    fn plan(&self) -> Plan {
        let (first, last) = match self.settings[map::PATTERN] {
            0 => (0, 4),
            1 => (4, 8),
            _ => (0, 8),
        };
        let segment = |step: usize| Segment {
            target_c: self.tenths(map::STEP_SV + step),
            ramp_s: f64::from(self.settings[map::STEP_TIMES + 2 * step]) * 60.0,
            soak_s: f64::from(self.settings[map::STEP_TIMES + 2 * step + 1]) * 60.0,
        };
        Plan { first, segments: (first..last).map(segment).collect() }
    }

    /// Fail-safe and standby come first, then tuning, then the control law.
    fn output(&mut self) -> f64 {
        let standby = self.settings[map::STANDBY] == 1;
        if self.faults != 0 || standby {
            self.stop_tuning();
            self.control = Control::default();
            return 0.0;
        }
        match self.tune() {
            Some(output) => output,
            None => {
                let settings = self.law();
                self.control.step(SAMPLE_S, self.sv_c, self.pv_c, &settings)
            }
        }
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
        match self.tuner.get_or_insert_with(|| Tuner::new(target_c)).step(SAMPLE_S, self.pv_c) {
            Verdict::Running(output) => return Some(output),
            Verdict::Failed => {}
            Verdict::Done { band_c, i_s, d_s } => {
                let tenths = |value: f64, max: f64| (value * 10.0).round().clamp(1.0, max) as i16;
                self.settings[map::P] = tenths(100.0 * band_c / span_c, 9_999.0);
                self.settings[map::I] = tenths(i_s, 32_000.0);
                self.settings[map::D] = tenths(d_s, 9_999.0);
            }
        }
        self.stop_tuning();
        self.control = Control::default();
        None
    }

    fn stop_tuning(&mut self) {
        self.settings[map::TUNE] = 0;
        self.tuner = None;
    }

    fn law(&self) -> Settings {
        Settings {
            law: if self.settings[map::CONTROL] == 1 { Law::Fuzzy } else { Law::Pid },
            span_c: self.span_c(),
            p_percent: self.tenths(map::P),
            i_s: self.tenths(map::I),
            d_s: self.tenths(map::D),
            hysteresis_c: self.tenths(map::HYSTERESIS),
        }
    }

    /// A setting with one decimal: times, percent, and temperatures (P-dP is fixed at 1).
    fn tenths(&self, place: usize) -> f64 {
        f64::from(self.settings[place]) / 10.0
    }

    fn range_c(&self) -> (f64, f64) {
        (self.tenths(map::RANGE_LOW), self.tenths(map::RANGE_HIGH))
    }

    fn span_c(&self) -> f64 {
        let (low_c, high_c) = self.range_c();
        high_c - low_c
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::pdu::serve;

    fn read(pxr: &mut Pxr, function: u8, address: u16) -> i16 {
        let [high, low] = address.to_be_bytes();
        let reply = serve(pxr, &[function, high, low, 0, 1]).expect("a request has an answer");
        i16::from_be_bytes([reply[2], reply[3]])
    }

    fn write(pxr: &mut Pxr, address: u16, value: u16) {
        let [[a, b], [c, d]] = [address.to_be_bytes(), value.to_be_bytes()];
        assert_eq!(serve(pxr, &[6, a, b, c, d]), Some(vec![6, a, b, c, d]));
    }

    fn samples(pxr: &mut Pxr, sensor: Sensor, count: usize) {
        (0..count).for_each(|_| pxr.sample(sensor, 0.0));
    }

    #[test]
    fn a_broken_sensor_shows_as_a_fault_and_takes_the_output_away() {
        let pxr = &mut Pxr::new(27.0);
        samples(pxr, Sensor::Pt100(30.0), 2);
        assert_eq!((pxr.mv_percent(), read(pxr, 4, 1007)), (100.0, 0));
        samples(pxr, Sensor::Open, 1);
        assert_eq!((pxr.mv_percent(), read(pxr, 4, 1007), read(pxr, 4, 1000)), (0.0, 0b1010, 1943));
        assert!(!pxr.at_sv());
        samples(pxr, Sensor::Pt100(70.0), 1);
        assert_eq!((read(pxr, 4, 1007), read(pxr, 4, 1000)), (0, 700));
    }

    #[test]
    fn standby_means_no_output() {
        let pxr = &mut Pxr::new(27.0);
        write(pxr, 1003, 1);
        samples(pxr, Sensor::Pt100(30.0), 1);
        assert_eq!(read(pxr, 4, 1003), 0);
        write(pxr, 1003, 0);
        samples(pxr, Sensor::Pt100(30.0), 1);
        assert_eq!(read(pxr, 4, 1003), 10_000);
    }

    #[test]
    fn only_what_was_saved_survives_a_power_cut() {
        let pxr = &mut Pxr::new(27.0);
        write(pxr, 1002, 500);
        pxr.power_cycle();
        assert_eq!(read(pxr, 3, 1002), 700);
        write(pxr, 1002, 500);
        write(pxr, 1000, 1);
        assert_eq!(read(pxr, 3, 1000), 0);
        write(pxr, 1005, 12);
        pxr.power_cycle();
        assert_eq!((read(pxr, 3, 1002), read(pxr, 3, 1005), pxr.saves()), (500, 50, 1));
    }

    #[test]
    fn the_deviation_alarm_has_a_deadband() {
        let pxr = &mut Pxr::new(27.0);
        for (pv_c, alarm) in [(74.9, 0), (75.1, 1), (74.2, 1), (73.9, 0), (74.9, 0)] {
            samples(pxr, Sensor::Pt100(pv_c), 1);
            assert_eq!(read(pxr, 4, 1006), alarm, "at {pv_c} °C");
        }
    }

    #[test]
    fn auto_tuning_ends_by_writing_p_i_and_d() {
        let pxr = &mut Pxr::new(60.0);
        write(pxr, 1004, 1);
        // A tank that warms by 0.07 °C/s and cools by 0.02 °C/s, seen 15 s late.
        let (mut water_c, mut late) = (60.0, std::collections::VecDeque::from(vec![60.0; 30]));
        let ended = (0..7200).any(|_| {
            water_c += if pxr.mv_percent() > 50.0 { 0.035 } else { -0.01 };
            late.push_back(water_c);
            let seen_c = late.pop_front().expect("the line is never empty");
            pxr.sample(Sensor::Pt100(seen_c), 0.0);
            read(pxr, 3, 1004) == 0
        });
        assert!(ended, "tuning goes on after an hour");
        let tuned = [1005, 1006, 1007].map(|address| read(pxr, 3, address));
        assert!((1..50).contains(&tuned[0]) && (200..2000).contains(&tuned[1]) && tuned[2] < tuned[1], "{tuned:?}");
    }

    #[test]
    fn a_programme_moves_the_set_value_in_use_and_ends() {
        let pxr = &mut Pxr::new(30.0);
        for (address, value) in [(1056, 500), (1064, 1), (1065, 1), (1081, 1)] {
            write(pxr, address, value);
        }
        // Steps 2 to 4 go down to 0 °C at once.
        samples(pxr, Sensor::Pt100(30.0), 60);
        assert_eq!((read(pxr, 4, 1001), read(pxr, 4, 1008), read(pxr, 3, 1002)), (400, 1, 700));
        samples(pxr, Sensor::Pt100(30.0), 240);
        assert_eq!((read(pxr, 3, 1081), read(pxr, 4, 1008), read(pxr, 4, 1001)), (3, 17, 0));
        write(pxr, 1081, 0);
        samples(pxr, Sensor::Pt100(30.0), 1);
        assert_eq!((read(pxr, 4, 1001), read(pxr, 4, 1008)), (700, 0));
    }
}
