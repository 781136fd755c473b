//! The bytes of the frames: a backend that sends each frame in one piece, and of each cell only what is new.

use std::io::{self, Write};

use crossterm::{
    cursor,
    style::{Attribute, SetAttribute, SetBackgroundColor, SetForegroundColor},
    terminal,
};
use ratatui::{
    backend::{Backend, ClearType, CrosstermBackend, IntoCrossterm, WindowSize},
    buffer::Cell,
    layout::{Position, Size},
    style::{Color, Modifier},
};

/// Attributes of a cell, with what switches each on and off. Bold and dim go off together.
const ATTRIBUTES: [(Modifier, Attribute, Attribute); 5] = [
    (Modifier::BOLD, Attribute::Bold, Attribute::NormalIntensity),
    (Modifier::DIM, Attribute::Dim, Attribute::NormalIntensity),
    (Modifier::ITALIC, Attribute::Italic, Attribute::NoItalic),
    (Modifier::UNDERLINED, Attribute::Underlined, Attribute::NoUnderline),
    (Modifier::REVERSED, Attribute::Reverse, Attribute::NoReverse),
];
/// Smaller frames cannot tear and are sent without the brackets of synchronized output.
const TEAR_BYTES: usize = 96;

/// A backend that gathers a frame's bytes, so that they travel in one write and an unchanged frame costs nothing.
/// It asks the terminal nothing: an answer would arrive among the keys.
/// A cell is sent with what differs from the one sent before it, also in the frame before: 24-bit colours take most of the bytes.
pub(super) struct FrameBackend {
    /// What is sent next.
    pub(super) bytes: Vec<u8>,
    pub(super) size: Size,
    /// Colours and attributes that the terminal has now.
    style: Appearance,
}

/// Foreground, background and attributes of a cell.
type Appearance = (Color, Color, Modifier);

impl FrameBackend {
    pub(super) fn new() -> io::Result<FrameBackend> {
        let mut wire = FrameBackend { bytes: Vec::new(), size: Size::default(), style: Appearance::default() };
        wire.measure()?;
        Ok(wire)
    }

    pub(super) fn measure(&mut self) -> io::Result<()> {
        let (width, height) = terminal::size()?;
        self.size = Size::new(width, height);
        Ok(())
    }

    /// Gives what is sent next these colours and attributes.
    fn dress(&mut self, style: Appearance) -> io::Result<()> {
        let (had, wanted) = (self.style, style);
        let mut kept = had.2 & wanted.2;
        if (had.2 - wanted.2).intersects(Modifier::BOLD | Modifier::DIM) {
            kept -= Modifier::BOLD | Modifier::DIM;
        }
        for (_, _, off) in ATTRIBUTES.into_iter().filter(|(modifier, ..)| (had.2 - kept).contains(*modifier)) {
            crossterm::queue!(self.bytes, SetAttribute(off))?;
        }
        for (_, on, _) in ATTRIBUTES.into_iter().filter(|(modifier, ..)| (wanted.2 - kept).contains(*modifier)) {
            crossterm::queue!(self.bytes, SetAttribute(on))?;
        }
        if had.0 != wanted.0 {
            crossterm::queue!(self.bytes, SetForegroundColor(wanted.0.into_crossterm()))?;
        }
        if had.1 != wanted.1 {
            crossterm::queue!(self.bytes, SetBackgroundColor(wanted.1.into_crossterm()))?;
        }
        self.style = style;
        Ok(())
    }

    pub(super) fn send(&mut self) -> io::Result<()> {
        if self.bytes.is_empty() {
            return Ok(());
        }
        let frame = framed(&self.bytes);
        self.bytes.clear();
        let mut out = io::stdout().lock();
        out.write_all(&frame)?;
        out.flush()
    }
}

/// The bytes of a frame as they are sent: in synchronized output unless it is tiny.
fn framed(bytes: &[u8]) -> Vec<u8> {
    if bytes.len() < TEAR_BYTES { bytes.to_vec() } else { [b"\x1b[?2026h".as_slice(), bytes, b"\x1b[?2026l"].concat() }
}

impl Backend for FrameBackend {
    type Error = io::Error;

