//! How things look, by role: colours, attributes and glyph sets; no widget names a colour.

use ratatui::style::{Color, Modifier, Style};

use crate::plant::{
    alarm::AlarmState,
    def::Priority,
    sample::{Cause, Quality},
};

/// Looks of a terminal. Every role keeps a cue besides colour: a word, a shape, reverse or bold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Theme {
    /// How many colours.
    pub colours: Colours,
    /// Which characters.
    pub glyphs: Glyphs,
    /// Agitators turn and flow arrows travel.
    pub motion: bool,
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
    pub const FULL: Theme = Theme { colours: Colours::True, glyphs: Glyphs::Braille, motion: true };
    /// Attributes and seven bits only.
    pub const PLAIN: Theme = Theme { colours: Colours::None, glyphs: Glyphs::Ascii, motion: true };

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
        Theme { colours, glyphs, motion: true }
    }

    /// Does the terminal have the letters of every language? Fonts of a console and seven bits have those of English.
    pub fn has_all_letters(&self) -> bool {
        self.glyphs == Glyphs::Braille
    }

    /// Ordinary words and values.
    pub fn normal(&self) -> Style {
        self.fg((200, 200, 196), 251, Color::Reset)
    }
    /// Labels, units, frames: there when looked for.
    pub fn dim(&self) -> Style {
        self.fg((140, 142, 144), 245, Color::Reset).add_modifier(if self.colours == Colours::Sixteen {
            Modifier::DIM
        } else {
            Modifier::empty()
        })
    }
    /// Headings and the keys of the footer.
    pub fn strong(&self) -> Style {
        self.fg((232, 232, 228), 254, Color::Reset).add_modifier(Modifier::BOLD)
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
        self.fg((96, 128, 152), 67, Color::Blue)
    }
    /// Under words that stand in liquid: its colour becomes the background.
    pub fn under_liquid(&self) -> Style {
        match self.liquid().fg {
            Some(colour) => Style::new().bg(colour),
            None => Style::new(),
        }
    }
    /// Equipment that runs: brighter than one that rests, no colour of its own.
    pub fn running(&self) -> Style {
        self.strong()
    }
    /// A setpoint, marked on bars and curves.
    pub fn set_value(&self) -> Style {
        self.fg((150, 170, 190), 110, Color::Cyan)
    }
    /// Trouble of the program itself: lost records, a silent station.
    pub fn trouble(&self) -> Style {
        self.fg((230, 160, 80), 214, Color::Yellow).add_modifier(Modifier::BOLD)
    }
    /// An action that succeeded.
    pub fn done(&self) -> Style {
        self.strong()
    }
    /// A priority in full strength, for alarms that are active.
    pub fn severity(&self, priority: Priority) -> Style {
        let style = match priority {
            Priority::Critical => self.fg((255, 96, 96), 203, Color::LightRed),
            Priority::High => self.fg((255, 170, 70), 215, Color::LightYellow),
            Priority::Medium => self.fg((226, 214, 110), 185, Color::Yellow),
            Priority::Low => self.fg((196, 150, 210), 176, Color::LightMagenta),
        };
        style.add_modifier(Modifier::BOLD)
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
            Quality::Uncertain(_) => self.fg((190, 150, 120), 180, Color::Yellow).add_modifier(Modifier::ITALIC),
            Quality::Bad(Cause::NotRead) => self.dim(),
            Quality::Bad(_) => self.trouble(),
        }
    }
    /// The n-th pen of a chart.
    pub fn pen(&self, index: usize) -> Style {
        const PENS: [(u8, u8, u8, u8, Color); 8] = [
            (126, 184, 218, 110, Color::LightCyan),
            (206, 206, 200, 252, Color::White),
            (150, 196, 150, 114, Color::Green),
            (196, 168, 218, 182, Color::Magenta),
            (120, 200, 190, 79, Color::Cyan),
            (214, 186, 160, 180, Color::Gray),
            (160, 170, 230, 147, Color::LightBlue),
            (180, 200, 130, 150, Color::LightGreen),
        ];
        let (r, g, b, indexed, sixteen) = PENS[index % PENS.len()];
        self.fg((r, g, b), indexed, sixteen)
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

    fn fg(&self, (r, g, b): (u8, u8, u8), indexed: u8, sixteen: Color) -> Style {
        match self.colours {
            Colours::True => Style::new().fg(Color::Rgb(r, g, b)),
            Colours::Indexed => Style::new().fg(Color::Indexed(indexed)),
            Colours::Sixteen => Style::new().fg(sixteen),
            Colours::None => Style::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(env: &[(&str, &str)], colours: Colours, glyphs: Glyphs) {
        let theme = Theme::detect(|name| env.iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_string()));
        assert_eq!((theme.colours, theme.glyphs), (colours, glyphs), "{env:?}");
    }

    #[test]
    fn a_terminal_gets_what_it_can_show() {
        let utf8 = ("LANG", "en_US.UTF-8");
        check(&[("TERM", "xterm-256color"), ("COLORTERM", "truecolor"), utf8], Colours::True, Glyphs::Braille);
        check(&[("TERM", "tmux-256color"), utf8], Colours::Indexed, Glyphs::Braille);
        check(&[("TERM", "xterm"), utf8], Colours::Sixteen, Glyphs::Braille);
        for term in ["linux", "linux-16color"] {
            check(&[("TERM", term), utf8], Colours::Sixteen, Glyphs::Block);
        }
        check(&[("TERM", "linux")], Colours::Sixteen, Glyphs::Ascii);
        check(&[("TERM", "xterm"), ("LC_ALL", "C"), utf8], Colours::Sixteen, Glyphs::Ascii);
        check(&[("TERM", "vt220")], Colours::None, Glyphs::Ascii);
        check(&[("TERM", "xterm-256color"), ("NO_COLOR", "1"), utf8], Colours::None, Glyphs::Braille);
        check(&[("TERM", "xterm-256color"), ("NO_COLOR", ""), utf8], Colours::Indexed, Glyphs::Braille);
    }

    #[test]
    fn without_colour_no_role_asks_for_one() {
        let theme = Theme::PLAIN;
        let pens = (0..8).map(|n| theme.pen(n));
        let roles = [
            theme.normal(),
            theme.dim(),
            theme.strong(),
            theme.focus(),
            theme.liquid(),
            theme.trouble(),
            theme.severity(Priority::High),
        ];
        for style in pens.chain(roles) {
            assert_eq!((style.fg, style.bg), (None, None));
        }
    }
}
