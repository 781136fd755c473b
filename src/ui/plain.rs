//! The plant in plain lines, for screen readers and logs: what stands at first, then one line for each change, in words.

use std::collections::BTreeMap;

use jiff::{SignedDuration, Timestamp};
use ratatui::layout::Rect;

use super::{
    Clock, QueryNumbers, ViewContext,
    context::view_context,
    modal::{faceplate::unknown_text, reason::subject},
    preferences::Preferences,
    tabs::alarms::actions,
    theme::Theme,
    widgets::{text::stamp, value},
};
use crate::{
    access::SessionStatus,
    plant::{
        Snapshot,
        alarm::AlarmState,
        def::{AlarmId, DeviceId, LineDef, LineId, TagId},
        line_state::{DeviceState, LineState},
        sample::{Cause, Quality},
        tag::{Access, TagDef},
    },
    t,
    text::{of_plant, translate},
};

/// What a line is about, in the order in which the first lines stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fact {
    Station,
    Line(LineId),
    Device(DeviceId),
    Alarm(AlarmId),
    Suppressed(AlarmId),
    Tag(TagId),
}

/// What was written of a fact last.
#[derive(Debug, Clone, PartialEq)]
struct Written {
    text: String,
    quality: Option<Quality>,
    at: Timestamp,
}

/// The facts as they were written last.
#[derive(Debug)]
pub(crate) struct Plain {
    /// A value is written at most once in so long (real time); a change of its quality at once.
    every: SignedDuration,
    written: BTreeMap<Fact, Written>,
}

impl Plain {
    /// Nothing is written yet.
    pub(crate) fn new(every: SignedDuration) -> Plain {
        Plain { every, written: BTreeMap::new() }
    }

    /// A line for each fact that changed: time, and what stands now.
    pub(crate) fn lines(&mut self, snapshot: &Snapshot, session: &SessionStatus) -> Vec<String> {
        let (theme, preferences, extension) = (Theme::PLAIN, Preferences::default(), None);
        let numbers = QueryNumbers::default();
        let parts = (&theme, &preferences);
        let cx = &view_context(snapshot, parts, Clock::default(), Rect::default(), &extension, (session, &numbers));
        let at = stamp(snapshot.at, &cx.def().time_zone);
        let facts = facts(cx);
        let is_gone = |fact: &Fact| matches!(fact, Fact::Alarm(_) | Fact::Suppressed(_)) && !facts.contains_key(fact);
        let mut lines: Vec<String> = self
            .written
            .keys()
            .filter(|fact| is_gone(fact))
            .filter_map(|fact| Some(format!("{at}  {}", gone(cx, *fact, &facts)?.replace('\u{200b}', ""))))
            .collect();
        self.written.retain(|fact, _| !is_gone(fact));
        let pause = self.every.as_secs_f64() * snapshot.speed.clamp(0.0, 1e6);
        for (fact, (text, quality)) in facts {
            let is_due = self.written.get(&fact).is_none_or(|last| {
                let rested = pause <= snapshot.at.duration_since(last.at).abs().as_secs_f64();
                last.text != text && (quality.is_none() || last.quality != quality || rested)
            });
            if is_due {
                // Where a line may break is no part of a text that is read out or searched.
                lines.push(format!("{at}  {}", text.replace('\u{200b}', "")));
                self.written.insert(fact, Written { text, quality, at: snapshot.at });
            }
        }
        lines
    }
}

