//! A device is asked what it is where its profile has a condition on that, and no other is.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use tokio::time::Instant;

use super::{slave::Line, *};
use crate::plant::{
    PlantDef,
    def::LineId,
    diagnostics::Diagnostic,
    expr::{Compare, Expr},
    identity::{IdentityObject, IdentityTest},
};

/// The basic objects of a device with this revision.
pub fn identification(unit: u8, revision: &str) -> Vec<u8> {
    let mut answer = vec![unit, 0x2B, 0x0E, 1, 1, 0, 0, 3];
    for (id, text) in (0..).zip(["ACME", "M1", revision]) {
        answer.extend([&[id, text.len() as u8], text.as_bytes()].concat());
    }
    answer
}

const U1: DeviceId = DeviceId(0);

/// The first unit has its first tag from revision 2.10 on.
pub fn asking(mode: Mode) -> PlantDef {
    let mut def = plant(mode);
    let object = IdentityObject::of("revision").expect("an object");
    let test = IdentityTest { device: U1, object, compare: Compare::AtLeast, with: "2.10".into() };
    def.tags[0].when = Some(Arc::new(Expr::Identity(test)));
    def
}

/// What the first unit has said within a time of the line, and how many reads of each unit were good.
async fn identified_until(line: &mut Line, def: &PlantDef, second: i64) -> (Vec<String>, [usize; 2]) {
    let (mut said, mut good) = (Vec::new(), [0; 2]);
    loop {
        match line.next(def).await {
            Event::Identified { device, objects, .. } => {
                assert_eq!(device, U1);
                let revision = objects.into_iter().find(|(object, _)| object.0 == 2);
                said.push(revision.map(|(_, text)| text).unwrap_or_default());
            }
            Event::Read { at, device, .. } => {
                good[device.index()] += 1;
                if second <= at.as_second() {
                    return (said, good);
                }
            }
            Event::Line { state: LineState::Waiting { .. }, .. } => panic!("the connection was given up"),
            _ => {}
        }
    }
}

/// Counts the requests for an identification, each of which gets what `action` says; all else is answered.
fn counted(
    count: &Arc<AtomicUsize>,
    action: impl Fn() -> SlaveAction + Send + 'static,
) -> impl FnMut(usize, &[u8]) -> SlaveAction + Send + 'static {
    let count = Arc::clone(count);
    move |_, message: &[u8]| match message {
        [1, 0x2B, ..] => {
            count.fetch_add(1, Ordering::Relaxed);
            action()
        }
        [_, 0x2B, ..] => panic!("no profile asks what it is: {message:?}"),
        _ => SlaveAction::Answer,
    }
}

