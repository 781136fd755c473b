//! A safe state that was not reached: it is written once the device is back, and the alarm says what is missing until then.

use super::*;
use crate::{
    plant::{
        reducer::tests::recorded,
        tag::{Bound, Decimals},
    },
    text::Language,
};

const NOT_SENT: fn(TagValue) -> WriteResult = |_| WriteResult::NotSent(Fault::NotConnected);

/// `heat` has failed at its first step while SV could not be written: it is 50 and should be 0.
fn failed_of(def: PlantDef) -> Plant {
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    let failed = end(&mut plant, &started, 2, |_| WriteResult::NoValidResponse(Fault::Timeout));
    silent(&mut plant, 2);
    let safe = end(&mut plant, &failed, 3, NOT_SENT);
    let [.., last] = &actions(&safe)[..] else { panic!("{safe:?}") };
    assert!(last.ends_with(", step 1 of 6; safe state NOT complete: TIC-1.SV = 0"), "{last}");
    assert_eq!((run(&plant).is_safe(), run(&plant).at_work()), (Some(false), false));
    plant
}

fn failed() -> Plant {
    failed_of(with_alarm())
}

fn with_alarm() -> PlantDef {
    let mut def = def();
    let id = AlarmId(to_u16(def.alarms.len()));
    def.alarms.push(StationFault::Procedure.alarm(id));
    def
}

/// The controller does not answer, until it is read again.
fn silent(plant: &mut Plant, second: i64) {
    for second in second..second + 3 {
        let tags = vec![PV, SV, DP, FAULT];
        plant.on_event(Event::Failed { at: at(second), device: TIC, tags, fault: Fault::Timeout, exchange: None });
    }
}

/// The details of its alarm while that is raised and its cause lasts.
fn alarm(plant: &mut Plant, second: i64) -> Option<String> {
    plant.on_tick(at(second));
    let id = AlarmId(to_u16(plant.def.alarms.len() - 1));
    let snapshot = plant.snapshot();
    let lasts = snapshot.alarms.iter().any(|alarm| alarm.id == id && alarm.state.is_active());
    lasts.then(|| snapshot.fault_details(id).to_owned())
}

/// It is back, and has not done the first write after that.
fn back_in_vain(plant: &mut Plant, second: i64) {
    let again = back(plant, second);
    end(plant, &again, second, |_| WriteResult::NotRead(Fault::Timeout));
}

/// The controller is back, with SV at 50.
fn back(plant: &mut Plant, second: i64) -> Effects {
    read(plant, second, &[(PV, 400.0), (SV, 500.0), (DP, 1.0), (FAULT, 0.0)])
}

#[test]
fn it_is_written_once_the_device_is_back() {
    let mut plant = failed();
    assert!((4..=900).all(|second| plant.on_tick(at(second)).bus.is_empty()), "nothing is sent into the void");
    let details = alarm(&mut plant, 901).expect("it lasts for as long as something is missing");
    assert!(details.ends_with("safe state NOT complete: TIC-1.SV = 0"), "{details}");
    let again = back(&mut plant, 902);
    assert_eq!(written(&again), [(SV, 0.0)]);
    assert!(back(&mut plant, 903).bus.is_empty(), "once");
    let reached = end(&mut plant, &again, 904, WriteResult::ReadBack);
    let [.., last] = &actions(&reached)[..] else { panic!("{reached:?}") };
    assert!(last.ends_with("safe state written"), "{last}");
    assert_eq!((run(&plant).is_safe(), alarm(&mut plant, 905)), (Some(true), None));
    assert!(back(&mut plant, 2_000).bus.is_empty(), "what an operator does afterwards stays");
}

#[test]
fn a_device_that_refuses_it_is_asked_ever_more_seldom() {
    let mut plant = failed();
    let mut sent = Vec::new();
    for second in 10..3_600 {
        let again = back(&mut plant, second);
        if !again.bus.is_empty() {
            sent.push(second);
            end(&mut plant, &again, second, |_| WriteResult::NotRead(Fault::Timeout));
        }
    }
    assert_eq!(sent[..5], [10, 20, 40, 80, 160]);
    assert!(sent.len() < 15 && alarm(&mut plant, 3_600).is_some(), "{sent:?}");
}

#[test]
fn an_abort_writes_what_is_missing_at_once() {
    let mut plant = failed();
    back_in_vain(&mut plant, 59);
    let aborted = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 60);
    assert_eq!(written(&aborted), [(SV, 0.0)]);
    assert_eq!(actions(&aborted), ["anna abort procedure heat done"]);
    assert!(run(&plant).at_work());
    end(&mut plant, &aborted, 61, NOT_SENT);
    assert!(alarm(&mut plant, 62).is_some());
    let again = back(&mut plant, 90);
    let reached = end(&mut plant, &again, 91, WriteResult::ReadBack);
    assert_eq!(actions(&reached)[1], "anna end procedure heat aborted by anna, step 1 of 6; safe state written");
    let over = command(&mut plant, 3, CommandKind::AbortProcedure(HEAT), 92);
    assert_eq!(actions(&over), ["anna abort procedure heat unchanged, not written"]);
}

