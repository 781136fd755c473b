//! The layout of every function, one row each (Modbus application protocol V1.1b3, section 6). The link of the master, the
//! simulated devices, the check before sending and the decoder of frames all read this table.

mod place;
mod request;

use tokio_modbus::{Response, bytes::Bytes};

use self::Item::*;
pub(crate) use self::place::{modicon, place, span};
pub use self::request::{Pdu, request_fields};
use super::names::{self, Counted, counted};
use crate::{plant::tag::Table, t};

/// A field of a request or response, behind the function code.
#[derive(Debug, Clone, Copy)]
pub enum Item {
    /// Wire address, by its name.
    Address(&'static str),
    /// Count of bits or registers, from 1 to `most`, by its name and what is done to them.
    Count {
        name: &'static str,
        verb: &'static str,
        most: u16,
    },
    /// FF00 or 0000.
    CoilState,
    /// The value of one register.
    Register,
    /// Name and meaning of one byte, or of two.
    Byte(&'static str, fn(u8) -> String),
    Word(&'static str, fn(u16) -> String),
    /// The bits that function 22 sets, of those that it does not keep.
    OrMask,
    /// The data of function 08: usually two bytes.
    Data,
    /// One byte: how many bytes follow. The next fields are what they hold.
    ByteCount,
    /// The same in two bytes.
    WordCount,
    FifoCount,
    Bits,
    Registers,
    Events,
    ServerId,
    /// Groups of reference, file, record and length: without and with the registers of the records.
    FileRequests,
    FileWrites,
    /// Groups of length, reference and registers.
    FileRecords,
    /// Kind of an encapsulated transport; only 0E, device identification, has a known layout.
    MeiType,
    /// The object to continue with, if more follow.
    NextObject,
    /// Count of objects, then id, length and text of each.
    Objects,
}

impl Item {
    /// Bytes that it has at least. What a byte count precedes has none of its own.
    pub fn size(&self) -> usize {
        match self {
            Bits | Registers | Events | ServerId | FileRequests | FileWrites | FileRecords => 0,
            ByteCount | Byte(..) | MeiType | NextObject | Objects => 1,
            Address(_) | Count { .. } | CoilState | Register | Word(..) | OrMask | Data | WordCount | FifoCount => 2,
        }
    }
}

/// A function of the standard.
#[derive(Debug)]
pub struct Function {
    pub code: u8,
    pub name: &'static str,
    /// The table that it works on.
    pub table: Table,
    pub request: &'static [Item],
    pub response: &'static [Item],
    /// The response is a copy of the request.
    pub echoes: bool,
}

impl Function {
    /// Does it change values, so that it may be sent to all units at once?
    pub fn writes(&self) -> bool {
        matches!(self.code, 0x05 | 0x06 | 0x0F | 0x10 | 0x15 | 0x16)
    }
}

/// Device identification (V1.1b3, 6.21).
pub const MEI_IDENTIFICATION: u8 = 0x0E;
/// Its read code for one object; 1 to 3 are for lists.
pub const READ_ONE_OBJECT: u8 = 4;
/// Reference type of every file record (V1.1b3, 6.14).
pub const FILE_REFERENCE: u8 = 6;

const fn count(name: &'static str, verb: &'static str, most: u16) -> Item {
    Count { name, verb, most }
}

const READ_BITS: &[Item] = &[Address("address"), count("count", "to read", 2000)];
const READ_REGISTERS: &[Item] = &[Address("address"), count("count", "to read", 125)];
const BITS: &[Item] = &[ByteCount, Bits];
const REGISTERS: &[Item] = &[ByteCount, Registers];
const WRITTEN: &[Item] = &[Address("address"), count("count", "written", u16::MAX)];
const DIAGNOSTICS: &[Item] =
    &[Word("sub-function", |code| format!("{code} / 0x{code:04X} {}", names::diagnostic(code))), Data];
const MASK_WRITE: &[Item] = &[
    Address("address"),
    Word("AND mask", |mask| t!("keeps the bits of {mask}", mask = format!("{mask:016b}"))),
    OrMask,
];
const STATUS: Item = Byte("status", |status| {
    t!("{status}, highest first: the device says what they mean", status = format!("{status:08b}"))
});
const COMM_STATUS: Item = Word("status", |status| names::comm_status(status).to_owned());
const EVENT_COUNT: Item =
    Word("event count", |count| t!("{messages} done", messages = counted(count.into(), Counted::Messages)));
const MESSAGE_COUNT: Item =
    Word("message count", |count| t!("{messages} seen", messages = counted(count.into(), Counted::Messages)));
const READ_WRITE: &[Item] = &[
    Address("read address"),
    count("read count", "to read", 125),
    Address("write address"),
    count("write count", "to write", 121),
    ByteCount,
    Registers,
];
const READ_CODE: Item = Byte("read code", |code| format!("{code} {}", names::identification(code)));
const IDENTIFY: &[Item] =
    &[MeiType, READ_CODE, Byte("object", |id| t!("from {id} {object}", id, object = names::object(id)))];
const IDENTIFICATION: &[Item] = &[
    MeiType,
    READ_CODE,
    Byte("conformity", |level| {
        let one_by_one = if level & 0x80 == 0 { t!("stream access only") } else { t!("stream and individual access") };
        format!("{}, {one_by_one}", names::identification(level & 0x7F))
    }),
    Byte("more follows", |more| if more == 0 { t!("no") } else { t!("yes") }.into()),
    NextObject,
    Objects,
];

#[rustfmt::skip]
const FUNCTIONS: &[Function] = &[
    row(0x01, "read coils", Table::Coil, READ_BITS, BITS),
    row(0x02, "read discrete inputs", Table::Discrete, READ_BITS, BITS),
    row(0x03, "read holding registers", Table::Holding, READ_REGISTERS, REGISTERS),
    row(0x04, "read input registers", Table::Input, READ_REGISTERS, REGISTERS),
    echo(0x05, "write single coil", Table::Coil, &[Address("address"), CoilState]),
    echo(0x06, "write single register", Table::Holding, &[Address("address"), Register]),
    row(0x07, "read exception status", Table::Holding, &[], &[STATUS]),
    echo(0x08, "diagnostics", Table::Holding, DIAGNOSTICS),
    row(0x0B, "get comm event counter", Table::Holding, &[], &[COMM_STATUS, EVENT_COUNT]),
    row(0x0C, "get comm event log", Table::Holding, &[], &[ByteCount, COMM_STATUS, EVENT_COUNT, MESSAGE_COUNT, Events]),
    row(0x0F, "write multiple coils", Table::Coil, &[Address("address"), count("count", "to write", 1968), ByteCount, Bits], WRITTEN),
    row(0x10, "write multiple registers", Table::Holding, &[Address("address"), count("count", "to write", 123), ByteCount, Registers], WRITTEN),
    row(0x11, "report server id", Table::Holding, &[], &[ByteCount, ServerId]),
    row(0x14, "read file record", Table::Holding, &[ByteCount, FileRequests], &[ByteCount, FileRecords]),
    echo(0x15, "write file record", Table::Holding, &[ByteCount, FileWrites]),
    echo(0x16, "mask write register", Table::Holding, MASK_WRITE),
    row(0x17, "read/write multiple registers", Table::Holding, READ_WRITE, REGISTERS),
    row(0x18, "read FIFO queue", Table::Holding, &[Address("FIFO address")], &[WordCount, FifoCount, Registers]),
    row(0x2B, "encapsulated interface transport", Table::Holding, IDENTIFY, IDENTIFICATION),
];

const fn row(
    code: u8,
    name: &'static str,
    table: Table,
    request: &'static [Item],
    response: &'static [Item],
) -> Function {
    Function { code, name, table, request, response, echoes: false }
}

const fn echo(code: u8, name: &'static str, table: Table, items: &'static [Item]) -> Function {
    Function { echoes: true, ..row(code, name, table, items, items) }
}

/// The row of a function; `None` for one that the standard does not know, and for an exception.
pub fn function(code: u8) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.code == code)
}

/// Name of a function; `None` for one that the standard does not know.
pub fn name(code: u8) -> Option<&'static str> {
    function(code).map(|function| function.name)
}

