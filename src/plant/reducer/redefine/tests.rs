//! Another definition of a plant that runs: what is as it was is not touched, and what is not says why.

use std::time::Duration;

use super::{
    super::tests::{actions, alarm_events},
    *,
};
use crate::plant::{
    alarm::{AlarmCommand, AlarmState},
    batch::BatchDef,
    calculation_def::{Calculation, OverTime},
    command::{BusRequest, Command, CommandId, CommandStatus},
    def::{Condition, DeviceId, LineId, ProcedureDef, ProcedureStep, TagId},
    event::{Event, WriteResult},
    expr::{Compare, Expr},
    fault::Fault,
    fixture::{self, DP, FAULT, HIGH, PLC, PV, RUN, SILENT, SV, TIC},
    id::WriteId,
    line_report::LineReport,
    line_state::LineState,
    procedure::ProcedureState,
    record::AlarmEvent,
    sample::{Cause, Quality, Sample},
    tag::{Decimals, TagDef},
    totalizer::Total,
};

const L1: LineId = LineId(0);
const L2: LineId = LineId(1);
/// The hours of [`RUN`].
const HOURS: TagId = TagId(5);

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

/// The fixture with the PLC on a line of its own, the hours that it runs, a batch while it does and a procedure that starts it.
fn def() -> PlantDef {
    let mut def = fixture::plant();
    def.lines.push(LineDef::new(L2, "L2", Transport::tcp("plc", 502)));
    def.devices[PLC.index()].line = L2;
    let hours = Calculation {
        text: "on_time(PLC-1.RUN)".into(),
        over_time: Some(OverTime::Total(Total::OnTime)),
        expr: Expr::Tag(RUN),
    };
    let run = def.tags[RUN.index()].clone();
    let calculation = Some(Arc::new(hours));
    def.tags.push(TagDef { id: HOURS, name: "PLC-1.HOURS".into(), calculation, ..run });
    let is = |value| Expr::test(RUN, Compare::Equal, value);
    let (phase, energy, tags) = (None, None, Vec::new());
    def.batches = vec![BatchDef { name: "water".into(), start: is(1.0), end: is(0.0), phase, energy, tags }];
    let steps = vec![ProcedureStep::Write { tag: RUN, value: 0.0 }, ProcedureStep::Hold(Duration::from_secs(600))];
    let (about, safe, reference) = (String::new(), vec![(RUN, 1.0)], None);
    def.procedures = vec![ProcedureDef { name: "stop".into(), about, steps, safe, reference }];
    def
}

/// The same without SV: every tag behind it has another id.
fn without_sv() -> PlantDef {
    let mut def = def();
    def.tags.remove(SV.index());
    (0..).map(TagId).zip(&mut def.tags).for_each(|(id, tag)| tag.id = id);
    let moved = |tag: TagId| TagId(tag.0 - 1);
    let pv = &mut def.tags[PV.index()];
    pv.decimals = Decimals::From(moved(DP));
    pv.quality_from = Some((moved(FAULT), 0xFFFF));
    let hours = &mut def.tags[moved(HOURS).index()];
    let calculation = hours.calculation.as_deref().cloned().expect("it is calculated");
    hours.calculation = Some(Arc::new(Calculation { expr: Expr::Tag(moved(RUN)), ..calculation }));
    let is = |value| Expr::test(moved(RUN), Compare::Equal, value);
    (def.batches[0].start, def.batches[0].end) = (is(1.0), is(0.0));
    def.procedures.clear();
    def
}

fn read(plant: &mut Plant, second: i64, device: DeviceId, values: &[(TagId, f64)]) -> Effects {
    let values = values.iter().map(|(tag, value)| (*tag, (*value).into())).collect();
    let (texts, response_time) = (Vec::new(), Duration::from_millis(12));
    plant.on_event(Event::Read { at: at(second), device, values, texts, response_time, exchange: None })
}

/// Both lines are connected; PV is 80.5, SV 70.0, and the PLC runs since second 0.
fn plant() -> Plant {
    let mut plant = Plant::new(Arc::new(def()), at(0), 1.0);
    plant.restore_totals(&[]);
    plant.restore_batches(&[], None);
    for line in [L1, L2] {
        plant.on_event(Event::Line { at: at(0), line, state: LineState::Connected });
    }
    read(&mut plant, 0, PLC, &[(RUN, 0.0)]);
    read(&mut plant, 0, PLC, &[(RUN, 1.0)]);
    read(&mut plant, 1, TIC, &[(DP, 1.0), (FAULT, 0.0), (PV, 805.0), (SV, 700.0)]);
    plant
}

