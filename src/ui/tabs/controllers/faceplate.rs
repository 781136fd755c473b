//! The faceplate of a controller: PV, SV and MV as bars on their ranges, its states, its alarms and a small trend.

use ratatui::style::Modifier;

use super::list;
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        control_run::ControlRun,
        def::{Faceplate, Subject},
        tuning::Tuning,
    },
    report::control_runs,
    ui::widgets::mimic::{Bounds, panel::sv_difference, trend},
};

/// How far back the small trend goes.
pub const WINDOW: std::time::Duration = std::time::Duration::from_secs(1_800);
/// Columns of the small trend beside the bars.
const TREND: u16 = 22;
/// Columns of bars with the ends of their scales behind them; in less, a bar would tell nothing.
const ROW: u16 = 48;

/// Rows that [`strip`] takes.
pub fn strip_height(cx: &ViewContext, device: &DeviceDef) -> u16 {
    let Some(faceplate) = &device.faceplate else { return 0 };
    let shown = [cx.snapshot.tuning(device.id).is_some(), cx.snapshot.control_run(device.id).is_some()];
    3 + u16::from(faceplate.mv.is_some()) + shown.map(u16::from).iter().sum::<u16>()
}

/// Three bars over each other, with their ranges, the trend beside them, and a row of states and alarms.
pub fn strip(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, series: Option<&Series>) {
    let Some(faceplate) = &device.faceplate else { return };
    let wide = canvas.width();
    let rows = 2 + u16::from(faceplate.mv.is_some());
    let bars = wide.saturating_sub(TREND + 2);
    // The table below has the ranges too.
    let layout = if bars < ROW { Bars::Bare } else { Bars::Row };
    self::bars(cx, &mut canvas.part(0, 0, bars, rows), faceplate, layout);
    let at = Bounds { x: bars + 1, y: 0, width: TREND, height: rows };
    trend::view(cx, canvas, at, faceplate.pv, WINDOW, series, false);
    states(cx, &mut canvas.part(0, rows, wide, 1), device, faceplate);
    let mut y = rows + 1;
    if let Some(tuning) = cx.snapshot.tuning(device.id) {
        tuning_row(cx, &mut canvas.part(0, y, wide, 1), faceplate, tuning);
        y += 1;
    }
    if let Some(run) = cx.snapshot.control_run(device.id) {
        let words = format!("{}: {}", run_label(run), control_runs::figures(run).join(", "));
        canvas.text(1, y, &fit_words(&words, wide.saturating_sub(2)), run_style(cx, run));
    }
}

