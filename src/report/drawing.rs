//! A page of lines, rectangles and texts, as SVG and as PNG, which needs no font of the system.

use std::fmt::{self, Write};

use tiny_skia::{Color, FillRule, LineCap, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform};
use unicode_width::UnicodeWidthStr;

pub use super::typeface::CELL;
use super::typeface::Letters;

/// Height of a line of text, and room of a letter, in pixels.
pub const TEXT: (f32, f32) = (16.0, 8.0);
/// Size of the letters of a chart.
const LETTERS: f32 = 13.0;
/// From the middle of a text down to its base line, in sizes.
const BASE: f32 = 4.5 / LETTERS;
/// The pens in print, distinguishable with any colour vision (Okabe and Ito).
const PENS: [Rgb; 8] = [
    Rgb(0, 114, 178),
    Rgb(213, 94, 0),
    Rgb(0, 158, 115),
    Rgb(204, 121, 167),
    Rgb(86, 180, 233),
    Rgb(160, 110, 0),
    Rgb(90, 90, 90),
    Rgb(0, 0, 0),
];

/// A colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Rgb(pub u8, pub u8, pub u8);

/// What a line or text is, which decides its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// Texts and axes.
    Text,
    /// The grid.
    Grid,
    /// The pen of this number.
    Pen(usize),
    /// A colour of its own.
    Own(Rgb),
}

/// Where a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A page, in pixels from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    width: u16,
    height: u16,
    paper: Rgb,
    /// Size of its letters.
    letters: f32,
    shapes: Vec<Shape>,
}

/// A shape of a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A line through points.
    Line { points: Vec<(f32, f32)>, ink: Ink, width: f32, dashed: bool },
    /// Filled rectangles: left, top, width and height.
    Fill { rects: Vec<[f32; 4]>, ink: Ink },
    /// A text with its middle at this height.
    Text { at: (f32, f32), anchor: Anchor, text: String, ink: Ink, look: Look },
}

/// How a text looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Look {
    /// Bold.
    pub bold: bool,
    /// Italic.
    pub italic: bool,
    /// Underlined.
    pub underlined: bool,
    /// Its letters fill this many columns, whatever the font of the viewer; `None`: as wide as they are.
    pub columns: Option<u16>,
}

impl Anchor {
    /// The share of a text that stands before its place.
    pub fn before(self) -> f32 {
        match self {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        }
    }
}

impl Ink {
    /// Its colour.
    pub fn rgb(self) -> Rgb {
        match self {
            Ink::Text => Rgb(30, 30, 30),
            Ink::Grid => Rgb(210, 210, 210),
            Ink::Pen(n) => PENS[n % PENS.len()],
            Ink::Own(rgb) => rgb,
        }
    }
}

impl Drawing {
    /// An empty page.
    pub fn new(width: u16, height: u16) -> Drawing {
        Drawing { width, height, paper: Rgb(255, 255, 255), letters: LETTERS, shapes: Vec::new() }
    }

    /// An empty page of a colour, with letters of a size.
    pub fn on(width: u16, height: u16, paper: Rgb, letters: f32) -> Drawing {
        Drawing { paper, letters, ..Drawing::new(width, height) }
    }

    /// Its width and height.
    pub fn size(&self) -> (u16, u16) {
        (self.width, self.height)
    }

    /// What stands on it.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The same page with inks of other colours.
    pub fn recoloured(mut self, colour: impl Fn(Ink) -> Rgb) -> Drawing {
        for shape in &mut self.shapes {
            let (Shape::Line { ink, .. } | Shape::Fill { ink, .. } | Shape::Text { ink, .. }) = shape;
            *ink = Ink::Own(colour(*ink));
        }
        self
    }

    /// A line through these points.
    pub fn line(&mut self, points: Vec<(f32, f32)>, ink: Ink, width: f32, dashed: bool) {
        if points.len() > 1 {
            self.shapes.push(Shape::Line { points, ink, width, dashed });
        }
    }

    /// Rectangles of a colour.
    pub fn fill(&mut self, rects: Vec<[f32; 4]>, ink: Ink) {
        if !rects.is_empty() {
            self.shapes.push(Shape::Fill { rects, ink });
        }
    }

