//! Addresses as people write them, for every place where one is typed or read: profiles, register lists, the register
//! window, the command line.
//!
//! ```text
//!   0x3EA  03EAH        as sent on the wire
//!   holding:1002        as sent, with its table
//!   41003               a Modicon number, or as sent: the same digits, two registers
//!   4x1003              a Modicon number for sure; `0x` is hexadecimal
//! ```

use super::tag::Table;

/// The tables in the order of their Modicon numbers.
pub const TABLES: [Table; 4] = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];

/// How a plain decimal number counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AddressBase {
    /// A Modicon number where it can be one, else as sent.
    Modicon,
    /// As sent, from 0.
    Zero,
    /// From 1, as in many manuals.
    One,
}

/// What is known about an address beside its text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AddressContext {
    /// Its table, if the text names none.
    pub table: Table,
    /// The table is stated, so that a Modicon number of another table is none.
    pub is_stated: bool,
    /// How a plain number counts.
    pub base: AddressBase,
}

impl AddressContext {
    /// Table and wire address of a text; `None` for what is no address.
    pub fn parse(self, text: &str) -> Option<(Table, u16)> {
        let text = text.trim();
        if text.contains(':') {
            return in_table(text);
        }
        if let Some(address) = hexadecimal(text) {
            return Some((self.table, address));
        }
        let Some(number) = plain(text) else {
            return of_modicon(text).filter(|(table, _)| !self.is_stated || *table == self.table);
        };
        let first = if self.base == AddressBase::One { 1 } else { 0 };
        let counted = number.checked_sub(first).and_then(|address| Some((self.table, u16::try_from(address).ok()?)));
        let modicon = of_modicon(text).filter(|(table, _)| !self.is_stated || *table == self.table);
        match self.base {
            AddressBase::Modicon => modicon.or(counted),
            AddressBase::Zero | AddressBase::One => counted.or(modicon),
        }
    }
}

/// `holding:1002`, `input:0x3EA`: always as sent.
pub fn in_table(text: &str) -> Option<(Table, u16)> {
    let (word, address) = text.split_once(':')?;
    Some((table_named(word.trim())?, wire(address.trim())?))
}

/// The table of a word such as `holding`.
pub fn table_named(word: &str) -> Option<Table> {
    TABLES.into_iter().find(|table| table.word().eq_ignore_ascii_case(word))
}

/// A wire address without its table: `1002`, `0x3EA`, `03EAH`.
pub fn wire(text: &str) -> Option<u16> {
    hexadecimal(text).or_else(|| u16::try_from(plain(text)?).ok())
}

/// Table and wire address of a Modicon number of five or six digits, or `4x1`.
pub fn of_modicon(text: &str) -> Option<(Table, u16)> {
    TABLES.into_iter().find_map(|table| {
        let digits = text.strip_prefix(char::from(b'0' + table.digit()))?;
        let marked = digits.strip_prefix(['x', 'X']).filter(|_| table != Table::Coil);
        let is_long = marked.is_some() || matches!(digits.len(), 4 | 5);
        let number = plain(marked.unwrap_or(digits)).filter(|number| is_long && *number != 0)?;
        Some((table, u16::try_from(number - 1).ok()?))
    })
}

fn hexadecimal(text: &str) -> Option<u16> {
    let marked = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let digits = marked.or_else(|| {
        text.strip_suffix(['h', 'H']).filter(|digits| digits.starts_with(|first: char| first.is_ascii_digit()))
    })?;
    // `from_str_radix` takes a sign.
    u16::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'))
}

fn plain(text: &str) -> Option<u32> {
    text.parse().ok().filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_table_or_base_decides_what_digits_mean() {
        let check = |text: &str, stated: Option<Table>, base, expect: Option<(Table, u16)>| {
            let of = AddressContext { table: stated.unwrap_or(Table::Holding), is_stated: stated.is_some(), base };
            assert_eq!(of.parse(text), expect, "{text} {stated:?} {base:?}");
        };
        let (modicon, zero, one) = (AddressBase::Modicon, AddressBase::Zero, AddressBase::One);
        check("41003", None, modicon, Some((Table::Holding, 1002)));
        check("31003", None, modicon, Some((Table::Input, 1002)));
        check("40080", None, zero, Some((Table::Holding, 40_080)));
        check("40080", None, one, Some((Table::Holding, 40_079)));
        check("16299", Some(Table::Holding), modicon, Some((Table::Holding, 16_299)));
        check("41003", Some(Table::Holding), modicon, Some((Table::Holding, 1002)));
        check("41003", Some(Table::Input), modicon, Some((Table::Input, 41_003)));
        check("400001", None, zero, Some((Table::Holding, 0)));
        check("400001", Some(Table::Input), zero, None);
        check("1002", None, modicon, Some((Table::Holding, 1002)));
        check("0", None, one, None);
        for base in [modicon, zero, one] {
            check("holding:32080", Some(Table::Input), base, Some((Table::Holding, 32_080)));
            check("input:0x3EA", None, base, Some((Table::Input, 1002)));
            check("0X03EA", None, base, Some((Table::Holding, 1002)));
            check("03eah", None, base, Some((Table::Holding, 1002)));
            check("4x1003", None, base, Some((Table::Holding, 1002)));
            check("3X0001", None, base, Some((Table::Input, 0)));
            check("0x0010", None, base, Some((Table::Holding, 16)));
            check("3x0001", Some(Table::Holding), base, None);
            for wrong in ["", "+5", "4+003", "70000", "register:5", "holding:", "0x10000", "1.5", "BEEFH", "4x0", "5x1"]
            {
                check(wrong, None, base, None);
            }
        }
    }
}
