//! One Modbus server for every simulated device: parses a request, keeps the limits, refuses with the right exception.

mod identity;

pub use identity::Identity;

use crate::{
    bus::pdu::{self, Item, MEI_IDENTIFICATION},
    plant::{
        def::{Limits, READ_REGISTERS_MAX},
        fault::ExceptionCode,
        number::to_u8,
        tag::Table,
    },
};

/// What a device has behind its addresses. A write of several is tried on a copy, so one bad value refuses the whole block.
pub trait Registers: Clone {
    /// The functions it knows.
    fn functions(&self) -> &[u8];
    /// What one request may hold. An odd address or count is refused by a device with an alignment of two.
    fn limits(&self) -> Limits;
    /// What it says of itself, for the functions 11 and 2B.
    fn identity(&self) -> Identity {
        Identity { server_id: 0, objects: Vec::new() }
    }

    /// One coil or discrete input.
    fn bit(&self, table: Table, address: u16) -> Result<bool, ExceptionCode>;
    /// Writes one coil.
    fn write_bit(&mut self, address: u16, on: bool) -> Result<(), ExceptionCode>;
    /// Words that a register address holds: two where the device has 32 bits in one.
    fn address_words(&self, _table: Table, _address: u16) -> u16 {
        1
    }
    /// One word of a holding or input register; `place` is 0 but for the second one of an address.
    fn word_at(&self, table: Table, address: u16, _place: u16) -> Result<u16, ExceptionCode> {
        self.word(table, address)
    }
    /// One holding or input register.
    fn word(&self, table: Table, address: u16) -> Result<u16, ExceptionCode>;
    /// Writes one holding register.
    fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode>;
    /// Whether it is too busy for this function now: then the request has no answer and no effect.
    fn holds_back(&self, _function: u8) -> bool {
        false
    }
    /// Writes holding registers that came in one request: all of them, on a copy that is thrown away if one is refused.
    fn write_block(&mut self, address: u16, values: &[u16]) -> Result<(), ExceptionCode> {
        (address..=u16::MAX).zip(values).try_for_each(|(at, value)| self.write_word(at, *value))
    }
    /// Eight bits of the maker's choice, for function 07.
    fn exception_status(&self) -> u8 {
        0
    }
    /// Whether its run lamp is on, for function 11.
    fn running(&self) -> bool {
        true
    }
}

/// Answers a request. The PDU holds function and data, neither unit nor check; an empty one has no answer.
pub fn serve<D: Registers>(device: &mut D, pdu: &[u8]) -> Option<Vec<u8>> {
    let function = *pdu.first()?;
    Some(answer(device, pdu).unwrap_or_else(|refusal| exception(function, refusal.0)))
}

/// The PDU of an exception.
pub fn exception(function: u8, code: u8) -> Vec<u8> {
    vec![function | 0x80, code]
}

/// Most registers of a queue (V1.1b3, 6.18).
const QUEUE_MAX: u16 = 31;

/// The most that the standard allows in each block of a function.
fn most(function: u8) -> impl Iterator<Item = u16> {
    let items = pdu::function(function).map_or(&[][..], |function| function.request);
    items.iter().filter_map(|item| match item {
        Item::Count { most, .. } => Some(*most),
        _ => None,
    })
}

