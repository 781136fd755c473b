//! Counters that are read wrongly, roll over, are reset and replaced, by a table of what each does.

use proptest::prelude::*;

use super::{CounterEvent::*, *};
use crate::plant::{
    data_type::DataType,
    id::{DeviceId, TagId},
    tag::{ByteOrder, Decimals, Point, Table},
};

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn tag_of(kind: DataType, scale: f64) -> TagDef {
    let point = Point { table: Table::Holding, address: 0, kind, order: ByteOrder::Abcd, field: None };
    TagDef { scale, ..TagDef::new(TagId(0), DeviceId(0), "M.E", point) }
}

fn whole(kind: DataType) -> CounterRule {
    CounterRule::of(&tag_of(kind, 1.0), None)
}

/// What is counted in all, and the events, of readings a minute apart.
fn run(rule: CounterRule, values: &[f64]) -> (f64, Vec<CounterEvent>) {
    run_at(rule, &values.iter().zip(0..).map(|(value, minute)| (minute * 60, *value)).collect::<Vec<_>>())
}

fn run_at(rule: CounterRule, values: &[(i64, f64)]) -> (f64, Vec<CounterEvent>) {
    let mut counter = Counter::new(rule);
    let (mut sum, mut events) = (0.0, Vec::new());
    for (second, value) in values {
        let counted = counter.read(Reading { value: Exact::from(*value), at: at(*second), until: at(second + 60) });
        assert!(0.0 <= counted.gain.near(), "{values:?}: {counted:?}");
        sum += counted.gain.near();
        events.extend(counted.step.map(|step| step.event));
    }
    events.extend(counter.held().map(|step| step.event));
    (sum, events)
}

#[test]
fn each_kind_of_step_is_known_by_what_comes_after_it() {
    let long = whole(DataType::U32);
    let decimal = CounterRule { moduli: [Some(1e6), None], digit: 0.1, ..CounterRule::default() };
    let check = |what: &str, rule, values: &[f64], counted: f64, events: &[CounterEvent]| {
        let (sum, found) = run(rule, values);
        assert!((sum - counted).abs() < 1e-6 && found == events, "{what}: counted {sum}, {found:?}");
    };
    check("plain", long, &[100.0, 101.0, 103.0, 103.0], 3.0, &[]);
    check("jitter", long, &[100.0, 105.0, 104.0, 106.0, 105.0, 107.0], 7.0, &[]);
    check("jitter that lasts", long, &[100.0, 105.0, 104.0, 104.0], 5.0, &[]);
    check("false 0", long, &[15_508_000.0, 15_508_001.0, 0.0, 15_508_002.0], 2.0, &[FalseReading]);
    check("0 for a while", long, &[500.0, 0.0, 0.0, 0.0, 502.0], 2.0, &[FalseReading]);
    check("counts up from 0 to where it was", long, &[500.0, 0.0, 5.0, 502.0], 2.0 + 3.0, &[Reset, FalseReading]);
    check("two false ones", long, &[499.0, 500.0, 0.0, 65_535.0, 502.0], 3.0, &[FalseReading, FalseReading]);
    check("torn words", long, &[131_067.0, 131_070.0, 196_606.0, 131_073.0], 6.0, &[FalseReading]);
    check("reset", long, &[5_000.0, 5_002.0, 0.0, 3.0, 4.0], 6.0, &[Reset]);
    check("reset, and it stands still", long, &[5_000.0, 5_002.0, 0.0, 0.0], 2.0, &[Held]);
    check("lower", long, &[50_000.0, 50_001.0, 30_000.0, 30_001.0, 30_002.0], 3.0, &[Replaced]);
    check("another meter with few", long, &[10_000.0, 10_005.0, 904.0, 908.0], 9.0, &[Replaced]);
    check("higher", long, &[500.0, 501.0, 502.0, 90_000.0, 90_001.0], 3.0, &[Replaced]);
    check("a fast begin is none", long, &[500.0, 501.0, 501.0, 2_000.0, 3_500.0, 5_000.0], 4_500.0, &[]);
    check("16 bits", whole(DataType::U16), &[65_530.0, 65_534.0, 3.0, 9.0], 15.0, &[Rollover]);
    check("signed", whole(DataType::I16), &[32_760.0, -32_770.0, -32_760.0], 16.0, &[Rollover]);
    check("signed to 0", whole(DataType::I16), &[32_760.0, 2.0, 9.0], 17.0, &[Rollover]);
    check("BCD", whole(DataType::Bcd32), &[99_999_990.0, 4.0, 5.0], 15.0, &[Rollover]);
    check("its own", decimal, &[999_999.0, 999_999.9, 0.3, 0.5], 1.5, &[Rollover]);
    check("32 bits do not roll over here", long, &[99_999_999.0, 3.0, 4.0], 4.0, &[Reset]);
}

#[test]
fn an_outage_is_counted_when_it_is_over() {
    let long = whole(DataType::U32);
    let hour = |hours: i64, value| (hours * 3_600, value);
    let day = |from: i64| (from..from + 24).map(|n| hour(n, 1_000.0 + 60.0 * n as f64));
    let after = |hours: i64, value: f64| {
        let last = [hour(23 + hours, value), hour(24 + hours, value + 60.0)];
        run_at(long, &day(0).chain(last).collect::<Vec<_>>())
    };
    assert_eq!(after(10, 2_380.0 + 600.0), (23.0 * 60.0 + 660.0, vec![]));
    // A meter put in meanwhile, which shows more or less than the one before.
    assert_eq!(after(10, 90_000.0), (23.0 * 60.0 + 60.0, vec![Replaced]));
    assert_eq!(after(10, 2_300.0 / 2.0), (23.0 * 60.0 + 60.0 + 1_150.0, vec![Reset]));
    assert_eq!(after(2, 1_150.0), (23.0 * 60.0 + 60.0, vec![Replaced]));
}

