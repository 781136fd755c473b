//! The task of one line: opens the port, keeps the schedule, carries writes, and tells the plant what came of it.

use std::{borrow::Cow, collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::sync::{mpsc, watch};
use tokio_modbus::{Request, Response};

use super::{
    clock::Clock,
    link::{Link, Trouble},
    transport::{Connector, Stream},
};
use crate::{
    bus::{
        backoff::Backoff,
        codec,
        plan::{self, Block, Holes, Hunt},
        schedule::{Next, Schedule},
    },
    plant::{
        PlantDef,
        command::{BusRequest, WriteId},
        def::{ActionDef, DeviceId, LineDef, LineId, TagId, Transport},
        event::{Event, ExceptionCode, Fault, LineCounters, LineState, WriteResult},
        scale,
        tag::{Table, TagDef},
    },
};

/// Counters are told once in this plant time.
const COUNTERS_EVERY: Duration = Duration::from_secs(1);
/// Utilisation is the mean over so many of these.
const UTILISATION_OVER: usize = 10;

/// Runs a line until `stop` turns true or nobody can send requests any more.
pub async fn run(
    def: Arc<PlantDef>,
    line: LineId,
    clock: Clock,
    connector: Connector,
    events: mpsc::Sender<Event>,
    requests: mpsc::Receiver<BusRequest>,
    stop: watch::Receiver<bool>,
) {
    let blocks = plan::blocks(&def, line, &Holes::default());
    let task = Task {
        clock,
        connector,
        events,
        requests,
        stop,
        blocks,
        holes: Holes::default(),
        hunt: Hunt::default(),
        counters: LineCounters::default(),
        busy: VecDeque::new(),
        line,
        def,
    };
    // The only way out is the end of the station; there is nobody left to tell.
    let _ = task.outer().await;
}

/// The station is ending.
struct Ended;

/// Why a port is left.
enum Leave {
    Closed,
    Lost(String),
}

struct Task {
    def: Arc<PlantDef>,
    line: LineId,
    clock: Clock,
    connector: Connector,
    events: mpsc::Sender<Event>,
    requests: mpsc::Receiver<BusRequest>,
    stop: watch::Receiver<bool>,
    /// The read plan; a block that is refused is split while the search goes on.
    blocks: Vec<Block>,
    /// What the devices do not have, as far as found.
    holes: Holes,
    hunt: Hunt,
    counters: LineCounters,
    /// Busy share of the last seconds, newest last.
    busy: VecDeque<f32>,
}

impl Task {
    /// Opens, serves, waits, for ever.
    async fn outer(mut self) -> Result<(), Ended> {
        let mut backoff = Backoff::for_ports();
        loop {
            self.tell_state(LineState::Connecting).await?;
            let why = match self.connector.open().await {
                Ok(port) => {
                    self.counters.opens += 1;
                    self.tell_state(LineState::Connected).await?;
                    tracing::info!(line = self.line_def().name, "connected");
                    let answers = self.counters.ok;
                    let leave = self.serve(port).await?;
                    // A port that opens and dies at once must not be tried in a hurry.
                    if answers < self.counters.ok {
                        backoff.reset();
                    }
                    match leave {
                        Leave::Closed => None,
                        Leave::Lost(why) => Some(why),
                    }
                }
                Err(why) => Some(why),
            };
            match why {
                None => {
                    self.tell_state(LineState::Disconnected).await?;
                    self.wait(None).await?;
                }
                Some(why) => {
                    tracing::warn!(line = self.line_def().name, why, "not connected");
                    let retry_at = self.clock.now() + backoff.fail();
                    self.tell_state(LineState::Waiting { why, retry_at }).await?;
                    self.wait(Some(retry_at)).await?;
                }
            }
        }
    }

    /// Waits without a port until a moment, or until an operator opens the line; refuses writes meanwhile.
    async fn wait(&mut self, mut until: Option<Timestamp>) -> Result<(), Ended> {
        loop {
            let clock = self.clock;
            let pause = async {
                match until {
                    Some(until) => clock.sleep_until(until).await,
                    None => std::future::pending().await,
                }
            };
            let request = tokio::select! {
                _ = self.stop.wait_for(|stop| *stop) => return Err(Ended),
                () = pause => return Ok(()),
                request = self.requests.recv() => request.ok_or(Ended)?,
            };
            match request {
                BusRequest::Write { id, .. } => self.tell_wrote(id, WriteResult::NotSent(Fault::NotConnected)).await?,
                BusRequest::Refresh(_) => {}
                BusRequest::Connect(true) => return Ok(()),
                BusRequest::Connect(false) => {
                    until = None;
                    self.tell_state(LineState::Disconnected).await?;
                }
            }
        }
    }

    /// Serves an open port: operators first, then the schedule, else listens.
    async fn serve(&mut self, port: Box<dyn Stream>) -> Result<Leave, Ended> {
        let mut link = Link::new(port, self.line_def(), self.clock, self.counters);
        let mut schedule = Schedule::new(&self.blocks, self.clock.now());
        let mut count_at = self.clock.now() + COUNTERS_EVERY;
        let leave = loop {
            if *self.stop.borrow() {
                break Err(Ended);
            }
            let now = self.clock.now();
            if count_at <= now {
                count_at = now + COUNTERS_EVERY;
                self.tell_counters(&mut link, &schedule).await?;
            }
            let request = match self.requests.try_recv() {
                Ok(request) => Some(request),
                Err(mpsc::error::TryRecvError::Disconnected) => break Err(Ended),
                Err(mpsc::error::TryRecvError::Empty) => None,
            };
            let result = match (request, schedule.next(now)) {
                (Some(request), _) => self.serve_request(&mut link, &mut schedule, request).await?,
                (None, Next::Run(index)) => self.poll(&mut link, &mut schedule, index).await?,
                (None, Next::WaitUntil(at)) => self.listen(&mut link, &mut schedule, at.min(count_at)).await?,
                (None, Next::Idle) => self.listen(&mut link, &mut schedule, count_at).await?,
            };
            if let Err(leave) = result {
                break Ok(leave);
            }
        };
        self.counters = link.counters;
        leave
    }

    /// Nothing is due: drops what comes unasked until something is.
    async fn listen(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        until: Timestamp,
    ) -> Result<Result<(), Leave>, Ended> {
        let request = tokio::select! {
            _ = self.stop.wait_for(|stop| *stop) => return Err(Ended),
            request = self.requests.recv() => request.ok_or(Ended)?,
            why = link.idle() => return Ok(Err(Leave::Lost(why))),
            () = self.clock.sleep_until(until) => return Ok(Ok(())),
        };
        self.serve_request(link, schedule, request).await
    }

    async fn serve_request(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        request: BusRequest,
    ) -> Result<Result<(), Leave>, Ended> {
        match request {
            BusRequest::Connect(true) => Ok(Ok(())),
            BusRequest::Connect(false) => Ok(Err(Leave::Closed)),
            BusRequest::Refresh(device) => {
                schedule.refresh(device, self.clock.now());
                Ok(Ok(()))
            }
            BusRequest::Write { id, tag, raw, unlock, verify } => {
                let def = self.def.clone();
                let (tag, unlock) = (def.tag(tag), unlock.map(|(tag, raw)| (def.tag(tag), raw)));
                let result = self.write(link, schedule, tag, raw, unlock, verify).await;
                let result = match result {
                    Ok(result) => result,
                    Err(why) => {
                        // The port went away under the write: it may or may not have arrived.
                        self.tell_wrote(id, WriteResult::Lost(Fault::NotConnected)).await?;
                        return Ok(Err(Leave::Lost(why)));
                    }
                };
                let tcp = matches!(self.line_def().transport, Transport::Tcp { .. });
                let unanswered = tcp && matches!(result, WriteResult::Lost(Fault::Timeout));
                match result {
                    WriteResult::ReadBack(raw) => {
                        let (device, values) = (tag.device, vec![(tag.id, raw)]);
                        self.tell(Event::Read { at: self.clock.now(), device, values, reply: link.reply }).await?;
                    }
                    // What the device holds now is not known until it is read again.
                    WriteResult::NotRead(_) | WriteResult::Accepted | WriteResult::Lost(_) => {
                        schedule.refresh(tag.device, self.clock.now());
                    }
                    WriteResult::Refused(_) | WriteResult::NotSent(_) => {}
                }
                self.tell_wrote(id, result).await?;
                if unanswered {
                    // The system would go on sending it for minutes; a closed connection takes it back.
                    return Ok(Err(Leave::Lost("a write was not answered".into())));
                }
                Ok(Ok(()))
            }
        }
    }

    /// Reads one block and tells what came.
    async fn poll(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: usize,
    ) -> Result<Result<(), Leave>, Ended> {
        let block = self.blocks[index].clone();
        let started = self.clock.now();
        let outcome = match self.in_step(link, &block).await {
            Ok(()) => self.read_twice(link, &block).await,
            Err(trouble) => Err(trouble),
        };
        let at = self.clock.now();
        schedule.done(index, started, at);
        link.rest(self.def.device(block.device).gap);
        match outcome {
            Ok(values) => {
                schedule.answered(block.device, at);
                let decoded = self.decode(&block, &values);
                self.tell_values(at, &block, decoded, link.reply).await?;
                self.hunt.answered(&block);
                let disproved = self.holes.disproved(&block);
                self.replan(schedule, at, disproved);
            }
            Err(Trouble::Gone(why)) => return Ok(Err(Leave::Lost(why))),
            Err(Trouble::Fault(fault @ Fault::Exception(code))) if !code.is_of_gateway() => {
                schedule.answered(block.device, at);
                schedule.again(index, at);
                self.tell_failed(at, block.device, block.tags.clone(), fault).await?;
                let its_own = link.debt(block.unit).is_clear();
                let hole = code == ExceptionCode(0x02) && its_own;
                if hole && let Some(parts) = self.hunt.refused(&self.def, &self.holes, &block) {
                    tracing::debug!(address = block.address, count = block.count, "exception 02: the block is split");
                    self.blocks.splice(index..=index, parts);
                    if !self.replan(schedule, at, false) {
                        schedule.replan(&self.blocks, at);
                    }
                } else {
                    schedule.excused(index, code, at);
                }
            }
            Err(Trouble::Fault(fault)) => {
                schedule.again(index, at);
                self.tell_failed(at, block.device, block.tags.clone(), fault).await?;
                if schedule.failed(block.device, at) {
                    let tags = self.def.tags_of(block.device).map(|tag| tag.id).collect();
                    self.tell_failed(at, block.device, tags, Fault::Resting).await?;
                    self.holes.forget(block.device);
                    self.replan(schedule, at, true);
                }
            }
        }
        Ok(Ok(()))
    }

    /// Makes sure that the answer to a block cannot be mistaken for one that the unit still owes: by a read of another
    /// shape if there is one, else by a loopback, else by patience.
    async fn in_step(&self, link: &mut Link, block: &Block) -> Result<(), Trouble> {
        if !link.is_ambiguous(&block.request()) {
            return Ok(());
        }
        let own = std::iter::once(block);
        let others = self.blocks.iter().filter(|other| other.device == block.device && *other != block);
        if let Some(probe) = link.debt(block.unit).probe(own.chain(others)) {
            match link.exchange(&probe).await {
                // The device does not read parts of a block, or this answers an older request: neither proves anything.
                Err(Trouble::Fault(Fault::Exception(_))) => {}
                other => return other.map(drop),
            }
        }
        match link.loopback(block.unit).await {
            Err(Trouble::Fault(_)) if link.forget_debt(block.unit).is_none() => Ok(()),
            other => other,
        }
    }

    /// Reads a block; a spoiled answer is asked for once more. It counts as owed, so the unit is brought into step first.
    async fn read_twice(&self, link: &mut Link, block: &Block) -> Result<Answer, Trouble> {
        match read(link, block).await {
            Err(Trouble::Fault(fault)) if fault.is_corrupt() => {
                self.in_step(link, block).await?;
                read(link, block).await
            }
            other => other,
        }
    }

    /// Writes once, reads back. `Err` when the port is gone.
    async fn write(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        tag: &TagDef,
        raw: f64,
        unlock: Option<(&TagDef, f64)>,
        verify: bool,
    ) -> Result<WriteResult, String> {
        let def = self.def.clone();
        let device = def.device(tag.device);
        let (unit, write_gap) = (device.unit, device.write_gap);
        if schedule.is_down(tag.device) || schedule.is_resting(tag.device, self.clock.now()) {
            return Ok(WriteResult::NotSent(Fault::Resting));
        }
        // A key of another device would be written to an address of this one.
        if unlock.is_some_and(|(key, _)| key.device != tag.device) {
            return Ok(WriteResult::NotSent(Fault::NotANumber));
        }
        for (tag, raw) in unlock.into_iter().chain([(tag, raw)]) {
            // A value that the codec cannot hold was refused by the plant before; nothing is sent in any case.
            let Some(request) = write_request(tag, raw) else { return Ok(WriteResult::NotSent(Fault::NotANumber)) };
            let sent = link.call(unit, request).await;
            link.rest(write_gap);
            match sent {
                Ok(_) => schedule.answered(tag.device, self.clock.now()),
                Err(Trouble::Gone(why)) => return Err(why),
                Err(Trouble::Fault(Fault::Exception(code))) if code.is_refusal() => {
                    return Ok(WriteResult::Refused(code));
                }
                Err(Trouble::Fault(fault)) => return Ok(WriteResult::Lost(fault)),
            }
        }
        // An action such as saving to non-volatile memory wants the device left alone, not the line.
        let is_this = |action: &&ActionDef| action.tag == tag.id && scale::to_raw(tag, action.value, 0) == Some(raw);
        if let Some(action) = device.actions.iter().find(is_this) {
            schedule.rest(tag.device, self.clock.now() + action.settle);
        }
        if !verify {
            return Ok(WriteResult::Accepted);
        }
        let block = plan::single(device, tag);
        let back = match self.in_step(link, &block).await {
            Ok(()) => self.read_twice(link, &block).await,
            Err(trouble) => Err(trouble),
        };
        match back {
            Ok(values) => Ok(match value_of(tag, &block, &values) {
                Some(back) => WriteResult::ReadBack(back),
                None => WriteResult::NotRead(Fault::NotANumber),
            }),
            Err(Trouble::Gone(why)) => Err(why),
            Err(Trouble::Fault(fault)) => Ok(WriteResult::NotRead(fault)),
        }
    }

    /// Makes the plan anew when the search for what a device does not have has come to an end, or knowledge was `wrong`.
    fn replan(&mut self, schedule: &mut Schedule, at: Timestamp, wrong: bool) -> bool {
        if wrong {
            self.hunt.reset();
        }
        let anew = wrong || self.hunt.conclude(&mut self.holes);
        if anew {
            self.blocks = plan::blocks(&self.def, self.line, &self.holes);
            schedule.replan(&self.blocks, at);
        }
        anew
    }

    /// The numbers of a block's tags; `None` for those that hold none.
    fn decode(&self, block: &Block, values: &Answer) -> Vec<(TagId, Option<f64>)> {
        block.tags.iter().map(|tag| (*tag, value_of(self.def.tag(*tag), block, values))).collect()
    }

    async fn tell_values(
        &mut self,
        at: Timestamp,
        block: &Block,
        decoded: Vec<(TagId, Option<f64>)>,
        reply: Duration,
    ) -> Result<(), Ended> {
        let spoiled: Vec<TagId> = decoded.iter().filter(|(_, value)| value.is_none()).map(|(tag, _)| *tag).collect();
        let values = decoded.into_iter().filter_map(|(tag, value)| Some((tag, value?))).collect();
        self.tell(Event::Read { at, device: block.device, values, reply }).await?;
        if !spoiled.is_empty() {
            self.tell_failed(at, block.device, spoiled, Fault::NotANumber).await?;
        }
        Ok(())
    }

    async fn tell_counters(&mut self, link: &mut Link, schedule: &Schedule) -> Result<(), Ended> {
        let real = self.clock.real_span(COUNTERS_EVERY).as_secs_f32();
        if self.busy.len() == UTILISATION_OVER {
            self.busy.pop_front();
        }
        self.busy.push_back((std::mem::take(&mut link.busy).as_secs_f32() / real).min(1.0));
        link.counters.utilisation = self.busy.iter().sum::<f32>() / self.busy.len() as f32;
        link.counters.missed = schedule.missed();
        self.counters = link.counters;
        self.tell(Event::Counters { at: self.clock.now(), line: self.line, counters: link.counters }).await
    }

    async fn tell_state(&mut self, state: LineState) -> Result<(), Ended> {
        self.tell(Event::Line { at: self.clock.now(), line: self.line, state }).await
    }

    async fn tell_failed(
        &mut self,
        at: Timestamp,
        device: DeviceId,
        tags: Vec<TagId>,
        fault: Fault,
    ) -> Result<(), Ended> {
        self.tell(Event::Failed { at, device, tags, fault }).await
    }

    async fn tell_wrote(&mut self, id: WriteId, result: WriteResult) -> Result<(), Ended> {
        self.tell(Event::Wrote { at: self.clock.now(), id, result }).await
    }

    async fn tell(&mut self, event: Event) -> Result<(), Ended> {
        self.events.send(event).await.map_err(|_| Ended)
    }

    fn line_def(&self) -> &LineDef {
        self.def.line(self.line)
    }
}

/// What a block read gave: bits or registers, the first at the block's address.
#[derive(Debug)]
enum Answer {
    Bits(Vec<bool>),
    Words(Vec<u16>),
}

async fn read(link: &mut Link, block: &Block) -> Result<Answer, Trouble> {
    let (address, count) = (block.address, block.count);
    let request = match block.table {
        Table::Coil => Request::ReadCoils(address, count),
        Table::Discrete => Request::ReadDiscreteInputs(address, count),
        Table::Input => Request::ReadInputRegisters(address, count),
        Table::Holding => Request::ReadHoldingRegisters(address, count),
    };
    match link.call(block.unit, request).await? {
        Response::ReadCoils(bits) | Response::ReadDiscreteInputs(bits) if usize::from(count) <= bits.len() => {
            Ok(Answer::Bits(bits))
        }
        Response::ReadInputRegisters(words) | Response::ReadHoldingRegisters(words)
            if words.len() == usize::from(count) =>
        {
            Ok(Answer::Words(words))
        }
        // The length was checked byte for byte before; kept so that no later change can turn a shift into a value.
        _ => Err(Fault::WrongLength { got: 0, asked: count }.into()),
    }
}

fn value_of(tag: &TagDef, block: &Block, values: &Answer) -> Option<f64> {
    let start = usize::from(tag.point.address.checked_sub(block.address)?);
    match values {
        Answer::Bits(bits) => bits.get(start).map(|bit| f64::from(u8::from(*bit))),
        Answer::Words(words) => codec::decode(tag.point, words.get(start..start + usize::from(tag.point.len()))?),
    }
}

/// The request that writes a raw number: function 5 or 6 for one, 15 or 16 for more or where the profile says so.
fn write_request(tag: &TagDef, raw: f64) -> Option<Request<'static>> {
    let address = tag.point.address;
    match tag.point.table {
        Table::Coil => Some(match tag.write_fc {
            Some(15) => Request::WriteMultipleCoils(address, Cow::Owned(vec![raw != 0.0])),
            Some(_) | None => Request::WriteSingleCoil(address, raw != 0.0),
        }),
        Table::Holding => {
            let words = codec::encode(tag.point, raw)?;
            Some(match (words.as_slice(), tag.write_fc) {
                ([word], None | Some(6)) => Request::WriteSingleRegister(address, *word),
                _ => Request::WriteMultipleRegisters(address, Cow::Owned(words)),
            })
        }
        Table::Discrete | Table::Input => None,
    }
}
