//! A scripted slave in memory, for every mode, and a line task that polls it. Register N holds N.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    sync::{mpsc, watch},
    time::Instant,
};

use crate::{
    bus::{
        frame::{self, Mbap},
        io::{
            clock::Clock,
            listening,
            live_reads::{LiveReads, LiveRequest},
            redefine::Redefine,
            requests::Requests,
            task,
            transport::Connector,
        },
    },
    plant::{
        PlantDef,
        command::{BusRequest, WriteId, WriteJob},
        def::{DeviceDef, DeviceId, Framing, Limits, LineId, Protocol, Rs485, Serial, TagId, Transport},
        event::{Event, WriteResult},
        fault::Fault,
        fixture,
        line_finding::DeviceFinding,
        tag::{DataType, Point, Poll, Table, TagDef},
        tag_value::TagValue,
    },
};

/// How line and slave speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Rtu,
    Ascii,
    RtuOverTcp,
    AsciiOverTcp,
    Tcp,
    /// With sixteen requests under way.
    Tcp16,
    Udp,
    RtuOverUdp,
}

impl Mode {
    pub const ALL: [Mode; 5] = [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp, Mode::Tcp, Mode::Tcp16];

    pub fn framing(self) -> Framing {
        self.transport().framing()
    }

    /// Answers carry the transaction of their request.
    pub fn has_ids(self) -> bool {
        self.framing() == Framing::Mbap
    }

    fn transport(self) -> Transport {
        let serial = |framing, data_bits| Transport::Serial {
            port: "memory".into(),
            serial: Serial { data_bits, ..Serial::USUAL },
            framing,
            rs485: Rs485::Off,
        };
        let network = |protocol, framing| Transport::Network { protocol, host: "memory".into(), port: 502, framing };
        match self {
            Mode::Rtu => serial(Framing::Rtu, 8),
            Mode::Ascii => serial(Framing::Ascii, 7),
            Mode::RtuOverTcp => network(Protocol::Tcp, Framing::Rtu),
            Mode::AsciiOverTcp => network(Protocol::Tcp, Framing::Ascii),
            Mode::Tcp | Mode::Tcp16 => network(Protocol::Tcp, Framing::Mbap),
            Mode::Udp => network(Protocol::Udp, Framing::Mbap),
            Mode::RtuOverUdp => network(Protocol::Udp, Framing::Rtu),
        }
    }

    /// Where the request at the beginning of the buffer ends, once it is whole. In RTU, but for writes of several and
    /// identifications, it has eight bytes.
    pub fn end(self, buffer: &[u8]) -> Option<usize> {
        match self.framing() {
            Framing::Rtu => {
                let end = match buffer.get(1) {
                    Some(15 | 16) => 9 + usize::from(*buffer.get(6)?),
                    Some(0x2B) => 7,
                    _ => 8,
                };
                (end <= buffer.len()).then_some(end)
            }
            Framing::Ascii => buffer.iter().position(|char| *char == b'\n').map(|last| last + 1),
            Framing::Mbap => match frame::mbap(buffer) {
                Mbap::Whole { end, .. } => Some(end),
                Mbap::Incomplete | Mbap::Broken => None,
            },
        }
    }
}

pub const MS: Duration = Duration::from_millis(1);

/// Two units with the same map: holding registers 10–13, 20–23, 400 (alone), once 600.
pub fn plant(mode: Mode) -> PlantDef {
    let mut def = fixture::plant();
    let sample = def.tags[1].clone();
    let limits = Limits {
        read_registers_max: 60,
        read_bits_max: 100,
        write_registers_max: 60,
        gap_registers_max: 0,
        in_flight_max: if mode == Mode::Tcp16 { 16 } else { 1 },
        ..Limits::STANDARD
    };
    let first = def.devices[0].clone();
    let device = |id, unit| DeviceDef { id, name: format!("U{unit}"), unit, limits, ..first.clone() };
    def.devices = (0..2).map(|n| device(DeviceId(n), n as u8 + 1)).collect();
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
            point: Point { table: Table::Holding, address, kind: DataType::U16, ..sample.point },
            poll,
            ..sample.clone()
        })
        .collect();
    def.alarms.clear();
    def.lines[0].transport = mode.transport();
    def
}

