//! Writes: stops, unlock registers, interlocks, rounding, and the value that the operator saw.

use super::*;
use crate::plant::{tag::Decimals, tag_value::TagValue};

/// The plant of the tests, whose PLC is stopped by an action.
fn with_stop() -> Plant {
    let mut def = fixture::plant();
    let (settle, confirm) = (Duration::ZERO, String::new());
    let stop =
        ActionDef { name: "STOP".into(), tag: RUN, value: 0.0, settle, confirm, stop: true, saves: false, role: None };
    def.devices[PLC.index()].actions = vec![stop];
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.on_event(read(0, &[(RUN, 0.0)]));
    plant
}

#[test]
fn a_stop_is_sent_though_a_start_is_under_way() {
    let mut plant = with_stop();
    let mut check = |number, value, expect: Option<(f64, bool)>| {
        let effects = plant.on_command(shown(&plant, number, RUN, value), at(1));
        let sent = effects.bus.first().map(|(_, request)| match request {
            BusRequest::Write(job) => (job.raw.number().expect("a number").near(), job.urgent),
            other => panic!("not a write: {other:?}"),
        });
        assert_eq!(sent, expect, "command {number}: {:?}", plant.snapshot().commands[0].outcome);
    };
    check(1, 1.0, Some((1.0, false)));
    // The PLC was read as stopped before the start: that makes the stop no less needed.
    check(2, 0.0, Some((0.0, true)));
    check(3, 0.0, None);
    check(4, 1.0, None);
    assert_eq!(plant.snapshot().commands[1].outcome, Outcome::Refused(Refusal::UnderWay));
}

