//! The reducer of facts: what an operator would notice.

mod alarms;
mod exact;
mod texts;
mod writes;

use std::time::Duration;

use super::*;
use crate::plant::{
    alarm::AlarmState,
    command::{Command, CommandId, NotConfirmed, Refusal, WriteJob, WriteResult},
    def::{ActionDef, AlarmDef, AlarmId, Condition, Subject},
    fault::{ExceptionCode, Fault},
    fixture::{self, DP, FAULT, PLC, PV, RUN, SILENT, SV, TIC},
    interlock::{InterlockCondition, InterlockDef},
    line_report::LineReport,
    record::{ActionRecord, AlarmEvent, AlarmRecord},
    recorded_action::RecordedAction,
    sample::{Cause, Quality},
};

const L1: LineId = LineId(0);

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn read(second: i64, values: &[(TagId, f64)]) -> Event {
    Event::Read {
        at: at(second),
        device: TIC,
        values: fixture::raw(values.iter().copied()),
        texts: Vec::new(),
        response_time: Duration::from_millis(12),
        exchange: None,
    }
}

fn fail(second: i64, tags: &[TagId], fault: Fault) -> Event {
    Event::Failed { at: at(second), device: TIC, tags: tags.to_vec(), fault, exchange: None }
}

fn running() -> Plant {
    let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
    plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    plant.on_event(read(0, &[(PV, 700.0), (SV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
    plant
}

fn command(number: u32, kind: CommandKind) -> CommandStatus {
    CommandStatus::new(Command::new(1, CommandId { terminal: 1, number }, kind), "anna", at(0))
}

/// Each operator action on record.
pub(super) fn recorded(effects: &Effects) -> impl Iterator<Item = &ActionRecord> {
    effects.records.iter().filter_map(|record| if let Record::Action(action) = record { Some(action) } else { None })
}

/// The same as words: who, what, which and its outcome.
pub(super) fn actions(effects: &Effects) -> Vec<String> {
    let words = |action: &ActionRecord| format!("{} {} {} {}", action.by, action.action, action.target, action.outcome);
    recorded(effects).map(words).collect()
}

/// Each alarm event on record.
pub(super) fn alarm_events(effects: Effects) -> Vec<AlarmRecord> {
    let alarm = |record| if let Record::Alarm(event) = record { Some(event) } else { None };
    effects.records.into_iter().filter_map(alarm).collect()
}

/// A write by an operator who sees the plant's present values.
fn shown(plant: &Plant, number: u32, tag: TagId, value: f64) -> CommandStatus {
    let kind = CommandKind::Write { tag, value: value.into() };
    let command = plant.snapshot().command(CommandId { terminal: 1, number }, kind);
    CommandStatus::new(command, "anna", at(0))
}

/// Writes `SV := value`, answers with `result`, and gives the outcome and the raw number that was sent.
fn write(plant: &mut Plant, value: f64, result: WriteResult) -> (Outcome, Option<f64>) {
    let effects = plant.on_command(shown(plant, 1, SV, value), at(1));
    let sent = effects.bus.first().map(|(_, request)| match request {
        BusRequest::Write(job) => (job.id, job.raw.number().expect("a number")),
        other => panic!("not a write: {other:?}"),
    });
    if let Some((id, _)) = sent {
        assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Pending);
        plant.on_event(Event::Wrote { at: at(2), id, result });
    }
    (plant.snapshot().commands[0].outcome.clone(), sent.map(|(_, raw)| raw.near()))
}

#[test]
fn a_write_is_verified_only_by_its_own_read_back() {
    let refused = |refusal| Outcome::Refused(refusal);
    for (value, result, outcome, sent) in [
        (72.5, WriteResult::ReadBack(725.0.into()), Outcome::Verified, Some(725.0)),
        (
            72.5,
            WriteResult::ReadBack(700.0.into()),
            Outcome::NotConfirmed(NotConfirmed::Different(70.0.into())),
            Some(725.0),
        ),
        (
            72.5,
            WriteResult::NotRead(Fault::Timeout),
            Outcome::NotConfirmed(NotConfirmed::NotRead(Fault::Timeout)),
            Some(725.0),
        ),
        (72.5, WriteResult::Refused(ExceptionCode(3)), refused(Refusal::Exception(ExceptionCode(3))), Some(725.0)),
        (
            72.5,
            WriteResult::NoValidResponse(Fault::Timeout),
            Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)),
            Some(725.0),
        ),
        (72.5, WriteResult::ReadBackAfterFault(Fault::Timeout, 725.0.into()), Outcome::Verified, Some(725.0)),
        (
            72.5,
            WriteResult::ReadBackAfterFault(Fault::Timeout, 700.0.into()),
            Outcome::NotConfirmed(NotConfirmed::NotApplied(Fault::Timeout, 70.0.into())),
            Some(725.0),
        ),
        (70.0, WriteResult::Accepted, Outcome::Unchanged, None),
        (100.1, WriteResult::Accepted, refused(Refusal::OutOfRange { min: "0.0".into(), max: "100.0".into() }), None),
        (72.54, WriteResult::Accepted, refused(Refusal::Resolution("72.5 °C".into())), None),
        (
            f64::NAN,
            WriteResult::Accepted,
            refused(Refusal::OutOfRange { min: "0.0".into(), max: "100.0".into() }),
            None,
        ),
    ] {
        assert_eq!(write(&mut running(), value, result.clone()), (outcome, sent), "{value} {result:?}");
    }
}

#[test]
fn after_an_uncertain_write_the_old_value_is_not_good() {
    for result in [WriteResult::NoValidResponse(Fault::Timeout), WriteResult::NotRead(Fault::Timeout)] {
        let mut plant = running();
        write(&mut plant, 72.5, result);
        assert_eq!(plant.snapshot().sample(SV).quality, Quality::Uncertain(Cause::Timeout));
        // The correction is really written, not taken for unchanged.
        assert_eq!(write(&mut plant, 70.0, WriteResult::ReadBack(700.0.into())), (Outcome::Verified, Some(700.0)));
    }
}

#[test]
fn a_handover_is_on_record_with_its_note() {
    let mut plant = running();
    let mut action = |number, kind, note: Option<String>| {
        let mut status = command(number, kind);
        status.command.note = note.map(Into::into);
        let effects = plant.on_command(status, at(1));
        let [Record::Action(action)] = &effects.records[..] else { panic!("{effects:?}") };
        (action.action.to_string(), action.note.as_deref().map(str::to_owned), action.outcome.to_string())
    };
    let found = |action: &str, note: Option<&str>, outcome: &str| {
        (action.to_owned(), note.map(str::to_owned), outcome.to_owned())
    };
    assert_eq!(
        action(1, CommandKind::HandOver, Some("pump is loud".to_owned())),
        found("hand over", Some("pump is loud"), "done")
    );
    assert_eq!(action(2, CommandKind::TakeOver, None), found("take over", None, "done"));
    let (_, _, outcome) = action(3, CommandKind::HandOver, Some("x".repeat(501)));
    assert_eq!(outcome, "refused: more than 500 characters");
}

#[test]
fn a_line_is_closed_when_it_says_so() {
    let mut plant = running();
    let effects = plant.on_command(command(1, CommandKind::Connect(L1, false)), at(1));
    assert_eq!((effects.bus.len(), effects.records.len()), (1, 0));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Pending);
    let effects = plant.on_event(Event::Line { at: at(2), line: L1, state: LineState::Disconnected });
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Verified);
    assert_eq!(actions(&effects), ["anna disconnect L1 done"], "nothing was read back");
    plant.on_command(command(2, CommandKind::Connect(L1, false)), at(3));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Unchanged);
    let effects = plant.on_command(command(3, CommandKind::Connect(L1, true)), at(4));
    plant.on_undeliverable(L1, &effects.bus[0].1);
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::Busy));
}

