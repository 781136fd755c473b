//! Which stretch of time the trends show: windows, zoom, pan and the grid of columns; pure arithmetic.

use crate::ui::tabs::prelude::*;
use crate::{history::tiers::Tier, plant::number::to_usize};
use jiff::tz::TimeZone;

/// The windows that zooming steps through, seconds: 1 min to 5 years.
pub const WINDOWS: [i64; 20] = [
    60,
    120,
    300,
    600,
    900,
    1_800,
    3_600,
    7_200,
    14_400,
    28_800,
    43_200,
    DAY,
    2 * DAY,
    7 * DAY,
    14 * DAY,
    30 * DAY,
    90 * DAY,
    YEAR,
    2 * YEAR,
    5 * YEAR,
];
const DAY: i64 = 86_400;
const YEAR: i64 = 366 * DAY;
/// How often the history may be queried, milliseconds.
pub const RATES: [u64; 5] = [500, 1_000, 2_000, 5_000, 10_000];

/// A living view of a short window moves so seldom, but never by more than an eighth of it.
const HOP: SignedDuration = SignedDuration::from_secs(10);
const HOPS_MIN: i64 = 8;

/// A stretch of time cut into columns of equal width, on a grid that does not move with the clock: so a curve travels
/// by whole columns and does not shimmer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// Left edge.
    pub from: Timestamp,
    /// Right edge; for a living view up to one column, or a hop, after now.
    pub to: Timestamp,
    pub columns: usize,
}

impl View {
    /// The view of `seconds` that ends with the column in which `end` lies.
    pub fn ending(end: Timestamp, seconds: i64, columns: usize) -> View {
        let columns = columns.max(1);
        let width = seconds.max(1) * 1_000_000;
        let least = (width + columns as i64 - 1) / columns as i64;
        let step = of_aggregates(least);
        // Wider columns are fewer: the view is not.
        let columns = if step > least { to_usize((width + step - 1) / step) } else { columns };
        let to = (end.as_microsecond().div_euclid(step) + 1) * step;
        View { from: instant(to - step * columns as i64), to: instant(to), columns }
    }

    /// The view of `seconds` with `now` near its right edge. It moves by a hop or by a column, and in between the curves
    /// grow: each move sends every cell of them again.
    pub fn live(now: Timestamp, seconds: i64, columns: usize) -> View {
        let step = View::ending(now, seconds, columns).step().as_micros().max(1);
        let hop = HOP.as_micros().min(i128::from(seconds.max(1) * 1_000_000 / HOPS_MIN));
        let hop = step * (hop / step).max(1);
        let last = (i128::from(now.as_microsecond()).div_euclid(hop) + 1) * hop - 1;
        View::ending(instant(i64::try_from(last).unwrap_or(i64::MAX)), seconds, columns)
    }

    /// The view from `from` to `end`, at least a minute wide. Columns are half seconds or multiples, so that it grows by
    /// steps, and one column is to spare, so that its left edge can stand on the grid.
    pub fn since(from: Timestamp, end: Timestamp, columns: usize) -> View {
        let columns = columns.max(2);
        let count = columns as i64;
        let width = (end.as_microsecond() - from.as_microsecond()).max(60_000_000);
        let step = of_aggregates((width / (count - 1) / 500_000 + 1) * 500_000);
        let from = from.as_microsecond().div_euclid(step) * step;
        View { from: instant(from), to: instant(from + step * count), columns }
    }

    /// Width of a column.
    pub fn step(self) -> SignedDuration {
        self.to.duration_since(self.from) / i32::try_from(self.columns.max(1)).unwrap_or(i32::MAX)
    }

    pub fn width(self) -> SignedDuration {
        self.to.duration_since(self.from)
    }

    pub fn holds(self, at: Timestamp) -> bool {
        self.from <= at && at < self.to
    }
}

/// The width of a column that begins and ends with the aggregates that it is made of, in microseconds.
fn of_aggregates(step: i64) -> i64 {
    Tier::within(step).step().map_or(step, |row| (step + row - 1) / row * row)
}

