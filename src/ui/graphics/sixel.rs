//! Sixel: bands of six rows of pixels, a run of letters for each colour in them (DEC STD 070, chapter 9).

use std::collections::BTreeMap;

use tiny_skia::Pixmap;

/// Colours of a picture, where the terminal does not say how many it has.
pub const COLOURS_MAX: u16 = 256;
/// Rows of pixels of a band.
const BAND: usize = 6;

/// Red, green and blue in percent.
type Colour = [u8; 3];

/// Shows the pixels at the cursor, in so many colours: beyond them the rarest become the nearest of the others.
pub fn encode(pixels: &Pixmap, colours_max: u16) -> Vec<u8> {
    let (width, height) = (pixels.width() as usize, pixels.height() as usize);
    let percent = |part: u8| u8::try_from((u16::from(part) * 100 + 127) / 255).unwrap_or(100);
    let colours: Vec<Colour> =
        pixels.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()].map(percent)).collect();
    let (palette, places) = palette(&colours, colours_max.clamp(2, COLOURS_MAX).into());
    let mut sent = format!("\x1bP0;1;0q\"1;1;{width};{height}").into_bytes();
    for (n, [red, green, blue]) in palette.iter().enumerate() {
        sent.extend(format!("#{n};2;{red};{green};{blue}").into_bytes());
    }
    for band in colours.chunks(width.max(1) * BAND) {
        let mut rows: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        for (row, line) in band.chunks(width.max(1)).enumerate() {
            for (x, colour) in line.iter().enumerate() {
                let bits = rows.entry(places[colour]).or_insert_with(|| vec![0; width]);
                bits[x] |= 1 << row;
            }
        }
        for (n, bits) in rows {
            sent.extend(format!("#{n}").into_bytes());
            runs(&mut sent, &bits);
            sent.push(b'$');
        }
        sent.push(b'-');
    }
    sent.extend(b"\x1b\\");
    sent
}

/// The most frequent colours, and which of them stands for each colour.
fn palette(colours: &[Colour], most: usize) -> (Vec<Colour>, BTreeMap<Colour, usize>) {
    let mut counts: BTreeMap<Colour, usize> = BTreeMap::new();
    for colour in colours {
        *counts.entry(*colour).or_default() += 1;
    }
    let mut all: Vec<(Colour, usize)> = counts.into_iter().collect();
    all.sort_by_key(|(colour, count)| (std::cmp::Reverse(*count), *colour));
    let palette: Vec<Colour> = all.iter().take(most).map(|(colour, _)| *colour).collect();
    let distance = |a: &Colour, b: &Colour| a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum::<u32>();
    let nearest = |colour: &Colour| (0..palette.len()).min_by_key(|n| distance(&palette[*n], colour)).unwrap_or(0);
    let places = all.iter().map(|(colour, _)| (*colour, nearest(colour))).collect();
    (palette, places)
}

/// Equal columns as a count and one letter; blank ones at the end are left out.
fn runs(sent: &mut Vec<u8>, bits: &[u8]) {
    let end = bits.iter().rposition(|bits| *bits != 0).map_or(0, |last| last + 1);
    for run in bits[..end].chunk_by(|a, b| a == b) {
        let letter = b'?' + run[0];
        match run.len() {
            1..=3 => sent.extend(std::iter::repeat_n(letter, run.len())),
            count => sent.extend(format!("!{count}{}", char::from(letter)).into_bytes()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{
        io::Write,
        process::{Command, Stdio},
    };

    use super::*;
    use crate::report::drawing::{Anchor, Drawing, Ink, Rgb};

    /// As libsixel decodes it; `None` where it is not installed.
    fn decoded(sent: &[u8]) -> Option<Pixmap> {
        let program = Command::new("sixel2png").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let Ok(mut program) = program else {
            assert!(std::env::var_os("CI").is_none(), "sixel2png (Debian package libsixel-bin)");
            eprintln!("skipped: no sixel2png (Debian package libsixel-bin)");
            return None;
        };
        program.stdin.take().expect("a pipe").write_all(sent).expect("it reads");
        let output = program.wait_with_output().expect("it ends");
        Some(Pixmap::decode_png(&output.stdout).expect("a PNG"))
    }

    fn drawing(width: u16, height: u16) -> Drawing {
        let mut drawing = Drawing::on(width, height, Rgb(38, 38, 38), 16.0);
        for pen in 0..8_u8 {
            let y = f32::from(pen) * 9.0;
            let points = vec![(0.0, y), (f32::from(width) / 2.0, f32::from(height)), (f32::from(width), y)];
            drawing.line(points, Ink::Pen(pen.into()), 1.5, pen % 2 == 0);
        }
        drawing.fill(vec![[10.0, 10.0, 30.0, 7.0]], Ink::Own(Rgb(255, 106, 96)));
        drawing.text((60.0, 20.0), Anchor::Start, "TIC-1 °C ถังน้ำ", Ink::Own(Rgb(200, 200, 196)));
        drawing
    }

    /// The share of parts of colours that differ by more than a percent, which is 2.55 steps; and the mean difference.
    fn difference(a: &Pixmap, b: &Pixmap) -> (f64, f64) {
        assert_eq!((a.width(), a.height()), (b.width(), b.height()));
        let parts = a.data().iter().zip(b.data()).map(|(a, b)| a.abs_diff(*b));
        let (sum, far) = (parts.clone().map(f64::from).sum::<f64>(), parts.filter(|part| *part > 3).count());
        (far as f64 / a.data().len() as f64, sum / a.data().len() as f64)
    }

    #[test]
    fn another_decoder_sees_the_pixels_of_the_drawing() {
        // Heights that end within a band too.
        for (width, height) in [(300, 120), (301, 121), (64, 5), (1, 1)] {
            let pixels = drawing(width, height).pixels().expect("it has a size");
            let Some(seen) = decoded(&encode(&pixels, COLOURS_MAX)) else { return };
            // Colours beyond 256 are blends at the edge of a line.
            let (far, mean) = difference(&pixels, &seen);
            assert!(far < 0.01 && mean < 1.3, "{width}x{height}: {far} {mean}");
        }
    }

    #[test]
    fn few_colours_keep_the_most_frequent_ones() {
        let pixels = drawing(300, 120).pixels().expect("it has a size");
        let sent = encode(&pixels, 16);
        let text = String::from_utf8(sent.clone()).expect("letters");
        assert_eq!(text.matches(";2;").count(), 16, "{text}");
        let Some(seen) = decoded(&sent) else { return };
        let (_, mean) = difference(&pixels, &seen);
        assert!(mean < 5.0, "{mean}");
        let ground = |page: &Pixmap| page.pixel(299, 60).map(|pixel| pixel.red());
        assert!(ground(&pixels).zip(ground(&seen)).is_some_and(|(a, b)| a.abs_diff(b) < 2));
    }
}
