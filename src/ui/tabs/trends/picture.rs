//! The chart as a page to print, or as the terminal's own picture: what is on the screen, in pixels.

mod limits;

use ratatui::layout::Rect;

use unicode_width::UnicodeWidthStr;

use super::{
    events::EventKind,
    lanes::runs,
    view::{self, NO_TRACE, axis, number, share},
    *,
};
use crate::{
    plant::number::to_f32,
    report::drawing::{Anchor, CELL, Drawing, Ink, Rgb, TEXT},
    ui::{
        graphics::Picture,
        screen_dump::{GROUND, INK, rgb},
        widgets::chart::{
            Axis, Chart,
            axis::{Scale, time_ticks},
            mark,
            stroke::straight,
            trace::Span,
        },
    },
};

const PAGE: (u16, u16) = (1_280, 800);
/// The plot on it: left, top and right.
const PLOT: (f32, f32, f32) = (80.0, 64.0, 1_200.0);

/// Places on the page.
struct Frame {
    from: Timestamp,
    to: Timestamp,
    left: f32,
    top: f32,
    right: f32,
    bottom: f32,
    /// Height and width of a letter.
    text: (f32, f32),
    /// The units stand so much above the plot.
    unit: f32,
    /// Labels of time have so many letters from the left to the right.
    letters: usize,
}

impl Frame {
    fn x(&self, at: Timestamp) -> f32 {
        let share = at.duration_since(self.from).as_secs_f64() / self.to.duration_since(self.from).as_secs_f64();
        self.share(to_f32(share.clamp(0.0, 1.0)))
    }

    /// A share of the way from the left to the right.
    fn share(&self, share: f32) -> f32 {
        self.left + (self.right - self.left) * share
    }

    /// The n-th of so many columns.
    fn column(&self, n: usize, count: usize) -> f32 {
        self.share(n as f32 / count.max(1) as f32)
    }

    /// A line so many times as thick as a thin one.
    fn thick(&self, times: f32) -> f32 {
        times * self.text.0 / TEXT.0
    }

    fn y(&self, scale: Scale, value: f64) -> f32 {
        self.bottom - (self.bottom - self.top) * to_f32(scale.share(value))
    }
}

/// Draws the curves, lanes, events, cursors and figures of the view.
pub(super) fn picture(trends: &Trends, cx: &ViewContext) -> Drawing {
    let mut page = Drawing::new(PAGE.0, PAGE.1);
    let (view, chart) = (trends.span(cx), view::chart(trends, cx, false));
    let (lanes, pens) = (trends.lanes(cx), trends.drawn(cx));
    let rows = (lanes.len() + pens.len() + 4) as f32;
    let frame = Frame {
        from: view.from,
        to: view.to,
        left: PLOT.0,
        top: PLOT.1,
        right: PLOT.2,
        bottom: f32::from(PAGE.1) - rows * (TEXT.0 + 2.0),
        text: TEXT,
        unit: 18.0,
        letters: 140,
    };
    let head = format!(
        "{}   {}   {} – {}",
        cx.def().name,
        trends.name(cx),
        cx.local(view.from, "%Y-%m-%d %H:%M:%S"),
        cx.local(view.to, "%Y-%m-%d %H:%M:%S %:z")
    );
    page.text((PLOT.0, 20.0), Anchor::Start, head, Ink::Text);
    let scales = chart.plan(Rect::new(0, 0, 120, 40)).scales;
    plot(&mut page, (trends, cx), &chart, &scales, &frame);
    let mut y = frame.bottom + 2.2 * TEXT.0;
    for (n, pen) in lanes {
        lane(&mut page, trends, cx, (n, pen), y, &frame);
        y += TEXT.0 + 2.0;
    }
    for mark in trends.marks(cx) {
        let ink = if mark.kind == EventKind::Alarm { Ink::Pen(1) } else { Ink::Text };
        page.text((frame.x(mark.at), y), Anchor::Middle, mark.kind.symbol(), ink);
    }
    y += TEXT.0 + 8.0;
    for pen in pens {
        let own = chart.curves.iter().zip(&scales).find(|(curve, (axis, _))| curve.pen == pen.0 && *axis == Axis::Own);
        legend(&mut page, trends, cx, pen, own.map(|(_, (_, scale))| *scale), y);
        y += TEXT.0 + 2.0;
    }
    page
}

