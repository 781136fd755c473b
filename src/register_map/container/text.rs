//! The text of a file, of whatever encoding.

use std::borrow::Cow;

use crate::t;

/// Control characters that no text has; form feeds and the old end of a file stand in some.
fn is_strange(sign: char) -> bool {
    sign.is_control() && !matches!(sign, '\t' | '\n' | '\r' | '\u{0B}' | '\u{0C}' | '\u{1A}' | '\u{85}')
}

/// A stray control character makes no text a picture; a zero does, and many of them do.
fn is_binary(text: &str) -> bool {
    let first = || text.chars().take(1 << 16);
    let strange = first().filter(|sign| is_strange(*sign)).count();
    first().any(|sign| sign == '\0') || first().count() < 20 * strange
}

/// UTF-8, UTF-16 by its mark or its zeros, else Latin-1 as Windows has it; `Err` where it is no text.
pub fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let text = match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(rest),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes)?,
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes)?,
        [first, 0, ..] if *first != 0 => utf16(bytes, u16::from_le_bytes)?,
        [0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes)?,
        _ => utf8(bytes),
    };
    match is_binary(&text) {
        true => Err(not_text()),
        false => Ok(text),
    }
}

fn not_text() -> String {
    t!("it is no text").to_owned()
}

/// The signs of Windows from 0x80 on, where Latin-1 has none; five of the bytes are not used.
const OF_WINDOWS: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8D}Ž\u{8F}\u{90}‘’“”•–—˜™š›œ\u{9D}žŸ";

/// Each byte of Latin-1 is the character of its number.
fn utf8(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| of_windows(*byte)).collect()),
    }
}

fn of_windows(byte: u8) -> char {
    let place = byte.checked_sub(0x80).map(usize::from);
    place.and_then(|place| OF_WINDOWS.chars().nth(place)).unwrap_or(char::from(byte))
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<Cow<'_, str>, String> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let text: Result<String, _> = char::decode_utf16(units).collect();
    text.map(Cow::Owned).map_err(|_| not_text())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_of_any_encoding_is_read_and_a_picture_is_not() {
        let both = |order: fn(u16) -> [u8; 2], mark: &[u8]| -> Vec<u8> {
            mark.iter().copied().chain("5;°C\n".encode_utf16().flat_map(order)).collect()
        };
        for bytes in [
            "5;°C\n".as_bytes().to_vec(),
            [b"\xEF\xBB\xBF", "5;°C\n".as_bytes()].concat(),
            both(u16::to_le_bytes, b"\xFF\xFE"),
            both(u16::to_be_bytes, b"\xFE\xFF"),
            both(u16::to_le_bytes, b""),
            b"5;\xB0C\n".to_vec(),
        ] {
            assert_eq!(decode(&bytes).as_deref(), Ok("5;°C\n"), "{bytes:?}");
        }
        assert_eq!(decode(b"\x80 \x93a\x94 \x89 \xE4").as_deref(), Ok("€ “a” ‰ ä"), "as Windows has it");
        for bytes in [&b"\x89PNG\r\n\x1a\n\x00\x00"[..], b"\x7fELF\x02\x01", b"\xFF\xFE\x00\xD8\x00\x00"] {
            assert!(decode(bytes).is_err(), "{bytes:?}");
        }
    }
}
