//! A few lines to fill in, one below the other: names, passwords that are never shown, a role.

use crate::t;
use crate::text::translate;
use std::fmt;

use crossterm::event::{KeyCode, KeyEvent};

use super::line::Line;
use crate::{
    access::Secret,
    plant::{number::to_u16, role::Role},
    ui::{
        ViewContext, keys,
        widgets::text::{Canvas, pad, width},
    },
};

/// Most characters of a password, and of a name.
const SECRET_CHARS: usize = 128;
const NAME_CHARS: usize = 32;

/// Lines to fill in.
#[derive(Debug, Clone, PartialEq)]
pub struct Form {
    fields: Vec<Field>,
    /// The one that is typed into.
    at: usize,
    /// Passwords are readable, on request.
    shown: bool,
}

/// A line of a form. What was typed never comes out of its `Debug`.
#[derive(Clone, PartialEq)]
pub struct Field {
    label: &'static str,
    what: What,
}

#[derive(Clone, PartialEq)]
enum What {
    Text(Line),
    Secret(Line),
    Role(Role),
}

/// What a key did to a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// Something was typed, or another line is typed into now.
    Taken,
    /// Enter on the last line: the form is finished.
    Finished,
    /// Nothing.
    Nothing,
}

impl Field {
    /// A name, empty.
    pub fn name(label: &'static str) -> Field {
        Field { label, what: What::Text(Line::long("", NAME_CHARS)) }
    }
    /// A password, empty.
    pub fn secret(label: &'static str) -> Field {
        Field { label, what: What::Secret(Line::long("", SECRET_CHARS)) }
    }
    /// A role to choose.
    pub fn role(label: &'static str, role: Role) -> Field {
        Field { label, what: What::Role(role) }
    }
}

impl Form {
    /// A form of these lines; the first is typed into.
    pub fn new(fields: Vec<Field>) -> Form {
        let mut form = Form { fields, at: 0, shown: false };
        form.forget();
        form
    }

    /// Lines of it.
    pub fn rows(&self) -> u16 {
        to_u16(self.fields.len())
    }

    /// Is there a password to be typed?
    pub fn has_secret(&self) -> bool {
        self.fields.iter().any(|field| matches!(field.what, What::Secret(_)))
    }

    /// What stands in line `n`, without blanks around it; empty for a role.
    pub fn name(&self, n: usize) -> String {
        match self.fields.get(n).map(|field| &field.what) {
            Some(What::Text(line)) => line.text().trim().to_owned(),
            Some(What::Secret(_) | What::Role(_)) | None => String::new(),
        }
    }

    /// The password in line `n`, as it was typed.
    pub fn secret(&self, n: usize) -> Secret {
        match self.fields.get(n).map(|field| &field.what) {
            Some(What::Secret(line)) => Secret(line.text()),
            Some(What::Text(_) | What::Role(_)) | None => Secret::default(),
        }
    }

    /// The role that is chosen.
    pub fn role(&self) -> Option<Role> {
        self.fields.iter().find_map(|field| match field.what {
            What::Role(role) => Some(role),
            What::Text(_) | What::Secret(_) => None,
        })
    }

    /// The first line that holds something else than its author meant, or nothing; typing goes on there.
    pub fn lacking(&mut self) -> Option<String> {
        let lacks = |field: &Field| match &field.what {
            What::Text(line) | What::Secret(line) if line.missed() => {
                Some(t!("the text was cut; Ctrl-U clears the line").to_owned())
            }
            What::Text(line) if line.text().trim().is_empty() => Some(required(field.label)),
            What::Secret(line) if line.text().is_empty() => Some(required(field.label)),
            What::Text(_) | What::Secret(_) | What::Role(_) => None,
        };
        let (n, why) = self.fields.iter().enumerate().find_map(|(n, field)| Some((n, lacks(field)?)))?;
        self.at = n;
        Some(why)
    }

    /// Empties the passwords; the first empty line is typed into.
    pub fn forget(&mut self) {
        for field in &mut self.fields {
            if let What::Secret(line) = &mut field.what {
                *line = Line::long("", SECRET_CHARS);
            }
        }
        let empty = |field: &Field| match &field.what {
            What::Text(line) | What::Secret(line) => line.text().is_empty(),
            What::Role(_) => false,
        };
        self.at = self.fields.iter().position(empty).unwrap_or(0);
        self.shown = false;
    }

