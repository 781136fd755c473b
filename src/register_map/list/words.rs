//! The words of a cell: types with their byte order, tables, factors.

mod labels;
mod types;

pub use self::{
    labels::{labels_of, labels_text, written_labels_of},
    types::{is_sized_type, kind_of, type_of},
};
use super::codes;
use crate::{
    plant::{
        address::TABLES,
        exact::Exact,
        number::to_f32,
        raw_number::BadSpan,
        tag::{Access, ByteOrder, DataType, Point, Poll, Table},
    },
    profile::{duration_of, is_known_unit, unit_of},
    t,
};

/// `0.1`, `0,1`, `x0.1`, `/10`, `÷10`, `1/10`, `10^-1`; `None` for `1,000`, which is one or a thousand.
pub fn number_of(text: &str) -> Option<f64> {
    let is_of_thousands = text.split_once(',').is_some_and(|(first, rest)| {
        let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        let first = first.trim().trim_start_matches(['-', '+']);
        rest.trim().len() == 3 && is_digits(rest.trim()) && is_digits(first) && !first.starts_with('0')
    });
    if is_of_thousands {
        return None;
    }
    let text = text.trim().replace(',', ".");
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    if let Some(exponent) = text.strip_prefix("10^") {
        return number(exponent).map(power_of_ten).filter(|factor| factor.is_finite());
    }
    if let Some((one, by)) = text.split_once(['/', '÷', ':']) {
        let one = if one.trim().is_empty() { 1.0 } else { number(one)? };
        return number(by).filter(|by| *by != 0.0).map(|by| one / by);
    }
    number(text.trim_start_matches(['x', 'X', '*', '×']))
}

/// `-40`, `−40`, `-40 °C`: what is added to a value, in its unit.
pub fn offset_of(text: &str) -> Option<f64> {
    let text = text.replace(['−', '–'], "-");
    let is_of_number = |sign: char| sign.is_ascii_digit() || matches!(sign, '-' | '+' | '.' | ',' | ' ');
    let end = text.find(|sign| !is_of_number(sign)).unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let has_unit = !unit.is_empty() && is_known_unit(unit.trim());
    number_of(&text).or_else(|| number_of(&number.replace("- ", "-")).filter(|_| unit.is_empty() || has_unit))
}

/// Does a factor say itself whether it multiplies or divides?
pub fn is_marked(text: &str) -> bool {
    text.contains(['x', 'X', '*', '×', '/', '÷', ':', '^'])
}

/// As a person would write it: 0.001, not the nearest to it.
pub fn power_of_ten(exponent: f64) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The table that a word, an area such as `4x` or a function code means; `None` too where it has codes of several.
pub fn table_of(text: &str) -> Option<Table> {
    let text = text.to_lowercase().replace('_', " ");
    let is = |words: &[&str]| words.iter().any(|word| text.contains(word));
    let is_output = is(&["discrete output"]);
    let words = [
        (Table::Coil, is(&["coil"]) || is_output),
        (Table::Discrete, is(&["discrete", "input status"]) && !is_output),
        (Table::Holding, is(&["holding"])),
        (Table::Input, is(&["input reg", "inputreg"]) || text == "input" || text == "inputs"),
    ];
    let named: Vec<Table> = words.into_iter().filter(|(_, is)| *is).map(|(table, _)| table).collect();
    match named.as_slice() {
        [] => area_of(&text).or_else(|| codes::table_of(&text)),
        [table] => Some(*table),
        _ => None,
    }
}

/// `4x`, `4xxxx`, `3X0001`: the digit that the Modicon numbers of a table begin with.
pub fn area_of(text: &str) -> Option<Table> {
    let text = text.trim();
    let (digit, rest) = text.split_at_checked(1)?;
    let number = rest.strip_prefix('x')?;
    let is_shown = number.bytes().all(|byte| byte == b'x')
        || 4 <= number.len() && number.bytes().all(|byte| byte.is_ascii_digit());
    area(digit).filter(|_| is_shown)
}

/// The table of an area digit.
pub fn area(digit: &str) -> Option<Table> {
    TABLES.into_iter().find(|table| table.digit().to_string() == digit.trim())
}

