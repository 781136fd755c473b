//! Sets against a controller whose SV is bounded by limits that are settings themselves.

use jiff::Timestamp;
use proptest::prelude::*;

use super::*;
use crate::plant::{
    fixture,
    interlock::{InterlockCondition, InterlockDef},
    tag::{Access, Bound, ByteOrder, DataType, Point, Table},
};

const LOW: TagId = TagId(0);
const HIGH: TagId = TagId(1);
const SV: TagId = TagId(2);
const MODE: TagId = TagId(3);
const UNIT: TagId = TagId(4);
const RUN: TagId = TagId(5);
const TIC: DeviceId = fixture::TIC;

fn def() -> PlantDef {
    let tag = |id: TagId, short: &str| TagDef {
        access: Access::ReadWrite,
        in_sets: true,
        ..TagDef::new(
            id,
            TIC,
            &format!("TIC-1.{short}"),
            Point { table: Table::Holding, address: id.0, kind: DataType::I16, order: ByteOrder::Abcd, field: None },
        )
    };
    let unit = Some((UNIT, vec![(0, "°C".to_owned()), (1, "°F".to_owned())]));
    let (low, high) = (Some(Bound::From(LOW)), Some(Bound::From(HIGH)));
    let tags = vec![
        TagDef { min: Some(Bound::Fixed(0.0.into())), max: high, unit_from: unit.clone(), ..tag(LOW, "SV-L") },
        TagDef { min: low, max: Some(Bound::Fixed(500.0.into())), ..tag(HIGH, "SV-H") },
        TagDef { min: low, max: high, ..tag(SV, "SV") },
        TagDef { enum_labels: vec![(0, "PID".into()), (1, "FUZZY".into())], ..tag(MODE, "CTRL") },
        TagDef {
            access: Access::Read,
            in_sets: false,
            enum_labels: vec![(0, "°C".into()), (1, "°F".into())],
            ..tag(UNIT, "P-F")
        },
        TagDef { in_sets: false, ..tag(RUN, "RUN") },
    ];
    PlantDef { tags, ..fixture::plant() }
}

/// SV-L, SV-H, SV, CTRL of a device in °C that runs.
fn device(values: [f64; 4]) -> impl Fn(TagId) -> Option<Exact> {
    let known = move |tag: TagId| values.get(tag.index()).copied().or((tag == UNIT || tag == RUN).then_some(0.0));
    move |tag| known(tag).map(Exact::from)
}

fn set(values: [f64; 4]) -> ParameterSet {
    capture(&def(), TIC, "winter", "anna".into(), Timestamp::UNIX_EPOCH, &device(values))
}

fn planned(from: [f64; 4], to: &ParameterSet) -> Result<Vec<(TagId, f64)>, Vec<String>> {
    let plan = plan(&def(), TIC, to, &device(from));
    plan.map(|changes| changes.iter().map(|change| (change.tag, change.new.near())).collect())
        .map_err(|problems| problems.iter().map(Problem::to_string).collect())
}

#[test]
fn limits_that_widen_come_first_and_limits_that_narrow_last() {
    let check = |from, to, expect: &[(TagId, f64)]| assert_eq!(planned(from, &set(to)), Ok(expect.to_vec()), "{to:?}");
    check([0., 100., 50., 0.], [0., 100., 50., 0.], &[]);
    check([0., 100., 50., 0.], [0., 200., 150., 0.], &[(HIGH, 200.), (SV, 150.)]);
    check([0., 200., 150., 0.], [0., 100., 50., 0.], &[(SV, 50.), (HIGH, 100.)]);
    check([0., 10., 5., 0.], [200., 300., 250., 1.], &[(HIGH, 300.), (SV, 250.), (LOW, 200.), (MODE, 1.)]);
    check([200., 300., 250., 1.], [0., 10., 5., 1.], &[(LOW, 0.), (SV, 5.), (HIGH, 10.)]);
}

#[test]
fn what_cannot_be_written_is_reported_before_anything_is() {
    let check = |set: &ParameterSet, expect: &[&str]| {
        let expect: Vec<String> = expect.iter().map(|words| (*words).to_owned()).collect();
        assert_eq!(planned([0., 100., 50., 0.], set), Err(expect));
    };
    let good = set([0., 100., 60., 0.]);
    let with = |tag: &str, value: f64| {
        let mut set = good.clone();
        set.values.retain(|held| held.tag != tag);
        set.values.push(SetValue { tag: tag.to_owned(), value: value.into() });
        set
    };
    check(&with("SV", 101.), &["SV 101 is outside 0 … 100"]);
    check(&with("SV-H", 600.), &["SV-H 600 is outside 0 … 500"]);
    check(&with("SV", 60.4), &["SV 60.4: the device would store 60"]);
    check(&with("CTRL", 7.), &["CTRL has no value 7"]);
    check(&with("RUN", 1.), &["RUN is not a setting of this device"]);
    check(&with("NOPE", 1.), &["NOPE is not a setting of this device"]);
    let fahrenheit = ParameterSet { given: vec![SetValue { tag: "P-F".into(), value: 1.0.into() }], ..good.clone() };
    check(&fahrenheit, &["P-F is °C in the device, °F in the set: the values mean something else"]);
    let foreign = ParameterSet { profile: "other".into(), ..good.clone() };
    check(&foreign, &["the set is for other, this device is fixture"]);
    // A limit that is not known cannot be kept.
    let blind = |tag: TagId| device([0., 100., 50., 0.])(tag).filter(|_| tag != HIGH);
    let problems = plan(&def(), TIC, &ParameterSet { values: vec![good.values[2].clone()], ..good }, &blind);
    assert_eq!(problems, Err(vec![Problem::Unknown("SV-H".into())]));
}

