//! What can be chosen from a list: values, profiles, places; and a device that says itself what it has.

use super::*;

/// The SunSpec models 1 and 103 at 40000: 230.2 V, 4110 W, state MPPT; what is not implemented is marked.
pub fn inverter(table: Table, address: u16) -> Option<u16> {
    if table != Table::Holding {
        return None;
    }
    let text = |text: &str, at: u16| {
        let byte = |n: u16| text.as_bytes().get(usize::from(n)).copied().unwrap_or(0);
        Some(u16::from_be_bytes([byte(2 * at), byte(2 * at + 1)]))
    };
    match address {
        40_000 => Some(0x5375),
        40_001 => Some(0x6E53),
        40_002 => Some(1),
        40_003 => Some(66),
        40_004..=40_019 => text("ACME", address - 40_004),
        40_020..=40_035 => text("Sun 5", address - 40_020),
        40_036..=40_069 => Some(0),
        40_070 => Some(103),
        40_071 => Some(50),
        40_073..=40_075 => Some(0xFFFF),
        40_080 => Some(2_302),
        40_083 => Some((-1_i16).cast_unsigned()),
        40_084 => Some(411),
        40_085 => Some(1),
        40_108 => Some(4),
        40_110..=40_121 => Some(0),
        40_072..=40_109 => Some(0x8000),
        40_122 => Some(0xFFFF),
        40_123 => Some(0),
        _ => None,
    }
}

impl Bench {
    /// A unit that answers everything that is asked.
    pub fn at(unit: impl Fn(Table, u16) -> Option<u16>) -> Bench {
        let mut bench = Bench::new();
        bench.answer(0, |address| unit(Table::Holding, address));
        bench.probes(&unit);
        bench
    }

    fn probes(&mut self, unit: &impl Fn(Table, u16) -> Option<u16>) {
        self.probes_lost(unit, |_, _| false);
    }

    /// The same where registers are lost, by the number of their read and their address.
    fn probes_lost(&mut self, unit: &impl Fn(Table, u16) -> Option<u16>, is_lost: impl Fn(usize, u16) -> bool) {
        let mut reads = 0;
        while let Some((id, read)) = self.probed.pop() {
            assert_eq!(read.check(), Ok(()));
            self.respond_or_lose(0, id, &read, |table, address| match unit(table, address) {
                _ if is_lost(reads, address) => Err(Fault::Timeout),
                word => word.ok_or(Fault::Exception(ExceptionCode(2))),
            });
            reads += 1;
        }
    }
}

#[test]
fn one_lost_request_costs_neither_models_nor_a_profile() {
    for lost in 0..4 {
        let mut bench = Bench::new();
        bench.answer(0, |address| inverter(Table::Holding, address));
        bench.probes_lost(&inverter, |read, _| read == lost);
        bench.keys("⎋");
        assert!(bench.screen(110, 24).contains("ACME Sun 5: SunSpec models 2 "), "{}", bench.screen(110, 24));
        let mut bench = Bench::new();
        bench.answer(0, |address| keep::pxr(Table::Holding, address));
        bench.probes_lost(&keep::pxr, |read, address| read % 5 == lost && address != 0);
        assert!(bench.screen(80, 24).contains("looks like FUJI PXR: 11 of 11"), "{}", bench.screen(80, 24));
    }
}

#[test]
fn values_are_scaled_once_their_power_of_ten_has_come() {
    let mut bench = Bench::new();
    bench.send(Msg::Resize(110, 70));
    bench.answer(0, |address| inverter(Table::Holding, address));
    bench.probes_lost(&inverter, |_, address| address == 40_083);
    bench.keys("⎋");
    assert!(bench.screen(110, 70).contains("not all could be read"), "{}", bench.screen(110, 70));
    bench.keys("v");
    let row = |shown: String| shown.lines().find(|row| row.contains("PhVphA")).unwrap_or_default().to_owned();
    let read = bench.answer(1, |address| inverter(Table::Holding, address).filter(|_| address != 40_083));
    assert!(read.spans.iter().any(|span| span.range().contains(&40_083)), "{:?}", read.spans);
    assert!(row(bench.screen(110, 70)).contains("2302 raw"), "{}", bench.screen(110, 70));
    bench.answer(2, |address| inverter(Table::Holding, address));
    assert!(row(bench.screen(110, 70)).contains("230.2 V"), "{}", bench.screen(110, 70));
}

#[test]
fn an_inverter_says_its_names_and_values_itself() {
    let mut bench = Bench::at(inverter);
    bench.keys("v");
    bench.answer(1, |address| inverter(Table::Holding, address));
    let shown = bench.screen(110, 40);
    assert!(shown.contains("values with names"), "{shown}");
    let row = |name: &str| {
        let of = |row: &&str| row.contains("inverter") && row.split_whitespace().any(|word| word == name);
        shown.lines().find(of).unwrap_or_else(|| panic!("no {name} in\n{shown}")).to_owned()
    };
    assert!(row("PhVphA").contains("230.2 V") && row("W").contains("4110 W"), "{shown}");
    assert!(row("AphB").contains("no value"), "{shown}");
    bench.keys("⎋");
    assert!(bench.screen(110, 40).contains("ACME Sun 5: SunSpec models 2"), "{}", bench.screen(110, 40));
}

