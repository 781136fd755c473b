//! Other plots of the view: one pen over another, and how often a pen had which value.

use super::{
    legend::signed_time,
    view::{NO_TRACE, axis, resolution},
    *,
};
use crate::{
    plant::{exact::digits, number::to_usize},
    ui::widgets::{
        axes::Axes,
        chart::{axis::Scale, mark, raster, raster::Canvas as Dots, trace::Span},
    },
};

/// Columns of the view that a plot is made of: finer than any screen.
const COLUMNS: usize = 2_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Plot {
    #[default]
    Time,
    /// The selected pen over the next one.
    Xy,
    /// How long the selected pen had which value.
    Histogram,
    /// The answer of a controller to its last step of the setpoint.
    Response,
    Numbers,
}

impl Plot {
    pub fn next(self) -> Plot {
        match self {
            Plot::Time => Plot::Xy,
            Plot::Xy => Plot::Histogram,
            Plot::Histogram => Plot::Response,
            Plot::Response => Plot::Numbers,
            Plot::Numbers => Plot::Time,
        }
    }
}

/// Values of a pen in columns of equal width over the view, or between both cursors.
fn columns(trends: &Trends, cx: &ViewContext, tag: TagId) -> Vec<Option<Span>> {
    let view = trends.span(cx);
    let (from, to) = trends.both().map_or((view.from, view.to), |(a, b)| (a.min(b), a.max(b)));
    trends.traces.get(&tag).unwrap_or(&NO_TRACE).columns(from, to, cx.present(), COLUMNS)
}

/// The scale of a pen for a plot: that of its curve, or one that fits these values.
fn scale(trends: &Trends, cx: &ViewContext, pen: Pen, columns: &[Option<Span>], ticks: usize) -> Scale {
    let typed = trends.scales.get(&pen.tag).and_then(|scale| scale.range);
    let data = columns.iter().flatten().map(|span| (span.min, span.max));
    let data = data.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    Scale::fit(data.filter(|_| typed.is_none()), typed, resolution(cx, pen.tag), ticks)
}

/// The selected pen over the one that comes next: one dot for each instant at which both were known, the latest marked.
pub(super) fn draw_xy(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (theme, pens) = (cx.theme, trends.curved(cx));
    let place = pens.iter().position(|(n, _)| *n == trends.selected).unwrap_or(0);
    let (Some((n, y)), Some((_, x))) = (pens.get(place), pens.get((place + 1) % pens.len().max(1))) else {
        return canvas.text_centred(canvas.height() / 2, t!("select a pen that has a curve"), theme.dim());
    };
    if pens.len() < 2 {
        return canvas.text_centred(canvas.height() / 2, t!("needs a second pen"), theme.dim());
    }
    let both = (columns(trends, cx, x.tag), columns(trends, cx, y.tag));
    let (width, height) = (canvas.width(), canvas.height());
    let ticks = (usize::from(width / 12).clamp(2, 8), usize::from(height / 4).clamp(2, 6));
    let scales = (scale(trends, cx, *x, &both.0, ticks.0), scale(trends, cx, *y, &both.1, ticks.1));
    let name = |tag: TagId| format!("{} {}", cx.def().tag(tag).name, axis(trends, cx, tag));
    let names = (name(x.tag), format!("{} {}", mark(theme, *n), name(y.tag)));
    let axes = Axes { x: scales.0, y: scales.1, names: (&names.0, &names.1) };
    let (left, top, across, down) = axes.draw(theme, canvas);
    let mut dots = Dots::new(raster(theme), across.into(), down.into());
    let size = dots.size();
    let inside = |scale: Scale, value: f64| (scale.low..=scale.high).contains(&value);
    let dot = |share: f64, count: usize| to_usize((share * count.saturating_sub(1) as f64).round());
    let pairs = both.0.iter().zip(&both.1).filter_map(|(x, y)| Some(((*x)?.last, (*y)?.last)));
    let mut last = None;
    for (x, y) in pairs.filter(|(x, y)| inside(scales.0, *x) && inside(scales.1, *y)) {
        let at = (dot(scales.0.share(x), size.0), dot(1.0 - scales.1.share(y), size.1));
        dots.bar(at.0, at.1, at.1, *n);
        last = Some(at);
    }
    for (x, y, glyph, _) in dots.glyphs() {
        canvas.text(left + to_u16(x), top + to_u16(y), &glyph.to_string(), theme.pen(*n));
    }
    let (cell_x, cell_y) = raster(theme).dots();
    match last {
        Some((x, y)) => {
            canvas.text(left + to_u16(x / cell_x), top + to_u16(y / cell_y), mark(theme, *n), theme.strong());
        }
        None => canvas.text_centred(height / 2, t!("no time at which both are known"), theme.dim()),
    }
}

