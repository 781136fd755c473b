//! Procedures of a plant file.

use std::time::Duration;

use super::*;
use crate::plant::def::ProcedureStep;

/// The meter as a controller whose MODE is its setpoint.
fn with(tables: &str) -> Result<PlantDef, Errors> {
    let meter = format!("{METER}\n[faceplate]\npv = \"T\"\nsv = \"MODE\"\n");
    load(PLANT.replace("[mimic]", &format!("{tables}\n[mimic]")).as_bytes(), &meter, PLC)
}

const SOUP: &str = r#"[[procedure]]
name = "soup"
about = "heats it"
steps = [
    { write = "D1.MODE", value = "on" },
    { begin_measurement = "D1" },
    { wait_until = "D1.T > 60 °C", limit = "30min" },
    { hold = "5min" },
    { end_measurement = "D1" },
]
safe = [{ write = "D1.MODE", value = "off" }]
reference = { source = "the cook", at_sv = "12min 45s", overshoot = 1 }
"#;

#[test]
fn a_procedure_has_steps_a_safe_state_and_a_reference() {
    let plant = with(SOUP).unwrap();
    let [soup] = plant.procedures.as_slice() else { panic!("{:?}", plant.procedures) };
    let mode = plant.tag_named("D1.MODE").unwrap();
    assert_eq!((&*soup.name, soup.about.as_str(), soup.steps.len()), ("soup", "heats it", 5));
    assert_eq!(soup.steps[0], ProcedureStep::Write { tag: mode, value: 1.0 });
    let ProcedureStep::WaitUntil { text, limit, .. } = &soup.steps[2] else { panic!("{:?}", soup.steps[2]) };
    assert_eq!((&**text, *limit), ("D1.T > 60 °C", Duration::from_secs(1_800)));
    assert_eq!(
        (soup.steps[3].clone(), &soup.safe[..]),
        (ProcedureStep::Hold(Duration::from_secs(300)), &[(mode, 0.0)][..])
    );
    let reference = soup.reference.as_ref().unwrap();
    assert_eq!((reference.at_sv, reference.steady), (Some(Duration::from_secs(765)), None));
    assert_eq!(soup.writes().collect::<Vec<_>>(), [(mode, 1.0), (mode, 0.0)]);
}

#[test]
fn steps_of_an_earlier_procedure_are_part_of_another() {
    let both = "[[procedure]]\nname = \"both\"\nsteps = [{ steps_of = \"soup\" }, { hold = \"1s\" }]\nsafe = [{ write = \"D1.MODE\", value = \"off\" }]\n";
    let plant = with(&format!("{SOUP}{both}")).unwrap();
    assert_eq!(plant.procedures[1].steps.len(), 6);
    let labels: Vec<&str> = plant.procedures[1].measured().map(|(_, label)| &**label).collect();
    assert_eq!(labels, ["soup"], "a measurement keeps the name of its own procedure");
    let text = with(&format!("{both}{SOUP}")).expect_err("later").to_string();
    assert!(text.contains("no procedure `soup` before this one"), "{text}");
}

