//! All keys of the shown tab and of every tab, from their tables.

use crate::t;
use crate::text::translate;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, Target, window};
use crate::ui::{
    ViewContext,
    global::{self, GlobalKey},
    keys::Hint,
    replay_keys,
    tabs::{Tab, Tabs},
    widgets::{
        list::{Motion, first, on_screen},
        text::{fit_words, pad, width},
    },
};

pub(super) fn on_key(selected: usize, cx: &ViewContext, tabs: &Tabs, event: KeyEvent) -> Next {
    let rows = rows(cx, tabs);
    match event.code {
        KeyCode::Char('q' | '?') => Next::Close,
        KeyCode::Enter => match rows.get(selected).and_then(|hint| hint.chord) {
            Some(chord) => Next::Go(Target::Key(chord)),
            None => Next::Close,
        },
        _ => {
            let room = usize::from(cx.area.height.saturating_sub(2));
            let moved = Motion::from_key(event).map_or(selected, |motion| motion.to(selected, rows.len(), room));
            Next::Stay(Modal::Help(moved))
        }
    }
}

/// Headings and keys.
fn rows(cx: &ViewContext, tabs: &Tabs) -> Vec<Hint> {
    let own = tabs.shown().hints(cx);
    let offered = Tab::offered(cx);
    let there = global::keys().into_iter().filter(|key| key.tab().is_none_or(|tab| offered.contains(&tab)));
    let heading = |text: &str| Hint::new("", text, "");
    let replayed = replay_keys::KEYS.iter().copied().map(GlobalKey::hint);
    let past = [heading(""), heading(t!("past"))].into_iter().chain(replayed).filter(|_| cx.is_past());
    let own = own.into_iter().filter(|hint| !hint.help.is_empty());
    [heading(translate(tabs.shown.title()))]
        .into_iter()
        .chain(own)
        .chain(past)
        .chain([heading(""), heading(t!("every tab"))])
        .chain(there.map(GlobalKey::hint))
        .collect()
}

pub(super) fn view(selected: usize, cx: &ViewContext, tabs: &Tabs, frame: &mut Frame, body: Rect) {
    let rows = rows(cx, tabs);
    let keys = rows.iter().map(|hint| width(&hint.key)).max().unwrap_or(0);
    let inner = rows.iter().map(|hint| keys + 4 + width(&hint.help)).max().unwrap_or(0).max(40);
    let shown = usize::from(body.height.saturating_sub(2));
    let first = first(selected, rows.len(), shown);
    let mut canvas = window(cx, frame, body, t!("keys"), (inner, rows.len()));
    for (y, n, hint) in on_screen(&rows, first, shown) {
        if hint.key.is_empty() {
            canvas.text(0, y, &hint.label, cx.theme.dim());
        } else {
            let mark = if n == selected { cx.theme.pick("▸", ">") } else { " " };
            let x = canvas.text(0, y, &pad(&format!("{mark} {}", hint.key), keys + 4), cx.theme.strong());
            let help = fit_words(&hint.help, canvas.width().saturating_sub(x));
            canvas.text(x, y, &help, if n == selected { cx.theme.focus() } else { cx.theme.normal() });
        }
    }
}
