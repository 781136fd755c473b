//! Which response belongs to which request, and how requests end.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    Listener, NOISE_MAX, OPEN_MAX, SETTLED,
    evidence::{GLITCH_MAX, Pair, Verdict},
    heard::{Ended, Heard, Role},
};
use crate::{
    bus::{
        frame, framing,
        pdu::{self},
    },
    plant::{
        fault::Fault,
        line::Framing,
        time::elapsed,
        traffic::{FrameFault, FrameResult},
    },
};

/// A request that has no response yet.
#[derive(Debug)]
pub(super) struct Open {
    pub message: Vec<u8>,
    /// Over TCP; and whether no other request near it has this number.
    pub transaction: u16,
    numbered: bool,
    pub at: Timestamp,
    /// The first frame of all: its response may have been before the first byte heard.
    first: bool,
    /// What has come since in place of its response; how many bytes of anything, and of what is no frame.
    noise: Vec<u8>,
    strange: usize,
    broken: usize,
}

impl Open {
    fn add_noise(&mut self, bytes: &[u8]) {
        let room = NOISE_MAX.saturating_sub(self.noise.len());
        self.noise.extend(bytes.iter().take(room));
    }
}

/// A request and the response behind it, until it is known whether they belong together.
#[derive(Debug)]
pub(super) struct Answered {
    open: Open,
    message: Vec<u8>,
    bytes: Arc<[u8]>,
    first: Timestamp,
    at: Timestamp,
    /// It may be the late response to an earlier request.
    late: bool,
    /// Bytes behind it that are no frame.
    noise: usize,
    /// A silence behind it has proved nothing.
    waits: bool,
}

impl Answered {
    fn pair(&self) -> Pair<'_> {
        let Answered { open, message, first, at, .. } = self;
        let noise = open.strange;
        Pair { request: &open.message, response: message, asked_at: open.at, first: *first, at: *at, noise }
    }

    /// When a silence tells what it can.
    pub fn settled_at(&self) -> Option<Timestamp> {
        self.at.checked_add(SETTLED).ok().filter(|_| !self.waits)
    }
}

/// What comes behind a response.
#[derive(Debug, Clone, Copy)]
pub(super) enum Next<'a> {
    Silence,
    Request(&'a [u8]),
    /// A frame that has nothing to do with it.
    Other,
    /// Something that may be the rest of it, or another response to the same request.
    Doubt,
}

impl Listener {
    /// Says what is known of the last response, by what came next; after a mere silence perhaps nothing yet.
    pub(super) fn settle(&mut self, next: Next, heard: &mut Vec<Heard>) {
        let Some(mut answered) = self.answered.take() else { return };
        let verdict = match next {
            Next::Doubt => Verdict::Open,
            _ if answered.late => Verdict::Open,
            _ if answered.open.numbered => Verdict::Proven,
            Next::Request(request) => self.evidence.judge(&answered.pair(), Some(request)),
            Next::Silence | Next::Other => self.evidence.judge(&answered.pair(), None),
        };
        let is_beside = matches!(next, Next::Request(_) | Next::Other) && answered.open.strange == 0;
        // A refusal would take the value away.
        let may_be_its_own = is_beside && !answered.late && answered.message.get(1).is_some_and(|code| *code < 0x80);
        let verdict = if verdict == Verdict::Open && may_be_its_own { Verdict::Unproven } else { verdict };
        if verdict == Verdict::Open && matches!(next, Next::Silence) {
            answered.waits = true;
            self.answered = Some(answered);
        } else {
            heard.push(self.end_answered(answered, verdict));
        }
    }

    fn end_answered(&mut self, answered: Answered, verdict: Verdict) -> Heard {
        let pair = answered.pair();
        let checked = frame::check_answer(self.framing, pair.request, pair.response);
        let outcome = match verdict {
            Verdict::Proven => checked,
            Verdict::Unproven => checked.and(Err(Fault::Unproven)),
            Verdict::Open => Err(Fault::NotHeard),
        };
        let time = response_time(&answered.open, pair.first);
        self.units.entry(pair.request[0]).or_default().count(outcome, time);
        self.evidence.answer(&pair, verdict == Verdict::Proven, answered.late);
        let (at, held) = (answered.at, elapsed(answered.at, self.now));
        let (request, response, framing) = (answered.open.message, Some(answered.bytes), self.framing);
        Heard::Ended(Ended { at, held, framing, request, response, time, outcome })
    }

    pub(super) fn request(
        &mut self,
        message: Vec<u8>,
        transaction: u16,
        bytes: Vec<u8>,
        first: Timestamp,
        at: Timestamp,
        heard: &mut Vec<Heard>,
    ) {
        self.settle(Next::Request(&message), heard);
        let previous = self.previous.take();
        let most = if self.framing == Framing::Mbap { OPEN_MAX } else { 1 };
        // The same number again, or no room for one more.
        let reused = self.open.iter().position(|open| open.transaction == transaction);
        let given_up = reused.or((self.open.len() == most).then_some(0)).and_then(|place| self.open.remove(place));
        given_up.into_iter().for_each(|open| self.lose(open, first, at, heard));
        self.totals.requests += 1;
        self.evidence.ask(&message, first, previous.as_deref());
        let numbered = !self.transactions.is_empty() && !self.transactions.contains(&transaction);
        if self.framing == Framing::Mbap {
            self.transactions.push_back(transaction);
            self.transactions.drain(..self.transactions.len().saturating_sub(OPEN_MAX));
        }
        let is_first = self.frames == 0;
        heard.push(self.frame(at, true, bytes.into(), FrameResult::Sent, Role::Request));
        if message[0] == 0 && self.framing != Framing::Mbap {
            self.units.entry(0).or_default().requests += 1;
        } else {
            let noise = Vec::new();
            self.open.push_back(Open {
                message,
                transaction,
                numbered,
                at,
                first: is_first,
                noise,
                strange: 0,
                broken: 0,
            });
        }
    }

