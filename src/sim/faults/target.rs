//! The target of a fault, by its name in the plant, and the faults that apply to it.

use super::{
    syntax::{InjectedFault, TargetKind, ValueFault},
    values::Values,
};
use crate::plant::{
    PlantDef,
    def::{DeviceDef, Framing, LineId, TagId, Transport},
};
use crate::sim::rig::{RigDevice, SIMULATION, part};

/// What a fault is injected into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FaultTarget {
    /// A line.
    Line(LineId),
    /// A unit on a line.
    Unit(LineId, u8),
    /// One value of a unit.
    Tag(TagId),
    /// The simulated process.
    Process,
}

/// The faults that apply to one target, in the order of the page.
#[derive(Debug, Clone, PartialEq)]
pub struct AvailableFaults {
    /// The target.
    pub target: FaultTarget,
    /// Each with its default parameter.
    pub faults: Vec<InjectedFault>,
}

impl FaultTarget {
    /// The unit of a device.
    pub fn of_unit(device: &DeviceDef) -> FaultTarget {
        FaultTarget::Unit(device.line, device.unit)
    }

    /// `L1`, `TIC-1`, `TIC-1.PV`, `process`.
    pub fn name(self, def: &PlantDef) -> String {
        match self {
            FaultTarget::Line(line) => def.line(line).name.clone(),
            FaultTarget::Unit(line, unit) => match device_at(def, line, unit) {
                Some(device) => device.name.clone(),
                None => format!("unit {unit} on {}", def.line(line).name),
            },
            FaultTarget::Tag(tag) => def.tag(tag).name.clone(),
            FaultTarget::Process => "process".to_owned(),
        }
    }

    /// Whether this kind of fault applies to this kind of target.
    pub fn accepts(self, fault: InjectedFault) -> bool {
        match (self, fault.target_kind()) {
            (FaultTarget::Line(_), TargetKind::Line)
            | (FaultTarget::Unit(..), TargetKind::Unit | TargetKind::Value)
            | (FaultTarget::Tag(_), TargetKind::Value)
            | (FaultTarget::Process, TargetKind::Process) => true,
            (FaultTarget::Line(_) | FaultTarget::Unit(..) | FaultTarget::Tag(_) | FaultTarget::Process, _) => false,
        }
    }
}

/// The device at an address.
pub fn device_at(def: &PlantDef, line: LineId, unit: u8) -> Option<&DeviceDef> {
    def.devices.iter().find(|device| (device.line, device.unit) == (line, unit))
}

/// All faults that apply to a simulated plant: to its serial lines, its units, their values and, where the tank is
/// simulated, the process.
pub fn available_faults(def: &PlantDef) -> Vec<AvailableFaults> {
    let lines = def.lines.iter().map(|line| FaultTarget::Line(line.id));
    let units = def.devices.iter().map(FaultTarget::of_unit);
    let targets = lines.chain(units).chain([FaultTarget::Process]);
    let available = targets.map(|target| {
        let faults = InjectedFault::all().filter(|fault| why_not_applicable(def, target, *fault).is_none()).collect();
        AvailableFaults { target, faults }
    });
    available.filter(|available| !available.faults.is_empty()).collect()
}

/// Why a fault does not apply to a target; `None` if it does.
pub fn why_not_applicable(def: &PlantDef, target: FaultTarget, fault: InjectedFault) -> Option<String> {
    let name = target.name(def);
    if !target.accepts(fault) {
        let belongs = match fault.target_kind() {
            TargetKind::Line => "a line",
            TargetKind::Unit => "a device",
            TargetKind::Value => "a device or a tag",
            TargetKind::Process => "the process",
        };
        return Some(format!("`{fault}` is a fault of {belongs}, not of {name}"));
    }
    let is_controller = |line, unit| {
        device_at(def, line, unit).is_some_and(|device| part(def, device.id) == Some(RigDevice::Controller))
    };
    let why = match (target, fault) {
        (FaultTarget::Line(line), _) if over_mbap(def, line) => {
            "is not a serial line: TCP itself repairs what the wire corrupts"
        }
        (FaultTarget::Process, _) if def.simulation.as_deref() != Some(SIMULATION) => "is not simulated",
        // The thesis's controller reports a broken sensor in its fault word.
        (FaultTarget::Unit(line, unit), InjectedFault::SensorBurnout) if is_controller(line, unit) => return None,
        (FaultTarget::Unit(..) | FaultTarget::Tag(_), _) => {
            let values = match target {
                FaultTarget::Unit(line, unit) => {
                    device_at(def, line, unit).map(|device| Values::of_device(def, device))
                }
                FaultTarget::Tag(tag) => Some(Values::of_tags(std::iter::once(def.tag(tag)))),
                FaultTarget::Line(_) | FaultTarget::Process => None,
            };
            match fault.of_values() {
                Some(fault) if !values.unwrap_or_default().can_have(fault) => lack(fault),
                Some(_) | None => return None,
            }
        }
        (FaultTarget::Line(_) | FaultTarget::Process, _) => return None,
    };
    Some(format!("{name} {why}"))
}

fn over_mbap(def: &PlantDef, line: LineId) -> bool {
    matches!(def.line(line).transport, Transport::Network { framing: Framing::Mbap, .. })
}

fn lack(fault: ValueFault) -> &'static str {
    match fault {
        ValueFault::Stuck => "has no value that is only read",
        ValueFault::Torn | ValueFault::WordOrder => "has no value of 32 bits",
        ValueFault::SensorBurnout => "has no mark for a broken sensor in its profile (bad_if)",
    }
}
