//! The link layer of one open port: whole frames out, checked answers in.
//!
//! ```text
//!  exchange(message) ────────┬─> wire    RTU, ASCII: check, silences, outstanding replies; one at a time
//!  submit(message), flush() ─┘           MBAP: transaction ids; several under way
//! ```

mod gaps;
mod outstanding;
mod raw;
mod receive;
mod signals;
mod transactions;

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;

pub use self::transactions::Ended;
use self::{receive::Received, transactions::Transactions};
use super::{
    clock::Clock,
    memory::LineMemory,
    transport::Opened,
    uart::{HeldSignal, PortWatch},
    wire::Wire,
};
use crate::{
    bus::frame,
    plant::{
        def::{Framing, LineDef, Protocol},
        fault::{Fault, FaultKind},
        line_state::LineCounters,
        line_trouble::LineTrouble,
        number::to_u32,
        traffic::{Exchange, Frame, FrameFault, FrameResult},
    },
};

/// Why a request could not be completed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinkError {
    /// The device or the line corrupted this request; the port is fine.
    Fault(Fault),
    /// The port or connection is gone.
    Gone(LineTrouble),
}

impl From<Fault> for LinkError {
    fn from(fault: Fault) -> Self {
        LinkError::Fault(fault)
    }
}

fn answers(counters: &LineCounters) -> u64 {
    counters.ok + counters.exceptions
}

/// The link on one open port.
pub struct Link {
    wire: Wire,
    /// Those under way over Modbus TCP.
    transactions: Transactions,
    /// The request under way: its caller may give it up.
    asked: Option<Vec<u8>>,
    /// The same over Modbus TCP.
    asked_id: Option<u16>,
    timeout: Duration,
    frame_timeout: Duration,
    turnaround: Duration,
    /// Units that are not to be asked before a moment.
    gaps: Vec<(u8, Instant)>,
    /// What the driver of the port counts and sees.
    watch: Option<PortWatch>,
    /// A signal that a test holds.
    held: Option<HeldSignal>,
    /// The adapter gives back what it sends.
    echoes: bool,
    /// Exchanges in a row to which nothing came back.
    pub unanswered: u32,
    /// What the last exchange was; `None` before the first since a caller has cleared it.
    pub last: Option<Arc<Exchange>>,
    /// Real time in which the line was busy.
    busy: Duration,
    /// Of the last exchange on a line without transaction ids.
    took: Duration,
    /// Answers before it was opened.
    answers_before: u64,
    /// Bytes may be delayed by a network.
    is_network: bool,
    /// What comes in one piece is one datagram.
    in_datagrams: bool,
}

impl Link {
    /// A link on a freshly opened port; `memory` goes on from an earlier opening.
    pub fn new(opened: Opened, line: &LineDef, clock: Clock, memory: LineMemory) -> Link {
        let watch = opened.watch;
        let wire = Wire::new(opened.stream, opened.pause, line, clock, memory);
        Link {
            transactions: Transactions::new(),
            asked: None,
            asked_id: None,
            gaps: Vec::new(),
            timeout: line.timeout,
            frame_timeout: wire.frame_timeout,
            turnaround: clock.real_span(line.turnaround),
            watch,
            held: None,
            echoes: false,
            unanswered: 0,
            last: None,
            busy: Duration::ZERO,
            took: Duration::ZERO,
            answers_before: answers(&wire.counters),
            is_network: line.transport.serial().is_none(),
            in_datagrams: line.transport.protocol() == Some(Protocol::Udp),
            wire,
        }
    }

    /// Answers since it was opened; an exception is one.
    pub fn answers(&self) -> u64 {
        answers(&self.wire.counters) - self.answers_before
    }

    /// Sends a message (unit and PDU) and gives the checked answer message. Sent once, never repeated.
    pub async fn exchange(&mut self, message: &[u8]) -> Result<Vec<u8>, LinkError> {
        if self.framing() == Framing::Mbap {
            return self.exchange_mbap(message).await;
        }
        // An answer proves that nothing older is to come only if it could not itself have been older.
        let proof = !self.wire.replies.is_ambiguous(message);
        let frame: Arc<[u8]> = frame::wrap(self.framing(), 0, message).into();
        let sent_at = self.send(message, &frame).await?;
        let started = Instant::now();
        self.note_sent(frame.clone());
        let mut received = match message.first() {
            Some(0) => Received::nothing(Ok(vec![])),
            _ => self.receive(message, &frame, sent_at).await?,
        };
        // Something unsolicited came meanwhile: this may be unsolicited too.
        if proof && received.answer.is_ok() && self.wire.replies.is_ambiguous(message) {
            received.answer = Err(Fault::OutOfSync);
        }
        self.asked = None;
        let took = started.elapsed();
        self.busy += took;
        self.took = self.wire.clock().plant_span(took);
        let rest = if message.first() == Some(&0) {
            sent_at.saturating_duration_since(Instant::now()) + self.turnaround
        } else {
            self.wire.silent_interval
        };
        self.wire.hold_off(rest);
        match &received.answer {
            Ok(answer) => {
                self.wire.counters.ok += 1;
                let age = self.wire.uptime();
                self.wire.replies.answered(message, answer, proof, age);
            }
            Err(fault) => self.count_fault(message, *fault),
        }
        self.note_silence(matches!(received.answer, Err(Fault::Timeout)));
        self.keep_request_gap(message, sent_at, &received.answer);
        self.remember_exchange(frame, received, sent_at).map_err(LinkError::Fault)
    }

