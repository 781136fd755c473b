//! The link layer of one open port: whole frames out, checked answers in, every byte accounted for.
//!
//! PDUs are made and read by tokio-modbus, with a fresh context for every request on one end of a pipe; what travels on
//! the port is ours:
//!
//! ```text
//!  call(Request) ─> tokio-modbus ─> pipe ─> message ─> exchange ─> port     RTU: CRC, silences, debt
//!       Response <─ tokio-modbus <─ pipe <─ message <─ (checked) <─ port     TCP: MBAP, own transaction ids
//! ```

use std::{borrow::Cow, collections::VecDeque, time::Duration};

use futures_util::FutureExt;
use jiff::Timestamp;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    time::Instant,
};
use tokio_modbus::{
    Request, Response,
    client::{Client, rtu},
    slave::Slave,
};

use super::{clock::Clock, transport::Stream};
use crate::{
    bus::{
        debt::{self, Debt},
        frame::{self, Mbap, Shape},
        gather::{self, Verdict},
    },
    plant::{
        def::{LineDef, Transport},
        event::{Fault, LineCounters},
    },
};

/// Frames kept for inspection.
const RING: usize = 1_000;
/// USB adapters hand bytes over in batches (16 ms is common), gateways even later: only a longer silence ends a frame
/// that is not complete. Frames end by length first, so this costs nothing on a good line.
const IDLE_MIN: Duration = Duration::from_millis(50);
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

/// One frame or run of bytes as it went over the port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameLog {
    /// When.
    pub at: Timestamp,
    /// `true` for bytes that we sent.
    pub sent: bool,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// `ok`, or what was wrong with it.
    pub verdict: Cow<'static, str>,
}

/// The link on one open port.
pub struct Link {
    port: Box<dyn Stream>,
    clock: Clock,
    /// Time of one character and of the silence between frames, real time; zero over TCP.
    char_time: Duration,
    silence: Duration,
    /// Frames carry a transaction id.
    tcp: bool,
    transaction: u16,
    timeout: Duration,
    /// Nothing is sent before this.
    quiet_until: Instant,
    /// What each unit owes, by unit address.
    debts: Vec<Debt>,
    /// Numbers of loopbacks.
    loopbacks: u16,
    /// How late an owed answer has ever come, by unit address.
    late_max: Vec<Duration>,
    /// When the unit last failed to answer in time.
    failed_last: Vec<Option<Instant>>,
    ring: VecDeque<FrameLog>,
    /// Totals of this line; `utilisation`, `opens` and `missed` are the task's.
    pub counters: LineCounters,
    /// From the last byte sent to the first byte received, of the last answer.
    pub reply: Duration,
    /// Real time in which the line was busy.
    pub busy: Duration,
}

impl Link {
    /// A link on a freshly opened port. `counters` go on from an earlier opening.
    pub fn new(port: Box<dyn Stream>, line: &LineDef, clock: Clock, counters: LineCounters) -> Link {
        let (char_time, silence, tcp) = match &line.transport {
            Transport::Serial { serial, .. } => (serial.char_time(), serial.silence().max(line.gap), false),
            Transport::Tcp { .. } => (Duration::ZERO, line.gap, true),
        };
        Link {
            port,
            clock,
            char_time: clock.real_span(char_time),
            silence: clock.real_span(silence),
            tcp,
            transaction: 0,
            timeout: line.timeout,
            // What was asked before an earlier port went away may still be answered.
            quiet_until: Instant::now() + if tcp || counters.requests == 0 { Duration::ZERO } else { line.timeout },
            debts: vec![Debt::default(); 256],
            loopbacks: 0,
            late_max: vec![Duration::ZERO; 256],
            failed_last: vec![None; 256],
            ring: VecDeque::new(),
            counters,
            reply: Duration::ZERO,
            busy: Duration::ZERO,
        }
    }

