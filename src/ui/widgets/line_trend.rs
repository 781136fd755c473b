//! How a line did over the last day: the share of requests that failed, and how busy it was, in two rows of bars.

use crate::t;
use jiff::{SignedDuration, Timestamp};

use super::{
    spark::bars,
    text::{Canvas, pad, pad_left, width},
};
use crate::{
    history::Query,
    plant::{
        def::LineId,
        line_minute::LineMinute,
        number::{to_u16, to_usize},
    },
    ui::ViewContext,
};

/// How far it reaches back.
pub const SPAN: SignedDuration = SignedDuration::from_hours(24);
/// Minutes in that span, and some that overlap when a clock is set.
const MINUTES_MAX: usize = 1_500;
/// A scale for errors never ends below this share: one lost answer a day must not fill the screen.
const ERRORS_MIN: f64 = 0.01;
/// Columns of the names, and of the figures behind the bars.
const NAME: u16 = 8;
const FIGURES: u16 = 26;

/// What the history is asked.
pub fn query(line: LineId, now: Timestamp) -> Query {
    let to = now + SignedDuration::from_secs(60);
    Query::LineMinutes { line, from: to - SPAN, to, limit: MINUTES_MAX }
}

/// One column of bars: the worst share of failures in it, the mean share of busy time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrendColumn {
    /// 0–1; `None` if nothing was asked.
    pub failed: Option<f64>,
    /// 0–1.
    pub busy: f64,
}

/// The minutes of the span that ends `now`, in so many columns; `None` where the station did not run.
pub fn columns(minutes: &[LineMinute], now: Timestamp, count: usize) -> Vec<Option<TrendColumn>> {
    let span = SPAN.as_secs_f64();
    let mut columns: Vec<Vec<&LineMinute>> = vec![Vec::new(); count];
    for minute in minutes {
        let ago = now.duration_since(minute.at).as_secs_f64();
        let place = ((1.0 - ago / span) * count as f64).floor();
        // A minute may end a little after a guessed present.
        let place = if ago < 0.0 { count.saturating_sub(1) as f64 } else { place.min(count as f64 - 1.0) };
        if let Some(column) = columns.get_mut(to_usize(place)).filter(|_| 0.0 <= place) {
            column.push(minute);
        }
    }
    let column = |minutes: Vec<&LineMinute>| {
        let busy = minutes.iter().map(|minute| f64::from(minute.utilisation)).sum::<f64>() / minutes.len() as f64;
        let failed = minutes.iter().filter_map(|minute| minute.failed()).reduce(f64::max);
        (!minutes.is_empty()).then_some(TrendColumn { failed, busy })
    };
    columns.into_iter().map(column).collect()
}

/// Draws three rows: errors, busy, the time. Says so where nothing is known.
pub fn line_trend(cx: &ViewContext, canvas: &mut Canvas, minutes: &[LineMinute]) {
    let theme = cx.theme;
    let room = canvas.width().saturating_sub(NAME + FIGURES);
    let columns = columns(minutes, cx.now, usize::from(room));
    let Some(last) = minutes.last() else {
        canvas.text(0, 0, t!("no history of this line yet"), theme.dim());
        return;
    };
    let failed: Vec<Option<f64>> = columns.iter().map(|column| column.and_then(|column| column.failed)).collect();
    let busy: Vec<Option<f64>> = columns.iter().map(|column| column.map(|column| column.busy)).collect();
    let worst = minutes.iter().filter_map(LineMinute::failed).fold(0.0, f64::max);
    let most = minutes.iter().map(|minute| f64::from(minute.utilisation)).fold(0.0, f64::max);
    let now = last.failed();
    let style = if now.is_some_and(|now| ERRORS_MIN <= now) { theme.trouble() } else { theme.normal() };
    let rows = [
        (t!("errors"), bars(&failed, worst.max(ERRORS_MIN), theme.glyphs), now, worst, style),
        (t!("busy"), bars(&busy, 1.0, theme.glyphs), Some(f64::from(last.utilisation)), most, theme.normal()),
    ];
    for (y, (name, curve, now, most, style)) in rows.into_iter().enumerate() {
        let y = to_u16(y);
        canvas.text(0, y, &pad(name, NAME), theme.dim());
        let x = canvas.text(NAME, y, &curve, style);
        let figures = t!(
            " {pad_left} now {pad_left2} peak",
            pad_left = pad_left(&percent(now), 8),
            pad_left2 = pad_left(&percent(Some(most)), 7)
        );
        canvas.text(x, y, &figures, style);
    }
    let zone = &cx.def().time_zone;
    let hour = |at: Timestamp| at.to_zoned(zone.clone()).strftime("%H:%M").to_string();
    canvas.text(NAME, 2, &hour(cx.now - SPAN), theme.dim());
    let (middle, end) = (hour(cx.now - SPAN / 2), hour(cx.now));
    canvas.text((NAME + room / 2).saturating_sub(width(&middle) / 2), 2, &middle, theme.dim());
    canvas.text_right(NAME + room, 2, &end, theme.dim());
}