/// What the slave does with its n-th request.
#[derive(Debug, Clone, PartialEq)]
pub enum SlaveAction {
    Answer,
    /// Answers after this time; the next request waits for its turn, as behind a gateway.
    Late(Duration),
    /// Answers after this time; the next requests are answered meanwhile.
    Meanwhile(Duration),
    Silent,
    /// Closes the connection in place of an answer.
    HangUp,
    /// These bytes, as they are.
    Bytes(Vec<u8>),
    /// The answer in two pieces, cut here, the second piece after this time.
    Torn(usize, Duration),
    /// Only the first bytes of the answer.
    Cut(usize),
    BadCheck,
    Noise(Vec<u8>),
    /// These bytes behind the answer.
    Trailing(Vec<u8>),
    /// These message bytes instead of the answer, with a good check.
    Instead(Vec<u8>),
    Exception(u8),
}

pub fn correct(message: &[u8]) -> Vec<u8> {
    let word = |index: usize| u16::from_be_bytes([message[index], message[index + 1]]);
    match message[1] {
        3 => {
            let values = (word(2)..word(2) + word(4)).flat_map(u16::to_be_bytes);
            [message[0], 3, 2 * message[5]].into_iter().chain(values).collect()
        }
        // Of several registers or coils the answer tells where and how many.
        15 | 16 => message[..6].to_vec(),
        0x2B => super::identifying::identification(message[0], "2.10"),
        _ => message.to_vec(),
    }
}

/// Serves until the stream closes; `script(n, message)` says what to do with the n-th request.
async fn slave(mut stream: DuplexStream, mode: Mode, mut script: impl FnMut(usize, &[u8]) -> SlaveAction) {
    let mut buffer = Vec::new();
    let mut slow: Vec<(Instant, Vec<u8>)> = Vec::new();
    for number in 0.. {
        let (transaction, message) = loop {
            if let Some(end) = mode.end(&buffer) {
                let frame: Vec<u8> = buffer.drain(..end).collect();
                let transaction = u16::from_be_bytes([frame[0], frame[1]]);
                let message = frame::unwrap(mode.framing(), &frame).expect("the master sends good frames");
                break (transaction, message);
            }
            slow.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
            let due = slow.last().map(|(at, _)| *at);
            let mut chunk = [0; 256];
            let read = tokio::select! {
                read = stream.read(&mut chunk) => read,
                () = tokio::time::sleep_until(due.unwrap_or_else(Instant::now)), if due.is_some() => {
                    if let Some((_, answer)) = slow.pop() {
                        let _ = stream.write_all(&answer).await;
                    }
                    continue;
                }
            };
            match read {
                Ok(0) | Err(_) => return,
                Ok(count) => buffer.extend_from_slice(&chunk[..count]),
            }
        };
        let framed = |message: &[u8]| frame::wrap(mode.framing(), transaction, message);
        let answer = framed(&correct(&message));
        let send = match script(number, &message) {
            SlaveAction::Answer => answer,
            SlaveAction::Late(delay) => {
                tokio::time::sleep(delay).await;
                answer
            }
            SlaveAction::Meanwhile(delay) => {
                slow.push((Instant::now() + delay, answer));
                continue;
            }
            SlaveAction::Silent => continue,
            SlaveAction::HangUp => return,
            SlaveAction::Bytes(bytes) => bytes,
            SlaveAction::Torn(at, pause) => {
                let at = at.min(answer.len() - 1);
                let _ = stream.write_all(&answer[..at]).await;
                tokio::time::sleep(pause).await;
                answer[at..].to_vec()
            }
            SlaveAction::Cut(at) => answer[..at.min(answer.len() - 1)].to_vec(),
            SlaveAction::BadCheck => {
                let mut corrupt = answer;
                let check = corrupt.len() - if mode == Mode::Ascii { 4 } else { 1 };
                corrupt[check] ^= if mode == Mode::Ascii { 1 } else { 0xFF };
                corrupt
            }
            SlaveAction::Noise(noise) => noise.into_iter().chain(answer).collect(),
            SlaveAction::Trailing(bytes) => answer.into_iter().chain(bytes).collect(),
            SlaveAction::Instead(message) => framed(&message),
            SlaveAction::Exception(code) => framed(&[message[0], message[1] | 0x80, code]),
        };
        if stream.write_all(&send).await.is_err() {
            return;
        }
    }
}

/// A running line: its events, its requests, and the way to plug in ports.
pub struct Line {
    pub events: mpsc::Receiver<Event>,
    pub requests: mpsc::Sender<BusRequest>,
    pub live: mpsc::Sender<LiveRequest>,
    pub ports: mpsc::Sender<DuplexStream>,
    /// When its plant time began.
    pub since: Instant,
    pub task: tokio::task::JoinHandle<()>,
    pub stop: watch::Sender<bool>,
    pub redefines: mpsc::Sender<Redefine>,
}

