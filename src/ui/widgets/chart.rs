//! Several curves over one time axis, drawn in cells: a spike is never lost, a gap is a gap, and every pen is known
//! without colour.

pub mod axis;
pub mod raster;
pub mod trace;

use std::time::Duration;

use jiff::{SignedDuration, Timestamp, tz::TimeZone};
use ratatui::{buffer::Buffer, layout::Rect, style::Style, text::Line, widgets::Widget};
use unicode_width::UnicodeWidthStr;

use self::{
    axis::{Scale, time_ticks},
    raster::{Canvas, Raster},
    trace::{Span, Trace},
};
use crate::{
    plant::number::{to_i32, to_u16, to_usize},
    ui::theme::{Glyphs, Theme},
};

/// Least width of the space for the labels of an axis, so that the picture does not jump with its data.
const GUTTER: usize = 6;
/// Pens carry their mark every so many cells.
const MARK_CELLS: i64 = 24;

/// What is drawn. Nothing appears before `from`, from `to` on or after `now`.
pub struct Chart<'a> {
    /// Looks.
    pub theme: &'a Theme,
    /// The plant's local time, for the labels.
    pub zone: &'a TimeZone,
    /// Left edge.
    pub from: Timestamp,
    /// Right edge, may lie after `now`.
    pub to: Timestamp,
    /// The present: the curves end here.
    pub now: Timestamp,
    /// The pens, most important first: the first wins where curves cross.
    pub curves: Vec<Curve<'a>>,
    /// A vertical line at an instant, and what to write above it.
    pub cursor: Option<(Timestamp, Line<'a>)>,
    /// Events on the time axis.
    pub marks: Vec<(Timestamp, Style)>,
}

/// One pen.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// Its data.
    pub trace: &'a Trace,
    /// Its number in the group: picks mark and colour, and stays the same when others are switched off.
    pub pen: usize,
    /// Curves of one unit share an axis.
    pub unit: &'a str,
    /// Fixed scale; `None` fits the data.
    pub fixed: Option<(f64, f64)>,
    /// The value of the last digit shown.
    pub resolution: f64,
    /// A broken line: what somebody has set, not what was measured.
    pub dashed: bool,
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

fn raster(theme: &Theme) -> Raster {
    match theme.glyphs {
        Glyphs::Braille => Raster::Braille,
        Glyphs::Block => Raster::Half,
        Glyphs::Ascii => Raster::Ascii,
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
        let (mut left, mut right) = (gutter(Axis::Left).max(1), gutter(Axis::Right));
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
            let same = || self.curves.iter().zip(columns).filter(|(other, _)| other.unit == curve.unit);
            let spans = same().flat_map(|(_, columns)| columns.iter().flatten()).map(|span| (span.min, span.max));
            let fixed = same().filter_map(|(curve, _)| curve.fixed);
            let resolution = same().map(|(curve, _)| curve.resolution).fold(f64::INFINITY, f64::min);
            Scale::fit(spans.reduce(widen), fixed.reduce(widen), resolution, intervals.clamp(1, 6))
        };
        self.axes().into_iter().zip(self.curves.iter().map(scale)).collect()
    }

    /// The axis of each curve. Units get the two axes in the order of the pens; what has no unit only if one is left.
    fn axes(&self) -> Vec<Axis> {
        let mut units: Vec<&str> = Vec::new();
        let (with, without): (Vec<_>, Vec<_>) = self.curves.iter().map(|curve| curve.unit).partition(|u| !u.is_empty());
        for unit in with.into_iter().chain(without) {
            if !units.contains(&unit) {
                units.push(unit);
            }
        }
        let axis = |curve: &Curve| match units.iter().position(|unit| *unit == curve.unit) {
            Some(0) => Axis::Left,
            Some(1) => Axis::Right,
            _ => Axis::Own,
        };
        self.curves.iter().map(axis).collect()
    }

    /// The cell row of a value, counted from the top of the plot: the very cell that its dots are in.
    fn row(&self, scale: Scale, value: f64, height: u16) -> u16 {
        let down = raster(self.theme).dots().1;
        to_u16(dot_of(scale, value, usize::from(height) * down) / down)
    }

    /// The cell column of an instant, counted from the left of the plot.
    fn cell(&self, at: Timestamp, width: u16) -> Option<u16> {
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
        self.draw_axes(&plan, area, buf);
        self.draw_cursor(&plan, area, buf);
    }
}

