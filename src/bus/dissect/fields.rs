//! The fields of a request or response by the layout of its function; with the request, values get their addresses.

use super::{
    Direction,
    reader::{Reader, hex_words, text},
};
use crate::{
    bus::{
        frame::{Request, hex},
        names::{self, Counted, counted},
        pdu::{self, FILE_REFERENCE, Item, MEI_IDENTIFICATION},
        request_lint::coil_value_words,
    },
    t,
    text::translate,
};

/// What the fields of one message hold.
#[derive(Default)]
pub(super) struct Values {
    /// Address and count of each block; those of the request in a response that does not repeat them.
    pub blocks: Vec<(u16, u16)>,
    /// Every other number, in order.
    pub numbers: Vec<u16>,
    pub registers: Vec<u16>,
    /// Words of them that each address holds.
    pub address_words: usize,
    pub bits: Vec<bool>,
    /// Data, objects or groups, each as text.
    pub parts: Vec<String>,
}

/// Reads the fields of one message.
pub(super) struct Fields<'r, 'a> {
    reader: &'r mut Reader<'a>,
    function: u8,
    direction: Direction,
    values: Values,
    /// First address of the values that follow, and how many there are, as far as known.
    start: Option<u16>,
    count: Option<u16>,
    /// Does the message itself say the count?
    counts: bool,
    /// Bytes that follow, by the latest byte count.
    bytes: usize,
}

impl<'r, 'a> Fields<'r, 'a> {
    /// `asked` is the request: the message itself, or that of a response if it is known.
    pub fn new(
        reader: &'r mut Reader<'a>,
        function: u8,
        direction: Direction,
        asked: Option<Request>,
    ) -> Fields<'r, 'a> {
        let of_response = asked.filter(|_| direction == Direction::Answer).map(|asked| asked.message);
        let word = |at: usize| Some(u16::from_be_bytes([*of_response?.get(at)?, *of_response?.get(at + 1)?]));
        let address_words = asked.map_or(1, |asked| usize::from(asked.address_words));
        let values = Values { address_words, ..Values::default() };
        let (start, count) = (word(2), word(4));
        Fields { reader, function, direction, values, start, count, counts: false, bytes: 0 }
    }

    /// Reads the items; `None` if the message is cut short.
    pub fn read(mut self, items: &[Item]) -> Option<Values> {
        for (index, item) in items.iter().enumerate() {
            match *item {
                Item::ByteCount => self.byte_count(items.get(index + 1).copied())?,
                Item::MeiType if self.mei_type()? != MEI_IDENTIFICATION => {
                    let left = self.reader.left();
                    self.reader.bytes(t!("data"), left, text)?;
                    break;
                }
                Item::MeiType => {}
                item => self.item(item)?,
            }
        }
        Some(self.values)
    }

