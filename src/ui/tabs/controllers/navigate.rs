//! Moving between the pages and rows of the controllers tab.

use super::*;

impl Controllers {
    pub(super) fn step(&mut self, cx: &ViewContext, motion: Motion) {
        if *self.page() == Page::List {
            return self.step_in_list(cx, motion);
        }
        let Some(device) = self.device(cx) else { return };
        let room = usize::from(cx.area.height.saturating_sub(4)).max(1);
        let to = |at: usize, count: usize| motion.to(at, count, room);
        match self.pages.last_mut().unwrap_or(&mut Page::List) {
            Page::Device => self.table.selected = to(self.table.selected, self.table.rows(cx, device.id).len()),
            Page::Program => {
                let steps = device.program.as_ref().map_or(0, |program| program.steps.len());
                self.cell.row = to(self.cell.row, steps);
            }
            Page::Compare(compare) => compare.scroll(cx, device, motion, room),
            Page::List | Page::Sets | Page::Runs | Page::Procedures | Page::Lamps | Page::Overlay | Page::Guide(_) => {}
        }
    }

    /// To another row, or to another faceplate.
    fn step_in_list(&mut self, cx: &ViewContext, motion: Motion) {
        if !self.is_wall(cx) {
            return self.devices.step(cx, motion);
        }
        let devices = self.devices.rows(cx);
        let (at, count) = (self.devices.place(&devices), devices.len());
        let grid = wall::Grid::new(cx.size, cx.area, count);
        let place = match motion {
            Motion::Rows(by) => grid.step(at, by, count),
            Motion::Pages(_) | Motion::First | Motion::Last => motion.to(at, count, grid.rows * grid.columns),
        };
        let id = devices.get(place).map(|device| device.id);
        id.into_iter().for_each(|id| self.devices.select(id));
    }

    /// Lays the marked runs, or those of the procedures, over each other, or goes back to their list.
    pub(super) fn swap_overlay(&mut self, cx: &ViewContext) {
        if *self.page() == Page::Overlay {
            TabView::back(self, cx);
            return;
        }
        if *self.page() == Page::Procedures {
            self.runs.overlay = self.procedures.overlay(cx);
        } else {
            self.runs.lay_over(cx);
        }
        self.pages.extend(self.runs.overlay.is_some().then_some(Page::Overlay));
    }

    /// Shows the device so many further on, around the end.
    pub(super) fn next_device(&mut self, cx: &ViewContext, by: isize) {
        self.show(DeviceId(to_u16(around(self.device.index(), by, cx.def().devices.len()))));
    }

    /// Selects the faceplate so many to the right.
    pub(super) fn neighbour(&mut self, cx: &ViewContext, by: isize) {
        let devices = self.devices.rows(cx);
        let place = self.devices.place(&devices).saturating_add_signed(by).min(devices.len().saturating_sub(1));
        let id = devices.get(place).map(|device| device.id);
        id.into_iter().for_each(|id| self.devices.select(id));
    }
}
