//! Every model that comes with the program becomes a profile, with its points where they stand.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use super::{
    models::{Count, Group, Kind, ids, model},
    *,
};
use crate::{
    plant::{
        PlantDef,
        def::{Condition, Subject},
        exact::Exact,
        tag::{Access, DataType, Decimals, TagDef},
    },
    profile::OwnProfiles,
};

/// A device with these models, all of whose registers hold a number.
fn device(models: &[(u16, u16)], word: u16) -> SunSpecDevice {
    let mut address = 40_002;
    let mut one = |(id, length): &(u16, u16)| {
        let found =
            FoundModel { id: *id, address: address + 2, length: *length, words: vec![Some(word); (*length).into()] };
        address += 2 + length;
        found
    };
    let models = models.iter().map(&mut one).collect();
    SunSpecDevice { table: Table::Holding, base: 40_000, models, is_cut: false }
}

/// The profile of a device, which loads without a warning but for what its alarms do not say.
fn profile(device: &SunSpecDevice) -> Arc<PlantDef> {
    let mut profiles = OwnProfiles::default();
    let text = profile_text(device);
    profiles.add("made", &text);
    profiles.device("made").unwrap_or_else(|| {
        let plant = "title='a'\ntime_zone='UTC'\n[[line]]\nname='L'\nmode='tcp'\nhost='h'\n\
                     [[device]]\nname='D'\nprofile='made'\nline='L'\nunit=1\n";
        panic!("{}\n{text}", profiles.check("p", plant).unwrap_err())
    })
}

fn tag<'a>(def: &'a PlantDef, short: &str) -> &'a TagDef {
    def.tags.iter().find(|tag| tag.short == short).unwrap_or_else(|| {
        let names: Vec<&str> = def.tags.iter().map(|tag| tag.short.as_str()).collect();
        panic!("no {short} in {names:?}")
    })
}

/// Registers of a model with `n` of each part that repeats, and its points that make a tag.
fn extent(group: &Group, n: u16) -> (u16, usize) {
    let mut registers: u16 = group.points.iter().map(|point| point.registers).sum();
    let tags = |kind: Kind| match kind {
        Kind::Pad => 0,
        _ => 1,
    };
    let mut points = group.points.iter().map(|point| tags(point.kind)).sum();
    for part in &group.groups {
        let (length, count) = extent(part, n);
        let times = match part.count {
            Count::Once => 1,
            Count::Times(times) => times,
            Count::From(_) | Count::Fill => n,
        };
        registers += times * length;
        points += usize::from(times) * count;
    }
    (registers, points)
}

#[test]
fn every_model_becomes_a_profile_with_all_its_points() {
    let ids = ids();
    assert_eq!(ids.len(), 112);
    for id in ids {
        let group = model(id).unwrap();
        let (registers, points) = extent(&group, 2);
        let def = profile(&device(&[(id, registers)], 2));
        assert_eq!(def.tags.len(), points, "model {id}");
        let last = def.tags.iter().map(|tag| tag.point.address + tag.point.len()).max().unwrap();
        assert!(last <= 40_004 + registers, "model {id}");
    }
}

#[test]
fn a_model_gives_names_places_factors_states_and_alarms() {
    let def = profile(&device(&[(1, 66), (103, 50), (160, 48)], 2));
    let check = |name: &str, address: u16, kind: DataType| {
        let point = tag(&def, name).point;
        assert_eq!((point.table, point.address, point.kind), (Table::Holding, address, kind), "{name}");
    };
    check("common.Mn", 40_004, DataType::TextToNul(32));
    check("inverter.A", 40_072, DataType::U16);
    check("inverter.W", 40_084, DataType::I16);
    check("inverter.WH", 40_094, DataType::U32);
    check("inverter.St", 40_108, DataType::U16);
    check("mppt.module.1.DCA", 40_141, DataType::U16);
    check("mppt.module.2.DCA", 40_161, DataType::U16);
    let power = tag(&def, "inverter.W_SF").id;
    let power_of_dc = tag(&def, "mppt.DCA_SF").id;
    assert_eq!(tag(&def, "inverter.W").decimals, Decimals::PowerFrom(power));
    assert_eq!(tag(&def, "mppt.module.2.DCA").decimals, Decimals::PowerFrom(power_of_dc), "a factor of the fixed part");
    assert_eq!(tag(&def, "inverter.W").unit, "W");
    assert_eq!(tag(&def, "inverter.St").label_of(4.0), Some("MPPT"));
    assert_eq!(tag(&def, "inverter.W").group, "inverter");
    assert!(
        tag(&def, "inverter.W").is_bad(Exact::whole(-32_768)) && tag(&def, "inverter.St").is_bad(Exact::whole(65_535))
    );
    assert!(
        tag(&def, "inverter.WH").is_bad(Exact::whole(0))
            && !tag(&def, "inverter.WH").is_bad(Exact::whole(4_294_967_295))
    );
    let ground = def
        .alarms
        .iter()
        .find(|alarm| alarm.message == "GROUND_FAULT" && alarm.subject == Subject::Tag(tag(&def, "inverter.Evt1").id))
        .unwrap();
    assert_eq!(ground.condition, Condition::Bit { bit: 0 });
    assert!(def.alarms.iter().all(|alarm| !alarm.message.contains("RESERVED")));
}

