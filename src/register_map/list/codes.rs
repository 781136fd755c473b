//! Function codes in a cell: the table that they read and write, and whether they do.

use crate::plant::tag::Table;

/// The codes in front of a text: `03`, `FC04`, `FC=01,05,15`, `FC 3/6`, `0x04`; empty where it begins with something else.
fn codes_of(text: &str) -> Vec<u8> {
    let text = text.to_lowercase();
    let words = text.split(|sign: char| !sign.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let number = |word: &str| {
        let word = word.strip_prefix("fc").unwrap_or(word);
        match word.strip_prefix("0x") {
            Some(digits) => u8::from_str_radix(digits, 16).ok(),
            None => word.parse().ok(),
        }
    };
    words.filter(|word| *word != "fc").map_while(number).collect()
}

fn table_of_code(code: u8) -> Option<Table> {
    match code {
        1 | 5 | 15 => Some(Table::Coil),
        2 => Some(Table::Discrete),
        3 | 6 | 16 | 22 | 23 => Some(Table::Holding),
        4 => Some(Table::Input),
        _ => None,
    }
}

/// The table of all codes in it; `None` where they have several.
pub fn table_of(text: &str) -> Option<Table> {
    // `-3` is a number.
    if !text.trim().starts_with(|sign: char| sign.is_ascii_alphanumeric()) {
        return None;
    }
    let tables: Option<Vec<Table>> = codes_of(text).into_iter().map(table_of_code).collect();
    let tables = tables?;
    let table = *tables.first()?;
    tables.iter().all(|other| *other == table).then_some(table)
}

/// The table of the codes behind `FC` or `function code` within a title.
pub fn table_in(title: &str) -> Option<Table> {
    let title = title.to_lowercase().replace("function code", "fc");
    let (before, codes) = title.split_once("fc")?;
    let is_word = before.is_empty() || before.ends_with(|sign: char| !sign.is_alphanumeric());
    let codes = codes.trim_start_matches(|sign: char| !sign.is_ascii_alphanumeric());
    is_word.then(|| table_of(codes)).flatten()
}

/// The codes that write what others beside them read: of one register or coil, and of several; `None` for no such.
pub fn writes_of<'a>(texts: impl Iterator<Item = &'a str>) -> [Option<u8>; 2] {
    let codes: Vec<u8> = texts.filter(|text| table_of(text).is_some()).flat_map(codes_of).collect();
    let of = |read: u8, write: u8| Some(write).filter(|_| codes.contains(&read) && codes.contains(&write));
    [of(1, 5).or(of(3, 6)), of(1, 15).or(of(3, 16))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_state_the_table_and_what_is_done_with_it() {
        for (text, table, writes) in [
            ("FC=01,05,15", Table::Coil, [Some(5), Some(15)]),
            ("FC=02", Table::Discrete, [None; 2]),
            ("FC=03,06,16", Table::Holding, [Some(6), Some(16)]),
            ("FC 3/6", Table::Holding, [Some(6), None]),
            ("FC03, FC16", Table::Holding, [None, Some(16)]),
            ("1, 15", Table::Coil, [None, Some(15)]),
            ("0x03/0x10", Table::Holding, [None, Some(16)]),
            ("FC=04", Table::Input, [None; 2]),
            ("FC: 4", Table::Input, [None; 2]),
            ("03", Table::Holding, [None; 2]),
            ("06", Table::Holding, [None; 2]),
            ("3 - read", Table::Holding, [None; 2]),
        ] {
            assert_eq!((table_of(text), writes_of([text].into_iter())), (Some(table), writes), "{text}");
        }
        for text in ["", "FC", "FC=03,04", "FC=99", "-3", "read", "(3)", "FC=3; FC=4"] {
            assert_eq!((table_of(text), writes_of([text].into_iter())), (None, [None; 2]), "{text}");
        }
    }
}
