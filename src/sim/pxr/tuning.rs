//! Auto-tuning: swings around SV at full and no power, and turns two such swings into P, I and D.

use std::f64::consts::PI;

/// Tuning gives up after this time, as nothing may wait for ever.
const LONGEST_S: f64 = 4.0 * 3600.0;
/// Crossings of SV on the way up that two whole swings need.
const CROSSINGS: usize = 3;
/// From the critical gain and period of the swings to P, I and D. The maker's rule is not public: these shares give on the
/// tank about what the controller of the thesis found there, P 1.2 %, I 70 s, D 13.5 s.
const GAIN_SHARE: f64 = 0.5;
const I_SHARE: f64 = 0.263;
const D_SHARE: f64 = 0.051;

/// One run of the auto-tuning.
#[derive(Debug, Clone)]
pub struct Tuner {
    target_c: f64,
    elapsed_s: f64,
    heating: bool,
    crossings_s: Vec<f64>,
    highest_c: f64,
    lowest_c: f64,
}

/// What came out of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Still swinging, with this output in percent.
    Running(f64),
    /// The new proportional band in °C, integral and derivative time in seconds.
    Done {
        /// Proportional band.
        band_c: f64,
        /// Integral time.
        i_s: f64,
        /// Derivative time.
        d_s: f64,
    },
    /// No two swings within the longest time.
    Failed,
}

impl Tuner {
    /// Begins to swing around `target_c`.
    pub fn new(target_c: f64) -> Tuner {
        let (highest_c, lowest_c) = (target_c, target_c);
        Tuner {
            target_c,
            elapsed_s: 0.0,
            heating: true,
            crossings_s: Vec::with_capacity(CROSSINGS),
            highest_c,
            lowest_c,
        }
    }

    /// One sample.
    pub fn step(&mut self, dt_s: f64, pv_c: f64) -> Verdict {
        self.elapsed_s += dt_s;
        if self.elapsed_s > LONGEST_S {
            return Verdict::Failed;
        }
        if !self.crossings_s.is_empty() {
            self.highest_c = self.highest_c.max(pv_c);
            self.lowest_c = self.lowest_c.min(pv_c);
        }
        let was_heating = std::mem::replace(&mut self.heating, pv_c < self.target_c);
        if was_heating && !self.heating {
            self.crossings_s.push(self.elapsed_s);
        }
        if self.crossings_s.len() == CROSSINGS { self.result() } else { Verdict::Running(self.output()) }
    }

    fn output(&self) -> f64 {
        if self.heating { 100.0 } else { 0.0 }
    }

    /// The relay's describing function: critical gain 4·50 %/(π·amplitude).
    fn result(&self) -> Verdict {
        let period_s = (self.crossings_s[CROSSINGS - 1] - self.crossings_s[0]) / (CROSSINGS - 1) as f64;
        let amplitude_c = (self.highest_c - self.lowest_c) / 2.0;
        let critical_percent_per_c = 4.0 * 50.0 / (PI * amplitude_c.max(0.01));
        Verdict::Done {
            band_c: 100.0 / (GAIN_SHARE * critical_percent_per_c),
            i_s: I_SHARE * period_s,
            d_s: D_SHARE * period_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_swings_of_a_known_wave_give_its_gain_and_period() {
        let mut tuner = Tuner::new(70.0);
        // A sine of 2 °C and 200 s, which starts below SV.
        let done = (1..=4000).find_map(|sample| {
            let time_s = f64::from(sample) * 0.5;
            match tuner.step(0.5, 70.0 - 2.0 * (2.0 * PI * time_s / 200.0).sin()) {
                Verdict::Running(_) => None,
                verdict => Some(verdict),
            }
        });
        let Some(Verdict::Done { band_c, i_s, d_s }) = done else { panic!("tuning did not end: {done:?}") };
        assert!((band_c - 100.0 / (GAIN_SHARE * 100.0 / PI)).abs() < 0.05, "band {band_c}");
        assert!((i_s - I_SHARE * 200.0).abs() < 0.5 && (d_s - D_SHARE * 200.0).abs() < 0.5, "I {i_s} D {d_s}");
    }

    #[test]
    fn tuning_of_a_dead_process_gives_up() {
        let mut tuner = Tuner::new(70.0);
        let verdicts: Vec<Verdict> = (0..28_801).map(|_| tuner.step(0.5, 27.0)).collect();
        assert_eq!(verdicts.first(), Some(&Verdict::Running(100.0)));
        assert_eq!(verdicts.last(), Some(&Verdict::Failed));
    }
}