/// The order of four letters, or in words that mean one order; "little endian" can be two.
pub fn order_of(text: &str) -> Option<ByteOrder> {
    let word: String = text.to_lowercase().chars().filter(|sign| sign.is_alphanumeric()).collect();
    match word.as_str() {
        "bigendian" | "highwordfirst" | "mswfirst" => Some(ByteOrder::Abcd),
        "lowwordfirst" | "lswfirst" | "wordswap" | "wordswapped" | "swappedwords" => Some(ByteOrder::Cdab),
        _ => ByteOrder::ALL.into_iter().find(|order| order.word().eq_ignore_ascii_case(text)),
    }
}

/// `2`, `2 registers`, `4 bytes`, `32 bit`: how many registers; a plain number counts bytes where its column does.
pub fn length_of(cell: &str, is_bytes: bool) -> Option<u16> {
    let cell = cell.trim().to_lowercase();
    let digits = cell.len() - cell.trim_start_matches(|sign: char| sign.is_ascii_digit()).len();
    let (number, word) = cell.split_at(digits);
    let number: u16 = number.parse().ok()?;
    let of_bytes = || if number == 1 { Some(1) } else { Some(number / 2).filter(|_| number.is_multiple_of(2)) };
    match word.trim() {
        "" if is_bytes => of_bytes(),
        "" | "register" | "registers" | "reg" | "regs" | "word" | "words" | "wort" | "wörter" => Some(number),
        "byte" | "bytes" => of_bytes(),
        "bit" | "bits" => width_of(&cell).map(|bits| bits.div_ceil(16)),
        _ => None,
    }
}

/// `16`, `32 bit`: how many bits a number has.
pub fn width_of(cell: &str) -> Option<u16> {
    let cell = cell.trim().to_lowercase();
    let number = cell.trim_end_matches("bits").trim_end_matches("bit").trim_end().trim_end_matches('-');
    number.parse().ok().filter(|bits| [8, 16, 24, 32, 48, 64].contains(bits))
}

/// What a mark of a column such as `signed` says.
pub fn yes_or_no(cell: &str) -> Option<bool> {
    match cell.trim().to_lowercase().as_str() {
        "yes" | "y" | "true" | "x" | "1" | "✓" | "✔" | "ja" | "j" | "signed" | "s" | "+/-" | "±" => Some(true),
        "no" | "n" | "false" | "0" | "nein" | "unsigned" | "u" | "+" => Some(false),
        _ => None,
    }
}

/// Whether a register is read, written or both, as manuals say it.
pub fn access_of(cell: &str) -> Option<Access> {
    let word: String = cell.to_lowercase().chars().filter(|c| c.is_alphabetic()).collect();
    match word.as_str() {
        "r" | "ro" | "rd" | "read" | "readonly" | "lesen" | "nurlesen" | "lecture" | "lectura" | "lettura" | "只读" => {
            Some(Access::Read)
        }
        "rw" | "wr" | "rdwr" | "readwrite" | "writeread" | "lesenschreiben" | "lectureécriture"
        | "lecturaescritura" | "letturascrittura" | "读写" | "可读写" => Some(Access::ReadWrite),
        "w" | "wo" | "write" | "writeonly" | "schreiben" | "écriture" | "escritura" | "scrittura" | "只写" => {
            Some(Access::Write)
        }
        _ => None,
    }
}

/// A unit, and the factor in front of it: `0.1 kW`, `1/10 V`. `Err` where what else stands in it may be one, or may not.
pub fn unit_with_factor(cell: &str) -> Result<(f64, String), String> {
    let unclear = || Err(t!("`{cell}`: does its unit have a factor?", cell));
    if let Some(number) = number_of(cell) {
        return if number == 1.0 { Ok((1.0, unit_of(cell))) } else { unclear() };
    }
    if is_known_unit(cell) {
        return Ok((1.0, unit_of(cell)));
    }
    let splits = cell.char_indices().skip(1).map(|(at, _)| cell.split_at(at));
    let parts =
        splits.filter_map(|(number, unit)| Some((number_of(number)?, unit)).filter(|(_, unit)| is_known_unit(unit)));
    if let Some((factor, unit)) = parts.last() {
        // 50 Hz is a frequency.
        let is_factor = factor != 0.0 && (factor.abs() < 1.0 || factor.log10().fract() == 0.0);
        return if is_factor { Ok((factor, unit_of(unit))) } else { unclear() };
    }
    let last = cell.rsplit(['*', '×', 'x', 'X', '/', '·', ' ', '(']).next().unwrap_or_default();
    let begins = cell.trim_start_matches(['x', 'X', '*', '×', '/', '÷', '+']).trim_start();
    let rest = begins.trim_start_matches(|sign: char| sign.is_ascii_digit());
    // A range and names of numbers are neither.
    let is_number = rest.len() < begins.len()
        && !rest.trim_start().starts_with(['-', '–', '…', '=', ':'])
        && !rest.starts_with("..");
    if is_number || number_of(last.trim_end_matches(')')).is_some() { unclear() } else { Ok((1.0, unit_of(cell))) }
}

