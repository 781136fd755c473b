//! What is really so, by tag: the process behind the instruments of the tank, the registers of modelled devices.

use super::{
    rig::{Part, Truth, part},
    scenario::judge::Truths,
    simulator::Simulator,
};
use crate::plant::{
    PlantDef,
    def::TagId,
    tag::{Table, TagDef},
};

/// Takes one value out of what is so in the rig.
type Look = fn(&Truth) -> f64;

/// Which tags of a plant have a truth, and which.
#[derive(Debug, Clone, Default)]
pub struct Lens {
    rig: Vec<(TagId, Look)>,
    others: Vec<TagId>,
}

impl Lens {
    /// Looks at a plant.
    pub fn of(def: &PlantDef) -> Lens {
        let mut lens = Lens::default();
        for tag in &def.tags {
            match of_rig(def, tag) {
                Some(look) => lens.rig.push((tag.id, look)),
                None => lens.others.push(tag.id),
            }
        }
        lens
    }

    /// What is so now, in the units of the tags.
    pub fn look(&self, simulator: &Simulator) -> Truths {
        let truth = simulator.rig().map(|rig| rig.truth());
        let rig = self.rig.iter().filter_map(|(tag, look)| Some((*tag, look(truth.as_ref()?))));
        let others = self.others.iter().filter_map(|tag| Some((*tag, simulator.value(*tag)?)));
        rig.chain(others).collect()
    }
}

/// What a tag of the thesis's controller or PLC measures, by its address in their profiles.
fn of_rig(def: &PlantDef, tag: &TagDef) -> Option<Look> {
    let point = (tag.point.table, tag.point.address);
    match part(def, tag.device)? {
        Part::Controller => of_controller(point),
        Part::Plc => of_plc(point),
    }
}

fn of_controller(point: (Table, u16)) -> Option<Look> {
    match point {
        (Table::Input, 0x03E8) => Some(|truth| truth.probe_c),
        (Table::Input, 0x03EB) => Some(|truth| truth.mv_percent),
        _ => None,
    }
}

fn of_plc(point: (Table, u16)) -> Option<Look> {
    match point {
        (Table::Input, 1032) => Some(|truth| truth.readings.level_cm),
        (Table::Input, 1033) => Some(|truth| truth.readings.cold_l),
        (Table::Input, 1034) => Some(|truth| truth.readings.hot_l),
        (Table::Input, 1035) => Some(|truth| truth.readings.flow_in),
        (Table::Input, 1036) => Some(|truth| truth.readings.flow_out),
        (Table::Input, 1037) => Some(|truth| truth.readings.flow_pump),
        (Table::Input, 1038) => Some(|truth| truth.readings.heater_w),
        (Table::Coil, 2048) => Some(|truth| f64::from(u8::from(truth.moving.pump))),
        (Table::Coil, 2049) => Some(|truth| f64::from(u8::from(truth.moving.agitator))),
        (Table::Coil, 2050) => Some(|truth| f64::from(u8::from(truth.moving.drain_valve))),
        (Table::Coil, 2051) => Some(|truth| f64::from(u8::from(truth.moving.fill_valve))),
        _ => None,
    }
}
