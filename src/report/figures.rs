//! The figures of a period: from stored samples and alarm steps to the rows of a report.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    time::Duration,
};

use jiff::{Timestamp, ToSpan, tz::TimeZone};

use super::{
    DECIMALS_UNKNOWN, RecordRow, SuppressedAlarm, TagFigures,
    hold::{Held, Holding, Tally, good_value},
};
use crate::plant::{
    def::TagId,
    record::{AlarmRecord, AlarmStep},
    sample::Sample,
    tag::{Decimals, TagDef},
};

/// What a tag is called in a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// `TIC-1.PV`.
    pub tag: String,
    /// `°C`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// Whether it is a counter.
    pub counts: bool,
}

/// Units in which only counters of energy and charge count.
const COUNTED: [&str; 12] = ["Wh", "kWh", "MWh", "GWh", "varh", "kvarh", "Mvarh", "VAh", "kVAh", "MVAh", "Ah", "kAh"];

impl Label {
    /// Name, unit and decimals of a tag, where the device may have chosen the last two: `latest` has the latest good values
    /// of the tags that hold them.
    pub fn at(def: &TagDef, latest: &HashMap<TagId, f64>) -> Label {
        let decimals = match def.decimals {
            Decimals::Fixed(decimals) => decimals,
            Decimals::From(tag) => match latest.get(&tag) {
                Some(decimals) if (0.0..=9.0).contains(decimals) => *decimals as u8,
                Some(_) | None => DECIMALS_UNKNOWN,
            },
        };
        let chosen = def.unit_from.as_ref().and_then(|(chooser, units)| {
            let value = latest.get(chooser)?;
            units.iter().find(|(number, _)| *value == *number as f64).map(|(_, unit)| unit.clone())
        });
        let unit = chosen.unwrap_or_else(|| def.unit.clone());
        let counts = def.counter.unwrap_or_else(|| COUNTED.contains(&unit.as_str()));
        Label { tag: def.name.clone(), unit, decimals, counts }
    }
}

/// The tags that hold decimals and unit of a tag.
pub fn choosers(def: &TagDef) -> impl Iterator<Item = TagId> + use<> {
    let decimals = match def.decimals {
        Decimals::From(tag) => Some(tag),
        Decimals::Fixed(_) => None,
    };
    decimals.into_iter().chain(def.unit_from.as_ref().map(|(tag, _)| *tag))
}

/// Computes the figures of one tag over a period. The samples come in order of time and begin
/// [`HOLD_MAX`](super::hold::HOLD_MAX) before it.
pub struct Figures {
    seconds: f64,
    holding: Holding,
    tally: Option<Tally>,
    counted: f64,
}

impl Figures {
    /// Over `from..until`; nothing has come yet.
    pub fn new(from: Timestamp, until: Timestamp) -> Figures {
        let seconds = until.duration_since(from).as_secs_f64();
        Figures { seconds, holding: Holding::new(from, until), tally: None, counted: 0.0 }
    }

    /// The next sample.
    pub fn next(&mut self, sample: Sample) {
        if let Some(span) = self.holding.next(sample) {
            self.add(span);
        }
    }

    fn add(&mut self, span: Held) {
        let last = self.tally.map_or(span.value, |tally| tally.last);
        // A counter that shows less than half of its last value, but not less than nothing, was reset or has rolled over:
        // it counts from zero. Any other step back is that of a balance, as of energy taken and fed back.
        let reset = (0.0..last / 2.0).contains(&span.value);
        self.counted += if reset { span.value } else { span.value - last };
        Tally::add(&mut self.tally, span);
    }

