//! Where a fault is, by its name in the plant, and which faults can be there.

use super::{
    syntax::{Fault, Target},
    values::Values,
};
use crate::plant::{
    PlantDef,
    def::{DeviceDef, Framing, LineId, TagId, Transport},
};
use crate::sim::rig::{Part, SIMULATION, part};

/// What is faulty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// A line.
    Line(LineId),
    /// A unit on a line.
    Unit(LineId, u8),
    /// One value of a unit.
    Tag(TagId),
    /// The simulated process.
    Process,
}

/// What can go wrong in one place, in the order of the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// Where.
    pub place: Place,
    /// What, each with its usual number.
    pub faults: Vec<Fault>,
}

impl Place {
    /// The place of a device.
    pub fn of(device: &DeviceDef) -> Place {
        Place::Unit(device.line, device.unit)
    }

    /// `L1`, `TIC-1`, `TIC-1.PV`, `process`.
    pub fn name(self, def: &PlantDef) -> String {
        match self {
            Place::Line(line) => def.line(line).name.clone(),
            Place::Unit(line, unit) => match device_at(def, line, unit) {
                Some(device) => device.name.clone(),
                None => format!("unit {unit} on {}", def.line(line).name),
            },
            Place::Tag(tag) => def.tag(tag).name.clone(),
            Place::Process => "process".to_owned(),
        }
    }

    /// Whether a kind of fault belongs here.
    pub fn takes(self, fault: Fault) -> bool {
        match (self, fault.target()) {
            (Place::Line(_), Target::Line)
            | (Place::Unit(..), Target::Unit | Target::Value)
            | (Place::Tag(_), Target::Value)
            | (Place::Process, Target::Process) => true,
            (Place::Line(_) | Place::Unit(..) | Place::Tag(_) | Place::Process, _) => false,
        }
    }
}

/// The device at an address.
pub fn device_at(def: &PlantDef, line: LineId, unit: u8) -> Option<&DeviceDef> {
    def.devices.iter().find(|device| (device.line, device.unit) == (line, unit))
}

/// All that can go wrong with a simulated plant: its serial lines, its units, their values and, where the tank is
/// simulated, the process.
pub fn offers(def: &PlantDef) -> Vec<Offer> {
    let lines = def.lines.iter().map(|line| Place::Line(line.id));
    let units = def.devices.iter().map(Place::of);
    let places = lines.chain(units).chain([Place::Process]);
    let offers = places.map(|place| {
        let faults = Fault::ALL.into_iter().filter(|fault| refusal(def, place, *fault).is_none()).collect();
        Offer { place, faults }
    });
    offers.filter(|offer| !offer.faults.is_empty()).collect()
}

/// Why a fault cannot be in a place; `None` if it can.
pub fn refusal(def: &PlantDef, place: Place, fault: Fault) -> Option<String> {
    let name = place.name(def);
    if !place.takes(fault) {
        let belongs = match fault.target() {
            Target::Line => "a line",
            Target::Unit => "a device",
            Target::Value => "a device or a tag",
            Target::Process => "the process",
        };
        return Some(format!("`{fault}` is a fault of {belongs}, not of {name}"));
    }
    let is_controller =
        |line, unit| device_at(def, line, unit).is_some_and(|device| part(def, device.id) == Some(Part::Controller));
    let why = match (place, fault) {
        (Place::Line(line), _) if over_mbap(def, line) => "is no serial line: TCP itself repairs what the wire spoils",
        (Place::Process, _) if def.simulation.as_deref() != Some(SIMULATION) => "is not simulated",
        // The thesis's controller reports a broken sensor in its fault word.
        (Place::Unit(line, unit), Fault::SensorBurnout) if is_controller(line, unit) => return None,
        (Place::Unit(line, unit), Fault::Stuck | Fault::Torn | Fault::WordOrder | Fault::SensorBurnout) => {
            let values = device_at(def, line, unit).map(|device| Values::of(def, device)).unwrap_or_default();
            if values.can_have(fault) {
                return None;
            }
            lack(fault)
        }
        (Place::Tag(tag), _) if !Values::of_tags(std::iter::once(def.tag(tag))).can_have(fault) => lack(fault),
        (Place::Line(_) | Place::Unit(..) | Place::Tag(_) | Place::Process, _) => return None,
    };
    Some(format!("{name} {why}"))
}

fn over_mbap(def: &PlantDef, line: LineId) -> bool {
    matches!(def.line(line).transport, Transport::Tcp { framing: Framing::Mbap, .. })
}

fn lack(fault: Fault) -> &'static str {
    match fault {
        Fault::Torn | Fault::WordOrder => "has no value of 32 bits",
        Fault::SensorBurnout => "has no mark for a broken sensor in its profile (bad_if)",
        _ => "has no value that is only read",
    }
}
