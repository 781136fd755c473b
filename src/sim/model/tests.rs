//! Tests of modelled devices: what a master gets from a device that exists only as a profile.

use std::sync::Arc;

use super::*;
use crate::{
    bus::plan::{UnreadableRanges, blocks},
    plant::{PlantDef, def::LineId, tag::Table},
    profile::{self, Search},
    sim::simulator::Simulator,
};

const L1: LineId = LineId(0);

/// A plant around one device profile, unit 1.
fn plant(profile: &str) -> Arc<PlantDef> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("device.toml");
    let head = "vendor = 'A'\nmodel = 'B'\nstatus = 'manual'\nsource = 'C'\n";
    std::fs::write(&path, format!("{head}{profile}")).expect("the folder takes a file");
    profile::check(&path, &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}")).plant
}

const OVEN: &str = r#"
limits = { read_registers_max = 8, write_registers_max = 4, gap_registers_max = 2 }
tag = [
    { name = "SV", table = "holding", address = 10, type = "int16", scale = 0.1, access = "rw", min = -20, max_from = "SV-H" },
    { name = "SV-H", table = "holding", address = 11, type = "int16", scale = 0.1, access = "rw", max = 500 },
    { name = "MODE", table = "holding", address = 14, type = "uint16", access = "rw", enum = { 1 = "PID", 2 = "ON-OFF" } },
    { name = "GAIN", table = "holding", address = 20, type = "float32", access = "rw", min = 0.5, max = 2 },
    { name = "PV", table = "input", address = 0, type = "int16", scale = 0.1 },
    { name = "KEY", table = "coil", address = 5, access = "rw" },
    { name = "P", table = "holding", address = 30, type = "uint16", access = "rw", write_unlock = { tag = "KEY", value = 1 } },
    { name = "LAMP", table = "discrete", address = 7 },
    { name = "HIGH", table = "holding", address = 40, type = "uint16", field = "15-8" },
    { name = "LOW", table = "holding", address = 40, type = "uint16", field = "7-0" },
]
"#;

/// Puts requests to one oven one after another.
fn check(exchanges: &[(&[u8], &[u8])]) {
    let mut simulator = Simulator::new(&plant(OVEN)).expect("no rig is named");
    let sv_h = plant(OVEN).tag_named("D-1.SV-H").expect("it is in the profile");
    assert!(simulator.set_value(sv_h, 200.0));
    for (request, expect) in exchanges {
        assert_eq!(simulator.respond(L1, 1, request).as_deref(), Some(*expect), "request {request:02X?}");
    }
}

#[test]
fn what_is_written_is_read_back() {
    check(&[(&[6, 0, 10, 0x05, 0xDC], &[6, 0, 10, 0x05, 0xDC]), (&[3, 0, 10, 0, 1], &[3, 2, 0x05, 0xDC])]);
    check(&[(&[5, 0, 5, 0xFF, 0], &[5, 0, 5, 0xFF, 0]), (&[1, 0, 5, 0, 1], &[1, 1, 1])]);
    let gain: &[u8] = &[16, 0, 20, 0, 2, 4, 0x3F, 0x80, 0, 0];
    check(&[(gain, &[16, 0, 20, 0, 2]), (&[3, 0, 20, 0, 2], &[3, 4, 0x3F, 0x80, 0, 0])]);
}

#[test]
fn each_value_starts_where_its_bounds_and_states_allow() {
    // 1 is the first state of MODE; 0.5 the least GAIN; the gap of two words before MODE may be read over.
    check(&[(&[3, 0, 10, 0, 5], &[3, 10, 0, 0, 0x07, 0xD0, 0, 0, 0, 0, 0, 1])]);
    check(&[(&[3, 0, 20, 0, 2], &[3, 4, 0x3F, 0, 0, 0]), (&[2, 0, 7, 0, 1], &[2, 1, 0])]);
}