#[test]
fn a_write_is_recorded_before_it_is_sent() {
    let mut plant = running();
    let effects = plant.on_command(shown(&plant, 1, SV, 61.0), at(1));
    let requested = plant.write_requested_record(&effects.bus[0].1).expect("a write is about to be sent");
    assert_eq!(
        (&*requested.action, &*requested.target, &*requested.outcome),
        ("write requested", "TIC-1.SV", "pending")
    );
    assert!(!RecordedAction::WriteRequested.is_on_process(), "a shift report has the outcome alone");
    assert_eq!(plant.write_requested_record(&BusRequest::StopTest), None);
    let ended = plant.on_stop().records;
    let [Record::Action(action)] = &ended[..] else { panic!("{ended:?}") };
    assert_eq!((&*action.action, &action.new), ("write", &requested.new));
    assert_eq!(&*action.outcome, "not confirmed: the station stopped; it may have taken effect");
    assert_eq!(plant.on_stop().records, []);
}

#[test]
fn a_gateway_that_answers_for_a_dead_device_is_not_the_device() {
    let mut plant = running();
    plant.on_event(fail(1, &[PV], Fault::Exception(ExceptionCode(0x0B))));
    assert_eq!(plant.snapshot().devices[TIC.index()].state, DeviceState::Failing(1));
}

