//! The line task against a scripted slave in memory, in virtual time. Register N holds N, so that a value in a wrong tag
//! shows the address it came from.

mod slave;
mod slow;
mod stops;
mod strangers;
mod together;
mod diagnostics;

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use jiff::Timestamp;
use proptest::prelude::*;
use tokio::io::AsyncWriteExt;

use self::slave::{MS, Mode, SlaveAction, line, plant};
use crate::bus::frame;
use crate::plant::{
    command::{BusRequest, WriteId, WriteJob},
    def::{DeviceId, LineDef, TagId},
    event::{Event, ExceptionCode, Fault, LineState, WriteResult},
    request_stats::RequestStats,
    tag::{Access, TagDef},
};

/// Runs a line against a script until `polls` block reads have ended; gives good and failed ones.
async fn poll(
    mode: Mode,
    polls: usize,
    script: impl FnMut(usize, &[u8]) -> SlaveAction + Send + 'static,
) -> (usize, usize) {
    let def = plant(mode);
    let mut line = line(def.clone());
    line.plug(mode, script);
    let (mut good, mut failed) = (0, 0);
    while good + failed < polls {
        match line.next(&def).await {
            Event::Read { .. } => good += 1,
            Event::Failed { fault, .. } if fault != Fault::BackedOff => failed += 1,
            Event::Line { state: LineState::Waiting { .. }, .. } => {
                // A TCP stream out of sync is closed; the gateway takes the next connection.
                line.plug(mode, |_, _| SlaveAction::Answer);
            }
            _ => {}
        }
    }
    (good, failed)
}

#[tokio::test(start_paused = true)]
async fn a_late_reply_never_lands_in_another_tag() {
    for mode in Mode::ALL {
        for late_ms in [310, 500, 700, 1_000, 2_900, 9_000] {
            let script =
                move |number, _: &[u8]| if number == 2 { SlaveAction::Late(late_ms * MS) } else { SlaveAction::Answer };
            let (good, failed) = poll(mode, 60, script).await;
            assert!(40 <= good && failed <= 14, "{mode:?}, late by {late_ms} ms: {good} good, {failed} failed");
        }
    }
}

/// The gateway that answers everything in its order, 40 ms each, one answer 700 ms late: back in sync within one poll.
#[tokio::test(start_paused = true)]
async fn an_in_order_gateway_is_in_sync_again_within_one_poll() {
    for mode in Mode::ALL {
        let script = |number, _: &[u8]| SlaveAction::Late(if number == 3 { 700 * MS } else { 40 * MS });
        let (good, failed) = poll(mode, 100, script).await;
        // What is under way behind the late answer is late with it: that is one flight of eight blocks.
        let at_once = if mode == Mode::Tcp16 { 8 } else { 2 };
        assert!(failed <= at_once, "{mode:?}: {good} good, {failed} failed");
    }
}

/// The answer may itself be a piece of something else: it is refused with what stands behind it.
#[tokio::test(start_paused = true)]
async fn an_answer_before_bytes_that_are_no_header_is_refused() {
    for mode in [Mode::Tcp, Mode::Tcp16] {
        let def = plant(mode);
        let mut line = line(def.clone());
        line.plug(mode, |_, _| SlaveAction::Trailing(vec![0xFF, 0xFF, 0xFF, 0xFF, 0x00, 0x55]));
        let read = |event: &Event| match event {
            Event::Read { .. } => Some(true),
            Event::Line { state: LineState::Waiting { .. }, .. } => Some(false),
            _ => None,
        };
        assert!(!line.until(&def, read).await, "{mode:?}: a value of a stream that is out of sync");
    }
}

// A million polls in all.
proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]
    #[test]
    fn no_mixture_of_faults_puts_a_value_into_a_wrong_tag(
        mode in prop::sample::select(Mode::ALL.to_vec()),
        actions in proptest::collection::vec((0u8..14, 0u64..4_000, 0usize..14), 400),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build()
            .expect("a runtime");
        let script = move |number: usize, message: &[u8]| {
            let (action, ms, at) = actions[number % actions.len()];
            match action {
                0 => SlaveAction::Late(Duration::from_millis(ms)),
                1 => SlaveAction::Silent,
                2 => SlaveAction::Torn(at, Duration::from_millis(ms / 100)),
                3 if !mode.has_ids() => SlaveAction::Cut(at),
                4 if !mode.has_ids() => SlaveAction::BadCheck,
                5 if !mode.has_ids() => SlaveAction::Noise(vec![0xFF, message[0], 0x55, message[1]]),
                6 => SlaveAction::Exception(6),
                7 => SlaveAction::Instead(vec![message[0] ^ 0x40, 3, 8, 0, 1, 0, 2, 0, 3, 0, 4]),
                _ => SlaveAction::Answer,
            }
        };
        let (good, _) = runtime.block_on(poll(mode, 500, script));
        prop_assert!(0 < good);
    }
}