#[test]
fn a_model_refuses_what_its_profile_does_not_allow() {
    // Below the lowest SV; above SV-H; no state; a float out of its bounds; then all is as it was.
    check(&[(&[6, 0, 10, 0xFF, 0x37], &[0x86, 3]), (&[6, 0, 10, 0x07, 0xD1], &[0x86, 3])]);
    check(&[(&[6, 0, 14, 0, 3], &[0x86, 3]), (&[3, 0, 14, 0, 1], &[3, 2, 0, 1])]);
    check(&[(&[16, 0, 20, 0, 2, 4, 0x40, 0x80, 0, 0], &[0x90, 3]), (&[3, 0, 20, 0, 2], &[3, 4, 0x3F, 0, 0, 0])]);
    // Half a float; a gap, which may only be read; beyond the gap; read only tables and unused functions.
    check(&[(&[6, 0, 20, 0x3F, 0x80], &[0x86, 2]), (&[6, 0, 12, 0, 1], &[0x86, 2])]);
    check(&[(&[3, 0, 15, 0, 1], &[0x83, 2]), (&[4, 0, 1, 0, 1], &[0x84, 2]), (&[3, 0, 40, 0, 1], &[3, 2, 0, 0])]);
    check(&[(&[6, 0, 40, 0, 1], &[0x86, 2]), (&[22, 0, 10, 0, 0, 0, 0], &[0x96, 1]), (&[8, 0, 0, 0, 0], &[0x88, 1])]);
    // More words than one request may hold.
    check(&[(&[3, 0, 10, 0, 9], &[0x83, 3])]);
}

#[test]
fn a_locked_value_takes_a_write_only_after_its_key() {
    check(&[
        (&[6, 0, 30, 0, 7], &[0x86, 2]),
        (&[5, 0, 5, 0xFF, 0], &[5, 0, 5, 0xFF, 0]),
        (&[6, 0, 30, 0, 7], &[6, 0, 30, 0, 7]),
        (&[3, 0, 30, 0, 1], &[3, 2, 0, 7]),
    ]);
}

#[test]
fn fields_of_one_word_do_not_disturb_each_other() {
    let plant = plant(OVEN);
    let mut simulator = Simulator::new(&plant).expect("no rig is named");
    let id = |name: &str| plant.tag_named(name).expect("it is in the profile");
    assert!(simulator.set_value(id("D-1.HIGH"), 18.0) && simulator.set_value(id("D-1.LOW"), 52.0));
    assert_eq!(simulator.respond(L1, 1, &[3, 0, 40, 0, 1]), Some(vec![3, 2, 0x12, 0x34]));
    assert_eq!(simulator.value(id("D-1.HIGH")), Some(18.0));
    assert!(!simulator.set_value(id("D-1.HIGH"), 256.0), "a byte holds no 256");
}

/// A meter that wants even addresses and counts.
#[test]
fn a_device_with_an_alignment_refuses_odd_requests() {
    let meter = plant(
        "limits = { alignment = 2 }\ntag = [{ name = 'V1', table = 'input', address = 0, type = 'float32' }, { name = 'V2', table = 'input', address = 2, type = 'float32' }]",
    );
    let mut simulator = Simulator::new(&meter).expect("no rig is named");
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 0, 0, 4]), Some(vec![4, 8, 0, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 1, 0, 2]), Some(vec![0x84, 2]));
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 0, 0, 3]), Some(vec![0x84, 3]));
}

#[test]
fn a_device_refuses_what_one_of_its_tables_does_not_give() {
    let tags = "[{ name = 'V1', table = 'input', address = 0, type = 'float32' }, { name = 'V2', table = 'holding', address = 0, type = 'float32' }, { name = 'B', table = 'coil', address = 0 }]";
    let meter = plant(&format!(
        "limits = {{ input = {{ read_max = 2 }}, coil = {{ alignment = 8, gap_max = 15 }} }}\ntag = {tags}"
    ));
    let mut simulator = Simulator::new(&meter).expect("no rig is named");
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 0, 0, 2]), Some(vec![4, 4, 0, 0, 0, 0]));
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 0, 0, 3]), Some(vec![0x84, 3]));
    assert_eq!(simulator.respond(L1, 1, &[1, 0, 0, 0, 1]), Some(vec![0x81, 3]));
    let plan = blocks(&meter, L1, &UnreadableRanges::default());
    let counts: Vec<_> = plan.iter().map(|block| (block.table, block.address, block.count)).collect();
    assert_eq!(counts, [(Table::Coil, 0, 8), (Table::Input, 0, 2), (Table::Holding, 0, 2)]);
}

