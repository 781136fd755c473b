//! Windows on top of a tab: they get every key until they close, and carry the action to confirm.

mod write_words;
pub(crate) mod choice;
pub(crate) mod confirm;
pub(crate) mod correction;
mod action;
pub(crate) mod audit_entry;
pub(crate) mod bus;
pub(crate) mod entry;
pub(crate) mod faceplate;
pub(crate) mod form;
pub(crate) mod guidance;
mod help;
pub(crate) mod instant;
pub(crate) mod line;
pub(crate) mod notice;
pub(crate) mod palette;
pub(crate) mod plant_command;
pub(crate) mod prompt;
pub(crate) mod reason;
pub(crate) mod confirmed_value;
pub(crate) mod line_settings;
pub(crate) mod terminal_settings;
mod sheet;
pub(crate) mod user_form;
pub(crate) mod why;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

pub use action::{Scope, UiAction};
pub use audit_entry::AuditEntryDialog;
pub use choice::Choice;
pub use confirm::Confirm;
pub use correction::Correction;
pub use entry::Entry;
pub use faceplate::Faceplate;
pub use guidance::Guidance;
pub use help::Help;
pub use line_settings::LineSettings;
pub use notice::Notice;
pub use palette::{Palette, Target};
pub use prompt::{Asked, Prompt};
pub use reason::Reason;
pub use terminal_settings::TerminalSettings;
pub use user_form::UserForm;
pub use why::Why;

use super::{
    ViewContext,
    keys::{self, Hint},
    tab::Tab,
    widgets::text::{Canvas, fit, width},
};
use crate::plant::{
    def::TagId,
    number::{Number, to_u16},
};

#[derive(Debug, Clone, PartialEq)]
pub enum Modal {
    /// All keys.
    Help(Help),
    Confirm(Confirm),
    Entry(Entry),
    Choice(Choice),
    /// Go to anything by its name.
    Palette(Box<Palette>),
    /// A text for the tab below.
    Prompt(Prompt),
    /// An action with a reason or a note.
    Reason(Box<Reason>),
    Correction(Box<Correction>),
    /// What there is to know about an item of the mimic.
    Faceplate(Faceplate),
    /// Words to be read: why something cannot be done now.
    Notice(Notice),
    /// What to do about an alarm.
    Guidance(Box<Guidance>),
    Why(Why),
    LineSettings(Box<LineSettings>),
    /// A frame, a block, a test of the bus tab.
    Bus(Box<bus::Window>),
    UserForm(Box<UserForm>),
    AuditEntry(Box<AuditEntryDialog>),
    /// Theme, characters, pictures, motion, bell, mouse and language.
    TerminalSettings(TerminalSettings),
}

/// What a key did to a window.
#[derive(Debug)]
pub enum Next {
    Stay(Modal),
    Close,
    /// It is gone, and this is to be done.
    Do(Vec<UiAction>),
    /// It stays, and this is to be done.
    Both(Modal, Vec<UiAction>),
    /// It is gone, and leads there.
    Go(Target),
    /// The tab below it is asked, which says what becomes of it.
    Ask(Asked),
}

impl Modal {
    /// The window in which an operator writes this tag: a list for an enumeration, else a number; `None` if it is
    /// read-only. Where the device cannot be reached the window says so, before anything is typed.
    pub fn write(cx: &ViewContext, tag: TagId) -> Option<Modal> {
        let def = cx.def().tag(tag);
        match (def.writable(), Notice::unreachable(cx, def.device), def.enum_labels.is_empty()) {
            (false, ..) => None,
            (true, Some(notice), _) => Some(Modal::Notice(notice)),
            (true, None, true) => Some(Modal::Entry(Entry::new(cx, tag))),
            (true, None, false) => Some(Modal::Choice(Choice::values(cx, tag))),
        }
    }

