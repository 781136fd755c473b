//! What may happen to the bytes between the line and the listener.

use sightglass::api::plant::Framing;

use super::{
    dice::Dice,
    line::{Model, Sent},
};

/// How often each thing happens: to a byte, or to a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Damage {
    pub name: &'static str,
    pub lost_bytes: f64,
    /// One to three bits of a frame, and one byte of an ASCII frame.
    pub flipped: f64,
    /// The end of a frame and the beginning of the next are lost.
    pub merged: f64,
    pub lost_frames: f64,
    /// Two to six frames in a row.
    pub lost_runs: f64,
    /// Up to 64 bytes in a row, wherever they begin.
    pub lost_chunks: f64,
    pub duplicated: f64,
    /// One to four bytes of noise before a frame.
    pub noise: f64,
    /// Answers that come after the timeout of the master.
    pub late: f64,
    /// Spells in which a device takes about as long as its master waits.
    pub slow: f64,
    /// Two exchanges or more come at once, without a gap.
    pub glued: f64,
}

impl Damage {
    /// Modbus TCP has no check of its own: bytes that were changed, or cut away so that the rest fits again, go unnoticed.
    fn without_check(&self) -> Damage {
        Damage { flipped: 0.0, noise: 0.0, merged: 0.0, lost_chunks: 0.0, ..*self }
    }
}

/// A driver hands over no more bytes at once.
const PIECE_MAX: u64 = 16;

/// Bytes, and when they come to the listener.
pub type Piece = (u64, Vec<u8>);

/// What is carried from frame to frame.
#[derive(Default)]
pub struct Channel {
    /// Frames and bytes that are still to be lost.
    frames: u64,
    bytes: u64,
    /// Nothing comes before this time.
    held_until: u64,
}

impl Channel {
    /// What comes of a frame.
    pub fn pass(&mut self, sent: &Sent, damage: &Damage, model: &Model, dice: &mut Dice, pieces: &mut Vec<Piece>) {
        let damage = match model.framing {
            Framing::Mbap => &damage.without_check(),
            Framing::Rtu | Framing::Ascii => damage,
        };
        let bytes = self.damaged(sent.bytes.clone(), damage, dice);
        if dice.chance(damage.glued) {
            self.held_until = self.held_until.max(sent.end + 1_000 * (20 + dice.below(100)));
        }
        let copies = if dice.chance(damage.duplicated) { 2 } else { 1 };
        for _ in 0..copies {
            // In pieces, as a driver hands them over.
            let (mut rest, batch) = (&bytes[..], 1_000 * model.batch_ms.max(1));
            while !rest.is_empty() {
                let (piece, behind) = rest.split_at(rest.len().min(1 + dice.below(PIECE_MAX) as usize));
                let at = sent.end - (sent.end - sent.start) * behind.len() as u64 / bytes.len() as u64;
                let at = at.max(self.held_until).div_ceil(batch) * batch;
                pieces.push((at.max(pieces.last().map_or(0, |(last, _)| *last)), piece.to_vec()));
                rest = behind;
            }
        }
    }

    fn damaged(&mut self, mut bytes: Vec<u8>, damage: &Damage, dice: &mut Dice) -> Vec<u8> {
        let ascii = bytes.first() == Some(&b':');
        if dice.chance(damage.lost_runs) {
            self.frames = 2 + dice.below(5);
        }
        let run = self.frames;
        self.frames = run.saturating_sub(1);
        if 0 < run || dice.chance(damage.lost_frames) {
            return Vec::new();
        }
        if dice.chance(damage.flipped) {
            // A byte of ASCII is hit whole: its check, a sum, does not see two bits that make up for each other.
            let flips = if ascii { 1 } else { 1 + dice.below(3) };
            for _ in 0..flips {
                let place = dice.below(bytes.len() as u64) as usize;
                bytes[place] ^= if ascii { 1 + dice.below(127) as u8 } else { 1 << dice.below(8) };
            }
        }
        // What of the last frame's loss reaches into this one.
        let lost = std::mem::take(&mut self.bytes).min(bytes.len() as u64);
        bytes.drain(..lost as usize);
        if !bytes.is_empty() && dice.chance(damage.merged) {
            let tail = (1 + dice.below(bytes.len() as u64)) as usize;
            bytes.truncate(bytes.len() - tail);
            self.bytes = 1 + dice.below(8);
        }
        if !bytes.is_empty() && dice.chance(damage.lost_chunks) {
            let (from, run) = (dice.below(bytes.len() as u64) as usize, 1 + dice.below(64) as usize);
            let end = bytes.len().min(from + run);
            self.bytes = (run - (end - from)) as u64;
            bytes.drain(from..end);
        }
        bytes.retain(|_| !dice.chance(damage.lost_bytes));
        if dice.chance(damage.noise) {
            let noise: Vec<u8> = (0..=dice.below(4)).map(|_| dice.below(256) as u8).collect();
            bytes.splice(0..0, noise);
        }
        bytes
    }
}
