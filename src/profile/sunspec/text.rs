//! The device profile of a SunSpec device, as text: its models as groups, their points as tags, their events as alarms.

use std::{collections::BTreeMap, fmt::Write};

use toml_edit::Value;

use super::{
    FoundModel, SunSpecDevice,
    models::{Count, Group, Kind, ModelPoint, model},
    poll::{NEVER, poll_of},
};
use crate::{
    plant::{def::READ_REGISTERS_MAX, tag::Decimals, text_value},
    profile::tag_text::quoted,
};

/// Most tags of a profile; the rest is left out, and its notes say so.
const TAGS_MAX: usize = 4_000;
/// Most registers of models that are not known.
const UNKNOWN_MAX: u32 = 250;
/// The text of a profile that is all that this device has.
pub(crate) fn profile_text(device: &SunSpecDevice) -> String {
    let mut rows = Rows::default();
    let mut listed: Vec<String> = Vec::new();
    for found in &device.models {
        let name = rows.model(found);
        listed.push(format!("{} {name} ({} registers)", found.id, found.length));
    }
    rows.text(device, &listed).unwrap_or_default()
}

/// Tags and alarms so far.
#[derive(Default)]
struct Rows {
    tags: String,
    count: usize,
    left_out: usize,
    missing: usize,
    unknown: u32,
    /// The tags of events with named bits.
    events: Vec<String>,
    /// Groups that have something to write.
    writable: Vec<String>,
    /// How often a device has models of one name.
    names: BTreeMap<String, usize>,
}

/// Where a group of a model stands, and what its points need of those around it.
#[derive(Clone)]
pub(super) struct Place<'a> {
    pub found: &'a FoundModel,
    /// Of all its tags: `mppt`.
    model: &'a str,
    /// `mppt.module.1`.
    path: String,
    /// Powers of ten and counts around it, by name: their tags and addresses.
    pub known: BTreeMap<&'static str, (String, u32)>,
}

impl Rows {
    /// The tags of a model; gives its name.
    fn model(&mut self, found: &FoundModel) -> String {
        let known = model(found.id);
        let stem = known.as_ref().map_or_else(|| format!("model_{}", found.id), |group| short(group.name).to_owned());
        let count = self.names.entry(stem.clone()).or_default();
        *count += 1;
        let name = if *count == 1 { stem } else { format!("{stem}-{count}") };
        let place = Place { found, model: &name, path: name.clone(), known: BTreeMap::new() };
        match known {
            Some(group) => {
                self.group(&group, found.address.into(), &place);
                name
            }
            None => {
                self.raw(&place);
                format!("{name}, not known")
            }
        }
    }

    /// The words of a model of which nothing is known.
    fn raw(&mut self, place: &Place) {
        for address in u32::from(place.found.address)..place.found.end() {
            if self.unknown == UNKNOWN_MAX {
                self.left_out += 1;
                continue;
            }
            self.unknown += 1;
            let name = format!("{}.{}", place.path, address - u32::from(place.found.address));
            self.row(place, &name, address, "uint16", &["bad_if = []".to_owned()]);
        }
    }

    /// The tags of a group at an address; gives the address behind it. What is beyond the length of the model is left out.
    fn group(&mut self, group: &Group, at: u32, place: &Place) -> u32 {
        let mut place = place.clone();
        let mut next = at;
        for point in &group.points {
            let end = next + u32::from(point.registers);
            if end <= place.found.end() {
                place.known.insert(point.name, (format!("{}.{}", place.path, point.name), next));
            }
            next = end;
        }
        next = at;
        for point in &group.points {
            let end = next + u32::from(point.registers);
            if end <= place.found.end() {
                self.point(point, next, &place);
            }
            next = end;
        }
        for part in &group.groups {
            let times = place.times(part, next);
            for n in 1..=times {
                if place.found.end() <= next {
                    break;
                }
                let path = match part.count {
                    Count::Once => format!("{}.{}", place.path, part.name),
                    Count::Times(_) | Count::From(_) | Count::Fill => format!("{}.{}.{n}", place.path, part.name),
                };
                next = self.group(part, next, &Place { path, ..place.clone() });
            }
        }
        next
    }

