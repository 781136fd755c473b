//! The link layer of one open port: whole frames out, checked answers in.
//!
//! ```text
//!  call(Request) ─> tokio-modbus ─> pipe ─> message ─┐
//!  exchange(message) ────────────────────────────────┼─> wire    RTU, ASCII: check, silences, debts; one at a time
//!  exchange_all(messages) ───────────────────────────┘           MBAP: transaction ids; several under way
//! ```
//!
//! PDUs are made and read by tokio-modbus, with a fresh context for every request on one end of a pipe; what travels on
//! the port is ours.

use std::{borrow::Cow, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    time::Instant,
};
use tokio_modbus::{
    Request, Response,
    bytes::Bytes,
    client::{Client, rtu},
    slave::Slave,
};

use super::{
    clock::Clock,
    transport::{CountUart, Opened},
    wire::{Memory, Wire},
};
use crate::{
    bus::{
        debt::Debt,
        frame::{self, Mbap, Shape},
        gather::{self, Verdict},
    },
    plant::{
        def::{Framing, LineDef},
        event::{ExceptionCode, Fault, LineCounters},
        traffic::{Exchange, Frame},
    },
};

/// Characters of an ASCII frame may be this far apart (Modbus over serial line V1.02, 2.5.2.1).
const ASCII_PAUSE: Duration = Duration::from_secs(1);
/// Most bytes gathered for one answer, noise included; more is no Modbus.
const GATHER_MAX: usize = 4_096;

/// Why a request could not be completed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// The device or the line spoiled this request; the port is fine.
    Fault(Fault),
    /// The port or connection is gone, in the words of the system.
    Gone(String),
}

impl From<Fault> for Trouble {
    fn from(fault: Fault) -> Self {
        Trouble::Fault(fault)
    }
}

/// A request with what came back; the message of a good answer is in `answer`.
#[derive(Debug, Clone)]
pub struct Answered {
    /// Unit and PDU of the answer, or why there is none.
    pub answer: Result<Vec<u8>, Fault>,
    /// Both as they were on the wire.
    pub exchange: Arc<Exchange>,
}

/// The link on one open port.
pub struct Link {
    wire: Wire,
    transaction: u16,
    timeout: Duration,
    idle: Duration,
    turnaround: Duration,
    /// What the driver of the port counts.
    uart: Option<CountUart>,
    /// The adapter gives back what it sends.
    echoes: bool,
    /// Exchanges in a row to which nothing came back.
    pub unanswered: u32,
    /// What the last exchange was; `None` before the first.
    pub last: Option<Arc<Exchange>>,
    /// Real time in which the line was busy.
    pub busy: Duration,
}

impl Link {
    /// A link on a freshly opened port; `memory` goes on from an earlier opening.
    pub fn new(opened: Opened, line: &LineDef, clock: Clock, memory: Memory) -> Link {
        let uart = opened.uart;
        let wire = Wire::new(opened.stream, opened.pause, line, clock, memory);
        Link {
            transaction: 0,
            timeout: line.timeout,
            idle: wire.silence.max(line.idle),
            turnaround: clock.real_span(line.turnaround),
            uart,
            echoes: false,
            unanswered: 0,
            last: None,
            busy: Duration::ZERO,
            wire,
        }
    }

    /// Sends a request through tokio-modbus and gives the answer; an exception is a [`Fault::Exception`].
    pub async fn call(&mut self, unit: u8, request: Request<'_>) -> Result<Response, Trouble> {
        let (ours, theirs) = tokio::io::duplex(2 * frame::MESSAGE_MAX);
        let mut context = rtu::attach_slave(theirs, Slave(unit));
        let (answer, done) = tokio::join!(context.call(request), self.carry(ours));
        done?;
        if unit == 0 && self.framing() != Framing::Mbap {
            // A broadcast: nobody answers, so there is nothing to read.
            return Ok(Response::Custom(0, Bytes::new()));
        }
        match answer {
            Ok(Ok(response)) => Ok(response),
            Ok(Err(code)) => Err(Fault::Exception(ExceptionCode(code.into())).into()),
            // The frame was whole and checked, so its content is what the other side got wrong.
            Err(error) => {
                tracing::warn!(unit, %error, "an answer that cannot be read");
                Err(Fault::WrongEcho.into())
            }
        }
    }

