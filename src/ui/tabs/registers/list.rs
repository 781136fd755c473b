//! A register list from a manual becomes names: CSV, or columns as they are copied from a PDF, recognised by their heading
//! or, without one, by their form.

use super::names::Named;
use crate::{
    plant::{
        live::of_modicon,
        tag::{ByteOrder, DataType, Table},
    },
    profile::unit_of,
    t,
};

/// Most lines of a list.
const LINES_MAX: usize = 10_000;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Address,
    Name,
    Type,
    Scale,
    Divisor,
    Unit,
    Table,
    Order,
}

/// Words of headings, in small letters; the first that stands in a cell counts.
#[rustfmt::skip]
const HEADINGS: [(Column, &[&str]); 8] = [
    (Column::Divisor, &["divisor", "divide"]),
    (Column::Scale, &["scale", "scaling", "factor", "multiplier", "gain", "resolution"]),
    (Column::Order, &["order", "endian", "swap"]),
    (Column::Unit, &["unit", "units", "uom", "dimension"]),
    (Column::Type, &["type", "format", "datatype"]),
    (Column::Table, &["table", "function", "area", "fc"]),
    (Column::Address, &["address", "addr", "addr.", "register", "reg", "reg.", "modicon", "hex"]),
    (Column::Name, &["name", "parameter", "description", "tag", "label", "signal", "variable", "meaning"]),
];

/// What was read of a list, and what was not, by line.
#[derive(Debug, Default, PartialEq)]
pub struct List {
    /// In the order of the list.
    pub named: Vec<Named>,
    /// `line 7: no address`.
    pub problems: Vec<String>,
}

/// Reads a list. A plain number is an address of `table`; `first` is 1 where numbers count from 1.
pub fn parse(text: &str, table: Table, first: u16) -> List {
    let mut list = List::default();
    let mut heading: Option<Vec<Option<Column>>> = None;
    for (n, line) in text.lines().enumerate().take(LINES_MAX) {
        let cells = cells(line);
        if cells.iter().all(|cell| cell.is_empty()) || line.trim_start().starts_with('#') {
            continue;
        }
        if let Some(columns) = columns(&cells) {
            heading = Some(columns);
            continue;
        }
        let row = match &heading {
            // A line with other columns than the heading is taken by its form.
            Some(columns) if columns.len() == cells.len() => headed(columns, &cells),
            Some(_) | None => by_form(&cells),
        };
        let named = row.named(table, first).and_then(|named| {
            let taken = list.named.iter().any(|old| (old.table, old.address) == (named.table, named.address));
            if taken { Err(t!("{name}: this address has a name already", name = named.name)) } else { Ok(named) }
        });
        match named {
            Ok(named) => list.named.push(named),
            Err(why) => list.problems.push(t!("line {number}: {why}", number = n + 1, why)),
        }
    }
    list
}

/// The cells of a line: at tabs, else semicolons, else commas, else two blanks, else every blank.
fn cells(line: &str) -> Vec<String> {
    let line = line.trim_matches(['\u{FEFF}', '\r']);
    let separator = ['\t', ';', ','].into_iter().find(|separator| line.contains(*separator));
    let decimal_comma = separator == Some(',') && line.matches(',').count() == 1;
    match separator.filter(|_| !decimal_comma) {
        Some(separator) => quoted_cells(line, separator),
        None if line.trim().contains("  ") => {
            line.split("  ").map(|cell| cell.trim().to_owned()).filter(|cell| !cell.is_empty()).collect()
        }
        None => line.split_whitespace().map(str::to_owned).collect(),
    }
}

fn quoted_cells(line: &str, separator: char) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).delimiter(u8::try_from(separator).unwrap_or(b',')).trim(csv::Trim::All);
    let record = reader.from_reader(line.as_bytes()).into_records().next();
    // A line of text in memory is a record.
    record.and_then(Result::ok).map_or(Vec::new(), |cells| cells.iter().map(str::to_owned).collect())
}

/// The columns of a heading: at least an address and one more, and no number.
fn columns(cells: &[String]) -> Option<Vec<Option<Column>>> {
    let of = |cell: &String| {
        let cell = cell.to_lowercase();
        let words: Vec<&str> = cell.split([' ', '_', '(', ')', '/']).collect();
        HEADINGS.iter().find(|(_, known)| known.iter().any(|known| words.contains(known))).map(|(column, _)| *column)
    };
    let columns: Vec<Option<Column>> = cells.iter().map(of).collect();
    let known = columns.iter().flatten().count();
    let numbers = cells.iter().any(|cell| address_of(cell, Table::Holding, 0).is_some());
    (columns.contains(&Some(Column::Address)) && 2 <= known && !numbers).then_some(columns)
}

/// The cells of a row by what they hold.
#[derive(Debug, Default)]
struct Row {
    address: Option<String>,
    name: String,
    kind: Option<String>,
    scale: Option<f64>,
    wrong_scale: Option<String>,
    unit: String,
    table: Option<Table>,
    order: ByteOrder,
}

