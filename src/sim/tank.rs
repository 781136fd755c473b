//! Three tanks, two valves, a pump, an agitator and a heater: where the water is and how warm it is.
//!
//! ```text
//!  TK-2 cold ── SV-2 ──> TK-1 control, heater, agitator ── SV-1 ──> TK-3 hot ── P-1 ──> back to TK-2
//! ```

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Full power of the heater in watts (thesis, heater sizing).
pub const HEATER_W: f64 = 1600.0;
/// Temperature of the room in °C: where every experiment starts.
pub const AMBIENT_C: f64 = 27.0;
/// Water in the whole rig, in litres.
pub const TOTAL_L: f64 = 20.0;

// Fitted: found by a search over all six experiments of the thesis at once (`sim::experiment`), each within what such a
// rig can have. The rest is from data sheets and the thesis, or ours where it says so.

/// Heat capacity of a litre of water.
const WATER_J_PER_L_K: f64 = 4184.0;
/// TK-1 without water, fitted: about 2.3 kg of steel.
const WALL_J_PER_K: f64 = 1138.4;
/// TK-1 to the room, fitted: an open tank without insulation.
const CONTROL_LOSS_W_PER_K: f64 = 3.276;
/// TK-2 and TK-3 have cooling coils, or the cold water would warm up from batch to batch. Ours: the thesis is silent.
const COIL_LOSS_W_PER_K: f64 = 60.0;
/// The thesis says 25 cm, 40 cm high, 20 l, which do not quite agree: with this diameter 20 l are 40 cm.
const CONTROL_DIAMETER_CM: f64 = 25.25;
const COLD_DIAMETER_CM: f64 = 30.0;
/// Flow factor of the solenoid valves (Parker VE131.4 FV) in m³/h at 1 bar.
const VALVE_KV: f64 = 0.174;
/// Height of pipe under each tank that drains by gravity, in metres.
const PIPE_HEAD_M: f64 = 0.6;
const BAR_PER_M: f64 = 0.0981;
const PUMP_L_PER_S: f64 = 4.0 / 60.0;
/// Lag of the heating element, fitted.
const HEATER_LAG_S: f64 = 5.14;
/// Transport from the heater to the probe, fitted.
const DEAD_TIME_S: f64 = 14.3;
/// Lag of the probe in stirred water, fitted, and in still water, where layers form (ours).
const STIRRED_LAG_S: f64 = 5.30;
const STILL_LAG_S: f64 = 40.0;
/// Eddies of warmer and colder water pass the probe: half their height before the probe's lag where the water is 43 °C above
/// the room, as in the experiments, fitted; where they begin, fitted; their periods and shares, ours. Sines of times that do
/// not fit into each other look random and are reproducible. Without them P control would come to rest, and the
/// thesis's never did although it did not overshoot.
const EDDY_K: f64 = 0.344;
const EDDY_AT_K: f64 = 43.0;
const EDDIES_BEGIN_S: f64 = 26.7;
const EDDIES: [(f64, f64); 3] = [(13.7, 0.5), (31.3, 0.6), (71.9, 0.6)];
/// The cut-out thermostat in series with the heater, set to 95 °C (ours) of its 0–120 °C: it opens here, and closes again
/// 4 K below (data sheet: 4 ± 2 K).
const CUT_OUT_C: f64 = 95.0;
const CUT_OUT_HYSTERESIS_K: f64 = 4.0;
/// One place of the delay line.
const SLOT_S: f64 = 0.1;
/// Places of the delay line, which is its bound.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a constant of three digits")]
const SLOTS: usize = (DEAD_TIME_S / SLOT_S) as usize;

/// What the outputs of PLC and controller do to the plant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Actuators {
    /// P-1: TK-3 to TK-2.
    pub pump: bool,
    /// M-1: mixes TK-1.
    pub agitator: bool,
    /// SV-1: TK-1 to TK-3.
    pub drain_valve: bool,
    /// SV-2: TK-2 to TK-1.
    pub fill_valve: bool,
    /// Power of the heater, 0–100 %.
    pub heater_percent: f64,
}

