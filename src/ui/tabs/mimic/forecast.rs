//! What comes next, where rate and target are known: the end of a step, a value at its target or at a limit.

use super::attention::AttentionRow;
use crate::ui::{tabs::prelude::*, widgets::mimic::limits};
use crate::{
    history::Series,
    plant::def::{Level, MimicItem},
};

/// The rate is that of the last columns of a curve.
const COLUMNS: usize = 10;
/// How well a straight line must fit them: the share of their variance that it explains.
const FIT_MIN: f64 = 0.9;
/// What lies further ahead is not said.
const AHEAD_MAX: f64 = 8.0 * 3_600.0;

/// How fast a value changes, per minute: the slope of the last columns, where all of them are good and lie on a line.
pub fn rate_per_minute(series: &Series, resolution: f64) -> Option<f64> {
    let columns = series.buckets.len().checked_sub(COLUMNS).and_then(|from| series.buckets.get(from..))?;
    let means: Vec<f64> = columns.iter().map(|bucket| bucket.map(|bucket| bucket.mean)).collect::<Option<_>>()?;
    let count = means.len() as f64;
    let (mid, mean) = ((count - 1.0) / 2.0, means.iter().sum::<f64>() / count);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (n, value) in means.iter().enumerate() {
        let (x, y) = (n as f64 - mid, value - mean);
        (xy, xx, yy) = (xy + x * y, xx + x * x, yy + y * y);
    }
    let slope = xy / xx;
    let change = slope * count;
    if change.abs() <= 3.0 * resolution {
        // Within the last digits it stands still.
        return (yy.sqrt() <= 3.0 * resolution).then_some(0.0);
    }
    (FIT_MIN <= xy * xy / (xx * yy)).then(|| slope * 60.0 / series.step.as_secs_f64().max(1e-3))
}

/// How long until a value is at a target, at this rate; nothing where it moves away or it takes too long.
pub fn until(now: f64, target: f64, per_minute: f64) -> Option<Duration> {
    let seconds = (target - now) / per_minute * 60.0;
    (seconds.is_finite() && 0.0 < seconds && seconds <= AHEAD_MAX).then(|| Duration::from_secs_f64(seconds))
}

/// The smallest change of a tag that is shown.
pub fn resolution(cx: &ViewContext, tag: TagId) -> f64 {
    10f64.powi(-i32::from(cx.snapshot.decimals[tag.index()]))
}

