//! Live reads beside the polls of a line, in every mode.

use jiff::{SignedDuration, Timestamp};
use tokio::sync::oneshot;

use super::slave::{Line, MS, Mode, SlaveAction, line, plant};
use crate::{
    bus::io::live_reads::LiveRequest,
    plant::{
        def::LineId,
        event::Event,
        fault::Fault,
        live::{AddressSpan, LiveRead, LiveReading},
        tag::Table,
    },
};

fn read(address: u16, count: u16) -> LiveRead {
    let spans = vec![AddressSpan { table: Table::Holding, address, count }];
    LiveRead { line: LineId(0), unit: 1, spans, not_before: None, relearn: false }
}

async fn ask(line: &mut Line, read: LiveRead) -> LiveReading {
    let (reply, mut answer) = oneshot::channel();
    line.live.send(LiveRequest { read, reply }).await.expect("the line runs");
    loop {
        // The line waits where its events are not taken.
        tokio::select! {
            reading = &mut answer => return reading.expect("the line answers"),
            event = line.events.recv() => drop(event.expect("the line runs")),
        }
    }
}

fn words(reading: &LiveReading) -> Vec<u16> {
    reading.parts.iter().flat_map(|part| part.words.clone().unwrap_or_default()).collect()
}

#[tokio::test(start_paused = true)]
async fn registers_are_read_beside_the_polls_in_every_mode() {
    for mode in Mode::ALL {
        let mut line = line(plant(mode));
        line.plug(mode, |_, _| SlaveAction::Answer);
        let reading = ask(&mut line, read(1_000, 20)).await;
        assert_eq!(words(&reading), (1_000..1_020).collect::<Vec<_>>(), "{mode:?}");
        assert_eq!(reading.requests, 1, "{mode:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_read_waits_until_it_is_due_and_meanwhile_the_polls_go_on() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    let due = Timestamp::UNIX_EPOCH + SignedDuration::from_secs(30);
    let (reply, mut answer) = oneshot::channel();
    let read = LiveRead { not_before: Some(due), ..read(5, 2) };
    line.live.send(LiveRequest { read, reply }).await.expect("the line runs");
    let mut polled = 0;
    let reading = loop {
        tokio::select! {
            reading = &mut answer => break reading.expect("the line answers"),
            event = line.events.recv() => polled += u32::from(matches!(event, Some(Event::Read { .. }))),
        }
    };
    let at = reading.parts[0].at;
    assert!(due <= at && at < due + SignedDuration::from_secs(1), "{at}");
    assert!(150 <= polled, "two units with three blocks a second each: {polled}");
}

#[tokio::test(start_paused = true)]
async fn corrupt_answers_are_asked_again_and_silence_is_a_timeout() {
    for mode in Mode::ALL {
        let mut line = line(plant(mode));
        let mut corrupted = false;
        line.plug(mode, move |_, message| match message {
            [1, 3, 3, 0xE8, ..] if !mode.has_ids() && !corrupted => {
                corrupted = true;
                SlaveAction::BadCheck
            }
            [1, 3, 7, 0xD0, ..] => SlaveAction::Silent,
            _ => SlaveAction::Answer,
        });
        assert_eq!(words(&ask(&mut line, read(1_000, 2)).await), [1_000, 1_001], "{mode:?}");
        let silent = ask(&mut line, read(2_000, 2)).await;
        assert_eq!(silent.parts[0].words, Err(Fault::Timeout), "{mode:?}");
        let after = ask(&mut line, read(3_000, 3)).await;
        assert_eq!(words(&after), [3_000, 3_001, 3_002], "{mode:?}: no late answer counts");
    }
}

#[tokio::test(start_paused = true)]
async fn a_late_answer_is_never_taken_for_a_later_read() {
    let mut line = line(plant(Mode::Rtu));
    let mut first = true;
    line.plug(Mode::Rtu, move |_, message| match message {
        [1, 3, 3, 0xE8, ..] if std::mem::take(&mut first) => SlaveAction::Late(800 * MS),
        _ => SlaveAction::Answer,
    });
    let late = ask(&mut line, read(1_000, 2)).await;
    assert_eq!(late.parts[0].words, Err(Fault::Timeout));
    for address in [4_000, 4_100, 4_200] {
        let reading = ask(&mut line, read(address, 2)).await;
        let good = words(&reading);
        assert!(good.is_empty() || good == [address, address + 1], "{reading:?}");
    }
    assert_eq!(words(&ask(&mut line, read(4_300, 2)).await), [4_300, 4_301], "in sync again");
}

#[tokio::test(start_paused = true)]
async fn reads_of_a_silent_unit_leave_the_polls_their_time() {
    for mode in Mode::ALL {
        let mut line = line(plant(mode));
        line.plug(mode, |_, message| if message[0] == 77 { SlaveAction::Silent } else { SlaveAction::Answer });
        let end = tokio::time::Instant::now() + 60_000 * MS;
        let mut polled = 0;
        while tokio::time::Instant::now() < end {
            let (reply, mut answer) = oneshot::channel();
            let read = LiveRead { unit: 77, ..read(0, 10) };
            line.live.send(LiveRequest { read, reply }).await.expect("the line runs");
            loop {
                tokio::select! {
                    _ = &mut answer => break,
                    event = line.events.recv() => polled += u32::from(matches!(event, Some(Event::Read { .. }))),
                }
            }
        }
        // Two units with three blocks a second each: 360.
        assert!(300 <= polled, "{mode:?}: {polled}");
    }
}