#[test]
fn nothing_is_written_blindly() {
    let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
    let unknown = Outcome::Refused(Refusal::Unknown("TIC-1.DP".into()));
    assert_eq!(write(&mut plant, 50.0, WriteResult::Accepted), (unknown, None));
    for (tag, value, refusal) in [(PV, 1.0, Refusal::ReadOnly), (RUN, 2.0, Refusal::NotAChoice)] {
        let effects = plant.on_command(shown(&plant, 2, tag, value), at(1));
        assert!(effects.bus.is_empty());
        assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(refusal));
    }
}

#[test]
fn a_second_write_is_refused_and_a_lost_one_expires() {
    let mut plant = running();
    plant.on_command(shown(&plant, 1, SV, 71.0), at(1));
    plant.on_command(shown(&plant, 2, SV, 72.0), at(2));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::UnderWay));
    let effects = plant.on_tick(at(122));
    let outcome = plant.snapshot().commands[1].outcome.clone();
    assert_eq!(outcome, Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)));
    assert!(effects.records.iter().any(|record| matches!(record, Record::Action(_))), "failures are on record too");
}

#[test]
fn the_record_of_a_write_has_old_new_and_outcome() {
    let mut plant = running();
    let effects = plant.on_command(shown(&plant, 1, SV, 72.5), at(1));
    let BusRequest::Write(WriteJob { id, .. }) = effects.bus[0].1 else { panic!("a write was requested") };
    let effects = plant.on_event(Event::Wrote { at: at(2), id, result: WriteResult::ReadBack(725.0.into()) });
    let Some(Record::Action(action)) = effects.records.last() else { panic!("no action on record") };
    assert_eq!(
        (&*action.by, &*action.action, &*action.target, action.old.as_deref(), action.new.as_deref(), &*action.outcome),
        ("anna", "write", "TIC-1.SV", Some("70.0 °C"), Some("72.5 °C"), "verified")
    );
}