    pub fn on_key(self, cx: &ViewContext, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Esc).is(event) {
            let back = match self {
                Modal::Confirm(confirm) => confirm.back().map(Modal::Faceplate),
                Modal::UserForm(form) => form.below(),
                Modal::Prompt(prompt) => return prompt.cancel(),
                Modal::Help(_)
                | Modal::Entry(_)
                | Modal::Choice(_)
                | Modal::Reason(_)
                | Modal::Correction(_)
                | Modal::Faceplate(_)
                | Modal::Notice(_)
                | Modal::Guidance(_)
                | Modal::Why(_)
                | Modal::LineSettings(_)
                | Modal::Bus(_)
                | Modal::Palette(_)
                | Modal::TerminalSettings(_)
                | Modal::AuditEntry(_) => None,
            };
            return back.map_or(Next::Close, Next::Stay);
        }
        if keys::ctrl('c').is(event) {
            return Next::Both(self, vec![UiAction::Leave]);
        }
        match self {
            Modal::Help(help) => help.on_key(cx, event),
            Modal::Confirm(confirm) => confirm.on_key(cx, event),
            Modal::Entry(entry) => entry.on_key(cx, event),
            Modal::Choice(choice) => choice.on_key(cx, event),
            Modal::Palette(palette) => palette.on_key(cx, event),
            Modal::Prompt(prompt) => prompt.on_key(cx, event),
            Modal::Reason(reason) => reason.on_key(cx, event),
            Modal::Correction(window) => window.on_key(cx, event),
            Modal::Faceplate(faceplate) => faceplate.on_key(cx, event),
            Modal::Notice(notice) => notice.on_key(cx, event),
            Modal::Guidance(guidance) => guidance.on_key(cx, event),
            Modal::Why(why) => why.on_key(event),
            Modal::LineSettings(settings) => settings.on_key(cx, event),
            Modal::Bus(window) => window.on_key(cx, event),
            Modal::UserForm(form) => form.on_key(cx, event),
            Modal::AuditEntry(dialog) => dialog.on_key(event),
            Modal::TerminalSettings(window) => window.on_key(event),
        }
    }

    /// Is it the confirmation to leave? The only window that a screen of any size can show.
    pub fn is_quit(&self) -> bool {
        matches!(self, Modal::Confirm(confirm) if confirm.is_quit())
    }

    /// Is something typed into it, so that a digit is one?
    pub fn takes_text(&self) -> bool {
        match self {
            Modal::Confirm(confirm) => confirm.takes_text(),
            Modal::Notice(notice) => notice.takes_text(),
            Modal::Choice(_) | Modal::TerminalSettings(_) => false,
            Modal::Palette(_)
            | Modal::Entry(_)
            | Modal::Prompt(_)
            | Modal::Reason(_)
            | Modal::Correction(_)
            | Modal::LineSettings(_)
            | Modal::UserForm(_) => true,
            Modal::Help(_)
            | Modal::Guidance(_)
            | Modal::Why(_)
            | Modal::Faceplate(_)
            | Modal::AuditEntry(_)
            | Modal::Bus(_) => !self.only_shows(),
        }
    }

    /// Does it only show, so that a locked terminal may have it?
    pub fn only_shows(&self) -> bool {
        match self {
            Modal::Help(_)
            | Modal::Notice(_)
            | Modal::Guidance(_)
            | Modal::Why(_)
            | Modal::Faceplate(_)
            | Modal::AuditEntry(_) => true,
            Modal::Confirm(confirm) => confirm.is_quit(),
            Modal::Bus(window) => window.only_shows(),
            Modal::Entry(_)
            | Modal::Choice(_)
            | Modal::Palette(_)
            | Modal::Prompt(_)
            | Modal::Reason(_)
            | Modal::Correction(_)
            | Modal::LineSettings(_)
            | Modal::TerminalSettings(_)
            | Modal::UserForm(_) => false,
        }
    }

    /// Pasted text goes into a text line, or nowhere.
    pub fn on_paste(&mut self, cx: &ViewContext, text: &str) {
        match self {
            Modal::Entry(entry) => entry.paste(cx, text),
            Modal::Prompt(prompt) => prompt.line.paste(text),
            Modal::Palette(palette) => palette.paste(cx, text),
            Modal::Reason(reason) => reason.paste(text),
            Modal::Correction(window) => window.paste(text),
            Modal::LineSettings(settings) => settings.on_paste(text),
            Modal::Confirm(confirm) => confirm.on_paste(text),
            Modal::UserForm(form) => form.paste(text),
            Modal::Help(_)
            | Modal::Choice(_)
            | Modal::Faceplate(_)
            | Modal::Notice(_)
            | Modal::Guidance(_)
            | Modal::AuditEntry(_)
            | Modal::TerminalSettings(_)
            | Modal::Why(_) => {}
            Modal::Bus(window) => window.on_paste(text),
        }
    }

    pub fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let mut hints = match self {
            Modal::Help(_) => vec![
                Hint::in_window("↑↓", t!("select")),
                Hint::in_window("⏎", t!("press it")),
                Hint::in_window(t!("Esc"), t!("close")),
            ],
            Modal::Confirm(confirm) if confirm.is_refused(cx) => vec![Hint::in_window(t!("Esc"), confirm.escape())],
            Modal::Confirm(confirm) => {
                vec![Hint::in_window(confirm.key(), confirm.verb()), Hint::in_window(t!("Esc"), confirm.escape())]
            }
            Modal::Entry(_) => {
                vec![Hint::in_window("⏎", t!("write and verify")), Hint::in_window(t!("Esc"), t!("cancel"))]
            }
            Modal::Choice(_) => {
                vec![
                    Hint::in_window("↑↓", t!("select")),
                    Hint::in_window("⏎", t!("next")),
                    Hint::in_window(t!("Esc"), t!("cancel")),
                ]
            }
            Modal::Palette(palette) => {
                let remove = palette.is_on_bookmark().then(|| Hint::in_window(t!("Del"), t!("remove bookmark")));
                let hints = [Hint::in_window("↑↓", t!("select")), Hint::in_window("⏎", t!("go"))];
                hints.into_iter().chain(remove).chain([Hint::in_window(t!("Esc"), t!("cancel"))]).collect()
            }
            Modal::Prompt(prompt) if prompt.is_filter() => vec![
                Hint::in_window("↑↓", t!("select")),
                Hint::in_window("⏎", t!("OK")),
                Hint::in_window(t!("Esc"), t!("cancel")),
            ],
            Modal::Prompt(_) => vec![Hint::in_window("⏎", t!("OK")), Hint::in_window(t!("Esc"), t!("cancel"))],
            Modal::Reason(reason) => reason.hints(),
            Modal::Correction(window) => window.hints(),
            Modal::Faceplate(faceplate) => faceplate.hints(cx),
            Modal::Notice(_) => vec![Hint::in_window(t!("Esc"), t!("close"))],
            Modal::Guidance(guidance) => guidance.hints(cx),
            Modal::Why(why) => why.hints(),
            Modal::LineSettings(settings) => settings.hints(),
            Modal::Bus(window) => window.hints(),
            Modal::UserForm(form) => {
                form.hints().into_iter().chain([Hint::in_window(t!("Esc"), t!("cancel"))]).collect()
            }
            Modal::TerminalSettings(window) => window.hints(),
            Modal::AuditEntry(_) => vec![Hint::in_window(t!("Esc"), t!("close"))],
        };
        // A digit is typed here: the tabs are one key further away.
        if let Some(last) = Tab::offered(cx).last().filter(|_| self.takes_text()) {
            hints.push(Hint::in_window(&t!("Esc, 0-{number}", number = last.number()), t!("another tab")));
        }
        hints
    }

    /// Draws it in the middle of the body.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        match self {
            Modal::Help(help) => help.view(cx, frame, body),
            Modal::Confirm(confirm) => confirm.view(cx, frame, body),
            Modal::Entry(entry) => entry.view(cx, frame, body),
            Modal::Choice(choice) => choice.view(cx, frame, body),
            Modal::Palette(palette) => palette.view(cx, frame, body),
            Modal::Prompt(prompt) => prompt.view(cx, frame, body),
            Modal::Reason(reason) => reason.view(cx, frame, body),
            Modal::Correction(window) => window.view(cx, frame, body),
            Modal::Faceplate(faceplate) => faceplate.view(cx, frame, body),
            Modal::Notice(notice) => notice.view(cx, frame, body),
            Modal::Guidance(guidance) => guidance.view(cx, frame, body),
            Modal::Why(why) => why.view(cx, frame, body),
            Modal::LineSettings(settings) => settings.view(cx, frame, body),
            Modal::Bus(window) => window.view(cx, frame, body),
            Modal::UserForm(form) => form.view(cx, frame, body),
            Modal::AuditEntry(dialog) => dialog.view(cx, frame, body),
            Modal::TerminalSettings(window) => window.view(cx, frame, body),
        }
    }
}