/// The picture of the chart in place of its cells, in the colours of the theme; `None` while something else is shown, or
/// where the terminal takes no picture.
pub(super) fn on_screen(trends: &Trends, cx: &ViewContext) -> Option<Picture> {
    let (protocol, (wide, high)) = cx.theme.graphics.protocol(cx.preferences.pictures).ok()?;
    let (columns_max, rows_max) = cx.theme.graphics.cells_max(protocol, (wide, high));
    let (chart, area) = view::placed_chart(trends, cx)?;
    let area = Rect { width: area.width.min(columns_max), height: area.height.min(rows_max), ..area };
    if area.is_empty() {
        return None;
    }
    let (plan, view) = (chart.plan(area), trends.span(cx));
    let x = |column: u16| f32::from(column.saturating_sub(area.x)) * f32::from(wide);
    let y = |row: u16| f32::from(row.saturating_sub(area.y)) * f32::from(high);
    let frame = Frame {
        from: view.from,
        to: view.to,
        left: x(plan.plot.x),
        // The greatest value lies in the middle of its row, as among the cells.
        top: y(plan.plot.y) + f32::from(high) / 2.0,
        right: x(plan.plot.right()),
        bottom: y(plan.plot.bottom()),
        text: (f32::from(high), f32::from(wide)),
        unit: f32::from(high),
        letters: plan.plot.width.into(),
    };
    let ground = cx.theme.ground().and_then(rgb).unwrap_or(GROUND);
    let mut page = Drawing::on(area.width * wide, area.height * high, ground, f32::from(wide) / CELL);
    plot(&mut page, (trends, cx), &chart, &plan.scales, &frame);
    ends(&mut page, cx, &chart, &plan.scales, &frame);
    let of = |style: Style| style.fg.and_then(rgb).unwrap_or(INK);
    let drawing = page.recoloured(|ink| match ink {
        Ink::Text => of(cx.theme.normal()),
        Ink::Grid => between(ground, of(cx.theme.dim())),
        Ink::Pen(n) => of(cx.theme.pen(n)),
        Ink::Own(own) => own,
    });
    Some(Picture { protocol, area, drawing })
}

/// A quarter of the way from one colour to the other.
fn between(Rgb(r, g, b): Rgb, to: Rgb) -> Rgb {
    let mix = |a: u8, b: u8| u8::midpoint(a, u8::midpoint(a, b));
    Rgb(mix(r, to.0), mix(g, to.1), mix(b, to.2))
}

/// Axes, curves and cursors.
fn plot(
    page: &mut Drawing,
    (trends, cx): (&Trends, &ViewContext),
    chart: &Chart,
    scales: &[(Axis, Scale)],
    frame: &Frame,
) {
    axes(page, cx, chart, scales, frame);
    // As many as on the screen: finer ones would only smear those of the history.
    let count = trends.span(cx).columns;
    let half = frame.text.0 / 2.0;
    for (curve, (_, scale)) in chart.curves.iter().zip(scales) {
        let columns = curve.trace.columns(frame.from, frame.to, cx.present(), count);
        let ink = Ink::Pen(curve.pen);
        for points in paths(&inside(&columns, *scale), curve.stroke, frame, |value| frame.y(*scale, value)) {
            page.line(points, ink, frame.thick(1.5), curve.dashed);
        }
        for (n, sign, y) in outside(&columns, *scale) {
            let y = frame.y(*scale, y) + if sign == "^" { half } else { -half };
            page.text((frame.column(n, columns.len()), y), Anchor::Start, sign, ink);
        }
    }
    for (at, words) in &chart_cursors(trends, cx) {
        page.line(vec![(frame.x(*at), frame.top), (frame.x(*at), frame.bottom)], Ink::Text, frame.thick(1.0), true);
        page.text((frame.x(*at), frame.top - half), Anchor::Middle, words.as_str(), Ink::Text);
    }
}

/// The mark of each pen at the end of its curve: colour alone tells nothing.
fn ends(page: &mut Drawing, cx: &ViewContext, chart: &Chart, scales: &[(Axis, Scale)], frame: &Frame) {
    let count = frame.letters.max(1);
    for (curve, (_, scale)) in chart.curves.iter().zip(scales) {
        let columns = curve.trace.columns(frame.from, frame.to, cx.present(), count);
        let last = columns.iter().enumerate().rev().find_map(|(n, span)| Some((n, (*span)?.last)));
        if let Some((n, value)) = last.filter(|(_, value)| (scale.low..=scale.high).contains(value)) {
            let at = (frame.column(n, count), frame.y(*scale, value));
            page.text(at, Anchor::Start, mark(cx.theme, curve.pen), Ink::Pen(curve.pen));
        }
    }
}

/// The cursors with their times.
fn chart_cursors(trends: &Trends, cx: &ViewContext) -> Vec<(Timestamp, String)> {
    let word = |letter: &str, at| (at, format!("{letter} {}", clock(at, &cx.def().time_zone)));
    match trends.both() {
        Some((a, b)) => vec![word("A", a), word("B", b)],
        None => trends.cursor(cx).map(|at| word("A", at)).into_iter().collect(),
    }
}

