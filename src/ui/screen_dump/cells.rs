//! A screen as a drawing: lines, blocks and braille dots as rectangles, so that they join whatever the font of the viewer;
//! text as text.

use std::collections::BTreeMap;

use ratatui::{
    buffer::{Buffer, Cell},
    style::{Color, Modifier},
};
use unicode_width::UnicodeWidthStr;

use crate::{
    plant::number::to_u16,
    report::drawing::{Drawing, Ink, Look, Rgb},
};

/// A cell in pixels, in whole ones of which a block has halves and quarters.
const WIDTH: f32 = 10.0;
const HEIGHT: f32 = 20.0;
/// Size of letters that are as wide as a cell.
const LETTERS: f32 = 16.6;
const MARGIN: f32 = 12.0;
/// What a terminal shows where a program asks for no colour.
pub(crate) const GROUND: Rgb = Rgb(18, 20, 22);
pub(crate) const INK: Rgb = Rgb(200, 200, 196);

/// Rectangles by colour: left, top, width and height.
type Rects = BTreeMap<Rgb, Vec<[f32; 4]>>;

/// The whole screen; the same screen gives the same drawing.
pub(crate) fn drawing(buffer: &Buffer) -> Drawing {
    let mut page = Page { ground: usual_ground(buffer), ..Page::default() };
    for y in 0..buffer.area.height {
        let mut free = 0;
        for x in 0..buffer.area.width {
            let Some(cell) = buffer.cell((x, y)) else { continue };
            let is_covered = x < free;
            if !is_covered {
                free = x + columns(cell).max(1);
            }
            page.cell(cell, is_covered, x, y);
        }
        page.end_text();
    }
    let side = |cells: u16, size: f32| to_u16(f32::from(cells) * size + 2.0 * MARGIN);
    let (width, height) = (side(buffer.area.width, WIDTH), side(buffer.area.height, HEIGHT));
    let mut drawing = Drawing::on(width, height, page.ground, LETTERS);
    for (colour, rects) in page.grounds.into_iter().chain(page.shapes) {
        drawing.fill(rects, Ink::Own(colour));
    }
    for Run { at, colour, look, text } in page.texts {
        drawing.styled(at, text, Ink::Own(colour), look);
    }
    drawing
}

/// Columns that a cell's letter takes.
fn columns(cell: &Cell) -> u16 {
    u16::try_from(cell.symbol().width()).unwrap_or(1)
}

