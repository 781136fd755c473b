//! A page of lines and texts, as SVG and as PNG. The PNG needs no font of the system: it has the letters of Latin-1.

use std::fmt::Write;

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, LineCap, Paint, PathBuilder, Pixmap, PremultipliedColorU8, Rect, Stroke, StrokeDash, Transform,
};

use crate::plant::number::{to_u8, to_u32, to_usize};

/// Height of a line of text, and width of a letter of the SVG, in pixels.
pub const TEXT: (f32, f32) = (16.0, 8.0);
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    shapes: Vec<Shape>,
}

/// A shape of a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A line through points.
    Line { points: Vec<(f32, f32)>, ink: Ink, width: f32, dashed: bool },
    /// A text with its middle at this height.
    Text { at: (f32, f32), anchor: Anchor, text: String, ink: Ink },
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
        }
    }
}

impl Drawing {
    /// An empty page.
    pub fn new(width: u16, height: u16) -> Drawing {
        Drawing { width, height, shapes: Vec::new() }
    }

    /// Its width and height.
    pub fn size(&self) -> (u16, u16) {
        (self.width, self.height)
    }

    /// What stands on it.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// A line through these points.
    pub fn line(&mut self, points: Vec<(f32, f32)>, ink: Ink, width: f32, dashed: bool) {
        if points.len() > 1 {
            self.shapes.push(Shape::Line { points, ink, width, dashed });
        }
    }

    /// A text with its middle at this height.
    pub fn text(&mut self, at: (f32, f32), anchor: Anchor, text: impl Into<String>, ink: Ink) {
        self.shapes.push(Shape::Text { at, anchor, text: text.into(), ink });
    }

    /// The page as SVG.
    pub fn svg(&self) -> Vec<u8> {
        let Drawing { width, height, shapes } = self;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"DejaVu Sans Mono, monospace\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
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
                        hex(*ink),
                        points.join(" ")
                    )
                }
                Shape::Text { at: (x, y), anchor, text, ink } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    writeln!(
                        svg,
                        "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"{}\" \
                         xml:space=\"preserve\">{}</text>",
                        y + 4.5,
                        hex(*ink),
                        escaped(text)
                    )
                }
            };
        }
        svg.push_str("</svg>\n");
        svg.into_bytes()
    }

    /// The page as PNG; `None` where it has no size.
    pub fn png(&self) -> Option<Vec<u8>> {
        let mut page = Pixmap::new(self.width.into(), self.height.into())?;
        page.fill(Color::WHITE);
        for shape in &self.shapes {
            match shape {
                Shape::Line { points, ink, width, dashed } => stroke(&mut page, points, *ink, *width, *dashed),
                Shape::Text { at, anchor, text, ink } => letters(&mut page, *at, *anchor, text, *ink),
            }
        }
        page.encode_png().ok()
    }
}

fn hex(ink: Ink) -> String {
    let Rgb(r, g, b) = ink.rgb();
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A text in XML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn stroke(page: &mut Pixmap, points: &[(f32, f32)], ink: Ink, width: f32, dashed: bool) {
    let Rgb(r, g, b) = ink.rgb();
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    let mut path = PathBuilder::new();
    for (n, (x, y)) in points.iter().enumerate() {
        if n == 0 { path.move_to(*x, *y) } else { path.line_to(*x, *y) }
    }
    let dash = if dashed { StrokeDash::new(vec![6.0, 4.0], 0.0) } else { None };
    let stroke = Stroke { width, line_cap: LineCap::Butt, dash, ..Stroke::default() };
    match path.finish() {
        Some(path) => page.stroke_path(&path, &paint, &stroke, Transform::identity(), None),
        // A line without length is a point.
        None => {
            if let Some(rect) = points.first().and_then(|(x, y)| Rect::from_xywh(*x, *y, width, width)) {
                page.fill_rect(rect, &paint, Transform::identity(), None);
            }
        }
    }
}

/// A place in whole pixels; what lies before the edge is at it.
fn whole(place: f32) -> u32 {
    to_u32(to_usize(f64::from(place).round()))
}

/// Sets a text; a letter that the font lacks is a question mark.
fn letters(page: &mut Pixmap, (x, y): (f32, f32), anchor: Anchor, text: &str, ink: Ink) {
    let length = (text.chars().count() * get_raster_width(FontWeight::Regular, RasterHeight::Size16)) as f32;
    let left = match anchor {
        Anchor::Start => x,
        Anchor::Middle => x - length / 2.0,
        Anchor::End => x - length,
    };
    let (mut left, top) = (whole(left), whole(y - TEXT.0 / 2.0));
    let (width, height, Rgb(r, g, b)) = (page.width(), page.height(), ink.rgb());
    for letter in text.chars() {
        let letter = match letter {
            '–' | '−' => '-',
            'Δ' => 'd',
            letter => letter,
        };
        let raster = |letter| get_raster(letter, FontWeight::Regular, RasterHeight::Size16);
        let Some(raster) = raster(letter).or_else(|| raster('?')) else { continue };
        for (row, line) in (top..height).zip(raster.rows()) {
            for (column, cover) in (left..width).zip(line) {
                let pixel = &mut page.pixels_mut()[(row * width + column) as usize];
                let mix = |under: u8, over: u8| {
                    let cover = u32::from(*cover);
                    to_u8((u32::from(under) * (255 - cover) + u32::from(over) * cover) / 255)
                };
                let mixed = [mix(pixel.red(), r), mix(pixel.green(), g), mix(pixel.blue(), b)];
                if let Some(mixed) = PremultipliedColorU8::from_rgba(mixed[0], mixed[1], mixed[2], 255) {
                    *pixel = mixed;
                }
            }
        }
        left += to_u32(raster.width());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing() -> Drawing {
        let mut drawing = Drawing::new(120, 60);
        drawing.line(vec![(10.0, 50.0), (60.0, 20.0), (110.0, 50.0)], Ink::Pen(0), 1.5, false);
        drawing.line(vec![(5.0, 5.0)], Ink::Grid, 1.0, false);
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
    fn a_png_has_lines_and_letters_without_a_font() {
        let png = drawing().png().expect("it has a size");
        let page = Pixmap::decode_png(&png).expect("a PNG");
        let dark = |x: std::ops::Range<u32>, y: std::ops::Range<u32>| {
            y.flat_map(|y| x.clone().map(move |x| (x, y)))
                .filter(|(x, y)| page.pixel(*x, *y).is_some_and(|p| p.green() < 200))
                .count()
        };
        assert!(dark(24..96, 2..18) > 40, "letters");
        assert!(dark(10..110, 20..50) > 60, "the line");
        assert_eq!(dark(0..120, 54..60), 0);
        assert_eq!(Drawing::new(0, 10).png(), None);
    }
}
