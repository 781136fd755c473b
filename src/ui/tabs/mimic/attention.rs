//! What an operator must look at: what needs an action, and what is not as it usually is.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        alarm::{ActiveAlarm, AlarmState},
        command::{CommandStatus, Outcome},
        def::Subject,
        line_state::LineState,
        sample::Cause,
    },
    ui::{
        alarm_text::since,
        modal::{
            faceplate::{device_text, line_state_text},
            reason::subject,
        },
    },
};

/// A row of a list with its look.
pub type AttentionRow = (String, Style);

/// A failed command is listed for so long.
const FAILED_FOR: SignedDuration = SignedDuration::from_mins(30);

/// Alarms, failed commands, lines and devices that do not respond, outputs that do not follow, in this order.
pub fn needs_action(cx: &ViewContext) -> Vec<AttentionRow> {
    let (def, snapshot, trouble) = (cx.def(), cx.snapshot, cx.theme.trouble());
    let has_alarm = |subject| snapshot.alarms.iter().any(|alarm| def.alarm(alarm.id).subject == subject);
    let is_lost = |line: &LineDef| match snapshot.line(line.id).state {
        LineState::Connecting | LineState::Waiting { .. } | LineState::NoTraffic => true,
        LineState::Connected | LineState::Disconnected | LineState::Testing => false,
    };
    let lines = def.lines.iter().filter(|line| is_lost(line) && !has_alarm(Subject::Line(line.id)));
    let lines = lines.map(|line| (format!("{}  {}", line.name, line_state_text(cx, line.id)), trouble));
    // What the state of its line does not explain.
    let devices = def.devices.iter().filter(|device| {
        snapshot.line(device.line).state == LineState::Connected
            && !responds(cx, device)
            && !has_alarm(Subject::Device(device.id))
    });
    let devices = devices.map(|device| (format!("{}  {}", device.name, device_text(cx, device.id)), trouble));
    let outputs = def.logic.actuators.iter().enumerate().filter_map(|(n, actuator)| {
        let lasts = snapshot.actuators.feedback_mismatch(&def.logic, n, snapshot.at)?;
        let name = &def.tag(actuator.output).name;
        Some((t!("{name} has not followed its command for {running}", name, running = running(lasts)), trouble))
    });
    alarms(cx).chain(failed_commands(cx)).chain(lines).chain(devices).chain(outputs).collect()
}

/// The active alarms, in order of urgency.
fn alarms(cx: &ViewContext) -> impl Iterator<Item = AttentionRow> {
    let row = |alarm: &ActiveAlarm| {
        let def = cx.def().alarm(alarm.id);
        let (mark, since) = (cx.theme.priority_mark(def.priority), running(elapsed(since(alarm), cx.now)));
        let text = format!("{mark} {since}  {} {}", subject(cx, alarm.id), translate(&def.message));
        (text, cx.theme.alarm(def.priority, alarm.state, cx.flash()))
    };
    cx.snapshot.alarms.iter().map(row)
}

/// Commands that failed lately, unless a later one for the same tag went well.
fn failed_commands(cx: &ViewContext) -> impl Iterator<Item = AttentionRow> {
    let commands = &cx.snapshot.commands;
    let has_failed = |status: &CommandStatus| match status.outcome {
        Outcome::Refused(_) | Outcome::NotConfirmed(_) | Outcome::Failed(_) => true,
        Outcome::Pending | Outcome::Verified | Outcome::Unchanged | Outcome::Sent => false,
    };
    let is_latest = move |n: usize, tag| {
        let mut later = commands[..n].iter().filter_map(|status| status.command.kind.written_tag());
        !later.any(|other| other == tag)
    };
    commands.iter().enumerate().filter_map(move |(n, status)| {
        let (tag, value) = cx.snapshot.written(&status.command.kind)?;
        let is_recent = cx.now.duration_since(status.outcome_at) <= FAILED_FOR;
        if !has_failed(status) || !is_recent || !is_latest(n, tag) {
            return None;
        }
        let name = &cx.def().tag(tag).name;
        let mark = cx.theme.pick("✗", "x");
        Some((
            t!("{mark} {name} := {value} {outcome}", mark, name, value, outcome = status.outcome),
            cx.theme.trouble(),
        ))
    })
}

