//! How things look, by role: colours, attributes and glyph sets; no widget names a colour.

mod palette;

use ratatui::{
    buffer::Buffer,
    style::{Color, Modifier, Style},
};

use super::graphics::Graphics;
use crate::plant::{
    alarm::AlarmState,
    def::Priority,
    keyword::keyword_enum,
    sample::{Cause, Quality},
};
use palette::Role;

/// Looks of a terminal. Every role keeps a cue besides colour: a word, a shape, reverse or bold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Theme {
    /// Which colours.
    pub name: ThemeName,
    /// How many colours.
    pub colours: Colours,
    /// Which characters.
    pub glyphs: Glyphs,
    /// Agitators turn and flow arrows travel.
    pub motion: bool,
    /// What the terminal has announced beside characters.
    pub graphics: Graphics,
}

keyword_enum! {
    /// A set of colours.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum ThemeName: "theme" {
        /// Greys on dark grey, colour for what is abnormal only (ISA-101).
        #[default]
        Grey => "grey",
        /// More colour on near black.
        Dark => "dark",
        /// Dark words on a light ground.
        Light => "light",
        /// At least 7:1 on black.
        HighContrast => "high contrast",
        /// Without hue.
        Mono => "mono",
    }
}

/// How many colours the terminal has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colours {
    /// 24 bits.
    True,
    /// The palette of 256.
    Indexed,
    /// The sixteen of the Linux console.
    Sixteen,
    /// None: attributes only.
    None,
}

/// Which characters the terminal's font has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Glyphs {
    /// Lines, blocks and braille dots.
    Braille,
    /// Lines and blocks (Linux console).
    Block,
    /// Seven bits.
    Ascii,
}

impl Theme {
    /// Full looks, for tests and modern terminals.
    pub const FULL: Theme = Theme {
        name: ThemeName::Grey,
        colours: Colours::True,
        glyphs: Glyphs::Braille,
        motion: true,
        graphics: Graphics::NONE,
    };
    /// Attributes and seven bits only.
    pub const PLAIN: Theme = Theme { colours: Colours::None, glyphs: Glyphs::Ascii, ..Theme::FULL };

    /// Chooses by the environment: `NO_COLOR`, `TERM`, `COLORTERM` and the locale.
    pub fn detect(env: impl Fn(&str) -> Option<String>) -> Theme {
        let set = |name: &str| env(name).unwrap_or_default();
        let term = set("TERM");
        let console = term.starts_with("linux");
        let colours = if !set("NO_COLOR").is_empty() || term.starts_with("vt") {
            Colours::None
        } else if matches!(set("COLORTERM").as_str(), "truecolor" | "24bit") {
            Colours::True
        } else if term.contains("256color") || term.contains("direct") {
            Colours::Indexed
        } else {
            Colours::Sixteen
        };
        let locale = [set("LC_ALL"), set("LC_CTYPE"), set("LANG")].into_iter().find(|text| !text.is_empty());
        let utf8 = locale.is_some_and(|text| {
            let text = text.to_ascii_lowercase();
            text.contains("utf-8") || text.contains("utf8")
        });
        let glyphs = match (utf8, console) {
            (false, _) => Glyphs::Ascii,
            (true, true) => Glyphs::Block,
            (true, false) => Glyphs::Braille,
        };
        Theme { colours, glyphs, ..Theme::FULL }
    }

    /// Does the terminal have the letters of every language? Fonts of a console and seven bits have those of English.
    pub fn has_all_letters(&self) -> bool {
        self.glyphs == Glyphs::Braille
    }

