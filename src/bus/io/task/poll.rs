//! Reading blocks: one at a time, or several under way over Modbus TCP; what came is judged and told.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio_modbus::{Response, bytes::Bytes};

use super::{Ended, Leave, Task, Turn};
use crate::{
    bus::{
        codec,
        io::link::{Link, Trouble},
        plan::{self, Block},
        schedule::{Next, Schedule},
    },
    plant::{
        def::{Framing, TagId},
        event::{Event, ExceptionCode, Fault},
        tag::TagDef,
        traffic::Exchange,
    },
};

/// Requests in a row without any answer after which a TCP connection is made anew.
const UNANSWERED_MAX: u32 = 5;

/// How a read has ended: values or a fault, with the evidence.
pub(super) type Outcome = (Result<Answer, Fault>, Option<Arc<Exchange>>);

impl Task {
    /// Reads the block that is due, and with it others where several requests may be under way.
    pub(super) async fn poll(&mut self, link: &mut Link, schedule: &mut Schedule, index: usize) -> Turn {
        self.polls_since_test += 1;
        let in_flight = self.in_flight(index);
        if 1 < in_flight {
            return self.poll_many(link, schedule, index, in_flight).await;
        }
        let block = self.blocks[index].clone();
        let started = self.clock.now();
        let sent = link.last.clone();
        let read = match self.in_step(link, &block).await {
            Ok(()) => self.read_twice(link, &block).await,
            Err(trouble) => Err(trouble),
        };
        let at = self.clock.now();
        schedule.done(index, started, at);
        link.rest(self.def.device(block.device).gap);
        let answer = match read {
            Ok(answer) => Ok(answer),
            Err(Trouble::Fault(fault)) => Err(fault),
            Err(Trouble::Gone(why)) => return Ok(Err(Leave::Lost(why))),
        };
        // Nothing new was sent when patience was the only way.
        let exchange = link.last.clone().filter(|last| sent.as_ref().is_none_or(|sent| !Arc::ptr_eq(sent, last)));
        self.settle(link, schedule, index, at, (answer, exchange)).await?;
        Ok(self.still_there(link))
    }

    /// A peer may have forgotten a connection, or hold it without ever answering: only a new one tells.
    fn still_there(&self, link: &Link) -> Result<(), Leave> {
        if self.settings.transport.serial().is_some() || link.unanswered < UNANSWERED_MAX {
            return Ok(());
        }
        Err(Leave::Lost(format!("no answer to {} requests over this connection", link.unanswered)))
    }

    /// Reads all blocks that are due now, at most `in_flight` at once. Transaction ids tell their answers apart.
    async fn poll_many(&mut self, link: &mut Link, schedule: &mut Schedule, first: usize, in_flight: usize) -> Turn {
        let started = self.clock.now();
        let (mut taken, mut next) = (Vec::new(), Next::Run(first));
        while let Next::Run(index) = next {
            if taken.len() == in_flight || taken.contains(&index) || self.in_flight(index) <= taken.len() {
                break;
            }
            taken.push(index);
            schedule.done(index, started, started);
            next = schedule.next(started);
        }
        let requests: Vec<[u8; 6]> = taken.iter().map(|index| self.blocks[*index].request()).collect();
        let messages: Vec<&[u8]> = requests.iter().map(|request| &request[..]).collect();
        let answers = match link.exchange_all(&messages).await {
            Ok(answers) => answers,
            Err(Trouble::Gone(why)) => return Ok(Err(Leave::Lost(why))),
            // The connection stands, so every message has its own outcome.
            Err(Trouble::Fault(_)) => return Ok(Ok(())),
        };
        let at = self.clock.now();
        // A block that is split moves those behind it: the last first.
        for (index, answered) in taken.into_iter().zip(answers).rev() {
            let answer = answered.answer.and_then(|answer| parse(&self.blocks[index], &answer));
            self.settle(link, schedule, index, at, (answer, Some(answered.exchange))).await?;
        }
        Ok(self.still_there(link))
    }

    /// How many requests may be under way when this block is among them.
    fn in_flight(&self, index: usize) -> usize {
        let device = self.def.device(self.blocks[index].device);
        match self.settings.transport.framing() {
            Framing::Mbap => usize::from(device.limits.in_flight_max),
            Framing::Rtu | Framing::Ascii => 1,
        }
    }