    /// Takes one frame from the pipe, exchanges its message over the port, hands the answer back. On trouble the pipe is
    /// dropped, which ends the waiting on its other end.
    async fn carry(&mut self, mut pipe: DuplexStream) -> Result<(), Trouble> {
        let mut frame = vec![0; 2 * frame::MESSAGE_MAX];
        let count = pipe.read(&mut frame).await.unwrap_or(0);
        let message = frame::without_crc(&frame[..count])?.to_vec();
        let answer = self.exchange(&message).await?;
        // A pipe that is no longer listened to is the business of the caller.
        let _ = pipe.write_all(&frame::with_crc(&answer)).await;
        Ok(())
    }

    /// Sends a message (unit and PDU) and gives the checked answer message. Sent once, never repeated.
    pub async fn exchange(&mut self, message: &[u8]) -> Result<Vec<u8>, Trouble> {
        if self.framing() == Framing::Mbap {
            let mut answers = self.exchange_all(&[message]).await?;
            let answered = answers.pop().map_or(Err(Fault::Timeout), |answered| answered.answer);
            return answered.map_err(Trouble::Fault);
        }
        // An answer proves that nothing older is to come only if it could not itself have been older.
        let proof = !self.wire.debts.is_ambiguous(message);
        let frame = frame::wrap(self.framing(), 0, message);
        let sent_at = self.wire.send(&frame).await?;
        let started = Instant::now();
        self.note_sent(frame.clone());
        let gathered = match message.first() {
            Some(0) => Gathered::nothing(Ok(vec![])),
            _ => self.gather(message, &frame, sent_at).await?,
        };
        self.busy += started.elapsed();
        let rest = if message.first() == Some(&0) {
            sent_at.saturating_duration_since(Instant::now()) + self.turnaround
        } else {
            self.wire.silence
        };
        self.wire.rest(rest);
        match &gathered.answer {
            Ok(_) => {
                self.wire.counters.ok += 1;
                if let Some(unit) = message.first().filter(|_| proof) {
                    self.wire.debts.clear(*unit);
                }
            }
            Err(fault) => self.account(message, *fault),
        }
        self.note_silence(matches!(gathered.answer, Err(Fault::Timeout)));
        self.keep(frame, gathered).answer.map_err(Trouble::Fault)
    }

    /// Sends several messages at once over Modbus TCP and gives their answers in the same order: they may overtake each
    /// other on the way. `Err` only when the connection is gone or out of step.
    pub async fn exchange_all(&mut self, messages: &[&[u8]]) -> Result<Vec<Answered>, Trouble> {
        let first = self.transaction.wrapping_add(1);
        let mut frames = Vec::with_capacity(messages.len());
        for message in messages {
            self.transaction = self.transaction.wrapping_add(1);
            frames.push(frame::with_mbap(self.transaction, message));
        }
        let sent_at = self.wire.send(&frames.concat()).await?;
        for frame in &frames {
            self.note_sent(frame.clone());
        }
        let gathered = self.gather_mbap(messages, first, sent_at).await?;
        self.busy += sent_at.elapsed();
        self.wire.rest(self.wire.silence);
        self.note_silence(gathered.iter().all(|gathered| matches!(gathered.answer, Err(Fault::Timeout))));
        let mut answers = Vec::with_capacity(messages.len());
        for ((message, frame), gathered) in messages.iter().zip(frames).zip(gathered) {
            match &gathered.answer {
                Ok(_) => self.wire.counters.ok += 1,
                Err(fault) => self.account(message, *fault),
            }
            answers.push(self.keep(frame, gathered));
        }
        Ok(answers)
    }

