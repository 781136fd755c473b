//! Alarms of a profile, in the plant that uses it.

use super::*;
use crate::plant::def::{AlarmDef, Condition, Priority, Subject};

const ALARMS: &str = r#"
[[tag]]
name = "FAULT"
table = "holding"
address = 600
type = "uint32"
bits = { 0 = "motor hot", 17 = "fan blocked", 31 = "service due" }

[[tag]]
name = "CODE"
table = "holding"
address = 602
type = "uint16"
enum = { 0 = "none", 4 = "overcurrent", 9 = "phase lost" }

[[alarm]]
tag = "FAULT"
each = "bit"
except = [31]
priority = "high"
id = "fault"

[[alarm]]
tag = "CODE"
each = "code"
except = [0]
message = "trip: {n}"
priority = "critical"

[[alarm]]
tag = "T"
high = 90
deadband = 1
priority = "medium"
message = "very hot"
"#;

fn plant_with(plant: &str, meter: &str) -> PlantDef {
    load(plant.as_bytes(), meter, PLC).unwrap_or_else(|errors| panic!("{errors}"))
}

fn of_profile(plant: &PlantDef) -> Vec<(String, Condition, Priority)> {
    let is_of =
        |alarm: &&AlarmDef| matches!(alarm.subject, Subject::Tag(tag) if plant.tag(tag).name.starts_with("D1."));
    plant
        .alarms
        .iter()
        .filter(is_of)
        .map(|alarm| (alarm.message.to_string(), alarm.condition, alarm.priority))
        .collect()
}

#[test]
fn a_fault_word_gives_an_alarm_for_each_named_bit_and_code() {
    let plant = plant_with(PLANT, &format!("{METER}{ALARMS}"));
    let found = of_profile(&plant);
    for expect in [
        ("motor hot".into(), Condition::Bit { bit: 0 }, Priority::High),
        ("fan blocked".into(), Condition::Bit { bit: 17 }, Priority::High),
        ("trip: overcurrent".into(), Condition::State { is: 4.0 }, Priority::Critical),
        ("trip: phase lost".into(), Condition::State { is: 9.0 }, Priority::Critical),
    ] {
        assert!(found.contains(&expect), "{expect:?} in {found:?}");
    }
    let messages: Vec<&str> = found.iter().map(|(message, ..)| message.as_str()).collect();
    assert!(!messages.iter().any(|message| message.contains("none") || message.contains("service")), "{messages:?}");
    assert!(!messages.contains(&"very hot"), "the plant file has its own high limit: {messages:?}");
    let key = plant.alarms.iter().find(|alarm| &*alarm.message == "fan blocked").and_then(|alarm| alarm.key.clone());
    assert_eq!(key.as_deref(), Some("D1.fault-17"));
}

#[test]
fn the_plant_changes_the_priority_of_an_alarm_or_leaves_it_out() {
    let meter = format!("{METER}{ALARMS}");
    let own = |keys: &str| PLANT.replacen("fast = \"1s\"", &format!("fast = \"1s\"\nalarm_priority = {{ {keys} }}"), 1);
    let found = of_profile(&plant_with(&own("\"motor hot\" = \"low\", fault-17 = \"off\""), &meter));
    assert!(found.contains(&("motor hot".into(), Condition::Bit { bit: 0 }, Priority::Low)), "{found:?}");
    assert!(!found.iter().any(|(message, ..)| message == "fan blocked"), "{found:?}");
    for (keys, why) in [
        ("\"motor cold\" = \"low\"", "unknown alarm `motor cold`"),
        ("\"motor hot\" = \"urgent\"", "unknown priority `urgent`"),
    ] {
        let errors = load(own(keys).as_bytes(), &meter, PLC).expect_err(why).to_string();
        assert!(errors.contains(why), "{errors}");
    }
}

#[test]
fn an_alarm_of_a_profile_is_checked_like_any_other() {
    for (from, to, why) in [
        ("each = \"bit\"", "each = \"word\"", "unknown each `word`"),
        ("tag = \"CODE\"", "tag = \"COD\"", "unknown tag `COD`"),
        ("each = \"code\"", "each = \"bit\"", "D1.CODE names none"),
        ("priority = \"high\"\n", "", "an alarm needs `priority`"),
        ("deadband = 1\n", "colour = 1\n", "unknown key `colour`"),
    ] {
        let meter = format!("{METER}{}", ALARMS.replacen(from, to, 1));
        let errors = load(PLANT.as_bytes(), &meter, PLC).expect_err(why).to_string();
        assert!(errors.contains(why), "{from} -> {to}: {errors}");
    }
}
