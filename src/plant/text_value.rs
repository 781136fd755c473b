//! Texts of devices, with their dates, times and addresses: words of registers as text, and typed text as words.
//! Words are most significant first; the codec of the bus puts them in the order of a device.

mod clock;
mod digits;

use std::{fmt, time::Duration};

use jiff::Zoned;
use serde::{Deserialize, Serialize};

use super::{
    data_type::{Clock, DataType, NetworkAddress},
    visible::is_printable,
};
use crate::t;

/// What stands for a byte that is no part of a printable character.
pub const UNPRINTABLE: char = '·';
/// What is typed to set a clock by that of the station.
pub const NOW: &str = "now";

/// The text that words hold, two characters a word, in UTF-8 (which plain ASCII is): NULs and blanks at its end are filling,
/// each byte or character that cannot be printed is shown as [`UNPRINTABLE`], and text of which nothing can be printed as the
/// hex of its bytes, or of its registers where each holds one character. `None` for a type that holds no text, and for what is no date, time or address.
pub fn decode(kind: DataType, words: &[u16]) -> Option<String> {
    let bytes: Vec<u8> = words.iter().copied().flat_map(u16::to_be_bytes).collect();
    if let DataType::Clock(clock) = kind {
        return clock::text(clock, words);
    } else if let DataType::Version(_) = kind {
        return Some(digits::version(words));
    } else if let DataType::NetworkAddress(address) = kind {
        return digits::address(address, &bytes);
    }
    let count = kind.length().filter(|_| kind.is_text())?;
    // A character that does not fit one byte is none that can be printed: 0xFF is in no UTF-8.
    let is_of_words = matches!(kind, DataType::Chars(_));
    let single = |word: &u16| u8::try_from(*word).unwrap_or(0xFF);
    let bytes = if is_of_words { words.iter().map(single).collect() } else { bytes };
    let bytes = bytes.get(..usize::from(count))?;
    let to_nul = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    let bytes = if let DataType::TextToNul(_) = kind { to_nul } else { bytes };
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | b' ')).map_or(0, |last| last + 1);
    let bytes = &bytes[..end];
    let mut text = String::new();
    for chunk in bytes.utf8_chunks() {
        text.extend(chunk.valid().chars().map(|letter| if is_printable(letter) { letter } else { UNPRINTABLE }));
        text.extend(chunk.invalid().iter().map(|_| UNPRINTABLE));
    }
    let nothing = !text.is_empty() && text.chars().all(|letter| letter == UNPRINTABLE || letter == ' ');
    let held = if is_of_words { words } else { &bytes.iter().copied().map(u16::from).collect::<Vec<_>>() };
    let hex = held.iter().take(bytes.len()).map(|held| format!("{held:02X}"));
    Some(if nothing { hex.collect::<Vec<_>>().join(" ") } else { text })
}

/// The words that hold a text as it is shown, filled with NULs; `None` unless they would be shown as the same text: it is too
/// long, ends in what would be taken for filling, has characters that cannot be printed, or is no date, time or address.
pub fn encode(kind: DataType, text: &str) -> Option<Vec<u16>> {
    let words = if let DataType::Clock(clock) = kind {
        clock::words(clock, text)?
    } else if let DataType::NetworkAddress(address) = kind {
        digits::words(address, text)?
    } else {
        kind.length().filter(|count| text.len() <= usize::from(*count))?;
        let mut bytes = text.as_bytes().to_vec();
        if let DataType::Chars(_) = kind {
            bytes = bytes.into_iter().flat_map(|byte| [0, byte]).collect();
        }
        bytes.resize(usize::from(kind.words()) * 2, 0);
        bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
    };
    (decode(kind, &words).as_deref() == Some(text)).then_some(words)
}

/// A text in a line of words, where an empty one must be seen.
pub fn quoted(text: &str) -> String {
    if text.is_empty() { "\"\"".to_owned() } else { text.to_owned() }
}

/// Registers that one request writes at most (V1.1b3, 6.12).
pub const WRITE_MAX: u16 = 123;

/// Can a text of this type be written?
pub fn is_writable(kind: DataType) -> bool {
    kind.is_text() && !matches!(kind, DataType::Version(_)) && kind.words() <= WRITE_MAX
}

/// A typed text as a device will show it once it is written. `now` is the time and the zone of the plant.
pub fn as_held(kind: DataType, typed: &str, now: &Zoned) -> Result<String, ExpectedText> {
    let text = if let DataType::Clock(clock) = kind {
        clock::typed(clock, typed.trim(), now)
    } else if let DataType::NetworkAddress(address) = kind {
        digits::typed(address, typed.trim())
    } else {
        Some(typed.to_owned())
    };
    text.filter(|text| encode(kind, text).is_some()).ok_or(ExpectedText(kind))
}

/// Does a device that shows the second text hold the first, written this long ago? A clock goes on in the meantime.
pub fn is_held(kind: DataType, written: &str, shown: &str, ago: Duration) -> bool {
    if let (DataType::Clock(clock), true) = (kind, is_running(kind)) {
        return clock::goes_on(clock, written, shown, ago);
    }
    written == shown
}

/// Does it go on by itself, so that what was seen of it is no more what it shows?
pub fn is_running(kind: DataType) -> bool {
    if let DataType::Clock(clock) = kind { clock::is_running(clock) } else { false }
}

/// What can be written into a type, in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExpectedText(pub DataType);

impl fmt::Display for ExpectedText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = self.0;
        f.write_str(&match (kind, kind.length().filter(|_| is_writable(kind))) {
            (DataType::Clock(Clock::Epoch), _) => t!("a date and time such as 2026-11-30T14:05:00Z, or now").to_owned(),
            (DataType::Clock(Clock::Words | Clock::Bytes | Clock::Bcd), _) => {
                t!("a date and time such as 2026-11-30 14:05:00, or now").to_owned()
            }
            (DataType::Clock(_), _) => t!("an hour and minute such as 14:05, or now").to_owned(),
            (DataType::NetworkAddress(NetworkAddress::Eui48), _) => {
                t!("an address such as 00:1B:44:11:3A:B7").to_owned()
            }
            (DataType::NetworkAddress(NetworkAddress::Ipv4), _) => t!("an address such as 192.168.0.7").to_owned(),
            (DataType::NetworkAddress(NetworkAddress::Ipv6), _) => t!("an address such as fe80::7").to_owned(),
            (_, Some(most)) => t!("printable characters in at most {most} bytes, no blank at the end", most),
            (_, None) => t!("a text that can be written, which this tag does not hold").to_owned(),
        })
    }
}

#[cfg(test)]
mod tests;