#[test]
fn an_unlock_is_sent_once_and_has_its_own_audit_entry() {
    let mut def = fixture::plant();
    def.tags[SV.index()].write_unlock = Some((FAULT, 1.0));
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    let unlocked = |plant: &mut Plant, number, value| {
        let effects = plant.on_command(shown(plant, number, SV, value), at(1));
        match &effects.bus[0].1 {
            BusRequest::Write(job) => (job.id, job.unlock),
            other => panic!("not a write: {other:?}"),
        }
    };
    plant.on_event(read(0, &[(SV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
    let (id, unlock) = unlocked(&mut plant, 1, 71.0);
    assert_eq!(unlock, Some((FAULT, 1.0.into())));
    let effects = plant.on_event(Event::Unlocked { at: at(2), id, unlock_tag: FAULT, result: WriteResult::Accepted });
    let Some(Record::Action(action)) = effects.records.last() else { panic!("no entry for it") };
    assert_eq!((&*action.by, &*action.target, action.new.as_deref()), ("anna", "TIC-1.FAULT", Some("1 °C")));
    assert_eq!(&*action.outcome, "not confirmed: accepted, not read back; for TIC-1.SV");
    assert!(plant.snapshot().sample(FAULT).good_value().is_none(), "it is not as it was read before");
    plant.on_event(Event::Wrote { at: at(2), id, result: WriteResult::Refused(ExceptionCode(3)) });
    // Not read again yet: unknown, so it is sent again.
    let (id, unlock) = unlocked(&mut plant, 2, 71.0);
    assert_eq!(unlock, Some((FAULT, 1.0.into())));
    plant.on_event(Event::Wrote { at: at(3), id, result: WriteResult::ReadBack(710.0.into()) });
    plant.on_event(read(4, &[(FAULT, 1.0)]));
    assert_eq!(unlocked(&mut plant, 3, 72.0).1, None, "it has its value already");
}

#[test]
fn what_will_be_sent_is_blocked_whatever_was_typed() {
    let mut def = fixture::plant();
    def.tags[RUN.index()].enum_labels.clear();
    let message = "not while it is hot".to_owned();
    let when = InterlockCondition::Above(60.0);
    def.logic.interlocks = vec![InterlockDef { tag: RUN, value: 1.0, of: PV, when, message, refuse: true }];
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.on_event(read(0, &[(PV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
    for (value, refused) in [(1.0, true), (0.6, true), (0.0, false)] {
        let effects = plant.on_command(shown(&plant, 1, RUN, value), at(1));
        assert_eq!(effects.bus.is_empty(), refused, "{value}: {:?}", plant.snapshot().commands[0].outcome);
        assert!(!refused || matches!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::Interlock(_))));
    }
}

#[test]
fn a_lost_refresh_of_the_plant_fails_no_command() {
    let mut plant = running();
    let effects = plant.on_command(command(1, CommandKind::Refresh(TIC)), at(1));
    plant.on_undeliverable(L1, &BusRequest::Refresh { device: TIC, command: None });
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Verified);
    plant.on_command(command(2, CommandKind::Refresh(TIC)), at(2));
    plant.on_undeliverable(L1, &effects.bus[0].1);
    let outcomes = plant.snapshot().commands.into_iter().map(|status| status.outcome).collect::<Vec<_>>();
    assert_eq!(outcomes, [Outcome::Verified, Outcome::Refused(Refusal::Busy)], "newest first");
}

#[test]
fn what_another_power_of_ten_scales_by_now_is_not_verified() {
    let mut def = fixture::plant();
    let sv = &mut def.tags[SV.index()];
    (sv.decimals, sv.quality_from, sv.min, sv.max) = (Decimals::PowerFrom(DP), None, None, None);
    let different = NotConfirmed::Different(TagValue::Number(4.5.into()));
    for (power, outcome) in [
        (Some(0.0), Outcome::Verified),
        (Some(-1.0), Outcome::NotConfirmed(different)),
        (None, Outcome::NotConfirmed(NotConfirmed::NoReadBack)),
    ] {
        let mut plant = Plant::new(Arc::new(def.clone()), at(0), 1.0);
        plant.on_event(read(0, &[(SV, 20.0), (DP, 0.0)]));
        let effects = plant.on_command(shown(&plant, 1, SV, 45.0), at(1));
        let BusRequest::Write(WriteJob { id, raw, .. }) = effects.bus[0].1.clone() else { panic!("a write") };
        plant.on_event(read(2, &[(SV, 45.0)]));
        power.map(|power| plant.on_event(read(2, &[(DP, power)])));
        plant.on_event(Event::Wrote { at: at(2), id, result: WriteResult::ReadBack(raw) });
        assert_eq!(plant.snapshot().commands[0].outcome, outcome, "{power:?}");
    }
}

/// SV in steps of 0.5 °C (scale 5 on a register with one decimal), at 70 °C.
fn in_steps(max: f64) -> Plant {
    let mut def = fixture::plant();
    let sv = &mut def.tags[SV.index()];
    (sv.scale, sv.max) = (5.0, Some(crate::plant::tag::Bound::Fixed(max.into())));
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    plant.on_event(read(0, &[(PV, 700.0), (SV, 140.0), (DP, 1.0), (FAULT, 0.0)]));
    plant
}

/// The line of the journal that an operator's command leaves.
fn action_of(effects: &Effects) -> &ActionRecord {
    let action = effects.records.iter().find_map(|record| match record {
        Record::Action(action) => Some(action),
        _ => None,
    });
    action.expect("it is on record")
}

#[test]
fn a_write_is_recorded_with_the_value_that_the_device_holds() {
    let mut plant = in_steps(100.0);
    let effects = plant.on_command(shown(&plant, 1, SV, 72.3), at(1));
    assert_eq!((&*action_of(&effects).outcome, effects.bus.len()), ("refused: the device would store 72.5 °C", 0));
    let effects = plant.on_command(shown(&plant, 1, SV, 72.500_000_000_000_1), at(1));
    let BusRequest::Write(WriteJob { id, raw, .. }) = effects.bus[0].1.clone() else { panic!("a write was requested") };
    assert_eq!(raw, 145.0.into(), "72.5 °C goes out");
    assert_eq!(
        plant.snapshot().commands[0].command.kind,
        CommandKind::Write { tag: SV, value: 72.5.into() },
        "screens show it too"
    );
    let effects = plant.on_event(Event::Wrote { at: at(2), id, result: WriteResult::ReadBack(raw) });
    let action = action_of(&effects);
    assert_eq!((action.new.as_deref(), &*action.outcome), (Some("72.5 °C"), "verified"));
}

#[test]
fn rounding_never_leads_beyond_a_limit() {
    let range = Refusal::OutOfRange { min: "0.0".into(), max: "99.8".into() };
    for (value, sent, outcome) in [
        (99.8, None, Outcome::Refused(range.clone())),
        (99.7, None, Outcome::Refused(Refusal::Resolution("99.5 °C".into()))),
        (99.5, Some(199.0), Outcome::Pending),
        (99.9, None, Outcome::Refused(range)),
    ] {
        let mut plant = in_steps(99.8);
        let effects = plant.on_command(shown(&plant, 1, SV, value), at(1));
        let raw = effects.bus.first().map(|(_, request)| match request {
            BusRequest::Write(job) => job.raw.number().expect("a number").near(),
            other => panic!("not a write: {other:?}"),
        });
        assert_eq!((raw, plant.snapshot().commands[0].outcome.clone()), (sent, outcome), "{value}");
    }
}

#[test]
fn a_limit_itself_may_be_written_whatever_the_scale() {
    for (scale, max) in [(1.1, 3.3), (0.3, 0.9), (0.7, 4.9)] {
        let mut def = fixture::plant();
        let sv = &mut def.tags[SV.index()];
        (sv.scale, sv.max) = (scale, Some(crate::plant::tag::Bound::Fixed(max.into())));
        let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
        plant.on_event(read(0, &[(SV, 0.0), (DP, 0.0), (FAULT, 0.0)]));
        plant.on_command(shown(&plant, 1, SV, max), at(1));
        assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Pending, "{max} in steps of {scale}");
    }
}

#[test]
fn an_unchanged_double_is_not_refused_as_changed() {
    for (raw, scale, offset) in [(0.09, 0.1, 0.0), (0.14, 3.6, 0.0), (0.03, 0.01, 0.0), (20.05, 1.0, 273.15)] {
        let mut def = fixture::plant();
        let sv = &mut def.tags[SV.index()];
        (sv.point.kind, sv.decimals) = (crate::plant::tag::DataType::F64, crate::plant::tag::Decimals::Fixed(2));
        (sv.scale, sv.offset, sv.min, sv.max) = (scale, offset, None, None);
        let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
        plant.on_event(read(0, &[(SV, raw), (DP, 1.0), (FAULT, 0.0)]));
        plant.on_command(shown(&plant, 1, SV, 5.0), at(1));
        assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Pending, "raw {raw}");
        // What it holds already is not written, however its number came about.
        let mut again = plant.clone();
        again.on_event(read(2, &[(SV, raw + raw * f64::EPSILON)]));
        let held = again.snapshot().sample(SV).value.expect("it was read");
        let mut fresh = Plant::new(again.def().clone(), at(0), 1.0);
        fresh.on_event(read(0, &[(SV, raw), (DP, 1.0), (FAULT, 0.0)]));
        fresh.on_command(shown(&fresh, 1, SV, held), at(1));
        assert_eq!(fresh.snapshot().commands[0].outcome, Outcome::Unchanged, "raw {raw}");
    }
}

#[test]
fn a_write_that_saw_no_value_is_asked_again_and_a_stop_is_not() {
    let mut plant = running();
    let blind = |number, tag, value| command(number, CommandKind::Write { tag, value });
    let effects = plant.on_command(blind(1, SV, 65.0.into()), at(1));
    assert_eq!(effects.bus, []);
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::NotSeen("70.0 °C".into())));
    plant.on_command(blind(2, SV, 70.0.into()), at(1));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Unchanged, "there is nothing to overwrite");
    plant.on_event(fail(2, &[SV], Fault::Timeout));
    plant.on_command(blind(3, SV, 65.0.into()), at(3));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Pending, "the station does not know it either");
    let mut stopped = with_stop();
    stopped.on_event(read(1, &[(RUN, 1.0)]));
    stopped.on_command(blind(1, RUN, 0.0.into()), at(1));
    assert_eq!(stopped.snapshot().commands[0].outcome, Outcome::Pending);
}

