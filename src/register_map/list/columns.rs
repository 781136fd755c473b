//! What the columns of a list mean: by their heading, if what stands in them agrees, else by what stands in them.

use std::collections::BTreeMap;

use super::{
    cells::Cells,
    words::{bad_of, field_of, is_sized_type, kind_of, labels_of, number_of, table_of, type_of},
};
use crate::plant::{
    address::{AddressBase, AddressContext},
    tag::Table,
};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    /// Of the first register.
    Address,
    /// What it is called.
    Name,
    /// Type of the raw value.
    Type,
    /// Registers.
    Length,
    /// It multiplies.
    Scale,
    /// It divides.
    Divisor,
    /// Of ten.
    Exponent,
    /// Added after scaling.
    Offset,
    /// `°C`.
    Unit,
    /// One of the four.
    Table,
    /// Of bytes and words.
    Order,
    /// Unit address.
    Device,
    /// More than a scale and an offset.
    Formula,
    /// `r`, `rw`, `w`.
    Access,
    /// Least value that may be written.
    Min,
    /// The greatest.
    Max,
    /// Decimals to show.
    Decimals,
    /// `0=off; 1=on`: names of numbers.
    Labels,
    /// The same of bits.
    Bits,
    /// `5-4`, `3`: bits of a register.
    Field,
    /// Raw numbers that mean "no value".
    Bad,
    /// What it belongs to.
    Group,
}

impl Column {
    /// In the order in which a key offers them.
    pub const ALL: [Column; 22] = [
        Column::Address,
        Column::Name,
        Column::Type,
        Column::Length,
        Column::Scale,
        Column::Divisor,
        Column::Exponent,
        Column::Offset,
        Column::Unit,
        Column::Table,
        Column::Order,
        Column::Device,
        Column::Formula,
        Column::Access,
        Column::Min,
        Column::Max,
        Column::Decimals,
        Column::Labels,
        Column::Bits,
        Column::Field,
        Column::Bad,
        Column::Group,
    ];

    /// On the screen.
    pub fn label(self) -> &'static str {
        match self {
            Column::Address => "address",
            Column::Name => "name",
            Column::Type => "type",
            Column::Length => "registers",
            Column::Scale => "factor",
            Column::Divisor => "divisor",
            Column::Exponent => "power of ten",
            Column::Offset => "offset",
            Column::Unit => "unit",
            Column::Table => "table",
            Column::Order => "byte order",
            Column::Device => "unit address",
            Column::Formula => "formula",
            Column::Access => "access",
            Column::Min => "least",
            Column::Max => "greatest",
            Column::Decimals => "decimals",
            Column::Labels => "names of numbers",
            Column::Bits => "names of bits",
            Column::Field => "bits",
            Column::Bad => "no value",
            Column::Group => "group",
        }
    }
}

/// Words of headings, in small letters. Of several columns that a heading can be, the first that fits what is in it counts.
#[rustfmt::skip]
const HEADINGS: [(Column, &[&str]); 13] = [
    (Column::Divisor, &["divisor", "divide", "divider", "division", "div"]),
    (Column::Exponent, &["sf", "exponent"]),
    (Column::Scale, &["scale", "scaling", "factor", "multiplier", "multiply", "gain", "resolution", "coefficient", "sf"]),
    (Column::Order, &["order", "endian", "endianness", "swap"]),
    (Column::Device, &["deviceid", "slave", "slaveid", "station", "unit"]),
    (Column::Unit, &["unit", "units", "uom", "dimension"]),
    (Column::Type, &["type", "format", "datatype", "encoding", "size"]),
    (Column::Table, &["table", "function", "area", "fc", "type"]),
    (Column::Length, &["len", "length", "size", "count", "quantity", "qty", "words", "registers"]),
    (Column::Formula, &["formula", "expression"]),
    (Column::Offset, &["offset"]),
    (Column::Address, &["address", "addr", "addr.", "register", "reg", "reg.", "modicon", "pdu", "wire", "hex", "dec"]),
    (Column::Name, &["name", "title", "parameter", "description", "tag", "label", "signal", "variable", "meaning", "point", "function"]),
];
/// Headings that are this word and no more: as the export writes them.
const EXACT: [(Column, &str); 9] = [
    (Column::Access, "access"),
    (Column::Min, "min"),
    (Column::Max, "max"),
    (Column::Decimals, "decimals"),
    (Column::Labels, "enum"),
    (Column::Bits, "bits"),
    (Column::Field, "field"),
    (Column::Bad, "bad if"),
    (Column::Group, "group"),
];
/// A heading with one of these alone is no column of addresses: tables of codes have them too.
const WEAK: [&str; 2] = ["hex", "dec"];

