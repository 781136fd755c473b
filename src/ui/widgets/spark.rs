//! A curve in one row of cells: the shape of the last hour beside a value.

use crate::{history::Series, plant::number::to_usize, ui::theme::Glyphs};

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
const ASCII: [char; 5] = ['_', '.', '-', '=', '^'];

/// The curve in `cells` glyphs, from its least value at the bottom to its greatest at the top. A cell without a good
/// value is blank, and a constant is drawn in the middle: it is neither low nor high. `resolution` is the last digit
/// of the tag: what moves by no more counts as constant. Console fonts lack most eighth blocks, so only the full glyph
/// set has them.
pub fn spark(series: &Series, cells: usize, resolution: f64, glyphs: Glyphs) -> String {
    let glyphs = bars_of(glyphs);
    let count = series.buckets.len();
    let mean = |n: usize| {
        // Every cell stands for at least one column, and every column stands in a cell.
        let (first, last) = (n * count / cells, ((n + 1) * count / cells).max(n * count / cells + 1));
        let known: Vec<f64> = series.buckets.get(first..last.min(count))?.iter().flatten().map(|b| b.mean).collect();
        let known = known.into_iter().filter(|mean| mean.is_finite()).collect::<Vec<f64>>();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    };
    let means: Vec<Option<f64>> = (0..cells).map(mean).collect();
    let least = means.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let range = means.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max) - least;
    let glyph = |mean: Option<f64>| match mean {
        None => ' ',
        Some(_) if range <= resolution => glyphs[(glyphs.len() - 1) / 2],
        Some(mean) => glyphs[to_usize(((mean - least) / range * (glyphs.len() - 1) as f64).round())],
    };
    means.into_iter().map(glyph).collect()
}

/// Values as bars from 0 to `top`, one glyph each; what is not known is blank.
pub fn bars(values: &[Option<f64>], top: f64, glyphs: Glyphs) -> String {
    let glyphs = bars_of(glyphs);
    let last = glyphs.len() - 1;
    let bar = |value: f64| glyphs[to_usize(((value / top).clamp(0.0, 1.0) * last as f64).round())];
    values.iter().map(|value| value.filter(|value| value.is_finite()).map_or(' ', bar)).collect()
}

fn bars_of(glyphs: Glyphs) -> &'static [char] {
    match glyphs {
        Glyphs::Braille => &BLOCKS,
        Glyphs::Block | Glyphs::Ascii => &ASCII,
    }
}

/// Shares from 0 to 1, newest last, on a scale that does not move: how busy a line was. The oldest are at the left.
pub fn shares(values: &[f32], cells: usize, glyphs: Glyphs) -> String {
    let glyphs = bars_of(glyphs);
    let each = values.len().div_ceil(cells.max(1)).max(1);
    let glyph = |part: &[f32]| {
        let mean = part.iter().sum::<f32>() / part.len() as f32;
        glyphs[to_usize((mean.clamp(0.0, 1.0) * (glyphs.len() - 1) as f32).round())]
    };
    values.rchunks(each).rev().map(glyph).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use jiff::Timestamp;

    use super::*;
    use crate::{history::Bucket, plant::def::TagId};

    const GAP: f64 = f64::NAN;

    fn check(values: &[f64], cells: usize, expect: &str, expect_ascii: &str) {
        let bucket = |v: &f64| v.is_finite().then_some(Bucket { min: *v, max: *v, mean: *v, last: (*v).into() });
        let series = Series {
            tag: TagId(0),
            from: Timestamp::UNIX_EPOCH,
            step: Duration::from_secs(1),
            buckets: values.iter().map(bucket).collect(),
            summary: None,
            counted: None,
            good: 1.0,
        };
        assert_eq!(spark(&series, cells, 0.1, Glyphs::Braille), expect, "{values:?}");
        assert_eq!(spark(&series, cells, 0.1, Glyphs::Ascii), expect_ascii, "{values:?}");
    }

    #[test]
    fn how_busy_a_line_was_is_seen_on_a_scale_that_does_not_move() {
        assert_eq!(shares(&[0.0, 0.5, 1.0, 0.52], 8, Glyphs::Braille), "▁▅█▅");
        assert_eq!(shares(&[0.0, 0.0, 1.0, 1.0, 0.0], 3, Glyphs::Ascii), "_--");
        assert_eq!(shares(&[], 8, Glyphs::Ascii), "");
    }

    #[test]
    fn the_shape_of_a_curve_is_seen_in_a_row() {
        check(&[0., 1., 2., 3., 4., 5., 6., 7.], 8, "▁▂▃▄▅▆▇█", "_..--==^");
        check(&[1., GAP, GAP, 9.], 4, "▁  █", "_  ^");
        check(&[5., 5., 5.], 3, "▄▄▄", "---");
        check(&[5.0, 5.1, 5.0], 3, "▄▄▄", "---");
        check(&[GAP, GAP], 2, "  ", "  ");
        check(&[0., 10., 20., 30.], 2, "▁█", "_^");
        check(&[0., 10.], 4, "▁▁██", "__^^");
        check(&[], 3, "   ", "   ");
        check(&[1.], 0, "", "");
    }
}