    /// Judges what came of a block and tells it.
    async fn settle(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: usize,
        at: Timestamp,
        (answer, exchange): Outcome,
    ) -> Result<(), Ended> {
        let block = self.blocks[index].clone();
        let reply = exchange.as_ref().and_then(|exchange| exchange.reply);
        if let Some(exchange) = &exchange {
            self.books.polled(index, block.device, answer.as_ref().map(drop).map_err(|fault| *fault), reply);
            let retries = u64::from(exchange.tries.saturating_sub(1));
            self.books.poll(index).retries += retries;
            if let Some(tally) = self.books.device(block.device) {
                tally.retries += retries;
            }
        }
        match answer {
            Ok(values) => {
                schedule.answered(block.device, at);
                self.tell_values(at, &block, &values, reply.unwrap_or_default(), exchange).await
            }
            Err(fault @ Fault::Exception(code)) if !code.is_of_gateway() => {
                schedule.answered(block.device, at);
                schedule.again(index, at);
                self.tell_failed(at, block.device, block.tags.clone(), fault, exchange).await?;
                let its_own = link.debt(block.unit).is_clear();
                if code == ExceptionCode(0x02) && its_own && self.split(index) {
                    *schedule = Schedule::new(&self.blocks, at);
                }
                Ok(())
            }
            Err(fault) => {
                schedule.again(index, at);
                self.tell_failed(at, block.device, block.tags.clone(), fault, exchange).await?;
                if schedule.failed(block.device, at) {
                    let tags = self.def.tags_of(block.device).map(|tag| tag.id).collect();
                    self.tell_failed(at, block.device, tags, Fault::Resting, None).await?;
                }
                Ok(())
            }
        }
    }

    /// Makes sure that the answer to a block cannot be mistaken for one that the unit still owes: by a read of another
    /// shape if there is one, else by a loopback, else by patience.
    pub(super) async fn in_step(&self, link: &mut Link, block: &Block) -> Result<(), Trouble> {
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

    /// Reads a block; a spoiled answer, or one that the device's memory spoiled (exception 08), is asked for once more. It
    /// counts as owed, so the unit is brought into step first.
    pub(super) async fn read_twice(&self, link: &mut Link, block: &Block) -> Result<Answer, Trouble> {
        match read(link, block).await {
            Err(Trouble::Fault(fault)) if fault.is_corrupt() || fault == Fault::Exception(ExceptionCode(0x08)) => {
                self.in_step(link, block).await?;
                let second = read(link, block).await;
                if let Some(last) = &mut link.last {
                    Arc::make_mut(last).tries = 2;
                }
                second
            }
            other => other,
        }
    }

    /// A block that the device does not have as a whole is read tag by tag from now on. `false`: it was a single tag.
    fn split(&mut self, index: usize) -> bool {
        let block = self.blocks[index].clone();
        if block.tags.len() < 2 {
            return false;
        }
        tracing::warn!(address = block.address, count = block.count, "exception 02: the block is split");
        let device = self.def.device(block.device);
        let singles = block.tags.iter().map(|tag| plan::single(device, self.def.tag(*tag)));
        let singles: Vec<Block> = singles.collect();
        self.books.split(index, singles.len());
        self.blocks.splice(index..=index, singles);
        true
    }

    async fn tell_values(
        &mut self,
        at: Timestamp,
        block: &Block,
        values: &Answer,
        reply: Duration,
        exchange: Option<Arc<Exchange>>,
    ) -> Result<(), Ended> {
        let decoded = block.tags.iter().map(|tag| (*tag, value_of(self.def.tag(*tag), block, values)));
        let (good, spoiled): (Vec<_>, Vec<_>) = decoded.partition(|(_, value)| value.is_some());
        let values = good.into_iter().filter_map(|(tag, value)| Some((tag, value?))).collect();
        self.tell(Event::Read { at, device: block.device, values, reply, exchange: exchange.clone() }).await?;
        if !spoiled.is_empty() {
            let tags: Vec<TagId> = spoiled.into_iter().map(|(tag, _)| tag).collect();
            self.tell_failed(at, block.device, tags, Fault::NotANumber, exchange).await?;
        }
        Ok(())
    }
}

/// What a block read gave: bits or registers, the first at the block's address.
#[derive(Debug)]
pub(super) enum Answer {
    Bits(Vec<bool>),
    Words(Vec<u16>),
}

async fn read(link: &mut Link, block: &Block) -> Result<Answer, Trouble> {
    let answer = link.exchange(&block.request()).await?;
    Ok(parse(block, &answer)?)
}

/// The values in a checked answer message.
fn parse(block: &Block, answer: &[u8]) -> Result<Answer, Fault> {
    let count = usize::from(block.count);
    let pdu = Bytes::copy_from_slice(answer.get(1..).unwrap_or_default());
    match Response::try_from(pdu) {
        Ok(Response::ReadCoils(bits) | Response::ReadDiscreteInputs(bits)) if count <= bits.len() => {
            Ok(Answer::Bits(bits))
        }
        Ok(Response::ReadInputRegisters(words) | Response::ReadHoldingRegisters(words)) if words.len() == count => {
            Ok(Answer::Words(words))
        }
        // The length was checked byte for byte before; kept so that no later change can turn a shift into a value.
        _ => Err(Fault::WrongLength { got: answer.len() as u16, asked: block.count }),
    }
}

pub(super) fn value_of(tag: &TagDef, block: &Block, values: &Answer) -> Option<f64> {
    let start = usize::from(tag.point.address.checked_sub(block.address)?);
    match values {
        Answer::Bits(bits) => bits.get(start).map(|bit| f64::from(u8::from(*bit))),
        Answer::Words(words) => codec::decode(tag.point, words.get(start..start + usize::from(tag.point.len()))?),
    }
}
