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

/// UTF-8, UTF-16 by its mark or its zeros, else Latin-1 or Thai as Windows has them; `Err` where it is no text that is known.
pub fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let text = match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(rest)?,
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes)?,
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes)?,
        [first, 0, ..] if *first != 0 => utf16(bytes, u16::from_le_bytes)?,
        [0, second, ..] if *second != 0 => utf16(bytes, u16::from_be_bytes)?,
        _ => utf8(bytes)?,
    };
    match is_binary(&text) {
        true => Err(not_text()),
        false => Ok(text),
    }
}

fn not_text() -> String {
    t!("it is not text").to_owned()
}

/// The signs of Windows from 0x80 on, where Latin-1 has none; five of the bytes are not used.
const OF_WINDOWS: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8D}Ž\u{8F}\u{90}‘’“”•–—˜™š›œ\u{9D}žŸ";

/// In all other encodings than UTF-8 a byte is a character, of Latin-1 that of its number.
fn utf8(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Ok(Cow::Borrowed(text));
    }
    let text = |of: fn(u8) -> char| bytes.iter().map(|byte| of(*byte)).collect::<String>();
    let western = text(of_windows);
    if is_binary(&western) || runs(bytes).all(is_western) {
        Ok(Cow::Owned(western))
    } else if is_thai(bytes) {
        Ok(Cow::Owned(text(of_thai)))
    } else {
        Err(t!("its characters are neither UTF-8 nor Western: save it as UTF-8").to_owned())
    }
}

fn of_windows(byte: u8) -> char {
    let place = byte.checked_sub(0x80).map(usize::from);
    place.and_then(|place| OF_WINDOWS.chars().nth(place)).unwrap_or(char::from(byte))
}

fn of_thai(byte: u8) -> char {
    match byte {
        0xA1.. => char::from_u32(0x0E01 + u32::from(byte - 0xA1)).unwrap_or('·'),
        byte => of_windows(byte),
    }
}

/// What stands beside each other and is not of ASCII.
fn runs(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let is_of_run = |byte: u8| 0x80 <= byte && byte != 0xA0;
    bytes.chunk_by(move |one, next| is_of_run(*one) && is_of_run(*next)).filter(move |run| is_of_run(run[0]))
}

/// One sign, or a line of the same; of several no more than two letters, besides quotation marks and those of units: other
/// signs stand beside no letter of the West, and more letters in no word.
fn is_western(run: &[u8]) -> bool {
    let is_used = |byte: &u8| !matches!(byte, 0x81 | 0x8D | 0x8F | 0x90 | 0x9D);
    let is_letter = |byte: &&u8| matches!(byte, 0x8A | 0x8C | 0x8E | 0x9A | 0x9C | 0x9E | 0x9F | 0xC0..=0xD6 | 0xD8..);
    let is_mark = |byte: &u8| {
        let is_quote = matches!(byte, 0x80 | 0x82 | 0x84 | 0x85 | 0x91..=0x97 | 0xAB | 0xBB);
        is_quote || matches!(byte, 0xB0..=0xB3 | 0xB5 | 0xB7 | 0xB9 | 0xD7)
    };
    let is_line = run.iter().all(|byte| *byte == run[0]);
    let is_known = run.iter().all(|byte| is_letter(&byte) || is_mark(byte));
    run.iter().all(is_used) && (is_line || is_known && run.iter().filter(is_letter).count() <= 2)
}

/// Words of Thai: vowels and marks above or below stand behind a consonant. What is made of pairs as Chinese and Korean are is
/// not sure to be Thai.
fn is_thai(bytes: &[u8]) -> bool {
    let words = || bytes.chunk_by(|one, next| 0xA1 <= *one && 0xA1 <= *next).filter(|run| 0xA1 <= run[0]);
    let is_mark = |byte: u8| matches!(byte, 0xD1 | 0xD4..=0xDA | 0xE7..=0xEE);
    let is_consonant = |byte: u8| matches!(byte, 0xA1..=0xCE);
    let is_word = |word: &[u8]| {
        !is_mark(word[0])
            && word.iter().all(|byte| matches!(byte, 0xA1..=0xDA | 0xDF..=0xFB))
            && word.windows(2).all(|two| !is_mark(two[1]) || is_consonant(two[0]) || is_mark(two[0]))
    };
    let is_of_pairs = |word: &[u8]| {
        word.len().is_multiple_of(2)
            && word.chunks_exact(2).all(|pair| matches!(pair[0], 0xA1 | 0xA3..=0xA5 | 0xB0..=0xF7))
    };
    let is_sign = |byte: &u8| !matches!(byte, 0x80..=0x9F) || matches!(byte, 0x80 | 0x85 | 0x91..=0x97);
    bytes.iter().all(is_sign)
        && words().all(is_word)
        && words().any(|word| 3 <= word.len())
        && !words().all(is_of_pairs)
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
        for (bytes, expect) in [
            (
                &b"Gr\xF6\xDFe \xABd\xE9bit\xBB Descri\xE7\xE3o m\xB3\xB7\xB0C \x97\x97\x97"[..],
                "Größe «débit» Descrição m³·°C ———",
            ),
            (b"\xE1\xC3\xA7\xB4\xD1\xB9;\xA1\xC3\xD0\xE1\xCA", "แรงดัน;กระแส"),
        ] {
            assert_eq!(decode(bytes).as_deref(), Ok(expect));
        }
        for other in [
            &b"\x89\xB7\x93x;\x93d\x88\xB3"[..],
            b"\xCE\xC2\xB6\xC8;\xB5\xE7\xD1\xB9",
            b"\xD2\xE5\xEC\xEF\xE5\xF0\xE0\xF2\xF3\xF0\xE0",
        ] {
            assert!(decode(other).is_err_and(|why| why.contains("save it as UTF-8")), "{other:?}");
        }
        for bytes in [&b"\x89PNG\r\n\x1a\n\x00\x00"[..], b"\x7fELF\x02\x01", b"\xFF\xFE\x00\xD8\x00\x00"] {
            assert!(decode(bytes).is_err(), "{bytes:?}");
        }
    }
}
