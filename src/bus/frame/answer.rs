//! Whether an answer belongs to its request. Polls, writes, tests of a line, listening and decoding all ask here.

use crate::{
    bus::pdu::{self, Function, Item, Length},
    plant::{
        def::Framing,
        fault::{ExceptionCode, Fault},
        number::to_u16,
    },
};

/// Fewest bytes behind the byte count of an event log: status, event count and message count.
const LOG_MIN: u8 = 6;

/// A request message with what its bytes do not say.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Unit and PDU.
    pub message: &'a [u8],
    /// Words that each register address holds in the device: one, or two where it counts as Enron does.
    pub address_words: u16,
}

/// To a device that counts as the standard does.
impl<'a, M: AsRef<[u8]> + ?Sized> From<&'a M> for Request<'a> {
    fn from(message: &'a M) -> Request<'a> {
        Request { message: message.as_ref(), address_words: 1 }
    }
}

/// The normal answer to a request, as far as the request itself tells.
struct Expected {
    /// Length of the message.
    length: usize,
    /// How many of its bytes, from the unit on, are those of the request.
    repeated: usize,
}

/// `None` where only the answer tells how long it is, and for a request that is cut short.
fn expected(Request { message: request, address_words }: Request) -> Option<Expected> {
    let function = pdu::function(*request.get(1)?)?;
    let word = |at: usize| Some(u16::from_be_bytes([*request.get(at)?, *request.get(at + 1)?]));
    let count = || word(4).map(usize::from);
    let (length, repeated) = match function.response {
        [Item::ByteCount, Item::Bits] => (3 + count()?.div_ceil(8), 2),
        [Item::ByteCount, Item::Registers] => (3 + 2 * usize::from(address_words) * count()?, 2),
        [Item::ByteCount, Item::FileRecords] => (3 + records(request).map(|length| 2 + length).sum::<usize>(), 2),
        [.., Item::Data] => match word(2)? {
            // These come back as they were sent (V1.1b3, 6.8.1), the others with what they ask for.
            0x00 | 0x01 | 0x03 | 0x0A | 0x14 => (request.len(), request.len()),
            _ => (6, 4),
        },
        _ if function.echoes => pdu::request_length(request).known().map(|length| (length, length))?,
        [Item::Address(_), Item::Count { .. }] => (6, 6),
        items if items.iter().all(|item| matches!(item, Item::Byte(..) | Item::Word(..))) => {
            (2 + items.iter().map(Item::size).sum::<usize>(), 2)
        }
        [..] => return None,
    };
    (repeated <= request.len()).then_some(Expected { length, repeated })
}

/// Length of the normal answer to a request message, where the request tells.
pub fn expected_length<'a>(request: impl Into<Request<'a>>) -> Option<usize> {
    expected(request.into()).map(|expected| expected.length)
}

/// Bytes of registers in each record that a request of function 14 asks for.
fn records(request: &[u8]) -> impl Iterator<Item = usize> {
    let groups = request.get(3..).unwrap_or_default().as_chunks::<7>().0;
    groups.iter().map(|group| 2 * usize::from(u16::from_be_bytes([group[5], group[6]])))
}

/// What an answer looks like from outside. RTU answers carry no transaction id: two answers of one signature look
/// the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ResponseSignature {
    function: u8,
    /// Length of the message.
    length: usize,
    /// All that an echo repeats behind the function code, as one number.
    echo: Option<u64>,
}

/// The signature of the normal answer to a request message; `None` for functions whose answers have none.
pub fn response_signature<'a>(request: impl Into<Request<'a>>) -> Option<ResponseSignature> {
    let request = request.into();
    let Expected { length, repeated } = expected(request)?;
    let function = pdu::function(*request.message.get(1)?)?;
    let echo = match function.response {
        [Item::ByteCount, Item::Bits | Item::Registers] => None,
        _ if repeated == length && length <= 10 => Some(number(&request.message[2..repeated])),
        _ => return None,
    };
    Some(ResponseSignature { function: function.code, length, echo })
}

/// At most eight bytes as one number.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

impl ResponseSignature {
    /// Would this answer message be taken for one of this signature?
    pub fn fits(self, answer: &[u8]) -> bool {
        answer.get(1) == Some(&self.function)
            && answer.len() == self.length
            && self.echo.is_none_or(|echo| number(&answer[2..]) == echo)
    }

    /// The echo of diagnostics 08.
    pub fn is_loopback(self) -> bool {
        self.function == 0x08
    }
}

/// Do these bytes begin like an answer to a request message, or a refusal: the same unit, the same function?
pub fn begins_answer(request: &[u8], bytes: &[u8]) -> bool {
    match (request, bytes) {
        ([asked_unit, asked, ..], [unit, function, ..]) => unit == asked_unit && function & 0x7F == *asked,
        _ => false,
    }
}

/// Is this whole message the answer to a request message, or a refusal of it?
pub fn answers<'a>(framing: Framing, request: impl Into<Request<'a>>, answer: &[u8]) -> bool {
    matches!(check_answer(framing, request, answer), Ok(()) | Err(Fault::Exception(_)))
}

