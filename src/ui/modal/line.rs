//! A one-line text editor.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::ui::{
    theme::Theme,
    widgets::text::{Canvas, width},
};

/// Longest text that can be entered.
const CHARS_MAX: usize = 64;

/// A text and the place of its cursor.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Line {
    text: Vec<char>,
    cursor: usize,
    allowed: Option<&'static str>,
}

impl Line {
    /// Any text.
    pub fn new(text: &str) -> Line {
        let text: Vec<char> = text.chars().take(CHARS_MAX).collect();
        Line { cursor: text.len(), text, allowed: None }
    }
    /// Only these characters; others are ignored.
    pub fn only(allowed: &'static str) -> Line {
        Line { allowed: Some(allowed), ..Line::default() }
    }
    /// What has been entered.
    pub fn text(&self) -> String {
        self.text.iter().collect()
    }
    /// An editing key; `false` if it is none.
    pub fn on_key(&mut self, event: KeyEvent) -> bool {
        let ctrl = event.modifiers.contains(KeyModifiers::CONTROL);
        match event.code {
            KeyCode::Char('u') if ctrl => {
                self.text.drain(..self.cursor);
                self.cursor = 0;
            }
            KeyCode::Char('a') if ctrl => self.cursor = 0,
            KeyCode::Char('e') if ctrl => self.cursor = self.text.len(),
            KeyCode::Char(c) if !ctrl && !event.modifiers.contains(KeyModifiers::ALT) => self.insert(c),
            KeyCode::Backspace if self.cursor > 0 => {
                self.cursor -= 1;
                self.text.remove(self.cursor);
            }
            KeyCode::Delete if self.cursor < self.text.len() => {
                self.text.remove(self.cursor);
            }
            KeyCode::Left => self.cursor = self.cursor.saturating_sub(1),
            KeyCode::Right => self.cursor = (self.cursor + 1).min(self.text.len()),
            KeyCode::Home => self.cursor = 0,
            KeyCode::End => self.cursor = self.text.len(),
            _ => return false,
        }
        true
    }
    /// Pasted text: control characters (a line end above all) are left out, so a paste never confirms anything.
    pub fn paste(&mut self, text: &str) {
        for c in text.trim().chars() {
            self.insert(c);
        }
    }
    /// Draws text and cursor; returns the column after it.
    pub fn view(&self, theme: &Theme, canvas: &mut Canvas, x: u16, y: u16) -> u16 {
        let text = self.text();
        let end = canvas.text(x, y, &text, theme.strong());
        let before: String = self.text[..self.cursor].iter().collect();
        let at = x + width(&before);
        let under = self.text.get(self.cursor).copied().unwrap_or(' ');
        canvas.glyph(at, y, under, theme.focus());
        end.max(at + 1)
    }

    fn insert(&mut self, c: char) {
        let welcome = !c.is_control() && self.allowed.is_none_or(|allowed| allowed.contains(c));
        if welcome && self.text.len() < CHARS_MAX {
            self.text.insert(self.cursor, c);
            self.cursor += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(keys: &[KeyCode], expect: &str) {
        let mut line = Line::only("0123456789.-");
        for code in keys {
            line.on_key(KeyEvent::new(*code, KeyModifiers::NONE));
        }
        assert_eq!(line.text(), expect, "{keys:?}");
    }

    #[test]
    fn typing_corrects_itself() {
        use KeyCode::{Backspace, Char, Delete, End, Home, Left};
        check(&[Char('7'), Char('2')], "72");
        check(&[Char('7'), Char('x'), Char('2')], "72");
        check(&[Char('7'), Char('2'), Left, Char('0')], "702");
        check(&[Char('7'), Char('2'), Backspace, Backspace, Backspace], "");
        check(&[Char('7'), Char('2'), Home, Delete, End, Char('5')], "25");
    }

    #[test]
    fn a_paste_is_text_and_has_a_bound() {
        let mut line = Line::new("");
        line.paste("12\r\n34\u{1b}[A\n");
        assert_eq!(line.text(), "1234[A");
        line.paste(&"9".repeat(1_000));
        assert_eq!(line.text().len(), CHARS_MAX);
    }
}
