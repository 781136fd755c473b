//! The six experiments of the thesis, repeated on the simulated rig in virtual time: one rig, one controller, six settings.
//!
//! 5 l of water at 27 °C, agitator on, SV 70 °C, an hour recorded, one value a second, as the display shows it: rounded
//! to 1 °C.

use std::time::Duration;

use super::pxr::map;
use super::rig::Rig;
use super::slave::Unit;
use crate::plant::number::{to_i32, to_u16, to_u32};

/// Setpoint of all experiments, in °C.
pub const SV_C: i32 = 70;
/// Length of each recording.
pub const RECORDING: Duration = Duration::from_secs(3600);
/// PV that came to SV later than this before the end of the recording is not called steady.
const STEADY_MIN_S: u32 = 300;
const FILL_L: f64 = 5.0;
/// Address of the first setting in display units.
const ENGINEERING: u16 = 1000;

/// Settings of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Name of the kind of control.
    pub name: &'static str,
    /// Proportional band in percent of the range.
    pub p_percent: f64,
    /// Integral time in seconds; 0 is none.
    pub i_s: f64,
    /// Derivative time in seconds; 0 is none.
    pub d_s: f64,
    /// Whether register 41002 selects the fuzzy law.
    pub fuzzy: bool,
}

/// What a recording shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Milestones {
    /// When the rounded PV was first at SV, in seconds from the start.
    pub first_at_sv_s: Option<u32>,
    /// From when the rounded PV stayed at SV until the end of the recording, five minutes at least; `None` is never.
    pub steady_from_s: Option<u32>,
    /// The greatest rounded PV above SV.
    pub overshoot_c: i32,
}

/// One experiment with what the thesis measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// The settings.
    pub control: Control,
    /// Measured on the real rig: to compare with, never to compute from.
    pub thesis: Milestones,
}

const fn experiment(control: Control, first_at_sv_s: u32, steady_from_s: Option<u32>, overshoot_c: i32) -> Experiment {
    Experiment { control, thesis: Milestones { first_at_sv_s: Some(first_at_sv_s), steady_from_s, overshoot_c } }
}

const fn control(name: &'static str, p_percent: f64, i_s: f64, d_s: f64, fuzzy: bool) -> Control {
    Control { name, p_percent, i_s, d_s, fuzzy }
}

/// KMITL thesis, 2008, chapter 4.
pub const THESIS: [Experiment; 6] = [
    experiment(control("P", 5.0, 0.0, 0.0, false), 12 * 60 + 45, None, 0),
    experiment(control("PI", 5.0, 240.0, 0.0, false), 13 * 60 + 27, Some(17 * 60 + 46), 0),
    experiment(control("PD", 5.0, 0.0, 60.0, false), 12 * 60 + 57, None, 0),
    experiment(control("PID", 5.0, 240.0, 60.0, false), 13 * 60 + 3, Some(22 * 60 + 35), 1),
    experiment(control("auto-tuned", 1.2, 70.0, 13.5, false), 10 * 60 + 44, Some(19 * 60 + 21), 2),
    experiment(control("fuzzy", 5.0, 240.0, 60.0, true), 9 * 60 + 47, Some(16 * 60 + 51), 2),
];

/// A second of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recorded {
    /// Seconds from the start.
    pub second: u32,
    /// PV in °C, as the controller measures it.
    pub pv_c: f64,
    /// Its output in percent.
    pub mv_percent: f64,
}

/// Records one experiment from the start.
pub fn record(control: &Control) -> Vec<Recorded> {
    record_filled(control, FILL_L)
}

fn record_filled(control: &Control, fill_l: f64) -> Vec<Recorded> {
    let mut rig = Rig::filled(fill_l);
    let tenths = |value: f64| to_u16((value * 10.0).round());
    let settings = [
        (map::CONTROL, u16::from(control.fuzzy)),
        (map::P, tenths(control.p_percent)),
        (map::I, tenths(control.i_s)),
        (map::D, tenths(control.d_s)),
    ];
    for (place, value) in settings {
        let [[a, b], [c, d]] = [(ENGINEERING + to_u16(place)).to_be_bytes(), value.to_be_bytes()];
        let request = [6, a, b, c, d];
        assert_eq!(
            rig.controller().respond(&request).as_deref(),
            Some(&request[..]),
            "the controller takes {control:?}"
        );
    }
    // Running, in manual, agitator and heater on.
    let taken = rig.plc().respond(&[15, 0x0C, 0, 0, 7, 1, 0b100_1001]);
    assert_eq!(taken.as_deref(), Some(&[15, 0x0C, 0, 0, 7][..]), "the PLC takes its commands");
    let seconds = (0..=to_u32(RECORDING.as_secs())).map(|second| {
        let state = rig.state();
        rig.advance(Duration::from_secs(1));
        Recorded { second, pv_c: state.pv_c, mv_percent: state.mv_percent }
    });
    seconds.collect()
}

