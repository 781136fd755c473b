//! A number for a tag: old value, new value, range, address, and what the profile wants said.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::{Frame, layout::Rect, style::Style};

use super::{
    Confirm, Modal, Next,
    confirm::{wire_words, write_notes},
    line::Line,
    seen::Seen,
    window,
};
use crate::{
    access::gate::sign,
    plant::{command::Command, def::TagId},
    ui::{
        Act, Confirmed, Cx, guard, keys, rights,
        widgets::{
            text::{width, wrap},
            value,
        },
    },
};

/// A number on its way into a tag.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Which tag.
    pub tag: TagId,
    /// What has been typed.
    pub line: Line,
    /// Why the last Enter was not taken.
    pub problem: Option<String>,
    /// What its author saw.
    seen: Seen,
}

impl Entry {
    /// An empty entry.
    pub fn new(cx: &Cx, tag: TagId) -> Entry {
        Entry { tag, line: Line::default(), problem: None, seen: Seen::new(cx, tag) }
    }

    pub(super) fn on_key(mut self, cx: &Cx, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) {
            let checked = match self.line.missed() {
                true => Err("not all of it was taken; Ctrl-U empties the line".to_owned()),
                false => check(cx, self.tag, &self.line.text()),
            };
            match checked {
                Ok(_) if self.seen.changed(cx) => self.problem = None,
                Ok(value) if asks(cx, self.tag, value) => {
                    return Next::Stay(Modal::Confirm(Confirm::write(cx, self.tag, value)));
                }
                Ok(value) => {
                    let seen = self.seen.shown(cx);
                    let command = Command::Write { tag: self.tag, value };
                    return Next::Do(vec![Act::Confirmed(Confirmed { seen, ..command.into() })]);
                }
                Err(problem) => self.problem = Some(problem),
            }
        } else if let Some(c) = strange(event) {
            self.reject(c);
        } else if self.line.on_key(event) {
            // What was left out is told until the line is empty again.
            self.problem.take_if(|_| !self.line.missed());
        }
        Next::Stay(Modal::Entry(self))
    }

    /// Pasted text, if it is a number.
    pub(super) fn paste(&mut self, text: &str) {
        match text.trim().chars().find(|c| !is_numeric(*c)) {
            Some(c) => self.reject(c),
            None => self.line.paste(text),
        }
    }

    /// What cannot be in a number is not shown, it might be a secret; the number is not written either.
    fn reject(&mut self, c: char) {
        self.line.miss();
        let named = if c.is_control() || c.is_whitespace() { "a blank".to_owned() } else { format!("\"{c}\"") };
        self.problem = Some(format!("{named} is no part of a number; Ctrl-U empties the line"));
    }

    pub(super) fn view(&self, cx: &Cx, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let def = cx.def().tag(self.tag);
        let room = body.width.saturating_sub(8).min(64);
        let mut rows: Vec<(String, Style)> =
            vec![(range_words(cx, self.tag), theme.normal()), (wire_words(def), theme.dim())];
        let notes = Some(&def.meaning).filter(|text| !text.is_empty()).cloned().into_iter().chain(write_notes(def));
        let notes = notes.chain(guard::key_words(cx, self.tag));
        rows.extend(notes.flat_map(|note| wrap(&note, room)).map(|line| (line, theme.normal())));
        let missing = rights::missing(cx, &Command::Write { tag: self.tag, value: 0.0 });
        let told = self.problem.clone().or_else(|| self.seen.news(cx)).or(missing);
        let problem = wrap(&told.map_or(String::new(), |words| theme.enter(&words)), room);
        let inner = rows
            .iter()
            .map(|(text, _)| width(text))
            .chain(problem.iter().map(|text| width(text)))
            .max()
            .unwrap_or(0)
            .max(46);
        let title = format!("write {} {}", def.name, def.label);
        let told = problem.len().max(1) as u16;
        let mut canvas = window(cx, frame, body, &title, (inner, rows.len() as u16 + 3 + told));
        let old = value::show(cx, self.tag);
        let x = canvas.text(0, 0, "old ", theme.dim());
        let x = canvas.text(x, 0, &old.whole(), old.style);
        let x = canvas.text(x, 0, "  →  new ", theme.dim());
        let x = self.line.view(theme, &mut canvas, x, 0);
        canvas.text(x + 1, 0, cx.snapshot.unit(self.tag), theme.normal());
        for (y, (text, style)) in rows.iter().enumerate() {
            canvas.text(0, y as u16 + 1, text, *style);
        }
        let last = canvas.height().saturating_sub(1);
        for (y, line) in problem.iter().enumerate() {
            canvas.text(0, last.saturating_sub(told) + y as u16, line, theme.trouble());
        }
        canvas.text(0, last, &theme.enter("⏎ write and verify   Esc leave unchanged"), theme.strong());
    }
}

