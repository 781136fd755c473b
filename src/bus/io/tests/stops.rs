//! Stops: what may hold them, and for how long.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use tokio::time::Instant;

use super::slave::{Line, MS, Mode, SlaveAction, line, plant, until_silent};
use crate::plant::{
    command::{BusRequest, WriteId, WriteJob},
    def::{DeviceId, TagId},
    event::{Event, WriteResult},
    fault::Fault,
};

/// The first tag of each unit is register 10, which holds 10 whatever is written.
const FIRST_OF: [TagId; 2] = [TagId(0), TagId(10)];

fn write(id: u64, tag: TagId, urgent: bool) -> BusRequest {
    BusRequest::Write(WriteJob {
        id: WriteId(id),
        tag,
        raw: 10.0.into(),
        unlock: None,
        verify: true,
        urgent,
        over: None,
        unscaled_by: None,
    })
}

async fn end_of(line: &mut Line, def: &crate::plant::PlantDef, id: u64) -> WriteResult {
    let ended = |event: &Event| match event {
        Event::Wrote { id: ended, result, .. } if *ended == WriteId(id) => Some(result.clone()),
        _ => None,
    };
    line.until(def, ended).await
}

/// What was given up may hear a stop all the same; other writes are refused there.
#[tokio::test(start_paused = true)]
async fn a_stop_is_sent_to_a_device_that_is_given_up() {
    for mode in Mode::ALL {
        for hears in [false, true] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let writes = Arc::new(Mutex::new(0));
            let count = writes.clone();
            line.plug(mode, move |_, message| match message {
                [1, 6, ..] => {
                    *count.lock().expect("no panic") += 1;
                    if hears { SlaveAction::Answer } else { SlaveAction::Silent }
                }
                [1, ..] if !hears || *count.lock().expect("no panic") == 0 => SlaveAction::Silent,
                _ => SlaveAction::Answer,
            });
            let given_up = |event: &Event| {
                matches!(event, Event::Failed { device: DeviceId(0), fault: Fault::BackedOff, .. }).then_some(())
            };
            line.until(&def, given_up).await;
            line.requests.send(write(1, FIRST_OF[0], false)).await.expect("the line runs");
            assert_eq!(end_of(&mut line, &def, 1).await, WriteResult::NotSent(Fault::BackedOff), "{mode:?}");
            line.requests.send(write(2, FIRST_OF[0], true)).await.expect("the line runs");
            let expect =
                if hears { WriteResult::ReadBack(10.0.into()) } else { WriteResult::NoValidResponse(Fault::Timeout) };
            assert_eq!(end_of(&mut line, &def, 2).await, expect, "{mode:?}");
            assert_eq!(*writes.lock().expect("no panic"), 1, "{mode:?}: sent once");
        }
    }
}

/// A line with an answer time of ten seconds, on which unit 1 falls silent: the moments at which stops reach unit 2.
fn slow_line(mode: Mode) -> (crate::plant::PlantDef, Line, Arc<AtomicBool>, Arc<Mutex<Vec<Instant>>>) {
    let mut def = plant(mode);
    def.lines[0].timeout = Duration::from_secs(10);
    let (silent, stops) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
    let (is_silent, heard) = (silent.clone(), stops.clone());
    let line = line(def.clone());
    line.plug(mode, move |_, message| match message {
        [2, 6, ..] => {
            heard.lock().expect("no panic").push(Instant::now());
            SlaveAction::Answer
        }
        [1, ..] if is_silent.load(Ordering::Relaxed) => SlaveAction::Silent,
        _ => SlaveAction::Answer,
    });
    (def, line, silent, stops)
}

#[tokio::test(start_paused = true)]
async fn a_stop_is_not_held_by_a_poll_that_is_not_answered() {
    for mode in Mode::ALL {
        let (def, mut line, silent, stops) = slow_line(mode);
        line.read(&def).await;
        silent.store(true, Ordering::Relaxed);
        until_silent(&mut line, &def).await;
        let sent_at = Instant::now();
        // Nor by what was asked for before.
        line.requests.send(BusRequest::StopTest).await.expect("the line runs");
        line.requests.send(write(1, FIRST_OF[1], true)).await.expect("the line runs");
        assert_eq!(end_of(&mut line, &def, 1).await, WriteResult::ReadBack(10.0.into()), "{mode:?}");
        let waited = stops.lock().expect("no panic")[0] - sent_at;
        assert!(waited < 600 * MS, "{mode:?}: {waited:?}");
        // What was cut short is read later, and nothing of it lands elsewhere: every value is checked.
        silent.store(false, Ordering::Relaxed);
        let read = |event: &Event| matches!(event, Event::Read { device: DeviceId(0), .. }).then_some(());
        line.until(&def, read).await;
    }
}

/// The write that was cut short is not lost: it ends when its unit can be read, as one without an answer does.
#[tokio::test(start_paused = true)]
async fn a_stop_is_not_held_by_a_write_that_is_not_answered() {
    for mode in Mode::ALL {
        let (def, mut line, silent, stops) = slow_line(mode);
        for _ in 0..12 {
            line.read(&def).await;
        }
        silent.store(true, Ordering::Relaxed);
        line.requests.send(write(1, FIRST_OF[0], false)).await.expect("the line runs");
        until_silent(&mut line, &def).await;
        let sent_at = Instant::now();
        line.requests.send(write(2, FIRST_OF[1], true)).await.expect("the line runs");
        assert_eq!(end_of(&mut line, &def, 2).await, WriteResult::ReadBack(10.0.into()), "{mode:?}");
        let waited = stops.lock().expect("no panic")[0] - sent_at;
        assert!(waited < 600 * MS, "{mode:?}: {waited:?}");
        silent.store(false, Ordering::Relaxed);
        assert_eq!(
            end_of(&mut line, &def, 1).await,
            WriteResult::ReadBackAfterFault(Fault::Timeout, 10.0.into()),
            "{mode:?}"
        );
    }
}

/// The device has started, then stopped: what is read after the stop says nothing about the start.
#[tokio::test(start_paused = true)]
async fn a_start_is_not_compared_with_what_a_stop_has_left() {
    // Over TCP a write without an answer has the connection opened again.
    for mode in [Mode::Rtu, Mode::Ascii] {
        let def = plant(mode);
        let mut line = line(def.clone());
        let mut writes = 0;
        line.plug(mode, move |_, message| {
            writes += usize::from(message[1] == 6);
            match message {
                // The start, and what it is compared with before the stop.
                [1, 6, ..] | [1, 3, 0, 10, 0, 1] if writes == 1 => SlaveAction::Silent,
                _ => SlaveAction::Answer,
            }
        });
        line.read(&def).await;
        line.requests.send(write(1, FIRST_OF[0], false)).await.expect("the line runs");
        let is_lost = |event: &Event| {
            matches!(event, Event::Failed { tags, fault: Fault::Timeout, .. } if *tags == [FIRST_OF[0]]).then_some(())
        };
        line.until(&def, is_lost).await;
        line.requests.send(write(2, FIRST_OF[0], true)).await.expect("the line runs");
        assert_eq!(end_of(&mut line, &def, 1).await, WriteResult::NoValidResponse(Fault::Timeout), "{mode:?}");
        assert_eq!(end_of(&mut line, &def, 2).await, WriteResult::ReadBack(10.0.into()), "{mode:?}");
    }
}
