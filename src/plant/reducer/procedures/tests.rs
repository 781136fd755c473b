//! Procedures as an operator sees them: step by step, and into the safe state by whatever ends them early.

mod measurements;
mod safe_state;

use std::time::Duration;

use super::{super::tests::actions, *};
use crate::plant::{
    command::BusRequest,
    control_run::{DURATION_MAX, Figure, RunCause, RunDef},
    def::{AlarmId, PlantDef, ProcedureDef, ProcedureStep},
    event::{Event, WriteResult},
    expr::{Compare, Expr},
    fault::Fault,
    fixture::{self, DP, FAULT, PLC, PV, RUN, SV, TIC},
    interlock::{ActuatorDef, InterlockCondition, InterlockDef},
    procedure::{ProcedureState, StepFailure},
    tag_value::TagValue,
};

const HEAT: ProcedureId = ProcedureId(0);
const OTHER: ProcedureId = ProcedureId(1);
const LIMIT: Duration = Duration::from_secs(600);

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

/// `heat`: SV to 50, RUN, measured until PV is above 49; 60 s more. Safe: STOP, SV to 0.
fn def() -> PlantDef {
    let mut def = fixture::plant();
    let (sv, pv, controller) = (SV, PV, TIC);
    let (band, steady_for, duration_max) = (Some(0.5), Duration::from_secs(300), DURATION_MAX);
    let (sv_used, energy, batches, tags) = (None, None, Vec::new(), Vec::new());
    def.runs = vec![RunDef { controller, sv, sv_used, pv, band, steady_for, duration_max, energy, batches, tags }];
    let steps = vec![
        ProcedureStep::Write { tag: SV, value: 50.0 },
        ProcedureStep::BeginMeasurement { controller: TIC, label: "heat".into() },
        ProcedureStep::Write { tag: RUN, value: 1.0 },
        ProcedureStep::WaitUntil {
            text: "TIC-1.PV > 49".into(),
            condition: Expr::test(PV, Compare::Above, 49.0),
            limit: LIMIT,
        },
        ProcedureStep::Hold(Duration::from_secs(60)),
        ProcedureStep::EndMeasurement { controller: TIC },
    ];
    let safe = vec![(RUN, 0.0), (SV, 0.0)];
    let heat = ProcedureDef { name: "heat".into(), about: String::new(), steps, safe, reference: None };
    let other = ProcedureDef { name: "other".into(), steps: heat.steps[..1].to_vec(), ..heat.clone() };
    def.procedures = vec![heat, other];
    // 0 of RUN is a stop.
    let (output, needs, travel) = (RUN, Vec::new(), None);
    def.logic.actuators = vec![ActuatorDef { output, command: RUN, off: 0.0, needs, travel }];
    def
}

/// Of this definition, with PV 20.0, SV 20.0 and STOP.
fn plant_of(def: PlantDef) -> Plant {
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.restore_runs(&[]);
    read(&mut plant, 0, &[(PV, 200.0), (SV, 200.0), (DP, 1.0), (FAULT, 0.0), (RUN, 0.0)]);
    plant
}

fn plant() -> Plant {
    plant_of(def())
}

fn read(plant: &mut Plant, second: i64, values: &[(TagId, f64)]) -> Effects {
    let response_time = Duration::from_millis(12);
    let mut effects = Effects::default();
    for device in [TIC, PLC] {
        let values = values.iter().copied().filter(|(tag, _)| plant.def.tag(*tag).device == device);
        let values = fixture::raw(values);
        let event = Event::Read { at: at(second), device, values, texts: Vec::new(), response_time, exchange: None };
        let more = plant.on_event(event);
        effects.bus.extend(more.bus);
        effects.records.extend(more.records);
    }
    effects
}

fn command(plant: &mut Plant, number: u32, kind: CommandKind, second: i64) -> Effects {
    let command = Command::new(1, CommandId { terminal: 1, number }, kind);
    plant.on_command(CommandStatus::new(command, "anna", at(second)), at(second))
}

fn start(plant: &mut Plant) -> Effects {
    command(plant, 1, CommandKind::StartProcedure(HEAT), 1)
}

fn run(plant: &Plant) -> ProcedureRun {
    plant.snapshot().procedures[0].as_deref().cloned().expect("it was started")
}

/// The tags and raw numbers that go to the bus.
fn written(effects: &Effects) -> Vec<(TagId, f64)> {
    let write = |(_, request): &(_, BusRequest)| match request {
        BusRequest::Write(job) => Some((job.tag, job.raw.number().expect("a number").near())),
        _ => None,
    };
    effects.bus.iter().filter_map(write).collect()
}