#[test]
fn a_rate_that_is_given_decides() {
    let rule = CounterRule { max_rate: Some(100.0), ..whole(DataType::U32) };
    assert_eq!(run(rule, &[500.0, 590.0, 600.0]), (100.0, vec![]));
    assert_eq!(run(rule, &[500.0, 700.0, 790.0]), (90.0, vec![Replaced]));
    assert_eq!(run(rule, &[500.0, 700.0, 510.0]), (10.0, vec![FalseReading]));
}

#[test]
fn type_and_scale_give_the_last_digit_and_the_rollover() {
    let check = |tag: &TagDef, decimals, digit: f64, first: Option<f64>| {
        let rule = CounterRule::of(tag, decimals);
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
        assert!(near(rule.digit, digit), "{rule:?}");
        assert!(rule.moduli[0].zip(first).map_or(rule.moduli[0] == first, |(a, b)| near(a, b)), "{rule:?}");
    };
    check(&tag_of(DataType::U16, 0.1), None, 0.1, Some(6_553.6));
    check(&tag_of(DataType::U32, 0.01), None, 0.01, Some(42_949_672.96));
    check(&tag_of(DataType::U64, 0.001), None, 0.001, Some(18_446_744_073_709_551.616));
    check(&tag_of(DataType::Bcd16, 10.0), None, 10.0, Some(100_000.0));
    check(&TagDef { decimals: Decimals::Fixed(2), ..tag_of(DataType::F32, 1.0) }, None, 0.01, None);
    check(&TagDef { decimals: Decimals::From(TagId(1)), ..tag_of(DataType::U16, 1.0) }, Some(2), 0.01, Some(655.36));
    check(&TagDef { modulus: Some(1e6), ..tag_of(DataType::F32, 1.0) }, None, 1.0, Some(1e6));
}

/// A float of 32 bits at 15 million has whole numbers only: it stands still, then steps.
#[test]
fn a_float_that_has_become_coarse_counts_all_the_same() {
    let rule = CounterRule::of(&TagDef { decimals: Decimals::Fixed(3), ..tag_of(DataType::F32, 1.0) }, None);
    let values: Vec<f64> = (0..200).map(|n| f64::from((16_777_000.0 + 0.1 * f64::from(n)) as f32)).collect();
    assert_eq!(run(rule, &values), (20.0, vec![]));
}

/// A part of a history: what happens, and how long after the reading before.
#[derive(Debug, Clone, Copy)]
enum Story {
    Counts(u32),
    Jitter,
    FalseZero(u8),
    Outage(u32),
    Reset,
    Replaced,
}

fn story() -> impl Strategy<Value = Story> {
    prop_oneof![
        8 => (0..20u32).prop_map(Story::Counts),
        2 => Just(Story::Jitter),
        1 => (1..4u8).prop_map(Story::FalseZero),
        1 => (10..600u32).prop_map(Story::Outage),
        1 => Just(Story::Reset),
        1 => Just(Story::Replaced),
    ]
}

proptest! {
    /// What is counted is what was consumed, whatever happened to the readings; cut anywhere, the parts add up.
    #[test]
    fn what_is_counted_is_what_was_consumed(stories in proptest::collection::vec(story(), 1..60), cut in 0..400_usize) {
        let (mut minute, mut shown, mut consumed) = (0_i64, 40_000.0, 0.0);
        let mut readings = vec![(0, shown)];
        let mut go_on = |minute: &mut i64, shown: &mut f64, minutes: u32, readings: &mut Vec<(i64, f64)>| {
            *minute += i64::from(minutes);
            *shown += f64::from(7 * minutes);
            readings.push((*minute * 60, *shown));
            consumed += f64::from(7 * minutes);
        };
        for story in stories {
            match story {
                Story::Counts(minutes) => (0..minutes).for_each(|_| go_on(&mut minute, &mut shown, 1, &mut readings)),
                Story::Jitter => { minute += 1; readings.push((minute * 60, shown - 1.0)); }
                Story::FalseZero(times) => {
                    for _ in 0..times { minute += 1; readings.push((minute * 60, 0.0)); }
                }
                Story::Outage(minutes) => go_on(&mut minute, &mut shown, minutes, &mut readings),
                Story::Reset => { minute += 1; shown = 0.0; readings.push((minute * 60, shown)); }
                Story::Replaced => {
                    // Far from what another showed before: near it, it would be a false reading that is over.
                    minute += 1;
                    shown = 100_000.0 + 2_000.0 * minute as f64;
                    readings.push((minute * 60, shown));
                }
            }
            // It counts on, so that what happened is decided.
            (0..2).for_each(|_| go_on(&mut minute, &mut shown, 1, &mut readings));
        }
        let mut counter = Counter::new(CounterRule { max_rate: Some(420.0), ..whole(DataType::U32) });
        let mut parts = [0.0; 2];
        for (place, (second, value)) in readings.iter().enumerate() {
            let counted = counter.read(Reading { value: (*value).into(), at: at(*second), until: at(second + 60) });
            prop_assert!(0.0 <= counted.gain.near());
            parts[usize::from(cut < place)] += counted.gain.near();
        }
        prop_assert!(counter.held().is_none());
        prop_assert_eq!(parts[0] + parts[1], consumed);
    }
}
