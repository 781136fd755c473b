//! The line of another master, heard without sending a byte: frames of both sides, requests paired with responses.
//!
//! The bytes say neither who sent them nor where a frame begins:
//!
//! ```text
//!  bytes ──> cut ──> frame ──> role ──┬─> request     until its response, or the next request
//!             │      length,          ├─> response    of the open request: paired, counted, timed
//!             v      check            └─> unmatched   no request of it was heard
//!           noise
//! ```
//!
//! A frame that may be either (the echo of a write) is the response of an open request that it repeats, else a request. So
//! after a lost response the roles are right again with the next frame that is not the same, or that comes after the
//! response timeout. What is not a frame is noise: counted, recorded, and bounded like everything that is kept here.

mod follow;

#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;

use super::{
    ascii,
    cut::{self, Cut},
    frame, framing,
    late_reply::LineReplies,
    pdu::{self, Length},
};
use crate::plant::{
    event::Fault,
    line::{Framing, LineDef},
    request_stats::RequestStats,
    time::elapsed,
    traffic::{Frame, FrameFault, FrameResult},
};

pub use follow::{Ending, Follower, Losses, ending, events, silent_after};

/// Bytes in a row that are no frame are recorded in runs of at most this.
const NOISE_MAX: usize = ascii::FRAME_MAX;
/// Requests over TCP that wait for their responses at once; the oldest is given up for one more.
const OPEN_MAX: usize = 64;
/// The pieces of a frame may come so far apart over TCP.
const TCP_SILENCE: Duration = Duration::from_secs(1);

/// What was heard.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// A frame, or a run of bytes that is none.
    Frame(HeardFrame),
    /// No response, or only a corrupt one, came to a request.
    Lost {
        /// When that was known: with the next request.
        at: Timestamp,
        /// How the line frames its messages.
        framing: Framing,
        /// The request message.
        request: Vec<u8>,
        /// What came in its place.
        fault: Fault,
    },
}

/// A frame with its role.
#[derive(Debug, Clone, PartialEq)]
pub struct HeardFrame {
    /// As it went over the line; `sent` stands for the master.
    pub frame: Frame,
    /// What it is.
    pub role: Role,
}

/// What a frame is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// The master asks.
    Request,
    /// A unit responds.
    Response {
        /// The request message.
        request: Vec<u8>,
        /// From the last byte of the request to the first of the response; `None` if both came at once.
        time: Option<Duration>,
        /// It cannot be the late response to an earlier request.
        proven: bool,
    },
    /// A response without its request: late, or the request was not heard.
    Unmatched,
    /// No frame.
    Noise,
}

/// A request that has no response yet.
#[derive(Debug)]
struct Open {
    message: Vec<u8>,
    /// Over TCP.
    transaction: u16,
    at: Timestamp,
    /// The first frame of all: its response may have been before the first byte heard.
    first: bool,
    /// What has come since that is no frame.
    noise: Vec<u8>,
}

impl Open {
    fn add_noise(&mut self, bytes: &[u8]) {
        let room = NOISE_MAX.saturating_sub(self.noise.len());
        self.noise.extend(bytes.iter().take(room));
    }
}

/// Hears a line.
#[derive(Debug)]
pub struct Listener {
    framing: Framing,
    silence: Duration,
    timeout: Duration,
    /// Bytes that have no role yet, and when each came.
    bytes: Vec<u8>,
    times: Vec<Timestamp>,
    /// How many of them, at the front, are no frame.
    noise: usize,
    open: VecDeque<Open>,
    replies: LineReplies,
    began: Option<Timestamp>,
    frames: u64,
    totals: Totals,
    units: BTreeMap<u8, RequestStats>,
}

/// What was heard of the whole line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// Requests, broadcasts included.
    pub requests: u64,
    /// Responses to them.
    pub responses: u64,
    /// Responses without request.
    pub unmatched: u64,
    /// Bytes that are no frame, and in how many runs.
    pub noise_bytes: u64,
    /// See above.
    pub noise_runs: u64,
}

impl Listener {
    /// Nothing has been heard yet.
    pub fn new(line: &LineDef) -> Listener {
        let silence =
            line.transport.serial().map_or(TCP_SILENCE, |serial| serial.silent_interval().max(line.frame_timeout));
        Listener {
            framing: line.transport.framing(),
            silence,
            timeout: line.timeout,
            bytes: Vec::new(),
            times: Vec::new(),
            noise: 0,
            open: VecDeque::new(),
            replies: LineReplies::new(line.timeout, 0),
            began: None,
            frames: 0,
            totals: Totals::default(),
            units: BTreeMap::new(),
        }
    }