/// The keys of the moment in the last row of a window.
pub(super) fn view_keys(cx: &ViewContext, canvas: &mut Canvas, hints: &[Hint]) {
    let keys: Vec<String> = hints.iter().map(|hint| format!("{} {}", hint.key, hint.label)).collect();
    let last = canvas.height().saturating_sub(1);
    canvas.text(0, last, &cx.theme.enter(&keys.join("   ")), cx.theme.strong());
}

/// A cleared, framed window of this inner size in the middle of the body; drawn smaller where there is no room.
pub(super) fn window<'a>(
    cx: &ViewContext,
    frame: &'a mut Frame,
    body: Rect,
    title: &str,
    (columns, rows): (impl Number, impl Number),
) -> Canvas<'a> {
    let width = to_u16(columns).max(width(title) + 4).saturating_add(4).min(body.width);
    let height = to_u16(rows).saturating_add(2).min(body.height);
    let area = Rect::new(body.x + (body.width - width) / 2, body.y + (body.height - height) / 2, width, height);
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    canvas.clear();
    canvas.frame(&fit(title, width.saturating_sub(6)), cx.theme.strong());
    let area =
        Rect::new(area.x + 2.min(width), area.y + 1.min(height), width.saturating_sub(4), height.saturating_sub(2));
    Canvas::new(frame.buffer_mut(), area)
}
