//! All keys of the shown tab and of every tab, from their tables.

use crate::t;
use crate::text::translate;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, window};
use crate::plant::number::to_u16;
use crate::ui::{
    ViewContext, keys,
    keys::{Global, Hint},
    replay,
    tabs::{Tab, Tabs},
    widgets::{
        list::Motion,
        text::{pad, width},
    },
};

pub(super) fn on_key(row: u16, event: KeyEvent) -> Next {
    match event.code {
        KeyCode::Char('q' | '?') | KeyCode::Enter => Next::Close,
        _ => {
            let moved = Motion::from_key(event).map_or(row, |motion| to_u16(motion.to(usize::from(row), ROWS_MAX, 10)));
            Next::Stay(Modal::Help(moved))
        }
    }
}

/// No tab has more keys; the view stops at the last one.
const ROWS_MAX: usize = 100;

pub(super) fn view(row: u16, cx: &ViewContext, tabs: &Tabs, frame: &mut Frame, body: Rect) {
    let own = tabs.shown().hints(cx);
    let offered = Tab::offered(cx);
    let there =
        keys::global().into_iter().filter(|key| !matches!(key.action, Global::Show(tab) if !offered.contains(&tab)));
    let global = keys::hints(&there.collect::<Vec<_>>());
    let heading = |text: &str| Hint::new("", text, "");
    let past = [heading(""), heading(t!("past"))].into_iter().chain(keys::hints(replay::KEYS)).filter(|_| cx.is_past());
    let own = own.into_iter().filter(|hint| !hint.help.is_empty());
    let rows: Vec<Hint> = [heading(translate(tabs.shown.title()))]
        .into_iter()
        .chain(own)
        .chain(past)
        .chain([heading(""), heading(t!("every tab"))])
        .chain(global)
        .collect();
    let keys = rows.iter().map(|hint| width(&hint.key)).max().unwrap_or(0);
    let inner = rows.iter().map(|hint| keys + 2 + width(&hint.help)).max().unwrap_or(0).max(40);
    let shown = body.height.saturating_sub(2);
    let first = row.min(to_u16(rows.len()).saturating_sub(shown));
    let mut canvas = window(cx, frame, body, t!("keys"), (inner, rows.len()));
    for (y, hint) in rows.iter().skip(usize::from(first)).enumerate() {
        let y = to_u16(y);
        if hint.key.is_empty() {
            canvas.text(0, y, &hint.label, cx.theme.dim());
        } else {
            let x = canvas.text(0, y, &pad(&hint.key, keys + 2), cx.theme.strong());
            canvas.text(x, y, &hint.help, cx.theme.normal());
        }
    }
}
