//! "Do it or not": the window that carries a finished intent.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect, style::Style};

use super::{Faceplate, Modal, Next, seen::Seen, window};
use crate::{
    plant::{
        alarm::{AlarmCommand, book::subject_name},
        command::Command,
        def::TagId,
        tag::{Access, Confidence, TagDef},
        tool::Tool,
    },
    ui::{
        Cx, guard, keys,
        tabs::mimic,
        widgets::{
            text::{width, wrap},
            value,
        },
    },
};

/// A finished intent and what the operator is asked about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Confirm {
    intent: Intent,
    title: String,
    notes: Vec<String>,
    /// Where it was asked from, and where it leads back to.
    back: Option<Faceplate>,
    /// What its reader saw, where a value is written.
    seen: Option<Seen>,
}

/// What a confirmed window does.
#[derive(Debug, Clone, PartialEq)]
pub enum Intent {
    /// Leave the terminal.
    Quit,
    /// Give an order.
    Order(Command),
}

impl Confirm {
    /// Leave?
    pub fn quit() -> Confirm {
        let notes = ["Quit?", "Polling and alarms stop too: the station runs in this terminal."];
        Confirm {
            intent: Intent::Quit,
            title: "quit".to_owned(),
            notes: notes.map(str::to_owned).to_vec(),
            back: None,
            seen: None,
        }
    }

    /// Is it the question whether to leave?
    pub fn is_quit(&self) -> bool {
        self.intent == Intent::Quit
    }

    /// Acknowledge all? `None` when there is nothing to acknowledge.
    pub fn acknowledge_all(cx: &Cx) -> Option<Confirm> {
        let waiting: Vec<_> = cx.snapshot.alarms.iter().filter(|alarm| alarm.state.needs_acknowledgement()).collect();
        if waiting.is_empty() {
            return None;
        }
        let mut notes = vec![match waiting.len() {
            1 => "Acknowledge 1 alarm?".to_owned(),
            n => format!("Acknowledge {n} alarms?"),
        }];
        notes.extend(waiting.iter().take(6).map(|alarm| {
            let def = cx.def().alarm(alarm.id);
            format!("{} {} {}", cx.theme.priority_mark(def.priority), subject(cx, alarm.id), def.text)
        }));
        if waiting.len() > 6 {
            notes.push(format!("… and {} more", waiting.len() - 6));
        }
        let intent = Intent::Order(cx.snapshot.acknowledge_all()?);
        Some(Confirm { intent, title: "acknowledge all".to_owned(), notes, back: None, seen: None })
    }

    /// Write this value? Old and new value are drawn from the intent, so they cannot differ from what is sent.
    pub fn write(cx: &Cx, tag: TagId, value: f64) -> Confirm {
        let def = cx.def().tag(tag);
        let intent = Intent::Order(Command::Write { tag, value });
        Confirm {
            intent,
            title: format!("write {}", def.name),
            notes: write_notes(def),
            back: None,
            seen: Some(Seen::new(cx, tag)),
        }
    }

    /// The same, asked from a faceplate, with words of its own above all others.
    pub fn from_faceplate(cx: &Cx, tag: TagId, value: f64, words: Option<String>, back: Faceplate) -> Confirm {
        let confirm = Confirm::write(cx, tag, value);
        let notes = words.into_iter().chain(confirm.notes).collect();
        Confirm { notes, back: Some(back), ..confirm }
    }

    /// A write with words of its own (an action of a device).
    pub fn action(cx: &Cx, tag: TagId, value: f64, name: &str, words: &str) -> Confirm {
        let confirm = Confirm::write(cx, tag, value);
        let notes = [words.to_owned()].into_iter().chain(confirm.notes).collect();
        Confirm { title: format!("{name} {}", cx.def().device(cx.def().tag(tag).device).name), notes, ..confirm }
    }

    /// Open or close a line, or any other order, with words of its own.
    pub fn order(title: impl Into<String>, words: impl Into<String>, command: Command) -> Confirm {
        Confirm {
            intent: Intent::Order(command),
            title: title.into(),
            notes: vec![words.into()],
            back: None,
            seen: None,
        }
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

    /// What Enter does.
    pub fn verb(&self) -> &'static str {
        match &self.intent {
            Intent::Quit => "quit",
            Intent::Order(Command::Write { .. }) => "write and verify",
            Intent::Order(Command::Alarm(command)) => match command {
                AlarmCommand::Acknowledge { .. } | AlarmCommand::AcknowledgeAll { .. } => "acknowledge",
                AlarmCommand::Silence => "silence",
                AlarmCommand::Reset(_) => "reset",
                AlarmCommand::Shelve { .. } => "shelve",
                AlarmCommand::Unshelve(_) => "take back",
                AlarmCommand::OutOfService(_) => "put out of service",
                AlarmCommand::InService(_) => "put in service",
            },
            Intent::Order(Command::Refresh(_)) => "refresh",
            Intent::Order(Command::Connect(_, true)) => "connect",
            Intent::Order(Command::Connect(_, false)) => "disconnect",
            Intent::Order(Command::Configure(_)) => "use these settings",
            Intent::Order(Command::SaveSettings(_)) => "save",
            Intent::Order(Command::Test(_, Tool::Scan(_))) => "scan",
            Intent::Order(Command::Test(..)) => "send",
            Intent::Order(Command::StopTest(_) | Command::StopRestore(_)) => "stop",
            Intent::Order(Command::ReadSets) => "read",
            Intent::Order(Command::SaveSet { replace: true, .. }) => "replace it",
            Intent::Order(Command::SaveSet { replace: false, .. }) => "save",
            Intent::Order(Command::Restore(_)) => "write and verify",
        }
    }

