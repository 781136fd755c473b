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
use crate::sim::wire::{FrameReceiver, SlaveRequest};

/// Requests and answers under way at once; a request beyond that is dropped.
const JOBS_MAX: usize = 8;
/// Silence that ends a frame of unknown length, in real time: bytes of one write may come in pieces.
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
        let on_wire = self.began + self.time_of(characters);
        // Bytes that really came later than the line's pace count from when they came.
        let over = if on_wire + TICK < self.latest { self.latest } else { on_wire };
        self.began = over;
        if self.jobs.len() < JOBS_MAX {
            let at = over + self.clock.real_span(self.wire.gap());
            self.jobs.push(Job { at, what: What::Execute(message) });
        }
    }

    /// The next moment at which something is due.
    fn next(&self) -> Instant {
        let silence = (!self.receiver.is_empty()).then(|| self.silent_at());
        self.jobs.iter().map(|job| job.at).chain(silence).min().unwrap_or(self.latest)
    }

    fn waits(&self) -> bool {
        !self.jobs.is_empty() || !self.receiver.is_empty()
    }

    fn silent_at(&self) -> Instant {
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

    /// Real time of so many characters.
    fn time_of(&self, characters: usize) -> Duration {
        let bits = characters as f64 * f64::from(self.wire.serial.bits_per_char());
        self.clock.real_span(Duration::from_secs_f64(bits / f64::from(self.wire.serial.baud)))
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;
    use tokio::io::{DuplexStream, duplex};

    use super::*;
    use crate::bus::frame::with_crc;
    use crate::plant::def::LineId;
    use crate::plant::def::Parity;
    use crate::sim::faults::InjectedFault;
    use crate::sim::io::{SimulatorHandle, serving::FOR_EVER};
    use crate::sim::rig::Rig;
    use crate::sim::simulator::Simulator;

    const L1: LineId = LineId(0);
    const READ_TEN: &[u8] = &[1, 4, 0x03, 0xE8, 0, 10];
    const READ_STEP: &[u8] = &[2, 3, 4, 0, 0, 1];

    fn line(baud: u32, parity: Parity, speed: f64) -> (DuplexStream, SimulatorHandle) {
        serve(Serial { baud, data_bits: 8, parity, stop_bits: 1 }, false, speed)
    }

    fn serve(serial: Serial, ascii: bool, speed: f64) -> (DuplexStream, SimulatorHandle) {
        let simulator =
            SimulatorHandle::spawn(Simulator::tank(Rig::demo()), Clock::starting_at(Timestamp::UNIX_EPOCH, speed));
        let (master, slave) = duplex(1024);
        tokio::spawn(serve_line(slave, simulator.line(L1), Wire { serial, ascii }, FOR_EVER));
        (master, simulator)
    }

    /// What arrives until nothing has come for two seconds, and when its last byte came.
    async fn gather(master: &mut DuplexStream) -> (Vec<u8>, Duration) {
        let (asked, mut frame, mut took) = (Instant::now(), Vec::new(), Duration::ZERO);
        let mut bytes = [0; 256];
        while let Ok(Ok(count)) = timeout(Duration::from_secs(2), master.read(&mut bytes)).await {
            if count == 0 {
                break;
            }
            frame.extend_from_slice(&bytes[..count]);
            took = asked.elapsed();
        }
        (frame, took)
    }

    async fn ask(master: &mut DuplexStream, message: &[u8]) -> (Vec<u8>, Duration) {
        master.write_all(&with_crc(message)).await.expect("the line takes requests");
        gather(master).await
    }

    async fn check(baud: u32, parity: Parity, speed: f64, expect_ms: f64) {
        let (mut master, _simulator) = line(baud, parity, speed);
        let (frame, took) = ask(&mut master, READ_TEN).await;
        assert_eq!(frame.len(), 25);
        let took_ms = took.as_secs_f64() * 1e3;
        assert!((expect_ms..expect_ms + 2.0).contains(&took_ms), "{took_ms} ms at {baud}, expected {expect_ms} ms");
    }

    /// (8 + 25) characters, one silence before the answer, 5 ms of the device; the second silence is the master's.
    #[tokio::test(start_paused = true)]
    async fn an_answer_takes_the_time_of_the_wire() {
        check(9600, Parity::None, 1.0, 330.0 / 9.6 + 35.0 / 9.6 + 5.0).await;
        check(9600, Parity::Even, 1.0, 45.8 - 4.01 + 5.0).await;
        check(19_200, Parity::Even, 1.0, 22.9 - 2.0 + 5.0).await;
        check(115_200, Parity::Even, 1.0, 6.7 - 1.75 + 5.0).await;
        check(9600, Parity::None, 10.0, 4.3).await;
    }

    #[tokio::test(start_paused = true)]
    async fn the_grain_of_the_timers_does_not_add_up() {
        let (mut master, _simulator) = line(115_200, Parity::None, 1.0);
        let (began, mut reply, rounds) = (Instant::now(), [0; 25], 200);
        for _ in 0..rounds {
            master.write_all(&with_crc(READ_TEN)).await.expect("the line takes requests");
            master.read_exact(&mut reply).await.expect("the line answers");
        }
        let each_ms = began.elapsed().as_secs_f64() * 1e3 / f64::from(rounds);
        let wire_ms = 330.0 / 115.2 + 1.75 + 5.0;
        assert!((each_ms / wire_ms - 1.0).abs() < 0.01, "{each_ms} ms each, the wire needs {wire_ms} ms");
    }

    #[tokio::test(start_paused = true)]
    async fn a_request_in_pieces_and_one_after_noise_are_understood() {
        let (mut master, _simulator) = line(9600, Parity::None, 1.0);
        let request = with_crc(READ_STEP);
        master.write_all(&request[..3]).await.expect("the line takes bytes");
        tokio::time::advance(Duration::from_millis(5)).await;
        master.write_all(&request[3..]).await.expect("the line takes bytes");
        assert_eq!(gather(&mut master).await.0.len(), 7);
        master.write_all(&[0xFF, 0x00, 0x55]).await.expect("the line takes bytes");
        assert_eq!(gather(&mut master).await.0, Vec::<u8>::new());
        assert_eq!(ask(&mut master, READ_STEP).await.0.len(), 7);
        assert_eq!(ask(&mut master, &[1, 0x2B, 14, 1, 0]).await.0, with_crc(&[1, 0xAB, 1]));
    }

    #[tokio::test(start_paused = true)]
    async fn faults_look_as_they_do_on_a_line() {
        let (mut master, simulator) = line(9600, Parity::None, 1.0);
        simulator.inject_into_unit(L1, 1, InjectedFault::Silent).await;
        assert_eq!(ask(&mut master, READ_TEN).await.0, Vec::<u8>::new());
        assert_eq!(ask(&mut master, READ_STEP).await.0.len(), 7);
        simulator.inject_into_unit(L1, 1, InjectedFault::Cut).await;
        assert_eq!(ask(&mut master, READ_TEN).await.0.len(), 12);
        simulator.inject_into_unit(L1, 1, InjectedFault::Late(Duration::from_millis(700))).await;
        let (frame, took) = ask(&mut master, READ_TEN).await;
        assert!(frame.len() == 25 && took > Duration::from_millis(743), "{took:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn another_unit_answers_while_one_is_late() {
        let (mut master, simulator) = line(9600, Parity::None, 1.0);
        simulator.inject_into_unit(L1, 1, InjectedFault::Late(Duration::from_millis(500))).await;
        master.write_all(&with_crc(READ_TEN)).await.expect("the line takes requests");
        tokio::time::advance(Duration::from_millis(100)).await;
        let (frames, _) = ask(&mut master, READ_STEP).await;
        assert_eq!((frames.len(), frames[0], frames[7]), (32, 2, 1));
    }

    #[tokio::test(start_paused = true)]
    async fn a_broadcast_is_obeyed_but_not_answered_nor_is_a_stranger() {
        let (mut master, _simulator) = line(9600, Parity::None, 1.0);
        assert_eq!(ask(&mut master, &[0, 6, 0x03, 0xEA, 0, 1]).await.0, Vec::<u8>::new());
        assert_eq!(ask(&mut master, &[9, 3, 0, 0, 0, 1]).await.0, Vec::<u8>::new());
        for unit in [1, 2] {
            assert_eq!(ask(&mut master, &[unit, 3, 0x03, 0xEA, 0, 1]).await.0, with_crc(&[unit, 3, 2, 0, 1]));
        }
    }

    /// The counter of bus communication errors (08/0C) of unit 2.
    #[tokio::test(start_paused = true)]
    async fn a_slave_counts_the_frames_that_it_could_not_read() {
        let (mut master, _simulator) = line(9600, Parity::None, 1.0);
        for corrupt in [&[1, 3, 0, 0, 0, 1, 0, 0][..], &[0xFF], &[2; 300]] {
            master.write_all(corrupt).await.expect("the line takes bytes");
            assert_eq!(gather(&mut master).await.0, Vec::<u8>::new());
        }
        let answer = ask(&mut master, &[2, 8, 0, 0x0C, 0, 0]).await.0;
        assert_eq!(answer, with_crc(&[2, 8, 0, 0x0C, 0, 3]));
    }

    const SEVEN_BITS: Serial = Serial { baud: 9600, data_bits: 7, parity: Parity::Even, stop_bits: 1 };

    async fn ask_ascii(master: &mut DuplexStream, frame: &str) -> (String, Duration) {
        master.write_all(frame.as_bytes()).await.expect("the line takes requests");
        let (answer, took) = gather(master).await;
        (String::from_utf8(answer).expect("ASCII"), took)
    }

    /// 17 characters there, 15 back, 5 ms of the device, no silence between.
    #[tokio::test(start_paused = true)]
    async fn ascii_takes_its_own_time() {
        let (mut master, _simulator) = serve(SEVEN_BITS, true, 1.0);
        let (answer, took) = ask_ascii(&mut master, ":010303EA00010E\r\n").await;
        assert_eq!(answer, ":01030202BC3C\r\n");
        let (took_ms, wire_ms) = (took.as_secs_f64() * 1e3, 320.0 / 9.6 + 5.0);
        assert!((wire_ms..wire_ms + 2.0).contains(&took_ms), "{took_ms} ms, the wire needs {wire_ms} ms");
    }

    #[tokio::test(start_paused = true)]
    async fn ascii_waits_a_second_and_restarts_at_a_colon() {
        let (mut master, simulator) = serve(SEVEN_BITS, true, 1.0);
        master.write_all(b":010303EA").await.expect("the line takes bytes");
        tokio::time::advance(Duration::from_millis(900)).await;
        assert_eq!(ask_ascii(&mut master, "00010E\r\n").await.0, ":01030202BC3C\r\n");
        // `gather` waits two seconds: too long for a frame.
        assert_eq!(ask_ascii(&mut master, ":010303EA").await.0, "");
        assert_eq!(ask_ascii(&mut master, "00010E\r\n").await.0, "");
        assert_eq!(ask_ascii(&mut master, ":0103:010303EA00010E\r\n").await.0, ":01030202BC3C\r\n");
        assert_eq!(ask_ascii(&mut master, ":010303EA00010F\r\n").await.0, "");
        assert_eq!(ask_ascii(&mut master, ":0208000C0000EA\r\n").await.0, ":0208000C0003E7\r\n");
        simulator.inject_into_unit(L1, 1, InjectedFault::BadCrc).await;
        assert_eq!(ask_ascii(&mut master, ":010303EA00010E\r\n").await.0, ":01030202BC30\r\n");
    }
}
