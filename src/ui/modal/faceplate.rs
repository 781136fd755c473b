//! What there is to know about an item of the mimic: its tags with value, quality, age, range, alarms and device.

use crate::t;
use crate::text::{of_plant, translate};
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Confirm, Modal, Next, Notice, Why, plant_command,
    sheet::{Fact, Sheet},
    window,
    write_words::wire_text,
};
use crate::{
    access::right,
    plant::{
        command::CommandKind,
        def::{AlarmId, Condition, DeviceId, Subject, TagId},
        entry,
        line_state::{DeviceState, LineState},
        ne107::Reason,
        tag::{Access, Poll},
        time::elapsed,
    },
    ui::{
        ViewContext, interlock, keys,
        keys::Hint,
        rights,
        widgets::{
            actuator_mark,
            text::{age, clock, fit, pad, width},
            value,
        },
    },
};

/// The tags of an item, one of them looked at closely.
#[derive(Debug, Clone, PartialEq)]
pub struct Faceplate {
    title: String,
    tags: Vec<TagId>,
    selected: usize,
}

impl Faceplate {
    /// A faceplate; `None` for an item without tags.
    pub fn new(title: impl Into<String>, tags: Vec<TagId>) -> Option<Faceplate> {
        (!tags.is_empty()).then(|| Faceplate { title: title.into(), tags, selected: 0 })
    }

    /// The faceplate of what an alarm watches.
    pub fn of(cx: &ViewContext, subject: Subject) -> Option<Faceplate> {
        match subject {
            Subject::Tag(tag) => Faceplate::new(cx.def().tag(tag).label.clone(), vec![tag]),
            Subject::Device(device) => {
                let tags = cx.def().tags_of(device).take(8).map(|tag| tag.id).collect();
                Faceplate::new(format!("{} {}", cx.def().device(device).name, device_text(cx, device)), tags)
            }
            Subject::Line(_) | Subject::Station => None,
        }
    }