/// `0.3 %`, `62 %`, `–`.
fn percent(share: Option<f64>) -> String {
    match share.map(|share| share * 100.0) {
        None => "–".to_owned(),
        Some(percent @ ..10.0) => format!("{percent:.1} %"),
        Some(percent) => format!("{percent:.0} %"),
    }
}

#[cfg(test)]
mod tests {
    use ratatui::{buffer::Buffer, layout::Rect};

    use super::*;
    use crate::ui::fixture::{Fixture, now, with_cx};

    /// A minute that ended so many minutes ago.
    fn minute(ago: i64, requests: u64, failed: u64, busy: f32) -> LineMinute {
        LineMinute {
            at: now() - SignedDuration::from_mins(ago),
            line: "L1".into(),
            requests,
            ok: requests - failed,
            timeouts: failed,
            corrupt: 0,
            exceptions: 0,
            retries: 0,
            late: 0,
            missed: 0,
            sent_bytes: 0,
            received_bytes: 0,
            utilisation: busy,
            reply_p99_ms: None,
            reply_max_ms: None,
        }
    }

    fn shown(minutes: &[LineMinute]) -> Vec<String> {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 60, 3));
        let area = buffer.area;
        with_cx(&Fixture::normal().snapshot(), |cx| line_trend(cx, &mut Canvas::new(&mut buffer, area), minutes));
        let row = |row: &[ratatui::buffer::Cell]| row.iter().map(|cell| cell.symbol()).collect::<String>();
        buffer.content.chunks(60).map(|cells| row(cells).trim_end().to_owned()).collect()
    }

    #[test]
    fn a_bad_hour_stands_out_and_an_absence_is_a_gap() {
        let day = (0..1_440).rev().filter(|ago| !(300..480).contains(ago));
        let minutes: Vec<LineMinute> =
            day.map(|ago| minute(ago, 60, if (600..660).contains(&ago) { 6 } else { 0 }, 0.5)).collect();
        let rows = shown(&minutes);
        // A column is 55 minutes: two lie wholly in the absence.
        assert_eq!(rows[0], "errors  ▁▁▁▁▁▁▁▁▁▁▁▁▁▁██▁▁  ▁▁▁▁▁▁    0.0 % now    10 % peak");
        assert_eq!(rows[1], "busy    ▅▅▅▅▅▅▅▅▅▅▅▅▅▅▅▅▅▅  ▅▅▅▅▅▅     50 % now    50 % peak");
        assert_eq!(rows[2], "        14:02      02:02     14:02");
    }

    #[test]
    fn a_single_lost_answer_does_not_fill_the_screen() {
        let minutes: Vec<LineMinute> =
            (0..1_440).rev().map(|ago| minute(ago, 600, u64::from(ago == 700), 0.2)).collect();
        assert!(!shown(&minutes)[0].contains('█'), "{:?}", shown(&minutes));
    }

    #[test]
    fn nothing_stored_is_said_and_nothing_asked_is_no_error() {
        assert_eq!(shown(&[])[0], "no history of this line yet");
        let closed: Vec<LineMinute> = (0..60).rev().map(|ago| minute(ago, 0, 0, 0.0)).collect();
        assert!(shown(&closed)[0].contains("– now"), "{:?}", shown(&closed));
    }
}
