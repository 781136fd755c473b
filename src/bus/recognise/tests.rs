//! Every shipped signature against its own simulated device, against those of the others, and against slaves of no kind.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::{
    plant::{id::LineId, tag::Table},
    profile::{OwnProfiles, Search},
    sim::simulator::Simulator,
};

/// What a simulated unit answers; nothing where it refuses.
fn read(simulator: &mut Simulator, unit: u8, span: AddressSpan) -> Vec<u16> {
    let [high, low] = span.address.to_be_bytes();
    let pdu = [span.table.read_fc(), high, low, 0, u8::try_from(span.count).unwrap()];
    let reply = simulator.respond(LineId(0), unit, &pdu).unwrap_or_default();
    match reply.split_first() {
        Some((function, bytes)) if *function == span.table.read_fc() && span.table.is_bits() => {
            (0..usize::from(span.count)).map(|bit| u16::from(bytes[1 + bit / 8] >> (bit % 8) & 1)).collect()
        }
        Some((function, bytes)) if *function == span.table.read_fc() => {
            bytes[1..].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
        }
        _ => Vec::new(),
    }
}

/// The profile that a simulated unit is taken for.
fn recognised(plant: &PlantDef, unit: u8) -> Option<(String, Fit)> {
    let mut simulator = Simulator::new(plant).unwrap();
    simulator.advance(std::time::Duration::from_secs(5));
    let simulator = std::cell::RefCell::new(simulator);
    let known = OwnProfiles::default().recognisable();
    let found = best(&known, &|span| read(&mut simulator.borrow_mut(), unit, span));
    found.map(|(def, fit)| (def.name.clone(), fit))
}

#[test]
fn every_simulated_device_is_recognised_as_itself() {
    let known = OwnProfiles::default().recognisable();
    assert!(7 <= known.len(), "{}", known.len());
    for def in &known {
        let found = recognised(def, 1);
        assert_eq!(found.as_ref().map(|(name, _)| name), Some(&def.name), "{found:?}");
    }
}

#[test]
fn the_devices_of_the_tank_are_recognised() {
    let tank = crate::profile::load(std::path::Path::new("tank"), &Search::shipped()).unwrap();
    for device in &tank.devices {
        let found = recognised(&tank, device.unit);
        assert_eq!(found.as_ref().map(|(name, _)| name), Some(&device.profile), "{found:?}");
    }
}

#[test]
fn slaves_of_no_kind_are_not_recognised() {
    let known = OwnProfiles::default().recognisable();
    let check = |what: &str, word: &dyn Fn(Table, u16) -> Option<u16>| {
        let words = |span: AddressSpan| -> Vec<u16> {
            span.range().map_while(|address| word(span.table, to_u16(address))).collect()
        };
        let found = best(&known, &words).map(|(def, fit)| (def.name.clone(), fit));
        assert_eq!(found, None, "{what}");
    };
    let bit = |table: Table, word: u16| if table.is_bits() { word & 1 } else { word };
    check("all zero", &|_, _| Some(0));
    check("all one", &|_, _| Some(1));
    check("all ones", &|table, _| Some(bit(table, u16::MAX)));
    check("nothing there", &|_, _| None);
    check("its address", &|table, address| Some(bit(table, address)));
    check("its address by ten", &|table, address| Some(bit(table, address % 10)));
    check("its address by a hundred", &|table, address| Some(bit(table, address % 100)));
    check("holding registers only", &|table, address| (table == Table::Holding).then_some(address % 7));
    for seed in 1..200u64 {
        let noise = |table: Table, address: u16| {
            let mixed = (u64::from(address) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_mul(2 * seed + 1);
            Some(bit(table, (mixed >> 40 & 0xFFFF) as u16))
        };
        check("noise", &noise);
        check("small noise", &|table, address| noise(table, address).map(|word| bit(table, word % 50)));
    }
}

#[test]
fn decimals_and_unit_are_those_that_the_device_says() {
    let known = OwnProfiles::default().recognisable();
    let pxr = known.iter().find(|def| def.name == "fuji_pxr").unwrap();
    let sv = pxr.tags.iter().find(|tag| tag.short == "SV").unwrap();
    let device = |decimals: u16, unit: u16| {
        scaling(pxr, sv, &|span| match span.address {
            1019 => vec![decimals],
            1016 => vec![unit],
            _ => Vec::new(),
        })
    };
    assert_eq!(device(1, 0), Some((1, "°C".to_owned())));
    assert_eq!(device(0, 1), Some((0, "°F".to_owned())));
    assert_eq!((device(40, 0), device(1, 7)), (None, None), "it says nothing of use");
    assert_eq!(scaling(pxr, sv, &|_| Vec::new()), None, "it was not read");
}

#[test]
fn a_power_of_ten_scales_as_its_own_tag_says() {
    let text = "vendor = \"a\"\nmodel = \"b\"\nstatus = \"manual\"\nsource = \"c\"\n\
        tag = [{ name = \"W\", table = \"holding\", address = 0, type = \"int16\", unit = \"W\", decimals_from = \"SF\" },\n\
        { name = \"SF\", table = \"holding\", address = 1, type = \"int16\", scale = -1 }]\n\
        [signature]\nprobe = [{ tag = \"W\", range = [0, 9] }, { tag = \"W\", is = [1] }, { tag = \"SF\", is = [2] }]\n";
    let known = OwnProfiles::of_text("sun", text).recognisable();
    let def = known.iter().find(|def| def.name == "sun").expect("it is recognisable");
    let scaled = |exponent: i16| scaling(def, &def.tags[0], &|_| vec![exponent.cast_unsigned()]);
    assert_eq!(scaled(-1), Some((1, "W".to_owned())));
    assert_eq!(scaled(1), None, "411 would be shown as 41.1 where 4110 is meant");
}
