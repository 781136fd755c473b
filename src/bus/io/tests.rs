//! The line task against a scripted slave in memory, in virtual time. Register N holds N, so that a value in a wrong tag
//! shows the address it came from.

mod connecting;
mod identifying;
mod listening;
mod live;
mod oddities;
mod recalled;
mod redefined;
mod reports;
mod silent;
pub mod slave;
mod slow;
mod stops;
mod strangers;
mod together;
mod unpolled;
mod texts;
mod wide;
mod worst_case;
mod diagnostics;
mod writes;

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
    event::{Event, WriteResult},
    fault::{ExceptionCode, Fault},
    line_state::LineState,
    request_stats::RequestStats,
    tag::{Access, DataType, Poll, Table, TagDef},
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
            assert!(40 <= good && failed <= 16, "{mode:?}, late by {late_ms} ms: {good} good, {failed} failed");
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

/// What the slave does with a message, of numbers drawn at random.
fn drawn(mode: Mode, (action, ms, at): (u8, u64, usize), message: &[u8]) -> SlaveAction {
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
        let script = move |number: usize, message: &[u8]| drawn(mode, actions[number % actions.len()], message);
        let (good, _) = runtime.block_on(poll(mode, 500, script));
        prop_assert!(0 < good);
    }
}

/// A mixture that did: the slave stands still for 7.8 s, a loopback to unit 2 is lost, and the delay after it was taken for a
/// proof that this unit owes nothing.
#[tokio::test(start_paused = true)]
async fn a_delay_proves_nothing_while_the_line_stands_still() {
    #[rustfmt::skip]
    let before = [
        (5, 0), (1, 0), (0, 649), (1, 0), (3, 1), (7, 0), (8, 0), (3, 1), (2, 0), (1, 0), (8, 0), (3, 2), (3, 2), (3, 1),
        (1, 0), (2, 0), (3, 1), (1, 0), (3, 2), (8, 0), (1, 0), (8, 0), (1, 0), (8, 0), (8, 0), (6, 0), (8, 0), (8, 0),
        (1, 0), (5, 0), (2, 1300), (0, 3263), (0, 0), (2, 800), (1, 0), (2, 0), (3, 1), (2, 0), (2, 0), (2, 0), (3, 2),
        (2, 0), (2, 0), (4, 0), (2, 0), (2, 0), (1, 0), (3, 2), (3, 2), (4, 0), (0, 0), (1, 0), (7, 0), (5, 0), (2, 0),
        (2, 0), (2, 0), (2, 0), (5, 0), (5, 0), (0, 3121), (0, 1216), (1, 0), (0, 3457),
    ];
    let script = move |number: usize, message: &[u8]| {
        let (action, number) = before.get(number).copied().unwrap_or((8, 0));
        // What a number means: how late an answer is, or where it is cut.
        let at = if action == 3 { number as usize } else { 0 };
        drawn(Mode::Rtu, (action, number, at), message)
    };
    let (good, failed) = poll(Mode::Rtu, 300, script).await;
    assert!(250 < good, "{good} good, {failed} failed");
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
async fn each_corrupt_answer_is_reported_by_its_name() {
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
        (SlaveAction::Instead(vec![1, 3, 2, 0, 1]), Fault::WrongLength { got: 2, asked: 8 }),
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

/// A device with a single register that ignores loopbacks: nothing tells its answers apart, so only time helps – and
/// it does help.
#[tokio::test(start_paused = true)]
async fn a_device_that_stays_out_of_step_is_read_again_after_a_rest() {
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

/// A device that never stops sending is reported as a failure, and the line still serves commands.
#[tokio::test(start_paused = true)]
async fn a_chattering_line_is_reported_and_can_be_closed() {
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
    assert!(fault.is_corrupt(), "noise is reported as noise, not as a timeout: {fault}");
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

/// An answer that comes after the port was opened again – with a longer timeout, as a technician would – is still late.
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
    // The answer to the block at 20 comes when the block at 10, of the same signature, would be asked.
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
