//! A plant file that was changed while its station runs: what of the plant is as it was.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use super::{
    def::{DeviceDef, PlantDef, ProcedureDef},
    id::{DeviceId, LineId, ProcedureId, TagId},
    line::{LineDef, Transport},
    number::to_u16,
    place,
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

    /// The line here whose port a line of another definition goes on with: nothing of the line itself is other. One that only
    /// listens starts again.
    pub fn same_port(&self, other: &PlantDef, line: LineId) -> Option<LineId> {
        let now = other.line(line);
        let was = self.lines.iter().find(|was| was.name == now.name)?;
        (!now.listens && *was == LineDef { id: was.id, ..now.clone() }).then_some(was.id)
    }

    /// What becomes of the lines under another definition, in words.
    pub fn changed_lines(&self, other: &PlantDef) -> String {
        let has = |def: &PlantDef, name: &str| def.lines.iter().any(|line| line.name == name);
        let became = |line: &LineDef| {
            let port = self.same_port(other, line.id);
            let is_whole = port.is_some_and(|was| Renamed::new((self, was), (other, line.id)).is_whole);
            match (self.keeps_line(other, line.id) || is_whole, port, has(self, &line.name)) {
                (true, ..) => "keeps running",
                (false, Some(_), _) => "keeps its connection",
                (false, None, true) => "starts again",
                (false, None, false) => "starts",
            }
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

    /// The procedure here that each of another definition goes on as: of the same name, else for certain the one that does the
    /// same to the same tags.
    pub fn procedures_before(&self, other: &PlantDef) -> Vec<Option<ProcedureId>> {
        let was = place::predecessors(&placed_procedures(self), &placed_procedures(other));
        was.into_iter().map(|was| was.map(|was| ProcedureId(to_u16(was)))).collect()
    }
}

/// The ids of what is asked of a line as it was under another definition: of then, and of now.
#[derive(Debug, Default)]
pub struct Renamed {
    devices: HashMap<DeviceId, DeviceId>,
    tags: HashMap<TagId, TagId>,
    /// Nothing that is asked of the line is other.
    is_whole: bool,
}

impl Renamed {
    /// Of a line of `before` that is a line of `def`.
    pub fn new((before, was): (&PlantDef, LineId), (def, line): (&PlantDef, LineId)) -> Renamed {
        let (own, others) = (devices_on(before, was), devices_on(def, line));
        let same_device = |was: &&DeviceDef| {
            let now = others.iter().find(|now| now.name == was.name)?;
            now.is_asked_as(was).then_some((was.id, now.id))
        };
        let devices: HashMap<DeviceId, DeviceId> = own.iter().filter_map(same_device).collect();
        let (own_tags, other_tags) = (tags_on(before, was), tags_on(def, line));
        let same_tag = |was: &TagDef| {
            let now = *other_tags.get(was.name.as_str())?;
            (devices.get(&was.device) == Some(&now.device) && now.point == was.point).then_some((was.id, now.id))
        };
        let tags: HashMap<TagId, TagId> = own_tags.values().copied().filter_map(same_tag).collect();
        let as_often = |(was, now): (&TagId, &TagId)| {
            let (was, now) = (before.tag(*was), def.tag(*now));
            (was.poll, was.class, was.access) == (now.poll, now.class, now.access)
        };
        let is_whole = [own.len(), others.len()] == [devices.len(); 2]
            && [own_tags.len(), other_tags.len()] == [tags.len(); 2]
            && tags.iter().all(as_often);
        Renamed { devices, tags, is_whole }
    }

    /// The id that a device has now, if it is asked as it was.
    pub fn device(&self, was: DeviceId) -> Option<DeviceId> {
        self.devices.get(&was).copied()
    }

    /// The id that a tag has now, if it is in the same registers of such a device.
    pub fn tag(&self, was: TagId) -> Option<TagId> {
        self.tags.get(&was).copied()
    }

    /// The tags that have been asked for before, under their ids of now.
    pub fn kept_tags(&self) -> HashSet<TagId> {
        self.tags.values().copied().collect()
    }

    /// Renames a device and tags of it; `false` where there is no such device any more.
    pub fn rename(&self, device: &mut DeviceId, tags: &mut Arc<[TagId]>) -> bool {
        let Some(now) = self.device(*device) else { return false };
        *device = now;
        *tags = tags.iter().filter_map(|tag| self.tag(*tag)).collect();
        true
    }
}

fn devices_on(def: &PlantDef, line: LineId) -> Vec<&DeviceDef> {
    def.devices.iter().filter(|device| device.line == line).collect()
}

fn tags_on(def: &PlantDef, line: LineId) -> HashMap<&str, &TagDef> {
    let tags = def.tags.iter().filter(|tag| def.device(tag.device).line == line);
    tags.map(|tag| (tag.name.as_str(), tag)).collect()
}

fn placed_devices(def: &PlantDef) -> Vec<(&str, String)> {
    def.devices.iter().map(|device| (device.name.as_str(), place::of_device(def, device))).collect()
}

/// A procedure is where it writes to, in what steps.
fn placed_procedures(def: &PlantDef) -> Vec<(&str, String)> {
    let place = |procedure: &ProcedureDef| {
        let writes: Vec<String> = procedure.writes().map(|(tag, _)| place::of_tag(def, def.tag(tag))).collect();
        format!("{writes:?} {:?} {:?}", procedure.steps, procedure.safe)
    };
    def.procedures.iter().map(|procedure| (&*procedure.name, place(procedure))).collect()
}

fn placed_tags(def: &PlantDef) -> Vec<(&str, String)> {
    def.tags.iter().map(|tag| (tag.name.as_str(), place::of_tag(def, tag))).collect()
}

/// What a definition has of the one before it, by its own ids.
pub struct Redefinition {
    /// The lines that keep running.
    lines: Vec<bool>,
    /// The lines that keep their ports, each with its id of before.
    ports: Vec<Option<LineId>>,
    /// The devices that are asked where they were, whatever they were called, each with its id of before.
    devices: Vec<Option<DeviceId>>,
    /// The tags of the same names, or [for certain](place::predecessors) of other names, each with its id of before.
    tags: Vec<Option<TagId>>,
    /// Of these, those whose registers are the same, or whose calculation is.
    same_source: Vec<bool>,
}

impl Redefinition {
    /// Of `def` after `before`; `transport` is how a line of before is connected, whatever its plant file says.
    pub fn new<'a>(before: &'a PlantDef, def: &PlantDef, transport: impl Fn(LineId) -> &'a Transport) -> Redefinition {
        let lines: Vec<bool> = def.lines.iter().map(|line| before.keeps_line(def, line.id)).collect();
        let port = |line: &LineDef| if lines[line.id.index()] { Some(line.id) } else { before.same_port(def, line.id) };
        let ports = def.lines.iter().map(port).collect();
        let same_device = |(device, was): (&DeviceDef, Option<usize>)| {
            let was = &before.devices[was?];
            let same_place = was.unit == device.unit && *transport(was.line) == def.line(device.line).transport;
            (lines[device.line.index()] || same_place).then_some(was.id)
        };
        let was = place::predecessors(&placed_devices(before), &placed_devices(def));
        let devices: Vec<Option<DeviceId>> = def.devices.iter().zip(was).map(same_device).collect();
        let was = place::predecessors(&placed_tags(before), &placed_tags(def));
        let tags: Vec<Option<TagId>> = was.into_iter().map(|was| was.map(|was| before.tags[was].id)).collect();
        let same_source = def.tags.iter().zip(&tags).map(|(tag, was)| {
            let Some(was) = was.map(|was| before.tag(was)) else { return false };
            match (&tag.calculation, &was.calculation) {
                (Some(own), Some(was)) => (&own.text, own.over_time) == (&was.text, was.over_time),
                (None, None) => tag.point == was.point && devices[tag.device.index()] == Some(was.device),
                (Some(_), None) | (None, Some(_)) => false,
            }
        });
        Redefinition { same_source: same_source.collect(), lines, ports, devices, tags }
    }

    /// Does this line keep running?
    pub fn keeps_line(&self, line: LineId) -> bool {
        self.lines.get(line.index()).is_some_and(|keeps| *keeps)
    }

    /// The line of before whose port this one goes on with.
    pub fn port(&self, line: LineId) -> Option<LineId> {
        self.ports[line.index()]
    }

    /// The device of before, if it is asked where it was.
    pub fn device(&self, id: DeviceId) -> Option<DeviceId> {
        self.devices[id.index()]
    }

    /// The tag of before that this one goes on as.
    pub fn tag(&self, id: TagId) -> Option<TagId> {
        self.tags[id.index()]
    }

    /// The tag of before that had its value from the same registers of the same device, or by the same calculation.
    pub fn source(&self, id: TagId) -> Option<TagId> {
        self.tags[id.index()].filter(|_| self.same_source[id.index()])
    }
}
