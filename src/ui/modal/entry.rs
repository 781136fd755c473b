//! A number or a text for a tag: old value, new value, range, address, and what the profile wants said.

use crate::text::of_plant;
use std::sync::Arc;

use crate::t;
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::{Frame, layout::Rect};

use super::{
    Confirm, Modal, Next,
    confirmed_value::ConfirmedValue,
    line::Line,
    window,
    write_words::{wire_text, write_notes},
};
use crate::{
    access::control::reauthentication,
    plant::{
        command::{Command, CommandKind},
        def::TagId,
        entry::{self, is_numeric, range_text},
        exact::Exact,
        number::to_u16,
        tag::DataType,
        text_value::{self, ExpectedText},
    },
    ui::{
        UiAction, ViewContext, interlock, keys, rights,
        widgets::{
            text::{width, wrap},
            value,
        },
    },
};

#[cfg(test)]
mod numbers;
#[cfg(test)]
mod texts;

/// Most characters of a text.
const TEXT_MAX: usize = DataType::TEXT_MAX as usize;

/// Is a number for this tag asked again in a window of its own? A tag with reauthentication is.
fn needs_confirmation(cx: &ViewContext, tag: TagId, value: Exact) -> bool {
    entry::needs_confirmation(cx.snapshot, tag, value)
        || reauthentication::required(cx.def(), &CommandKind::Write { tag, value }).is_some()
}

/// A number or a text on its way into a tag.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub tag: TagId,
    pub line: Line,
    /// Why the last Enter was not taken.
    pub problem: Option<String>,
    /// What its author saw.
    expected: ConfirmedValue,
    /// The same of a text.
    seen: Option<Arc<str>>,
}