#[test]
fn a_person_who_writes_something_else_ends_it() {
    let by_hand = |value: f64| {
        let mut plant = failed();
        back_in_vain(&mut plant, 61);
        back(&mut plant, 62);
        let kind = CommandKind::Write { tag: SV, value: value.into() };
        let command = plant.snapshot().command(CommandId { terminal: 1, number: 9 }, kind);
        let written = plant.on_command(CommandStatus::new(command, "bob", at(62)), at(62));
        end(&mut plant, &written, 62, WriteResult::ReadBack);
        (actions(&written), alarm(&mut plant, 63), plant)
    };
    let (left, details, mut plant) = by_hand(30.0);
    assert!(left[0].ends_with("safe state NOT complete, left as it is by an operator"), "{left:?}");
    assert_eq!((details, back(&mut plant, 4_000).bus.len()), (None, 0));
    let (same, details, mut plant) = by_hand(0.0);
    assert!(same.is_empty(), "{same:?}");
    assert!(details.is_some(), "it is not known yet to be reached");
    read(&mut plant, 4_000, &[(SV, 0.0), (DP, 1.0), (PV, 400.0), (FAULT, 0.0)]);
    assert_eq!(alarm(&mut plant, 4_001), None, "what it holds is what was wanted");
}

#[test]
fn who_starts_a_procedure_ends_it() {
    let mut plant = failed();
    back_in_vain(&mut plant, 59);
    command(&mut plant, 2, CommandKind::StartProcedure(OTHER), 60);
    assert_eq!(alarm(&mut plant, 61), None);
}

#[test]
fn a_restarted_station_writes_what_was_on_record() {
    let record = |outcome: &str| ActionRecord::new(at(-50), "anna", RecordedAction::EndProcedure, "heat", outcome);
    let restored = |outcome: &str| {
        let mut plant = plant_of(with_alarm());
        plant.restore_procedures(Some(&record(outcome)));
        let sent = written(&plant.on_tick(at(1)));
        (sent, alarm(&mut plant, 2))
    };
    let (sent, raised) = restored("failed: no response, step 1 of 6; safe state NOT complete: TIC-1.SV = 0");
    assert_eq!(sent, [(SV, 0.0)]);
    assert!(raised.expect("it lasts").ends_with("TIC-1.SV = 0"));
    for over in
        ["failed, step 1 of 6; safe state written", "failed; safe state NOT complete, left as it is by an operator"]
    {
        assert_eq!(restored(over), (Vec::new(), None), "{over}");
    }
}

#[test]
fn a_station_killed_while_it_is_written_leaves_it_to_the_next() {
    let mut plant = plant_of(with_alarm());
    let started = start(&mut plant);
    // It fails, or a person aborts it; the write of its safe state has no outcome yet.
    let failed = end(&mut plant, &started, 2, |_| WriteResult::NoValidResponse(Fault::Timeout));
    let mut plant = plant_of(with_alarm());
    let started = start(&mut plant);
    end(&mut plant, &started, 2, WriteResult::ReadBack);
    let aborted = command(&mut plant, 2, CommandKind::AbortProcedure(HEAT), 3);
    for (last_words, why) in [(failed, "failed"), (aborted, "aborted by anna")] {
        assert!(written(&last_words).contains(&(SV, 0.0)), "{why}");
        let latest = recorded(&last_words).find(|action| action.is(RecordedAction::WriteSafeState)).expect(why);
        assert!(latest.outcome.starts_with(why), "{latest:?}");
        let thai = Language::THAI.locale().within(|| RecordedAction::translated(&latest.action).to_owned());
        assert_ne!(thai, *latest.action, "a report says it in its own language");
        let mut next = plant_of(with_alarm());
        let records = next.restore_procedures(Some(latest));
        let recorded = actions(&Effects { records, ..Effects::default() });
        let missing = "; safe state NOT complete: PLC-1.RUN = STOP, TIC-1.SV = 0";
        assert_eq!(recorded, [format!("anna end procedure heat interrupted: the station stopped{missing}")]);
        assert!(written(&next.on_tick(at(1))).contains(&(SV, 0.0)), "{why}");
        assert!(alarm(&mut next, 2).expect("it lasts").ends_with("TIC-1.SV = 0"));
    }
}

