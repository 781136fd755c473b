//! The registers as a page of the tab Bus, of a unit that the plant file knows.

use super::{
    Registers,
    keys::table,
    names::{Named, Names},
};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::tag::{Decimals, Table, TagDef},
    ui::keys::find,
};

/// The chords that read, for the page of the tab Bus.
#[cfg(test)]
pub fn chords_of_page() -> Vec<crate::ui::keys::Chord> {
    crate::ui::keys::chords_of(&super::keys::of_plant())
}

impl Registers {
    /// As a page of another tab.
    pub fn within(snapshot: &Snapshot, tab: Tab) -> Registers {
        let mut registers = Registers { tab, ..Registers::new(snapshot) };
        registers.names = names_of(snapshot, registers.line, registers.unit);
        registers
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

    /// The line whose registers are shown.
    pub fn line(&self) -> LineId {
        self.line
    }

    /// Is a key one of its own?
    pub fn takes(&self, cx: &ViewContext, event: KeyEvent) -> bool {
        self.watch.has_graph() || find(&table(cx), event).is_some()
    }

    /// Is the graph of what is watched shown?
    pub fn has_graph(&self) -> bool {
        self.watch.has_graph()
    }

    /// What was to be read next is not.
    pub fn rest(&mut self) -> Vec<UiAction> {
        self.on_way = None;
        Vec::new()
    }
}

/// What the plant file calls the registers of a unit.
pub(super) fn names_of(snapshot: &Snapshot, line: LineId, unit: u8) -> Names {
    let of_unit = |tag: &&TagDef| {
        let device = snapshot.def.device(tag.device);
        (device.line, device.unit) == (line, unit) && tag.point.field.is_none() && tag.calculation.is_none()
    };
    let mut names = Names::default();
    for tag in snapshot.def.tags.iter().filter(of_unit) {
        let (point, decimals) = (tag.point, snapshot.decimals[tag.id.index()]);
        let scaling = if let Decimals::From(_) = tag.decimals { 0.1f64.powi(i32::from(decimals)) } else { 1.0 };
        names.put(Named {
            scale: tag.scale * scaling,
            offset: tag.offset,
            decimals,
            unit: snapshot.unit(tag.id).to_owned(),
            labels: tag.labels.clone(),
            ..Named::new(point.table, point.address, point.kind, point.order, &tag.short)
        });
    }
    names
}