#[test]
fn an_inverter_is_saved_as_plant_and_profile() {
    let mut bench = Bench::at(inverter);
    type_keys(&mut bench.model, "⎋S");
    let effects = type_keys(&mut bench.model, "roof⏎");
    let files = effects.into_iter().find_map(|effect| match effect {
        Effect::SaveNew { files, .. } => Some(files),
        _ => None,
    });
    let files = files.expect("files, typed text stands in place of what was offered");
    let names: Vec<_> = files.iter().map(|(path, _)| path.to_str()).collect();
    assert_eq!(names, [Some("roof_sunspec.toml"), Some("roof.toml")], "all or none of them");
    let [profile, text] = [0, 1].map(|n| String::from_utf8(files[n].1.clone()).expect("text"));
    let mut profiles = crate::profile::OwnProfiles::default();
    profiles.add("roof_sunspec", &profile);
    let loaded = profiles.check("roof", &text).unwrap_or_else(|errors| panic!("{text}\n{errors}"));
    assert!(loaded.plant.tag_named("roof.inverter.W").is_some(), "{text}");
    bench.send(Msg::Saved(Some(Tab::Registers), Ok("roof.toml".into())));
    assert!(bench.screen(80, 24).contains("saved roof.toml"));
}

#[test]
fn a_profile_is_chosen_by_hand_and_says_why_others_do_not_fit() {
    let unit = |table: Table, address: u16| match (table, address) {
        (Table::Holding, 1_019) => Some(1),
        (_, 1_000..=1_100) => Some(77),
        (Table::Holding, 0..=200) => Some(0),
        _ => None,
    };
    let mut bench = Bench::at(unit);
    assert!(bench.screen(110, 24).contains("not recognised: f chooses a profile"), "{}", bench.screen(110, 24));
    bench.keys("f");
    let shown = bench.screen(110, 30);
    assert!(shown.contains("fuji_pxr") && shown.contains(" of 11") && shown.contains("expected"), "{shown}");
    bench.keys("/fuji_pxr⏎");
    assert!(!bench.screen(110, 30).contains("eastron"), "{}", bench.screen(110, 30));
    bench.keys("⏎");
    bench.answer(1, |address| unit(Table::Holding, address));
    let shown = bench.screen(110, 30);
    assert!(shown.contains("names of FUJI PXR, as chosen"), "{shown}");
    assert!(!bench.model.tabs.registers.names.is_empty());
}

#[test]
fn a_value_is_looked_for_in_every_type_order_and_scale() {
    let mut bench = Bench::new();
    bench.answer(0, |address| match address {
        2 => Some(237),
        5 => Some(0x999A),
        6 => Some(0x41BD),
        _ => Some(0),
    });
    bench.keys("/23.7⏎");
    let shown = bench.screen(110, 24);
    let row = |word: &str| {
        shown.lines().find(|row| row.contains(word)).unwrap_or_else(|| panic!("{word}: {shown}")).to_owned()
    };
    assert!(row("float32").contains("float32 CDAB  ") && row("float32").contains("23.7"), "{shown}");
    assert!(row("40003").contains("uint16 ABCD ÷10") && row("40003").contains('%'), "{shown}");
    assert_eq!(shown.matches("uint16 ABCD ÷10").count(), 1, "{shown}");
    bench.keys("⎋/nonsense⏎");
    assert!(bench.screen(110, 24).contains("expected a number such as 702"));
}

#[test]
fn the_file_of_a_log_is_asked_for() {
    let mut bench = Bench::new();
    bench.answer(0, |_| Some(7));
    bench.keys("eSV⏎pR");
    assert!(bench.screen(80, 24).contains("registers-"), "a name is offered");
    let effects = type_keys(&mut bench.model, "mine.csv⏎");
    let path = effects.into_iter().find_map(|effect| match effect {
        Effect::Append { path, new: true, .. } => Some(path),
        _ => None,
    });
    assert_eq!(path.as_deref().and_then(std::path::Path::to_str), Some("mine.csv"));
}

#[test]
fn a_preview_says_how_plain_numbers_were_read() {
    let mut bench = Bench::new();
    let first = |bench: &mut Bench, list: &str| {
        bench.send(Msg::Loaded(Tab::Registers, Ok(list.as_bytes().to_vec())));
        let shown = bench.screen(110, 24);
        let line = shown.lines().find(|row| row.contains("plain numbers:")).unwrap_or_default().to_owned();
        assert!(!line.is_empty(), "{shown}");
        line
    };
    let sent = first(&mut bench, "address;name;type\n5;a;int16\n");
    assert!(sent.contains("as sent, from 0; by default: holding, ABCD"), "{sent}");
    let modicon = first(&mut bench, "address;name;type\n400005;a;int16\n");
    assert!(modicon.contains("Modicon numbers; by default"), "{modicon}");
    let heat_pump = "Title;Register type;Register;Division factor;Size of variable\na;MODBUS_INPUT_REGISTER;5;1;6\n";
    let swapped = first(&mut bench, heat_pump);
    assert!(swapped.contains("as sent, from 0; by default: holding, CDAB"), "{swapped}");
    bench.keys("b");
    let changed = bench.screen(110, 24);
    assert!(changed.contains("plain numbers: Modicon numbers"), "what is said counts: {changed}");
}
