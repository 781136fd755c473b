//! The experiments that a plant file has as procedures, repeated on the simulated rig in virtual time: one rig, one
//! controller, their settings.
//!
//! 5 l of water at 27 °C, agitator on, an hour recorded, one value a second, as the display shows it: rounded to 1 °C.

use std::{sync::Arc, time::Duration};

use super::pxr::map;
use super::rig::Rig;
use super::slave::Unit;
use crate::plant::{
    PlantDef,
    def::{ProcedureDef, ProcedureStep, TagId},
    number::{to_i32, to_u16, to_u32},
};

/// Length of each recording.
pub const RECORDING: Duration = Duration::from_secs(3600);
/// PV that came to SV later than this before the end of the recording is not called steady.
const STEADY_MIN_S: u32 = 300;
const FILL_L: f64 = 5.0;
/// Address of the first setting in display units.
const ENGINEERING: u16 = 1000;

/// Settings of the controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Control {
    /// Name of the kind of control.
    pub name: Arc<str>,
    /// Setpoint in °C, a whole number.
    pub sv_c: i32,
    /// Proportional band in percent of the range.
    pub p_percent: f64,
    /// Integral time in seconds; 0 is none.
    pub i_s: f64,
    /// Derivative time in seconds; 0 is none.
    pub d_s: f64,
    /// What register 41002 is set to: the law.
    pub law: u16,
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

/// One experiment with what was measured on the real rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// The settings.
    pub control: Control,
    /// The reference of the plant file: to compare with, never to compute from.
    pub reference: Milestones,
}

/// The procedures of a plant that measure one controller and have a reference, in the order of its file.
pub fn of_plant(def: &PlantDef) -> Vec<Experiment> {
    def.procedures.iter().filter_map(|procedure| experiment(def, procedure)).collect()
}

