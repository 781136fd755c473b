//! The bytes of one open port: silent intervals are kept, every byte is counted and recorded, unexpected bytes are dropped.

use std::{sync::Arc, time::Duration};

use futures_util::FutureExt;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    time::Instant,
};

use super::{clock::Clock, link::LinkError, memory::LineMemory, pause::Pause, transport::Stream};
use crate::{
    bus::{
        ascii,
        frame::{self, Unsolicited},
        late_reply::LineReplies,
        other_master::OtherMaster,
        request_gap::RequestGaps,
    },
    plant::{
        def::{Framing, LineDef},
        line_state::LineCounters,
        line_trouble::LineTrouble,
        number::to_u32,
        traffic::{FRAMES_MAX, Frame, FrameFault, FrameResult},
    },
};

/// More stray bytes are judged without waiting for silence.
const STRAY_MAX: usize = 4 * frame::MESSAGE_MAX;

/// A line is heard for so long before the first request on it: another master may be at work.
const FIRST_LISTEN: Duration = Duration::from_millis(300);

/// One open port.
pub struct Wire {
    port: Box<dyn Stream>,
    pause: Pause,
    clock: Clock,
    framing: Framing,
    /// Time of one character, real time; zero over TCP.
    pub char_time: Duration,
    /// Silence between frames, real time.
    pub silent_interval: Duration,
    timeout: Duration,
    /// Nothing is sent before this.
    quiet_until: Instant,
    /// When the last byte sent has left.
    left_at: Instant,
    created_at: Instant,
    /// Outstanding replies of each unit.
    pub replies: LineReplies,
    other_master: OtherMaster,
    /// How soon each unit hears the next request.
    pub request_gaps: RequestGaps,
    /// Bytes that no request waits for, until silence shows that their frame has ended.
    stray: Vec<u8>,
    /// Bytes that are further apart than this (real time) are of two frames.
    pub frame_timeout: Duration,
    /// Frames since they were last taken.
    frames: Vec<Frame>,
    /// Units whose answers came late since this was last taken.
    late: Vec<u8>,
    /// Units that sent since then what they were not asked for, though nothing was outstanding.
    unsolicited: Vec<u8>,
    /// Totals of the line; `utilisation`, `opens` and `missed` are the task's.
    pub counters: LineCounters,
}

impl Wire {
    /// A freshly opened port; `memory` goes on from an earlier opening.
    pub fn new(port: Box<dyn Stream>, pause: Pause, line: &LineDef, clock: Clock, memory: LineMemory) -> Wire {
        let LineMemory { counters, mut replies, other_master, request_gaps, created_at, is_cut } = memory;
        let (char_time, silent_interval) = match line.transport.serial() {
            // The frames of ASCII have a beginning and an end of their own.
            Some(serial) if line.transport.framing() == Framing::Ascii => (serial.char_time(), line.gap),
            Some(serial) => (serial.char_time(), serial.silent_interval().max(line.gap)),
            None => (Duration::ZERO, line.gap),
        };
        let framing = line.transport.framing();
        replies.set_line(line.timeout, framing == Framing::Mbap);
        // What was asked before an earlier port went away may still be answered; at the start another master may be heard.
        let rest = match (framing, counters.requests) {
            (Framing::Mbap, _) => Duration::ZERO,
            (_, _) if line.transport.serial().is_none() && !is_cut => Duration::ZERO,
            (_, 0) => line.timeout.min(FIRST_LISTEN),
            (_, 1..) => line.timeout,
        };
        Wire {
            port,
            pause,
            clock,
            framing,
            char_time: clock.real_span(char_time),
            silent_interval: clock.real_span(silent_interval),
            timeout: line.timeout,
            quiet_until: Instant::now() + rest.max(line.connect_delay),
            left_at: Instant::now(),
            created_at,
            replies,
            other_master,
            request_gaps,
            stray: Vec::new(),
            frame_timeout: clock.real_span(silent_interval).max(line.frame_timeout),
            frames: Vec::new(),
            late: Vec::new(),
            unsolicited: Vec::new(),
            counters,
        }
    }

    /// Plant time.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// How messages are framed.
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// Time since the line was opened first.
    pub fn uptime(&self) -> Duration {
        self.created_at.elapsed()
    }

    /// What is remembered until the next opening.
    pub fn memory(&self) -> LineMemory {
        let (counters, created_at) = (self.counters, self.created_at);
        let (replies, other_master) = (self.replies.clone(), self.other_master.clone());
        let request_gaps = self.request_gaps.clone();
        LineMemory { counters, replies, other_master, request_gaps, created_at, is_cut: false }
    }

    /// Nothing is sent for this long (real time).
    pub fn hold_off(&mut self, real: Duration) {
        if real.is_zero() {
            return;
        }
        self.quiet_until = self.quiet_until.max(Instant::now() + real);
    }