    /// Sends bytes as they are and gives everything that comes back until the line is silent: for tests of the line.
    pub async fn send_raw(&mut self, bytes: &[u8]) -> Result<(Vec<u8>, Option<Duration>), Trouble> {
        let sent_at = self.wire.send(bytes).await?;
        self.note_sent(bytes.to_vec());
        let deadline = sent_at + self.timeout + self.wire.char_time * frame::MESSAGE_MAX as u32;
        let framing = self.framing();
        let request = frame::unwrap(framing, bytes).unwrap_or_default();
        let proof = framing != Framing::Mbap && !self.wire.debts.is_ambiguous(&request);
        let (mut buffer, mut reply) = (Vec::new(), None);
        let mut until = deadline;
        let answered = loop {
            if !self.wire.receive(until, &mut buffer).await? || GATHER_MAX <= buffer.len() {
                break false;
            }
            reply.get_or_insert(Instant::now().saturating_duration_since(sent_at));
            // A request is answered by one frame; what follows bytes that are none only silence tells.
            match gather::verdict(framing, &request, &buffer) {
                Verdict::Answer(_) if framing != Framing::Mbap && !request.is_empty() => break true,
                _ if request.is_empty() => until = (Instant::now() + self.idle).min(deadline),
                _ => {}
            }
        };
        if !buffer.is_empty() {
            self.wire.record(false, buffer.clone(), Cow::Borrowed("received"));
        }
        self.wire.rest(self.wire.silence);
        // What was sent may have been a request whose answer is still to come.
        if framing != Framing::Mbap && !request.is_empty() && !(answered && proof) {
            self.owe(&request);
        }
        Ok((buffer, reply))
    }

    /// How messages are framed.
    pub fn framing(&self) -> Framing {
        self.wire.framing()
    }

    /// Could the answer to this message be mistaken for one that its unit still owes?
    pub fn is_ambiguous(&self, message: &[u8]) -> bool {
        self.framing() != Framing::Mbap && self.wire.debts.is_ambiguous(message)
    }

    /// How long an answer may take.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Another time from now on, for a tool in a hurry.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// What a unit owes.
    pub fn debt(&self, unit: u8) -> &Debt {
        self.wire.debts.of(unit)
    }

    /// Brings a unit into step by a loopback, where no read can: after it nothing older can come any more.
    pub async fn loopback(&mut self, unit: u8) -> Result<(), Trouble> {
        let proves = self.debt(unit).refusal_proves();
        let loopback = self.wire.debts.next_loopback(unit);
        match self.exchange(&loopback).await {
            Ok(_) => Ok(()),
            Err(Trouble::Fault(Fault::Exception(_))) if proves => {
                self.wire.debts.clear(unit);
                Ok(())
            }
            // It may be the answer to an earlier loopback: the unit is alive, but not in step.
            Err(Trouble::Fault(Fault::Exception(_))) => Err(Fault::Timeout.into()),
            Err(trouble) => Err(trouble),
        }
    }

    /// See [`crate::bus::debt::Debts::forget`].
    pub fn forget_debt(&mut self, unit: u8) -> Option<Duration> {
        self.wire.debts.forget(unit, self.wire.age())
    }

    /// Nothing is sent for this long (plant time), for devices that need it.
    pub fn rest(&mut self, plant: Duration) {
        self.wire.rest(self.wire.clock().real_span(plant));
    }

    /// Reads and drops what comes while nobody has asked; returns only when the port is gone.
    pub async fn idle(&mut self) -> String {
        self.wire.idle().await
    }

    /// Asks the driver of the port what it has counted.
    pub fn count_uart(&mut self) {
        self.wire.counters.uart = self.uart.as_ref().and_then(|uart| uart());
        self.wire.counters.echoes = self.echoes;
    }

    /// Totals of this line; `utilisation`, `opens` and `missed` are the task's.
    pub fn counters(&mut self) -> &mut LineCounters {
        &mut self.wire.counters
    }

    /// The frames since they were last taken, oldest first.
    pub fn take_frames(&mut self) -> Vec<Frame> {
        self.wire.take_frames()
    }

    /// What is remembered until the next opening.
    pub fn memory(&self) -> Memory {
        self.wire.memory()
    }

    fn note_silence(&mut self, silent: bool) {
        self.unanswered = if silent { self.unanswered.saturating_add(1) } else { 0 };
    }

    fn note_sent(&mut self, frame: Vec<u8>) {
        self.wire.counters.requests += 1;
        self.wire.record(true, frame, Cow::Borrowed("sent"));
    }