    pub(super) fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let mut hints = Vec::new();
        if self.tags.len() > 1 {
            hints.push(Hint::in_window("↑↓", t!("select")));
        }
        match (self.toggle(cx), command_tag(cx, self.tag())) {
            // Nothing is written in the past.
            _ if cx.is_past() => {}
            (Some((tag, value)), _) => {
                let words = format!("{} {}", cx.snapshot.format(tag, value), cx.def().tag(self.tag()).short);
                let role = right::needs(cx.def(), &CommandKind::Write { tag, value: value.into() });
                hints.insert(0, Hint::in_window("t", &words).needs(role));
            }
            (None, Some(tag)) if tag != self.tag() => {
                let words = t!("write {short}", short = cx.def().tag(tag).short);
                hints.push(Hint::in_window("⏎", words).needs(rights::to_write(cx, [tag])));
            }
            (None, Some(tag)) => hints.push(Hint::in_window("⏎", t!("write")).needs(rights::to_write(cx, [tag]))),
            (None, None) => {}
        }
        hints.push(Hint::in_window("w", t!("why")));
        hints.push(Hint::in_window(t!("Esc"), t!("close")));
        hints
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        match event.code {
            KeyCode::Up => self.selected = self.selected.saturating_sub(1),
            KeyCode::Down => self.selected = (self.selected + 1).min(self.tags.len() - 1),
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => {
                let window = command_tag(cx, self.tag()).and_then(|tag| Modal::write(cx, tag));
                return Next::Stay(window.unwrap_or(Modal::Faceplate(self)));
            }
            KeyCode::Char('w') if keys::char('w').is(event) => {
                let why = Why::new(self.tags.clone(), self.selected.min(self.tags.len() - 1));
                return Next::Stay(why.map_or(Modal::Faceplate(self), Modal::Why));
            }
            KeyCode::Char('t') if keys::char('t').is(event) => {
                return Next::Stay(self.clone().asked(cx).unwrap_or(Modal::Faceplate(self)));
            }
            KeyCode::Char('q') => return Next::Close,
            _ => {}
        }
        Next::Stay(plant_command::command_of(cx, event).unwrap_or(Modal::Faceplate(self)))
    }

    /// The other state of the selected actuator: its command, and the value.
    fn toggle(&self, cx: &ViewContext) -> Option<(TagId, f64)> {
        let command = cx.def().logic.actuator(self.tag())?.1.command;
        Some((command, interlock::other_state(cx, command)?))
    }

    /// The confirmation of the other state; where the command would have no effect, that of the state that it needs
    /// comes first, as a step of its own.
    fn asked(self, cx: &ViewContext) -> Option<Modal> {
        let (_, actuator) = cx.def().logic.actuator(self.tag())?;
        if let Some(notice) = Notice::unreachable(cx, cx.def().tag(actuator.command).device) {
            return Some(Modal::Notice(notice));
        }
        let Some((command, value)) = self.toggle(cx) else { return Modal::write(cx, actuator.command) };
        let refused = interlock::is_refused(cx, command, value.into());
        let missing = interlock::unmet(cx, actuator).filter(|(need, _)| {
            // An unknown state is no reason to write.
            cx.def().tag(*need).writable() && cx.snapshot.sample(*need).good_value().is_some() && !refused
        });
        let confirm = match missing {
            Some((need, state)) => {
                let words = t!(
                    "{name} has no effect now. Change this first, then press t again for the command.",
                    name = cx.def().tag(command).name
                );
                Confirm::from_faceplate(cx, need, state, Some(words), self)
            }
            None => Confirm::from_faceplate(cx, command, value, None, self),
        };
        Some(Modal::Confirm(confirm))
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let names = self.tags.iter().map(|tag| width(&cx.def().tag(*tag).name)).max().unwrap_or(0);
        let room = body.width.saturating_sub(8).min(64);
        let details = Sheet::new(details(cx, self.tag()), room, 9);
        let list = self.tags.len();
        let mut canvas = window(cx, frame, body, of_plant(&self.title), (room, list + 1 + details.len()));
        for (y, tag) in self.tags.iter().enumerate() {
            let def = cx.def().tag(*tag);
            let shown = value::show(cx, *tag);
            let name = if y == self.selected { cx.theme.focus() } else { cx.theme.normal() };
            let x = canvas.text(0, y, &pad(&def.name, names), name);
            let room = canvas.width().saturating_sub(x + 2);
            let x = canvas.text(x + 2, y, &shown.within(room), shown.style);
            let left = canvas.width().saturating_sub(x + 2);
            let x = canvas.text(x + 2, y, &fit(of_plant(&def.label), left), cx.theme.dim());
            if let Some((words, style)) = actuator_mark::mark(cx, *tag).filter(|_| 1 < self.tags.len()) {
                let left = canvas.width().saturating_sub(x + 2);
                canvas.text(x + 2, y, &fit(&words, left), style);
            }
        }
        let (width, height) = (canvas.width(), canvas.height());
        details.view(cx.theme, &mut canvas.part(0, list + 1, width, height), 0);
    }

    fn tag(&self) -> TagId {
        self.tags[self.selected.min(self.tags.len() - 1)]
    }
}

/// What is known about one tag.
fn details(cx: &ViewContext, tag: TagId) -> Vec<Fact> {
    let (theme, def, sample) = (cx.theme, cx.def().tag(tag), cx.snapshot.sample(tag));
    let quality = match def.access {
        Access::Write => t!("none: write only").to_owned(),
        Access::Read | Access::ReadWrite => sample.quality.to_string(),
    };
    let read = match def.access {
        Access::Write => t!("never").to_owned(),
        Access::Read | Access::ReadWrite if cx.is_past() => {
            t!("stored {age} before, {clock}", age = age(cx.age(tag)), clock = clock(sample.at, &cx.def().time_zone))
        }
        Access::Read | Access::ReadWrite => {
            t!("{age} ago, {clock}", age = age(cx.age(tag)), clock = clock(sample.at, &cx.def().time_zone))
        }
    };
    let poll = match def.poll {
        Poll::Every(period) => t!("every {period} s", period = period.as_secs_f64()),
        Poll::Once => t!("once, and on refresh").to_owned(),
        Poll::Never => t!("on request only").to_owned(),
    };
    let access = match def.access {
        Access::Read => t!("read only"),
        Access::ReadWrite => t!("read and write"),
        Access::Write => t!("write only"),
    };
    let device = cx.def().device(def.device);
    // What can be done comes first, what there is to know about the tag behind it.
    let mut rows = interlock::facts(cx, tag);
    rows.extend([
        (t!("quality"), quality, theme.quality(sample.quality)),
        (t!("read"), format!("{read} ({poll})"), theme.normal()),
        (t!("range"), entry::range_text(cx.snapshot, tag).trim_start_matches(t!("range ")).to_owned(), theme.normal()),
        (
            t!("access"),
            t!(
                "{access}  {wire_text}  map row {confidence}",
                access,
                wire_text = wire_text(def),
                confidence = translate(def.confidence.word())
            ),
            theme.normal(),
        ),
        (
            t!("device"),
            t!(
                "{name} {model} unit {unit} on {name2}  {device_text}",
                name = device.name,
                model = device.model,
                unit = device.unit,
                name2 = cx.def().line(device.line).name,
                device_text = device_text(cx, def.device)
            ),
            theme.normal(),
        ),
    ]);
    for alarm in cx.snapshot.alarms_of(tag) {
        let def = cx.def().alarm(alarm.id);
        let [message, state] = [&*def.message, alarm.state.word()].map(translate);
        let text = format!("{} {message} {state}", theme.priority_mark(def.priority));
        rows.push((t!("alarm"), text, theme.alarm(def.priority, alarm.state, cx.flash())));
    }
    if !def.meaning.is_empty() {
        rows.push((t!("meaning"), of_plant(&def.meaning).to_owned(), theme.normal()));
    }
    rows.into_iter().map(|(label, text, style)| Fact::new(label, text, style)).collect()
}

