//! A text for the tab below, which says whether it can use it.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, instant, line::Line, window};
use crate::plant::number::to_u16;
use crate::ui::{
    ViewContext, keys,
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

/// What the tab below is asked to do.
#[derive(Debug)]
pub enum Asked {
    /// To take the text of this prompt, which stays where that cannot be used.
    Take(Prompt),
    /// To show the rows of its list with this text; the prompt stays, if there is one.
    Filter(Option<Prompt>, String),
    /// To move the selection of its list below this prompt.
    Step(Prompt, Motion),
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
    pub(super) fn cancel(self) -> Next {
        match self.taker {
            Taker::Filter(before) => Next::Ask(Asked::Filter(None, before)),
            Taker::Tab | Taker::Replay(_) => Next::Close,
        }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) {
            let text = self.line.text();
            return match self.taker {
                Taker::Tab => Next::Ask(Asked::Take(self)),
                Taker::Filter(_) => Next::Ask(Asked::Filter(None, text)),
                Taker::Replay(asked) => match instant::typed(cx, &text, asked) {
                    Ok(actions) => Next::Do(actions),
                    Err(problem) => self.refused(problem),
                },
            };
        }
        if self.line.on_key(event) {
            self.problem = None;
            if self.is_filter() {
                let text = self.line.text();
                return Next::Ask(Asked::Filter(Some(self), text));
            }
        } else if let Some(motion) = Motion::from_key(event).filter(|_| self.is_filter()) {
            return Next::Ask(Asked::Step(self, motion));
        }
        Next::Stay(Modal::Prompt(self))
    }

    /// It stays, and says why the text was not taken.
    pub fn refused(self, problem: String) -> Next {
        Next::Stay(Modal::Prompt(Prompt { problem: Some(problem), ..self }))
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
