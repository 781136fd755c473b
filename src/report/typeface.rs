//! The embedded fonts: texts as shaped glyphs, for PDF, and as outlines in cells of one width, for pictures.

use rustybuzz::{
    Face, UnicodeBuffer,
    ttf_parser::{GlyphId, OutlineBuilder},
};
use tiny_skia::{Path, PathBuilder};
use unicode_segmentation::UnicodeSegmentation;
use unicode_width::UnicodeWidthStr;

use crate::plant::number::to_f32;

/// Letters of reports, Thai and Latin.
pub(super) const REGULAR: &[u8] = include_bytes!("fonts/Sarabun-Regular.ttf");
pub(super) const BOLD: &[u8] = include_bytes!("fonts/Sarabun-Bold.ttf");
/// Letters and signs of pictures, all of one width.
const MONO: &[u8] = include_bytes!("fonts/DejaVuSansMono-subset.ttf");
/// Width of a letter of pictures in sizes: 1233 of 2048 units.
pub const CELL: f32 = 0.602;

/// A font that shapes and outlines.
pub(super) struct Typeface(Face<'static>);

/// A glyph of a shaped text; lengths are parts of the size.
pub(super) struct Glyph {
    pub id: GlyphId,
    pub advance: f32,
    pub offset: (f32, f32),
    /// The bytes of the text that it stands for.
    pub text: std::ops::Range<usize>,
}

impl Typeface {
    pub fn new(bytes: &'static [u8]) -> Option<Typeface> {
        Face::from_slice(bytes, 0).map(Typeface)
    }

    /// It has this letter.
    pub fn has(&self, letter: char) -> bool {
        self.0.glyph_index(letter).is_some()
    }

    fn units(&self) -> f32 {
        f32::from(u16::try_from(self.0.units_per_em()).unwrap_or(1_000))
    }

    /// Thai and other letters are shaped apart, each by the rules of its script.
    pub fn shape(&self, text: &str) -> Vec<Glyph> {
        let part = |units: i32| to_f32(f64::from(units)) / self.units();
        let mut glyphs = Vec::new();
        for (begin, run) in runs(text) {
            let mut buffer = UnicodeBuffer::new();
            buffer.push_str(run);
            buffer.guess_segment_properties();
            let shaped = rustybuzz::shape(&self.0, &[], buffer);
            let infos = shaped.glyph_infos();
            for (n, (info, place)) in infos.iter().zip(shaped.glyph_positions()).enumerate() {
                let next = infos[n..].iter().find(|other| other.cluster != info.cluster);
                let end = next.map_or(run.len(), |other| other.cluster as usize);
                glyphs.push(Glyph {
                    // A font has no more glyphs than that.
                    id: GlyphId(u16::try_from(info.glyph_id).unwrap_or(0)),
                    advance: part(place.x_advance),
                    offset: (part(place.x_offset), part(place.y_offset)),
                    text: begin + info.cluster as usize..begin + end,
                });
            }
        }
        glyphs
    }

    /// Draws a glyph with its origin at a place; it is as wide as `scale.0` and as high as `scale.1` say.
    fn outline(&self, id: GlyphId, at: (f32, f32), size: (f32, f32), path: &mut PathBuilder) {
        let scale = (size.0 / self.units(), size.1 / self.units());
        self.0.outline_glyph(id, &mut Outline { at, scale, path });
    }
}

/// The letters of a picture.
pub(super) struct Letters {
    mono: Typeface,
    thai: Typeface,
}

impl Letters {
    pub fn new() -> Option<Letters> {
        Some(Letters { mono: Typeface::new(MONO)?, thai: Typeface::new(REGULAR)? })
    }

    /// The outlines of a text that begins on its base line at a place, each letter in its columns as in a terminal.
    /// A letter that no font has is a question mark, never nothing.
    pub fn outline(&self, text: &str, (mut x, y): (f32, f32), size: f32) -> Option<Path> {
        let mut path = PathBuilder::new();
        for letter in text.graphemes(true) {
            let room = letter.width() as f32 * size * CELL;
            self.letter(letter, (x, y), size, room, &mut path);
            x += room;
        }
        path.finish()
    }

    fn letter(&self, letter: &str, (x, y): (f32, f32), size: f32, room: f32, path: &mut PathBuilder) {
        let mut characters = letter.chars();
        if let (Some(only), None) = (characters.next(), characters.next())
            && let Some(id) = self.mono.0.glyph_index(only)
        {
            return self.mono.outline(id, (x, y), (size, size), path);
        }
        if !letter.chars().all(|letter| self.thai.has(letter)) {
            return self.letter("?", (x, y), size, room, path);
        }
        // In the middle of its columns, and no wider.
        let glyphs = self.thai.shape(letter);
        let width = glyphs.iter().map(|glyph| glyph.advance * size).sum::<f32>();
        let squeeze = if room < width { room / width } else { 1.0 };
        let mut left = x + (room - width * squeeze) / 2.0;
        for Glyph { id, advance, offset, .. } in glyphs {
            let at = (left + offset.0 * size * squeeze, y - offset.1 * size);
            self.thai.outline(id, at, (size * squeeze, size), path);
            left += advance * size * squeeze;
        }
    }
}

/// The pictures have this character, alone or as part of a letter.
#[cfg(test)]
pub(crate) fn has_letter(character: char) -> bool {
    ('\u{2800}'..='\u{28ff}').contains(&character)
        || Letters::new().is_some_and(|letters| letters.mono.has(character) || letters.thai.has(character))
}

/// Moves the curves of a glyph, which count upwards, into a path, which counts downwards.
struct Outline<'a> {
    at: (f32, f32),
    scale: (f32, f32),
    path: &'a mut PathBuilder,
}

