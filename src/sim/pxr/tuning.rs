//! Auto-tuning: swings around SV at full and no power, and turns two whole swings into P, I and D.
//!
//! ```text
//!        ╭─╮         ╭─╮          height H = 2·h + R·L
//!   ────╱───╲───────╱───╲── +h    full power rises with H/on, none falls with H/off,
//!      ╱     ╲     ╱     ╲        so full power alone makes the slope R = H/on + H/off
//!   ──╱───────╲───╱───────╲ −h    and the delay is L = (H − 2·h)/R
//!    ╯  on  off╰─╯
//! ```
//!
//! `on` and `off` are the times with full and without power, ±h the hysteresis that keeps eddies at the probe from
//! switching. Slope and delay do not depend on how fast the process cools, so both types of tuning find the same.

use super::rule::{self, PidSettings};

/// Tuning gives up after this time, as nothing may wait for ever.
const LONGEST_S: f64 = 4.0 * 3600.0;
/// Whole swings that are measured.
const SWINGS: usize = 2;
/// The output switches this far above and below the target, as a share of the range.
const HYSTERESIS: f64 = 0.002;

/// One run of the auto-tuning.
#[derive(Debug, Clone)]
pub struct Tuner {
    target_c: f64,
    hysteresis_k: f64,
    elapsed_s: f64,
    heating: bool,
    swing: Option<Swing>,
    measured: Vec<(f64, f64)>,
}

/// From switching on to switching on again.
#[derive(Debug, Clone)]
struct Swing {
    on_s: f64,
    off_s: f64,
    highest_c: f64,
    lowest_c: f64,
}

/// What came out of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TuningStatus {
    /// Still swinging, with this output in percent.
    Running(f64),
    /// The new settings.
    Done(PidSettings),
    /// No two swings within the longest time.
    Failed,
}

impl Tuner {
    /// Begins to swing around `target_c` in a range of `span_c`.
    pub fn new(target_c: f64, span_c: f64) -> Tuner {
        let hysteresis_k = HYSTERESIS * span_c;
        Tuner {
            target_c,
            hysteresis_k,
            elapsed_s: 0.0,
            heating: true,
            swing: None,
            measured: Vec::with_capacity(SWINGS),
        }
    }

    /// One sample.
    pub fn step(&mut self, dt_s: f64, pv_c: f64) -> TuningStatus {
        self.elapsed_s += dt_s;
        if self.elapsed_s > LONGEST_S {
            return TuningStatus::Failed;
        }
        let above_k = pv_c - self.target_c;
        let was_heating = self.heating;
        self.heating = above_k < if was_heating { self.hysteresis_k } else { -self.hysteresis_k };
        if self.heating && !was_heating {
            let ended = self.swing.replace(Swing { on_s: 0.0, off_s: 0.0, highest_c: pv_c, lowest_c: pv_c });
            self.measured.extend(ended.map(|swing| swing.slope_and_delay(2.0 * self.hysteresis_k)));
        }
        if let Some(swing) = &mut self.swing {
            swing.highest_c = swing.highest_c.max(pv_c);
            swing.lowest_c = swing.lowest_c.min(pv_c);
            *(if self.heating { &mut swing.on_s } else { &mut swing.off_s }) += dt_s;
        }
        if self.measured.len() == SWINGS {
            let mean = |part: fn(&(f64, f64)) -> f64| self.measured.iter().map(part).sum::<f64>() / SWINGS as f64;
            return TuningStatus::Done(rule::settings(mean(|swing| swing.0), mean(|swing| swing.1)));
        }
        TuningStatus::Running(if self.heating { 100.0 } else { 0.0 })
    }
}

impl Swing {
    fn slope_and_delay(&self, dead_band_k: f64) -> (f64, f64) {
        let height_k = self.highest_c - self.lowest_c;
        let slope_k_per_s = height_k / self.on_s + height_k / self.off_s;
        (slope_k_per_s, ((height_k - dead_band_k) / slope_k_per_s).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A process that rises by `up` and falls by `down`, seen `late` samples late, tuned around 70 °C.
    fn tuned(up: f64, down: f64, late: usize) -> TuningStatus {
        let mut tuner = Tuner::new(70.0, 185.0);
        let (mut c, mut line, mut output) = (65.0, std::collections::VecDeque::from(vec![65.0; late]), 100.0);
        (0..28_802)
            .find_map(|_| {
                c += 0.5 * if output > 50.0 { up } else { -down };
                line.push_back(c);
                match tuner.step(0.5, line.pop_front().unwrap_or(c)) {
                    TuningStatus::Running(percent) => {
                        output = percent;
                        None
                    }
                    verdict => Some(verdict),
                }
            })
            .unwrap_or(TuningStatus::Failed)
    }

    #[test]
    fn slope_and_delay_of_a_known_process_are_found() {
        for down in [0.003, 0.006, 0.03] {
            let TuningStatus::Done(found) = tuned(0.07 - down, down, 60) else {
                panic!("tuning did not end at {down} K/s")
            };
            let expect = rule::settings(0.07, 30.0);
            for (found, expect) in [(found.band_k, expect.band_k), (found.i_s, expect.i_s), (found.d_s, expect.d_s)] {
                assert!((found / expect - 1.0).abs() < 0.06, "{found} instead of {expect} at {down} K/s");
            }
        }
    }

    #[test]
    fn tuning_of_a_dead_process_gives_up() {
        assert_eq!(tuned(0.0, 0.0, 1), TuningStatus::Failed);
    }
}
