//! What to do about an alarm: cause, effect, action, the time there is left, and where to look.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        alarm::ActiveAlarm,
        def::{AlarmDef, AlarmId, Subject},
        station_fault::STATION,
    },
    ui::{
        modal::{
            faceplate::{device_alarm_text, line_state_text},
            reason::subject,
        },
        rights,
    },
};

/// Columns of the names at the left, with a blank before and behind them.
pub fn names() -> u16 {
    let names = [t!("now"), t!("cause"), t!("effect"), t!("action"), t!("before"), t!("go to")];
    names.into_iter().map(|name| text::width(name) + 2).max().unwrap_or(0).max(9)
}

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

/// Is it a row of the action?
pub fn is_of_action(label: &str) -> bool {
    label.is_empty() || label == t!("action")
}

/// The rows of the screen that all of it needs, with its title and the way on.
pub fn height(rows: &[(&str, String)], width: u16) -> u16 {
    let room = width.saturating_sub(names() + 1);
    rows.iter().map(|(_, text)| to_u16(wrap(text, room).len())).sum::<u16>() + 2
}

/// Draws it; for a listed alarm with the keys that act on it, and how long there is to respond.
pub fn view(cx: &ViewContext, id: AlarmId, listed: Option<&ActiveAlarm>, now: String, canvas: &mut Canvas) {
    let def = cx.def().alarm(id);
    let respond = listed.and_then(|alarm| respond_text(cx, def, alarm));
    let style = |overdue| if overdue { cx.theme.trouble() } else { cx.theme.strong() };
    let respond = respond.map(|(words, overdue)| (format!(" {words} "), style(overdue)));
    let cut = title(cx, def, listed, respond, canvas);
    draw(cx, cut.as_deref(), &rows_of_any(cx, id, now, listed), &go_text(cx, def, listed), canvas);
}

/// Which alarm it is about; at the right how long there is to respond. Its whole name, where there was no room for that.
fn title(
    cx: &ViewContext,
    def: &AlarmDef,
    listed: Option<&ActiveAlarm>,
    respond: Option<(String, Style)>,
    canvas: &mut Canvas,
) -> Option<String> {
    let (width, theme) = (canvas.width(), cx.theme);
    canvas.run(0, 0, width, '─', theme.dim());
    let (words, style) = respond.unwrap_or_default();
    let end = width.saturating_sub(1);
    canvas.text_right(end, 0, &words, style);
    // On this tab `a` is for this alarm, which need not be the one of the banner.
    let mine = listed.is_some_and(|alarm| {
        alarm.state.needs_acknowledgement() && rights::missing(cx, &alarm.acknowledge()).is_none()
    });
    let ack = if mine { t!("a ack ") } else { "" };
    let name =
        format!(" {ack}{} {} {}", theme.priority_tag(def.priority), subject(cx, def.id), translate(&def.message));
    let whole = format!("{name} {}", condition_text(cx, def.id));
    let room = end.saturating_sub(text::width(&words) + 3);
    let shown =
        if text::width(whole.trim_end()) <= room { whole.trim_end().to_owned() } else { fit_words(&name, room) };
    canvas.text(1, 0, &format!("{shown} "), theme.strong());
    (room < text::width(&name)).then(|| name.trim_start().to_owned())
}

/// Draws the rows below the title, above them the `name` where the title has it only in part.
fn draw(cx: &ViewContext, name: Option<&str>, rows: &[(&str, String)], go: &str, canvas: &mut Canvas) {
    let theme = cx.theme;
    let (width, height) = (canvas.width(), canvas.height());
    let room = width.saturating_sub(names() + 1);
    let mut y = 1;
    for line in name.iter().flat_map(|name| wrap(name, width.saturating_sub(2))) {
        canvas.text(1, y, &line, theme.strong());
        y += 1;
    }
    // Where there is no room for all of it the action is shown whole, and one line of the others; the least wanted go.
    let free = usize::from(height.saturating_sub(1 + y));
    // More steps than rows end above the last row; the window has all of them.
    let last = height.saturating_sub(1);
    let mut rows: Vec<&(&str, String)> = rows.iter().collect();
    for least in [t!("effect"), t!("cause"), t!("now")] {
        if free < rows.len() {
            rows.retain(|(label, _)| *label != least);
        }
    }
    let lines: Vec<Vec<String>> = rows.iter().map(|(_, text)| wrap(text, room)).collect();
    let whole = lines.iter().map(Vec::len).sum::<usize>() <= free;
    let mut spare = free.saturating_sub(rows.len());
    for ((label, text), lines) in rows.iter().zip(lines) {
        let style = if is_of_action(label) { theme.strong() } else { theme.normal() };
        if y < last {
            canvas.text(1, y, label, theme.dim());
        }
        let shown = match (whole, is_of_action(label)) {
            (true, _) => lines,
            (false, true) => {
                let more = lines.len().saturating_sub(1).min(spare);
                spare -= more;
                lines.into_iter().take(1 + more).collect()
            }
            (false, false) => vec![fit_words(text, room)],
        };
        for line in shown {
            if y < last {
                canvas.text(names(), y, &line, style);
            }
            y += 1;
        }
    }
    canvas.text(1, last, t!("go to"), theme.dim());
    canvas.text(names(), last, &fit_words(go, room), theme.normal());
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
    /// The time that is gone as a bar: `██████────`.
    pub fn bar(self, cx: &ViewContext, cells: u16) -> String {
        draw::bar(cx, self.gone.as_secs_f64() / self.allowed.as_secs_f64().max(1.0), usize::from(cells))
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

/// The keys that lead from an alarm to what it watches.
pub fn go_text(cx: &ViewContext, def: &AlarmDef, alarm: Option<&ActiveAlarm>) -> String {
    let at =
        alarm.map(|alarm| t!(" at {clock}", clock = clock(alarm.raised_at, &cx.def().time_zone))).unwrap_or_default();
    let journal = t!("j journal of {journal_of}", journal_of = journal_of(cx, def.subject));
    match def.subject {
        Subject::Tag(_) => t!("m mimic   t trend{at}   c controller   {journal}", at, journal),
        Subject::Device(_) => t!("m mimic   c controller   {journal}", journal),
        Subject::Line(_) | Subject::Station => journal,
    }
}

/// What the journal is searched for: the whole device, because its settings are what often makes the alarm of a tag.
pub fn journal_of<'a>(cx: &ViewContext<'a>, subject: Subject) -> &'a str {
    let def = cx.def();
    match subject {
        Subject::Tag(tag) => &def.device(def.tag(tag).device).name,
        Subject::Device(device) => &def.device(device).name,
        Subject::Line(line) => &def.line(line).name,
        Subject::Station => STATION,
    }
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
