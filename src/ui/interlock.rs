//! What an operator sees before and after a command: what blocks it, when it acts, what it will change, how it went.

use crate::t;
use crate::text::translate;

use ratatui::style::Style;

use super::{
    ViewContext, rights,
    widgets::{
        actuator_mark::news,
        text::{age, clock},
        value,
    },
};
use crate::plant::{
    command::CommandKind,
    def::{DeviceId, TagId},
    exact::Exact,
    interlock::{self, ActuatorDef, InterlockCondition, InterlockDef, InterlockStatus},
    line_state::{DeviceState, LineState},
    tag::{DataType, TagDef},
};

/// The other of two states, if the tag has two and is in one of them for certain.
pub fn other_state(cx: &ViewContext, tag: TagId) -> Option<f64> {
    let (one, other) = two_states(cx.def().tag(tag))?;
    match cx.snapshot.sample(tag).good_value()? {
        now if now == one => Some(other),
        now if now == other => Some(one),
        _ => None,
    }
}

fn two_states(def: &TagDef) -> Option<(f64, f64)> {
    match (def.enum_labels.as_slice(), def.point.kind) {
        ([one, other], _) => Some((one.0 as f64, other.0 as f64)),
        ([], DataType::Bool) => Some((0.0, 1.0)),
        _ => None,
    }
}

fn decimals(cx: &ViewContext, tag: TagId) -> Option<i8> {
    Some(cx.snapshot.scaling_decimals(tag))
}

/// Is this value of a tag certainly without effect, so that it is not to be sent?
pub fn is_refused(cx: &ViewContext, tag: TagId, value: Exact) -> bool {
    interlock::refusal(cx.def(), tag, value, decimals(cx, tag), |tag| cx.snapshot.sample(tag)).is_some()
}

/// What forbids a command now: the missing right, the line, an interlock or the mode; nothing where it can be given. Of two
/// states the other one is meant.
pub fn forbidden_text(cx: &ViewContext, tag: TagId) -> Option<String> {
    let def = cx.def().tag(tag);
    let value = match two_states(def) {
        Some(_) => other_state(cx, tag),
        None => cx.snapshot.sample(tag).good_value(),
    };
    let kind = CommandKind::Write { tag, value: value.unwrap_or_default().into() };
    let blocks = |value: f64| {
        let mut locks = interlock::of_write(cx.def(), tag, value.into(), decimals(cx, tag));
        locks.find_map(|lock| interlock_text(cx, lock)).map(|(words, _)| words)
    };
    rights::missing(cx, &kind)
        .or_else(|| why_unreachable(cx, def.device))
        .or_else(|| {
            // What is not read is not known, and need not be.
            let is_unknown = value.is_none() && def.is_read();
            is_unknown.then(|| t!("? unknown: {name} is not good", name = def.name))
        })
        .or_else(|| blocks(value?))
        .or_else(|| unmet_text(cx, tag))
}

/// Why nothing can be written to this device now, as one sentence; `None` if it can be tried.
pub fn why_unreachable(cx: &ViewContext, device: DeviceId) -> Option<String> {
    let def = cx.def().device(device);
    let line = &cx.def().line(def.line).name;
    let why = match (&cx.snapshot.line(def.line).state, cx.snapshot.device(device).state) {
        (LineState::Disconnected, _) => t!("Line {line} was disconnected by an operator.", line),
        (LineState::Testing, _) => t!("Line {line} is in use by a test (tab Bus).", line),
        (LineState::NoTraffic, _) => t!("No traffic is heard on line {line}.", line),
        (LineState::Waiting { why, .. }, _) => t!("Line {line} is not connected: {why}.", line, why),
        (LineState::Connecting, _) => t!("Line {line} is connecting.", line),
        (LineState::Connected, DeviceState::Down { since }) => {
            t!("No data received since {clock}.", clock = clock(since, &cx.def().time_zone))
        }
        (LineState::Connected, DeviceState::Unknown | DeviceState::Responding | DeviceState::Failing(_)) => {
            return None;
        }
    };
    Some(why)
}

/// All there is to say before a value is written, with its look.
pub fn before_write(cx: &ViewContext, tag: TagId, value: Exact) -> Vec<(String, Style)> {
    let gone = why_unreachable(cx, cx.def().tag(tag).device);
    let gone = gone.map(|why| (t!("! Writing is not possible now. {why}", why), cx.theme.trouble()));
    let locks = interlock::of_write(cx.def(), tag, value, decimals(cx, tag));
    let locks = locks.filter_map(|lock| interlock_text(cx, lock));
    let mut rows: Vec<(String, Style)> = gone.into_iter().chain(locks).collect();
    if is_refused(cx, tag, value) {
        rows.push((t!("Not sent: it would have no effect.").to_owned(), cx.theme.strong()));
    }
    if let Some(words) = unmet_text(cx, tag) {
        rows.push((format!("! {words}"), cx.theme.strong()));
    }
    rows.extend(unlock_text(cx, tag).into_iter().map(|words| (words, cx.theme.strong())));
    rows.extend(sequence_text(cx, tag, value.near()).into_iter().map(|words| (words, cx.theme.normal())));
    rows.extend(taken_over(cx, tag, value.near()).into_iter().map(|words| (words, cx.theme.normal())));
    rows
}

