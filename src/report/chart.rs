//! The curves of a report: one panel for each unit, a common time axis, gaps left open; pure.

use jiff::{Timestamp, tz::TimeZone};
use serde::{Deserialize, Serialize};

use super::{
    curve::Bucket,
    drawing::{Anchor, Drawing, Ink, TEXT},
};
use crate::plant::{
    exact::digits,
    number::{to_f32, to_u8, to_u16, to_usize},
};

/// Curves over one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Its name: that of the group of pens.
    pub title: String,
    /// Where its time axis begins.
    pub from: Timestamp,
    /// Where it ends.
    pub to: Timestamp,
    /// Its curves.
    pub curves: Vec<ChartCurve>,
}

/// A curve of a chart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChartCurve {
    /// Its tag.
    pub name: String,
    /// Its unit; curves of one unit share a panel.
    pub unit: String,
    /// Decimals of its values.
    pub decimals: u8,
    /// When its first column begins.
    pub from: Timestamp,
    /// Width of a column in seconds.
    pub step: f64,
    /// Its columns; `None` where there was no good value.
    pub columns: Vec<Option<Bucket>>,
}

/// Height of a panel, and of the texts above and below all of them, in pixels.
const PANEL: f32 = 150.0;
/// Left and right edge of the plots.
const EDGES: (f32, f32) = (64.0, 8.0);

impl ChartCurve {
    /// Its columns with the begin of each, in seconds after `from`.
    fn points(&self, from: Timestamp) -> impl Iterator<Item = Option<(f64, Bucket)>> {
        let first = self.from.duration_since(from).as_secs_f64();
        self.columns.iter().enumerate().map(move |(n, bucket)| Some((first + self.step * n as f64, (*bucket)?)))
    }
}

/// Curves of one unit, with the scale that holds them.
struct Panel<'a> {
    unit: &'a str,
    decimals: u8,
    low: f64,
    high: f64,
    /// Between two ticks.
    step: f64,
    curves: Vec<(usize, &'a ChartCurve)>,
}

impl Panel<'_> {
    /// Widens the scale to whole steps; a constant stands inside of them.
    fn round(&mut self) {
        let least = 10f64.powi(-i32::from(self.decimals));
        let raw = ((self.high - self.low) / 4.0).max(least);
        let power = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|of| of * power).find(|step| raw <= *step).unwrap_or(raw);
        if self.low == self.high {
            (self.low, self.high) = (self.low - step, self.high + step);
        }
        (self.low, self.high) = ((self.low / step).floor() * step, (self.high / step).ceil() * step);
        self.step = step;
    }

    /// Its ticks, with the decimals that they need.
    fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let decimals = to_u8((-self.step.log10().floor()).max(0.0));
        let count = to_usize(((self.high - self.low) / self.step).round());
        (0..=count).map(move |n| {
            let value = self.low + self.step * n as f64;
            (value, digits(value, Some(decimals)))
        })
    }
}

impl Chart {
    /// Has any curve a value?
    pub fn is_empty(&self) -> bool {
        self.curves.iter().all(|curve| curve.columns.iter().all(Option::is_none))
    }

    /// Draws the panels over each other.
    pub fn drawing(&self, zone: &TimeZone, width: u16) -> Drawing {
        let panels = self.panels();
        let head = TEXT.0 * 1.5;
        let height = head + panels.len() as f32 * (PANEL + TEXT.0 * 1.5) + TEXT.0 * 1.5;
        let mut page = Drawing::new(width, to_u16(height));
        page.text((0.0, TEXT.0 / 2.0), Anchor::Start, self.title.as_str(), Ink::Text);
        for (n, panel) in panels.iter().enumerate() {
            let top = head + n as f32 * (PANEL + TEXT.0 * 1.5) + TEXT.0;
            self.panel(&mut page, panel, (top, top + PANEL - TEXT.0), f32::from(width), zone, n + 1 == panels.len());
        }
        page
    }

