//! Modbus TCP: several requests under way at once, identified by their transaction ids; no answer waits for a slower one.
//!
//! ```text
//!  submit ─> flush ─> under way ──answer──────────> ended ─> take_ended
//!                          └──────timeout─> given up ──late answer: dropped, its unit is noted
//! ```

mod busy;
mod under_way;

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;

pub use under_way::Transactions;
use under_way::{Owner, SHORT_WAIT, Transaction};

use super::{FrameFault, FrameResult, Link, LinkError};
use crate::{
    bus::frame,
    plant::{def::Framing, fault::Fault, line_trouble::LineTrouble, traffic::Exchange},
};

/// This many bytes that are no frame are shown.
const SHOWN_MAX: usize = 24;
/// Looked at again after this time at the latest.
const LOOK_AGAIN: Duration = Duration::from_secs(3_600);

/// A request with what came back.
#[derive(Debug, Clone)]
pub struct Ended {
    /// Its transaction id.
    pub id: u16,
    /// Unit and PDU of the answer, or why there is none.
    pub answer: Result<Vec<u8>, Fault>,
    /// When the answer came, or was given up.
    pub at: Instant,
    /// Both as they were on the wire.
    pub exchange: Arc<Exchange>,
}

impl Link {
    /// How many requests a unit takes at once, over Modbus TCP; one that wants a gap between them takes one.
    pub fn allow(&mut self, unit: u8, in_flight_max: u16) {
        let most = if self.wire.request_gaps.of(unit).is_zero() { in_flight_max.max(1) } else { 1 };
        self.transactions.limits[usize::from(unit)] = most;
    }

    /// From now on one request at a time is under way, or as many as the units take.
    pub fn set_alone(&mut self, alone: bool) {
        self.transactions.alone = alone;
    }

    /// May another request be sent, to this unit, beside those that are under way?
    pub fn has_room(&self, unit: u8) -> bool {
        self.transactions.has_room(unit)
    }

    /// Requests whose time was over, and whose answers may still come.
    pub fn late_awaited(&self) -> usize {
        self.transactions.given_up.iter().filter(|(_, unit)| unit.is_some()).count()
    }

    /// Is there no room for any other request?
    pub fn is_full(&self) -> bool {
        self.transactions.limit() <= self.transactions.under_way.len()
    }

    /// Is nothing of this unit under way, and room for a request to it?
    pub fn is_free(&self, unit: u8) -> bool {
        self.has_room(unit) && !self.transactions.under_way.iter().any(|request| request.is_to(unit))
    }

    /// Puts a message (unit and PDU) among those that the next [`Link::flush`] sends; gives its transaction id.
    pub fn submit(&mut self, message: &[u8], timeout: Duration) -> u16 {
        self.transactions.begin(message, timeout, Instant::now())
    }

    /// Sends what was submitted in one write, once the line has rested long enough.
    pub async fn flush(&mut self) -> Result<(), LinkError> {
        if self.transactions.outbox.is_empty() {
            return Ok(());
        }
        while let Some(rests_until) = self.wire.hold_off_until() {
            self.collect(rests_until).await?;
        }
        let bytes = std::mem::take(&mut self.transactions.outbox);
        if std::mem::replace(&mut self.transactions.sending, true) {
            return Err(LinkError::Gone(LineTrouble::RequestIncomplete));
        }
        let sent_at = self.wire.put(&bytes).await?;
        self.transactions.sending = false;
        self.transactions.busy_since.get_or_insert(sent_at);
        for place in 0..self.transactions.under_way.len() {
            let request = &mut self.transactions.under_way[place];
            if request.sent_at.is_none() {
                request.sent_at = Some(sent_at);
                let frame = request.frame.clone();
                self.note_sent(frame);
            }
        }
        Ok(())
    }

    /// Returns when a request has ended, or none is under way.
    pub async fn wait_for_answer(&mut self) -> Result<(), LinkError> {
        while self.transactions.ended.is_empty() && !self.transactions.under_way.is_empty() {
            self.collect(Instant::now() + LOOK_AGAIN).await?;
        }
        Ok(())
    }

