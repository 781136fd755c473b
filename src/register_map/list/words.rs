//! The words of a cell: types with their byte order, tables, factors.

use crate::{
    plant::tag::{ByteOrder, DataType, Table},
    t,
};

/// `0.1`, `0,1`, `x0.1`, `/10`, `÷10`, `1/10`, `10^-1`.
pub fn number_of(text: &str) -> Option<f64> {
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

/// As a person would write it: 0.001, not the nearest to it.
pub fn power_of_ten(exponent: f64) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The table that a word or a function code means.
pub fn table_of(text: &str) -> Option<Table> {
    let text = text.to_lowercase().replace('_', " ");
    let is = |words: &[&str]| words.iter().any(|word| text.contains(word));
    let code = text.trim_start_matches("fc").trim();
    let code = code.split(|sign: char| !sign.is_ascii_digit()).next().unwrap_or_default();
    match code.trim_start_matches('0') {
        "1" => Some(Table::Coil),
        "2" => Some(Table::Discrete),
        "3" => Some(Table::Holding),
        "4" => Some(Table::Input),
        _ if is(&["coil"]) => Some(Table::Coil),
        _ if is(&["discrete"]) => Some(Table::Discrete),
        _ if is(&["holding"]) => Some(Table::Holding),
        _ if is(&["input reg"]) || text == "input" => Some(Table::Input),
        _ => None,
    }
}

/// The order of four letters.
pub fn order_of(text: &str) -> Option<ByteOrder> {
    ByteOrder::ALL.into_iter().find(|order| order.word().eq_ignore_ascii_case(text))
}

/// The type that a manual means by a word.
pub fn kind_of(text: &str) -> Option<DataType> {
    // As a profile says it, and an export: `cstring(8)`, `mod10k(2)`.
    if let Ok(kind) = text.trim().parse() {
        return Some(kind);
    }
    let word: String = text.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let text_bytes =
        ["string", "char", "ascii"].iter().find_map(|prefix| word.strip_prefix(prefix)?.parse::<u8>().ok());
    if let Some(bytes) = text_bytes.filter(|bytes| (1..=DataType::TEXT_MAX).contains(bytes)) {
        return Some(DataType::Text(bytes));
    }
    Some(match word.as_str() {
        "int16" | "i16" | "s16" | "sint16" | "int" | "short" | "signed" | "signed16" | "signed16bit" | "signedint" => {
            DataType::I16
        }
        "uint16" | "u16" | "word" | "uint" | "ushort" | "unsigned" | "unsigned16" | "unsigned16bit" | "unsignedint" => {
            DataType::U16
        }
        "int32" | "i32" | "s32" | "sint32" | "dint" | "long" | "signed32" | "signed32bit" => DataType::I32,
        "uint32" | "u32" | "dword" | "udint" | "ulong" | "unsigned32" | "unsigned32bit" => DataType::U32,
        "int64" | "i64" | "s64" | "lint" => DataType::I64,
        "uint64" | "u64" | "ulint" | "qword" => DataType::U64,
        "float" | "float32" | "f32" | "real" | "single" | "ieee754" | "floatingpoint" | "32bitfloat" => DataType::F32,
        "double" | "float64" | "f64" | "lreal" => DataType::F64,
        "bcd" | "bcd16" => DataType::Bcd16,
        "bcd32" => DataType::Bcd32,
        "int24" | "i24" | "s24" => DataType::I24,
        "uint24" | "u24" => DataType::U24,
        "int48" | "i48" | "s48" => DataType::I48,
        "uint48" | "u48" => DataType::U48,
        "float16" | "f16" | "half" => DataType::F16,
        "int8" | "i8" | "s8" | "sint8" | "signed8" => DataType::I8,
        "uint8" | "u8" | "byte" | "unsigned8" => DataType::U8,
        "bool" | "boolean" | "bit" => DataType::Bool,
        _ => return None,
    })
}

/// A type with the suffix of its byte order, as the lists of ioBroker have it: `uint32be`, `floatsw`, `int16le`.
fn suffixed(text: &str) -> Option<(DataType, ByteOrder)> {
    let word = text.trim().to_lowercase();
    let (kind, suffix) = word.split_at_checked(word.len().checked_sub(2)?)?;
    let kind = kind_of(kind)?;
    let order = match (suffix, kind.registers()) {
        ("be", _) => ByteOrder::Abcd,
        ("le", 1) => ByteOrder::Badc,
        ("le", _) => ByteOrder::Dcba,
        ("sw", 2..) => ByteOrder::Cdab,
        _ => return None,
    };
    Some((kind, order))
}

/// Is it the word of a type that says its size, which no name of a value is?
pub fn is_sized_type(text: &str) -> bool {
    let has_size = text.ends_with(|c: char| c.is_ascii_digit());
    suffixed(text).is_some() || has_size && kind_of(text).is_some()
}

/// The type and, where the word says it, the order; by the registers that it takes where the word does not say how many.
pub fn type_of(word: &str, length: Option<u16>) -> Result<(DataType, Option<ByteOrder>), String> {
    let plain: String = word.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let of_length = |one, two, four| match length {
        None | Some(1) => Ok((one, None)),
        Some(2) => Ok((two, None)),
        Some(4) => Ok((four, None)),
        Some(length) => Err(t!("`{word}` of {length} registers is not known", word, length)),
    };
    match plain.as_str() {
        "int" | "signed" | "signedint" | "sint" => return of_length(DataType::I16, DataType::I32, DataType::I64),
        "uint" | "unsigned" | "unsignedint" => return of_length(DataType::U16, DataType::U32, DataType::U64),
        "string" | "char" | "ascii" | "text" | "stringbe" | "stringle" => {
            let bytes = length.and_then(|length| u8::try_from(length.checked_mul(2)?).ok());
            let bytes = bytes.filter(|bytes| (1..=DataType::TEXT_MAX).contains(bytes));
            let order = plain.ends_with("le").then_some(ByteOrder::Badc);
            return bytes
                .map(|bytes| (DataType::Text(bytes), order))
                .ok_or_else(|| t!("`{word}` does not say how long the text is", word));
        }
        _ => {}
    }
    let found = kind_of(word).map(|kind| (kind, None));
    let found = found.or_else(|| suffixed(word).map(|(kind, order)| (kind, Some(order))));
    let (kind, order) = found.ok_or_else(|| t!("`{word}` is not a known type", word))?;
    match length.filter(|length| *length != kind.registers()) {
        Some(length) => Err(t!("`{word}` does not take {length} registers", word, length)),
        None => Ok((kind, order)),
    }
}

/// `0=off; 1=on`.
pub fn labels_of(cell: &str) -> Option<Vec<(i128, String)>> {
    let label = |part: &str| {
        let (number, text) = part.split_once('=')?;
        Some((number.trim().parse().ok()?, text.trim().to_owned()))
    };
    cell.split(';').map(label).collect()
}

/// `5-4` or `3`: the lowest bit and how many.
pub fn field_of(cell: &str) -> Option<(u8, u8)> {
    let (high, low) = cell.split_once('-').unwrap_or((cell, cell));
    let (high, low): (u8, u8) = (high.trim().parse().ok()?, low.trim().parse().ok()?);
    (low <= high && high < 64).then(|| (low, high - low + 1))
}

/// Numbers with a blank between them.
pub fn bad_of(cell: &str) -> Option<Vec<i128>> {
    cell.split_whitespace().map(|number| number.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_type_fits_its_number_of_registers_or_is_refused() {
        let check = |word: &str, length, expect: Option<(DataType, Option<ByteOrder>)>| {
            assert_eq!(type_of(word, length).ok(), expect, "{word} {length:?}");
        };
        check("int16", None, Some((DataType::I16, None)));
        check("int16", Some(2), None);
        check("signed", Some(2), Some((DataType::I32, None)));
        check("unsigned", Some(3), None);
        check("string", Some(4), Some((DataType::Text(8), None)));
        check("string", None, None);
        check("uint16be", Some(1), Some((DataType::U16, Some(ByteOrder::Abcd))));
        check("uint32sw", Some(2), Some((DataType::U32, Some(ByteOrder::Cdab))));
        check("floatle", Some(2), Some((DataType::F32, Some(ByteOrder::Dcba))));
        check("int16le", Some(1), Some((DataType::I16, Some(ByteOrder::Badc))));
        check("uint32sb", Some(2), None);
        check("s8", None, Some((DataType::I8, None)));
        check("uint8le", Some(1), Some((DataType::U8, Some(ByteOrder::Badc))));
        check("int8be", None, Some((DataType::I8, Some(ByteOrder::Abcd))));
        check("uint48", Some(3), Some((DataType::U48, None)));
        check("cstring(8)", None, Some((DataType::TextToNul(8), None)));
        check("mod10k(2)", Some(2), Some((DataType::Mod10k(2), None)));
    }

    #[test]
    fn tables_are_known_by_words_and_function_codes() {
        for (word, table) in [
            ("MODBUS_INPUT_REGISTER", Table::Input),
            ("MODBUS_HOLDING_REGISTER", Table::Holding),
            ("03/06/16", Table::Holding),
            ("FC04", Table::Input),
            ("Coil (0x)", Table::Coil),
        ] {
            assert_eq!(table_of(word), Some(table), "{word}");
        }
        assert_eq!(table_of("measured value"), None);
        assert_eq!([number_of("10^-2"), number_of("0,1"), number_of("/10")], [Some(0.01), Some(0.1), Some(0.1)]);
    }
}