    fn panels(&self) -> Vec<Panel<'_>> {
        let mut panels: Vec<Panel> = Vec::new();
        for (n, curve) in self.curves.iter().enumerate() {
            let values = curve.columns.iter().flatten();
            let (low, high) =
                values.fold((f64::MAX, f64::MIN), |(low, high), bucket| (low.min(bucket.min), high.max(bucket.max)));
            if high < low {
                continue;
            }
            match panels.iter_mut().find(|panel| panel.unit == curve.unit) {
                Some(panel) => {
                    (panel.low, panel.high) = (panel.low.min(low), panel.high.max(high));
                    panel.decimals = panel.decimals.max(curve.decimals);
                    panel.curves.push((n, curve));
                }
                None => panels.push(Panel {
                    unit: &curve.unit,
                    decimals: curve.decimals,
                    low,
                    high,
                    step: 1.0,
                    curves: vec![(n, curve)],
                }),
            }
        }
        panels.iter_mut().for_each(Panel::round);
        panels
    }

    fn panel(
        &self,
        page: &mut Drawing,
        panel: &Panel,
        (top, bottom): (f32, f32),
        width: f32,
        zone: &TimeZone,
        last: bool,
    ) {
        let (left, right) = (EDGES.0, width - EDGES.1);
        let span = self.to.duration_since(self.from).as_secs_f64().max(1.0);
        let x = |seconds: f64| left + (right - left) * to_f32((seconds / span).clamp(0.0, 1.0));
        let y = |value: f64| bottom - (bottom - top) * to_f32((value - panel.low) / (panel.high - panel.low));
        for (value, label) in panel.ticks() {
            page.line(vec![(left, y(value)), (right, y(value))], Ink::Grid, 1.0, false);
            page.text((left - 4.0, y(value)), Anchor::End, label, Ink::Text);
        }
        for at in self.ticks(zone) {
            let at_x = x(at.duration_since(self.from).as_secs_f64());
            page.line(vec![(at_x, top), (at_x, bottom)], Ink::Grid, 1.0, false);
            if last {
                let label = at.to_zoned(zone.clone()).strftime(self.tick_form()).to_string();
                page.text((at_x, bottom + TEXT.0 * 0.7), Anchor::Middle, label, Ink::Text);
            }
        }
        let mut at = left;
        page.text((left - 4.0, top - TEXT.0 * 0.9), Anchor::End, panel.unit, Ink::Text);
        for (n, curve) in &panel.curves {
            page.line(vec![(at, top - TEXT.0 * 0.6), (at + 16.0, top - TEXT.0 * 0.6)], Ink::Pen(*n), 2.0, false);
            page.text((at + 20.0, top - TEXT.0 * 0.6), Anchor::Start, curve.name.as_str(), Ink::Text);
            at += 36.0 + curve.name.chars().count() as f32 * TEXT.1;
            for path in paths(curve, self.from, x, y) {
                page.line(path, Ink::Pen(*n), 1.2, false);
            }
        }
    }

    /// Full hours, or full days, of local time: at most twelve.
    fn ticks(&self, zone: &TimeZone) -> Vec<Timestamp> {
        let hours = self.to.duration_since(self.from).as_secs_f64() / 3_600.0;
        let steps = [0.25, 0.5, 1.0, 2.0, 3.0, 6.0, 12.0, 24.0, 48.0, 168.0, 720.0];
        let step = steps.into_iter().find(|step| hours / step <= 12.0).unwrap_or(8_760.0);
        let every = std::time::Duration::from_secs_f64(step.min(24.0) * 3_600.0);
        let grid = super::figures::record_grid(every, zone, self.from, self.to);
        let thin = grid.len().div_ceil(12).max(1);
        grid.into_iter().step_by(thin).collect()
    }

    fn tick_form(&self) -> &'static str {
        if self.to.duration_since(self.from).as_hours() <= 36 { "%H:%M" } else { "%m-%d" }
    }
}

/// The lines of a curve: through the mean of each column, with its least and greatest value. A gap ends a line.
fn paths(curve: &ChartCurve, from: Timestamp, x: impl Fn(f64) -> f32, y: impl Fn(f64) -> f32) -> Vec<Vec<(f32, f32)>> {
    let mut paths = vec![Vec::new()];
    for point in curve.points(from) {
        match (point, paths.last_mut()) {
            (Some((at, bucket)), Some(path)) => {
                let here = x(at);
                if bucket.min < bucket.max {
                    path.extend([(here, y(bucket.min)), (here, y(bucket.max))]);
                }
                path.push((here, y(bucket.last.near())));
                path.push((x(at + curve.step), y(bucket.last.near())));
            }
            (None, Some(path)) if path.is_empty() => {}
            (None, _) | (Some(_), None) => paths.push(Vec::new()),
        }
    }
    paths.retain(|path| path.len() > 1);
    paths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{at, zone};

    fn curve(name: &str, unit: &str, values: &[Option<f64>]) -> ChartCurve {
        let bucket = |value: f64| Bucket { min: value, max: value, mean: value, last: value.into() };
        let columns = values.iter().map(|value| value.map(bucket)).collect();
        let from = at("2026-11-21T06:00+07");
        ChartCurve { name: name.into(), unit: unit.into(), decimals: 1, from, step: 3_600.0, columns }
    }

    #[test]
    fn times_up_to_36_hours_and_dates_beyond_are_written() {
        let from = at("2026-11-21T06:00+07");
        for (hours, form) in [(1, "%H:%M"), (36, "%H:%M"), (37, "%m-%d")] {
            let to = from + jiff::SignedDuration::from_hours(hours);
            let chart = Chart { title: "TIC-1".into(), from, to, curves: Vec::new() };
            assert_eq!(chart.tick_form(), form, "{hours} h");
        }
    }

    #[test]
    fn curves_of_one_unit_share_a_panel_and_a_gap_stays_open() {
        let (from, to) = (at("2026-11-21T06:00+07"), at("2026-11-21T14:00+07"));
        let values = [Some(20.0), Some(21.0), None, Some(25.0)];
        let curves = vec![curve("TIC-1.PV", "°C", &values), curve("TIC-1.SV", "°C", &[Some(30.0)])];
        let mut chart = Chart { title: "TIC-1".into(), from, to, curves };
        assert_eq!(chart.panels().len(), 1);
        let [panel] = &chart.panels()[..] else { unreachable!() };
        assert_eq!((panel.low, panel.high, panel.curves.len()), (20.0, 30.0, 2));
        assert_eq!(panel.ticks().map(|(_, label)| label).collect::<Vec<_>>(), ["20", "25", "30"]);
        let [first, _] = &chart.curves[..] else { unreachable!() };
        assert_eq!(paths(first, from, |x| x as f32, |y| y as f32).len(), 2, "the gap ends a line");
        chart.curves.push(curve("TIC-1.MV", "%", &[None]));
        assert_eq!(chart.panels().len(), 1, "a curve without values has no panel");
        chart.curves.push(curve("PLC-1.LT-1", "cm", &[Some(9.5)]));
        assert_eq!(chart.panels()[1].ticks().map(|(_, label)| label).collect::<Vec<_>>(), ["9.4", "9.5", "9.6"]);
        let svg = String::from_utf8(chart.drawing(&zone("Asia/Bangkok"), 640).svg()).expect("SVG is text");
        assert!(svg.contains(">08:00</text>") && svg.contains(">TIC-1.SV</text>"), "{svg}");
    }
}