pub fn line(def: PlantDef) -> Line {
    let (ports, streams) = mpsc::channel(1_024);
    line_on(def, ports, Connector::Memory(streams))
}

/// A line of whose devices something was found before the start.
pub fn line_with(def: PlantDef, found: Vec<(DeviceId, DeviceFinding)>) -> Line {
    let (ports, streams) = mpsc::channel(1_024);
    start(def, ports, Connector::Memory(streams), found)
}

/// A line whose port is opened by this connector, which takes the `ports` if it is one in memory.
pub fn line_on(def: PlantDef, ports: mpsc::Sender<DuplexStream>, connector: Connector) -> Line {
    start(def, ports, connector, Vec::new())
}

fn start(
    def: PlantDef,
    ports: mpsc::Sender<DuplexStream>,
    mut connector: Connector,
    found: Vec<(DeviceId, DeviceFinding)>,
) -> Line {
    let (sender, events) = mpsc::channel(64);
    let (requests, queue) = mpsc::channel(4);
    let (live, live_queue) = mpsc::channel(4);
    let (stop, stopped) = watch::channel(false);
    let (redefines, redefine_queue) = mpsc::channel(1);
    let clock = Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0);
    let task = tokio::spawn(async move {
        let mut requests = Requests::new(queue).redefined_by(redefine_queue);
        let mut live = LiveReads::new(live_queue);
        let def = Arc::new(def);
        match def.lines[0].listens {
            false => {
                let (requests, live) = (&mut requests, &mut live);
                task::run(def, LineId(0), clock, &mut connector, sender, requests, live, stopped, &found).await;
            }
            true => {
                listening::run(def, LineId(0), clock, &mut connector, sender, &mut requests, &mut live, stopped).await
            }
        }
    });
    Line { events, requests, live, ports, since: Instant::now(), task, stop, redefines }
}

impl Line {
    /// Ends it as a kill of its process does: at once, whatever is under way.
    pub fn kill(self) {
        self.task.abort();
    }

    pub fn plug(
        &self,
        mode: Mode,
        script: impl FnMut(usize, &[u8]) -> SlaveAction + Send + 'static,
    ) -> tokio::task::JoinHandle<()> {
        let (ours, theirs) = tokio::io::duplex(4096);
        self.ports.try_send(ours).expect("room for a port");
        tokio::spawn(slave(theirs, mode, script))
    }

    /// The next event that is no counter; every value is checked against its address.
    pub async fn next(&mut self, def: &PlantDef) -> Event {
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

    /// Writes a raw number or a text to the first tag, and gives the result.
    pub async fn write(&mut self, def: &PlantDef, raw: impl Into<TagValue>, verify: bool) -> WriteResult {
        self.write_over(def, raw, verify, None).await
    }

    /// The same over what its author saw, which was read long ago.
    pub async fn write_over(
        &mut self,
        def: &PlantDef,
        raw: impl Into<TagValue>,
        verify: bool,
        over: Option<TagValue>,
    ) -> WriteResult {
        let (id, tag) = (WriteId(7), TagId(0));
        let job = WriteJob { id, tag, raw: raw.into(), unlock: None, verify, urgent: false, over, unscaled_by: None };
        self.requests.send(BusRequest::Write(job)).await.expect("the line runs");
        let wrote = |event: &Event| match event {
            Event::Wrote { id: WriteId(7), result, .. } => Some(result.clone()),
            _ => None,
        };
        self.until(def, wrote).await
    }

    /// Goes on to the first event of which `pick` makes something.
    pub async fn until<T>(&mut self, def: &PlantDef, mut pick: impl FnMut(&Event) -> Option<T>) -> T {
        for _ in 0..10_000 {
            let event = self.next(def).await;
            if let Some(found) = pick(&event) {
                return found;
            }
        }
        panic!("it never came")
    }

    pub async fn fault(&mut self, def: &PlantDef) -> Fault {
        self.until(def, |event| match event {
            Event::Failed { fault, .. } => Some(*fault),
            _ => None,
        })
        .await
    }

    pub async fn read(&mut self, def: &PlantDef) {
        self.until(def, |event| matches!(event, Event::Read { .. }).then_some(())).await;
    }
}

/// Goes on until nothing has come of the first unit for three seconds: the line waits for its answer.
pub async fn until_silent(line: &mut Line, def: &PlantDef) {
    let mut last = Instant::now();
    while let Ok(event) = tokio::time::timeout_at(last + Duration::from_secs(3), line.next(def)).await {
        if matches!(event, Event::Read { device: DeviceId(0), .. } | Event::Failed { device: DeviceId(0), .. }) {
            last = Instant::now();
        }
    }
}
