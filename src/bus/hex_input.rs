//! What a technician types or pastes: hex in any dress, ASCII frames, lines of a log.

use super::{ascii, frame};
use crate::{
    plant::{line::Framing, number::to_u8},
    t,
};

/// Bytes that were typed or pasted, with the framing and direction that their text names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParsedInput {
    /// The bytes as they travel.
    pub bytes: Vec<u8>,
    /// [`Framing::Ascii`] if it began with `:`.
    pub framing: Option<Framing>,
    /// `true` behind `TX` or in `[01]`, `false` behind `RX` or in `<01>`.
    pub sent: Option<bool>,
}

/// Why a text holds no bytes. Positions count characters from 1.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HexInputError {
    /// There is nothing.
    #[error("{}", t!("found nothing, expected bytes in hex such as 01 03 00 00 00 01, or an ASCII frame such as :010300000001FB"))]
    Empty,
    /// A character that means nothing here.
    #[error("{}", t!("position {position}: `{found}` is not a hex digit, expected 0–9 or A–F", position = .position, found = .found))]
    NotHex {
        /// Where.
        position: usize,
        /// What stands there.
        found: char,
    },
    /// Half a byte.
    #[error("{}", t!("position {position}: `{found}` has an odd number of hex digits, expected two per byte", position = .position, found = .found))]
    OddDigits {
        /// Where the digits begin.
        position: usize,
        /// The digits.
        found: String,
    },
    /// No frame is that long.
    #[error("{}", t!("too long: {got} {what}, expected {longest} at most", got = .got, what = .what, longest = .longest))]
    TooLong {
        /// How long it is.
        got: usize,
        /// `bytes` or `characters`.
        what: &'static str,
        /// The limit of its framing.
        longest: usize,
    },
}

/// Reads hex with or without spaces, commas, dashes, brackets or `0x`; an ASCII frame; or a line of a log, where bytes
/// stand between `TX` or `RX` and `|`. Framing is only needed for the longest length; without it 260 bytes are taken.
pub fn parse(text: &str, framing: Option<Framing>) -> Result<ParsedInput, HexInputError> {
    let (sent, skipped, rest) = of_log(text);
    let indent = rest.chars().take_while(|letter| letter.is_whitespace()).count();
    let body = rest.trim();
    let skipped = skipped + indent;
    if body.is_empty() {
        return Err(HexInputError::Empty);
    }
    if let Some(digits) = body.strip_prefix(':') {
        let bytes = ascii_frame(digits, skipped)?;
        return Ok(ParsedInput { bytes, framing: Some(Framing::Ascii), sent });
    }
    let sent = sent.or(if body.starts_with('[') {
        Some(true)
    } else if body.starts_with('<') {
        Some(false)
    } else {
        None
    });
    let bytes = hex(body, skipped)?;
    let longest = match framing {
        Some(Framing::Rtu) => 256,
        Some(Framing::Ascii) => frame::MESSAGE_MAX + 1,
        Some(Framing::Mbap) | None => 260,
    };
    match bytes.len() {
        0 => Err(HexInputError::Empty),
        got if longest < got => Err(HexInputError::TooLong { got, what: t!("bytes"), longest }),
        _ => Ok(ParsedInput { bytes, framing: None, sent }),
    }
}

/// What stands behind `TX` or `RX` and before `|`: direction, characters skipped, the bytes.
fn of_log(text: &str) -> (Option<bool>, usize, &str) {
    let mut sent = None;
    let mut from = 0;
    for (mark, direction) in [("TX", true), ("RX", false), ("Tx", true), ("Rx", false), ("tx", true), ("rx", false)] {
        let found = text.find(mark).filter(|at| {
            let letter = |next: Option<char>| next.is_some_and(char::is_alphanumeric);
            !letter(text[..*at].chars().next_back()) && !letter(text[at + 2..].chars().next())
        });
        if let Some(at) = found {
            sent = Some(direction);
            let behind = &text[at + 2..];
            // `TX: 01` has a colon that begins no ASCII frame, `TX :01…` has one that does.
            let colon = usize::from(behind.starts_with(':'));
            from = at + 2 + colon;
            break;
        }
    }
    let rest = text[from..].split('|').next().unwrap_or_default();
    (sent, text[..from].chars().count(), rest)
}

/// `:0103…` with its LRC; CR LF is added, typed as `\r\n` or not at all.
fn ascii_frame(digits: &str, skipped: usize) -> Result<Vec<u8>, HexInputError> {
    let digits = digits.trim_end_matches("\\n").trim_end_matches("\\r");
    let mut bytes = b":".to_vec();
    for (at, letter) in digits.chars().enumerate().filter(|(_, letter)| !letter.is_whitespace()) {
        if !letter.is_ascii_hexdigit() {
            return Err(HexInputError::NotHex { position: skipped + at + 2, found: letter });
        }
        bytes.push(letter as u8);
    }
    if bytes.len().is_multiple_of(2) {
        return Err(HexInputError::OddDigits { position: skipped + 2, found: digits.trim().to_owned() });
    }
    bytes.extend(b"\r\n");
    match bytes.len() {
        3 => Err(HexInputError::Empty),
        got if ascii::FRAME_MAX < got => {
            Err(HexInputError::TooLong { got, what: t!("characters"), longest: ascii::FRAME_MAX })
        }
        _ => Ok(bytes),
    }
}

