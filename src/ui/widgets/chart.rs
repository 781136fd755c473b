//! Several curves over one time axis, drawn in cells: a spike is never lost, a gap is a gap, and every pen is known
//! without colour.

mod draw;
pub(crate) mod stroke;
pub(crate) mod axis;
pub(crate) mod raster;
pub(crate) mod trace;

use crate::t;
use std::time::Duration;

use jiff::{SignedDuration, Timestamp, tz::TimeZone};
use ratatui::{buffer::Buffer, layout::Rect, style::Style, text::Line, widgets::Widget};
use unicode_width::UnicodeWidthStr;

use self::{
    axis::{Scale, elapsed_ticks, time_ticks},
    raster::{Canvas, Raster},
    stroke::Stroke,
    trace::{Span, Trace},
};
use crate::{
    plant::number::{to_i32, to_u16, to_usize},
    ui::theme::{Glyphs, Theme},
};

/// Least width of the space for the labels of an axis, so that the picture does not jump with its data.
const GUTTER: usize = 6;
/// Pens carry their mark every this many cells.
const MARK_CELLS: i64 = 24;

/// What is drawn. Nothing appears before `from`, from `to` on or after `now`.
pub struct Chart<'a> {
    pub theme: &'a Theme,
    /// The local time of the labels; `None` counts from the left edge.
    pub zone: Option<&'a TimeZone>,
    /// Left edge.
    pub from: Timestamp,
    /// Right edge, may lie after `now`.
    pub to: Timestamp,
    /// The present: the curves end here.
    pub now: Timestamp,
    /// The pens, most important first: the first wins where curves cross.
    pub curves: Vec<Curve<'a>>,
    /// Vertical lines at instants, and what to write above each, in order of time.
    pub cursors: Vec<(Timestamp, Line<'a>)>,
    /// The curve whose axis is at the right where there are more than two.
    pub right: Option<usize>,
    /// Alarm limits: lines behind the curves, and the range between them on the axis.
    pub limits: Vec<Limit>,
    /// Least width of the margin at the left: rows under the chart have their names there.
    pub margin: u16,
    /// Events on the time axis.
    pub marks: Vec<(Timestamp, Style)>,
}

/// A limit on the scale of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Place of the curve.
    pub curve: usize,
    /// In its unit.
    pub value: f64,
    /// Values above it are abnormal; else those below.
    pub high: bool,
    /// `H 75.0`.
    pub text: String,
}

/// One pen.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    pub trace: &'a Trace,
    /// Its number in the group: picks mark and colour, and stays the same when others are switched off.
    pub pen: usize,
    /// Curves of one unit share an axis.
    pub unit: &'a str,
    /// It has an axis of its own.
    pub own: bool,
    /// Fixed scale; `None` fits the data.
    pub fixed: Option<(f64, f64)>,
    /// The fixed scale is kept where data lie outside: arrows at its end say so.
    pub clipped: bool,
    /// The value of the last digit shown.
    pub resolution: f64,
    pub stroke: Stroke,
    /// A broken line: a written value, not a measured one.
    pub dashed: bool,
}

impl<'a> Curve<'a> {
    /// A plain pen with so many decimals, on a scale that fits it.
    pub fn new(trace: &'a Trace, pen: usize, unit: &'a str, decimals: u8) -> Curve<'a> {
        let resolution = 10f64.powi(-i32::from(decimals));
        Curve {
            trace,
            pen,
            unit,
            own: false,
            fixed: None,
            clipped: false,
            resolution,
            stroke: Stroke::Step,
            dashed: false,
        }
    }

    /// Curves with equal ones share an axis.
    fn axis(&self) -> (&str, Option<usize>) {
        (self.unit, self.own.then_some(self.pen))
    }

    /// What is written over its axis.
    fn heading(&self, theme: &Theme) -> String {
        if self.own { format!("{} {}", mark(theme, self.pen), self.unit) } else { self.unit.to_owned() }
    }
}

/// The axis that a curve is read on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// The first unit.
    Left,
    /// The second unit.
    Right,
    /// Any further unit fills the height on a scale of its own, which the legend must tell.
    Own,
}

/// Where everything goes: the same for drawing, for the cursor and for the legend.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The cells of the curves.
    pub plot: Rect,
    /// Axis and scale of each curve.
    pub scales: Vec<(Axis, Scale)>,
    columns: Vec<Vec<Option<Span>>>,
}

