//! What stands beside the list of alarms on a wide screen: all that is known of the selected one, else what happened last.

use super::{Alarms, guidance, journal::event_text, recent};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::alarm::ActiveAlarm,
    ui::{modal::reason::subject, rights},
};

/// Least and greatest width; the list is at least so wide.
const WIDTH: (u16, u16) = (40, 64);
const LIST_MIN: u16 = 78;
/// Cells of the bar of the time to respond.
const BAR: u16 = 16;
/// Rows of the curve of what the alarm watches, at least and at most.
const CURVE: (u16, u16) = (7, 14);
/// Earlier times that are listed.
const TIMES_MAX: usize = 6;

/// Columns of the panel on a tab of this width.
pub fn columns(width: u16) -> u16 {
    width.saturating_sub(LIST_MIN).clamp(WIDTH.0, WIDTH.1)
}

/// A row: its name at the left, its words.
type LabelledRow = (&'static str, String, Style);

pub fn view(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    for y in 0..canvas.height() {
        canvas.text(0, y, cx.theme.pick("┊", "|"), cx.theme.dim());
    }
    let (width, height) = (canvas.width().saturating_sub(2), canvas.height());
    let mut canvas = canvas.part(2, 0, width, height);
    match tab.selected(cx) {
        Some(alarm) => selected(tab, cx, alarm, &mut canvas),
        None => last_events(tab, cx, &mut canvas),
    }
}

fn selected(tab: &Alarms, cx: &ViewContext, alarm: &ActiveAlarm, canvas: &mut Canvas) {
    let (def, theme) = (cx.def().alarm(alarm.id), cx.theme);
    let (width, indent) = (canvas.width(), guidance::names());
    let may = rights::missing(cx, &alarm.acknowledge()).is_none();
    let ack = if alarm.state.needs_acknowledgement() && may && !cx.is_past() { t!("a ack ") } else { "" };
    let condition = guidance_text::condition_text(cx, def.id);
    let tag = theme.priority_tag(def.priority);
    let title = format!("{ack}{tag} {} {} {condition}", subject(cx, def.id), translate(&def.message));
    let mut y = 0;
    for line in wrap(title.trim_end(), width) {
        canvas.text(0, y, &line, theme.strong());
        y += 1;
    }
    if let Some((words, over)) = guidance_text::respond_text(cx, def, alarm) {
        let style = if over { theme.trouble() } else { theme.strong() };
        for line in wrap(&words, width) {
            canvas.text(0, y, &line, style);
            y += 1;
        }
        if let Some(response) = guidance_text::response(def, alarm, cx.now) {
            canvas.text(0, y, &draw::bar(cx, response.share(), usize::from(BAR.max(width / 2))), style);
            y += 1;
        }
    }
    y += 1;
    let guide = guidance_text::rows(cx, alarm).into_iter().map(|(label, text)| {
        let style = if guidance::is_of_action(label) { theme.strong() } else { theme.normal() };
        (label, text, style)
    });
    let rows: Vec<LabelledRow> = guide.chain(before(tab, cx, alarm)).collect();
    let go = wrap(&guidance::go_text(cx, def, Some(alarm)), width.saturating_sub(indent));
    let last = canvas.height().saturating_sub(to_u16(go.len()));
    for (label, text, style) in rows {
        if y < last {
            canvas.text(0, y, label, theme.dim());
        }
        for line in wrap(&text, width.saturating_sub(indent)) {
            if y < last {
                canvas.text(indent, y, &line, style);
            }
            y += 1;
        }
    }
    let free = last.saturating_sub(y + 2);
    if CURVE.0 <= free {
        tab.recent.draw_curve(cx, &mut canvas.part(0, y + 1, width, free.min(CURVE.1)));
    }
    canvas.text(0, last, t!("go to"), theme.dim());
    for (n, line) in go.iter().enumerate() {
        canvas.text(indent, last + to_u16(n), line, theme.normal());
    }
}

/// How often it was raised before, and what was done the last times.
fn before(tab: &Alarms, cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<LabelledRow> {
    let (def, normal) = (cx.def().alarm(alarm.id), cx.theme.normal());
    let since = |at| cx.local(at, "%m-%d %H:%M");
    let [searched, actions] = tab.recent.searched_since();
    let Some((times, all)) = tab.recent.before(cx, def, alarm.raised_at) else {
        return vec![(t!("before"), t!("collecting data").to_owned(), cx.theme.dim())];
    };
    let days = recent::DAYS;
    let head = match (searched.map(since), times) {
        (None, 0) => t!("none recorded in the last {days} days", days),
        (None, 1) => t!("once in {days} days", days),
        (None, times) => t!("{times} times in {days} days", times, days),
        (Some(time), 0) => t!("none recorded since {time}", time),
        (Some(time), 1) => t!("once since {time}", time),
        (Some(time), times) => t!("{times} times since {time}", times, time),
    };
    let mut rows = vec![(t!("before"), head, normal)];
    let words = actions.map(|at| t!("actions are recorded since {time}", time = since(at)));
    rows.extend(words.map(|words| ("", words, cx.theme.strong())));
    for occurrence in all.iter().take(TIMES_MAX) {
        let at = since(occurrence.raised_at);
        let lasted = occurrence.lasted.map(|lasted| t!("  for {lasted}", lasted = running(lasted)));
        rows.push(("", format!("{at}{}", lasted.unwrap_or_default()), normal));
        rows.extend(occurrence.done.iter().map(|done| ("", format!("· {done}"), cx.theme.strong())));
    }
    let more = all.len().saturating_sub(TIMES_MAX);
    rows.extend((more > 0).then(|| ("", t!("… and {more} earlier times", more), cx.theme.dim())));
    rows
}

/// Where no alarm is active: what the journal holds last.
fn last_events(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    let dim = cx.theme.dim();
    canvas.text(0, 0, t!("last events"), dim);
    let Some((events, quiet)) = tab.recent.events() else {
        canvas.text(0, 1, t!("collecting data"), dim);
        return;
    };
    if events.is_empty() && quiet == 0 {
        canvas.text(0, 1, t!("none"), dim);
    }
    let mut y = 1;
    if 0 < quiet {
        let words = t!("{quiet} not annunciated: d in the journal", quiet);
        for line in wrap(&words, canvas.width()) {
            canvas.text(0, y, &line, dim);
            y += 1;
        }
    }
    for record in events {
        if canvas.height() <= y {
            return;
        }
        let x = canvas.text(0, y, &pad(&moment(record.at, cx.now, &cx.def().time_zone), 10), dim);
        for line in wrap(&event_text(cx, record), canvas.width().saturating_sub(x)) {
            canvas.text(x, y, &line, cx.theme.normal());
            y += 1;
        }
    }
}