/// The bus ends the first write of `effects`; as there, the value read back comes before the result.
fn end(plant: &mut Plant, effects: &Effects, second: i64, result: fn(TagValue) -> WriteResult) -> Effects {
    let job = effects.bus.iter().find_map(|(_, request)| match request {
        BusRequest::Write(job) => Some(job.clone()),
        _ => None,
    });
    let job = job.expect("a write is under way");
    let mut effects = Effects::default();
    if let WriteResult::ReadBack(back) = result(job.raw.clone()) {
        effects = read(plant, second, &[(job.tag, back.number().expect("a number").near())]);
    }
    let more = plant.on_event(Event::Wrote { at: at(second), id: job.id, result: result(job.raw.clone()) });
    effects.bus.extend(more.bus);
    effects.records.extend(more.records);
    effects
}

/// Until it waits for PV.
fn waiting(plant: &mut Plant) {
    let started = start(plant);
    let next = end(plant, &started, 2, WriteResult::ReadBack);
    end(plant, &next, 3, WriteResult::ReadBack);
    assert_eq!((run(plant).step, run(plant).since), (Some(3), at(3)), "{:?}", run(plant));
}

#[test]
fn step_follows_step_and_the_run_is_measured() {
    let mut plant = plant();
    let started = start(&mut plant);
    assert_eq!(actions(&started), ["anna start procedure heat done"]);
    assert_eq!(written(&started), [(SV, 500.0)], "one step after the other");
    assert!(run(&plant).at_work() && plant.on_tick(at(2)).bus.is_empty(), "it waits for the read-back");
    let verified = end(&mut plant, &started, 2, WriteResult::ReadBack);
    assert_eq!(written(&verified), [(RUN, 1.0)]);
    assert_eq!(actions(&verified), ["anna write TIC-1.SV verified"]);
    end(&mut plant, &verified, 3, WriteResult::ReadBack);
    for second in 4..=20 {
        read(&mut plant, second, &[(PV, 200.0 + 15.0 * second as f64), (SV, 500.0)]);
    }
    assert_eq!((run(&plant).step, run(&plant).since), (Some(4), at(20)), "49.0 is not above 49, 50.0 is");
    for second in 21..80 {
        read(&mut plant, second, &[(PV, 503.0), (SV, 500.0)]);
        assert!(run(&plant).at_work(), "it holds at {second}");
    }
    let ended = read(&mut plant, 80, &[(PV, 503.0), (SV, 500.0)]);
    assert_eq!(actions(&ended), ["anna end procedure heat done"]);
    assert_eq!(run(&plant).state, ProcedureState::Ended(ProcedureEnd::Done));
    assert!(run(&plant).safe.is_empty() && ended.bus.is_empty(), "what its steps have done stays");
    let measured = plant.snapshot().runs[0].as_deref().cloned().expect("a run");
    assert_eq!((measured.cause, &*measured.detail, measured.state), (RunCause::Procedure, "heat", RunState::Ended));
    assert_eq!((measured.from, measured.until, measured.sv), (at(2), at(80), 50.0));
    assert_eq!(measured.at_sv, Figure::After(Duration::from_secs(18)), "PV was within 0.5 at 20 s");
    assert!(ended.records.contains(&Record::Run(Box::new(measured))), "{:?}", ended.records);
}

#[test]
fn a_write_that_is_not_verified_ends_in_the_safe_state() {
    for (result, why) in [
        ((|_| WriteResult::ReadBack(300.0.into())) as fn(TagValue) -> WriteResult, "not confirmed: read back 30"),
        (|_| WriteResult::NoValidResponse(Fault::Timeout), "not confirmed: no response"),
    ] {
        let mut plant = plant();
        let started = start(&mut plant);
        let failed = end(&mut plant, &started, 2, result);
        // SV may be 0 or not: it is written all the same. RUN is STOP already.
        assert_eq!(written(&failed), [(SV, 0.0)]);
        let ProcedureState::WritingSafeState(ProcedureEnd::Failed(StepFailure::Write(_))) = run(&plant).state else {
            panic!("{:?}", run(&plant))
        };
        let safe = end(&mut plant, &failed, 3, WriteResult::ReadBack);
        let [.., last] = &actions(&safe)[..] else { panic!("{safe:?}") };
        assert!(last.starts_with("anna end procedure heat failed: not confirmed"), "{last} {why}");
        assert!(last.ends_with(", step 1 of 6; safe state written"), "{last}");
        assert_eq!(run(&plant).is_safe(), Some(true));
    }
}

