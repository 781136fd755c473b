//! Windows of the bus tab: sheets to read, and entries for tests.

pub(crate) mod start;
mod request;
mod send;
mod text;

use crossterm::event::KeyEvent;
use ratatui::{Frame, layout::Rect};

pub use request::{RequestForm, ask_sweep};
pub use send::Send;
pub use text::{Shown, TextWindow, dissection_rows, exchange_rows};

use super::{Modal, Next, UiAction};
use crate::{
    t,
    ui::{ViewContext, keys::Hint},
};

#[derive(Debug, Clone, PartialEq)]
pub enum Window {
    /// Something to read.
    Text(TextWindow),
    /// Bytes or words to be sent.
    Send(Send),
    Form(RequestForm),
}

impl Window {
    pub fn only_shows(&self) -> bool {
        matches!(self, Window::Text(_))
    }

    pub fn on_key(self, cx: &ViewContext, event: KeyEvent) -> Next {
        match self {
            Window::Text(text) => text.on_key(event),
            Window::Send(send) => send.on_key(cx, event),
            Window::Form(form) => form.on_key(cx, event),
        }
    }

    pub fn stay(self) -> Next {
        Next::Stay(Modal::Bus(Box::new(self)))
    }

    /// It stays, and what is filled in is kept for the next time.
    fn stay_and_keep(self) -> Next {
        let kept = UiAction::KeepTest(Box::new(self.clone()));
        Next::Both(Modal::Bus(Box::new(self)), vec![kept])
    }

    pub fn open(self) -> UiAction {
        UiAction::Open(Modal::Bus(Box::new(self)))
    }

    /// Pasted text goes into the entry.
    pub fn on_paste(&mut self, text: &str) {
        match self {
            Window::Send(send) => send.on_paste(text),
            Window::Form(form) => form.on_paste(text),
            Window::Text(_) => {}
        }
    }

    pub fn hints(&self) -> Vec<Hint> {
        let hint = |key: &str, label: &str| Hint::new(key, label, "");
        let close = hint(t!("Esc"), t!("close"));
        match self {
            Window::Text(_) => vec![hint("↑↓", t!("scroll")), close],
            Window::Send(_) => vec![hint("⏎", t!("send")), hint(t!("Tab"), t!("check on or off")), close],
            Window::Form(_) => {
                vec![hint("↑↓", t!("field")), hint("←→", t!("choose")), hint("⏎", t!("start")), close]
            }
        }
    }

    pub fn view(&self, cx: &ViewContext, screen: &mut Frame, body: Rect) {
        match self {
            Window::Text(text) => text.view(cx, screen, body),
            Window::Send(send) => send.view(cx, screen, body),
            Window::Form(form) => form.view(cx, screen, body),
        }
    }
}
