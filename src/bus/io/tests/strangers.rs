//! Frames that this line has not asked for: due to a process that was killed, sent to another master, or sent twice.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

use super::slave::{Line, MS, Mode, SlaveAction, correct, line, plant};
use crate::{
    bus::frame,
    plant::{PlantDef, event::Event, fault::Fault},
};

/// Modes without transaction ids.
const MODES: [Mode; 3] = [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp];

/// The answer to the block at 20, which looks like one to the block at 10.
fn outstanding(mode: Mode) -> Vec<u8> {
    frame::wrap(mode.framing(), 0, &[1, 3, 8, 0, 20, 0, 21, 0, 22, 0, 23])
}

/// Reads this many blocks; every value is checked against its address. Gives good and failed ones.
async fn read(line: &mut Line, def: &PlantDef, polls: usize) -> (usize, usize) {
    let (mut good, mut failed) = (0, 0);
    while good + failed < polls {
        match line.next(def).await {
            Event::Read { .. } => good += 1,
            Event::Failed { .. } => failed += 1,
            _ => {}
        }
    }
    (good, failed)
}

#[tokio::test(start_paused = true)]
async fn an_answer_owed_to_a_process_that_was_killed_is_no_value() {
    for mode in MODES {
        let def = plant(mode);
        let mut line = line(def.clone());
        // It needs 250 ms for each request, and answers in their order: the first two are those of the dead process.
        line.plug(mode, move |number, _| match number {
            0 => SlaveAction::Noise([outstanding(mode), outstanding(mode)].concat()),
            _ => SlaveAction::Late(250 * MS),
        });
        let (good, failed) = read(&mut line, &def, 60).await;
        assert!(50 <= good, "{mode:?}: {good} good, {failed} failed");
    }
}

/// The same where the dead process had begun as this one does: what is outstanding answers the very first request.
#[tokio::test(start_paused = true)]
async fn an_outstanding_first_reply_does_not_shift_the_others() {
    for mode in MODES {
        let def = plant(mode);
        let mut line = line(def.clone());
        // The slave is one answer behind from the first request on.
        let mut behind: Option<Vec<u8>> = None;
        line.plug(mode, move |number, message| {
            let answer = correct(message);
            match behind.replace(answer.clone()) {
                Some(before) if number < 40 => SlaveAction::Instead(before),
                Some(before) if number == 40 => SlaveAction::Noise(frame::wrap(mode.framing(), 0, &before)),
                Some(_) => SlaveAction::Answer,
                None => SlaveAction::Answer,
            }
        });
        let (good, _) = read(&mut line, &def, 120).await;
        assert!(20 <= good, "{mode:?}: {good} good");
    }
}

/// Answers each request after `reply`, and sends each answer again `after` that, whatever was asked meanwhile.
async fn repeating_slave(stream: DuplexStream, mode: Mode, reply: Duration, after: Duration) {
    let (mut requests, mut answers) = tokio::io::split(stream);
    let (sender, mut due) = tokio::sync::mpsc::unbounded_channel::<(tokio::time::Instant, Vec<u8>)>();
    tokio::spawn(async move {
        let mut waiting: Vec<(tokio::time::Instant, Vec<u8>)> = Vec::new();
        loop {
            waiting.sort_by_key(|(at, _)| *at);
            let first = waiting.first().map(|(at, _)| *at);
            tokio::select! {
                more = due.recv() => match more {
                    Some(more) => waiting.push(more),
                    None => return,
                },
                () = tokio::time::sleep_until(first.unwrap_or_else(tokio::time::Instant::now)), if first.is_some() => {
                    let (_, frame) = waiting.remove(0);
                    if answers.write_all(&frame).await.is_err() {
                        return;
                    }
                }
            }
        }
    });
    let mut buffer = Vec::new();
    loop {
        while let Some(end) = mode.end(&buffer) {
            let request: Vec<u8> = buffer.drain(..end).collect();
            let message = frame::unwrap(mode.framing(), &request).expect("the master sends good frames");
            let answer = frame::wrap(mode.framing(), 0, &correct(&message));
            let at = tokio::time::Instant::now() + reply;
            let _ = sender.send((at, answer.clone()));
            let _ = sender.send((at + after, answer));
        }
        let mut chunk = [0; 256];
        match requests.read(&mut chunk).await {
            Ok(0) | Err(_) => return,
            Ok(count) => buffer.extend_from_slice(&chunk[..count]),
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_device_that_sends_each_answer_twice_puts_no_wrong_value() {
    for mode in MODES {
        for (reply, after) in [(5, 25), (20, 25), (30, 25), (40, 25), (60, 25), (30, 3), (10, 90), (10, 250)] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let (ours, theirs) = tokio::io::duplex(4096);
            line.ports.try_send(ours).expect("room for a port");
            tokio::spawn(repeating_slave(theirs, mode, reply * MS, after * MS));
            let (good, failed) = read(&mut line, &def, 1_500).await;
            assert!(0 < good, "{mode:?}, {reply} ms, again after {after} ms: {good} good, {failed} failed");
        }
    }
}

/// One frame too many: what was read of that unit is doubted, and read again as soon as the unit has proved itself.
#[tokio::test(start_paused = true)]
async fn an_unasked_frame_puts_the_values_of_its_unit_in_doubt() {
    for mode in MODES {
        let def = plant(mode);
        let mut line = line(def.clone());
        let mut sent = 0;
        line.plug(mode, move |_, message| {
            sent += usize::from(message[0] == 2);
            if sent == 6 && message[0] == 2 { SlaveAction::Noise(outstanding(mode)) } else { SlaveAction::Answer }
        });
        let mut doubted = None;
        let mut good = 0;
        for _ in 0..1_000 {
            if doubted.is_some() && 10 <= good {
                break;
            }
            match line.next(&def).await {
                Event::Failed { device, tags, fault: Fault::OutOfSync, .. } => {
                    doubted = Some((device.0, tags.len()));
                    good = 0;
                }
                Event::Read { .. } => good += 1,
                _ => {}
            }
        }
        assert_eq!(doubted, Some((0, 10)), "{mode:?}");
    }
}