#[test]
fn a_failure_is_an_alarm_with_the_reason() {
    let mut def = def();
    let id = AlarmId(to_u16(def.alarms.len()));
    def.alarms.push(StationFault::Procedure.alarm(id));
    let is_raised = |plant: &mut Plant| {
        plant.on_tick(at(5));
        plant.snapshot().alarms.iter().any(|alarm| alarm.id == id)
    };
    let mut plant = plant_of(def.clone());
    let started = start(&mut plant);
    let failed = end(&mut plant, &started, 2, |_| WriteResult::NotRead(Fault::Timeout));
    end(&mut plant, &failed, 3, WriteResult::ReadBack);
    assert!(is_raised(&mut plant));
    let details = plant.snapshot().fault_details(id).to_owned();
    assert!(details.starts_with("heat: failed: not confirmed") && details.ends_with("safe state written"), "{details}");
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 2);
    let over = end(&mut plant, &started, 3, WriteResult::ReadBack);
    end(&mut plant, &over, 4, WriteResult::ReadBack);
    assert!(!is_raised(&mut plant), "an abort that reached the safe state is none");
}

#[test]
fn an_interlock_that_refuses_ends_it() {
    let mut def = def();
    let (tag, value, of, message) = (RUN, 1.0, PV, "too cold".to_owned());
    let when = InterlockCondition::Below(30.0);
    def.logic.interlocks = vec![InterlockDef { tag, value, of, when, message, refuse: true }];
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    let failed = end(&mut plant, &started, 2, WriteResult::ReadBack);
    assert_eq!(actions(&failed)[1], "anna write PLC-1.RUN refused: interlock: too cold");
    assert_eq!(written(&failed), [(SV, 0.0)], "the safe state at once");
}

#[test]
fn a_condition_that_does_not_come_true_in_time_ends_it() {
    let mut plant = plant();
    waiting(&mut plant);
    // Unknown is not true, and not false either.
    plant.on_event(Event::Failed { at: at(10), device: TIC, tags: vec![PV], fault: Fault::Timeout, exchange: None });
    let others = [(SV, 500.0), (DP, 1.0), (FAULT, 0.0), (RUN, 1.0)];
    assert!(read(&mut plant, 602, &others).bus.is_empty());
    let failed = plant.on_tick(at(603));
    assert_eq!(written(&failed), [(RUN, 0.0), (SV, 0.0)]);
    let failure = ProcedureEnd::Failed(StepFailure::TimeLimit);
    assert_eq!(run(&plant).state, ProcedureState::WritingSafeState(failure));
    let measured = plant.snapshot().runs[0].as_deref().map(|run| run.state);
    assert_eq!(measured, Some(RunState::Interrupted), "its figures are not those of a whole measurement");
}

#[test]
fn an_abort_writes_the_safe_state_at_once() {
    let mut plant = plant();
    waiting(&mut plant);
    let aborted = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 9);
    assert_eq!(written(&aborted), [(RUN, 0.0), (SV, 0.0)]);
    let once = command(&mut plant, 3, CommandKind::AbortProcedure(HEAT), 9);
    assert_eq!(
        (written(&once), &actions(&once)[..]),
        (vec![], &["anna abort procedure heat unchanged, not written".to_owned()][..])
    );
    let first = end(&mut plant, &aborted, 10, WriteResult::ReadBack);
    assert!(run(&plant).at_work(), "{first:?}");
    let rest = Effects { bus: aborted.bus[1..].to_vec(), ..Effects::default() };
    let ended = end(&mut plant, &rest, 11, WriteResult::ReadBack);
    assert_eq!(actions(&ended)[1], "anna end procedure heat aborted by anna, step 4 of 6; safe state written");
    let again = command(&mut plant, 4, CommandKind::AbortProcedure(HEAT), 12);
    assert!(again.bus.is_empty(), "it has ended");
}

#[test]
fn the_safe_state_is_written_by_who_aborts() {
    let mut plant = plant();
    waiting(&mut plant);
    let abort = Command::new(1, CommandId { terminal: 2, number: 1 }, CommandKind::AbortProcedure(HEAT));
    let status = CommandStatus { from: "pts/9".into(), ..CommandStatus::new(abort, "bob", at(9)) };
    let aborted = plant.on_command(status, at(9));
    let (_, request) = &aborted.bus[0];
    let requested = plant.write_requested_record(request).expect("a write");
    assert_eq!((&*requested.by, &*requested.from), ("bob", "pts/9"));
}

