//! Restores as an operator sees them: in order, stopped by the first failure, and never over another's head.

use super::{super::tests::actions, *};
use crate::plant::{
    command::BusRequest,
    def::{DeviceId, PlantDef},
    event::{Event, WriteResult},
    fault::Fault,
    fixture::{self, DP, FAULT, SV, TIC},
    parameter_set::{ParameterSet, SetValue, plan},
    tag::{Access, Bound, ByteOrder, DataType, Point, Table, TagDef},
    tag_value::TagValue,
};

const HIGH: TagId = TagId(5);

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn def() -> PlantDef {
    let mut def = fixture::plant();
    let point =
        Point { table: Table::Holding, address: 1030, kind: DataType::I16, order: ByteOrder::Abcd, field: None };
    def.tags.push(TagDef {
        access: Access::ReadWrite,
        in_sets: true,
        max: Some(Bound::Fixed(500.0.into())),
        ..TagDef::new(HIGH, TIC, "TIC-1.SV-H", point)
    });
    let sv = &mut def.tags[SV.index()];
    (sv.in_sets, sv.max) = (true, Some(Bound::From(HIGH)));
    def
}

/// SV 50.0 °C, at most 100.
fn plant() -> Plant {
    let mut plant = Plant::new(Arc::new(def()), at(0), 1.0);
    read(&mut plant, 0, 500.0, 100.0);
    plant
}

fn read(plant: &mut Plant, second: i64, sv: f64, high: f64) -> Effects {
    read_values(plant, second, vec![(SV, sv), (DP, 1.0), (FAULT, 0.0), (HIGH, high)])
}

fn read_values(plant: &mut Plant, second: i64, values: Vec<(TagId, f64)>) -> Effects {
    let (device, response_time) = (TIC, std::time::Duration::from_millis(12));
    let (values, texts) = (fixture::raw(values), Vec::new());
    plant.on_event(Event::Read { at: at(second), device, values, texts, response_time, exchange: None })
}

/// The read of the device that a restore begins with.
fn look(number: u32) -> BusRequest {
    BusRequest::Refresh { device: TIC, command: Some(CommandId { terminal: 1, number }) }
}

/// Commands a restore and lets the device be read as it was; the first write follows.
fn begin(plant: &mut Plant, number: u32, request: RestoreRequest) -> Effects {
    let asked = command(plant, number, CommandKind::Restore(Box::new(request)));
    assert_eq!(asked.bus, [(plant.def.device(TIC).line, look(number))], "the device is read first");
    read(plant, 1, 500.0, 100.0)
}

fn set(sv: f64, high: f64) -> Arc<ParameterSet> {
    let value = |tag: &str, value: f64| SetValue { tag: tag.to_owned(), value: value.into() };
    Arc::new(ParameterSet {
        name: "winter".into(),
        device: "TIC-1".into(),
        profile: "fixture".into(),
        saved: at(0),
        by: "anna".into(),
        given: Vec::new(),
        values: vec![value("SV", sv), value("SV-H", high)],
        units: Default::default(),
        missing: Vec::new(),
    })
}

fn restore_request(plant: &Plant, set: Arc<ParameterSet>) -> RestoreRequest {
    let changes = plan(&plant.def, TIC, &set, &trusted(&plant.image)).expect("a set that fits");
    RestoreRequest { device: TIC, from: "winter".into(), set, changes }
}

fn command(plant: &mut Plant, number: u32, kind: CommandKind) -> Effects {
    plant.on_command(CommandStatus::new(Command::new(1, CommandId { terminal: 1, number }, kind), "anna", at(1)), at(1))
}

fn outcome(plant: &Plant, number: u32) -> Option<Outcome> {
    plant.commands.outcome_of(CommandId { terminal: 1, number }).cloned()
}

/// The tags and raw numbers that went to the bus.
fn written(effects: &Effects) -> Vec<(TagId, f64)> {
    let write = |(_, request): &(_, BusRequest)| match request {
        BusRequest::Write(job) => Some((job.tag, job.raw.number().expect("a number").near())),
        _ => None,
    };
    effects.bus.iter().filter_map(write).collect()
}

/// Ends the write under way and returns the effects. As on the bus, the value read back comes before the result.
fn end(plant: &mut Plant, effects: &Effects, result: fn(TagValue) -> WriteResult) -> Effects {
    let (id, tag, raw) = effects
        .bus
        .iter()
        .find_map(|(_, request)| match request {
            BusRequest::Write(job) => Some((job.id, job.tag, job.raw.clone())),
            _ => None,
        })
        .expect("a write is under way");
    if let WriteResult::ReadBack(back) = result(raw.clone()) {
        let response_time = std::time::Duration::from_millis(12);
        plant.on_event(Event::Read {
            at: at(2),
            device: TIC,
            values: vec![(tag, back.number().expect("a number"))],
            texts: Vec::new(),
            response_time,
            exchange: None,
        });
    }
    plant.on_event(Event::Wrote { at: at(2), id, result: result(raw.clone()) })
}