    /// What is sent to a line past all limits of the plant file comes behind an Enter: a second one must not send it.
    fn wants_y(&self) -> bool {
        matches!(&self.intent, Intent::Order(Command::Test(..)))
    }

    /// What Esc does.
    pub fn escape(&self) -> &'static str {
        if self.is_quit() { "stay" } else { "leave it as it is" }
    }

    /// Is it certainly without effect now?
    pub(super) fn is_refused(&self, cx: &Cx) -> bool {
        match &self.intent {
            Intent::Order(Command::Write { tag, value }) => guard::is_refused(cx, *tag, *value),
            Intent::Order(_) | Intent::Quit => false,
        }
    }

    pub(super) fn on_key(mut self, cx: &Cx, event: KeyEvent) -> Next {
        let enter = keys::code(KeyCode::Enter).is(event) && !self.wants_y();
        if enter || keys::char('y').is(event) {
            if self.is_refused(cx) {
                return Next::Stay(Modal::Confirm(self));
            }
            if let Some(seen) = &mut self.seen
                && seen.changed(cx)
            {
                return Next::Stay(Modal::Confirm(self));
            }
            let acts = vec![self.intent.act()];
            match self.back {
                Some(back) => Next::Both(Modal::Faceplate(back), acts),
                None => Next::Do(acts),
            }
        } else if keys::char('n').is(event) || keys::char('q').is(event) {
            match self.back {
                Some(back) => Next::Stay(Modal::Faceplate(back)),
                None => Next::Close,
            }
        } else {
            let write = matches!(self.intent, Intent::Order(Command::Write { .. }));
            let other = mimic::command_of(cx, event).filter(|_| write);
            Next::Stay(other.unwrap_or(Modal::Confirm(self)))
        }
    }

    pub(super) fn view(&self, cx: &Cx, frame: &mut Frame, body: Rect) {
        let room = body.width.saturating_sub(8).min(68);
        let mut rows: Vec<(String, Style)> = Vec::new();
        if let Intent::Order(Command::Write { tag, value }) = &self.intent {
            let change = old_and_new(cx, *tag, *value);
            let lines = if width(&change) <= room { vec![change] } else { wrap(&change, room) };
            rows.extend(lines.into_iter().map(|line| (line, cx.theme.strong())));
            rows.push((wire_words(cx.def().tag(*tag)), cx.theme.dim()));
        }
        rows.extend(self.notes.iter().flat_map(|note| wrap(note, room)).map(|line| (line, cx.theme.normal())));
        if let Intent::Order(Command::Write { tag, value }) = &self.intent {
            // As it stands now: what was true when the window opened may have changed under it.
            let told = guard::before_write(cx, *tag, *value).into_iter();
            rows.extend(told.flat_map(|(note, style)| wrap(&note, room).into_iter().map(move |line| (line, style))));
        }
        if let Some(seen) = self.seen.as_ref().filter(|seen| seen.has_asked()) {
            rows.extend(wrap(&seen.words(cx), room).into_iter().map(|line| (line, cx.theme.trouble())));
        }
        let yes = if self.wants_y() { "y".to_owned() } else { cx.theme.enter("⏎") };
        let keys = match self.is_refused(cx) {
            true => format!("Esc {}", self.escape()),
            false => format!("{yes} {}   Esc {}", self.verb(), self.escape()),
        };
        let inner = rows.iter().map(|(text, _)| width(text)).max().unwrap_or(0).max(width(&keys));
        let mut canvas = window(cx, frame, body, &self.title, (inner, rows.len() as u16 + 2));
        for (y, (text, style)) in rows.iter().enumerate() {
            canvas.text(0, y as u16, text, *style);
        }
        let last = canvas.height().saturating_sub(1);
        canvas.text(0, last, &keys, cx.theme.strong());
    }
}

/// `old 60.0 °C → new 70.0 °C`; an unknown old value is said to be unknown.
pub(super) fn old_and_new(cx: &Cx, tag: TagId, new: f64) -> String {
    let new = format!("{} {}", cx.snapshot.format(tag, new), cx.snapshot.unit(tag));
    match cx.def().tag(tag).access {
        Access::Write => format!("writes {}", new.trim_end()),
        Access::Read | Access::ReadWrite => format!("old {}  →  new {}", value::show(cx, tag).whole(), new.trim_end()),
    }
}

/// Where a write goes (a read, for a tag that is read-only), in both forms that manuals use: `41007 / 0x03EE, FC 06 / 0x06`.
pub fn wire_words(def: &TagDef) -> String {
    let fc = def.write_function().unwrap_or(def.point.table.read_fc());
    let address = def.point.address;
    format!("{} / 0x{address:04X}, FC {fc:02} / 0x{fc:02X}", def.point.table.modicon(address))
}

/// What the profile wants said before a write.
pub(super) fn write_notes(def: &TagDef) -> Vec<String> {
    let mut notes: Vec<String> = def.confirm.iter().cloned().collect();
    match def.confidence {
        Confidence::Proven | Confidence::High => {}
        Confidence::Medium => notes.push("! not verified: this row of the register map has one source".to_owned()),
        Confidence::Low => notes.push("! not verified: this row of the register map is inferred".to_owned()),
    }
    notes
}

/// The name of what an alarm watches.
pub fn subject(cx: &Cx, alarm: crate::plant::def::AlarmId) -> String {
    subject_name(cx.def(), cx.def().alarm(alarm).subject).to_owned()
}
