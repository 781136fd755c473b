//! A one-line text editor.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use unicode_segmentation::UnicodeSegmentation;

use crate::ui::{
    theme::Theme,
    widgets::text::{Canvas, width},
};

/// Longest text that can be entered, unless more is asked for.
const CHARS_MAX: usize = 64;

/// A text and the place of its cursor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    text: Vec<char>,
    cursor: usize,
    /// Most characters that it takes.
    room: usize,
    /// Something that was typed or pasted is not in the text; the text is incomplete until it is cleared.
    missed: bool,
    /// It was there before anything was typed: what is typed stands in its place, another key keeps it.
    is_offered: bool,
}

impl Default for Line {
    fn default() -> Line {
        Line::new("")
    }
}

impl Line {
    pub fn new(text: &str) -> Line {
        Line::long(text, CHARS_MAX)
    }
    /// A text of at most so many characters.
    pub fn long(text: &str, room: usize) -> Line {
        let text: Vec<char> = text.chars().take(room).collect();
        Line { cursor: text.len(), text, room, missed: false, is_offered: false }
    }
    /// A text that is offered: typed text replaces it.
    pub fn offered(text: &str) -> Line {
        Line::long(text, CHARS_MAX).into_offered()
    }
    /// The same text, offered.
    pub fn into_offered(self) -> Line {
        Line { is_offered: !self.text.is_empty(), ..self }
    }
    pub fn text(&self) -> String {
        self.text.iter().collect()
    }
    /// Was anything left out since the text was last empty? Such a text says something else than its author meant.
    pub fn missed(&self) -> bool {
        self.missed
    }
    /// An editing key; `false` if it is none.
    pub fn on_key(&mut self, event: KeyEvent) -> bool {
        let (known, offered) = (self.edit(event), self.is_offered);
        self.is_offered = offered && !known;
        // Clearing the text resets the mark; a rejected key does not.
        let typed = matches!(event.code, KeyCode::Char(_)) && !event.modifiers.contains(KeyModifiers::CONTROL);
        self.missed &= typed || !self.text.is_empty();
        known
    }

    fn edit(&mut self, event: KeyEvent) -> bool {
        let ctrl = event.modifiers.contains(KeyModifiers::CONTROL);
        match event.code {
            KeyCode::Char('u') if ctrl => {
                self.text.drain(..self.cursor);
                self.cursor = 0;
            }
            KeyCode::Char('a') if ctrl => self.cursor = 0,
            KeyCode::Char('e') if ctrl => self.cursor = self.text.len(),
            // Over a slow line a lone Esc and a digit arrive as Alt with that digit: it is not taken, and that is noted.
            KeyCode::Char(_) if event.modifiers.contains(KeyModifiers::ALT) => self.missed = true,
            KeyCode::Char(c) if !ctrl => self.insert(c),
            KeyCode::Backspace | KeyCode::Delete if self.is_offered => self.clear(),
            KeyCode::Backspace if self.cursor > 0 => {
                self.cursor -= 1;
                self.text.remove(self.cursor);
            }
            KeyCode::Delete if self.cursor < self.text.len() => {
                self.text.drain(self.cursor..self.after());
            }
            KeyCode::Left => self.cursor = self.before(),
            KeyCode::Right => self.cursor = self.after(),
            KeyCode::Home => self.cursor = 0,
            KeyCode::End => self.cursor = self.text.len(),
            _ => return false,
        }
        true
    }
    /// Notes that something typed or pasted was not taken.
    pub fn miss(&mut self) {
        self.missed = true;
    }
    /// Pasted text: control characters (a line end above all) become blanks, so a paste never confirms anything and
    /// two lines never become one number.
    pub fn paste(&mut self, text: &str) {
        if std::mem::take(&mut self.is_offered) {
            self.clear();
        }
        for c in text.trim().chars() {
            self.insert(if c.is_control() { ' ' } else { c });
        }
    }
    /// Pasted text as it is, for a password: what cannot be in a line is missed, not replaced.
    pub fn paste_whole(&mut self, text: &str) {
        text.chars().for_each(|c| self.insert(c));
    }
    /// The same line with another character for each of its own: for a password.
    pub fn hidden(&self, dot: char) -> Line {
        Line { text: vec![dot; self.text.len()], ..self.clone() }
    }
    /// Draws text and cursor; returns the column after it. A text that is too wide is drawn from a later character on,
    /// marked with `…`, so that the cursor stays in sight.
    pub fn view(&self, theme: &Theme, canvas: &mut Canvas, x: u16, y: u16) -> u16 {
        let room = canvas.width().saturating_sub(x + 1);
        let part = |from: usize| self.text[from..self.cursor].iter().collect::<String>();
        let first = (0..=self.cursor).find(|from| width(&part(*from)) + u16::from(*from > 0) <= room);
        let first = first.unwrap_or(self.cursor);
        let start = if first > 0 { canvas.text(x, y, theme.ellipsis(), theme.strong()) } else { x };
        let style = if self.is_offered { theme.focus() } else { theme.strong() };
        let end = canvas.text(start, y, &self.text[first..].iter().collect::<String>(), style);
        let at = start + width(&part(first));
        let under = self.text[self.cursor..self.after()].iter().collect::<String>();
        if under.is_empty() {
            canvas.text(at, y, " ", theme.focus());
        } else {
            canvas.paint(at, y, width(&under), 1, theme.focus());
        }
        end.max(at + 1)
    }

