//! From what a process does at full output to P, I and D: the rule of Chien, Hrones and Reswick (1952) for disturbances
//! without overshoot. The maker's rule is not public; on the tank this one gives what his controller found there.

/// P, I and D in physical units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Width of the proportional band in K.
    pub band_k: f64,
    /// Integral time.
    pub i_s: f64,
    /// Derivative time.
    pub d_s: f64,
}

/// Settings for a process that answers full output after `delay_s` with `slope_k_per_s`.
pub fn settings(slope_k_per_s: f64, delay_s: f64) -> Found {
    Found { band_k: slope_k_per_s * delay_s / 0.95, i_s: 2.4 * delay_s, d_s: 0.42 * delay_s }
}
