//! Asks for the correction of a counter: which one, by how much, and why.

use crate::t;
use std::sync::Arc;

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, line::Line, view_keys, window};
use crate::{
    plant::{
        alarm::command::NOTE_CHARS_MAX,
        command::{Command, CommandKind, Refusal},
        counter::check_correction,
        def::TagId,
        exact::Exact,
        number::to_u16,
    },
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        rights,
        widgets::{
            text::{fit, width, wrap},
            value,
        },
    },
};

/// Counters that are shown at once.
const ROWS: usize = 6;

/// The window.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Never empty.
    counters: Vec<TagId>,
    chosen: usize,
    amount: Line,
    reason: Line,
    /// What is typed goes into the reason, not into the amount.
    explains: bool,
    problem: Option<String>,
}

impl Correction {
    /// Of one of these counters, the one in this place first; `None` where there is none.
    pub fn new(counters: Vec<TagId>, chosen: usize) -> Option<Correction> {
        let chosen = chosen.min(counters.len().checked_sub(1)?);
        let (amount, reason) = (Line::default(), Line::long("", NOTE_CHARS_MAX));
        Some(Correction { counters, chosen, amount, reason, explains: false, problem: None })
    }

    /// The command, as far as it is known who may give it.
    pub fn command_kind(&self, amount: Exact) -> CommandKind {
        CommandKind::CorrectCounter { tag: self.counters[self.chosen], amount }
    }

    /// The keys of the moment.
    pub fn hints(&self) -> Vec<Hint> {
        let choose = (1 < self.counters.len()).then(|| Hint::in_window("↑↓", t!("select")));
        let other = if self.explains { t!("enter the amount") } else { t!("enter the reason") };
        let (enter, other) = (Hint::in_window("⏎", t!("correct")), Hint::in_window(t!("Tab"), other));
        let escape = Hint::in_window(t!("Esc"), t!("cancel"));
        [enter].into_iter().chain(choose).chain([other, escape]).collect()
    }

    pub(super) fn paste(&mut self, text: &str) {
        self.line().paste(text);
    }

    fn line(&mut self) -> &mut Line {
        if self.explains { &mut self.reason } else { &mut self.amount }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => return self.finish(cx),
            KeyCode::Up => self.chosen = self.chosen.saturating_sub(1),
            KeyCode::Down => self.chosen = (self.chosen + 1).min(self.counters.len() - 1),
            KeyCode::Tab => self.explains = !self.explains,
            _ if self.line().on_key(event) => self.problem = None,
            _ => {}
        }
        Next::Stay(Modal::Correction(Box::new(self)))
    }

    /// Checked as the station checks it, so that what is missing is said before anything is sent.
    fn finish(mut self, cx: &ViewContext) -> Next {
        let reason = Some(self.reason.text().trim()).filter(|words| !words.is_empty()).map(Arc::from);
        let is_cut = self.amount.missed() || self.reason.missed();
        // A reason can be missing only once there is an amount.
        let any = Some("?".into());
        let of_amount = |amount| check_correction(cx.def().tag(self.counters[self.chosen]), amount, any.as_ref());
        let amount = self.amount.text().trim().parse().map_err(|_| Refusal::NotAnAmount);
        let amount = amount.and_then(|amount| of_amount(amount).map(|()| amount));
        let checked = match (is_cut, &amount) {
            (true, _) => Err(t!("the text was cut; Ctrl-U clears the line").to_owned()),
            (false, Err(why)) => Err(why.to_string()),
            (false, Ok(amount)) => {
                let kind = self.command_kind(*amount);
                let checked = check_correction(cx.def().tag(self.counters[self.chosen]), *amount, reason.as_ref());
                match rights::missing(cx, &kind) {
                    None => checked.map(|()| kind).map_err(|why| why.to_string()),
                    Some(why) => Err(why),
                }
            }
        };
        match checked {
            Ok(kind) => Next::Do(vec![UiAction::SendCommand(Command { note: reason, ..kind.into() }, None)]),
            Err(why) => {
                (self.problem, self.explains) = (Some(why), amount.is_ok());
                Next::Stay(Modal::Correction(Box::new(self)))
            }
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let words =
            t!("What is added to what it counted, in its unit; below 0 it is taken away. It counts from now on.");
        let notes = wrap(words, room);
        let first = self.chosen.saturating_sub(ROWS - 1);
        let rows = self.counters.len().min(ROWS);
        let mut canvas = window(cx, frame, body, t!("correct a counter"), (room, notes.len() + rows + 7));
        for (y, note) in notes.iter().enumerate() {
            canvas.text(0, to_u16(y), note, theme.normal());
        }
        let mut y = to_u16(notes.len());
        let names = self.counters.iter().map(|tag| width(&cx.def().tag(*tag).name)).max().unwrap_or(0);
        for (place, tag) in self.counters.iter().enumerate().skip(first).take(rows) {
            let (def, is_chosen) = (cx.def().tag(*tag), place == self.chosen);
            let shown = value::show(cx, *tag);
            canvas.text(0, y, if is_chosen { theme.pick("▸ ", "> ") } else { "  " }, theme.strong());
            canvas.text(2, y, &def.name, if is_chosen { theme.focus() } else { theme.normal() });
            let x = canvas.text(4 + names, y, &shown.whole(), shown.style).max(18 + names) + 2;
            canvas.text(x, y, &fit(&def.label, room.saturating_sub(x)), theme.dim());
            y += 1;
        }
        let unit = cx.snapshot.unit(self.counters[self.chosen]);
        let [amount, reason] = [t!("amount:"), t!("reason:")];
        let x = canvas.text(0, y, amount, theme.dim()).max(width(reason)) + 1;
        let end = view_line(&self.amount, cx, &mut canvas, (x, y), !self.explains);
        canvas.text(end + 1, y, unit, theme.normal());
        canvas.text(0, y + 1, reason, theme.dim());
        view_line(&self.reason, cx, &mut canvas, (0, y + 2), self.explains);
        let problem = self.problem.clone().or_else(|| rights::missing(cx, &self.command_kind(Exact::from(1.0))));
        for (n, line) in wrap(&problem.unwrap_or_default(), room).iter().take(2).enumerate() {
            canvas.text(0, y + 3 + to_u16(n), line, theme.trouble());
        }
        view_keys(cx, &mut canvas, &self.hints());
    }
}

/// With a cursor where it is typed into.
fn view_line(line: &Line, cx: &ViewContext, canvas: &mut super::Canvas, (x, y): (u16, u16), is_typed: bool) -> u16 {
    if is_typed { line.view(cx.theme, canvas, x, y) } else { canvas.text(x, y, &line.text(), cx.theme.normal()) }
}