#[test]
fn the_second_controller_of_a_tank_plant_is_a_model() {
    let tank = profile::load("tank".as_ref(), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
    let mut def = (*tank).clone();
    let mut second = def.devices[0].clone();
    (second.id, second.unit) = (DeviceId(2), 3);
    def.devices.push(second);
    let mut simulator = Simulator::new(&def).expect("the tank is known");
    assert_eq!(simulator.respond(L1, 1, &[3, 0x03, 0xEA, 0, 1]), Some(vec![3, 2, 0x02, 0xBC]), "the rig's own");
    assert_eq!(simulator.respond(L1, 3, &[3, 0x03, 0xEA, 0, 1]), Some(vec![0x83, 1]), "a model without tags");
    def.simulation = Some("tanc".into());
    assert!(
        Simulator::new(&def)
            .is_err_and(|error| error.to_string().contains("`tank`") || error.to_string().contains("\"tank\""))
    );
}

#[test]
fn rare_types_and_places_are_simulated_as_they_are_read() {
    let device = plant(
        r#"
tag = [
    { name = "LOW", table = "holding", address = 0, type = "int8", access = "rw", write = "rmw" },
    { name = "HIGH", table = "holding", address = 0, type = "uint8", order = "BADC", access = "rw", write = "rmw" },
    { name = "ENERGY", table = "holding", address = 1, type = "mod10k(2)", scale_from = "SF" },
    { name = "SF", table = "holding", address = 3, type = "int16", simulate = { start = 2 } },
    { name = "T", table = "input", address = 9, type = "sm16", access = "rw", write_address = 0x20, max = 100 },
    { name = "PART", table = "holding", address = 4, type = "uint32", field = "19-12" },
]
"#,
    );
    let mut simulator = Simulator::new(&device).expect("no rig is named");
    let id = |name: &str| device.tag_named(name).expect("it is in the profile");
    for (name, value) in [("LOW", -2.0), ("HIGH", 200.0), ("ENERGY", 1_234_567_800.0), ("T", -5.0), ("PART", 171.0)] {
        let name = format!("D-1.{name}");
        assert!(simulator.set_value(id(&name), value), "{name}");
        assert_eq!(simulator.value(id(&name)), Some(value), "{name}");
    }
    let words = [3, 12, 0xC8, 0xFE, 0x04, 0xD2, 0x16, 0x2E, 0, 2, 0x00, 0x0A, 0xB0, 0x00];
    assert_eq!(simulator.respond(L1, 1, &[3, 0, 0, 0, 6]), Some(words.to_vec()), "1234 5678 hundreds");
    assert_eq!(simulator.respond(L1, 1, &[4, 0, 9, 0, 1]), Some(vec![4, 2, 0x80, 0x05]));
    let sent = [6, 0, 0x20, 0x00, 0x07];
    assert_eq!(simulator.respond(L1, 1, &sent), Some(sent.to_vec()), "written elsewhere");
    assert_eq!(simulator.value(id("D-1.T")), Some(7.0));
    assert_eq!(simulator.respond(L1, 1, &[6, 0, 0x20, 0, 101]), Some(vec![0x86, 3]), "beyond its greatest value");
    assert!(simulator.set_value(id("D-1.LOW"), -2.0));
    assert_eq!(simulator.respond(L1, 1, &[6, 0, 0, 0xC8, 0x05]), Some(vec![6, 0, 0, 0xC8, 0x05]));
    assert_eq!((simulator.value(id("D-1.LOW")), simulator.value(id("D-1.HIGH"))), (Some(5.0), Some(200.0)));
}

/// As Enron and Daniel count: a flow computer.
#[test]
fn addresses_of_32_bits_are_simulated_as_they_are_read() {
    let device = plant(
        r#"
tag = [
    { name = "STATE", table = "holding", address = 3001, type = "uint16", simulate = { start = 7 } },
    { name = "N", table = "holding", address = 5001, type = "enron_uint32", access = "rw", max = 4000000000 },
    { name = "FLOW", table = "holding", address = 5003, type = "enron_float32", order = "CDAB" },
]
"#,
    );
    let mut simulator = Simulator::new(&device).expect("no rig is named");
    let id = |name: &str| device.tag_named(name).expect("it is in the profile");
    assert!(simulator.set_value(id("D-1.FLOW"), 1.5) && simulator.set_value(id("D-1.N"), 305_419_896.0));
    let read: &[u8] = &[3, 12, 0x12, 0x34, 0x56, 0x78, 0, 0, 0, 0, 0, 0, 0x3F, 0xC0];
    let write: &[u8] = &[16, 0x13, 0x89, 0, 1, 4, 0, 1, 0, 2];
    for (request, expect) in [
        (&[3, 0x13, 0x89, 0, 3][..], read),
        (&[3, 0x0B, 0xB9, 0, 1], &[3, 2, 0, 7]),
        (write, &write[..5]),
        (&[3, 0x13, 0x89, 0, 1], &[3, 4, 0, 1, 0, 2]),
        // Two bytes are no number of this device, and neither is one beyond its greatest.
        (&[16, 0x13, 0x89, 0, 1, 2, 0, 1], &[0x90, 3]),
        (&[16, 0x13, 0x89, 0, 1, 4, 0xFF, 0, 0, 0], &[0x90, 3]),
        (&[3, 0x13, 0x89, 0, 63], &[0x83, 3]),
        (&[6, 0x13, 0x89, 0, 1], &[0x86, 2]),
    ] {
        assert_eq!(simulator.respond(L1, 1, request).as_deref(), Some(expect), "request {request:02X?}");
    }
    assert_eq!(simulator.value(id("D-1.N")), Some(65_538.0));
    let words = blocks(&device, L1, &UnreadableRanges::default());
    let words: Vec<_> = words.iter().map(|block| (block.address, block.count, block.address_words)).collect();
    assert_eq!(words, [(3_001, 1, 1), (5_001, 3, 2)]);
}

/// It says what most conditions of its profile want to hear.
#[test]
fn a_device_says_of_itself_what_its_conditions_ask() {
    let tag = |name: &str, address, when: &str| {
        format!("{{ name = \"{name}\", table = \"holding\", address = {address}, type = \"uint16\"{when} }}")
    };
    let tags = [
        tag("A", 0, ""),
        tag("B", 1, ", when = \"revision >= '2.9'\""),
        tag("C", 2, ", when = \"revision >= '2.10'\""),
        tag("D", 3, ", when = \"revision < '2.1' or object_0x80 = 'X'\""),
    ];
    let said = |tags: &[String], request: &[u8]| {
        let mut simulator = Simulator::new(&plant(&format!("tag = [{}]", tags.join(", ")))).expect("no rig is named");
        simulator.respond(L1, 1, request)
    };
    let answer = |code, id, text: &[u8]| [&[0x2B, 0x0E, code, 0x83, 0, 0, 1, id, text.len() as u8], text].concat();
    assert_eq!(said(&tags, &[0x2B, 0x0E, 1, 0]), Some(answer(1, 2, b"2.10")));
    assert_eq!(said(&tags, &[0x2B, 0x0E, 3, 0x80]), Some(answer(3, 0x80, b"X")));
    assert_eq!(said(&tags[..1], &[0x2B, 0x0E, 1, 0]), Some(vec![0xAB, 1]), "no condition asks");
}
