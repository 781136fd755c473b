//! Self-tuning: P, I and D from what the controller sees while it works, without swings made on purpose.
//!
//! 1. **Approach.** After power-on, and after SV moved by more than 3 % of the range, PV far below SV and at rest: the
//!    output is full until a quarter of the way is done. Steepest slope and delay of that step response give P, I and D
//!    by the rule that auto-tuning uses too.
//! 2. **Swings.** Two swings around SV in a row, each larger than 0.3 % of the range from top to bottom and the second at
//!    least half as large as the first, are a loop that does not calm down: the band becomes a quarter wider and I at
//!    least half a period.
//!
//! The manufacturer does not publish the rule; these two are ours.

use super::rule::{self, PidSettings};

/// SV must have moved this far, as a share of the range, or PV be this far from it at power-on.
const MOVED: f64 = 0.03;
/// The way that is observed, as a share of the whole.
const OBSERVED: f64 = 0.25;
/// PV is at rest below this slope.
const REST_K_PER_S: f64 = 0.02;
/// Slopes are taken over this time.
const SLOPE_OVER: usize = 20;
/// An approach that takes longer is not one.
const LONGEST_S: f64 = 3600.0;
/// A swing that counts, as a share of the range; one that keeps this much of the one before does not calm down.
const SWING: f64 = 0.003;
const KEPT: f64 = 0.5;
const WIDER: f64 = 1.25;

/// What self-tuning has seen so far.
#[derive(Debug, Clone, Default)]
pub struct SelfTuner {
    last_sv_c: Option<f64>,
    approach: Option<Approach>,
    recent_c: Vec<f64>,
    swings: Swings,
}

#[derive(Debug, Clone)]
struct Approach {
    start_c: f64,
    target_c: f64,
    elapsed_s: f64,
    steepest_k_per_s: f64,
}

/// One swing is from one crossing of SV on the way up to the next.
#[derive(Debug, Clone, Default)]
struct Swings {
    above: bool,
    highest_k: f64,
    lowest_k: f64,
    elapsed_s: f64,
    /// Height of the swing before; 0 if there was none that counts.
    before_k: f64,
}

impl SelfTuner {
    /// Whether an approach is under way: the output is full meanwhile.
    pub fn pushing(&self) -> bool {
        self.approach.is_some()
    }

    /// One sample of a process that is heated; `now` are the settings in use.
    pub fn step(&mut self, dt_s: f64, sv_c: f64, pv_c: f64, span_c: f64, now: PidSettings) -> Option<PidSettings> {
        self.recent_c.push(pv_c);
        if self.recent_c.len() > SLOPE_OVER + 1 {
            self.recent_c.remove(0);
        }
        let slope = match (self.recent_c.first(), self.recent_c.len()) {
            (Some(first_c), length) if length > 1 => (pv_c - first_c) / ((length - 1) as f64 * dt_s),
            _ => 0.0,
        };
        let before_c = self.last_sv_c.replace(sv_c);
        let moved = before_c.is_none_or(|before_c| (sv_c - before_c).abs() > MOVED * span_c);
        if moved {
            let far = sv_c - pv_c > MOVED * span_c && slope.abs() < REST_K_PER_S;
            self.approach =
                far.then_some(Approach { start_c: pv_c, target_c: sv_c, elapsed_s: 0.0, steepest_k_per_s: 0.0 });
            self.swings = Swings::default();
        }
        if let Some(approach) = &mut self.approach {
            let ended = approach.step(dt_s, pv_c, slope);
            self.approach = self.approach.take_if(|_| ended.is_none());
            return ended.flatten();
        }
        self.swings.step(dt_s, pv_c - sv_c, SWING * span_c, now)
    }
}

impl Approach {
    /// `None` while it goes on; then what was found, if anything.
    fn step(&mut self, dt_s: f64, pv_c: f64, slope_k_per_s: f64) -> Option<Option<PidSettings>> {
        self.elapsed_s += dt_s;
        self.steepest_k_per_s = self.steepest_k_per_s.max(slope_k_per_s);
        let risen_k = pv_c - self.start_c;
        if self.elapsed_s > LONGEST_S {
            return Some(None);
        }
        if risen_k < OBSERVED * (self.target_c - self.start_c) {
            return None;
        }
        let slope = self.steepest_k_per_s;
        let delay_s = self.elapsed_s - risen_k / slope;
        let good = slope > 0.0 && delay_s > dt_s;
        Some(good.then(|| rule::settings(slope, delay_s)))
    }
}

impl Swings {
    fn step(&mut self, dt_s: f64, above_k: f64, least_k: f64, now: PidSettings) -> Option<PidSettings> {
        self.elapsed_s += dt_s;
        let (height_k, length_s) = (self.highest_k - self.lowest_k, self.elapsed_s);
        let crossed = !self.above && above_k > 0.0;
        self.above = above_k > 0.0;
        if !crossed {
            self.highest_k = self.highest_k.max(above_k);
            self.lowest_k = self.lowest_k.min(above_k);
            return None;
        }
        let before_k = self.before_k;
        *self = Swings { above: true, before_k: if height_k > least_k { height_k } else { 0.0 }, ..Swings::default() };
        if before_k == 0.0 || self.before_k < KEPT * before_k {
            return None;
        }
        self.before_k = 0.0;
        Some(PidSettings { band_k: now.band_k * WIDER, i_s: now.i_s.max(length_s / 2.0), d_s: now.d_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: PidSettings = PidSettings { band_k: 2.0, i_s: 20.0, d_s: 5.0 };

    #[test]
    fn a_step_response_of_known_slope_and_delay_gives_its_settings() {
        let mut tuner = SelfTuner::default();
        // At rest for 20 s, then 0.1 K/s.
        let found = (0..1200).find_map(|sample| {
            let time_s = f64::from(sample) * 0.5;
            let found = tuner.step(0.5, 70.0, 30.0 + 0.1 * (time_s - 20.0).max(0.0), 185.0, NOW);
            assert!(found.is_some() || tuner.pushing() || time_s > 130.0);
            found
        });
        let found = found.expect("a quarter of the way is done after 120 s");
        let expect = rule::settings(0.1, 20.0);
        for (found, expect) in [(found.band_k, expect.band_k), (found.i_s, expect.i_s), (found.d_s, expect.d_s)] {
            assert!((found / expect - 1.0).abs() < 0.05, "{found} instead of {expect}");
        }
    }

    #[test]
    fn only_persistent_oscillation_widens_the_band() {
        let check = |decay_per_swing: f64, expect: bool| {
            let mut tuner = SelfTuner::default();
            let found = (0..2000).find_map(|sample| {
                let time_s = f64::from(sample) * 0.5;
                let pv_c =
                    70.0 + 3.0 * decay_per_swing.powf(time_s / 50.0) * (time_s / 100.0 * std::f64::consts::TAU).sin();
                tuner.step(0.5, 70.0, pv_c, 185.0, NOW)
            });
            assert_eq!(found.is_some(), expect, "decay {decay_per_swing}: {found:?}");
            if let Some(found) = found {
                assert!((found.band_k - 2.5).abs() < 1e-9 && (found.i_s - 50.0).abs() < 1.0, "{found:?}");
            }
        };
        check(1.0, true);
        check(0.95, true);
        check(0.4, false);
    }
}
