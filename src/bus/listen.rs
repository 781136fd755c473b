//! The line of another master, heard without sending a byte: frames of both sides, requests paired with responses.
//!
//! The bytes say neither who sent them nor where a frame begins:
//!
//! ```text
//!  bytes ──> cut ──> frame ──> role ──┬─> request     until its response, or the next request
//!             │      length,          ├─> response    of the open request: paired, until evidence says whether it is its own
//!             v      check            └─> unmatched   no request of it was heard
//!           noise
//! ```
//!
//! A frame that may be either (the echo of a write) is the response of an open request that it repeats, else a request. So
//! after a lost response the roles are right again with the next frame that is not the same, or that comes after the
//! response timeout. What is not a frame is noise: counted, recorded, and bounded like everything that is kept here.
//!
//! Bytes and whole frames may be lost on the way here, so a response behind a request may be that of another: see `evidence`.

mod evidence;
mod follow;
mod heard;
mod order;
mod pairing;
mod traffic;
mod unit;

#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;

use self::{
    evidence::Evidence,
    order::fits,
    pairing::{Answered, Next, Open},
};
use super::{
    ascii, frame,
    frame_boundaries::{self, Cut},
    pdu::{self, Length},
};
use crate::plant::{
    line::{Framing, LineDef},
    request_stats::RequestStats,
    time::elapsed,
    traffic::{Frame, FrameResult},
};

pub use follow::{Follower, Losses, events};
pub use heard::{Ended, Heard, HeardFrame, Role};
pub use traffic::{Traffic, silent_after};

/// Bytes in a row that are no frame are recorded in runs of at most this.
const NOISE_MAX: usize = ascii::FRAME_MAX;
/// Requests over TCP that wait for their responses at once; the oldest is given up for one more.
const OPEN_MAX: usize = 64;
/// The pieces of a frame may come so far apart over TCP.
const TCP_SILENCE: Duration = Duration::from_secs(1);
/// So long after a response nothing belongs to it any more.
const SETTLED: Duration = Duration::from_millis(50);

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
    answered: Option<Answered>,
    /// The last request, if it had a response and nothing else has come since.
    previous: Option<Vec<u8>>,
    /// The numbers of the last requests over TCP.
    transactions: VecDeque<u16>,
    evidence: Evidence,
    heard_until: Timestamp,
    now: Timestamp,
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
            answered: None,
            previous: None,
            transactions: VecDeque::new(),
            evidence: Evidence::new(line.timeout),
            heard_until: Timestamp::MAX,
            now: Timestamp::MIN,
            frames: 0,
            totals: Totals::default(),
            units: BTreeMap::new(),
        }
    }

    /// Takes bytes as they came.
    pub fn hear(&mut self, at: Timestamp, bytes: &[u8]) -> Vec<Heard> {
        let mut heard = self.rest(at);
        self.bytes.extend_from_slice(bytes);
        self.times.resize(self.bytes.len(), at);
        self.take_frames(false, &mut heard);
        heard
    }

    /// Nothing has come until now: what has begun before a silence has ended.
    pub fn rest(&mut self, at: Timestamp) -> Vec<Heard> {
        let mut heard = Vec::new();
        while let Some(silent) = self.silent_at().filter(|silent| *silent <= at) {
            self.now = silent;
            match self.bytes.is_empty() {
                true => self.settle(Next::Silence, &mut heard),
                false => self.take_frames(true, &mut heard),
            }
        }
        self.now = at;
        heard
    }

    /// When [`Listener::rest`] decides something, if nothing more comes.
    pub fn silent_at(&self) -> Option<Timestamp> {
        match self.times.last() {
            Some(last) => last.checked_add(self.silence).ok(),
            None => self.answered.as_ref().and_then(Answered::settled_at),
        }
    }

    /// Nothing more will come.
    pub fn end(&mut self) -> Vec<Heard> {
        let mut heard = Vec::new();
        self.take_frames(true, &mut heard);
        self.settle(Next::Other, &mut heard);
        heard
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
            match frame_boundaries::cut(self.framing, &self.bytes[self.noise..], asked, ended) {
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
        match frame_boundaries::of_unknown_functions(noise)
            .filter(|_| self.framing == Framing::Rtu && !noise.is_empty())
        {
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
        let (bytes, first, at) = self.split(self.noise);
        self.pause(first, at);
        self.noise = 0;
        self.noise(bytes, at, heard);
    }

    /// Something has come, from `first` to `at`.
    fn pause(&mut self, first: Timestamp, at: Timestamp) {
        if self.open.is_empty() {
            self.evidence.pause(elapsed(self.heard_until, first));
        }
        self.heard_until = at;
    }

    /// Takes a whole frame from the front of the bytes.
    fn take(&mut self, length: usize, heard: &mut Vec<Heard>) {
        let (bytes, first, at) = self.split(length);
        self.pause(first, at);
        let transaction = if self.framing == Framing::Mbap { u16::from_be_bytes([bytes[0], bytes[1]]) } else { 0 };
        let Ok(message) = frame::unwrap(self.framing, &bytes) else { return };
        let place = self.open.iter().position(|open| self.answers(open, transaction, &message, first));
        if let Some(open) = place.and_then(|place| self.open.remove(place)) {
            self.response(open, message, bytes, first, at, heard);
        } else if is_request(&message) {
            self.request(message, transaction, bytes, first, at, heard);
        } else {
            self.unmatched(&message, bytes, at, heard);
        }
    }

    /// Is this the response to an open request?
    fn answers(&self, open: &Open, transaction: u16, message: &[u8], first: Timestamp) -> bool {
        let asked = &open.message;
        if open.transaction != transaction || !fits(asked, message) {
            return false;
        }
        let echoes = pdu::function(message[1]).is_none_or(|function| function.echoes);
        // A master that repeats a request waits for its own timeout before.
        let patience = self.evidence.patience(message[0]).max(self.silence).min(self.timeout);
        let repeats = *asked == message && (!echoes || patience < elapsed(open.at, first));
        !repeats && (echoes || !is_request(message) || !self.evidence.is_usual(message))
    }

    fn frame(&mut self, at: Timestamp, sent: bool, bytes: Arc<[u8]>, result: FrameResult, role: Role) -> Heard {
        self.frames += 1;
        let unit = if role == Role::Noise { None } else { frame::unit_of(self.framing, &bytes) };
        let framing = self.framing;
        Heard::Frame(HeardFrame { frame: Frame { at, sent, bytes, framing, result, unit, number: self.frames }, role })
    }

    /// Takes bytes from the front, with the times of the first and of the last.
    fn split(&mut self, length: usize) -> (Vec<u8>, Timestamp, Timestamp) {
        let (first, at) = (self.times[0], self.times[length - 1]);
        self.times.drain(..length);
        (self.bytes.drain(..length).collect(), first, at)
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