/// `5-4` or `3`: the lowest bit and how many.
pub fn field_of(cell: &str) -> Option<(u8, u8)> {
    let (high, low) = cell.split_once('-').unwrap_or((cell, cell));
    let (high, low): (u8, u8) = (high.trim().parse().ok()?, low.trim().parse().ok()?);
    (low <= high && high < 64).then(|| (low, high - low + 1))
}

/// The same as manuals write it: `bit 3`, `0..3`, `7:4`.
pub fn bit_field_of(cell: &str) -> Option<(u8, u8)> {
    let cell = cell.to_lowercase();
    let digits = cell
        .trim_start_matches("bits")
        .trim_start_matches("bit")
        .trim_start_matches('b')
        .trim_start_matches(['.', ' ', '#']);
    let plain = ["..", "…", "–", ":", "~"].into_iter().fold(digits.to_owned(), |text, sign| text.replace(sign, "-"));
    let turned = || plain.split_once('-').map(|(low, high)| format!("{high}-{low}"));
    field_of(&plain).or_else(|| field_of(&turned()?))
}

/// A number that means "no value", as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BadNumber {
    /// A whole number, or the pattern of its bits.
    Whole(i128, bool),
    /// Any other.
    Float(f64),
}

impl BadNumber {
    /// What it is as a raw number of a point; `None` where it can never occur.
    fn of(self, point: Point) -> Option<Exact> {
        match self {
            BadNumber::Whole(number, is_pattern) => point.raw_number(number, is_pattern).number(),
            BadNumber::Float(number) if point.kind == DataType::F32 => Some(f64::from(to_f32(number)).into()),
            BadNumber::Float(number) => Some(Exact::plain(number)),
        }
    }
}

/// The raw numbers of a point from one such number to another; `None` where they can never occur.
pub fn bad_span((first, last): (BadNumber, BadNumber), point: Point) -> Option<BadSpan> {
    Some(BadSpan { first: first.of(point)?, last: last.of(point)? })
}

/// `30s`, `500ms`, `once`, `never`: how often a register is read.
pub fn poll_of(cell: &str) -> Option<Poll> {
    match cell {
        "once" => Some(Poll::Once),
        "never" => Some(Poll::Never),
        period => duration_of(period).filter(|period| !period.is_zero()).map(Poll::Every),
    }
}

/// Writes what [`poll_of`] and a profile read.
pub fn poll_text(poll: Poll) -> String {
    match poll {
        Poll::Once => "once".to_owned(),
        Poll::Never => "never".to_owned(),
        Poll::Every(period) if period.subsec_millis() == 0 => format!("{}s", period.as_secs()),
        Poll::Every(period) => format!("{}ms", period.as_millis()),
    }
}

/// Numbers with a blank between them; `1001..65535` are all of these.
pub fn bad_of(cell: &str) -> Option<Vec<(BadNumber, BadNumber)>> {
    let number = |word: &str| {
        let pattern = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"));
        if let Some(digits) = pattern {
            return i128::from_str_radix(digits, 16).ok().map(|number| BadNumber::Whole(number, true));
        }
        let whole = word.parse().ok().map(|number| BadNumber::Whole(number, false));
        whole.or_else(|| word.parse().ok().map(BadNumber::Float))
    };
    let span = |word: &str| {
        let (first, last) = word.split_once("..").unwrap_or((word, word));
        Some((number(first)?, number(last)?))
    };
    cell.split_whitespace().map(span).collect()
}

#[cfg(test)]
mod tests;