    /// Until when nothing is to be sent, if that is not over.
    pub fn hold_off_until(&self) -> Option<Instant> {
        Some(self.quiet_until).filter(|until| Instant::now() < *until)
    }

    /// Nothing is sent for this long (real time) after the last byte sent has left.
    pub fn hold_off_after_sending(&mut self, real: Duration) {
        self.quiet_until = self.quiet_until.max(self.left_at.max(Instant::now()) + real);
    }

    /// A rest under way lasts no longer than this (real time), and never less than what was sent needs to leave.
    pub fn limit_hold_off(&mut self, real: Duration) {
        self.quiet_until = self.quiet_until.min(self.left_at.max(Instant::now()) + real);
    }

    /// Sends bytes when the line has been silent long enough, and gives the moment when the last of them has left.
    pub async fn send(&mut self, bytes: &[u8]) -> Result<Instant, LinkError> {
        self.wait_for_silence().await;
        if self.framing != Framing::Mbap {
            // What is just coming in is received to its end: it may be an outstanding reply.
            self.drain()?;
            if self.has_begun() {
                self.hold_off(self.frame_timeout);
                self.wait_for_silence().await;
                self.drain()?;
            }
        }
        self.drop_stray();
        self.put(bytes).await
    }

    /// Sends bytes now, and gives the moment when the last of them has left.
    pub async fn put(&mut self, bytes: &[u8]) -> Result<Instant, LinkError> {
        // No flush: on a serial port that waits for the last byte to leave, and blocks the thread while it does.
        // What the system takes at once, as a rule all of it, costs no timer.
        self.left_at = Instant::now() + self.char_time * to_u32(bytes.len());
        let taken = self.port.write(bytes).now_or_never().unwrap_or(Ok(0));
        let taken = taken.map_err(gone)?;
        if let Some(rest @ [_, ..]) = bytes.get(taken..) {
            match tokio::time::timeout(self.timeout + self.char_time * 512, self.port.write_all(rest)).await {
                Ok(written) => written.map_err(gone)?,
                Err(_) => return Err(LinkError::Gone(LineTrouble::NoBytesAccepted)),
            }
        }
        let sent_at = Instant::now();
        self.counters.sent_bytes += bytes.len() as u64;
        self.counters.last_tx = Some(self.clock.to_utc(self.clock.at(sent_at)));
        Ok(sent_at + self.char_time * to_u32(bytes.len()))
    }

    /// Appends what comes next to `buffer`; `false` if nothing came before `until`.
    pub async fn receive(&mut self, until: Instant, buffer: &mut Vec<u8>) -> Result<bool, LinkError> {
        // Room of its own would be part of this future, and be moved with it from call to call.
        buffer.reserve(frame::FRAME_MAX);
        // What is there already costs no timer.
        let read = match self.port.read_buf(buffer).now_or_never() {
            Some(read) => read,
            None => match tokio::time::timeout_at(until, self.port.read_buf(buffer)).await {
                Err(_) => return Ok(false),
                Ok(read) => read,
            },
        };
        let count = received(read)?;
        self.counters.received_bytes += count as u64;
        self.counters.last_rx = Some(self.clock.utc());
        Ok(true)
    }

    /// Appends what has come already.
    pub fn receive_waiting(&mut self, buffer: &mut Vec<u8>) {
        buffer.reserve(frame::FRAME_MAX);
        if let Some(read) = self.port.read_buf(buffer).now_or_never() {
            // A stream that has ended shows itself at the next request.
            self.counters.received_bytes += read.unwrap_or(0) as u64;
        }
    }

    /// Reads and drops unsolicited bytes; returns only when the port is gone.
    pub async fn listen(&mut self) -> LinkError {
        loop {
            let pause = if self.stray.is_empty() { Duration::from_secs(3_600) } else { self.frame_timeout };
            self.stray.reserve(frame::FRAME_MAX);
            match tokio::time::timeout(pause, self.port.read_buf(&mut self.stray)).await.map(received) {
                Err(_) => self.drop_stray(),
                Ok(Ok(count)) => self.took_stray(count),
                Ok(Err(error)) => return error,
            }
        }
    }

    /// The answer of a unit to a request that was given up.
    pub fn drop_late(&mut self, unit: u8, frame: &[u8]) {
        self.counters.unexpected += 1;
        self.counters.late += 1;
        self.late.push(unit);
        tracing::debug!(unit, bytes = %frame::hex(frame), "late answer dropped");
        self.record(false, frame.into(), FrameResult::Wrong(FrameFault::Late));
    }

    /// Stray bytes have come.
    fn took_stray(&mut self, count: usize) {
        self.counters.received_bytes += count as u64;
        self.counters.last_rx = Some(self.clock.utc());
        if STRAY_MAX <= self.stray.len() {
            self.drop_stray();
        }
    }

