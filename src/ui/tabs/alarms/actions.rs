//! What an operator does with alarms: the windows that ask, and the commands that need no query.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        alarm::{ActiveAlarm, AlarmCommand, AlarmState, SuppressedAlarm},
        def::{AlarmId, Subject},
    },
    ui::{
        modal::{
            Reason,
            reason::{spelled, subject},
        },
        preferences::{Bell, Preferences},
    },
};

/// Times that are offered for the shelf, minutes.
const SHELVE_MIN: [u64; 4] = [15, 30, 60, 240];
/// Alarms that a query names.
const NAMED: usize = 6;

/// Acknowledges one alarm; where the plant file wants a note it is asked for.
pub fn acknowledge(cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<UiAction> {
    match cx.def().alarm(alarm.id).ack_comment {
        true => note(cx, alarm),
        false => vec![UiAction::Command(alarm.acknowledge())],
    }
}

/// Says that this one needs no acknowledgement, and who gave it.
pub fn acknowledged(cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<UiAction> {
    let by = alarm.acknowledged.as_ref().map(|note| {
        let by = note.by.as_deref().unwrap_or(t!("the station"));
        t!("It was acknowledged {clock} by {by}.", clock = clock(note.at, &cx.def().time_zone), by)
    });
    let words = [t!("already acknowledged").to_owned(), name(cx, alarm.id)].into_iter().chain(by).collect();
    open(Modal::Notice(Notice::new(t!("acknowledge"), words)))
}

/// Acknowledges one alarm with a note; says it where there is nothing to acknowledge.
pub fn note(cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<UiAction> {
    if !alarm.state.needs_acknowledgement() {
        return acknowledged(cx, alarm);
    }
    let needed = cx.def().alarm(alarm.id).ack_comment;
    let notes = vec![name(cx, alarm.id)];
    let reason = Reason::new(t!("acknowledge with a note"), t!("acknowledge"), notes, alarm.acknowledge(), needed);
    open(Modal::Reason(Box::new(reason)))
}

/// Asks whether to acknowledge all of these, exactly as they are seen now; for one note where one of them needs it, or
/// where it is wanted.
pub fn acknowledge_all<'a>(
    cx: &ViewContext,
    alarms: impl Iterator<Item = &'a ActiveAlarm>,
    with_note: bool,
) -> Vec<UiAction> {
    let waiting: Vec<_> = alarms.filter(|alarm| alarm.state.needs_acknowledgement()).collect();
    let asked = match waiting.len() {
        0 => return Vec::new(),
        1 => t!("Acknowledge 1 alarm?").to_owned(),
        n => t!("Acknowledge {n} alarms?", n),
    };
    let needed = waiting.iter().any(|alarm| cx.def().alarm(alarm.id).ack_comment);
    let mut notes = names(cx, waiting.iter().map(|alarm| alarm.id));
    let all = cx.snapshot.alarms.iter().filter(|alarm| alarm.state.needs_acknowledgement()).count();
    let alarms = (waiting.len() < all).then(|| waiting.iter().map(|alarm| alarm.id).collect());
    let kind = CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms, seen: cx.snapshot.annunciations });
    if !needed && !with_note {
        return open(Modal::Confirm(Confirm::command(t!("acknowledge all"), asked, kind).with_notes(notes)));
    }
    notes.insert(0, asked);
    notes.extend(needed.then(|| t!("At least one of them needs a note.").to_owned()));
    let title = if with_note { t!("acknowledge with a note") } else { t!("acknowledge all") };
    open(Modal::Reason(Box::new(Reason::new(title, t!("acknowledge"), notes, kind, needed))))
}

/// Asks for how long these alarms are shelved, and why.
pub fn shelve(cx: &ViewContext, alarms: &[AlarmId]) -> Vec<UiAction> {
    let [alarm, ..] = *alarms else { return Vec::new() };
    let max = cx.def().alarm_rules.shelve_max;
    let fixed = SHELVE_MIN.map(|minutes| Duration::from_secs(minutes * 60));
    let mut times: Vec<_> = fixed.into_iter().filter(|span| *span <= max).map(|span| (spelled(span), span)).collect();
    let shift = period::at(cx.def(), cx.now).filter(|_| !cx.def().shifts.is_empty());
    let rest = shift.and_then(|shift| Duration::try_from(shift.to.duration_since(cx.now)).ok());
    if let Some(rest) = rest.filter(|rest| !rest.is_zero() && *rest <= max) {
        times.push((t!("rest of the shift, {running}", running = running(rest)), rest));
    }
    let mut notes = if alarms.len() == 1 { vec![name(cx, alarm)] } else { names(cx, alarms.iter().copied()) };
    notes.push(t!("Not annunciated for this time, then unshelved automatically:").to_owned());
    let kind = CommandKind::Alarm(AlarmCommand::Shelve { alarms: alarms.into(), lasts: max });
    let window = Modal::Reason(Box::new(Reason::shelve(notes, alarms, times, max)));
    vec![Notice::or(cx, t!("shelve an alarm"), &kind, window)]
}

/// Asks why an alarm is taken out of service.
pub fn out_of_service(cx: &ViewContext, alarm: AlarmId) -> Vec<UiAction> {
    let notes = vec![name(cx, alarm), t!("Not annunciated until it is returned to service.").to_owned()];
    let kind = CommandKind::Alarm(AlarmCommand::OutOfService(alarm));
    let reason = Reason::new(t!("out of service"), t!("take out of service"), notes, kind.clone(), true);
    vec![Notice::or(cx, t!("out of service"), &kind, Modal::Reason(Box::new(reason)))]
}

