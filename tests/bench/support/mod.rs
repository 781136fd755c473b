//! Slaves for benches, in which register N holds N: [`PacedSlave`] at the pace of a UART, [`TcpSlave`] as fast as it can.
#![allow(dead_code, reason = "each bench takes what it needs")]

mod paced;
mod tcp;

pub use paced::PacedSlave;
pub use tcp::TcpSlave;

use sightglass::api::{
    plant::{ExceptionCode, Limits, Table},
    sim::pdu::{self, Registers},
};

/// Every register holds its address, odd coils are on; what is written is acknowledged and forgotten.
#[derive(Clone)]
struct Numbers;

impl Registers for Numbers {
    fn functions(&self) -> &[u8] {
        &[0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F, 0x10]
    }

    fn limits(&self) -> Limits {
        Limits::STANDARD
    }

    fn bit(&self, _: Table, address: u16) -> Result<bool, ExceptionCode> {
        Ok(address % 2 == 1)
    }

    fn write_bit(&mut self, _: u16, _: bool) -> Result<(), ExceptionCode> {
        Ok(())
    }

    fn word(&self, _: Table, address: u16) -> Result<u16, ExceptionCode> {
        Ok(address)
    }

    fn write_word(&mut self, _: u16, _: u16) -> Result<(), ExceptionCode> {
        Ok(())
    }
}

/// The answer message (unit and PDU) of any unit but the broadcast.
fn answer(message: &[u8]) -> Option<Vec<u8>> {
    let (&unit, request) = message.split_first().filter(|(unit, _)| **unit != 0)?;
    let mut reply = pdu::serve(&mut Numbers, request)?;
    reply.insert(0, unit);
    Some(reply)
}