    fn item(&mut self, item: Item) -> Option<()> {
        let function = self.function;
        match item {
            Item::Address(name) => {
                let address = self.reader.word(translate(name), |address| pdu::place(function, address))?;
                self.start = Some(address);
                self.values.blocks.push((address, 1));
            }
            Item::Count { name, verb, .. } => {
                let kind = if pdu::table(function).is_bits() { Counted::Bits } else { Counted::Registers };
                let label = |count: u16| format!("{} {}", counted(count.into(), kind), translate(verb));
                let count = self.reader.word(translate(name), label)?;
                (self.count, self.counts) = (Some(count), true);
                self.values.blocks.last_mut()?.1 = count;
            }
            Item::CoilState => self.coil_state()?,
            Item::Register => {
                self.values.registers = self.reader.registers(function, self.start, 1, 1)?;
            }
            Item::Byte(name, label) => self.values.numbers.push(self.reader.byte(translate(name), label)?.into()),
            Item::Word(name, label) => self.number(translate(name), label)?,
            Item::OrMask => {
                let and = self.values.numbers.last().copied().unwrap_or_default();
                self.number(t!("OR mask"), |mask| {
                    t!("sets {bits} of the others", bits = format!("{:016b}", mask & !and))
                })?;
            }
            Item::Data => self.data()?,
            Item::Bits => {
                let count = self.count.map_or(8 * self.bytes, |count| usize::from(count).min(8 * self.bytes));
                self.values.bits = self.reader.bits(function, self.start, count)?;
            }
            Item::Registers => {
                let each = self.values.address_words;
                let counted = self.count.filter(|_| self.counts).map(|count| usize::from(count) * each);
                let count = counted.unwrap_or(self.bytes / 2).min(self.bytes / 2);
                self.values.registers = self.reader.registers(function, self.start, count, each)?;
            }
            Item::WordCount => {
                self.bytes = self.reader.word(t!("byte count"), |count| t!("{count} bytes follow", count))?.into();
            }
            Item::FifoCount => self.fifo_count()?,
            Item::Events => {
                if self.bytes < 6 {
                    self.reader.wrong(t!("byte count says {got}, expected 6 or more", got = self.bytes));
                }
                let count = self.bytes.saturating_sub(6);
                self.reader.bytes(t!("events"), count, |_| t!("one byte per event, latest first").into())?;
            }
            Item::ServerId => {
                let label = |bytes: &[u8]| t!("{text}, run state FF on, 00 off", text = text(bytes));
                let id = self.reader.bytes(t!("id and run"), self.bytes, label)?;
                self.values.parts.push(text(id));
            }
            Item::FileRequests | Item::FileWrites | Item::FileRecords => self.groups(item)?,
            Item::NextObject => {
                let more = self.values.numbers.last() != Some(&0);
                self.reader.byte(t!("next object"), |id| match more {
                    false => t!("none").into(),
                    true => t!("continue from {id} {object}", id, object = names::object(id)),
                })?;
            }
            Item::Objects => self.objects()?,
            Item::ByteCount | Item::MeiType => {}
        }
        Some(())
    }

    /// A number of two bytes that is kept.
    fn number(&mut self, name: &str, label: impl FnOnce(u16) -> String) -> Option<()> {
        let number = self.reader.word(name, label)?;
        self.values.numbers.push(number);
        Some(())
    }

    fn coil_state(&mut self) -> Option<()> {
        let label = |value| coil_state(value).unwrap_or(t!("neither on (FF00) nor off (0000)")).into();
        let value = self.reader.word(t!("value"), label)?;
        if coil_state(value).is_none() {
            self.reader.wrong(coil_value_words(value));
        }
        self.values.numbers.push(value);
        Some(())
    }

    /// The count of a queue must fit the byte count before it.
    fn fifo_count(&mut self) -> Option<()> {
        self.number(t!("FIFO count"), |count| {
            t!("{registers} queued", registers = counted(count.into(), Counted::Registers))
        })?;
        let count = usize::from(*self.values.numbers.last()?);
        if self.bytes != 2 + 2 * count {
            self.reader.wrong(t!("byte count says {got}, {expected} fit", got = self.bytes, expected = 2 + 2 * count));
        }
        (self.start, self.bytes) = (None, 2 * count);
        Some(())
    }

    /// The byte count must fit what `next` needs.
    fn byte_count(&mut self, next: Option<Item>) -> Option<()> {
        self.bytes = usize::from(self.reader.byte(t!("byte count"), follow)?);
        let bytes = self.bytes;
        let each = self.values.address_words;
        let expected = match (&next, self.count.map(usize::from)) {
            (Some(Item::Bits), Some(count)) => count.div_ceil(8),
            (Some(Item::Registers), Some(count)) if self.counts => 2 * count * each,
            _ => bytes,
        };
        if bytes != expected {
            self.reader.wrong(t!("byte count says {got}, {expected} fit", got = bytes, expected));
        } else if matches!(next, Some(Item::Registers)) && bytes % 2 == 1 {
            self.reader.wrong(t!("byte count {bytes} is odd, registers have two bytes", bytes));
        }
        Some(())
    }

