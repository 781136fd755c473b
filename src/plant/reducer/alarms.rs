//! Alarms in the plant: the facts that they are evaluated by, the commands of operators, and the state after a restart.

use super::{Effects, Plant};
use crate::plant::{
    alarm::{AlarmCommand, AlarmRefusal, Succession, state::OperatorNote},
    command::{CommandStatus, NotConfirmed, Outcome, Refusal},
    condition::Facts,
    def::{AlarmDef, AlarmId, Condition, DeviceId, PlantDef, Subject},
    device_time::DeviceTime,
    exact::Exact,
    line_state::{DeviceState, LineState},
    ne107::{Reason, Signal},
    process_image::ProcessImage,
    record::{AlarmEvent, AlarmRecord, Record},
    sample::{Cause, Quality},
    snapshot::{DeviceStatus, LineStatus},
    station_alarms::StationFaults,
    station_fault::{STATION, StationFault},
};

impl Plant {
    /// Restores the alarms from the journal after a restart, oldest event first; says what is to be recorded of those that
    /// the plant has no more, or under another name.
    pub fn restore(&mut self, events: &[AlarmRecord]) -> Succession {
        self.alarm_manager.restore(events)
    }

    /// Carries out a command about alarms.
    pub(super) fn alarm_command(
        &mut self,
        status: &CommandStatus,
        alarm_command: AlarmCommand,
        effects: &mut Effects,
    ) -> Outcome {
        let note = OperatorNote {
            at: self.at.max(status.at),
            by: Some(status.by.clone()),
            reason: status.command.note.clone(),
            recorded: true,
        };
        let value = |alarm| value_of(&self.def, &self.image, alarm);
        let manager = &mut self.alarm_manager;
        let one = |record: Result<AlarmRecord, AlarmRefusal>| record.map(|record| vec![record]);
        let done = match alarm_command {
            AlarmCommand::Acknowledge { alarm, annunciated_at } => {
                one(manager.acknowledge(alarm, annunciated_at, &note))
            }
            AlarmCommand::AcknowledgeAll { alarms, seen } => {
                let alarms = alarms.unwrap_or_else(|| manager.waiting(seen).into());
                let each = alarms.iter().map(|alarm| manager.acknowledge_seen(*alarm, seen, &note));
                return together(each, AlarmRefusal::NothingToAcknowledge, effects);
            }
            AlarmCommand::Silence => manager.silence().then(Vec::new).ok_or(AlarmRefusal::NothingSounds),
            AlarmCommand::Reset(alarm) => one(manager.reset(alarm, &note)),
            AlarmCommand::Shelve { alarms, lasts } => {
                let each = alarms.iter().map(|alarm| manager.shelve(*alarm, lasts, &note));
                return together(each, AlarmRefusal::NoSuchAlarm, effects);
            }
            AlarmCommand::Unshelve(alarm) => manager.reinstate(alarm, AlarmEvent::Unshelved, value(alarm), &note),
            AlarmCommand::OutOfService(alarm) => one(manager.out_of_service(alarm, &note)),
            AlarmCommand::Tick { alarm, raised_at, step, done } => {
                one(manager.tick(alarm, raised_at, (step, done), &note))
            }
            AlarmCommand::InService(alarm) => manager.reinstate(alarm, AlarmEvent::InService, value(alarm), &note),
        };
        let done = done.map(|events| effects.records.extend(events.into_iter().map(Record::Alarm)));
        done.map_err(Refusal::Alarm).into()
    }

