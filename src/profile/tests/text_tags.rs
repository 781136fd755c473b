//! Tags that hold text.

use super::*;
use crate::plant::tag::StorePolicy;

/// A tag that holds text, added to the small plant's meter.
fn with_text(keys: &str) -> Result<PlantDef, Errors> {
    let text = "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\n";
    load(PLANT.as_bytes(), &format!("{METER}{text}{keys}\n"), PLC)
}

#[test]
fn a_text_is_read_and_never_stored() {
    let plant = with_text("type = \"string(9)\"\norder = \"BADC\"").unwrap();
    let tag = plant.tag(plant.tag_named("D1.MODEL").unwrap());
    assert_eq!((tag.point.kind, tag.point.len()), (DataType::Text(9), 5));
    assert!(tag.is_text() && !tag.is_stored() && !tag.writable());
}

#[test]
fn a_text_takes_no_key_that_is_for_numbers() {
    for (key, expect) in [
        ("scale = 0.1", "`scale` is for numbers, this is a text"),
        ("unit = \"s\"", "`unit` is for numbers"),
        ("max = 5", "`max` is for numbers"),
        ("enum = { 0 = \"a\" }", "`enum` is for numbers"),
        ("bad_if = [0]", "`bad_if` is for numbers"),
        ("field = 3", "type string(8) has no field of bits"),
        ("order = \"CDAB\"", "the words of a text cannot be reversed"),
        ("store = \"always\"", "the history keeps numbers, this is a text"),
    ] {
        let text = with_text(&format!("type = \"string(8)\"\n{key}")).expect_err(key).to_string();
        assert!(text.contains(expect), "{key}: {text}");
    }
    let long = with_text("type = \"string(250)\"").expect_err("60 registers are read at most").to_string();
    assert!(long.contains("the value takes 125 registers, the device reads at most 60"), "{long}");
}

#[test]
fn a_text_is_written_where_one_request_can() {
    for kind in ["string(8)", "cstring(8)", "chars(8)", "clock_bcd", "time_words", "epoch32", "ipv4"] {
        let plant = with_text(&format!("type = \"{kind}\"\naccess = \"rw\"")).unwrap();
        assert!(plant.tag(plant.tag_named("D1.MODEL").unwrap()).writable(), "{kind}");
    }
    let check = |kind: &str, expect: &str| {
        let text = with_text(&format!("type = \"{kind}\"\naccess = \"rw\"")).expect_err(kind).to_string();
        assert!(text.contains(expect), "{kind}: {text}");
    };
    check("version(1)", "a version can only be read");
    let limited = METER.replace("[limits]", "[limits]\nwrite_registers_max = 3");
    assert_ne!(limited, METER);
    let text =
        "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\ntype = \"string(8)\"\naccess = \"rw\"\n";
    let long = load(PLANT.as_bytes(), &format!("{limited}{text}"), PLC).expect_err("three registers").to_string();
    assert!(long.contains("the value takes 4 registers, the device writes at most 3"), "{long}");
}

#[test]
fn a_number_is_never_written_into_a_text() {
    let text =
        "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\ntype = \"string(8)\"\naccess = \"rw\"\n";
    let action = "\n[[action]]\nname = \"save\"\ntag = \"MODEL\"\nvalue = 1\n";
    let why = load(PLANT.as_bytes(), &format!("{METER}{text}{action}"), PLC).expect_err("a text").to_string();
    assert!(why.contains("D1.MODEL is a text"), "{why}");
}

#[test]
fn nothing_counts_with_a_text() {
    let text = "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\ntype = \"string(8)\"\n";
    let meter = format!("{METER}{text}");
    for (from, to) in [
        ("tag = \"D1.T\"\nhigh", "tag = \"D1.MODEL\"\nhigh"),
        ("\n[mimic]", "\n[[trend]]\nname = \"t\"\npens = [{ tag = \"D1.MODEL\" }]\n\n[mimic]"),
        ("\n[mimic]", "\n[report]\ntags = [\"D1.MODEL\"]\n\n[mimic]"),
    ] {
        assert!(PLANT.contains(from), "{from}");
        let text = load(PLANT.replace(from, to).as_bytes(), &meter, PLC).expect_err(to).to_string();
        assert!(text.contains("D1.MODEL is a text"), "{to}: {text}");
    }
    let shown = PLANT.replace("y = 1, tag = \"D1.T\"", "y = 1, tag = \"D1.MODEL\"");
    assert!(load(shown.as_bytes(), &meter, PLC).is_ok(), "the mimic may show it");
    let scaled = meter.replace("decimals_from = \"DP\"", "decimals_from = \"MODEL\"");
    let text = load(PLANT.as_bytes(), &scaled, PLC).expect_err("no decimals").to_string();
    assert!(text.contains("D1.MODEL is a text"), "{text}");
}

#[test]
fn what_is_stored_and_when_can_be_chosen() {
    let number = |keys: &str| {
        let tag = "\n[[tag]]\nname = \"X\"\ntable = \"holding\"\naddress = 2000\ntype = \"int16\"\n";
        load(PLANT.as_bytes(), &format!("{METER}{tag}{keys}\n"), PLC)
    };
    let plant = number("store = \"always\"\nstore_every = \"10 s\"\ndeadband = 0").unwrap();
    let tag = plant.tag(plant.tag_named("D1.X").unwrap());
    assert_eq!(
        (tag.store, tag.store_every, tag.deadband),
        (StorePolicy::Always, std::time::Duration::from_secs(10), Some(0.0))
    );
    for (key, expect) in [
        ("store = \"sometimes\"", "sometimes"),
        ("store = false", "found true or false, expected a string"),
        ("store_every = \"61 s\"", "a value can be stored every 1 to 60 s"),
        ("store_every = \"0.5 s\"", "a value can be stored every 1 to 60 s"),
    ] {
        let text = number(key).expect_err(key).to_string();
        assert!(text.contains(expect), "{key}: {text}");
    }
}
