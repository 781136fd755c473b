//! What there is to say about an alarm: how it stands, its cause, effect and action, and the time there is left.

use std::time::Duration;

use jiff::Timestamp;

use crate::{
    plant::{
        alarm::{ActiveAlarm, SuppressedAlarm},
        def::{AlarmDef, AlarmId, Subject},
        time::elapsed,
    },
    t,
    text::translate,
    ui::{
        ViewContext,
        modal::{
            faceplate::{device_alarm_text, line_state_text},
            reason::subject,
        },
        widgets::{
            text::{clock, moment, running},
            value,
        },
    },
};

/// What there is to say about a listed alarm.
pub fn rows(cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<(&'static str, String)> {
    rows_of_any(cx, alarm.id, now_text(cx, alarm), Some(alarm))
}

/// What there is to say about any alarm; `now` says how it stands. The action of a listed one is a checklist: its steps are
/// rows of their own, without a label but for the first.
pub fn rows_of_any(
    cx: &ViewContext,
    alarm: AlarmId,
    now: String,
    listed: Option<&ActiveAlarm>,
) -> Vec<(&'static str, String)> {
    let guidance = &cx.def().alarm(alarm).guidance;
    let mut rows =
        vec![(t!("now"), now), (t!("cause"), words(&guidance.cause)), (t!("effect"), words(&guidance.effect))];
    let steps = listed.into_iter().flat_map(|listed| guidance.steps().map(|step| step_text(cx, listed, step)));
    let labels = std::iter::once(t!("action")).chain(std::iter::repeat(""));
    let steps: Vec<_> = labels.zip(steps).collect();
    if steps.is_empty() {
        rows.push((t!("action"), words(&guidance.action)));
    }
    rows.extend(steps);
    rows
}

/// A text of the plant file, or one of the station's own, whose parts are translated.
fn words(text: &str) -> String {
    or_dash(&text.split("; ").map(translate).collect::<Vec<_>>().join("; ")).to_owned()
}

/// `[x] lower SV (anna 14:02:31)`, `[_] check SSR lamp`.
fn step_text(cx: &ViewContext, alarm: &ActiveAlarm, step: &str) -> String {
    let (done, step) = (alarm.step(step), translate(step));
    let Some(done) = done else { return format!("[_] {step}") };
    let by = done.by.as_deref().unwrap_or(t!("the station"));
    let at = moment(done.at, cx.now, &cx.def().time_zone);
    let lost = if done.recorded { "" } else { t!(" (NOT RECORDED)") };
    format!("[x] {step} ({by} {at}){lost}")
}

fn or_dash(text: &str) -> &str {
    if text.is_empty() { "–" } else { text }
}

/// The value now and when it was raised, how often, and who acknowledged it.
pub fn now_text(cx: &ViewContext, alarm: &ActiveAlarm) -> String {
    let zone = &cx.def().time_zone;
    let mut words = match cx.def().alarm(alarm.id).subject {
        Subject::Tag(tag) => {
            let raised = alarm.value.map_or("–".to_owned(), |value| value::number(cx, tag, value));
            t!("{whole}, raised at {raised}", whole = value::show(cx, tag).whole(), raised)
        }
        Subject::Device(device) => device_alarm_text(cx, alarm.id, device),
        Subject::Line(line) => line_state_text(cx, line),
        Subject::Station => cx.snapshot.fault_details(alarm.id).to_owned(),
    };
    if 1 < alarm.times {
        words += &t!(", {times} times since the start", times = alarm.times);
    }
    if let Some(note) = &alarm.acknowledged {
        let by = note.by.as_deref().unwrap_or(t!("the station"));
        words += &t!(", acknowledged {clock} by {by}", clock = clock(note.at, zone), by);
        if !note.recorded {
            words += t!(" (NOT RECORDED)");
        }
        if let Some(reason) = &note.reason {
            words += &format!(": {reason}");
        }
    }
    words
}

/// The time to respond to an active alarm, and how much of it is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Response {
    allowed: Duration,
    gone: Duration,
}

/// The time to respond to this alarm; nothing where the plant file gives none, or once the condition has cleared.
pub fn response(def: &AlarmDef, alarm: &ActiveAlarm, now: Timestamp) -> Option<Response> {
    let allowed = def.guidance.response_time.filter(|_| alarm.state.is_active())?;
    Some(Response { allowed, gone: elapsed(alarm.raised_at, now) })
}

impl Response {
    /// How much is left; `Err` by how much it is over.
    fn left(self) -> Result<Duration, Duration> {
        self.allowed.checked_sub(self.gone).ok_or(self.gone.saturating_sub(self.allowed))
    }
    /// The share of the time that is gone; above 1 once it is over.
    pub fn share(self) -> f64 {
        self.gone.as_secs_f64() / self.allowed.as_secs_f64().max(1.0)
    }
    /// `09:19`, `OVERDUE`.
    pub fn short(self) -> String {
        self.left().map_or(t!("OVERDUE").to_owned(), running)
    }
}

/// `respond within 10 min, 09:19 left`, and whether that time is over; nothing where the plant file gives no time.
pub fn respond_text(cx: &ViewContext, def: &AlarmDef, alarm: &ActiveAlarm) -> Option<(String, bool)> {
    let respond = def.guidance.response_time?;
    let within = t!("respond within {div_ceil} min", div_ceil = respond.as_secs().div_ceil(60));
    let Some(response) = response(def, alarm, cx.now) else { return Some((within, false)) };
    Some(match response.left() {
        Ok(left) => (t!("{within}, {running} left", within, running = running(left)), false),
        Err(over) => (t!("{within}, OVERDUE by {running}", within, running = running(over)), true),
    })
}

/// The limit of an alarm: `> 72.0`; empty where there is none.
pub fn condition_text(cx: &ViewContext, alarm: AlarmId) -> String {
    let def = cx.def().alarm(alarm);
    let number = |value: f64| match def.subject {
        Subject::Tag(tag) => cx.snapshot.format(tag, value),
        Subject::Device(_) | Subject::Line(_) | Subject::Station => value.to_string(),
    };
    def.condition.text(number, |tag| cx.def().tag(tag).short.clone())
}

/// `shelved ‹2›! TIC-1.PV temperature high, 41:00 left, by anna: sensor is cleaned, since 13:20:00`.
pub fn suppressed_words(cx: &ViewContext, suppressed: &SuppressedAlarm) -> String {
    let def = cx.def().alarm(suppressed.id);
    let mark = cx.theme.priority_tag(def.priority);
    let left = suppressed
        .until
        .map(|until| t!(", {running} left", running = running(elapsed(cx.now, until))))
        .unwrap_or_default();
    let since = moment(suppressed.note.at, cx.now, &cx.def().time_zone);
    let by = suppressed.note.by.as_ref().map(|by| t!(", by {by}", by)).unwrap_or_default();
    let reason = suppressed.note.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
    let active = if suppressed.active { t!(" ACTIVE") } else { "" };
    let name = subject(cx, suppressed.id);
    t!(
        "{state} {mark} {name} {message}{active}{left}{by}{reason}, since {since}",
        state = translate(suppressed.state.word()),
        mark,
        name,
        message = translate(&def.message),
        active,
        left,
        by,
        reason,
        since
    )
}
