//! Reads a message from left to right, naming every byte; says what is missing, what is too much, what does not fit.

use std::ops::Range;

use super::Field;
use crate::{
    bus::{
        frame,
        names::{self, Counted},
        pdu,
    },
    plant::{number::to_u16, visible::is_control_or_bidi},
    t,
};

/// The reading of one message as a request or as an answer.
pub(super) struct Reader<'a> {
    message: &'a [u8],
    /// Bytes read.
    pub at: usize,
    pub fields: Vec<Field>,
    /// The first thing that does not fit.
    pub trouble: Option<String>,
    /// Bytes read before it was found.
    sense: Option<usize>,
}

impl<'a> Reader<'a> {
    pub fn new(message: &'a [u8]) -> Reader<'a> {
        Reader { message, at: 0, fields: Vec::new(), trouble: None, sense: None }
    }

    /// Everything was read, and nothing was wrong.
    pub fn fits(&self) -> bool {
        self.trouble.is_none() && self.at == self.message.len()
    }

    /// How many bytes made sense.
    pub fn sense(&self) -> usize {
        self.sense.unwrap_or(self.at)
    }

    /// Bytes not yet read.
    pub fn left(&self) -> usize {
        self.message.len() - self.at
    }

    pub fn byte(&mut self, name: &str, words: impl FnOnce(u8) -> String) -> Option<u8> {
        let (range, bytes) = self.take(1, name)?;
        self.name(range, name.to_owned(), words(bytes[0]));
        Some(bytes[0])
    }

    pub fn word(&mut self, name: &str, words: impl FnOnce(u16) -> String) -> Option<u16> {
        let (range, bytes) = self.take(2, name)?;
        let value = u16::from_be_bytes([bytes[0], bytes[1]]);
        self.name(range, name.to_owned(), words(value));
        Some(value)
    }

    pub fn bytes(&mut self, name: &str, count: usize, words: impl FnOnce(&[u8]) -> String) -> Option<&'a [u8]> {
        let (range, bytes) = self.take(count, name)?;
        if !bytes.is_empty() {
            self.name(range, name.to_owned(), words(bytes));
        }
        Some(bytes)
    }

    /// `count` registers; `start` is the wire address of the first, if it is known.
    pub fn registers(
        &mut self,
        function: u8,
        start: Option<u16>,
        count: usize,
        address_words: usize,
    ) -> Option<Vec<u16>> {
        let mut values = Vec::new();
        for index in 0..count {
            let name = match start {
                Some(start) => {
                    let address = start.saturating_add(to_u16(index / address_words));
                    let place = format!("{} / 0x{address:04X}", pdu::modicon(function, address));
                    match address_words {
                        1 => place,
                        _ => t!("{place} word {number}", place, number = index % address_words + 1),
                    }
                }
                None => t!("register {number}", number = index + 1),
            };
            values.push(self.word(&name, number)?);
        }
        Some(values)
    }

    /// The bytes of `count` bits, lowest address in the lowest bit; a count that is not known is that of all the bits.
    pub fn bits(&mut self, function: u8, start: Option<u16>, count: usize) -> Option<Vec<bool>> {
        let mut values = Vec::new();
        while values.len() < count {
            let first = values.len();
            let of_byte = (count - first).min(8);
            let name = match start {
                Some(start) => pdu::span(function, start.saturating_add(to_u16(first)), to_u16(of_byte)),
                None if of_byte == 1 => t!("bit {number}", number = first + 1),
                None => t!("bits {first}–{last}", first = first + 1, last = first + of_byte),
            };
            let (range, bytes) = self.take(1, &name)?;
            let bits: Vec<bool> = (0..of_byte).map(|bit| bytes[0] >> bit & 1 == 1).collect();
            let digits: Vec<&str> = bits.iter().map(|on| if *on { "1" } else { "0" }).collect();
            let mut words = digits.join(" ");
            if first == 0 && 1 < of_byte {
                words += t!("  (lowest address first)");
            }
            self.name(range, name, words);
            values.extend(bits);
        }
        Some(values)
    }

    /// Notes what does not fit; the first note stands.
    pub fn wrong(&mut self, words: String) {
        self.trouble.get_or_insert(words);
        self.sense.get_or_insert(self.at);
    }

    /// Names what is left over.
    pub fn finish(&mut self) {
        let left = self.left();
        if left == 0 {
            return;
        }
        let words = if self.trouble.is_none() { t!("does not belong to this message") } else { t!("unknown") };
        self.wrong(t!("{bytes} too many", bytes = names::counted(left, Counted::Bytes)));
        self.name(self.at..self.message.len(), t!("rest").into(), words.into());
    }

    fn take(&mut self, count: usize, name: &str) -> Option<(Range<usize>, &'a [u8])> {
        let range = self.at..self.at + count;
        let Some(bytes) = self.message.get(range.clone()) else {
            let missing = count - self.left();
            self.wrong(t!(
                "cut short: {bytes} of {name} missing",
                bytes = names::counted(missing, Counted::Bytes),
                name
            ));
            return None;
        };
        self.at = range.end;
        Some((range, bytes))
    }

    fn name(&mut self, range: Range<usize>, name: String, words: String) {
        let hex = frame::hex(&self.message[range.clone()]);
        self.fields.push(Field { range, hex, name, words });
    }
}

/// `0x00C8  200`, and the signed reading where it differs: `0xFFFE  65534 or -2`.
fn number(value: u16) -> String {
    match value.cast_signed() {
        signed @ ..0 => t!("0x{hex}  {value} or {signed}", hex = format!("{value:04X}"), value, signed),
        0.. => format!("0x{value:04X}  {value}"),
    }
}

/// `00C8 0000`.
pub(super) fn hex_words(values: &[u16]) -> String {
    values.iter().map(|value| format!("{value:04X}")).collect::<Vec<_>>().join(" ")
}

/// `1011 0011 10`.
pub(super) fn bit_words(bits: &[bool]) -> String {
    let group = |bits: &[bool]| bits.iter().map(|on| if *on { '1' } else { '0' }).collect::<String>();
    bits.chunks(4).map(group).collect::<Vec<_>>().join(" ")
}

/// Text as it stands, anything else escaped.
pub(super) fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) if !text.contains(is_control_or_bidi) => format!("\"{text}\""),
        Ok(_) | Err(_) => format!("\"{}\"", bytes.escape_ascii()),
    }
}
