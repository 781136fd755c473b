//! What the columns of a list mean: by their heading, if what stands in them agrees, else by what stands in them.

use std::collections::{BTreeMap, BTreeSet};

pub use super::headings::{Column, is_heading};
use super::{
    cells::Cells,
    headings::{self, Heading},
    heat_pump,
    questions::{self, Question},
    register_names,
    words::{
        access_of, bad_of, bit_field_of, field_of, is_sized_type, kind_of, labels_of, length_of, number_of, table_of,
        type_of, width_of, yes_or_no,
    },
};
use crate::plant::{
    address::{AddressBase, AddressContext, wire},
    tag::Table,
};

/// What readers have said about columns, by heading; `None`: it is not used.
pub type Said = BTreeMap<String, Option<Column>>;

/// The columns of some rows below one heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// As they are called, each another name.
    pub headings: Vec<String>,
    /// What each means; `None`: nothing that is taken.
    pub means: Vec<Option<Column>>,
    /// Those of which it is not known what they mean.
    pub open: Vec<Question>,
    /// Columns of addresses such as `4x0001`, in which `0x` is no mark of hexadecimal digits.
    areas: BTreeSet<usize>,
    /// Columns of addresses such as `R72`.
    names: BTreeSet<usize>,
    /// Columns of types that are the codes of a heat pump.
    codes: BTreeSet<usize>,
    /// It is a list of a known program: nothing is guessed.
    pub is_sure: bool,
    /// It is a list of ioBroker.
    pub is_iobroker: bool,
    /// It is an export of ModbusManager, whose devices write with the function for several registers alone.
    pub is_of_manager: bool,
}

/// Is it an address in any reading?
pub fn is_address(cell: &str) -> bool {
    let any = AddressContext { table: Table::Holding, is_stated: false, base: AddressBase::Modicon };
    any.parse(first_of(cell)).is_some()
}

/// Of `41003-41004` the first.
pub fn first_of(cell: &str) -> &str {
    match ends_of(cell) {
        Some((first, last)) if number_as(first, last).is_none_or(|(first, last)| first <= last) => first,
        _ => cell.trim(),
    }
}

/// How many registers a span takes: 2 of `41003-41004` and of `41003-04`.
pub fn span_of(cell: &str) -> Option<u16> {
    let (first, last) = ends_of(cell)?;
    let (first, last) = number_as(first, last)?;
    u16::try_from(last.checked_sub(first)? + 1).ok()
}

/// First and last of a span: two numbers. A date is no address.
fn ends_of(cell: &str) -> Option<(&str, &str)> {
    let (first, last) = cell.split_once(['-', '–', '…'])?;
    let last = last.trim();
    (!last.contains(['-', '–', '…']) && last.starts_with(|sign: char| sign.is_ascii_digit()))
        .then_some((first.trim(), last))
}

/// Both as numbers; the last may have its last digits only.
fn number_as(first: &str, last: &str) -> Option<(u32, u32)> {
    let number = |text: &str| wire(text).map(u32::from).or_else(|| text.parse().ok());
    let front = first.get(..first.len().saturating_sub(last.len())).unwrap_or_default();
    let is_short = last.bytes().chain(first.bytes()).all(|byte| byte.is_ascii_digit());
    Some((number(first)?, if is_short { number(&format!("{front}{last}"))? } else { number(last)? }))
}

/// Hexadecimal digits without a mark.
fn is_bare_hex(cell: &str) -> bool {
    !cell.is_empty() && cell.len() <= 4 && cell.bytes().all(|byte| byte.is_ascii_hexdigit())
}

