//! A unit is recognised by its registers, named, and kept as a plant file.

use super::*;

/// A controller that holds what a PXR holds.
pub fn pxr(table: Table, address: u16) -> Option<u16> {
    match (table, address) {
        (Table::Input, 1000) => Some(696),
        (Table::Input, 1003) => Some(4_500),
        (Table::Input, 1001..=1009) | (Table::Holding, 1001 | 1003 | 1004 | 1016) => Some(0),
        (Table::Holding, 1002) => Some(700),
        (Table::Holding, 1005) => Some(50),
        (Table::Holding, 1015 | 1019) => Some(1),
        (Table::Holding, 1018 | 1031) => Some(1_000),
        (Table::Holding, 1006..=1038) => Some(0),
        _ => None,
    }
}

impl Bench {
    /// A unit that answers the window, then every signature.
    fn at_unit(unit: impl Fn(Table, u16) -> Option<u16>) -> Bench {
        let mut bench = Bench::new();
        assert!(bench.probed.is_empty(), "nothing is asked before the first value of the window");
        bench.answer(0, |address| unit(Table::Holding, address));
        while let Some((id, read)) = bench.probed.pop() {
            assert_eq!(read.check(), Ok(()));
            bench.respond(0, id, &read, &unit);
        }
        bench
    }
}

#[test]
fn a_controller_is_recognised_and_gives_its_names() {
    let mut bench = Bench::at_unit(pxr);
    assert!(bench.screen(80, 24).contains("looks like FUJI PXR: 11 of 11 probes fit"), "{}", bench.screen(80, 24));
    bench.keys("⏎");
    let read = bench.answer(1, |address| pxr(Table::Input, address));
    assert_eq!((read.spans[0].table, read.spans[0].address), (Table::Input, 1000), "it goes to the first name");
    let shown = bench.screen(120, 24);
    assert!(shown.contains("PV  69.6 °C") && shown.contains("MV  45.00 %"), "{shown}");
    assert!(shown.contains("names of FUJI PXR"), "{shown}");
}

#[test]
fn what_fits_no_signature_is_said_as_not_recognised() {
    for unit in [&|_, _| None, &|_, _| Some(0), &|_, address| Some(address)] as [&dyn Fn(Table, u16) -> Option<u16>; 3]
    {
        let mut bench = Bench::at_unit(unit);
        assert!(bench.screen(80, 24).contains("not recognised"), "{}", bench.screen(80, 24));
        bench.keys("⏎");
        assert!(bench.model.tabs.registers.names.is_empty());
    }
}

#[test]
fn a_number_whose_decimals_are_not_known_is_shown_raw() {
    let mut bench = Bench::at_unit(|table, address| pxr(table, address).filter(|_| address != 1019));
    assert!(bench.screen(80, 24).contains("10 of 11"));
    bench.keys("⏎");
    bench.answer(1, |address| pxr(Table::Input, address));
    assert!(bench.screen(120, 24).contains("PV  696 raw"), "{}", bench.screen(120, 24));
}

#[test]
fn each_unit_has_names_of_its_own() {
    let mut bench = Bench::at_unit(pxr);
    bench.keys("⏎U2⏎");
    assert!(bench.model.tabs.registers.names.is_empty());
    bench.keys("U1⏎");
    assert!(!bench.model.tabs.registers.names.is_empty());
}

impl Bench {
    /// Saves: the text of the plant file, which loads.
    fn saved(&mut self) -> (String, PlantDef) {
        let mut effects = type_keys(&mut self.model, "S");
        effects.extend(type_keys(&mut self.model, "⏎"));
        let written = effects.into_iter().find_map(|effect| match effect {
            Effect::SaveNew { files, .. } => files.into_iter().next(),
            _ => None,
        });
        let (path, bytes) = written.unwrap_or_else(|| panic!("{}", self.screen(120, 40)));
        assert_eq!(path.to_str(), Some("bench.toml"));
        let text = String::from_utf8(bytes).expect("a text");
        let loaded = crate::profile::OwnProfiles::default()
            .check("bench", &text)
            .unwrap_or_else(|errors| panic!("{text}\n{errors}"));
        (text, PlantDef::clone(&loaded.plant))
    }
}

