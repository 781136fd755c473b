//! A line that is heard: another master and its devices, frame by frame in virtual time.

use std::collections::VecDeque;

use sightglass::api::{
    bus::frame::{self, wrap},
    plant::{Fault, Framing},
};

use super::dice::Dice;

/// A read of the master's cycle, in every `every`th round.
#[derive(Debug, Clone, Copy)]
pub struct Ask {
    pub unit: u8,
    pub function: u8,
    pub address: u16,
    pub count: u16,
    pub every: u64,
}

pub const fn ask(unit: u8, function: u8, address: u16, count: u16) -> Ask {
    Ask { unit, function, address, count, every: 1 }
}

/// A master, its devices, and how their bytes reach the listener.
#[derive(Debug, Clone)]
pub struct Model {
    pub name: &'static str,
    pub framing: Framing,
    /// No wire time over TCP.
    pub baud: Option<u32>,
    pub cycle: Vec<Ask>,
    /// The rounds begin on a grid; without, one follows the other.
    pub round_ms: u64,
    pub shuffled: bool,
    /// Writes of all functions between the reads, and devices that refuse.
    pub writes: bool,
    /// Bytes come in batches, as USB adapters hand them over.
    pub batch_ms: u64,
    /// Every transaction has a number of its own, where the framing has numbers.
    pub numbered: bool,
    /// Most that a device takes before it answers; and the master waits so long.
    pub answer_ms: u64,
    pub timeout_ms: u64,
}

/// A frame on the wire, in microseconds.
#[derive(Debug, Clone)]
pub struct Sent {
    pub start: u64,
    pub end: u64,
    pub bytes: Vec<u8>,
}