impl Columns {
    /// What the columns of a heading mean, by what stands in the rows below it and what its reader has said.
    pub fn new(heading: &[String], rows: &[Cells], said: &Said) -> Columns {
        let headings = distinct(heading);
        let is_own = headings::is_own(heading);
        let is_iobroker = heading.first().is_some_and(|cell| cell == "_address");
        let is_of_manager = heat_pump::is_of_manager(heading);
        let cells: Vec<Vec<&str>> = (0..heading.len()).map(|n| filled(rows, n)).collect();
        let guess = |n: usize| if is_own { Heading::exact(&heading[n]) } else { meaning(&heading[n], &cells[n]) };
        let mut means: Vec<Option<Column>> = match is_of_manager {
            true => heat_pump::means_of_manager(heading),
            false => (0..heading.len()).map(guess).collect(),
        };
        if !is_own && !is_iobroker {
            count_bytes(&mut means, rows);
        }
        let said: Vec<Option<Option<Column>>> = headings.iter().map(|heading| said_of(said, heading)).collect();
        means.iter_mut().zip(&said).for_each(|(means, said)| *means = said.unwrap_or(*means));
        let is_of_areas =
            |n: &usize| means[*n] == Some(Column::Address) && cells[*n].iter().any(|cell| is_in_area(cell));
        let areas = (0..means.len()).filter(is_of_areas).collect();
        let is_of_names = |n: &usize| means[*n] == Some(Column::Address) && register_names::are(&cells[*n]);
        let names = (0..means.len()).filter(is_of_names).collect();
        let is_of_codes = |n: &usize| means[*n] == Some(Column::Type) && are_codes(&headings[*n], &cells[*n]);
        let codes = (0..means.len()).filter(is_of_codes).collect();
        let is_sure = is_own || is_iobroker;
        let open = Vec::new();
        let mut columns = Columns { headings, means, open, areas, names, codes, is_sure, is_iobroker, is_of_manager };
        if !columns.is_sure {
            columns.open = questions::of(&mut columns.means, &columns.headings, &cells, |n| said[n].is_some());
        }
        columns
    }

    /// The places of the columns of a meaning; those of an address with the surest first.
    pub fn places(&self, column: Column) -> Vec<usize> {
        let of = |n: &usize| match self.means[*n] {
            Some(Column::HexAddress) => column == Column::Address,
            means => means == Some(column),
        };
        let mut places: Vec<usize> = (0..self.means.len()).filter(of).collect();
        let rank = |n: &usize| {
            let heading = Heading::new(&self.headings[*n]);
            if column == Column::Name {
                return heading.rank_of_names();
            }
            let is_sent = heading.has(&["pdu", "protocol", "wire", "hex"]);
            [is_sent, heading.has(&["address", "addr", "addr.", "adresse"])].iter().position(|is| *is).unwrap_or(2)
        };
        places.sort_by_key(rank);
        places
    }

    /// The table that a cell of a column of addresses names.
    pub fn table_of_address(&self, place: usize, cell: &str) -> Option<Table> {
        register_names::number_of(cell).filter(|_| self.names.contains(&place))?.1
    }

    /// The types of a row, as written or as their codes mean them.
    pub fn types<'a>(&self, row: &'a Cells) -> Vec<&'a str> {
        let cell = |place: usize| {
            let cell = row.cells.get(place)?.as_str();
            let code = Some(cell).filter(|_| self.codes.contains(&place)).and_then(heat_pump::type_of_code);
            Some(code.unwrap_or(cell)).filter(|cell| !matches!(*cell, "" | "-" | "–"))
        };
        self.places(Column::Type).into_iter().filter_map(cell).collect()
    }

    /// The cell of a column of addresses, and how it counts where its heading says that.
    pub fn address(&self, place: usize, cell: &str) -> (String, Option<AddressBase>) {
        let base = self.headings.get(place).and_then(|heading| Heading::new(heading).base());
        if let Some((digits, _)) = register_names::number_of(cell).filter(|_| self.names.contains(&place)) {
            return (digits.to_owned(), base);
        }
        if self.means[place] == Some(Column::HexAddress) && is_bare_hex(cell) {
            return (format!("0x{cell}"), base);
        }
        let of_coil = cell
            .strip_prefix(['0'])
            .and_then(|rest| rest.strip_prefix(['x', 'X'])?.parse::<u16>().ok()?.checked_sub(1));
        match of_coil.filter(|_| self.areas.contains(&place)) {
            Some(address) => (format!("coil:{address}"), base),
            None => (cell.to_owned(), base),
        }
    }
}

/// Are they the codes of sizes that a heat pump has?
fn are_codes(heading: &str, cells: &[&str]) -> bool {
    heat_pump::is_of_sizes(heading)
        && !cells.is_empty()
        && cells.iter().all(|cell| heat_pump::type_of_code(cell).is_some())
}

/// Lengths that fit the types of their rows as bytes, and none as registers, are bytes.
fn count_bytes(means: &mut [Option<Column>], rows: &[Cells]) {
    let at = |column: Column| means.iter().position(|means| *means == Some(column));
    let (Some(kind), Some(length)) = (at(Column::Type), at(Column::Length)) else { return };
    let sized = rows.iter().filter_map(|row| {
        let kind = row.cells.get(kind).filter(|cell| is_sized_type(cell)).and_then(|cell| type_of(cell, None).ok())?;
        Some((kind.0.registers(), row.cells.get(length)?.parse::<u16>().ok()?))
    });
    let sized: Vec<(u16, u16)> = sized.collect();
    if !sized.is_empty() && sized.iter().all(|(registers, length)| 2 * registers == *length) {
        means[length] = Some(Column::Bytes);
    }
}