#[test]
fn a_recognised_device_is_saved_with_its_profile() {
    let mut bench = Bench::at_unit(pxr);
    bench.keys("⏎");
    let (text, def) = bench.saved();
    let device = &def.devices[0];
    assert_eq!((device.name.as_str(), device.profile.as_str(), device.unit), ("bench", "fuji_pxr", 1));
    assert!(device.faceplate.is_some() && text.contains("{controller bench 30x6}"), "{text}");
    assert_eq!(def.lines[0].transport, Transport::tcp("10.0.0.7", 502));
    assert_eq!(def.shifts.len(), 2);
    bench.send(Msg::Saved(Some(Tab::Registers), Ok("/tmp/x.toml".into())));
    assert!(bench.screen(80, 24).contains("saved /tmp/x.toml"));
}

#[test]
fn registers_named_by_hand_are_saved_as_tags_of_the_plant_file() {
    let mut bench = Bench::at_unit(|_, _| None);
    let named = |address, kind, name: &str| Named::new(Table::Holding, address, kind, ByteOrder::Cdab, name);
    let names = &mut bench.model.tabs.registers.names;
    names.put(Named { scale: 0.1, decimals: 1, unit: "°C".into(), ..named(1002, DataType::I16, "SV tank \"1\"") });
    names.put(Named { unit: "furlong".into(), ..named(1010, DataType::F32, "way") });
    names.put(named(1011, DataType::U16, "inside the float"));
    names.put(Named { enum_labels: vec![(0, "off".into()), (1, "on".into())], ..named(1020, DataType::U16, "way") });
    names.put(Named::new(Table::Coil, 7, DataType::Bool, ByteOrder::Abcd, "run"));
    names.put(Named::new(Table::Input, 0, DataType::Text(8), ByteOrder::Abcd, "serial"));
    let (text, def) = bench.saved();
    let names: Vec<&str> = def.tags.iter().map(|tag| tag.name.as_str()).collect();
    assert_eq!(names, ["bench.run", "bench.serial", "bench.SV_tank__1_", "bench.way", "bench.way_1020"], "{text}");
    assert!(text.contains("# overlaps another one: { name = \"inside_the_float\""), "{text}");
    let sv = &def.tags[2];
    assert_eq!((sv.point.address, sv.scale, sv.unit.as_str()), (1002, 0.1, "°C"));
    assert_eq!(sv.access, crate::plant::tag::Access::Read, "read only until the plant file says otherwise");
    assert_eq!(def.tags[3].unit, "furlong", "any text is a unit");
    assert_eq!(def.tags[4].label_of(1.0), Some("on"));
}

#[test]
fn without_a_name_there_is_nothing_to_save() {
    let mut bench = Bench::at_unit(|_, _| None);
    bench.keys("S");
    assert!(bench.screen(80, 24).contains("Nothing has a name yet"));
}

#[test]
fn a_list_from_a_manual_gives_names() {
    let mut bench = Bench::at_unit(device_of_a_manual);
    bench.keys("Nlist.csv⏎");
    let list = "address;name;type;scale;unit\n41003;SV;int16;0.1;°C\nsee page 9\n";
    bench.send(Msg::Loaded(Tab::Registers, Ok(list.into())));
    let read = bench.answer(1, |address| device_of_a_manual(Table::Holding, address));
    assert!(read.spans.iter().any(|span| span.address == 1002), "what the list names is read: {read:?}");
    let shown = bench.screen(80, 24);
    assert!(
        shown.contains("Registers that can be taken: 1, lines that cannot: 1") && shown.contains("70.0 °C"),
        "{shown}"
    );
    assert!(shown.contains("41003: holding 1002 (Modicon) or holding 41003 (as sent)? b chooses"), "{shown}");
    assert!(shown.contains("line 3: ") && bench.model.tabs.registers.names.is_empty(), "nothing is taken yet: {shown}");
    bench.keys("b⏎");
    assert!(bench.screen(80, 24).contains("names taken: 1"), "{}", bench.screen(80, 24));
    bench.keys("⎋");
    bench.answer(1, |address| device_of_a_manual(Table::Holding, address));
    assert!(bench.screen(80, 24).contains("SV  70.0 °C"), "{}", bench.screen(80, 24));
    bench.send(Msg::Paste("40005  speed  uint16  rpm\n".to_owned()));
    bench.send(Msg::Tick { silent: Duration::ZERO });
    assert!(bench.screen(80, 24).contains("speed"), "{}", bench.screen(80, 24));
    bench.keys("⎋");
    assert!(!bench.screen(80, 24).contains("speed"), "nothing of it was taken");
    bench.send(Msg::Loaded(Tab::Registers, Err("list.csv: it is not there".to_owned())));
    assert!(bench.screen(80, 24).contains("it is not there"));
}

