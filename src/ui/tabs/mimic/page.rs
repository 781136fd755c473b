//! A page of the mimic alone, for pages that show it beside other things.

use super::Mimic;
use crate::ui::tabs::prelude::*;

impl Mimic {
    /// The picture for a room, and its size.
    pub fn size(&self, cx: &ViewContext, room: Rect) -> (u16, u16) {
        self.shown(cx, room).0.size
    }

    /// Draws the shown page without what belongs to the tab: selection, small trends and companions.
    pub fn draw_page(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        Mimic { page: self.page, ..Mimic::default() }.view(cx, frame, area);
    }
}