    fn point(&mut self, point: &ModelPoint, address: u32, place: &Place) {
        let name = format!("{}.{}", place.path, point.name);
        let mut keys = Vec::new();
        let kind = match point.kind {
            Kind::Pad => return,
            Kind::Text => format!("cstring({})", 2 * point.registers.min(READ_REGISTERS_MAX)),
            Kind::Power => "int16".to_owned(),
            Kind::Address(address) => address.word().to_owned(),
            Kind::Number(kind) | Kind::NotZero(kind) | Kind::Enum(kind) | Kind::Bits(kind) => kind.to_string(),
        };
        if let Kind::NotZero(_) = point.kind {
            keys.push("bad_if = [0]".to_owned());
        }
        match (point.scale.parse::<i32>(), place.known.get(point.scale)) {
            (Ok(power), _) => {
                keys.push(format!("scale = {}", Value::from(power_of_ten(power)).to_string().trim()));
                keys.push(format!("decimals = {}", 0.max(-power).min(i32::from(Decimals::MAX))));
            }
            (Err(_), Some((power, _))) => keys.push(format!("scale_from = {}", quoted(power))),
            // Its power of ten is beyond the length of the model: it has no value.
            (Err(_), None) if !point.scale.is_empty() => return,
            (Err(_), None) => {}
        }
        keys.extend((!point.label.is_empty()).then(|| format!("label = {}", quoted(point.label))));
        keys.extend(
            (!point.unit.is_empty() && !point.kind.is_text()).then(|| format!("unit = {}", quoted(point.unit))),
        );
        keys.extend(self.symbols(point, &name));
        let poll = poll_of(point, address, place);
        self.missing += usize::from(poll == Some(NEVER));
        let fits = point.registers <= text_value::WRITE_MAX;
        if point.is_writable && fits && poll != Some(NEVER) {
            keys.push("access = \"rw\"".to_owned());
            if self.writable.last().map(String::as_str) != Some(place.model) {
                self.writable.push(place.model.to_owned());
            }
        }
        keys.extend(poll.map(|poll| format!("poll = {}", quoted(poll))));
        self.row(place, &name, address, &kind, &keys);
    }

    /// The names of numbers or bits; of events, each bit has an alarm.
    fn symbols(&mut self, point: &ModelPoint, name: &str) -> Option<String> {
        if point.symbols.is_empty() {
            return None;
        }
        let rows = point.symbols.iter().map(|(number, symbol)| format!("{number} = {}", quoted(symbol)));
        let rows = rows.collect::<Vec<_>>().join(", ");
        match point.kind {
            Kind::Enum(_) => Some(format!("enum = {{ {rows} }}")),
            Kind::Bits(_) => {
                let is_event = ["Evt", "Alrm", "Alm"].iter().any(|word| point.name.contains(word));
                if is_event && self.count < TAGS_MAX {
                    let reserved = point.symbols.iter().filter(|(_, symbol)| symbol.contains("RESERVED"));
                    let reserved: Vec<String> = reserved.map(|(bit, _)| bit.to_string()).collect();
                    let tag = quoted(name);
                    self.events.push(format!(
                        "[[alarm]]\ntag = {tag}\neach = \"bit\"\nexcept = [{}]\nid = {tag}\npriority = \"medium\"\n",
                        reserved.join(", ")
                    ));
                }
                Some(format!("bits = {{ {rows} }}"))
            }
            Kind::Number(_) | Kind::NotZero(_) | Kind::Power | Kind::Text | Kind::Address(_) | Kind::Pad => None,
        }
    }

