//! The settings of a terminal: tried while they are chosen, saved with Enter, cancelled with Esc.

#[cfg(test)]
mod tests;

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Modal, Next,
    form::{Field, Form, KeyOutcome},
    window,
};
use crate::{
    plant::{def::Priority, number::to_u16},
    t,
    text::{Language, Locale, translate},
    ui::{
        Model, UiAction, ViewContext,
        graphics::{Pictures, Protocol},
        keys::Hint,
        preferences::{Bell, Characters, Preferences},
        theme::{Colours, Glyphs, ThemeName},
        widgets::{
            chart,
            text::{Canvas, fit_words, width, wrap},
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
    row: usize,
}

/// The fields of the form, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Setting {
    Theme,
    Characters,
    Pictures,
    Motion,
    Bell,
    Mouse,
    Language,
}

const ROWS: [Setting; 7] = [
    Setting::Theme,
    Setting::Characters,
    Setting::Pictures,
    Setting::Motion,
    Setting::Bell,
    Setting::Mouse,
    Setting::Language,
];

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

    /// The form in the language of the moment, which may be the one that is tried.
    fn form(&self) -> Form {
        let Preferences { theme, characters, pictures, motion, bell, mouse, language } = self.chosen;
        let on = |label, on: bool| Field::choice(label, [t!("on"), t!("off")], usize::from(!on));
        let fields = vec![
            Field::one_of(t!("theme"), &ThemeName::ALL, theme, |theme| translate(theme.word())),
            Field::one_of(t!("characters"), &Characters::ALL, characters, |characters| translate(characters.word())),
            Field::one_of(t!("pictures"), &Pictures::ALL, pictures, |pictures| translate(pictures.word())),
            on(t!("motion"), motion),
            Field::one_of(t!("bell"), &Bell::ALL, bell, |bell| translate(bell.word())),
            on(t!("mouse"), mouse),
            Field::one_of(t!("language"), &languages(), language, |one| one.map_or(t!("automatic"), Language::name)),
        ];
        Form::submitting(fields, self.row)
    }

    pub(super) fn on_key(mut self, event: KeyEvent) -> Next {
        let mut form = self.form();
        match form.on_key(event) {
            KeyOutcome::Submitted => {
                let keep = UiAction::KeepPreferences(self.chosen);
                // It stays below the password of a locked terminal; what is kept closes it.
                return Next::Both(Modal::TerminalSettings(self), vec![keep]);
            }
            KeyOutcome::Ignored if event.code == KeyCode::Char('q') => return Next::Close,
            KeyOutcome::Ignored | KeyOutcome::Taken => {}
        }
        let chosen = |row: Setting| form.chosen(row as usize);
        self.row = form.selected();
        self.chosen = Preferences {
            theme: ThemeName::ALL[chosen(Setting::Theme)],
            characters: Characters::ALL[chosen(Setting::Characters)],
            pictures: Pictures::ALL[chosen(Setting::Pictures)],
            motion: chosen(Setting::Motion) == 0,
            bell: Bell::ALL[chosen(Setting::Bell)],
            mouse: chosen(Setting::Mouse) == 0,
            language: languages()[chosen(Setting::Language)],
        };
        Next::Stay(Modal::TerminalSettings(self))
    }

    /// What the choice means.
    fn note(&self, cx: &ViewContext, row: Setting) -> &'static str {
        match row {
            Setting::Theme if cx.theme.colours == Colours::None => t!("no colours here"),
            Setting::Theme => match self.chosen.theme {
                ThemeName::Grey => t!("abnormal in colour"),
                ThemeName::Dark => t!("more colour on black"),
                ThemeName::Light => t!("for bright rooms"),
                ThemeName::HighContrast => t!("bright on black"),
                ThemeName::Mono => t!("without hue"),
            },
            Setting::Characters => match cx.theme.glyphs {
                Glyphs::Braille => t!("as braille dots"),
                Glyphs::Block => t!("as blocks"),
                Glyphs::Ascii => t!("as ASCII characters"),
            },
            Setting::Pictures => match cx.theme.graphics.protocol(self.chosen.pictures) {
                Ok((Protocol::Kitty, _)) => t!("i in Trends: Kitty"),
                Ok((Protocol::Sixel, _)) => t!("i in Trends: Sixel"),
                Err(_) => t!("characters only"),
            },
            Setting::Motion => t!("agitators and arrows"),
            Setting::Bell => match self.chosen.bell {
                Bell::Off => t!("alarms make no sound"),
                Bell::Once | Bell::Repeated => t!("Ctrl-S silences"),
            },
            Setting::Mouse if self.chosen.mouse => t!("Shift selects text"),
            Setting::Mouse => t!("selects text"),
            Setting::Language => "",
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
        let form = self.form();
        let (rows, labels) = (form.rows(), form.labels().saturating_sub(1));
        let wanted = rows + 3 + to_u16(kept.len());
        let mut canvas = window(cx, frame, body, t!("terminal settings"), (room, wanted));
        let values = (0..ROWS.len()).map(|n| width(&form.text(n))).max().unwrap_or(0).max(18);
        let notes = labels + values + 5;
        let last = canvas.height().saturating_sub(to_u16(kept.len()));
        for drawn in form.view(cx, &mut canvas, labels, 0..rows.min(last)) {
            let note = fit_words(self.note(cx, ROWS[drawn.field]), canvas.width().saturating_sub(notes));
            canvas.text(notes, drawn.y, &note, theme.dim());
        }
        // Blank rows give way on a small screen, then the sample.
        let gap = u16::from(wanted <= canvas.height());
        if rows < last {
            sample(cx, &mut canvas, rows + gap);
        }
        canvas.rows(0, last, &kept);
    }
}

/// What can be chosen as the language; the first is that of the environment.
fn languages() -> Vec<Option<Language>> {
    std::iter::once(None).chain(Language::all().map(Some)).collect()
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

impl Model {
    /// The language of the texts: as chosen, else as kept; one whose letters the terminal has. The window of the settings
    /// shows what is chosen in it.
    pub(in crate::ui) fn locale(&self) -> Locale {
        let is_tried = matches!(self.modal, Some(Modal::TerminalSettings(_)));
        let ways = [
            self.chosen_locale.filter(|_| !is_tried),
            self.preferences.language.map(Language::locale),
            Some(self.locale),
        ];
        ways.into_iter().flatten().find(|locale| self.can_show(*locale)).unwrap_or(Locale::ENGLISH)
    }

    /// Follows what the user has chosen, or tries in the window of the settings: whatever closes it ends the trial.
    pub(in crate::ui) fn apply_preferences(&mut self) {
        self.preferences = match &self.modal {
            Some(Modal::TerminalSettings(window)) => window.chosen,
            Some(_) | None => self.preferences_file.of(self.user()),
        };
        self.theme = self.preferences.theme(&self.limits);
    }
}
