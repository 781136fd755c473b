//! Page Test: what a technician can try on a line, and what came of it; and the entry for bytes.

use super::results;
use crate::ui::tabs::prelude::*;
use crate::{
    plant::diagnostics::Diagnostic,
    ui::{
        line_view::LineView,
        modal::bus::{
            RequestForm, Send, Window,
            start::{self, TestKind},
        },
        widgets::rows,
    },
};

#[derive(Debug, Default)]
pub struct Bench {
    selected: usize,
    /// First row shown of the results; `None` until the first scroll.
    pub first: Option<usize>,
    /// What was typed last, and whether its check is left out.
    pub text: String,
    /// As it is typed, without a check.
    pub bare: bool,
    /// The form that was filled in last.
    pub form: Option<RequestForm>,
}

impl Bench {
    /// What was filled in, for the next time.
    pub fn keep(&mut self, window: Window) {
        match window {
            Window::Send(send) => (self.text, self.bare) = send.typed(),
            Window::Form(form) => self.form = Some(form),
            Window::Text(_) => {}
        }
    }

    pub fn selected(&self) -> TestKind {
        TestKind::ALL[self.selected.min(TestKind::ALL.len() - 1)]
    }

    pub fn open(&mut self, cx: &ViewContext, at: &LineView, kind: TestKind) -> Vec<UiAction> {
        self.selected = TestKind::ALL.iter().position(|known| *known == kind).unwrap_or(0);
        self.first = None;
        let window = match kind {
            TestKind::Bytes => Window::Send(Send::new(at.id, &self.text, self.bare)),
            TestKind::Request
            | TestKind::Loopback
            | TestKind::Plug
            | TestKind::Signal
            | TestKind::Identify
            | TestKind::Scan
            | TestKind::Sweep => {
                let last = self.form.take_if(|form| form.is(at.id, kind));
                Window::Form(last.unwrap_or_else(|| RequestForm::new(cx, at, kind)))
            }
        };
        // What is sent as it was typed may be a write.
        let diagnostic = match matches!(kind, TestKind::Bytes | TestKind::Request | TestKind::Plug | TestKind::Signal) {
            true => Diagnostic::Send(Vec::new()),
            false => Diagnostic::Identify { unit: 1 },
        };
        vec![Notice::or(cx, t!("test"), &CommandKind::Test(at.id, diagnostic), Modal::Bus(Box::new(window)))]
    }

    /// Single rows move the selection; pages scroll the results.
    pub fn scroll(&mut self, cx: &ViewContext, at: &LineView, motion: Motion) {
        if matches!(motion, Motion::Rows(_)) {
            self.selected = motion.to(self.selected, TestKind::ALL.len(), 1);
            return;
        }
        let room = usize::from(cx.area.height).saturating_sub(TOP as usize + 1).max(1);
        let count = results::rows(cx, at, cx.area.width).len();
        let end = rows::last_first(count, room);
        let first = self.first.unwrap_or_else(|| begin(at)).min(end);
        self.first = Some(motion.to(first, end + 1, room.saturating_sub(1)));
    }

    /// Draws it: the tests, then what came of the last one.
    pub fn view(&self, cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
        let theme = cx.theme;
        let (width, height) = (canvas.width(), canvas.height());
        let tests = height.saturating_sub(3).min(TOP - 2);
        let first = list::first(self.selected, TestKind::ALL.len(), usize::from(tests));
        for (y, (n, kind)) in TestKind::ALL.into_iter().enumerate().skip(first).take(usize::from(tests)).enumerate() {
            let [key, name, what] = kind.words().map(translate);
            let y = to_u16(y);
            let chosen = n == self.selected;
            let x = canvas.text(1, y, key, theme.strong());
            let x = canvas.text(x + 1, y, &pad(name, 18), if chosen { theme.focus() } else { theme.normal() });
            canvas.text(x + 1, y, &fit_words(what, width.saturating_sub(x + 2)), theme.dim());
        }
        canvas.run(1, tests, width.saturating_sub(2), '─', theme.dim());
        if let Some(why) = start::closed(at) {
            canvas.text(3, tests, &format!(" ! {} ", fit_words(&why, width.saturating_sub(10))), theme.trouble());
        }
        let rows = results::rows(cx, at, width);
        let mut below = canvas.part(0, tests + 1, width, height.saturating_sub(tests + 1));
        rows::draw(cx, &mut below, &rows, self.first.unwrap_or_else(|| begin(at)));
    }
}

/// First row of the results until the first scroll: what has one answer is read from its beginning, what goes on for
/// long is followed at its end.
fn begin(at: &LineView) -> usize {
    match at.status.test.as_ref().map(|run| &run.diagnostic) {
        Some(Diagnostic::Loopback { .. } | Diagnostic::Pattern { .. } | Diagnostic::Scan(_) | Diagnostic::Sweep(_)) => {
            usize::MAX
        }
        Some(
            Diagnostic::Send(_)
            | Diagnostic::Identify { .. }
            | Diagnostic::Read { .. }
            | Diagnostic::Write(_)
            | Diagnostic::Signal(_),
        )
        | None => 0,
    }
}

/// Rows of the tests with the line below them.
#[expect(clippy::cast_possible_truncation, reason = "a constant of one digit")]
const TOP: u16 = TestKind::ALL.len() as u16 + 2;

/// The last test once more.
pub fn again(cx: &ViewContext, at: &LineView) -> Vec<UiAction> {
    at.status.test.iter().filter_map(|run| start::start(cx, at, run.diagnostic.clone()).ok()).collect()
}

pub fn stop(at: &LineView) -> Vec<UiAction> {
    if at.is_testing() { vec![UiAction::Command(CommandKind::StopTest(at.id))] } else { Vec::new() }
}