/// The table that a function works on.
pub fn table(code: u8) -> Table {
    function(code).map_or(Table::Holding, |function| function.table)
}

/// Length of a message: unit and PDU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Length {
    Known(usize),
    /// Too little has come to tell.
    TooEarly,
    /// Only silence ends it.
    BySilence,
}

impl Length {
    pub fn known(self) -> Option<usize> {
        match self {
            Length::Known(length) => Some(length),
            Length::TooEarly | Length::BySilence => None,
        }
    }
}

/// Length of the request message that begins in `received`.
pub fn request_length(received: &[u8]) -> Length {
    length(received, |function| function.request)
}

/// Length of the response message that begins in `received`; an exception has three bytes.
pub fn response_length(received: &[u8]) -> Length {
    match received.get(1) {
        Some(0x80..) => Length::Known(3),
        _ => length(received, |function| function.response),
    }
}

fn length(received: &[u8], items: impl Fn(&'static Function) -> &'static [Item]) -> Length {
    let Some(code) = received.get(1) else { return Length::TooEarly };
    let Some(function) = function(*code) else { return Length::BySilence };
    if matches!(items(function), [MeiType, ..]) && received.get(2).is_some_and(|mei| *mei != MEI_IDENTIFICATION) {
        return Length::BySilence;
    }
    measure(received, items(function)).map_or(Length::TooEarly, Length::Known)
}

/// The end of the items in a message; `None` while a count that is needed has not come.
fn measure(message: &[u8], items: &[Item]) -> Option<usize> {
    let byte = |at: usize| message.get(at).map(|byte| usize::from(*byte));
    let mut end = 2;
    for item in items {
        match item {
            ByteCount => return Some(end + 1 + byte(end)?),
            WordCount => return Some(end + 2 + (byte(end)? << 8 | byte(end + 1)?)),
            Objects => return (0..byte(end)?).try_fold(end + 1, |end, _| Some(end + 2 + byte(end + 1)?)),
            _ => end += item.size(),
        }
    }
    Some(end)
}

/// What a response to a read of one table holds, both as PDUs: the table, the first address and a word each; bits are 0 or 1.
/// `None` for any other exchange, and for a response of a wrong length.
pub fn values_read(request: &[u8], response: &[u8]) -> Option<(Table, u16, Vec<u16>)> {
    words_read(request, response, 1)
}

/// The same where each register address holds so many words.
pub fn words_read(request: &[u8], response: &[u8], address_words: u16) -> Option<(Table, u16, Vec<u16>)> {
    let [code, a, b, c, d] = *request else { return None };
    let (address, count) = (u16::from_be_bytes([a, b]), usize::from(u16::from_be_bytes([c, d])));
    let words_expected = count * usize::from(address_words);
    let table = function(code).filter(|_| response.first() == Some(&code))?.table;
    let values = match Response::try_from(Bytes::copy_from_slice(response)).ok()? {
        // The last byte is filled up.
        Response::ReadCoils(bits) | Response::ReadDiscreteInputs(bits) if bits.len() == count.next_multiple_of(8) => {
            bits.into_iter().take(count).map(u16::from).collect()
        }
        Response::ReadHoldingRegisters(words) | Response::ReadInputRegisters(words)
            if words.len() == words_expected =>
        {
            words
        }
        _ => return None,
    };
    Some((table, address, values))
}

/// The objects of a device identification response PDU, id and text, as far as they are whole.
pub fn identification_objects(pdu: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let (count, mut rest) = match pdu {
        [0x2B, MEI_IDENTIFICATION, _, _, _, _, count, rest @ ..] => (*count, rest),
        _ => (0, &[][..]),
    };
    (0..count).map_while(move |_| {
        let [id, length, tail @ ..] = rest else { return None };
        let (text, tail) = tail.split_at(tail.len().min(usize::from(*length)));
        rest = tail;
        Some((*id, text))
    })
}