/// Asks whether to reset a latched alarm.
pub fn reset(cx: &ViewContext, alarm: &ActiveAlarm) -> Vec<UiAction> {
    if alarm.state.is_latched() {
        let kind = CommandKind::Alarm(AlarmCommand::Reset(alarm.id));
        return open(Modal::Confirm(Confirm::command(t!("reset a latched alarm"), name(cx, alarm.id), kind)));
    }
    let why = match alarm.state.is_active() && cx.def().alarm(alarm.id).latch {
        true => t!("Its condition is still active: reset it when it has cleared."),
        false => t!("It does not latch: there is nothing to reset."),
    };
    open(Modal::Notice(Notice::new(t!("reset"), vec![name(cx, alarm.id), why.to_owned()])))
}

/// Asks whether to unshelve, or to put back in service.
pub fn put_back(cx: &ViewContext, suppressed: &SuppressedAlarm) -> Vec<UiAction> {
    let (title, alarm_command) = match suppressed.state {
        AlarmState::Shelved => (t!("unshelve"), AlarmCommand::Unshelve(suppressed.id)),
        AlarmState::OutOfService => (t!("return to service"), AlarmCommand::InService(suppressed.id)),
        AlarmState::SuppressedByDesign => {
            let words = t!("Suppressed by design; it returns when its enabling condition is true again.");
            return open(Modal::Notice(Notice::new(t!("suppressed"), vec![words.to_owned()])));
        }
        // Every other state is annunciated.
        _ => return Vec::new(),
    };
    let holds = suppressed.active.then(|| t!("Its condition is active: it will be annunciated at once.").to_owned());
    let kind = CommandKind::Alarm(alarm_command);
    let confirm = Confirm::command(title, name(cx, suppressed.id), kind.clone());
    vec![Notice::or(cx, title, &kind, Modal::Confirm(confirm.with_notes(holds)))]
}

/// Asks for what the next shift should know.
pub fn hand_over() -> Vec<UiAction> {
    let notes = vec![t!("Notes for the next shift, in addition to this page:").to_owned()];
    let reason = Reason::new(t!("hand over"), t!("hand over"), notes, CommandKind::HandOver, false);
    open(Modal::Reason(Box::new(reason)))
}

/// Says that a handover takes two.
pub fn own_handover() -> Vec<UiAction> {
    let words = [
        t!("You cannot take over what you handed over yourself."),
        t!("Another user reads this page and takes over the plant."),
    ];
    open(Modal::Notice(Notice::new(t!("take over"), words.map(str::to_owned).to_vec())))
}

/// Asks whether the user takes the plant over.
pub fn take_over(cx: &ViewContext) -> Vec<UiAction> {
    let who = cx.session.who.as_ref().map_or("–", |who| &who.user);
    let words = t!("{who} has read this page and takes over the plant.", who);
    open(Modal::Confirm(Confirm::command(t!("take over"), words, CommandKind::TakeOver)))
}

/// The first few of these, and how many more.
fn names(cx: &ViewContext, alarms: impl ExactSizeIterator<Item = AlarmId>) -> Vec<String> {
    let more = alarms.len().saturating_sub(NAMED);
    let mut names: Vec<String> = alarms.take(NAMED).map(|alarm| marked(cx, alarm)).collect();
    if more > 0 {
        names.push(t!("… and {count} more", count = more));
    }
    names
}

/// The same with the mark as wide as all others, for lists.
fn marked(cx: &ViewContext, alarm: AlarmId) -> String {
    let def = cx.def().alarm(alarm);
    format!("{} {} {}", cx.theme.priority_mark(def.priority), subject(cx, alarm), translate(&def.message))
}

/// `‹2›! TIC-1.PV temperature high`.
fn name(cx: &ViewContext, alarm: AlarmId) -> String {
    let def = cx.def().alarm(alarm);
    format!("{} {} {}", cx.theme.priority_tag(def.priority), subject(cx, alarm), translate(&def.message))
}

/// Priority, subject, message, state, value and time of an alarm, separated by tabs.
pub fn line(cx: &ViewContext, alarm: &ActiveAlarm) -> String {
    fields(cx, alarm, translate(alarm.state.word())).join("\t")
}

/// Priority, subject, message, state as the caller calls it, value and time of an alarm.
pub fn fields(cx: &ViewContext, alarm: &ActiveAlarm, state: &str) -> [String; 6] {
    let def = cx.def().alarm(alarm.id);
    let value = match (def.subject, alarm.value) {
        (Subject::Tag(tag), Some(value)) => format!("{} {}", cx.snapshot.format(tag, value), cx.snapshot.unit(tag)),
        (Subject::Tag(_) | Subject::Device(_) | Subject::Line(_) | Subject::Station, _) => String::new(),
    };
    [
        translate(def.priority.word()).to_owned(),
        subject(cx, alarm.id),
        translate(&def.message).to_owned(),
        state.to_owned(),
        value.trim_end().to_owned(),
        text::stamp(alarm.raised_at, &cx.def().time_zone),
    ]
}

/// Switches the bell off, or on for new alarms.
pub fn toggle_bell(cx: &ViewContext) -> Vec<UiAction> {
    let bell = match cx.preferences.bell {
        Bell::Off => Bell::Once,
        Bell::Once | Bell::Repeated => Bell::Off,
    };
    vec![UiAction::KeepPreferences(Preferences { bell, ..*cx.preferences })]
}