    fn keep(&mut self, request: Vec<u8>, gathered: Gathered) -> Answered {
        let took = Duration::from_secs_f64(gathered.took.as_secs_f64() * self.wire.clock().speed());
        let now = self.wire.clock().now();
        let exchange = Arc::new(Exchange {
            at: now.checked_sub(took).unwrap_or(now),
            framing: self.framing(),
            request,
            answer: gathered.frame,
            outcome: gathered.answer.as_ref().map(drop).map_err(|fault| *fault),
            reply: gathered.reply,
            tries: 1,
        });
        self.last = Some(exchange.clone());
        Answered { answer: gathered.answer, exchange }
    }

    /// Gathers until a frame has come that answers the message. Whole frames that do not (another unit, an owed answer)
    /// are dropped, and waiting goes on inside the same deadline.
    async fn gather(&mut self, message: &[u8], sent: &[u8], sent_at: Instant) -> Result<Gathered, Trouble> {
        let framing = self.framing();
        let mut echo = self.expects_echo(message).then_some(sent);
        let longest = frame::shape_of(message).map_or(frame::MESSAGE_MAX, Shape::length);
        let deadline = sent_at + self.timeout + self.wire.char_time * frame::wrapped_length(framing, longest) as u32;
        let mut buffer: Vec<u8> = Vec::new();
        // What came and did not fit: it names the fault if nothing better comes.
        let mut misfit: Option<Fault> = None;
        let mut reply = None;
        loop {
            // An adapter that gives back what it sends: its echo is no answer, however much it looks like one.
            if let Some(sent) = echo.filter(|sent| buffer.starts_with(sent)) {
                self.wire.record(false, buffer.drain(..sent.len()).collect(), Cow::Borrowed("echo of the adapter"));
                (self.echoes, echo) = (true, None);
            }
            let echo_begun = self.echoes && echo.is_some_and(|sent| sent.starts_with(&buffer));
            let verdict = if echo_begun { Verdict::Nothing } else { gather::verdict(framing, message, &buffer) };
            let wait_until = match verdict {
                Verdict::Answer(range) => {
                    self.wire.drop_stale(&buffer[..range.start]);
                    let frame = buffer[range].to_vec();
                    self.wire.record(false, frame.clone(), Cow::Borrowed("ok"));
                    let answer = frame::unwrap(framing, &frame)
                        .and_then(|answer| frame::check_answer(message, &answer).map(|()| answer));
                    return Ok(Gathered { answer, frame, reply, took: sent_at.elapsed() });
                }
                Verdict::Foreign(end, fault) => {
                    self.wire.drop_stale(&buffer[..end]);
                    buffer.drain(..end);
                    misfit = Some(fault);
                    continue;
                }
                // Nothing, or noise: the answer may still come.
                Verdict::Nothing => deadline,
                // The frame may still grow, or it is spoiled; silence decides.
                Verdict::Begun if framing == Framing::Ascii => (Instant::now() + ASCII_PAUSE).min(deadline),
                Verdict::Begun | Verdict::Spoiled(_) => (Instant::now() + self.idle).min(deadline),
            };
            if self.wire.receive(wait_until, &mut buffer).await? && buffer.len() <= GATHER_MAX {
                reply.get_or_insert(Instant::now().saturating_duration_since(sent_at));
                continue;
            }
            let fault = match verdict {
                Verdict::Spoiled(fault) => fault,
                _ => misfit.unwrap_or_else(|| gather::left_over(framing, message, &buffer)),
            };
            if !buffer.is_empty() {
                self.wire.record(false, buffer.clone(), Cow::Owned(fault.to_string()));
            }
            return Ok(Gathered { answer: Err(fault), frame: buffer, reply, took: sent_at.elapsed() });
        }
    }

