//! The settings of a terminal: tried while they are chosen, saved with Enter, cancelled with Esc.

#[cfg(test)]
mod tests;

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, window};
use crate::{
    plant::{def::Priority, number::to_u16},
    t,
    text::{Language, translate},
    ui::{
        Model, UiAction, ViewContext,
        graphics::{Pictures, Protocol},
        keys,
        keys::Hint,
        preferences::{Bell, Characters, Preferences},
        theme::{Colours, Glyphs, ThemeName},
        widgets::{
            chart,
            text::{Canvas, fit_words, pad, width, wrap},
        },
    },
};

/// The window. While it is open the terminal looks as chosen in it.
#[derive(Debug, Clone, PartialEq)]
pub struct TerminalSettings {
    /// What is chosen so far.
    pub chosen: Preferences,
    /// Whose they are, and where they are kept, or why not.
    kept: Result<String, String>,
    /// The selected row.
    row: usize,
}

/// A row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Field {
    Theme,
    Characters,
    Pictures,
    Motion,
    Bell,
    Mouse,
    Language,
}

const FIELDS: [Field; 7] =
    [Field::Theme, Field::Characters, Field::Pictures, Field::Motion, Field::Bell, Field::Mouse, Field::Language];

impl TerminalSettings {
    /// What is in use, to be changed.
    pub fn new(model: &Model) -> TerminalSettings {
        let file = &model.preferences_file;
        let kept = match (&file.problem, model.user()) {
            (Some(problem), _) => Err(t!("Not kept: {problem}", problem)),
            (None, Some(user)) => Ok(t!("Enter saves for {user} in {path}", user, path = file.path)),
            (None, None) => Ok(t!("Enter saves for everyone who is not logged in, in {path}", path = file.path)),
        };
        let shown = model.chosen_locale.map(|locale| locale.language);
        let language = shown.or(model.preferences.language);
        TerminalSettings { chosen: Preferences { language, ..model.preferences }, kept, row: 0 }
    }

    pub(super) fn hints(&self) -> Vec<Hint> {
        vec![
            Hint::in_window("↑↓", t!("select")),
            Hint::in_window("←→", t!("change")),
            Hint::in_window("⏎", t!("OK")),
            Hint::in_window(t!("Esc"), t!("cancel")),
        ]
    }

    pub(super) fn on_key(mut self, event: KeyEvent) -> Next {
        let last = FIELDS.len() - 1;
        match event.code {
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => {
                let keep = UiAction::KeepPreferences(self.chosen);
                // It stays below the password of a locked terminal; what is kept closes it.
                return Next::Both(Modal::TerminalSettings(self), vec![keep]);
            }
            KeyCode::Up => self.row = self.row.checked_sub(1).unwrap_or(last),
            KeyCode::Down | KeyCode::Tab => self.row = if self.row == last { 0 } else { self.row + 1 },
            KeyCode::Left => self.step(-1),
            KeyCode::Right | KeyCode::Char(' ') => self.step(1),
            KeyCode::Char('q') => return Next::Close,
            _ => {}
        }
        Next::Stay(Modal::TerminalSettings(self))
    }

    fn step(&mut self, by: isize) {
        let field = FIELDS[self.row.min(FIELDS.len() - 1)];
        let chosen = &mut self.chosen;
        match field {
            Field::Theme => chosen.theme = stepped(&ThemeName::ALL, chosen.theme, by),
            Field::Characters => chosen.characters = stepped(&Characters::ALL, chosen.characters, by),
            Field::Pictures => chosen.pictures = stepped(&Pictures::ALL, chosen.pictures, by),
            Field::Motion => chosen.motion = !chosen.motion,
            Field::Bell => chosen.bell = stepped(&Bell::ALL, chosen.bell, by),
            Field::Mouse => chosen.mouse = !chosen.mouse,
            Field::Language => {
                let all: Vec<_> = std::iter::once(None).chain(Language::all().map(Some)).collect();
                chosen.language = stepped(&all, chosen.language, by);
            }
        }
    }