/// What Enter writes for a tag: itself, or the command of an output that is only read.
fn command_tag(cx: &ViewContext, tag: TagId) -> Option<TagId> {
    if cx.def().tag(tag).writable() { Some(tag) } else { command_of(cx, tag) }
}

/// The command of an output that is only read.
fn command_of(cx: &ViewContext, tag: TagId) -> Option<TagId> {
    let (_, actuator) = cx.def().logic.actuator(tag)?;
    (actuator.output == tag).then_some(actuator.command)
}

/// Why nothing is known of a device: it was not polled yet, or its master was not heard.
pub fn unknown_text(cx: &ViewContext, device: DeviceId) -> &'static str {
    if cx.def().listens_on(cx.def().device(device).line) { t!("not heard yet") } else { t!("not polled yet") }
}

/// How a device stands, in words.
pub fn device_text(cx: &ViewContext, device: DeviceId) -> String {
    let status = cx.snapshot.device(device);
    match status.state {
        DeviceState::Unknown => unknown_text(cx, device).to_owned(),
        DeviceState::Responding => match status.response_time {
            Some(reply) => t!("OK, {reply} ms", reply = reply.as_millis()),
            None => t!("OK").to_owned(),
        },
        DeviceState::Failing(n) => t!("failing, {n} in a row", n),
        DeviceState::Down { since } => {
            t!(
                "DOWN since {clock}{retry_text}",
                clock = clock(since, &cx.def().time_zone),
                retry_text = retry_text(cx, device)
            )
        }
    }
}

/// What an alarm of a device says now: how the device stands, or what it takes where the alarm is about that.
pub fn device_alarm_text(cx: &ViewContext, alarm: AlarmId, device: DeviceId) -> String {
    let report = cx.snapshot.line(cx.def().device(device).line).report.as_ref();
    let time = report.and_then(|report| report.device_time(device));
    let reason = match cx.def().alarm(alarm).condition {
        Condition::SlowerThanStated => time.and_then(Reason::above_stated),
        _ => None,
    };
    reason.map_or_else(|| device_text(cx, device), |reason| reason.to_string())
}

/// `, retry in 12 s` for a device that does not answer.
pub fn retry_text(cx: &ViewContext, device: DeviceId) -> String {
    let report = cx.snapshot.line(cx.def().device(device).line).report.as_ref();
    match report.and_then(|report| report.retry_at(device)) {
        Some(at) if cx.now < at => t!(", retry {ceil} s", ceil = elapsed(cx.now, at).as_secs_f64().ceil()),
        Some(_) => t!(", retrying").to_owned(),
        None => String::new(),
    }
}

/// How a line stands, in words.
pub fn line_state_text(cx: &ViewContext, line: crate::plant::def::LineId) -> String {
    let status = cx.snapshot.line(line);
    match &status.state {
        LineState::NoTraffic => t!("no traffic heard").to_owned(),
        LineState::Connecting => t!("connecting").to_owned(),
        LineState::Connected => match status.report.as_ref().and_then(|report| report.strain.as_deref()) {
            Some(strain) => strain.trim_start_matches("line overloaded: ").to_owned(),
            None if cx.def().listens_on(line) => t!("listening").to_owned(),
            None => t!("connected").to_owned(),
        },
        LineState::Disconnected => t!("disconnected by an operator").to_owned(),
        LineState::Testing => t!("in use by a test").to_owned(),
        LineState::Waiting { why, .. } => t!("not connected: {why}", why),
    }
}