#[tokio::test(start_paused = true)]
async fn an_answer_in_two_pieces_is_one_answer() {
    for mode in Mode::ALL {
        for cut in 1..14 {
            let (_, failed) = poll(mode, 20, move |_, _| SlaveAction::Torn(cut, 30 * MS)).await;
            assert_eq!(failed, 0, "{mode:?}, cut after {cut} bytes");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn each_corrupt_answer_is_told_by_its_name() {
    // Twice, so that the one retry of a corrupt read does not hide it; the probes before each of the two answer well.
    let twice = |action: SlaveAction| {
        move |number, _: &[u8]| if number == 1 || number == 3 { action.clone() } else { SlaveAction::Answer }
    };
    let crc = Fault::Crc { got: 0, computed: 0 };
    for (action, expect) in [
        (SlaveAction::BadCheck, crc),
        (SlaveAction::Cut(6), Fault::Truncated { got: 6, expected: 13 }),
        (SlaveAction::Silent, Fault::Timeout),
        (SlaveAction::Instead(vec![9, 3, 2, 0, 1]), Fault::WrongUnit { got: 9, asked: 1 }),
        (SlaveAction::Instead(vec![1, 4, 8, 0, 1, 0, 2, 0, 3, 0, 4]), Fault::WrongFunction { got: 4, asked: 3 }),
        (SlaveAction::Instead(vec![1, 3, 2, 0, 1]), Fault::WrongLength { got: 5, asked: 11 }),
        (SlaveAction::Exception(4), Fault::Exception(ExceptionCode(4))),
    ] {
        let def = plant(Mode::Rtu);
        let mut line = line(def.clone());
        line.plug(Mode::Rtu, twice(action.clone()));
        let fault = line.fault(&def).await;
        let same = matches!((fault, expect), (Fault::Crc { .. }, Fault::Crc { .. })) || fault == expect;
        assert!(same, "{action:?}: {fault}, expected {expect}");
        line.read(&def).await;
    }
}

#[tokio::test(start_paused = true)]
async fn noise_before_an_answer_and_one_corrupt_answer_are_overcome() {
    let (_, failed) = poll(Mode::Rtu, 40, |_, _| SlaveAction::Noise(vec![0xFF, 0x00, 0x55])).await;
    assert_eq!(failed, 0);
    let (_, failed) =
        poll(Mode::Rtu, 40, |number, _| if number % 7 == 0 { SlaveAction::BadCheck } else { SlaveAction::Answer })
            .await;
    assert!(failed <= 2, "a corrupt read is asked for once more: {failed} failed");
}

#[tokio::test(start_paused = true)]
async fn one_dead_unit_leaves_the_others_their_rate() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| if message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer });
    let (mut reads, mut told_down) = (BTreeMap::new(), 0);
    let mut end = Timestamp::UNIX_EPOCH;
    while end < Timestamp::from_second(120).expect("a small number") {
        match line.next(&def).await {
            Event::Read { at, device, .. } => {
                *reads.entry(device).or_insert(0) += 1;
                end = at;
            }
            Event::Failed { fault: Fault::BackedOff, device, tags, .. } => {
                assert_eq!((device, tags.len()), (DeviceId(0), 10), "all its tags at once");
                told_down += 1;
            }
            _ => {}
        }
    }
    assert_eq!(told_down, 1);
    // Three blocks a second for two minutes, and one block once.
    let rate = f64::from(reads[&DeviceId(1)]) / 361.0;
    assert!(0.9 <= rate, "the living unit keeps {rate} of its rate");
    assert!(!reads.contains_key(&DeviceId(0)));
}

