//! What a terminal sees is what the station has, whatever happened in between, and nothing costs next to nothing.
#![allow(clippy::unwrap_used)]

use std::{sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};
use proptest::prelude::*;

use super::Delta;
use crate::{
    attach::{protocol, redaction::redact},
    plant::{
        Snapshot,
        alarm::AlarmState,
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome},
        def::{AlarmId, Framing, TagId},
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState},
        event::{Fault, LineState},
        line_report::LineReport,
        parameter_set::StoredSet,
        sample::{Cause, Sample},
        snapshot::{ActiveAlarm, DeviceState},
        station::StationFault,
        traffic::{Exchange, Frame, Frames},
    },
    ui::fixture::{Fixture, now},
};

fn bytes(snapshot: &Snapshot) -> Vec<u8> {
    protocol::encode(snapshot, usize::MAX).unwrap()
}

fn size(delta: &Delta) -> usize {
    protocol::encode(delta, usize::MAX).unwrap().len()
}

/// Over the socket and taken in: all of it, by its bytes.
fn check(old: &Snapshot, new: &Snapshot) {
    let sent = protocol::encode(&Delta::between(old, new), usize::MAX).unwrap();
    let delta: Delta = protocol::decode(&sent[protocol::LENGTH_BYTES..], "delta").unwrap();
    let mut seen = old.clone();
    delta.apply(&mut seen).unwrap();
    if bytes(&seen) != bytes(new) {
        assert_eq!(format!("{seen:#?}"), format!("{new:#?}"));
        panic!("the same in words, not in bytes");
    }
}

/// Every mood of the fixture, and a plant of which nothing is known.
fn moods() -> Vec<Snapshot> {
    let fixtures =
        [Fixture::normal(), Fixture::alarm(), Fixture::line_down(), Fixture::traffic(), Fixture::traffic_trouble()];
    let mut moods: Vec<Snapshot> = fixtures.iter().map(|fixture| Snapshot::clone(&fixture.snapshot())).collect();
    let def = moods[0].def.clone();
    moods.iter_mut().for_each(|mood| mood.def = def.clone());
    moods.push(Snapshot::blank(def));
    moods
}

fn frame(number: u64) -> Frame {
    Frame {
        at: now(),
        sent: number.is_multiple_of(2),
        bytes: [1, 3, number as u8].into(),
        framing: Framing::Rtu,
        verdict: "ok".into(),
        unit: Some(1),
        number,
    }
}

/// Changes one thing of a snapshot; `kind` says what, `place` and `amount` how.
fn change(snapshot: &mut Snapshot, (kind, place, amount): (u8, u16, u32)) {
    let at = now() + SignedDuration::from_millis(i64::from(amount % 5) * 250);
    let tag = usize::from(place) % snapshot.samples.len();
    let device = usize::from(place) % snapshot.devices.len();
    snapshot.at = at;
    match kind {
        0 => snapshot.samples[tag] = Sample::good(f64::from(amount) / 8.0, at),
        1 => snapshot.samples[tag] = Sample::bad(Cause::Timeout, at),
        2 => snapshot.samples.iter_mut().for_each(|sample| *sample = sample.uncertain(Cause::Stale)),
        3 => Arc::make_mut(&mut snapshot.texts)[tag] = (amount % 2 == 0).then(|| format!("{amount}").into()),
        4 => {
            let exchange = Arc::new(Exchange {
                at,
                framing: Framing::Rtu,
                request: [1, 4].into(),
                answer: [amount as u8].into(),
                outcome: Err(Fault::Timeout),
                reply: None,
                tries: 1,
            });
            let source_frames = Arc::make_mut(&mut snapshot.source_frames).iter_mut().skip(tag).take(5);
            source_frames.for_each(|place| *place = (amount % 4 != 0).then(|| exchange.clone()));
        }
        5 => (snapshot.devices[device].ok, snapshot.devices[device].state) = (amount.into(), DeviceState::Failing(1)),
        6 => {
            let alarm = ActiveAlarm {
                returned_at: Some(at),
                value: Some(f64::from(amount)),
                ..ActiveAlarm::new(AlarmId(place % 4), AlarmState::ReturnedToNormal, at)
            };
            let place = usize::from(place) % (snapshot.alarms.len() + 1);
            Arc::make_mut(&mut snapshot.alarms).insert(place, alarm);
        }
        7 if !snapshot.alarms.is_empty() => {
            let place = usize::from(place) % snapshot.alarms.len();
            Arc::make_mut(&mut snapshot.alarms).remove(place);
        }
        8 => {
            let command = CommandStatus {
                from: "pts/3".into(),
                outcome: Outcome::Pending,
                ..CommandStatus::new(
                    Command::new(
                        0,
                        CommandId { terminal: u32::from(place), number: amount },
                        CommandKind::Write { tag: TagId(place), value: 1.0 },
                    ),
                    "anna",
                    at,
                )
            };
            snapshot.commands.insert(0, command);
            snapshot.commands.truncate(32);
        }
        9 if !snapshot.commands.is_empty() => snapshot.commands[0].outcome = Outcome::Verified,
        10 => snapshot.lines[0].state = LineState::Waiting { why: "gone".into(), retry_at: at },
        11 => change_report(snapshot, place, amount),
        12 => snapshot.lines[0].report = None,
        13 => {
            snapshot.lines[0].test = Some(Arc::new(DiagnosticRun {
                id: CommandId { terminal: 1, number: amount },
                by: "anna".into(),
                diagnostic: Diagnostic::Send(vec![1, 2]),
                started: at,
                done: amount,
                total: 9,
                now: "unit 3".into(),
                state: DiagnosticState::Running,
                findings: Vec::new(),
            }));
        }
        14 => (snapshot.history.rows, snapshot.speed) = (amount.into(), f64::from(amount % 3)),
        15 => snapshot.programs[device] = Some((Duration::from_secs(amount.into()), true)),
        16 => {
            let set = StoredSet { name: format!("set {amount}"), set: Err(vec!["bad".to_owned()]) };
            Arc::make_mut(&mut snapshot.sets).push(set);
        }
        17 => snapshot.decimals[tag] = (amount % 4) as u8,
        18 => {
            let details = format!("{amount} lost").into();
            Arc::make_mut(&mut snapshot.station).insert(StationFault::RecordsLost, details);
        }
        _ => {}
    }
}

