//! "Do it or not": the window that carries an action to confirm.

use crate::text::of_plant;
use std::sync::Arc;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect, style::Style};

use super::{
    Faceplate, Modal, Next,
    confirmed_value::ConfirmedValue,
    form::{Field, Form, KeyOutcome},
    plant_command, window,
    write_words::{old_and_new, wire_text, write_notes},
};
use crate::{
    access::{Credentials, control::reauthentication},
    plant::{
        alarm::AlarmCommand,
        command::{Command, CommandKind},
        def::TagId,
        diagnostics::Diagnostic,
        entry,
        exact::Exact,
        number::to_u16,
        role::Reauthentication,
    },
    ui::{
        Effect, Leaving, UiAction, ViewContext, interlock, keys, rights,
        widgets::text::{Canvas, width, wrap},
    },
};

/// An action to confirm and what the operator is asked about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Confirm {
    action: ConfirmAction,
    title: String,
    notes: Vec<String>,
    /// Where it was asked from, and where it leads back to.
    back: Option<Faceplate>,
    /// What its reader saw, where a value is written.
    expected: Option<ConfirmedValue>,
    /// What the tag asks for again.
    reauthentication: Option<Form>,
    /// Why the last Enter was not taken.
    problem: Option<String>,
    /// The command has been sent; the station checks the credentials.
    waiting: bool,
}

/// What a confirmed window does.
#[derive(Debug, Clone, PartialEq)]
pub enum ConfirmAction {
    Quit,
    Command(CommandKind),
}

impl Confirm {
    /// Leave? Says what ends with it.
    pub fn quit(leaving: Leaving) -> Confirm {
        let ends = match leaving {
            Leaving::Station => t!("Polling and alarms stop too: the station runs in this terminal."),
            Leaving::Demo => t!("The demonstration ends: its simulated plant, polling and alarms stop."),
            Leaving::Bench => t!("The device stays as it is. Reading ends, and so does a log."),
            Leaving::Log => t!("The log stays as it is."),
            Leaving::Terminal => t!("Only this terminal closes. Polling and alarms continue."),
        };
        Confirm::new(ConfirmAction::Quit, t!("quit"), vec![t!("Quit?").to_owned(), ends.to_owned()])
    }

    fn new(action: ConfirmAction, title: impl Into<String>, notes: Vec<String>) -> Confirm {
        Confirm {
            action,
            title: title.into(),
            notes,
            back: None,
            expected: None,
            reauthentication: None,
            problem: None,
            waiting: false,
        }
    }

    pub fn is_quit(&self) -> bool {
        self.action == ConfirmAction::Quit
    }

    /// Write this value, as the device will hold it? Old and new value are drawn from the action, so they cannot differ from
    /// what is sent.
    pub fn write(cx: &ViewContext, tag: TagId, value: impl Into<Exact>) -> Confirm {
        let value = value.into();
        let def = cx.def().tag(tag);
        let rounded = entry::rounded_text(cx.snapshot, tag, value);
        let value = entry::as_confirmed(cx.snapshot, tag, value);
        let action = ConfirmAction::Command(CommandKind::Write { tag, value });
        let notes = rounded.into_iter().chain(write_notes(def)).collect();
        let confirm = Confirm::new(action, t!("write {name}", name = def.name), notes);
        Confirm { expected: Some(ConfirmedValue::new(cx, tag)), ..confirm }.with_reauthentication(cx)
    }

    /// Write this text?
    pub(super) fn text(cx: &ViewContext, tag: TagId, text: &str, seen: Option<Arc<str>>) -> Confirm {
        let def = cx.def().tag(tag);
        let action = ConfirmAction::Command(CommandKind::WriteText { tag, text: text.into(), seen });
        Confirm::new(action, t!("write {name}", name = def.name), write_notes(def)).with_reauthentication(cx)
    }

    /// The same, asked from a faceplate, with words of its own above all others.
    pub fn from_faceplate(cx: &ViewContext, tag: TagId, value: f64, words: Option<String>, back: Faceplate) -> Confirm {
        let confirm = Confirm::write(cx, tag, value);
        let notes = words.into_iter().chain(confirm.notes).collect();
        Confirm { notes, back: Some(back), ..confirm }
    }

