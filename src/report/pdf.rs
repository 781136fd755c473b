//! A report as PDF: text that can be searched, curves as vectors, Thai shaped by the embedded font Sarabun (SIL Open Font License).

mod layout;

use krilla::{
    Document as Pdf, SerializeSettings,
    color::rgb,
    geom::{PathBuilder, Point, Rect},
    metadata::{DateTime, Metadata},
    num::NormalizedF32,
    page::PageSettings,
    paint::{Fill, Stroke, StrokeDash},
    surface::Surface,
    text::{Font, GlyphId, KrillaGlyph},
};

use self::layout::{Item, Metrics};
use super::{
    ReportFormat, Style,
    document::Document,
    drawing::Ink,
    typeface::{BOLD, Glyph, REGULAR, Typeface},
};
use crate::plant::number::{to_u8, to_u16};

/// The format `pdf`.
#[derive(Debug)]
pub struct PdfFile;

impl ReportFormat for PdfFile {
    fn name(&self) -> &'static str {
        "pdf"
    }
    fn about(&self) -> &'static str {
        "pages to print and sign"
    }

    fn extension(&self) -> &'static str {
        "pdf"
    }

    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        let fonts = Fonts::new().ok_or("the embedded font cannot be read")?;
        let pages = document.locale.within(|| layout::pages(document, style.paper, &fonts));
        let settings = SerializeSettings { enable_tagging: false, ..SerializeSettings::default() };
        let mut pdf = Pdf::new_with(settings);
        pdf.set_metadata(metadata(document));
        let (width, height) = layout::size(style.paper);
        for page in &pages {
            let settings = PageSettings::from_wh(width, height).ok_or("a page without a size")?;
            let mut sheet = pdf.start_page_with(settings);
            let mut surface = sheet.surface();
            page.items.iter().for_each(|item| draw(&mut surface, &fonts, item));
            surface.finish();
            sheet.finish();
        }
        pdf.finish().map_err(|error| format!("{error:?}"))
    }
}

/// The time of the data stands for the time of making: the same report is the same file.
fn metadata(document: &Document) -> Metadata {
    let utc = document.until.to_zoned(jiff::tz::TimeZone::UTC);
    let made = DateTime::new(to_u16(utc.year()))
        .month(to_u8(utc.month()))
        .day(to_u8(utc.day()))
        .hour(to_u8(utc.hour()))
        .minute(to_u8(utc.minute()))
        .second(to_u8(utc.second()));
    let title = format!("{}: {}", document.title, document.heading);
    let language = document.locale.language.code().to_owned();
    Metadata::new().title(title).language(language).creator("sightglass".to_owned()).creation_date(made)
}

fn draw(surface: &mut Surface, fonts: &Fonts, item: &Item) {
    match item {
        Item::Text { at, size, bold, text, ink } => {
            surface.set_stroke(None);
            surface.set_fill(Some(fill(ink.colour())));
            fonts.draw(surface, *at, *size, *bold, text);
        }
        Item::Line { points, width, dashed, ink } => {
            let mut path = PathBuilder::new();
            for (n, (x, y)) in points.iter().enumerate() {
                if n == 0 { path.move_to(*x, *y) } else { path.line_to(*x, *y) }
            }
            let Some(path) = path.finish() else { return };
            let (red, green, blue) = ink.colour();
            let dash = dashed.then(|| StrokeDash { array: vec![3.0, 2.0], offset: 0.0 });
            surface.set_fill(None);
            surface.set_stroke(Some(Stroke {
                paint: rgb::Color::new(red, green, blue).into(),
                width: *width,
                dash,
                ..Stroke::default()
            }));
            surface.draw_path(&path);
        }
        Item::Fill([left, top, width, height], ink) => {
            let Some(rect) = Rect::from_xywh(*left, *top, *width, *height) else { return };
            let mut path = PathBuilder::new();
            path.push_rect(rect);
            let Some(path) = path.finish() else { return };
            surface.set_stroke(None);
            surface.set_fill(Some(fill(ink.colour())));
            surface.draw_path(&path);
        }
    }
}

fn fill((red, green, blue): (u8, u8, u8)) -> Fill {
    Fill {
        paint: rgb::Color::new(red, green, blue).into(),
        opacity: NormalizedF32::ONE,
        rule: krilla::paint::FillRule::default(),
    }
}

/// The two weights of the font, to shape with and to embed.
struct Fonts {
    weights: [(Typeface, Font); 2],
}

impl Fonts {
    fn new() -> Option<Fonts> {
        let weight = |bytes: &'static [u8]| Some((Typeface::new(bytes)?, Font::new(bytes.into(), 0)?));
        Some(Fonts { weights: [weight(REGULAR)?, weight(BOLD)?] })
    }

    /// A letter that the font does not have is a question mark, never nothing.
    fn printable(&self, text: &str, bold: bool) -> String {
        let face = &self.weights[usize::from(bold)].0;
        text.chars().map(|letter| if face.has(letter) { letter } else { '?' }).collect()
    }

    /// Glyphs as the library takes them.
    fn shape(&self, text: &str, bold: bool) -> Vec<KrillaGlyph> {
        let glyph = |Glyph { id, advance, offset, text }| {
            KrillaGlyph::new(GlyphId::new(id.0.into()), advance, offset.0, offset.1, 0.0, text, None)
        };
        self.weights[usize::from(bold)].0.shape(text).into_iter().map(glyph).collect()
    }

    fn draw(&self, surface: &mut Surface, (x, y): (f32, f32), size: f32, bold: bool, text: &str) {
        let text = self.printable(text, bold);
        let glyphs = self.shape(&text, bold);
        let font = self.weights[usize::from(bold)].1.clone();
        surface.draw_glyphs(Point::from_xy(x, y), &glyphs, font, &text, size, false);
    }
}

impl Metrics for Fonts {
    fn width(&self, text: &str, size: f32, bold: bool) -> f32 {
        self.shape(&self.printable(text, bold), bold).iter().map(|glyph| glyph.x_advance * size).sum()
    }
}

impl Ink {
    fn colour(self) -> (u8, u8, u8) {
        let super::drawing::Rgb(red, green, blue) = self.rgb();
        (red, green, blue)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_the_font_lacks_are_seen() {
        let fonts = Fonts::new().expect("the font is embedded");
        assert_eq!(fonts.printable("✓ 漢 °C ≤ ก", false), "? ? °C ≤ ก");
        let advance = |text: &str| fonts.width(text, 10.0, false);
        assert!(advance("ก") > 0.0 && (advance("ก่") - advance("ก")).abs() < 0.01, "a tone mark takes no room");
        assert!(advance("1.00") < fonts.width("1.00", 20.0, false));
    }
}
