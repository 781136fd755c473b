//! A form: fields one below the other, typed or chosen. Every window that is filled in is one.

mod field;

use crate::t;
use std::ops::Range;

use crossterm::event::{KeyCode, KeyEvent};

use super::line::Line;
use crate::{
    access::Secret,
    plant::number::to_u16,
    ui::{
        ViewContext, keys,
        widgets::text::{Canvas, fit, pad, width},
    },
};
pub use field::Field;
use field::{Input, SECRET_CHARS};

/// Fields to fill in.
#[derive(Debug, Clone, PartialEq)]
pub struct Form {
    fields: Vec<Field>,
    at: usize,
    /// Passwords are readable, on request.
    shown: bool,
    /// Enter submits on any field, where a form is mostly filled in already.
    submits: bool,
}

/// What a key did to a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyOutcome {
    /// Something was typed or chosen, or another field is selected.
    Taken,
    /// Enter: the form is submitted.
    Submitted,
    Ignored,
}

/// Where a field was drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// Its place in the form.
    pub field: usize,
    pub y: u16,
    /// The column behind its value.
    pub end: u16,
}

impl Form {
    /// A form of these fields; the first empty one is selected. Enter leads from one to the next, and submits on the last.
    pub fn new(fields: Vec<Field>) -> Form {
        let mut form = Form { fields, at: 0, shown: false, submits: false };
        form.forget();
        form
    }

    /// The same, submitted with Enter on any field; this one is selected.
    pub fn submitting(fields: Vec<Field>, at: usize) -> Form {
        Form { fields, at, shown: false, submits: true }
    }

    pub fn rows(&self) -> u16 {
        to_u16(self.fields.iter().filter(|field| !field.hidden).count())
    }

    /// Its fields, hidden ones too.
    pub fn count(&self) -> usize {
        self.fields.len()
    }

    pub fn selected(&self) -> usize {
        self.at
    }

    pub fn select(&mut self, n: usize) {
        self.at = n.min(self.fields.len().saturating_sub(1));
    }

    /// Selects the next field that is shown, if there is one.
    pub fn select_next(&mut self) {
        self.at = self.next(1).unwrap_or(self.at);
    }

    /// Is there a password to be typed?
    pub fn has_secret(&self) -> bool {
        self.fields.iter().any(|field| matches!(field.input, Input::Secret(_)))
    }

    /// Is the selected field chosen with ← and →?
    pub fn is_on_choice(&self) -> bool {
        matches!(self.fields.get(self.at).map(|field| &field.input), Some(Input::Choice(..)))
    }

    /// Is every letter typed into the selected field, so that none is a key?
    pub fn is_on_text(&self) -> bool {
        matches!(self.fields.get(self.at).map(|field| &field.input), Some(Input::Text(_) | Input::Secret(_)))
    }

    /// What stands in field `n`, without blanks around it; of a choice its words, of a password nothing.
    pub fn text(&self, n: usize) -> String {
        match self.fields.get(n).map(|field| &field.input) {
            Some(Input::Text(line) | Input::Digits(line)) => line.text().trim().to_owned(),
            Some(Input::Choice(options, chosen)) => options[*chosen].clone(),
            Some(Input::Secret(_)) | None => String::new(),
        }
    }