/// Bad and uncertain values, values outside their normal band, manual operation and suppressed alarms, in this order.
pub fn not_normal(cx: &ViewContext) -> Vec<AttentionRow> {
    let (def, snapshot, normal) = (cx.def(), cx.snapshot, cx.theme.normal());
    // What the state of its device does not explain.
    let values = def.tags.iter().filter(|tag| tag.is_read() && responds(cx, def.device(tag.device)));
    let values = values.filter(|tag| snapshot.sample(tag.id).quality.cause().is_some_and(is_trouble)).map(|tag| {
        let shown = value::show(cx, tag.id);
        (format!("{}  {} {}", tag.name, shown.text, shown.note), shown.style)
    });
    let outside = def.tags.iter().filter_map(|tag| {
        let words = outside_text(cx, tag.id)?;
        Some((format!("{}  {}  {words}", tag.name, value::show(cx, tag.id).with_unit()), cx.theme.strong()))
    });
    let manual = def.logic.sequences.iter().filter_map(|sequence| {
        let (tag, auto) = sequence.auto?;
        let now = snapshot.sample(tag).good_value().filter(|now| *now != auto)?;
        Some((format!("{}  {}", def.tag(tag).name, snapshot.format(tag, now)), cx.theme.strong()))
    });
    let lines = def.lines.iter().filter(|line| match snapshot.line(line.id).state {
        LineState::Disconnected | LineState::Testing => true,
        LineState::Connected | LineState::Connecting | LineState::Waiting { .. } | LineState::NoTraffic => false,
    });
    let lines = lines.map(|line| (format!("{}  {}", line.name, line_state_text(cx, line.id)), cx.theme.strong()));
    let suppressed = snapshot.suppressed.iter().filter(|alarm| alarm.state != AlarmState::SuppressedByDesign);
    let suppressed = suppressed.map(|alarm| (guidance_text::suppressed_words(cx, alarm), normal));
    values.chain(outside).chain(manual).chain(lines).chain(suppressed).collect()
}

/// `below 55.0 … 70.0`, of a good value outside its normal band.
pub fn outside_text(cx: &ViewContext, tag: TagId) -> Option<String> {
    let [low, high] = cx.def().tag(tag).normal?;
    let now = cx.snapshot.sample(tag).good_value()?;
    let [from, to] = [low, high].map(|end| cx.snapshot.format(tag, end));
    match (now < low, high < now) {
        (true, _) => Some(t!("below normal {from} … {to}", from, to)),
        (_, true) => Some(t!("above normal {from} … {to}", from, to)),
        (false, false) => None,
    }
}

fn responds(cx: &ViewContext, device: &DeviceDef) -> bool {
    cx.snapshot.device(device.id).state == DeviceState::Responding
}

/// Has a value of this cause been asked for in vain? What is not polled or stored is as it should be.
fn is_trouble(cause: Cause) -> bool {
    match cause {
        Cause::Timeout
        | Cause::Corrupt
        | Cause::Exception
        | Cause::Stale
        | Cause::NotHeard
        | Cause::SensorFault
        | Cause::Unscaled
        | Cause::Undefined
        | Cause::Unreadable => true,
        Cause::NotRead
        | Cause::NotReadBack
        | Cause::Stated
        | Cause::Unproven
        | Cause::DeviceDown
        | Cause::NotConnected
        | Cause::StationOff
        | Cause::Reloaded
        | Cause::NotAuthorised
        | Cause::NotStored
        | Cause::OnRequest
        | Cause::NotPresent => false,
    }
}

/// Sections of rows with their headings, each at most so many rows and `none` where it has none; returns the row below.
pub fn sections(cx: &ViewContext, canvas: &mut Canvas, rows_max: usize, sections: &[(&str, Vec<AttentionRow>)]) -> u16 {
    let (width, dim) = (canvas.width(), cx.theme.dim());
    let mut y = 0;
    for (title, rows) in sections {
        let x = canvas.text(0, y, title, dim);
        if rows.is_empty() {
            canvas.text(x + 2, y, t!("none"), dim);
        } else {
            canvas.text_right(width, y, &rows.len().to_string(), cx.theme.normal());
        }
        y += 1;
        for (text, style) in rows.iter().take(rows_max) {
            for (n, line) in wrap(text, width.saturating_sub(INDENT)).into_iter().enumerate() {
                canvas.text(if n == 0 { 0 } else { INDENT }, y, &line, *style);
                y += 1;
            }
        }
        if let more @ 1.. = rows.len().saturating_sub(rows_max) {
            canvas.text(0, y, &t!("and {more} more", more), cx.theme.normal());
            y += 1;
        }
        y += 1;
    }
    y
}