#[test]
fn a_value_of_another_kind_or_beyond_its_register_is_an_error() {
    let meter = |bounds: &str| {
        let level = format!("[[tag]]\nname = \"LEVEL\"\ntable = \"holding\"\naddress = 1010\n{bounds}");
        format!("{METER}\n{level}\n[faceplate]\npv = \"T\"\nsv = \"MODE\"\n")
    };
    let written = |bounds: &str, value: &str| {
        let soup = SOUP.replacen("\"D1.MODE\", value = \"on\"", &format!("\"D1.LEVEL\", value = {value}"), 1);
        load(PLANT.replace("[mimic]", &format!("{soup}\n[mimic]")).as_bytes(), &meter(bounds), PLC)
    };
    let word = "type = \"uint16\"\naccess = \"rw\"\nmax_from = \"DP\"\n";
    let float = "type = \"float32\"\naccess = \"rw\"\nmax_from = \"DP\"\n";
    let scaled = "type = \"int16\"\naccess = \"rw\"\ndecimals_from = \"DP\"\n";
    let halves = "type = \"int16\"\naccess = \"rw\"\nscale = 0.5\n";
    for (bounds, value, expect) in [
        (word, "true", "`true` is not a state of D1.LEVEL"),
        (word, "1e308", "1e308 does not fit the register of D1.LEVEL"),
        (word, "70000", "70000 does not fit the register of D1.LEVEL"),
        (word, "-1", "-1 does not fit the register of D1.LEVEL"),
        (float, "1e308", "1e308 does not fit the register of D1.LEVEL"),
        (scaled, "-40000", "-40000 does not fit the register of D1.LEVEL"),
        (word, "70.5", "70.5 has more decimals than D1.LEVEL"),
        (float, "70.125", "70.125 has more decimals than D1.LEVEL"),
        (halves, "70.3", "D1.LEVEL cannot hold 70.3"),
    ] {
        let text = written(bounds, value).expect_err(value).to_string();
        assert!(text.contains(expect) && text.contains("small.toml:"), "{value}: {text}");
    }
    for (bounds, value) in [(word, "65535"), (word, "7.0"), (float, "1e38"), (scaled, "-3276.8"), (halves, "70.5")] {
        written(bounds, value).unwrap_or_else(|errors| panic!("{value}: {errors}"));
    }
    let flag = with(&SOUP.replacen("value = \"on\"", "value = true", 1)).unwrap();
    let mode = flag.tag_named("D1.MODE").unwrap();
    assert_eq!(flag.procedures[0].steps[0], ProcedureStep::Write { tag: mode, value: 1.0 }, "of two states");
}

#[test]
fn each_mistake_of_a_procedure_has_its_place_and_name() {
    for (from, to, expect) in [
        ("name = \"soup\"", "name = \"hot soup\"", "`hot soup` is not a name for a procedure"),
        ("value = \"on\"", "value = \"full\"", "`full` is not a state of D1.MODE"),
        (", value = \"on\"", "", "`write` needs `value`"),
        (", limit = \"30min\"", "", "`wait_until` needs `limit`"),
        ("hold = \"5min\"", "hold = \"5min\", limit = \"1s\"", "`limit` belongs to `wait_until`"),
        ("hold = \"5min\"", "hold = \"200h\"", "this is not the time of a step"),
        ("hold = \"5min\"", "hold = \"5min\", write = \"D1.MODE\", value = \"on\"", "a step has one action"),
        ("{ hold = \"5min\" }", "{}", "a step needs an action"),
        ("hold", "rest", "unknown key `rest` in a step of a procedure"),
        ("D1.T > 60 °C", "D1.T + 60", "this is a number, not a condition"),
        ("write = \"D1.MODE\", value = \"on\"", "write = \"D1.T\", value = 5", "D1.T cannot be written and read back"),
        ("begin_measurement = \"D1\"", "begin_measurement = \"PLC\"", "PLC has no SV and PV"),
        ("    { begin_measurement = \"D1\" },\n", "", "no measurement has begun"),
        ("    { end_measurement = \"D1\" },\n", "", "this measurement never ends"),
        ("{ hold = \"5min\" }", "{ begin_measurement = \"D1\" }", "the measurement before this one has not ended"),
        (
            "    { wait_until = \"D1.T > 60 °C\", limit = \"30min\" },\n    { hold = \"5min\" },\n",
            "    { wait_until = \"D1.T > 60 °C\", limit = \"4s\" },\n    { hold = \"5s\" },\n",
            "this measurement is too short to be kept",
        ),
        ("safe = [{ write = \"D1.MODE\", value = \"off\" }]", "", "procedure soup has no safe state"),
        ("source = \"the cook\", ", "", "a reference needs `source`"),
    ] {
        let text = with(&SOUP.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(text.contains(expect), "{to}: {text}");
        assert!(text.contains("small.toml:"), "{text}");
    }
    let text = with(&format!("{SOUP}{SOUP}")).expect_err("twice").to_string();
    assert!(text.contains("duplicate procedure `soup`"), "{text}");
}
