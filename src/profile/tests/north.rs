//! Where values are sent to.

use super::*;

#[test]
fn a_broker_gets_no_text_or_number_that_it_cannot_take() {
    let table = "[north.mqtt]\nhost = \"localhost\"\nport = 1884\ntopic = \"a/b\"\nuser = \"u\"\nclient_id = \"c\"\ncommands_as = \"mes\"\nlag_max = \"20s\"\n";
    let north = |table: &str| load(PLANT.replace("[mimic]", &format!("{table}\n[mimic]")).as_bytes(), METER, PLC);
    let mqtt = north(table).unwrap().north.mqtt.expect("a broker");
    assert_eq!((mqtt.port, mqtt.topic.as_str(), mqtt.commands_as.as_deref()), (1_884, "a/b", Some("mes")));
    let long = "x".repeat(1_025);
    for (from, to, expect) in [
        ("1884", "0", "no broker has port 0"),
        ("a/b", &long, "this is too long for a broker"),
        ("\"u\"", &format!("{long:?}"), "this is too long for a broker"),
        ("\"c\"", &format!("{long:?}"), "this is too long for a broker"),
        ("mes", &long, "this is too long for a broker"),
        ("localhost", &long, "this is too long for a broker"),
        ("mes", " ", "requests need a user to act as"),
        ("a/b", "a/+", "`a/+` is not a topic to send to"),
        ("localhost", "a b", "`a b` is not a host"),
        ("20s", "14s", "this is too short"),
    ] {
        let text = north(&table.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect) && text.contains("[small.toml:"), "{to}: {text}");
    }
}