fn headed(columns: &[Option<Column>], cells: &[String]) -> Row {
    let mut row = Row::default();
    for (column, cell) in columns.iter().zip(cells).filter(|(_, cell)| !cell.is_empty()) {
        match column {
            // Of two addresses (register and hex) the first that can be read counts.
            Some(Column::Address) if row.address.is_none() => row.address = Some(cell.clone()),
            Some(Column::Name) if row.name.is_empty() => row.name.clone_from(cell),
            Some(Column::Type) => row.kind = Some(cell.clone()),
            Some(Column::Scale | Column::Divisor) => {
                let factor = number_of(cell).filter(|number| *number != 0.0);
                row.scale = if *column == Some(Column::Divisor) { factor.map(|by| 1.0 / by) } else { factor };
                row.wrong_scale = factor.is_none().then(|| cell.clone()).filter(|cell| cell != "-");
            }
            Some(Column::Unit) => row.unit.clone_from(cell),
            Some(Column::Table) => row.table = table_of(cell),
            Some(Column::Order) => row.order = order_of(cell).unwrap_or_default(),
            Some(Column::Address | Column::Name) | None => {}
        }
    }
    row
}

/// Without a heading: an address, a type, a unit, a scale and an order are known by their form; the rest is the name.
fn by_form(cells: &[String]) -> Row {
    let mut row = Row::default();
    let is_address = |cell: &&String| address_of(cell, Table::Holding, 0).is_some();
    // A Modicon number or hexadecimal is one anywhere; a plain number, which may be a page or count the rows, only in front.
    let sure = cells.iter().find(|cell| is_address(cell) && (of_modicon(cell).is_some() || !plain(cell)));
    row.address = sure.or_else(|| cells.first().filter(is_address)).cloned();
    let mut words: Vec<&str> = Vec::new();
    let counts = |n: usize, cell: &String| n == 0 && plain(cell);
    let rest = cells.iter().enumerate().filter(|(n, cell)| !cell.is_empty() && !counts(*n, cell)).map(|(_, cell)| cell);
    let rest = rest.filter(|cell| Some(*cell) != row.address.as_ref());
    for cell in rest.cloned().collect::<Vec<_>>().iter() {
        if row.kind.is_none() && kind_of(cell).is_some() {
            row.kind = Some(cell.clone());
        } else if let Some(order) = order_of(cell) {
            row.order = order;
        } else if let (None, Some(table)) = (row.table, table_of(cell).filter(|_| number_of(cell).is_none())) {
            row.table = Some(table);
        } else if let (None, Some(factor)) = (row.scale, number_of(cell).filter(|number| *number != 0.0)) {
            row.scale = Some(factor);
        } else if row.unit.is_empty() && unit_of(cell).is_some() && !cell.is_empty() {
            row.unit.clone_from(cell);
        } else if let Some(known) = cells.iter().find(|known| *known == cell) {
            words.push(known);
        }
    }
    row.name = words.join(" ");
    row
}

impl Row {
    fn named(self, table: Table, first: u16) -> Result<Named, String> {
        let Some(written) = self.address else { return Err(t!("no address").to_owned()) };
        let found = address_of(&written, self.table.unwrap_or(table), first);
        let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
        if self.name.is_empty() {
            return Err(t!("{written}: no name", written));
        }
        if let Some(wrong) = self.wrong_scale {
            return Err(t!("{written}: `{wrong}` is not a scale", written, wrong));
        }
        let kind = match self.kind {
            _ if table.is_bits() => DataType::Bool,
            None => DataType::U16,
            Some(word) => kind_of(&word).ok_or_else(|| t!("{written}: `{word}` is not a known type", written, word))?,
        };
        let scale = self.scale.unwrap_or(1.0);
        let decimals = decimals_of(scale, kind);
        let unit = unit_of(&self.unit).map_or(self.unit, str::to_owned);
        Ok(Named { scale, decimals, unit, ..Named::new(table, address, kind, self.order, &self.name) })
    }
}

/// Decimals that show what a scale leaves of a raw number.
pub fn decimals_of(scale: f64, kind: DataType) -> u8 {
    let fraction = format!("{scale}").split_once('.').map_or(0, |(_, digits)| digits.len().min(6));
    let float = matches!(kind, DataType::F32 | DataType::F64);
    u8::try_from(if float { fraction.max(2) } else { fraction }).unwrap_or(0)
}

fn plain(text: &str) -> bool {
    text.chars().all(|c| c.is_ascii_digit())
}