/// A request of a wrong length is refused with 03, which the standard gives to "the implied length is incorrect".
fn answer<D: Registers>(device: &mut D, pdu: &[u8]) -> Result<Vec<u8>, ExceptionCode> {
    let function = pdu[0];
    if !device.functions().contains(&function) || matches!(pdu, [0x2B, other, ..] if *other != MEI_IDENTIFICATION) {
        return Err(ExceptionCode::ILLEGAL_FUNCTION);
    }
    let (fields, data) = pdu::request_fields(pdu).ok_or(ExceptionCode::ILLEGAL_VALUE)?;
    let limits = device.limits();
    match (function, &fields[..]) {
        (0x01 | 0x02, &[address, count]) => {
            let most = limits.most(pdu::table(function));
            check_step(&limits, pdu::table(function), address, count)?;
            read_bits(device, function, span(function, 0, address, count, most)?)
        }
        (0x03 | 0x04, &[address, count]) => read_words(device, function, address, count),
        (0x05, &[address, state @ (0x0000 | 0xFF00)]) => {
            device.write_bit(address, state != 0)?;
            Ok(pdu.to_vec())
        }
        (0x06, &[address, value]) => write_words(device, address, &[value]).map(|()| pdu.to_vec()),
        (0x07, []) => Ok(vec![function, device.exception_status()]),
        (0x0F, &[address, count]) => {
            write_bits(device, span(function, 0, address, count, u16::MAX)?, data)?;
            Ok(pdu[..5].to_vec())
        }
        (0x10, &[address, count]) => {
            let each = device.address_words(Table::Holding, address);
            let addresses = span(function, 0, address, count, limits.write_registers_max / each)?;
            write_words(device, address, &registers(addresses, each, data)?)?;
            Ok(pdu[..5].to_vec())
        }
        (0x11, []) => Ok(identity::report(&device.identity(), device.running())),
        (0x16, &[address, and, or]) => {
            let value = device.word(Table::Holding, address)? & and | or & !and;
            device.write_word(address, value)?;
            Ok(pdu.to_vec())
        }
        (0x17, &[_, _, to, _]) if device.address_words(Table::Holding, to) != 1 => Err(ExceptionCode::ILLEGAL_ADDRESS),
        (0x17, &[from, count, to, written]) => {
            let values = registers(span(function, 1, to, written, limits.write_registers_max)?, 1, data)?;
            let mut trial = device.clone();
            write_words(&mut trial, to, &values)?;
            let reply = read_words(&trial, function, from, count)?;
            *device = trial;
            Ok(reply)
        }
        (0x18, &[address]) => read_queue(device, function, address),
        (0x2B, &[_, code, object]) => identity::read(&device.identity(), to_u8(code), to_u8(object)),
        _ => Err(ExceptionCode::ILLEGAL_VALUE),
    }
}

type Addresses = std::ops::RangeInclusive<u16>;

fn read_bits<D: Registers>(device: &D, function: u8, addresses: Addresses) -> Result<Vec<u8>, ExceptionCode> {
    let table = pdu::table(function);
    let bytes = addresses.len().div_ceil(8);
    let mut reply = vec![function, to_u8(bytes)];
    reply.resize(2 + bytes, 0);
    for (place, at) in addresses.enumerate() {
        reply[2 + place / 8] |= u8::from(device.bit(table, at)?) << (place % 8);
    }
    Ok(reply)
}

/// Address and count are multiples of the alignment of their table.
fn check_step(limits: &Limits, table: Table, address: u16, count: u16) -> Result<(), ExceptionCode> {
    let step = limits.step(table);
    match (address.is_multiple_of(step), count.is_multiple_of(step)) {
        (false, _) => Err(ExceptionCode::ILLEGAL_ADDRESS),
        (_, false) => Err(ExceptionCode::ILLEGAL_VALUE),
        (true, true) => Ok(()),
    }
}

fn read_words<D: Registers>(device: &D, function: u8, address: u16, count: u16) -> Result<Vec<u8>, ExceptionCode> {
    let table = pdu::table(function);
    let limits = device.limits();
    let most = limits.most(table);
    let each = device.address_words(table, address);
    let addresses = span(function, 0, address, count, most.min(READ_REGISTERS_MAX / each))?;
    let mut reply = vec![function, to_u8(count * each * 2)];
    check_step(&limits, table, address, count)?;
    for at in addresses {
        // What counts in another way is not in the same read.
        if device.address_words(table, at) != each {
            return Err(ExceptionCode::ILLEGAL_ADDRESS);
        }
        for place in 0..each {
            reply.extend_from_slice(&device.word_at(table, at, place)?.to_be_bytes());
        }
    }
    Ok(reply)
}

fn write_bits<D: Registers>(device: &mut D, addresses: Addresses, packed: &[u8]) -> Result<(), ExceptionCode> {
    if packed.len() != addresses.len().div_ceil(8) {
        return Err(ExceptionCode::ILLEGAL_VALUE);
    }
    let mut trial = device.clone();
    for (place, at) in addresses.enumerate() {
        trial.write_bit(at, packed[place / 8] >> (place % 8) & 1 == 1)?;
    }
    *device = trial;
    Ok(())
}

