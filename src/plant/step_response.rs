//! How a control loop answered to a step of its setpoint: overshoot, rise time, settling time, integral of the error.
//!
//! ```text
//!          peak ─ ─ ─ ─╭╮
//!   SV  ┌──────────────╯╰──╮╭──────  ± 2 % of the step
//!   90 %│· · · · · ╭╯      ╰╯
//!   10 %│· · ·╭────╯
//!   ────┘─────╯                       PV at the step
//!       step  ├rise┤        │ settled
//! ```

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

/// A value counts as settled within this share of the step.
pub const SETTLED: f64 = 0.02;
/// Rise time is measured between these shares of the step.
const RISE: (f64, f64) = (0.1, 0.9);

/// SV and PV in columns of equal width; `None` where no good value is known.
#[derive(Debug, Clone, Copy)]
pub struct Loop<'a> {
    /// Start of the first column.
    pub from: Timestamp,
    /// Width of a column.
    pub step: Duration,
    /// Setpoint.
    pub sv: &'a [Option<f64>],
    /// Measured value, as many columns.
    pub pv: &'a [Option<f64>],
}

/// The answer to the last step of the setpoint. Times are exact to a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepResponse {
    /// When the setpoint changed.
    pub at: Timestamp,
    /// Setpoint before and after.
    pub sv: (f64, f64),
    /// PV at the step: what the rise is measured from.
    pub pv: f64,
    /// When PV was furthest beyond the new setpoint, and its value there; `None` if it never passed it.
    pub peak: Option<(Timestamp, f64)>,
    /// The peak beyond the setpoint, in percent of the step of the setpoint; 0 without one.
    pub overshoot: f64,
    /// From 10 % to 90 % of the step: begin and end; `None` if it was never there.
    pub rise: Option<(Timestamp, Timestamp)>,
    /// From here on PV stayed within 2 %; `None` if it does not yet. Unknown is not settled.
    pub settled: Option<Timestamp>,
    /// Integral of the absolute error over the good time, in unit minutes.
    pub iae: f64,
    /// Until when it was observed.
    pub until: Timestamp,
    /// Share of that time with good values, 0–1.
    pub good: f64,
}

