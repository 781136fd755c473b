//! Page Registers: the tab of that name, for the chosen device.

use super::{Bus, LineView, Page};
use crate::ui::tabs::prelude::*;

impl Bus {
    /// Turns to a page; the registers are those of the device that was chosen.
    pub(super) fn show(&mut self, cx: &ViewContext, page: Page) {
        let Some(at) = LineView::new(cx, self.line).filter(|_| !cx.is_past()) else { return };
        let block = (self.page == Page::Plan).then(|| self.plan.block(cx)).flatten();
        let first = || cx.def().devices.iter().find(|device| device.line == at.id).map(|device| device.id);
        let device = block.map(|(device, ..)| device);
        let device = device.or_else(|| first().filter(|_| self.registers.line() != at.id));
        if let (Page::Registers, Some(device)) = (page, device) {
            self.registers.show(
                cx,
                at.id,
                cx.def().device(device).unit,
                block.map(|(_, table, address)| (table, address)),
            );
        }
        self.page = page;
    }
}

/// What a page below the heading sees.
pub(super) fn below<'a>(cx: &ViewContext<'a>) -> ViewContext<'a> {
    let area = cx.area;
    ViewContext { area: Rect { y: area.y + 1, height: area.height.saturating_sub(1), ..area }, ..*cx }
}