fn hex(body: &str, skipped: usize) -> Result<Vec<u8>, HexInputError> {
    let between = |letter: char| letter.is_whitespace() || ",;:-.[]<>(){}\"'".contains(letter);
    let letters: Vec<char> = body.chars().collect();
    let mut bytes = Vec::new();
    let mut at = 0;
    while at < letters.len() {
        if between(letters[at]) {
            at += 1;
            continue;
        }
        let end = (at..letters.len()).find(|end| between(letters[*end])).unwrap_or(letters.len());
        // A prefix may also stand inside: `0x010x03`.
        let mut from = at;
        while from < end {
            let prefixed = matches!(letters[from..end], ['0', 'x' | 'X', ..] | ['\\', 'x' | 'X', ..]);
            from += if prefixed { 2 } else { 0 };
            let until = (from + 1..end)
                .find(|next| matches!(letters[*next..end], ['0', 'x' | 'X', ..] | ['\\', ..]))
                .unwrap_or(end);
            run(&letters[from..until], skipped + from + 1, prefixed, &mut bytes)?;
            from = until;
        }
        at = end;
    }
    Ok(bytes)
}

/// Digits without anything between them; `0x1` is a byte, `1` is half of one.
fn run(digits: &[char], position: usize, prefixed: bool, bytes: &mut Vec<u8>) -> Result<(), HexInputError> {
    let found = || digits.iter().collect::<String>();
    let mut values = Vec::new();
    for (at, letter) in digits.iter().enumerate() {
        let value = letter.to_digit(16).ok_or(HexInputError::NotHex { position: position + at, found: *letter })?;
        values.push(to_u8(value));
    }
    match (values.as_slice(), prefixed) {
        ([value], true) => bytes.push(*value),
        (values, _) if values.is_empty() || values.len() % 2 == 1 => {
            return Err(HexInputError::OddDigits { position, found: found() });
        }
        (values, _) => bytes.extend(values.chunks(2).map(|pair| pair[0] << 4 | pair[1])),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ: [u8; 8] = [0x01, 0x03, 0x00, 0x00, 0x00, 0x01, 0x84, 0x0A];

    fn check(text: &str, expect: &[u8], sent: Option<bool>) {
        let typed = parse(text, None);
        assert_eq!(typed, Ok(ParsedInput { bytes: expect.to_vec(), framing: None, sent }), "{text}");
    }

    #[test]
    fn hex_is_read_in_any_dress() {
        for text in [
            "01 03 00 00 00 01 84 0A",
            "010300000001840a",
            "0103 0000 0001 840A",
            "01,03,00,00,00,01,84,0A",
            "01-03-00-00-00-01-84-0a",
            "01:03:00:00:00:01:84:0a",
            "0x01 0x03 0x00 0x00 0x00 0x01 0x84 0x0A",
            "0x01,0x3,0x0,0x0,0x0,0x1,0x84,0xA",
            "0x010x030x000x000x000x010x840x0A",
            "\\x01\\x03\\x00\\x00\\x00\\x01\\x84\\x0a",
            "  01 03 00 00\n00 01 84 0A \r\n",
        ] {
            check(text, &READ, None);
        }
    }

    #[test]
    fn lines_of_logs_tell_the_direction_too() {
        check("TX 01 03 00 00 00 01 84 0A", &READ, Some(true));
        check("2026-11-21 13:28:01.250 Tx: 01 03 00 00 00 01 84 0A", &READ, Some(true));
        check("12:00:01 RX 01 03 00 00 00 01 84 0A | unit 1 read | ok", &READ, Some(false));
        check("[01][03][00][00][00][01][84][0A]", &READ, Some(true));
        check("<01><03><00><00><00><01><84><0A>", &READ, Some(false));
        let typed = parse("RX :010300000001FB\\r\\n", None);
        let expect =
            ParsedInput { bytes: b":010300000001FB\r\n".to_vec(), framing: Some(Framing::Ascii), sent: Some(false) };
        assert_eq!(typed, Ok(expect.clone()));
        assert_eq!(parse(":01 03 00 00 00 01 FB", None), Ok(ParsedInput { sent: None, ..expect }));
    }

    #[test]
    fn what_cannot_be_read_says_where_and_what_was_expected() {
        let says = |text: &str, words: &str| {
            let error = parse(text, None).map_err(|error| error.to_string());
            assert!(error.as_ref().is_err_and(|error| error.starts_with(words)), "{text}: {error:?}");
        };
        says("", "found nothing, expected bytes in hex");
        says(" \n", "found nothing");
        says(":", "found nothing");
        says("- ,", "found nothing");
        says("01 03 0G", "position 8: `G` is not a hex digit, expected 0–9 or A–F");
        says("TX 01 0Z", "position 8: `Z` is not a hex digit");
        says("01 03 000", "position 7: `000` has an odd number of hex digits, expected two per byte");
        says("0x", "position 3: `` has an odd number");
        says(":01G3", "position 4: `G` is not a hex digit");
        says(":010", "position 2: `010` has an odd number of hex digits");
        says("hello", "position 1: `h` is not a hex digit");
        says(&"00".repeat(261), "too long: 261 bytes, expected 260 at most");
        says(&format!(":{}", "00".repeat(256)), "too long: 515 characters, expected 513 at most");
        assert!(parse(&"00".repeat(257), Some(Framing::Rtu)).is_err());
        assert!(parse(&"00".repeat(256), Some(Framing::Rtu)).is_ok());
    }
}
