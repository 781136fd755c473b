//! Set files: what is written is read back, and each error is reported with its line.

use proptest::prelude::*;

use super::*;
use crate::{
    plant::parameter_set,
    profile::{Search, load},
};

fn tank() -> Arc<PlantDef> {
    load(std::path::Path::new("tank"), &Search::shipped()).expect("the shipped plant loads")
}

fn winter(def: &PlantDef) -> ParameterSet {
    let device = def.devices.iter().find(|device| device.profile == "fuji_pxr").expect("the tank has a PXR");
    let value = |tag: crate::plant::def::TagId| match def.tag(tag).short.as_str() {
        "P" => None,
        "SV" => Some(70.5.into()),
        "CTRL" => Some(1.0.into()),
        "P-F" | "P-DP" | "PTN" => Some(0.0.into()),
        _ => Some(12.0.into()),
    };
    parameter_set::capture(def, device.id, "winter", "anna \"boss\" \\".into(), Timestamp::UNIX_EPOCH, &value)
}

#[test]
fn a_set_is_readable_and_comes_back_as_it_was() {
    let def = tank();
    let set = winter(&def);
    let text = text_of_set(&set, &def);
    for line in [
        "device = \"TIC-1\"",
        "saved = 1970-01-01T00:00:00Z",
        "missing = [\"P\"]",
        "P-F = \"°C\"",
        "SV = 70.5",
        "CTRL = \"FUZZY\"",
        "I = 12                  # s, integral time",
        "[units]",
    ] {
        assert!(text.contains(line), "{line} in\n{text}");
    }
    for command in ["FIX", "AT =", "STBY", "PROG ="] {
        assert!(!text.contains(command), "{command} is a command, no setting:\n{text}");
    }
    assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &def), Ok(set));
}

#[test]
fn two_devices_of_a_profile_may_have_tags_of_their_own() {
    let mut def = (*tank()).clone();
    let plc = def.devices.iter().find(|device| device.profile == "koyo_dl06").expect("the tank has a PLC").clone();
    // A second PLC whose plant file gives it another register, and none of the first one's.
    let second = crate::plant::def::DeviceId(def.devices.len() as u16);
    let base = def.tags_of(plc.id).find(|tag| tag.enum_labels.is_empty()).expect("a number").clone();
    def.devices.push(crate::plant::def::DeviceDef { id: second, name: "PLC-2".into(), ..plc.clone() });
    let id = crate::plant::def::TagId(def.tags.len() as u16);
    let name = "PLC-2.RECIPE".to_owned();
    def.tags.push(TagDef { id, device: second, name, short: "RECIPE".into(), in_sets: true, unit: "l".into(), ..base });
    let all = |_| Some(1.0.into());
    let set = parameter_set::capture(&def, second, "winter", "anna".into(), Timestamp::UNIX_EPOCH, &all);
    assert_eq!(set.values.len(), 1);
    let text = text_of_set(&set, &def);
    assert!(text.contains("\"l\" = [\"RECIPE\"]\n"), "{text}");
    assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &def), Ok(set.clone()));
    // The device has got another name since: any device of the profile that has the tag will do.
    let text: String = text.split_inclusive('\n').filter(|line| !line.starts_with(CHECK)).collect();
    let renamed = text.replace("PLC-2", "PLC-9");
    let expect = ParameterSet { device: "PLC-9".into(), ..set };
    assert_eq!(read_set("winter", "winter.toml", renamed.as_bytes(), &def), Ok(expect));
    // The first PLC has no such register.
    let foreign = read_set("winter", "winter.toml", text.replace("PLC-2", "PLC-1").as_bytes(), &def);
    assert!(foreign.expect_err("no RECIPE")[0].contains("unknown setting `RECIPE`"));
}

#[test]
fn a_set_without_units_is_still_read() {
    let def = tank();
    let set = ParameterSet { units: BTreeMap::new(), ..winter(&def) };
    let text = text_of_set(&set, &def);
    assert!(!text.contains("[units]"), "{text}");
    assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &def), Ok(set));
}