    /// Takes bytes as they came.
    pub fn hear(&mut self, at: Timestamp, bytes: &[u8]) -> Vec<Heard> {
        let mut heard = self.rest(at);
        self.began.get_or_insert(at);
        self.bytes.extend_from_slice(bytes);
        self.times.resize(self.bytes.len(), at);
        self.take_frames(false, &mut heard);
        heard
    }

    /// Nothing has come until now: what has begun before a silence has ended.
    pub fn rest(&mut self, at: Timestamp) -> Vec<Heard> {
        let mut heard = Vec::new();
        if self.silent_at().is_some_and(|silent| silent <= at) {
            self.take_frames(true, &mut heard);
        }
        heard
    }

    /// When [`Listener::rest`] decides something, if nothing more comes.
    pub fn silent_at(&self) -> Option<Timestamp> {
        self.times.last().and_then(|last| last.checked_add(self.silence).ok())
    }

    /// What was heard of the whole line.
    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// Requests that wait for their response.
    pub fn waiting(&self) -> usize {
        self.open.len()
    }

    /// The requests of each unit: how they ended, how long they took; `late` counts its responses without request.
    pub fn units(&self) -> &BTreeMap<u8, RequestStats> {
        &self.units
    }

    fn take_frames(&mut self, ended: bool, heard: &mut Vec<Heard>) {
        while self.noise < self.bytes.len() {
            let asked = self.open.front().map(|open| &open.message[..]);
            match cut::cut(self.framing, &self.bytes[self.noise..], asked, ended) {
                Cut::Frame(length) => {
                    self.end_noise(heard);
                    self.take(length, heard);
                }
                Cut::Wait => return,
                Cut::Noise => {
                    self.noise += 1;
                    if self.noise == NOISE_MAX {
                        self.drop_noise(heard);
                    }
                }
            }
        }
        if ended {
            self.end_noise(heard);
        }
    }

    /// What stood before a frame or a silence is noise, or frames of functions that are not in the standard.
    fn end_noise(&mut self, heard: &mut Vec<Heard>) {
        let noise = &self.bytes[..self.noise];
        match cut::of_unknown_functions(noise).filter(|_| self.framing == Framing::Rtu && !noise.is_empty()) {
            Some(lengths) => {
                self.noise = 0;
                lengths.into_iter().for_each(|length| self.take(length, heard));
            }
            None => self.drop_noise(heard),
        }
    }

    fn drop_noise(&mut self, heard: &mut Vec<Heard>) {
        if self.noise == 0 {
            return;
        }
        let (bytes, _, at) = self.split(self.noise);
        self.noise = 0;
        self.totals.noise_bytes += bytes.len() as u64;
        self.totals.noise_runs += 1;
        let unit = frame::unit_of(self.framing, &bytes);
        let why = match self.open.front().filter(|open| unit == open.message.first().copied()) {
            Some(open) => FrameFault::NoResponse(self.left_over(&open.message, &bytes)),
            None => FrameFault::NoFrame,
        };
        self.open.front_mut().into_iter().for_each(|open| open.add_noise(&bytes));
        heard.push(self.frame(at, false, bytes, FrameResult::Wrong(why), Role::Noise));
    }

    /// Takes a whole frame from the front of the bytes.
    fn take(&mut self, length: usize, heard: &mut Vec<Heard>) {
        let (bytes, first, at) = self.split(length);
        let transaction = if self.framing == Framing::Mbap { u16::from_be_bytes([bytes[0], bytes[1]]) } else { 0 };
        let Ok(message) = frame::unwrap(self.framing, &bytes) else { return };
        if let Some(place) = self.open.iter().position(|open| self.answers(open, transaction, &message, first)) {
            let open = self.open.remove(place).into_iter();
            open.for_each(|open| heard.push(self.response(open, &message, bytes.clone(), first, at)));
        } else if is_request(&message) {
            self.request(message, transaction, bytes, at, heard);
        } else {
            heard.push(self.unmatched(&message, bytes, at));
        }
    }

    /// Is this the response to an open request?
    fn answers(&self, open: &Open, transaction: u16, message: &[u8], first: Timestamp) -> bool {
        let asked = &open.message;
        let same = *asked == message;
        let echoes = pdu::function(message[1]).is_none_or(|function| function.echoes);
        // A master that repeats a request waits for its own timeout before.
        let repeated = same && (!echoes || self.timeout < elapsed(open.at, first));
        open.transaction == transaction && frame::answers(self.framing, asked, message) && !repeated
    }

