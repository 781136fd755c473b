//! The line of alarms that is on every tab: the most urgent one, how many there are, and why some might not be seen.

use super::{Canvas, Model, SILENCE, ViewContext, fit_words, width};
use crate::t;
use crate::{
    plant::{
        alarm::{ActiveAlarm, AlarmState},
        line_state::{DeviceState, LineState},
        ne107::Reason,
    },
    ui::{
        alarm_text::{counts, history_text, state_text, what_text},
        rights,
    },
};

/// The most urgent alarm that waits for an acknowledgement, else trouble of the history, else the most urgent alarm; and
/// the counts by priority. "No alarms" is said only when alarms could be seen.
pub(super) fn banner(model: &Model, cx: &ViewContext, canvas: &mut Canvas) {
    let alarms = &cx.snapshot.alarms;
    let trouble = history_text(cx);
    let foremost = cx.snapshot.foremost_alarm();
    let foremost = foremost.filter(|alarm| alarm.state.needs_acknowledgement() || trouble.is_none());
    let Some(alarm) = foremost else {
        let seen_none = alarms.is_empty();
        let blind = if seen_none { blind_text(model, cx) } else { silent_text(model).map(|why| not_judged(&why)) };
        let room = canvas.width().saturating_sub(1);
        match [blind, trouble].into_iter().flatten().reduce(|blind, trouble| format!("{blind}   {trouble}")) {
            Some(words) => canvas.text(1, 0, &fit_words(&words, room), cx.theme.trouble()),
            None if cx.def().is_bench() => {
                canvas.text(1, 0, t!("no plant file: no alarms, no history"), cx.theme.dim())
            }
            None => canvas.text(1, 0, t!("no alarms"), cx.theme.dim()),
        };
        let suppressed = suppressed_words(cx);
        if canvas.is_blank(room.saturating_sub(width(&suppressed) + 2), 0, width(&suppressed) + 2) {
            canvas.text_right(room, 0, &suppressed, cx.theme.normal());
        }
        return;
    };
    let def = cx.def().alarm(alarm.id);
    let waiting = alarm.state.needs_acknowledgement();
    let (mark, style) =
        (cx.theme.alarm(def.priority, alarm.state, cx.flash()), cx.theme.alarm(def.priority, alarm.state, false));
    let x = canvas.text(1, 0, cx.theme.priority_mark(def.priority), mark) + 1;
    let x = canvas.text(x, 0, &state_text(cx, alarm), style) + 2;
    let room = canvas.width();
    // The key is shown where it acts on this very alarm: on the alarms tab it acts on the selected one.
    let meant = model.alarm_to_acknowledge().is_some_and(|meant| meant.id == alarm.id);
    let may = rights::missing(cx, &alarm.acknowledge()).is_none();
    let ack = if waiting && meant && may { t!("a ack ") } else { "" };
    let worry = worry_text(model, cx);
    let (suppressed, silenced) = (suppressed_words(cx), if is_silenced(cx) { t!("silenced   ") } else { "" });
    let suppressed = if suppressed.is_empty() { suppressed } else { format!("{suppressed}   ") };
    let counts = counts(cx);
    // A long text must not push out the counts, the mark of an unacknowledged alarm and the reason for doubt.
    let tails = [
        (25, format!("{worry}{counts}   {suppressed}{silenced}{ack}")),
        (25, format!("{worry}{counts}   {suppressed}{ack}")),
        (14, format!("{worry}{counts}   {ack}")),
        (8, format!("{worry}{ack}")),
    ];
    let (text, value) = what_text(cx, alarm);
    let fits = |least: u16, tail: &str| x + width(&text).min(least) + 2 + width(tail) <= room;
    let tail = tails.iter().find(|(least, tail)| fits(*least, tail)).map_or("", |(_, tail)| tail.trim_end());
    let end = room.saturating_sub(1);
    let left = end.saturating_sub(x + if tail.is_empty() { 0 } else { 2 + width(tail) });
    let whole = format!("{text}  {value}").trim_end().to_owned();
    let shown = if width(&whole) <= left { whole } else { fit_words(&text, left) };
    canvas.text(x, 0, &shown, style);
    canvas.text_right(end, 0, tail, cx.theme.normal());
    if !worry.is_empty() && tail.starts_with(worry.trim_end()) {
        canvas.text(end.saturating_sub(width(tail)), 0, worry.trim_end(), cx.theme.trouble());
    }
}

/// Why more may be wrong than can be seen: the station evaluates nothing, or there is a flood.
fn worry_text(model: &Model, cx: &ViewContext) -> String {
    let blind = if silent_text(model).is_some() { t!("alarms not evaluated   ") } else { "" };
    let flood = if cx.snapshot.alarm_metrics.flood_since.is_some() { t!("FLOOD   ") } else { "" };
    format!("{blind}{flood}")
}

/// `3 suppressed`: shelved or out of service. What is suppressed by design is as it should be, and stands
/// on the alarms tab only.
fn suppressed_words(cx: &ViewContext) -> String {
    let by_operator =
        cx.snapshot.suppressed.iter().filter(|suppressed| suppressed.state != AlarmState::SuppressedByDesign);
    match by_operator.count() {
        0 => String::new(),
        many => t!("{many} suppressed", many),
    }
}

/// Something is active and unacknowledged, and was silenced.
fn is_silenced(cx: &ViewContext) -> bool {
    let sounds = |alarm: &ActiveAlarm| alarm.state == AlarmState::Unacknowledged;
    !cx.snapshot.sound && cx.snapshot.alarms.iter().any(sounds)
}

/// Why alarms may be there without being seen: `alarms not evaluated: L1 disconnected`.
fn blind_text(model: &Model, cx: &ViewContext) -> Option<String> {
    let snapshot = cx.snapshot;
    let silent = silent_text(model);
    if cx.def().is_bench() {
        // It has no alarms; the line's state stands on its tabs.
        return silent;
    }
    let lines = cx.def().lines.iter().filter_map(|line| match snapshot.line(line.id).state {
        LineState::Connected => None,
        LineState::Disconnected => Some(t!("{name} disconnected", name = line.name)),
        LineState::NoTraffic => Some(t!("{name} no traffic heard", name = line.name)),
        LineState::Testing => Some(t!("{name} in use by a test", name = line.name)),
        LineState::Connecting | LineState::Waiting { .. } => Some(t!("{name} not connected", name = line.name)),
    });
    let devices = cx.def().devices.iter().filter(|device| snapshot.line(device.line).state == LineState::Connected);
    let devices = devices.filter_map(|device| match snapshot.device(device.id).state {
        DeviceState::Down { .. } => Some(t!("{name} not responding", name = device.name)),
        DeviceState::Responding | DeviceState::Failing(_)
            if snapshot.device(device.id).diagnosis == Some(Reason::NoValues) =>
        {
            Some(t!("{name} has no valid values", name = device.name))
        }
        DeviceState::Unknown | DeviceState::Responding | DeviceState::Failing(_) => None,
    });
    let blind: Vec<String> = silent.into_iter().chain(lines).chain(devices).collect();
    (!blind.is_empty()).then(|| not_judged(&blind.join(", ")))
}

fn not_judged(why: &str) -> String {
    t!("alarms not evaluated: {why}", why)
}

/// Why nothing is heard of the station.
fn silent_text(model: &Model) -> Option<String> {
    match &model.session.gone {
        Some(why) => Some(t!("station disconnected: {why}", why)),
        None => (model.clock.silent >= SILENCE).then(|| t!("station not responding").to_owned()),
    }
}
