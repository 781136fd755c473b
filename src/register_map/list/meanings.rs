//! What a column means: of what its heading can be, what stands in it can be too.

use super::{
    address_forms,
    columns::{Column, is_address},
    factors::places_of,
    headings::Heading,
    heat_pump, register_names,
    tables::are_tables,
    words::{
        access_of, bad_of, bit_field_of, field_of, is_sized_type, kind_of, length_of, number_of, order_of, table_of,
        type_of, width_of, written_labels_of, yes_or_no,
    },
};
use crate::plant::address::wire;

/// Hexadecimal digits without a mark.
pub fn is_bare_hex(cell: &str) -> bool {
    !cell.is_empty() && cell.len() <= 4 && cell.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Are they the codes of sizes that a heat pump has?
pub fn are_codes(heading: &str, cells: &[&str]) -> bool {
    heat_pump::is_of_sizes(heading)
        && !cells.is_empty()
        && cells.iter().all(|cell| heat_pump::type_of_code(cell).is_some())
}

/// Is there nothing in a cell but a mark of that?
pub fn is_dash(cell: &str) -> bool {
    matches!(cell, "" | "-" | "–" | "—")
}

/// Does a cell only say that nothing stands in it?
pub fn is_blank(cell: &str) -> bool {
    is_dash(cell) || ["n/a", "n.a.", "n.a"].iter().any(|none| cell.eq_ignore_ascii_case(none))
}

/// How many of a hundred cells fit.
pub fn share(cells: &[&str], fits: impl Fn(&str) -> bool) -> usize {
    if cells.is_empty() { 100 } else { 100 * cells.iter().filter(|cell| fits(cell)).count() / cells.len() }
}

/// What a column means: of what its heading can be, the first that what is in it can be too.
pub fn meaning(heading: &str, cells: &[&str]) -> Option<Column> {
    let words = Heading::new(heading);
    // A type with its size stands in no other column, whatever that is called.
    if !cells.is_empty() && 80 <= share(cells, is_sized_type) {
        return Some(Column::Type);
    }
    if are_codes(heading, cells) {
        return Some(Column::Type);
    }
    // What is done with a register is no type of it.
    let is_of_access = !cells.is_empty() && 80 <= share(cells, |cell| access_of(cell).is_some());
    if is_of_access && (words.is_of_types() || words.has(&["format", "function", "area"])) {
        return Some(Column::Access);
    }
    if !cells.is_empty() && are_tables(&words, cells) {
        return Some(Column::Table);
    }
    // A cell that does not fit leaves out its row, not the column.
    if let Some(exact) = Heading::exact(heading).filter(|exact| 50 <= share(cells, |cell| fits_exactly(*exact, cell))) {
        return Some(exact);
    }
    if words.is_format() && cells.iter().any(|cell| cell.parse::<u8>().is_err() && places_of(cell).is_some()) {
        return Some(Column::Places);
    }
    let candidates = words.candidates();
    // Codes that are not understood say so row by row: without them each row would be of another table.
    if words.is_of_codes() && cells.iter().any(|cell| cell.bytes().any(|byte| byte.is_ascii_digit())) {
        return Some(Column::Table);
    }
    if let Some(column) = candidates.iter().copied().find(|column| fits(*column, &words, cells)) {
        let found = match column {
            Column::Address if is_of_hex(&words, cells) => Column::HexAddress,
            Column::Length if words.has(&["bytes", "byte"]) => Column::Bytes,
            column => column,
        };
        return Some(found);
    }
    // A column of types that are all unknown says so row by row; without it each would be taken for a whole number.
    candidates.into_iter().find(|column| *column == Column::Type && !words.has(&["size", "signed", "sign", "typ"]))
}

/// Does a cell fit below the heading of an export?
fn fits_exactly(exact: Column, cell: &str) -> bool {
    if matches!(exact, Column::Min | Column::Max | Column::Decimals) {
        return number_of(cell).is_some();
    }
    if matches!(exact, Column::Labels | Column::Bits) {
        return written_labels_of(cell).is_some();
    }
    exact == Column::Field && field_of(cell).is_some()
        || exact == Column::Bad && bad_of(cell).is_some()
        || exact == Column::Group
}

/// Can what is in it be of a meaning that its heading has?
fn fits(column: Column, heading: &Heading, cells: &[&str]) -> bool {
    match column {
        Column::Address => {
            let is_bare = is_of_hex(heading, cells);
            let is_one = |cell: &str| is_address(&address_forms::plain(cell)) || is_bare && is_bare_hex(cell);
            40 <= share(cells, is_one) || register_names::are(cells)
        }
        Column::Type => 1 <= share(cells, |cell| kind_of(cell).is_some() || type_of(cell, Some(1)).is_ok()),
        Column::Signed => !cells.is_empty() && 60 <= share(cells, |cell| yes_or_no(cell).is_some()),
        Column::Table => 60 <= share(cells, |cell| table_of(cell).is_some()),
        Column::Device => 80 <= share(cells, |cell| cell.parse::<u8>().is_ok()) && !cells.is_empty(),
        Column::Width => {
            // The same bit of all registers is none.
            let is_width = |cell: &&str| width_of(cell) == Some(16);
            80 <= share(cells, |cell| width_of(cell).is_some())
                && (cells.iter().any(is_width) || are_of_one_width(heading, cells))
        }
        Column::Field => !cells.is_empty() && 60 <= share(cells, |cell| bit_field_of(cell).is_some()),
        Column::Access => !cells.is_empty() && 60 <= share(cells, |cell| access_of(cell).is_some()),
        Column::Length => 60 <= share(cells, |cell| length_of(cell, false).is_some()),
        Column::Offset => 60 <= share(cells, is_numeric),
        Column::Exponent => {
            60 <= share(cells, |cell| cell.parse::<i8>().is_ok_and(|number| (-10..=10).contains(&number)))
        }
        // Numbers below `item` count rows.
        Column::Name => {
            let is_word = |cell: &str| cell.chars().any(char::is_alphabetic);
            heading.rank_of_names() != 1 || 50 <= share(cells, is_word)
        }
        Column::Order => {
            !heading.is_any_order() || cells.iter().any(|cell| order_of(cell).is_some() || number_of(cell).is_none())
        }
        Column::Scale | Column::Divisor | Column::Unit | Column::Formula => true,
        Column::HexAddress
        | Column::Bytes
        | Column::Places
        | Column::Area
        | Column::Min
        | Column::Max
        | Column::Decimals
        | Column::Labels
        | Column::Bits
        | Column::Bad
        | Column::Group
        | Column::Label
        | Column::WriteAt
        | Column::WriteWith
        | Column::Poll => false,
    }
}

/// Have all registers 8, or all 32 bits? Below `bit` it may be the same one of each.
fn are_of_one_width(heading: &Heading, cells: &[&str]) -> bool {
    let is_of_sizes = heading.has(&["bits", "size", "length", "width", "länge", "größe", "bitbreite"]);
    is_of_sizes
        && 1 < cells.len()
        && matches!(width_of(cells[0]), Some(8 | 32 | 64))
        && cells.iter().all(|cell| *cell == cells[0])
}

/// Does a cell begin as a number does? One that then is none makes its row wrong.
fn is_numeric(cell: &str) -> bool {
    let digits = cell.trim_start_matches(['-', '+', '−', '–', ' ']);
    digits.starts_with(|sign: char| sign.is_ascii_digit()) && !digits.contains(['x', 'X'])
}

/// Do the digits of a column of addresses without a mark count as hexadecimal? Most of them prove it, one with a letter does
/// not.
fn is_of_hex(heading: &Heading, cells: &[&str]) -> bool {
    if heading.is_hex() || heading.is_decimal() {
        return !heading.is_decimal();
    }
    let has_letter = |cell: &str| cell.bytes().any(|byte| byte.is_ascii_alphabetic());
    // `F1` may be the name of a parameter.
    let is_number = |cell: &str| cell.starts_with(|sign: char| sign.is_ascii_digit());
    let is_bare = |cell: &str| is_bare_hex(cell) && is_number(cell) && has_letter(cell);
    let is_marked = |cell: &str| is_bare_hex(cell) && has_letter(cell) || wire(cell).is_some() && has_letter(cell);
    cells.iter().any(|cell| is_bare(cell)) && 50 < share(cells, is_marked)
}