#[tokio::test(start_paused = true)]
async fn a_device_is_asked_once_what_it_is() {
    for mode in Mode::ALL {
        let (def, count) = (asking(mode), Arc::default());
        let mut line = line(def.clone());
        line.plug(mode, counted(&count, || SlaveAction::Answer));
        let (said, good) = identified_until(&mut line, &def, 1_000).await;
        assert_eq!((said, count.load(Ordering::Relaxed)), (vec!["2.10".to_owned()], 1), "{mode:?}");
        assert!(good.iter().all(|good| 2_900 < *good), "{mode:?}: {good:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn what_a_device_does_not_tell_costs_few_requests() {
    let silent = || SlaveAction::Silent;
    let refuses = || SlaveAction::Exception(1);
    let script: [(fn() -> SlaveAction, _, _); 2] = [(silent, vec![], 3), (refuses, vec![String::new()], 1)];
    for mode in Mode::ALL {
        for (action, expect, requests) in script.clone() {
            let (def, count) = (asking(mode), Arc::default());
            let mut line = line(def.clone());
            line.plug(mode, counted(&count, action));
            let (said, good) = identified_until(&mut line, &def, 1_000).await;
            assert_eq!((said, count.load(Ordering::Relaxed)), (expect, requests), "{mode:?}");
            assert!(good.iter().all(|good| 2_900 < *good), "{mode:?}: {good:?}");
        }
    }
}

/// An identification that comes when it was given up is taken for no value, and a later one is still taken.
#[tokio::test(start_paused = true)]
async fn a_late_identification_is_taken_for_nothing_else() {
    for mode in Mode::ALL {
        // What is later ends a connection over a network.
        let is_serial = matches!(mode, Mode::Rtu | Mode::Ascii);
        for late_ms in [310, 500, 700, 1_500, 2_900].into_iter().filter(|ms| *ms < 1_000 || is_serial) {
            let (def, count) = (asking(mode), Arc::new(AtomicUsize::new(0)));
            let seen = Arc::clone(&count);
            let late = move || match seen.load(Ordering::Relaxed) {
                1 => SlaveAction::Late(late_ms * MS),
                _ => SlaveAction::Answer,
            };
            let mut line = line(def.clone());
            line.plug(mode, counted(&count, late));
            let (said, good) = identified_until(&mut line, &def, 120).await;
            assert_eq!(said, ["2.10"], "{mode:?}, late by {late_ms} ms");
            assert!(good.iter().all(|good| 250 < *good), "{mode:?}, late by {late_ms} ms: {good:?}");
        }
    }
}

/// It is replaced while it is off.
#[tokio::test(start_paused = true)]
async fn a_device_that_comes_back_is_asked_again() {
    for mode in Mode::ALL {
        let (def, since) = (asking(mode), Instant::now());
        let mut line = line(def.clone());
        line.plug(mode, move |_, message: &[u8]| match (since.elapsed().as_secs(), message) {
            (100..200, [1, ..]) => SlaveAction::Silent,
            (second, [1, 0x2B, ..]) => {
                SlaveAction::Instead(identification(1, if second < 100 { "2.9" } else { "2.10" }))
            }
            _ => SlaveAction::Answer,
        });
        let (said, _) = identified_until(&mut line, &def, 400).await;
        assert_eq!(said, ["2.9", "2.10"], "{mode:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_new_connection_asks_again() {
    for mode in Mode::ALL {
        let def = asking(mode);
        let mut line = line(def.clone());
        let first = line.plug(mode, |_, _| SlaveAction::Answer);
        assert_eq!(identified_until(&mut line, &def, 10).await.0, ["2.10"], "{mode:?}");
        line.plug(mode, |_, message| match message {
            [1, 0x2B, ..] => SlaveAction::Instead(identification(1, "2.11")),
            _ => SlaveAction::Answer,
        });
        first.abort();
        let said = |event: &Event| match event {
            Event::Identified { objects, .. } => Some(objects[2].1.clone()),
            _ => None,
        };
        assert_eq!(line.until(&def, said).await, "2.11", "{mode:?}");
    }
}

/// It was updated while it answered: an operator who asks it what it is does not wait an hour for its values.
#[tokio::test(start_paused = true)]
async fn an_operator_who_identifies_it_asks_for_its_profile_too() {
    for mode in Mode::ALL {
        let (def, since) = (asking(mode), Instant::now());
        let mut line = line(def.clone());
        line.plug(mode, move |_, message: &[u8]| match message {
            [1, 0x2B, ..] => {
                let revision = if since.elapsed().as_secs() < 60 { "2.9" } else { "2.10" };
                SlaveAction::Instead(identification(1, revision))
            }
            _ => SlaveAction::Answer,
        });
        assert_eq!(identified_until(&mut line, &def, 100).await.0, ["2.9"], "{mode:?}");
        diagnostics::start(&line, Diagnostic::Identify { unit: 1 }).await;
        assert_eq!(identified_until(&mut line, &def, 200).await.0, ["2.10"], "{mode:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn another_plant_file_asks_again() {
    for mode in Mode::ALL {
        let (before, def, count) = (plant(mode), asking(mode), Arc::default());
        let mut line = line(before.clone());
        line.plug(mode, counted(&count, || SlaveAction::Answer));
        line.read(&before).await;
        assert_eq!(count.load(Ordering::Relaxed), 0, "{mode:?}: nothing depends on it");
        for times in 1..=2 {
            redefined::redefine(&mut line, &before, &def, LineId(0)).await;
            assert_eq!(identified_until(&mut line, &def, 60 * times).await.0, ["2.10"], "{mode:?}");
        }
    }
}

/// The device ends each connection on which it is asked what it is.
#[tokio::test(start_paused = true)]
async fn a_device_that_hangs_up_on_it_is_polled_all_the_same() {
    for mode in [Mode::RtuOverTcp, Mode::Tcp, Mode::Tcp16] {
        let (def, count) = (asking(mode), Arc::default());
        let mut line = line(def.clone());
        (0..20).for_each(|_| drop(line.plug(mode, counted(&count, || SlaveAction::HangUp))));
        let good = |event: &Event| matches!(event, Event::Read { at, .. } if 1_000 <= at.as_second()).then_some(());
        line.until(&def, good).await;
        assert_eq!(count.load(Ordering::Relaxed), 2, "{mode:?}");
    }
}
