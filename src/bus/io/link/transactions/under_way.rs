//! The requests under way on one connection of Modbus TCP, and the frames of its stream.

use std::{collections::VecDeque, ops::Range, sync::Arc, time::Duration};

use tokio::time::Instant;

use super::Ended;
use crate::{
    bus::{
        frame::{self, Mbap, ShortException},
        framing,
    },
    plant::{def::Framing, fault::Fault},
};

/// Ids of requests that were given up are remembered, and not used again, as long as there are no more than these.
const GIVEN_UP_MAX: usize = 256;
/// What may be a whole exception with a wrong length is waited for so long: the rest of a longer frame would have come.
pub const SHORT_WAIT: Duration = Duration::from_millis(200);

/// A request that is under way.
#[derive(Debug)]
pub struct Transaction {
    pub id: u16,
    /// Unit and PDU.
    pub message: Vec<u8>,
    pub frame: Arc<[u8]>,
    pub timeout: Duration,
    /// `None` until it is flushed.
    pub sent_at: Option<Instant>,
    /// The last answer to a request that was sent before it.
    pub begun_at: Instant,
    /// What is wrong if nothing better comes.
    pub fault: Fault,
}

impl Transaction {
    pub fn is_to(&self, unit: u8) -> bool {
        self.message.first() == Some(&unit)
    }

    /// Its time runs from when the device could begin with it: what was sent before it may have been answered first.
    pub fn deadline(&self) -> Option<Instant> {
        Some(self.sent_at?.max(self.begun_at) + self.timeout)
    }
}

/// Whose answer a transaction id announces.
#[derive(Debug)]
pub enum Owner {
    UnderWay(Transaction),
    /// The request to this unit was given up.
    Late(u8),
    Unknown,
}

/// The requests under way on one connection.
#[derive(Debug)]
pub struct Transactions {
    pub last_id: u16,
    pub under_way: Vec<Transaction>,
    /// The latest that are not waited for any longer: id, and the unit if it did not answer in time.
    pub given_up: VecDeque<(u16, Option<u8>)>,
    /// By unit: how many may be under way beside one to this unit, that one included.
    pub limits: [u16; 256],
    /// Only one may be under way at all.
    pub alone: bool,
    /// Bytes of a frame that has not come as a whole.
    pub inbox: Vec<u8>,
    /// Requests that wait for their place in the next write.
    pub outbox: Vec<u8>,
    /// A write has begun and has not ended.
    pub sending: bool,
    pub ended: Vec<Ended>,
    /// Since when the line is busy.
    pub busy_since: Option<Instant>,
    /// When the last silence was counted: what was under way then adds nothing.
    pub silence_at: Option<Instant>,
    /// Since when the stream begins with what may be an exception whose header counts too many bytes.
    pub short_since: Option<Instant>,
}

impl Transactions {
    pub fn new() -> Transactions {
        Transactions {
            last_id: 0,
            under_way: Vec::new(),
            given_up: VecDeque::new(),
            limits: [1; 256],
            alone: false,
            inbox: Vec::new(),
            outbox: Vec::new(),
            sending: false,
            ended: Vec::new(),
            busy_since: None,
            silence_at: None,
            short_since: None,
        }
    }

    /// The most that may be under way now.
    pub fn limit(&self) -> usize {
        if self.alone {
            return 1;
        }
        let units = self.under_way.iter().filter_map(|request| request.message.first());
        units.map(|unit| usize::from(self.limits[usize::from(*unit)])).min().unwrap_or(usize::MAX)
    }

    pub fn has_room(&self, unit: u8) -> bool {
        self.under_way.len() < self.limit().min(self.limits[usize::from(unit)].into())
    }

    pub fn begin(&mut self, message: &[u8], timeout: Duration, now: Instant) -> u16 {
        self.last_id = self.last_id.wrapping_add(1);
        while self.under_way.iter().any(|request| request.id == self.last_id)
            || self.given_up.iter().any(|(id, _)| *id == self.last_id)
        {
            self.last_id = self.last_id.wrapping_add(1);
        }
        let (id, frame) = (self.last_id, frame::with_mbap(self.last_id, message));
        self.outbox.extend_from_slice(&frame);
        self.under_way.push(Transaction {
            id,
            message: message.to_vec(),
            frame: frame.into(),
            timeout,
            sent_at: None,
            begun_at: now,
            fault: Fault::Timeout,
        });
        id
    }

