//! The fuzzy law: three rules over where PV will be, blended with PID.
//!
//! | if PV, drawn out along its slope over a part of D, will be | then |
//! |---|---|
//! | far below SV | heat fully |
//! | near SV | do as PID says |
//! | far above SV | do not heat |
//!
//! "Far" begins to hold a little at SV and holds fully at a share of the proportional band; between, both neighbours hold
//! in part and the output is their mean, weighted by how much each holds (Sugeno's way with constant and PID consequents).
//! The manufacturer does not publish the law: this one has its shape (full power longer than PID, settings of PID at SV).

/// PV is drawn out along its slope over this share of D.
const LOOK_AHEAD: f64 = 0.0222;
/// "Far below" holds fully at this share of the band, "far above" at that one.
const FAR_BELOW: f64 = 0.1292;
const FAR_ABOVE: f64 = 0.6447;

/// How much each rule holds; together 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grades {
    /// Far below SV.
    pub heat: f64,
    /// Near SV.
    pub settle: f64,
    /// Far above SV.
    pub coast: f64,
}

impl Grades {
    /// From the deviation SV − PV in K, the slope of PV in K/s, the width of the proportional band in K and D in seconds.
    pub fn new(error_k: f64, slope_k_per_s: f64, band_k: f64, d_s: f64) -> Grades {
        let expected_k = error_k - LOOK_AHEAD * d_s * slope_k_per_s;
        let heat = (expected_k / (FAR_BELOW * band_k)).clamp(0.0, 1.0);
        let coast = (-expected_k / (FAR_ABOVE * band_k)).clamp(0.0, 1.0);
        Grades { heat, settle: 1.0 - heat - coast, coast }
    }

    /// The output in percent.
    pub fn blend(self, pid_percent: f64) -> f64 {
        self.heat * 100.0 + self.settle * pid_percent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_share_the_output() {
        let check = |error_k: f64, slope: f64, expect: f64| {
            let output = Grades::new(error_k, slope, 10.0, 60.0).blend(40.0);
            assert!((output - expect).abs() < 1e-9, "{error_k} K at {slope} K/s: {output} %, expected {expect} %");
        };
        check(20.0, 0.0, 100.0);
        check(FAR_BELOW * 10.0, 0.0, 100.0);
        check(FAR_BELOW * 5.0, 0.0, 70.0);
        check(0.0, 0.0, 40.0);
        check(-FAR_ABOVE * 5.0, 0.0, 20.0);
        check(-FAR_ABOVE * 10.0, 0.0, 0.0);
        // A rising PV counts as nearer.
        check(FAR_BELOW * 5.0 + LOOK_AHEAD * 60.0 * 0.1, 0.1, 70.0);
    }
}