impl Chart<'_> {
    /// Faint points where round values meet round times, to lead the eye; not in ASCII, where a point is a value.
    fn draw_grid(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let Some((_, scale)) = plan.scales.iter().find(|(axis, _)| *axis == Axis::Left) else { return };
        if self.theme.glyphs == Glyphs::Ascii || plan.plot.height == area.height {
            return;
        }
        for (at, _) in self.time_labels(plan) {
            let Some(x) = self.cell(at, plan.plot.width) else { continue };
            for tick in scale.ticks() {
                let y = self.row(*scale, tick, plan.plot.height);
                buf[(plan.plot.x + x, plan.plot.y + y)].set_symbol("·").set_style(self.theme.dim());
            }
        }
    }

    fn draw_curves(&self, plan: &Plan, buf: &mut Buffer) {
        let plot = plan.plot;
        let mut canvas = Canvas::new(raster(self.theme), plot.width.into(), plot.height.into());
        let (_, height) = canvas.size();
        for (n, curve) in self.curves.iter().enumerate().rev() {
            let scale = plan.scales[n].1;
            let row = |value: f64| dot_of(scale, value, height);
            let mut before: Option<Span> = None;
            for (x, span) in plan.columns[n].iter().enumerate() {
                if let Some(span) = span {
                    let from = before.map_or(span.last, |before| before.last);
                    let (low, high) = (span.min.min(from), span.max.max(from));
                    if !curve.dashed || row(low) != row(high) || x % 4 < 2 {
                        canvas.bar(x, row(high), row(low), n);
                    }
                }
                before = *span;
            }
        }
        for (x, y, glyph, owner) in canvas.glyphs() {
            let cell = &mut buf[(plot.x + to_u16(x), plot.y + to_u16(y))];
            cell.set_char(glyph).set_style(self.theme.pen(self.curves[owner].pen));
        }
    }

    /// The mark of each pen: at the end of its curve, and at regular times so that it travels with the curve.
    fn draw_marks(&self, plan: &Plan, buf: &mut Buffer) {
        let (plot, dots) = (plan.plot, raster(self.theme).dots().0);
        let mut taken: Vec<(u16, u16)> = Vec::new();
        let count = self.curves.len() as i64;
        let cell_width = (self.to.as_microsecond() - self.from.as_microsecond()) / i64::from(plot.width.max(1));
        let first = self.from.as_microsecond().div_euclid(cell_width.max(1));
        for (n, curve) in self.curves.iter().enumerate() {
            let place = |x: u16| {
                let cell = &plan.columns[n][usize::from(x) * dots..(usize::from(x) + 1) * dots];
                let last = cell.iter().rev().flatten().next()?.last;
                Some((x, self.row(plan.scales[n].1, last, plot.height)))
            };
            let mut put = |(x, y): (u16, u16)| {
                let free = !taken.contains(&(x, y));
                if free {
                    taken.push((x, y));
                    let cell = &mut buf[(plot.x + x, plot.y + y)];
                    cell.set_symbol(mark(self.theme, curve.pen)).set_style(self.theme.pen(curve.pen));
                }
                free
            };
            // Where two curves end in one place, the second mark stands a little before.
            (0..plot.width).rev().filter_map(place).take(8).any(&mut put);
            let phase = MARK_CELLS * n as i64 / count;
            let due = |x: &u16| count > 1 && (first + i64::from(*x)).rem_euclid(MARK_CELLS) == phase;
            (0..plot.width.saturating_sub(8)).filter(due).filter_map(place).for_each(|at| {
                put(at);
            });
        }
    }

    /// Says how long there is no value of any pen, where there is room to say it. Time that was not read yet is left
    /// blank: nothing is known of it.
    fn draw_gaps(&self, plan: &Plan, buf: &mut Buffer) {
        let (plot, across) = (plan.plot, raster(self.theme).dots().0);
        let count = usize::from(plot.width) * across;
        let past = self.cell(self.now, plot.width).map_or(count, |x| usize::from(x) * across);
        let known = |x: &usize| plan.columns.iter().any(|columns| columns[*x].is_some());
        let span = Duration::try_from(self.to.duration_since(self.from)).unwrap_or_default();
        let was_read = |x: usize| {
            let at = self
                .from
                .checked_add(SignedDuration::try_from(span.mul_f64(x as f64 / count as f64)).unwrap_or_default());
            at.is_ok_and(|at| self.curves.iter().any(|curve| curve.trace.covers(at)))
        };
        let mut x = 0;
        while x < past && !plan.columns.is_empty() {
            let end = (x..past).find(known).unwrap_or(past);
            let (first, last) = (to_u16(x.div_ceil(across)), to_u16(end / across));
            let length = span_text(span.mul_f64((end - x) as f64 / count as f64));
            let texts = [format!("no data {length}"), format!("gap {length}"), length];
            let fits = |text: &String| first + to_u16(text.width()) + 2 <= last;
            if let Some(text) = texts.into_iter().find(fits).filter(|_| was_read(x + (end - x) / 2)) {
                let start = plot.x + first + (last - first - to_u16(text.width())) / 2;
                buf.set_string(start, plot.y + plot.height / 2, text, self.theme.dim());
            }
            x = end + 1;
        }
    }

    fn draw_axes(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let (plot, style) = (plan.plot, self.theme.dim());
        if plot.height == area.height {
            return;
        }
        let (right, below) = (plot.right(), plot.bottom());
        let line = |unicode, ascii| self.theme.pick(unicode, ascii);
        let own = |wanted: Axis| self.curves.iter().zip(&plan.scales).find(move |(_, (axis, _))| *axis == wanted);
        if plot.x > area.x {
            for y in plot.y..below {
                buf[(plot.x - 1, y)].set_symbol(line("│", "|")).set_style(style);
            }
            buf[(plot.x - 1, below)].set_symbol(line("└", "+")).set_style(style);
        }
        if let Some((curve, (_, scale))) = own(Axis::Left).filter(|_| plot.x > area.x) {
            let width = usize::from(plot.x - area.x - 1);
            buf.set_stringn(area.x, area.y, format!("{:>width$}", curve.unit), plot.width.into(), style);
            for tick in scale.ticks() {
                let y = plot.y + self.row(*scale, tick, plot.height);
                buf.set_string(area.x, y, format!("{:>width$}{}", scale.label(tick), line("┤", "+")), style);
            }
        }
        if let Some((curve, (_, scale))) = own(Axis::Right).filter(|_| area.right() > right) {
            for y in plot.y..below {
                buf[(right, y)].set_symbol(line("│", "|")).set_style(style);
            }
            buf.set_stringn(right + 1, area.y, curve.unit, usize::from(area.right() - right - 1), style);
            buf[(right, below)].set_symbol(line("┘", "+")).set_style(style);
            for tick in scale.ticks() {
                let y = plot.y + self.row(*scale, tick, plot.height);
                buf.set_string(right, y, format!("{}{}", line("├", "+"), scale.label(tick)), style);
            }
        }
        for x in plot.x..right {
            buf[(x, below)].set_symbol(line("─", "-")).set_style(style);
        }
        self.draw_time(plan, area, buf);
    }

    /// Ticks, labels and events of the time axis. A label is drawn whole or not at all.
    fn draw_time(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let (plot, style) = (plan.plot, self.theme.dim());
        let mut free = area.x;
        for (at, label) in self.time_labels(plan) {
            let Some(x) = self.cell(at, plot.width) else { continue };
            buf[(plot.x + x, plot.bottom())].set_symbol(self.theme.pick("┴", "+"));
            let width = to_u16(label.width());
            let start = (plot.x + x).saturating_sub(width / 2).min(area.right().saturating_sub(width)).max(area.x);
            if start >= free && start + width <= area.right() {
                buf.set_string(start, plot.bottom() + 1, &label, style);
                free = start + width + 1;
            }
        }
        for (at, style) in &self.marks {
            if let Some(x) = self.cell(*at, plot.width) {
                buf[(plot.x + x, plot.bottom())].set_symbol("!").set_style(*style);
            }
        }
    }

    fn time_labels(&self, plan: &Plan) -> Vec<(Timestamp, String)> {
        let seconds = self.to.as_second() - self.from.as_second();
        let cells_min = if seconds < 8 * 60 { 12 } else { 8 };
        time_ticks(self.from, self.to, self.zone, plan.plot.width.into(), cells_min)
    }

    /// A line through the empty cells of its column, and the words above it, on whichever side there is room.
    fn draw_cursor(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let plot = plan.plot;
        let Some((at, words)) = &self.cursor else { return };
        let Some(x) = self.cell(*at, plot.width).map(|x| plot.x + x) else { return };
        let (line, foot) = match self.theme.glyphs {
            Glyphs::Braille => ("┊", "┷"),
            Glyphs::Block => ("│", "┴"),
            Glyphs::Ascii => (":", "^"),
        };
        for y in plot.y..plot.bottom() {
            let cell = &mut buf[(x, y)];
            if matches!(cell.symbol(), " " | "·") {
                cell.set_symbol(line).set_style(self.theme.normal());
            } else {
                cell.set_style(self.theme.focus());
            }
        }
        if plot.y > area.y {
            buf[(x, plot.bottom())].set_symbol(foot).set_style(self.theme.normal());
            let width = to_u16(words.width()).min(plot.width);
            let end = plot.right().saturating_sub(2).max(plot.x + width);
            let start = x.saturating_sub(width / 2).clamp(plot.x, end - width);
            buf.set_line(start, area.y, words, width);
        }
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
        100..=5_999 => format!("{} min", (seconds + 30) / 60),
        6_000..=172_799 => format!("{:.1} h", span.as_secs_f64() / 3_600.0),
        _ => format!("{:.1} d", span.as_secs_f64() / 86_400.0),
    }
}

#[cfg(test)]
mod tests;