/// A unit that was silent for minutes is repaired: with the retry of an operator it is read at once.
#[tokio::test(start_paused = true)]
async fn a_repaired_unit_is_read_as_soon_as_an_operator_retries() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let repaired = Arc::new(AtomicUsize::new(0));
    let is_repaired = repaired.clone();
    line.plug(Mode::Rtu, move |_, message| match (message[0], is_repaired.load(Ordering::Relaxed)) {
        (1, 0) => SlaveAction::Silent,
        _ => SlaveAction::Answer,
    });
    let of_other = |event: &Event, after: Timestamp| match event {
        Event::Read { at, device: DeviceId(1), .. } if after < *at => Some(*at),
        _ => None,
    };
    let minutes = Timestamp::from_second(300).expect("a small number");
    let now = line.until(&def, |event| of_other(event, minutes)).await;
    repaired.store(1, Ordering::Relaxed);
    line.requests.send(BusRequest::Refresh { device: DeviceId(0), command: None }).await.expect("the line runs");
    let read = |event: &Event| match event {
        Event::Read { at, device: DeviceId(0), .. } => Some(*at),
        _ => None,
    };
    let waited = line.until(&def, read).await.duration_since(now).as_secs_f64();
    assert!(waited < 1.5, "{waited} s");
}

/// A unit that has always answered at once and falls silent does not hold the line for the whole timeout of 300 ms.
#[tokio::test(start_paused = true)]
async fn a_fast_unit_that_dies_is_not_waited_for_long() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(
        Mode::Rtu,
        |number, message| if 200 < number && message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer },
    );
    let waited = |event: &Event| match event {
        Event::Failed { at, fault: Fault::Timeout, exchange: Some(exchange), .. } => {
            Some(at.duration_since(exchange.at))
        }
        _ => None,
    };
    let waited = Duration::try_from(line.until(&def, waited).await).expect("not negative");
    assert!((100 * MS..150 * MS).contains(&waited), "{waited:?}");
}

/// A unit that becomes slow has the whole timeout again as soon as one of its answers has come late.
#[tokio::test(start_paused = true)]
async fn a_fast_unit_that_becomes_slow_is_waited_for() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        let slow = |number, _: &[u8]| if 200 < number { SlaveAction::Late(220 * MS) } else { SlaveAction::Answer };
        let (good, failed) = poll(mode, 400, slow).await;
        // Behind this slave requests wait for their turn, so that one late answer makes others late.
        assert!(failed <= 6, "{mode:?}: {good} good, {failed} failed");
    }
}

#[tokio::test(start_paused = true)]
async fn a_hole_in_a_block_costs_only_itself() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| {
        let (first, count) = (u16::from_be_bytes([message[2], message[3]]), u16::from(message[5]));
        if (first..first + count).contains(&21) { SlaveAction::Exception(2) } else { SlaveAction::Answer }
    });
    let (mut good, mut holes) = (std::collections::BTreeSet::new(), std::collections::BTreeSet::new());
    for _ in 0..100 {
        match line.next(&def).await {
            Event::Read { values, .. } => good.extend(values.iter().map(|(tag, _)| def.tag(*tag).name.clone())),
            Event::Failed { tags, fault, .. } if tags.len() == 1 => {
                assert_eq!(fault, Fault::Exception(ExceptionCode(2)));
                holes.insert(def.tag(tags[0]).name.clone());
            }
            _ => {}
        }
    }
    assert_eq!(good.len(), 18, "all other points are good: {good:?}");
    assert_eq!(holes.into_iter().collect::<Vec<_>>(), ["U1.21", "U2.21"]);
}

/// A device with a single register that ignores loopbacks: nothing tells its answers apart, so only patience helps – and
/// it does help.
#[tokio::test(start_paused = true)]
async fn a_device_that_nothing_brings_into_step_is_read_again_after_a_rest() {
    let mut def = plant(Mode::Rtu);
    def.devices.truncate(1);
    def.tags.retain(|tag| tag.device == DeviceId(0) && tag.point.address == 400);
    def.tags[0].id = TagId(0);
    let mut line = line(def.clone());
    line.plug(
        Mode::Rtu,
        |number, message| if number == 4 || message[1] == 8 { SlaveAction::Silent } else { SlaveAction::Answer },
    );
    for _ in 0..3 {
        line.read(&def).await;
    }
    assert_eq!(line.fault(&def).await, Fault::Timeout);
    line.read(&def).await;
}

/// A device that never stops talking: it is told as a failure, and the line still obeys.
#[tokio::test(start_paused = true)]
async fn a_chattering_line_is_told_and_can_be_closed() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let (ours, mut theirs) = tokio::io::duplex(4096);
    line.ports.try_send(ours).expect("room for a port");
    tokio::spawn(async move {
        while theirs.write_all(&[0x55, 0xAA]).await.is_ok() {
            tokio::time::sleep(2 * MS).await;
        }
    });
    let fault = line.fault(&def).await;
    assert!(fault.is_corrupt(), "noise is told as noise, not as silence: {fault}");
    line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Disconnected, .. }).then_some(())).await;
}