/// All facts in words, with the quality of a value.
fn facts(cx: &ViewContext) -> BTreeMap<Fact, (String, Option<Quality>)> {
    let (def, snapshot) = (cx.def(), cx.snapshot);
    let station = match &cx.session.gone {
        Some(why) => t!("station lost: {why}", why),
        None if snapshot.samples.iter().any(|sample| sample.quality == Quality::Bad(Cause::NotAuthorised)) => {
            t!("station of {title}, values are shown after a login (--user)", title = of_plant(&def.title))
        }
        None => t!("station of {title}", title = of_plant(&def.title)),
    };
    // While a lost line is tried again nothing is new.
    let is_retry = |line: LineId| {
        let status = snapshot.line(line);
        matches!(status.state, LineState::Connecting) && status.lost_since.is_some()
    };
    let lines = def.lines.iter().filter(|line| !is_retry(line.id)).map(|line| {
        let state = line_label(line, &snapshot.line(line.id).state);
        (Fact::Line(line.id), t!("line {name}: {state}", name = line.name, state))
    });
    let devices = def.devices.iter().filter(|device| !is_retry(device.line)).map(|device| {
        let status = snapshot.device(device.id);
        let why = status.diagnosis.map(|reason| format!(", {reason}")).unwrap_or_default();
        let state = device_label(cx, device.id);
        (Fact::Device(device.id), t!("device {name}: {state}{why}", name = device.name, state, why))
    });
    let alarm = |line: String| t!("alarm: {line}", line);
    let alarms = snapshot.alarms.iter().map(|active| {
        let fields = actions::fields(cx, active, alarm_label(active.state));
        let fields: Vec<&str> = fields.iter().map(String::as_str).filter(|field| !field.is_empty()).collect();
        (Fact::Alarm(active.id), alarm(fields.join(", ")))
    });
    let suppressed = snapshot.suppressed.iter().map(|suppressed| {
        let state = translate(suppressed.state.word());
        let active = if suppressed.active { t!(" ACTIVE") } else { "" };
        (Fact::Suppressed(suppressed.id), format!("{}: {state}{active}", alarm(name(cx, suppressed.id))))
    });
    let plain = [(Fact::Station, station)].into_iter().chain(lines).chain(devices).chain(alarms).chain(suppressed);
    let is_shown = |tag: &&TagDef| {
        tag.access != Access::Write && snapshot.sample(tag.id).quality != Quality::Bad(Cause::NotAuthorised)
    };
    let tags = def.tags.iter().filter(is_shown).map(|tag| {
        let (quality, shown) = (snapshot.sample(tag.id).quality, value::show(cx, tag.id));
        let value = if quality.is_bad() { t!("no value").to_owned() } else { shown.with_unit() };
        let label = if tag.label.is_empty() { String::new() } else { format!(" ({})", of_plant(&tag.label)) };
        (Fact::Tag(tag.id), (format!("{}{label}: {value}, {quality}", tag.name), Some(quality)))
    });
    plain.map(|(fact, text)| (fact, (text, None))).chain(tags).collect()
}

fn name(cx: &ViewContext, alarm: AlarmId) -> String {
    format!("{}, {}", subject(cx, alarm), translate(&cx.def().alarm(alarm).message))
}

/// What is said of an alarm that is in no list any more; nothing where it went from one list into the other.
fn gone(cx: &ViewContext, fact: Fact, facts: &BTreeMap<Fact, (String, Option<Quality>)>) -> Option<String> {
    let (alarm, other, words) = match fact {
        Fact::Alarm(alarm) => (alarm, Fact::Suppressed(alarm), t!("normal")),
        Fact::Suppressed(alarm) => (alarm, Fact::Alarm(alarm), t!("no longer suppressed")),
        Fact::Station | Fact::Line(_) | Fact::Device(_) | Fact::Tag(_) => return None,
    };
    let line = format!("{}, {words}", name(cx, alarm));
    (!facts.contains_key(&other)).then(|| t!("alarm: {line}", line))
}

fn line_label(line: &LineDef, state: &LineState) -> String {
    match state {
        LineState::Connecting => t!("connecting").to_owned(),
        LineState::NoTraffic => t!("no traffic heard").to_owned(),
        LineState::Connected if line.listens => t!("listening").to_owned(),
        LineState::Connected => t!("connected").to_owned(),
        LineState::Disconnected => t!("disconnected by an operator").to_owned(),
        LineState::Testing => t!("in use by a test").to_owned(),
        LineState::Waiting { why, .. } => format!("{}, {}", t!("not connected"), why),
    }
}

