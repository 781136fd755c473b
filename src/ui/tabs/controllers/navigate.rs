//! Moving between the pages and rows of the controllers tab.

use super::*;

impl Controllers {
    pub(super) fn step(&mut self, cx: &ViewContext, motion: Motion) {
        let Some(device) = self.device(cx) else { return };
        let listed = self.listed(cx);
        let wall =
            (*self.page() == Page::List && self.is_wall(cx)).then(|| wall::Grid::new(cx.size, cx.area, listed.len()));
        let room = wall.map_or(usize::from(cx.area.height.saturating_sub(4)).max(1), |grid| grid.rows * grid.columns);
        let to = |at: usize, count: usize| motion.to(at, count, room);
        match self.pages.last_mut().unwrap_or(&mut Page::List) {
            Page::List => {
                let (at, count) = (self.place(&listed), listed.len());
                let place = match (motion, wall) {
                    (Motion::Rows(by), Some(grid)) => grid.step(at, by, count),
                    (Motion::Rows(_) | Motion::Pages(_) | Motion::First | Motion::Last, _) => to(at, count),
                };
                self.device = listed.get(place).map_or(self.device, |device| device.id);
            }
            Page::Device => self.table.selected = to(self.table.selected, self.table.rows(cx, device.id).len()),
            Page::Program => {
                let steps = device.program.as_ref().map_or(0, |program| program.steps.len());
                self.cell.row = to(self.cell.row, steps);
            }
            Page::Compare(compare) => compare.scroll(cx, device, motion, room),
            Page::Sets | Page::Runs | Page::Procedures | Page::Lamps | Page::Overlay | Page::Guide(_) => {}
        }
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
        let listed = self.listed(cx);
        let place = self.place(&listed).saturating_add_signed(by).min(listed.len().saturating_sub(1));
        self.device = listed.get(place).map_or(self.device, |device| device.id);
    }
}
