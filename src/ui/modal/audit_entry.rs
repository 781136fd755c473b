//! All fields of one audit entry: what the list has no room for.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, window};
use crate::{
    plant::{number::to_u16, record::ActionRecord},
    ui::{
        ViewContext,
        widgets::text::{pad, wrap},
    },
};

/// Columns of the names at the left.
const NAMES: u16 = 8;

/// The dialog.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditEntryDialog(pub ActionRecord);

impl AuditEntryDialog {
    pub(super) fn on_key(self, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Enter | KeyCode::Char('q') => Next::Close,
            _ => Next::Stay(Modal::AuditEntry(Box::new(self))),
        }
    }

    /// Name and words of every line that says something.
    fn lines(&self, cx: &ViewContext) -> Vec<(&'static str, String)> {
        let entry = &self.0;
        let told = |words: &Option<std::sync::Arc<str>>| words.as_deref().unwrap_or_default().to_owned();
        let at = entry.at.to_zoned(cx.def().time_zone.clone()).strftime("%Y-%m-%d %H:%M:%S %:z").to_string();
        let chain_hash =
            entry.chain_hash.map_or((String::new(), t!("not in the audit log").to_owned()), |chain_hash| {
                (chain_hash.number.to_string(), chain_hash.hash_hex())
            });
        let lines = [
            (t!("number"), chain_hash.0),
            (t!("time"), at),
            (t!("who"), entry.by.to_string()),
            (t!("from"), entry.from.to_string()),
            (t!("action"), entry.action.to_string()),
            (t!("target"), entry.target.to_string()),
            (t!("old"), told(&entry.old)),
            (t!("new"), told(&entry.new)),
            (t!("outcome"), entry.outcome.to_string()),
            (t!("note"), told(&entry.note)),
            (t!("hash"), chain_hash.1),
        ];
        lines.into_iter().filter(|(_, words)| !words.is_empty()).collect()
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let room = body.width.saturating_sub(8).min(76).saturating_sub(NAMES).max(1);
        let lines = self.lines(cx).into_iter().map(|(name, words)| (name, broken(&words, room)));
        let lines: Vec<(&str, Vec<String>)> = lines.collect();
        let height = lines.iter().map(|(_, rows)| to_u16(rows.len())).sum::<u16>();
        let mut canvas = window(cx, frame, body, t!("audit entry"), (room + NAMES, height));
        let mut y = 0;
        for (name, rows) in &lines {
            canvas.text(0, y, &pad(name, NAMES), cx.theme.dim());
            for row in rows {
                canvas.text(NAMES, y, row, cx.theme.normal());
                y += 1;
            }
        }
    }
}

/// Words in lines of so many columns; a word that is longer, as a hash is, goes on in the next one.
fn broken(words: &str, room: u16) -> Vec<String> {
    if words.contains(' ') {
        return wrap(words, room);
    }
    let chars: Vec<char> = words.chars().collect();
    chars.chunks(usize::from(room)).map(|part| part.iter().collect()).collect()
}
