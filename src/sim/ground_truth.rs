//! The actual value of each tag: from the process behind the instruments of the tank, or the registers of a modelled device.

use super::{
    rig::{RigDevice, RigState, part},
    scenario::judge::ActualValues,
    simulator::Simulator,
};
use crate::plant::{
    PlantDef,
    def::TagId,
    tag::{Table, TagDef},
};

/// Reads one value of the rig.
type RigValue = fn(&RigState) -> f64;

/// Where the actual value of each tag comes from.
#[derive(Debug, Clone, Default)]
pub struct GroundTruth {
    rig: Vec<(TagId, RigValue)>,
    others: Vec<TagId>,
}

impl GroundTruth {
    /// The sources of a plant.
    pub fn new(def: &PlantDef) -> GroundTruth {
        let mut found = GroundTruth::default();
        for tag in &def.tags {
            match of_rig(def, tag) {
                Some(value) => found.rig.push((tag.id, value)),
                None => found.others.push(tag.id),
            }
        }
        found
    }

    /// The actual values now, in the units of the tags.
    pub fn values(&self, simulator: &Simulator) -> ActualValues {
        let state = simulator.rig().map(|rig| rig.state());
        let rig = self.rig.iter().filter_map(|(tag, value)| Some((*tag, value(state.as_ref()?))));
        let others = self.others.iter().filter_map(|tag| Some((*tag, simulator.value(*tag)?)));
        rig.chain(others).collect()
    }
}

/// What a tag of the thesis's controller or PLC measures, by its address in their profiles.
fn of_rig(def: &PlantDef, tag: &TagDef) -> Option<RigValue> {
    let point = (tag.point.table, tag.point.address);
    match part(def, tag.device)? {
        RigDevice::Controller => of_controller(point),
        RigDevice::Plc => of_plc(point),
    }
}

fn of_controller(point: (Table, u16)) -> Option<RigValue> {
    match point {
        (Table::Input, 0x03E8) => Some(|state| state.probe_c),
        (Table::Input, 0x03EB) => Some(|state| state.mv_percent),
        _ => None,
    }
}

fn of_plc(point: (Table, u16)) -> Option<RigValue> {
    match point {
        (Table::Input, 1032) => Some(|state| state.readings.level_cm),
        (Table::Input, 1033) => Some(|state| state.readings.cold_l),
        (Table::Input, 1034) => Some(|state| state.readings.hot_l),
        (Table::Input, 1035) => Some(|state| state.readings.flow_in),
        (Table::Input, 1036) => Some(|state| state.readings.flow_out),
        (Table::Input, 1037) => Some(|state| state.readings.flow_pump),
        (Table::Input, 1038) => Some(|state| state.readings.heater_w),
        (Table::Coil, 2048) => Some(|state| f64::from(u8::from(state.moving.pump))),
        (Table::Coil, 2049) => Some(|state| f64::from(u8::from(state.moving.agitator))),
        (Table::Coil, 2050) => Some(|state| f64::from(u8::from(state.moving.drain_valve))),
        (Table::Coil, 2051) => Some(|state| f64::from(u8::from(state.moving.fill_valve))),
        _ => None,
    }
}
