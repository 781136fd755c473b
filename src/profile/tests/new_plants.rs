//! Plant files that are written from what was found on a line.

use std::sync::Arc;

use crate::{
    plant::{
        PlantDef,
        def::{LineDef, LineId, Transport},
        live::ReplyTimes,
        tag::TagDef,
    },
    profile::{
        OwnProfiles,
        new_plant::{NewDevice, NewPlant, of_interest},
    },
};

/// The plant file of a controller with this name of which these tags are kept, loaded again.
fn loaded(name: &str, kept: impl Fn(&[TagDef]) -> Vec<TagDef>) -> Arc<PlantDef> {
    written(&OwnProfiles::default(), "fuji_pxr", name, kept).1
}

/// The text of a plant file with a device of this profile, and the plant.
fn written(
    profiles: &OwnProfiles,
    profile: &str,
    name: &str,
    kept: impl Fn(&[TagDef]) -> Vec<TagDef>,
) -> (String, Arc<PlantDef>) {
    let profile = profiles.device(profile).unwrap();
    let tags = kept(&profile.tags);
    let device = NewDevice {
        name: name.to_owned(),
        line: 0,
        unit: 1,
        controller: !tags.is_empty() && profile.devices[0].faceplate.is_some(),
        profile: Some((profile.name.clone(), tags)),
        unpolled: Vec::new(),
        tags: Vec::new(),
    };
    let line = LineDef::new(LineId(0), "L1", Transport::tcp("127.0.0.1", 502));
    let plant = NewPlant {
        title: "New".to_owned(),
        time_zone: "UTC".to_owned(),
        lines: vec![(line, ReplyTimes::default())],
        devices: vec![device],
        alarms: Vec::new(),
        shifts: Vec::new(),
    };
    let text = plant.text(profiles).unwrap_or_else(|why| panic!("{why}"));
    let checked = profiles.check("new", &text).unwrap_or_else(|errors| panic!("{errors}"));
    (text, checked.plant)
}

#[test]
fn a_new_plant_with_long_names_or_nothing_to_show_loads() {
    for name in ["TIC-1", "temperature-controller-of-zone-1-of-kiln-2"] {
        assert_eq!(loaded(name, of_interest).mimic.pages.len(), 1, "{name}");
    }
    assert!(loaded("TIC-1", |_| Vec::new()).mimic.pages.is_empty(), "nothing to draw");
}

#[test]
fn names_on_the_picture_of_a_new_plant_differ() {
    let phase = |n: usize| {
        let short = format!("INVERTER_AMPS_OF_PHASE_{n}");
        format!(
            "    {{ name = \"{short}\", table = \"holding\", address = {n}, type = \"uint16\", unit = \"A\", poll = \"fast\" }},\n"
        )
    };
    let rows: String = (1..=4).map(phase).collect();
    let profile = format!("vendor = \"V\"\nmodel = \"M\"\nsource = \"test\"\nstatus = \"partial\"\ntag = [\n{rows}]\n");
    let profiles = OwnProfiles::of_text("long", &profile);
    for name in ["INV", "inverter-of-the-roof-1"] {
        let (text, plant) = written(&profiles, "long", name, of_interest);
        assert!(plant.mimic.pages[0].pictures[0].size.0 <= 80, "{text}");
        let (_, picture) = text.split_once("picture").unwrap();
        for n in 1..=4 {
            assert!(picture.contains(&format!(" INVERTER_AMPS_OF_PHASE_{n} {{")), "{text}");
        }
    }
}