/// The end of a view after a step of `by` to the right (left if negative); `None` when that reaches the present, and
/// the view is alive again.
pub fn pan(end: Timestamp, by: SignedDuration, now: Timestamp) -> Option<Timestamp> {
    end.checked_add(by).ok().filter(|end| *end < now)
}

/// The window nearest to a stretch of time, as a place in [`WINDOWS`].
pub fn nearest(span: SignedDuration) -> usize {
    let seconds = span.as_secs();
    WINDOWS.iter().position(|window| *window >= seconds).unwrap_or(WINDOWS.len() - 1)
}

/// The window that shows a stretch of time with a sixteenth of the window or more on either side, and where it ends.
pub fn around((from, to): (Timestamp, Timestamp)) -> (usize, Timestamp) {
    let span = to.duration_since(from).max(SignedDuration::ZERO);
    // A living view of it ends up to an eighth of the window after now.
    let window = nearest(span + span / 7 + SignedDuration::from_secs(1));
    let spare = SignedDuration::from_secs(WINDOWS[window]) - span;
    (window, to.checked_add(spare.max(SignedDuration::ZERO) / 2).unwrap_or(to))
}

/// The last local midnight; a day that begins later (clocks change at midnight) begins then.
pub fn midnight(now: Timestamp, zone: &TimeZone) -> Timestamp {
    now.to_zoned(zone.clone()).start_of_day().map_or(now, |start| start.timestamp())
}

/// A window as it is written: `10 min`, `1 h`, `7 d`.
pub fn window_text(seconds: i64) -> String {
    match seconds {
        0..3_600 => t!("{seconds} min", seconds = seconds / 60),
        3_600..=DAY => format!("{} h", seconds / 3_600),
        86_401..YEAR => format!("{} d", seconds / DAY),
        YEAR => t!("1 year").to_owned(),
        _ => t!("{years} years", years = seconds / YEAR),
    }
}

/// A rate as it is written: `0.5 s`, `10 s`.
pub fn rate_text(millis: u64) -> String {
    format!("{} s", Duration::from_millis(millis).as_secs_f64())
}

