//! The line task against a scripted slave in memory, in virtual time. Register N holds N, so that a value in a wrong tag
//! shows the address it came from.

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
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    sync::{mpsc, watch},
};

use super::{clock::Clock, task, transport::Connector};
use crate::{
    bus::frame::{self, Mbap},
    plant::{
        PlantDef,
        command::{BusRequest, WriteId},
        def::{DeviceDef, DeviceId, Limits, LineId, TagId, Transport},
        event::{Event, ExceptionCode, Fault, LineState, WriteResult},
        fixture,
        tag::{Kind, Point, Poll, Table, TagDef},
    },
};

const MS: Duration = Duration::from_millis(1);

/// Two units with the same map: holding registers 10–13, 20–23, 400 (alone), once 600.
fn plant(tcp: bool) -> PlantDef {
    let mut def = fixture::plant();
    let sample = def.tags[1].clone();
    let limits = Limits {
        read_words_max: 60,
        read_bits_max: 100,
        write_words_max: 60,
        gap_words_max: 0,
        alignment: 1,
        in_flight_max: 1,
    };
    def.devices =
        (0..2).map(|n| DeviceDef { id: DeviceId(n), unit: n as u8 + 1, limits, ..def.devices[0].clone() }).collect();
    let every = Poll::Every(Duration::from_secs(1));
    let rows: Vec<(u16, Poll)> = [10, 11, 12, 13, 20, 21, 22, 23, 400]
        .into_iter()
        .map(|address| (address, every))
        .chain([(600, Poll::Once)])
        .collect();
    def.tags = (0..2u16)
        .flat_map(|device| rows.iter().map(move |row| (device, *row)))
        .enumerate()
        .map(|(index, (device, (address, poll)))| TagDef {
            id: TagId(index as u16),
            device: DeviceId(device),
            name: format!("U{}.{address}", device + 1),
            point: Point { table: Table::Holding, address, kind: Kind::U16, ..sample.point },
            poll,
            ..sample.clone()
        })
        .collect();
    def.alarms.clear();
    if tcp {
        def.lines[0].transport = Transport::tcp("memory", 502);
    }
    def
}

/// What the slave does with its n-th request.
#[derive(Debug, Clone, PartialEq)]
enum Deed {
    Answer,
    /// Answers after this time; the next request waits for its turn, as behind a gateway.
    Late(Duration),
    Silent,
    /// The answer in two pieces, cut here, the second piece after this time.
    Torn(usize, Duration),
    /// Only the first bytes of the answer.
    Cut(usize),
    BadCheck,
    Noise(Vec<u8>),
    /// These message bytes instead of the answer, with a good check.
    Instead(Vec<u8>),
    Exception(u8),
}

fn correct(message: &[u8]) -> Vec<u8> {
    let word = |index: usize| u16::from_be_bytes([message[index], message[index + 1]]);
    match message[1] {
        3 => {
            let values = (word(2)..word(2) + word(4)).flat_map(u16::to_be_bytes);
            [message[0], 3, 2 * message[5]].into_iter().chain(values).collect()
        }
        _ => message.to_vec(),
    }
}

/// Serves until the stream closes; `script(n, message)` says what to do with the n-th request.
async fn slave(mut stream: DuplexStream, tcp: bool, mut script: impl FnMut(usize, &[u8]) -> Deed) {
    let mut buffer = Vec::new();
    for number in 0.. {
        let (transaction, message) = loop {
            if tcp {
                if let Mbap::Whole { transaction, end } = frame::mbap(&buffer) {
                    let message = buffer[6..end].to_vec();
                    buffer.drain(..end);
                    break (transaction, message);
                }
            } else if 8 <= buffer.len() {
                let rest = buffer.split_off(8);
                let message = frame::without_crc(&buffer).expect("the master sends good frames").to_vec();
                buffer = rest;
                break (0, message);
            }
            let mut chunk = [0; 256];
            match stream.read(&mut chunk).await {
                Ok(0) | Err(_) => return,
                Ok(count) => buffer.extend_from_slice(&chunk[..count]),
            }
        };
        let framed = |message: &[u8]| {
            if tcp { frame::with_mbap(transaction, message) } else { frame::with_crc(message) }
        };
        let answer = framed(&correct(&message));
        let send = match script(number, &message) {
            Deed::Answer => answer,
            Deed::Late(delay) => {
                tokio::time::sleep(delay).await;
                answer
            }
            Deed::Silent => continue,
            Deed::Torn(at, pause) => {
                let at = at.min(answer.len() - 1);
                let _ = stream.write_all(&answer[..at]).await;
                tokio::time::sleep(pause).await;
                answer[at..].to_vec()
            }
            Deed::Cut(at) => answer[..at.min(answer.len() - 1)].to_vec(),
            Deed::BadCheck => {
                let mut spoiled = answer;
                *spoiled.last_mut().expect("never empty") ^= 0xFF;
                spoiled
            }
            Deed::Noise(noise) => noise.into_iter().chain(answer).collect(),
            Deed::Instead(message) => framed(&message),
            Deed::Exception(code) => framed(&[message[0], message[1] | 0x80, code]),
        };
        if stream.write_all(&send).await.is_err() {
            return;
        }
    }
}

