//! Serves the units of a line that takes the time of a real one: RTU or ASCII, on any stream of bytes.
//!
//! ```text
//!  request arrives     its last byte        slave knows       answer begins      last byte of answer: written here
//!  |— bytes · char ————|— 3.5 characters ———|— device delay ——|— bytes · char ————|
//!                       (RTU only)
//! ```

use std::io;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, sleep_until, timeout};

use super::LineHandle;
use crate::bus::io::clock::Clock;
use crate::plant::def::Serial;
use crate::sim::faults::Answer;
use crate::sim::{ascii::SlaveRequest, wire::FrameReceiver};

/// Requests and answers under way at once; a request beyond that is dropped.
const JOBS_MAX: usize = 8;
/// Silence that ends a frame whose check is not right, in real time: bytes of one write may come in pieces.
const SILENCE_REAL_MIN: Duration = Duration::from_millis(20);
/// Time that characters of one ASCII frame may be apart (Modbus serial line V1.02, 2.5.2.1).
const SILENCE_ASCII: Duration = Duration::from_secs(1);
/// An answer that is not read for this long is dropped (the other end of a pty is closed and its buffer full).
const WRITE_MAX: Duration = Duration::from_secs(1);
/// Timers tick in 1 ms, so an answer may be this late for no other reason; the next request is credited with it.
const TICK: Duration = Duration::from_millis(2);

/// What a line is: how frames are spelled on it and how fast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wire {
    /// Baud rate and bits of a character.
    pub serial: Serial,
    /// ASCII; RTU otherwise.
    pub ascii: bool,
}

impl Wire {
    /// Silence between a request and its answer.
    fn gap(self) -> Duration {
        if self.ascii { Duration::ZERO } else { self.serial.silent_interval() }
    }

    fn spell(self, answer: &Answer) -> Vec<u8> {
        if self.ascii { answer.ascii() } else { answer.rtu() }
    }
}

/// Serves until the stream ends, fails, or brings nothing for longer than `idle_max`. Everything on the wire runs in the
/// plant time of the simulator's clock.
pub async fn serve_line<S>(mut stream: S, units: LineHandle, wire: Wire, idle_max: Duration) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let mut line = Line::new(units.clock(), wire);
    let mut bytes = [0; 256];
    loop {
        tokio::select! {
            // A replay must come to the same end.
            biased;
            read = stream.read(&mut bytes) => match read? {
                0 => return Ok(()),
                count => line.on_received(Instant::now(), &bytes[..count]),
            },
            () = sleep_until(line.next()), if line.waits() => match line.due(Instant::now()) {
                Due::Nothing => {}
                Due::Execute { at, request } => line.execute(at, &request, &units).await,
                Due::Send(frame) => match timeout(WRITE_MAX, stream.write_all(&frame)).await {
                    Ok(written) => written?,
                    Err(_receiver_gone) => {}
                },
            },
            () = sleep_until(line.latest + idle_max) => return Ok(()),
        }
        for _ in 0..std::mem::take(&mut line.corrupt) {
            units.corrupt().await;
        }
    }
}

/// What happens on the line, and when.
struct Line {
    clock: Clock,
    wire: Wire,
    receiver: FrameReceiver,
    /// Corrupt frames that the units have not counted yet.
    corrupt: usize,
    /// Since when the request that is arriving has been on the wire, and when its latest bytes came.
    began: Instant,
    latest: Instant,
    /// When the last answer was written, and how late that was by the grain of the timers.
    sent: Instant,
    credit: Duration,
    jobs: Vec<Job>,
}

struct Job {
    at: Instant,
    what: What,
}

enum What {
    Execute(Vec<u8>),
    Send(Vec<u8>),
}

enum Due {
    Nothing,
    Execute { at: Instant, request: Vec<u8> },
    Send(Vec<u8>),
}

