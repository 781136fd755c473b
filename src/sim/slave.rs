//! A device as a slave on its line: it counts what it hears and says, and tells that by the functions 08, 0B and 0C.

use std::collections::VecDeque;

use super::pdu::{self, Registers};
use crate::plant::fault::ExceptionCode;
use crate::{bus, plant::number::to_u8};

/// Events in the log (V1.1b3, 6.10); the oldest makes room.
const LOG_MAX: usize = 64;

/// A device with its counters.
#[derive(Debug, Clone)]
pub struct Slave<D> {
    /// What it serves.
    pub device: D,
    counters: Counters,
}

/// The counters of function 08, sub-functions 0B to 12, in their order (V1.1b3, 6.8), and those of 0B and 0C. All wrap.
#[derive(Debug, Clone, Default)]
struct Counters {
    diagnostic: [u16; 8],
    done: u16,
    log: VecDeque<u8>,
}

/// Places in [`Counters::diagnostic`].
const HEARD: usize = 0;
const CORRUPT: usize = 1;
const EXCEPTIONS: usize = 2;
const ADDRESSED: usize = 3;
const UNANSWERED: usize = 4;
const NEGATIVE: usize = 5;
const BUSY: usize = 6;

/// Bits of an event (V1.1b3, 6.10).
const RECEIVED: u8 = 1 << 7;
const RECEIVED_CORRUPT: u8 = RECEIVED | 1 << 1;
const RECEIVED_BROADCAST: u8 = RECEIVED | 1 << 6;
const SENT: u8 = 1 << 6;

/// A unit as its line sees it, whatever device it is.
pub trait Unit {
    /// Answers a request; an empty one has no answer, nor one that the device holds back.
    fn respond(&mut self, pdu: &[u8]) -> Option<Vec<u8>>;
    /// Does what a broadcast says, without a response.
    fn serve_broadcast(&mut self, pdu: &[u8]);
    /// Refuses a request with a code of the caller's choice.
    fn refuse(&mut self, pdu: &[u8], code: u8) -> Option<Vec<u8>>;
    /// Counts a message for another unit.
    fn on_foreign_message(&mut self);
    /// Counts a message that could not be read.
    fn on_corrupt_message(&mut self);
}

impl<D> Slave<D> {
    /// All counters at zero.
    pub fn new(device: D) -> Slave<D> {
        Slave { device, counters: Counters::default() }
    }
}

impl<D: Registers> Unit for Slave<D> {
    fn on_foreign_message(&mut self) {
        self.counters.count(HEARD);
    }

    fn on_corrupt_message(&mut self) {
        self.counters.count(CORRUPT);
        self.counters.note(RECEIVED_CORRUPT);
    }

    fn respond(&mut self, pdu: &[u8]) -> Option<Vec<u8>> {
        let (&function, data) = pdu.split_first()?;
        self.counters.addressed(RECEIVED);
        if self.device.holds_back(function) {
            self.counters.count(UNANSWERED);
            return None;
        }
        let reply = match function {
            0x08 | 0x0B | 0x0C if self.device.functions().contains(&function) => {
                self.counters.serve(function, data).unwrap_or_else(|refusal| pdu::exception(function, refusal.0))
            }
            _ => pdu::serve(&mut self.device, pdu)?,
        };
        self.counters.answered(function, &reply);
        Some(reply)
    }

    fn serve_broadcast(&mut self, pdu: &[u8]) {
        self.counters.addressed(RECEIVED_BROADCAST);
        self.counters.count(UNANSWERED);
        let writes = |function: u8| bus::pdu::function(function).is_some_and(bus::pdu::Function::writes);
        let heard = |function: &u8| writes(*function) && !self.device.holds_back(*function);
        if let Some(function) = pdu.first().copied().filter(heard)
            && let Some(reply) = pdu::serve(&mut self.device, pdu)
        {
            self.counters.answered(function, &reply);
        }
    }

    fn refuse(&mut self, pdu: &[u8], code: u8) -> Option<Vec<u8>> {
        let reply = pdu::exception(*pdu.first()?, code);
        self.counters.addressed(RECEIVED);
        self.counters.answered(pdu[0], &reply);
        Some(reply)
    }
}

impl Counters {
    fn count(&mut self, place: usize) {
        self.diagnostic[place] = self.diagnostic[place].wrapping_add(1);
    }

    fn note(&mut self, event: u8) {
        self.log.truncate(LOG_MAX - 1);
        self.log.push_front(event);
    }

    fn addressed(&mut self, event: u8) {
        self.count(HEARD);
        self.count(ADDRESSED);
        self.note(event);
    }

    /// Function 0B itself does not count as done, nor does what was refused (V1.1b3, 6.9).
    fn answered(&mut self, function: u8, reply: &[u8]) {
        let event = match reply {
            [0x80..=0xFF, code] => {
                self.count(EXCEPTIONS);
                match code {
                    1..=3 => 1 << 0,
                    5 | 6 => {
                        self.count(BUSY);
                        1 << 2
                    }
                    7 => {
                        self.count(NEGATIVE);
                        1 << 3
                    }
                    _ => 1 << 1,
                }
            }
            _ => {
                self.done = self.done.wrapping_add(u16::from(function != 0x0B));
                0
            }
        };
        self.note(SENT | event);
    }

