//! Words to be read: why something cannot be done now.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, window};
use crate::{
    plant::{command::CommandKind, def::DeviceId, event::LineState, snapshot::DeviceState},
    ui::{
        UiAction, ViewContext, rights,
        widgets::text::{clock, width, wrap},
    },
};

/// A message without a choice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    title: String,
    words: Vec<String>,
    /// The first line is why it is there.
    worry: bool,
}

impl Notice {
    /// Why nothing can be written to this device now; `None` if it can be tried.
    pub fn unreachable(cx: &ViewContext, device: DeviceId) -> Option<Notice> {
        let def = cx.def().device(device);
        let why = Notice::why_unreachable(cx, device)?;
        let words =
            vec![t!("{name} is not responding", name = def.name), why, t!("Writing is not possible now.").to_owned()];
        Some(Notice::new(def.name.clone(), words))
    }

    /// The same as one sentence.
    pub fn why_unreachable(cx: &ViewContext, device: DeviceId) -> Option<String> {
        let def = cx.def().device(device);
        let line = &cx.def().line(def.line).name;
        let why = match (&cx.snapshot.line(def.line).state, cx.snapshot.device(device).state) {
            (LineState::Disconnected, _) => t!("Line {line} was disconnected by an operator.", line),
            (LineState::Testing, _) => t!("Line {line} is in use by a test (tab Bus).", line),
            (LineState::Waiting { why, .. }, _) => t!("Line {line} is not connected: {why}.", line, why),
            (LineState::Connecting, _) => t!("Line {line} is connecting.", line),
            (LineState::Connected, DeviceState::Down { since }) => {
                t!("No data received since {clock}.", clock = clock(since, &cx.def().time_zone))
            }
            (LineState::Connected, DeviceState::Unknown | DeviceState::Responding | DeviceState::Failing(_)) => {
                return None;
            }
        };
        Some(why)
    }

    /// Opens a form that ends in this command, or says why the present user may not give it, before anything is filled in.
    pub fn or(cx: &ViewContext, title: &str, kind: &CommandKind, window: Modal) -> UiAction {
        UiAction::Open(match rights::missing(cx, kind) {
            Some(why) => Modal::Notice(Notice::new(title, vec![why])),
            None => window,
        })
    }

    /// Words to be read, the first line as the worry.
    pub fn new(title: impl Into<String>, words: Vec<String>) -> Notice {
        Notice { title: title.into(), words, worry: true }
    }

    /// A list without a worry; the first lines where there is not room for all.
    pub fn list(title: impl Into<String>, words: Vec<String>) -> Notice {
        Notice { title: title.into(), words, worry: false }
    }

    pub(super) fn on_key(self, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Enter | KeyCode::Char('q') => Next::Close,
            _ => Next::Stay(Modal::Notice(self)),
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let room = body.width.saturating_sub(8).min(64);
        let rows: Vec<String> = self.words.iter().flat_map(|words| wrap(words, room)).collect();
        let inner = rows.iter().map(|row| width(row)).max().unwrap_or(0);
        let mut canvas = window(cx, frame, body, &self.title, (inner, rows.len() + 2));
        for (y, row) in rows.iter().enumerate() {
            let style = if y == 0 && self.worry { cx.theme.trouble() } else { cx.theme.normal() };
            canvas.text(0, y, row, style);
        }
        let last = canvas.height().saturating_sub(1);
        canvas.text(0, last, t!("Esc close"), cx.theme.strong());
    }
}