#[test]
fn an_abort_waits_only_for_a_write_to_the_same_tag() {
    let mut plant = plant();
    let started = start(&mut plant);
    let aborted = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 2);
    assert_eq!(written(&aborted), [], "RUN is STOP, and SV := 50 is under way");
    let over = end(&mut plant, &started, 3, WriteResult::ReadBack);
    assert_eq!(written(&over), [(SV, 0.0)]);
    // A stop is sent while the start that it ends is under way.
    let mut plant = self::plant();
    let started = start(&mut plant);
    let starting = end(&mut plant, &started, 2, WriteResult::ReadBack);
    assert_eq!(written(&starting), [(RUN, 1.0)]);
    let aborted = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 3);
    assert_eq!(written(&aborted), [(RUN, 0.0), (SV, 0.0)]);
}

#[test]
fn one_procedure_at_a_time() {
    let mut plant = plant();
    start(&mut plant);
    let second = command(&mut plant, 2, CommandKind::StartProcedure(OTHER), 2);
    assert_eq!(actions(&second), ["anna start procedure other refused: procedure heat is running"]);
    assert_eq!(plant.snapshot().procedure_at_work().map(|(id, _)| id), Some(HEAT));
    // Nor is the safe state of another one written meanwhile.
    plant.restore_procedures(Some(&ActionRecord::new(
        at(-50),
        "anna",
        RecordedAction::StartProcedure,
        "other",
        "verified",
    )));
    let aborted = command(&mut plant, 3, CommandKind::AbortProcedure(OTHER), 3);
    assert_eq!(actions(&aborted), ["anna abort procedure other refused: procedure heat is running"]);
}

#[test]
fn nothing_is_measured_before_the_history_is_known() {
    let mut plant = Plant::new(Arc::new(def()), at(0), 1.0);
    let refused = start(&mut plant);
    assert_eq!(
        actions(&refused),
        ["anna start procedure heat refused: the history is not open: nothing can be measured"]
    );
    assert!(refused.bus.is_empty());
    let unmeasured = command(&mut plant, 2, CommandKind::StartProcedure(OTHER), 2);
    assert_eq!(actions(&unmeasured)[0], "anna start procedure other done", "it measures nothing");
}

#[test]
fn a_station_that_stops_leaves_it_interrupted() {
    let mut plant = plant();
    let started = start(&mut plant);
    let stopped = plant.on_stop();
    let all = actions(&stopped);
    assert_eq!(all[1], "anna end procedure heat interrupted, step 1 of 6", "{all:?}");
    assert!(stopped.bus.is_empty(), "{started:?}");
    assert_eq!(run(&plant).state, ProcedureState::Ended(ProcedureEnd::Interrupted));
}

#[test]
fn a_restarted_station_shows_it_and_goes_on_with_nothing() {
    let record = |action: RecordedAction, outcome: &str| ActionRecord::new(at(-50), "anna", action, "heat", outcome);
    for (latest, is_shown, is_recorded) in [
        (record(RecordedAction::StartProcedure, "verified"), true, true),
        (record(RecordedAction::EndProcedure, "interrupted, step 1 of 6"), true, false),
        (record(RecordedAction::EndProcedure, "done"), false, false),
    ] {
        let mut plant = plant();
        let records = plant.restore_procedures(Some(&latest));
        let recorded = actions(&Effects { records, ..Effects::default() });
        let expected = ["anna end procedure heat interrupted: the station stopped"];
        assert_eq!(recorded, if is_recorded { &expected[..] } else { &[][..] });
        let values = [(PV, 200.0), (SV, 200.0), (DP, 1.0), (FAULT, 0.0), (RUN, 0.0)];
        assert!(read(&mut plant, 5, &values).bus.is_empty());
        assert_eq!(plant.snapshot().procedures[0].is_some(), is_shown, "{latest:?}");
        if !is_shown {
            continue;
        }
        let found = run(&plant);
        assert_eq!((found.started, found.step, found.end()), (at(-50), None, Some(&ProcedureEnd::Interrupted)));
        // The safe state is an operator's decision.
        let safe = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 6);
        assert_eq!(written(&safe), [(SV, 0.0)]);
        let ended = end(&mut plant, &safe, 7, WriteResult::ReadBack);
        assert_eq!(actions(&ended)[1], "anna end procedure heat aborted by anna; safe state written");
    }
}

#[test]
fn a_write_is_on_record_with_its_procedure() {
    let mut plant = plant();
    let started = start(&mut plant);
    let (_, request) = &started.bus[0];
    let requested = plant.write_requested_record(request).expect("a write");
    assert_eq!((&*requested.by, requested.note.as_deref()), ("anna", Some("procedure heat")));
    let lost = plant.on_undeliverable(started.bus[0].0, request);
    assert_eq!(actions(&lost)[0], "anna write TIC-1.SV refused: line too busy");
    assert!(matches!(run(&plant).end(), Some(ProcedureEnd::Failed(StepFailure::Write(Outcome::Refused(_))))));
}
