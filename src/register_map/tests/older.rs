//! The JSON of MTUI and the exports of ModMaster.

use crate::register_map::{list::ListContext, named::Named};

fn read(text: &str) -> (Vec<String>, Vec<String>) {
    let list = crate::register_map::read(text.as_bytes(), &ListContext::default());
    let shown = |named: &Named| {
        let (place, kind, order) = (named.table.modicon(named.address), named.kind.name(), named.order.word());
        let (name, unit) = (&named.name, &named.unit);
        format!("{place} {name} {kind} {order} {} {} {} {unit}", named.scale, named.offset, named.decimals)
    };
    (list.named.iter().map(shown).collect(), list.problems)
}

#[test]
fn an_export_of_modmaster_divides_by_its_scale() {
    let head =
        "\"Address\",\"Name\",\"Type\",\"Value\",\"Unit\",\"Radix\",\"Offset\",\"Scale\",\"Min\",\"Max\",\"Write\"\n";
    let rows = "\"1002\",\"\"\"SV\"\" wanted\",\"int16\",\"700\",\"degC\",\"10\",\"-20.0\",\"10.0\",\"\",\"\",\"true\"\n\
                \"3049\",\"Alarm 4\",\"int16\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                \"7\",\"Run\",\"int1\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                \"8\",\"Half\",\"int8\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                \"9\",\"Zero\",\"int16\",\"0\",\"\",\"10\",\"0.0\",\"0\",\"false\"\n";
    let (named, problems) = read(&format!("{head}{rows}"));
    let expect =
        ["41003 \"SV\" wanted int16 ABCD 0.1 -2 1 °C", "43050 Alarm 4 int16 ABCD 1 0 0 ", "00008 Run bool ABCD 1 0 0 "];
    assert_eq!(named, expect);
    assert_eq!(problems, ["line 5: 8: `int8` is not a known type", "line 6: 9: `0` is not a scale"]);
    assert_eq!(read("Address,Name,Multiplier\n5,a,10\n").0, ["40006 a uint16 ABCD 10 0 0 "], "a list of a manual");
}

#[test]
fn registers_of_mtui_are_taken_with_their_rules() {
    let text = r#"{ "version": 1, "device": { "word_order": "CDAB" }, "registers": {
        "holdings": [
            { "address": 50, "label": "set voltage", "custom": { "repr": "U16", "ops": ["/10"], "decimals": 1, "suffix": " V" } },
            { "address": 53, "pinned": true },
            { "address": 54, "label": "state", "custom": { "repr": "U16", "enum": [{ "value": 0, "text": "off" }] } },
            { "address": 60, "custom": { "repr": "F32", "ops": ["*2", "+5"], "word_order": "ABCD" } },
            { "address": 70, "label": "flags", "custom": { "repr": "U16", "bits": [{ "bit": 0, "name": "run" }] } },
            { "address": 80, "label": "half", "custom": { "repr": "F16" } },
            { "address": 90, "label": "apart", "custom": { "repr": "U32", "next": [95] } },
            { "address": 91, "label": "squared", "custom": { "repr": "U16", "ops": ["^2"] } } ],
        "coils": [{ "address": 0, "label": "breaker" }] } }"#;
    let (named, problems) = read(text);
    let expect = [
        "40051 set voltage uint16 CDAB 0.1 0 1 V",
        "40055 state uint16 CDAB 1 0 0 ",
        "40061 holding-60 float32 ABCD 2 5 2 ",
        "40081 half float16 CDAB 1 0 2 ",
        "00001 breaker bool CDAB 1 0 0 ",
    ];
    assert_eq!(named, expect);
    assert_eq!(problems.len(), 3, "{problems:?}");
    assert!(problems[0].starts_with("40071: names of bits") && problems[2].contains("\"^2\""), "{problems:?}");
}

#[test]
fn labels_and_rules_of_an_older_mtui_are_joined_by_address() {
    let text = r#"{ "labels": { "inputs": [{ "i": 7, "t": "temperature" }, { "i": 9, "t": "plain" }] },
        "custom_rules": { "inputs": [{ "a": 7, "repr": "I16", "ops": ["/10"], "decimals": 1, "suffix": " C" }] } }"#;
    let expect = ["30008 temperature int16 ABCD 0.1 0 1 °C", "30010 plain uint16 ABCD 1 0 0 "];
    assert_eq!(read(text), (expect.map(str::to_owned).to_vec(), Vec::new()));
    let broken = crate::register_map::read(b"{ \"holdings\": ", &ListContext::default()).refused.expect("a reason");
    assert!(broken.contains("not the registers") && broken.contains("What can be read: CSV"), "{broken}");
}