    /// Gathers the answers to the transactions that begin with `first`; others are late answers and are dropped.
    async fn gather_mbap(
        &mut self,
        messages: &[&[u8]],
        first: u16,
        sent_at: Instant,
    ) -> Result<Vec<Gathered>, Trouble> {
        let deadline = sent_at + self.timeout;
        let mut gathered: Vec<Option<Gathered>> = vec![None; messages.len()];
        let (mut buffer, mut start, mut open): (Vec<u8>, usize, usize) = (Vec::new(), 0, messages.len());
        while 0 < open {
            match frame::mbap(&buffer[start..]) {
                Mbap::Incomplete => {
                    buffer.drain(..start);
                    start = 0;
                    if self.wire.receive(deadline, &mut buffer).await? {
                        continue;
                    }
                    if !buffer.is_empty() {
                        self.wire.record(false, buffer, Cow::Borrowed("cut short"));
                        // The rest may come later and would stand before the next header.
                        return Err(Trouble::Gone("an answer was cut short, the stream is out of step".into()));
                    }
                    break;
                }
                Mbap::Broken => {
                    self.wire.record(false, buffer.split_off(start), Cow::Borrowed("no MBAP header"));
                    return Err(Trouble::Gone("the stream is out of step".into()));
                }
                Mbap::Whole { transaction, end } => {
                    let frame = buffer[start..start + end].to_vec();
                    start += end;
                    let index = usize::from(transaction.wrapping_sub(first));
                    let Some(slot) = gathered.get_mut(index).filter(|slot| slot.is_none()) else {
                        self.wire.drop_stale(&frame);
                        continue;
                    };
                    let answer = frame[6..].to_vec();
                    let answer = frame::check_answer(messages[index], &answer).map(|()| answer);
                    let took = sent_at.elapsed();
                    open -= 1;
                    let verdict = match &answer {
                        Ok(_) | Err(Fault::Exception(_)) => Cow::Borrowed("ok"),
                        Err(fault) => Cow::Owned(fault.to_string()),
                    };
                    *slot = Some(Gathered { answer, frame: frame.clone(), reply: Some(took), took });
                    self.wire.record(false, frame, verdict);
                }
            }
        }
        // What stands behind the last answer nobody has asked for.
        self.wire.drop_stale(&buffer[start..]);
        let missing = || Gathered { took: sent_at.elapsed(), ..Gathered::nothing(Err(Fault::Timeout)) };
        Ok(gathered.into_iter().map(|slot| slot.unwrap_or_else(missing)).collect())
    }

    /// Counts a fault. On a line without transaction ids the unit owes the answer, and the line rests until the longest
    /// late frame has passed.
    fn account(&mut self, message: &[u8], fault: Fault) {
        let Some(unit) = message.first() else { return };
        let mbap = self.framing() == Framing::Mbap;
        match fault {
            Fault::Exception(_) => {
                self.wire.counters.exceptions += 1;
                // An exception names no address: while the unit owes, it may be the answer to an older request.
                if mbap || self.wire.debts.of(*unit).is_clear() {
                    return;
                }
            }
            Fault::Timeout => self.wire.counters.timeouts += 1,
            Fault::Crc { .. }
            | Fault::Lrc { .. }
            | Fault::NotHex(_)
            | Fault::Truncated { .. }
            | Fault::WrongUnit { .. }
            | Fault::WrongFunction { .. }
            | Fault::WrongLength { .. }
            | Fault::WrongEcho
            | Fault::NotANumber
            | Fault::NotConnected
            | Fault::Resting => self.wire.counters.corrupt += 1,
        }
        tracing::debug!(unit, request = %frame::hex(message), %fault, "a request failed");
        // Even what looked like a spoiled answer may have been noise, with the answer still on its way.
        if !mbap {
            self.owe(message);
        }
    }

    /// The answer to this message may still come: it is remembered, and the line rests until it would have passed.
    fn owe(&mut self, message: &[u8]) {
        self.wire.debts.failed(message, self.wire.age());
        let longest = frame::shape_of(message).map_or(frame::MESSAGE_MAX, Shape::length);
        let chars = frame::wrapped_length(self.framing(), longest) as u32;
        self.wire.rest(self.wire.char_time * chars + self.wire.silence);
    }

    /// Could the sent bytes come back from the adapter? A read cannot be answered by itself, so its echo gives the adapter
    /// away; from then on the echo of every request is expected.
    fn expects_echo(&self, message: &[u8]) -> bool {
        self.echoes || matches!(message.get(1), Some(0x01..=0x04 | 0x17))
    }
}

/// What was gathered for one request.
#[derive(Debug, Clone)]
struct Gathered {
    answer: Result<Vec<u8>, Fault>,
    /// As it was on the wire.
    frame: Vec<u8>,
    reply: Option<Duration>,
    /// From the last byte sent until now.
    took: Duration,
}

impl Gathered {
    fn nothing(answer: Result<Vec<u8>, Fault>) -> Gathered {
        Gathered { answer, frame: Vec::new(), reply: None, took: Duration::ZERO }
    }
}
