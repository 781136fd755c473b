//! Where a thing of the plant is, whatever it is called: what proves that two plant files mean the same by two names.

use std::collections::{HashMap, HashSet};

use super::{
    alarm_def::Subject,
    def::{DeviceDef, LineDef, PlantDef, Transport},
    tag::{Point, TagDef},
};

/// The port or endpoint of a line.
fn of_line(line: &LineDef) -> String {
    match &line.transport {
        Transport::Serial { port, .. } => port.clone(),
        Transport::Network { host, port, .. } => format!("{host} {port}"),
    }
}

/// Line and unit of a device.
fn of_unit(def: &PlantDef, device: &DeviceDef) -> String {
    format!("{} unit {}", of_line(def.line(device.line)), device.unit)
}

/// Line, unit and profile of a device: another model at this address is another device.
pub(super) fn of_device(def: &PlantDef, device: &DeviceDef) -> String {
    format!("{} {}", of_unit(def, device), device.profile)
}

/// Line, unit and register of a tag; of one that is calculated, its text instead of the register.
pub(super) fn of_tag(def: &PlantDef, tag: &TagDef) -> String {
    let unit = of_unit(def, def.device(tag.device));
    let Point { table, address, kind, order, field } = tag.point;
    match &tag.calculation {
        Some(calculation) => format!("{unit} {} {:?}", calculation.text, calculation.over_time),
        None => format!("{unit} {} {kind} {order:?} {field:?}", table.modicon(address)),
    }
}

/// Of what an alarm watches.
pub(super) fn of_subject(def: &PlantDef, subject: Subject) -> String {
    match subject {
        Subject::Tag(tag) => of_tag(def, def.tag(tag)),
        Subject::Device(device) => of_device(def, def.device(device)),
        Subject::Line(line) => of_line(def.line(line)),
        Subject::Station => super::station_fault::STATION.to_owned(),
    }
}

/// What each thing of a plant file was in the one before, by names and places: what was called so, else what was where it is.
/// The latter where it is certain: nothing else is or was there, and what was there is called so no more.
pub(super) fn predecessors(before: &[(&str, String)], now: &[(&str, String)]) -> Vec<Option<usize>> {
    let named: HashMap<&str, usize> = before.iter().enumerate().map(|(number, (name, _))| (*name, number)).collect();
    let names: HashSet<&str> = now.iter().map(|(name, _)| *name).collect();
    let (placed, places) = (by_place(before), by_place(now));
    let was_there = |place: &str| match (placed.get(place)?.as_slice(), places.get(place)?.as_slice()) {
        ([was], [_]) => Some(*was).filter(|was| !names.contains(before[*was].0)),
        _ => None,
    };
    now.iter().map(|(name, place)| named.get(name).copied().or_else(|| was_there(place))).collect()
}

fn by_place<'a>(things: &'a [(&str, String)]) -> HashMap<&'a str, Vec<usize>> {
    let mut places: HashMap<&str, Vec<usize>> = HashMap::new();
    for (number, (_, place)) in things.iter().enumerate() {
        places.entry(place).or_default().push(number);
    }
    places
}