/// What a recording of seconds and PV shows on a display without decimals.
pub fn measure(recording: &[Recorded]) -> Milestones {
    let mut outcome = Milestones { first_at_sv_s: None, steady_from_s: None, overshoot_c: 0 };
    let mut last_s = 0;
    for Recorded { second, pv_c, .. } in recording.iter().copied() {
        last_s = second;
        let shown_c = to_i32(pv_c.round());
        outcome.overshoot_c = outcome.overshoot_c.max(shown_c - SV_C);
        if shown_c != SV_C {
            outcome.steady_from_s = None;
            continue;
        }
        outcome.first_at_sv_s.get_or_insert(second);
        outcome.steady_from_s.get_or_insert(second);
    }
    outcome.steady_from_s = outcome.steady_from_s.filter(|from_s| from_s + STEADY_MIN_S <= last_s);
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::def::{ProcedureStep, Reference},
        profile,
    };

    fn of((second, pv_c): (u32, f64)) -> Recorded {
        Recorded { second, pv_c, mv_percent: 0.0 }
    }

    #[test]
    fn a_recording_is_judged_as_the_display_shows_it() {
        let check = |recording: &[f64], first_at_sv_s, steady_from_s, overshoot_c| {
            // The last value is held for long enough.
            let held = std::iter::repeat_n(recording.last().copied().unwrap_or(27.0), 300);
            let seconds = (0..).zip(recording.iter().copied().chain(held));
            let recorded: Vec<Recorded> = seconds.map(of).collect();
            let expect = Milestones { first_at_sv_s, steady_from_s, overshoot_c };
            assert_eq!(measure(&recorded), expect, "{recording:?}");
        };
        check(&[27.0, 69.4, 69.5, 70.4, 70.0], Some(2), Some(2), 0);
        check(&[27.0, 69.5, 69.4, 69.6], Some(1), Some(3), 0);
        check(&[27.0, 69.5, 70.5, 72.4, 70.0], Some(1), Some(4), 2);
        check(&[27.0, 69.5, 70.6], Some(1), None, 1);
        check(&[27.0, 69.4], None, None, 0);
        let late: Vec<Recorded> = (0..300).map(|second| of((second, if second < 10 { 27.0 } else { 70.0 }))).collect();
        assert_eq!(measure(&late), Milestones { first_at_sv_s: Some(10), steady_from_s: None, overshoot_c: 0 });
        // What jumps over SV was not at it.
        check(&[27.0, 71.0, 70.0], Some(2), Some(2), 1);
    }

    /// The shipped plant has them as procedures: with the same settings, beside the same figures of the thesis.
    #[test]
    fn the_procedures_of_the_shipped_plant_are_these() {
        let def = profile::load(std::path::Path::new("tank"), &profile::Search::shipped()).expect("a shipped plant");
        let seconds = |time: Option<Duration>| time.map(|time| to_u32(time.as_secs()));
        for Experiment { control, thesis } in THESIS {
            let procedure = def.procedures.iter().find(|procedure| *procedure.name == *control.name);
            let procedure = procedure.expect(control.name);
            let written = |name: &str| {
                procedure.steps.iter().rev().find_map(|step| match step {
                    ProcedureStep::Write { tag, value } if def.tag(*tag).name == name => Some(*value),
                    _ => None,
                })
            };
            let set = ["TIC-1.P", "TIC-1.I", "TIC-1.D", "TIC-1.CTRL", "TIC-1.SV"].map(written);
            let fuzzy = f64::from(u8::from(control.fuzzy));
            let expected = [control.p_percent, control.i_s, control.d_s, fuzzy, f64::from(SV_C)];
            assert_eq!(set, expected.map(Some), "{}", control.name);
            let Reference { at_sv, steady, overshoot, .. } = procedure.reference.as_ref().expect(control.name);
            let figures = (seconds(*at_sv), seconds(*steady), *overshoot);
            let overshoot = Some(f64::from(thesis.overshoot_c));
            assert_eq!(figures, (thesis.first_at_sv_s, thesis.steady_from_s, overshoot), "{}", control.name);
        }
    }

    /// Why fuzzy and auto-tuned tie here: both heat fully until PV is within 1.5 °C of SV, so that their settings have no time
    /// to differ. The 57 s between them in the thesis are those of another process: 0.4 l less water give them all.
    #[test]
    fn full_power_until_sv_leaves_no_time_for_the_law() {
        let [.., tuned, fuzzy] = THESIS;
        for experiment in [tuned, fuzzy] {
            let recording = record(&experiment.control);
            let throttled = recording.iter().skip(5).find(|recorded| recorded.mv_percent < 99.9).expect("it throttles");
            assert!(f64::from(SV_C) - 1.5 < throttled.pv_c, "{}: {throttled:?}", experiment.control.name);
        }
        let less = measure(&record_filled(&fuzzy.control, FILL_L - 0.4)).first_at_sv_s;
        let thesis = fuzzy.thesis.first_at_sv_s.expect("it came to SV");
        assert!(less.is_some_and(|less| less.abs_diff(thesis) <= 10), "{less:?}, thesis {thesis}");
    }

    /// What the rig meets of the goal: times within 10 %, overshoots within 1 °C, P and PD never steady, the order by first
    /// time at SV as in the thesis but for one tie.
    #[test]
    fn the_six_experiments_come_out_as_in_the_thesis() {
        let outcomes = THESIS.map(|experiment| measure(&record(&experiment.control)));
        for (Experiment { control, thesis }, here) in THESIS.iter().zip(outcomes) {
            let near = |here: Option<u32>, thesis: Option<u32>| match (here, thesis) {
                (Some(here), Some(thesis)) => (f64::from(here) / f64::from(thesis) - 1.0).abs() <= 0.10,
                (here, thesis) => here == thesis,
            };
            let name = control.name;
            assert!(near(here.first_at_sv_s, thesis.first_at_sv_s), "{name}: {here:?}, thesis {thesis:?}");
            assert!(near(here.steady_from_s, thesis.steady_from_s), "{name}: {here:?}, thesis {thesis:?}");
            assert!((here.overshoot_c - thesis.overshoot_c).abs() <= 1, "{name}: {here:?}, thesis {thesis:?}");
        }
        let [p, pi, pd, pid, tuned, fuzzy] = outcomes.map(|outcome| outcome.first_at_sv_s);
        // Fuzzy and auto-tuned heat fully until SV and reach it in the same second; in the thesis fuzzy was 57 s earlier.
        assert!(fuzzy <= tuned && tuned < p && p < pd && pd < pid && pid < pi, "{outcomes:?}");
    }
}