#[test]
fn a_write_over_a_value_that_has_changed_is_refused() {
    let mut plant = running();
    plant.on_event(fail(1, &[SV], Fault::Timeout));
    let write = shown(&plant, 1, SV, 65.0);
    assert_eq!(write.command.expected_value, Some(70.0.into()), "a doubted value was shown as well");
    plant.on_event(read(2, &[(SV, 800.0)]));
    plant.on_command(write, at(3));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Refused(Refusal::ChangedTo("80.0 °C".into())));
}

#[test]
fn a_written_value_is_uncertain_for_the_true_cause() {
    let crc = Fault::Crc { got: 1, computed: 2 };
    let check = |result: WriteResult, expect: &str| {
        let mut def = fixture::plant();
        def.tags[SV.index()].write_unlock = Some((FAULT, 1.0));
        let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
        plant.on_event(read(0, &[(SV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
        let effects = plant.on_command(shown(&plant, 1, SV, 71.0), at(1));
        let BusRequest::Write(WriteJob { id, .. }) = effects.bus[0].1 else { panic!("a write was requested") };
        plant.on_event(Event::Unlocked { at: at(2), id, unlock_tag: FAULT, result: result.clone() });
        plant.on_event(Event::Wrote { at: at(2), id, result: result.clone() });
        for tag in [SV, FAULT] {
            assert_eq!(plant.snapshot().sample(tag).quality.word(), expect, "{result:?}");
        }
    };
    check(WriteResult::Accepted, "uncertain: written, not read back");
    check(WriteResult::NotRead(crc), "uncertain: corrupt response");
    check(WriteResult::NoValidResponse(crc), "uncertain: corrupt response");
    check(WriteResult::NoValidResponse(Fault::Timeout), "uncertain: response timeout");
    check(WriteResult::NoValidResponse(Fault::Exception(ExceptionCode(4))), "uncertain: refused by the device");
    check(WriteResult::Refused(ExceptionCode(3)), "good");
}

#[test]
fn a_broadcast_is_sent_and_its_device_never_silent() {
    let mut def = fixture::plant();
    def.devices[PLC.index()].unit = 0;
    def.tags[RUN.index()].access = crate::plant::tag::Access::Write;
    def.alarms[SILENT.index()].subject = Subject::Device(PLC);
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    let waiting = LineState::Waiting { why: "unplugged".into(), retry_at: at(2) };
    for (second, state) in [(0, waiting), (2, LineState::Connected)] {
        let effects = plant.on_event(Event::Line { at: at(second), line: L1, state });
        assert_eq!(alarm_events(effects), []);
        let snapshot = plant.snapshot();
        assert_eq!(snapshot.devices[PLC.index()].state, DeviceState::Unknown, "at {second} s");
        assert_ne!(snapshot.devices[TIC.index()].state, DeviceState::Unknown, "at {second} s");
    }
    assert_eq!(alarm_events(plant.on_tick(at(60))), []);
    let effects = plant.on_command(shown(&plant, 1, RUN, 1.0), at(61));
    let BusRequest::Write(job) = &effects.bus[0].1 else { panic!("not a write") };
    let effects = plant.on_event(Event::Wrote { at: at(61), id: job.id, result: WriteResult::Sent });
    assert_eq!(actions(&effects), ["anna write PLC-1.RUN sent, no unit answers a broadcast"]);
    let outcome = &plant.snapshot().commands[0].outcome;
    assert!(outcome.is_success() && *outcome == Outcome::Sent, "{outcome:?}");
}

#[test]
fn what_was_read_long_ago_is_read_again_before_it_is_written() {
    for (second, value, seen) in [(5, 65.0, None), (6, 65.0, Some(700.0)), (6, 70.0, Some(700.0))] {
        let mut plant = running();
        let status = CommandStatus { at: at(second), ..shown(&plant, 1, SV, value) };
        let effects = plant.on_command(status, at(second));
        let BusRequest::Write(job) = &effects.bus[0].1 else { panic!("a write was requested") };
        assert_eq!(job.over, seen.map(Into::into), "{value} at {second} s");
        for (held, expect) in
            [(705.0, Outcome::Refused(Refusal::ChangedTo("70.5 °C".into()))), (value * 10.0, Outcome::Unchanged)]
        {
            let mut plant = plant.clone();
            plant.on_event(Event::Wrote { at: at(second), id: job.id, result: WriteResult::Held(held.into()) });
            assert_eq!(plant.snapshot().commands[0].outcome, expect, "{value}, {held} is held");
        }
    }
    let mut plant = running();
    let status = CommandStatus { at: at(5), ..shown(&plant, 1, SV, 70.0) };
    plant.on_command(status, at(5));
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Unchanged, "it was read a moment ago");
}
