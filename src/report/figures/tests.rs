//! Figures over tables of samples, alarms and clock changes.

use proptest::prelude::*;

use std::sync::Arc;

use super::*;
use crate::{
    plant::{counter::CounterRule, def::Priority, sample::Cause},
    report::step_series::ValuesAt,
    report::testing::{at, counted_of, figures_of, sec, tag, zone},
};

fn figures(samples: impl Iterator<Item = Sample>, from: Timestamp, until: Timestamp) -> TagFigures {
    figures_of(samples, from, until).end(label(), Exact::default(), Duration::ZERO)
}

fn label() -> TagDescription {
    TagDescription { tag: "TIC-1.PV".into(), unit: "°C".into(), decimals: 1, counts: false }
}

/// Figures over 0..100 s of samples (second, value or none) as (min, mean, max, last, good).
fn check(samples: &[(i64, Option<f64>)], expect: (Option<[f64; 4]>, f64)) {
    let samples = samples
        .iter()
        .map(|&(at, value)| value.map_or(Sample::bad(Cause::Timeout, sec(at)), |value| Sample::good(value, sec(at))));
    let got = figures(samples, sec(0), sec(100));
    let [min, mean, max, last] = expect.0.map_or([None; 4], |values| values.map(|value| Some(value.into())));
    assert_eq!((got.min, got.mean, got.max, got.last), (min, mean, max, last));
    assert!((got.good - expect.1).abs() < 1e-9, "{}", got.good);
}

#[test]
fn the_figures_count_good_time_only() {
    check(&[], (None, 0.0));
    check(&[(0, Some(20.0))], (Some([20.0; 4]), 1.0));
    check(&[(-30, Some(20.0))], (Some([20.0; 4]), 1.0));
    check(&[(0, Some(10.0)), (75, Some(30.0))], (Some([10.0, 15.0, 30.0, 30.0]), 1.0));
    check(&[(0, Some(10.0)), (50, None)], (Some([10.0; 4]), 0.5));
    check(&[(0, None), (90, Some(7.0))], (Some([7.0; 4]), 0.1));
    check(&[(0, Some(10.0)), (120, Some(99.0))], (Some([10.0; 4]), 1.0));
}

fn step(at: i64, text: &str, step: AlarmEvent) -> AlarmRecord {
    AlarmRecord::new(sec(at), "TIC-1.PV", text, Priority::High, step)
}

#[test]
fn a_report_takes_the_decimals_that_the_screen_takes() {
    let pv = TagDef { decimals: Decimals::From(TagId(9)), ..tag(0, "PV") };
    for (announced, expect) in [(2.0, 2), (6.0, 6), (7.0, DECIMALS_UNKNOWN), (1.5, DECIMALS_UNKNOWN)] {
        assert_eq!(TagDescription::new(&pv, &HashMap::from([(TagId(9), announced)])).decimals, expect, "{announced}");
    }
}

#[test]
fn a_counter_has_a_difference_and_no_mean() {
    for (readings, expect) in [
        (vec![], None),
        (vec![(-10, 100.0)], Some(0.0)),
        (vec![(-10, 100.0), (20, 101.5), (60, 104.0), (110, 200.0)], Some(4.0)),
        // Reset after 7: 5 before it, 0.2 and 1 after it.
        (vec![(0, 2.0), (20, 7.0), (40, 0.2), (60, 1.2)], Some(6.2)),
        // Never less than nothing.
        (vec![(0, 50.0), (20, 49.5)], Some(0.0)),
        (vec![(0, 50.0), (20, 49.5), (40, 50.5)], Some(0.5)),
    ] {
        let samples = || readings.iter().map(|(at, value)| Sample::good(*value, sec(*at)));
        let rule = CounterRule { digit: 0.1, ..CounterRule::default() };
        let (counted, _) = counted_of(samples(), rule, (sec(0), sec(100)));
        let got = figures_of(samples(), sec(0), sec(100)).end(
            TagDescription { unit: "kWh".into(), counts: true, ..label() },
            counted,
            Duration::ZERO,
        );
        assert_eq!((got.difference, got.mean), (expect.map(Into::into), None), "{readings:?}");
    }
    let mut def = crate::report::testing::tag(0, "E");
    let counts = |def: &TagDef| TagDescription::new(def, &HashMap::new()).counts;
    assert!(!counts(&def));
    def.unit = "kWh".into();
    assert!(counts(&def));
    def.counter = Some(false);
    assert!(!counts(&def));
}