    /// A key.
    pub fn on_key(&mut self, event: KeyEvent) -> Turn {
        let last = self.fields.len().saturating_sub(1);
        let choosing = matches!(self.fields.get(self.at).map(|field| &field.what), Some(What::Role(_)));
        match event.code {
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) && self.at >= last => return Turn::Finished,
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => self.at += 1,
            KeyCode::Down => self.at = (self.at + 1).min(last),
            KeyCode::Tab => self.at = (self.at + 1) % (last + 1),
            KeyCode::Up => self.at = self.at.saturating_sub(1),
            KeyCode::BackTab => self.at = (self.at + last) % (last + 1),
            KeyCode::Left if choosing => self.choose(-1),
            KeyCode::Right | KeyCode::Char(' ') if choosing => self.choose(1),
            _ if keys::ctrl('r').is(event) => self.shown = !self.shown,
            _ => {
                let typed = match self.fields.get_mut(self.at).map(|field| &mut field.what) {
                    Some(What::Text(line) | What::Secret(line)) => line.on_key(event),
                    Some(What::Role(_)) | None => false,
                };
                return if typed { Turn::Taken } else { Turn::Nothing };
            }
        }
        Turn::Taken
    }

    /// Pasted text goes into the line that is typed into; a line end at its end is no part of a password.
    pub fn paste(&mut self, text: &str) {
        match self.fields.get_mut(self.at).map(|field| &mut field.what) {
            Some(What::Text(line)) => line.paste(text),
            Some(What::Secret(line)) => line.paste_whole(text.trim_end_matches(['\r', '\n'])),
            Some(What::Role(_)) | None => {}
        }
    }

    fn choose(&mut self, by: isize) {
        if let Some(What::Role(role)) = self.fields.get_mut(self.at).map(|field| &mut field.what) {
            let place = Role::ALL.iter().position(|other| other == role).unwrap_or(0) as isize;
            *role = Role::ALL[(place + by).rem_euclid(Role::ALL.len() as isize) as usize];
        }
    }

    /// Columns that it wants.
    pub fn width(&self) -> u16 {
        self.labels() + 36
    }

    fn labels(&self) -> u16 {
        self.fields.iter().map(|field| width(field.label)).max().unwrap_or(0) + 4
    }

    /// Draws it from row `y` on. The line that is typed into has the mark and the cursor.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, y: u16) {
        let theme = cx.theme;
        for (n, field) in self.fields.iter().enumerate() {
            let (y, here) = (y + to_u16(n), n == self.at);
            let mark = if here { theme.pick("▸ ", "> ") } else { "  " };
            canvas.text(0, y, &format!("{mark}{}", pad(field.label, self.labels())), theme.normal());
            let x = self.labels();
            match &field.what {
                What::Role(role) => {
                    let style = if here { theme.focus() } else { theme.strong() };
                    let end = canvas.text(x, y, translate(role.word()), style);
                    if here {
                        canvas.text(end + 2, y, theme.pick(t!("← → change"), t!("left/right change")), theme.dim());
                    }
                }
                What::Text(line) => draw(cx, canvas, (x, y), line, here),
                What::Secret(line) if self.shown => draw(cx, canvas, (x, y), line, here),
                What::Secret(line) => draw(cx, canvas, (x, y), &line.hidden(theme.pick('•', '*')), here),
            }
        }
    }
}

fn draw(cx: &ViewContext, canvas: &mut Canvas, (x, y): (u16, u16), line: &Line, here: bool) {
    if here {
        line.view(cx.theme, canvas, x, y);
    } else if line.text().is_empty() {
        canvas.run(x, y, 20, '·', cx.theme.dim());
    } else {
        canvas.text(x, y, &line.text(), cx.theme.strong());
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.label)
    }
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
        let mut form =
            Form::new(vec![Field::name("name"), Field::role("role", Role::Viewer), Field::secret("password")]);
        for c in keys.chars() {
            let code = if c == '⏎' { KeyCode::Enter } else { KeyCode::Char(c) };
            form.on_key(KeyEvent::new(code, KeyModifiers::NONE));
        }
        form
    }

    #[test]
    fn enter_leads_from_line_to_line() {
        let form = form("anna⏎ ⏎a b ");
        assert_eq!(
            (form.name(0).as_str(), form.role(), form.secret(2).0.as_str()),
            ("anna", Some(Role::Technician), "a b ")
        );
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
        assert_eq!(form.name(0), "anna");
    }
}