    /// The figures, when the last sample has come.
    pub fn end(mut self, label: Label, in_alarm: Duration) -> TagFigures {
        if let Some(span) = self.holding.clone().end() {
            self.add(span);
        }
        let Figures { seconds, tally, counted, holding: _ } = self;
        let (mean, difference) = match label.counts {
            true => (None, tally.map(|_| counted)),
            false => (tally.map(|tally| tally.mean), None),
        };
        TagFigures {
            tag: label.tag,
            unit: label.unit,
            decimals: label.decimals,
            min: tally.map(|tally| tally.min),
            mean,
            difference,
            max: tally.map(|tally| tally.max),
            last: tally.map(|tally| tally.last),
            in_alarm,
            good: tally.map_or(0.0, |tally| (tally.seconds / seconds).clamp(0.0, 1.0)),
        }
    }
}

/// Time within `from..until` in which at least one alarm of a subject was active. The steps are all of this subject, in
/// order, and begin with those of the alarms that were active at `from`; an alarm still active at the end counts to the end.
pub fn time_in_alarm<'a>(steps: impl Iterator<Item = &'a AlarmRecord>, from: Timestamp, until: Timestamp) -> Duration {
    let mut active: HashSet<&str> = HashSet::new();
    let mut since = from;
    let mut total = Duration::ZERO;
    for step in steps.filter(|step| step.at < until) {
        let at = step.at.max(since);
        if !active.is_empty() {
            total += Duration::try_from(at.duration_since(since)).unwrap_or_default();
        }
        since = at;
        match step.step {
            AlarmStep::Raised | AlarmStep::RaisedQuietly => {
                active.insert(&step.text);
            }
            AlarmStep::Returned | AlarmStep::ReturnedQuietly => {
                active.remove(&*step.text);
            }
            AlarmStep::Acknowledged
            | AlarmStep::RaisedAgain
            | AlarmStep::Reset
            | AlarmStep::Shelved
            | AlarmStep::Unshelved
            | AlarmStep::Suppressed
            | AlarmStep::Released
            | AlarmStep::OutOfService
            | AlarmStep::InService => {}
        }
    }
    if !active.is_empty() {
        total += Duration::try_from(until.duration_since(since)).unwrap_or_default();
    }
    total
}

/// The rows of the thesis's record, from what stood at each of its instants.
pub fn record(instants: &[Timestamp], sv: &[Option<Sample>], pv: &[Option<Sample>]) -> Vec<RecordRow> {
    let good = |sample: &Option<Sample>| sample.and_then(good_value);
    let row = |((at, sv), pv): ((&Timestamp, &Option<Sample>), &Option<Sample>)| {
        let (sv, pv) = (good(sv), good(pv));
        RecordRow { at: *at, sv, pv, er: sv.zip(pv).map(|(sv, pv)| sv - pv) }
    };
    instants.iter().zip(sv).zip(pv).map(row).collect()
}

/// The alarms that were active over `from..until` while they were not annunciated. `active` are the raising steps of those
/// active at `from`, `standing` of those that were annunciated then; `steps` are those of the period, in order.
pub fn suppressed(
    active: &[AlarmRecord],
    standing: &[AlarmRecord],
    steps: &[AlarmRecord],
    from: Timestamp,
    until: Timestamp,
) -> Vec<SuppressedAlarm> {
    let mut alarms: BTreeMap<(&str, &str), Quiet> = BTreeMap::new();
    let annunciated: HashSet<(&str, &str)> = standing.iter().map(|step| (&*step.subject, &*step.text)).collect();
    for step in active {
        let name = (&*step.subject, &*step.text);
        alarms.entry(name).or_insert_with(|| Quiet::new(step)).set(true, !annunciated.contains(&name), from);
    }
    for step in steps {
        let alarm = alarms.entry((&step.subject, &step.text)).or_insert_with(|| Quiet::new(step));
        let (active, quiet) = match step.step {
            AlarmStep::Raised => (true, false),
            AlarmStep::RaisedQuietly => (true, true),
            AlarmStep::Returned | AlarmStep::ReturnedQuietly => (false, alarm.quiet),
            AlarmStep::Shelved | AlarmStep::Suppressed | AlarmStep::OutOfService => (alarm.active, true),
            AlarmStep::Unshelved | AlarmStep::Released | AlarmStep::InService => (alarm.active, false),
            AlarmStep::Acknowledged | AlarmStep::RaisedAgain | AlarmStep::Reset => continue,
        };
        alarm.found.raised += u64::from(step.step == AlarmStep::RaisedQuietly);
        alarm.set(active, quiet, step.at);
    }
    let ended = alarms.into_values().map(|mut alarm| {
        alarm.set(false, false, until);
        alarm.found
    });
    ended.filter(|found| found.raised > 0 || !found.active.is_zero()).collect()
}

