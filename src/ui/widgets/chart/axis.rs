//! Scales and ticks: round numbers (1-2-5) for values, round local times for the time axis.

use crate::plant::number::to_usize;
use jiff::{Timestamp, tz::TimeZone};

/// The range of an axis and the distance of its ticks, in the unit of its curves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    pub low: f64,
    pub high: f64,
    /// From tick to tick: 1, 2 or 5 times a power of ten.
    pub step: f64,
}

impl Scale {
    /// The scale for data from `data.0` to `data.1`, with at most `ticks` intervals. A fixed scale is kept, unless
    /// data lie outside: a scale never hides data. Else it ends at round numbers, and shows at least ten times
    /// `resolution`, so that the last digit of a steady value does not look like a storm.
    pub fn fit(data: Option<(f64, f64)>, fixed: Option<(f64, f64)>, resolution: f64, ticks: usize) -> Scale {
        let fixed = fixed.filter(|(low, high)| low < high && (high - low).is_finite());
        if let Some((low, high)) = fixed
            && data.is_none_or(|data| low <= data.0 && data.1 <= high)
        {
            return Scale { low, high, step: nice_step(high - low, ticks) };
        }
        let (mut low, mut high) = match (data, fixed) {
            (None, None) => (0.0, 1.0),
            (None, Some(range)) | (Some(range), None) => range,
            (Some(data), Some(fixed)) => (data.0.min(fixed.0), data.1.max(fixed.1)),
        };
        let least = (10.0 * resolution).max(low.abs().max(high.abs()) * 1e-9);
        let least = if least > 0.0 { least } else { 1.0 };
        if high - low < least {
            let (positive, middle) = (low >= 0.0, low / 2.0 + high / 2.0);
            (low, high) = match (low, high) {
                // Nothing all the time: a plain scale, not one around a nought.
                (0.0, 0.0) => (0.0, least.max(1.0)),
                _ => (middle - least / 2.0, middle + least / 2.0),
            };
            // What is never negative gets no negative scale.
            if positive && low < 0.0 {
                (low, high) = (0.0, high - low);
            }
        }
        // Rounding outwards may need a longer step, once or twice.
        let mut step = nice_step(high - low, ticks);
        for _ in 0..3 {
            let (bottom, top) = ((low / step + 1e-9).floor() * step, (high / step - 1e-9).ceil() * step);
            if ((top - bottom) / step).round() <= ticks.max(1) as f64 {
                (low, high) = (bottom, top);
                break;
            }
            step = nice_step(step * 1.5, 1);
        }
        Scale { low, high, step }
    }

    /// Where a value lies: 0 at the bottom, 1 at the top.
    pub fn share(self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// The round values of the axis, upwards.
    pub fn ticks(self) -> Vec<f64> {
        let (first, last) = ((self.low / self.step - 1e-6).ceil(), (self.high / self.step + 1e-6).floor());
        let count = to_usize((last - first).clamp(0.0, 100.0));
        // Adding zero turns a negative zero into a plain one.
        (0..=count).map(|n| (first + n as f64) * self.step + 0.0).collect()
    }

    /// The same range in `n` intervals, if that makes ticks that people count in: 25 for 0 … 100, 400 for 0 … 1600.
    pub fn divided(self, n: usize) -> Option<Scale> {
        let step = (self.high - self.low) / n.max(1) as f64;
        let power = 10f64.powf((step.log10() + 1e-9).floor());
        let factors: &[f64] = &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 2.5];
        let factors = if step >= 10.0 { factors } else { &factors[..7] };
        let round = factors.iter().find(|factor| (step / power - **factor).abs() < 1e-6)?;
        let scale = Scale { step: round * power, ..self };
        (scale.intervals() == Some(n)).then_some(scale)
    }

    /// Intervals between ticks; `None` where the ends of the scale are no ticks.
    pub fn intervals(self) -> Option<usize> {
        let ticks = self.ticks();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * self.step;
        let ends = near(*ticks.first()?, self.low) && near(*ticks.last()?, self.high);
        ends.then_some(ticks.len() - 1)
    }

