//! Asks for the correction of a counter: which one, by how much, and why.

use crate::t;
use crate::text::of_plant;
use std::sync::Arc;

use crossterm::event::KeyEvent;
use ratatui::{Frame, layout::Rect};

use super::{
    Modal, Next,
    form::{self, Field, Form, KeyOutcome},
    view_keys, window,
};
use crate::{
    plant::{
        alarm::command::NOTE_CHARS_MAX,
        command::{Command, CommandKind, Refusal},
        counter_watch::check_correction,
        def::{PlantDef, TagId},
        exact::Exact,
        number::to_u16,
    },
    ui::{
        UiAction, ViewContext,
        keys::Hint,
        rights,
        widgets::{
            text::{fit, wrap},
            value,
        },
    },
};

/// The fields of the form, in their order.
const COUNTER: usize = 0;
const AMOUNT: usize = 1;
const REASON: usize = 2;
const AMOUNT_CHARS: usize = 64;

#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Never empty.
    counters: Vec<TagId>,
    form: Form,
    problem: Option<String>,
}

impl Correction {
    /// Of one of these counters, the one in this place first; `None` where there is none.
    pub fn new(def: &PlantDef, counters: Vec<TagId>, chosen: usize) -> Option<Correction> {
        let chosen = chosen.min(counters.len().checked_sub(1)?);
        let fields = vec![
            Field::choice(t!("counter"), counters.iter().map(|tag| def.tag(*tag).name.as_str()), chosen),
            Field::text(t!("amount"), "", AMOUNT_CHARS),
            Field::text(t!("reason"), "", NOTE_CHARS_MAX),
        ];
        Some(Correction { counters, form: Form::submitting(fields, AMOUNT), problem: None })
    }

    fn tag(&self) -> TagId {
        self.counters[self.form.chosen(COUNTER)]
    }

    /// The command, as far as it is known who may give it.
    pub fn command_kind(&self, amount: Exact) -> CommandKind {
        CommandKind::CorrectCounter { tag: self.tag(), amount }
    }

    pub fn hints(&self) -> Vec<Hint> {
        let change = self.form.is_on_choice().then(|| Hint::in_window("←→", t!("change")));
        let (enter, select) = (Hint::in_window("⏎", t!("correct")), Hint::in_window("↑↓", t!("select")));
        [Some(enter), Some(select), change, Some(Hint::in_window(t!("Esc"), t!("cancel")))]
            .into_iter()
            .flatten()
            .collect()
    }

    pub(super) fn paste(&mut self, text: &str) {
        self.form.paste(text);
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        match self.form.on_key(event) {
            KeyOutcome::Submitted => return self.finish(cx),
            KeyOutcome::Taken => self.problem = None,
            KeyOutcome::Ignored => {}
        }
        Next::Stay(Modal::Correction(Box::new(self)))
    }

    /// Checked as the station checks it, so that what is missing is said before anything is sent.
    fn finish(mut self, cx: &ViewContext) -> Next {
        let reason = Some(self.form.text(REASON)).filter(|words| !words.is_empty()).map(Arc::from);
        let check = |amount, reason: Option<&Arc<str>>| check_correction(cx.def().tag(self.tag()), amount, reason);
        // A reason can be missing only once there is an amount.
        let any = Some("?".into());
        let amount = self.form.text(AMOUNT).parse().map_err(|_| Refusal::NotAnAmount);
        let amount = amount.and_then(|amount| check(amount, any.as_ref()).map(|()| amount));
        let checked = match (self.form.is_cut(), &amount) {
            (true, _) => Err(form::cut()),
            (false, Err(why)) => Err(why.to_string()),
            (false, Ok(amount)) => {
                let kind = self.command_kind(*amount);
                match rights::missing(cx, &kind) {
                    None => check(*amount, reason.as_ref()).map(|()| kind).map_err(|why| why.to_string()),
                    Some(why) => Err(why),
                }
            }
        };
        match checked {
            Ok(kind) => Next::Do(vec![UiAction::SendCommand(Command { note: reason, ..kind.into() }, None)]),
            Err(why) => {
                self.form.select(if amount.is_ok() { REASON } else { AMOUNT });
                self.problem = Some(why);
                Next::Stay(Modal::Correction(Box::new(self)))
            }
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(8).min(72);
        let words =
            t!("Amount to add to what it has counted, in its unit; below 0: to subtract. It counts from now on.");
        let notes: Vec<_> = wrap(words, room).into_iter().map(|note| (note, theme.normal())).collect();
        let (above, rows) = (to_u16(notes.len()), self.form.rows());
        let mut canvas = window(cx, frame, body, t!("correct a counter"), (room, above + rows + 5));
        canvas.rows(0, 0, &notes);
        for drawn in self.form.view(cx, &mut canvas, self.form.labels(), above..above + rows) {
            let (x, tag) = (drawn.end + 2, self.tag());
            match drawn.field {
                COUNTER => {
                    let shown = value::show(cx, tag);
                    let x = canvas.text(x, drawn.y, &shown.whole(), shown.style) + 2;
                    canvas.text(
                        x,
                        drawn.y,
                        &fit(of_plant(&cx.def().tag(tag).label), room.saturating_sub(x)),
                        theme.dim(),
                    );
                }
                AMOUNT => drop(canvas.text(x, drawn.y, cx.snapshot.unit(tag), theme.normal())),
                _ => {}
            }
        }
        let problem = self.problem.clone().or_else(|| rights::missing(cx, &self.command_kind(Exact::from(1.0))));
        for (n, line) in wrap(&problem.unwrap_or_default(), room).iter().take(2).enumerate() {
            canvas.text(0, above + rows + 1 + to_u16(n), line, theme.trouble());
        }
        view_keys(cx, &mut canvas, &self.hints());
    }
}