    /// A request has ended without a good response: the next began at `first`.
    fn lose(&mut self, open: Open, first: Timestamp, at: Timestamp, heard: &mut Vec<Heard>) {
        if open.first {
            return;
        }
        let gave_up = self.evidence.miss(&open.message, elapsed(open.at, first), self.is_response_damaged(&open));
        let fault = match self.left_over(&open.message, &open.noise) {
            Fault::Timeout if !gave_up => Fault::NotHeard,
            fault => fault,
        };
        if fault == Fault::NotHeard {
            self.evidence.lose();
        }
        self.units.entry(open.message[0]).or_default().count(Err(fault), None);
        let (held, framing) = (elapsed(at, self.now), self.framing);
        let (request, response, time, outcome) = (open.message, None, None, Err(fault));
        heard.push(Heard::Ended(Ended { at, held, framing, request, response, time, outcome }));
    }

    /// Is what came behind a request, and is no frame, as long as most of its response?
    fn is_response_damaged(&self, open: &Open) -> bool {
        let expected = frame::expected_length(&open.message).map(|length| frame::wrapped_length(self.framing, length));
        expected.is_some_and(|expected| 3 * expected <= 4 * open.broken)
    }

    /// Names what came in place of a response.
    fn left_over(&self, asked: &[u8], bytes: &[u8]) -> Fault {
        // More noise may stand behind a corrupt response.
        let whole = pdu::response_length(bytes).known().filter(|_| self.framing == Framing::Rtu);
        let bytes = whole.and_then(|length| bytes.get(..length + 2)).unwrap_or(bytes);
        framing::left_over(self.framing, asked, bytes)
    }

    pub(super) fn response(
        &mut self,
        open: Open,
        message: Vec<u8>,
        bytes: Vec<u8>,
        first: Timestamp,
        at: Timestamp,
        heard: &mut Vec<Heard>,
    ) {
        self.settle(Next::Other, heard);
        self.totals.responses += 1;
        let late = !open.numbered && self.evidence.is_late(&open.message, &message);
        self.previous = Some(open.message.clone()).filter(|_| open.strange <= GLITCH_MAX);
        let role = Role::Response { request: open.message.clone(), time: response_time(&open, first) };
        let bytes: Arc<[u8]> = bytes.into();
        heard.push(self.frame(at, false, bytes.clone(), FrameResult::Good, role));
        self.answered = Some(Answered { open, message, bytes, first, at, late, noise: 0, waits: false });
    }

    pub(super) fn unmatched(&mut self, message: &[u8], bytes: Vec<u8>, at: Timestamp, heard: &mut Vec<Heard>) {
        self.totals.unmatched += 1;
        self.units.entry(message[0]).or_default().late += 1;
        self.evidence.answer_late(message[0], at);
        // A frame that came twice is no other response.
        if self.answered.as_ref().is_none_or(|answered| answered.message != message) {
            let of_unit = |answered: &Answered| !answered.open.numbered && answered.open.message[0] == message[0];
            let in_doubt = self.answered.as_ref().is_some_and(of_unit);
            self.settle(if in_doubt { Next::Doubt } else { Next::Other }, heard);
            self.previous = None;
            self.evidence.lose();
        }
        // Late ones come, or this one in the place of one and after a request that were both lost.
        if !self.open.is_empty() && self.framing != Framing::Mbap {
            self.evidence.hide();
        }
        // It may be a wrong response to the open request.
        if let Some(open) = self.open.front_mut() {
            open.strange += bytes.len();
            if open.message[0] == message[0] {
                open.add_noise(&bytes);
            }
        }
        let result = FrameResult::Wrong(FrameFault::WithoutRequest);
        heard.push(self.frame(at, false, bytes.into(), result, Role::Unmatched));
    }

    /// Bytes that are no frame.
    pub(super) fn noise(&mut self, bytes: Vec<u8>, at: Timestamp, heard: &mut Vec<Heard>) {
        self.totals.noise_bytes += bytes.len() as u64;
        self.totals.noise_runs += 1;
        if GLITCH_MAX < bytes.len() {
            self.previous = None;
            self.evidence.lose();
        }
        if let Some(answered) = &mut self.answered {
            answered.noise += bytes.len();
            // A header without check is misread when bytes before it were lost.
            if GLITCH_MAX < answered.noise || self.framing == Framing::Mbap {
                self.settle(Next::Doubt, heard);
            }
        }
        let unit = frame::unit_of(self.framing, &bytes);
        let why = match self.open.front().filter(|open| unit == open.message.first().copied()) {
            Some(open) => FrameFault::NoResponse(self.left_over(&open.message, &bytes)),
            None => FrameFault::NoFrame,
        };
        if let Some(open) = self.open.front_mut() {
            open.add_noise(&bytes);
            open.strange += bytes.len();
            open.broken += bytes.len();
        }
        heard.push(self.frame(at, false, bytes.into(), FrameResult::Wrong(why), Role::Noise));
    }
}

/// `None` if both came at once.
fn response_time(open: &Open, first: Timestamp) -> Option<Duration> {
    Some(elapsed(open.at, first)).filter(|time| !time.is_zero())
}
