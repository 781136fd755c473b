//! What the columns of a list mean: by their heading, if what stands in them agrees, else by what stands in them.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    address_forms,
    cells::Cells,
    headings::{self, Heading},
    heat_pump,
    meanings::{are_codes, is_blank, meaning},
    neighbours::Neighbours,
    questions::{self, Question},
    register_names,
};
pub use super::{
    headings::{Column, is_heading},
    span::{first_of, is_address, span_of},
};
use crate::plant::{address::AddressBase, tag::Table};

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
    /// The column of the last addresses of spans, whose first are those of the surest column.
    pub last: Option<usize>,
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

impl Columns {
    /// The table of a list of ioBroker: only registers have types, and only what may be written is polled.
    pub fn table_of_iobroker(&self) -> Option<Table> {
        let has = |word: &str| self.headings.iter().any(|heading| heading == word);
        self.is_iobroker.then(|| match (has("type"), has("poll") || has("wp")) {
            (true, true) => Table::Holding,
            (true, false) => Table::Input,
            (false, true) => Table::Coil,
            (false, false) => Table::Discrete,
        })
    }

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
        let mut last = None;
        if !is_own && !is_iobroker && !is_of_manager {
            last = Neighbours { means: &mut means, headings: &headings, rows }.settle();
        }
        let said: Vec<Option<Option<Column>>> = headings.iter().map(|heading| said_of(said, heading)).collect();
        means.iter_mut().zip(&said).for_each(|(means, said)| *means = said.unwrap_or(*means));
        let last = last.filter(|n| said[*n].is_none());
        let is_of_areas =
            |n: &usize| means[*n] == Some(Column::Address) && cells[*n].iter().any(|cell| is_in_area(cell));
        let areas = (0..means.len()).filter(is_of_areas).collect();
        let is_of_names = |n: &usize| means[*n] == Some(Column::Address) && register_names::are(&cells[*n]);
        let names = (0..means.len()).filter(is_of_names).collect();
        let is_of_codes = |n: &usize| means[*n] == Some(Column::Type) && are_codes(&headings[*n], &cells[*n]);
        let codes = (0..means.len()).filter(is_of_codes).collect();
        let is_sure = is_own || is_iobroker;
        let open = Vec::new();
        let mut columns =
            Columns { headings, means, open, last, areas, names, codes, is_sure, is_iobroker, is_of_manager };
        if !columns.is_sure {
            columns.open = questions::of(&mut columns.means, &columns.headings, (rows, &cells), |n| said[n].is_some());
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
            let is_sent = heading.is_hex() || heading.has(&["pdu", "protocol", "wire"]);
            if heading.is_decimal() && !heading.is_strong_address() {
                return 3;
            }
            [is_sent, heading.has(&["address", "addr", "addr.", "adresse"])].iter().position(|is| *is).unwrap_or(2)
        };
        places.sort_by_key(rank);
        places
    }

    /// The table that a cell of a column of addresses names.
    pub fn table_of_address(&self, place: usize, cell: &str) -> Option<Table> {
        register_names::number_of(cell).filter(|_| self.names.contains(&place))?.1
    }

    /// The types of a row.
    pub fn types<'a>(&self, row: &'a Cells) -> Vec<&'a str> {
        self.places(Column::Type).into_iter().filter_map(|place| self.type_at(place, row)).collect()
    }

    /// The type in a column, as written or as its code means it.
    pub fn type_at<'a>(&self, place: usize, row: &'a Cells) -> Option<&'a str> {
        let cell = row.cells.get(place)?.as_str();
        let code = Some(cell).filter(|_| self.codes.contains(&place)).and_then(heat_pump::type_of_code);
        Some(code.unwrap_or(cell)).filter(|cell| !is_blank(cell))
    }

    /// The cell of a column of addresses, and how it counts where its heading says that.
    pub fn address(&self, place: usize, cell: &str) -> (String, Option<AddressBase>) {
        let base = self.headings.get(place).and_then(|heading| Heading::new(heading).base());
        if let Some((digits, _)) = register_names::number_of(cell).filter(|_| self.names.contains(&place)) {
            return (digits.to_owned(), base);
        }
        if self.means[place] == Some(Column::HexAddress) {
            return (marked_hex(&address_forms::plain(cell)), base);
        }
        let of_coil = cell
            .strip_prefix(['0'])
            .and_then(|rest| rest.strip_prefix(['x', 'X'])?.parse::<u16>().ok()?.checked_sub(1));
        match of_coil.filter(|_| self.areas.contains(&place)) {
            Some(address) => (format!("coil:{address}"), base),
            None => (address_forms::plain(cell).into_owned(), base),
        }
    }
}

/// Digits that are hexadecimal, with the mark of these; `40001` is too long for a register, and no decimal number here.
fn marked_hex(cell: &str) -> String {
    let marked = |digits: &str| match digits.bytes().all(|byte| byte.is_ascii_hexdigit()) && !digits.is_empty() {
        true => format!("0x{digits}"),
        false => digits.to_owned(),
    };
    match cell.split_once(['-', '–', '…']) {
        Some((first, last)) => format!("{}-{}", marked(first.trim()), marked(last.trim())),
        None => marked(cell),
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
    cells.filter(|cell| !is_blank(cell)).collect()
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
        check("Register;Gain;Quantity\n1;10;2\n", &[Some(Address), None, Some(Length)]);
        check("Register;Factor;Offset\n1;0.1;-5\n", &[Some(Address), Some(Scale), Some(Offset)]);
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