    fn request(&mut self, message: Vec<u8>, transaction: u16, bytes: Vec<u8>, at: Timestamp, heard: &mut Vec<Heard>) {
        let most = if self.framing == Framing::Mbap { OPEN_MAX } else { 1 };
        // The same number again, or no room for one more.
        let reused = self.open.iter().position(|open| open.transaction == transaction);
        if let Some(open) = reused.and_then(|place| self.open.remove(place)) {
            self.lose(open, at, heard);
        } else if self.open.len() == most {
            let oldest = self.open.pop_front().into_iter();
            oldest.for_each(|open| self.lose(open, at, heard));
        }
        self.totals.requests += 1;
        // A unit that was left alone for long owes nothing any more.
        self.replies.forget(message[0], self.age(at));
        let first = self.frames == 0;
        heard.push(self.frame(at, true, bytes, FrameResult::Sent, Role::Request));
        if message[0] == 0 && self.framing != Framing::Mbap {
            self.units.entry(0).or_default().requests += 1;
        } else {
            self.open.push_back(Open { message, transaction, at, first, noise: Vec::new() });
        }
    }

    /// A request has ended without a good response.
    fn lose(&mut self, open: Open, at: Timestamp, heard: &mut Vec<Heard>) {
        if open.first {
            return;
        }
        let fault = self.left_over(&open.message, &open.noise);
        self.units.entry(open.message[0]).or_default().count(Err(fault), None);
        self.replies.failed(&open.message, self.age(at));
        heard.push(Heard::Lost { at, framing: self.framing, request: open.message, fault });
    }

    /// Names what came in place of a response.
    fn left_over(&self, asked: &[u8], bytes: &[u8]) -> Fault {
        // More noise may stand behind a corrupt response.
        let whole = pdu::response_length(bytes).known().filter(|_| self.framing == Framing::Rtu);
        let bytes = whole.and_then(|length| bytes.get(..length + 2)).unwrap_or(bytes);
        framing::left_over(self.framing, asked, bytes)
    }

    fn response(&mut self, open: Open, message: &[u8], bytes: Vec<u8>, first: Timestamp, at: Timestamp) -> Heard {
        self.totals.responses += 1;
        let outcome = frame::check_answer(self.framing, &open.message, message);
        let time = Some(elapsed(open.at, first)).filter(|time| !time.is_zero());
        self.units.entry(message[0]).or_default().count(outcome, time);
        let proven = self.framing == Framing::Mbap || !self.replies.is_ambiguous(&open.message);
        if outcome.is_ok() {
            self.replies.answered(&open.message, message, proven, self.age(at));
        }
        self.frame(at, false, bytes, FrameResult::Good, Role::Response { request: open.message, time, proven })
    }

    fn unmatched(&mut self, message: &[u8], bytes: Vec<u8>, at: Timestamp) -> Heard {
        self.totals.unmatched += 1;
        let age = self.age(at);
        self.replies.detect_reordering(message[0], message, age);
        self.replies.on_late_reply(message[0], message, age);
        self.units.entry(message[0]).or_default().late += 1;
        // It may be a wrong response to the open request.
        let asked = self.open.front_mut().filter(|open| open.message[0] == message[0]);
        asked.into_iter().for_each(|open| open.add_noise(&bytes));
        self.frame(at, false, bytes, FrameResult::Wrong(FrameFault::WithoutRequest), Role::Unmatched)
    }

    fn frame(&mut self, at: Timestamp, sent: bool, bytes: Vec<u8>, result: FrameResult, role: Role) -> Heard {
        self.frames += 1;
        let unit = if role == Role::Noise { None } else { frame::unit_of(self.framing, &bytes) };
        let (bytes, framing): (Arc<[u8]>, _) = (bytes.into(), self.framing);
        Heard::Frame(HeardFrame { frame: Frame { at, sent, bytes, framing, result, unit, number: self.frames }, role })
    }

    /// Takes bytes from the front, with the times of the first and of the last.
    fn split(&mut self, length: usize) -> (Vec<u8>, Timestamp, Timestamp) {
        let (first, at) = (self.times[0], self.times[length - 1]);
        self.times.drain(..length);
        (self.bytes.drain(..length).collect(), first, at)
    }

    fn age(&self, at: Timestamp) -> Duration {
        self.began.map_or(Duration::ZERO, |began| elapsed(began, at))
    }
}

/// May a message be a request?
fn is_request(message: &[u8]) -> bool {
    match pdu::request_length(message) {
        Length::Known(length) => length == message.len(),
        // A function that is not in the standard; an exception is none.
        Length::BySilence => message[1] < 0x80,
        Length::TooEarly => false,
    }
}