/// A running line: its events, its requests, and the way to plug in ports.
struct Line {
    events: mpsc::Receiver<Event>,
    requests: mpsc::Sender<BusRequest>,
    ports: mpsc::Sender<DuplexStream>,
    _stop: watch::Sender<bool>,
}

fn line(def: PlantDef) -> Line {
    let (sender, events) = mpsc::channel(64);
    let (requests, queue) = mpsc::channel(4);
    let (ports, streams) = mpsc::channel(8);
    let (stop, stopped) = watch::channel(false);
    let clock = Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0);
    tokio::spawn(task::run(Arc::new(def), LineId(0), clock, Connector::Memory(streams), sender, queue, stopped));
    Line { events, requests, ports, _stop: stop }
}

impl Line {
    fn plug(
        &self,
        tcp: bool,
        script: impl FnMut(usize, &[u8]) -> Deed + Send + 'static,
    ) -> tokio::task::JoinHandle<()> {
        let (ours, theirs) = tokio::io::duplex(4096);
        self.ports.try_send(ours).expect("room for a port");
        tokio::spawn(slave(theirs, tcp, script))
    }

    /// The next event that is no counter; every value is checked against its address.
    async fn next(&mut self, def: &PlantDef) -> Event {
        loop {
            let event = self.events.recv().await.expect("the line runs");
            if let Event::Read { values, .. } = &event {
                for (tag, raw) in values {
                    assert_eq!(*raw, f64::from(def.tag(*tag).point.address), "a value in a wrong tag: {event:?}");
                }
            }
            if !matches!(event, Event::Report { .. }) {
                return event;
            }
        }
    }

    /// Goes on to the first event of which `pick` makes something.
    async fn until<T>(&mut self, def: &PlantDef, mut pick: impl FnMut(&Event) -> Option<T>) -> T {
        for _ in 0..10_000 {
            let event = self.next(def).await;
            if let Some(found) = pick(&event) {
                return found;
            }
        }
        panic!("it never came")
    }

    async fn fault(&mut self, def: &PlantDef) -> Fault {
        self.until(def, |event| match event {
            Event::Failed { fault, .. } => Some(*fault),
            _ => None,
        })
        .await
    }

    async fn read(&mut self, def: &PlantDef) {
        self.until(def, |event| matches!(event, Event::Read { .. }).then_some(())).await;
    }
}

/// Runs a line against a script until `polls` block reads have ended; gives good and failed ones.
async fn poll(tcp: bool, polls: usize, script: impl FnMut(usize, &[u8]) -> Deed + Send + 'static) -> (usize, usize) {
    let def = plant(tcp);
    let mut line = line(def.clone());
    line.plug(tcp, script);
    let (mut good, mut failed) = (0, 0);
    while good + failed < polls {
        match line.next(&def).await {
            Event::Read { .. } => good += 1,
            Event::Failed { fault, .. } if fault != Fault::Resting => failed += 1,
            Event::Line { state: LineState::Waiting { .. }, .. } => {
                // A TCP stream out of step is closed; the gateway takes the next connection.
                line.plug(tcp, |_, _| Deed::Answer);
            }
            _ => {}
        }
    }
    (good, failed)
}

#[tokio::test(start_paused = true)]
async fn a_late_reply_never_lands_in_another_tag() {
    for tcp in [false, true] {
        for late_ms in [310, 500, 700, 1_000, 2_900, 9_000] {
            let script = move |number, _: &[u8]| if number == 2 { Deed::Late(late_ms * MS) } else { Deed::Answer };
            let (good, failed) = poll(tcp, 60, script).await;
            assert!(40 <= good && failed <= 14, "tcp {tcp}, late by {late_ms} ms: {good} good, {failed} failed");
        }
    }
}