    /// What function 08 sends and gets back.
    fn data(&mut self) -> Option<()> {
        let words = |bytes: &[u8]| match bytes {
            [high, low] => u16::from_be_bytes([*high, *low]).to_string(),
            [..] => counted(bytes.len(), Counted::Bytes),
        };
        let name = if self.direction == Direction::Request { t!("data") } else { t!("result") };
        let count = self.reader.left().max(2);
        let bytes = self.reader.bytes(name, count, words)?;
        self.values.parts.push(format!("{name} {}", hex(bytes)));
        Some(())
    }

    /// The kind of an encapsulated transport.
    fn mei_type(&mut self) -> Option<u8> {
        self.reader.byte(t!("MEI type"), |kind| match kind {
            0x0D => "13 / 0x0D CANopen".into(),
            0x0E => t!("14 / 0x0E read device identification").into(),
            _ => t!("{code} unknown", code = names::code(kind)),
        })
    }

    fn groups(&mut self, item: Item) -> Option<()> {
        let end = self.reader.at + self.bytes;
        while self.reader.at < end {
            let group = match item {
                Item::FileRecords => self.file_record(),
                _ => self.file_group(matches!(item, Item::FileWrites)),
            };
            self.values.parts.push(group?);
        }
        Some(())
    }

    /// Length, reference type and registers.
    fn file_record(&mut self) -> Option<String> {
        let length = usize::from(self.reader.byte(t!("group length"), follow)?);
        self.reference()?;
        Some(hex_words(&self.reader.registers(0x03, None, length.saturating_sub(1) / 2, 1)?))
    }

    /// Reference type, file, record and length; and the registers to write.
    fn file_group(&mut self, with_data: bool) -> Option<String> {
        self.reference()?;
        let file = self.reader.word(t!("file"), |file| t!("file {file}", file))?;
        let record = self.reader.word(t!("record"), |record| t!("from record {record}", record))?;
        let length = self.reader.word(t!("length"), |length| counted(length.into(), Counted::Registers))?;
        let registers = if with_data { usize::from(length) } else { 0 };
        let data = hex_words(&self.reader.registers(0x03, None, registers, 1)?);
        let data = if data.is_empty() { String::new() } else { format!(": {data}") };
        let count = counted(length.into(), Counted::Registers);
        Some(t!("file {file} record {record}, {count}{data}", file, record, count, data))
    }

    fn reference(&mut self) -> Option<()> {
        let kind = self.reader.byte(t!("reference"), |kind| {
            if kind == FILE_REFERENCE { t!("file record") } else { t!("must be 06") }.into()
        })?;
        if kind != FILE_REFERENCE {
            self.reader.wrong(t!("reference type {kind}, expected 06", kind = format!("{kind:02X}")));
        }
        Some(())
    }

    fn objects(&mut self) -> Option<()> {
        let count = self.reader.byte(t!("objects"), |count| counted(count.into(), Counted::Objects))?;
        for _ in 0..count {
            let id = self.reader.byte(t!("object"), |id| format!("{id} {}", names::object(id)))?;
            let length = self.reader.byte(t!("length"), |length| counted(length.into(), Counted::Bytes))?;
            let value = self.reader.bytes(names::object(id), length.into(), text)?;
            self.values.parts.push(format!("{} {}", names::object(id), text(value)));
        }
        Some(())
    }
}

/// `on` or `off`; `None` for any other value of a coil.
pub(super) fn coil_state(value: u16) -> Option<&'static str> {
    match value {
        0x0000 => Some(t!("off")),
        0xFF00 => Some(t!("on")),
        _ => None,
    }
}

fn follow(count: u8) -> String {
    match count {
        1 => t!("1 byte follows").into(),
        _ => t!("{count} bytes follow", count),
    }
}
