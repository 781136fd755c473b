//! One Modbus server for every simulated device: parses a request, keeps the limits, refuses with the right exception.

/// Why a device refuses (Modbus application protocol V1.1b3, 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// 01: it does not know the function.
    Function,
    /// 02: nothing is at this address, or it cannot be written.
    Address,
    /// 03: the value or the count is out of range.
    Value,
}

impl Refusal {
    /// The code on the wire.
    pub fn code(self) -> u8 {
        match self {
            Refusal::Function => 1,
            Refusal::Address => 2,
            Refusal::Value => 3,
        }
    }
}

/// Which kind of bits a request means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bits {
    /// Functions 01, 05, 0F.
    Coils,
    /// Function 02.
    Discretes,
}

/// Which kind of words a request means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Words {
    /// Functions 03, 06, 10.
    Holding,
    /// Function 04.
    Input,
}

/// What a device has behind its addresses. A write of several is tried on a copy, so one bad value refuses the whole block.
pub trait Registers: Clone {
    /// The functions it knows.
    const FUNCTIONS: &'static [u8];
    /// Words that one request may read or write.
    const WORDS_MAX: u16;

    /// One bit.
    fn bit(&self, kind: Bits, address: u16) -> Result<bool, Refusal>;
    /// Writes one coil.
    fn write_bit(&mut self, address: u16, on: bool) -> Result<(), Refusal>;
    /// One word.
    fn word(&self, kind: Words, address: u16) -> Result<u16, Refusal>;
    /// Writes one holding register.
    fn write_word(&mut self, address: u16, value: u16) -> Result<(), Refusal>;
}

/// Answers a request. The PDU holds function and data, neither unit nor check; an empty one has no answer.
pub fn serve<D: Registers>(device: &mut D, pdu: &[u8]) -> Option<Vec<u8>> {
    let (&function, data) = pdu.split_first()?;
    Some(answer(device, function, data).unwrap_or_else(|refusal| exception(function, refusal.code())))
}

/// The PDU of an exception.
pub fn exception(function: u8, code: u8) -> Vec<u8> {
    vec![function | 0x80, code]
}

/// Most bits of one read and of one write, words of one write (V1.1b3, 6.1, 6.11, 6.12).
const READ_BITS_MAX: u16 = 2000;
const WRITE_BITS_MAX: u16 = 1968;
const WRITE_WORDS_MAX: u16 = 123;

fn answer<D: Registers>(device: &mut D, function: u8, data: &[u8]) -> Result<Vec<u8>, Refusal> {
    if !D::FUNCTIONS.contains(&function) {
        return Err(Refusal::Function);
    }
    let [a, b, c, d, rest @ ..] = data else { return Err(Refusal::Value) };
    let (address, operand) = (u16::from_be_bytes([*a, *b]), u16::from_be_bytes([*c, *d]));
    match function {
        0x01 => read_bits(device, function, Bits::Coils, address, operand),
        0x02 => read_bits(device, function, Bits::Discretes, address, operand),
        0x03 => read_words(device, function, Words::Holding, address, operand),
        0x04 => read_words(device, function, Words::Input, address, operand),
        0x05 => write_bit(device, address, operand)?.echo(function, data),
        0x06 => write_words(device, address, &[operand])?.echo(function, data),
        0x0F => write_bits(device, address, operand, rest)?.echo(function, data),
        0x10 => {
            let values = block_of_words(operand, D::WORDS_MAX.min(WRITE_WORDS_MAX), rest)?;
            write_words(device, address, &values)?.echo(function, data)
        }
        _ => Err(Refusal::Function),
    }
}

fn read_bits<D: Registers>(device: &D, function: u8, kind: Bits, address: u16, count: u16) -> Result<Vec<u8>, Refusal> {
    let addresses = span(address, count, READ_BITS_MAX)?;
    let mut reply = vec![function, count.div_ceil(8) as u8];
    reply.resize(2 + usize::from(count.div_ceil(8)), 0);
    for (place, at) in addresses.enumerate() {
        reply[2 + place / 8] |= u8::from(device.bit(kind, at)?) << (place % 8);
    }
    Ok(reply)
}