/// The gateway that answers everything in its order, 40 ms each, one answer 700 ms late: back in step within one poll.
#[tokio::test(start_paused = true)]
async fn an_in_order_gateway_is_in_step_again_within_one_poll() {
    for tcp in [false, true] {
        let script = |number, _: &[u8]| Deed::Late(if number == 3 { 700 * MS } else { 40 * MS });
        let (good, failed) = poll(tcp, 100, script).await;
        assert!(failed <= 2, "tcp {tcp}: {good} good, {failed} failed");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn no_mixture_of_faults_puts_a_value_into_a_wrong_tag(
        tcp in any::<bool>(),
        deeds in proptest::collection::vec((0u8..14, 0u64..4_000, 0usize..14), 400),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build()
            .expect("a runtime");
        let script = move |number: usize, message: &[u8]| {
            let (deed, ms, at) = deeds[number % deeds.len()];
            match deed {
                0 => Deed::Late(Duration::from_millis(ms)),
                1 => Deed::Silent,
                2 => Deed::Torn(at, Duration::from_millis(ms / 100)),
                3 if !tcp => Deed::Cut(at),
                4 if !tcp => Deed::BadCheck,
                5 if !tcp => Deed::Noise(vec![0xFF, message[0], 0x55, message[1]]),
                6 => Deed::Exception(6),
                7 => Deed::Instead(vec![message[0] ^ 0x40, 3, 8, 0, 1, 0, 2, 0, 3, 0, 4]),
                _ => Deed::Answer,
            }
        };
        let (good, _) = runtime.block_on(poll(tcp, 500, script));
        prop_assert!(0 < good);
    }
}

#[tokio::test(start_paused = true)]
async fn an_answer_in_two_pieces_is_one_answer() {
    for tcp in [false, true] {
        for cut in 1..14 {
            let (_, failed) = poll(tcp, 20, move |_, _| Deed::Torn(cut, 30 * MS)).await;
            assert_eq!(failed, 0, "tcp {tcp}, cut after {cut} bytes");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn each_spoiled_answer_is_told_by_its_name() {
    // Twice, so that the one retry of a spoiled read does not hide it; the probe between the two answers well.
    let twice =
        |deed: Deed| move |number, _: &[u8]| if number == 0 || number == 2 { deed.clone() } else { Deed::Answer };
    let crc = Fault::Crc { got: 0, computed: 0 };
    for (deed, expect) in [
        (Deed::BadCheck, crc),
        (Deed::Cut(6), Fault::Truncated { got: 6, expected: 13 }),
        (Deed::Silent, Fault::Timeout),
        (Deed::Instead(vec![9, 3, 2, 0, 1]), Fault::WrongUnit { got: 9, asked: 1 }),
        (Deed::Instead(vec![1, 4, 8, 0, 1, 0, 2, 0, 3, 0, 4]), Fault::WrongFunction { got: 4, asked: 3 }),
        (Deed::Instead(vec![1, 3, 2, 0, 1]), Fault::WrongLength { got: 5, asked: 11 }),
        (Deed::Exception(4), Fault::Exception(ExceptionCode(4))),
    ] {
        let def = plant(false);
        let mut line = line(def.clone());
        line.plug(false, twice(deed.clone()));
        let fault = line.fault(&def).await;
        let same = matches!((fault, expect), (Fault::Crc { .. }, Fault::Crc { .. })) || fault == expect;
        assert!(same, "{deed:?}: {fault}, expected {expect}");
        line.read(&def).await;
    }
}

#[tokio::test(start_paused = true)]
async fn noise_before_an_answer_and_one_spoiled_answer_are_overcome() {
    let (_, failed) = poll(false, 40, |_, _| Deed::Noise(vec![0xFF, 0x00, 0x55])).await;
    assert_eq!(failed, 0);
    let (_, failed) = poll(false, 40, |number, _| if number % 7 == 0 { Deed::BadCheck } else { Deed::Answer }).await;
    assert!(failed <= 2, "a spoiled read is asked for once more: {failed} failed");
}

#[tokio::test(start_paused = true)]
async fn one_dead_unit_leaves_the_others_their_rate() {
    let def = plant(false);
    let mut line = line(def.clone());
    line.plug(false, |_, message| if message[0] == 1 { Deed::Silent } else { Deed::Answer });
    let (mut reads, mut told_down) = (BTreeMap::new(), 0);
    let mut end = Timestamp::UNIX_EPOCH;
    while end < Timestamp::from_second(120).expect("a small number") {
        match line.next(&def).await {
            Event::Read { at, device, .. } => {
                *reads.entry(device).or_insert(0) += 1;
                end = at;
            }
            Event::Failed { fault: Fault::Resting, device, tags, .. } => {
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

#[tokio::test(start_paused = true)]
async fn a_hole_in_a_block_costs_only_itself() {
    let def = plant(false);
    let mut line = line(def.clone());
    line.plug(false, |_, message| {
        let (first, count) = (u16::from_be_bytes([message[2], message[3]]), u16::from(message[5]));
        if (first..first + count).contains(&21) { Deed::Exception(2) } else { Deed::Answer }
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
    let mut def = plant(false);
    def.devices.truncate(1);
    def.tags.retain(|tag| tag.device == DeviceId(0) && tag.point.address == 400);
    def.tags[0].id = TagId(0);
    let mut line = line(def.clone());
    line.plug(false, |number, message| if number == 3 || message[1] == 8 { Deed::Silent } else { Deed::Answer });
    for _ in 0..3 {
        line.read(&def).await;
    }
    assert_eq!(line.fault(&def).await, Fault::Timeout);
    line.read(&def).await;
}

/// A device that never stops talking: it is told as a failure, and the line still obeys.
#[tokio::test(start_paused = true)]
async fn a_chattering_line_is_told_and_can_be_closed() {
    let def = plant(false);
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
    let def = plant(false);
    let mut line = line(def.clone());
    line.plug(false, |number, _| match number {
        2 => Deed::Silent,
        3 | 4 => Deed::Exception(2),
        _ => Deed::Answer,
    });
    let mut whole = 0;
    for _ in 0..200 {
        if let Event::Read { values, .. } = line.next(&def).await {
            whole += usize::from(values.len() == 4);
        }
    }
    assert!(60 < whole, "blocks of four are read as blocks of four: {whole}");
}

#[tokio::test(start_paused = true)]
async fn a_port_that_goes_away_comes_back_by_itself() {
    let def = plant(false);
    let mut line = line(def.clone());
    for _ in 0..3 {
        let served = line.plug(false, |_, _| Deed::Answer);
        line.read(&def).await;
        served.abort();
        let waiting =
            |event: &Event| matches!(event, Event::Line { state: LineState::Waiting { .. }, .. }).then_some(());
        line.until(&def, waiting).await;
    }
    line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Disconnected, .. }).then_some(())).await;
    line.plug(false, |_, _| Deed::Answer);
    line.requests.send(BusRequest::Connect(true)).await.expect("the line runs");
    line.read(&def).await;
}

/// Writes register 10 := 10 (so that the read-back fits the address rule) and gives result and number of writes on the wire.
async fn write(deed: Deed, read_back: Deed) -> (WriteResult, usize) {
    let def = plant(false);
    let mut line = line(def.clone());
    let writes = Arc::new(AtomicUsize::new(0));
    let count = writes.clone();
    line.plug(false, move |_, message| {
        if message[1] == 6 {
            count.fetch_add(1, Ordering::Relaxed);
            return deed.clone();
        }
        if message[2..6] == [0, 10, 0, 1] { read_back.clone() } else { Deed::Answer }
    });
    line.read(&def).await;
    let request = BusRequest::Write { id: WriteId(7), tag: TagId(0), raw: 10.0, unlock: None, verify: true };
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
    for (deed, read_back, expect) in [
        (Deed::Answer, Deed::Answer, WriteResult::ReadBack(10.0)),
        (Deed::Exception(3), Deed::Answer, WriteResult::Refused(ExceptionCode(3))),
        (Deed::Silent, Deed::Answer, WriteResult::Lost(Fault::Timeout)),
        (Deed::Answer, Deed::Silent, WriteResult::NotRead(Fault::Timeout)),
        (Deed::Instead(vec![1, 6, 0, 10, 0, 11]), Deed::Answer, WriteResult::Lost(Fault::WrongEcho)),
    ] {
        assert_eq!(write(deed.clone(), read_back).await, (expect, 1), "{deed:?}");
    }
}