    fn row(&mut self, place: &Place, name: &str, address: u32, kind: &str, keys: &[String]) {
        if self.count == TAGS_MAX {
            self.left_out += 1;
            return;
        }
        self.count += 1;
        let head = format!(
            "name = {}, group = {}, address = {address}, type = {}",
            quoted(name),
            quoted(place.model),
            quoted(kind)
        );
        let keys: Vec<&str> = std::iter::once(head.as_str()).chain(keys.iter().map(String::as_str)).collect();
        self.tags += &format!("    {{ {} }},\n", keys.join(", "));
    }

    fn text(&self, device: &SunSpecDevice, listed: &[String]) -> Result<String, std::fmt::Error> {
        let mut out = String::new();
        let [vendor, model, revision] = device.identity();
        let or = |text: String, other: &str| if text.is_empty() { other.to_owned() } else { text };
        writeln!(
            out,
            "# Made by sightglass from the SunSpec models of the device itself. The models are facts of SunSpec Alliance,"
        )?;
        writeln!(out, "# Apache License 2.0.\n")?;
        writeln!(out, "vendor = {}\nmodel = {}", quoted(&or(vendor, "SunSpec")), quoted(&or(model, "device")))?;
        if !revision.is_empty() {
            writeln!(out, "revision = {}", quoted(&revision))?;
        }
        let mut notes = format!("Models: {}.", listed.join(", "));
        if device.is_cut {
            notes += " Not all could be read: there may be more.";
        }
        if 0 < self.missing {
            notes += &format!(" Values not implemented, and not polled: {}.", self.missing);
        }
        if 0 < self.left_out {
            notes += &format!(" Values left out, because a profile holds no more: {}.", self.left_out);
        }
        writeln!(
            out,
            "status = \"manual\"\nsource = \"SunSpec models, from {} {} on\"",
            device.table.word(),
            device.base
        )?;
        writeln!(out, "notes = {}\naddress_base = 0\n", quoted(&notes))?;
        writeln!(out, "tag = [\n{}]\n", self.tags)?;
        // The marker of a type stands where a point is not implemented.
        writeln!(out, "[default]\ntable = {}\nbad_if = \"sunspec\"\n", quoted(device.table.word()))?;
        if !self.writable.is_empty() {
            writeln!(out, "[roles]")?;
            self.writable.iter().try_for_each(|group| writeln!(out, "{} = \"supervisor\"", quoted(group)))?;
            writeln!(out)?;
        }
        self.events.iter().try_for_each(|event| writeln!(out, "{event}"))?;
        Ok(out)
    }
}

impl Place<'_> {
    /// How often a part stands at an address.
    fn times(&self, part: &Group, at: u32) -> u32 {
        match part.count {
            Count::Once => 1,
            Count::Times(times) => times.into(),
            Count::From(name) => self.number(name),
            // A part is as long as the first of them.
            Count::Fill => self.found.end().saturating_sub(at) / self.registers_of(part).max(1),
        }
    }

    /// Registers of a group with all within it.
    fn registers_of(&self, group: &Group) -> u32 {
        let points: u32 = group.points.iter().map(|point| u32::from(point.registers)).sum();
        let parts = group.groups.iter().map(|part| match part.count {
            Count::Once => self.registers_of(part),
            Count::Times(times) => u32::from(times) * self.registers_of(part),
            Count::From(name) => self.number(name).saturating_mul(self.registers_of(part)),
            Count::Fill => 0,
        });
        parts.fold(points, u32::saturating_add)
    }

    /// What a count holds; 0 where it is not implemented, or was not read.
    fn number(&self, name: &str) -> u32 {
        let word = self.known.get(name).and_then(|(_, address)| self.found.word(*address));
        word.filter(|word| *word != u16::MAX).map_or(0, u32::from)
    }
}

/// A name that leaves room for those of its points.
fn short(name: &str) -> &str {
    match name {
        _ if name.starts_with("inverter_") => "inverter",
        _ if name.starts_with("ac_meter_") => "meter",
        _ => name,
    }
}

/// As a person would write it: 0.1, not the nearest to it.
fn power_of_ten(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(1.0)
}