/// `First writes TIC-2.UNLOCK := ON; it keeps this value.`, where a write needs an unlock register that does not
/// certainly have its value.
pub fn unlock_text(cx: &ViewContext, tag: TagId) -> Option<String> {
    let (unlock_tag, unlock_value) = cx.def().tag(tag).write_unlock?;
    if cx.snapshot.sample(unlock_tag).good_value() == Some(unlock_value) {
        return None;
    }
    Some(t!(
        "First writes {name} := {format}; it keeps this value.",
        name = cx.def().tag(unlock_tag).name,
        format = cx.snapshot.format(unlock_tag, unlock_value)
    ))
}

/// `⊘ no heating below 5 cm of water: PLC-1.LT-1 is 3.2 cm`; `None` while it does not block.
pub fn interlock_text(cx: &ViewContext, lock: &InterlockDef) -> Option<(String, Style)> {
    let mark = cx.theme.pick("⊘", "(/)");
    let name = &cx.def().tag(lock.of).name;
    match (lock.status(cx.snapshot.sample(lock.of)), lock.when) {
        (InterlockStatus::Free, _) => None,
        (InterlockStatus::Blocked, InterlockCondition::Bit(_)) => {
            Some((t!("{mark} {message}: bit set in {name}", mark, message = lock.message, name), cx.theme.strong()))
        }
        (
            InterlockStatus::Blocked,
            InterlockCondition::Below(_) | InterlockCondition::Above(_) | InterlockCondition::Is(_),
        ) => {
            let now = value::show(cx, lock.of).with_unit();
            Some((t!("{mark} {message}: {name} is {now}", mark, message = lock.message, name, now), cx.theme.strong()))
        }
        (InterlockStatus::Unknown(cause), _) => {
            let words = t!(
                "? unknown: {name} is not good ({cause}): {message}",
                name,
                cause = translate(cause.word()),
                message = lock.message
            );
            Some((words, cx.theme.trouble()))
        }
    }
}

/// The first state that a command needs and that is not there: the tag, and the state.
pub fn unmet(cx: &ViewContext, actuator: &ActuatorDef) -> Option<(TagId, f64)> {
    actuator.needs.iter().find(|(tag, state)| cx.snapshot.sample(*tag).good_value() != Some(*state)).copied()
}

/// `effective in MANUAL only (PLC-1.AUTO is AUTO)`, for the command of an actuator.
pub fn unmet_text(cx: &ViewContext, tag: TagId) -> Option<String> {
    let actuator = &cx.def().logic.actuators.iter().find(|actuator| actuator.command == tag)?;
    let (need, state) = unmet(cx, actuator)?;
    let now = match cx.snapshot.sample(need).good_value() {
        Some(now) => t!("is {format}", format = cx.snapshot.format(need, now)),
        None => t!("is unknown").to_owned(),
    };
    Some(t!(
        "effective in {format} only ({name} {now})",
        format = cx.snapshot.format(need, state),
        name = cx.def().tag(need).name,
        now
    ))
}

/// What starting or stopping a sequence does.
fn sequence_text(cx: &ViewContext, tag: TagId, value: f64) -> Vec<String> {
    let sequences = &cx.def().logic.sequences;
    if let Some(sequence) = sequences.iter().find(|sequence| sequence.auto == Some((tag, value))) {
        return vec![match (value::is_on(cx, sequence.run), cx.snapshot.text(sequence.step)) {
            (Some(true), Some(step)) => t!("The sequence continues with {step} and controls the outputs.", step),
            (Some(false), _) => t!("The sequence controls the outputs once it is started.").to_owned(),
            (Some(true) | None, _) => t!("The sequence controls the outputs; its step is unknown.").to_owned(),
        }];
    }
    let Some(sequence) = sequences.iter().find(|sequence| sequence.run == tag) else { return Vec::new() };
    let step = |number: f64| cx.snapshot.format(sequence.step, number);
    if value == 0.0 {
        let now = cx.snapshot.sample(sequence.step).good_value();
        let at = now.map_or_else(
            || t!("The sequence stops.").to_owned(),
            |now| t!("The sequence stops in {step}.", step = step(now)),
        );
        return vec![at, switched_off(cx)];
    }
    let by_itself = sequence.auto.map(|(auto, state)| (cx.snapshot.sample(auto).good_value(), state, auto));
    match by_itself {
        Some((Some(now), state, _)) if now != state => {
            vec![t!("In MANUAL no step starts: manual commands act from now on.").to_owned()]
        }
        Some((None, _, auto)) => {
            vec![t!("Unknown whether steps start: {name} is unknown.", name = cx.def().tag(auto).name)]
        }
        Some(_) | None => vec![t!("The sequence starts with {step}.", step = step(sequence.first))],
    }
}