    /// Receives unsolicited bytes; returns when a request has ended.
    pub(super) async fn idle_mbap(&mut self) -> Result<(), LinkError> {
        while self.transactions.ended.is_empty() {
            self.collect(Instant::now() + LOOK_AGAIN).await?;
        }
        Ok(())
    }

    /// The requests that have ended since this was last asked.
    pub fn take_ended(&mut self) -> Vec<Ended> {
        std::mem::take(&mut self.transactions.ended)
    }

    /// Sends a message and waits for its own answer; what else ends meanwhile is kept. Nothing else of the unit is under way.
    pub(super) async fn exchange_mbap(&mut self, message: &[u8]) -> Result<Vec<u8>, LinkError> {
        let unit = message.first().copied().unwrap_or_default();
        while !self.is_free(unit) {
            self.collect(Instant::now() + LOOK_AGAIN).await?;
        }
        while let Some(until) = self.gap_of(unit) {
            self.collect(until).await?;
        }
        let id = self.submit(message, self.timeout);
        self.asked_id = Some(id);
        self.flush().await?;
        loop {
            let ended = &mut self.transactions.ended;
            if let Some(place) = ended.iter().position(|ended| ended.id == id) {
                let Ended { answer, exchange, .. } = ended.remove(place);
                (self.asked_id, self.last) = (None, Some(exchange));
                return answer.map_err(LinkError::Fault);
            }
            self.collect(Instant::now() + LOOK_AGAIN).await?;
        }
    }

    /// Waits until nothing is under way; what ends meanwhile is kept.
    pub(super) async fn finish_all(&mut self) -> Result<(), LinkError> {
        while !self.transactions.under_way.is_empty() {
            self.collect(Instant::now() + LOOK_AGAIN).await?;
        }
        Ok(())
    }

    /// No request is waited for any longer; what was not sent is not sent. Whose answers come all the same is not late.
    pub fn give_up_all(&mut self) {
        self.transactions.give_up_all();
        self.close_busy(Instant::now());
    }

    /// The request under way is not waited for any longer.
    pub(super) fn abandon_mbap(&mut self) {
        let Some(id) = self.asked_id.take() else { return };
        if let Owner::UnderWay(request) = self.transactions.take(id) {
            self.transactions.give_up(&request);
            if request.sent_at.is_none() {
                self.transactions.outbox.clear();
            }
        }
        self.transactions.ended.retain(|ended| ended.id != id);
        self.close_busy(Instant::now());
    }

    /// Takes what comes until `until`, or until the first time for an answer is over. May be dropped while it waits.
    async fn collect(&mut self, until: Instant) -> Result<(), LinkError> {
        let deadlines = self.transactions.under_way.iter().filter_map(Transaction::deadline);
        let until =
            deadlines.chain(self.transactions.short_since.map(|since| since + SHORT_WAIT)).fold(until, Instant::min);
        if self.wire.receive(until, &mut self.transactions.inbox).await? {
            // What stands behind an answer shows whether it was one.
            if !self.in_datagrams {
                self.wire.receive_waiting(&mut self.transactions.inbox);
            }
            self.take_frames_mbap()?;
        } else if self.transactions.short_since.is_some() {
            self.take_frames_mbap()?;
        }
        let now = Instant::now();
        let expired = self.transactions.expire(now);
        if !expired.is_empty() && self.transactions.is_cut_short() {
            self.wire.record(false, self.transactions.inbox[..].into(), FrameResult::Wrong(FrameFault::CutShort));
            // The rest may come later and would stand before the next header.
            return Err(LinkError::Gone(LineTrouble::ResponseIncomplete));
        }
        for request in expired {
            let fault = request.fault;
            if fault == Fault::Timeout && self.transactions.silence_at <= request.sent_at {
                (self.transactions.silence_at, self.unanswered) = (Some(now), self.unanswered.saturating_add(1));
            }
            let ended = self.end(request, Err(fault), Arc::default(), now);
            self.transactions.ended.push(ended);
        }
        self.close_busy(now);
        Ok(())
    }