#[test]
fn a_spoiled_file_tells_line_found_and_expected() {
    let def = tank();
    let head = "device = \"TIC-1\"\nprofile = \"fuji_pxr\"\nsaved = 1970-01-01T00:00:00Z\nby = \"anna\"\n[values]\n";
    let check = |text: &str, expect: &[&str]| {
        let problems = read_set("winter", "winter.toml", text.as_bytes(), &def).expect_err(text);
        for words in expect {
            assert!(problems.iter().any(|problem| problem.contains(words)), "{words} in {problems:#?}");
        }
    };
    check(
        &format!("{head}SV = \"hot\"\n"),
        &["winter.toml:6:6: `hot` is not a state of TIC-1.SV", "expected a number"],
    );
    check(&format!("{head}I = 12.54\n"), &["winter.toml:6:5: TIC-1.I cannot hold 12.54", "can hold: 12.5"]);
    check(&format!("{head}I = 70000\n"), &["winter.toml:6:5: 70000 does not fit the register of TIC-1.I"]);
    check(&format!("{head}SW = 70\n"), &["winter.toml:6:1: unknown setting `SW`", "did you mean `SV`?"]);
    check(
        &format!("{head}FIX = 1\nAT = 1\n"),
        &["winter.toml:6:1: `FIX` is not a setting", "winter.toml:7:1: `AT` is not a setting"],
    );
    check(&format!("{head}CTRL = \"FUZY\"\n"), &["winter.toml:6:8: `FUZY` is not a state", "did you mean `FUZZY`?"]);
    check(&format!("{head}SV = 7O\n"), &["winter.toml:6:", "TOML syntax error here"]);
    check(&format!("{head}SV = true\nP = [1]\n"), &["winter.toml:7:5: found an array, expected a number or a word"]);
    check(
        &head.replace("fuji_pxr", "fuji_pxg"),
        &["winter.toml:2:11: no device of this plant has the profile", "fuji_pxr"],
    );
    check(&head.replace("1970-01-01T", "yesterday "), &["winter.toml:3:"]);
    let units = |line: &str| head.replace("[values]", &format!("[units]\n{line}\n[values]"));
    check(&units("\"°C\" = \"SV\""), &["winter.toml:6:1: `°C` does not say what is measured in it"]);
    check(&units("\"°C\" = [\"SW\"]"), &["winter.toml:6:9: unknown setting `SW`", "did you mean `SV`?"]);
    check(&units("\"°C\" = [\"SV\"]\ns = [\"SV\"]"), &["`SV` has two units"]);
    check("", &["winter.toml is empty"]);
    check("\u{0}", &["winter.toml:1:"]);
}

proptest! {
    #[test]
    fn no_file_makes_the_reader_fail_without_words(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let def = tank();
        if let Err(problems) = read_set("x", "x.toml", &bytes, &def) {
            prop_assert!(!problems.is_empty() && problems.iter().all(|problem| problem.contains("x.toml")));
        }
    }

    #[test]
    fn every_number_comes_back(value in prop_oneof![-1e9f64..1e9, (-100_000i32..100_000).prop_map(|n| f64::from(n) / 10.0)]) {
        let def = tank();
        let mut set = winter(&def);
        set.values.retain(|held| held.tag == "SV");
        set.values[0].value = value.into();
        set.units.retain(|short, _| short == "SV");
        let text = text_of_set(&set, &def);
        prop_assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &def), Ok(set));
    }

    #[test]
    fn every_number_of_64_bits_comes_back(number in any::<i64>(), decimals in 0_u32..4) {
        let def = tank();
        let mut set = winter(&def);
        set.values.retain(|held| held.tag == "SV");
        set.units.retain(|short, _| short == "SV");
        let scaled = format!("{number}e-{decimals}").parse::<crate::plant::exact::Exact>();
        let unsigned = crate::plant::exact::Exact::whole(i128::from(number) + (1 << 63));
        for value in [unsigned, scaled.expect("a number")] {
            set.values[0].value = value;
            let text = text_of_set(&set, &def);
            prop_assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &def), Ok(set.clone()), "{}", text);
        }
    }
}

#[test]
fn a_set_that_was_cut_or_changed_is_no_set() {
    let def = tank();
    let text = text_of_set(&winter(&def), &def);
    let damaged = |bytes: &[u8]| {
        let why = read_set("winter", "winter.toml", bytes, &def).expect_err("it is not as it was written");
        assert!(why[0].starts_with("winter.toml is damaged or was changed"), "{why:?}");
    };
    let first = text.find("check").expect("its check") + 40;
    (first..text.len()).for_each(|end| damaged(&text.as_bytes()[..end]));
    damaged(text.replace("SV = 70.5", "SV = 79.5").as_bytes());
    let mut zeroed = text.clone().into_bytes();
    zeroed[first + 40..first + 80].fill(0);
    damaged(&zeroed);
    let by_hand: String = text.split_inclusive('\n').filter(|line| !line.starts_with(CHECK)).collect();
    let by_hand = read_set("winter", "winter.toml", by_hand.replace("SV = 70.5", "SV = 79.5").as_bytes(), &def);
    assert!(by_hand.is_ok(), "{by_hand:?}");
}
