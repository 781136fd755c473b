//! A plant file that was changed while its station runs: what of the plant is as it was.

use std::collections::HashMap;

use super::{
    def::{DeviceDef, PlantDef},
    id::{DeviceId, LineId, ProcedureId, TagId},
    line::{LineDef, Transport},
    tag::TagDef,
};

impl PlantDef {
    /// Is a line in another definition what it is here, with its devices and tags and the ids of all of them? Then its task
    /// knows nothing that has changed.
    pub fn keeps_line(&self, other: &PlantDef, line: LineId) -> bool {
        let is_on = move |device: &&DeviceDef| device.line == line;
        let on_line = |def: &PlantDef, tag: &TagDef| def.device(tag.device).line == line;
        let (own, others) = (self.tags.iter(), other.tags.iter());
        self.lines.get(line.index()).is_some_and(|own| other.lines.get(line.index()) == Some(own))
            && self.devices.iter().filter(is_on).eq(other.devices.iter().filter(is_on))
            && own.filter(|tag| on_line(self, tag)).eq(others.filter(|tag| on_line(other, tag)))
    }

    /// What becomes of the lines under another definition, in words.
    pub fn changed_lines(&self, other: &PlantDef) -> String {
        let has = |def: &PlantDef, name: &str| def.lines.iter().any(|line| line.name == name);
        let became = |line: &LineDef| match (self.keeps_line(other, line.id), has(self, &line.name)) {
            (true, _) => "keeps running",
            (false, true) => "starts again",
            (false, false) => "starts",
        };
        let now = other.lines.iter().map(|line| format!("line {} {}", line.name, became(line)));
        let gone = self.lines.iter().filter(|line| !has(other, &line.name));
        let words: Vec<String> = now.chain(gone.map(|line| format!("line {} ends", line.name))).collect();
        words.join(", ")
    }

    /// Does every id of a line, device or tag stand for what it stands for here, so that others who use them need not know of
    /// the other definition?
    pub fn keeps_ids(&self, other: &PlantDef) -> bool {
        let tag = |tag: &TagDef| (tag.name.clone(), tag.unit.clone());
        self.lines.iter().map(|line| &line.name).eq(other.lines.iter().map(|line| &line.name))
            && self.devices.iter().map(|device| &device.name).eq(other.devices.iter().map(|device| &device.name))
            && self.tags.iter().map(tag).eq(other.tags.iter().map(tag))
    }

    /// Does a procedure go on under another definition? What it writes is on lines that keep running, and it is what it was.
    pub fn keeps_procedure(&self, other: &PlantDef, id: ProcedureId) -> bool {
        let own = self.procedure(id);
        let mut lines = own.writes().map(|(tag, _)| self.device(self.tag(tag).device).line);
        self.keeps_ids(other)
            && other.procedures.get(id.index()) == Some(own)
            && lines.all(|line| self.keeps_line(other, line))
    }
}

/// What a definition has of the one before it, by its own ids.
pub struct Redefinition {
    /// The lines that keep running.
    lines: Vec<bool>,
    /// The devices that are asked where they were, each with its id of before.
    devices: Vec<Option<DeviceId>>,
    /// The tags of the same names, each with its id of before.
    tags: Vec<Option<TagId>>,
    /// Of these, those whose registers are the same, or whose calculation is.
    same_source: Vec<bool>,
}

impl Redefinition {
    /// Of `def` after `before`; `transport` is how a line of before is connected, whatever its plant file says.
    pub fn new<'a>(before: &'a PlantDef, def: &PlantDef, transport: impl Fn(LineId) -> &'a Transport) -> Redefinition {
        let lines: Vec<bool> = def.lines.iter().map(|line| before.keeps_line(def, line.id)).collect();
        let named: HashMap<&str, &DeviceDef> =
            before.devices.iter().map(|device| (device.name.as_str(), device)).collect();
        let same_device = |device: &DeviceDef| {
            let was = named.get(device.name.as_str())?;
            let same_place = was.unit == device.unit && *transport(was.line) == def.line(device.line).transport;
            (lines[device.line.index()] || same_place).then_some(was.id)
        };
        let devices: Vec<Option<DeviceId>> = def.devices.iter().map(same_device).collect();
        let named: HashMap<&str, TagId> = before.tags.iter().map(|tag| (tag.name.as_str(), tag.id)).collect();
        let tags: Vec<Option<TagId>> = def.tags.iter().map(|tag| named.get(tag.name.as_str()).copied()).collect();
        let same_source = def.tags.iter().zip(&tags).map(|(tag, was)| {
            let Some(was) = was.map(|was| before.tag(was)) else { return false };
            match (&tag.calculation, &was.calculation) {
                (Some(own), Some(was)) => (&own.text, own.over_time) == (&was.text, was.over_time),
                (None, None) => tag.point == was.point && devices[tag.device.index()] == Some(was.device),
                (Some(_), None) | (None, Some(_)) => false,
            }
        });
        Redefinition { same_source: same_source.collect(), lines, devices, tags }
    }

    /// Does this line keep running?
    pub fn keeps_line(&self, line: LineId) -> bool {
        self.lines.get(line.index()).is_some_and(|keeps| *keeps)
    }

    /// The device of before, if it is asked where it was.
    pub fn device(&self, id: DeviceId) -> Option<DeviceId> {
        self.devices[id.index()]
    }

    /// The tag of before with the same name.
    pub fn named(&self, id: TagId) -> Option<TagId> {
        self.tags[id.index()]
    }

    /// The tag of before that had its value from the same registers of the same device, or by the same calculation.
    pub fn source(&self, id: TagId) -> Option<TagId> {
        self.tags[id.index()].filter(|_| self.same_source[id.index()])
    }
}
