//! A map as a profile: it passes its check, and what does not is said.

use super::list_of;
use crate::{
    plant::tag::{Access, Decimals, TagDef},
    register_map::profile::{Written, written},
};

fn profile(text: &str) -> Written {
    written(&list_of(text), "made_up", "a test").unwrap_or_else(|why| panic!("{text}: {why}"))
}

fn tags(written: &Written) -> &[TagDef] {
    &written.checked.plant.tags
}

#[test]
fn a_profile_has_names_of_its_own_and_the_labels_of_the_file() {
    let text = "address;name\n5;Flow rate [1]\n6;Flow rate (1)\n7;\"SV\u{7} \"\"x\"\"\"\n8;Temperatur außen\n";
    let written = profile(text);
    let named: Vec<(&str, &str)> = tags(&written).iter().map(|tag| (tag.short.as_str(), tag.label.as_str())).collect();
    assert_eq!(named[0], ("Flow_rate__1_", "Flow rate [1]"));
    assert_eq!(named[1], ("Flow_rate__1__6", "Flow rate (1)"));
    assert_eq!(named[3], ("Temperatur_außen", "Temperatur außen"));
    assert_eq!(named.len(), 4, "{}", written.text);
}

#[test]
fn everything_that_a_row_has_stands_in_its_profile() {
    let text = "modbus:\n  - sensors:\n    - { name: Outside, address: 40001, scale: 0.1, offset: -40, nan_value: 0x8000, unit_of_measurement: °C, scan_interval: 30 }\n    switches:\n    - { name: Valve, address: 7, verify: { address: 9, input_type: input } }\n";
    let written = profile(text);
    let [outside, valve] = tags(&written) else { panic!("{}", written.text) };
    assert_eq!(
        (outside.point.address, outside.scale, outside.offset, outside.unit.as_str()),
        (40_001, 0.1, -40.0, "°C")
    );
    assert!(outside.is_bad((-32_768.0).into()) && written.text.contains("poll = \"30s\""), "{}", written.text);
    assert_eq!(valve.write_at.map(|(_, address)| address), Some(7));
    assert_eq!((valve.access, valve.label_of(1.0)), (Access::ReadWrite, Some("on")));
    assert_eq!(written.problems, Vec::<String>::new());
}

#[test]
fn what_the_check_refuses_is_left_out_and_said() {
    let text =
        "read_write_word:\n  a: { address: 5, control: number, number: { min: -5, max: 20 } }\n  b: { address: 6 }\n";
    let written = profile(text);
    assert_eq!(tags(&written).len(), 2);
    assert_eq!(tags(&written)[0].access, Access::Read, "{}", written.text);
    assert!(written.problems[0].starts_with("line 2: a: read only: min -5 is outside"), "{:?}", written.problems);
}

#[test]
fn a_power_of_ten_is_followed_or_its_value_is_left_out() {
    let model = |kind: &str| {
        format!(
            "{{ \"id\": 9, \"group\": {{ \"name\": \"m\", \"points\": [\n\
             {{ \"name\": \"W\", \"type\": \"int16\", \"size\": 1, \"sf\": \"SF\" }},\n\
             {{ \"name\": \"SF\", \"type\": \"sunssf\", \"size\": 1{kind} }} ] }} }}"
        )
    };
    let written = profile(&model(""));
    assert!(matches!(tags(&written)[0].decimals, Decimals::PowerFrom(_)), "{}", written.text);
    let mut list = list_of(&model(""));
    list.named.remove(1);
    let refused = super::super::profile::written(&list, "made_up", "a test").err();
    assert!(refused.is_some_and(|why| why.contains("power of ten")));
}

