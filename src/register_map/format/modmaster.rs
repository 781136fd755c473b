//! The CSV that Wingpath's ModMaster and Modsak export. Its scales are not those of a manual: read as such a list they would
//! give wrong values.

use crate::{
    plant::{
        address::AddressContext,
        tag::{ByteOrder, DataType, Table},
    },
    profile::unit_of,
    register_map::{
        list::{self, List, ListContext, words},
        named::{Named, decimals_of},
    },
    t,
};

/// Is it such a file?
pub fn is_one(text: &str) -> bool {
    let head = text.lines().next().unwrap_or_default();
    ["Address", "Name", "Type", "Radix", "Offset", "Scale"].iter().all(|column| head.contains(column))
}

/// "Export Registers" of ModMaster and Modsak: their displayed value is (raw + offset) / scale.
pub fn read(text: &str, context: &ListContext) -> List {
    let mut reader = csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(text.as_bytes());
    // A text in memory is read to its end.
    let mut records = reader.records().filter_map(Result::ok);
    let columns = records.next().unwrap_or_default();
    let cell = |record: &csv::StringRecord, name: &str| {
        let at = columns.iter().position(|column| column.trim() == name);
        at.and_then(|at| record.get(at)).unwrap_or_default().trim().to_owned()
    };
    let rows: Vec<csv::StringRecord> = records.collect();
    let written: Vec<String> = rows.iter().map(|row| cell(row, "Address")).collect();
    let written: Vec<(&str, Option<Table>)> = written.iter().map(|text| (text.as_str(), None)).collect();
    let (base, unclear) = list::base_of(&written, context);
    let mut list = List { unclear, ..List::default() };
    for row in &rows {
        let place = t!("line {number}", number = row.position().map_or(0, csv::Position::line));
        let of = AddressContext { table: context.table, is_stated: context.is_table_stated, base };
        list.push(&place, exported(|name| cell(row, name), of));
    }
    list
}

fn exported(cell: impl Fn(&str) -> String, of: AddressContext) -> Result<Named, String> {
    let (written, name, word) = (cell("Address"), cell("Name"), cell("Type"));
    // A discrete value stands in a table of bits.
    let table = if word == "int1" && !of.table.is_bits() { Table::Coil } else { of.table };
    let found = AddressContext { table, ..of }.parse(&written);
    let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
    if name.is_empty() {
        return Err(t!("{written}: no name", written));
    }
    let kind = if word == "int1" { Some(DataType::Bool) } else { words::kind_of(&word) };
    // Its 8-bit types are those of devices whose registers have 8 bits.
    let kind = kind.filter(|kind| table.is_bits() == (*kind == DataType::Bool) && !kind.is_half());
    let kind = kind.ok_or_else(|| t!("{written}: `{word}` is not a known type", written, word))?;
    let number = |name: &str, usual: f64| {
        let text = cell(name);
        let number = if text.is_empty() { Ok(usual) } else { text.parse::<f64>() };
        number
            .ok()
            .filter(|number| number.is_finite())
            .ok_or_else(|| t!("{written}: `{text}` is not a scale", written, text))
    };
    let (offset, divisor) = (number("Offset", 0.0)?, number("Scale", 1.0)?);
    if divisor == 0.0 {
        return Err(t!("{written}: `{text}` is not a scale", written, text = cell("Scale")));
    }
    let (scale, unit) = (1.0 / divisor, unit_of(&cell("Unit")));
    let decimals = decimals_of(scale, kind);
    let order = ByteOrder::Abcd;
    Ok(Named { scale, offset: offset / divisor, decimals, unit, ..Named::new(table, address, kind, order, &name) })
}
