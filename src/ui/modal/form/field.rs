//! A field of a form: what it holds, and what a key does to it.

use std::fmt;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::ui::modal::line::Line;

/// Most characters of a password, and of a name.
pub(super) const SECRET_CHARS: usize = 128;
const NAME_CHARS: usize = 32;

/// A field of a form. What was typed never comes out of its `Debug`.
#[derive(Clone, PartialEq)]
pub struct Field {
    pub(super) label: &'static str,
    pub(super) input: Input,
    /// What may be typed, shown while it is; empty where it need not be said.
    pub(super) range: String,
    /// It has no meaning beside what other fields hold: not shown, not reached.
    pub(super) hidden: bool,
}

#[derive(Clone, PartialEq)]
pub(super) enum Input {
    Text(Line),
    /// Only digits: a letter may be a key of the window.
    Digits(Line),
    Secret(Line),
    Choice(Vec<String>, usize),
}

impl Field {
    /// A name, empty.
    pub fn name(label: &'static str) -> Field {
        Field::text(label, "", NAME_CHARS)
    }
    /// A text of at most so many characters, to start from.
    pub fn text(label: &'static str, text: &str, chars: usize) -> Field {
        Field::new(label, Input::Text(Line::long(text, chars)))
    }
    /// A whole number, to start from.
    pub fn digits(label: &'static str, number: impl fmt::Display) -> Field {
        Field::new(label, Input::Digits(Line::new(&number.to_string())))
    }
    /// A password, empty.
    pub fn secret(label: &'static str) -> Field {
        Field::new(label, Input::Secret(Line::long("", SECRET_CHARS)))
    }
    /// One of a few, never none; this one at first.
    pub fn choice(label: &'static str, options: impl IntoIterator<Item = impl Into<String>>, chosen: usize) -> Field {
        let options: Vec<String> = options.into_iter().map(Into::into).collect();
        Field::new(label, Input::Choice(options, chosen))
    }
    /// One of these, each with its words; this one at first.
    pub fn one_of<T: Copy + PartialEq, W: Into<String>>(
        label: &'static str,
        all: &[T],
        now: T,
        words: impl Fn(T) -> W,
    ) -> Field {
        let chosen = all.iter().position(|one| *one == now).unwrap_or(0);
        Field::choice(label, all.iter().map(|one| words(*one)), chosen)
    }
    pub fn within(self, range: impl Into<String>) -> Field {
        Field { range: range.into(), ..self }
    }

    fn new(label: &'static str, input: Input) -> Field {
        Field { label, input, range: String::new(), hidden: false }
    }

    pub(super) fn line(&self) -> Option<&Line> {
        match &self.input {
            Input::Text(line) | Input::Digits(line) | Input::Secret(line) => Some(line),
            Input::Choice(..) => None,
        }
    }

    pub(super) fn type_key(&mut self, event: KeyEvent) -> bool {
        let is_letter = matches!(event.code, KeyCode::Char(c) if !c.is_ascii_digit());
        match &mut self.input {
            Input::Text(line) | Input::Secret(line) => line.on_key(event),
            Input::Digits(_) if is_letter && !event.modifiers.contains(KeyModifiers::CONTROL) => false,
            Input::Digits(line) => line.on_key(event),
            Input::Choice(options, chosen) => {
                let by = match event.code {
                    KeyCode::Left => options.len() - 1,
                    KeyCode::Right | KeyCode::Char(' ') => 1,
                    _ => return false,
                };
                *chosen = (*chosen + by) % options.len();
                true
            }
        }
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.label)
    }
}