fn command(plant: &mut Plant, number: u32, kind: CommandKind) -> Effects {
    let note = Some("why".into());
    let expected_value = kind.written().and_then(|(tag, _)| plant.snapshot().sample(tag).exact());
    let id = CommandId { terminal: 1, number };
    let command = Command { note, expected_value, ..Command::new(plant.run, id, kind) };
    plant.on_command(CommandStatus::new(command, "anna", at(3)), at(3))
}

fn redefine(plant: &mut Plant, second: i64, def: PlantDef) -> Redefined {
    plant.redefine(&Arc::new(def), plant.run + 1, at(second))
}

fn samples(effects: &Effects) -> Vec<(TagId, Sample)> {
    let of_tag = |record: &Record| if let Record::Sample(tag, sample) = record { Some((*tag, *sample)) } else { None };
    effects.records.iter().filter_map(of_tag).collect()
}

#[test]
fn another_title_changes_no_value_alarm_line_or_device() {
    let mut plant = plant();
    plant.on_tick(at(3));
    let high = plant.snapshot().alarms[0].clone();
    assert_eq!((high.id, high.state), (HIGH, AlarmState::Unacknowledged));
    command(&mut plant, 1, high.acknowledge());
    let lasts = Duration::from_secs(600);
    command(&mut plant, 2, CommandKind::Alarm(AlarmCommand::Shelve { alarms: [SILENT].into(), lasts }));
    let before = plant.snapshot();
    let changed = redefine(&mut plant, 4, PlantDef { title: "Another".into(), ..def() });
    assert_eq!(changed, Redefined::default(), "nothing ends, nothing begins");
    let after = plant.snapshot();
    assert_eq!((&*after.def.title, after.run), ("Another", before.run + 1));
    assert_eq!((after.samples, after.lines, after.devices), (before.samples, before.lines, before.devices));
    assert_eq!((&after.alarms, &after.suppressed), (&before.alarms, &before.suppressed));
    assert_eq!((after.alarms[0].state, after.suppressed.len()), (AlarmState::Acknowledged, 1));
    assert_eq!(alarm_events(plant.on_tick(at(5))), []);
}

#[test]
fn a_changed_limit_is_evaluated_and_changes_no_value() {
    let mut plant = plant();
    plant.on_tick(at(3));
    let before = plant.snapshot();
    let mut other = def();
    let Condition::Limit { limit, .. } = &mut other.alarms[HIGH.index()].condition else { panic!("a limit") };
    *limit = 90.0;
    let Redefined { ended, begun, .. } = redefine(&mut plant, 4, other);
    assert_eq!((&ended, plant.snapshot().samples), (&Effects::default(), before.samples));
    let events: Vec<AlarmEvent> = alarm_events(begun).into_iter().map(|event| event.event).collect();
    assert_eq!(events, [AlarmEvent::ReturnedToNormal]);
}

#[test]
fn a_removed_tag_ends_its_curve_and_no_other() {
    let mut plant = plant();
    let before = plant.snapshot();
    let Redefined { ended, begun, .. } = redefine(&mut plant, 4, without_sv());
    assert_eq!(samples(&ended), [(SV, Sample::bad(Cause::Reloaded, at(4)))], "under the id that it had");
    assert_eq!(samples(&begun), [], "the history has all others");
    let after = plant.snapshot();
    for tag in &after.def.tags {
        let was = before.def.tag_named(&tag.name).expect("it was there");
        assert_eq!(after.sample(tag.id), before.sample(was), "{}", tag.name);
    }
}

#[test]
fn a_line_without_one_of_its_tags_keeps_its_port() {
    let mut plant = plant();
    let report = LineReport { refused: vec![SV, DP], ..LineReport::new(def().lines[0].clone()) };
    plant.on_event(Event::Report { at: at(2), line: L1, report: Arc::new(report) });
    let before = plant.snapshot();
    assert_eq!(def().changed_lines(&without_sv()), "line L1 keeps its connection, line L2 keeps running");
    redefine(&mut plant, 4, without_sv());
    let after = plant.snapshot();
    let states = |snapshot: &crate::plant::Snapshot| [L1, L2].map(|line| snapshot.line(line).state.clone());
    assert_eq!((states(&after), &after.devices), (states(&before), &before.devices));
    let refused = after.line(L1).report.as_ref().map(|report| report.refused.clone());
    assert_eq!(refused, Some(vec![TagId(DP.0 - 1)]), "under its new id");
}