    /// Evaluates every alarm.
    pub(super) fn evaluate_alarms(&mut self) -> Vec<AlarmRecord> {
        let asks_health = |alarm: &AlarmDef| matches!(alarm.condition, Condition::Health { .. });
        let diagnosed = if self.def.alarms.iter().any(asks_health) { self.diagnosed() } else { Vec::new() };
        let (def, image, lines, devices) = (&self.def, &self.image, &self.lines, &self.devices);
        let (faults, speed) = (&self.faults, self.speed);
        let ill = |alarm: &AlarmDef| match (alarm.subject, alarm.condition) {
            (Subject::Device(device), Condition::Health { signal }) => {
                diagnosed.get(device.index()).and_then(|status| has_signal(status, signal))
            }
            // A computer that plays a plant faster is what takes the time.
            (Subject::Device(_), Condition::SlowerThanStated) if 1.0 < speed => Some(false),
            (Subject::Device(device), Condition::SlowerThanStated) => {
                let report = lines[def.device(device).line.index()].report.as_deref();
                let time = report.and_then(|report| report.device_time(device));
                is_slow(devices[device.index()].state, time)
            }
            (Subject::Device(device), _) => {
                let report = lines[def.device(device).line.index()].report.as_deref();
                let no_values = report.is_some_and(|report| report.gives_no_values(device));
                let state = devices[device.index()].state;
                let failing = matches!(state, DeviceState::Failing(_));
                let no_values = no_values || failing && has_only_bad(def, image, device);
                answers(state, no_values).map(|answers| !answers)
            }
            // A plant that is played faster overloads the machine that plays it, not its lines.
            (Subject::Line(_), Condition::Overloaded) if 1.0 < speed => Some(false),
            (Subject::Line(line), Condition::Overloaded) => is_overloaded(&lines[line.index()]),
            (Subject::Line(line), Condition::OtherMaster) => has_other_master(&lines[line.index()]),
            (Subject::Line(line), _) => is_lost(&lines[line.index()]),
            (Subject::Station, Condition::Station(fault)) => Some(faults.is_active(fault)),
            (Subject::Tag(_) | Subject::Station, _) => None,
        };
        let mut events = self.alarm_manager.evaluate(self.at, |alarm| facts(image, ill(alarm), alarm));
        events.iter_mut().for_each(|event| explain(event, faults));
        events.iter_mut().for_each(|event| self.explain_slow(event));
        events.iter_mut().for_each(|event| self.explain_other_master(event));
        events
    }

    /// Adds what is heard of another master to its alarm event.
    fn explain_other_master(&self, event: &mut AlarmRecord) {
        let of_event = |alarm: &&AlarmDef| {
            let line = match alarm.subject {
                Subject::Line(line) if alarm.condition == Condition::OtherMaster => self.def.line(line),
                _ => return false,
            };
            (&*line.name, &*alarm.message) == (&*event.subject, &*event.message)
        };
        let alarm = self.def.alarms.iter().find(of_event).filter(|_| event.event == AlarmEvent::Raised);
        let Some(Subject::Line(line)) = alarm.map(|alarm| alarm.subject) else { return };
        let heard = self.lines[line.index()].report.as_deref().and_then(|report| report.other_master);
        event.reason = heard.map(|heard| heard.to_string().into());
    }

    /// Adds what a slow device takes to its alarm event.
    fn explain_slow(&self, event: &mut AlarmRecord) {
        let of_event = |alarm: &&AlarmDef| {
            let device = match alarm.subject {
                Subject::Device(device) if alarm.condition == Condition::SlowerThanStated => self.def.device(device),
                _ => return false,
            };
            (&*device.name, &*alarm.message) == (&*event.subject, &*event.message)
        };
        let alarm = self.def.alarms.iter().find(of_event).filter(|_| event.event == AlarmEvent::Raised);
        let Some(Subject::Device(device)) = alarm.map(|alarm| alarm.subject) else { return };
        let report = self.lines[self.def.device(device).line.index()].report.as_deref();
        let reason = report.and_then(|report| Reason::above_stated(report.device_time(device)?));
        event.reason = reason.map(|reason| reason.to_string().into());
    }
}

/// Only heard while the line is connected.
fn has_other_master(line: &LineStatus) -> Option<bool> {
    let report = line.report.as_ref().filter(|_| line.state == LineState::Connected);
    report.map(|report| report.other_master.is_some())
}

/// Adds the detail of a station fault to its alarm event.
fn explain(event: &mut AlarmRecord, faults: &StationFaults) {
    if event.event != AlarmEvent::Raised || &*event.subject != STATION {
        return;
    }
    let fault = StationFault::ALL.into_iter().find(|fault| fault.word() == &*event.message);
    event.reason = fault.and_then(|fault| faults.details.get(&fault).cloned());
}