/// The character that was typed and can be in no number.
fn strange(event: KeyEvent) -> Option<char> {
    let combined = event.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT);
    match event.code {
        KeyCode::Char(c) if !combined && !is_numeric(c) => Some(c),
        _ => None,
    }
}

fn is_numeric(c: char) -> bool {
    c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | ',')
}

/// Is a number for this tag asked again in a window of its own? What must be signed is.
fn asks(cx: &Cx, tag: TagId, value: f64) -> bool {
    cx.def().tag(tag).confirm.is_some() || sign::needed(cx.def(), &Command::Write { tag, value }).is_some()
}

/// The permitted range in words.
pub fn range_words(cx: &Cx, tag: TagId) -> String {
    let labels = &cx.def().tag(tag).labels;
    if !labels.is_empty() {
        return format!("range one of {}", labels.len());
    }
    match cx.snapshot.range(tag) {
        Some((min, max)) => {
            let unit = cx.snapshot.unit(tag);
            format!("range {} … {} {unit}", cx.snapshot.format(tag, min), cx.snapshot.format(tag, max))
                .trim_end()
                .to_owned()
        }
        None => "range not known".to_owned(),
    }
}

/// The number if it can be written; else what is wrong with it. Courtesy: the station checks again.
fn check(cx: &Cx, tag: TagId, text: &str) -> Result<f64, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err("type a number".to_owned());
    }
    let (value, typed) = number(text).ok_or_else(|| format!("\"{text}\" is no number"))?;
    // Zeros count: where no decimals are taken, `1,000` and `1.000` mean a thousand to their author, and are refused.
    let decimals = usize::from(cx.snapshot.decimals[tag.index()]);
    if typed > decimals {
        return Err(match decimals {
            0 => "whole numbers only".to_owned(),
            1 => "at most 1 decimal".to_owned(),
            n => format!("at most {n} decimals"),
        });
    }
    match cx.snapshot.range(tag) {
        Some((min, max)) if !(min..=max).contains(&value) => Err(format!("outside {}", range_words(cx, tag))),
        Some(_) | None => Ok(value),
    }
}

/// A plain number and its decimals: sign, digits and one decimal mark, a point or a comma. No exponent, no `inf`.
fn number(text: &str) -> Option<(f64, usize)> {
    let plain = text.replacen(',', ".", 1);
    let (whole, fraction) = plain.split_once('.').unwrap_or((&plain, ""));
    let whole = whole.strip_prefix(['-', '+']).unwrap_or(whole);
    let digits = |text: &str| text.bytes().all(|c| c.is_ascii_digit());
    let numeric = digits(whole) && digits(fraction) && !(whole.is_empty() && fraction.is_empty());
    numeric.then(|| plain.parse().ok()).flatten().map(|value| (value, fraction.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn a_wrong_number_is_told_before_it_is_sent() {
        let fixture = Fixture::normal();
        let sv = fixture.tag("TIC-1.SV");
        with_cx(&fixture.snapshot(), |cx| {
            let check = |text: &str, expect: Result<f64, &str>| {
                assert_eq!(check(cx, sv, text), expect.map_err(str::to_owned), "{text}")
            };
            check("70", Ok(70.0));
            check("70.5", Ok(70.5));
            check("3,5", Ok(3.5));
            check("+3,5 ", Ok(3.5));
            check("-0", Ok(0.0));
            check("70.50", Err("at most 1 decimal"));
            check("", Err("type a number"));
            for text in ["7-0", "7OO", "1e1", "1e5", "7 0", "1,0.5", "1.0.5", "inf", "NaN", "-", ".", "0x10", "๗"] {
                check(text, Err(&format!("\"{text}\" is no number")));
            }
            check("70.55", Err("at most 1 decimal"));
            check("1,000", Err("at most 1 decimal"));
            check("1000", Err("outside range 0.0 … 120.0 °C"));
        });
    }
}
