//! The registers as a page of the tab Bus, of a unit that the plant file knows.

use super::{ReadFor, Registers};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        number::to_i8,
        tag::{Decimals, Table, TagDef},
    },
    register_map::named::Named,
};

impl Registers {
    /// As a page of another tab.
    pub fn within(snapshot: &Snapshot, tab: Tab) -> Registers {
        Registers { tab, ..Registers::new(snapshot) }
    }

    /// The registers of this unit, from `place` on; what is shown of it already stays.
    pub fn show(&mut self, cx: &ViewContext, line: LineId, unit: u8, place: Option<(Table, u16)>) {
        if let Some((table, address)) = place {
            (self.table, self.first, self.selected) = (table, address, address);
        }
        if (self.line, self.unit) == (line, unit) {
            return;
        }
        if self.line != line {
            self.names_of.clear();
            self.line = line;
        }
        self.show_unit(cx, unit);
    }

    /// Calls the registers what the plant file calls them, with the scaling that the device announces now; a name that was
    /// given by hand stays.
    pub(super) fn name_by_plant(&mut self, snapshot: &Snapshot) {
        let (line, unit) = (self.line, self.unit);
        let of_unit = |tag: &&TagDef| {
            let device = snapshot.def.device(tag.device);
            (device.line, device.unit) == (line, unit) && tag.point.field.is_none() && tag.calculation.is_none()
        };
        let before = std::mem::take(&mut self.names_of_plant);
        for tag in snapshot.def.tags.iter().filter(of_unit) {
            let named = Named::of_tag(tag, scaling(snapshot, tag));
            self.give(&named, before.get(named.table, named.address));
            self.names_of_plant.put(named);
        }
    }

    pub fn line(&self) -> LineId {
        self.line
    }

    /// Is the graph of what is watched shown?
    pub fn has_graph(&self) -> bool {
        self.watch.has_graph()
    }

    /// What was to be read next is not.
    pub fn rest(&mut self) -> Vec<UiAction> {
        self.sent.retain(|sent| !matches!(sent.what, ReadFor::Window(_)));
        Vec::new()
    }
}

/// Decimals and unit of a tag now; `None` while the device has not said them.
fn scaling(snapshot: &Snapshot, tag: &TagDef) -> Option<(i8, String)> {
    let value = |of| snapshot.sample(of).scaling_value();
    let decimals = match tag.decimals {
        Decimals::Fixed(decimals) => to_i8(decimals),
        Decimals::From(_) | Decimals::PowerFrom(_) => tag.scaling_decimals(value)?,
    };
    Some((decimals, tag.unit_by(value)?.to_owned()))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        plant::{
            PlantDef,
            sample::{Cause, Sample},
        },
        ui::fixture::{Fixture, now},
    };

    #[test]
    fn a_value_is_raw_until_the_device_says_its_decimals() {
        let mut snapshot = Snapshot::clone(&Fixture::traffic().snapshot());
        let mut def = PlantDef::clone(&snapshot.def);
        let (first, source) = (def.tags[0].point, TagId(1));
        (def.tags[0].decimals, def.tags[0].scale) = (Decimals::From(source), 1.0);
        snapshot.def = Arc::new(def);
        let mut registers = Registers::within(&snapshot, Tab::Bus);
        let steps = [(Sample::bad(Cause::NotRead, now()), "700 raw"), (Sample::good(1.0, now()), "70.0 °C")];
        for (decimals, expect) in steps {
            snapshot.samples[source.index()] = decimals;
            registers.name_by_plant(&snapshot);
            let named = registers.names.get(first.table, first.address).expect("a name").clone();
            assert_eq!(named.text(&[700]).as_deref(), Some(expect));
        }
        let by_hand =
            Named { unit: "K".into(), ..registers.names.get(first.table, first.address).expect("one").clone() };
        registers.names.put(by_hand.clone());
        registers.name_by_plant(&snapshot);
        assert_eq!(registers.names.get(first.table, first.address), Some(&by_hand), "a name by hand stays");
    }
}