    /// The line is silent, or something is sent.
    fn drop_stray(&mut self) {
        let bytes = std::mem::take(&mut self.stray);
        self.drop_unexpected(&bytes);
    }

    /// Records unexpected or late bytes, and counts them for their unit.
    pub fn drop_unexpected(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.counters.unexpected += 1;
        tracing::debug!(bytes = %frame::hex(bytes), "unexpected bytes dropped");
        let mut late = false;
        // Only a whole good frame names the unit: chance bytes may name any.
        for frame in frame::unsolicited(self.framing, bytes) {
            let age = self.uptime();
            let (Unsolicited::Response(message) | Unsolicited::Request(message)) = &frame;
            let Some(unit) = message.first().copied() else { continue };
            let asks = matches!(frame, Unsolicited::Request(_));
            let reordered = !asks && self.replies.detect_reordering(unit, message, age);
            let was_outstanding = !asks && !reordered && self.replies.on_late_reply(unit, message, age);
            if was_outstanding {
                late = true;
                self.counters.late += 1;
                self.late.push(unit);
            }
            if reordered || (!was_outstanding && self.replies.on_unsolicited(unit, message, age)) {
                self.unsolicited.push(unit);
            }
            if asks {
                self.other_master.on_request(message, age);
                self.replies.mark_all_unproven();
            }
        }
        self.record(
            false,
            bytes.into(),
            FrameResult::Wrong(if late { FrameFault::Late } else { FrameFault::Unexpected }),
        );
    }

    /// Puts bytes on record.
    pub fn record(&mut self, sent: bool, bytes: Arc<[u8]>, result: FrameResult) {
        self.counters.frames += 1;
        // Between two reports a fast line carries more than anybody can look at: the latest are enough.
        if self.frames.len() == 2 * FRAMES_MAX {
            self.frames.drain(..FRAMES_MAX);
        }
        let unit = frame::unit_of(self.framing, &bytes);
        let moved_at = if sent { self.counters.last_tx } else { self.counters.last_rx };
        let at = moved_at.unwrap_or_else(|| self.clock.utc());
        let (framing, number) = (self.framing, self.counters.frames);
        self.frames.push(Frame { at, sent, bytes, framing, result, unit, number });
    }

    /// The frames since they were last taken, oldest first.
    pub fn take_frames(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.frames)
    }

    /// The units whose answers came late since this was last asked, once for each answer.
    pub fn take_late(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.late)
    }

    /// The units that have sent what they were not asked for since this was last asked.
    pub fn take_unsolicited(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.unsolicited)
    }

    async fn wait_for_silence(&mut self) {
        // A device that never stops talking, or a second master, must not hold the line for ever: it corrupts what is sent
        // then, and that is reported.
        let now = Instant::now();
        if self.quiet_until <= now {
            return;
        }
        let limit = self.quiet_until + self.timeout;
        while Instant::now() < self.quiet_until.min(limit) {
            let until = self.quiet_until.min(limit);
            self.stray.reserve(frame::FRAME_MAX);
            let read = tokio::select! {
                () = self.pause.until(until) => break,
                read = self.port.read_buf(&mut self.stray) => read,
            };
            // A gone port shows itself at the write that follows.
            let Ok(count @ 1..) = read else {
                self.pause.until(until).await;
                break;
            };
            self.took_stray(count);
            self.hold_off(if self.has_begun() { self.frame_timeout } else { self.silent_interval });
        }
        self.quiet_until = self.quiet_until.min(limit);
    }

    /// Takes what lies in the kernel: it was sent before we asked. (Over Modbus TCP the transaction id tells.)
    fn drain(&mut self) -> Result<(), LinkError> {
        loop {
            self.stray.reserve(frame::FRAME_MAX);
            let Some(read) = self.port.read_buf(&mut self.stray).now_or_never() else { return Ok(()) };
            self.took_stray(received(read)?);
        }
    }

    /// Is a stray frame just coming in? A single byte is noise, as drivers make it when they let go of a line.
    fn has_begun(&self) -> bool {
        match self.framing {
            Framing::Mbap => false,
            Framing::Ascii => ascii::open_frame(&self.stray).is_some(),
            Framing::Rtu => 1 < self.stray.len() && frame::unsolicited(self.framing, &self.stray).is_empty(),
        }
    }
}

/// A port that fails, in the words of the system.
fn gone(error: std::io::Error) -> LinkError {
    LinkError::Gone(LineTrouble::System(error.to_string()))
}

/// No bytes mean the end of the stream.
fn received(read: std::io::Result<usize>) -> Result<usize, LinkError> {
    match read {
        Ok(0) => Err(LinkError::Gone(LineTrouble::Closed)),
        Ok(count) => Ok(count),
        Err(error) => Err(gone(error)),
    }
}
