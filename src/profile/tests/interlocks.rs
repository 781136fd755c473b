//! Interlocks and actuators.

use super::*;

/// The small plant with more tables before its mimic.
fn interlocked(tables: &str) -> Result<PlantDef, Errors> {
    load(PLANT.replace("[mimic]", &format!("{tables}\n[mimic]")).as_bytes(), METER, PLC)
}

#[test]
fn an_interlock_says_what_blocks_which_value() {
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"too hot\"\n";
    let plant = interlocked(lock).unwrap();
    let found = &plant.logic.interlocks[0];
    assert_eq!((found.value, found.when, found.refuse), (1.0, InterlockCondition::Above(80.0), false));
    let off = interlocked(&lock.replace("\"on\"", "\"off\"")).unwrap();
    assert!(!off.logic.interlocks[0].refuse, "switching off is warned of, never refused");
    for (from, to, expect) in [
        ("value = \"on\"", "value = \"off\"\nrefuse = true", "switching off is never refused"),
        ("value = \"on\"", "value = \"full\"", "`full` is not a state of D1.MODE"),
        ("above = 80", "", "an interlock needs a condition"),
        ("above = 80", "above = 80\nbelow = 3", "an interlock has one condition"),
        ("above = 80", "bit = 16", "D1.T has no bit 16"),
        ("of = \"D1.T\"", "of = \"D1.X\"", "unknown tag `D1.X`"),
        ("tag = \"D1.MODE\"", "tag = \"D1.T\"", "D1.T cannot be written"),
        ("message = \"too hot\"", "", "an interlock needs `message`"),
    ] {
        let text = interlocked(&lock.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect), "{to}: {text}");
    }
}

#[test]
fn only_a_binary_number_that_is_not_scaled_has_bits() {
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.W\"\nbit = 3\nmessage = \"locked\"\n";
    let plant = PLANT.replace("[mimic]", &format!("{lock}\n[mimic]"));
    for (kind, fits) in [
        ("type = \"int16\"", true),
        ("type = \"uint32\"", true),
        ("type = \"bcd16\"", false),
        ("type = \"float32\"", false),
        ("type = \"string(4)\"", false),
        ("type = \"uint16\"\nscale = 0.1", false),
        ("type = \"uint16\"\noffset = 1", false),
        ("type = \"uint16\"\ndecimals_from = \"DP\"", false),
        ("type = \"uint16\"\nfield = \"6-4\"", false),
        ("type = \"uint16\"\nfield = \"7-4\"", true),
    ] {
        let tag = format!("\n[[tag]]\nname = \"W\"\ntable = \"holding\"\naddress = 2000\n{kind}\n");
        match (load(plant.as_bytes(), &format!("{METER}{tag}"), PLC), fits) {
            (Ok(_), true) => {}
            (Err(errors), false) => assert!(errors.to_string().contains("D1.W has no bit 3"), "{kind}: {errors}"),
            (Ok(_), false) => panic!("{kind}: taken"),
            (Err(errors), true) => panic!("{kind}: {errors}"),
        }
    }
}

#[test]
fn an_actuator_has_one_command_and_one_output() {
    let table = "[[actuator]]\noutput = \"PLC.OUT\"\ncommand = \"D1.MODE\"\nneeds = [{ tag = \"PLC.STEP\", is = 1 }]\n";
    let plant = interlocked(table).unwrap();
    assert_eq!(plant.logic.actuators[0].needs, [(plant.tag_named("PLC.STEP").unwrap(), 1.0)]);
    assert_eq!(plant.logic.actuators[0].travel, None);
    let unsaid = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"hot\"\n";
    for (tables, refuse) in [
        (unsaid.to_owned(), false),
        (format!("{unsaid}refuse = true\n"), true),
        (format!("{table}{unsaid}"), true),
        (format!("{table}off = \"on\"\n{unsaid}"), false),
        (format!("{table}off = \"on\"\n{}", unsaid.replace("\"on\"", "\"off\"")), true),
    ] {
        assert_eq!(interlocked(&tables).unwrap().logic.interlocks[0].refuse, refuse, "{tables}");
    }
    // Where another value switches off, that one is never refused.
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"hot\"\nrefuse = true\n";
    let text = interlocked(&format!("{table}off = \"on\"\n{lock}")).expect_err("off is on").to_string();
    assert!(text.contains("switching off is never refused"), "{text}");
    assert!(interlocked(&format!("{table}{lock}")).is_ok());
    let text = interlocked(&format!("{table}{table}")).expect_err("twice").to_string();
    assert!(text.contains("PLC.OUT belongs to another actuator"), "{text}");
    let text = interlocked(&table.replace("D1.MODE", "D1.T")).expect_err("read only").to_string();
    assert!(text.contains("D1.T cannot be written"), "{text}");
}
