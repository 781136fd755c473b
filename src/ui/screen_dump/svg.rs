//! A screen as SVG: lines, blocks and braille dots as shapes, so that they join whatever the font of the viewer; text as text.

use std::{collections::BTreeMap, fmt::Write};

use ratatui::{
    buffer::{Buffer, Cell},
    style::{Color, Modifier},
};
use unicode_width::UnicodeWidthStr;

/// A cell in pixels.
const WIDTH: f64 = 8.4;
const HEIGHT: f64 = 17.0;
/// The base line of text in a cell.
const BASE: f64 = 13.0;
const MARGIN: f64 = 10.0;
/// What a terminal shows where a program asks for no colour.
const GROUND: Rgb = (18, 20, 22);
const INK: Rgb = (200, 200, 196);

type Rgb = (u8, u8, u8);

/// A whole SVG document; the same screen gives the same bytes.
pub(crate) fn svg(buffer: &Buffer) -> String {
    let mut page = Page { ground: usual_ground(buffer), ..Page::default() };
    for y in 0..buffer.area.height {
        for x in 0..buffer.area.width {
            page.cell(buffer, x, y);
        }
        page.end_text();
    }
    let (width, height) =
        (f64::from(buffer.area.width) * WIDTH + 2.0 * MARGIN, f64::from(buffer.area.height) * HEIGHT + 2.0 * MARGIN);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-size=\"14\" \
         font-family=\"ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,monospace\">\n\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"{}\"/>\n<g transform=\"translate({MARGIN} {MARGIN})\">\n",
        hex(page.ground)
    );
    for (colour, path) in page.grounds.iter().chain(&page.shapes) {
        // Writing into a string does not fail.
        let _ = writeln!(out, "<path fill=\"{}\" d=\"{path}\"/>", hex(*colour));
    }
    out + &page.texts + "</g>\n</svg>\n"
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
    grounds: BTreeMap<Rgb, String>,
    shapes: BTreeMap<Rgb, String>,
    texts: String,
    run: Option<Run>,
}

/// Text of one look in a row.
struct Run {
    x: u16,
    y: u16,
    columns: u16,
    colour: Rgb,
    bold: bool,
    italic: bool,
    underlined: bool,
    text: String,
}

impl Page {
    fn cell(&mut self, buffer: &Buffer, x: u16, y: u16) {
        let Some(cell) = buffer.cell((x, y)) else { return };
        let (ink, ground) = colours(cell);
        let (left, top) = (f64::from(x) * WIDTH, f64::from(y) * HEIGHT);
        if ground != self.ground {
            rect(self.grounds.entry(ground).or_default(), left, top, WIDTH, HEIGHT);
        }
        let symbol = cell.symbol().chars().next().unwrap_or(' ');
        let path = self.shapes.entry(ink).or_default();
        let shaped = shape(path, symbol, left, top);
        if path.is_empty() {
            self.shapes.remove(&ink);
        }
        if shaped || cell.symbol().trim().is_empty() {
            // One blank does not end a run of words.
            let ends = shaped || self.run.as_ref().is_some_and(|run| run.text.ends_with(' '));
            match &mut self.run {
                Some(run) if !ends => {
                    run.text.push(' ');
                    run.columns += 1;
                }
                _ => self.end_text(),
            }
            return;
        }
        let (bold, italic, underlined) = (
            cell.modifier.contains(Modifier::BOLD),
            cell.modifier.contains(Modifier::ITALIC),
            cell.modifier.contains(Modifier::UNDERLINED),
        );
        let look = |run: &Run| (run.colour, run.bold, run.italic, run.underlined) == (ink, bold, italic, underlined);
        if !self.run.as_ref().is_some_and(look) {
            self.end_text();
        }
        let columns = u16::try_from(cell.symbol().width()).unwrap_or(1);
        let new = || Run { x, y, columns: 0, colour: ink, bold, italic, underlined, text: String::new() };
        let run = self.run.get_or_insert_with(new);
        run.text.push_str(cell.symbol());
        run.columns += columns;
    }

    fn end_text(&mut self) {
        let Some(run) = self.run.take() else { return };
        let text = run.text.trim_end();
        let columns = run.columns - u16::try_from(run.text.len() - text.len()).unwrap_or(0);
        let escaped = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let look = [
            (run.bold, " font-weight=\"bold\""),
            (run.italic, " font-style=\"italic\""),
            (run.underlined, " text-decoration=\"underline\""),
        ];
        let look: String = look.iter().filter(|(is_set, _)| *is_set).map(|(_, look)| *look).collect();
        let _ = writeln!(
            self.texts,
            "<text xml:space=\"preserve\" x=\"{:.1}\" y=\"{:.0}\" textLength=\"{:.1}\" fill=\"{}\"{look}>{escaped}</text>",
            f64::from(run.x) * WIDTH,
            f64::from(run.y) * HEIGHT + BASE,
            f64::from(columns) * WIDTH,
            hex(run.colour)
        );
    }
}

