//! Slow devices whose registers change: a value that is older than the request that it answers betrays itself.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    sync::mpsc,
    time::Instant,
};

use super::slave::{Line, MS, Mode, line, plant};
use crate::{
    bus::frame,
    plant::{event::Event, line_state::LineState},
};

/// Registers hold the time of the device in these steps.
const STEP: Duration = Duration::from_millis(10);
/// A request reaches the device in memory at once, and is over for the master after its time on the wire.
const TOLERANCE: Duration = Duration::from_millis(50);

const SECOND: Duration = Duration::from_secs(1);
/// How long processes live that are killed.
const LIVES: [Duration; 4] =
    [Duration::from_millis(1_300), Duration::from_millis(4_100), Duration::from_millis(700), Duration::from_secs(9)];

/// What a device does with a request that comes while it is at work on another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Busy {
    /// It waits for its turn.
    Queues,
    /// It is not heard.
    Deaf,
    /// It is answered in its own time: answers overtake each other.
    Overtakes,
}

/// When a device answers.
#[derive(Debug, Clone, Copy)]
enum Late {
    /// Never.
    Never,
    /// One in five answers.
    Some,
    /// None for twenty seconds, all of the next twenty.
    InTurns,
}

/// A device.
#[derive(Debug, Clone, Copy)]
struct Device {
    mode: Mode,
    busy: Busy,
    late: Late,
    by: Duration,
    /// Each answer is sent again after this.
    again: Option<Duration>,
    loopback: bool,
    /// Its bytes come one by one, a character time apart, instead of a frame at once.
    paced: bool,
}

impl Device {
    /// How long it needs for its n-th request.
    fn delay(&self, number: u64, since: Duration) -> Duration {
        // As good as chance, and the same in each run.
        let chance = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407) >> 33;
        let late = match self.late {
            Late::Never => false,
            Late::Some => chance.is_multiple_of(5),
            Late::InTurns => (since.as_secs() / 20) % 2 == 1,
        };
        if late { self.by } else { 5 * MS + Duration::from_millis(chance % 20) }
    }

    /// Serves one port after the other: what one that was closed did not get goes out at the next.
    async fn serve(self, start: Instant, mut ports: mpsc::Receiver<DuplexStream>) {
        let Some(mut port) = ports.recv().await else { return };
        let (mut open, mut buffer, mut number, mut busy_until) = (true, Vec::new(), 0, start);
        let mut due: Vec<(Instant, Vec<u8>)> = Vec::new();
        loop {
            due.sort_by_key(|(at, _)| *at);
            let first = due.first().map(|(at, _)| *at);
            let mut chunk = [0; 256];
            tokio::select! {
                biased;
                next = ports.recv() => match next {
                    Some(next) => {
                        (port, open) = (next, true);
                        buffer.clear();
                    }
                    None => return,
                },
                read = port.read(&mut chunk), if open => match read {
                    Ok(0) | Err(_) => open = false,
                    Ok(count) => buffer.extend_from_slice(&chunk[..count]),
                },
                () = tokio::time::sleep_until(first.unwrap_or(start)), if first.is_some() => {
                    let (at, mut frame) = due.remove(0);
                    if self.paced && 1 < frame.len() {
                        due.insert(0, (at + MS, frame.split_off(1)));
                    }
                    if open {
                        let _ = port.write_all(&frame).await;
                    }
                }
            }
            while let Some(end) = self.mode.end(&buffer) {
                let request: Vec<u8> = buffer.drain(..end).collect();
                let transaction = u16::from_be_bytes([request[0], request[1]]);
                let message = frame::unwrap(self.mode.framing(), &request).expect("the master sends good frames");
                let now = Instant::now();
                let taken = if self.busy == Busy::Queues { busy_until.max(now) } else { now };
                if (self.busy == Busy::Deaf && now < busy_until) || (message[1] == 8 && !self.loopback) {
                    continue;
                }
                number += 1;
                let at = taken + self.delay(number, now - start);
                busy_until = at;
                let held = ((taken - start).as_millis() / STEP.as_millis()) as u16;
                let answer = match message[1] {
                    3 => [message[0], 3, 2 * message[5]]
                        .into_iter()
                        .chain(held.to_be_bytes().repeat(usize::from(message[5])))
                        .collect(),
                    _ => message.clone(),
                };
                let answer = frame::wrap(self.mode.framing(), transaction, &answer);
                due.extend(self.again.map(|again| (at + again, answer.clone())));
                due.push((at, answer));
            }
        }
    }
}

