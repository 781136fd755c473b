//! All keys of the shown tab and of every tab, from their tables.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, Target, window};
use crate::ui::{
    ViewContext,
    keys::Hint,
    widgets::{
        list::{Motion, first, on_screen},
        text::{fit_words, pad, width},
    },
};

/// The window.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Help {
    /// Headings and keys of the moment: the terminal fills them in with every message.
    pub rows: Vec<Hint>,
    selected: usize,
}

impl Help {
    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Char('q' | '?') => Next::Close,
            KeyCode::Enter => match self.rows.get(self.selected).and_then(|hint| hint.chord) {
                Some(chord) => Next::Go(Target::Key(chord)),
                None => Next::Close,
            },
            _ => {
                let room = usize::from(cx.area.height.saturating_sub(2));
                if let Some(motion) = Motion::from_key(event) {
                    self.selected = motion.to(self.selected, self.rows.len(), room);
                }
                Next::Stay(Modal::Help(self))
            }
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let Help { rows, selected } = self;
        let keys = rows.iter().map(|hint| width(&hint.key)).max().unwrap_or(0);
        let inner = rows.iter().map(|hint| keys + 4 + width(&hint.help)).max().unwrap_or(0).max(40);
        let shown = usize::from(body.height.saturating_sub(2));
        let first = first(*selected, rows.len(), shown);
        let mut canvas = window(cx, frame, body, t!("keys"), (inner, rows.len()));
        for (y, n, hint) in on_screen(rows, first, shown) {
            if hint.key.is_empty() {
                canvas.text(0, y, &hint.label, cx.theme.dim());
            } else {
                let mark = if n == *selected { cx.theme.pick("▸", ">") } else { " " };
                let x = canvas.text(0, y, &pad(&format!("{mark} {}", hint.key), keys + 4), cx.theme.strong());
                let help = fit_words(&hint.help, canvas.width().saturating_sub(x));
                canvas.text(x, y, &help, if n == *selected { cx.theme.focus() } else { cx.theme.normal() });
            }
        }
    }
}