fn read_words<D: Registers>(
    device: &D,
    function: u8,
    kind: Words,
    address: u16,
    count: u16,
) -> Result<Vec<u8>, Refusal> {
    let mut reply = vec![function, (count.min(D::WORDS_MAX) * 2) as u8];
    for at in span(address, count, D::WORDS_MAX)? {
        reply.extend_from_slice(&device.word(kind, at)?.to_be_bytes());
    }
    Ok(reply)
}

fn write_bit<D: Registers>(device: &mut D, address: u16, operand: u16) -> Result<Written, Refusal> {
    let on = match operand {
        0xFF00 => true,
        0x0000 => false,
        _ => return Err(Refusal::Value),
    };
    device.write_bit(address, on)?;
    Ok(Written)
}

fn write_bits<D: Registers>(device: &mut D, address: u16, count: u16, rest: &[u8]) -> Result<Written, Refusal> {
    let addresses = span(address, count, WRITE_BITS_MAX)?;
    let [bytes, packed @ ..] = rest else { return Err(Refusal::Value) };
    if usize::from(*bytes) != packed.len() || packed.len() != usize::from(count.div_ceil(8)) {
        return Err(Refusal::Value);
    }
    let mut trial = device.clone();
    for (place, at) in addresses.enumerate() {
        trial.write_bit(at, packed[place / 8] >> (place % 8) & 1 == 1)?;
    }
    *device = trial;
    Ok(Written)
}

fn block_of_words(count: u16, max: u16, rest: &[u8]) -> Result<Vec<u16>, Refusal> {
    let [bytes, packed @ ..] = rest else { return Err(Refusal::Value) };
    let fits = usize::from(*bytes) == packed.len() && packed.len() == 2 * usize::from(count);
    if count == 0 || count > max || !fits {
        return Err(Refusal::Value);
    }
    Ok(packed.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
}

fn write_words<D: Registers>(device: &mut D, address: u16, values: &[u16]) -> Result<Written, Refusal> {
    let addresses = span(address, values.len() as u16, WRITE_WORDS_MAX)?;
    let mut trial = device.clone();
    addresses.zip(values).try_for_each(|(at, value)| trial.write_word(at, *value))?;
    *device = trial;
    Ok(Written)
}

/// The addresses of a request: a wrong count is a wrong value, an end beyond 65535 a wrong address.
fn span(address: u16, count: u16, max: u16) -> Result<std::ops::RangeInclusive<u16>, Refusal> {
    if count == 0 || count > max {
        return Err(Refusal::Value);
    }
    Ok(address..=address.checked_add(count - 1).ok_or(Refusal::Address)?)
}

/// A write that was done; every write is answered with function, address and value or count.
struct Written;

impl Written {
    fn echo(self, function: u8, data: &[u8]) -> Result<Vec<u8>, Refusal> {
        let mut reply = vec![function];
        reply.extend_from_slice(&data[..4]);
        Ok(reply)
    }
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

    fn place(address: u16) -> Result<usize, Refusal> {
        (100..108).contains(&address).then(|| usize::from(address) - 100).ok_or(Refusal::Address)
    }

    impl Registers for Small {
        const FUNCTIONS: &'static [u8] = &[1, 3, 5, 6, 15, 16];
        const WORDS_MAX: u16 = 6;

        fn bit(&self, _: Bits, address: u16) -> Result<bool, Refusal> {
            Ok(self.bits[place(address)?])
        }
        fn write_bit(&mut self, address: u16, on: bool) -> Result<(), Refusal> {
            self.bits[place(address)?] = on;
            Ok(())
        }
        fn word(&self, _: Words, address: u16) -> Result<u16, Refusal> {
            Ok(self.words[place(address)?])
        }
        fn write_word(&mut self, address: u16, value: u16) -> Result<(), Refusal> {
            let place = place(address)?;
            self.words[place] = if value < 1000 { value } else { return Err(Refusal::Value) };
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
        check(&[5, 0, 100, 0, 1], &[0x85, 3]);
        check(&[6, 0, 100, 0xFF, 0xFF], &[0x86, 3]);
        check(&[15, 0, 100, 0, 3, 2, 0b101], &[0x8F, 3]);
        check(&[16, 0, 100, 0, 2, 3, 0, 1, 0], &[0x90, 3]);
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
