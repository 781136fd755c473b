//! A slave on a pseudo-terminal whose bytes come when a UART would deliver them.
//!
//! ```text
//!  the master writes          over on the wire          the answer begins        its last byte is here
//!  |— characters of request ——|— t3.5 ——————————————————|— characters of answer —|
//! ```
//! A pseudo-terminal carries a request at once; it is over only when a real line would have carried it, counted from its first
//! byte. The answer comes in pieces of eight characters, as Linux takes them out of a 16550, the last piece when it is over.

use std::{
    fs::{File, OpenOptions},
    io::{Read, Write},
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use rustix::{
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};
use sightglass::api::{bus::frame::with_crc, plant::Serial, sim::Receiver};

/// Characters that the UART hands over at once.
const FIFO: usize = 8;
/// The system wakes a sleeper this late at most, as a rule; the rest is spun.
const SPIN: Duration = Duration::from_micros(200);
/// Silence that ends what could not be read.
const SILENCE: Duration = Duration::from_millis(20);

/// Keeps the line open. The slave's thread ends once this is dropped and every client has closed the port.
pub struct PacedSlave {
    _port: File,
    /// By unit.
    served: Arc<[AtomicU64; 64]>,
    heard: Arc<AtomicU64>,
    hasty: Arc<AtomicU64>,
    /// A bit for each unit that does not answer.
    dead: Arc<AtomicU64>,
}

impl PacedSlave {
    /// Serves at so many baud with 8N1. The path is the port for a master to open.
    pub fn start(baud: u32) -> (PathBuf, PacedSlave) {
        PacedSlave::start_on(Serial { baud, ..Serial::USUAL })
    }

    /// Serves with other bits to a character.
    pub fn start_on(serial: Serial) -> (PathBuf, PacedSlave) {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&line).unwrap();
        unlockpt(&line).unwrap();
        let path = PathBuf::from(ptsname(&line, Vec::new()).unwrap().into_string().unwrap());
        let port = OpenOptions::new().read(true).write(true).open(&path).unwrap();
        let mut raw = tcgetattr(&port).unwrap();
        raw.make_raw();
        tcsetattr(&port, OptionalActions::Now, &raw).unwrap();
        let served = Arc::new(std::array::from_fn(|_| AtomicU64::new(0)));
        let [heard, hasty, dead]: [Arc<AtomicU64>; 3] = Default::default();
        let slave = PacedSlave { _port: port, served, heard, hasty, dead };
        let (served, heard) = (slave.served.clone(), slave.heard.clone());
        let (hasty, dead) = (slave.hasty.clone(), slave.dead.clone());
        thread::spawn(move || serve(File::from(line), serial, &dead, &served, [&heard, &hasty]));
        (path, slave)
    }

    /// From now on a unit below 64 does not answer.
    pub fn kill(&self, unit: u8) {
        self.dead.fetch_or(1 << unit, Ordering::Relaxed);
    }

    /// Requests answered so far.
    pub fn served(&self) -> u64 {
        self.served_by_unit().iter().sum()
    }

    /// The same by unit.
    pub fn served_by_unit(&self) -> [u64; 64] {
        std::array::from_fn(|unit| self.served[unit].load(Ordering::Relaxed))
    }

    /// Requests that have come whole, also those that have no answer.
    pub fn heard(&self) -> u64 {
        self.heard.load(Ordering::Relaxed)
    }

    /// Requests that began before the answer was followed by its 3.5 characters of silence: on a real line they are lost.
    pub fn hasty(&self) -> u64 {
        self.hasty.load(Ordering::Relaxed)
    }
}

fn serve(mut line: File, serial: Serial, dead: &AtomicU64, served: &[AtomicU64; 64], [heard, hasty]: [&AtomicU64; 2]) {
    let character = serial.char_time();
    let (mut receiver, mut bytes) = (Receiver::default(), [0; 512]);
    let (mut began, mut latest, mut quiet) = (Instant::now(), Instant::now(), Instant::now());
    // The read fails when the other end is closed.
    while let Ok(count) = line.read(&mut bytes) {
        let now = Instant::now();
        if now - latest > SILENCE {
            receiver.on_silent_interval();
        }
        if receiver.is_empty() {
            began = now;
            hasty.fetch_add(u64::from(now < quiet), Ordering::Relaxed);
        }
        latest = now;
        receiver.push(&bytes[..count]);
        // A whole request is followed by the silence that its answer waits for below.
        if receiver.is_whole()
            && let Some(request) = receiver.on_silent_interval()
        {
            heard.fetch_add(1, Ordering::Relaxed);
            let over = (began + character * request.len() as u32).max(now);
            began = over;
            let received = Some(&request[..request.len() - 2]).filter(|message| {
                let is_dead =
                    |unit: &u8| dead.load(Ordering::Relaxed) & 1u64.checked_shl((*unit).into()).unwrap_or(0) != 0;
                !message.first().is_some_and(is_dead)
            });
            let Some(answer) = received.and_then(super::answer) else { continue };
            // Before its last byte: who has read it finds it counted.
            served[usize::from(answer[0] % 64)].fetch_add(1, Ordering::Relaxed);
            let Ok(end) = say(&mut line, &with_crc(&answer), over + serial.silent_interval(), character) else {
                return;
            };
            quiet = end + serial.silent_interval();
        }
    }
}

/// Delivers a frame that begins at a given time; says when its last character was over.
fn say(line: &mut File, frame: &[u8], begins: Instant, character: Duration) -> std::io::Result<Instant> {
    let mut over = begins;
    for piece in frame.chunks(FIFO) {
        over += character * piece.len() as u32;
        wait_until(over);
        line.write_all(piece)?;
    }
    Ok(over)
}

/// Sleeps until just before and spins the rest.
fn wait_until(time: Instant) {
    thread::sleep(time.saturating_duration_since(Instant::now()).saturating_sub(SPIN));
    while Instant::now() < time {
        std::hint::spin_loop();
    }
}