    /// The label of field `n`.
    pub fn label(&self, n: usize) -> &'static str {
        self.fields.get(n).map_or("", |field| field.label)
    }

    /// The password in field `n`, as it was typed.
    pub fn secret(&self, n: usize) -> Secret {
        match self.fields.get(n).map(|field| &field.input) {
            Some(Input::Secret(line)) => Secret(line.text()),
            Some(Input::Text(_) | Input::Digits(_) | Input::Choice(..)) | None => Secret::default(),
        }
    }

    /// Which of its options field `n` has, if it is a choice.
    pub fn choice(&self, n: usize) -> Option<usize> {
        match self.fields.get(n).map(|field| &field.input) {
            Some(Input::Choice(_, chosen)) => Some(*chosen),
            Some(Input::Text(_) | Input::Digits(_) | Input::Secret(_)) | None => None,
        }
    }

    /// The same of a field that is one; 0 else.
    pub fn chosen(&self, n: usize) -> usize {
        self.choice(n).unwrap_or(0)
    }

    /// Puts another field in this place.
    pub fn replace(&mut self, n: usize, field: Field) {
        self.fields[n] = field;
    }

    pub fn replace_from(&mut self, n: usize, fields: Vec<Field>) {
        self.fields.splice(n.., fields);
        self.select(self.at);
    }

    /// Gives a field another label.
    pub fn label_with(&mut self, n: usize, label: &'static str) {
        self.fields[n].label = label;
    }

    pub fn is_hidden(&self, n: usize) -> bool {
        self.fields[n].hidden
    }

    pub fn hide(&mut self, n: usize, hidden: bool) {
        self.fields[n].hidden = hidden;
    }

    /// Does a field hold something else than its author meant? The text is incomplete until it is cleared.
    pub fn is_cut(&self) -> bool {
        self.fields.iter().filter(|field| !field.hidden).filter_map(Field::line).any(Line::missed)
    }

    /// The first field that holds something else than its author meant, or nothing; it is selected.
    pub fn lacking(&mut self) -> Option<String> {
        let lacks = |field: &Field| match &field.input {
            Input::Text(line) | Input::Digits(line) | Input::Secret(line) if line.missed() => Some(cut()),
            Input::Text(line) | Input::Digits(line) if line.text().trim().is_empty() => Some(required(field.label)),
            Input::Secret(line) if line.text().is_empty() => Some(required(field.label)),
            Input::Text(_) | Input::Digits(_) | Input::Secret(_) | Input::Choice(..) => None,
        };
        let mut shown = self.fields.iter().enumerate().filter(|(_, field)| !field.hidden);
        let (n, why) = shown.find_map(|(n, field)| Some((n, lacks(field)?)))?;
        self.at = n;
        Some(why)
    }

    /// Empties the passwords; the first empty field is selected.
    pub fn forget(&mut self) {
        for field in &mut self.fields {
            if let Input::Secret(line) = &mut field.input {
                *line = Line::long("", SECRET_CHARS);
            }
        }
        let empty = |field: &Field| field.line().is_some_and(|line| line.text().is_empty());
        self.at = self.fields.iter().position(empty).unwrap_or(0);
        self.shown = false;
    }

    pub fn on_key(&mut self, event: KeyEvent) -> KeyOutcome {
        let enter = keys::code(KeyCode::Enter).is(event);
        match event.code {
            KeyCode::Enter if enter && (self.submits || self.next(1).is_none()) => return KeyOutcome::Submitted,
            KeyCode::Enter if !enter => return KeyOutcome::Ignored,
            KeyCode::Enter | KeyCode::Down => self.at = self.next(1).unwrap_or(self.at),
            KeyCode::Up => self.at = self.next(-1).unwrap_or(self.at),
            KeyCode::Tab => self.at = self.next(1).or_else(|| self.shown_at(true)).unwrap_or(self.at),
            KeyCode::BackTab => self.at = self.next(-1).or_else(|| self.shown_at(false)).unwrap_or(self.at),
            _ if keys::ctrl('r').is(event) && self.has_secret() => self.shown = !self.shown,
            _ => {
                let typed = self.fields.get_mut(self.at).is_some_and(|field| field.type_key(event));
                return if typed { KeyOutcome::Taken } else { KeyOutcome::Ignored };
            }
        }
        KeyOutcome::Taken
    }

    /// The next field that is shown, down (1) or up (-1).
    fn next(&self, by: isize) -> Option<usize> {
        let is_shown = |n: &usize| !self.fields[*n].hidden;
        match by {
            1 => (self.at + 1..self.fields.len()).find(is_shown),
            _ => (0..self.at).rev().find(is_shown),
        }
    }

    /// The first field that is shown, or the last.
    fn shown_at(&self, first: bool) -> Option<usize> {
        let mut shown = (0..self.fields.len()).filter(|n| !self.fields[*n].hidden);
        if first { shown.next() } else { shown.next_back() }
    }

    /// Pasted text goes into the selected field if it is typed; a line end at its end is no part of a password.
    pub fn paste(&mut self, text: &str) {
        match self.fields.get_mut(self.at).map(|field| &mut field.input) {
            Some(Input::Text(line) | Input::Digits(line)) => line.paste(text),
            Some(Input::Secret(line)) => line.paste_whole(text.trim_end_matches(['\r', '\n'])),
            Some(Input::Choice(..)) | None => {}
        }
    }

    pub fn width(&self) -> u16 {
        self.labels() + 36
    }

    /// Columns of its labels, with the mark before and a gap behind them.
    pub fn labels(&self) -> u16 {
        self.fields.iter().map(|field| width(field.label)).max().unwrap_or(0) + 4
    }

    /// Draws it into these rows, values from column `x` on: on a small screen those around the selected field, which has the
    /// mark, the cursor, or arrows around its choice.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, x: u16, rows: Range<u16>) -> Vec<Drawn> {
        let theme = cx.theme;
        let shown: Vec<usize> = (0..self.fields.len()).filter(|n| !self.fields[*n].hidden).collect();
        let selected = shown.iter().position(|n| *n == self.at).unwrap_or(0);
        let first = (selected + 1).saturating_sub(rows.len());
        let mut drawn = Vec::new();
        for (y, n) in rows.zip(shown.into_iter().skip(first)) {
            let (field, here) = (&self.fields[n], n == self.at);
            let mark = if here { theme.pick("▸ ", "> ") } else { "  " };
            let label = canvas.text(0, y, mark, theme.strong());
            canvas.text(label, y, &pad(field.label, x.saturating_sub(label + 1)), theme.normal());
            let end = match &field.input {
                Input::Choice(options, chosen) => {
                    let style = if here { theme.focus() } else { theme.strong() };
                    canvas.text(x, y, &format!("‹ {} ›", options[*chosen]), style)
                }
                Input::Text(line) | Input::Digits(line) => draw(cx, canvas, (x, y), line, here),
                Input::Secret(line) if self.shown => draw(cx, canvas, (x, y), line, here),
                Input::Secret(line) => draw(cx, canvas, (x, y), &line.hidden(theme.pick('•', '*')), here),
            };
            if here {
                let left = canvas.width().saturating_sub(end + 2);
                canvas.text_right(canvas.width(), y, &fit(&field.range, left), theme.dim());
            }
            drawn.push(Drawn { field: n, y, end });
        }
        drawn
    }
}

