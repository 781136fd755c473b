//! The terminal's own pictures: what it has announced, which protocol is used, and why there is none.

pub(crate) mod kitty;
pub(crate) mod sixel;

use ratatui::layout::Rect;

use crate::{plant::keyword::keyword_enum, report::drawing::Drawing, t};

/// Most pixels of a picture on a side.
const SIDE_MAX: u16 = 4_096;

keyword_enum! {
    /// How pictures are shown.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Pictures: "way to show pictures" {
        /// As the terminal announces.
        #[default]
        Automatic => "automatic",
        /// By Kitty graphics, announced or not.
        Kitty => "Kitty",
        /// By Sixel, announced or not.
        Sixel => "Sixel",
        /// Never.
        Off => "off",
    }
}

/// How a picture is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// A PNG in pieces, with a number.
    Kitty,
    /// Bands of six rows of pixels.
    Sixel,
}

/// What a terminal has announced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Graphics {
    /// It takes Kitty graphics.
    pub kitty: bool,
    /// It takes Sixel.
    pub sixel: bool,
    /// Width and height of its cells in pixels.
    pub cell: Option<(u16, u16)>,
    /// Width and height of the largest Sixel picture that it takes, in pixels, where it says so.
    pub sixel_max: Option<(u16, u16)>,
    /// Colours of a Sixel picture, where it says so.
    pub sixel_colours: Option<u16>,
    /// Why it was not asked.
    pub unasked: Option<NoPicture>,
}

/// Why a terminal shows no picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoPicture {
    /// The user wants none.
    Off,
    /// It was not asked, because pictures were off when it began.
    NotAsked,
    /// tmux or screen stands between.
    Relayed,
    /// It announces neither protocol.
    NotAnnounced,
    /// The size of its cells is not known.
    NoCellSize,
}

/// What is to be shown over the cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// How it is sent.
    pub protocol: Protocol,
    /// The cells that it covers.
    pub area: Rect,
    /// What it shows, in pixels of the terminal.
    pub drawing: Drawing,
}

impl NoPicture {
    pub fn words(self) -> &'static str {
        match self {
            NoPicture::Off => t!("Pictures are off in the settings (F2)"),
            NoPicture::NotAsked => t!("Pictures were off when this terminal started: restart it to detect them"),
            NoPicture::Relayed => t!("tmux and screen pass no pictures on; the settings (F2) can force them"),
            NoPicture::NotAnnounced => {
                t!("This terminal shows no pictures: neither Kitty graphics nor Sixel announced")
            }
            NoPicture::NoCellSize => t!("This terminal shows no pictures: it does not report its cell size"),
        }
    }
}

impl Graphics {
    /// Of a terminal that has announced nothing.
    pub const NONE: Graphics =
        Graphics { kitty: false, sixel: false, cell: None, sixel_max: None, sixel_colours: None, unasked: None };

    /// Why a terminal with this environment is not asked; `None`: it is.
    pub fn unasked(env: impl Fn(&str) -> Option<String>, chosen: Pictures) -> Option<NoPicture> {
        let set = |name: &str| env(name).unwrap_or_default();
        let term = set("TERM");
        let is_relayed = !set("TMUX").is_empty()
            || !set("STY").is_empty()
            || ["tmux", "screen"].iter().any(|name| term.starts_with(name));
        match chosen {
            Pictures::Off => Some(NoPicture::NotAsked),
            Pictures::Automatic if is_relayed => Some(NoPicture::Relayed),
            // A console and the terminals of old have no pictures, and may print the question.
            Pictures::Automatic if term.starts_with("linux") || term.starts_with("vt") => Some(NoPicture::NotAnnounced),
            Pictures::Automatic | Pictures::Kitty | Pictures::Sixel => None,
        }
    }

