//! All fields of one audit entry: what the list has no room for.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Modal, Next,
    sheet::{Fact, Sheet},
    window,
};
use crate::{plant::record::ActionRecord, ui::ViewContext};

#[derive(Debug, Clone, PartialEq)]
pub struct AuditEntryDialog(pub ActionRecord);

impl AuditEntryDialog {
    pub(super) fn on_key(self, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Enter | KeyCode::Char('q') => Next::Close,
            _ => Next::Stay(Modal::AuditEntry(Box::new(self))),
        }
    }

    /// Name and words of every field that has a value.
    fn rows(&self, cx: &ViewContext) -> Vec<Fact> {
        let entry = &self.0;
        let notes = |words: &Option<std::sync::Arc<str>>| words.as_deref().unwrap_or_default().to_owned();
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
            (t!("old"), notes(&entry.old)),
            (t!("new"), notes(&entry.new)),
            (t!("outcome"), entry.outcome.to_string()),
            (t!("note"), notes(&entry.note)),
            (t!("hash"), chain_hash.1),
        ];
        let lines = lines.into_iter().filter(|(_, words)| !words.is_empty());
        lines.map(|(label, words)| Fact::new(label, words, cx.theme.normal())).collect()
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let columns = body.width.saturating_sub(8).min(76);
        let sheet = Sheet::new(self.rows(cx), columns, 0);
        let mut canvas = window(cx, frame, body, t!("audit entry"), (columns, sheet.len()));
        sheet.view(cx.theme, &mut canvas, 0);
    }
}