/// The answer to the last step; `None` where the setpoint did not change, or PV was not known then.
pub fn step_response(of: Loop) -> Option<StepResponse> {
    let time = |column: usize| {
        let after = of.step.checked_mul(u32::try_from(column).ok()?)?;
        of.from.checked_add(SignedDuration::try_from(after).ok()?).ok()
    };
    let changed = |n: &usize| matches!((of.sv[n - 1], of.sv[*n]), (Some(a), Some(b)) if a != b);
    let count = of.sv.len().min(of.pv.len());
    let last = (1..count).rev().find(changed)?;
    // A step across a gap: when the setpoint changed is not known, and this step is no longer the last one.
    if of.sv[last..count].iter().flatten().any(|sv| Some(*sv) != of.sv[last]) {
        return None;
    }
    // A step that fell between two columns, or took a few of them, is one.
    let first = (1..=last).rev().take_while(changed).last()?;
    let sv = (of.sv[first - 1]?, of.sv[last]?);
    let pv = of.pv[..=first].iter().rev().take(2).find_map(|pv| *pv)?;
    let end = count - of.pv[..count].iter().rev().take_while(|pv| pv.is_none()).count();
    // PV may have been anywhere: only its way up is measured from there.
    let share = |value: f64| (value - sv.0) / (sv.1 - sv.0);
    let way = |value: f64| (value - pv) / (sv.1 - pv);
    let known = || (first..end).filter_map(|n| Some((n, share(of.pv[n]?))));
    let passed = |least: f64| (first..end).find(|n| of.pv[*n].is_some_and(|pv| way(pv) >= least)).and_then(time);
    // Where PV had not come to the old setpoint, its way may lead against the step.
    let toward = (sv.1 - pv).signum() * (sv.1 - sv.0).signum();
    let beyond = |share: f64| (share - 1.0) * toward;
    let peak = known().filter(|(_, share)| beyond(*share) > 0.0).max_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1)));
    let outside = |n: &usize| of.pv[*n].is_none_or(|value| (share(value) - 1.0).abs() > SETTLED);
    let settled = (last..end).rev().find(outside).map_or(last, |n| n + 1);
    let errors = (first..end).filter_map(|n| Some((of.sv[n]? - of.pv[n]?).abs()));
    let minutes = of.step.as_secs_f64() / 60.0;
    let good = known().count() as f64 / (end - first).max(1) as f64;
    Some(StepResponse {
        at: time(first)?,
        sv,
        pv,
        peak: peak.and_then(|(n, _)| Some((time(n)?, of.pv[n]?))),
        overshoot: peak.map_or(0.0, |(_, share)| beyond(share) * 100.0),
        rise: passed(RISE.0).zip(passed(RISE.1)),
        settled: if settled < end { time(settled) } else { None },
        iae: errors.sum::<f64>() * minutes,
        until: time(end)?,
        good,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// Of columns of a minute.
    fn response(sv: &[f64], pv: &[f64]) -> Option<StepResponse> {
        let known = |values: &[f64]| values.iter().map(|v| v.is_finite().then_some(*v)).collect::<Vec<_>>();
        step_response(Loop { from: at(0), step: Duration::from_secs(60), sv: &known(sv), pv: &known(pv) })
    }

    #[test]
    fn overshoot_rise_and_settling_are_of_the_step() {
        let sv = [60., 60., 70., 70., 70., 70., 70., 70., 70.];
        let got = response(&sv, &[60., 60., 60., 62., 69.5, 71., 69.9, 70.1, 70.]).expect("a step");
        assert_eq!((got.at, got.sv, got.pv), (at(120), (60., 70.), 60.));
        assert_eq!((got.peak, got.rise), (Some((at(300), 71.)), Some((at(180), at(240)))));
        assert!((got.overshoot - 10.).abs() < 1e-9);
        assert_eq!((got.settled, got.until, got.good), (Some(at(360)), at(540), 1.));
        assert!((got.iae - (10. + 8. + 0.5 + 1. + 0.1 + 0.1)).abs() < 1e-9, "{}", got.iae);
    }

    #[test]
    fn a_step_down_is_the_same_upside_down() {
        let got = response(&[70., 60., 60., 60.], &[70., 70., 59., 60.]).expect("a step");
        assert_eq!((got.overshoot.round(), got.peak, got.settled), (10., Some((at(120), 59.)), Some(at(180))));
    }

    #[test]
    fn a_step_down_to_above_pv_is_no_overshoot() {
        let sv = [70., 60., 60., 60., 60.];
        let got = response(&sv, &[39., 40., 50., 58., 60.]).expect("a step");
        assert_eq!((got.overshoot, got.peak), (0., None), "PV comes from below and never passes 60");
        let passed = response(&sv, &[39., 40., 50., 62., 60.]).expect("a step");
        assert_eq!((passed.overshoot.round(), passed.peak), (20., Some((at(180), 62.))));
    }

    #[test]
    fn what_is_not_known_is_not_settled() {
        let sv = [60., 70., 70., 70., 70.];
        let gap = response(&sv, &[60., 60., 70., f64::NAN, 70.]).expect("a step");
        assert_eq!((gap.settled, gap.good), (Some(at(240)), 0.75), "not before the gap");
        let far = response(&sv, &[60., 60., 61., 62., 63.]).expect("a step");
        assert_eq!((far.settled, far.rise, far.overshoot, far.peak), (None, None, 0., None));
        let ended = response(&sv, &[60., 60., 70., f64::NAN, f64::NAN]).expect("a step");
        assert_eq!((ended.settled, ended.until), (Some(at(120)), at(180)), "what was not read any more is no time");
    }

    #[test]
    fn the_last_step_counts_and_one_over_two_columns_is_one() {
        let got = response(&[50., 60., 60., 65., 70., 70.], &[60., 60., 60., 60., 65., 70.]).expect("a step");
        assert_eq!((got.at, got.sv), (at(180), (60., 70.)));
        assert_eq!(response(&[60., 60.], &[60., 61.]), None, "no step");
        assert_eq!(response(&[60., 70., 70.], &[f64::NAN, f64::NAN, 65.]), None, "PV not known at the step");
        assert_eq!(response(&[60., f64::NAN, 70.], &[60., 60., 60.]), None, "when it changed is not known");
        let older = [50., 60., f64::NAN, 70., 70.];
        assert_eq!(response(&older, &[50., 60., 60., 65., 70.]), None, "the step to 60 is not the last one");
        let same = [50., 60., f64::NAN, 60., 60.];
        assert!(response(&same, &[50., 60., 60., 60., 60.]).is_some(), "the same setpoint after a gap");
    }
}