#[test]
fn what_the_model_permits_is_written_by_a_supervisor() {
    let def = profile(&device(&[(123, 24)], 2));
    let (limit, power) = (tag(&def, "controls.WMaxLimPct"), tag(&def, "controls.WMaxLimPct_SF"));
    assert_eq!((limit.access, power.access), (Access::ReadWrite, Access::Read));
    assert_eq!(limit.role, crate::plant::def::Role::Supervisor);
}

#[test]
fn what_lies_beyond_the_stated_length_is_left_out() {
    // The older common model is without its last register, an old inverter without its events.
    let def = profile(&device(&[(1, 65), (103, 38)], 2));
    let names: Vec<&str> = def.tags.iter().map(|tag| tag.short.as_str()).collect();
    assert!(names.contains(&"inverter.StVnd") && !names.contains(&"inverter.Evt1"), "{names:?}");
    let cut = profile(&device(&[(103, 4)], 2));
    let names: Vec<&str> = cut.tags.iter().map(|tag| tag.short.as_str()).collect();
    assert!(names.is_empty(), "without its factor a value is none: {names:?}");
}

#[test]
fn a_model_that_is_not_known_is_raw_words() {
    let found = device(&[(64_999, 3), (103, 50), (103, 50)], 7);
    let def = profile(&found);
    assert_eq!(tag(&def, "model_64999.2").point.address, 40_006);
    assert!(!tag(&def, "model_64999.2").is_bad(Exact::whole(65_535)), "nothing is known of it");
    assert_eq!(tag(&def, "inverter-2.A").point.address, 40_061);
    assert!(profile_text(&found).contains("64999 model_64999, not known (3 registers)"));
}

#[test]
fn a_count_that_was_not_read_gives_no_part() {
    let mut found = device(&[(705, 65)], 2);
    assert!(tag(&profile(&found), "DERVoltVar.Crv.2.Pt.2.Var").point.address < 40_069);
    found.models[0].words = vec![None; 65];
    assert!(!profile(&found).tags.iter().any(|tag| tag.short.contains("Crv.")));
    found.models[0].words = vec![Some(u16::MAX); 65];
    assert!(!profile(&found).tags.iter().any(|tag| tag.short.contains("Crv.")));
}

#[test]
fn a_hostile_device_makes_a_bounded_profile() {
    let whole = device(&[(64_998, 16_000), (160, 16_000)], 2);
    let def = profile(&whole);
    assert!(def.tags.len() <= 4_000 && profile_text(&whole).contains("left out"), "{}", def.tags.len());
    let mut odd = device(&[(1, 66)], 0x2241);
    odd.models[0].words[0] = Some(0x0A0D);
    assert_eq!(odd.identity()[0].chars().filter(|c| c.is_control()).count(), 0);
    profile(&odd);
}

#[test]
fn an_optional_counter_that_stands_at_0_is_polled() {
    let found = device(&[(103, 50), (203, 105)], 0);
    let def = profile(&found);
    for name in ["inverter.WH", "meter.TotWhExp", "meter.TotVAhImpPhA"] {
        assert_ne!(tag(&def, name).poll, crate::plant::tag::Poll::Never, "{name}");
    }
    assert!(!profile_text(&found).contains("not polled"), "{}", profile_text(&found));
}