fn rect(path: &mut String, x: f64, y: f64, width: f64, height: f64) {
    let _ = write!(path, "M{x:.1} {y:.1}h{width:.1}v{height:.1}h{:.1}z", -width);
}

/// Draws a line, a block or braille dots; `false` for everything else.
fn shape(path: &mut String, symbol: char, left: f64, top: f64) -> bool {
    if let Some((arms, dashed)) = arms(symbol) {
        lines(path, arms, dashed, left, top);
        return true;
    }
    let code = u32::from(symbol);
    match symbol {
        '▀' => rect(path, left, top, WIDTH, HEIGHT / 2.0),
        '▐' => rect(path, left + WIDTH / 2.0, top, WIDTH / 2.0, HEIGHT),
        // One to eight eighths from below.
        '▁'..='█' => {
            let high = HEIGHT * f64::from(code - 0x2580) / 8.0;
            rect(path, left, top + HEIGHT - high, WIDTH, high);
        }
        '▌' => rect(path, left, top, WIDTH / 2.0, HEIGHT),
        // Shades are rows of lines: a share of the cell is filled.
        '░' | '▒' | '▓' => {
            let share = f64::from(code - 0x2590) / 4.0;
            for row in 0..4 {
                let step = HEIGHT / 4.0;
                rect(path, left, top + f64::from(row) * step, WIDTH, step * share);
            }
        }
        '\u{2800}'..='\u{28FF}' => dots(path, code - 0x2800, left, top),
        _ => return false,
    }
    true
}

fn dots(path: &mut String, bits: u32, left: f64, top: f64) {
    const PLACES: [(f64, f64); 8] =
        [(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0), (0.0, 3.0), (1.0, 3.0)];
    for (_, (x, y)) in PLACES.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1) {
        rect(path, left + WIDTH * (0.25 + 0.5 * x) - 1.0, top + HEIGHT * (0.125 + 0.25 * y) - 1.0, 2.0, 2.0);
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

fn lines(path: &mut String, [right, below, to_left, above]: [u8; 4], dashed: bool, left: f64, top: f64) {
    let (x, y) = (left + WIDTH / 2.0, top + HEIGHT / 2.0);
    let thick = |weight: u8| if weight == 2 { 2.6 } else { 1.2 };
    if dashed {
        for part in 0..2 {
            let at = f64::from(part);
            match right {
                0 => rect(path, x - 0.6, top + at * HEIGHT / 2.0, 1.2, HEIGHT / 4.0),
                _ => rect(path, left + at * WIDTH / 2.0, y - 0.6, WIDTH / 4.0, 1.2),
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
            (_, true) => rect(path, from - wide / 2.0, y - wide / 2.0, length + wide, wide),
            (_, false) => rect(path, x - wide / 2.0, from - wide / 2.0, wide, length + wide),
        }
    }
}

/// Ink and ground of a cell.
fn colours(cell: &Cell) -> (Rgb, Rgb) {
    let (ink, ground) = (rgb(cell.fg).unwrap_or(INK), rgb(cell.bg).unwrap_or(GROUND));
    let dim = |(r, g, b): Rgb| {
        let half = |ink: u8, ground: u8| u8::midpoint(ink, ground);
        (half(r, ground.0), half(g, ground.1), half(b, ground.2))
    };
    let ink = if cell.modifier.contains(Modifier::DIM) { dim(ink) } else { ink };
    if cell.modifier.contains(Modifier::REVERSED) { (ground, ink) } else { (ink, ground) }
}

fn hex((r, g, b): Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A colour as a usual terminal shows it; `None` for the terminal's own.
fn rgb(colour: Color) -> Option<Rgb> {
    const SIXTEEN: [Rgb; 16] = [
        (0, 0, 0),
        (205, 49, 49),
        (13, 188, 121),
        (229, 229, 16),
        (36, 114, 200),
        (188, 63, 188),
        (17, 168, 205),
        (204, 204, 204),
        (118, 118, 118),
        (241, 76, 76),
        (35, 209, 139),
        (245, 245, 67),
        (59, 142, 234),
        (214, 112, 214),
        (41, 184, 219),
        (242, 242, 242),
    ];
    let level = |step: u8| if step == 0 { 0 } else { 55 + 40 * step };
    Some(match colour {
        Color::Reset => return None,
        Color::Rgb(r, g, b) => (r, g, b),
        Color::Indexed(n @ 0..=15) => SIXTEEN[usize::from(n)],
        Color::Indexed(n @ 16..=231) => {
            let n = n - 16;
            (level(n / 36), level(n / 6 % 6), level(n % 6))
        }
        Color::Indexed(n) => {
            let grey = 8 + 10 * (n - 232);
            (grey, grey, grey)
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