/// The ground of most cells: that of the page.
fn usual_ground(buffer: &Buffer) -> Rgb {
    let mut counts: BTreeMap<Rgb, usize> = BTreeMap::new();
    buffer.content.iter().for_each(|cell| *counts.entry(colours(cell).1).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map_or(GROUND, |(ground, _)| ground)
}

/// Shapes by colour, and text.
#[derive(Default)]
struct Page {
    /// What most cells stand on.
    ground: Rgb,
    grounds: Rects,
    shapes: Rects,
    texts: Vec<Run>,
    /// The text that may go on.
    run: Option<Run>,
}

/// Text of one look in a row.
struct Run {
    at: (f32, f32),
    colour: Rgb,
    look: Look,
    text: String,
}

impl Page {
    /// A cell; of one that a wide letter covers only the ground.
    fn cell(&mut self, cell: &Cell, is_covered: bool, x: u16, y: u16) {
        let (colour, ground) = colours(cell);
        let (left, top) = (MARGIN + f32::from(x) * WIDTH, MARGIN + f32::from(y) * HEIGHT);
        if ground != self.ground {
            rect(self.grounds.entry(ground).or_default(), left, top, WIDTH, HEIGHT);
        }
        if is_covered {
            return;
        }
        let symbol = cell.symbol().chars().next().unwrap_or(' ');
        let mut rects = Vec::new();
        let is_shape = shape(&mut rects, symbol, left, top);
        if !rects.is_empty() {
            self.shapes.entry(colour).or_default().append(&mut rects);
        }
        if is_shape || cell.symbol().trim().is_empty() {
            // One blank does not end a run of words.
            match &mut self.run {
                Some(run) if !is_shape && !run.text.ends_with(' ') => run.text.push(' '),
                _ => self.end_text(),
            }
            return;
        }
        let has = |modifier| cell.modifier.contains(modifier);
        let look = Look {
            bold: has(Modifier::BOLD),
            italic: has(Modifier::ITALIC),
            underlined: has(Modifier::UNDERLINED),
            columns: None,
        };
        if !self.run.as_ref().is_some_and(|run| (run.colour, run.look) == (colour, look)) {
            self.end_text();
        }
        let new = || Run { at: (left, top + HEIGHT / 2.0), colour, look, text: String::new() };
        self.run.get_or_insert_with(new).text.push_str(cell.symbol());
    }

    fn end_text(&mut self) {
        let Some(mut run) = self.run.take() else { return };
        run.text.truncate(run.text.trim_end().len());
        run.look.columns = u16::try_from(run.text.width()).ok();
        self.texts.push(run);
    }
}

/// Adds a rectangle; one that continues the last one makes that wider.
fn rect(rects: &mut Vec<[f32; 4]>, x: f32, y: f32, width: f32, height: f32) {
    match rects.last_mut() {
        Some([left, top, wide, high]) if (*left + *wide, *top, *high) == (x, y, height) => *wide += width,
        _ => rects.push([x, y, width, height]),
    }
}

/// Draws a line, a block or braille dots; `false` for everything else.
fn shape(rects: &mut Vec<[f32; 4]>, symbol: char, left: f32, top: f32) -> bool {
    if let Some((arms, dashed)) = arms(symbol) {
        lines(rects, arms, dashed, left, top);
        return true;
    }
    let code = u32::from(symbol);
    match symbol {
        '▀' => rect(rects, left, top, WIDTH, HEIGHT / 2.0),
        '▐' => rect(rects, left + WIDTH / 2.0, top, WIDTH / 2.0, HEIGHT),
        // One to eight eighths from below.
        '▁'..='█' => {
            let high = HEIGHT * (code - 0x2580) as f32 / 8.0;
            rect(rects, left, top + HEIGHT - high, WIDTH, high);
        }
        // Seven to one eighths from the left.
        '▉'..='▏' => rect(rects, left, top, WIDTH * (0x2590 - code) as f32 / 8.0, HEIGHT),
        // Shades are rows of lines: a share of the cell is filled.
        '░' | '▒' | '▓' => {
            let share = (code - 0x2590) as f32 / 4.0;
            for row in 0..4 {
                let step = HEIGHT / 4.0;
                rect(rects, left, top + row as f32 * step, WIDTH, step * share);
            }
        }
        '\u{2800}'..='\u{28FF}' => dots(rects, code - 0x2800, left, top),
        _ => return false,
    }
    true
}

fn dots(rects: &mut Vec<[f32; 4]>, bits: u32, left: f32, top: f32) {
    const PLACES: [(f32, f32); 8] =
        [(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0), (0.0, 3.0), (1.0, 3.0)];
    for (_, (x, y)) in PLACES.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1) {
        rect(rects, left + WIDTH * (0.25 + 0.5 * x) - 1.0, top + HEIGHT * (0.125 + 0.25 * y) - 1.0, 2.0, 2.0);
    }
}

/// The weights of the lines to the right, below, to the left and above (0 none, 1 thin, 2 heavy), and whether they are dashed.
fn arms(symbol: char) -> Option<([u8; 4], bool)> {
    const LINES: &str = "─1010│0101┌1100┐0110└1001┘0011├1101┤0111┬1110┴1011┼1111\
                         ━2020┃0202┏2200┓0220┗2002┛0022╶1000╷0100╴0010╵0001\
                         ╂1212╋2222╡0111╞1101╎0101┆0101┊0101╌1010┄1010┈1010╭1100╮0110╰1001╯0011╱0000";
    let rest = LINES.split_once(symbol)?.1;
    if !('\u{2500}'..='\u{257F}').contains(&symbol) {
        return None;
    }
    let mut weights = rest.chars().map_while(|digit| digit.to_digit(3)).filter_map(|weight| u8::try_from(weight).ok());
    let arms = [weights.next()?, weights.next()?, weights.next()?, weights.next()?];
    (arms != [0; 4]).then_some((arms, "╎┆┊╌┄┈".contains(symbol)))
}