    /// Ordinary words and values.
    pub fn normal(&self) -> Style {
        self.fg(Role::Normal)
    }
    /// Labels, units, frames: there when looked for.
    pub fn dim(&self) -> Style {
        self.fg(Role::Dim)
    }
    /// Headings and the keys of the footer.
    pub fn strong(&self) -> Style {
        self.fg(Role::Strong).add_modifier(Modifier::BOLD)
    }
    /// What the arrow keys have selected.
    pub fn focus(&self) -> Style {
        self.strong().add_modifier(Modifier::REVERSED)
    }
    /// The heading of the shown tab.
    pub fn tab(&self, shown: bool) -> Style {
        if shown { self.focus() } else { self.dim() }
    }
    /// The liquid in a vessel: calm, never an alarm colour.
    pub fn liquid(&self) -> Style {
        self.fg(Role::Liquid)
    }
    /// Equipment that runs: brighter than one that rests, no colour of its own.
    pub fn running(&self) -> Style {
        self.strong()
    }
    /// A setpoint, marked on bars and curves.
    pub fn set_value(&self) -> Style {
        self.fg(Role::SetValue)
    }
    /// Trouble of the program itself: lost records, a silent station.
    pub fn trouble(&self) -> Style {
        self.fg(Role::Trouble).add_modifier(Modifier::BOLD)
    }
    /// An action that succeeded.
    pub fn done(&self) -> Style {
        self.strong()
    }
    /// A priority in full strength, for alarms that are active.
    pub fn severity(&self, priority: Priority) -> Style {
        let role = match priority {
            Priority::Critical => Role::Critical,
            Priority::High => Role::High,
            Priority::Medium => Role::Medium,
            Priority::Low => Role::Low,
        };
        self.fg(role).add_modifier(Modifier::BOLD)
    }
    /// An alarm by priority and state: unacknowledged flashes (reverse in one phase), returned is dim.
    pub fn alarm(&self, priority: Priority, state: AlarmState, flash: bool) -> Style {
        match state {
            AlarmState::Unacknowledged if flash => self.severity(priority).add_modifier(Modifier::REVERSED),
            AlarmState::Unacknowledged => self.severity(priority),
            AlarmState::Acknowledged => self.severity(priority).remove_modifier(Modifier::BOLD),
            AlarmState::ReturnedToNormal | AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged => {
                self.dim()
            }
            AlarmState::Shelved | AlarmState::SuppressedByDesign | AlarmState::OutOfService => self.dim(),
            AlarmState::Normal => self.normal(),
        }
    }
    /// A value by its quality; the text carries `?` or `----` as well.
    pub fn quality(&self, quality: Quality) -> Style {
        match quality {
            Quality::Good => self.normal(),
            Quality::Uncertain(_) => self.fg(Role::Uncertain).add_modifier(Modifier::ITALIC),
            Quality::Bad(Cause::NotRead | Cause::OnRequest | Cause::NotPresent) => self.dim(),
            Quality::Bad(_) => self.trouble(),
        }
    }
    /// The n-th pen of a chart.
    pub fn pen(&self, index: usize) -> Style {
        self.fg(Role::Pen(index))
    }

    /// The mark of a priority: shape, number and, for the two urgent ones, an exclamation mark.
    pub fn priority_mark(&self, priority: Priority) -> &'static str {
        match (priority, self.glyphs) {
            (Priority::Critical, _) => "[1]!",
            (Priority::High, Glyphs::Ascii) => "<2>!",
            (Priority::High, _) => "‹2›!",
            (Priority::Medium, _) => "(3) ",
            (Priority::Low, _) => " 4  ",
        }
    }
    /// The mark of a state: filled while unacknowledged, a letter for what is not plain.
    pub fn state_mark(&self, state: AlarmState) -> &'static str {
        match state {
            AlarmState::Normal => " ",
            AlarmState::Unacknowledged => self.pick("■", "#"),
            AlarmState::Acknowledged => self.pick("□", "="),
            AlarmState::ReturnedToNormal => self.pick("●", "*"),
            AlarmState::LatchedUnacknowledged => "L",
            AlarmState::LatchedAcknowledged => "l",
            AlarmState::Shelved => "z",
            AlarmState::SuppressedByDesign => "-",
            AlarmState::OutOfService => "x",
        }
    }
    /// The mark of a priority beside a value, where a bare number could be read as one.
    pub fn priority_tag(&self, priority: Priority) -> &'static str {
        match priority {
            Priority::Low => self.pick("·4·", ".4."),
            Priority::Critical | Priority::High | Priority::Medium => self.priority_mark(priority).trim_end(),
        }
    }
    /// Picks the text for terminals with Unicode or without.
    pub fn pick<T>(&self, unicode: T, ascii: T) -> T {
        if self.glyphs == Glyphs::Ascii { ascii } else { unicode }
    }
    /// A text with the key Enter by its sign, or by its name where the sign cannot be drawn.
    pub fn enter(&self, text: &str) -> String {
        if self.glyphs == Glyphs::Ascii { text.replace('⏎', "Enter") } else { text.to_owned() }
    }
    /// `…` or `..`.
    pub fn ellipsis(&self) -> &'static str {
        self.pick("…", "..")
    }

    /// Gives the cells of a drawn frame that have no colour of their own those of the theme, so that it does not depend on
    /// the ground of the terminal.
    pub fn paint_ground(&self, buffer: &mut Buffer) {
        let (Some(ground), Some(normal)) = (self.colour(Role::Ground), self.colour(Role::Normal)) else { return };
        for cell in &mut buffer.content {
            if cell.bg == Color::Reset {
                cell.bg = ground;
            }
            if cell.fg == Color::Reset {
                cell.fg = normal;
            }
        }
    }

    /// What everything stands on.
    pub fn ground(&self) -> Option<Color> {
        self.colour(Role::Ground)
    }

    fn colour(&self, role: Role) -> Option<Color> {
        palette::colour(self.name, self.colours, role)
    }

    fn fg(&self, role: Role) -> Style {
        Style { fg: self.colour(role), ..Style::new() }
    }
}

#[cfg(test)]
mod tests;