/// The columns of some rows below one heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// As they are called.
    pub headings: Vec<String>,
    /// What each means; `None`: nothing that is taken.
    pub means: Vec<Option<Column>>,
    /// The list says itself that its factors multiply.
    pub is_sure: bool,
}

/// Words of a heading in small letters.
fn words(heading: &str) -> Vec<String> {
    let heading = heading.to_lowercase();
    heading
        .split(|c: char| !c.is_alphanumeric() && c != '.')
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn candidates(heading: &str) -> Vec<Column> {
    let words = words(heading);
    let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    HEADINGS.iter().filter(|(_, known)| has(known)).map(|(column, _)| *column).collect()
}

/// Is it a heading: with an address and one more, and no number?
pub fn is_heading(cells: &[String]) -> bool {
    let all: Vec<Vec<Column>> = cells.iter().map(|cell| candidates(cell)).collect();
    let known = all.iter().filter(|columns| !columns.is_empty()).count();
    let is_strong = |cell: &String| {
        let words = words(cell);
        let is_weak =
            words.iter().all(|word| !HEADINGS[11].1.contains(&word.as_str()) || WEAK.contains(&word.as_str()));
        candidates(cell).contains(&Column::Address) && !is_weak
    };
    cells.iter().any(is_strong) && 2 <= known && !cells.iter().any(|cell| is_address(cell))
}

/// Is it an address in any reading?
pub fn is_address(cell: &str) -> bool {
    let any = AddressContext { table: Table::Holding, is_stated: false, base: AddressBase::Modicon };
    any.parse(first_of(cell)).is_some()
}

/// A cell as an address: below `hex` digits are hexadecimal, with or without a mark.
pub fn address_in(heading: &str, cell: &str) -> String {
    let words = words(heading);
    let has = |word: &str| words.iter().any(|one| one == word);
    let is_bare = !cell.is_empty() && cell.bytes().all(|byte| byte.is_ascii_hexdigit());
    if has("hex") && !has("dec") && is_bare { format!("0x{cell}") } else { cell.to_owned() }
}

/// Of `41003-41004` the first.
pub fn first_of(cell: &str) -> &str {
    let parts: Vec<&str> = cell.split(['-', '–', '…']).map(str::trim).collect();
    match parts.as_slice() {
        // Of two numbers; a date is no address.
        [first, last] if last.starts_with(|sign: char| sign.is_ascii_digit()) => first,
        _ => cell.trim(),
    }
}

impl Columns {
    /// What the columns of a heading mean, by what stands in the rows below it.
    pub fn new(heading: &[String], rows: &[Cells]) -> Columns {
        let is_iobroker = heading.first().is_some_and(|cell| cell == "_address");
        let mut means: Vec<Option<Column>> = Vec::new();
        for (n, heading) in heading.iter().enumerate() {
            let cells: Vec<&str> = rows.iter().filter_map(|row| row.cells.get(n)).map(String::as_str).collect();
            let cells: Vec<&str> = cells.into_iter().filter(|cell| !matches!(*cell, "" | "-" | "–")).collect();
            means.push(meaning(heading, &cells));
        }
        Columns { headings: heading.to_vec(), means, is_sure: is_iobroker }
    }

    /// The places of the columns of a meaning; those of an address with the surest first.
    pub fn places(&self, column: Column) -> Vec<usize> {
        let mut places: Vec<usize> = (0..self.means.len()).filter(|n| self.means[*n] == Some(column)).collect();
        let rank = |n: &usize| {
            let words = words(&self.headings[*n]);
            let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
            if column == Column::Name {
                return usize::from(has(&["description", "meaning"]));
            }
            let is_sent = has(&["pdu", "protocol", "wire", "hex"]);
            [is_sent, has(&["address", "addr", "addr."])].iter().position(|is| *is).unwrap_or(2)
        };
        places.sort_by_key(rank);
        places
    }
}

impl Columns {
    /// Whole numbers around 0 as factors are powers of ten as well, unless the list or its reader says which.
    pub fn undecided_factor(&self, rows: &[Cells], said: &BTreeMap<usize, Option<Column>>) -> bool {
        let is_open = |place: &usize| !self.is_sure && !said.contains_key(place);
        self.places(Column::Scale).iter().filter(|place| is_open(place)).any(|place| {
            let cells = rows.iter().filter_map(|row| row.cells.get(*place)).filter(|cell| !cell.is_empty());
            let numbers: Option<Vec<i8>> = cells.map(|cell| cell.parse().ok()).collect();
            numbers.is_some_and(|numbers| numbers.iter().any(|number| *number <= 0))
        })
    }
}

/// What a column means: of what its heading can be, the first that what is in it can be too.
fn meaning(heading: &str, cells: &[&str]) -> Option<Column> {
    let share = |fits: &dyn Fn(&str) -> bool| {
        let count = cells.iter().filter(|cell| fits(cell)).count();
        if cells.is_empty() { 100 } else { 100 * count / cells.len() }
    };
    // A type with its size stands in no other column, whatever that is called.
    if !cells.is_empty() && 80 <= share(&is_sized_type) {
        return Some(Column::Type);
    }
    let exact = EXACT.iter().find(|(_, word)| heading.trim().eq_ignore_ascii_case(word)).map(|(column, _)| *column);
    let is_number = |cell: &str| number_of(cell).is_some();
    let fits_exactly = match exact {
        Some(Column::Access) => 100 == share(&|cell| matches!(cell, "r" | "rw" | "w")),
        Some(Column::Min | Column::Max | Column::Decimals) => 100 == share(&is_number),
        Some(Column::Labels | Column::Bits) => 100 == share(&|cell| labels_of(cell).is_some()),
        Some(Column::Field) => 100 == share(&|cell| field_of(cell).is_some()),
        Some(Column::Bad) => 100 == share(&|cell| bad_of(cell).is_some()),
        Some(_) => true,
        None => false,
    };
    if fits_exactly {
        return exact;
    }
    let is_whole = |cell: &str| cell.parse::<u32>().is_ok();
    let fits = |column: Column| match column {
        Column::Address => 40 <= share(&|cell| is_address(&address_in(heading, cell))),
        Column::Type => {
            1 <= share(&|cell| kind_of(cell).is_some() || type_of(cell, Some(1)).is_ok() || is_sized_type(cell))
        }
        Column::Table => 60 <= share(&|cell| table_of(cell).is_some()),
        Column::Device => 80 <= share(&|cell| cell.parse::<u8>().is_ok()) && !cells.is_empty(),
        Column::Length => 60 <= share(&is_whole),
        Column::Offset => 60 <= share(&|cell| number_of(cell).is_some()) && !is_rising(cells),
        Column::Exponent => 60 <= share(&|cell| cell.parse::<i8>().is_ok_and(|number| (-10..=10).contains(&number))),
        Column::Name => true,
        Column::Scale | Column::Divisor | Column::Unit | Column::Order | Column::Formula => true,
        Column::Access
        | Column::Min
        | Column::Max
        | Column::Decimals
        | Column::Labels
        | Column::Bits
        | Column::Field
        | Column::Bad
        | Column::Group => false,
    };
    let candidates = candidates(heading);
    if let Some(column) = candidates.iter().copied().find(|column| fits(*column)) {
        // What is more than 1 as a gain is what a maker has multiplied by.
        let is_gain = column == Column::Scale && words(heading).iter().any(|word| word == "gain");
        let is_above = !cells.is_empty() && 100 == share(&|cell| number_of(cell).is_some_and(|number| 1.0 <= number));
        return Some(if is_gain && is_above { Column::Divisor } else { column });
    }
    // A column of types that are all unknown says so row by row; without it each would be taken for a whole number.
    candidates.into_iter().find(|column| *column == Column::Type && words(heading).iter().any(|word| word != "size"))
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
        let rows = super::super::cells::rows(text, Some(';'));
        let (heading, rows) = rows.split_first().expect("a heading");
        assert!(is_heading(&heading.cells), "{text}");
        assert_eq!(Columns::new(&heading.cells, rows).means, expect, "{text}");
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
    }
}