    fn serve(&mut self, function: u8, data: &[u8]) -> Result<Vec<u8>, ExceptionCode> {
        let ready = [0, 0];
        match (function, data) {
            (0x08, [high, low, data @ ..]) => self.diagnose(u16::from_be_bytes([*high, *low]), data),
            (0x0B, []) => Ok([&[function], &ready[..], &self.done.to_be_bytes()].concat()),
            (0x0C, []) => {
                let counts = [ready, self.done.to_be_bytes(), self.diagnostic[HEARD].to_be_bytes()].concat();
                let length = to_u8(counts.len() + self.log.len());
                Ok([function, length].into_iter().chain(counts).chain(self.log.iter().copied()).collect())
            }
            _ => Err(ExceptionCode::ILLEGAL_VALUE),
        }
    }

    fn diagnose(&mut self, what: u16, data: &[u8]) -> Result<Vec<u8>, ExceptionCode> {
        let reply = |data: &[u8]| Ok([&[0x08], &what.to_be_bytes()[..], data].concat());
        match what {
            0x00 => reply(data),
            0x0A..=0x12 if data != [0, 0] => Err(ExceptionCode::ILLEGAL_VALUE),
            0x0A => {
                (self.diagnostic, self.done) = ([0; 8], 0);
                reply(data)
            }
            0x0B..=0x12 => reply(&self.diagnostic[usize::from(what - 0x0B)].to_be_bytes()),
            _ => Err(ExceptionCode::ILLEGAL_FUNCTION),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::dl06::Dl06;
    use crate::sim::pxr::Pxr;

    fn assert_reply(slave: &mut Slave<Dl06>, request: &[u8], expect: &[u8]) {
        assert_eq!(slave.respond(request).as_deref(), Some(expect), "request {request:02X?}");
    }

    fn counters(slave: &Slave<Dl06>) -> [u16; 8] {
        let mut copy = slave.clone();
        std::array::from_fn(|place| {
            let reply = copy.counters.serve(8, &[0, 0x0B + place as u8, 0, 0]).expect("every counter is there");
            u16::from_be_bytes([reply[3], reply[4]])
        })
    }

    #[test]
    fn an_echo_brings_back_every_byte() {
        let slave = &mut Slave::new(Dl06::new());
        assert_reply(slave, &[8, 0, 0, 0xA5, 0x37], &[8, 0, 0, 0xA5, 0x37]);
        assert_reply(slave, &[8, 0, 0], &[8, 0, 0]);
        assert_reply(slave, &[8, 0, 0, 1, 2, 3, 4, 5], &[8, 0, 0, 1, 2, 3, 4, 5]);
        assert_reply(slave, &[8, 0, 0x0B, 0, 1], &[0x88, 3]);
        assert_reply(slave, &[8, 0, 0x15, 0, 0], &[0x88, 1]);
        assert_reply(slave, &[8, 0], &[0x88, 3]);
    }

    #[test]
    fn what_happens_on_the_line_is_counted() {
        let slave = &mut Slave::new(Dl06::new());
        assert_reply(slave, &[3, 4, 0, 0, 1], &[3, 2, 0, 0]);
        assert_reply(slave, &[3, 4, 0, 0, 0], &[0x83, 3]);
        slave.on_foreign_message();
        slave.on_corrupt_message();
        slave.serve_broadcast(&[6, 4, 0x10, 0, 1]);
        slave.refuse(&[3, 4, 0, 0, 1], 6);
        slave.refuse(&[3, 4, 0, 0, 1], 7);
        assert_eq!(counters(slave), [6, 1, 3, 5, 1, 1, 1, 0]);
        assert_reply(slave, &[0x0B], &[0x0B, 0, 0, 0, 2]);
        // Newest first; the request for the log is in it already.
        let log = [0x80, 0x40, 0x80, 0x48, 0x80, 0x44, 0x80, 0x40, 0xC0, 0x82, 0x41, 0x80, 0x40, 0x80];
        assert_reply(slave, &[0x0C], &[&[0x0C, 20, 0, 0, 0, 2, 0, 8], &log[..]].concat());
        assert_reply(slave, &[8, 0, 0x0A, 0, 0], &[8, 0, 0x0A, 0, 0]);
        assert_eq!(counters(slave), [0; 8]);
    }

    #[test]
    fn the_log_keeps_the_latest_64_events() {
        let slave = &mut Slave::new(Dl06::new());
        (0..100).for_each(|_| slave.on_corrupt_message());
        let reply = slave.respond(&[0x0C]).expect("an answer");
        assert_eq!((reply.len(), reply[1], reply[8], reply[9], reply[71]), (72, 70, 0x80, 0x82, 0x82));
    }

    #[test]
    fn a_broadcast_is_obeyed_only_where_it_writes() {
        let slave = &mut Slave::new(Dl06::new());
        slave.serve_broadcast(&[8, 0, 0x0A, 0, 0]);
        slave.serve_broadcast(&[6, 4, 0x20, 0x12, 0x34]);
        slave.serve_broadcast(&[]);
        assert_reply(slave, &[3, 4, 0x20, 0, 1], &[3, 2, 0x12, 0x34]);
        assert_eq!(counters(slave)[ADDRESSED], 4);
    }

    #[test]
    fn a_controller_without_diagnostics_says_so() {
        let mut pxr = Slave::new(Pxr::new(27.0));
        for function in [0x07, 0x08, 0x0B, 0x0C, 0x11, 0x16, 0x17, 0x18, 0x2B] {
            assert_eq!(pxr.respond(&[function, 0, 0, 0, 0]), Some(vec![function | 0x80, 1]));
        }
    }
}