/// `Switched off: pump RUN, fill valve OPEN.`
fn switched_off(cx: &ViewContext) -> String {
    let outputs = cx.def().logic.actuators.iter().map(|actuator| actuator.output);
    let (mut on, mut unknown) = (Vec::new(), Vec::new());
    for output in outputs {
        let def = cx.def().tag(output);
        match value::is_on(cx, output) {
            Some(true) => on.push(format!("{} {}", def.short, value::show(cx, output).with_unit())),
            Some(false) => {}
            None => unknown.push(def.short.clone()),
        }
    }
    let words = match (on.is_empty(), unknown.is_empty()) {
        (true, true) => t!("No output is on.").to_owned(),
        (true, false) => t!("No output is known to be on.").to_owned(),
        (false, _) => t!("Switched off: {join}.", join = on.join(", ")),
    };
    match unknown.join(", ") {
        none if none.is_empty() => words,
        unknown => t!("{words} Unknown: {unknown}.", words, unknown),
    }
}

/// What the manual commands will change at once when this value lets them act.
fn taken_over(cx: &ViewContext, tag: TagId, value: f64) -> Vec<String> {
    let sample = |tag: TagId| cx.snapshot.sample(tag).good_value();
    let acts = |actuator: &&ActuatorDef| {
        let needs =
            |(need, state): &(TagId, f64)| if *need == tag { value == *state } else { sample(*need) == Some(*state) };
        actuator.needs.iter().any(|(need, _)| *need == tag) && actuator.needs.iter().all(needs)
    };
    let acting: Vec<&ActuatorDef> = cx.def().logic.actuators.iter().filter(acts).collect();
    if acting.is_empty() {
        return Vec::new();
    }
    let mut changes = Vec::new();
    for actuator in acting {
        let name = &cx.def().tag(actuator.output).short;
        match (sample(actuator.command), sample(actuator.output)) {
            (Some(command), Some(output)) if (command != actuator.off) != (output != 0.0) => {
                let arrow = cx.theme.pick("→", "->");
                let new = cx.snapshot.format(actuator.command, command);
                let shown = decimals(cx, actuator.command);
                let mut locks = interlock::of_write(cx.def(), actuator.command, command.into(), shown);
                let blocked = locks.any(|lock| lock.status(cx.snapshot.sample(lock.of)) == InterlockStatus::Blocked);
                let but = if blocked { t!(", blocked") } else { "" };
                changes.push(format!("{name} {} {arrow} {new}{but}", value::show(cx, actuator.output).with_unit()));
            }
            (Some(_), Some(_)) => {}
            (None, _) | (_, None) => changes.push(format!("{name} ?")),
        }
    }
    vec![if changes.is_empty() {
        t!("Manual commands take over; no output changes.").to_owned()
    } else {
        t!("Manual commands take over: {join}.", join = changes.join(", "))
    }]
}

/// What a faceplate says of an actuator: (label, words, look).
pub fn facts(cx: &ViewContext, tag: TagId) -> Vec<(&'static str, String, Style)> {
    let theme = cx.theme;
    let logic = &cx.def().logic;
    let Some((place, actuator)) = logic.actuator(tag) else { return Vec::new() };
    let command = cx.def().tag(actuator.command);
    let commanded = value::show(cx, actuator.command);
    let mut rows = vec![(t!("command"), format!("{} {}", command.name, commanded.whole()), commanded.style)];
    let modes: Vec<String> = actuator.needs.iter().map(|(need, _)| value::show(cx, *need).whole()).collect();
    let mode = modes.join(", ");
    match unmet_text(cx, actuator.command) {
        Some(words) => rows.push((t!("mode"), format!("{mode}: {words}"), theme.strong())),
        None if modes.is_empty() => {}
        None => rows.push((t!("mode"), t!("{mode}: command effective", mode), theme.normal())),
    }
    let locks = logic.interlocks.iter().filter(|lock| lock.tag == actuator.command);
    rows.extend(locks.filter_map(|lock| interlock_text(cx, lock)).map(|(words, style)| (t!("blocked"), words, style)));
    if let Some(lasts) = cx.snapshot.actuators.feedback_mismatch(logic, place, cx.snapshot.at) {
        let (wanted, is) = (commanded.text, value::show(cx, actuator.output).with_unit());
        let words = t!(
            "{pick} commanded {wanted}, still {is} after {age}",
            pick = theme.pick("≠", "!="),
            wanted,
            is,
            age = age(lasts)
        );
        rows.push((t!("differs"), words, theme.trouble()));
    }
    if let Some((outcome, well)) = news(cx, actuator.command) {
        let words = outcome.to_string();
        let style = if well == Some(false) { theme.trouble() } else { theme.strong() };
        rows.push((t!("last"), words, style));
    }
    rows
}
