//! From what a process does at full output to P, I and D, for auto-tuning and self-tuning.
//!
//! The maker's rule is not public. The form is that of all rules for a process with slope and delay (Ziegler and Nichols,
//! Chien, Hrones and Reswick): the band is a share of `slope · delay`, I and D are multiples of the delay. The three numbers
//! are chosen so that the tank, whose thesis has the result of the real controller, gets about P 1.2 %, I 70 s, D 13.5 s.

/// Width of the band for each K of `slope · delay`.
const BAND: f64 = 1.25;
/// I and D for each second of delay.
const I: f64 = 3.0;
const D: f64 = 0.58;

/// P, I and D in physical units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidSettings {
    /// Width of the proportional band in K.
    pub band_k: f64,
    /// Integral time.
    pub i_s: f64,
    /// Derivative time.
    pub d_s: f64,
}

/// Settings for a process that answers full output after `delay_s` with `slope_k_per_s`.
pub fn settings(slope_k_per_s: f64, delay_s: f64) -> PidSettings {
    PidSettings { band_k: BAND * slope_k_per_s * delay_s, i_s: I * delay_s, d_s: D * delay_s }
}