/// `41003`, `0x3EA`, `03EAH`, `1002`; of `41003-41004` the first.
pub fn address_of(text: &str, table: Table, first: u16) -> Option<(Table, u16)> {
    let text = text.split(['-', '–', '…']).next()?.trim();
    let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let hex =
        hex.or_else(|| text.strip_suffix(['h', 'H']).filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())));
    match hex {
        Some(hex) => u16::from_str_radix(hex, 16).ok().map(|address| (table, address)),
        None if !plain(text) || text.is_empty() => None,
        None => {
            of_modicon(text).or_else(|| text.parse::<u16>().ok()?.checked_sub(first).map(|address| (table, address)))
        }
    }
}

/// `0.1`, `0,1`, `x0.1`, `/10`, `÷10`, `1/10`.
fn number_of(text: &str) -> Option<f64> {
    let text = text.trim().replace(',', ".");
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    if let Some((one, by)) = text.split_once(['/', '÷', ':']) {
        let one = if one.trim().is_empty() { 1.0 } else { number(one)? };
        return number(by).filter(|by| *by != 0.0).map(|by| one / by);
    }
    number(text.trim_start_matches(['x', 'X', '*', '×']))
}

fn table_of(text: &str) -> Option<Table> {
    let text = text.to_lowercase();
    let is = |words: &[&str]| words.iter().any(|word| text.contains(word));
    match text.trim_start_matches("fc").trim().trim_start_matches('0') {
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

pub fn order_of(text: &str) -> Option<ByteOrder> {
    ByteOrder::ALL.into_iter().find(|order| order.word().eq_ignore_ascii_case(text))
}

/// The type that a manual means by a word.
pub fn kind_of(text: &str) -> Option<DataType> {
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
        "bool" | "boolean" | "bit" => DataType::Bool,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Vec<String>, Vec<String>) {
        let list = parse(text, Table::Holding, 0);
        let shown = |named: &Named| {
            let (place, kind, order) = (named.table.modicon(named.address), named.kind.name(), named.order.word());
            format!("{place} {} {kind} {order} {} {} {}", named.name, named.scale, named.decimals, named.unit)
        };
        (list.named.iter().map(shown).collect(), list.problems)
    }

    #[test]
    fn a_csv_with_a_heading_is_read_in_any_order_of_columns() {
        let csv = "Name;Unit;Register Address;Data type;Scaling\n\"SV; wanted\";degC;41003;INT16;0,1\n\nEnergy;kWh;31001;float32;\n";
        let expect = ["41003 SV; wanted int16 ABCD 0.1 1 °C", "31001 Energy float32 ABCD 1 2 kWh"];
        assert_eq!(read(csv), (expect.map(str::to_owned).to_vec(), Vec::new()));
        let fc = "address,name,function code,type,divisor\n0x0010,Speed,04,u16,10\n12,Run,1,,\n";
        assert_eq!(read(fc).0, ["30017 Speed uint16 ABCD 0.1 1 ", "00013 Run bool ABCD 1 0 "]);
    }

    #[test]
    fn columns_of_a_pdf_are_known_by_their_form() {
        let columns = "Modbus map, page 7\n40001   Voltage L1   float  V\n40003   Power factor   int16   0.001\n";
        let (named, problems) = read(columns);
        assert_eq!(named, ["40001 Voltage L1 float32 ABCD 1 2 V", "40003 Power factor int16 ABCD 0.001 3 "]);
        assert_eq!(problems, ["line 1: no address"]);
        assert_eq!(read("1 40010 Tank level UINT16 /10 cm CDAB\n").0, ["40010 Tank level uint16 CDAB 0.1 1 cm"]);
        assert_eq!(
            read("0x03EA SV x0.1 °C\n03EBH STBY\n").0,
            ["41003 SV uint16 ABCD 0.1 1 °C", "41004 STBY uint16 ABCD 1 0 "]
        );
    }

    #[test]
    fn what_cannot_be_read_is_said_by_line() {
        let (named, problems) = read(
            "address,name,type,scale\n5,a,int16,1\n5,b,int16,1\nx,c,int16,1\n6,d,quux,1\n7,,int16,1\n8,e,int16,ten\n",
        );
        assert_eq!(named, ["40006 a int16 ABCD 1 0 "]);
        let expect = [
            "line 3: b: this address has a name already",
            "line 4: `x` is not an address",
            "line 5: 6: `quux` is not a known type",
            "line 6: 7: no name",
            "line 7: 8: `ten` is not a scale",
        ];
        assert_eq!(problems, expect);
    }

    #[test]
    fn a_quoted_cell_keeps_its_separators_and_quotes() {
        assert_eq!(quoted_cells("5,\"a, \"\"b\"\"\",10\" pipe,", ','), ["5", "a, \"b\"", "10\" pipe", ""]);
    }

    #[test]
    fn plain_numbers_count_from_one_where_the_manual_does() {
        let list = parse("1  first\n0  none\n", Table::Input, 1);
        assert_eq!((list.named[0].table, list.named[0].address, list.named.len()), (Table::Input, 0, 1));
        assert_eq!(list.problems, ["line 2: `0` is not an address"]);
    }
}