/// Columns by which the second line of a row stands back.
const INDENT: u16 = 5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::{
            alarm::SuppressedAlarm,
            command::{Command, CommandId, Refusal},
            sample::{Quality, Sample},
        },
        ui::fixture::{Fixture, now, with_cx},
    };

    fn rows(snapshot: &Snapshot, list: fn(&ViewContext) -> Vec<AttentionRow>) -> Vec<String> {
        with_cx(snapshot, list).into_iter().map(|(text, _)| text).collect()
    }

    #[test]
    fn what_is_not_normal_is_listed_once() {
        let normal = Fixture::normal();
        assert!(rows(&normal.snapshot(), not_normal).is_empty());
        let mut stale = Fixture::normal();
        let pv = stale.tag("TIC-1.PV");
        stale.samples[pv.index()] = Sample { quality: Quality::Uncertain(Cause::Stale), ..stale.samples[pv.index()] };
        let shown = rows(&stale.snapshot(), not_normal);
        assert!(shown.len() == 1 && shown[0].starts_with("TIC-1.PV  64.2?"), "{shown:?}");
        // The line and its devices explain their values.
        let down = Fixture::line_down().snapshot();
        assert!(rows(&down, not_normal).is_empty());
        let shown = rows(&down, needs_action);
        assert!(shown.len() == 2 && shown[1].contains("not connected"), "an alarm, and the line: {shown:?}");
    }

    #[test]
    fn what_is_read_on_request_only_is_never_called_abnormal() {
        use crate::plant::tag::{Access, Poll};
        let mut fixture = Fixture::normal();
        let pv = fixture.tag("TIC-1.PV");
        for (access, poll) in [(Access::ReadWrite, Poll::Never), (Access::Write, Poll::Never)] {
            (fixture.def.tags[pv.index()].access, fixture.def.tags[pv.index()].poll) = (access, poll);
            for cause in [Cause::Stale, Cause::OnRequest, Cause::Timeout] {
                fixture.samples[pv.index()].quality = Quality::Uncertain(cause);
                assert!(rows(&fixture.snapshot(), not_normal).is_empty(), "{cause:?}");
            }
        }
    }

    #[test]
    fn values_outside_and_what_is_done_by_hand_are_listed() {
        let mut fixture = Fixture::normal();
        fixture.set("TIC-1.PV", 71.5);
        fixture.set("PLC-1.AUTO", 0.0);
        let note = crate::plant::alarm::state::OperatorNote { at: now(), by: None, reason: None, recorded: true };
        let (id, state) = (crate::plant::def::AlarmId(2), AlarmState::OutOfService);
        fixture.suppressed = vec![SuppressedAlarm { id, state, note, until: None, active: false }];
        let shown = rows(&fixture.snapshot(), not_normal);
        assert!(shown.len() == 3 && shown[2].contains("level low"), "{shown:?}");
        assert_eq!(shown[..2], ["TIC-1.PV  71.5 °C  above normal 55.0 … 70.0", "PLC-1.AUTO  MANUAL"]);
        // An uncertain value is not taken for one outside.
        let pv = fixture.tag("TIC-1.PV");
        fixture.samples[pv.index()].quality = Quality::Uncertain(Cause::Stale);
        assert!(rows(&fixture.snapshot(), not_normal)[0].contains("71.5?"));
    }

    #[test]
    fn a_failed_command_is_listed_until_one_goes_well() {
        let fixture = Fixture::normal();
        let mut snapshot = Snapshot::clone(&fixture.snapshot());
        let kind = CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.0.into() };
        let given = |outcome, ago| {
            let at = now() - SignedDuration::from_mins(ago);
            let command = Command::new(7, CommandId::default(), kind.clone());
            CommandStatus { outcome, ..CommandStatus::new(command, "anna", at) }
        };
        snapshot.commands = vec![given(Outcome::Refused(Refusal::ReadOnly), 5)];
        assert_eq!(rows(&snapshot, needs_action).len(), 1);
        snapshot.commands.insert(0, given(Outcome::Verified, 1));
        assert!(rows(&snapshot, needs_action).is_empty());
        snapshot.commands = vec![given(Outcome::Refused(Refusal::ReadOnly), 31)];
        assert!(rows(&snapshot, needs_action).is_empty());
    }
}
