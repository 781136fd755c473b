//! Tests of what is shipped: every profile loads, and its addresses are those of the manuals.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use super::*;
use crate::plant::{
    def::{Condition, Subject},
    tag::{Access, Bound, DataType, Decimals, Poll, Table},
};

fn tank() -> Arc<PlantDef> {
    load(Path::new("tank"), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn every_shipped_plant_loads_without_a_problem() {
    for plant in list(&Search::shipped()).iter().filter(|listed| listed.kind == Kind::Plant) {
        if let Err(errors) = load(Path::new(&plant.name), &Search::shipped()) {
            panic!("{}:\n{errors}", plant.name);
        }
    }
}

#[test]
fn the_alarms_of_every_shipped_plant_are_complete_and_of_use() {
    for plant in list(&Search::shipped()).iter().filter(|listed| listed.kind == Kind::Plant) {
        let checked = check(Path::new(&plant.name), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
        assert_eq!(checked.warnings.count(), 0, "{}:\n{}", plant.name, checked.warnings);
    }
}

/// All devices of the library, each once, in one plant.
fn library() -> Arc<PlantDef> {
    let mut text = "title = 'a'\ntime_zone = 'UTC'\n[[line]]\nname = 'L'\nmode = 'tcp'\nhost = 'plc'\n".to_owned();
    for (unit, card) in cards(&Search::shipped()).iter().enumerate() {
        let name = &card.listed.name;
        text += &format!("[[device]]\nname = '{name}'\nprofile = '{name}'\nline = 'L'\nunit = {unit}\n");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.toml"), text).unwrap();
    load(&folder.path().join("p.toml"), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"))
}

/// What each quantity of the table of names in profiles/README.md is shown in, whichever device it comes from.
const UNITS: &[(&str, &str)] = &[
    ("V", "V"),
    ("I", "A"),
    ("P", "W"),
    ("Q", "var"),
    ("S", "VA"),
    ("PF", ""),
    ("PHI", "°"),
    ("F", "Hz"),
    ("E", "kWh"),
    ("EQ", "kvarh"),
    ("ES", "kVAh"),
    ("SOC", "%"),
    ("SOH", "%"),
    ("RH", "%"),
    ("CO2", "ppm"),
];

/// The unit of the quantity that a name begins with, or has behind what it is of: `BAT.V`, `PV1.P`, `E.IN.TODAY`.
fn unit_of_quantity(name: &str) -> Option<&'static str> {
    const OF: &[&str] = &["GRID", "LOAD", "EPS", "GEN", "BAT", "PV", "METER", "INV", "BMS", "LOSS", "BUS"];
    const TAIL: &[&str] = &[
        "L1", "L2", "L3", "L12", "L23", "L31", "N", "LN", "LL", "MEAN", "SUM", "IN", "OUT", "YIELD", "TODAY", "MONTH",
        "YEAR", "MAX", "MIN", "DEMAND", "T1", "T2", "T3", "T4",
    ];
    let mut parts: Vec<&str> = name.split('.').collect();
    if parts.len() > 1 && OF.contains(&parts[0].trim_end_matches(|c: char| c.is_ascii_digit())) {
        parts.remove(0);
    }
    let (_, unit) = UNITS.iter().find(|(quantity, _)| *quantity == parts[0])?;
    parts[1..].iter().all(|part| TAIL.contains(part)).then_some(*unit)
}

#[test]
fn every_shipped_device_loads_and_a_quantity_has_one_unit() {
    let plant = library();
    let cards = cards(&Search::shipped());
    assert!(cards.len() >= 150, "{}", cards.len());
    let mut counted = 0;
    for (device, card) in plant.devices.iter().zip(&cards) {
        let tags: Vec<_> = plant.tags_of(device.id).collect();
        assert_eq!(tags.len(), card.tags.len(), "{}: a card counts the tags", device.name);
        assert!(tags.iter().all(|tag| !tag.source.is_empty()), "{}: a row without a source", device.name);
        // The P and I of a controller are its tuning.
        for tag in tags.iter().filter(|_| card.listed.folder != "controllers") {
            if let Some(unit) = unit_of_quantity(&tag.short).filter(|_| tag.enum_labels.is_empty()) {
                assert_eq!(tag.unit, unit, "{}", tag.name);
                counted += 1;
            }
        }
    }
    assert!(counted > 1_500, "{counted}");
}

#[test]
fn every_shipped_device_says_whose_facts_it_has() {
    let open = ["(MIT)", "(BSD-3-Clause)", "(Apache-2.0)"];
    let seen = ["manual", "maker's", "thesis", "article", "drivers"];
    for Card { listed, vendor, model, status, source, .. } in cards(&Search::shipped()) {
        assert!(![vendor, model, status].iter().any(String::is_empty), "{}", listed.name);
        let foreign = ["register list of", "register model of", "library"].iter().any(|word| source.contains(word));
        let licensed = open.iter().any(|licence| source.contains(licence));
        assert!(licensed || !foreign && seen.iter().any(|word| source.contains(word)), "{}: {source}", listed.name);
    }
}

#[test]
fn a_search_finds_by_maker_model_kind_and_tag() {
    let check = |words: &str, first: &str| {
        let found = find_cards(cards(&Search::shipped()), words);
        assert_eq!(found.first().map(|card| card.listed.name.as_str()), Some(first), "{words}");
        found
    };
    check("sdm630", "eastron_sdm630");
    check("koyo dl06", "koyo_dl06");
    check("fuji pxr", "fuji_pxr");
    check("gensets oil", "dse_52xx");
    let found = check("siemens meters", "siemens_pac2200");
    assert!(found.len() < 10, "{}", found.len());
    assert!(find_cards(cards(&Search::shipped()), "qqxqq").is_empty());
}

#[test]
fn an_unknown_profile_is_looked_for_near_and_by_a_search() {
    let folder = tempfile::tempdir().unwrap();
    let check = |profile: &str, expect: &str| {
        let text = format!(
            "title = 'a'\ntime_zone = 'UTC'\n[[line]]\nname = 'L'\nmode = 'tcp'\nhost = 'plc'\n\
             [[device]]\nname = 'D'\nprofile = '{profile}'\nline = 'L'\nunit = 1\n"
        );
        std::fs::write(folder.path().join("p.toml"), text).unwrap();
        let errors = load(&folder.path().join("p.toml"), &Search::shipped()).unwrap_err().to_string();
        assert!(errors.contains(expect), "{errors}");
    };
    check("eastron_sdm360", "did you mean `eastron_sdm630`?");
    check("something_else_than_all", "sightglass profiles --search");
}

#[test]
fn a_profile_on_disk_may_lie_in_a_folder_of_its_kind() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("devices/meters");
    std::fs::create_dir_all(&own).unwrap();
    let text = text_of("eastron_sdm630", &Search::shipped()).unwrap().replace("SDM630", "OURS");
    std::fs::write(own.join("ours.toml"), &text).unwrap();
    std::fs::write(own.join("eastron_sdm630.toml"), text).unwrap();
    let search = Search::folders(vec![folder.path().into()]);
    let all = cards(&search);
    for name in ["ours", "eastron_sdm630"] {
        let card = all.iter().find(|card| card.listed.name == name).unwrap();
        assert_eq!((card.model.as_str(), card.listed.folder.as_str()), ("OURS", "meters"), "{name}");
        assert_eq!(card.listed.from, Some(own.join(format!("{name}.toml"))));
    }
    assert_eq!(all.len(), cards(&Search::shipped()).len() + 1, "one more name");
}

#[test]
fn a_set_of_the_controller_holds_settings_and_no_commands() {
    let plant = tank();
    let in_sets = |name: &str| plant.tag(plant.tag_named(name).unwrap()).in_sets;
    for setting in ["SV", "P", "I", "D", "CTRL", "SV-L", "SV-H", "PTN", "SV-8", "TM8S"] {
        assert!(in_sets(&format!("TIC-1.{setting}")), "{setting}");
    }
    for other in ["FIX", "AT", "STBY", "PROG", "PV", "MV", "P-N2"] {
        assert!(!in_sets(&format!("TIC-1.{other}")), "{other}");
    }
    let coils = plant.tags.iter().filter(|tag| tag.point.table.is_bits() && tag.in_sets);
    assert_eq!(coils.count(), 0, "a coil of the PLC is a command");
    let program = plant.devices[0].program.as_ref().unwrap();
    assert_eq!((program.steps.len(), program.steps_of(Some(1.0))), (8, Some((4, 7))));
}

#[test]
fn the_addresses_are_those_of_the_recorded_frames_and_manuals() {
    let plant = tank();
    let check = |name: &str, table: Table, address: u16, kind: DataType| {
        let point = plant.tag(plant.tag_named(name).unwrap()).point;
        assert_eq!((point.table, point.address, point.kind), (table, address, kind), "{name}");
    };
    check("TIC-1.SV", Table::Holding, 0x03EA, DataType::I16);
    check("TIC-1.PV", Table::Input, 0x03E8, DataType::I16);
    check("TIC-1.MV", Table::Input, 0x03EB, DataType::I16);
    check("TIC-1.FAULT", Table::Input, 0x03EF, DataType::U16);
    check("TIC-1.FIX", Table::Holding, 0x03E8, DataType::U16);
    check("TIC-1.STBY", Table::Holding, 0x03EB, DataType::U16);
    check("TIC-1.P-DP", Table::Holding, 0x03FB, DataType::U16);
    check("TIC-1.SV-H", Table::Holding, 0x0407, DataType::I16);
    check("TIC-1.SV-8", Table::Holding, 0x0427, DataType::I16);
    check("TIC-1.TM8S", Table::Holding, 0x0437, DataType::U16);
    check("TIC-1.PTN", Table::Holding, 0x043A, DataType::U16);
    check("PLC-1.Y0", Table::Coil, 2048, DataType::Bool);
    check("PLC-1.Y17", Table::Coil, 2063, DataType::Bool);
    check("PLC-1.X23", Table::Discrete, 2067, DataType::Bool);
    check("PLC-1.VY0", Table::Holding, 0x4140, DataType::U16);
    check("PLC-1.VX0", Table::Holding, 0x4100, DataType::U16);
    check("PLC-1.P-1", Table::Coil, 2048, DataType::Bool);
    check("PLC-1.AT-SV", Table::Discrete, 2052, DataType::Bool);
    check("PLC-1.RUN", Table::Coil, 3072, DataType::Bool);
    check("PLC-1.SEQ.FAULT", Table::Coil, 3079, DataType::Bool);
    check("PLC-1.STEP", Table::Holding, 1024, DataType::Bcd16);
    check("PLC-1.LT-1", Table::Input, 1032, DataType::U16);
    check("PLC-1.HEATER", Table::Input, 1038, DataType::U16);
}

#[test]
fn a_temperature_needs_its_decimals_unit_and_sensor_state() {
    let plant = tank();
    let id = |name: &str| plant.tag_named(name).unwrap();
    let pv = plant.tag(id("TIC-1.PV"));
    assert_eq!(pv.decimals, Decimals::From(id("TIC-1.P-DP")));
    for name in ["TIC-1.PV", "TIC-1.DV"] {
        assert_eq!(plant.tag(id(name)).quality_from, Some((id("TIC-1.FAULT"), u64::MAX)), "{name}");
    }
    assert_eq!(pv.unit_from, Some((id("TIC-1.P-F"), vec![(0, "°C".to_owned()), (1, "°F".to_owned())])));
    assert_eq!(pv.unit, "°C");
    assert_eq!(
        (pv.min, pv.max),
        (Some(Bound::Fixed(0.0.into())), Some(Bound::Fixed(100.0.into()))),
        "the plant file's bounds win"
    );
    let sv = plant.tag(id("TIC-1.SV"));
    assert_eq!((sv.min, sv.max), (Some(Bound::From(id("TIC-1.SV-L"))), Some(Bound::From(id("TIC-1.SV-H")))));
}

#[test]
fn outputs_are_read_only_and_only_needed_tags_are_polled() {
    let plant = tank();
    let plc = plant.devices[1].id;
    let writable: Vec<&str> = plant.tags_of(plc).filter(|tag| tag.writable()).map(|tag| tag.short.as_str()).collect();
    assert_eq!(writable, ["RUN", "AUTO", "MAN.P-1", "MAN.M-1", "MAN.SV-1", "MAN.SV-2", "MAN.HEATER", "FILL"]);
    assert_eq!(plant.tags_of(plc).filter(|tag| tag.poll != Poll::Never).count(), 25);
    let fix = plant.tag(plant.tag_named("TIC-1.FIX").unwrap());
    assert_eq!((fix.access, fix.poll), (Access::Write, Poll::Never));
    let saving = plant.devices.iter().flat_map(|device| &device.actions).filter(|action| action.saves);
    assert_eq!(saving.map(|action| action.name.as_str()).collect::<Vec<_>>(), ["FIX"]);
}

#[test]
fn a_silent_device_always_raises_an_alarm() {
    let plant = tank();
    for device in &plant.devices {
        let silent = |alarm: &&crate::plant::def::AlarmDef| {
            alarm.subject == Subject::Device(device.id) && alarm.condition == Condition::NotResponding
        };
        assert_eq!(plant.alarms.iter().filter(silent).count(), 1, "{}", device.name);
    }
    assert!(plant.alarms.iter().all(|alarm| !alarm.guidance.action.is_empty()), "every alarm says what to do");
}

#[test]
fn a_plant_is_found_by_name_and_by_its_path_in_the_program() {
    let check = |argument: &str, expect: bool| {
        assert_eq!(load(Path::new(argument), &Search::shipped()).is_ok(), expect, "{argument}");
    };
    check("tank", true);
    check("profiles/plants/tank.toml", true);
    check("plants/nowhere.toml", false);
    check("../profiles/plants/tank.toml", false);
}

#[test]
fn the_file_beside_the_plant_wins_over_user_and_shipped() {
    let root = tempfile::tempdir().unwrap();
    let (here, user) = (root.path().join("here"), root.path().join("user"));
    std::fs::create_dir_all(&here).unwrap();
    std::fs::create_dir_all(user.join("devices")).unwrap();
    std::fs::create_dir_all(user.join("plants")).unwrap();
    let tank = text_of("tank", &Search::shipped()).unwrap();
    std::fs::write(here.join("mine.toml"), &tank).unwrap();
    let search = Search::folders(vec![user.clone()]);
    let model = || load(&here.join("mine.toml"), &search).map(|plant| plant.devices[1].model.clone()).unwrap();
    let koyo =
        |model: &str| text_of("koyo_dl06", &Search::shipped()).unwrap().replace("\"DL06\"", &format!("\"{model}\""));
    assert_eq!(model(), "KOYO DL06");
    std::fs::write(user.join("devices/koyo_dl06.toml"), koyo("USER")).unwrap();
    assert_eq!(model(), "KOYO USER");
    std::fs::write(here.join("koyo_dl06.toml"), koyo("HERE")).unwrap();
    assert_eq!(model(), "KOYO HERE");
    let listed = list(&search).into_iter().find(|listed| listed.name == "koyo_dl06").unwrap();
    assert_eq!(listed.from, Some(user.join("devices/koyo_dl06.toml")), "sightglass profiles says where it comes from");
    assert!(text_of("koyo_dl06", &search).unwrap().contains("USER"));
    std::fs::write(user.join("plants/copy.toml"), &tank).unwrap();
    assert_eq!(load(Path::new("copy"), &search).unwrap().name, "copy");
}