#[test]
fn an_alarm_active_while_suppressed_is_listed_with_its_time() {
    use AlarmEvent::{
        Acknowledged, CarriedOver, Raised, RaisedSuppressed, Removed, ReturnedSuppressed, ReturnedToNormal, Shelved,
        SuppressedByDesign, Unshelved, Unsuppressed,
    };
    for (active, suppressing, steps, expect) in [
        (None, None, vec![(10, Raised), (30, ReturnedToNormal)], None),
        (
            None,
            None,
            vec![(10, SuppressedByDesign), (20, RaisedSuppressed), (50, ReturnedSuppressed), (60, Unsuppressed)],
            Some((1, 30)),
        ),
        // Shelved while it was active, and active again after that.
        (None, None, vec![(10, Raised), (20, Shelved), (25, Acknowledged), (70, ReturnedToNormal)], Some((0, 50))),
        (None, None, vec![(10, RaisedSuppressed), (20, Unsuppressed), (20, Raised)], Some((1, 10))),
        // Off the shelf it counts no more. Gone in the instant in which it came, it came all the same.
        (None, None, vec![(10, Raised), (20, Shelved), (50, Unshelved), (70, ReturnedToNormal)], Some((0, 30))),
        (None, None, vec![(10, RaisedSuppressed), (10, ReturnedSuppressed)], Some((1, 0))),
        // Active before the period: annunciated, or not.
        (Some(Raised), None, vec![(40, ReturnedToNormal)], None),
        (Some(Raised), Some(Shelved), vec![(40, ReturnedToNormal)], Some((0, 40))),
        (Some(RaisedSuppressed), None, vec![], Some((0, 100))),
        // For two reasons: the end of one is not that of the other.
        (
            Some(RaisedSuppressed),
            Some(SuppressedByDesign),
            vec![(10, Shelved), (30, Unshelved), (60, Unsuppressed), (60, Raised)],
            Some((0, 60)),
        ),
        // It is there no more, or goes on under this name.
        (None, None, vec![(10, Raised), (20, Shelved), (30, Removed)], Some((0, 10))),
        (None, None, vec![(10, CarriedOver), (10, Shelved), (30, ReturnedSuppressed)], Some((0, 20))),
    ] {
        let all =
            |steps: &[(i64, AlarmEvent)]| steps.iter().map(|(at, kind)| step(*at, "high", *kind)).collect::<Vec<_>>();
        let before = |kind: Option<AlarmEvent>| all(&kind.map(|kind| (-50, kind)).into_iter().collect::<Vec<_>>());
        let got = suppressed(&before(active), &before(suppressing), &all(&steps), sec(0), sec(100));
        let got: Vec<_> = got.iter().map(|alarm| (alarm.raised, alarm.active.as_secs())).collect();
        assert_eq!(got, expect.into_iter().collect::<Vec<_>>(), "{steps:?}");
    }
}

#[test]
fn minutes_in_alarm_are_counted_once_where_alarms_overlap() {
    use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};
    for (steps, expect) in [
        (vec![], 0),
        (vec![step(10, "high", Raised), step(30, "high", ReturnedToNormal)], 20),
        (vec![step(10, "high", Raised), step(12, "high", Acknowledged), step(30, "high", ReturnedToNormal)], 20),
        // Two that overlap, two that do not.
        (
            vec![
                step(10, "high", Raised),
                step(20, "high-high", Raised),
                step(30, "high-high", ReturnedToNormal),
                step(40, "high", ReturnedToNormal),
            ],
            30,
        ),
        (
            vec![
                step(10, "high", Raised),
                step(20, "high", ReturnedToNormal),
                step(50, "low", Raised),
                step(55, "low", ReturnedToNormal),
            ],
            15,
        ),
        // Active before the period, still active at its end.
        (vec![step(-50, "high", Raised), step(30, "high", ReturnedToNormal)], 30),
        (vec![step(90, "high", Raised)], 10),
        (vec![step(-50, "high", Raised)], 100),
        // Raised again without having returned (a restart): one stretch.
        (vec![step(10, "high", Raised), step(20, "high", Raised), step(30, "high", ReturnedToNormal)], 20),
        // After the end nothing counts.
        (vec![step(90, "high", Raised), step(150, "high", ReturnedToNormal)], 10),
        (vec![step(110, "high", Raised)], 0),
    ] {
        let got = time_in_alarm(steps.iter(), (sec(0), sec(100)), &[]);
        assert_eq!(got, Duration::from_secs(expect), "{steps:?}");
    }
    // A clock was set forward over 20 s of it, and over 10 s before it.
    let steps = [step(10, "high", Raised), step(60, "high", ReturnedToNormal)];
    let got = time_in_alarm(steps.iter(), (sec(0), sec(100)), &[(sec(-5), sec(5)), (sec(30), sec(50))]);
    assert_eq!(got, Duration::from_secs(30));
}