    /// A tick as text, with the decimals that its step needs.
    pub fn label(self, tick: f64) -> String {
        let decimals = to_usize((-(self.step.log10() + 1e-9).floor()).clamp(0.0, 9.0));
        format!("{tick:.decimals$}")
    }
}

/// The least of 1, 2, 5 · 10^n that covers `span` in at most `intervals` steps.
pub fn nice_step(span: f64, intervals: usize) -> f64 {
    let least = span / intervals.max(1) as f64;
    if !least.is_finite() || least <= 0.0 {
        return 1.0;
    }
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * power >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// Steps of a time axis that people count in, seconds.
const TIME_STEPS: [i64; 22] = [
    1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1_800, 3_600, 7_200, 10_800, 14_400, 21_600, 43_200, 86_400, 172_800,
    604_800, 1_209_600,
];
/// The same in months, for longer spans.
const MONTH_STEPS: [i64; 5] = [1, 2, 3, 6, 12];

/// Round local times between `from` and `to`, with their labels: `13:45`, with seconds where ticks are closer than a
/// minute, the date (`11-22`) at midnight, and the month (`2026-11`) where ticks are months apart. At most one in `cells_min`
/// cells of `cells`.
pub fn time_ticks(
    from: Timestamp,
    to: Timestamp,
    zone: &TimeZone,
    cells: usize,
    cells_min: usize,
) -> Vec<(Timestamp, String)> {
    let span = to.as_second() - from.as_second();
    let room = (cells / cells_min.max(1)).max(1) as i64;
    let steps = TIME_STEPS.into_iter();
    let Some(step) = steps.filter(|step| *step >= 60 || cells_min > 8).find(|step| span / step <= room) else {
        return month_ticks(from, to, zone, room);
    };
    let mut ticks = Vec::new();
    let mut next = round_up(from, step, zone);
    // Bounded by the step; the second bound is for clocks that turn back.
    while let Some(at) = next.filter(|at| *at <= to && ticks.len() as i64 <= room + 2) {
        let local = at.to_zoned(zone.clone());
        let midnight = local.hour() == 0 && local.minute() == 0 && local.second() == 0;
        let form = if midnight && span >= 3_600 {
            "%m-%d"
        } else if step < 60 {
            "%H:%M:%S"
        } else {
            "%H:%M"
        };
        ticks.push((at, local.strftime(form).to_string()));
        next = Timestamp::from_second(at.as_second() + 1).ok().and_then(|after| round_up(after, step, zone));
    }
    ticks
}

/// Round times since `from`, `0:30` in hours and minutes; with seconds where ticks are closer than a minute.
pub fn elapsed_ticks(from: Timestamp, to: Timestamp, ticks_max: usize) -> Vec<(Timestamp, String)> {
    let span = to.as_second() - from.as_second();
    let room = ticks_max.max(1) as i64;
    let step = TIME_STEPS.into_iter().find(|step| span / step <= room).unwrap_or(span.max(1));
    let label = |second: i64| {
        let (hours, minutes) = (second / 3_600, second / 60 % 60);
        if step < 60 { format!("{hours}:{minutes:02}:{:02}", second % 60) } else { format!("{hours}:{minutes:02}") }
    };
    let tick = |n: i64| Some((Timestamp::from_second(from.as_second() + n * step).ok()?, label(n * step)));
    (0..=span / step).filter_map(tick).collect()
}

/// The beginnings of months, or of every second, third … one.
fn month_ticks(from: Timestamp, to: Timestamp, zone: &TimeZone, room: i64) -> Vec<(Timestamp, String)> {
    const SECONDS: i64 = 2_629_746;
    let months = (to.as_second() - from.as_second()) / SECONDS;
    let step = MONTH_STEPS.into_iter().find(|step| months / step <= room).unwrap_or(months / room.max(1) + 1);
    let first = from.to_zoned(zone.clone()).date().first_of_month();
    let begin = |n: i64| first.checked_add(jiff::Span::new().try_months(n).ok()?).ok()?.to_zoned(zone.clone()).ok();
    let ticks = (0..=months + 1).map_while(begin).filter(|at| (i64::from(at.month()) - 1) % step.min(12) == 0);
    let seen = ticks.filter(|at| from <= at.timestamp() && at.timestamp() <= to);
    seen.map(|at| (at.timestamp(), at.strftime("%Y-%m").to_string())).collect()
}

/// The first instant from `at` on whose local time is a multiple of `step` seconds, counted from a midnight.
fn round_up(at: Timestamp, step: i64, zone: &TimeZone) -> Option<Timestamp> {
    let offset = |second: i64| Some(i64::from(zone.to_offset(Timestamp::from_second(second).ok()?).seconds()));
    let second = at.as_second() + i64::from(at.subsec_nanosecond() > 0);
    let round = |offset: i64| (second + offset + step - 1).div_euclid(step) * step - offset;
    // The clocks may change between `at` and there, so both offsets are tried.
    let near = offset(second)?;
    let far = offset(round(near))?;
    let candidates = [round(near), round(far), round(near) + step, round(far) + step];
    let is_round = |c: &i64| *c >= second && offset(*c).is_some_and(|offset| (c + offset).rem_euclid(step) == 0);
    candidates.into_iter().filter(is_round).min().and_then(|second| Timestamp::from_second(second).ok())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn elapsed_time_counts_from_the_left_edge() {
        let check = |seconds: i64, room: usize, expect: &str| {
            let from = Timestamp::from_second(1_000_000_007).expect("a time");
            let to = Timestamp::from_second(1_000_000_007 + seconds).expect("a time");
            let labels: Vec<String> = elapsed_ticks(from, to, room).into_iter().map(|(_, label)| label).collect();
            assert_eq!(labels.join(" "), expect, "{seconds} s, {room}");
        };
        check(1_800, 6, "0:00 0:05 0:10 0:15 0:20 0:25 0:30");
        check(40, 4, "0:00:00 0:00:10 0:00:20 0:00:30 0:00:40");
        check(30 * 3_600, 4, "0:00 12:00 24:00");
        check(0, 4, "0:00:00");
    }

    #[test]
    fn scales_end_at_round_numbers_and_never_hide_data() {
        let check = |data, fixed, resolution, ticks, expect: &str| {
            let scale = Scale::fit(data, fixed, resolution, ticks);
            let labels: Vec<String> = scale.ticks().into_iter().map(|tick| scale.label(tick)).collect();
            let text = format!("{} … {} | {}", scale.low, scale.high, labels.join(" "));
            assert_eq!(text, expect, "{data:?} {fixed:?} {ticks}");
        };
        check(Some((51.3, 78.9)), None, 0.1, 4, "50 … 80 | 50 60 70 80");
        check(Some((59.8, 72.6)), None, 0.1, 3, "50 … 80 | 50 60 70 80");
        check(Some((0.0, 100.0)), None, 0.1, 5, "0 … 100 | 0 20 40 60 80 100");
        check(Some((-3.0, 4.0)), None, 0.1, 4, "-4 … 4 | -4 -2 0 2 4");
        check(Some((70.0, 70.1)), None, 0.1, 5, "69.5 … 71 | 69.5 70.0 70.5 71.0");
        check(Some((70.0, 70.0)), None, 0.1, 4, "69.5 … 70.5 | 69.5 70.0 70.5");
        check(Some((0.0, 0.0)), None, 0.0, 4, "0 … 1 | 0.0 0.5 1.0");
        check(Some((0.0, 0.0)), None, 0.01, 5, "0 … 1 | 0.0 0.2 0.4 0.6 0.8 1.0");
        check(Some((0.02, 0.02)), None, 0.01, 5, "0 … 0.1 | 0.00 0.02 0.04 0.06 0.08 0.10");
        check(Some((10.0, 60.0)), Some((0.0, 100.0)), 0.1, 4, "0 … 100 | 0 50 100");
        check(Some((10.0, 107.0)), Some((0.0, 100.0)), 0.1, 4, "0 … 150 | 0 50 100 150");
        check(None, Some((0.0, 25.0)), 0.1, 5, "0 … 25 | 0 5 10 15 20 25");
        check(None, None, 0.1, 2, "0 … 1 | 0.0 0.5 1.0");
        check(Some((5.0, 15.0)), Some((7.0, 3.0)), 0.1, 2, "5 … 15 | 5 10 15");
    }

    #[test]
    fn a_given_range_is_divided_into_round_parts_or_not_at_all() {
        let check = |low: f64, high: f64, n: usize, expect: Option<f64>| {
            let scale = Scale { low, high, step: high - low }.divided(n);
            assert_eq!(scale.map(|scale| scale.step), expect, "{low} … {high} / {n}");
        };
        check(0.0, 100.0, 4, Some(25.0));
        check(0.0, 100.0, 5, Some(20.0));
        check(0.0, 100.0, 3, None);
        check(0.0, 1600.0, 4, Some(400.0));
        check(0.0, 10.0, 4, None);
        check(0.0, 30.0, 3, Some(10.0));
        check(10.0, 60.0, 2, None);
        check(50.0, 80.0, 3, Some(10.0));
    }

    #[test]
    fn times_are_round_where_the_plant_stands() {
        let check = |from: &str, minutes: i64, zone: &str, cells, expect: &str| {
            let from: Timestamp = from.parse().expect("a time in the table");
            let to = Timestamp::from_second(from.as_second() + 60 * minutes).expect("in range");
            let zone = TimeZone::get(zone).expect("a zone in the table");
            let width = if minutes < 10 { 11 } else { 8 };
            let labels: Vec<String> =
                time_ticks(from, to, &zone, cells, width).into_iter().map(|(_, label)| label).collect();
            assert_eq!(labels.join(" "), expect, "{from} {minutes} min");
        };
        check("2026-11-21T06:05:20Z", 60, "Asia/Bangkok", 66, "13:10 13:20 13:30 13:40 13:50 14:00");
        check(
            "2026-11-21T06:05:20Z",
            1,
            "Asia/Bangkok",
            66,
            "13:05:20 13:05:30 13:05:40 13:05:50 13:06:00 13:06:10 13:06:20",
        );
        check("2026-11-21T06:05:20Z", 1440, "Asia/Bangkok", 66, "15:00 18:00 21:00 11-22 03:00 06:00 09:00 12:00");
        // Half-hour zones are round too.
        check("2026-11-21T06:05:20Z", 240, "Asia/Kolkata", 40, "12:00 13:00 14:00 15:00");
        // The night in which clocks go forward has no 02:00, the one in which they go back has it twice.
        check("2026-03-29T00:00:00Z", 240, "Europe/Berlin", 40, "01:00 03:00 04:00 05:00 06:00");
        check("2026-10-24T22:00:00Z", 300, "Europe/Berlin", 60, "10-25 01:00 02:00 02:00 03:00 04:00");
        check("2026-10-24T22:00:00Z", 720, "Europe/Berlin", 40, "10-25 03:00 06:00 09:00");
        check("2026-11-21T06:05:20Z", 0, "UTC", 0, "06:05:20");
    }

    proptest! {
        #[test]
        fn any_data_fit_in_their_scale(a in -1e7..1e7f64, b in -1e7..1e7f64, ticks in 0usize..12) {
            let (low, high) = (a.min(b), a.max(b));
            let scale = Scale::fit(Some((low, high)), None, 0.1, ticks);
            prop_assert!(scale.low <= low && high <= scale.high);
            prop_assert!(scale.step > 0.0 && scale.ticks().len() <= ticks.max(1) + 3);
        }
    }
}
