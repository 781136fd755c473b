//! A text for the tab below, which says whether it can use it.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, instant, line::Line, window};
use crate::plant::number::to_u16;
use crate::ui::{
    UiAction, ViewContext, keys,
    tabs::{ListPage, Tabs},
    widgets::{
        list::Motion,
        text::{Canvas, width, wrap},
    },
};

/// A prompt with one line for the answer; the shown tab's `on_text` takes it, its list while it is typed, or the replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Prompt {
    pub title: String,
    /// The form that is expected, with an example.
    pub hint: String,
    pub line: Line,
    /// Why the last Enter was not taken.
    pub problem: Option<String>,
    taker: Taker,
}

#[derive(Debug, Clone, PartialEq)]
enum Taker {
    Tab,
    /// The replay: it is an instant.
    Replay(instant::Asked),
    /// The list of the tab, with each letter; it had this filter before.
    Filter(String),
}

impl Prompt {
    /// A prompt with a text to start from.
    pub fn new(title: impl Into<String>, hint: impl Into<String>, text: &str) -> Prompt {
        Prompt { title: title.into(), hint: hint.into(), line: Line::offered(text), problem: None, taker: Taker::Tab }
    }

    /// The answer is an instant to replay.
    pub fn for_replay(self, asked: instant::Asked) -> Prompt {
        Prompt { taker: Taker::Replay(asked), ..self }
    }

    /// The filter of the list of the tab, in force while it is typed.
    pub fn filter(text: &str, hint: &str) -> Prompt {
        Prompt { taker: Taker::Filter(text.to_owned()), line: Line::new(text), ..Prompt::new(t!("filter"), hint, "") }
    }

    /// Is it typed below what it changes?
    pub(super) fn is_filter(&self) -> bool {
        matches!(self.taker, Taker::Filter(_))
    }

    /// Esc: a filter is again what it was.
    pub(super) fn cancel(&self, cx: &ViewContext, tabs: &mut Tabs) {
        if let (Taker::Filter(before), Some(list)) = (&self.taker, tabs.shown_mut().list_mut(cx)) {
            list.set_filter(cx, before);
        }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, tabs: &mut Tabs, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) {
            let text = self.line.text();
            let taken = match self.taker {
                Taker::Replay(asked) => instant::typed(cx, &text, asked),
                Taker::Tab => tabs.shown_mut().on_text(cx, &text),
                Taker::Filter(_) => Ok(filter(cx, tabs, |list| list.set_filter(cx, &text))),
            };
            match taken {
                Ok(acts) => return Next::Do(acts),
                Err(problem) => self.problem = Some(problem),
            }
        } else if self.line.on_key(event) {
            self.problem = None;
            if self.is_filter() {
                let actions = filter(cx, tabs, |list| list.set_filter(cx, &self.line.text()));
                return Next::Both(Modal::Prompt(self), actions);
            }
        } else if let Some(motion) = Motion::from_key(event).filter(|_| self.is_filter()) {
            let actions = filter(cx, tabs, |list| list.step(cx, motion));
            return Next::Both(Modal::Prompt(self), actions);
        }
        Next::Stay(Modal::Prompt(self))
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        if self.is_filter() {
            let area = Rect { y: body.bottom().saturating_sub(1), height: body.height.min(1), ..body };
            let mut canvas = Canvas::new(frame.buffer_mut(), area);
            canvas.clear();
            let x = canvas.text(1, 0, &self.title, cx.theme.dim()) + 1;
            self.line.view(cx.theme, &mut canvas, x, 0);
            if self.line.text().is_empty() {
                canvas.text(x + 2, 0, &self.hint, cx.theme.dim());
            }
            return;
        }
        let room = body.width.saturating_sub(8);
        // Blanks part the examples of a hint in one line.
        let lines = |text: &str| {
            if width(text) <= room { vec![text.to_owned()] } else { wrap(&text.replace("   ", ", "), room) }
        };
        let [hint, problem] = [self.hint.as_str(), self.problem.as_deref().unwrap_or_default()].map(lines);
        let widest = hint.iter().chain(&problem).map(|line| width(line)).max().unwrap_or(0);
        let inner = widest.max((width(&self.line.text()) + 1).min(room)).max(40);
        let (above, below) = (to_u16(hint.len()), to_u16(problem.len()));
        let mut canvas = window(cx, frame, body, &self.title, (inner, above + below + 3));
        for (y, line) in hint.iter().enumerate() {
            canvas.text(0, to_u16(y), line, cx.theme.dim());
        }
        self.line.view(cx.theme, &mut canvas, 0, above);
        for (y, line) in problem.iter().enumerate() {
            canvas.text(0, above + 2 + to_u16(y), line, cx.theme.trouble());
        }
        canvas.text(0, above + below + 2, &cx.theme.enter(t!("⏎ OK   Esc cancel")), cx.theme.strong());
    }
}

/// Changes the list of the tab, which then asks for what it shows.
fn filter(cx: &ViewContext, tabs: &mut Tabs, change: impl FnOnce(&mut dyn ListPage)) -> Vec<UiAction> {
    if let Some(list) = tabs.shown_mut().list_mut(cx) {
        change(list);
    }
    tabs.shown_mut().on_snapshot(cx)
}