    /// A write with words of its own (an action of a device).
    pub fn action(cx: &ViewContext, tag: TagId, value: f64, name: &str, words: &str) -> Confirm {
        let confirm = Confirm::write(cx, tag, value);
        // The tag may ask the same.
        let own = of_plant(words).to_owned();
        let notes = confirm.notes.into_iter().filter(|note| *note != own);
        let notes = [own.clone()].into_iter().chain(notes).collect();
        let name = of_plant(name);
        Confirm { title: format!("{name} {}", cx.def().device(cx.def().tag(tag).device).name), notes, ..confirm }
    }

    /// Open or close a line, or any other command, with words of its own.
    pub fn command(title: impl Into<String>, words: impl Into<String>, kind: CommandKind) -> Confirm {
        Confirm::new(ConfirmAction::Command(kind), title, vec![words.into()])
    }

    /// The same with reauthentication, if a tag that it writes requires it.
    pub fn with_reauthentication(self, cx: &ViewContext) -> Confirm {
        let reauthentication = match &self.action {
            ConfirmAction::Command(kind) => reauthentication::required(cx.def(), kind).map(reauthentication_form),
            ConfirmAction::Quit => None,
        };
        Confirm { reauthentication, ..self }
    }

    /// The faceplate that it was asked from.
    pub(super) fn back(self) -> Option<Faceplate> {
        self.back
    }

    /// The same with more to read.
    pub fn with_notes(mut self, notes: impl IntoIterator<Item = String>) -> Confirm {
        self.notes.extend(notes);
        self
    }

