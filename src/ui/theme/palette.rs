//! The colours of the themes as data: one row a role, one column a theme; a test holds their contrast.

use ratatui::style::Color;

use super::{Colours, ThemeName};

/// What a colour is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Behind everything.
    Ground,
    /// Ordinary words and values.
    Normal,
    /// Labels, units, frames.
    Dim,
    /// Headings and keys.
    Strong,
    /// Liquid in a vessel.
    Liquid,
    SetValue,
    /// Trouble of the program itself.
    Trouble,
    Uncertain,
    /// Alarms of the first priority.
    Critical,
    /// Alarms of the second priority.
    High,
    /// Alarms of the third priority.
    Medium,
    /// Alarms of the fourth priority.
    Low,
    /// Curves of a chart.
    Pen(usize),
}

/// Pens that differ; further ones repeat them.
pub(super) const PENS: usize = 8;

/// A colour of 24 bits, and the nearest of the 256 that keeps the contrast.
type Shade = (u32, u8);

/// Grey, dark, light, high contrast, mono.
const SHADES: [[Shade; 5]; 12 + PENS] = [
    [(0x262626, 235), (0x0c1014, 233), (0xf2f2ee, 255), (0x000000, 16), (0x101010, 233)], // ground
    [(0xc8c8c4, 251), (0xd4dae0, 253), (0x2a2c2e, 236), (0xffffff, 231), (0xd0d0d0, 252)], // normal
    [(0x9c9ea0, 247), (0x96a0aa, 247), (0x5a5e62, 59), (0xd4d4d4, 188), (0xa4a4a4, 248)], // dim
    [(0xeaeae6, 255), (0xf4f8fc, 231), (0x000000, 16), (0xffffff, 231), (0xffffff, 231)], // strong
    [(0x5f7890, 66), (0x2f6a9c, 61), (0x5f88ac, 67), (0x1f62ac, 25), (0x686868, 242)],    // liquid
    [(0x9ab0c4, 110), (0x6cb6f0, 75), (0x1c5488, 24), (0x90d4ff, 117), (0xd0d0d0, 252)],  // set value
    [(0xe6a050, 214), (0xff9f40, 214), (0x8c4a00, 94), (0xffc060, 222), (0xffffff, 231)], // trouble
    [(0xc69c7c, 180), (0xd8a878, 180), (0x7c4a26, 94), (0xffdca8, 223), (0xbcbcbc, 250)], // uncertain
    [(0xff6a60, 203), (0xff5c5c, 203), (0x980014, 88), (0xff8a8a, 210), (0xffffff, 231)], // critical
    [(0xffaa46, 215), (0xffa63c, 215), (0xaa4c00, 94), (0xffb84c, 215), (0xffffff, 231)], // high
    [(0xe2d66e, 185), (0xf0e05a, 227), (0x4a4600, 58), (0xffff6c, 227), (0xffffff, 231)], // medium
    [(0xcc9cdc, 176), (0xd68af0, 177), (0x7a2c98, 90), (0xf4acff, 219), (0xffffff, 231)], // low
    [(0x8cb8d4, 110), (0x58b4ff, 75), (0x0a62a8, 25), (0x80d0ff, 117), (0xffffff, 231)],  // pens
    [(0xcecec8, 252), (0xf0f0ea, 255), (0x303030, 236), (0xffffff, 231), (0x808080, 244)],
    [(0x9cc09c, 114), (0x62d26e, 77), (0x1a6e2a, 28), (0x80ff90, 120), (0xd0d0d0, 252)],
    [(0xc4a8da, 182), (0xc88aff, 141), (0x7030b0, 91), (0xdcb0ff, 183), (0xa0a0a0, 247)],
    [(0x7cc4ba, 79), (0x34d0c0, 44), (0x00706a, 30), (0x60f0e0, 86), (0xe8e8e8, 254)],
    [(0xd6baa0, 180), (0xffb07c, 216), (0x9a5020, 130), (0xffc8a0, 216), (0x909090, 246)],
    [(0xa0aae6, 147), (0x8c9cff, 111), (0x3c46c8, 26), (0xb8c0ff, 147), (0xb8b8b8, 250)],
    [(0xb4c882, 150), (0xc2e04e, 184), (0x5a6a00, 100), (0xd8ff60, 191), (0x787878, 243)],
];

/// The same of sixteen: on black, on white, on black without hue. No grey but the light one is legible on all of them.
const SIXTEEN: [[Color; 3]; 12 + PENS] = [
    [Color::Black, Color::White, Color::Black],         // ground
    [Color::White, Color::Black, Color::White],         // normal
    [Color::Gray, Color::Black, Color::Gray],           // dim
    [Color::White, Color::Black, Color::White],         // strong
    [Color::LightBlue, Color::LightBlue, Color::Gray],  // liquid
    [Color::Cyan, Color::Blue, Color::White],           // set value
    [Color::LightYellow, Color::Magenta, Color::White], // trouble
    [Color::LightYellow, Color::Magenta, Color::White], // uncertain
    [Color::LightRed, Color::Red, Color::White],        // critical
    [Color::LightYellow, Color::Magenta, Color::White], // high
    [Color::LightCyan, Color::Blue, Color::White],      // medium
    [Color::LightMagenta, Color::Black, Color::White],  // low
    [Color::Cyan, Color::Blue, Color::White],           // pens
    [Color::White, Color::Black, Color::Gray],
    [Color::Green, Color::Magenta, Color::White],
    [Color::LightBlue, Color::DarkGray, Color::Gray],
    [Color::Gray, Color::LightBlue, Color::White],
    [Color::LightGreen, Color::Blue, Color::Gray],
    [Color::Magenta, Color::Black, Color::White],
    [Color::LightCyan, Color::DarkGray, Color::Gray],
];

/// The colour of a role; `None` where the terminal has none.
pub(super) fn colour(name: ThemeName, colours: Colours, role: Role) -> Option<Color> {
    let row = row(role);
    let (column, sixteen) = match name {
        ThemeName::Grey => (0, 0),
        ThemeName::Dark => (1, 0),
        ThemeName::Light => (2, 1),
        ThemeName::HighContrast => (3, 0),
        ThemeName::Mono => (4, 2),
    };
    match colours {
        Colours::True => Some(Color::from_u32(SHADES[row][column].0)),
        Colours::Indexed => Some(Color::Indexed(SHADES[row][column].1)),
        Colours::Sixteen => Some(SIXTEEN[row][sixteen]),
        Colours::None => None,
    }
}

fn row(role: Role) -> usize {
    match role {
        Role::Ground => 0,
        Role::Normal => 1,
        Role::Dim => 2,
        Role::Strong => 3,
        Role::Liquid => 4,
        Role::SetValue => 5,
        Role::Trouble => 6,
        Role::Uncertain => 7,
        Role::Critical => 8,
        Role::High => 9,
        Role::Medium => 10,
        Role::Low => 11,
        Role::Pen(pen) => 12 + pen % PENS,
    }
}
