//! Batches of a plant file.

use super::*;

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