#[test]
fn a_tag_with_other_registers_says_that_it_was_reloaded() {
    let mut other = def();
    other.tags[PV.index()].point.address += 1;
    let check = |what: &str, other: PlantDef, changed: &[TagId]| {
        let mut plant = plant();
        let before = plant.snapshot();
        let Redefined { ended, begun, .. } = redefine(&mut plant, 4, other);
        assert_eq!(samples(&ended), [], "{what}");
        let stored: Vec<(TagId, Sample)> =
            changed.iter().map(|tag| (*tag, Sample::bad(Cause::Reloaded, at(4)))).collect();
        let read: Vec<_> = samples(&begun).into_iter().filter(|(tag, _)| *tag != HOURS).collect();
        assert_eq!(read, stored, "{what}");
        let after = plant.snapshot();
        for tag in (0..HOURS.0).map(TagId).filter(|tag| !changed.contains(tag)) {
            assert_eq!(after.sample(tag), before.sample(tag), "{what}");
        }
    };
    check("another address", other, &[PV]);
    let mut other = def();
    other.devices[PLC.index()].unit += 1;
    check("another unit", other, &[RUN]);
    let mut other = def();
    other.lines[L2.index()].transport = Transport::tcp("other", 502);
    check("another host", other, &[RUN]);
    let mut other = def();
    other.lines[L2.index()].timeout += Duration::from_secs(1);
    check("another timeout of the same host", other, &[]);
}

#[test]
fn a_listening_line_keeps_what_was_heard_and_what_is_stated() {
    let listening = || {
        let mut def = def();
        def.lines[L1.index()].listens = true;
        def.tags[SV.index()].stated = Some(70.0);
        def
    };
    let mut plant = Plant::new(Arc::new(listening()), at(0), 1.0);
    let stated = Sample::good(70.0, at(0)).uncertain(Cause::Stated);
    assert_eq!(plant.snapshot().sample(SV), stated);
    redefine(&mut plant, 4, PlantDef { title: "Another".into(), ..listening() });
    assert_eq!(plant.snapshot().sample(SV), stated);
    read(&mut plant, 5, TIC, &[(DP, 1.0), (FAULT, 0.0), (PV, 805.0), (SV, 650.0)]);
    let (heard, heard_at) = (plant.snapshot().samples, at(5));
    redefine(&mut plant, 6, listening());
    assert_eq!((plant.snapshot().samples, plant.snapshot().sample(SV)), (heard, Sample::good(65.0, heard_at)));
    plant.on_event(Event::Line { at: at(7), line: L1, state: LineState::NoTraffic });
    let contradicted = plant.snapshot().sample(SV);
    assert_eq!(contradicted, Sample::good(65.0, heard_at).uncertain(Cause::NotHeard), "never what is stated again");
    let mut unstated = listening();
    unstated.tags[SV.index()].stated = None;
    let mut plant = Plant::new(Arc::new(listening()), at(0), 1.0);
    redefine(&mut plant, 4, unstated);
    assert_eq!(plant.snapshot().sample(SV).value, None, "it was never read");
}

#[test]
fn another_scale_counts_for_what_was_read() {
    let mut plant = plant();
    let mut other = def();
    other.tags[PV.index()].scale = 2.0;
    redefine(&mut plant, 4, other);
    assert_eq!(plant.snapshot().sample(PV), Sample::good(161.0, at(1)), "as old as it is");
}

#[test]
fn a_value_that_was_reloaded_says_what_is_wrong_now() {
    let mut plant = plant();
    let mut other = def();
    other.tags[PV.index()].point.address += 1;
    redefine(&mut plant, 4, other);
    let (device, tags, fault) = (TIC, vec![PV], Fault::Timeout);
    plant.on_event(Event::Failed { at: at(5), device, tags, fault, exchange: None });
    assert_eq!(plant.snapshot().sample(PV), Sample::bad(Cause::Timeout, at(5)));
}