/// What came of a run.
#[derive(Debug, Default)]
struct Seen {
    good: usize,
    failed: usize,
    /// By how much values were older than the requests that they were taken for.
    stale: Vec<Duration>,
}

/// Polls a device for a minute; the process is killed and started again each time after one of `lives`, if there are any.
async fn run(device: Device, timeout: Duration, lives: &[Duration]) -> Seen {
    let mut def = plant(device.mode);
    def.lines[0].timeout = timeout;
    let start = Instant::now();
    let (ports, served) = mpsc::channel(4);
    tokio::spawn(device.serve(start, served));
    let (mut came, mut lives) = (Seen::default(), lives.iter().cycle());
    while start.elapsed() < Duration::from_secs(60) {
        let born = Instant::now();
        let mut line = line(def.clone());
        let plug = async |line: &Line| {
            let (ours, theirs) = tokio::io::duplex(4096);
            line.ports.try_send(ours).expect("room for a port");
            ports.send(theirs).await.expect("the device runs");
        };
        plug(&line).await;
        let ends = born + lives.next().copied().unwrap_or(Duration::from_secs(60));
        loop {
            let event = tokio::select! {
                biased;
                () = tokio::time::sleep_until(ends) => break,
                event = line.events.recv() => event.expect("the line runs"),
            };
            take(&mut came, &event, born - start);
            if matches!(event, Event::Line { state: LineState::Waiting { .. }, .. }) {
                plug(&line).await;
            }
        }
        line.kill();
    }
    came
}

fn take(came: &mut Seen, event: &Event, born: Duration) {
    match event {
        Event::Read { values, exchange: Some(exchange), .. } => {
            came.good += 1;
            let sent = exchange.at.duration_since(Timestamp::UNIX_EPOCH)
                + SignedDuration::try_from(born).expect("a time of the test");
            for (_, raw) in values {
                let held = SignedDuration::from_millis(raw.near() as i64 * STEP.as_millis() as i64);
                if let Ok(older) = Duration::try_from(sent - held)
                    && TOLERANCE < older
                {
                    came.stale.push(older);
                    break;
                }
            }
        }
        Event::Failed { .. } => came.failed += 1,
        _ => {}
    }
}

#[tokio::test(start_paused = true)]
async fn a_late_answer_is_never_taken_for_a_later_one() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        for (busy, late, lives) in [
            (Busy::Queues, Late::Some, &[][..]),
            (Busy::Queues, Late::InTurns, &[]),
            (Busy::Queues, Late::InTurns, &LIVES),
            (Busy::Deaf, Late::Some, &[]),
            (Busy::Deaf, Late::InTurns, &LIVES),
        ] {
            for (by, paced) in [(400 * MS, false), (2_500 * MS, true)] {
                let device = Device { mode, busy, late, by, again: None, loopback: false, paced };
                let came = run(device, SECOND, lives).await;
                assert!(came.stale.is_empty() && 0 < came.good, "{device:?}: {came:?}");
            }
        }
    }
}

/// No serial device does this, but some gateways and radio modems do. What comes when it cannot come any more betrays it.
#[tokio::test(start_paused = true)]
async fn answers_that_overtake_each_other_are_found_out() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        for by in [1_500 * MS, 2_500 * MS] {
            let (busy, late) = (Busy::Overtakes, Late::Some);
            let device = Device { mode, busy, late, by, again: None, loopback: true, paced: false };
            let came = run(device, SECOND, &[]).await;
            assert!(came.stale.len() <= 2 && 10 < came.good, "{device:?}: {came:?}");
        }
    }
}

/// As bytes come over a serial line, so few at a time that no piece is a whole frame.
#[tokio::test(start_paused = true)]
async fn frames_that_come_in_pieces_are_known_as_repeated() {
    for mode in [Mode::Rtu, Mode::Ascii] {
        let (busy, late, by, again) = (Busy::Queues, Late::Never, SECOND, Some(400 * MS));
        let device = Device { mode, busy, late, by, again, loopback: true, paced: true };
        let came = run(device, SECOND, &[]).await;
        assert!(came.stale.is_empty() && 0 < came.failed && 0 < came.good, "{device:?}: {came:?}");
    }
}