/// What is said of a heading.
pub fn said_of(said: &Said, heading: &str) -> Option<Option<Column>> {
    let same = |(known, _): &(&String, &Option<Column>)| known.to_lowercase() == heading.to_lowercase();
    said.get(heading).or_else(|| said.iter().find(same).map(|(_, means)| means)).copied()
}

/// `4x0001`, which is no hexadecimal number.
fn is_in_area(cell: &str) -> bool {
    let mut signs = cell.chars();
    matches!((signs.next(), signs.next()), (Some('1' | '3' | '4'), Some('x' | 'X')))
}

/// Names of columns that are not the same twice.
fn distinct(heading: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (n, heading) in heading.iter().enumerate() {
        let plain = if heading.is_empty() { format!("({})", n + 1) } else { heading.clone() };
        let name = if names.contains(&plain) { format!("{plain} ({})", n + 1) } else { plain };
        names.push(name);
    }
    names
}

/// What stands in a column, but for what only says that nothing does.
fn filled(rows: &[Cells], n: usize) -> Vec<&str> {
    // A line of prose is a row of one cell.
    let is_prose = |row: &Cells| row.cells.len() == 1;
    let cells = rows.iter().filter(|row| !is_prose(row)).filter_map(|row| row.cells.get(n)).map(String::as_str);
    cells.filter(|cell| !matches!(*cell, "" | "-" | "–")).collect()
}

/// How many of a hundred cells fit.
pub fn share(cells: &[&str], fits: impl Fn(&str) -> bool) -> usize {
    if cells.is_empty() { 100 } else { 100 * cells.iter().filter(|cell| fits(cell)).count() / cells.len() }
}