#[test]
fn a_silent_device_fails_then_is_down_then_comes_back() {
    let mut plant = running();
    plant.on_event(fail(1, &[PV], Fault::Timeout));
    let snapshot = plant.snapshot();
    assert_eq!(snapshot.devices[TIC.index()].state, DeviceState::Failing(1));
    assert_eq!(snapshot.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
    assert_eq!(snapshot.sample(SV).quality, Quality::Good, "only what was asked for is in doubt");
    let effects = plant.on_event(fail(3, &[PV, SV, DP, FAULT], Fault::BackedOff));
    assert!(plant.snapshot().samples[..4].iter().all(|sample| sample.quality == Quality::Bad(Cause::DeviceDown)));
    assert!(
        effects
            .records
            .iter()
            .any(|record| matches!(record, Record::Alarm(event) if event.event == AlarmEvent::Raised))
    );
    assert_eq!(plant.snapshot().alarms[0].id, SILENT);
    plant.on_event(read(9, &[(PV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
    assert_eq!(plant.snapshot().alarms[0].state, AlarmState::ReturnedToNormal);
    assert_eq!(plant.snapshot().sample(PV).quality, Quality::Good);
}

#[test]
fn a_closed_line_raises_no_alarm_an_unplugged_one_does() {
    let mut plant = running();
    plant.on_event(Event::Line { at: at(1), line: L1, state: LineState::Disconnected });
    assert_eq!(plant.snapshot().sample(PV).quality, Quality::Bad(Cause::NotConnected));
    assert!(plant.snapshot().alarms.is_empty());
    let why = "No such file or directory".into();
    plant.on_event(Event::Line { at: at(2), line: L1, state: LineState::Waiting { why, retry_at: at(3) } });
    assert_eq!(plant.snapshot().alarms.iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [SILENT]);
    assert!(matches!(plant.snapshot().devices[PLC.index()].state, DeviceState::Down { .. }));
}

#[test]
fn a_device_that_refuses_everything_counts_as_silent() {
    let mut plant = running();
    let says = |plant: &mut Plant, second: i64, outcome: Result<(), Fault>| {
        let mut stats = crate::plant::request_stats::RequestStats::default();
        (0..20).for_each(|_| stats.count(Ok(()), None));
        (0..12).for_each(|_| stats.count(outcome, None));
        let report = LineReport { devices: vec![(TIC, stats)], ..LineReport::new(plant.def().line(L1).clone()) };
        plant.on_event(Event::Report { at: at(second), line: L1, report: Arc::new(report) });
        plant.on_tick(at(second + 10));
        plant.snapshot().alarms.iter().any(|alarm| alarm.id == SILENT && alarm.state == AlarmState::Unacknowledged)
    };
    assert!(!says(&mut plant, 1, Ok(())));
    assert!(says(&mut plant, 20, Err(Fault::Exception(ExceptionCode(4)))));
    assert!(!says(&mut plant, 40, Ok(())));
}

#[test]
fn an_overloaded_line_is_said_once_and_no_device_is_at_fault() {
    let mut def = fixture::plant();
    let overloaded = AlarmId(def.alarms.len() as u16);
    let alarm = AlarmDef::new(overloaded, Subject::Line(L1), Condition::Overloaded, "line overloaded");
    def.alarms.push(AlarmDef { on_delay: Duration::from_secs(10), ..alarm });
    let def = Arc::new(def);
    let mut plant = Plant::new(def.clone(), at(0), 1.0);
    plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    let mut raised = 0;
    let mut report = |plant: &mut Plant, second: i64, strain: Option<&str>| {
        let report = LineReport { strain: strain.map(str::to_owned), ..LineReport::new(plant.def().line(L1).clone()) };
        let mut records = plant.on_event(Event::Report { at: at(second), line: L1, report: Arc::new(report) }).records;
        records.extend(plant.on_event(read(second, &[(PV, 700.0), (SV, 700.0), (DP, 1.0), (FAULT, 0.0)])).records);
        let is_raise = |record: &Record| matches!(record, Record::Alarm(event) if event.event == AlarmEvent::Raised);
        raised += records.iter().chain(&plant.on_tick(at(second)).records).filter(|record| is_raise(record)).count();
        plant.snapshot().alarms.iter().map(|alarm| (alarm.id, alarm.state)).collect::<Vec<_>>()
    };
    let strained = Some("process values every 1.5 periods");
    (1..=9).for_each(|second| assert_eq!(report(&mut plant, second, strained), [], "a peak of {second} s"));
    let states: Vec<_> = (10..60).map(|second| report(&mut plant, second, strained)).collect();
    assert_eq!(states[49], [(overloaded, AlarmState::Unacknowledged)], "the line's alarm only");
    assert_eq!(report(&mut plant, 60, None), [(overloaded, AlarmState::ReturnedToNormal)]);
    let mut fast = Plant::new(def, at(0), 60.0);
    fast.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    (1..60).for_each(|second| assert_eq!(report(&mut fast, second, strained), [], "only the machine is busy"));
    assert_eq!(raised, 1);
}

#[test]
fn a_full_queue_is_reported_to_the_operator() {
    let mut plant = running();
    let effects = plant.on_command(shown(&plant, 1, SV, 72.5), at(1));
    plant.on_undeliverable(effects.bus[0].0, &effects.bus[0].1);
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::Busy));
}

#[test]
fn an_interlock_refuses_with_its_reason_but_never_a_stop() {
    use crate::plant::interlock::ControlLogic;
    let mut def = fixture::plant();
    let message = "not above 60 °C".to_owned();
    let lock = InterlockDef {
        tag: fixture::RUN,
        value: 1.0,
        of: PV,
        when: InterlockCondition::Above(60.0),
        message,
        refuse: true,
    };
    def.logic = ControlLogic { interlocks: vec![lock], ..ControlLogic::default() };
    let mut plant = Plant::new(std::sync::Arc::new(def), at(0), 1.0);
    let command = |plant: &mut Plant, number: u32, value: f64, second: i64| {
        let effects = plant.on_command(shown(plant, number, fixture::RUN, value), at(second));
        let outcome = plant.snapshot().commands[0].outcome.clone();
        (effects.bus.len(), outcome)
    };
    plant.on_event(read(0, &[(PV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
    let refused = Outcome::Refused(Refusal::Interlock("not above 60 °C".to_owned()));
    assert_eq!(command(&mut plant, 1, 1.0, 1), (0, refused));
    assert_eq!(command(&mut plant, 2, 0.0, 1), (1, Outcome::Pending), "a stop goes out");
}

#[test]
fn a_feedback_mismatch_is_in_the_snapshot() {
    use crate::plant::interlock::{ActuatorDef, ControlLogic};
    let mut def = fixture::plant();
    let travel = Some(Duration::from_secs(5));
    let actuator = ActuatorDef { output: FAULT, command: fixture::RUN, off: 0.0, needs: Vec::new(), travel };
    def.logic = ControlLogic { actuators: vec![actuator], ..ControlLogic::default() };
    let mut plant = Plant::new(std::sync::Arc::new(def), at(0), 1.0);
    let late = |plant: &Plant, second: i64| {
        let snapshot = plant.snapshot();
        snapshot.actuators.feedback_mismatch(&snapshot.def.logic, 0, at(second)).map(|span| span.as_secs())
    };
    plant.on_event(read(0, &[(fixture::RUN, 1.0), (FAULT, 0.0)]));
    plant.on_event(read(3, &[(fixture::RUN, 1.0), (FAULT, 0.0)]));
    assert_eq!((late(&plant, 4), late(&plant, 6)), (None, Some(6)));
    plant.on_event(read(7, &[(fixture::RUN, 1.0), (FAULT, 1.0)]));
    assert_eq!(late(&plant, 20), None, "it has followed");
}