/// An instant of plain microseconds; the times of a plant lie far inside the calendar.
fn instant(micros: i64) -> Timestamp {
    Timestamp::from_microsecond(micros).unwrap_or(Timestamp::UNIX_EPOCH)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(text: &str) -> Timestamp {
        format!("2026-11-21T{text}Z").parse().expect("a time in the table")
    }

    #[test]
    fn a_view_stands_still_until_a_column_is_full() {
        let check = |now: &str, seconds, columns, from: &str, to: &str| {
            let view = View::ending(at(now), seconds, columns);
            assert_eq!((view.from, view.to), (at(from), at(to)), "{now} {seconds} s in {columns}");
        };
        check("06:00:00", 600, 120, "05:50:05", "06:00:05");
        check("06:00:04.9", 600, 120, "05:50:05", "06:00:05");
        check("06:00:05", 600, 120, "05:50:10", "06:00:10");
        check("06:00:00.2", 60, 120, "05:59:00.5", "06:00:00.5");
        check("06:00:00", 3_600, 1, "06:00:00", "07:00:00");
    }

    #[test]
    fn a_living_view_holds_now_and_moves_seldom() {
        for (seconds, columns, most) in [(60, 120, 9), (60, 7, 9), (120, 60, 7), (600, 120, 7), (86_400, 120, 2)] {
            let views: Vec<View> = (0..600)
                .map(|n| at("06:00:00") + SignedDuration::from_millis(100 * n))
                .map(|now| {
                    let view = View::live(now, seconds, columns);
                    assert!(
                        view.holds(now) && view.to <= now + HOP.min(view.width() / 8).max(view.step()),
                        "{now}: {view:?}"
                    );
                    view
                })
                .collect();
            let moves = views.windows(2).filter(|pair| pair[0] != pair[1]).count();
            assert!(moves <= most, "{seconds} s in {columns}: {moves} moves in a minute");
        }
    }

    #[test]
    fn everything_since_the_start_is_on_the_screen() {
        for (from, end) in
            [("06:12:00", "07:00:00"), ("06:59:59", "07:00:00"), ("00:00:00", "23:59:59"), ("06:58:00", "07:00:00")]
        {
            for columns in [1, 10, 119, 120, 121, 400] {
                let view = View::since(at(from), at(end), columns);
                assert!(view.from <= at(from) && view.holds(at(end)), "{from} {end} {columns}: {view:?}");
                assert!(view.width() >= SignedDuration::from_secs(60));
            }
        }
    }

    #[test]
    fn panning_right_ends_in_the_present() {
        let now = at("07:00:00");
        let minutes = SignedDuration::from_mins;
        for (end, by, expect) in [
            ("07:00:00", minutes(-15), Some("06:45:00")),
            ("06:30:00", minutes(15), Some("06:45:00")),
            ("06:45:00", minutes(15), None),
            ("06:50:00", minutes(60), None),
        ] {
            assert_eq!(pan(at(end), by, now), expect.map(at), "{end}");
        }
    }

    #[test]
    fn a_batch_is_shown_from_its_begin_to_its_end() {
        for (from, to, window, after) in [
            ("06:00:00", "06:10:00", 900, 150),
            ("06:00:00", "06:08:00", 600, 60),
            ("06:00:00", "06:00:00", 60, 30),
            ("00:00:00", "23:00:00", 2 * DAY, 45_000),
        ] {
            let (place, shown) = around((at(from), at(to)));
            assert_eq!((WINDOWS[place], shown.duration_since(at(to)).as_secs()), (window, after), "{from} {to}");
        }
    }

    #[test]
    fn a_batch_is_whole_while_it_runs_and_after_it() {
        for (lasted, tenths) in (0..400).flat_map(|lasted| (0..110).map(move |tenths| (lasted, tenths))) {
            let from = at("06:00:00") + SignedDuration::from_millis(100 * tenths);
            let to = from + SignedDuration::from_secs(lasted);
            let (window, end) = around((from, to));
            for view in [View::live(to, WINDOWS[window], 120), View::ending(end, WINDOWS[window], 120)] {
                assert!(view.from <= from && view.holds(to), "{from} to {to}: {view:?}");
            }
        }
    }

    #[test]
    fn windows_and_rates_read_well() {
        let words: Vec<String> = WINDOWS.into_iter().map(window_text).collect();
        assert_eq!(
            words.join(", "),
            "1 min, 2 min, 5 min, 10 min, 15 min, 30 min, 1 h, 2 h, 4 h, 8 h, 12 h, 24 h, 2 d, 7 d, 14 d, \
             30 d, 90 d, 1 year, 2 years, 5 years"
        );
        let words: Vec<String> = RATES.into_iter().map(rate_text).collect();
        assert_eq!(words.join(", "), "0.5 s, 1 s, 2 s, 5 s, 10 s");
        for (seconds, expect) in [(10, 60), (60, 60), (61, 120), (90_000, 172_800)] {
            assert_eq!(WINDOWS[nearest(SignedDuration::from_secs(seconds))], expect);
        }
    }

    #[test]
    fn the_day_begins_at_the_plants_midnight() {
        let bangkok = TimeZone::get("Asia/Bangkok").expect("a zone");
        assert_eq!(midnight(at("06:00:00"), &bangkok), "2026-11-20T17:00:00Z".parse().expect("a time"));
    }

    proptest! {
        #[test]
        fn the_present_is_always_in_the_last_column(second in 0i64..4_000_000_000, window in 0usize..20, columns in 1usize..500) {
            let now = instant(second * 1_000_003);
            let view = View::ending(now, WINDOWS[window], columns);
            prop_assert!(view.holds(now) && view.to.duration_since(now) <= view.step() + SignedDuration::from_micros(columns as i64));
            prop_assert_eq!((view.to.as_microsecond() - view.from.as_microsecond()) % view.columns as i64, 0);
        }
    }
}
