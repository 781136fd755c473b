//! The active alarms in words, and why some may be missing.

use super::{
    ViewContext,
    modal::{
        faceplate::{device_alarm_text, line_state_text},
        reason::subject,
    },
    widgets::{text::running, value},
};
use crate::{
    plant::{
        alarm::{ActiveAlarm, AlarmState},
        def::{Priority, Subject},
        time::elapsed,
    },
    t,
    text::translate,
};

/// `history: disk full`; nothing while the history is well.
pub fn history_text(cx: &ViewContext) -> Option<String> {
    cx.snapshot.history.words().map(|words| t!("history: {words}", words))
}

/// `UNACK 00:41  TIC-1.PV temperature high  72.4 °C`.
pub fn alarm_words(cx: &ViewContext, alarm: &ActiveAlarm) -> String {
    let (text, value) = what_text(cx, alarm);
    format!("{}  {text}  {value}", state_text(cx, alarm))
}

/// `TIC-1.PV temperature high` and `72.4 °C`.
pub fn what_text(cx: &ViewContext, alarm: &ActiveAlarm) -> (String, String) {
    let def = cx.def().alarm(alarm.id);
    let now = match def.subject {
        Subject::Tag(tag) => value::show(cx, tag).with_unit(),
        Subject::Device(device) => device_alarm_text(cx, alarm.id, device),
        Subject::Line(line) => line_state_text(cx, line),
        Subject::Station => cx.snapshot.fault_details(alarm.id).to_owned(),
    };
    let message = translate(&def.message);
    // The message of "no traffic heard" is the state of its line.
    let now = if now == message { String::new() } else { now };
    (format!("{} {message}", subject(cx, alarm.id)), now)
}

/// `UNACK 00:41`: the state and how long it lasts.
pub fn state_text(cx: &ViewContext, alarm: &ActiveAlarm) -> String {
    format!("{} {}", translate(alarm.state.word()), running(elapsed(since(alarm), cx.now)))
}

/// Since when an alarm has been as it is: raised, or returned to normal. The one time that is counted from on every page.
pub fn since(alarm: &ActiveAlarm) -> jiff::Timestamp {
    match alarm.state {
        AlarmState::ReturnedToNormal | AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged => {
            alarm.returned_at.unwrap_or(alarm.raised_at)
        }
        AlarmState::Normal
        | AlarmState::Unacknowledged
        | AlarmState::Acknowledged
        | AlarmState::Shelved
        | AlarmState::SuppressedByDesign
        | AlarmState::OutOfService => alarm.raised_at,
    }
}

/// How many of each priority: `[1]!1 (3)2`.
pub fn counts(cx: &ViewContext) -> String {
    let all =
        [Priority::Critical, Priority::High, Priority::Medium, Priority::Low].into_iter().filter_map(|priority| {
            let count = cx.snapshot.alarms.iter().filter(|alarm| cx.def().alarm(alarm.id).priority == priority).count();
            (count > 0).then(|| format!("{}×{count}", cx.theme.priority_tag(priority)))
        });
    all.collect::<Vec<_>>().join(" ")
}