#[test]
fn a_calculated_row_is_an_expression_over_its_registers() {
    let text = "parameters:
  - group: Power
    items:
      - { name: PV1, rule: 1, registers: [10], uom: W, validation: { max: 9000 } }
      - { name: PV Power, rule: 1, uom: W, sensors: [{ registers: [10] }, { registers: [11] }] }
      - { name: Losses, rule: 1, scale: 0.1, uint: enforce, sensors: [{ registers: [10] }, { operator: subtract, signed: , registers: [12] }] }
      - { name: Ratio, rule: 1, sensors: [{ registers: [10] }, { registers: [11] }, { operator: divide, registers: [13], multiply: { registers: [14], scale: 2 } }] }
      - { name: Turned, rule: 2, inverted: true, sensors: [{ signed: , registers: [12], scale: 0.1 }] }
      - { name: Unlike, rule: 1, sensors: [{ signed: , registers: [10] }] }
      - { name: Checked, rule: 1, sensors: [{ registers: [10], validation: { min: 1 } }] }
      - { name: Chosen, rule: 1, sensors: [{ registers: [10], enabled_lookup: { a: [b] } }] }
";
    let list = super::list_of(text);
    let why = |key: &str| format!("a profile cannot express `{key}`");
    let expect =
        [format!("line 10: Checked: {}", why("validation")), format!("line 11: Chosen: {}", why("enabled_lookup"))];
    assert_eq!(list.problems, expect);
    let written = written(&list, "sums", "a file").expect("it is a profile");
    assert_eq!(written.problems, ["line 9: Unlike: Unlike part 1: this address has a name already"]);
    assert_eq!((written.checked.plant.tags.len(), written.rows), (9, 5), "{}", written.text);
    for expr in [
        "\"PV1 + PV_Power_part_2\"",
        "\"max(0, (PV1 * 0.1) - Losses_part_2)\"",
        "\"(PV1 + PV_Power_part_2) / (Ratio_part_3 * Ratio_factor_3)\"",
        "\"0 - Losses_part_2\"",
    ] {
        assert!(written.text.contains(&format!("expr = {expr}")), "no {expr} in {}", written.text);
    }
}

#[test]
fn parts_of_a_model_that_the_device_counts_are_a_repeat() {
    let text = |count: &str| {
        format!(
            r#"{{ "id": 902, "group": {{ "name": "m", "points": [
  {{ "name": "ID", "type": "uint16", "size": 1 }}, {{ "name": "L", "type": "uint16", "size": 1 }},
  {{ "name": "N", "type": "count", "size": 1 }}, {{ "name": "V_SF", "type": "sunssf", "size": 1 }} ],
 "groups": [{{ "name": "module", "count": {count}, "points": [{{ "name": "V", "type": "uint16", "size": 1, "sf": "V_SF" }},
  {{ "name": "A", "type": "int16", "size": 1, "sf": "A_SF" }}, {{ "name": "A_SF", "type": "sunssf", "size": 1 }}] }}] }} }}"#
        )
    };
    for (count, counted_by, first, second) in [("\"N\"", "N", 1.0, 2.0), ("0", "L", 5.0, 8.0)] {
        let list = list_of(&text(count));
        let written = written(&list, "model", "a file").unwrap_or_else(|why| panic!("{why}"));
        let plant = &written.checked.plant;
        assert_eq!((plant.tags.len(), written.rows), (4 + 16 * 3, 7), "{}", written.text);
        let tag =
            |short: &str| plant.tags.iter().find(|tag| tag.short == short).unwrap_or_else(|| panic!("no {short}"));
        let last = tag("module16.A");
        assert_eq!(last.point.address, tag("module1.A").point.address + 15 * 3);
        assert_eq!(last.decimals, Decimals::PowerFrom(tag("module16.A_SF").id));
        assert_eq!(tag("module2.V").decimals, Decimals::PowerFrom(tag("V_SF").id), "a factor of all of them");
        let counted = tag(counted_by).id;
        let has = |short: &str, number: f64| {
            tag(short).when.as_ref().expect("a condition").holds(&|of| (of == counted).then_some(number.into()))
        };
        assert_eq!(
            [has("module1.V", first), has("module2.V", first), has("module2.V", second)],
            [Some(true), Some(false), Some(true)]
        );
    }
}
