//! The requests that this program makes: one table gives their layout and takes them apart.

use super::{Item::ByteCount, function};
use crate::plant::{
    number::{to_u8, to_u16},
    tag::Table,
};

/// A request as it is sent: function code and data (V1.1b3, 4.1).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pdu(Vec<u8>);

impl Pdu {
    /// A request of this function: the numbers of its fields in their order, and what its byte count counts.
    pub fn new(code: u8, fields: &[u16], data: &[u8]) -> Pdu {
        let mut bytes = vec![code];
        let mut fields = fields.iter();
        for item in function(code).map_or(&[][..], |function| function.request) {
            match (item, item.size()) {
                (ByteCount, _) => bytes.push(to_u8(data.len())),
                (_, 1) => bytes.extend(fields.next().map(|field| to_u8(*field))),
                _ => bytes.extend(fields.next().into_iter().flat_map(|field| field.to_be_bytes())),
            }
        }
        bytes.extend(data);
        Pdu(bytes)
    }

    /// Reads so many registers or bits of a table.
    pub fn read(table: Table, address: u16, count: u16) -> Pdu {
        Pdu::new(table.read_fc(), &[address, count], &[])
    }

    /// Writes one coil.
    pub fn write_coil(address: u16, on: bool) -> Pdu {
        Pdu::new(0x05, &[address, if on { 0xFF00 } else { 0 }], &[])
    }

    /// Writes one register.
    pub fn write_register(address: u16, word: u16) -> Pdu {
        Pdu::new(0x06, &[address, word], &[])
    }

    /// Writes coils, the first in the lowest bit (V1.1b3, 6.11); any word but 0 is on.
    pub fn write_coils(address: u16, bits: &[u16]) -> Pdu {
        let byte = |bits: &[u16]| bits.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit != 0));
        let data: Vec<u8> = bits.chunks(8).map(byte).collect();
        Pdu::new(0x0F, &[address, to_u16(bits.len())], &data)
    }

    /// Writes registers.
    pub fn write_registers(address: u16, words: &[u16]) -> Pdu {
        Pdu::new(0x10, &[address, to_u16(words.len())], &bytes_of(words))
    }

    /// Writes addresses that hold so many words each: the count is that of the addresses.
    pub fn write_addresses(address: u16, address_words: u16, words: &[u16]) -> Pdu {
        Pdu::new(0x10, &[address, to_u16(words.len()) / address_words], &bytes_of(words))
    }

    /// Sets the bits of a register that are not in `and` to those of `or`.
    pub fn mask_write(address: u16, and: u16, or: u16) -> Pdu {
        Pdu::new(0x16, &[address, and, or], &[])
    }

    /// Writes registers and reads the same.
    pub fn write_and_read(address: u16, words: &[u16]) -> Pdu {
        let count = to_u16(words.len());
        Pdu::new(0x17, &[address, count, address, count], &bytes_of(words))
    }

    /// Asks for these two bytes to come back (V1.1b3, 6.8).
    pub fn loopback(data: u16) -> Pdu {
        Pdu::new(0x08, &[0, data], &[])
    }

    /// The message to a unit: it precedes the PDU.
    pub fn to(&self, unit: u8) -> Vec<u8> {
        [&[unit], &self.0[..]].concat()
    }
}

fn bytes_of(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

/// The fields of a request PDU: one number each, and the bytes behind the byte count. `None` if its length is wrong.
pub fn request_fields(pdu: &[u8]) -> Option<(Vec<u16>, &[u8])> {
    let (code, mut rest) = pdu.split_first()?;
    let mut fields = Vec::new();
    for item in function(*code)?.request {
        match (item, rest) {
            (ByteCount, [count, data @ ..]) if usize::from(*count) == data.len() => return Some((fields, data)),
            (ByteCount, _) => return None,
            (_, [byte, tail @ ..]) if item.size() == 1 => {
                fields.push(u16::from(*byte));
                rest = tail;
            }
            (_, [high, low, tail @ ..]) if item.size() == 2 => {
                fields.push(u16::from_be_bytes([*high, *low]));
                rest = tail;
            }
            _ => return None,
        }
    }
    rest.is_empty().then_some((fields, rest))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;
    use tokio_modbus::{Request, bytes::Bytes};

    use super::*;

    /// What another program takes a request for.
    fn read_by_others(pdu: &Pdu) -> Request<'static> {
        Request::try_from(Bytes::from(pdu.0.clone())).unwrap()
    }

    proptest! {
        #[test]
        fn another_program_reads_what_is_meant(
            address: u16, word: u16, or: u16, count in 1u16..=125, words in prop::collection::vec(any::<u16>(), 1..=121),
        ) {
            let on = |word: &u16| word % 2 == 1;
            let bits: Vec<u16> = words.iter().map(|word| word % 2).collect();
            let coils: Vec<bool> = words.iter().map(on).collect();
            let length = to_u16(words.len());
            for (pdu, expect) in [
                (Pdu::read(Table::Coil, address, count), Request::ReadCoils(address, count)),
                (Pdu::read(Table::Discrete, address, count), Request::ReadDiscreteInputs(address, count)),
                (Pdu::read(Table::Holding, address, count), Request::ReadHoldingRegisters(address, count)),
                (Pdu::read(Table::Input, address, count), Request::ReadInputRegisters(address, count)),
                (Pdu::write_coil(address, on(&word)), Request::WriteSingleCoil(address, on(&word))),
                (Pdu::write_register(address, word), Request::WriteSingleRegister(address, word)),
                (Pdu::write_coils(address, &bits), Request::WriteMultipleCoils(address, coils.into())),
                (Pdu::write_registers(address, &words), Request::WriteMultipleRegisters(address, words.clone().into())),
                (Pdu::mask_write(address, word, or), Request::MaskWriteRegister(address, word, or)),
                (
                    Pdu::write_and_read(address, &words),
                    Request::ReadWriteMultipleRegisters(address, length, address, words.clone().into()),
                ),
            ] {
                prop_assert_eq!(read_by_others(&pdu), expect);
                // What is put together by the table is taken apart by it.
                let (fields, data) = request_fields(&pdu.0).unwrap();
                prop_assert_eq!(&Pdu::new(pdu.0[0], &fields, data), &pdu);
            }
        }
    }
}
