//! The control laws: on/off, P, PI, PD, PID; the fuzzy law blends PID with its own rules.

use super::fuzzy::Grades;

// The maker publishes none of these constants: they are fitted to the six experiments of the thesis (`sim::experiment`).
/// Output at SV without an integral part (manual reset; with one it is not used).
const BIAS_PERCENT: f64 = 18.75;
/// The integral acts only this near to SV, and is empty beyond: so much of the range and so much of the band (Ar).
const REACH_OF_RANGE: f64 = 0.02255;
const REACH_OF_BAND: f64 = 0.073;
/// The derivative is filtered over this share of D.
const DERIVATIVE_FILTER: f64 = 0.0593;
/// It brings the point where the output begins to fall forward by this share of the range at most.
const DERIVATIVE_MAX: f64 = 0.003239;
/// Time over which the fuzzy law sees the slope of PV.
const SLOPE_FILTER_S: f64 = 3.45;

/// Which law register 41002 chose; self-tuning controls as PID.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// P, I and D as they are set; on/off when P is 0.
    Pid,
    /// PID that approaches SV with more power, see [`super::fuzzy`].
    Fuzzy,
}

/// What the law needs to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    pub law: Law,
    /// Width of the measuring range in °C.
    pub span_c: f64,
    /// Proportional band in percent of the span; 0 is on/off.
    pub p_percent: f64,
    /// Integral time in seconds; 0 is none.
    pub i_s: f64,
    /// Derivative time in seconds; 0 is none.
    pub d_s: f64,
    /// On/off control switches on again this far below SV.
    pub hysteresis_c: f64,
    /// The output cools (direct action) and does not heat (reverse action).
    pub cools: bool,
}

/// What a law remembers between two samples.
#[derive(Debug, Clone, Default)]
pub struct Control {
    integral_percent: f64,
    last_pv_c: Option<f64>,
    rate_c_per_s: f64,
    slope_c_per_s: f64,
    on: bool,
}

impl Control {
    /// The output, 0–100 %. Cooling is heating with everything upside down.
    pub fn step(&mut self, dt_s: f64, sv_c: f64, pv_c: f64, set: &Settings) -> f64 {
        let sign = if set.cools { -1.0 } else { 1.0 };
        let (sv_c, pv_c) = (sign * sv_c, sign * pv_c);
        let change_c = pv_c - self.last_pv_c.replace(pv_c).unwrap_or(pv_c);
        self.rate_c_per_s += (change_c / dt_s - self.rate_c_per_s) * dt_s / (DERIVATIVE_FILTER * set.d_s + dt_s);
        self.slope_c_per_s += (change_c / dt_s - self.slope_c_per_s) * dt_s / (SLOPE_FILTER_S + dt_s);
        let error_c = sv_c - pv_c;
        if set.p_percent <= 0.0 {
            return self.on_off(error_c, set.hysteresis_c);
        }
        let pid = self.pid(dt_s, error_c, set);
        match set.law {
            Law::Pid => pid,
            Law::Fuzzy => {
                let band_c = set.p_percent / 100.0 * set.span_c;
                Grades::new(error_c, self.slope_c_per_s, band_c, set.d_s).blend(pid)
            }
        }
    }

    fn on_off(&mut self, error_c: f64, hysteresis_c: f64) -> f64 {
        self.on = error_c > if self.on { 0.0 } else { hysteresis_c };
        if self.on { 100.0 } else { 0.0 }
    }

    fn pid(&mut self, dt_s: f64, error_c: f64, set: &Settings) -> f64 {
        let band_c = set.p_percent / 100.0 * set.span_c;
        let gain = 100.0 / band_c;
        let most_c = DERIVATIVE_MAX * set.span_c;
        let ahead_c = (set.d_s * self.rate_c_per_s).clamp(-most_c, most_c);
        let wanted = gain * (error_c - ahead_c);
        if set.i_s <= 0.0 {
            self.integral_percent = 0.0;
            return (wanted + BIAS_PERCENT).clamp(0.0, 100.0);
        }
        // Outside its reach the integral is empty, or it would fill up during the whole heating and overshoot.
        let reach_c = REACH_OF_RANGE * set.span_c + REACH_OF_BAND * band_c;
        self.integral_percent = if error_c.abs() <= reach_c {
            (self.integral_percent + gain * error_c * dt_s / set.i_s).clamp(0.0, 100.0)
        } else {
            0.0
        };
        (wanted + self.integral_percent).clamp(0.0, 100.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SET: Settings =
        Settings { law: Law::Pid, span_c: 185.0, p_percent: 5.0, i_s: 0.0, d_s: 0.0, hysteresis_c: 1.0, cools: false };

    fn check(set: Settings, errors_c: &[f64], expect: f64) {
        let mut control = Control::default();
        let output = errors_c.iter().map(|error_c| control.step(0.5, 70.0, 70.0 - error_c, &set)).last();
        let output = output.expect("every case has a sample");
        assert!((output - expect).abs() < 0.1, "{set:?} after {errors_c:?}: {output} %, expected {expect} %");
    }

    #[test]
    fn the_output_follows_the_law() {
        check(SET, &[43.0], 100.0);
        check(SET, &[0.0], BIAS_PERCENT);
        check(SET, &[4.625], 50.0 + BIAS_PERCENT);
        check(SET, &[-10.0], 0.0);
        check(Settings { i_s: 240.0, ..SET }, &[0.0], 0.0);
        check(Settings { i_s: 240.0, ..SET }, &[1.0; 480], 10.8 * 2.0);
        check(Settings { i_s: 240.0, ..SET }, &[9.0; 4800], 97.3);
        check(Settings { i_s: 240.0, p_percent: 50.0, ..SET }, &[10.0; 480], 10.8 * 2.0);
        check(Settings { i_s: 240.0, p_percent: 50.0, ..SET }, &[20.0; 480], 21.6);
        check(Settings { d_s: 60.0, ..SET }, &[4.0, 3.9, 3.8, 3.7, 3.6, 3.5, 3.4, 3.3], 35.7 + BIAS_PERCENT - 6.5);
        check(Settings { p_percent: 0.0, ..SET }, &[0.5], 0.0);
        check(Settings { p_percent: 0.0, ..SET }, &[1.5, 0.5], 100.0);
        check(Settings { p_percent: 0.0, ..SET }, &[1.5, -0.1, 0.5], 0.0);
        check(Settings { cools: true, ..SET }, &[-43.0], 100.0);
        check(Settings { cools: true, ..SET }, &[4.625], 0.0);
        check(Settings { law: Law::Fuzzy, i_s: 240.0, ..SET }, &[5.0], 100.0);
    }
}