    pub fn take(&mut self, id: u16) -> Owner {
        if let Some(place) = self.under_way.iter().position(|request| request.id == id) {
            return Owner::UnderWay(self.under_way.swap_remove(place));
        }
        let place = self.given_up.iter().position(|(given_up, _)| *given_up == id);
        let unit = place.and_then(|place| self.given_up.remove(place)).and_then(|(_, unit)| unit);
        unit.map_or(Owner::Unknown, Owner::Late)
    }

    /// Those whose time is over; their answers may still come.
    pub fn expire(&mut self, now: Instant) -> Vec<Transaction> {
        let is_over = |request: &mut Transaction| request.deadline().is_some_and(|deadline| deadline <= now);
        let expired: Vec<Transaction> = self.under_way.extract_if(.., is_over).collect();
        for request in &expired {
            self.keep_id(request.id, request.message.first().copied());
        }
        expired
    }

    /// Nothing is waited for any longer, and what was not sent is not sent. An answer that comes all the same is not late.
    pub fn give_up_all(&mut self) {
        self.outbox.clear();
        self.ended.clear();
        for request in std::mem::take(&mut self.under_way) {
            self.give_up(&request);
        }
    }

    /// This one is not waited for any longer.
    pub fn give_up(&mut self, request: &Transaction) {
        if request.sent_at.is_some() {
            self.keep_id(request.id, None);
        }
    }

    /// The answer may still come, and must not be taken for that of a later request.
    pub fn keep_id(&mut self, id: u16, unit: Option<u8>) {
        if self.given_up.len() == GIVEN_UP_MAX {
            self.given_up.pop_front();
        }
        self.given_up.push_back((id, unit));
    }

    /// Has a frame begun that answers nothing under way?
    pub fn is_cut_short(&self) -> bool {
        let id = self.inbox.first_chunk::<2>().map(|id| u16::from_be_bytes(*id));
        !self.inbox.is_empty() && !self.under_way.iter().any(|request| Some(request.id) == id)
    }

    /// The frames that the stream begins with, each with its transaction, and where they end. Nothing follows on an `ended` one.
    pub fn cut(&mut self, bytes: &[u8], ended: bool, now: Instant) -> (Vec<(u16, Range<usize>)>, usize) {
        let waited = ended || self.short_since.is_some_and(|since| since + SHORT_WAIT <= now);
        let asked =
            |id: u16| self.under_way.iter().find(|request| request.id == id).map(|request| &request.message[..]);
        let (mut frames, mut start, mut is_open) = (Vec::new(), 0, false);
        loop {
            let rest = &bytes[start..];
            let (transaction, length) = match (frame::short_exception(rest, &asked), frame::mbap(rest)) {
                (Some(short), _) if short.is_proven || waited => (short.transaction, ShortException::LENGTH),
                (Some(_), _) => {
                    is_open = true;
                    break;
                }
                (None, Mbap::Whole { transaction, end }) => (transaction, end),
                (None, Mbap::Incomplete | Mbap::Broken) => break,
            };
            frames.push((transaction, start..start + length));
            start += length;
        }
        self.short_since = if is_open { self.short_since.or(Some(now)) } else { None };
        (frames, start)
    }

    /// An answer came with a transaction id of which nothing is known: those that it may be meant for.
    pub fn note_strange(&mut self, got: u16, answer: &[u8]) {
        let meant = |request: &&mut Transaction| frame::begins_answer(&request.message, answer);
        let fault = |asked| Fault::WrongTransaction { got, asked };
        self.under_way.iter_mut().filter(meant).for_each(|request| request.fault = fault(request.id));
    }

    /// No more will come of what an answer began with.
    pub fn note_cut_short(&mut self, begun: &[u8]) {
        let Some(id) = begun.first_chunk::<2>().map(|id| u16::from_be_bytes(*id)) else { return };
        if let Some(request) = self.under_way.iter_mut().find(|request| request.id == id) {
            request.fault = framing::left_over(Framing::Mbap, &request.message, begun);
        }
    }
}