    /// Where the letter before the cursor begins: marks above and below belong to it.
    fn before(&self) -> usize {
        let text: String = self.text[..self.cursor].iter().collect();
        self.cursor - text.graphemes(true).next_back().map_or(0, |letter| letter.chars().count())
    }
    /// Where the letter at the cursor ends.
    fn after(&self) -> usize {
        let text: String = self.text[self.cursor..].iter().collect();
        self.cursor + text.graphemes(true).next().map_or(0, |letter| letter.chars().count())
    }

    fn clear(&mut self) {
        self.text.clear();
        self.cursor = 0;
    }

    fn insert(&mut self, c: char) {
        if self.is_offered && !c.is_control() {
            self.is_offered = false;
            self.clear();
        }
        if c.is_control() || self.text.len() >= self.room {
            self.missed = true;
            return;
        }
        self.text.insert(self.cursor, c);
        self.cursor += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_text_replaces_what_was_offered() {
        let typed = |keys: &[KeyCode]| {
            let mut line = Line::offered("bench.toml");
            for code in keys {
                line.on_key((*code).into());
            }
            line.text()
        };
        assert_eq!(typed(&[]), "bench.toml");
        assert_eq!(typed(&[KeyCode::Char('p'), KeyCode::Char('x')]), "px");
        assert_eq!(typed(&[KeyCode::End, KeyCode::Char('x')]), "bench.tomlx", "another key keeps it");
        assert_eq!(typed(&[KeyCode::Left, KeyCode::Backspace]), "bench.toml".replace("ml", "l"));
        assert_eq!(typed(&[KeyCode::Backspace]), "");
        let mut pasted = Line::offered("bench.toml");
        pasted.paste("a.toml");
        assert_eq!(pasted.text(), "a.toml");
    }

    fn check(keys: &[KeyCode], expect: &str) {
        let mut line = Line::default();
        for code in keys {
            line.on_key(KeyEvent::new(*code, KeyModifiers::NONE));
        }
        assert_eq!(line.text(), expect, "{keys:?}");
    }

    #[test]
    fn typing_corrects_itself() {
        use KeyCode::{Backspace, Char, Delete, End, Home, Left};
        check(&[Char('7'), Char('2')], "72");
        check(&[Char('7'), Char('x'), Char('2')], "7x2");
        check(&[Char('7'), Char('2'), Left, Char('0')], "702");
        check(&[Char('7'), Char('2'), Backspace, Backspace, Backspace], "");
        check(&[Char('7'), Char('2'), Home, Delete, End, Char('5')], "25");
    }

    #[test]
    fn the_cursor_stands_between_letters_not_marks() {
        use KeyCode::{Backspace, Char, Delete, Home, Left, Right};
        let typed = "ถังน้ำ".chars().map(Char);
        let keys = |more: &[KeyCode]| typed.clone().chain(more.iter().copied()).collect::<Vec<_>>();
        check(&keys(&[Left, Char('x')]), "ถังxน้ำ");
        check(&keys(&[Left, Left, Delete]), "ถัน้ำ");
        check(&keys(&[Home, Right, Char('x')]), "ถัxงน้ำ");
        check(&keys(&[Home, Delete]), "งน้ำ");
        check(&keys(&[Backspace]), "ถังน้");
    }

    #[test]
    fn a_paste_is_text_and_has_a_bound() {
        let mut line = Line::new("");
        line.paste("12\r\n34\u{1b}[A\n");
        assert_eq!(line.text(), "12  34 [A");
        assert!(!line.missed());
        line.paste(&"9".repeat(1_000));
        assert_eq!(line.text().len(), CHARS_MAX);
        assert!(line.missed(), "what did not fit is not forgotten");
        line.on_key(KeyEvent::new(KeyCode::Char('u'), KeyModifiers::CONTROL));
        assert!(!line.missed());
        line.on_key(KeyEvent::new(KeyCode::Char('5'), KeyModifiers::ALT));
        line.on_key(KeyEvent::new(KeyCode::Char('7'), KeyModifiers::NONE));
        assert!(line.missed(), "an Alt digit is not taken, but noticed");
    }
}