#[test]
fn the_record_is_on_the_local_grid_with_good_values_only() {
    let sv = [Sample::good(70.0, sec(-5))];
    let pv = [Sample::good(27.0, sec(3)), Sample::bad(Cause::Timeout, sec(15)), Sample::good(28.5, sec(30))];
    let instants: Arc<[_]> = record_grid(Duration::from_secs(10), &TimeZone::UTC, sec(0), sec(40)).into();
    let stood = |samples: &[Sample]| {
        let mut as_of = ValuesAt::new(instants.clone());
        samples.iter().for_each(|sample| as_of.next(*sample));
        as_of.end()
    };
    let rows = record(&instants, &stood(&sv), &stood(&pv));
    let row = |at, pv: Option<f64>| {
        let (pv, er) = (pv.map(Into::into), pv.map(|pv| (70.0 - pv).into()));
        RecordRow { at: sec(at), sv: Some(70.0.into()), pv, er }
    };
    assert_eq!(rows, [row(0, None), row(10, Some(27.0)), row(20, None), row(30, Some(28.5))]);
}

fn grid(zone_name: &str, interval: u64, from: &str, until: &str) -> Vec<String> {
    let zone = zone(zone_name);
    let instants = record_grid(Duration::from_secs(interval), &zone, at(from), at(until));
    instants.iter().map(|at| at.to_zoned(zone.clone()).strftime("%H:%M%:z").to_string()).collect()
}

#[test]
fn the_grid_follows_the_local_clock_over_its_changes() {
    assert_eq!(grid("UTC", 0, "2026-01-01T00:00Z", "2026-01-01T01:00Z"), [""; 0], "no interval, no grid");
    // A half-hour zone: the grid is local, not UTC.
    assert_eq!(
        grid("Asia/Kolkata", 3600, "2026-01-01T00:10+05:30", "2026-01-01T02:10+05:30"),
        ["01:00+05:30", "02:00+05:30"]
    );
    // Spring: 02:00 does not exist. Autumn: 02:00 and 02:30 happen twice.
    assert_eq!(
        grid("Europe/Berlin", 1800, "2026-03-29T01:30+01", "2026-03-29T03:30+02"),
        ["01:30+01:00", "03:00+02:00"]
    );
    let autumn = grid("Europe/Berlin", 1800, "2026-10-25T02:00+02", "2026-10-25T03:30+01");
    assert_eq!(autumn, ["02:00+02:00", "02:30+02:00", "02:00+01:00", "02:30+01:00", "03:00+01:00"]);
    // An interval that does not divide the day starts again at midnight.
    assert_eq!(
        grid("Asia/Bangkok", 7 * 3600, "2026-01-01T20:00+07", "2026-01-02T08:00+07"),
        ["21:00+07:00", "00:00+07:00", "07:00+07:00"]
    );
}

proptest! {
    #[test]
    fn the_mean_equals_a_second_by_second_integration(
        steps in proptest::collection::vec((1i64..200, proptest::option::weighted(0.8, -1e3f64..1e3)), 0..40),
        from in 0i64..500,
        length in 1i64..2000,
    ) {
        let mut at = 0;
        let samples: Vec<Sample> = steps.iter().map(|&(wait, value)| {
            at += wait;
            value.map_or(Sample::bad(Cause::Timeout, sec(at)), |value| Sample::good(value, sec(at)))
        }).collect();
        let until = from + length;
        let got = figures(samples.iter().copied(), sec(from), sec(until));
        // Naive: what stood in each second, by searching the whole list.
        let stood = |second: i64| samples.iter().rev().find(|sample| sample.at <= sec(second))
            .filter(|sample| sec(second).duration_since(sample.at).as_secs() < 150)
            .and_then(|sample| sample.good_value());
        let values: Vec<f64> = (from..until).filter_map(stood).collect();
        let good = values.len() as f64 / length as f64;
        prop_assert!((got.good - good).abs() < 1e-9);
        prop_assert_eq!(got.last.map(Exact::near), values.last().copied());
        prop_assert_eq!(got.min.map(Exact::near), values.iter().copied().reduce(f64::min));
        prop_assert_eq!(got.max.map(Exact::near), values.iter().copied().reduce(f64::max));
        let mean = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        prop_assert_eq!(got.mean.is_some(), mean.is_some());
        if let (Some(got), Some(mean)) = (got.mean, mean) {
            prop_assert!((got.near() - mean).abs() < 1e-6, "{} {}", got, mean);
        }
    }
}

#[test]
fn unshelved_while_suppressed_by_design_is_still_suppressed() {
    use AlarmEvent::{Raised, ReturnedSuppressed, Shelved, SuppressedByDesign, Unshelved};
    let steps = [(10, Raised), (20, Shelved), (30, SuppressedByDesign), (40, Unshelved), (70, ReturnedSuppressed)];
    let steps = steps.map(|(at, event)| step(at, "high", event));
    let got = suppressed(&[], &[], &steps, sec(0), sec(100));
    assert_eq!(got.iter().map(|alarm| (alarm.raised, alarm.active.as_secs())).collect::<Vec<_>>(), [(0, 50)]);
}