#[test]
fn an_unknown_limit_does_not_stop_it() {
    let mut def = with_alarm();
    let sv = &mut def.tags[SV.index()];
    (sv.max, sv.decimals) = (Some(Bound::From(PV)), Decimals::Fixed(1));
    def.procedures[0].steps[0] = ProcedureStep::Write { tag: SV, value: 10.0 };
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    for second in 2..5 {
        let (at, tags, fault) = (at(second), vec![PV], Fault::Timeout);
        plant.on_event(Event::Failed { at, device: TIC, tags, fault, exchange: None });
    }
    let failed = end(&mut plant, &started, 5, |_| WriteResult::NoValidResponse(Fault::Timeout));
    assert_eq!(written(&failed), [(SV, 0.0)], "{:?}", actions(&failed));
    end(&mut plant, &failed, 6, WriteResult::ReadBack);
    let kind = CommandKind::Write { tag: SV, value: 1.0.into() };
    let refused = command(&mut plant, 5, kind, 7);
    assert!(refused.bus.is_empty(), "an operator waits until the limit is known");
}

#[test]
fn a_plant_file_that_is_reloaded_keeps_it() {
    let mut plant = failed();
    let mut def = with_alarm();
    def.procedures[0].about = "another".into();
    plant.redefine(&Arc::new(def), 2, at(60));
    assert!(alarm(&mut plant, 61).is_some());
    assert_eq!(written(&back(&mut plant, 62)), [(SV, 0.0)]);
}

#[test]
fn a_safe_state_is_still_written_under_other_names() {
    for (again, expect) in [(false, vec![(SV, 0.0)]), (true, vec![])] {
        let mut plant = failed();
        let mut def = with_alarm();
        def.tags[SV.index()].name = "FIC-1.SV".into();
        def.devices[TIC.index()].name = "FIC-1".into();
        def.procedures[0].name = "warm up".into();
        if again {
            // Which of them it was is not certain.
            let other = ProcedureDef { name: "again".into(), ..def.procedures[0].clone() };
            def.procedures.push(other);
        }
        let becomes = if again { "ends" } else { "goes on as warm up" };
        let losses: Vec<String> = plant.snapshot().losses(&def).iter().map(ToString::to_string).collect();
        let loss = format!("procedure heat, whose safe state is not written, {becomes}");
        assert!(losses.contains(&loss), "{losses:?}");
        plant.redefine(&Arc::new(def), 2, at(60));
        plant.on_tick(at(61));
        assert_eq!(written(&back(&mut plant, 62)), expect);
    }
}

#[test]
fn what_the_device_would_round_is_no_step_but_is_safe() {
    let mut def = def();
    def.procedures[0].steps[0] = ProcedureStep::Write { tag: SV, value: 50.04 };
    def.procedures[0].safe = vec![(SV, 10.04)];
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    assert_eq!(actions(&started)[1], "anna write TIC-1.SV refused: the device would store 50.0 °C");
    assert_eq!(written(&started), [(SV, 100.0)], "the safe state at once");
}

#[test]
fn a_safe_state_is_sent_over_what_was_only_read_back() {
    // SV is scaled by a power of ten that is not read with it: the step is not confirmed.
    let mut def = def();
    let sv = &mut def.tags[SV.index()];
    (sv.decimals, sv.quality_from, sv.min, sv.max) = (Decimals::PowerFrom(DP), None, None, None);
    def.procedures[0].steps = vec![ProcedureStep::Write { tag: SV, value: 500.0 }, ProcedureStep::Hold(LIMIT)];
    def.procedures[0].safe = vec![(SV, 2000.0)];
    let mut plant = plant_of(def);
    let started = start(&mut plant);
    assert_eq!(written(&started), [(SV, 50.0)]);
    let failed = end(&mut plant, &started, 2, WriteResult::ReadBack);
    assert_eq!(written(&failed), [(SV, 200.0)], "2000 was read before the write");
}

#[test]
fn a_safe_state_is_written_over_whatever_the_device_holds() {
    let over = |effects: &Effects| -> Vec<(TagId, Option<TagValue>)> {
        let job = |(_, request): &(_, BusRequest)| match request {
            BusRequest::Write(job) => Some((job.tag, job.over.clone())),
            _ => None,
        };
        effects.bus.iter().filter_map(job).collect()
    };
    // A minute after all of it was read.
    let mut plant = plant();
    let started = command(&mut plant, 1, CommandKind::StartProcedure(HEAT), 60);
    assert_eq!(over(&started), [(SV, None)]);
    let failed = end(&mut plant, &started, 61, |_| WriteResult::NoValidResponse(Fault::Timeout));
    assert_eq!(over(&failed), [(RUN, None), (SV, None)]);
    // A person has seen what was there, a program that names no value has not.
    for (is_unconditional, has_seen) in [(false, true), (true, false)] {
        let mut plant = self::plant();
        let write = CommandKind::Write { tag: SV, value: 65.0.into() };
        let write = plant.snapshot().command(CommandId { terminal: 1, number: 1 }, write);
        let status = CommandStatus::new(Command { is_unconditional, ..write }, "anna", at(60));
        let asked = over(&plant.on_command(status, at(60)));
        assert!(matches!(&asked[..], [(SV, seen)] if seen.is_some() == has_seen), "{asked:?}");
    }
}
