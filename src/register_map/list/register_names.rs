//! Addresses that are the names of registers: `R72`, `HR5`, `%MW10`.

use super::columns::{first_of, is_address};
use crate::plant::tag::Table;

/// What such names begin with, in small letters; `R` is that of any register.
const PREFIXES: [(&str, Option<Table>); 9] = [
    ("register", None),
    ("reg", None),
    ("r", None),
    ("hr", Some(Table::Holding)),
    ("ir", Some(Table::Input)),
    ("%mw", Some(Table::Holding)),
    ("mw", Some(Table::Holding)),
    ("%iw", Some(Table::Input)),
    ("iw", Some(Table::Input)),
];

/// The number of such a name, and the table that it is of.
pub fn number_of(cell: &str) -> Option<(&str, Option<Table>)> {
    let digits = first_of(cell).trim_start_matches(|sign: char| !sign.is_ascii_digit());
    let prefix = cell.get(..cell.find(digits)?)?.trim_end_matches([' ', '_', '.', '#']);
    let is_number = (1..=6).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_digit());
    let (_, table) = PREFIXES.into_iter().find(|(known, _)| prefix.eq_ignore_ascii_case(known))?;
    is_number.then_some((digits, table))
}

/// Are the cells of a column such names? One that is a number alone says that a letter matters.
pub fn are(cells: &[&str]) -> bool {
    let count = cells.iter().filter(|cell| number_of(cell).is_some()).count();
    0 < count && 4 * cells.len() <= 5 * count && !cells.iter().any(|cell| is_address(cell))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_a_register_has_a_number_and_may_have_a_table() {
        for (cell, expect) in [
            ("R72", Some(("72", None))),
            ("r1442", Some(("1442", None))),
            ("HR5", Some(("5", Some(Table::Holding)))),
            ("IR 30001", Some(("30001", Some(Table::Input)))),
            ("%MW10", Some(("10", Some(Table::Holding)))),
            ("MW10", Some(("10", Some(Table::Holding)))),
            ("Reg. 7", Some(("7", None))),
            ("R", None),
            ("72", None),
            ("X1", None),
            ("DS100", None),
            ("R1a", None),
            ("R-7", None),
            ("", None),
        ] {
            assert_eq!(number_of(cell), expect, "{cell}");
        }
        assert!(are(&["R1", "R5", "R7", "R9", "see below"]) && !are(&["R1", "5"]) && !are(&["R1", "x"]) && !are(&[]));
    }
}
