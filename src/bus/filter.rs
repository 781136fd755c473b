//! Picks frames out of traffic by a line of words: `unit 1 fc 3 rx error 03EA`.

use super::{dissect, frame, hex_input};
use crate::{plant::traffic::Frame, t};

/// All of these must hold; an empty filter lets everything through.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Filter {
    unit: Option<u8>,
    function: Option<u8>,
    sent: Option<bool>,
    errors: bool,
    bytes: Vec<u8>,
}

/// A word that is no condition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FilterError {
    /// None of the words.
    #[error("{}", t!("found `{found}`, expected unit N, fc N, tx, rx, error, or bytes in hex such as 03EA", found = .0))]
    Word(String),
    /// `unit` or `fc` twice: no frame has two of them.
    #[error("{}", t!("{word} is given twice, and no frame has two", word = .0))]
    Twice(&'static str),
    /// `unit` or `fc` without its number.
    #[error("{}", t!("found `{found}` after {word}, expected a number from 0 to 255, or 0x00 to 0xFF", found = .found, word = .word))]
    Number {
        /// `unit` or `fc`.
        word: &'static str,
        /// What stands there.
        found: String,
    },
}

impl Filter {
    /// Reads `unit N`, `fc N` (decimal or `0x…`), `tx`, `rx`, `error`, and bytes in hex, in any order.
    pub fn parse(text: &str) -> Result<Filter, FilterError> {
        let mut filter = Filter::default();
        let mut words = text.split_whitespace();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                "unit" => once(&mut filter.unit, "unit", words.next())?,
                "fc" | "function" => once(&mut filter.function, "fc", words.next())?,
                "tx" => filter.sent = Some(true),
                "rx" => filter.sent = Some(false),
                "error" | "errors" => filter.errors = true,
                "hex" => {}
                _ => match hex_input::parse(word, None) {
                    Ok(typed) if !word.starts_with(':') => filter.bytes.extend(typed.bytes),
                    Ok(_) | Err(_) => return Err(FilterError::Word(word.to_owned())),
                },
            }
        }
        Ok(filter)
    }

    /// Does this frame pass? Bytes are looked for in the message of a frame and in the frame as it travels.
    pub fn matches(&self, frame: &Frame) -> bool {
        let message = dissect::message_of(&frame.bytes, frame.framing).unwrap_or_default();
        let function = message.get(1).map(|code| code & 0x7F);
        self.unit.is_none_or(|unit| frame.unit.or(message.first().copied()) == Some(unit))
            && self.function.is_none_or(|wanted| function == Some(wanted))
            && self.sent.is_none_or(|sent| frame.sent == sent)
            && (!self.errors || is_error(frame, &message))
            && (contains(&message, &self.bytes) || contains(&frame.bytes, &self.bytes))
    }
}

fn once(place: &mut Option<u8>, word: &'static str, found: Option<&str>) -> Result<(), FilterError> {
    match place.replace(number(word, found)?) {
        None => Ok(()),
        Some(_) => Err(FilterError::Twice(word)),
    }
}

/// Corrupt, late or dropped; or a refusal.
fn is_error(frame: &Frame, message: &[u8]) -> bool {
    let refused = !frame.sent && message.get(1).is_some_and(|code| 0x80 <= *code);
    refused || frame.result.is_wrong()
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    part.is_empty() || bytes.windows(part.len()).any(|window| window == part)
}

fn number(word: &'static str, text: Option<&str>) -> Result<u8, FilterError> {
    let found = text.unwrap_or(t!("nothing"));
    let digits = found.strip_prefix("0x").or_else(|| found.strip_prefix("0X"));
    let value = digits.map_or_else(|| found.parse(), |digits| u8::from_str_radix(digits, 16));
    value.map_err(|_| FilterError::Number { word, found: found.to_owned() })
}

/// The filter as it would be typed.
impl std::fmt::Display for Filter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = [
            self.unit.map(|unit| format!("unit {unit}")),
            self.function.map(|code| format!("fc {code}")),
            self.sent.map(|sent| if sent { "tx" } else { "rx" }.to_owned()),
            self.errors.then(|| "error".to_owned()),
            (!self.bytes.is_empty()).then(|| frame::hex(&self.bytes)),
        ];
        write!(f, "{}", words.into_iter().flatten().collect::<Vec<_>>().join(" "))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::{
        bus::ascii,
        plant::{
            fault::Fault,
            line::Framing,
            traffic::{FrameFault, FrameResult},
        },
    };

    fn frames() -> Vec<Frame> {
        let frame = |number: u64, sent: bool, framing: Framing, bytes: Vec<u8>, result: FrameResult| Frame {
            at: Timestamp::UNIX_EPOCH,
            sent,
            bytes: bytes.into(),
            framing,
            result,
            unit: None,
            number,
        };
        let mut corrupt = frame::with_crc(&[1, 3, 2, 0, 5]);
        corrupt[4] = 9;
        vec![
            frame(0, true, Framing::Rtu, frame::with_crc(&[1, 3, 3, 0xEA, 0, 1]), FrameResult::Sent),
            frame(1, false, Framing::Rtu, frame::with_crc(&[1, 0x83, 2]), FrameResult::Good),
            frame(2, true, Framing::Mbap, frame::with_mbap(9, &[2, 16, 3, 0xEA, 0, 1, 2, 0, 0]), FrameResult::Sent),
            frame(3, false, Framing::Ascii, ascii::encode(&[1, 3, 2, 3, 0xEA]), FrameResult::Good),
            frame(
                4,
                false,
                Framing::Rtu,
                corrupt,
                FrameResult::Wrong(FrameFault::NoResponse(Fault::Crc { got: 0x7BB8, computed: 0x7EB8 })),
            ),
            frame(5, false, Framing::Rtu, vec![0xFF], FrameResult::Wrong(FrameFault::NoFrame)),
        ]
    }

    fn check(filter: &str, expect: &[u64]) {
        let parsed = Filter::parse(filter).unwrap();
        let numbers: Vec<u64> =
            frames().iter().filter(|frame| parsed.matches(frame)).map(|frame| frame.number).collect();
        assert_eq!(numbers, expect, "{filter}");
        assert_eq!(Filter::parse(&parsed.to_string()), Ok(parsed), "{filter}");
    }

    #[test]
    fn frames_are_picked_by_unit_function_direction_error_and_bytes() {
        check("", &[0, 1, 2, 3, 4, 5]);
        check("unit 1", &[0, 1, 3, 4]);
        check("unit 0x02", &[2]);
        check("fc 3", &[0, 1, 3, 4]);
        check("FC 0x10", &[2]);
        check("tx", &[0, 2]);
        check("rx unit 1", &[1, 3, 4]);
        check("error", &[1, 4, 5]);
        check("unit 1 fc 3 error", &[1, 4]);
        check("03EA", &[0, 2, 3]);
        check("hex 03 EA tx", &[0, 2]);
        check("ff", &[5]);
    }

    #[test]
    fn a_word_that_is_no_condition_says_what_is_expected() {
        let says = |filter: &str, words: &str| {
            let error = Filter::parse(filter).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        };
        says("unti 1", "found `unti`, expected unit N, fc N, tx, rx, error, or bytes in hex");
        says("unit", "found `nothing` after unit, expected a number from 0 to 255");
        says("fc 0x100", "found `0x100` after fc, expected");
        says("3EA", "found `3EA`, expected");
    }
}