#[test]
fn a_set_holds_what_is_known_and_names_what_is_not() {
    let trusted = |tag: TagId| device([0., 100., 50., 0.])(tag).filter(|_| tag != SV);
    let set = capture(&def(), TIC, "winter", "anna".into(), Timestamp::UNIX_EPOCH, &trusted);
    let names: Vec<&str> = set.values.iter().map(|value| value.tag.as_str()).collect();
    assert_eq!((names, set.missing), (vec!["SV-L", "SV-H", "CTRL"], vec!["SV".to_owned()]));
    // Without the unit a number means nothing: only what has no such unit is kept.
    let trusted = |tag: TagId| device([0., 100., 50., 0.])(tag).filter(|_| tag != UNIT);
    let set = capture(&def(), TIC, "winter", "anna".into(), Timestamp::UNIX_EPOCH, &trusted);
    assert_eq!((set.missing, set.given), (vec!["SV-L".to_owned()], Vec::new()));
}

#[test]
fn a_name_can_be_a_file() {
    for good in ["winter", "Winter 2", "a-b_c", "v1.2", "70 °C (slow)", "ฤดูหนาว", "หน้าร้อน", "ทั้งปี"]
    {
        assert_eq!(check_name(good), Ok(()), "{good}");
    }
    for bad in [
        "",
        " ",
        " x",
        "x ",
        "\u{a0}x",
        ".",
        "..",
        "../x",
        ".x",
        "a/b",
        "a\\b",
        "a:b",
        "a*",
        "a?",
        "a\"b",
        "<a",
        "a>",
        "a|b",
        "a\nb",
        "a\0b",
        "a\u{7f}",
        "a\u{202e}b",
        &"x".repeat(33),
    ] {
        assert!(check_name(bad).is_err(), "{bad}");
    }
}

#[test]
fn a_value_in_another_unit_is_another_value() {
    let unit = |unit: &str| {
        let mut def = def();
        def.tags[SV.index()].unit = unit.to_owned();
        def
    };
    let values = [0., 100., 70., 0.];
    let capture_in =
        |def: &PlantDef| capture(def, TIC, "winter", "anna".into(), Timestamp::UNIX_EPOCH, &device(values));
    let set = capture_in(&unit("°C"));
    assert_eq!(set.units.get("SV").map(String::as_str), Some("°C"));
    let found = |def: &PlantDef, set: &ParameterSet| {
        let rows = compare(def, TIC, set, &device(values));
        let same = rows.iter().find(|row| row.short == "SV").is_some_and(|row| row.same);
        let problems = plan(def, TIC, set, &device(values)).err().unwrap_or_default();
        (same, problems.iter().map(Problem::to_string).collect::<Vec<_>>())
    };
    assert_eq!(found(&unit("°C"), &set), (true, vec![]));
    let other = "the unit of SV is °F in the device, °C in the set: the values mean something else";
    assert_eq!(found(&unit("°F"), &set), (false, vec![other.to_owned()]));
    // A set of before units were kept.
    let old = ParameterSet { units: BTreeMap::new(), ..set };
    assert_eq!(found(&unit("°F"), &old), (true, vec![]));
}

#[test]
fn what_an_interlock_forbids_is_shown_before_the_writes() {
    let mut def = def();
    def.logic.interlocks.push(InterlockDef {
        tag: MODE,
        value: 1.0,
        of: SV,
        when: InterlockCondition::Above(40.0),
        message: "no FUZZY above 40".into(),
        refuse: true,
    });
    let set = set([0., 100., 60., 1.]);
    let planned = |sv| plan(&def, TIC, &set, &device([0., 100., sv, 0.]));
    let found = Problem::Interlock { tag: "CTRL".into(), text: "no FUZZY above 40".into() };
    assert_eq!(planned(50.0), Err(vec![found.clone()]));
    assert_eq!(found.to_string(), "CTRL: interlock: no FUZZY above 40");
    assert_eq!(planned(30.0).map(|changes| changes.len()), Ok(2));
}

fn held() -> impl Strategy<Value = [f64; 4]> {
    (0..=500i32, 0..=500i32, 0..=500i32, 0..2i32).prop_map(|(a, b, c, mode)| {
        let mut sorted = [a, b, c];
        sorted.sort_unstable();
        [sorted[0], sorted[2], sorted[1], mode].map(f64::from)
    })
}

proptest! {
    #[test]
    fn every_step_of_a_plan_keeps_within_the_limits_of_its_moment(from in held(), to in held()) {
        let plan = plan(&def(), TIC, &set(to), &device(from)).map_err(|problems| TestCaseError::fail(format!("{problems:?}")))?;
        let mut now = from;
        for change in &plan {
            prop_assert_eq!(now[change.tag.index()], change.old);
            prop_assert_ne!(change.old, change.new);
            now[change.tag.index()] = change.new.near();
            prop_assert!(now[0] <= now[2] && now[2] <= now[1], "{:?} after {:?}", now, change);
        }
        prop_assert_eq!(now, to);
    }
}