/// What a register holds; other registers and other seconds hold other numbers. A bit is the last one of it.
pub fn held(unit: u8, function: u8, address: u16, second: u64) -> u16 {
    let place = u64::from(unit) << 32 | u64::from(function) << 16 | u64::from(address);
    let mixed = (place ^ second.wrapping_mul(0x9E37_79B9_7F4A_7C15)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    ((mixed ^ mixed >> 29).wrapping_mul(0xD6E8_FEB8_6659_FD93) >> 40) as u16
}

/// Addresses from here on are refused.
pub const REFUSED: u16 = 0x8000;

/// The answer of a device, as of `now`.
fn answer(request: &[u8], now: u64) -> Vec<u8> {
    let (unit, function) = (request[0], request[1]);
    let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
    if REFUSED <= word(2) {
        return vec![unit, function | 0x80, 2];
    }
    let values = || (0..word(4)).map(|place| held(unit, function, word(2) + place, now / 1_000_000));
    let with_count = |data: Vec<u8>| [&[unit, function, data.len() as u8][..], &data].concat();
    match function {
        1 | 2 => {
            let bits: Vec<u16> = values().map(|value| value & 1).collect();
            let byte = |bits: &[u16]| bits.iter().rev().fold(0, |byte, bit| byte << 1 | *bit as u8);
            with_count(bits.chunks(8).map(byte).collect())
        }
        3 | 4 | 0x17 => with_count(values().flat_map(u16::to_be_bytes).collect()),
        0x0F | 0x10 => request[..6].to_vec(),
        _ => request.to_vec(),
    }
}

/// The master and its devices at work.
pub struct World {
    pub model: Model,
    pub dice: Dice,
    /// So many answers come later than the master waits, and so many begin a spell of slow ones.
    late: f64,
    slow: f64,
    /// Values that were asked for.
    pub values: u64,
    now: u64,
    round: u64,
    transaction: u16,
    /// Answers under way: when each begins, its frame and its message.
    under_way: VecDeque<(u64, Vec<u8>, Vec<u8>)>,
    /// When the devices are free for the next request, and how many of their answers are still to be slow.
    free_at: u64,
    slow_left: u64,
}

impl World {
    pub fn new(model: &Model, (late, slow): (f64, f64), seed: u64) -> World {
        World {
            model: model.clone(),
            dice: Dice(seed),
            late,
            slow,
            values: 0,
            now: 1_000_000,
            round: 0,
            transaction: 0,
            under_way: VecDeque::new(),
            free_at: 0,
            slow_left: 0,
        }
    }

    fn wire(&self, bytes: &[u8]) -> u64 {
        self.model.baud.map_or(0, |baud| 11_000_000 * bytes.len() as u64 / u64::from(baud))
    }

    /// The frames of the next round, in order.
    pub fn round(&mut self) -> Vec<Sent> {
        let mut sent = Vec::new();
        let round = self.round;
        let mut cycle: Vec<Ask> =
            self.model.cycle.iter().filter(|ask| round.is_multiple_of(ask.every)).copied().collect();
        if self.model.shuffled {
            for place in (1..cycle.len()).rev() {
                cycle.swap(place, self.dice.below(place as u64 + 1) as usize);
            }
        }
        let began = self.now;
        for ask in &cycle {
            let [high, low] = ask.address.to_be_bytes();
            self.values += if ask.address < REFUSED { u64::from(ask.count) } else { 0 };
            self.exchange(vec![ask.unit, ask.function, high, low, 0, ask.count as u8], &mut sent);
            if self.model.writes && self.dice.chance(0.1) {
                let request = self.write(ask);
                self.exchange(request, &mut sent);
            }
        }
        self.round += 1;
        self.now = self.now.max(began + 1_000 * self.model.round_ms);
        self.deliver(self.now, &mut sent);
        sent
    }

    /// A write of any function, to places that are not read; function 23 reads too.
    fn write(&mut self, ask: &Ask) -> Vec<u8> {
        let value = self.dice.below(256) as u8;
        let function = [5, 6, 0x0F, 0x10, 0x16, 0x17, 3][self.dice.below(7) as usize];
        let head = vec![ask.unit, function, 0x20, self.dice.below(8) as u8];
        let rest: &[u8] = match function {
            5 => &[0xFF, 0],
            6 => &[0, value],
            0x0F => &[0, 8, 1, value],
            0x10 => &[0, 2, 4, 0, value, 0, 1],
            0x16 => &[0, value, 0, 1],
            0x17 => &[0, ask.count as u8, 0x21, 0, 0, 1, 2, 0, value],
            // A place that the device does not have.
            _ => return vec![ask.unit, ask.function, 0x80, value, 0, ask.count as u8],
        };
        [head, rest.to_vec()].concat()
    }

    fn exchange(&mut self, request: Vec<u8>, sent: &mut Vec<Sent>) {
        if self.model.numbered {
            self.transaction = self.transaction.wrapping_add(1);
        }
        let bytes = wrap(self.model.framing, self.transaction, &request);
        let (start, end) = (self.now, self.now + self.wire(&bytes));
        self.deliver(start, sent);
        sent.push(Sent { start, end, bytes });
        let usual = 1_000 * (1 + self.model.answer_ms / 4) + self.dice.below(750 * self.model.answer_ms);
        let late = 1_000 * self.model.timeout_ms + self.dice.below(4_000 * self.model.timeout_ms);
        if self.dice.chance(self.slow) {
            self.slow_left = 1 + self.dice.below(40);
        }
        let slow = 800 * self.model.timeout_ms + self.dice.below(800 * self.model.timeout_ms);
        let takes = match (0 < self.slow_left, self.dice.chance(self.late)) {
            (true, _) => slow,
            (false, true) => late,
            (false, false) => usual,
        };
        self.slow_left = self.slow_left.saturating_sub(1);
        let begins = end.max(self.free_at) + takes;
        let message = answer(&request, begins);
        let bytes = wrap(self.model.framing, self.transaction, &message);
        self.free_at = begins + self.wire(&bytes);
        self.under_way.push_back((begins, bytes, message));
        // It takes the first answer that may be the one to its request.
        let deadline = end + 1_000 * self.model.timeout_ms;
        let numbered = self.model.framing == Framing::Mbap && self.model.numbered;
        self.now = deadline;
        while let Some((begins, bytes, message)) = self.under_way.pop_front_if(|(begins, ..)| *begins <= deadline) {
            let end = begins + self.wire(&bytes);
            let own = !numbered || bytes.starts_with(&self.transaction.to_be_bytes());
            sent.push(Sent { start: begins, end, bytes });
            let fits = matches!(
                frame::check_answer(self.model.framing, &request, &message),
                Ok(()) | Err(Fault::Exception(_))
            );
            if fits && own {
                self.now = end;
                break;
            }
        }
        self.now += 1_000 * (1 + self.model.answer_ms / 4) + self.dice.below(250 * self.model.answer_ms);
    }

    /// Late answers that the master does not wait for any more.
    fn deliver(&mut self, until: u64, sent: &mut Vec<Sent>) {
        while let Some((start, bytes, _)) = self.under_way.pop_front_if(|(begins, ..)| *begins <= until) {
            let end = start + self.wire(&bytes);
            sent.push(Sent { start, end, bytes });
        }
    }
}