fn change_report(snapshot: &mut Snapshot, place: u16, amount: u32) {
    let line = snapshot.def.lines[0].clone();
    let mut report = snapshot.lines[0].report.as_deref().cloned().unwrap_or_else(|| LineReport::new(line));
    report.counters.requests += u64::from(amount);
    report.busy.push(amount as f32);
    report.busy.drain(..report.busy.len().saturating_sub(60));
    if let Some(poll) = report.polls.first_mut() {
        poll.stats.count(Ok(()), Some(Duration::from_millis(amount.into())));
    }
    let next = report.frames.iter().next_back().map_or(1, |frame| frame.number + 1);
    match place % 4 {
        // A link that was started anew counts from one.
        0 => report.frames = Frames::from((1..u64::from(amount % 40)).map(frame).collect::<Vec<_>>()),
        _ => report.frames.extend((next..next + u64::from(amount % 400)).map(frame).collect()),
    }
    snapshot.lines[0].report = Some(Arc::new(report));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn deltas_reproduce_every_snapshot(
        (from, to) in (0usize..6, 0usize..6),
        changes in prop::collection::vec((0u8..19, any::<u16>(), 0u32..1_000), 0..24),
        more in prop::collection::vec((0u8..19, any::<u16>(), 0u32..1_000), 0..24),
    ) {
        let mut old = moods().swap_remove(from);
        changes.iter().for_each(|one| change(&mut old, *one));
        let mut new = old.clone();
        more.iter().for_each(|one| change(&mut new, *one));
        check(&old, &new);
        check(&moods()[to], &new);
        check(&new, &redact(&new));
        check(&redact(&old), &new);
    }

    #[test]
    fn a_delta_for_another_snapshot_is_found_out_or_harmless(
        changes in prop::collection::vec((0u8..19, any::<u16>(), 0u32..1_000), 0..24),
        (from, to) in (0usize..6, 0usize..6),
    ) {
        let mut new = moods().swap_remove(from);
        let old = new.clone();
        changes.iter().for_each(|one| change(&mut new, *one));
        // No panic is all that is asked: after an error the terminal begins anew.
        let _ = Delta::between(&old, &new).apply(&mut moods()[to]);
    }
}

#[test]
fn every_mood_is_reached_from_every_other() {
    let moods = moods();
    for old in &moods {
        moods.iter().for_each(|new| check(old, new));
    }
}

#[test]
fn a_plant_in_which_nothing_happens_costs_a_few_bytes() {
    let old = Snapshot::clone(&Fixture::traffic_trouble().snapshot());
    let mut new = old.clone();
    new.at += SignedDuration::from_millis(250);
    let (whole, nothing) = (bytes(&old).len(), size(&Delta::between(&old, &new)));
    assert!(nothing < 64, "{nothing} bytes");
    let first = size(&Delta::between(&Snapshot::blank(old.def.clone()), &old));
    assert!(first < whole, "the first is {first} bytes, the snapshot with its definition {whole}");
}

#[test]
fn tags_of_one_answer_share_its_time() {
    let old = Snapshot::clone(&Fixture::normal().snapshot());
    let mut new = old.clone();
    for sample in &mut new.samples {
        *sample = Sample::good(sample.value.unwrap_or_default(), now());
    }
    let cost = size(&Delta::between(&old, &new));
    assert!(cost < 128, "{} tags read again cost {cost} bytes", new.samples.len());
}

#[test]
fn without_a_login_no_value_leaves_the_station() {
    let mut snapshot = Snapshot::clone(&Fixture::alarm().snapshot());
    (0..19).for_each(|kind| change(&mut snapshot, (kind, 1, 1)));
    Arc::make_mut(&mut snapshot.alarms)[0].value = Some(72.1);
    let seen = redact(&snapshot);
    assert!(seen.samples.iter().all(|sample| *sample == Sample::bad(Cause::NotAuthorised, snapshot.at)));
    assert!(seen.texts.iter().all(Option::is_none) && seen.source_frames.iter().all(Option::is_none));
    assert!(seen.lines.iter().all(|line| line.report.is_none() && line.test.is_none()));
    assert!(seen.commands.is_empty() && seen.sets.is_empty() && seen.restores.is_empty());
    assert!(seen.alarms.iter().all(|alarm| alarm.value.is_none()));
    let known = |snapshot: &Snapshot| -> Vec<(AlarmId, AlarmState, Timestamp)> {
        snapshot.alarms.iter().map(|alarm| (alarm.id, alarm.state, alarm.raised_at)).collect()
    };
    assert_eq!(known(&seen), known(&snapshot), "alarms stay to be seen");
    assert_eq!((seen.at, &seen.history), (snapshot.at, &snapshot.history));
}
