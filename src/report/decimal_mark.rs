//! Numbers of a file that others have written: a file has one decimal mark, and none between thousands.

use std::fmt;

use crate::plant::exact::Exact;

/// The decimal mark of a file: that of its first number that has one. Where cells stand between commas it is a point: `1,234`
/// could be either.
#[derive(Debug, Clone, Copy)]
pub struct DecimalMark {
    /// The mark, and the line on which it was found.
    known: Option<(char, u64)>,
}

/// Why a text is no number of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NumberError {
    /// It has the mark of another country than a number on an earlier line.
    OtherMark {
        /// The mark of the file.
        mark: char,
        /// Where it was found; 0: it is that of the separator.
        line: u64,
    },
    /// It has marks between thousands.
    Thousands,
    /// It is none.
    NotANumber,
}

impl DecimalMark {
    /// Of a file with this mark between its cells, of which no number was read yet.
    pub fn of(separator: u8) -> DecimalMark {
        DecimalMark { known: (separator == b',').then_some(('.', 0)) }
    }

    /// The number that a cell on this line holds.
    pub fn read(&mut self, found: &str, line: u64) -> Result<Exact, NumberError> {
        let mut marks = found.chars().filter(|letter| matches!(letter, '.' | ','));
        let mark = match (marks.next(), marks.next()) {
            (mark, None) => mark,
            (_, Some(_)) => return Err(NumberError::Thousands),
        };
        if let Some((known, line)) = self.known.filter(|(known, _)| mark.is_some_and(|mark| mark != *known)) {
            return Err(NumberError::OtherMark { mark: known, line });
        }
        let number = found.replace(',', ".").parse::<Exact>().ok().filter(|number| number.is_finite());
        let number =
            number.ok_or_else(|| if is_grouped(found) { NumberError::Thousands } else { NumberError::NotANumber })?;
        self.known = self.known.or(mark.map(|mark| (mark, line)));
        Ok(number)
    }
}

/// Are there blanks or apostrophes between the digits?
fn is_grouped(found: &str) -> bool {
    let is_digit = |letter: char| letter.is_ascii_digit() || matches!(letter, '.' | ',' | '-' | '+');
    let is_group = |letter: char| letter.is_whitespace() || matches!(letter, '\'' | '\u{2019}' | '_');
    let is_either = |letter: char| is_digit(letter) || is_group(letter);
    found.trim_matches(is_digit).contains(is_group) && found.chars().all(is_either)
}

/// What was expected.
impl fmt::Display for NumberError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NumberError::OtherMark { mark, line } => {
                let mark = if *mark == ',' { "comma" } else { "point" };
                match line {
                    0 => write!(f, "a decimal {mark}, as cells stand between commas"),
                    line => write!(f, "a decimal {mark}, as on line {line}"),
                }
            }
            NumberError::Thousands => f.write_str("a number without marks between thousands"),
            NumberError::NotANumber => f.write_str("a number"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_one_decimal_mark_and_none_between_thousands() {
        use NumberError::{NotANumber, OtherMark, Thousands};
        let comma = OtherMark { mark: ',', line: 1 };
        let point = |line| OtherMark { mark: '.', line };
        let check = |separator, cells: &[(&str, Result<f64, NumberError>)]| {
            let mut mark = DecimalMark::of(separator);
            for (line, (cell, expect)) in (1..).zip(cells) {
                assert_eq!(mark.read(cell, line).map(Exact::near), *expect, "{cell} on line {line} of {cells:?}");
            }
        };
        check(b';', &[("1,5", Ok(1.5)), ("1.234", Err(comma)), ("-7", Ok(-7.0)), ("0,25", Ok(0.25))]);
        check(b';', &[("7", Ok(7.0)), ("1.234", Ok(1.234)), ("1,5", Err(point(2))), ("1.5e3", Ok(1_500.0))]);
        check(b'\t', &[("1.234,5", Err(Thousands)), ("1,234,567", Err(Thousands)), ("1,5", Ok(1.5))]);
        check(b',', &[("1,5", Err(point(0))), ("1.5", Ok(1.5)), ("1,234.5", Err(Thousands))]);
        for grouped in ["1 234", "1\u{a0}234,5", "1\u{202f}234", "1'234", "1\u{2019}234.5", "1_000"] {
            check(b';', &[(grouped, Err(Thousands))]);
        }
        for other in ["", "high", "NaN", "inf", "1.5 °C", "0x10", "."] {
            check(b';', &[(other, Err(NotANumber)), ("1,5", Ok(1.5))]);
        }
    }
}