    /// How a picture is sent, and the size of a cell; or why there is none.
    pub fn protocol(&self, chosen: Pictures) -> Result<(Protocol, (u16, u16)), NoPicture> {
        let protocol = match chosen {
            Pictures::Off => return Err(NoPicture::Off),
            Pictures::Kitty => Protocol::Kitty,
            Pictures::Sixel => Protocol::Sixel,
            Pictures::Automatic if self.kitty => Protocol::Kitty,
            Pictures::Automatic if self.sixel => Protocol::Sixel,
            Pictures::Automatic => return Err(self.unasked.unwrap_or(NoPicture::NotAnnounced)),
        };
        Ok((protocol, self.cell.ok_or(NoPicture::NoCellSize)?))
    }

    /// Columns and rows that a picture covers at most.
    pub fn cells_max(&self, protocol: Protocol, (width, height): (u16, u16)) -> (u16, u16) {
        let (width_max, height_max) = match protocol {
            Protocol::Kitty => (SIDE_MAX, SIDE_MAX),
            Protocol::Sixel => self.sixel_max.unwrap_or((SIDE_MAX, SIDE_MAX)),
        };
        (width_max.min(SIDE_MAX) / width.max(1), height_max.min(SIDE_MAX) / height.max(1))
    }

    /// The bytes that show a picture at the cursor; `None` where it has no size.
    pub fn encode(&self, picture: &Picture) -> Option<Vec<u8>> {
        let pixels = picture.drawing.pixels()?;
        Some(match picture.protocol {
            Protocol::Kitty => kitty::show(&pixels.encode_png().ok()?, (picture.area.width, picture.area.height)),
            Protocol::Sixel => sixel::encode(&pixels, self.sixel_colours.unwrap_or(sixel::COLOURS_MAX)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_sent_only_as_announced_or_chosen() {
        let both = Graphics { kitty: true, sixel: true, cell: Some((10, 20)), ..Graphics::NONE };
        let sixel = Graphics { kitty: false, ..both };
        let none = Graphics { sixel: false, ..sixel };
        let tmux = Graphics { unasked: Some(NoPicture::Relayed), ..none };
        let no_size = Graphics { cell: None, ..both };
        for (graphics, chosen, expect) in [
            (both, Pictures::Automatic, Ok(Protocol::Kitty)),
            (sixel, Pictures::Automatic, Ok(Protocol::Sixel)),
            (none, Pictures::Automatic, Err(NoPicture::NotAnnounced)),
            (tmux, Pictures::Automatic, Err(NoPicture::Relayed)),
            (no_size, Pictures::Automatic, Err(NoPicture::NoCellSize)),
            (both, Pictures::Off, Err(NoPicture::Off)),
            (both, Pictures::Sixel, Ok(Protocol::Sixel)),
            (tmux, Pictures::Kitty, Ok(Protocol::Kitty)),
        ] {
            assert_eq!(graphics.protocol(chosen).map(|(protocol, _)| protocol), expect, "{graphics:?} {chosen:?}");
        }
    }

    #[test]
    fn a_terminal_that_may_print_the_question_is_not_asked() {
        let check = |name: &str, value: &str, chosen, expect| {
            let env = |asked: &str| (asked == name).then(|| value.to_owned());
            assert_eq!(Graphics::unasked(env, chosen), expect, "{name}={value}");
        };
        check("TERM", "xterm-kitty", Pictures::Automatic, None);
        check("TERM", "xterm-kitty", Pictures::Off, Some(NoPicture::NotAsked));
        check("TERM", "tmux-256color", Pictures::Automatic, Some(NoPicture::Relayed));
        check("TMUX", "/tmp/tmux-0/default,1,0", Pictures::Automatic, Some(NoPicture::Relayed));
        check("STY", "1.pts-0", Pictures::Automatic, Some(NoPicture::Relayed));
        check("TERM", "linux", Pictures::Automatic, Some(NoPicture::NotAnnounced));
        check("TERM", "screen", Pictures::Kitty, None);
    }
}
