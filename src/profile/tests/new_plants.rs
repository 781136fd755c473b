//! Plant files that are written from what was found on a line.

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
fn loaded(name: &str, kept: impl Fn(&[TagDef]) -> Vec<TagDef>) -> std::sync::Arc<PlantDef> {
    let profiles = OwnProfiles::default();
    let profile = profiles.device("fuji_pxr").unwrap();
    let tags = kept(&profile.tags);
    let device = NewDevice {
        name: name.to_owned(),
        line: 0,
        unit: 1,
        controller: !tags.is_empty(),
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
    let text = plant.text(&profiles).unwrap_or_else(|why| panic!("{why}"));
    profiles.check("new", &text).unwrap_or_else(|errors| panic!("{errors}")).plant
}

#[test]
fn a_new_plant_with_long_names_or_nothing_to_show_loads() {
    for name in ["TIC-1", "temperature-controller-of-zone-1-of-kiln-2"] {
        assert_eq!(loaded(name, of_interest).mimic.pages.len(), 1, "{name}");
    }
    assert!(loaded("TIC-1", |_| Vec::new()).mimic.pages.is_empty(), "nothing to draw");
}