/// The words of a write, which must be as many as its addresses hold.
fn registers(addresses: Addresses, each: u16, packed: &[u8]) -> Result<Vec<u16>, ExceptionCode> {
    let values: Vec<u16> = packed.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    (packed.len() == 2 * usize::from(each) * addresses.len()).then_some(values).ok_or(ExceptionCode::ILLEGAL_VALUE)
}

fn write_words<D: Registers>(device: &mut D, address: u16, values: &[u16]) -> Result<(), ExceptionCode> {
    let mut trial = device.clone();
    trial.write_block(address, values)?;
    *device = trial;
    Ok(())
}

/// The addresses of the `nth` block of a request: a wrong count is a wrong value, an end beyond 65535 a wrong address.
fn span(function: u8, nth: usize, address: u16, count: u16, limit: u16) -> Result<Addresses, ExceptionCode> {
    let most = most(function).nth(nth).unwrap_or(limit).min(limit);
    if count == 0 || count > most {
        return Err(ExceptionCode::ILLEGAL_VALUE);
    }
    Ok(address..=address.checked_add(count - 1).ok_or(ExceptionCode::ILLEGAL_ADDRESS)?)
}

/// A queue as the standard keeps it: its count at the address, its words behind; reading takes nothing out (V1.1b3, 6.18).
fn read_queue<D: Registers>(device: &D, function: u8, address: u16) -> Result<Vec<u8>, ExceptionCode> {
    let count = device.word(Table::Holding, address)?;
    if count > QUEUE_MAX {
        return Err(ExceptionCode::ILLEGAL_VALUE);
    }
    let mut reply = vec![function, 0, to_u8(2 + 2 * count), 0, to_u8(count)];
    for place in 1..=count {
        let at = address.checked_add(place).ok_or(ExceptionCode::ILLEGAL_ADDRESS)?;
        reply.extend_from_slice(&device.word(Table::Holding, at)?.to_be_bytes());
    }
    Ok(reply)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Eight coils and eight registers at 100; registers take values below 1000.
    #[derive(Clone, Default)]
    struct Small {
        bits: [bool; 8],
        words: [u16; 8],
    }

    fn place(address: u16) -> Result<usize, ExceptionCode> {
        (100..108).contains(&address).then(|| usize::from(address) - 100).ok_or(ExceptionCode::ILLEGAL_ADDRESS)
    }

    impl Registers for Small {
        fn functions(&self) -> &[u8] {
            &[1, 3, 5, 6, 7, 15, 16, 0x16, 0x17, 0x18]
        }
        fn limits(&self) -> Limits {
            Limits { read_registers_max: 6, write_registers_max: 6, ..Limits::STANDARD }
        }

        fn bit(&self, _: Table, address: u16) -> Result<bool, ExceptionCode> {
            Ok(self.bits[place(address)?])
        }
        fn write_bit(&mut self, address: u16, on: bool) -> Result<(), ExceptionCode> {
            self.bits[place(address)?] = on;
            Ok(())
        }
        fn word(&self, _: Table, address: u16) -> Result<u16, ExceptionCode> {
            Ok(self.words[place(address)?])
        }
        fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode> {
            let place = place(address)?;
            self.words[place] = if value < 1000 { value } else { return Err(ExceptionCode::ILLEGAL_VALUE) };
            Ok(())
        }
    }

    fn check(request: &[u8], expect: &[u8]) {
        let mut device = Small { bits: [true, false, true, true, false, false, false, true], ..Small::default() };
        assert_eq!(serve(&mut device, request).as_deref(), Some(expect), "request {request:02X?}");
    }

    #[test]
    fn requests_are_answered_or_refused_with_the_right_code() {
        check(&[1, 0, 100, 0, 8], &[1, 1, 0b1000_1101]);
        check(&[1, 0, 101, 0, 3], &[1, 1, 0b0110]);
        check(&[3, 0, 100, 0, 2], &[3, 4, 0, 0, 0, 0]);
        check(&[5, 0, 101, 0xFF, 0], &[5, 0, 101, 0xFF, 0]);
        check(&[6, 0, 101, 0, 7], &[6, 0, 101, 0, 7]);
        check(&[15, 0, 100, 0, 3, 1, 0b101], &[15, 0, 100, 0, 3]);
        check(&[16, 0, 100, 0, 2, 4, 0, 1, 0, 2], &[16, 0, 100, 0, 2]);
        check(&[2, 0, 100, 0, 1], &[0x82, 1]);
        check(&[0x2B, 14, 1, 0], &[0xAB, 1]);
        check(&[3, 0, 107, 0, 2], &[0x83, 2]);
        check(&[3, 0xFF, 0xFF, 0, 2], &[0x83, 2]);
        check(&[5, 0, 99, 0xFF, 0], &[0x85, 2]);
        check(&[3, 0, 100, 0, 0], &[0x83, 3]);
        check(&[3, 0, 100, 0, 7], &[0x83, 3]);
        check(&[3, 0, 100], &[0x83, 3]);
        check(&[3, 0, 100, 0, 1, 0], &[0x83, 3]);
        check(&[5, 0, 100, 0, 1], &[0x85, 3]);
        check(&[6, 0, 100, 0xFF, 0xFF], &[0x86, 3]);
        check(&[15, 0, 100, 0, 3, 2, 0b101], &[0x8F, 3]);
        check(&[16, 0, 100, 0, 2, 3, 0, 1, 0], &[0x90, 3]);
    }

    #[test]
    fn a_mask_touches_only_its_bits() {
        let mut device = Small::default();
        device.words[4] = 0x12;
        let mask = [0x16, 0, 104, 0, 0xF2, 0, 0x25];
        assert_eq!(serve(&mut device, &mask).as_deref(), Some(&mask[..]));
        // The example of the standard (V1.1b3, 6.16).
        assert_eq!(device.words[4], 0x17);
        check(&[0x16, 0, 99, 0, 0, 0, 0], &[0x96, 2]);
        check(&[0x16, 0, 104, 0, 0, 0xFF, 0xFF], &[0x96, 3]);
    }

    #[test]
    fn an_exchange_writes_before_it_reads_or_does_nothing() {
        let mut device = Small::default();
        let exchange = |read: u8, count: u8, value: u8| [0x17, 0, read, 0, count, 0, 101, 0, 1, 2, value, 9];
        assert_eq!(serve(&mut device, &exchange(100, 2, 0)).as_deref(), Some(&[0x17, 4, 0, 0, 0, 9][..]));
        assert_eq!(serve(&mut device, &exchange(107, 2, 1)).as_deref(), Some(&[0x97, 2][..]));
        assert_eq!(serve(&mut device, &exchange(100, 0, 1)).as_deref(), Some(&[0x97, 3][..]));
        assert_eq!(serve(&mut device, &exchange(100, 1, 0xFF)).as_deref(), Some(&[0x97, 3][..]));
        assert_eq!(device.words[1], 9);
    }

    #[test]
    fn a_queue_is_read_by_its_count_and_stays() {
        let mut device = Small { words: [0, 2, 440, 512, 0, 7, 40, 0], ..Small::default() };
        for _ in 0..2 {
            let queue = [0x18, 0, 6, 0, 2, 0x01, 0xB8, 0x02, 0];
            assert_eq!(serve(&mut device, &[0x18, 0, 101]).as_deref(), Some(&queue[..]));
        }
        assert_eq!(serve(&mut device, &[0x18, 0, 100]).as_deref(), Some(&[0x18, 0, 2, 0, 0][..]));
        assert_eq!(serve(&mut device, &[0x18, 0, 105]).as_deref(), Some(&[0x98, 2][..]));
        assert_eq!(serve(&mut device, &[0x18, 0, 106]).as_deref(), Some(&[0x98, 3][..]));
        assert_eq!(serve(&mut device, &[7]).as_deref(), Some(&[7, 0][..]));
    }

    #[test]
    fn one_bad_value_refuses_the_whole_block() {
        let mut device = Small::default();
        assert_eq!(serve(&mut device, &[16, 0, 100, 0, 2, 4, 0, 1, 0xFF, 0]).as_deref(), Some(&[0x90, 3][..]));
        assert_eq!(device.words, [0; 8]);
    }

    proptest! {
        #[test]
        fn no_request_breaks_a_device(request in prop::collection::vec(any::<u8>(), 0..260)) {
            let answer = serve(&mut Small::default(), &request);
            prop_assert_eq!(answer.is_none(), request.is_empty());
        }
    }
}