#[test]
fn one_write_after_the_other_each_on_record_and_then_the_whole() {
    let mut plant = plant();
    let request = restore_request(&plant, set(150.0, 200.0));
    let first = begin(&mut plant, 1, request);
    assert_eq!(written(&first), [(HIGH, 200.0)], "the limit first, and nothing else yet");
    let second = end(&mut plant, &first, WriteResult::ReadBack);
    assert_eq!(actions(&second), ["anna write TIC-1.SV-H verified"]);
    assert_eq!(written(&second), [(SV, 1500.0)]);
    assert_eq!(outcome(&plant, 1), Some(Outcome::Pending));
    let last = end(&mut plant, &second, WriteResult::ReadBack);
    assert_eq!(actions(&last), ["anna write TIC-1.SV verified", "anna restore set TIC-1 verified"]);
    assert_eq!(plant.restore_of(TIC).map(|run| (run.state, run.done())), Some((State::Done, 2)));
}

#[test]
fn the_first_failure_stops_it_and_says_what_was_written() {
    let mut plant = plant();
    let request = restore_request(&plant, set(40.0, 80.0));
    let first = begin(&mut plant, 1, request);
    assert_eq!(written(&first), [(SV, 400.0)]);
    let second = end(&mut plant, &first, WriteResult::ReadBack);
    assert_eq!(written(&second), [(HIGH, 80.0)]);
    let last = end(&mut plant, &second, |_| WriteResult::NoValidResponse(Fault::Timeout));
    assert_eq!(
        outcome(&plant, 1).map(|outcome| outcome.to_string()).as_deref(),
        Some("not confirmed: 1 of 2 written, then SV-H failed")
    );
    assert_eq!(actions(&last).len(), 2, "the write and the whole: {:?}", actions(&last));
    assert_eq!(plant.restore_of(TIC).map(|run| run.state), Some(State::Failed));
}

#[test]
fn a_device_that_has_changed_since_is_not_written() {
    let mut plant = plant();
    let request = restore_request(&plant, set(40.0, 80.0));
    command(&mut plant, 1, CommandKind::Restore(Box::new(request.clone())));
    // On the image it stood as it was confirmed; the device itself says otherwise.
    let effects = read(&mut plant, 1, 610.0, 100.0);
    let changed = Some(Outcome::Refused(Refusal::Changed));
    assert_eq!((written(&effects), outcome(&plant, 1)), (vec![], changed.clone()));
    assert_eq!(actions(&effects), [format!("anna restore set TIC-1 refused: {}", Refusal::Changed)]);
    let effects = command(&mut plant, 2, CommandKind::Restore(Box::new(request)));
    assert_eq!((effects.bus, outcome(&plant, 2)), (vec![], changed));
}

#[test]
fn nothing_is_written_before_every_value_was_read() {
    let mut plant = plant();
    let request = restore_request(&plant, set(40.0, 80.0));
    command(&mut plant, 1, CommandKind::Restore(Box::new(request.clone())));
    let only_sv = |plant: &mut Plant, second| read_values(plant, second, vec![(SV, 500.0), (DP, 1.0)]);
    assert_eq!(written(&only_sv(&mut plant, 2)), [], "SV-H is still of yesterday");
    assert_eq!(plant.restore_of(TIC).map(|run| run.state), Some(State::Reading));
    // The device goes on answering for SV alone: in the end it is given up, and said so.
    plant.on_tick(at(61));
    assert_eq!(outcome(&plant, 1), Some(Outcome::Pending));
    let late = plant.on_tick(at(62));
    assert_eq!(outcome(&plant, 1), Some(Outcome::Refused(Refusal::NotRead(60))));
    assert_eq!(actions(&late), ["anna restore set TIC-1 refused: the device could not be read within 60 s"]);
}

#[test]
fn a_reading_restore_is_stopped_and_a_full_line_ends_it() {
    let check = |end: &dyn Fn(&mut Plant), expect: Refusal| {
        let mut plant = plant();
        let request = restore_request(&plant, set(40.0, 80.0));
        command(&mut plant, 1, CommandKind::Restore(Box::new(request)));
        end(&mut plant);
        assert_eq!(outcome(&plant, 1), Some(Outcome::Refused(expect)));
        assert_eq!(written(&read(&mut plant, 2, 500.0, 100.0)), []);
    };
    let stop = |plant: &mut Plant| drop(command(plant, 2, CommandKind::StopRestore(TIC)));
    check(&stop, Refusal::Stopped);
    let busy = |plant: &mut Plant| drop(plant.on_undeliverable(plant.def.device(TIC).line, &look(1)));
    check(&busy, Refusal::Busy);
    let configure = |plant: &mut Plant| {
        let line = plant.def.line(plant.def.device(TIC).line).clone();
        drop(command(plant, 2, CommandKind::Configure(Box::new(line))));
    };
    check(&configure, Refusal::LineChanged);
}

