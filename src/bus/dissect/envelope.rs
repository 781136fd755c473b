//! The envelope of a message: CRC, LRC or MBAP header, and how to recognise it.

use super::Field;
use crate::{
    bus::{
        ascii,
        frame::{self, Mbap, hex},
        names::{Counted, counted},
    },
    plant::{fault::Fault, line::Framing},
    t,
};

/// A message and what stood around it.
pub(super) struct Envelope {
    /// `None`: a message without check or header.
    pub framing: Option<Framing>,
    /// Unit and PDU, as far as they could be read.
    pub message: Vec<u8>,
    /// Where the message begins in the frame, and how many characters one of its bytes takes there.
    pub offset: usize,
    pub step: usize,
    pub before: Vec<Field>,
    pub after: Vec<Field>,
    /// What is wrong with the frame around the message.
    pub fault: Option<String>,
}

/// The framing of bytes, recognised: `:` and text is ASCII, a CRC that fits is RTU, a header whose length fits is TCP. A read
/// of registers from 0 looks as if it had a header; a frame of TCP hardly ever has a CRC.
pub fn recognise(bytes: &[u8]) -> Option<Framing> {
    // Unit 58 of a binary frame is a `:` too, but what follows it is no text.
    let text = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    if bytes.starts_with(b":") && bytes.iter().all(text) {
        Some(Framing::Ascii)
    } else if 4 <= bytes.len() && frame::without_crc(bytes).is_ok() {
        Some(Framing::Rtu)
    } else if matches!(frame::mbap(bytes), Mbap::Whole { end, .. } if end == bytes.len()) {
        Some(Framing::Mbap)
    } else {
        None
    }
}

/// Unit and PDU of a frame, whether or not its check fits; `None` if there are none.
pub fn message_of(bytes: &[u8], framing: Framing) -> Option<Vec<u8>> {
    let message = open(bytes, Some(framing)).message;
    (2 <= message.len()).then_some(message)
}

/// Takes a frame apart.
pub(super) fn open(bytes: &[u8], framing: Option<Framing>) -> Envelope {
    match framing {
        Some(Framing::Rtu) => rtu(bytes),
        Some(Framing::Ascii) => in_ascii(bytes),
        Some(Framing::Mbap) => mbap(bytes),
        None => bare(bytes),
    }
}

fn bare(bytes: &[u8]) -> Envelope {
    let message = bytes.to_vec();
    Envelope { framing: None, message, offset: 0, step: 1, before: Vec::new(), after: Vec::new(), fault: None }
}

fn rtu(bytes: &[u8]) -> Envelope {
    let framing = Some(Framing::Rtu);
    let Some((message, check)) = bytes.split_last_chunk::<2>().filter(|(message, _)| !message.is_empty()) else {
        return Envelope { framing, fault: Some(too_short(bytes.len(), 4)), ..bare(bytes) };
    };
    let computed = frame::crc16(message).to_le_bytes();
    // As the bytes stand on the wire, low byte first.
    let fault = (*check != computed)
        .then(|| t!("CRC error: got {got}, computed {computed}", got = hex(check), computed = hex(&computed)));
    let words = match fault {
        None => t!("right").to_owned(),
        Some(_) if computed == [check[1], check[0]] => {
            t!("bytes swapped: {computed} is right, low byte first", computed = hex(&computed))
        }
        Some(_) => t!("wrong, computed {computed}", computed = hex(&computed)),
    };
    let after = vec![Field { range: message.len()..bytes.len(), hex: hex(check), name: "CRC".into(), words }];
    Envelope { framing, after, fault, ..bare(message) }
}

fn in_ascii(bytes: &[u8]) -> Envelope {
    let field = |from: usize, to: usize, name: &str, words: String| Field {
        range: from..to,
        hex: hex(&bytes[from..to]),
        name: name.into(),
        words,
    };
    let framing = Some(Framing::Ascii);
    let start = usize::from(bytes.starts_with(b":"));
    let end = bytes.iter().position(|byte| matches!(byte, b'\r' | b'\n')).unwrap_or(bytes.len()).max(start);
    let fault = ascii::open(bytes).err();
    let mut is_cut = matches!(fault, Some(Fault::Truncated { .. }));
    let mut fault = fault.map(|fault| fault.to_string());
    let mut before = Vec::new();
    if start == 1 {
        before.push(field(0, 1, t!("start"), t!("`:` begins an ASCII frame").into()));
    } else {
        fault = Some(t!("no `:` at the beginning").into());
    }
    let mut after = Vec::new();
    let message = match ascii::decode(&bytes[start..end]) {
        Ok(mut message) => {
            if let Some(got) = message.pop() {
                let computed = ascii::lrc(&message);
                let words = match got == computed {
                    true => t!("right").into(),
                    false => t!("wrong, computed {computed}", computed = format!("{computed:02X}")),
                };
                after.push(Field { hex: format!("{got:02X}"), ..field(end - 2, end, "LRC", words) });
            }
            message
        }
        Err(why) => {
            is_cut = false;
            after.push(field(start, end, t!("digits"), format!("\"{}\"", bytes[start..end].escape_ascii())));
            fault = Some(match bytes[start..end].iter().position(|digit| !digit.is_ascii_hexdigit()) {
                Some(at) => {
                    t!(
                        "`{found}` at character {number} is not a hex digit",
                        found = bytes[start + at].escape_ascii(),
                        number = start + at + 1
                    )
                }
                None => t!("odd count of hex digits: {why}", why),
            });
            Vec::new()
        }
    };
    if end < bytes.len() {
        let right = &bytes[end..] == b"\r\n";
        after.push(field(end, bytes.len(), t!("end"), if right { "CR LF" } else { t!("must be CR LF") }.into()));
    } else if before.len() == 1 && is_cut {
        fault = Some(t!("CR LF missing at the end").into());
    }
    Envelope { framing, message, offset: start, step: 2, before, after, fault }
}

fn mbap(bytes: &[u8]) -> Envelope {
    let framing = Some(Framing::Mbap);
    if bytes.len() < 8 {
        return Envelope { framing, fault: Some(too_short(bytes.len(), 8)), ..bare(bytes) };
    }
    let word = |at: usize| u16::from_be_bytes([bytes[at], bytes[at + 1]]);
    let field = |at: usize, name: &str, words: String| Field {
        range: at..at + 2,
        hex: hex(&bytes[at..at + 2]),
        name: name.into(),
        words,
    };
    let (protocol, length, follow) = (word(2), usize::from(word(4)), bytes.len() - 6);
    let before = vec![
        field(0, t!("transaction"), t!("{number}, the response repeats it", number = word(0))),
        field(
            2,
            t!("protocol"),
            if protocol == 0 { "0, Modbus".into() } else { t!("{protocol}, must be 0", protocol) },
        ),
        field(
            4,
            t!("length"),
            match length == follow {
                true => t!("{count} bytes follow", count = length),
                false => t!("says {length}, {follow} follow", length, follow),
            },
        ),
    ];
    let fault = if protocol != 0 {
        Some(t!("MBAP protocol {protocol}, expected 0", protocol))
    } else if length != follow {
        Some(t!("MBAP length says {length}, {follow} bytes follow", length, follow))
    } else if frame::MESSAGE_MAX < length {
        Some(t!("MBAP length {length}, at most {most} is allowed", length, most = frame::MESSAGE_MAX))
    } else {
        None
    };
    Envelope { framing, before, offset: 6, fault, ..bare(&bytes[6..]) }
}

fn too_short(got: usize, least: usize) -> String {
    t!("too short for a frame: {bytes}, the shortest has {least}", bytes = counted(got, Counted::Bytes), least)
}