fn lines(rects: &mut Vec<[f32; 4]>, [right, below, to_left, above]: [u8; 4], dashed: bool, left: f32, top: f32) {
    let (x, y) = (left + WIDTH / 2.0, top + HEIGHT / 2.0);
    let thick = |weight: u8| if weight == 2 { 4.0 } else { 2.0 };
    if dashed {
        for part in 0..2 {
            let at = part as f32;
            match right {
                0 => rect(rects, x - 1.0, top + at * HEIGHT / 2.0, 2.0, HEIGHT / 4.0),
                _ => rect(rects, left + at * WIDTH / 2.0, y - 1.0, WIDTH / 4.0, 2.0),
            }
        }
        return;
    }
    // An arm begins behind the middle, so that corners are closed.
    for (weight, horizontal, from, length) in [
        (right, true, x, WIDTH / 2.0),
        (to_left, true, left, WIDTH / 2.0),
        (below, false, y, HEIGHT / 2.0),
        (above, false, top, HEIGHT / 2.0),
    ] {
        let wide = thick(weight);
        match (weight, horizontal) {
            (0, _) => {}
            (_, true) => rect(rects, from - wide / 2.0, y - wide / 2.0, length + wide, wide),
            (_, false) => rect(rects, x - wide / 2.0, from - wide / 2.0, wide, length + wide),
        }
    }
}

/// Ink and ground of a cell.
fn colours(cell: &Cell) -> (Rgb, Rgb) {
    let (ink, ground) = (rgb(cell.fg).unwrap_or(INK), rgb(cell.bg).unwrap_or(GROUND));
    let dim = |Rgb(r, g, b): Rgb| {
        let half = |ink: u8, ground: u8| u8::midpoint(ink, ground);
        Rgb(half(r, ground.0), half(g, ground.1), half(b, ground.2))
    };
    let ink = if cell.modifier.contains(Modifier::DIM) { dim(ink) } else { ink };
    if cell.modifier.contains(Modifier::REVERSED) { (ground, ink) } else { (ink, ground) }
}

/// A colour as a usual terminal shows it; `None` for the terminal's own.
pub(crate) fn rgb(colour: Color) -> Option<Rgb> {
    const SIXTEEN: [Rgb; 16] = [
        Rgb(0, 0, 0),
        Rgb(205, 49, 49),
        Rgb(13, 188, 121),
        Rgb(229, 229, 16),
        Rgb(36, 114, 200),
        Rgb(188, 63, 188),
        Rgb(17, 168, 205),
        Rgb(204, 204, 204),
        Rgb(118, 118, 118),
        Rgb(241, 76, 76),
        Rgb(35, 209, 139),
        Rgb(245, 245, 67),
        Rgb(59, 142, 234),
        Rgb(214, 112, 214),
        Rgb(41, 184, 219),
        Rgb(242, 242, 242),
    ];
    let level = |step: u8| if step == 0 { 0 } else { 55 + 40 * step };
    Some(match colour {
        Color::Reset => return None,
        Color::Rgb(r, g, b) => Rgb(r, g, b),
        Color::Indexed(n @ 0..=15) => SIXTEEN[usize::from(n)],
        Color::Indexed(n @ 16..=231) => {
            let n = n - 16;
            Rgb(level(n / 36), level(n / 6 % 6), level(n % 6))
        }
        Color::Indexed(n) => {
            let grey = 8 + 10 * (n - 232);
            Rgb(grey, grey, grey)
        }
        Color::Black => SIXTEEN[0],
        Color::Red => SIXTEEN[1],
        Color::Green => SIXTEEN[2],
        Color::Yellow => SIXTEEN[3],
        Color::Blue => SIXTEEN[4],
        Color::Magenta => SIXTEEN[5],
        Color::Cyan => SIXTEEN[6],
        Color::Gray => SIXTEEN[7],
        Color::DarkGray => SIXTEEN[8],
        Color::LightRed => SIXTEEN[9],
        Color::LightGreen => SIXTEEN[10],
        Color::LightYellow => SIXTEEN[11],
        Color::LightBlue => SIXTEEN[12],
        Color::LightMagenta => SIXTEEN[13],
        Color::LightCyan => SIXTEEN[14],
        Color::White => SIXTEEN[15],
    })
}