/// The same in a column of its own: more room, no other content.
pub fn panel(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, series: Option<&Series>) {
    let Some(faceplate) = &device.faceplate else { return };
    let (wide, high) = (canvas.width(), canvas.height());
    let rows = 3 * (2 + u16::from(faceplate.mv.is_some()));
    bars(cx, &mut canvas.part(0, 0, wide, rows), faceplate, Bars::Tall);
    states(cx, &mut canvas.part(0, rows, wide, 1), device, faceplate);
    let mut y = rows + 2;
    for alarm in list::alarms(cx, device.id).take(4) {
        let def = cx.def().alarm(alarm.id);
        let style = cx.theme.alarm(def.priority, alarm.state, cx.flash());
        let x = canvas.text(0, y, cx.theme.priority_mark(def.priority), style) + 1;
        let words = format!("{} {}", translate(&def.message), translate(alarm.state.word()));
        canvas.text(x, y, &fit_words(&words, wide.saturating_sub(x)), style);
        y += 1;
    }
    if y == rows + 2 {
        canvas.text(0, y, t!("no alarm"), cx.theme.dim());
        y += 1;
    }
    y += 1;
    if let Some(tuning) = cx.snapshot.tuning(device.id) {
        for (n, words) in tuning_text(cx, faceplate, tuning).into_iter().enumerate() {
            let style = if n == 0 { cx.theme.strong() } else { cx.theme.normal() };
            for line in wrap(&words, wide) {
                canvas.text(0, y, &line, style);
                y += 1;
            }
        }
        y += 1;
    }
    if let Some(run) = cx.snapshot.control_run(device.id) {
        for line in run_text(run).iter().flat_map(|words| wrap(words, wide)) {
            canvas.text(0, y, &line, run_style(cx, run));
            y += 1;
        }
        y += 1;
    }
    let at = Bounds { x: 0, y, width: wide, height: high.saturating_sub(y).min(12) };
    if at.height > 3 {
        trend::view(cx, canvas, at, faceplate.pv, WINDOW, series, false);
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bars {
    /// Three rows each: value, bar, ends of the scale.
    Tall,
    /// A row each, with the ends of the scale behind it.
    Row,
    /// A row each, without the ends of the scale.
    Bare,
}

/// The bars of PV, SV and MV.
pub fn bars(cx: &ViewContext, canvas: &mut Canvas, faceplate: &Faceplate, layout: Bars) {
    let tall = layout == Bars::Tall;
    let rows = [("PV", Some(faceplate.pv)), ("SV", Some(faceplate.sv_to_show())), ("MV", faceplate.mv)];
    let rows: Vec<(&str, TagId)> = rows.into_iter().filter_map(|(name, tag)| Some((name, tag?))).collect();
    // All bars start in one column, so that they can be compared.
    let values = rows.iter().map(|(_, tag)| width(&value::show(cx, *tag).with_unit())).max().unwrap_or(0).clamp(9, 14);
    for (n, (name, tag)) in rows.into_iter().enumerate() {
        let y = to_u16(n) * if tall { 3 } else { 1 };
        let shown = value::show(cx, tag);
        canvas.text(if tall { 0 } else { 1 }, y, name, cx.theme.dim());
        let room = if tall { canvas.width().saturating_sub(4) } else { values };
        let end = canvas.text(4, y, &shown.within(room), shown.style);
        let apart = beside(cx, faceplate, tag);
        if let Some(words) = apart.as_ref().filter(|_| tall) {
            canvas.text(end + 2, y, words, cx.theme.strong());
        }
        // PV and SV share the scale of PV, so that their distance is seen.
        let scale = if tag == faceplate.sv_to_show() { faceplate.pv } else { tag };
        let ends = ends(cx, scale);
        let (x, y, wide) = if tall {
            if let Some((low, high)) = &ends {
                canvas.text(0, y + 2, low, cx.theme.dim());
                canvas.text_right(canvas.width(), y + 2, high, cx.theme.dim());
            }
            (0, y + 1, canvas.width())
        } else {
            let words = ends.map_or(t!("range unknown").to_owned(), |(low, high)| format!("{low} … {high}"));
            let words = if layout == Bars::Row { apart.unwrap_or(words) } else { apart.unwrap_or_default() };
            let behind = match layout {
                Bars::Tall | Bars::Row => 18,
                // Bars of one scale are equally long.
                Bars::Bare if scale == faceplate.pv => sv_difference(cx, faceplate).map_or(0, |words| width(&words)),
                Bars::Bare => width(&words),
            };
            let wide = canvas.width().saturating_sub(5 + values + 1 + behind);
            canvas.text(5 + values + wide + 1, y, &words, cx.theme.dim());
            (5 + values, y, wide)
        };
        bar(cx, &mut canvas.part(x, y, wide, 1), faceplate, tag, scale);
    }
}

/// What is said beside a value: an SV that is set and not in use, an output as it is at the terminals.
fn beside(cx: &ViewContext, faceplate: &Faceplate, tag: TagId) -> Option<String> {
    if tag == faceplate.sv_to_show() {
        return sv_difference(cx, faceplate);
    }
    let output = cx.def().device(cx.def().tag(tag).device).output.filter(|_| faceplate.mv == Some(tag))?;
    output.text(cx.snapshot.sample(tag).good_value()?)
}

/// The ends of a tag's range: `0.0`, `120.0 °C`.
fn ends(cx: &ViewContext, tag: TagId) -> Option<(String, String)> {
    let (min, max) = cx.snapshot.bounds(tag)?;
    let text = |value| cx.snapshot.format(tag, value);
    Some((text(min), format!("{} {}", text(max), cx.snapshot.unit(tag)).trim_end().to_owned()))
}

/// `├███━━━━━──▼──┃──┤`: filled up to the value; the normal band is heavy, the setpoint a triangle, alarm limits are bars; of SV only the
/// triangle, on a track that is dotted where it may not be set. Without a good value there is no filling.
fn bar(cx: &ViewContext, canvas: &mut Canvas, faceplate: &Faceplate, tag: TagId, scale: TagId) {
    let theme = cx.theme;
    let inner = canvas.width().saturating_sub(2);
    canvas.run(0, 0, inner + 2, '─', theme.dim());
    canvas.glyph(0, 0, '├', theme.dim());
    canvas.glyph(inner + 1, 0, '┤', theme.dim());
    let Some((min, max)) = cx.snapshot.range(scale) else { return };
    let column = |value: f64| {
        let share = (value - min) / (max - min);
        share.is_finite().then(|| 1 + to_u16((share.clamp(0.0, 1.0) * f64::from(inner.saturating_sub(1))).round()))
    };
    let now = cx.snapshot.sample(tag).good_value();
    let band = cx.def().tag(tag).normal.map(|[low, high]| (column(low), column(high)));
    if let Some((Some(low), Some(high))) = band {
        canvas.run(low, 0, (high + 1).saturating_sub(low), theme.pick('━', '='), theme.normal());
    }
    if tag == faceplate.sv_to_show() {
        if let Some((low, high)) =
            cx.snapshot.range(faceplate.sv).and_then(|(low, high)| Some((column(low)?, column(high)?)))
        {
            canvas.run(1, 0, low.saturating_sub(1), '·', theme.dim());
            canvas.run(high + 1, 0, (inner + 1).saturating_sub(high + 1), '·', theme.dim());
        }
    } else if let Some(end) = now.and_then(column) {
        let alarm = cx.snapshot.alarms_of(tag).next();
        // Never reversed: a reversed full block is an empty one.
        let style = alarm.map_or(theme.normal(), |alarm| {
            let priority = cx.def().alarm(alarm.id).priority;
            theme.alarm(priority, alarm.state, false).remove_modifier(Modifier::REVERSED)
        });
        canvas.run(1, 0, end, '█', style);
    }
    for limit in limits(cx, tag) {
        if let Some(x) = column(limit) {
            canvas.glyph(x, 0, '┃', theme.strong());
        }
    }
    if scale == faceplate.pv
        && let Some(x) = cx.snapshot.sample(faceplate.sv_to_show()).good_value().and_then(column)
    {
        canvas.glyph(x, 0, '▼', theme.set_value());
    }
}

/// The limits of a tag's alarms.
fn limits(cx: &ViewContext, tag: TagId) -> impl Iterator<Item = f64> {
    let of_tag = cx.def().alarms.iter().filter(move |alarm| alarm.subject == Subject::Tag(tag));
    of_tag.filter_map(|alarm| alarm.condition.on_scale())
}

/// `PID   AT off   RUN   ‹2›! temperature high UNACK`.
pub fn states(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, faceplate: &Faceplate) {
    let mut x = 1;
    for (name, tag) in [("", faceplate.mode), (t!("AT"), faceplate.tune), ("", faceplate.run)] {
        let Some(tag) = tag else { continue };
        if !name.is_empty() {
            x = canvas.text(x, 0, name, cx.theme.dim()) + 1;
        }
        let shown = value::show(cx, tag);
        x = canvas.text(x, 0, &shown.bare(12), shown.style) + 3;
    }
    let alarms: Vec<_> = list::alarms(cx, device.id).collect();
    let Some(alarm) = alarms.first() else { return };
    let def = cx.def().alarm(alarm.id);
    let more = if alarms.len() > 1 { t!(", {count} more", count = alarms.len() - 1) } else { String::new() };
    let words = format!(
        "{} {} {}{more}",
        cx.theme.priority_tag(def.priority),
        translate(&def.message),
        translate(alarm.state.word())
    );
    let room = canvas.width().saturating_sub(x);
    canvas.text(x, 0, &fit_words(&words, room), cx.theme.alarm(def.priority, alarm.state, cx.flash()));
}

fn tuning_row(cx: &ViewContext, canvas: &mut Canvas, faceplate: &Faceplate, tuning: &Tuning) {
    let words = tuning_text(cx, faceplate, tuning).join("  ");
    let room = canvas.width().saturating_sub(2);
    let style = if tuning.ended.is_none() { cx.theme.strong() } else { cx.theme.normal() };
    canvas.text(1, 0, &pad(&fit_words(&words, room), room), style);
}

fn run_style(cx: &ViewContext, run: &ControlRun) -> Style {
    if run.is_running() { cx.theme.strong() } else { cx.theme.dim() }
}

/// How a control run goes, or has gone: what it is, and its figures.
fn run_text(run: &ControlRun) -> [String; 2] {
    let head = format!("{}: {}, {}", run_label(run), control_runs::setpoint(run), translate(run.state.word()));
    [head, control_runs::figures(run).join(", ")]
}

/// `Run 17 12:45`.
fn run_label(run: &ControlRun) -> String {
    t!("Run {number} {lasted}", number = run.number, lasted = control_runs::clock(run.lasted()))
}

/// How a tuning goes, or what it has found.
pub fn tuning_text(cx: &ViewContext, faceplate: &Faceplate, tuning: &Tuning) -> Vec<String> {
    let elapsed = running(tuning.elapsed(cx.now));
    let least = if tuning.seen { "" } else { t!("more than ") };
    let number = |value: f64| cx.snapshot.format(faceplate.pv, value);
    let Some(ended) = tuning.ended else {
        let around = tuning.sv.map_or(String::new(), |sv| t!(" around {number}", number = number(sv)));
        let turns = tuning.extrema.iter().rev().take(4).rev();
        let arrow = |high| if high { cx.theme.pick("↑", "^") } else { cx.theme.pick("↓", "v") };
        let turns: Vec<String> = turns.map(|turn| format!("{}{}", arrow(turn.high), number(turn.pv))).collect();
        let swings = if turns.is_empty() {
            t!("no oscillation yet").to_owned()
        } else {
            t!("oscillation {join}", join = turns.join(" "))
        };
        let period = tuning.period().map_or(String::new(), |period| t!(", {period} s each", period = period.as_secs()));
        let known = faceplate.tune.is_some_and(|tune| cx.snapshot.sample(tune).good_value().is_some());
        let how = if known { t!("AUTO-TUNING") } else { t!("unknown now; AUTO-TUNING when last read") };
        return vec![
            t!("{how} {least}{elapsed}{around} (T stops)", how, least, elapsed, around),
            format!("{swings}{period}"),
        ];
    };
    let found = tuning.found.iter().map(|found| {
        let text = |value: Option<f64>| value.map_or("?".to_owned(), |value| cx.snapshot.format(found.tag, value));
        let unit = cx.snapshot.unit(found.tag);
        format!("{} {} → {} {unit}", cx.def().tag(found.tag).short, text(found.old), text(found.new))
            .trim_end()
            .to_owned()
    });
    let at = clock(ended, &cx.def().time_zone);
    let words: Vec<String> = found.collect();
    // Stopped by hand, given up, ended by a broken sensor: it looks the same from here, and nothing was found.
    let same = tuning.found.iter().all(|found| found.new.is_some() && found.new == found.old);
    let how = if same { t!("tuning ended, nothing changed,") } else { t!("tuned") };
    vec![t!("{how} {at} in {least}{elapsed}", how, at, least, elapsed), words.join("  ")]
}