/// How long a value lay in each class, as a share of the time in which it was known.
pub(super) fn classes(columns: &[Option<Span>], scale: Scale, count: usize) -> Vec<f64> {
    let mut classes = vec![0.0; count.max(1)];
    let known = columns.iter().flatten().map(|span| span.last).filter(|value| (scale.low..=scale.high).contains(value));
    let place = |value: f64| to_usize(scale.share(value) * classes.len() as f64).min(classes.len() - 1);
    let places: Vec<usize> = known.map(place).collect();
    let total = columns.iter().flatten().count().max(1) as f64;
    places.into_iter().for_each(|place| classes[place] += 1.0 / total);
    classes
}

/// Mean and standard deviation of the known values.
pub(super) fn spread(columns: &[Option<Span>]) -> Option<(f64, f64)> {
    let values: Vec<f64> = columns.iter().flatten().map(|span| span.last).collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    (!values.is_empty()).then_some((mean, variance.sqrt()))
}

/// How long the selected pen had which value, in percent of the time in which it was known.
pub(super) fn draw_histogram(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let Some((n, pen)) = trends.curved(cx).into_iter().find(|(n, _)| *n == trends.selected) else {
        return canvas.text_centred(canvas.height() / 2, t!("select a pen that has a curve"), theme.dim());
    };
    let columns = columns(trends, cx, pen.tag);
    let (width, height) = (canvas.width(), canvas.height());
    let x = scale(trends, cx, pen, &columns, usize::from(width / 12).clamp(2, 8));
    // A class is two cells wide, but never finer than the last digit.
    let finest = to_usize(((x.high - x.low) / resolution(cx, pen.tag)).round()).max(1);
    let classes = classes(&columns, x, usize::from(width / 2).min(40).min(finest));
    let most = classes.iter().copied().fold(0.0, f64::max) * 100.0;
    let y = Scale::fit(Some((0.0, most)), None, 0.1, usize::from(height / 4).clamp(2, 5));
    let name = format!("{} {} {}", mark(theme, n), cx.def().tag(pen.tag).name, axis(trends, cx, pen.tag));
    let axes = Axes { x, y, names: (&name, t!("% of time")) };
    let (left, top, across, down) = axes.draw(theme, canvas);
    let figures = match trends.both() {
        Some(_) => trends.measured(cx, pen.tag).and_then(|measured| measured.figures),
        None => trends.figures.get(&pen.tag).copied(),
    };
    // The mean of all samples, as in the legend: the columns know only their last value.
    let mean = figures.and_then(|(summary, _)| summary).map(|(_, mean, _)| mean);
    let Some((_, deviation)) = spread(&columns) else {
        return canvas.text_centred(height / 2, t!("no good value in this window"), theme.dim());
    };
    let eighths: [&str; 9] =
        theme.pick([" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"], [" ", " ", " ", " ", "#", "#", "#", "#", "#"]);
    for column in 0..across {
        let class = usize::from(column) * classes.len() / usize::from(across.max(1));
        let filled = to_usize((y.share(classes[class] * 100.0) * f64::from(down) * 8.0).round());
        for row in 0..down {
            let below = usize::from(down - 1 - row) * 8;
            let part = filled.saturating_sub(below).min(8);
            if part > 0 {
                canvas.text(left + column, top + row, eighths[part], theme.pen(n));
            }
        }
    }
    let decimals = Some(cx.snapshot.decimals[pen.tag.index()] + 1);
    let view = trends.span(cx);
    let span = trends.both().map_or(view.width(), |(a, b)| b.duration_since(a).abs());
    let words = t!(
        "mean {mean}   standard deviation {deviation}   in {time}",
        mean = mean.map_or("–".to_owned(), |mean| digits(mean, decimals)),
        deviation = digits(deviation, decimals),
        time = signed_time(span)
    );
    canvas.text_right(width.saturating_sub(1), 0, &words, theme.normal());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_share_the_known_time() {
        let at = |value: f64| Some(Span { min: value, max: value, last: value });
        let columns = [at(0.0), at(0.4), at(1.0), at(2.0), None, at(9.0)];
        let scale = Scale { low: 0.0, high: 2.0, step: 1.0 };
        assert_eq!(classes(&columns, scale, 2), [0.4, 0.4], "one value lies outside");
        assert_eq!(spread(&columns[2..4]), Some((1.5, 0.5)));
        assert_eq!(spread(&[None]), None);
    }
}