/// Frame, grid, ticks and units.
fn axes(page: &mut Drawing, cx: &ViewContext, chart: &Chart, scales: &[(Axis, Scale)], frame: &Frame) {
    let Frame { left, top, right, bottom, .. } = *frame;
    let thin = frame.thick(1.0);
    let corners = [(left, top), (left, bottom), (right, bottom), (right, top)];
    for (at, label) in time_ticks(frame.from, frame.to, &cx.def().time_zone, frame.letters, 12) {
        page.line(vec![(frame.x(at), top), (frame.x(at), bottom + 4.0)], Ink::Grid, thin, false);
        // A label at an end must not stand beyond it.
        let half = label.width() as f32 * frame.text.1 / 2.0;
        let x = frame.x(at).min(f32::from(page.size().0) - half);
        page.text((x, bottom + frame.text.0), Anchor::Middle, label, Ink::Text);
    }
    let sides = [(Axis::Left, left - 6.0, Anchor::End), (Axis::Right, right + 6.0, Anchor::Start)];
    for (side, x, anchor) in sides {
        let first = chart.curves.iter().zip(scales).find(|(_, (axis, _))| *axis == side);
        let Some((curve, (_, scale))) = first else { continue };
        page.text((x, top - frame.unit), anchor, curve.unit, Ink::Text);
        for tick in scale.ticks() {
            let y = frame.y(*scale, tick);
            if side == Axis::Left {
                page.line(vec![(left, y), (right, y)], Ink::Grid, thin, false);
            }
            page.text((x, y), anchor, scale.label(tick), Ink::Text);
        }
    }
    page.line(corners.to_vec(), Ink::Text, thin, false);
    limits::draw(page, cx, chart, scales, frame);
}

/// The columns that lie on the scale, at least in part: a value beyond it is not drawn at its end.
fn inside(columns: &[Option<Span>], scale: Scale) -> Vec<Option<Span>> {
    columns.iter().map(|span| span.filter(|span| scale.low <= span.max && span.min <= scale.high)).collect()
}

/// Where a curve leaves its scale: the first column of each stretch, the sign that says so, and the end of the scale.
fn outside(columns: &[Option<Span>], scale: Scale) -> Vec<(usize, &'static str, f64)> {
    let sign = |span: &Option<Span>| match span {
        Some(span) if span.min > scale.high => Some(("^", scale.high)),
        Some(span) if span.max < scale.low => Some(("v", scale.low)),
        Some(_) | None => None,
    };
    let mut before = None;
    let mut found = Vec::new();
    for (n, now) in columns.iter().map(sign).enumerate() {
        found.extend(now.filter(|_| now != before).map(|(sign, end)| (n, sign, end)));
        before = now;
    }
    found
}

/// The lines of a curve, a column of pixels each: from the value that held to the least, the greatest and the last, or as
/// the look of the pen has it. A gap ends a line.
fn paths(columns: &[Option<Span>], stroke: Stroke, frame: &Frame, y: impl Fn(f64) -> f32) -> Vec<Vec<(f32, f32)>> {
    let width = (frame.right - frame.left) / columns.len().max(1) as f32;
    let place = |n: usize| frame.column(n, columns.len());
    let known = || columns.iter().enumerate().filter_map(|(n, span)| Some((place(n), (*span)?)));
    match stroke {
        Stroke::Step => steps(columns, width, place, y),
        Stroke::Line => {
            let lines = straight(columns);
            let point = |(n, span): (usize, &Option<Span>)| span.map(|span| (place(n) + width / 2.0, y(span.last)));
            let points: Vec<_> = lines.iter().enumerate().map(point).collect();
            points.split(Option::is_none).map(|line| line.iter().flatten().copied().collect()).collect()
        }
        Stroke::Dots => known().map(|(x, span)| vec![(x, y(span.last)), (x + width.min(2.0), y(span.last))]).collect(),
        Stroke::Bars => {
            let far = |span: Span| if span.max.abs() < span.min.abs() { span.min } else { span.max };
            known().map(|(x, span)| vec![(x + width / 2.0, y(0.0)), (x + width / 2.0, y(far(span)))]).collect()
        }
    }
}

/// The lines of [`Stroke::Step`].
fn steps(
    columns: &[Option<Span>],
    width: f32,
    place: impl Fn(usize) -> f32,
    y: impl Fn(f64) -> f32,
) -> Vec<Vec<(f32, f32)>> {
    let mut paths: Vec<Vec<(f32, f32)>> = vec![Vec::new()];
    for (n, span) in columns.iter().enumerate() {
        let (x, path) = (place(n), paths.last_mut());
        match (span, path) {
            (Some(span), Some(path)) => {
                let spike = if span.min == span.max { vec![span.last] } else { vec![span.min, span.max, span.last] };
                path.extend(path.last().map(|(_, held)| (x, *held)));
                path.extend(spike.into_iter().map(|value| (x, y(value))));
                path.push((x + width, y(span.last)));
            }
            (None, Some(path)) if path.is_empty() => {}
            (None, _) | (Some(_), None) => paths.push(Vec::new()),
        }
    }
    paths
}