    /// Sends a request through tokio-modbus and gives the answer; an exception is a [`Fault::Exception`].
    pub async fn call(&mut self, unit: u8, request: Request<'_>) -> Result<Response, Trouble> {
        let (ours, theirs) = tokio::io::duplex(2 * frame::MESSAGE_MAX);
        let mut context = rtu::attach_slave(theirs, Slave(unit));
        let (answer, done) = tokio::join!(context.call(request), self.carry(ours));
        done?;
        match answer {
            Ok(Ok(response)) => Ok(response),
            Ok(Err(code)) => Err(Fault::Exception(crate::plant::event::ExceptionCode(code.into())).into()),
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
        let unit = usize::from(message.first().copied().unwrap_or(0));
        // An answer proves that nothing older is to come only if it could not itself have been older.
        let proof = !self.is_ambiguous(message);
        self.wait_for_silence().await;
        self.drain()?;
        let started = Instant::now();
        let outcome = self.transact(message).await;
        self.busy += started.elapsed();
        self.rest_at_least(self.silence);
        match &outcome {
            Ok(_) => {
                self.counters.ok += 1;
                if proof {
                    self.debts[unit].clear();
                }
            }
            Err(Trouble::Fault(fault)) => self.account(message, *fault),
            Err(Trouble::Gone(_)) => {}
        }
        outcome
    }

    /// Could the answer to this message be mistaken for one that its unit still owes?
    pub fn is_ambiguous(&self, message: &[u8]) -> bool {
        let Some(shape) = frame::shape_of(message) else { return !self.debt(message[0]).is_clear() };
        self.debt(message[0]).is_ambiguous(shape)
    }

    /// What a unit owes.
    pub fn debt(&self, unit: u8) -> &Debt {
        &self.debts[usize::from(unit)]
    }

    /// Brings a unit into step by a loopback, where no read can: after it nothing older can come any more.
    pub async fn loopback(&mut self, unit: u8) -> Result<(), Trouble> {
        self.loopbacks = self.loopbacks.wrapping_add(1);
        let proves = self.debt(unit).refusal_proves();
        match self.exchange(&debt::loopback(unit, self.loopbacks)).await {
            Ok(_) => Ok(()),
            Err(Trouble::Fault(Fault::Exception(_))) if proves => {
                self.debts[usize::from(unit)].clear();
                Ok(())
            }
            // It may be the answer to an earlier loopback: the unit is alive, but not in step.
            Err(Trouble::Fault(Fault::Exception(_))) => Err(Fault::Timeout.into()),
            Err(trouble) => Err(trouble),
        }
    }

    /// For a unit that no probe can bring into step: how much longer it must rest before its debt may be forgotten,
    /// `None` once it is forgotten. For each answer that it owes it rests twice as long as it has ever been late, ten
    /// timeouts at the least: patience, not proof, and needed only for devices that do not answer a loopback at all.
    pub fn forget_debt(&mut self, unit: u8) -> Option<Duration> {
        let unit = usize::from(unit);
        let each = (2 * self.late_max[unit]).max(10 * self.timeout);
        let rest = each * self.debts[unit].count().max(1) as u32;
        let waited = self.failed_last[unit].map_or(rest, |failed| failed.elapsed());
        if waited < rest {
            return Some(rest - waited);
        }
        self.debts[unit].clear();
        None
    }

    /// Nothing is sent for this long (plant time), for devices that need it.
    pub fn rest(&mut self, plant: Duration) {
        self.rest_at_least(self.clock.real_span(plant));
    }

    /// Reads and drops what comes while nobody has asked; returns only when the port is gone.
    pub async fn idle(&mut self) -> String {
        let mut buffer = [0; 512];
        loop {
            match self.port.read(&mut buffer).await {
                Ok(0) => return "closed by the other side".into(),
                Err(error) => return error.to_string(),
                Ok(count) => self.take_stale(&buffer[..count]),
            }
        }
    }

    /// The latest frames, oldest first.
    pub fn frames(&self) -> impl Iterator<Item = &FrameLog> {
        self.ring.iter()
    }

    async fn wait_for_silence(&mut self) {
        // A device that never stops talking, or a second master, must not hold the line for ever: it spoils what is sent
        // then, and that is told.
        let limit = self.quiet_until.max(Instant::now()) + self.timeout;
        while Instant::now() < self.quiet_until.min(limit) {
            let until = self.quiet_until.min(limit);
            // A gone port shows itself at the write that follows.
            let _ = tokio::time::timeout_at(until, self.idle_quietly()).await;
            if until == self.quiet_until.min(limit) {
                tokio::time::sleep_until(until).await;
            }
        }
        self.quiet_until = self.quiet_until.min(limit);
    }

    /// As [`Link::idle`], but every byte that comes prolongs the silence to be kept.
    async fn idle_quietly(&mut self) {
        let mut buffer = [0; 512];
        while let Ok(count @ 1..) = self.port.read(&mut buffer).await {
            self.take_stale(&buffer[..count]);
            self.rest_at_least(self.silence);
        }
    }

    /// Drops what lies in the kernel: it was sent before we asked. Over TCP the transaction id tells.
    fn drain(&mut self) -> Result<(), Trouble> {
        let mut buffer = [0; 512];
        loop {
            match self.port.read(&mut buffer).now_or_never() {
                None => return Ok(()),
                Some(Ok(0)) => return Err(Trouble::Gone("closed by the other side".into())),
                Some(Err(error)) => return Err(Trouble::Gone(error.to_string())),
                Some(Ok(count)) => self.take_stale(&buffer[..count]),
            }
        }
    }

    async fn transact(&mut self, message: &[u8]) -> Result<Vec<u8>, Trouble> {
        self.transaction = self.transaction.wrapping_add(1);
        let out = if self.tcp { frame::with_mbap(self.transaction, message) } else { frame::with_crc(message) };
        let gone = |error: std::io::Error| Trouble::Gone(error.to_string());
        // No flush: on a serial port that waits for the last byte to leave, and blocks the thread while it does.
        match tokio::time::timeout(self.timeout + self.char_time * 512, self.port.write_all(&out)).await {
            Ok(written) => written.map_err(gone)?,
            Err(_) => return Err(Trouble::Gone("the port takes no bytes".into())),
        }
        self.counters.requests += 1;
        self.counters.sent_bytes += out.len() as u64;
        self.counters.last_tx = Some(self.clock.now());
        // The write returns before the bytes have left the port: the answer's time begins with the last of them.
        let sent_at = Instant::now() + self.char_time * out.len() as u32;
        self.log(true, out, Cow::Borrowed("sent"));
        let longest = frame::shape_of(message).map_or(frame::MESSAGE_MAX, Shape::length) + 2;
        let deadline = sent_at + self.timeout + self.char_time * longest as u32;
        if self.tcp {
            self.gather_tcp(message, sent_at, deadline).await
        } else {
            self.gather_rtu(message, sent_at, deadline).await
        }
    }

    /// Gathers until a frame has come that answers the message. Whole frames that do not (another unit, an owed answer)
    /// are dropped, and waiting goes on inside the same deadline.
    async fn gather_rtu(&mut self, message: &[u8], sent_at: Instant, deadline: Instant) -> Result<Vec<u8>, Trouble> {
        let idle = self.silence.max(IDLE_MIN);
        let mut buffer: Vec<u8> = Vec::new();
        // What came and did not fit: it names the fault if nothing better comes.
        let mut misfit: Option<Fault> = None;
        loop {
            let wait_until = match gather::verdict(message, &buffer) {
                Verdict::Answer(range) => {
                    if 0 < range.start {
                        self.counters.stale += 1;
                        self.log(false, buffer[..range.start].to_vec(), Cow::Borrowed("noise before the answer"));
                    }
                    let answer = buffer[range.clone()].to_vec();
                    self.log(false, buffer[range.start..range.end + 2].to_vec(), Cow::Borrowed("ok"));
                    // An exception is an answer for the line, but a fault for the caller.
                    frame::check_answer(message, &answer)?;
                    return Ok(answer);
                }
                Verdict::Foreign(end, fault) => {
                    self.take_stale_counted(&buffer[..end]);
                    buffer.drain(..end);
                    misfit = Some(fault);
                    continue;
                }
                // Nothing, or noise: the answer may still come.
                Verdict::Nothing => deadline,
                // The frame may still grow, or it is spoiled; silence decides.
                Verdict::Begun | Verdict::Spoiled(_) => (Instant::now() + idle).min(deadline),
            };
            match self.read_until(wait_until, &mut buffer, sent_at).await? {
                true if buffer.len() <= GATHER_MAX => {}
                _ => {
                    let fault = match gather::verdict(message, &buffer) {
                        Verdict::Spoiled(fault) => fault,
                        _ => misfit.unwrap_or_else(|| gather::left_over(message, &buffer)),
                    };
                    if !buffer.is_empty() {
                        self.log(false, buffer, Cow::Owned(fault.to_string()));
                    }
                    return Err(fault.into());
                }
            }
        }
    }

    /// Gathers until the frame with our transaction id has come; others are late answers and are dropped.
    async fn gather_tcp(&mut self, message: &[u8], sent_at: Instant, deadline: Instant) -> Result<Vec<u8>, Trouble> {
        let mut buffer: Vec<u8> = Vec::new();
        loop {
            match frame::mbap(&buffer) {
                Mbap::Incomplete => {}
                Mbap::Broken => {
                    self.log(false, buffer, Cow::Borrowed("no MBAP header"));
                    return Err(Trouble::Gone("the stream is out of step".into()));
                }
                Mbap::Whole { transaction, end } if transaction == self.transaction => {
                    let answer = buffer[6..end].to_vec();
                    self.log(false, buffer[..end].to_vec(), Cow::Borrowed("ok"));
                    frame::check_answer(message, &answer)?;
                    return Ok(answer);
                }
                Mbap::Whole { end, .. } => {
                    self.take_stale_counted(&buffer[..end]);
                    buffer.drain(..end);
                    continue;
                }
            }
            if !self.read_until(deadline, &mut buffer, sent_at).await? {
                if !buffer.is_empty() {
                    self.log(false, buffer, Cow::Borrowed("cut short"));
                    // The rest may come later and would stand before the next header.
                    return Err(Trouble::Gone("an answer was cut short, the stream is out of step".into()));
                }
                return Err(Fault::Timeout.into());
            }
        }
    }

    /// Reads more bytes; `false` if none came before `until`.
    async fn read_until(&mut self, until: Instant, buffer: &mut Vec<u8>, sent_at: Instant) -> Result<bool, Trouble> {
        let mut chunk = [0; 512];
        match tokio::time::timeout_at(until, self.port.read(&mut chunk)).await {
            Err(_) => Ok(false),
            Ok(Ok(0)) => Err(Trouble::Gone("closed by the other side".into())),
            Ok(Err(error)) => Err(Trouble::Gone(error.to_string())),
            Ok(Ok(count)) => {
                if buffer.is_empty() {
                    self.reply = Instant::now().saturating_duration_since(sent_at);
                }
                self.counters.received_bytes += count as u64;
                self.counters.last_rx = Some(self.clock.now());
                buffer.extend_from_slice(&chunk[..count]);
                Ok(true)
            }
        }
    }

    /// Counts a fault. The unit owes the answer, and the line rests until the longest late frame has passed.
    fn account(&mut self, message: &[u8], fault: Fault) {
        let unit = usize::from(message[0]);
        match fault {
            Fault::Exception(_) => {
                self.counters.exceptions += 1;
                // An exception names no address: while the unit owes, it may be the answer to an older request.
                if self.tcp || self.debts[unit].is_clear() {
                    return;
                }
            }
            Fault::Timeout => self.counters.timeouts += 1,
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
            | Fault::Resting => self.counters.corrupt += 1,
        }
        tracing::debug!(unit, request = %frame::hex(message), %fault, "a request failed");
        // Even what looked like a spoiled answer may have been noise, with the answer still on its way.
        if !self.tcp {
            let shape = frame::shape_of(message);
            if let Some(shape) = shape {
                self.debts[unit].owe(shape);
            }
            // Patience counts from the last request that may be answered late; a loopback cannot be mistaken.
            if !shape.is_some_and(Shape::is_loopback) {
                self.failed_last[unit] = Some(Instant::now());
            }
            let longest = shape.map_or(frame::MESSAGE_MAX, Shape::length) + 2;
            self.rest_at_least(self.char_time * longest as u32 + self.silence);
        }
    }

    fn rest_at_least(&mut self, real: Duration) {
        self.quiet_until = self.quiet_until.max(Instant::now() + real);
    }

    /// Bytes that nobody waits for.
    fn take_stale(&mut self, bytes: &[u8]) {
        self.counters.received_bytes += bytes.len() as u64;
        self.counters.last_rx = Some(self.clock.now());
        self.take_stale_counted(bytes);
    }

    fn take_stale_counted(&mut self, bytes: &[u8]) {
        self.counters.stale += 1;
        tracing::debug!(bytes = %frame::hex(bytes), "stale bytes dropped");
        if let Some(unit) = bytes.first().map(|unit| usize::from(*unit))
            && let Some(failed) = self.failed_last[unit].filter(|_| !self.debts[unit].is_clear())
        {
            // The whole lateness includes the timeout itself.
            self.late_max[unit] = self.late_max[unit].max(failed.elapsed() + self.timeout);
        }
        self.log(false, bytes.to_vec(), Cow::Borrowed("stale, dropped"));
    }

    fn log(&mut self, sent: bool, bytes: Vec<u8>, verdict: Cow<'static, str>) {
        if self.ring.len() == RING {
            self.ring.pop_front();
        }
        self.ring.push_back(FrameLog { at: self.clock.now(), sent, bytes, verdict });
    }
}
