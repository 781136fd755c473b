//! Values of 64 bits, to the last digit: shown, doubted, stored, alarmed, written and compared.

use super::*;
use crate::plant::{
    exact::Exact,
    snapshot::Snapshot,
    tag::{Bound, DataType, Decimals},
};

/// Just above what an `f64` counts to.
const LEAST: i128 = 1 << 53;

/// PV is a counter whose greatest number means that it has none; SV can be set to one more than [`LEAST`].
fn counting() -> Plant {
    let mut def = fixture::plant();
    for tag in [PV, SV] {
        let tag = &mut def.tags[tag.index()];
        (tag.point.kind, tag.scale, tag.decimals) = (DataType::U64, 1.0, Decimals::Fixed(0));
        (tag.quality_from, tag.deadband) = (None, Some(0.0));
    }
    def.tags[PV.index()].bad_if = vec![Exact::whole(u64::MAX.into()).into()];
    def.tags[SV.index()].max = Some(Bound::Fixed(Exact::whole(LEAST + 1)));
    let alarm = &mut def.alarms[0];
    alarm.condition = Condition::Limit { level: crate::plant::def::Level::High, limit: LEAST as f64, deadband: 0.0 };
    alarm.on_delay = Duration::ZERO;
    Plant::new(Arc::new(def), at(0), 1.0)
}

fn numbers(second: i64, values: &[(TagId, i128)]) -> Event {
    let values = values.iter().map(|(tag, value)| (*tag, Exact::whole(*value))).collect();
    let (texts, response_time) = (Vec::new(), Duration::ZERO);
    Event::Read { at: at(second), device: TIC, values, texts, response_time, exchange: None }
}

fn stored(effects: &Effects) -> Vec<Option<Exact>> {
    let value = |record: &Record| if let Record::Sample(PV, sample) = record { Some(sample.exact()) } else { None };
    effects.records.iter().filter_map(value).collect()
}

#[test]
fn each_number_of_64_bits_is_shown_and_stored_as_it_was_read() {
    let mut plant = counting();
    let two_to = |power: u32| 1_i128 << power;
    let around = [LEAST - 1, LEAST, LEAST + 1, LEAST + 2, two_to(63), two_to(63) + 1, two_to(64) - 2];
    for (second, number) in around.into_iter().enumerate() {
        let effects = plant.on_event(numbers(second as i64, &[(PV, number)]));
        assert_eq!(plant.snapshot().text(PV).as_deref(), Some(&*number.to_string()));
        assert_eq!(stored(&effects), [Some(Exact::whole(number))], "{number}: it differs from the one before");
    }
    // What means no value is one number, not all that an f64 cannot tell from it.
    plant.on_event(numbers(20, &[(PV, u64::MAX.into())]));
    assert_eq!(plant.snapshot().sample(PV).quality, Quality::Bad(Cause::SensorFault));
    // The snapshot of an attached terminal is the same one.
    plant.on_event(numbers(21, &[(PV, LEAST + 1), (SV, LEAST + 1)]));
    let bytes = postcard::to_stdvec(&plant.snapshot()).expect("a snapshot is encodable");
    let attached: Snapshot = postcard::from_bytes(&bytes).expect("its own bytes");
    assert_eq!(attached.sample(PV).exact(), Some(Exact::whole(LEAST + 1)));
}

#[test]
fn an_alarm_of_64_bits_comes_with_the_number_that_is_beyond() {
    let mut plant = counting();
    let raised = |effects: Effects| alarm_events(effects).first().map(|event| (event.event, event.value));
    assert_eq!(raised(plant.on_event(numbers(1, &[(PV, LEAST - 1)]))), None);
    let above = raised(plant.on_event(numbers(2, &[(PV, LEAST + 1)])));
    assert_eq!(above, Some((AlarmEvent::Raised, Some(Exact::whole(LEAST + 1)))));
}

#[test]
fn a_write_of_64_bits_is_checked_and_compared_to_its_last_digit() {
    let write = |number: i128, read_back: i128| {
        let mut plant = counting();
        plant.on_event(numbers(0, &[(SV, LEAST)]));
        let kind = CommandKind::Write { tag: SV, value: Exact::whole(number) };
        let command = plant.snapshot().command(CommandId { terminal: 1, number: 1 }, kind);
        let effects = plant.on_command(CommandStatus::new(command, "anna", at(1)), at(1));
        let sent = effects.bus.first().map(|(_, request)| match request {
            BusRequest::Write(job) => (job.id, job.raw.number().expect("a number")),
            other => panic!("not a write: {other:?}"),
        });
        let on_record = sent.map(|(id, _)| {
            let result = WriteResult::ReadBack(Exact::whole(read_back).into());
            let effects = plant.on_event(Event::Wrote { at: at(2), id, result });
            recorded(&effects).next().map(|action| (action.old.clone(), action.new.clone()))
        });
        (plant.snapshot().commands[0].outcome.clone(), sent.map(|(_, raw)| raw), on_record.flatten())
    };
    let sent = Some(Exact::whole(LEAST + 1));
    let (outcome, raw, on_record) = write(LEAST + 1, LEAST + 1);
    assert_eq!((outcome, raw), (Outcome::Verified, sent), "one more than the device has is no `unchanged`");
    let text = |number: &str| Some(format!("{number} °C").into());
    assert_eq!(on_record, Some((text("9007199254740992"), text("9007199254740993"))));
    let different = NotConfirmed::Different(Exact::whole(LEAST).into());
    assert_eq!(write(LEAST + 1, LEAST).0, Outcome::NotConfirmed(different));
    let (min, max) = ("0".into(), "9007199254740993".into());
    let beyond = Outcome::Refused(Refusal::OutOfRange { min, max });
    assert_eq!(write(LEAST + 2, LEAST + 2), (beyond, None, None));
    assert_eq!(write(LEAST, LEAST).0, Outcome::Unchanged);
}

#[test]
fn interlocks_and_enumerations_of_64_bits_mean_one_number() {
    let mut def = fixture::plant();
    let state = &mut def.tags[PV.index()];
    (state.point.kind, state.scale, state.decimals) = (DataType::U64, 1.0, Decimals::Fixed(0));
    state.quality_from = None;
    state.enum_labels = vec![(1 << 63, "OPEN".into()), ((1 << 63) + 1, "SHUT".into())];
    let when = InterlockCondition::Above(2f64.powi(63));
    let message = "not while it is shut".to_owned();
    def.logic.interlocks = vec![InterlockDef { tag: RUN, value: 1.0, of: PV, when, message, refuse: true }];
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.on_event(read(0, &[(RUN, 0.0)]));
    for (number, label, refused) in [(1 << 63, "OPEN", false), ((1 << 63) + 1, "SHUT", true)] {
        plant.on_event(numbers(1, &[(PV, number)]));
        assert_eq!(plant.snapshot().text(PV).as_deref(), Some(label));
        let effects = plant.on_command(shown(&plant, 1, RUN, 1.0), at(2));
        let outcome = &plant.snapshot().commands[0].outcome;
        assert_eq!(matches!(outcome, Outcome::Refused(Refusal::Interlock(_))), refused, "{label}: {outcome:?}");
        effects.bus.iter().for_each(|(_, request)| {
            let BusRequest::Write(job) = request else { panic!("not a write: {request:?}") };
            plant.on_event(Event::Wrote { at: at(3), id: job.id, result: WriteResult::ReadBack(0.0.into()) });
        });
    }
}
