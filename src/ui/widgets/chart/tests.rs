//! Pictures of charts, as an operator sees them.

use proptest::prelude::*;
use ratatui::{buffer::Buffer, layout::Rect, style::Style, text::Line, widgets::Widget};

use super::*;
use crate::{
    history::{Bucket, Series},
    plant::def::TagId,
};

static ZONE: TimeZone = TimeZone::UTC;

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(1_795_244_400 + second).expect("a time in 2026")
}

/// A trace of one-second columns from second 0; NAN is a gap.
fn trace(values: impl IntoIterator<Item = f64>) -> Trace {
    let bucket = |v: f64| v.is_finite().then_some(Bucket { min: v, max: v, mean: v, last: v.into() });
    let mut trace = Trace::default();
    let buckets = values.into_iter().map(bucket).collect();
    let step = Duration::from_secs(1);
    trace
        .set_past(Series { tag: TagId(0), from: at(0), step, buckets, summary: None, counted: None, good: 1.0 }, at(0));
    trace
}

fn curve<'a>(trace: &'a Trace, pen: usize, unit: &'a str) -> Curve<'a> {
    Curve::new(trace, pen, unit, 1)
}

fn chart<'a>(theme: &'a Theme, curves: Vec<Curve<'a>>) -> Chart<'a> {
    Chart { zone: Some(&ZONE), ..Chart::new(theme, (at(0), at(120), at(120)), curves) }
}

fn picture(chart: &Chart, width: u16, height: u16) -> String {
    let mut buf = Buffer::empty(Rect::new(0, 0, width, height));
    chart.render(buf.area, &mut buf);
    let row = |y| (0..width).map(|x| buf[(x, y)].symbol()).collect::<String>().trim_end().to_owned();
    (0..height).map(row).collect::<Vec<_>>().join("\n")
}

fn wave(second: i64) -> f64 {
    65.0 + 8.0 * (second as f64 / 15.0).sin()
}

#[test]
fn curves_of_two_units_and_a_set_value() {
    let (pv, sv) = (trace((0..120).map(wave)), trace((0..120).map(|s| if s < 60 { 60.0 } else { 70.0 })));
    let mv = trace((0..120).map(|s| f64::from(s as u8) / 2.0));
    let sv = Curve { dashed: true, ..curve(&sv, 1, "°C") };
    let mv = Curve { fixed: Some((0.0, 100.0)), ..curve(&mv, 2, "%") };
    insta::assert_snapshot!(picture(&chart(&Theme::FULL, vec![curve(&pv, 0, "°C"), sv, mv]), 70, 14));
    insta::assert_snapshot!(picture(&chart(&Theme::PLAIN, vec![curve(&pv, 0, "°C"), sv, mv]), 70, 14));
}

#[test]
fn a_gap_is_a_gap_and_says_how_long() {
    let values = (0..120).map(|s| if (30..70).contains(&s) { f64::NAN } else { wave(s) });
    let pv = trace(values);
    insta::assert_snapshot!(picture(&chart(&Theme::FULL, vec![curve(&pv, 0, "°C")]), 60, 10));
}

#[test]
fn a_chart_without_values_says_so() {
    let none = trace([]);
    insta::assert_snapshot!(picture(&chart(&Theme::FULL, vec![curve(&none, 0, "°C")]), 60, 8));
}

#[test]
fn a_spike_of_one_second_is_seen_in_an_hour() {
    let pv = trace((0..3600).map(|s| if s == 1234 { 95.0 } else { 50.0 }));
    let hour = Chart { to: at(3600), now: at(3600), ..chart(&Theme::FULL, vec![curve(&pv, 0, "°C")]) };
    insta::assert_snapshot!(picture(&hour, 60, 10));
}

#[test]
fn the_cursor_shows_its_words_and_alarms_their_mark() {
    let pv = trace((0..120).map(wave));
    let mut chart = chart(&Theme::FULL, vec![curve(&pv, 0, "°C")]);
    chart.cursors = vec![(at(110), Line::from("13:01:50  PV 71.2"))];
    chart.marks = vec![(at(45), Style::new())];
    insta::assert_snapshot!(picture(&chart, 60, 10));
}