fn draw(cx: &ViewContext, canvas: &mut Canvas, (x, y): (u16, u16), line: &Line, here: bool) -> u16 {
    if here {
        line.view(cx.theme, canvas, x, y)
    } else if line.text().is_empty() {
        canvas.run(x, y, 20, '·', cx.theme.dim());
        x + 20
    } else {
        canvas.text(x, y, &line.text(), cx.theme.strong())
    }
}

/// What was typed or pasted is not all there.
pub fn cut() -> String {
    t!("the text was cut; Ctrl-U clears the line").to_owned()
}

/// `required: password`. Without an article, so that it stays right with every label and in every language.
fn required(label: &str) -> String {
    t!("required: {label}", label)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossterm::event::KeyModifiers;

    fn form(keys: &str) -> Form {
        let mut form = Form::new(vec![
            Field::name("name"),
            Field::choice("role", ["Viewer", "Technician"], 0),
            Field::secret("password"),
        ]);
        for c in keys.chars() {
            let code = if c == '⏎' { KeyCode::Enter } else { KeyCode::Char(c) };
            form.on_key(KeyEvent::new(code, KeyModifiers::NONE));
        }
        form
    }

    #[test]
    fn enter_leads_from_line_to_line() {
        let form = form("anna⏎ ⏎a b ");
        assert_eq!((form.text(0).as_str(), form.chosen(1), form.secret(2).0.as_str()), ("anna", 1, "a b "));
    }

    #[test]
    fn what_is_typed_is_not_in_a_log() {
        assert!(!format!("{:?}", form("anna⏎⏎horse")).contains("horse"));
    }

    #[test]
    fn a_pasted_password_keeps_its_blanks_and_tells_what_it_lost() {
        let mut form = form("anna⏎⏎");
        form.paste("  correct horse \n");
        assert_eq!((form.secret(2).0.as_str(), form.lacking()), ("  correct horse ", None));
        form.paste("two\nlines");
        assert!(form.lacking().is_some_and(|why| why.contains("the text was cut")));
        form.forget();
        assert_eq!(form.lacking().as_deref(), Some("required: password"));
        assert_eq!(form.text(0), "anna");
    }
}
