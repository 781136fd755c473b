//! Pasted text with more in it than bytes: ASCII frames between other characters, hex between other words.

use super::{HexInputError, ParsedInput, digits_of, of_log};
use crate::{bus::ascii, plant::line::Framing};

/// Most bytes of a paste.
const PASTE_MAX: usize = 0x1_0000;
/// Fewest digits of an ASCII frame: unit, function, LRC.
const DIGITS_MIN: usize = 6;

/// What was pasted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pasted {
    /// Its bytes.
    pub input: ParsedInput,
    /// Words between them were left out: only a frame among the bytes shows that they were meant.
    pub doubt: Option<HexInputError>,
}

/// Reads what [`super::parse`] reads, of any length, and bytes among other words or characters.
pub fn parse_paste(text: &str) -> Result<Pasted, HexInputError> {
    let (sent, skipped, rest) = of_log(text);
    if let Some(bytes) = ascii_frames(rest) {
        return Ok(Pasted { input: ParsedInput { bytes, framing: Some(Framing::Ascii), sent }, doubt: None });
    }
    let error = match super::parse_up_to(text, PASTE_MAX) {
        Ok(input) => return Ok(Pasted { input, doubt: None }),
        Err(error) => error,
    };
    let words = rest.split_whitespace().filter_map(|word| digits_of(word, skipped).ok());
    let bytes: Vec<u8> = words.flatten().take(PASTE_MAX).collect();
    match (&error, bytes.len()) {
        (HexInputError::NotHex { .. } | HexInputError::OddDigits { .. }, 4..) => {
            Ok(Pasted { input: ParsedInput { bytes, framing: None, sent }, doubt: Some(error) })
        }
        _ => Err(error),
    }
}

/// The characters of a text with an ASCII frame in it whose LRC fits; each frame gets the CR LF that may have been lost.
fn ascii_frames(text: &str) -> Option<Vec<u8>> {
    let text = text.replace("\\r", "\r").replace("\\n", "\n");
    let mut parts = text.split(':');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    let mut found = false;
    for part in parts {
        let end = part.find(|letter: char| !letter.is_ascii_hexdigit()).unwrap_or(part.len());
        let (digits, rest) = part.split_at(end);
        let frame = [b":", digits.as_bytes(), b"\r\n"].concat();
        if end < DIGITS_MIN || ascii::open(&frame).is_err() {
            bytes.extend([b":", part.as_bytes()].concat());
            continue;
        }
        found = true;
        bytes.extend(frame);
        let rest = rest.strip_prefix("\r\n").or(rest.strip_prefix(['\r', '\n'])).unwrap_or(rest);
        bytes.extend(rest.as_bytes());
    }
    found.then_some(bytes)
}