impl Line {
    fn new(clock: Clock, wire: Wire) -> Line {
        let now = Instant::now();
        Line {
            clock,
            wire,
            receiver: FrameReceiver::new(wire.ascii, wire.serial.data_bits),
            corrupt: 0,
            began: now,
            latest: now,
            sent: now,
            credit: Duration::ZERO,
            jobs: Vec::with_capacity(JOBS_MAX),
        }
    }

    /// Bytes have arrived. They come at once, but the request is not over before its time on the wire.
    fn on_received(&mut self, now: Instant, bytes: &[u8]) {
        if self.receiver.is_empty() {
            // A master that asks again at once was held up by the late answer; the lateness must not add up.
            let at_once = now - self.sent < SILENCE_REAL_MIN;
            self.began = if at_once { now.checked_sub(self.credit).unwrap_or(now) } else { now };
            self.credit = Duration::ZERO;
        }
        self.latest = now;
        self.receiver.push(bytes);
        while let Some(frame) = self.receiver.take() {
            self.accept(frame);
        }
    }

    fn accept(&mut self, frame: Option<SlaveRequest>) {
        let Some(SlaveRequest { message, characters }) = frame else {
            self.corrupt += 1;
            return;
        };
        let over = self.over(characters);
        self.began = over;
        if self.jobs.len() < JOBS_MAX {
            let at = over + self.clock.real_span(self.wire.gap());
            self.jobs.push(Job { at, what: What::Execute(message) });
        }
    }

    /// When this many characters have been on the wire since the request began. Bytes that really came later than the line's
    /// pace count from when they came.
    fn over(&self, characters: usize) -> Instant {
        let on_wire = self.began + self.time_of(characters);
        if on_wire + TICK < self.latest { self.latest } else { on_wire }
    }

    /// The next moment at which something is due.
    fn next(&self) -> Instant {
        let silence = (!self.receiver.is_empty()).then(|| self.silent_at());
        self.jobs.iter().map(|job| job.at).chain(silence).min().unwrap_or(self.latest)
    }

    fn waits(&self) -> bool {
        !self.jobs.is_empty() || !self.receiver.is_empty()
    }

    /// When what has come is over. A whole request is as soon as its silence is: what comes before that belongs to it.
    fn silent_at(&self) -> Instant {
        if let Some(characters) = self.receiver.whole() {
            return self.over(characters) + self.clock.real_span(self.wire.gap());
        }
        let silence = if self.wire.ascii { SILENCE_ASCII } else { self.wire.serial.silent_interval() };
        self.latest + self.clock.real_span(silence).max(SILENCE_REAL_MIN)
    }

    fn due(&mut self, now: Instant) -> Due {
        if !self.receiver.is_empty() && self.silent_at() <= now {
            if let Some(frame) = self.receiver.on_silent_interval() {
                self.accept(frame);
            }
            return Due::Nothing;
        }
        let first = (0..self.jobs.len()).min_by_key(|place| self.jobs[*place].at);
        let Some(job) = first.filter(|place| self.jobs[*place].at <= now).map(|place| self.jobs.remove(place)) else {
            return Due::Nothing;
        };
        match job.what {
            What::Execute(request) => Due::Execute { at: job.at, request },
            What::Send(frame) => {
                (self.sent, self.credit) = (now, (now - job.at).min(TICK));
                Due::Send(frame)
            }
        }
    }

    /// The device acts now, and its answer is over after its delay and its time on the wire.
    async fn execute(&mut self, at: Instant, request: &[u8], units: &LineHandle) {
        let [unit, pdu @ ..] = request else { return };
        if let Some(answer) = units.ask(*unit, pdu).await {
            let frame = self.wire.spell(&answer);
            let at = at + self.clock.real_span(answer.delay) + self.time_of(frame.len());
            self.jobs.push(Job { at, what: What::Send(frame) });
        }
    }

    /// Real time of this many characters.
    fn time_of(&self, characters: usize) -> Duration {
        let bits = characters as f64 * f64::from(self.wire.serial.bits_per_char());
        self.clock.real_span(Duration::from_secs_f64(bits / f64::from(self.wire.serial.baud)))
    }
}

#[cfg(test)]
mod tests;