    /// The caller of the exchange under way has given it up, for something that cannot wait. Its answer may still come.
    pub fn abandon(&mut self) {
        self.abandon_mbap();
        let Some(message) = self.asked.take() else { return };
        if self.framing() != Framing::Mbap && !message.is_empty() {
            self.wire.replies.failed(&message, self.wire.uptime());
        }
        self.wire.hold_off_after_sending(self.frame_timeout);
    }

    /// A stop is sent next: it waits for what is just coming in, not for what may still come.
    pub fn shorten_hold_off(&mut self) {
        self.wire.limit_hold_off(self.frame_timeout);
        let latest = Instant::now() + self.frame_timeout;
        self.gaps.iter_mut().for_each(|(_, until)| *until = (*until).min(latest));
    }

    /// Sends the frame of a message; until its answer is taken it may be given up.
    async fn send(&mut self, message: &[u8], frame: &[u8]) -> Result<Instant, LinkError> {
        self.keep_gap(message.first().copied());
        self.asked = Some(message.to_vec());
        self.wire.send(frame).await
    }

    /// How messages are framed.
    pub fn framing(&self) -> Framing {
        self.wire.framing()
    }

    /// Plant time of the last exchange on a line without transaction ids, from the first byte of the request to the last of
    /// the answer.
    pub fn took(&self) -> Duration {
        self.took
    }

    /// How long an answer may take.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Another response timeout from now on: a poll or a step of a diagnostic has its own.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Nothing is sent for this long (plant time), for devices that need it.
    pub fn hold_off_plant_time(&mut self, plant: Duration) {
        self.wire.hold_off(self.wire.clock().real_span(plant));
    }

    /// Takes what comes while nothing is sent. Returns when a request under way has ended, or an error when the port is gone.
    pub async fn listen(&mut self) -> Result<(), LinkError> {
        match self.framing() {
            Framing::Mbap => self.idle_mbap().await,
            Framing::Rtu | Framing::Ascii => Err(self.wire.listen().await),
        }
    }

    /// Asks the driver of the port what it has counted, and how its signals stand.
    pub fn look_at_port(&mut self) {
        self.wire.counters.uart = self.watch.as_ref().and_then(PortWatch::counters);
        self.wire.counters.signals = self.watch.as_ref().and_then(PortWatch::signals);
        self.wire.counters.echoes = self.echoes;
    }

    /// Totals of this line; `utilisation`, `opens` and `missed` are the task's.
    pub fn counters(&mut self) -> &mut LineCounters {
        &mut self.wire.counters
    }

    /// See [`Wire::take_unsolicited`].
    pub fn take_unsolicited(&mut self) -> Vec<u8> {
        self.wire.take_unsolicited()
    }

    /// See [`Wire::take_late`].
    pub fn take_late(&mut self) -> Vec<u8> {
        self.wire.take_late()
    }

    /// The frames since they were last taken, oldest first.
    pub fn take_frames(&mut self) -> Vec<Frame> {
        self.wire.take_frames()
    }

    /// What is remembered until the next opening.
    pub fn memory(&self) -> LineMemory {
        LineMemory { is_cut: self.asked.is_some(), ..self.wire.memory() }
    }

    fn note_silence(&mut self, silent: bool) {
        self.unanswered = if silent { self.unanswered.saturating_add(1) } else { 0 };
    }

    fn note_sent(&mut self, frame: Arc<[u8]>) {
        self.wire.counters.requests += 1;
        self.wire.record(true, frame, FrameResult::Sent);
    }

    fn remember_exchange(
        &mut self,
        request: Arc<[u8]>,
        received: Received,
        sent_at: Instant,
    ) -> Result<Vec<u8>, Fault> {
        self.last = Some(Arc::new(Exchange {
            at: self.wire.clock().to_utc(self.wire.clock().at(sent_at)),
            framing: self.framing(),
            request,
            answer: received.frame,
            outcome: received.answer.as_ref().map(drop).map_err(|fault| *fault),
            response_time: received.response_time,
            tries: 1,
        }));
        received.answer
    }

    /// Counts a fault. On a line without transaction ids the reply becomes outstanding, and the line pauses until the longest
    /// late frame has passed.
    fn count_fault(&mut self, message: &[u8], fault: Fault) {
        let Some(unit) = message.first() else { return };
        let mbap = self.framing() == Framing::Mbap;
        match fault.kind() {
            FaultKind::Exception(_) => {
                self.wire.counters.exceptions += 1;
                // An exception names no address: while a reply of the unit is outstanding, it may be the answer to an older request.
                if self.wire.replies.of(*unit).is_clear() {
                    return;
                }
                self.expect_late(message);
                self.wire.replies.refused(*unit, self.wire.uptime());
                return;
            }
            FaultKind::Timeout => self.wire.counters.timeouts += 1,
            FaultKind::Corrupt
            | FaultKind::OutOfSync
            | FaultKind::NotANumber
            | FaultKind::NotConnected
            | FaultKind::BackedOff
            | FaultKind::NotHeard
            | FaultKind::Unproven => self.wire.counters.corrupt += 1,
        }
        tracing::debug!(unit, request = %frame::hex(message), %fault, "a request failed");
        // Even what looked like a corrupt answer may have been noise, with the answer still on its way.
        if !mbap {
            self.expect_late(message);
        }
    }

    /// The answer to this message may still come: it is remembered, and the line stays silent until it would have passed.
    fn expect_late(&mut self, message: &[u8]) {
        self.wire.replies.failed(message, self.wire.uptime());
        let longest = frame::expected_length(self.wire.replies.request(message)).unwrap_or(frame::MESSAGE_MAX);
        let chars = to_u32(frame::wrapped_length(self.framing(), longest));
        self.wire.hold_off(self.wire.char_time * chars + self.wire.silent_interval);
    }
}