/// A late refusal, code 02, is no hole: the block stays whole.
#[tokio::test(start_paused = true)]
async fn a_late_refusal_splits_no_block() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let mut of_first = 0;
    line.plug(Mode::Rtu, move |_, message| {
        of_first += usize::from(message[0] == 1);
        match of_first {
            2 if message[0] == 1 => SlaveAction::Silent,
            3 | 4 if message[0] == 1 => SlaveAction::Exception(2),
            _ => SlaveAction::Answer,
        }
    });
    let mut whole = 0;
    for _ in 0..200 {
        if let Event::Read { values, .. } = line.next(&def).await {
            whole += usize::from(values.len() == 4);
        }
    }
    assert!(120 < whole, "blocks of four are read as blocks of four: {whole}");
}

#[tokio::test(start_paused = true)]
async fn a_port_that_goes_away_comes_back_by_itself() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    for _ in 0..100 {
        let served = line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
        line.read(&def).await;
        served.abort();
        let waiting =
            |event: &Event| matches!(event, Event::Line { state: LineState::Waiting { .. }, .. }).then_some(());
        line.until(&def, waiting).await;
    }
    line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Disconnected, .. }).then_some(())).await;
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    line.requests.send(BusRequest::Connect(true)).await.expect("the line runs");
    line.read(&def).await;
}

/// Writes register 10 := 10 (so that the read-back fits the address rule) and gives result and number of writes on the wire.
async fn write(action: SlaveAction, read_back: SlaveAction) -> (WriteResult, usize) {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let writes = Arc::new(AtomicUsize::new(0));
    let count = writes.clone();
    line.plug(Mode::Rtu, move |_, message| {
        if message[1] == 6 {
            count.fetch_add(1, Ordering::Relaxed);
            return action.clone();
        }
        if message[2..6] == [0, 10, 0, 1] { read_back.clone() } else { SlaveAction::Answer }
    });
    line.read(&def).await;
    let request = BusRequest::Write(WriteJob {
        id: WriteId(7),
        tag: TagId(0),
        raw: 10.0,
        unlock: None,
        verify: true,
        urgent: false,
    });
    line.requests.send(request).await.expect("the line runs");
    let result = line
        .until(&def, |event| match event {
            Event::Wrote { id: WriteId(7), result, .. } => Some(result.clone()),
            _ => None,
        })
        .await;
    for _ in 0..20 {
        line.next(&def).await;
    }
    (result, writes.load(Ordering::Relaxed))
}

#[tokio::test(start_paused = true)]
async fn a_write_is_sent_once_whatever_happens() {
    for (action, read_back, expect) in [
        (SlaveAction::Answer, SlaveAction::Answer, WriteResult::ReadBack(10.0)),
        (SlaveAction::Exception(3), SlaveAction::Answer, WriteResult::Refused(ExceptionCode(3))),
        (SlaveAction::Silent, SlaveAction::Answer, WriteResult::Held(10.0)),
        (SlaveAction::Silent, SlaveAction::Silent, WriteResult::Lost(Fault::Timeout)),
        (SlaveAction::Answer, SlaveAction::Silent, WriteResult::NotRead(Fault::Timeout)),
        (SlaveAction::Instead(vec![1, 6, 0, 10, 0, 11]), SlaveAction::Answer, WriteResult::Held(10.0)),
    ] {
        assert_eq!(write(action.clone(), read_back).await, (expect, 1), "{action:?}");
    }
}

/// A broadcast is sent once, nobody waits for an answer, and it is told as accepted, not as verified.
#[tokio::test(start_paused = true)]
async fn a_broadcast_is_sent_once_and_never_called_verified() {
    for mode in [Mode::Rtu, Mode::Ascii] {
        let mut def = plant(mode);
        def.devices[0].unit = 0;
        def.tags.retain(|tag| tag.device == DeviceId(1));
        let everybody = TagDef { device: DeviceId(0), access: Access::Write, ..def.tags[0].clone() };
        def.tags.insert(0, everybody);
        for (index, tag) in def.tags.iter_mut().enumerate() {
            tag.id = TagId(index as u16);
        }
        let mut line = line(def.clone());
        let heard = Arc::new(AtomicUsize::new(0));
        let count = heard.clone();
        line.plug(mode, move |_, message| {
            if message[0] != 0 {
                return SlaveAction::Answer;
            }
            count.fetch_add(1, Ordering::Relaxed);
            SlaveAction::Silent
        });
        line.read(&def).await;
        let request = BusRequest::Write(WriteJob {
            id: WriteId(1),
            tag: TagId(0),
            raw: 7.0,
            unlock: None,
            verify: false,
            urgent: false,
        });
        line.requests.send(request).await.expect("the line runs");
        let result = line
            .until(&def, |event| match event {
                Event::Wrote { result, .. } => Some(result.clone()),
                _ => None,
            })
            .await;
        assert_eq!((result, heard.load(Ordering::Relaxed)), (WriteResult::Accepted, 1), "{mode:?}");
        line.read(&def).await;
    }
}

