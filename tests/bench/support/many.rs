//! A plant of many tags: devices with [`TAGS_EACH`] registers each.

use std::{path::Path, sync::Arc, time::Duration};

use sightglass::api::{
    plant::{ByteOrder, DataType, DeviceDef, DeviceId, LineDef, LineId, PlantDef, Point, Poll, Table, TagDef, TagId},
    profile::{self, Search},
};

/// Tags of a device.
pub const TAGS_EACH: u16 = 100;

/// The tags of a device.
pub fn tags_of(device: u16) -> impl Iterator<Item = TagId> {
    (device * TAGS_EACH..(device + 1) * TAGS_EACH).map(TagId)
}

/// So many devices on so many lines, without alarms, mimic and trends.
pub fn plant(devices: u16, lines: u16) -> Arc<PlantDef> {
    let base = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let mut def = PlantDef::clone(&base);
    let (device, line) = (def.devices[0].clone(), def.lines[0].clone());
    def.lines = (0..lines).map(|id| LineDef { id: LineId(id), name: format!("L{id}"), ..line.clone() }).collect();
    def.alarms.clear();
    def.batches.clear();
    def.devices.clear();
    def.tags.clear();
    def.trends.clear();
    (def.logic, def.mimic) = (Default::default(), Default::default());
    for id in 0..devices {
        let name = format!("D{id}");
        let (id, unit) = (DeviceId(id), id as u8 + 1);
        def.devices.push(DeviceDef {
            id,
            line: LineId(id.0 % lines),
            name: name.clone(),
            unit,
            faceplate: None,
            actions: Vec::new(),
            program: None,
            signature: Vec::new(),
            ..device.clone()
        });
        for (address, tag) in tags_of(id.0).enumerate() {
            let point = Point {
                table: Table::Holding,
                address: address as u16,
                kind: DataType::U16,
                order: ByteOrder::Abcd,
                field: None,
            };
            let poll = Poll::Every(Duration::from_secs(1));
            def.tags.push(TagDef { poll, ..TagDef::new(tag, id, &format!("{name}.R{address}"), point) });
        }
    }
    Arc::new(def)
}