impl Outline<'_> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        (self.at.0 + x * self.scale.0, self.at.1 - y * self.scale.1)
    }
}

impl OutlineBuilder for Outline<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.place(x1, y1), self.place(x2, y2), self.place(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// The runs of Thai and of other letters, each with its place in the text.
fn runs(text: &str) -> Vec<(usize, &str)> {
    let is_thai = |letter: char| ('\u{e00}'..'\u{e80}').contains(&letter);
    let mut starts: Vec<usize> = vec![0];
    let mut thai = None;
    for (place, letter) in text.char_indices() {
        if thai.replace(is_thai(letter)).is_some_and(|before| before != is_thai(letter)) {
            starts.push(place);
        }
    }
    let ends = starts.iter().skip(1).copied().chain([text.len()]);
    starts
        .iter()
        .zip(ends)
        .map(|(begin, end)| (*begin, &text[*begin..end]))
        .filter(|(_, run)| !run.is_empty())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thai_and_latin_are_shaped_apart() {
        let found: Vec<&str> = runs("TIC-1 กำลังทำงาน 5 °C").into_iter().map(|(_, run)| run).collect();
        assert_eq!(found, ["TIC-1 ", "กำลังทำงาน", " 5 °C"]);
    }

    #[test]
    fn a_letter_stays_in_its_columns() {
        let letters = Letters::new().expect("the fonts are embedded");
        let cell = 20.0 * CELL;
        for (text, columns) in [("M", 1.0), ("▲", 1.0), ("…", 1.0), ("ก", 1.0), ("ฒ", 1.0), ("ที่", 1.0), ("漢", 2.0)]
        {
            let bounds = letters.outline(text, (0.0, 30.0), 20.0).expect("it is drawn").bounds();
            assert!(-1.0 <= bounds.left() && bounds.right() <= columns * cell + 1.0, "{text} {bounds:?}");
            assert!(30.0 - 25.0 <= bounds.top() && bounds.bottom() <= 36.0, "{text} {bounds:?}");
        }
        let ends = |text: &str| letters.outline(text, (0.0, 30.0), 20.0).expect("it is drawn").bounds().right();
        assert!((ends("กลM") - ends("M") - 2.0 * cell).abs() < 0.1, "Thai letters count as columns");
        let tops = |text: &str| letters.outline(text, (0.0, 30.0), 20.0).expect("it is drawn").bounds().top();
        assert!(tops("ที่") < tops("ที") && tops("ที") < tops("ท"), "marks stand above each other");
    }
}