#[test]
fn a_third_unit_gets_a_scale_of_its_own() {
    let data = trace([1.0, 2.0]);
    let axes = |units: &[&'static str]| {
        let curves = units.iter().enumerate().map(|(n, unit)| curve(&data, n, unit)).collect();
        chart(&Theme::FULL, curves).axes()
    };
    use Axis::{Left, Own, Right};
    assert_eq!(axes(&["°C", "%", "°C", "W"]), [Left, Right, Left, Own]);
    assert_eq!(axes(&["", "°C", "%"]), [Own, Left, Right]);
    assert_eq!(axes(&["", "°C"]), [Right, Left]);
    assert_eq!(axes(&[]), []);
}

#[test]
fn lengths_of_time_are_short() {
    for (seconds, expect) in
        [(0, "0 s"), (99, "99 s"), (100, "2 min"), (3_600, "60 min"), (9_000, "2.5 h"), (259_200, "3.0 d")]
    {
        assert_eq!(span_text(Duration::from_secs(seconds)), expect);
    }
}

proptest! {
    /// Whatever the size and the data, the chart draws within its area and does not panic.
    #[test]
    fn any_size_is_drawn(width in 0u16..90, height in 0u16..30, x in 0u16..90, y in 0u16..30, span in 0i64..4000,
                         values in prop::collection::vec(prop::num::f64::ANY, 0..40)) {
        let (a, b) = (trace(values.iter().copied()), trace(values.iter().map(|v| -v)));
        for theme in [Theme::FULL, Theme::PLAIN] {
            let curves = vec![curve(&a, 0, "°C"), curve(&b, 1, "%"), curve(&b, 2, "")];
            let chart = Chart { to: at(span), cursors: vec![(at(5), Line::from("13:01"))], ..chart(&theme, curves) };
            let mut buf = Buffer::empty(Rect::new(0, 0, 100, 40));
            chart.render(Rect::new(x, y, width, height), &mut buf);
        }
    }
}

#[test]
fn a_console_without_braille_gets_blocks_and_letters() {
    let theme = Theme { glyphs: Glyphs::Block, ..Theme::FULL };
    let (pv, sv) = (trace((0..120).map(wave)), trace((0..120).map(|_| 70.0)));
    let sv = Curve { dashed: true, ..curve(&sv, 1, "°C") };
    insta::assert_snapshot!(picture(&chart(&theme, vec![curve(&pv, 0, "°C"), sv]), 70, 14));
}

#[test]
fn time_that_was_not_read_yet_is_blank_and_not_called_a_gap() {
    let unread = Trace::default();
    let picture = picture(&chart(&Theme::FULL, vec![curve(&unread, 0, "°C")]), 60, 8);
    assert!(!picture.contains("no data"), "{picture}");
}

#[test]
fn the_labels_of_an_axis_stand_evenly() {
    let pv = trace((0..=100).map(|n| f64::from(n % 60)));
    for (fixed, least) in [(Some((0.0, 100.0)), 3), (Some((0.0, 1600.0)), 3), (None, 3)] {
        for height in 11..30 {
            let chart = chart(&Theme::FULL, vec![Curve { fixed, ..curve(&pv, 0, "°C") }]);
            let plan = chart.plan(Rect::new(0, 0, 80, height));
            let scale = plan.scales[0].1;
            let rows: Vec<i32> =
                scale.ticks().into_iter().map(|tick| i32::from(chart.row(scale, tick, plan.plot.height))).collect();
            let gaps: Vec<i32> = rows.windows(2).map(|pair| pair[0] - pair[1]).collect();
            assert!(gaps.windows(2).all(|pair| pair[0] == pair[1]), "{fixed:?} in {height} rows: {rows:?}");
            assert!(rows.len() >= least, "{fixed:?} in {height} rows: {rows:?}");
        }
    }
}

#[test]
fn two_limits_in_one_row_are_both_named() {
    let pv = trace((0..120).map(wave));
    let limit = |value, text: &str| Limit { curve: 0, value, high: true, text: text.to_owned() };
    let limits = vec![limit(84.0, "H 84.0"), limit(85.0, "HH 85.0")];
    let curves = vec![Curve { fixed: Some((0.0, 100.0)), ..curve(&pv, 0, "°C") }];
    let shown = picture(&Chart { limits, ..chart(&Theme::FULL, curves) }, 70, 10);
    assert!(shown.contains("H 84.0  HH 85.0"), "{shown}");
}
