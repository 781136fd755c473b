//! Moving between the pages and rows of the controllers tab.

use super::*;

impl Controllers {
    pub(super) fn move_by(&mut self, cx: &ViewContext, device: &DeviceDef, motion: Motion) {
        let wall = (self.page == Page::List && self.is_wall(cx))
            .then(|| wall::Grid::new(cx.size, cx.area, cx.def().devices.len()));
        let room = wall.map_or(usize::from(cx.area.height.saturating_sub(4)).max(1), |grid| grid.rows * grid.columns);
        let to = |at: usize, count: usize| motion.to(at, count, room);
        match &mut self.page {
            Page::List => {
                let (at, count) = (usize::from(self.device.0), cx.def().devices.len());
                self.device = DeviceId(to_u16(match (motion, wall) {
                    (Motion::Rows(by), Some(grid)) => grid.step(at, by, count),
                    (Motion::Rows(_) | Motion::Pages(_) | Motion::First | Motion::Last, _) => to(at, count),
                }));
            }
            Page::Device => self.table.selected = to(self.table.selected, self.table.rows(cx, device.id).len()),
            Page::Program => {
                let steps = device.program.as_ref().map_or(0, |program| program.steps.len());
                self.cell.row = to(self.cell.row, steps);
            }
            Page::Sets => self.set = to(self.set, sets::sources(cx, device).len()),
            Page::Compare(compare) => compare.scroll(cx, device, motion, room),
            Page::Runs => self.runs.select(cx, motion),
            Page::Procedures => self.procedures.move_by(cx, motion),
            Page::Lamps | Page::Overlay(_) | Page::Guide(..) => {}
        }
    }

    /// Lays the marked runs, or those of the procedures, over each other, or goes back to their list.
    pub(super) fn swap_overlay(&mut self, cx: &ViewContext, device: DeviceId) {
        let before = std::mem::replace(&mut self.page, Page::List);
        if let Page::Overlay(before) = before {
            (self.page, self.runs.overlay) = (*before, None);
            return;
        }
        if before == Page::Procedures {
            self.runs.overlay = self.procedures.overlay(cx);
        } else {
            self.runs.lay_over(cx, device);
        }
        self.page = if self.runs.overlay.is_some() { Page::Overlay(Box::new(before)) } else { before };
    }

    /// Enter: what is selected is opened, edited or written.
    pub(super) fn open_selected(&mut self, cx: &ViewContext, device: &DeviceDef) -> Vec<UiAction> {
        match &self.page {
            Page::List => {
                self.show(device.id);
                self.on_snapshot(cx)
            }
            Page::Device => match self.table.tag(cx, device.id) {
                Some(tag) if tag.writable() => write(cx, Some(tag.id)),
                Some(tag) => open(Faceplate::new(tag.label.clone(), vec![tag.id]).map(Modal::Faceplate)),
                None => Vec::new(),
            },
            Page::Program => write(cx, device.program.as_ref().and_then(|program| self.cell.tag(program))),
            Page::Sets => {
                let Some(source) = sets::sources(cx, device).into_iter().nth(self.set) else { return Vec::new() };
                if let Some(notice) = sets::problems(cx, &source) {
                    return open(Modal::Notice(notice));
                }
                self.page = Page::Compare(Compare::new(source));
                Vec::new()
            }
            Page::Compare(compare) => open(compare.restore(cx, device).map_or_else(Modal::Notice, Modal::Confirm)),
            Page::Procedures => self.procedures.start(cx),
            Page::Lamps | Page::Runs | Page::Overlay(_) | Page::Guide(..) => Vec::new(),
        }
    }

    pub(super) fn in_compare(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        let Page::Compare(compare) = &mut self.page else { return Vec::new() };
        match (action, &compare.source) {
            (Action::All, _) => compare.all = !compare.all,
            // A copy the other way round: the target is chosen by opening its page.
            (_, Source::Device(other)) => {
                let (other, here) = (*other, self.device);
                self.show(other);
                self.page = Page::Compare(Compare::new(Source::Device(here)));
            }
            (_, Source::Set(_)) => {
                let device = cx.def().device(self.device);
                return notice(device, t!("only a copy between two controllers can be turned around"));
            }
        }
        Vec::new()
    }
}
