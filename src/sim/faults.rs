//! Faults on demand: what a unit does wrong with a request, and the answer as it then leaves the device.

use std::collections::BTreeMap;
use std::time::Duration;

use super::ascii;
use super::world::World;
use crate::{bus::frame::with_crc, plant::def::LineId};

/// What is wrong with a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// It hears nothing and does nothing.
    Silent,
    /// It does what it is told and answers this much late (plant time).
    Late(Duration),
    /// It does what it is told; the answer arrives with a wrong check.
    BadCrc,
    /// It does what it is told; the answer breaks off in the middle.
    Truncated,
    /// It does nothing and answers with this exception code.
    Exception(u8),
}

/// The faults of all units.
#[derive(Debug, Clone, Default)]
pub struct Faults(BTreeMap<(LineId, u8), Fault>);

/// What leaves a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    unit: u8,
    pdu: Vec<u8>,
    damage: Damage,
    /// Time between the end of the request and the beginning of the answer (plant time).
    pub delay: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Damage {
    None,
    Check,
    Cut,
}

impl Faults {
    /// Sets what is wrong with a unit.
    pub fn set(&mut self, line: LineId, unit: u8, fault: Fault) {
        self.0.insert((line, unit), fault);
    }

    /// What is wrong with a unit.
    pub fn of(&self, line: LineId, unit: u8) -> Fault {
        self.0.get(&(line, unit)).copied().unwrap_or_default()
    }

    /// Lets the world answer a request, or the fault in its place. `None`: nothing comes back.
    pub fn answer(&self, world: &mut World, line: LineId, unit: u8, request: &[u8]) -> Option<Answer> {
        let delay = world.reply_delay(line, unit);
        let plain = |pdu| Answer { unit, pdu, damage: Damage::None, delay };
        if world.is_broadcast(line, unit) {
            world.broadcast(line, request, |unit| !matches!(self.of(line, unit), Fault::Silent | Fault::Exception(_)));
            return None;
        }
        match self.of(line, unit) {
            Fault::None => world.respond(line, unit, request).map(plain),
            Fault::Silent => {
                world.overhear(line, unit);
                None
            }
            Fault::Late(by) => world
                .respond(line, unit, request)
                .map(plain)
                .map(|answer| Answer { delay: answer.delay + by, ..answer }),
            Fault::BadCrc => {
                world.respond(line, unit, request).map(plain).map(|answer| Answer { damage: Damage::Check, ..answer })
            }
            Fault::Truncated => {
                world.respond(line, unit, request).map(plain).map(|answer| Answer { damage: Damage::Cut, ..answer })
            }
            Fault::Exception(code) => world.refuse(line, unit, request, code).map(plain),
        }
    }
}

impl Answer {
    /// The bytes on a serial line.
    pub fn rtu(&self) -> Vec<u8> {
        let mut frame = with_crc(&self.message());
        match self.damage {
            Damage::None => {}
            Damage::Check => {
                if let Some(last) = frame.last_mut() {
                    *last ^= 0xFF;
                }
            }
            Damage::Cut => frame.truncate(frame.len() / 2),
        }
        frame
    }

    /// The characters on a line in ASCII mode.
    pub fn ascii(&self) -> Vec<u8> {
        let mut frame = ascii::encode(&self.message());
        match self.damage {
            Damage::None => {}
            Damage::Check => {
                // The last digit of the LRC becomes another one.
                let digit = frame.len() - 3;
                frame[digit] = if frame[digit] == b'0' { b'1' } else { b'0' };
            }
            Damage::Cut => frame.truncate(frame.len() / 2),
        }
        frame
    }

    /// The bytes on a TCP connection. There is no check to spoil: a wrong transaction number is the nearest thing.
    pub fn tcp(&self, transaction: u16) -> Vec<u8> {
        let transaction = if self.damage == Damage::Check { transaction ^ 0xFF00 } else { transaction };
        let message = self.message();
        let mut frame = transaction.to_be_bytes().to_vec();
        frame.extend_from_slice(&[0, 0]);
        frame.extend_from_slice(&(message.len() as u16).to_be_bytes());
        frame.extend_from_slice(&message);
        if self.damage == Damage::Cut {
            frame.truncate(frame.len() / 2);
        }
        frame
    }