/// The time that is left in the step of a sequence, where the device counts it.
pub fn left_in_step(cx: &ViewContext, sequence: TagId) -> Option<Duration> {
    let pages = cx.def().mimic.pages.iter().flat_map(|page| &page.pictures);
    let remaining = pages.flat_map(|picture| &picture.items).find_map(|item| match item {
        MimicItem::Sequence { step, remaining, .. } if *step == sequence => *remaining,
        _ => None,
    })?;
    let seconds = cx.snapshot.sample(remaining).good_value().filter(|seconds| 0.0 < *seconds)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// What comes next, the soonest first; `series` are curves up to now.
pub fn next(cx: &ViewContext, series: &[Series]) -> Vec<AttentionRow> {
    let def = cx.def();
    let mut rows: Vec<(Duration, String)> = Vec::new();
    for sequence in &def.logic.sequences {
        if let (Some(left), Some(step)) = (left_in_step(cx, sequence.step), cx.snapshot.text(sequence.step)) {
            rows.push((left, t!("{step} ends", step)));
        }
    }
    for series in series {
        let Some((now, rate)) = moving(cx, series) else { continue };
        let name = &def.tag(series.tag).name;
        let faceplates = def.devices.iter().filter_map(|device| device.faceplate.as_ref());
        if let Some(faceplate) = faceplates.into_iter().find(|faceplate| faceplate.pv == series.tag) {
            let target = cx.snapshot.sample(faceplate.sv_to_show()).good_value();
            let at = target.and_then(|target| until(now, target, rate));
            let sv = value::show(cx, faceplate.sv_to_show()).with_unit();
            if let Some(at) = at {
                rows.push((at, t!("{name} at SV {sv}", name, sv)));
                // The controller stops it there, before a limit behind it.
                continue;
            }
        }
        let reached =
            limits(cx, series.tag).filter_map(|(limit, level)| Some((until(now, limit, rate)?, limit, level)));
        // A limit that is passed on the way back is no news.
        let entered = reached.filter(|(_, limit, level)| match level {
            Level::High | Level::HighHigh => now < *limit,
            Level::Low | Level::LowLow => *limit < now,
        });
        if let Some((at, limit, _)) = entered.min_by_key(|(at, ..)| *at) {
            let limit = format!("{} {}", cx.snapshot.format(series.tag, limit), cx.snapshot.unit(series.tag));
            rows.push((at, t!("{name} at its limit {limit}", name, limit = limit.trim_end())));
        }
    }
    rows.sort();
    let row = |(at, words): (Duration, String)| (format!("{}  {words}", running(at)), cx.theme.normal());
    rows.into_iter().map(row).collect()
}

/// The good value of a curve's tag now, and how fast it changes, while it does.
pub fn moving(cx: &ViewContext, series: &Series) -> Option<(f64, f64)> {
    let now = cx.snapshot.sample(series.tag).good_value()?;
    let rate = rate_per_minute(series, resolution(cx, series.tag)).filter(|rate| *rate != 0.0)?;
    Some((now, rate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        history::Bucket,
        ui::fixture::{Fixture, now, with_cx},
    };

    /// Columns of a minute.
    fn series(tag: TagId, values: impl Iterator<Item = Option<f64>>) -> Series {
        let bucket = |v: Option<f64>| v.map(|v| Bucket { min: v, max: v, mean: v, last: v.into() });
        let (from, step) = (now() - SignedDuration::from_hours(1), Duration::from_secs(60));
        Series { tag, from, step, buckets: values.map(bucket).collect(), summary: None, counted: None, good: 1.0 }
    }

    #[test]
    fn a_rate_is_known_only_where_the_curve_is_a_line() {
        let rate = |values: &[Option<f64>]| rate_per_minute(&series(TagId(0), values.iter().copied()), 0.1);
        let line: Vec<Option<f64>> = (0..10).map(|n| Some(20.0 + 0.5 * f64::from(n))).collect();
        assert!((rate(&line).expect("a line") - 0.5).abs() < 1e-9);
        assert_eq!(rate(&[Some(20.0); 10]), Some(0.0));
        let mut gap = line.clone();
        gap[4] = None;
        assert_eq!((rate(&gap), rate(&line[1..])), (None, None), "a gap, and too few");
        let swings: Vec<Option<f64>> = (0..10).map(|n| Some(f64::from(n % 2) * 10.0 + f64::from(n))).collect();
        assert_eq!(rate(&swings), None);
    }

    #[test]
    fn what_comes_next_is_said_only_where_rate_and_target_are_known() {
        let fixture = Fixture::normal();
        let (pv, level) = (fixture.tag("TIC-1.PV"), fixture.tag("PLC-1.LT-1"));
        let rising = series(pv, (0..10).map(|n| Some(62.4 + 0.2 * f64::from(n))));
        let falling = series(level, (0..10).map(|n| Some(26.6 - 0.5 * f64::from(n))));
        let said = |series: &[Series]| -> Vec<String> {
            with_cx(&fixture.snapshot(), |cx| next(cx, series).into_iter().map(|(text, _)| text).collect())
        };
        assert_eq!(said(&[]), ["03:12  HEAT ends"]);
        assert_eq!(
            said(&[rising, falling]),
            ["03:12  HEAT ends", "29:00  TIC-1.PV at SV 70.0 °C", "36:12  PLC-1.LT-1 at its limit 4.0 cm"]
        );
    }
}