/// What instruments would see; the real rig has only the sight glass.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readings {
    /// Level of TK-1 in cm.
    pub level_cm: f64,
    /// Water in TK-2 in litres.
    pub cold_l: f64,
    /// Water in TK-3 in litres.
    pub hot_l: f64,
    /// Whether TK-2 can take no more.
    pub cold_full: bool,
    /// Flow into TK-1 in l/min.
    pub flow_in: f64,
    /// Flow out of TK-1 in l/min.
    pub flow_out: f64,
    /// Flow of the pump in l/min.
    pub flow_pump: f64,
    /// Power that the heater gives to the water, in watts.
    pub heater_w: f64,
}

/// Heat that crossed the border of the rig in one step, in joules; positive is into the water.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Heat {
    pub heater_j: f64,
    /// To the room (negative when the water is colder than the room).
    pub loss_j: f64,
}

/// One tank with what is in it; water and wall have one temperature.
#[derive(Debug, Clone, PartialEq)]
pub struct Vessel {
    /// Water in litres.
    pub volume_l: f64,
    pub temperature_c: f64,
    /// Most that it holds, in litres.
    pub capacity_l: f64,
    loss_w_per_k: f64,
}

/// The process.
#[derive(Debug, Clone, PartialEq)]
pub struct Tank {
    /// TK-2.
    pub cold: Vessel,
    /// TK-1.
    pub control: Vessel,
    /// TK-3.
    pub hot: Vessel,
    heater_w: f64,
    cut_out: bool,
    probe_c: f64,
    delay: VecDeque<f64>,
    since_slot_s: f64,
    elapsed_s: f64,
    flow_in: f64,
    flow_out: f64,
    flow_pump: f64,
}

impl Tank {
    /// All water in TK-2 but `control_l` litres in TK-1, everything at `temperature_c`.
    pub fn new(control_l: f64, temperature_c: f64) -> Tank {
        let vessel = |volume_l, capacity_l, loss_w_per_k| Vessel { volume_l, temperature_c, capacity_l, loss_w_per_k };
        Tank {
            cold: vessel(TOTAL_L - control_l, TOTAL_L, COIL_LOSS_W_PER_K),
            control: vessel(control_l, 20.0, CONTROL_LOSS_W_PER_K),
            hot: vessel(0.0, TOTAL_L, COIL_LOSS_W_PER_K),
            heater_w: 0.0,
            cut_out: false,
            probe_c: temperature_c,
            delay: VecDeque::from(vec![temperature_c; SLOTS]),
            since_slot_s: 0.0,
            elapsed_s: EDDIES_BEGIN_S,
            flow_in: 0.0,
            flow_out: 0.0,
            flow_pump: 0.0,
        }
    }

    /// Moves water and heat for `dt_s` seconds (steps of up to a second are stable) and says what heat came and went.
    pub fn step(&mut self, dt_s: f64, actuators: &Actuators) -> Heat {
        self.move_water(dt_s, actuators);
        let heat = self.move_heat(dt_s, actuators.heater_percent);
        self.move_probe(dt_s, actuators.agitator);
        heat
    }

    /// Water that TK-1 loses to the floor in `dt_s` seconds, with its heat.
    pub fn spill(&mut self, dt_s: f64, l_per_min: f64) {
        let volume_l = &mut self.control.volume_l;
        *volume_l = (*volume_l - l_per_min / 60.0 * dt_s).max(0.0);
    }

    /// Temperature at the probe in °C, behind its dead time and lag.
    pub fn probe_c(&self) -> f64 {
        self.probe_c
    }

    /// The instruments.
    pub fn readings(&self) -> Readings {
        Readings {
            level_cm: level_cm(self.control.volume_l, CONTROL_DIAMETER_CM),
            cold_l: self.cold.volume_l,
            hot_l: self.hot.volume_l,
            cold_full: self.cold.capacity_l - self.cold.volume_l < 0.02,
            flow_in: self.flow_in,
            flow_out: self.flow_out,
            flow_pump: self.flow_pump,
            heater_w: self.heater_w,
        }
    }

    fn move_water(&mut self, dt_s: f64, actuators: &Actuators) {
        let per_minute = 60.0 / dt_s;
        let wanted = |open: bool, litres_per_s: f64| if open { litres_per_s * dt_s } else { 0.0 };

        let drain = gravity_l_per_s(level_cm(self.control.volume_l, CONTROL_DIAMETER_CM));
        let fill = gravity_l_per_s(level_cm(self.cold.volume_l, COLD_DIAMETER_CM));
        self.flow_out = per_minute * self.control.pour_into(&mut self.hot, wanted(actuators.drain_valve, drain));
        self.flow_in = per_minute * self.cold.pour_into(&mut self.control, wanted(actuators.fill_valve, fill));
        self.flow_pump = per_minute * self.hot.pour_into(&mut self.cold, wanted(actuators.pump, PUMP_L_PER_S));
    }