    /// A text with its middle at this height.
    pub fn text(&mut self, at: (f32, f32), anchor: Anchor, text: impl Into<String>, ink: Ink) {
        self.shapes.push(Shape::Text { at, anchor, text: text.into(), ink, look: Look::default() });
    }

    /// A text that begins here and looks so.
    pub fn styled(&mut self, at: (f32, f32), text: impl Into<String>, ink: Ink, look: Look) {
        self.shapes.push(Shape::Text { at, anchor: Anchor::Start, text: text.into(), ink, look });
    }

    /// The page as SVG.
    pub fn svg(&self) -> Vec<u8> {
        let Drawing { width, height, paper, letters, shapes } = self;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"DejaVu Sans Mono, ui-monospace, monospace\" \
             font-size=\"{letters}\">\n<rect width=\"100%\" height=\"100%\" fill=\"{paper}\"/>\n"
        );
        for shape in shapes {
            // Writing into a string never fails.
            let _ = match shape {
                Shape::Line { points, ink, width, dashed } => {
                    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                    let dash = if *dashed { " stroke-dasharray=\"6 4\"" } else { "" };
                    writeln!(
                        svg,
                        "<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"{dash} points=\"{}\"/>",
                        ink.rgb(),
                        points.join(" ")
                    )
                }
                Shape::Fill { rects, ink } => {
                    let path = rects.iter().map(|[x, y, w, h]| format!("M{x:.1} {y:.1}h{w:.1}v{h:.1}h{:.1}z", -w));
                    writeln!(svg, "<path fill=\"{}\" d=\"{}\"/>", ink.rgb(), path.collect::<String>())
                }
                Shape::Text { at: (x, y), anchor, text, ink, look } => writeln!(
                    svg,
                    "<text x=\"{x:.1}\" y=\"{:.1}\"{} fill=\"{}\"{} xml:space=\"preserve\">{}</text>",
                    y + letters * BASE,
                    anchor.attribute(),
                    ink.rgb(),
                    look.attributes(*letters),
                    escaped(text)
                ),
            };
        }
        svg.push_str("</svg>\n");
        svg.into_bytes()
    }

    /// The page as PNG; `None` where it has no size.
    pub fn png(&self) -> Option<Vec<u8>> {
        self.pixels()?.encode_png().ok()
    }

    /// The page as pixels; `None` where it has no size.
    pub fn pixels(&self) -> Option<Pixmap> {
        let mut page = Pixmap::new(self.width.into(), self.height.into())?;
        let Rgb(r, g, b) = self.paper;
        page.fill(Color::from_rgba8(r, g, b, 255));
        let letters = Letters::new()?;
        for shape in &self.shapes {
            match shape {
                Shape::Line { points, ink, width, dashed } => stroke(&mut page, points, *ink, *width, *dashed),
                Shape::Fill { rects, ink } => fill(&mut page, rects, *ink),
                Shape::Text { at, anchor, text, ink, look } => {
                    let before = text.width() as f32 * self.letters * CELL * anchor.before();
                    let begin = (at.0 - before, at.1 + self.letters * BASE);
                    set(&mut page, letters.outline(text, begin, self.letters), (begin, self.letters), *ink, *look);
                }
            }
        }
        Some(page)
    }
}

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rgb(r, g, b) = self;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

impl Anchor {
    fn attribute(self) -> &'static str {
        match self {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        }
    }
}

impl Look {
    fn attributes(self, letters: f32) -> String {
        let looks = [
            (self.bold, " font-weight=\"bold\""),
            (self.italic, " font-style=\"italic\""),
            (self.underlined, " text-decoration=\"underline\""),
        ];
        let looks = looks.iter().filter(|(is_set, _)| *is_set).map(|(_, look)| *look);
        let length = |columns| format!(" textLength=\"{:.1}\"", f32::from(columns) * letters * CELL);
        looks.collect::<String>() + &self.columns.map(length).unwrap_or_default()
    }
}

/// A text in XML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn paint(ink: Ink) -> Paint<'static> {
    let Rgb(r, g, b) = ink.rgb();
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