/// What is known for an alarm. Only good values count: an uncertain one neither raises nor clears.
fn facts(image: &ProcessImage, ill: Option<bool>, alarm: &AlarmDef) -> Facts {
    let trusted = |tag| image.sample(tag).good_exact();
    let value = match alarm.subject {
        Subject::Tag(tag) => trusted(tag),
        Subject::Device(_) | Subject::Line(_) | Subject::Station => None,
    };
    let reference = alarm.condition.reference().and_then(trusted);
    let enabled = alarm.enabled_when.as_ref().and_then(|expr| image.holds(expr, &trusted));
    Facts { value, reference, ill, enabled }
}

/// The present value for an alarm that comes back.
fn value_of(def: &crate::plant::PlantDef, image: &ProcessImage, alarm: AlarmId) -> Option<Exact> {
    facts(image, None, def.alarms.get(alarm.index())?).value
}

/// Has no tag of a device that is read a value, not even an uncertain one?
fn has_only_bad(def: &PlantDef, image: &ProcessImage, device: DeviceId) -> bool {
    let read = def.tags_of(device).filter(|tag| tag.is_read() && tag.calculation.is_none());
    let mut there = read.filter(|tag| image.sample(tag.id).quality != Quality::Bad(Cause::NotPresent));
    there.all(|tag| matches!(image.sample(tag.id).quality, Quality::Bad(_)))
}

/// A device that refuses everything is as good as silent.
fn answers(state: DeviceState, no_values: bool) -> Option<bool> {
    match state {
        DeviceState::Responding | DeviceState::Failing(_) if no_values => Some(false),
        DeviceState::Unknown | DeviceState::Failing(_) => None,
        DeviceState::Responding => Some(true),
        DeviceState::Down { .. } => Some(false),
    }
}

/// Unknown while it does not answer.
fn is_slow(state: DeviceState, time: Option<DeviceTime>) -> Option<bool> {
    match state {
        DeviceState::Responding | DeviceState::Failing(_) => Some(time?.above_stated.is_some()),
        DeviceState::Unknown | DeviceState::Down { .. } => None,
    }
}

/// Whether a device has a signal; unknown before the first request.
fn has_signal(status: &DeviceStatus, signal: Signal) -> Option<bool> {
    match (status.state, status.diagnosis) {
        (DeviceState::Unknown, None) => None,
        (_, reason) => Some(reason.is_some_and(|reason| reason.signal() == signal)),
    }
}

/// A line that an operator has closed, or that a test has, is not lost.
fn is_lost(line: &LineStatus) -> Option<bool> {
    match line.state {
        LineState::Connected | LineState::Disconnected | LineState::Testing => Some(false),
        LineState::Waiting { .. } | LineState::NoTraffic => Some(true),
        LineState::Connecting => line.lost_since.is_some().then_some(true),
    }
}

/// A line that is not polled has no load that could be evaluated.
fn is_overloaded(line: &LineStatus) -> Option<bool> {
    let report = line.report.as_ref().filter(|_| line.state == LineState::Connected);
    report.map(|report| report.strain.is_some())
}

/// Records what is done with several alarms; the common outcome, which hides no refusal. `of_none`: what an empty list is.
fn together(
    each: impl Iterator<Item = Result<AlarmRecord, AlarmRefusal>>,
    of_none: AlarmRefusal,
    effects: &mut Effects,
) -> Outcome {
    let (mut done, mut count, mut first) = (0, 0, None);
    for result in each {
        count += 1;
        match result {
            Ok(event) => {
                done += 1;
                effects.records.push(Record::Alarm(event));
            }
            Err(refusal) => first = first.or(Some(refusal)),
        }
    }
    match (done, first) {
        (0, first) => Outcome::Refused(Refusal::Alarm(first.unwrap_or(of_none))),
        (_, None) => Outcome::Verified,
        (_, Some(first)) => Outcome::NotConfirmed(NotConfirmed::PartlyAccepted { done, count, first }),
    }
}
