//! A past instant: what the history tells of it equals what a terminal saw then.

use super::*;
use crate::{
    history::{io::archive::LeftOut, tiers::HOUR},
    plant::{
        Plant,
        alarm::AlarmCommand,
        command::{Command, CommandId, CommandKind, CommandStatus},
        event::Event,
        fault::Fault,
        fixture::{self, DP, FAULT, HIGH, PLC, PV, RUN, SV, TIC},
        line_state::{DeviceState, LineState},
        sample::Quality,
        snapshot::Snapshot,
    },
};

/// Two hours and a quarter, beginning in the middle of one.
const BEGIN: i64 = HOUR / 1_000_000 / 2;
const END: i64 = BEGIN + 8_100;

/// The fixture, every change of which is stored.
fn def() -> Arc<PlantDef> {
    let mut def = fixture::plant();
    def.tags.iter_mut().for_each(|tag| tag.deadband = Some(0.0));
    Arc::new(def)
}

/// A plant that lives at random: values, failures, a lost line, alarms that are acknowledged and shelved. Hands over what
/// is stored in each second, and what is seen at its end.
fn live(def: &Arc<PlantDef>, mut each: impl FnMut(i64, Vec<Record>, Snapshot)) {
    let mut plant = Plant::new(def.clone(), sec(BEGIN), 1.0);
    let mut seed = 11_u64;
    let mut random = move |below: i64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as i64 % below
    };
    let mut fails_until = [0; 2];
    for second in BEGIN..END {
        let (at, mut records) = (sec(second), Vec::new());
        let mut take = |effects: crate::plant::Effects| records.extend(effects.records);
        if second == BEGIN || second == BEGIN + 3_000 {
            take(plant.on_event(Event::Line { at, line: LineId(0), state: LineState::Connected }));
        }
        if second == BEGIN + 2_900 {
            let state = LineState::Waiting { why: "unplugged".into(), retry_at: at };
            take(plant.on_event(Event::Line { at, line: LineId(0), state }));
        }
        let unplugged = (BEGIN + 2_900..BEGIN + 3_000).contains(&second);
        for (place, (device, values)) in [
            (
                TIC,
                vec![
                    (DP, 1.0),
                    (FAULT, f64::from(u8::from(random(300) == 0))),
                    (PV, (600 + random(300)) as f64),
                    (SV, 700.0),
                ],
            ),
            (PLC, vec![(RUN, (second / 400 % 2) as f64)]),
        ]
        .into_iter()
        .enumerate()
        {
            if fails_until[place] < second && random(700) == 0 {
                fails_until[place] = second + random(600);
            }
            if unplugged {
                continue;
            }
            let tags = values.iter().map(|(tag, _)| *tag).collect();
            let values = fixture::raw(values);
            let event = match second < fails_until[place] {
                true => Event::Failed { at, device, tags, fault: Fault::Timeout, exchange: None },
                false => {
                    Event::Read { at, device, values, texts: Vec::new(), response_time: Duration::ZERO, exchange: None }
                }
            };
            take(plant.on_event(event));
        }
        let snapshot = plant.snapshot();
        let kind = match random(40) {
            0 => snapshot.acknowledge_all(),
            1 if random(20) == 0 => Some(CommandKind::Alarm(AlarmCommand::Shelve {
                alarms: [HIGH].into(),
                lasts: Duration::from_secs(300),
            })),
            _ => None,
        };
        if let Some(kind) = kind {
            let command =
                Command::new(snapshot.run, CommandId { terminal: 1, number: u32::try_from(second).unwrap() }, kind);
            let command = Command { note: Some("seen".into()), ..command };
            take(plant.on_command(CommandStatus::new(command, "somchai", at), at));
        }
        take(plant.on_tick(at));
        each(second, records, plant.snapshot());
    }
}

/// What a terminal shows of values, alarms, devices and the line.
type Shown = (Vec<(Option<f64>, Quality)>, String, String, Vec<DeviceState>, bool);