    fn draw<'a, I>(&mut self, content: I) -> io::Result<()>
    where
        I: Iterator<Item = (u16, u16, &'a Cell)>,
    {
        let mut cells: Vec<_> = content.collect();
        let mut styles = vec![self.style];
        cells.sort_by_cached_key(|(_, _, cell)| {
            let style = (cell.fg, cell.bg, cell.modifier);
            styles.iter().position(|known| *known == style).unwrap_or_else(|| {
                styles.push(style);
                styles.len() - 1
            })
        });
        let mut last = None;
        for (x, y, cell) in cells {
            match last {
                Some((column, row)) if row == y && column + 1 == x => {}
                Some((_, row)) if row == y => crossterm::queue!(self.bytes, cursor::MoveToColumn(x))?,
                _ => crossterm::queue!(self.bytes, cursor::MoveTo(x, y))?,
            }
            last = Some((x, y));
            self.dress((cell.fg, cell.bg, cell.modifier))?;
            self.bytes.extend(cell.symbol().as_bytes());
        }
        Ok(())
    }
    fn hide_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }
    fn show_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }
    fn get_cursor_position(&mut self) -> io::Result<Position> {
        Ok(Position::ORIGIN)
    }
    fn set_cursor_position<P: Into<Position>>(&mut self, _position: P) -> io::Result<()> {
        Ok(())
    }
    fn clear(&mut self) -> io::Result<()> {
        self.clear_region(ClearType::All)
    }
    fn clear_region(&mut self, region: ClearType) -> io::Result<()> {
        // Whatever else has written on the terminal: here all is known again.
        self.style = Appearance::default();
        crossterm::queue!(self.bytes, SetAttribute(Attribute::Reset))?;
        CrosstermBackend::new(&mut self.bytes).clear_region(region)
    }
    fn size(&self) -> io::Result<Size> {
        Ok(self.size)
    }
    fn window_size(&mut self) -> io::Result<WindowSize> {
        Ok(WindowSize { columns_rows: self.size, pixels: Size::default() })
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::{collection::vec, prelude::*};

    use super::*;

    fn wire() -> FrameBackend {
        FrameBackend { bytes: Vec::new(), size: Size::new(80, 24), style: Appearance::default() }
    }

    fn sent(wire: &mut FrameBackend, cells: &[(u16, u16, Cell)]) -> String {
        wire.bytes.clear();
        wire.draw(cells.iter().map(|(x, y, cell)| (*x, *y, cell))).expect("a vector takes every byte");
        String::from_utf8(framed(&wire.bytes)).expect("text")
    }

    fn cell(symbol: char, colour: u8, modifier: Modifier) -> Cell {
        let mut cell = Cell::default();
        cell.set_char(symbol).set_fg(Color::Rgb(colour, 20, 30)).set_bg(Color::Rgb(9, 9, colour / 2));
        cell.modifier = modifier;
        cell
    }

    #[test]
    fn a_second_of_the_clock_costs_few_bytes() {
        let mut wire = wire();
        let [first, second] = ['7', '8'].map(|digit| sent(&mut wire, &[(77, 0, cell(digit, 200, Modifier::empty()))]));
        assert!(first.len() < 50, "{first:?}");
        assert_eq!(second, "\x1b[1;78H8", "in the colours that the terminal still has");
        assert!(sent(&mut wire, &[]).is_empty(), "an unchanged frame is not sent");
    }

    #[test]
    fn each_style_is_sent_once_a_frame() {
        let row = |y| {
            [('l', 10), ('v', 200), ('l', 10)]
                .map(|(symbol, colour)| cell(symbol, colour, Modifier::empty()))
                .into_iter()
                .zip(4..)
                .map(move |(cell, x)| (x, y, cell))
        };
        let frame = sent(&mut wire(), &(0..8).flat_map(row).collect::<Vec<_>>());
        assert_eq!(frame.matches("38;2;").count(), 2, "{frame:?}");
    }

    #[test]
    fn without_colour_no_colour_byte_is_sent() {
        let mut cell = Cell::default();
        cell.set_char('x').set_style(crate::ui::theme::Theme::PLAIN.focus());
        let sent = sent(&mut wire(), &[(0, 0, cell)]);
        assert!(sent.contains("\x1b[7m") && sent.contains("\x1b[1m"), "reverse and bold stay: {sent:?}");
        assert!(!sent.contains("\x1b[3") && !sent.contains("\x1b[4"), "{sent:?}");
    }

    /// Column, row, letter, colour, and one bit an attribute.
    type Drawn = (u16, u16, u8, u8, u16);

    fn drawn((x, y, letter, colour, bits): Drawn) -> ((u16, u16), Cell) {
        let all = ATTRIBUTES.map(|(modifier, ..)| modifier);
        let mut modifier: Modifier =
            all.into_iter().enumerate().filter(|(n, _)| (bits >> n) & 1 == 1).map(|(_, modifier)| modifier).collect();
        if modifier.contains(Modifier::BOLD) {
            // The terminal of this test knows only one of the two.
            modifier -= Modifier::DIM;
        }
        ((y, x), cell(char::from(b'a' + letter), colour * 60, modifier))
    }

    proptest! {
        /// Whatever frames follow each other, a terminal shows each cell as it was drawn last.
        #[test]
        fn a_terminal_shows_every_cell_as_drawn(
            frames in vec(vec((0..20_u16, 0..6_u16, 0..26_u8, 0..4_u8, 0..32_u16), 0..40), 1..6),
        ) {
            let (mut wire, mut terminal, mut all) = (wire(), vt100::Parser::new(24, 80, 0), BTreeMap::new());
            for frame in frames {
                let cells: BTreeMap<_, _> = frame.into_iter().map(drawn).collect();
                let list: Vec<_> = cells.iter().map(|((y, x), cell)| (*x, *y, cell.clone())).collect();
                terminal.process(sent(&mut wire, &list).as_bytes());
                all.extend(cells);
                for ((y, x), cell) in &all {
                    let shown = terminal.screen().cell(*y, *x).expect("inside");
                    let attributes = [shown.bold(), shown.dim(), shown.italic(), shown.underline(), shown.inverse()];
                    prop_assert_eq!(attributes, ATTRIBUTES.map(|(modifier, ..)| cell.modifier.contains(modifier)));
                    let rgb = |colour| match colour {
                        Color::Rgb(r, g, b) => vt100::Color::Rgb(r, g, b),
                        _ => vt100::Color::Default,
                    };
                    let looks = (shown.contents(), shown.fgcolor(), shown.bgcolor());
                    prop_assert_eq!(looks, (cell.symbol(), rgb(cell.fg), rgb(cell.bg)));
                }
            }
        }
    }
}