fn stroke(page: &mut Pixmap, points: &[(f32, f32)], ink: Ink, width: f32, dashed: bool) {
    let mut path = PathBuilder::new();
    for (n, (x, y)) in points.iter().enumerate() {
        if n == 0 { path.move_to(*x, *y) } else { path.line_to(*x, *y) }
    }
    let dash = if dashed { StrokeDash::new(vec![6.0, 4.0], 0.0) } else { None };
    let stroke = Stroke { width, line_cap: LineCap::Butt, dash, ..Stroke::default() };
    match path.finish() {
        Some(path) => page.stroke_path(&path, &paint(ink), &stroke, Transform::identity(), None),
        // A line without length is a point.
        None => points.first().into_iter().for_each(|(x, y)| fill(page, &[[*x, *y, width, width]], ink)),
    }
}

/// Whole pixels, so that neighbours join without a seam.
fn fill(page: &mut Pixmap, rects: &[[f32; 4]], ink: Ink) {
    let paint = Paint { anti_alias: false, ..paint(ink) };
    for rect in rects.iter().filter_map(|[x, y, w, h]| Rect::from_xywh(*x, *y, *w, *h)) {
        page.fill_rect(rect, &paint, Transform::identity(), None);
    }
}

/// Sets the outlines of a text that begins at a place and has letters of a size.
fn set(page: &mut Pixmap, outline: Option<Path>, ((x, y), size): ((f32, f32), f32), ink: Ink, look: Look) {
    if look.underlined {
        let length = f32::from(look.columns.unwrap_or(0)) * size * CELL;
        fill(page, &[[x, y + size * 0.12, length, size * 0.08]], ink);
    }
    let Some(path) = outline else { return };
    // Leans to the right, around the base line.
    let lean = if look.italic { Transform::from_row(1.0, 0.0, -0.2, 1.0, 0.2 * y, 0.0) } else { Transform::identity() };
    page.fill_path(&path, &paint(ink), FillRule::Winding, lean, None);
    if look.bold {
        let stroke = Stroke { width: size * 0.05, ..Stroke::default() };
        page.stroke_path(&path, &paint(ink), &stroke, lean, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing() -> Drawing {
        let mut drawing = Drawing::new(120, 60);
        drawing.line(vec![(10.0, 50.0), (60.0, 20.0), (110.0, 50.0)], Ink::Pen(0), 1.5, false);
        drawing.line(vec![(5.0, 5.0)], Ink::Grid, 1.0, false);
        drawing.fill(vec![[0.0, 55.0, 4.0, 5.0], [4.0, 55.0, 4.0, 5.0]], Ink::Own(Rgb(255, 0, 0)));
        drawing.text((60.0, 10.0), Anchor::Middle, "20 °C <&>", Ink::Text);
        drawing
    }

    #[test]
    fn an_svg_escapes_its_texts() {
        let svg = String::from_utf8(drawing().svg()).expect("SVG is text");
        assert!(svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n"));
        assert!(svg.contains(">20 °C &lt;&amp;&gt;</text>"), "{svg}");
        assert_eq!(svg.matches("<polyline").count(), 1, "a single point is no line");
    }

    #[test]
    fn a_text_of_the_png_ends_at_its_anchor() {
        let mut drawing = Drawing::new(400, 20);
        drawing.text((390.0, 10.0), Anchor::End, "M".repeat(40), Ink::Text);
        let page = Pixmap::decode_png(&drawing.png().expect("it has a size")).expect("a PNG");
        let dark = |x: u32| (0..20).any(|y| page.pixel(x, y).is_some_and(|p| p.green() < 200));
        let last = (0..400).rev().find(|x| dark(*x)).expect("letters");
        assert!((384..=390).contains(&last), "{last}");
    }

    #[test]
    fn a_png_has_lines_and_letters_without_a_system_font() {
        let png = drawing().png().expect("it has a size");
        let page = Pixmap::decode_png(&png).expect("a PNG");
        let dark = |x: std::ops::Range<u32>, y: std::ops::Range<u32>| {
            y.flat_map(|y| x.clone().map(move |x| (x, y)))
                .filter(|(x, y)| page.pixel(*x, *y).is_some_and(|p| p.green() < 200))
                .count()
        };
        assert!(dark(24..96, 2..18) > 40, "letters");
        assert!(dark(10..110, 20..50) > 60, "the line");
        assert_eq!(dark(0..120, 54..60), 40, "two rectangles without a seam");
        assert_eq!(Drawing::new(0, 10).png(), None);
    }
}