#[test]
fn a_list_that_can_be_read_in_two_ways_asks_before_it_is_taken() {
    let mut bench = Bench::at_unit(|_, _| None);
    let list = "address;name;type\n40080;W;int16\n40083;VA;int16\n".to_owned();
    bench.send(Msg::Loaded(Tab::Registers, Ok(list.into_bytes())));
    let shown = bench.screen(120, 24);
    let both = "40080: holding 79 (Modicon) or holding 40080 (as sent)? b chooses";
    assert!(shown.contains(both), "{shown}");
    bench.keys("⏎");
    assert!(bench.screen(80, 24).contains("choose one with b first"), "{}", bench.screen(80, 24));
    bench.keys("⎋bb⏎");
    assert!(bench.model.tabs.registers.names.get(Table::Holding, 40_080).is_some());
    assert!(bench.model.tabs.registers.names.get(Table::Holding, 79).is_none());
}

#[test]
fn a_power_of_ten_of_the_unit_scales_its_value() {
    let model = |list: &[(&str, &str)]| {
        let points = list.iter().map(|(name, more)| format!("{{ \"name\": \"{name}\", \"size\": 1, {more} }}"));
        let points = points.collect::<Vec<_>>().join(", ");
        format!("{{ \"id\": 103, \"group\": {{ \"name\": \"inverter\", \"points\": [ {points} ] }} }}")
    };
    let scaled = "\"type\": \"uint16\", \"sf\": \"A_SF\", \"units\": \"A\"";
    let text = model(&[("A", scaled), ("AphA", scaled), ("A_SF", "\"type\": \"sunssf\"")]);
    for (power, expect) in
        [(-2_i16, "10.02 A"), (0, "1002 A"), (1, "10020 A"), (11, "1002 raw"), (i16::MIN, "1002 raw")]
    {
        let mut bench = Bench::at_unit(|_, _| None);
        bench.send(Msg::Loaded(Tab::Registers, Ok(text.clone().into_bytes())));
        let registers = [(40_070, 1_002), (40_071, 7), (40_072, power.cast_unsigned())];
        let held = |address: u16| registers.iter().find(|(at, _)| *at == address).map(|(_, word)| *word);
        bench.answer(1, held);
        assert!(bench.screen(120, 24).contains(expect), "{power}: {}", bench.screen(120, 24));
        bench.keys("⏎");
        bench.keys("j40070⏎");
        bench.answer(2, held);
        let shown = bench.screen(160, 40);
        assert!(shown.contains(expect), "{power}: {shown}");
    }
}

#[test]
fn the_meaning_of_a_column_is_changed_by_a_key() {
    let mut bench = Bench::at_unit(|_, _| None);
    bench.send(Msg::Loaded(Tab::Registers, Ok("address;name;factor\n5;W;10\n6;VA;100\n".into())));
    bench.answer(1, |address| Some(address * 10));
    let asked = "factor (10): factor / divisor? m chooses what the column means";
    assert!(bench.screen(120, 24).contains(asked), "{}", bench.screen(120, 24));
    bench.keys("→→m");
    assert!(bench.screen(120, 24).contains("×10 "), "{}", bench.screen(120, 24));
    bench.keys("m");
    let shown = bench.screen(120, 24);
    assert!(shown.contains("factor: divisor") && shown.contains("×0.1"), "{shown}");
    bench.keys("⏎");
    assert_eq!(bench.model.tabs.registers.names.get(Table::Holding, 6).map(|named| named.scale), Some(0.01));
}

