//! What a terminal sees is what the station has, as far as it may.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::*;
use crate::{
    attach::{
        protocol::{self, LENGTH_BYTES, ServerMessage},
        redaction::redact,
    },
    plant::{
        alarm::AlarmState,
        command::{Command, CommandId, CommandKind, CommandStatus},
        def::{AlarmId, Framing, TagId},
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState, DiagnosticStep},
        fault::Fault,
        parameter_set::StoredSet,
        sample::{Cause, Sample},
        station_fault::StationFault,
        traffic::Exchange,
    },
    ui::fixture::{Fixture, now},
};

fn bytes(message: &ServerMessage) -> Vec<u8> {
    protocol::encode(message, usize::MAX).unwrap().split_off(LENGTH_BYTES)
}

/// Over the socket and put together again.
fn receive(snapshot: &Snapshot) -> Arc<Snapshot> {
    let mut assembly = Assembly::new(snapshot.def.clone());
    let reports = snapshot.lines.iter().zip(0..);
    let reports = reports.map(|(line, id)| ServerMessage::LineReport(LineId(id), line.report.clone()));
    for message in reports.chain([ServerMessage::Snapshot(Arc::new(snapshot.clone()))]) {
        match protocol::decode(&bytes(&message), "message").unwrap() {
            ServerMessage::LineReport(line, report) => assembly.on_report(line, report).unwrap(),
            ServerMessage::Snapshot(snapshot) => assembly.on_snapshot(Arc::unwrap_or_clone(snapshot)).unwrap(),
            other => panic!("{other:?}"),
        }
    }
    assembly.latest().clone()
}

fn check(sent: &Snapshot) {
    let seen = receive(sent);
    let snapshot = |snapshot: &Snapshot| bytes(&ServerMessage::Snapshot(Arc::new(snapshot.clone())));
    assert_eq!(snapshot(&seen), snapshot(sent));
    assert_eq!(seen.samples, sent.samples);
    assert_eq!(seen.source_frames, sent.source_frames);
    assert_eq!(seen.lines, sent.lines);
    assert!(Arc::ptr_eq(&seen.def, &sent.def));
}

/// With something of everything that a terminal may see.
fn full() -> Snapshot {
    let mut snapshot = Snapshot::clone(&Fixture::traffic_trouble().snapshot());
    snapshot.alarms = Fixture::alarm().snapshot().alarms.clone();
    Arc::make_mut(&mut snapshot.alarms)[0].value = Some(72.1.into());
    for (index, sample) in snapshot.samples.iter_mut().enumerate() {
        let at = now() + SignedDuration::from_millis(index as i64 % 3 * 250);
        *sample = if index % 4 == 0 { Sample::bad(Cause::Timeout, at) } else { Sample::good(index as f64 / 8.0, at) };
    }
    Arc::make_mut(&mut snapshot.texts)[1] = Some("1.07".into());
    let exchange = Arc::new(Exchange {
        at: now(),
        framing: Framing::Rtu,
        request: [1, 4].into(),
        answer: [7].into(),
        outcome: Err(Fault::Timeout),
        response_time: None,
        tries: 1,
    });
    Arc::make_mut(&mut snapshot.source_frames)[..3].fill(Some(exchange));
    let id = CommandId { terminal: 1, number: 7 };
    let command = Command::new(0, id, CommandKind::Write { tag: TagId(0), value: 1.0.into() });
    snapshot.commands.insert(0, CommandStatus::new(command, "anna", now()));
    snapshot.lines[0].test = Some(Arc::new(DiagnosticRun {
        id,
        by: "anna".into(),
        diagnostic: Diagnostic::Send(vec![1, 2]),
        started: now(),
        done: 3,
        total: 9,
        requests: 3,
        errors: 1,
        now: Some(DiagnosticStep::Request { unit: 3, function: 8, serial: None }),
        state: DiagnosticState::Running,
        findings: Vec::new(),
    }));
    snapshot.programs[0] = Some((Duration::from_secs(7), true));
    Arc::make_mut(&mut snapshot.sets).push(StoredSet { name: "set".into(), set: Err(vec!["bad".to_owned()]) });
    Arc::make_mut(&mut snapshot.station).insert(StationFault::RecordsLost, "7 lost".into());
    snapshot
}

#[test]
fn every_snapshot_survives_the_socket() {
    let fixtures =
        [Fixture::normal(), Fixture::alarm(), Fixture::line_down(), Fixture::traffic(), Fixture::traffic_trouble()];
    for fixture in fixtures {
        check(&fixture.snapshot());
        check(&redact(&fixture.snapshot()));
    }
    check(&full());
    check(&Snapshot::blank(full().def));
}

#[test]
fn tags_of_one_answer_share_its_time_and_frame() {
    let snapshot = full();
    let size = |snapshot: Snapshot| bytes(&ServerMessage::Snapshot(Arc::new(snapshot))).len();
    let mut one = snapshot.clone();
    let frame = one.source_frames[0].clone();
    Arc::make_mut(&mut one.source_frames).fill(frame);
    one.samples.iter_mut().for_each(|sample| *sample = Sample::good(1.0, now()));
    let mut none = snapshot.clone();
    Arc::make_mut(&mut none.source_frames).fill(None);
    none.samples.iter_mut().for_each(|sample| *sample = Sample { value: None, ..Sample::good(1.0, now()) });
    let (tags, cost) = (snapshot.samples.len(), size(one) - size(none));
    assert!(cost < 8 * tags + 64, "{tags} values cost {cost} bytes");
}

#[test]
fn messages_of_another_plant_are_refused() {
    let snapshot = full();
    let mut assembly = Assembly::new(Arc::default());
    assert_eq!(assembly.on_snapshot(snapshot.clone()), Err(OtherPlant));
    assert_eq!(assembly.on_report(LineId(0), None), Err(OtherPlant));
    let mut assembly = Assembly::new(snapshot.def.clone());
    let short = Snapshot { samples: Vec::new(), ..snapshot };
    assert_eq!(assembly.on_snapshot(short), Err(OtherPlant));
}

#[test]
fn without_a_login_no_value_leaves_the_station() {
    let snapshot = full();
    let seen = receive(&redact(&snapshot));
    assert!(seen.samples.iter().all(|sample| *sample == Sample::bad(Cause::NotAuthorised, snapshot.at)));
    assert!(seen.texts.iter().all(Option::is_none) && seen.source_frames.iter().all(Option::is_none));
    assert!(seen.lines.iter().all(|line| line.report.is_none() && line.test.is_none()));
    assert!(seen.commands.is_empty() && seen.sets.is_empty() && seen.restores.is_empty());
    assert!(seen.alarms.iter().all(|alarm| alarm.value.is_none()));
    let known = |snapshot: &Snapshot| -> Vec<(AlarmId, AlarmState, Timestamp)> {
        snapshot.alarms.iter().map(|alarm| (alarm.id, alarm.state, alarm.raised_at)).collect()
    };
    assert_eq!(known(&seen), known(&snapshot), "alarms stay visible");
    assert_eq!((seen.at, &seen.history), (snapshot.at, &snapshot.history));
}