/// An answer that comes after the port was opened anew – with a longer timeout, as a technician would – is still late.
#[tokio::test(start_paused = true)]
async fn a_late_reply_is_known_after_other_settings_too() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let mut gone = false;
    line.plug(Mode::Rtu, move |_, message| {
        gone |= message[..4] == [1, 3, 0, 20];
        if gone && message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer }
    });
    assert_eq!(line.fault(&def).await, Fault::Timeout);
    // The answer to the block at 20 comes when the block at 10, of the same shape, would be asked.
    let late = vec![1, 3, 8, 0, 20, 0, 21, 0, 22, 0, 23];
    line.plug(Mode::Rtu, move |number, message| {
        if number == 0 && message[..2] == [1, 3] { SlaveAction::Instead(late.clone()) } else { SlaveAction::Answer }
    });
    let settings = LineDef { timeout: 500 * MS, ..def.lines[0].clone() };
    line.requests.send(BusRequest::Configure(Box::new(settings))).await.expect("the line runs");
    // Every value that comes is checked against its address.
    for _ in 0..20 {
        line.read(&def).await;
    }
}

/// The refusal of a write that was given up must not be taken for the refusal of the next: that one may take effect.
#[tokio::test(start_paused = true)]
async fn a_late_refusal_is_not_the_answer_to_the_next_write() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let mut writes = 0;
    line.plug(Mode::Rtu, move |_, message| {
        writes += usize::from(message[1] == 6);
        match (message[1], writes) {
            (6, 1) | (8, _) => SlaveAction::Silent,
            (6, _) => SlaveAction::Exception(3),
            _ => SlaveAction::Answer,
        }
    });
    line.read(&def).await;
    for (id, tag) in [(1, 0), (2, 1)] {
        let request = BusRequest::Write(WriteJob {
            id: WriteId(id),
            tag: TagId(tag),
            raw: 10.0,
            unlock: None,
            verify: true,
            urgent: false,
        });
        line.requests.send(request).await.expect("the line runs");
    }
    for (id, expect) in
        // Read once the unit is in sync: what the device holds, not what an answer to another write says.
        [(1, WriteResult::Held(10.0)), (2, WriteResult::Held(11.0))]
    {
        let result = line
            .until(&def, |event| match event {
                Event::Wrote { id: done, result, .. } if *done == WriteId(id) => Some(result.clone()),
                _ => None,
            })
            .await;
        assert_eq!(result, expect);
    }
}

/// An adapter that gives back what it sends: its echo is neither an answer nor noise.
#[tokio::test(start_paused = true)]
async fn the_echo_of_an_adapter_is_no_answer() {
    let (_, failed) = poll(Mode::Rtu, 60, |_, message| SlaveAction::Noise(frame::with_crc(message))).await;
    assert_eq!(failed, 0);
    // Nothing but the echo, as on a line without a device.
    let (good, _) = poll(Mode::Rtu, 60, |_, message| match message {
        [2, ..] => SlaveAction::Answer,
        _ => SlaveAction::Instead(message.to_vec()),
    })
    .await;
    assert!(0 < good, "the other unit is read");
}

/// What a retry has cured, and what came late, is counted for its device all the same.
#[tokio::test(start_paused = true)]
async fn cured_and_late_answers_are_counted_with_their_device() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |number, _| match number % 20 {
        3 => SlaveAction::BadCheck,
        11 => SlaveAction::Late(700 * MS),
        _ => SlaveAction::Answer,
    });
    for _ in 0..10_000 {
        let event = line.events.recv().await.expect("the line runs");
        let Event::Report { report, .. } = event else { continue };
        let sum = |of: fn(&RequestStats) -> u64| report.devices.iter().map(|(_, stats)| of(stats)).sum::<u64>();
        if 0 < sum(|stats| stats.check) && 0 < sum(|stats| stats.retries) && 0 < sum(|stats| stats.late) {
            assert_eq!(sum(|stats| stats.late), report.counters.late);
            return;
        }
    }
    panic!("never counted")
}