#[test]
fn a_value_changed_during_a_restore_is_not_overwritten() {
    let check = |meanwhile: &dyn Fn(&mut Plant), expect: &str| {
        let mut plant = plant();
        let request = restore_request(&plant, set(40.0, 80.0));
        let first = begin(&mut plant, 1, request);
        meanwhile(&mut plant);
        let last = end(&mut plant, &first, WriteResult::ReadBack);
        assert_eq!(written(&last), [], "{expect}");
        let found = [
            "anna write TIC-1.SV verified",
            expect,
            "anna restore set TIC-1 not confirmed: 1 of 2 written, then SV-H failed",
        ];
        assert_eq!(actions(&last), found);
        assert_eq!(plant.restore_of(TIC).map(|run| (run.state, run.done())), Some((State::Failed, 1)));
    };
    let at_the_panel = |plant: &mut Plant| drop(read(plant, 1, 500.0, 120.0));
    check(&at_the_panel, "anna write TIC-1.SV-H refused: changed since you confirmed");
    let silent = |plant: &mut Plant| {
        let (tags, fault) = (vec![HIGH], Fault::Timeout);
        drop(plant.on_event(Event::Failed { at: at(1), device: TIC, tags, fault, exchange: None }));
    };
    check(&silent, "anna write TIC-1.SV-H refused: unknown now");
    let other_line = |plant: &mut Plant| {
        let line = plant.def.line(plant.def.device(TIC).line).clone();
        drop(command(plant, 7, CommandKind::Configure(Box::new(line))));
    };
    check(&other_line, "anna write TIC-1.SV-H refused: the settings of the line have changed in the meantime");
}

#[test]
fn limits_are_checked_in_the_station_whatever_a_terminal_sends() {
    let mut plant = plant();
    let request = RestoreRequest { changes: Vec::new(), ..restore_request(&plant, set(50.0, 100.0)) };
    let too_high = RestoreRequest { set: set(600.0, 100.0), ..request.clone() };
    let effects = command(&mut plant, 1, CommandKind::Restore(Box::new(too_high)));
    let why = "SV 600 is outside −∞ … 100";
    let refused = |why: &str| Some(format!("{}: {why}", Outcome::Refused(Refusal::Stopped).label()));
    let min = plant.def.tag(SV).min;
    assert_eq!(min, Some(Bound::Fixed(0.0.into())));
    let outcome_words = outcome(&plant, 1).map(|outcome| outcome.to_string());
    assert_eq!((written(&effects), outcome_words), (vec![], refused(&why.replace("−∞", "0"))));
    command(&mut plant, 2, CommandKind::Restore(Box::new(request)));
    assert_eq!(outcome(&plant, 2), Some(Outcome::Unchanged));
}

#[test]
fn a_restore_stops_between_writes_and_never_runs_twice() {
    let mut plant = plant();
    let request = restore_request(&plant, set(40.0, 80.0));
    let first = begin(&mut plant, 1, request.clone());
    command(&mut plant, 2, CommandKind::Restore(Box::new(request)));
    assert_eq!(outcome(&plant, 2), Some(Outcome::Refused(Refusal::UnderWay)));
    command(&mut plant, 3, CommandKind::StopRestore(TIC));
    let rest = end(&mut plant, &first, WriteResult::ReadBack);
    assert_eq!(written(&rest), []);
    assert_eq!(plant.restore_of(TIC).map(|run| (run.state, run.done())), Some((State::Stopped, 1)));
    command(&mut plant, 4, CommandKind::StopRestore(TIC));
    assert_eq!(outcome(&plant, 4), Some(Outcome::Unchanged));
}

#[test]
fn a_line_too_busy_ends_it_without_effect() {
    let mut plant = plant();
    let request = restore_request(&plant, set(40.0, 100.0));
    let first = begin(&mut plant, 1, request);
    let (line, request) = first.bus.into_iter().next().expect("a write");
    plant.on_undeliverable(line, &request);
    assert_eq!(outcome(&plant, 1), Some(Outcome::Refused(Refusal::Busy)));
}

#[test]
fn a_set_is_taken_with_what_is_known_and_saving_it_is_on_record() {
    let mut plant = plant();
    let name: Arc<str> = "winter".into();
    let save = CommandKind::SaveSet { device: DeviceId(0), name, replace: false };
    let effects = command(&mut plant, 1, save);
    let Some(SetWork::Write { set, replace: false, .. }) = effects.sets else { panic!("{:?}", effects.sets) };
    assert_eq!((set.values.len(), set.missing.len()), (2, 0));
    let id = CommandId { terminal: 1, number: 1 };
    let done = plant.on_set_written(id, Err("the disk is full".into()));
    assert_eq!(actions(&done), ["anna save set TIC-1 refused: not saved: the disk is full"]);
    let bad = CommandKind::SaveSet { device: DeviceId(0), name: "../x".into(), replace: false };
    assert_eq!(command(&mut plant, 2, bad).sets, None, "no path leaves the folder");
}
