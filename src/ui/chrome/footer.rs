//! The keys of the moment in the last row, and which of them stands where.

use super::super::{
    Model, ViewContext,
    global::{self, GlobalKey},
    keys::{Chord, Hint},
    layout::Size,
    rights,
    tabs::Tab,
    widgets::text::{Canvas, width},
};
use super::past;
use crate::t;

pub(super) struct Footer {
    /// Keys, each with its column.
    keys: Vec<(u16, Hint)>,
    /// Keys that the user may not press behind the role that they need, and their column.
    refused: Option<(u16, String)>,
}

impl Footer {
    /// As many keys as fit; those of every tab stand at the right end.
    pub fn new(model: &Model, cx: &ViewContext, columns: u16) -> Footer {
        // In seven bits the sign of Enter would be a slash, which is another key.
        let shown = |hint: Hint| Hint { key: cx.theme.enter(&hint.key), ..hint };
        let hints = match &model.modal {
            Some(modal) => modal.hints(cx),
            None if cx.is_past() => past::hints(model, cx),
            None if cx.size <= Size::Compact => super::compact_hints(model, cx),
            None => model.tabs.shown().hints(cx),
        };
        let typing = model.tabs.shown == Tab::Login && model.tabs.login.is_typing();
        let global = if model.modal.is_none() && !typing { global::keys() } else { Vec::new() };
        let global = global.into_iter().map(GlobalKey::hint).filter(|hint| !hint.label.is_empty());
        let mut tail: Vec<Hint> = global.map(shown).collect();
        let lacks = |hint: &Hint| hint.needs.filter(|role| rights::lacks(cx, *role).is_some());
        let (refused, hints): (Vec<Hint>, Vec<Hint>) =
            hints.into_iter().map(shown).partition(|hint| lacks(hint).is_some());
        let room = |hint: &Hint| width(&hint.key) + 1 + width(&hint.label) + 2;
        // A quarter of the row is for the keys of every tab, the last ones first.
        while 2 < tail.len() && columns / 4 < tail.iter().map(room).sum() {
            tail.remove(0);
        }
        let mut end = columns.saturating_sub(1 + tail.iter().map(room).sum::<u16>());
        let refused = refused.first().and_then(lacks).map(|role| {
            let named = |hint: &&Hint| !hint.label.is_empty();
            let keys: Vec<&str> = refused.iter().filter(named).map(|hint| hint.key.as_str()).collect();
            format!("{}: {}", rights::title(role), keys.join(" "))
        });
        // What may not be pressed is said before the least wanted of what may.
        let most = end.saturating_sub(refused.as_ref().map_or(0, |words| width(words) + 1));
        let mut keys = Vec::new();
        let mut x = 1;
        for (n, hint) in hints.iter().enumerate().filter(|(_, hint)| !hint.label.is_empty()) {
            let hint = n.checked_sub(1).and_then(|before| pair(&hints[before], hint)).unwrap_or_else(|| hint.clone());
            // The way out of a window stands behind what else it has.
            let way_out = hints.iter().skip(n + 1).find(|hint| model.modal.is_some() && hint.key == t!("Esc"));
            if x + room(&hint) + way_out.map_or(0, room) > most {
                if way_out.is_none() {
                    break;
                }
                continue;
            }
            let next = x + room(&hint);
            keys.push((x, hint));
            x = next;
        }
        let refused = refused.and_then(|keys| {
            let words = [t!("needs {keys}", keys), keys];
            words.into_iter().find(|words| x + width(words) < end).map(|words| (x, words))
        });
        for hint in tail {
            let next = end + room(&hint);
            keys.push((end, hint));
            end = next;
        }
        Footer { keys, refused }
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        for (x, hint) in &self.keys {
            let x = canvas.text(*x, 0, &hint.key, cx.theme.strong());
            canvas.text(x + 1, 0, &hint.label, cx.theme.dim());
        }
        if let Some((x, words)) = &self.refused {
            canvas.text(*x, 0, words, cx.theme.dim());
        }
    }

    /// The key that stands in a column.
    pub fn chord_at(&self, column: u16) -> Option<Chord> {
        let ends = |x: u16, hint: &Hint| x + width(&hint.key) + 1 + width(&hint.label);
        let key = self.keys.iter().find(|(x, hint)| (*x..ends(*x, hint)).contains(&column));
        key.and_then(|(_, hint)| hint.chord)
    }
}

/// Two keys that belong together as one: `↑↓ select`.
fn pair(before: &Hint, hint: &Hint) -> Option<Hint> {
    const PAIRS: &str = "←→←↑↓↑[]<>,.(){}";
    let together = before.label.is_empty() && PAIRS.contains(&format!("{}{}", before.key, hint.key));
    together.then(|| Hint { key: format!("{}{}", before.key, hint.key), ..hint.clone() })
}
