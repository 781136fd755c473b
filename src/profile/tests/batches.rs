//! Batches, control runs and procedures of a plant file.

mod procedures;

use std::time::Duration;

use super::*;
use crate::plant::control_run::{DURATION_MAX, STEADY_FOR};

#[test]
fn a_batch_is_read_and_its_mistakes_are_named() {
    let load = |table: &str| load(PLANT.replace("[mimic]", &format!("{table}\n[mimic]")).as_bytes(), METER, PLC);
    let table = "[[batch]]\nname = \"soup\"\nstart = \"D1.MODE = on\"\nend = \"PLC.STEP > 5 or D1.MODE = off\"\nphase = \"PLC.STEP\"\ntags = [\"D1.T\"]\n";
    let plant = load(table).unwrap();
    let rule = &plant.batches[0];
    assert_eq!((&*rule.name, rule.phase, rule.energy), ("soup", plant.tag_named("PLC.STEP"), None));
    assert_eq!(rule.tags, [plant.tag_named("D1.T").unwrap()]);
    for (from, to, expect) in [
        ("name = \"soup\"", "name = \"hot soup\"", "`hot soup` is not a name for a batch"),
        ("D1.MODE = on", "D1.MODE = full", "`full` is not a state of D1.MODE"),
        ("D1.MODE = on", "D1.T + 1", "this is a number, not a condition"),
        ("end = \"PLC.STEP > 5 or D1.MODE = off\"\n", "", "a batch needs `end`"),
        ("phase = \"PLC.STEP\"", "phase = \"PLC.STEPS\"", "unknown tag `PLC.STEPS`"),
        ("phase", "energy", "PLC.STEP has the unit ``"),
        ("phase", "phases", "unknown key `phases`"),
    ] {
        let text = load(&table.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect), "{to}: {text}");
    }
    let text = load(&format!("{table}{table}")).expect_err("twice").to_string();
    assert!(text.contains("duplicate batch `soup`"), "{text}");
}

/// The meter as a controller.
fn controller(table: &str) -> Result<PlantDef, Errors> {
    let meter = format!("{METER}\n[faceplate]\npv = \"T\"\nsv = \"MODE\"\n");
    let batch = "[[batch]]\nname = \"soup\"\nstart = \"D1.MODE = on\"\nend = \"D1.MODE = off\"\ntags = [\"D1.T\"]\n";
    load(PLANT.replace("[mimic]", &format!("{batch}{table}\n[mimic]")).as_bytes(), &meter, PLC)
}

#[test]
fn an_output_at_its_terminals_is_that_of_a_percentage() {
    let load_with = |meter: &str| load(PLANT.as_bytes(), meter, PLC);
    let load = |unit: &str| {
        let mv =
            format!("[[tag]]\nname = \"MV\"\ntable = \"holding\"\naddress = 1010\ntype = \"int16\"\nunit = \"{unit}\"");
        let meter =
            format!("output = \"4-20 mA\"\n{METER}\n{mv}\n[faceplate]\npv = \"T\"\nsv = \"MODE\"\nmv = \"MV\"\n");
        load_with(&meter)
    };
    assert!(load("%").unwrap().devices[0].output.is_some());
    for unit in ["kW", ""] {
        let text = load(unit).expect_err(unit).to_string();
        assert!(text.contains("meter.toml:1:10") && text.contains(&format!("D1.MV has the unit `{unit}`")), "{text}");
    }
    let none = load_with(&format!("output = \"4-20 mA\"\n{METER}\n")).unwrap_err().to_string();
    assert!(none.contains("meter.toml:1:10") && none.contains("this device has no `mv`"), "{none}");
}

#[test]
fn a_controller_has_runs_and_the_plant_file_refines_them() {
    let plant = controller("").unwrap();
    let [run] = plant.runs.as_slice() else { panic!("{:?}", plant.runs) };
    assert_eq!((run.band, run.steady_for, run.duration_max), (None, STEADY_FOR, DURATION_MAX));
    assert_eq!((run.batches.as_slice(), run.energy), (&[0][..], None), "the batch is about its tag");
    assert_eq!(run.tags, [plant.tag_named("D1.T").unwrap(), plant.tag_named("D1.MODE").unwrap()]);
    let table = "[[run]]\ncontroller = \"D1\"\nband = 0.5\nsteady_for = \"2min\"\nduration_max = \"1h\"\nbatches = [\"soup\"]\ntags = [\"D1.T\"]\n";
    let plant = controller(table).unwrap();
    let run = &plant.runs[0];
    assert_eq!((run.band, run.steady_for), (Some(0.5), Duration::from_secs(120)));
    assert_eq!((run.duration_max, run.tags.len()), (Duration::from_secs(3_600), 1));
    for (from, to, expect) in [
        ("\"D1\"", "\"D2\"", "unknown device `D2`"),
        ("\"D1\"", "\"PLC\"", "PLC has no SV and PV"),
        ("0.5", "0", "PV is never exactly at SV"),
        ("2min", "2h", "a run ends before it can be steady"),
        ("2min", "5s", "this is not the time of a run"),
        ("[\"soup\"]", "[\"soap\"]", "unknown batch `soap`"),
        ("tags = [\"D1.T\"]", "energy = \"D1.T\"", "D1.T has the unit `°C`"),
        ("tags = [\"D1.T\"]", "tags = []", "a run without a tag"),
        ("tags = [\"D1.T\"]", "tags = [\"D1.T\", \"D1.T\"]", "tag D1.T is named twice"),
        ("[\"soup\"]", "[]", "a run without a batch"),
        ("[\"soup\"]", "[\"soup\", \"soup\"]", "batch soup is named twice"),
        ("band", "bandwidth", "unknown key `bandwidth`"),
    ] {
        let text = controller(&table.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect) && text.contains("small.toml:"), "{to}: {text}");
    }
    let text = controller(&format!("{table}{table}")).expect_err("twice").to_string();
    assert!(text.contains("duplicate run of `D1`"), "{text}");
}