/// A lane of states: a line where it is not 0, and its names.
fn lane(page: &mut Drawing, trends: &Trends, cx: &ViewContext, (n, pen): (usize, Pen), y: f32, frame: &Frame) {
    let count = usize::from(PAGE.0);
    let width = (PLOT.2 - PLOT.0) / count as f32;
    page.text((PLOT.0 - 6.0, y), Anchor::End, cx.def().tag(pen.tag).short.as_str(), Ink::Pen(n));
    let trace = trends.traces.get(&pen.tag).unwrap_or(&NO_TRACE);
    for run in runs(&trace.columns(frame.from, frame.to, cx.present(), count)) {
        let (from, to) = (PLOT.0 + width * run.first as f32, PLOT.0 + width * (run.first + run.cells) as f32);
        let Some(state) = run.state else {
            page.line(vec![(from, y - 6.0), (from, y + 6.0)], Ink::Pen(n), 1.0, false);
            continue;
        };
        let (ink, thick) = if state == 0.0 { (Ink::Grid, 1.0) } else { (Ink::Pen(n), 3.0) };
        page.line(vec![(from, y + 6.0), (to, y + 6.0)], ink, thick, false);
        let label = cx.snapshot.format(pen.tag, state);
        if (label.chars().count() as f32 + 1.0) * TEXT.1 < to - from {
            page.text((from + 3.0, y - 2.0), Anchor::Start, label, Ink::Text);
        }
    }
}

/// Name, label, unit and figures of a pen, and the scale that no axis shows.
fn legend(page: &mut Drawing, trends: &Trends, cx: &ViewContext, (n, pen): (usize, Pen), own: Option<Scale>, y: f32) {
    let def = cx.def().tag(pen.tag);
    let own = own.map(|scale| t!("   scale {low} – {high}", low = number(scale.low), high = number(scale.high)));
    page.line(vec![(PLOT.0, y), (PLOT.0 + 24.0, y)], Ink::Pen(n), 3.0, false);
    let figures = trends.figures.get(&pen.tag).filter(|_| !lanes::is_state(def)).map(|(summary, good)| {
        let value = |value: Exact| cx.snapshot.format(pen.tag, value);
        let values = summary.map(|(min, mean, max)| {
            t!("min {min}  mean {mean}  max {max}", min = value(min), mean = value(mean), max = value(max))
        });
        format!("{}  {}", values.unwrap_or_default(), t!("good {share}", share = share(*good)))
    });
    let text = format!(
        "{:<18} {:<10} {}   {}",
        def.name,
        axis(trends, cx, pen.tag),
        of_plant(&def.label),
        figures.unwrap_or_default()
    );
    let text = text + &own.unwrap_or_default();
    page.text((PLOT.0 + 32.0, y), Anchor::Start, text, Ink::Text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_ends_at_a_gap() {
        let at = |value: f64| Some(Span { min: value, max: value, last: value });
        let columns = [at(1.0), at(2.0), None, None, at(3.0)];
        let (from, to) = (Timestamp::UNIX_EPOCH, Timestamp::MAX);
        let (left, top, right, bottom) = (0.0, 0.0, 50.0, 10.0);
        let frame = Frame { from, to, left, top, right, bottom, text: TEXT, unit: 0.0, letters: 5 };
        let check = |stroke, expect: &[usize]| {
            let paths = paths(&columns, stroke, &frame, to_f32);
            let ends: Vec<usize> = paths.iter().map(Vec::len).filter(|len| *len > 0).collect();
            assert_eq!(ends, expect, "{stroke:?}");
        };
        check(Stroke::Step, &[5, 2]);
        check(Stroke::Line, &[2, 1]);
        check(Stroke::Dots, &[2, 2, 2]);
        check(Stroke::Bars, &[2, 2, 2]);
    }

    #[test]
    fn a_curve_outside_its_scale_is_not_drawn_at_its_end() {
        let at = |value: f64| Some(Span { min: value, max: value, last: value });
        let columns = [at(1.0), at(5.0), at(6.0), None, at(-3.0), at(2.0)];
        let scale = Scale { low: 0.0, high: 2.0, step: 1.0 };
        assert_eq!(inside(&columns, scale), [at(1.0), None, None, None, None, at(2.0)]);
        assert_eq!(outside(&columns, scale), [(1, "^", 2.0), (4, "v", 0.0)]);
    }
}