/// The state of an alarm in full: the words of the lists are short, and are read out as letters.
fn alarm_label(state: AlarmState) -> &'static str {
    match state {
        AlarmState::Unacknowledged => t!("active, not acknowledged"),
        AlarmState::Acknowledged => t!("active, acknowledged"),
        AlarmState::ReturnedToNormal => t!("returned to normal, not acknowledged"),
        AlarmState::LatchedUnacknowledged => t!("returned to normal, latched, not acknowledged"),
        AlarmState::LatchedAcknowledged => t!("returned to normal, latched, acknowledged"),
        AlarmState::Normal | AlarmState::Shelved | AlarmState::SuppressedByDesign | AlarmState::OutOfService => {
            translate(state.word())
        }
    }
}

fn device_label(cx: &ViewContext, device: DeviceId) -> &'static str {
    match cx.snapshot.device(device).state {
        DeviceState::Unknown => unknown_text(cx, device),
        DeviceState::Responding => t!("responding"),
        DeviceState::Failing(_) => t!("requests fail"),
        DeviceState::Down { .. } => t!("not responding"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        text::Language,
        ui::fixture::{Fixture, session},
    };

    fn plain() -> Plain {
        Plain::new(SignedDuration::from_secs(10))
    }

    #[test]
    fn every_fact_stands_at_first_in_words() {
        let lines = plain().lines(&Fixture::alarm().snapshot(), &session());
        for words in [
            "station of Water tank",
            "line L1: connected",
            "device TIC-1: responding",
            "TIC-1.PV, temperature high, active, not acknowledged",
            "TIC-1.PV (process value): 72.4 °C, good",
        ] {
            let has = |line: &String| line.starts_with("2026-11-21T14:0") && line.contains(words);
            assert!(lines.iter().any(has), "{words}: {lines:#?}");
        }
        let heard = plain().lines(&Fixture::listening().snapshot(), &session());
        assert!(heard.iter().any(|line| line.contains(": listening")), "{heard:#?}");
        let no_control = |line: &String| !line.chars().any(char::is_control);
        assert!(lines.iter().all(no_control), "{lines:#?}");
    }

    #[test]
    fn a_change_is_one_line_and_the_same_is_none() {
        let mut fixture = Fixture::normal();
        let mut plain = plain();
        plain.lines(&fixture.snapshot(), &session());
        assert_eq!(plain.lines(&fixture.snapshot(), &session()), [""; 0]);
        let mut after = |fixture: &Fixture, seconds: i64| {
            let mut snapshot = (*fixture.snapshot()).clone();
            snapshot.at += SignedDuration::from_secs(seconds);
            plain.lines(&snapshot, &session())
        };
        fixture.set("TIC-1.PV", 99.0);
        assert_eq!(after(&fixture, 1), [""; 0], "a value waits");
        let lines = after(&fixture, 10);
        assert!(lines.len() == 1 && lines[0].ends_with("TIC-1.PV (process value): 99.0 °C, good"), "{lines:?}");
        let tag = fixture.tag("TIC-1.PV");
        fixture.samples[tag.index()].quality = Quality::Bad(Cause::Timeout);
        let lines = after(&fixture, 11);
        assert!(lines.len() == 1 && lines[0].ends_with("no value, bad: response timeout"), "at once: {lines:?}");
    }

    #[test]
    fn an_alarm_comes_and_goes() {
        let mut plain = plain();
        plain.lines(&Fixture::normal().snapshot(), &session());
        let came = plain.lines(&Fixture::alarm().snapshot(), &session());
        assert!(came.iter().any(|line| line.contains("alarm: ") && line.contains("temperature high")), "{came:?}");
        let went = plain.lines(&Fixture::normal().snapshot(), &session());
        assert!(went.iter().any(|line| line.ends_with("TIC-1.PV, temperature high, normal")), "{went:?}");
    }

    #[test]
    fn the_lines_are_in_the_language_of_the_terminal() {
        let snapshot = Fixture::normal().snapshot();
        let lines = Language::THAI.locale().within(|| plain().lines(&snapshot, &session()));
        assert!(!lines.iter().any(|line| line.contains("responding")), "{lines:?}");
    }
}