    pub fn verb(&self) -> &'static str {
        match &self.action {
            ConfirmAction::Quit => t!("quit"),
            ConfirmAction::Command(CommandKind::Write { .. } | CommandKind::WriteText { .. }) => t!("write and verify"),
            ConfirmAction::Command(CommandKind::Alarm(alarm_command)) => match alarm_command {
                AlarmCommand::Acknowledge { .. } | AlarmCommand::AcknowledgeAll { .. } => t!("acknowledge"),
                AlarmCommand::Silence => t!("silence"),
                AlarmCommand::Reset(_) => t!("reset"),
                AlarmCommand::Shelve { .. } => t!("shelve"),
                AlarmCommand::Unshelve(_) => t!("unshelve"),
                AlarmCommand::OutOfService(_) => t!("take out of service"),
                AlarmCommand::InService(_) => t!("return to service"),
                AlarmCommand::Tick { .. } => t!("tick"),
            },
            ConfirmAction::Command(CommandKind::Refresh(_)) => t!("refresh"),
            ConfirmAction::Command(CommandKind::Connect(_, true)) => t!("connect"),
            ConfirmAction::Command(CommandKind::Connect(_, false)) => t!("disconnect"),
            ConfirmAction::Command(CommandKind::Configure(_)) => t!("apply these settings"),
            ConfirmAction::Command(CommandKind::SaveSettings(_)) => t!("save"),
            ConfirmAction::Command(CommandKind::Test(_, Diagnostic::Scan(_))) => t!("scan"),
            ConfirmAction::Command(CommandKind::Test(_, Diagnostic::Sweep(_))) => t!("map"),
            ConfirmAction::Command(CommandKind::Test(_, Diagnostic::Write(_))) => t!("write and verify"),
            ConfirmAction::Command(CommandKind::Test(_, Diagnostic::Signal(_))) => t!("start"),
            ConfirmAction::Command(CommandKind::Test(..)) => t!("send"),
            ConfirmAction::Command(CommandKind::StopTest(_) | CommandKind::StopRestore(_)) => t!("stop"),
            ConfirmAction::Command(CommandKind::StartProcedure(_)) => t!("start"),
            ConfirmAction::Command(CommandKind::AbortProcedure(_)) => t!("abort"),
            ConfirmAction::Command(CommandKind::ReadSets) => t!("read"),
            ConfirmAction::Command(CommandKind::CorrectCounter { .. }) => t!("correct"),
            ConfirmAction::Command(CommandKind::HandOver) => t!("hand over"),
            ConfirmAction::Command(CommandKind::TakeOver) => t!("take over"),
            ConfirmAction::Command(CommandKind::SaveSet { replace: true, .. }) => t!("replace it"),
            ConfirmAction::Command(CommandKind::SaveSet { replace: false, .. }) => t!("save"),
            ConfirmAction::Command(CommandKind::Restore(_)) => t!("write and verify"),
        }
    }

    /// What is sent to a line past all limits of the plant file comes behind an Enter: a second one must not send it.
    fn wants_y(&self) -> bool {
        matches!(&self.action, ConfirmAction::Command(CommandKind::Test(..)))
    }

    /// The key that does it.
    pub fn key(&self) -> &'static str {
        if self.wants_y() { "y" } else { "⏎" }
    }

    pub fn escape(&self) -> &'static str {
        if self.is_quit() { t!("stay") } else { t!("cancel") }
    }

    fn written_tag(&self) -> Option<TagId> {
        match &self.action {
            ConfirmAction::Command(kind) => kind.written_tag(),
            ConfirmAction::Quit => None,
        }
    }

    /// Is it certainly without effect now?
    pub(super) fn is_refused(&self, cx: &ViewContext) -> bool {
        match &self.action {
            ConfirmAction::Command(CommandKind::Write { tag, value }) => interlock::is_refused(cx, *tag, *value),
            ConfirmAction::Command(_) | ConfirmAction::Quit => false,
        }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        let enter = keys::code(KeyCode::Enter).is(event) && !self.wants_y();
        if self.waiting {
            return Next::Stay(Modal::Confirm(self));
        }
        if let Some(form) = &mut self.reauthentication {
            // Letters belong to the name and the password.
            match form.on_key(event) {
                KeyOutcome::Submitted => return self.yes(cx),
                KeyOutcome::Taken => self.problem = None,
                KeyOutcome::Ignored => {}
            }
            return Next::Stay(Modal::Confirm(self));
        }
        if enter || keys::char('y').is(event) {
            self.yes(cx)
        } else if keys::char('n').is(event) || keys::char('q').is(event) {
            match self.back {
                Some(back) => Next::Stay(Modal::Faceplate(back)),
                None => Next::Close,
            }
        } else {
            let write = self.written_tag().is_some();
            let other = plant_command::command_of(cx, event).filter(|_| write);
            Next::Stay(other.unwrap_or(Modal::Confirm(self)))
        }
    }

    /// Does it, unless something has changed, is missing, or makes it useless.
    fn yes(mut self, cx: &ViewContext) -> Next {
        let refused = self.is_refused(cx);
        if refused || self.expected.as_mut().is_some_and(|expected| expected.changed(cx)) {
            return Next::Stay(Modal::Confirm(self));
        }
        if let Some(why) = self.reauthentication.as_mut().and_then(Form::lacking) {
            self.problem = Some(why);
            return Next::Stay(Modal::Confirm(self));
        }
        let act = match &self.action {
            ConfirmAction::Quit => UiAction::Do(Effect::Quit),
            ConfirmAction::Command(kind) => {
                let expected = self.expected.as_ref().and_then(|expected| expected.shown(cx));
                let credentials = self.reauthentication.as_ref().map(credentials);
                UiAction::SendCommand(Command { expected_value: expected, ..kind.clone().into() }, credentials)
            }
        };
        if self.reauthentication.is_some() {
            // After a refusal the password line stays open: the next keys must not reach the tab below.
            (self.waiting, self.problem) = (true, None);
            return Next::Both(Modal::Confirm(self), vec![act]);
        }
        match self.back {
            Some(back) => Next::Both(Modal::Faceplate(back), vec![act]),
            None => Next::Do(vec![act]),
        }
    }

    /// Is a name or password typed into it?
    pub(super) fn takes_text(&self) -> bool {
        self.reauthentication.is_some()
    }

    /// Whether the station still checks the credentials.
    pub(in crate::ui) fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// What is left once the station has spoken: the same window if the credentials were refused, else where it was
    /// asked from.
    pub(in crate::ui) fn answered(mut self, refused: Option<String>) -> Option<Modal> {
        let Some(why) = refused else { return self.back.map(Modal::Faceplate) };
        (self.waiting, self.problem) = (false, Some(why));
        if let Some(form) = &mut self.reauthentication {
            form.forget();
        }
        Some(Modal::Confirm(self))
    }

    /// Pasted text: a password or a name, where one is asked for.
    pub(super) fn on_paste(&mut self, text: &str) {
        if let Some(form) = self.reauthentication.as_mut().filter(|_| !self.waiting) {
            form.paste(text);
        }
    }

    /// What of the window is below the words: rows of the form and of what is wrong with it.
    fn view_reauthentication(&self, cx: &ViewContext, canvas: &mut Canvas, y: u16) {
        if let Some(form) = &self.reauthentication {
            let rows = y..y + form.rows();
            form.view(cx, canvas, form.labels(), rows.clone());
            let y = rows.end;
            if self.waiting {
                canvas.text(0, y, t!("waiting for the station …"), cx.theme.dim());
            }
            let room = canvas.width();
            for (n, words) in self.problem.iter().flat_map(|words| wrap(words, room)).enumerate() {
                canvas.text(0, y + to_u16(n), &words, cx.theme.trouble());
            }
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let room = body.width.saturating_sub(8).min(68);
        let mut rows: Vec<(String, Style)> = Vec::new();
        if let ConfirmAction::Command(kind) = &self.action
            && let Some((tag, new)) = cx.snapshot.written(kind)
        {
            let change = old_and_new(cx, tag, &new);
            let lines = if width(&change) <= room { vec![change] } else { wrap(&change, room) };
            rows.extend(lines.into_iter().map(|line| (line, cx.theme.strong())));
            rows.push((wire_text(cx.def().tag(tag)), cx.theme.dim()));
        }
        rows.extend(self.notes.iter().flat_map(|note| wrap(note, room)).map(|line| (line, cx.theme.normal())));
        if let ConfirmAction::Command(CommandKind::Write { tag, value }) = &self.action {
            // As it stands now: what was true when the window opened may have changed under it.
            let notes = interlock::before_write(cx, *tag, *value).into_iter();
            rows.extend(notes.flat_map(|(note, style)| wrap(&note, room).into_iter().map(move |line| (line, style))));
        }
        let missing = match &self.action {
            ConfirmAction::Command(kind) => rights::missing(cx, kind),
            ConfirmAction::Quit => None,
        };
        let news = self.expected.as_ref().and_then(|expected| expected.news(cx)).map(|words| cx.theme.enter(&words));
        let notes = news.into_iter().chain(missing);
        rows.extend(notes.flat_map(|words| wrap(&words, room)).map(|line| (line, cx.theme.trouble())));
        let yes = cx.theme.enter(self.key());
        let keys = match self.is_refused(cx) {
            true => t!("Esc {escape}", escape = self.escape()),
            false => t!("{yes} {verb}   Esc {escape}", yes, verb = self.verb(), escape = self.escape()),
        };
        let inner = rows.iter().map(|(text, _)| width(text)).max().unwrap_or(0).max(width(&keys));
        let inner = inner.max(self.reauthentication.as_ref().map_or(0, Form::width));
        let problem = self.problem.as_ref().map_or(1, |words| to_u16(wrap(words, inner).len()));
        let form = self.reauthentication.as_ref().map_or(0, |form| form.rows() + problem);
        let mut canvas = window(cx, frame, body, &self.title, (inner, to_u16(rows.len()) + form + 2));
        let y = canvas.rows(0, 0, &rows);
        self.view_reauthentication(cx, &mut canvas, y);
        let last = canvas.height().saturating_sub(1);
        canvas.text(0, last, &keys, cx.theme.strong());
    }
}

/// What is filled in where a tag asks for it again.
fn reauthentication_form(kind: Reauthentication) -> Form {
    Form::new(match kind {
        Reauthentication::Password => vec![Field::secret(t!("your password again"))],
        Reauthentication::SecondUser => vec![Field::name(t!("second user")), Field::secret(t!("password"))],
    })
}

/// A second user enters name and password; the user who writes is known.
fn credentials(form: &Form) -> Credentials {
    match form.rows() {
        1 => Credentials { user: None, password: form.secret(0) },
        _ => Credentials { user: Some(form.text(0)), password: form.secret(1) },
    }
}
