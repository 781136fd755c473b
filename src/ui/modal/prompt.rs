//! A text for the tab below, which says whether it can use it.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, line::Line, window};
use crate::ui::{ViewContext, keys, replay, tabs::Tabs, widgets::text::width};

/// A prompt with one line for the answer; the shown tab's `on_text` takes it, or the replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Prompt {
    /// What is asked.
    pub title: String,
    /// The form that is expected, with an example.
    pub hint: String,
    /// What has been typed.
    pub line: Line,
    /// Why the last Enter was not taken.
    pub problem: Option<String>,
    /// The answer is an instant for the replay, not for the tab.
    replay: Option<replay::Asked>,
}

impl Prompt {
    /// A prompt with a text to start from.
    pub fn new(title: impl Into<String>, hint: impl Into<String>, text: &str) -> Prompt {
        Prompt { title: title.into(), hint: hint.into(), line: Line::new(text), problem: None, replay: None }
    }

    /// The answer is an instant to replay.
    pub fn for_replay(self, asked: replay::Asked) -> Prompt {
        Prompt { replay: Some(asked), ..self }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, tabs: &mut Tabs, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) {
            let text = self.line.text();
            let taken = match self.replay {
                Some(asked) => replay::typed(cx, &text, asked),
                None => tabs.shown_mut().on_text(cx, &text),
            };
            match taken {
                Ok(acts) => return Next::Do(acts),
                Err(problem) => self.problem = Some(problem),
            }
        } else if self.line.on_key(event) {
            self.problem = None;
        }
        Next::Stay(Modal::Prompt(self))
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let problem = self.problem.clone().unwrap_or_default();
        let inner = width(&self.hint).max(width(&problem)).max(width(&self.line.text()) + 1).max(40);
        let mut canvas = window(cx, frame, body, &self.title, (inner, 5));
        canvas.text(0, 0, &self.hint, cx.theme.dim());
        self.line.view(cx.theme, &mut canvas, 0, 1);
        canvas.text(0, 3, &problem, cx.theme.trouble());
        canvas.text(0, 4, &cx.theme.enter(t!("⏎ OK   Esc cancel")), cx.theme.strong());
    }
}