/// Writes that got no answer have used up their share of a full line. A stop goes all the same, and what was requested before
/// it and still waits does not undo it.
#[tokio::test(start_paused = true)]
async fn a_stop_waits_for_nothing_but_the_transaction_under_way() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let heard = Arc::new(std::sync::Mutex::new(Vec::new()));
    let list = heard.clone();
    line.plug(Mode::Rtu, move |_, message| {
        list.lock().expect("no panic").push(message[..6].to_vec());
        let lost = message[1] == 6 && message[3] < 20;
        if lost { SlaveAction::Silent } else { SlaveAction::Late(200 * MS) }
    });
    line.read(&def).await;
    let write = |id, tag, raw, urgent| {
        BusRequest::Write(WriteJob { id: WriteId(id), tag: TagId(tag), raw, unlock: None, verify: true, urgent })
    };
    for tag in 0..4u16 {
        line.requests.send(write(u64::from(tag), tag, 1.0, false)).await.expect("the line runs");
    }
    line.until(&def, |event| matches!(event, Event::Wrote { id: WriteId(3), .. }).then_some(())).await;
    line.requests.send(write(4, 4, 1.0, false)).await.expect("the line runs");
    line.requests.send(write(5, 4, 0.0, true)).await.expect("the line runs");
    let before = heard.lock().expect("no panic").len();
    let mut results = Vec::new();
    while results.len() < 2 {
        let ended = |event: &Event| match event {
            Event::Wrote { id, result, .. } => Some((id.0, result.clone())),
            _ => None,
        };
        results.push(line.until(&def, ended).await);
    }
    assert_eq!(results, [(4, WriteResult::Overtaken), (5, WriteResult::ReadBack(20.0))]);
    let heard = heard.lock().expect("no panic").clone();
    let stop = heard.iter().position(|message| *message == [1, 6, 0, 20, 0, 0]).expect("sent");
    assert!(stop <= before + 1, "{} requests went before the stop: {:?}", stop - before, &heard[before..]);
    assert!(!heard.contains(&vec![1, 6, 0, 20, 0, 1]), "the start is not sent after the stop");
}

/// A key that was turned stays turned though the value is refused: that is told, and the key is read again.
#[tokio::test(start_paused = true)]
async fn a_key_is_told_and_read_again_though_the_value_is_refused() {
    let def = plant(Mode::Rtu);
    let (value, key) = (TagId(1), TagId(9));
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| match message {
        [1, 6, 0, 11, ..] => SlaveAction::Exception(3),
        _ => SlaveAction::Answer,
    });
    // The key is read once at the start and then only when somebody asks for it.
    let holds = |event: &Event| match event {
        Event::Read { values, .. } => values.iter().any(|(tag, _)| *tag == key).then_some(()),
        _ => None,
    };
    line.until(&def, holds).await;
    let (id, unlock) = (WriteId(1), Some((key, 1.0)));
    let request = BusRequest::Write(WriteJob { id, tag: value, raw: 7.0, unlock, verify: true, urgent: false });
    line.requests.send(request).await.expect("the line runs");
    let told = |event: &Event| match event {
        Event::Unlocked { key, result, .. } => Some((Some(*key), result.clone())),
        Event::Wrote { result, .. } => Some((None, result.clone())),
        _ => None,
    };
    assert_eq!(line.until(&def, told).await, (Some(key), WriteResult::Accepted));
    assert_eq!(line.until(&def, told).await, (None, WriteResult::Refused(ExceptionCode(3))));
    line.until(&def, holds).await;
}

/// A try that was not even sent, because the unit is out of sync, is not made again at once and for ever.
#[tokio::test(start_paused = true)]
async fn a_silent_unit_that_is_out_of_sync_is_read_again() {
    let script = |number, _: &[u8]| match number {
        0 | 2 => SlaveAction::Silent,
        1 => SlaveAction::Late(1_681 * MS),
        4 => SlaveAction::Late(332 * MS),
        5 => SlaveAction::Torn(0, Duration::ZERO),
        _ => SlaveAction::Answer,
    };
    let (good, failed) = poll(Mode::Ascii, 60, script).await;
    assert!(failed < good, "{good} good, {failed} failed");
}