/// The mark of a pen, in the legend and on its curve: a shape, or a letter where the font may lack the shapes.
pub fn mark(theme: &Theme, pen: usize) -> &'static str {
    const SHAPES: [&str; 8] = ["●", "○", "▲", "△", "■", "□", "◆", "◇"];
    const LETTERS: [&str; 8] = ["A", "B", "C", "D", "E", "F", "G", "H"];
    let marks = match theme.glyphs {
        Glyphs::Braille => SHAPES,
        Glyphs::Block | Glyphs::Ascii => LETTERS,
    };
    marks[pen % marks.len()]
}

/// Dots across a chart of so many columns whose labels are of usual width: the columns to ask the history for.
pub fn dots(theme: &Theme, width: u16, axes: usize) -> usize {
    let cells = usize::from(width).saturating_sub(GUTTER * axes.clamp(1, 2));
    cells.max(10) * raster(theme).dots().0
}

pub(crate) fn raster(theme: &Theme) -> Raster {
    match theme.glyphs {
        Glyphs::Braille => Raster::Braille,
        Glyphs::Block => Raster::Half,
        Glyphs::Ascii => Raster::Ascii,
    }
}

impl<'a> Chart<'a> {
    /// Curves from the first instant to the second, up to now, on an axis of elapsed time.
    pub fn new(
        theme: &'a Theme,
        (from, to, now): (Timestamp, Timestamp, Timestamp),
        curves: Vec<Curve<'a>>,
    ) -> Chart<'a> {
        Chart {
            theme,
            zone: None,
            from,
            to,
            now,
            curves,
            cursors: Vec::new(),
            right: None,
            limits: Vec::new(),
            margin: 0,
            marks: Vec::new(),
        }
    }
}

impl Chart<'_> {
    /// Decides scales and places. One row above for the units, two below for the time axis, where there is room.
    pub fn plan(&self, area: Rect) -> Plan {
        let rows = if area.height >= 6 { area.height - 3 } else { area.height };
        // The width of the labels wants the scales, the scales want the data in the columns of the final width:
        // the labels' width is settled first, on all data in sight.
        let rough = self.scales(&self.columns(usize::from(area.width)), rows.div_ceil(2).into());
        let gutter = |axis: Axis| {
            let scales = rough.iter().filter(|(of, _)| *of == axis).map(|(_, scale)| *scale);
            let labels = scales.flat_map(|scale| scale.ticks().into_iter().map(move |tick| scale.label(tick).len()));
            labels.max().map_or(0, |width| to_u16((width + 1).max(GUTTER)))
        };
        let (mut left, mut right) = (gutter(Axis::Left).max(1).max(self.margin), gutter(Axis::Right));
        if area.height < 6 || area.width < left + right + 10 {
            (left, right) = (0, 0);
        }
        let plot = Rect {
            x: area.x + left,
            y: area.y + u16::from(area.height >= 6),
            width: area.width - left - right,
            height: rows,
        };
        let columns = self.columns(usize::from(plot.width) * raster(self.theme).dots().0);
        if plot.height == area.height {
            let scales = self.scales(&columns, rows.div_ceil(2).into());
            return Plan { plot, scales, columns };
        }
        let (height, scales) = self.even(&columns, rows);
        Plan { plot: Rect { height, ..plot }, scales, columns }
    }

    fn columns(&self, count: usize) -> Vec<Vec<Option<Span>>> {
        self.curves.iter().map(|curve| curve.trace.columns(self.from, self.to, self.now, count)).collect()
    }

    /// Height and scales whose labels stand evenly: the intervals of each axis divide the rows between its ends. Up to
    /// three rows are given up for that; where nothing fits, the labels stand as they fall.
    fn even(&self, columns: &[Vec<Option<Span>>], rows: u16) -> (u16, Vec<(Axis, Scale)>) {
        let wanted = usize::from(rows.div_ceil(2)).min(6);
        let usual = self.scales(columns, wanted);
        let other: Vec<Vec<(Axis, Scale)>> = (1..wanted).map(|ticks| self.scales(columns, ticks)).collect();
        let choice = |height: u16| {
            let gaps = usize::from(height - 1);
            let even = |scale: &Scale| scale.intervals().is_some_and(|n| n > 1 && gaps.is_multiple_of(n) && gaps > n);
            let best = |(place, (axis, scale)): (usize, &(Axis, Scale))| {
                let divided = (2..=wanted).filter_map(|n| scale.divided(n));
                let all = divided.chain(other.iter().map(|scales| scales[place].1)).chain([*scale]);
                let best = all.filter(even).max_by_key(|scale| scale.intervals());
                // What has no labels needs no even ones.
                best.or((*axis == Axis::Own).then_some(*scale)).map(|best| (*axis, best))
            };
            let scales: Vec<(Axis, Scale)> = usual.iter().enumerate().map(best).collect::<Option<_>>()?;
            let least = to_i32(scales.iter().filter_map(|(_, scale)| scale.intervals()).min().unwrap_or(0).min(4));
            Some((2 * least - i32::from(rows - height), height, scales))
        };
        let choices = (rows.saturating_sub(3).max(3)..=rows).rev().filter_map(choice);
        // Of equals the first, which is the highest.
        let best = choices.reduce(|best, next| if next.0 > best.0 { next } else { best });
        best.map_or((rows, usual), |(_, height, scales)| (height, scales))
    }

    /// Axis and scale of each curve: curves of one unit share a scale.
    fn scales(&self, columns: &[Vec<Option<Span>>], intervals: usize) -> Vec<(Axis, Scale)> {
        let scale = |curve: &Curve| {
            let same = || self.curves.iter().zip(columns).filter(|(other, _)| other.axis() == curve.axis());
            let clipped = || same().filter(|(curve, _)| curve.clipped).filter_map(|(curve, _)| curve.fixed);
            let spans = same().flat_map(|(_, columns)| columns.iter().flatten()).map(|span| (span.min, span.max));
            let fixed = same().filter_map(|(curve, _)| curve.fixed);
            let resolution = same().map(|(curve, _)| curve.resolution).fold(f64::INFINITY, f64::min);
            let (data, fixed) = match clipped().reduce(widen) {
                Some(range) => (None, Some(range)),
                None => (spans.reduce(widen), fixed.reduce(widen)),
            };
            Scale::fit(data, fixed, resolution, intervals.clamp(1, 6))
        };
        self.axes().into_iter().zip(self.curves.iter().map(scale)).collect()
    }

    /// The axis of each curve. Units get the two axes in the order of the pens; what has no unit only if one is left.
    fn axes(&self) -> Vec<Axis> {
        let mut axes: Vec<(&str, Option<usize>)> = Vec::new();
        let (with, without): (Vec<_>, Vec<_>) =
            self.curves.iter().map(Curve::axis).partition(|axis| !axis.0.is_empty());
        for axis in with.into_iter().chain(without) {
            if !axes.contains(&axis) {
                axes.push(axis);
            }
        }
        let place = |curve: &Curve| axes.iter().position(|axis| *axis == curve.axis());
        let right = self.right.and_then(|n| place(self.curves.get(n)?)).filter(|place| *place > 0).unwrap_or(1);
        let axis = |curve: &Curve| match place(curve) {
            Some(0) => Axis::Left,
            Some(place) if place == right => Axis::Right,
            Some(_) | None => Axis::Own,
        };
        self.curves.iter().map(axis).collect()
    }

    /// The cell row of a value, counted from the top of the plot: the very cell that its dots are in.
    fn row(&self, scale: Scale, value: f64, height: u16) -> u16 {
        let down = raster(self.theme).dots().1;
        to_u16(dot_of(scale, value, usize::from(height) * down) / down)
    }

    /// The cell column of an instant, counted from the left of the plot.
    pub fn cell(&self, at: Timestamp, width: u16) -> Option<u16> {
        let (from, to) = (self.from.as_microsecond(), self.to.as_microsecond());
        let inside = (from..to).contains(&at.as_microsecond());
        let share = (at.as_microsecond() - from) as f64 / (to - from).max(1) as f64;
        (inside && width > 0).then(|| to_u16(share * f64::from(width)).min(width - 1))
    }
}

