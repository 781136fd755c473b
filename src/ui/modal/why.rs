//! Why a value is what it is: quality and cause, raw number and scaling, address, the bytes that brought it, the device,
//! the schedule; and what to do when it is not good.

mod bytes;
mod facts;
mod service;
mod value;
mod wire;
#[cfg(test)]
mod tests;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Modal, Next,
    sheet::{Sheet, label_columns},
    window,
};
use crate::{
    plant::{
        def::{DeviceId, TagId},
        number::to_u16,
    },
    text::of_plant,
    ui::{
        UiAction, ViewContext,
        keys::Hint,
        widgets::{list::Motion, text::Canvas},
    },
};

/// The window: one of a few tags, and the first row that is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Why {
    tags: Vec<TagId>,
    at: usize,
    row: u16,
}

impl Why {
    /// Why about these tags, beginning with the one in place `at`; `None` without any.
    pub fn new(tags: Vec<TagId>, at: usize) -> Option<Why> {
        (at < tags.len()).then_some(Why { tags, at, row: 0 })
    }

    /// About the tags of something, beginning with the first that is not good.
    pub fn of_all(cx: &ViewContext, tags: Vec<TagId>) -> Option<Why> {
        let doubtful = tags.iter().position(|tag| !cx.snapshot.sample(*tag).quality.is_good());
        Why::new(tags, doubtful.unwrap_or(0))
    }

    /// About a device as a whole: its first tag that is not good.
    pub fn of_device(cx: &ViewContext, device: DeviceId) -> Option<Why> {
        Why::of_all(cx, cx.def().tags_of(device).map(|tag| tag.id).collect())
    }

    /// The act that opens it, for a key.
    pub fn open(why: Option<Why>) -> Vec<UiAction> {
        why.map(|why| UiAction::Open(Modal::Why(why))).into_iter().collect()
    }

    pub(super) fn hints(&self) -> Vec<Hint> {
        let others = (1 < self.tags.len()).then(|| Hint::in_window("←→", t!("other value")));
        others
            .into_iter()
            .chain([Hint::in_window("↑↓", t!("scroll")), Hint::in_window(t!("Esc"), t!("close"))])
            .collect()
    }

    pub(super) fn on_key(mut self, event: KeyEvent) -> Next {
        let count = self.tags.len();
        if let Some(motion) = Motion::from_key(event) {
            self.row = to_u16(motion.to(usize::from(self.row), ROWS_MAX, 10));
        }
        match event.code {
            KeyCode::Left => (self.at, self.row) = ((self.at + count - 1) % count, 0),
            KeyCode::Right => (self.at, self.row) = ((self.at + 1) % count, 0),
            KeyCode::Enter | KeyCode::Char('q' | 'w') => return Next::Close,
            _ => {}
        }
        Next::Stay(Modal::Why(self))
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let tag = self.tags[self.at];
        let def = cx.def().tag(tag);
        let room = body.width.saturating_sub(4).min(WIDTH_MAX);
        let labels = label_columns(&facts::rows(cx, tag, room)).max(LABELS_MIN);
        let sheet = Sheet::new(facts::rows(cx, tag, room.saturating_sub(labels)), room, LABELS_MIN);
        let shown = body.height.saturating_sub(2);
        let first = self.row.min(to_u16(sheet.len()).saturating_sub(shown));
        let place = if self.tags.len() < 2 { String::new() } else { format!("  {}/{}", self.at + 1, self.tags.len()) };
        let title = t!("why {name} {label}{place}", name = def.name, label = of_plant(&def.label), place);
        let mut canvas = window(cx, frame, body, &title, (room, sheet.len()));
        sheet.view(cx.theme, &mut canvas, usize::from(first));
        let (inner, below) = (canvas.area(), to_u16(sheet.len()).saturating_sub(first + canvas.height()));
        if 0 < below {
            let words = t!(" {below} more ↓ ", below);
            let frame_row = Rect { y: inner.bottom(), height: 1, ..inner };
            Canvas::new(frame.buffer_mut(), frame_row).text_right(inner.width, 0, &words, cx.theme.strong());
        }
    }
}

/// Least columns of the labels.
const LABELS_MIN: u16 = 9;
/// Wider than this a window is harder to read, not easier.
const WIDTH_MAX: u16 = 100;
/// Further than this nothing is scrolled.
const ROWS_MAX: usize = 999;
