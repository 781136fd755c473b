//! The two lists of NIBE heat pumps: that of the S series, whose types are often codes, and that of its program ModbusManager
//! for the F series.

use super::headings::Column;

/// Headings of the list of the S series.
const OF_S: [&str; 5] = ["Title", "Register type", "Register", "Division factor", "Size of variable"];
/// Those of the export of ModbusManager, in their order, and what they mean. A number is divided by its factor.
const OF_MANAGER: [(&str, Option<Column>); 10] = [
    ("Title", Some(Column::Name)),
    ("Info", None),
    ("ID", Some(Column::Address)),
    ("Unit", Some(Column::Unit)),
    ("Size", Some(Column::Type)),
    ("Factor", Some(Column::Divisor)),
    ("Min", None),
    ("Max", None),
    ("Default", None),
    ("Mode", Some(Column::Access)),
];
/// What the codes of sizes mean, from 1.
const TYPES: [&str; 6] = ["s8", "s16", "s32", "u8", "u16", "u32"];

/// Is it the heading of an export of ModbusManager?
pub fn is_of_manager(cells: &[String]) -> bool {
    let filled = || cells.iter().filter(|cell| !cell.is_empty());
    filled().count() == OF_MANAGER.len() && filled().zip(OF_MANAGER).all(|(cell, (known, _))| cell == known)
}

/// What the columns of that export mean.
pub fn means_of_manager(cells: &[String]) -> Vec<Option<Column>> {
    let known = |cell: &String| OF_MANAGER.iter().find(|(known, _)| known == cell).and_then(|(_, means)| *means);
    cells.iter().map(known).collect()
}

/// Is it one of these lists, whose values of two registers have the low word first?
pub fn is_list<'a>(headings: impl Iterator<Item = &'a str> + Clone) -> bool {
    let has = |known: &str| headings.clone().any(|heading| heading == known);
    OF_S.iter().all(|known| has(known)) || OF_MANAGER.iter().all(|(known, _)| has(known))
}

/// Does its column hold sizes?
pub fn is_of_sizes(heading: &str) -> bool {
    heading.trim().eq_ignore_ascii_case("size of variable")
}

/// The type of a code of a size; `None` for what is no code.
pub fn type_of_code(cell: &str) -> Option<&'static str> {
    let code: usize = cell.strip_suffix(".0").unwrap_or(cell).parse().ok()?;
    TYPES.get(code.checked_sub(1)?).copied()
}