fn experiment(def: &PlantDef, procedure: &ProcedureDef) -> Option<Experiment> {
    let reference = procedure.reference.as_ref()?;
    let (controller, _) = procedure.measured().next()?;
    let faceplate = def.device(controller).faceplate.as_ref()?;
    let [p, i, d] = faceplate.tunes[..] else { return None };
    // The last write of a tag holds: those of the procedures that it names come first.
    let written = |tag: TagId| {
        procedure.steps.iter().rev().find_map(|step| match step {
            ProcedureStep::Write { tag: of, value } if *of == tag => Some(*value),
            _ => None,
        })
    };
    let control = Control {
        name: procedure.name.clone(),
        sv_c: to_i32(written(faceplate.sv)?),
        p_percent: written(p)?,
        i_s: written(i)?,
        d_s: written(d)?,
        law: to_u16(written(faceplate.mode?)?),
    };
    let seconds = |time: Option<Duration>| time.map(|time| to_u32(time.as_secs()));
    let reference = Milestones {
        first_at_sv_s: seconds(reference.at_sv),
        steady_from_s: seconds(reference.steady),
        overshoot_c: to_i32(reference.overshoot.unwrap_or(0.0)),
    };
    Some(Experiment { control, reference })
}

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
        (map::CONTROL, control.law),
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
pub fn measure(sv_c: i32, recording: &[Recorded]) -> Milestones {
    let mut outcome = Milestones { first_at_sv_s: None, steady_from_s: None, overshoot_c: 0 };
    let mut last_s = 0;
    for Recorded { second, pv_c, .. } in recording.iter().copied() {
        last_s = second;
        let shown_c = to_i32(pv_c.round());
        outcome.overshoot_c = outcome.overshoot_c.max(shown_c - sv_c);
        if shown_c != sv_c {
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
    use crate::profile;

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
            assert_eq!(measure(70, &recorded), expect, "{recording:?}");
        };
        check(&[27.0, 69.4, 69.5, 70.4, 70.0], Some(2), Some(2), 0);
        check(&[27.0, 69.5, 69.4, 69.6], Some(1), Some(3), 0);
        check(&[27.0, 69.5, 70.5, 72.4, 70.0], Some(1), Some(4), 2);
        check(&[27.0, 69.5, 70.6], Some(1), None, 1);
        check(&[27.0, 69.4], None, None, 0);
        let late: Vec<Recorded> = (0..300).map(|second| of((second, if second < 10 { 27.0 } else { 70.0 }))).collect();
        assert_eq!(measure(70, &late), Milestones { first_at_sv_s: Some(10), steady_from_s: None, overshoot_c: 0 });
        // What jumps over SV was not at it.
        check(&[27.0, 71.0, 70.0], Some(2), Some(2), 1);
    }

    fn shipped() -> Vec<Experiment> {
        let def = profile::load(std::path::Path::new("tank"), &profile::Search::shipped()).expect("a shipped plant");
        of_plant(&def)
    }

    #[test]
    fn the_procedures_of_the_shipped_plant_are_experiments() {
        let found = shipped();
        let names: Vec<&str> = found.iter().map(|experiment| &*experiment.control.name).collect();
        assert_eq!(names, ["P", "PI", "PD", "PID", "auto-tuned", "fuzzy"], "not the filling, nor all six together");
        let Experiment { control, reference } = &found[4];
        let settings = (control.sv_c, control.p_percent, control.i_s, control.d_s, control.law);
        assert_eq!(settings, (70, 1.2, 70.0, 13.5, 0), "the setpoint of the filling is not that of the experiment");
        assert_eq!(reference.first_at_sv_s, Some(10 * 60 + 44));
        let laws: Vec<u16> = found.iter().map(|experiment| experiment.control.law).collect();
        assert_eq!(laws, [0, 0, 0, 0, 0, 1]);
    }

    /// Why fuzzy and auto-tuned tie here: both heat fully until PV is within 1.5 °C of SV, so that their settings have no time
    /// to differ. The 57 s between them in the thesis are those of another process: 0.4 l less water give them all.
    #[test]
    fn full_power_until_sv_leaves_no_time_for_the_law() {
        let found = shipped();
        let [.., tuned, fuzzy] = &found[..] else { panic!("six experiments: {found:?}") };
        for experiment in [tuned, fuzzy] {
            let recording = record(&experiment.control);
            let throttled = recording.iter().skip(5).find(|recorded| recorded.mv_percent < 99.9).expect("it throttles");
            assert!(
                f64::from(experiment.control.sv_c) - 1.5 < throttled.pv_c,
                "{}: {throttled:?}",
                experiment.control.name
            );
        }
        let less = measure(fuzzy.control.sv_c, &record_filled(&fuzzy.control, FILL_L - 0.4)).first_at_sv_s;
        let thesis = fuzzy.reference.first_at_sv_s.expect("it came to SV");
        assert!(less.is_some_and(|less| less.abs_diff(thesis) <= 10), "{less:?}, thesis {thesis}");
    }

    /// What the rig meets of the goal: times within 10 %, overshoots within 1 °C, P and PD never steady, the order by first
    /// time at SV as in the thesis but for one tie.
    #[test]
    fn the_six_experiments_come_out_as_in_the_thesis() {
        let found = shipped();
        let outcome = |experiment: &Experiment| measure(experiment.control.sv_c, &record(&experiment.control));
        let outcomes: Vec<Milestones> = found.iter().map(outcome).collect();
        for (Experiment { control, reference: thesis }, here) in found.iter().zip(&outcomes) {
            let near = |here: Option<u32>, thesis: Option<u32>| match (here, thesis) {
                (Some(here), Some(thesis)) => (f64::from(here) / f64::from(thesis) - 1.0).abs() <= 0.10,
                (here, thesis) => here == thesis,
            };
            let name = &control.name;
            assert!(near(here.first_at_sv_s, thesis.first_at_sv_s), "{name}: {here:?}, thesis {thesis:?}");
            assert!(near(here.steady_from_s, thesis.steady_from_s), "{name}: {here:?}, thesis {thesis:?}");
            assert!((here.overshoot_c - thesis.overshoot_c).abs() <= 1, "{name}: {here:?}, thesis {thesis:?}");
        }
        let first: Vec<Option<u32>> = outcomes.iter().map(|outcome| outcome.first_at_sv_s).collect();
        let [p, pi, pd, pid, tuned, fuzzy] = first[..] else { panic!("six experiments: {first:?}") };
        // Fuzzy and auto-tuned heat fully until SV and reach it in the same second; in the thesis fuzzy was 57 s earlier.
        assert!(fuzzy <= tuned && tuned < p && p < pd && pd < pid && pid < pi, "{outcomes:?}");
    }
}