fn shown(snapshot: &Snapshot) -> Shown {
    let values = snapshot.samples.iter().map(|sample| (sample.value, sample.quality)).collect();
    let alarms = snapshot.alarms.iter().map(|alarm| {
        let note = alarm.acknowledged.as_ref().map(|note| (note.by.clone(), note.at));
        format!("{:?} {:?} {} {:?} {:?}; ", alarm.id, alarm.state, alarm.raised_at, alarm.returned_at, note)
    });
    let suppressed =
        snapshot.suppressed.iter().map(|alarm| format!("{:?} {:?} {:?}; ", alarm.id, alarm.state, alarm.until));
    let devices = snapshot.devices.iter().map(|device| match device.state {
        DeviceState::Failing(_) => DeviceState::Failing(1),
        DeviceState::Down { .. } => DeviceState::Down { since: sec(0) },
        other => other,
    });
    (values, alarms.collect(), suppressed.collect(), devices.collect(), snapshot.lines[0].state == LineState::Connected)
}

fn past(store: &Store, at: Timestamp, now: i64) -> Snapshot {
    match store.answer(&Query::Past { at }, sec(now)).unwrap() {
        Answer::Past(past) => past.snapshot(def()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_past_instant_is_as_it_was_seen() {
    let (_folder, db) = folder();
    let open = || Store::open(&db, &def(), sec(END)).unwrap().store;
    let (store, mut seen, mut waiting) = (open(), Vec::new(), Vec::new());
    live(&def(), |second, records, snapshot| {
        waiting.extend(records);
        if second % 31 == 0 {
            store.append(&std::mem::take(&mut waiting)).unwrap();
            seen.push((second, shown(&snapshot)));
        }
    });
    store.append(&waiting).unwrap();
    let check = |store: &Store, what: &str| {
        for (second, expect) in &seen {
            let got = shown(&past(store, sec(*second), END));
            assert_eq!(got, *expect, "{what}: at {second}");
        }
    };
    assert!(seen.iter().any(|(_, shown)| shown.1.contains("Acknowledged")), "alarms are acknowledged");
    assert!(seen.iter().any(|(_, shown)| shown.2.contains("Shelved")), "and shelved");
    check(&store, "as it was stored");
    while let Some(job) = store.archive_due(sec(END), &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    check(&store, "archived");
    drop(store);
    check(&open(), "after a start");
    // From here on the station is off, whatever its devices said last.
    let store = open();
    store.mark_station_off(sec(END)).unwrap();
    let off = past(&store, sec(END + 60), END + 60);
    assert!(off.samples.iter().all(|sample| *sample == Sample::bad(Cause::StationOff, sec(END))), "{:?}", off.samples);
    assert_eq!(off.devices[TIC.index()].state, DeviceState::Unknown);
    for at in [BEGIN - 1, END + 61] {
        let refused = store.answer(&Query::Past { at: sec(at) }, sec(END + 60));
        let expect = HistoryError::NotKept { at: sec(at), first: sec(BEGIN), last: sec(END + 60) };
        assert_eq!(refused, Err(expect));
    }
}

#[test]
fn the_time_of_the_next_stored_value_is_found() {
    let (_folder, db) = folder();
    let store = Store::open(&db, &def(), sec(END)).unwrap().store;
    let stored = |second| Record::Sample(TagId(0), Sample::good(second as f64, sec(second)));
    store.append(&[stored(10), stored(20), stored(30)]).unwrap();
    for (from, to, latest, expect) in [(11, 31, false, Some(20)), (0, 30, true, Some(20)), (31, 60, false, None)] {
        let query = Query::SampleTime { tags: vec![TagId(0)], from: sec(from), to: sec(to), latest };
        assert_eq!(store.answer(&query, sec(END)).unwrap(), Answer::SampleTime(expect.map(sec)), "{from} to {to}");
    }
}