/// Follows an alarm through a period.
struct Quiet {
    active: bool,
    quiet: bool,
    since: Timestamp,
    found: SuppressedAlarm,
}

impl Quiet {
    fn new(step: &AlarmRecord) -> Quiet {
        let (subject, text) = (step.subject.clone(), step.text.clone());
        let found = SuppressedAlarm { subject, text, priority: step.priority, raised: 0, active: Duration::ZERO };
        Quiet { active: false, quiet: false, since: step.at, found }
    }

    fn set(&mut self, active: bool, quiet: bool, at: Timestamp) {
        if self.active && self.quiet {
            self.found.active += Duration::try_from(at.duration_since(self.since)).unwrap_or_default();
        }
        (self.active, self.quiet, self.since) = (active, quiet, at);
    }
}

/// The instants of the record over `from..until`: those whose local time of day is a multiple of `interval`.
pub fn record_grid(interval: Duration, zone: &TimeZone, from: Timestamp, until: Timestamp) -> Vec<Timestamp> {
    let after = |at: &Timestamp| on_grid(zone, interval, at.checked_add(1.microsecond()).ok()?);
    std::iter::successors(on_grid(zone, interval, from), after).take_while(|at| *at < until).collect()
}

/// The first instant not before `at` whose local time of day is a multiple of `interval`. The grid starts anew at every
/// local midnight and follows the clocks over a change: an hour that happens twice has its rows twice.
fn on_grid(zone: &TimeZone, interval: Duration, at: Timestamp) -> Option<Timestamp> {
    const DAY: i64 = 86_400_000_000;
    let interval = i64::try_from(interval.as_micros()).ok().filter(|interval| *interval > 0)?;
    // Instants are whole microseconds in the history; what a period was typed or computed with may be finer.
    let micros = at.as_microsecond();
    let whole = Timestamp::from_microsecond(micros).ok()?;
    let mut at = if whole < at { Timestamp::from_microsecond(micros + 1).ok()? } else { whole };
    loop {
        let local = at.as_microsecond() + i64::from(zone.to_offset(at).seconds()) * 1_000_000;
        let of_day = local.rem_euclid(DAY);
        let past = of_day % interval;
        if past == 0 {
            return Some(at);
        }
        let candidate = at.checked_add((interval - past).min(DAY - of_day).microseconds()).ok()?;
        // A clock change on the way moves the grid: go on from there. Both branches move forward, so this ends.
        let change = zone.following(at).next().map(|change| change.timestamp());
        at = change.map_or(candidate, |change| change.min(candidate));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use std::sync::Arc;

    use super::*;
    use crate::{
        plant::{def::Priority, sample::Cause},
        report::hold::AsOf,
        report::testing::{at, sec, zone},
    };

    fn figures(samples: impl Iterator<Item = Sample>, from: Timestamp, until: Timestamp) -> TagFigures {
        let mut figures = Figures::new(from, until);
        samples.for_each(|sample| figures.next(sample));
        figures.end(label(), Duration::ZERO)
    }

    fn label() -> Label {
        Label { tag: "TIC-1.PV".into(), unit: "°C".into(), decimals: 1, counts: false }
    }

    /// Figures over 0..100 s of samples (second, value or none) as (min, mean, max, last, good).
    fn check(samples: &[(i64, Option<f64>)], expect: (Option<[f64; 4]>, f64)) {
        let samples = samples.iter().map(|&(at, value)| {
            value.map_or(Sample::bad(Cause::Timeout, sec(at)), |value| Sample::good(value, sec(at)))
        });
        let got = figures(samples, sec(0), sec(100));
        let [min, mean, max, last] = expect.0.map_or([None; 4], |values| values.map(Some));
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

    fn step(at: i64, text: &str, step: AlarmStep) -> AlarmRecord {
        AlarmRecord::new(sec(at), "TIC-1.PV", text, Priority::High, step)
    }

    #[test]
    fn a_counter_has_a_difference_and_no_mean() {
        for (readings, expect) in [
            (vec![], None),
            (vec![(-10, 100.0)], Some(0.0)),
            (vec![(-10, 100.0), (20, 101.5), (60, 104.0), (110, 200.0)], Some(4.0)),
            // Reset between 7 and 2: 5 before it, 2 and 1 after it.
            (vec![(0, 2.0), (20, 7.0), (40, 2.0), (60, 3.0)], Some(8.0)),
            // A balance goes back a little, and below zero.
            (vec![(0, 50.0), (20, 49.5)], Some(-0.5)),
            (vec![(0, -10.0), (20, -11.0), (40, -9.0)], Some(1.0)),
            (vec![(0, 1.0), (20, -1.0), (40, 1.0)], Some(0.0)),
        ] {
            let mut figures = Figures::new(sec(0), sec(100));
            readings.iter().for_each(|(at, value)| figures.next(Sample::good(*value, sec(*at))));
            let got = figures.end(Label { unit: "kWh".into(), counts: true, ..label() }, Duration::ZERO);
            assert_eq!((got.difference, got.mean), (expect, None), "{readings:?}");
        }
        let mut def = crate::report::testing::tag(0, "E");
        let counts = |def: &TagDef| Label::at(def, &HashMap::new()).counts;
        assert!(!counts(&def));
        def.unit = "kWh".into();
        assert!(counts(&def));
        def.counter = Some(false);
        assert!(!counts(&def));
    }

    #[test]
    fn an_alarm_that_was_active_while_suppressed_is_listed_with_its_time() {
        use AlarmStep::{
            Acknowledged, Raised, RaisedQuietly, Released, Returned, ReturnedQuietly, Shelved, Suppressed,
        };
        for (active, standing, steps, expect) in [
            (None, None, vec![(10, Raised), (30, Returned)], None),
            (
                None,
                None,
                vec![(10, Suppressed), (20, RaisedQuietly), (50, ReturnedQuietly), (60, Released)],
                Some((1, 30)),
            ),
            // Shelved while it was active, and active again after that.
            (None, None, vec![(10, Raised), (20, Shelved), (25, Acknowledged), (70, Returned)], Some((0, 50))),
            (None, None, vec![(10, RaisedQuietly), (20, Released), (20, Raised)], Some((1, 10))),
            // Active before the period: annunciated, or not.
            (Some(Raised), Some(Raised), vec![(40, Returned)], None),
            (Some(Raised), None, vec![(40, Returned)], Some((0, 40))),
            (Some(RaisedQuietly), None, vec![], Some((0, 100))),
        ] {
            let all = |steps: &[(i64, AlarmStep)]| {
                steps.iter().map(|(at, kind)| step(*at, "high", *kind)).collect::<Vec<_>>()
            };
            let before = |kind: Option<AlarmStep>| all(&kind.map(|kind| (-50, kind)).into_iter().collect::<Vec<_>>());
            let got = suppressed(&before(active), &before(standing), &all(&steps), sec(0), sec(100));
            let got: Vec<_> = got.iter().map(|alarm| (alarm.raised, alarm.active.as_secs())).collect();
            assert_eq!(got, expect.into_iter().collect::<Vec<_>>(), "{steps:?}");
        }
    }

    #[test]
    fn minutes_in_alarm_are_counted_once_however_many_alarms_overlap() {
        use AlarmStep::{Acknowledged, Raised, Returned};
        for (steps, expect) in [
            (vec![], 0),
            (vec![step(10, "high", Raised), step(30, "high", Returned)], 20),
            (vec![step(10, "high", Raised), step(12, "high", Acknowledged), step(30, "high", Returned)], 20),
            // Two that overlap, two that do not.
            (
                vec![
                    step(10, "high", Raised),
                    step(20, "high-high", Raised),
                    step(30, "high-high", Returned),
                    step(40, "high", Returned),
                ],
                30,
            ),
            (
                vec![
                    step(10, "high", Raised),
                    step(20, "high", Returned),
                    step(50, "low", Raised),
                    step(55, "low", Returned),
                ],
                15,
            ),
            // Active before the period, still active at its end.
            (vec![step(-50, "high", Raised), step(30, "high", Returned)], 30),
            (vec![step(90, "high", Raised)], 10),
            (vec![step(-50, "high", Raised)], 100),
            // Raised again without having returned (a restart): one stretch.
            (vec![step(10, "high", Raised), step(20, "high", Raised), step(30, "high", Returned)], 20),
            // After the end nothing counts.
            (vec![step(90, "high", Raised), step(150, "high", Returned)], 10),
            (vec![step(110, "high", Raised)], 0),
        ] {
            let got = time_in_alarm(steps.iter(), sec(0), sec(100));
            assert_eq!(got, Duration::from_secs(expect), "{steps:?}");
        }
    }

    #[test]
    fn the_record_stands_on_the_local_grid_and_leaves_out_what_was_not_good() {
        let sv = [Sample::good(70.0, sec(-5))];
        let pv = [Sample::good(27.0, sec(3)), Sample::bad(Cause::Timeout, sec(15)), Sample::good(28.5, sec(30))];
        let instants: Arc<[_]> = record_grid(Duration::from_secs(10), &TimeZone::UTC, sec(0), sec(40)).into();
        let stood = |samples: &[Sample]| {
            let mut as_of = AsOf::new(instants.clone());
            samples.iter().for_each(|sample| as_of.next(*sample));
            as_of.end()
        };
        let rows = record(&instants, &stood(&sv), &stood(&pv));
        let row = |at, pv: Option<f64>| RecordRow { at: sec(at), sv: Some(70.0), pv, er: pv.map(|pv| 70.0 - pv) };
        assert_eq!(rows, [row(0, None), row(10, Some(27.0)), row(20, None), row(30, Some(28.5))]);
    }

    fn grid(zone_name: &str, interval: u64, from: &str, until: &str) -> Vec<String> {
        let zone = zone(zone_name);
        let instants = record_grid(Duration::from_secs(interval), &zone, at(from), at(until));
        instants.iter().map(|at| at.to_zoned(zone.clone()).strftime("%H:%M%:z").to_string()).collect()
    }

    #[test]
    fn the_grid_follows_the_local_clock_over_its_changes() {
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
        // An interval that does not divide the day starts anew at midnight.
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
                .and_then(|sample| sample.trusted());
            let values: Vec<f64> = (from..until).filter_map(stood).collect();
            let good = values.len() as f64 / length as f64;
            prop_assert!((got.good - good).abs() < 1e-9);
            prop_assert_eq!(got.last, values.last().copied());
            prop_assert_eq!(got.min, values.iter().copied().reduce(f64::min));
            prop_assert_eq!(got.max, values.iter().copied().reduce(f64::max));
            let mean = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
            prop_assert_eq!(got.mean.is_some(), mean.is_some());
            if let (Some(got), Some(mean)) = (got.mean, mean) {
                prop_assert!((got - mean).abs() < 1e-6, "{} {}", got, mean);
            }
        }
    }
}
