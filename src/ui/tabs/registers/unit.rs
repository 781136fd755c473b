//! The unit whose registers are shown.

use std::ops::RangeInclusive;

use super::{Asking, Recognition, Registers, cells::Cells};
use crate::{register_map::named::Names, ui::tabs::prelude::*};

impl Registers {
    pub(super) fn ask_unit(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let (least, most) = self.units(cx).into_inner();
        self.ask_text(Asking::Unit, t!("unit address"), &t!("{least} to {most}", least, most))
    }

    pub(super) fn unit_typed(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        if self.watch.is_logging() {
            return Err(t!("another unit has other registers: end the log first, with R").to_owned());
        }
        let unit = self.parse_unit(cx, text)?;
        self.show_unit(cx, unit);
        Ok(())
    }

    pub(super) fn parse_unit(&self, cx: &ViewContext, text: &str) -> Result<u8, String> {
        let units = self.units(cx);
        let (least, most) = (units.start(), units.end());
        let wrong = || t!("found `{text}`, expected {least} to {most}", text, least, most);
        text.parse().ok().filter(|unit| units.contains(unit)).ok_or_else(wrong)
    }

    /// Nothing that was read of one unit is shown of another, and each has names of its own.
    pub(super) fn show_unit(&mut self, cx: &ViewContext, unit: u8) {
        let (names, of_profile) = self.names_of.remove(&unit).unwrap_or_default();
        let names = std::mem::replace(&mut self.names, names);
        let of_profile = std::mem::replace(&mut self.names_of_profile, of_profile);
        self.names_of.insert(self.unit, (names, of_profile));
        (self.unit, self.reads) = (unit, 0);
        (self.cells, self.last, self.recognition) = (Cells::default(), None, Recognition::default());
        self.watch.clear();
        self.sent.clear();
        self.comparison = None;
        self.names_of_plant = Names::default();
        self.name_by_plant(cx.snapshot);
    }

    /// Units that can answer on the line.
    fn units(&self, cx: &ViewContext) -> RangeInclusive<u8> {
        cx.def().lines.get(self.line.index()).map_or(0..=255, |line| line.transport.units())
    }
}