impl Entry {
    pub fn new(cx: &ViewContext, tag: TagId) -> Entry {
        let seen = cx.snapshot.texts[tag.index()].clone();
        let line = match is_text(cx, tag) {
            true => {
                Line::long(seen.as_deref().filter(|_| is_kept(cx, tag)).unwrap_or_default(), TEXT_MAX).into_offered()
            }
            false => Line::default(),
        };
        Entry { tag, line, problem: None, expected: ConfirmedValue::new(cx, tag), seen }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) {
            let checked = match self.line.missed() {
                true => Err(t!("the text was cut; Ctrl-U clears the line").to_owned()),
                false if is_text(cx, self.tag) => match self.held(cx) {
                    Ok(_) if self.asks_over_other_text(cx) => return Next::Stay(Modal::Entry(self)),
                    Ok(held) => return self.send_text(cx, &held),
                    Err(expected) => Err(t!("expected {what}", what = expected)),
                },
                false => entry::check(cx.snapshot, self.tag, &self.line.text()),
            };
            match checked {
                Ok(_) if self.expected.changed(cx) => self.problem = None,
                Ok(value) if needs_confirmation(cx, self.tag, value) => {
                    let why = entry::warnings(cx.snapshot, self.tag, value);
                    return Next::Stay(Modal::Confirm(Confirm::write(cx, self.tag, value).with_notes(why)));
                }
                Ok(value) => {
                    let expected = self.expected.shown(cx);
                    let kind = CommandKind::Write { tag: self.tag, value };
                    return Next::Do(vec![UiAction::SendCommand(
                        Command { expected_value: expected, ..kind.into() },
                        None,
                    )]);
                }
                Err(problem) => self.problem = Some(problem),
            }
        } else if let Some(c) = strange(event).filter(|_| !is_text(cx, self.tag)) {
            self.reject(c);
        } else if self.line.on_key(event) {
            // What was left out stays noted until the line is empty again.
            self.problem.take_if(|_| !self.line.missed());
        }
        Next::Stay(Modal::Entry(self))
    }

    /// The typed text as the device will show it.
    fn held(&self, cx: &ViewContext) -> Result<String, ExpectedText> {
        let now = cx.now.to_zoned(cx.def().time_zone.clone());
        text_value::as_held(cx.def().tag(self.tag).point.kind, &self.line.text(), &now)
    }

    /// Has the text become another one since it was shown? That is what was seen from now on, and says so.
    fn asks_over_other_text(&mut self, cx: &ViewContext) -> bool {
        let now = cx.snapshot.texts[self.tag.index()].clone();
        if now.is_none() || now == self.seen || text_value::is_running(cx.def().tag(self.tag).point.kind) {
            return false;
        }
        let text = |text: &Option<Arc<str>>| text.as_deref().map_or(t!("unknown").to_owned(), text_value::quoted);
        let words =
            t!("changed to {trim_end}{by} (was {text})", trim_end = text(&now), by = "", text = text(&self.seen));
        self.problem = Some(t!("{words}; ⏎ writes all the same", words));
        self.seen = now;
        true
    }

    /// Asks again where the tag wants that. What is meant is said then; only "now" is as late as its write.
    fn send_text(self, cx: &ViewContext, held: &str) -> Next {
        let Entry { tag, line, seen, .. } = self;
        let kind = CommandKind::WriteText { tag, text: line.text().into(), seen: seen.clone() };
        let asks = cx.def().tag(tag).confirm.is_some() || reauthentication::required(cx.def(), &kind).is_some();
        if !asks {
            return Next::Do(vec![UiAction::SendCommand(kind.into(), None)]);
        }
        let is_now = line.text().eq_ignore_ascii_case(text_value::NOW);
        let said = if is_now { text_value::NOW } else { held };
        Next::Stay(Modal::Confirm(Confirm::text(cx, tag, said, seen)))
    }

    /// Pasted text; into a number only if it is one.
    pub(super) fn paste(&mut self, cx: &ViewContext, text: &str) {
        if is_text(cx, self.tag) {
            return self.line.paste(text);
        }
        match text.trim().chars().find(|c| !is_numeric(*c)) {
            Some(c) => self.reject(c),
            None => self.line.paste(text),
        }
    }

    /// What cannot be in a number is not shown, it might be a secret; the number is not written either.
    fn reject(&mut self, c: char) {
        self.line.miss();
        let named = if c.is_control() || c.is_whitespace() { t!("a space").to_owned() } else { format!("\"{c}\"") };
        self.problem = Some(t!("{named} is not part of a number; Ctrl-U clears the line", named));
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let def = cx.def().tag(self.tag);
        let room = body.width.saturating_sub(8).min(64);
        let mut rows = Vec::new();
        if def.is_text() {
            let held = self.held(cx).ok().filter(|held| *held != self.line.text());
            let expected = (ExpectedText(def.point.kind).to_string(), theme.normal());
            rows.push(held.map_or(expected, |held| (t!("as {held}", held), theme.strong())));
            rows.push((wire_text(def), theme.dim()));
        } else {
            rows.push((range_text(cx.snapshot, self.tag), theme.normal()));
            rows.push((wire_text(def), theme.dim()));
            rows.push((entry::help(cx.snapshot, self.tag), theme.dim()));
        }
        let notes =
            Some(of_plant(&def.meaning).to_owned()).filter(|text| !text.is_empty()).into_iter().chain(write_notes(def));
        let notes = notes.chain(interlock::unlock_text(cx, self.tag));
        rows.extend(notes.flat_map(|note| wrap(&note, room)).map(|line| (line, theme.normal())));
        let missing = rights::lacks(cx, rights::to_write(cx, [self.tag]));
        let notes = self.problem.clone().or_else(|| self.expected.news(cx)).or(missing);
        let problem = wrap(&notes.map_or(String::new(), |words| theme.enter(&words)), room);
        let inner = rows
            .iter()
            .map(|(text, _)| width(text))
            .chain(problem.iter().map(|text| width(text)))
            .max()
            .unwrap_or(0)
            .max(46);
        let title = t!("write {name} {label}", name = def.name, label = of_plant(&def.label));
        let notes = to_u16(problem.len().max(1));
        let mut canvas = window(cx, frame, body, &title, (inner, to_u16(rows.len()) + 3 + notes));
        let old = value::show(cx, self.tag);
        let x = canvas.text(0, 0, t!("old "), theme.dim());
        let x = canvas.text(x, 0, &old.whole(), old.style);
        let x = canvas.text(x, 0, t!("  →  new "), theme.dim());
        let x = self.line.view(theme, &mut canvas, x, 0);
        let x = canvas.text(x + 1, 0, cx.snapshot.unit(self.tag), theme.normal());
        let change = entry::relative_text(cx.snapshot, self.tag, &self.line.text()).filter(|_| !def.is_text());
        if let Some(words) = change {
            canvas.text(x + 2, 0, &words, theme.strong());
        }
        canvas.rows(0, 1, &rows);
        let last = canvas.height().saturating_sub(1);
        for (y, line) in problem.iter().enumerate() {
            canvas.text(0, last.saturating_sub(notes) + to_u16(y), line, theme.trouble());
        }
        canvas.text(0, last, &theme.enter(t!("⏎ write and verify   Esc cancel")), theme.strong());
    }
}

fn is_text(cx: &ViewContext, tag: TagId) -> bool {
    cx.def().tag(tag).is_text()
}

/// Is its text offered, to be changed? The time that a clock shows is not typed again.
fn is_kept(cx: &ViewContext, tag: TagId) -> bool {
    !text_value::is_running(cx.def().tag(tag).point.kind)
}

/// The character that was typed and can be in no number.
fn strange(event: KeyEvent) -> Option<char> {
    let combined = event.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT);
    match event.code {
        KeyCode::Char(c) if !combined && !is_numeric(c) => Some(c),
        _ => None,
    }
}