    /// Assigns the whole frames that have come to their requests. If what stands behind them is no header, none of them is an
    /// answer: each may be a piece of something else. No datagram goes on with another.
    fn take_frames_mbap(&mut self) -> Result<(), LinkError> {
        let (mut bytes, now) = (std::mem::take(&mut self.transactions.inbox), Instant::now());
        let (frames, end) = self.transactions.cut(&bytes, self.in_datagrams, now);
        if frame::is_out_of_sync(&bytes[end..]) {
            let why = no_frame(&bytes[end..]);
            self.wire.record(false, bytes.into(), FrameResult::Wrong(FrameFault::NoHeader));
            return if self.in_datagrams { Ok(()) } else { Err(LinkError::Gone(why)) };
        }
        for (transaction, range) in frames {
            let frame = &bytes[range];
            match self.transactions.take(transaction) {
                Owner::Unknown => {
                    self.transactions.note_strange(transaction, &frame[6..]);
                    self.wire.drop_unexpected(frame);
                }
                Owner::Late(unit) => {
                    self.wire.drop_late(unit, frame);
                    // It is slower than it was: what else it was asked has the whole timeout.
                    let others = self.transactions.under_way.iter_mut().filter(|request| request.is_to(unit));
                    others.for_each(|request| request.timeout = request.timeout.max(self.timeout));
                }
                Owner::UnderWay(request) => {
                    let answer = frame[6..].to_vec();
                    let asked = self.wire.replies.request(&request.message);
                    let answer = frame::check_answer(Framing::Mbap, asked, &answer).map(|()| answer);
                    self.unanswered = 0;
                    let behind = self.transactions.under_way.iter_mut();
                    behind.filter(|other| request.sent_at <= other.sent_at).for_each(|other| other.begun_at = now);
                    let ended = self.end(request, answer, frame.into(), now);
                    self.transactions.ended.push(ended);
                }
            }
        }
        bytes.drain(..end);
        if self.in_datagrams && !bytes.is_empty() {
            self.transactions.note_cut_short(&bytes);
            self.wire.record(false, bytes.into(), FrameResult::Wrong(FrameFault::CutShort));
        } else {
            self.transactions.inbox = bytes;
        }
        Ok(())
    }

    /// Counts and records how a request has ended.
    fn end(&mut self, request: Transaction, answer: Result<Vec<u8>, Fault>, frame: Arc<[u8]>, now: Instant) -> Ended {
        let sent_at = request.sent_at.unwrap_or(now);
        match &answer {
            Ok(_) => self.wire.counters.ok += 1,
            Err(fault) => self.count_fault(&request.message, *fault),
        }
        let response_time = (!frame.is_empty()).then(|| now.saturating_duration_since(sent_at));
        if response_time.is_some() {
            let result = match &answer {
                Ok(_) | Err(Fault::Exception(_)) => FrameResult::Good,
                Err(fault) => FrameResult::Wrong(FrameFault::NoResponse(*fault)),
            };
            self.wire.record(false, frame.clone(), result);
        }
        self.wire.hold_off(self.wire.silent_interval);
        self.keep_request_gap(&request.message, sent_at, &answer);
        let exchange = Exchange {
            at: self.wire.clock().to_utc(self.wire.clock().at(sent_at)),
            framing: Framing::Mbap,
            request: request.frame,
            answer: frame,
            outcome: answer.as_ref().map(drop).map_err(|fault| *fault),
            response_time,
            tries: 1,
        };
        Ended { id: request.id, answer, at: now, exchange: Arc::new(exchange) }
    }
}

/// What came that is no frame, as text where it is text.
fn no_frame(bytes: &[u8]) -> LineTrouble {
    let shown = &bytes[..bytes.len().min(SHOWN_MAX)];
    let is_text = shown.iter().all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace());
    let words = if is_text { format!("text `{}`", String::from_utf8_lossy(shown).trim()) } else { frame::hex(shown) };
    LineTrouble::NoFrame(words)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