    fn move_heat(&mut self, dt_s: f64, heater_percent: f64) -> Heat {
        let temperature_c = self.control.temperature_c;
        self.cut_out = temperature_c > CUT_OUT_C || (self.cut_out && temperature_c > CUT_OUT_C - CUT_OUT_HYSTERESIS_K);
        let wanted_w = if self.cut_out { 0.0 } else { HEATER_W * power_share(heater_percent) };
        self.heater_w += (wanted_w - self.heater_w) * share(dt_s, HEATER_LAG_S);

        let heater_j = self.heater_w * dt_s;
        self.control.add_heat(heater_j);
        let loss_j = [&mut self.cold, &mut self.control, &mut self.hot].into_iter().map(|v| v.lose_heat(dt_s)).sum();
        Heat { heater_j, loss_j }
    }

    fn move_probe(&mut self, dt_s: f64, stirred: bool) {
        self.since_slot_s += dt_s;
        self.elapsed_s += dt_s;
        // Half a millionth of slack: ten times 0.1 is not 1.0 in binary.
        while self.since_slot_s + 1e-6 >= SLOT_S {
            self.since_slot_s -= SLOT_S;
            self.delay.pop_front();
            self.delay.push_back(self.control.temperature_c);
        }
        let delayed = self.delay.front().copied().unwrap_or(self.control.temperature_c);
        let arriving = delayed + (delayed - AMBIENT_C) / EDDY_AT_K * eddy_k(self.elapsed_s);
        self.probe_c += (arriving - self.probe_c) * share(dt_s, if stirred { STIRRED_LAG_S } else { STILL_LAG_S });
    }
}

impl Vessel {
    fn heat_capacity(&self) -> f64 {
        self.volume_l * WATER_J_PER_L_K + WALL_J_PER_K
    }

    fn energy_j(&self) -> f64 {
        self.heat_capacity() * self.temperature_c
    }

    fn add_heat(&mut self, joules: f64) {
        self.temperature_c += joules / self.heat_capacity();
    }

    fn lose_heat(&mut self, dt_s: f64) -> f64 {
        let joules = self.loss_w_per_k * (self.temperature_c - AMBIENT_C) * dt_s;
        self.add_heat(-joules);
        joules
    }

    /// Pours as much of `litres` as is here and as fits there; says how much that was.
    fn pour_into(&mut self, to: &mut Vessel, litres: f64) -> f64 {
        let litres = litres.min(self.volume_l).min(to.capacity_l - to.volume_l).max(0.0);
        let arriving = litres * WATER_J_PER_L_K;
        to.temperature_c = (to.energy_j() + arriving * self.temperature_c) / (to.heat_capacity() + arriving);
        to.volume_l += litres;
        self.volume_l -= litres;
        litres
    }
}

/// How much of a first-order lag happens in one step.
fn share(dt_s: f64, lag_s: f64) -> f64 {
    1.0 - (-dt_s / lag_s).exp()
}

/// Level in TK-1 with this many litres.
pub fn control_level_cm(litres: f64) -> f64 {
    level_cm(litres, CONTROL_DIAMETER_CM)
}

/// Share of full power at an output: the SSR cuts each half-wave of the mains at an angle, so the middle of its 4–20 mA does
/// much and both ends do little. Ten percent of output are less than one of power.
fn power_share(percent: f64) -> f64 {
    let angle = percent.clamp(0.0, 100.0) / 100.0 * TAU;
    (angle - angle.sin()) / TAU
}

fn eddy_k(elapsed_s: f64) -> f64 {
    EDDY_K * EDDIES.iter().map(|(period_s, share)| share * (TAU * elapsed_s / period_s).sin()).sum::<f64>()
}

fn level_cm(litres: f64, diameter_cm: f64) -> f64 {
    litres * 1000.0 / (PI * (diameter_cm / 2.0).powi(2))
}

/// Flow through an open valve under a tank with this level: Kv times the root of the pressure in bar is m³/h.
fn gravity_l_per_s(level_cm: f64) -> f64 {
    VALVE_KV * ((PIPE_HEAD_M + level_cm / 100.0) * BAR_PER_M).sqrt() / 3.6
}

#[cfg(test)]
mod tests;