    fn value(&self, field: Field) -> &'static str {
        let on = |on: bool| if on { t!("on") } else { t!("off") };
        match field {
            Field::Theme => translate(self.chosen.theme.word()),
            Field::Characters => translate(self.chosen.characters.word()),
            Field::Pictures => translate(self.chosen.pictures.word()),
            Field::Motion => on(self.chosen.motion),
            Field::Bell => translate(self.chosen.bell.word()),
            Field::Mouse => on(self.chosen.mouse),
            Field::Language => self.chosen.language.map_or(t!("automatic"), Language::name),
        }
    }

    /// What the choice means.
    fn note(&self, cx: &ViewContext, field: Field) -> &'static str {
        match field {
            Field::Theme if cx.theme.colours == Colours::None => t!("no colours here"),
            Field::Theme => match self.chosen.theme {
                ThemeName::Grey => t!("abnormal in colour"),
                ThemeName::Dark => t!("more colour on black"),
                ThemeName::Light => t!("for bright rooms"),
                ThemeName::HighContrast => t!("bright on black"),
                ThemeName::Mono => t!("without hue"),
            },
            Field::Characters => match cx.theme.glyphs {
                Glyphs::Braille => t!("as braille dots"),
                Glyphs::Block => t!("as blocks"),
                Glyphs::Ascii => t!("as ASCII characters"),
            },
            Field::Pictures => match cx.theme.graphics.protocol(self.chosen.pictures) {
                Ok((Protocol::Kitty, _)) => t!("i in Trends: Kitty"),
                Ok((Protocol::Sixel, _)) => t!("i in Trends: Sixel"),
                Err(_) => t!("characters only"),
            },
            Field::Motion => t!("agitators and arrows"),
            Field::Bell => match self.chosen.bell {
                Bell::Off => t!("alarms make no sound"),
                Bell::Once | Bell::Repeated => t!("Ctrl-S silences"),
            },
            Field::Mouse if self.chosen.mouse => t!("Shift selects text"),
            Field::Mouse => t!("selects text"),
            Field::Language => "",
        }
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = body.width.saturating_sub(4).min(76);
        let (words, style) = match &self.kept {
            Ok(words) => (words, theme.dim()),
            Err(words) => (words, theme.trouble()),
        };
        let kept: Vec<_> = wrap(words, room).into_iter().map(|row| (row, style)).collect();
        let rows = to_u16(FIELDS.len());
        let wanted = rows + 3 + to_u16(kept.len());
        let mut canvas = window(cx, frame, body, t!("terminal settings"), (room, wanted));
        let names = FIELDS.iter().map(|field| width(field.name())).max().unwrap_or(0);
        let values = FIELDS.iter().map(|field| width(self.value(*field))).max().unwrap_or(0).max(18);
        for (y, (n, field)) in (0..).zip(FIELDS.into_iter().enumerate()) {
            let selected = n == self.row;
            canvas.text(0, y, if selected { theme.pick("▸", ">") } else { " " }, theme.strong());
            let x = canvas.text(2, y, &pad(field.name(), names), if selected { theme.focus() } else { theme.normal() });
            let value = self.value(field);
            let value = if selected { format!("‹ {value} ›") } else { format!("  {value}") };
            canvas.text(x + 1, y, &value, if selected { theme.strong() } else { theme.normal() });
            let x = x + values + 6;
            canvas.text(x, y, &fit_words(self.note(cx, field), canvas.width().saturating_sub(x)), theme.dim());
        }
        // Blank rows give way on a small screen, then the sample.
        let gap = u16::from(wanted <= canvas.height());
        let last = canvas.height().saturating_sub(to_u16(kept.len()));
        if rows < last {
            sample(cx, &mut canvas, rows + gap);
        }
        canvas.rows(0, last, &kept);
    }
}

impl Field {
    fn name(self) -> &'static str {
        match self {
            Field::Theme => t!("theme"),
            Field::Characters => t!("characters"),
            Field::Pictures => t!("pictures"),
            Field::Motion => t!("motion"),
            Field::Bell => t!("bell"),
            Field::Mouse => t!("mouse"),
            Field::Language => t!("language"),
        }
    }
}

/// The choice so many places further, round and round.
fn stepped<T: Copy + PartialEq>(all: &[T], now: T, by: isize) -> T {
    let at = all.iter().position(|one| *one == now).unwrap_or(0);
    all[at.saturating_add_signed(by + all.len() as isize) % all.len()]
}

/// Priorities, qualities and pens as they look.
fn sample(cx: &ViewContext, canvas: &mut Canvas, y: u16) {
    let theme = cx.theme;
    let mut x = 2;
    for priority in [Priority::Critical, Priority::High, Priority::Medium, Priority::Low] {
        x = canvas.text(x, y, theme.priority_mark(priority).trim(), theme.severity(priority)) + 1;
    }
    x = canvas.text(x + 1, y, "70.0 ", theme.normal());
    x = canvas.text(x, y, "▽70.0 ", theme.set_value());
    x = canvas.text(x, y, "███", theme.liquid()) + 1;
    for pen in 0..8 {
        x = canvas.text(x, y, chart::mark(theme, pen), theme.pen(pen)) + 1;
    }
}