impl Widget for &Chart<'_> {
    fn render(self, area: Rect, buf: &mut Buffer) {
        let area = area.intersection(buf.area);
        if area.is_empty() {
            return;
        }
        let plan = self.plan(area);
        self.draw_grid(&plan, area, buf);
        self.draw_curves(&plan, buf);
        self.draw_marks(&plan, buf);
        self.draw_gaps(&plan, buf);
        self.draw_limits(&plan, buf);
        self.draw_axes(&plan, area, buf);
        self.draw_normal(&plan, area, buf);
        self.draw_cursors(&plan, area, buf);
    }
}

/// The row of dots of a value in a plot of so many rows of dots, from the top.
fn dot_of(scale: Scale, value: f64, rows: usize) -> usize {
    to_usize(((1.0 - scale.share(value)) * rows.saturating_sub(1) as f64).round())
}

fn widen(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// A length of time in a few letters: `40 s`, `12 min`, `3.5 h`, `2.0 d`.
pub fn span_text(span: Duration) -> String {
    let seconds = span.as_secs();
    match seconds {
        0..=99 => format!("{seconds} s"),
        100..=5_999 => t!("{seconds} min", seconds = (seconds + 30) / 60),
        6_000..=172_799 => format!("{:.1} h", span.as_secs_f64() / 3_600.0),
        _ => format!("{:.1} d", span.as_secs_f64() / 86_400.0),
    }
}

#[cfg(test)]
mod tests;