    fn message(&self) -> Vec<u8> {
        [&[self.unit], &self.pdu[..]].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bus::frame::crc16, sim::rig::Rig};

    const L1: LineId = LineId(0);

    const READ_SV: [u8; 5] = [3, 0x03, 0xEA, 0, 1];
    const WRITE_SV: [u8; 5] = [6, 0x03, 0xEA, 0x01, 0xF4];

    fn check(fault: Fault, expect: Option<(usize, bool)>, written: bool) {
        let (mut world, mut faults) = (World::tank(Rig::new()), Faults::default());
        faults.set(L1, 1, fault);
        let answer = faults.answer(&mut world, L1, 1, &READ_SV);
        let seen = answer.map(|answer| answer.rtu()).map(|frame| (frame.len(), crc16(&frame) == 0));
        assert_eq!(seen, expect, "{fault:?}: length and check");
        let answered = faults.answer(&mut world, L1, 1, &WRITE_SV).is_some();
        assert_eq!(answered, expect.is_some());
        assert_eq!(world.respond(L1, 1, &READ_SV) == Some(vec![3, 2, 0x01, 0xF4]), written, "{fault:?}");
        assert!(faults.answer(&mut world, L1, 2, &[1, 8, 0, 0, 1]).is_some(), "{fault:?} of another unit");
    }

    #[test]
    fn each_fault_looks_as_it_does_on_the_line() {
        check(Fault::None, Some((7, true)), true);
        check(Fault::Silent, None, false);
        check(Fault::Late(Duration::from_secs(1)), Some((7, true)), true);
        check(Fault::BadCrc, Some((7, false)), true);
        check(Fault::Truncated, Some((3, false)), true);
        check(Fault::Exception(4), Some((5, true)), false);
    }

    #[test]
    fn the_same_answer_in_ascii() {
        let (mut world, mut faults) = (World::tank(Rig::new()), Faults::default());
        let frame =
            |faults: &Faults, world: &mut World| faults.answer(world, L1, 1, &READ_SV).map(|answer| answer.ascii());
        assert_eq!(frame(&faults, &mut world).as_deref(), Some(&b":01030202BC3C\r\n"[..]));
        faults.set(L1, 1, Fault::BadCrc);
        assert_eq!(frame(&faults, &mut world).as_deref(), Some(&b":01030202BC30\r\n"[..]));
        faults.set(L1, 1, Fault::Truncated);
        assert_eq!(frame(&faults, &mut world).as_deref(), Some(&b":010302"[..]));
    }

    #[test]
    fn a_broadcast_passes_by_a_silent_unit() {
        let (mut world, mut faults) = (World::tank(Rig::new()), Faults::default());
        faults.set(L1, 1, Fault::Silent);
        assert_eq!(faults.answer(&mut world, L1, 0, &WRITE_SV), None);
        assert_eq!(world.respond(L1, 1, &READ_SV), Some(vec![3, 2, 0x02, 0xBC]));
        assert_eq!(world.respond(L1, 2, &READ_SV), Some(vec![3, 2, 0x01, 0xF4]));
    }

    #[test]
    fn a_late_answer_says_how_late() {
        let (mut world, mut faults) = (World::tank(Rig::new()), Faults::default());
        let delay =
            |faults: &Faults, world: &mut World| faults.answer(world, L1, 1, &READ_SV).map(|answer| answer.delay);
        assert_eq!(delay(&faults, &mut world), Some(Duration::from_millis(5)));
        faults.set(L1, 1, Fault::Late(Duration::from_millis(700)));
        assert_eq!(delay(&faults, &mut world), Some(Duration::from_millis(705)));
    }

    #[test]
    fn the_same_answer_on_tcp() {
        let (mut world, mut faults) = (World::tank(Rig::new()), Faults::default());
        let frame =
            |faults: &Faults, world: &mut World| faults.answer(world, L1, 1, &READ_SV).map(|answer| answer.tcp(0x1234));
        assert_eq!(frame(&faults, &mut world), Some(vec![0x12, 0x34, 0, 0, 0, 5, 1, 3, 2, 0x02, 0xBC]));
        faults.set(L1, 1, Fault::BadCrc);
        assert_eq!(frame(&faults, &mut world).map(|frame| frame[..2].to_vec()), Some(vec![0xED, 0x34]));
    }
}
