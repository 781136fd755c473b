//! Words for the four tables, as they stand in a column of tables and mean something else elsewhere.

use super::{headings::Heading, words};
use crate::plant::tag::Table;

/// In small letters.
const WORDS: [(&[&str], Table); 4] = [
    (&["co", "do", "c", "digital output", "digital outputs"], Table::Coil),
    (&["di", "d", "digital input", "digital inputs"], Table::Discrete),
    (&["ir", "ai", "ireg", "i", "analog input", "analog inputs", "analogue input"], Table::Input),
    (&["hr", "ao", "hreg", "h", "analog output", "analog outputs", "analogue output"], Table::Holding),
];

/// The table that a cell of a column of tables means.
pub fn table_of(cell: &str) -> Option<Table> {
    let lower = cell.trim().to_lowercase();
    let word = WORDS.iter().find(|(words, _)| words.contains(&lower.as_str())).map(|(_, table)| *table);
    word.or_else(|| words::table_of(cell))
}

/// Does a column have words for tables, whatever it is called? A number is a word below few headings.
pub fn are_tables(heading: &Heading, cells: &[&str]) -> bool {
    if heading.is_of_tables() {
        return true;
    }
    let is_number = |cell: &str| cell.starts_with(|sign: char| sign.is_ascii_digit()) && !cell.ends_with(['x', 'X']);
    let is_word = |cell: &&str| !is_number(cell) && table_of(cell).is_some();
    // `I` is a table beside `H`, and else a unit or a type.
    let is_letter = |cell: &&str| cell.len() == 1 && is_word(cell);
    let are_letters = cells.iter().any(is_letter);
    let is_typed = cells.iter().any(|cell| words::kind_of(cell).is_some());
    let is_clear =
        !are_letters || cells.iter().all(|cell| cell.len() == 1) && cells.iter().any(|cell| matches!(*cell, "h" | "H"));
    let count = cells.iter().filter(|cell| is_word(cell)).count();
    // Of types a single word is enough: the rows of the others must not be those of another table.
    let is_enough = heading.is_of_types() || 4 * cells.len() <= 5 * count;
    is_clear && !is_typed && 0 < count && is_enough && heading.may_be_of_tables()
}