/// Checks a whole answer message, free of line errors, against its request: unit, function, and every field that the request
/// or the answer itself determines. An exception answer is [`Fault::Exception`]; over Modbus TCP, where the header says where
/// it ends, some devices send more bytes behind its code, and some none at all.
pub fn check_answer<'a>(framing: Framing, request: impl Into<Request<'a>>, answer: &[u8]) -> Result<(), Fault> {
    let request = request.into();
    let (&[asked_unit, asked, ..], &[unit, function, ..]) = (request.message, answer) else {
        return Err(Fault::Truncated { got: to_u16(answer.len()), expected: 3 });
    };
    if unit != asked_unit {
        return Err(Fault::WrongUnit { got: unit, asked: asked_unit });
    }
    if function == asked | 0x80 && asked != function {
        return match answer {
            [_, _, code] => Err(Fault::Exception(ExceptionCode(*code))),
            [_, _, code, ..] if framing == Framing::Mbap => Err(Fault::Exception(ExceptionCode(*code))),
            [_, _] if framing == Framing::Mbap => Err(Fault::Exception(ExceptionCode::NONE)),
            [_, _] => Err(Fault::Truncated { got: 2, expected: 3 }),
            _ => Err(wrong_length(answer.len() - 2, 1)),
        };
    }
    if function != asked {
        return Err(Fault::WrongFunction { got: function, asked });
    }
    pdu::function(function).map_or(Ok(()), |row| check_fields(row, request, answer))
}

/// Checks a normal answer of a function: what it repeats, its length, and whether its counts agree.
fn check_fields(row: &Function, asked: Request, answer: &[u8]) -> Result<(), Fault> {
    let request = asked.message;
    let head = if matches!(row.response, [Item::ByteCount, ..]) && !row.echoes { 3 } else { 2 };
    let behind = |length: usize| length.saturating_sub(head);
    let expected = expected(asked);
    if let Some(Expected { length, repeated }) = expected {
        if answer.len() != length {
            return Err(wrong_length(behind(answer.len()), behind(length)));
        }
        if answer[..repeated] != request[..repeated] {
            return Err(Fault::WrongEcho);
        }
    }
    match pdu::response_length(answer) {
        // Diagnostics echo any length, which was compared with the request.
        _ if matches!(row.response, [.., Item::Data]) => Ok(()),
        Length::Known(length) if length == answer.len() => check_counts(row, request, answer),
        // The byte count of a length that is right.
        Length::Known(length) if expected.is_some() => Err(wrong_length(behind(length), behind(answer.len()))),
        Length::Known(length) => Err(wrong_length(behind(answer.len()), behind(length))),
        Length::TooEarly => Err(Fault::Truncated { got: to_u16(answer.len()), expected: to_u16(answer.len() + 1) }),
        Length::BySilence => check_transport(request, answer),
    }
}

/// Checks what is counted inside an answer of the right length.
fn check_counts(row: &Function, request: &[u8], answer: &[u8]) -> Result<(), Fault> {
    match (row.response, answer) {
        ([Item::ByteCount, .., Item::Events], [_, _, bytes, ..]) if *bytes < LOG_MIN => {
            Err(wrong_length(usize::from(*bytes), usize::from(LOG_MIN)))
        }
        ([Item::WordCount, ..], [_, _, _, _, high, low, registers @ ..]) => {
            let count = usize::from(u16::from_be_bytes([*high, *low]));
            if registers.len() == 2 * count { Ok(()) } else { Err(wrong_length(registers.len(), 2 * count)) }
        }
        ([Item::WordCount, ..], _) => Err(wrong_length(answer.len() - 2, 4)),
        ([Item::ByteCount, Item::FileRecords], [_, _, _, groups @ ..]) => check_records(request, groups),
        ([Item::MeiType, ..], _) => check_transport(request, answer),
        _ => Ok(()),
    }
}

/// Checks the groups of a file record answer, length, reference and registers each, against those of the request.
fn check_records(request: &[u8], mut groups: &[u8]) -> Result<(), Fault> {
    for bytes in records(request) {
        let [length, reference, rest @ ..] = groups else { return Err(Fault::WrongEcho) };
        if usize::from(*length) != 1 + bytes {
            return Err(wrong_length(usize::from(*length), 1 + bytes));
        }
        if *reference != pdu::FILE_REFERENCE {
            return Err(Fault::WrongEcho);
        }
        groups = rest.get(bytes..).ok_or(Fault::WrongEcho)?;
    }
    Ok(())
}

/// Checks an encapsulated answer: its kind; of an identification its read code, and the object if only one was asked for.
fn check_transport(request: &[u8], answer: &[u8]) -> Result<(), Fault> {
    let same = |at: usize| request.get(at).is_none_or(|asked| answer.get(at) == Some(asked));
    let is_identification = request.get(2) == Some(&pdu::MEI_IDENTIFICATION);
    if !same(2) || is_identification && !same(3) {
        return Err(Fault::WrongEcho);
    }
    match (request, answer.get(1..)) {
        ([_, 0x2B, pdu::MEI_IDENTIFICATION, pdu::READ_ONE_OBJECT, id, ..], Some(pdu)) => {
            let mut ids = pdu::identification_objects(pdu).map(|(id, _)| id);
            if ids.next() == Some(*id) && ids.next().is_none() { Ok(()) } else { Err(Fault::WrongEcho) }
        }
        _ => Ok(()),
    }
}

fn wrong_length(got: usize, asked: usize) -> Fault {
    Fault::WrongLength { got: to_u16(got), asked: to_u16(asked) }
}

#[cfg(test)]
mod tests;