/// What a column means: of what its heading can be, the first that what is in it can be too.
fn meaning(heading: &str, cells: &[&str]) -> Option<Column> {
    // A type with its size stands in no other column, whatever that is called.
    if !cells.is_empty() && 80 <= share(cells, is_sized_type) {
        return Some(Column::Type);
    }
    if are_codes(heading, cells) {
        return Some(Column::Type);
    }
    // What is done with a register is no type of it.
    let is_of_access = !cells.is_empty() && 80 <= share(cells, |cell| access_of(cell).is_some());
    if is_of_access && Heading::new(heading).has(&["type", "typ", "tipo", "format", "function", "area"]) {
        return Some(Column::Access);
    }
    // A cell that does not fit leaves out its row, not the column.
    if let Some(exact) = Heading::exact(heading).filter(|exact| 50 <= share(cells, |cell| fits_exactly(*exact, cell))) {
        return Some(exact);
    }
    let words = Heading::new(heading);
    let candidates = words.candidates();
    // Codes that are not understood say so row by row: without them each row would be of another table.
    if words.is_of_codes() && cells.iter().any(|cell| cell.bytes().any(|byte| byte.is_ascii_digit())) {
        return Some(Column::Table);
    }
    if let Some(column) = candidates.iter().copied().find(|column| fits(*column, &words, cells)) {
        // What is more than 1 as a gain is what a maker has multiplied by.
        let is_gain = column == Column::Scale && words.has(&["gain"]);
        let is_above =
            !cells.is_empty() && 100 == share(cells, |cell| number_of(cell).is_some_and(|number| 1.0 <= number));
        let is_hex = column == Column::Address && is_of_hex(&words, cells);
        let is_of_bytes = column == Column::Length && words.has(&["bytes"]);
        let found = match (is_gain && is_above, is_hex, is_of_bytes) {
            (true, _, _) => Column::Divisor,
            (_, true, _) => Column::HexAddress,
            (_, _, true) => Column::Bytes,
            (false, false, false) => column,
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
        return labels_of(cell).is_some();
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
            40 <= share(cells, |cell| is_address(cell) || is_bare && is_bare_hex(cell)) || register_names::are(cells)
        }
        Column::Type => 1 <= share(cells, |cell| kind_of(cell).is_some() || type_of(cell, Some(1)).is_ok()),
        Column::Signed => !cells.is_empty() && 60 <= share(cells, |cell| yes_or_no(cell).is_some()),
        Column::Table => 60 <= share(cells, |cell| table_of(cell).is_some()),
        Column::Device => 80 <= share(cells, |cell| cell.parse::<u8>().is_ok()) && !cells.is_empty(),
        Column::Width => {
            80 <= share(cells, |cell| width_of(cell).is_some()) && cells.iter().any(|cell| width_of(cell) == Some(16))
        }
        Column::Field => !cells.is_empty() && 60 <= share(cells, |cell| bit_field_of(cell).is_some()),
        Column::Access => !cells.is_empty() && 60 <= share(cells, |cell| access_of(cell).is_some()),
        Column::Length => 60 <= share(cells, |cell| length_of(cell, false).is_some()),
        Column::Offset => 60 <= share(cells, |cell| number_of(cell).is_some()) && !is_rising(cells),
        Column::Exponent => {
            60 <= share(cells, |cell| cell.parse::<i8>().is_ok_and(|number| (-10..=10).contains(&number)))
        }
        // Numbers below `item` count rows.
        Column::Name => {
            let is_word = |cell: &str| cell.chars().any(char::is_alphabetic);
            heading.rank_of_names() != 1 || 50 <= share(cells, is_word)
        }
        Column::Scale | Column::Divisor | Column::Unit | Column::Order | Column::Formula => true,
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

/// Do the digits of a column of addresses without a mark count as hexadecimal? One with a letter proves it of all.
fn is_of_hex(heading: &Heading, cells: &[&str]) -> bool {
    if heading.has(&["hex"]) {
        return !heading.has(&["dec"]);
    }
    let with_letter = |cell: &&&str| cell.bytes().any(|byte| byte.is_ascii_alphabetic());
    let bare: Vec<&&str> = cells.iter().filter(|cell| is_bare_hex(cell)).collect();
    // `F1` may be the name of a parameter.
    let is_number = |cell: &&str| cell.starts_with(|sign: char| sign.is_ascii_digit());
    !heading.has(&["dec"]) && bare.iter().any(|cell| with_letter(cell) && is_number(cell))
}

/// Does it rise from row to row? Then it counts registers.
fn is_rising(cells: &[&str]) -> bool {
    let numbers: Vec<f64> = cells.iter().filter_map(|cell| number_of(cell)).collect();
    3 <= numbers.len() && numbers.windows(2).all(|pair| pair[0] < pair[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expect: &[Option<Column>]) {
        let rows = super::super::cells::rows(text, Some(';'), &Said::new());
        let (heading, rows) = rows.split_first().expect("a heading");
        assert!(is_heading(&heading.cells, &Said::new()), "{text}");
        assert_eq!(Columns::new(&heading.cells, rows, &Said::new()).means, expect, "{text}");
    }

    #[test]
    fn columns_are_known_by_heading_and_by_what_is_in_them() {
        use Column::*;
        check(
            "Address;Name;Division factor;Unit\n1;Outdoor;10;°C\n",
            &[Some(Address), Some(Name), Some(Divisor), Some(Unit)],
        );
        check(
            "Title;Register type;Register;Division factor;Unit;Size of variable;Min value\nBT1;MODBUS_INPUT_REGISTER;1;10;°C;s16;0\n",
            &[Some(Name), Some(Table), Some(Address), Some(Divisor), Some(Unit), Some(Type), None],
        );
        check(
            "Reg. address;Function;Unit;Type\n1;Tank level;1;Analog\n",
            &[Some(Address), Some(Name), Some(Device), Some(Type)],
        );
        check("Register;Gain;Quantity\n1;10;2\n", &[Some(Address), Some(Divisor), Some(Length)]);
        check("Register;Gain;Offset\n1;0.1;-5\n", &[Some(Address), Some(Scale), Some(Offset)]);
        check(
            "Registeradresse;Bezeichnung;Datentyp;Einheit;Skalierung\n1;Vorlauf;INT16;°C;0,1\n",
            &[Some(Address), Some(Name), Some(Type), Some(Unit), Some(Scale)],
        );
        check("Adresse;Name;Typ;Faktor\n1;a;int;0,1\n", &[Some(Address), Some(Name), Some(Type), Some(Scale)]);
        check("Address;Bit;Name\n1;0;a\n1;15;b\n", &[Some(Address), Some(Field), Some(Name)]);
        check(
            "Address;Bits;Name;Signed\n1;16;a;yes\n3;32;b;no\n",
            &[Some(Address), Some(Width), Some(Name), Some(Signed)],
        );
        check("Address;Name\n0A;a\n1F;b\n10;c\n", &[Some(HexAddress), Some(Name)]);
    }
}