#[test]
fn a_configuration_of_another_program_is_saved_as_a_profile() {
    let mut bench = Bench::at_unit(|_, _| None);
    let text = "modbus:\n  - sensors:\n    - { name: Flow rate, slave: 3, address: 5, scale: 0.1 }\n    - { name: Own, slave: 3, address: 6, structure: \">h\", data_type: custom }\n";
    bench.send(Msg::Loaded(Tab::Registers, Ok(text.into())));
    let shown = bench.screen(120, 24);
    assert!(
        shown.contains("Registers that can be taken: 1, lines that cannot: 1") && shown.contains("S profile"),
        "{shown}"
    );
    let effects = type_keys(&mut bench.model, &format!("S{}meter⏎", "\u{8}".repeat(11)));
    let [Effect::SaveNew { files, .. }] = &effects[..] else { panic!("{effects:?}") };
    let [(path, bytes)] = &files[..] else { panic!("{files:?}") };
    let saved = String::from_utf8_lossy(bytes).into_owned();
    assert_eq!(path.to_str(), Some("meter.toml"));
    assert!(saved.contains("name = \"Flow_rate\"") && saved.contains("label = \"Flow rate\""), "{saved}");
}

#[test]
fn a_file_that_is_no_list_is_refused_with_what_can_be_read() {
    let mut bench = Bench::at_unit(|_, _| None);
    for (text, name) in [
        ("{ \"group\": { \"points\": [] } }", "it is empty"),
        ("a: 1\nb: 2\nc:\n  - d: 3\n", "it is YAML"),
        ("Mode\tCode\nWait\t0\nOn\t1\n", "no column of addresses"),
    ] {
        bench.send(Msg::Loaded(Tab::Registers, Ok(text.into())));
        let shown = bench.screen(120, 40);
        assert!(shown.contains(name) && shown.contains("What can be"), "{shown}");
        bench.keys("⎋");
        assert!(bench.model.tabs.registers.names.is_empty());
    }
}

fn device_of_a_manual(table: Table, address: u16) -> Option<u16> {
    (table == Table::Holding && address < 1_100).then_some(if address == 1002 { 700 } else { address })
}

#[test]
fn the_timeout_that_the_replies_suggest_is_saved() {
    let mut bench = Bench::at_unit(pxr);
    bench.keys("⏎");
    bench.answer(1, |address| pxr(Table::Input, address));
    assert!(!bench.saved().0.contains("timeout_ms"), "too few replies to say");
    let slow = std::time::Duration::from_millis(80);
    (0..20).for_each(|_| bench.model.tabs.registers.replies.see(slow));
    let (text, def) = bench.saved();
    assert_eq!(def.lines[0].timeout, std::time::Duration::from_millis(250), "{text}");
    assert!(text.contains(" replies took 80.0 ms; timeout_ms leaves a margin"), "{text}");
    let shown = bench.screen(120, 40);
    assert!(shown.contains("timeout 250 ms is enough"), "{shown}");
}

#[test]
fn a_plant_file_stays_beside_the_profile_that_it_names() {
    let fuji = crate::profile::text_of("fuji_pxr", &crate::profile::Search::shipped()).expect("it is shipped");
    let mut bench = Bench::at_unit(pxr);
    bench.keys("⏎");
    bench.model.tabs.registers.profiles = crate::profile::OwnProfiles::of_text("fuji_pxr", &fuji);
    bench.keys(&format!("S{}/tmp/other/bench⏎", "\u{8}".repeat(10)));
    assert!(bench.screen(120, 40).contains("fuji_pxr.toml would not be found from there"), "{}", bench.screen(120, 40));
}
