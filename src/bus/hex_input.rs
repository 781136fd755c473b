//! What a technician types or pastes: hex in any dress, ASCII frames, lines of a log.

mod paste;

use super::{
    ascii,
    frame::{self, Mbap},
    request_lint::check_request,
};
use crate::{
    plant::{fault::Fault, line::Framing, number::to_u8},
    t,
};

pub use paste::{Pasted, parse_paste};

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

/// A request as it goes over a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FramedRequest {
    /// Unit and PDU.
    pub message: Vec<u8>,
    /// With its check or header; what was typed, if it had that already.
    pub frame: Vec<u8>,
}

impl ParsedInput {
    /// The request that was typed, framed for a line. `Err`: it is an ASCII frame, and broken.
    pub fn framed(&self, framing: Framing, transaction: u16) -> Result<FramedRequest, Fault> {
        let message = match (self.framing, framing) {
            // The characters of an ASCII frame mean its message, on any line.
            (Some(Framing::Ascii), _) => Some(ascii::open(&self.bytes)?),
            (_, Framing::Rtu) => {
                frame::without_crc(&self.bytes).ok().filter(|message| 2 <= message.len()).map(Vec::from)
            }
            (_, Framing::Ascii) => ascii::open(&self.bytes).ok(),
            (_, Framing::Mbap) => behind_header(&self.bytes),
        };
        let is_frame = message.is_some() && self.framing.is_none_or(|typed| typed == framing);
        let message = message.unwrap_or_else(|| self.bytes.clone());
        let frame = if is_frame { self.bytes.clone() } else { frame::wrap(framing, transaction, &message) };
        Ok(FramedRequest { message, frame })
    }
}

/// The first message of bytes that are Modbus TCP frames from end to end. A request of its own may look like that: a header
/// is read where all behind it are requests as they should be, or where the bytes without it are none.
fn behind_header(bytes: &[u8]) -> Option<Vec<u8>> {
    let sound = |message: &[u8]| check_request(message, Framing::Mbap).is_empty();
    let (mut messages, mut rest) = (Vec::new(), bytes);
    while let Mbap::Whole { end, .. } = frame::mbap(rest) {
        messages.push(&rest[6..end]);
        rest = &rest[end..];
    }
    let is_header = rest.is_empty() && (messages.iter().all(|message| sound(message)) || !sound(bytes));
    messages.first().filter(|_| is_header).map(|message| message.to_vec())
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
    parse_up_to(
        text,
        match framing {
            Some(Framing::Rtu) => 256,
            Some(Framing::Ascii) => frame::MESSAGE_MAX + 1,
            Some(Framing::Mbap) | None => 260,
        },
    )
}

/// The same, with at most `longest` bytes in hex.
fn parse_up_to(text: &str, longest: usize) -> Result<ParsedInput, HexInputError> {
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
    let bytes = digits_of(body, skipped)?;
    match bytes.len() {
        0 => Err(HexInputError::Empty),
        got if longest < got => Err(HexInputError::TooLong { got, what: t!("bytes"), longest }),
        _ => Ok(ParsedInput { bytes, framing: None, sent }),
    }
}

/// Does a line of text say who sent its bytes?
pub fn is_of_log(text: &str) -> bool {
    of_log(text).0.is_some()
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

/// Bytes in hex, whatever stands between them.
fn digits_of(body: &str, skipped: usize) -> Result<Vec<u8>, HexInputError> {
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
#[allow(clippy::unwrap_used)]
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
    fn a_request_gets_what_its_line_adds_unless_it_has_it() {
        let check = |text: &str, framing: Framing, message: &str, frame: &str| {
            let bytes = |text: &str| parse(text, None).map(|typed| typed.bytes);
            let framed = parse(text, None).map(|typed| typed.framed(framing, 1));
            let expect = FramedRequest { message: bytes(message).unwrap(), frame: bytes(frame).unwrap() };
            assert_eq!(framed, Ok(Ok(expect)), "{text} on {framing:?}");
        };
        let (bare, rtu, ascii) = ("01 03 00 00 00 01", "01 03 00 00 00 01 84 0A", ":010300000001FB");
        let tcp = "00 01 00 00 00 06 01 03 00 00 00 01";
        for (framing, whole) in [(Framing::Rtu, rtu), (Framing::Ascii, ascii), (Framing::Mbap, tcp)] {
            check(bare, framing, bare, whole);
            check(whole, framing, bare, whole);
            check(ascii, framing, bare, whole);
        }
        assert!(parse(":010300000001FA", None).unwrap().framed(Framing::Rtu, 1).is_err());
        // Requests that look like the header of Modbus TCP: function, address 0 and count stand where it has its length.
        for request in [
            "01 10 00 00 00 02 04 00 01 00 02",
            "01 17 00 00 00 02 00 0A 00 01 02 00 05",
            "01 0F 00 00 00 02 01 03",
            "01 03 00 00 00 02",
            "01 10 00 00 00 07 0E 07 D0 00 00 00 02 01 07 00 00 00 00 00 00",
            // Sound as it stands, while what its header would hold is none.
            "01 08 00 00 00 02 01 99",
        ] {
            let framed = format!("00 01 00 00 00 {:02X} {request}", request.split(' ').count());
            check(request, Framing::Mbap, request, &framed);
        }
        // A transaction that looks like a function: what stands behind the header is a request.
        for id in ["00 08", "01 10", "01 2B"] {
            let whole = format!("{id} 00 00 00 06 01 03 00 00 00 01");
            check(&whole, Framing::Mbap, bare, &whole);
        }
        // Wrong either way: the header is believed.
        check(
            "00 01 00 00 00 06 01 03 00 00 00 00",
            Framing::Mbap,
            "01 03 00 00 00 00",
            "00 01 00 00 00 06 01 03 00 00 00 00",
        );
    }

    #[test]
    fn bytes_are_found_in_pasted_text() {
        let pasted = |text: &str| parse_paste(text).unwrap();
        let frames = b":010300000001FB\r\n:0103020007F3\r\n".to_vec();
        for text in [
            ":010300000001FB:0103020007F3",
            ":010300000001FB\r\n:0103020007F3\r\n",
            ":010300000001FB\\r\\n:0103020007F3\\r\\n",
            ":010300000001FB\n:0103020007F3\n",
        ] {
            let input = ParsedInput { bytes: frames.clone(), framing: Some(Framing::Ascii), sent: None };
            assert_eq!(pasted(text), Pasted { input, doubt: None }, "{text:?}");
        }
        assert_eq!(pasted("RX: xx:0103020007F3 yy").input.bytes, b" xx:0103020007F3\r\n yy");
        assert_eq!(pasted("RX: xx:0103020007F3 yy").input.sent, Some(false));
        // Colons between bytes begin no frame.
        let doubt = parse("01:03:00:00:00:01:84:0a", None).unwrap();
        assert_eq!(pasted("01:03:00:00:00:01:84:0a"), Pasted { input: doubt, doubt: None });
        let log = pasted("10:00:01.123 got 01 03 00 00 00 01 84 0A, 8 bytes");
        assert_eq!(log.input.bytes, READ, "{log:?}");
        assert!(log.doubt.is_some());
        assert_eq!(pasted(&"00".repeat(1_000)).input.bytes.len(), 1_000);
        assert!(parse_paste("hello").is_err() && parse_paste("01 0").is_err() && parse_paste(":010").is_err());
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