#[test]
fn a_write_under_way_ends_where_its_line_goes_on() {
    let mut plant = plant();
    let write = command(&mut plant, 1, CommandKind::Write { tag: SV, value: 61.0.into() });
    assert!(matches!(write.bus[..], [(L1, BusRequest::Write(_))]));
    let mut other = def();
    other.lines[L2.index()].timeout += Duration::from_secs(1);
    assert_eq!(redefine(&mut plant, 4, other.clone()).ended, Effects::default());
    let wrote = plant.on_event(Event::Wrote { at: at(5), id: WriteId(1), result: WriteResult::ReadBack(610.0.into()) });
    assert_eq!(actions(&wrote), ["anna write TIC-1.SV verified"]);

    command(&mut plant, 2, CommandKind::Write { tag: SV, value: 62.0.into() });
    other.lines[L1.index()].timeout += Duration::from_secs(1);
    let ended = redefine(&mut plant, 6, other).ended;
    let why = "not confirmed: the plant file was reloaded; it may have taken effect";
    assert_eq!(actions(&ended), [format!("anna write TIC-1.SV {why}")]);
    let late = plant.on_event(Event::Wrote { at: at(7), id: WriteId(2), result: WriteResult::ReadBack(620.0.into()) });
    assert_eq!(actions(&late), [] as [&str; 0], "once");
}

#[test]
fn totals_and_batches_go_on_under_other_ids() {
    let mut plant = plant();
    read(&mut plant, 3_600, PLC, &[(RUN, 1.0)]);
    let has_batches = |effects: &Effects| effects.records.iter().any(|record| matches!(record, Record::Batch(_)));
    let Redefined { ended, begun, .. } = redefine(&mut plant, 3_601, without_sv());
    assert!(!has_batches(&ended) && !has_batches(&begun), "the batch goes on");
    let (run, hours) = (TagId(RUN.0 - 1), TagId(HOURS.0 - 1));
    let effects = read(&mut plant, 5_400, PLC, &[(run, 1.0)]);
    assert_eq!((plant.snapshot().sample(hours), has_batches(&effects)), (Sample::good(1.5, at(5_400)), false));
    let none = PlantDef { batches: Vec::new(), ..without_sv() };
    assert!(has_batches(&redefine(&mut plant, 5_401, none).ended), "it is not followed any more");
}

#[test]
fn a_procedure_goes_on_only_where_its_lines_do() {
    let start = |plant: &mut Plant| {
        command(plant, 1, CommandKind::StartProcedure(ProcedureId(0)));
        plant.on_event(Event::Wrote { at: at(3), id: WriteId(1), result: WriteResult::ReadBack(0.0.into()) });
    };
    let state = |plant: &Plant| plant.snapshot().procedures[0].as_ref().map(|run| run.state.clone());
    let mut first = plant();
    start(&mut first);
    let (mut other, mut changed) = (def(), def());
    other.lines[L1.index()].timeout += Duration::from_secs(1);
    changed.lines[L2.index()].timeout += Duration::from_secs(1);
    assert!(def().keeps_procedure(&other, ProcedureId(0)) && !def().keeps_procedure(&changed, ProcedureId(0)));
    assert_eq!(actions(&redefine(&mut first, 4, other).ended), [] as [&str; 0]);
    assert_eq!(state(&first), Some(ProcedureState::Running));

    let mut second = plant();
    start(&mut second);
    let ended = redefine(&mut second, 4, changed).ended;
    assert_eq!(actions(&ended), ["anna end procedure stop interrupted, step 2 of 2"]);
    assert_eq!(state(&second), Some(ProcedureState::Ended(ProcedureEnd::Interrupted)), "its safe state can be written");
}

#[test]
fn a_renamed_device_keeps_its_values_and_its_alarms() {
    let mut plant = plant();
    plant.on_tick(at(3));
    let before = plant.snapshot();
    assert_eq!(before.alarms[0].id, HIGH);
    let mut def = def();
    def.devices[TIC.index()].name = "FIC-1".into();
    for tag in def.tags.iter_mut().filter(|tag| tag.device == TIC) {
        tag.name = tag.name.replace("TIC-1", "FIC-1");
    }
    let losses: Vec<String> = before.losses(&def).iter().map(ToString::to_string).collect();
    assert_eq!(losses, ["alarm TIC-1.PV alarm 0 (UNACK) goes on as FIC-1.PV alarm 0"]);
    let changed = redefine(&mut plant, 4, def);
    let after = plant.snapshot();
    assert_eq!((&after.alarms, &after.samples, &after.devices), (&before.alarms, &before.samples, &before.devices));
    let stored = samples(&changed.begun).into_iter().map(|(tag, _)| tag).collect::<Vec<_>>();
    assert_eq!(stored, [PV, SV, DP, FAULT], "the history knows them by their names");
    assert!(samples(&changed.ended).iter().all(|(_, sample)| sample.quality == Quality::Bad(Cause::Reloaded)));
}
