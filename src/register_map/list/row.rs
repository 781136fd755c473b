//! The cells of a row by what they hold, and what becomes of them.

use super::{
    cells::Cells,
    columns::{Column, Columns, address_in, first_of, is_address},
    words::{bad_of, field_of, kind_of, labels_of, number_of, order_of, power_of_ten, table_of, type_of},
};
use crate::{
    plant::{
        address::{AddressBase, AddressContext, of_modicon},
        keyword::Keyword,
        tag::{Access, ByteOrder, DataType, Table},
    },
    profile::{is_known_unit, unit_of},
    register_map::named::{Named, decimals_of},
    t,
};

/// The cells of a row by what they hold.
#[derive(Debug, Default)]
pub struct Row {
    /// Number of its line.
    pub line: usize,
    /// As written.
    pub address: Option<String>,
    name: String,
    kind: Option<String>,
    length: Option<u16>,
    scale: Option<f64>,
    offset: f64,
    unit: String,
    /// As the row states it.
    pub table: Option<Table>,
    order: Option<ByteOrder>,
    /// Unit address, as the row states it.
    pub device: Option<u8>,
    more: More,
    /// Why it cannot be taken, whatever else it says.
    wrong: Option<String>,
}

/// What few lists say.
#[derive(Debug, Default)]
struct More {
    access: Option<Access>,
    min: Option<f64>,
    max: Option<f64>,
    decimals: Option<u8>,
    labels: Vec<(i128, String)>,
    bits: Vec<(i128, String)>,
    field: Option<(u8, u8)>,
    bad: Vec<i128>,
    group: String,
}

/// What a list does not say itself.
#[derive(Debug, Clone, Copy)]
pub struct Assumed {
    /// Table of a plain number.
    pub table: Table,
    /// It is said so.
    pub is_stated: bool,
    /// How one counts.
    pub base: AddressBase,
    /// Order of what takes several registers.
    pub order: ByteOrder,
}

impl Row {
    /// Nothing of it is known but its line.
    pub fn without_cells(line: usize) -> Row {
        Row { line, ..Row::default() }
    }

    /// Below a heading.
    pub fn headed(columns: &Columns, row: &Cells) -> Row {
        let mut read = Row { line: row.line, ..Row::default() };
        if row.is_unclosed {
            return Row { wrong: Some(t!("a quote is never closed").to_owned()), ..read };
        }
        if row.cells.iter().skip(columns.headings.len()).any(|cell| !cell.is_empty()) {
            let (found, expected) = (row.cells.len(), columns.headings.len());
            return Row { wrong: Some(t!("{found} cells, the heading has {expected}", found, expected)), ..read };
        }
        let cells = |column: Column| {
            let places = columns.places(column).into_iter();
            places.filter_map(|place| row.cells.get(place)).filter(|cell| !cell.is_empty())
        };
        let cell = |column: Column| cells(column).find(|cell| !matches!(cell.as_str(), "-" | "–"));
        // Of two addresses the surest that can be read counts.
        let written = columns.places(Column::Address).into_iter().filter_map(|place| {
            let cell = row.cells.get(place).filter(|cell| !cell.is_empty())?;
            Some(address_in(columns.headings.get(place)?, cell))
        });
        let written: Vec<String> = written.collect();
        read.address = written.iter().find(|cell| is_address(cell)).or(written.first()).cloned();
        read.name = cell(Column::Name).cloned().unwrap_or_default();
        read.kind = cell(Column::Type).cloned();
        read.length = cell(Column::Length).and_then(|cell| cell.parse().ok());
        read.unit = cell(Column::Unit).cloned().unwrap_or_default();
        read.table = cell(Column::Table).and_then(|cell| table_of(cell));
        read.device = cell(Column::Device).and_then(|cell| cell.parse().ok());
        read.order = cell(Column::Order).and_then(|cell| order_of(cell));
        let problems = [
            cell(Column::Order).filter(|_| read.order.is_none()).map(|order| t!("`{order}` is no byte order", order)),
            cell(Column::Table).filter(|_| read.table.is_none()).map(|table| t!("`{table}` is no table", table)),
            cell(Column::Formula)
                .map(|formula| t!("the formula `{formula}` is more than a factor and an offset", formula)),
            read.factor(cell(Column::Scale), cell(Column::Divisor), cell(Column::Exponent)).err(),
        ];
        match cell(Column::Offset).map(|cell| (number_of(cell), cell)) {
            Some((None, cell)) => read.wrong = Some(t!("`{offset}` is not an offset", offset = cell)),
            Some((Some(offset), _)) => read.offset = offset,
            None => {}
        }
        read.more = More {
            access: cell(Column::Access).and_then(|cell| Access::from_word(cell)),
            min: cell(Column::Min).and_then(|cell| number_of(cell)),
            max: cell(Column::Max).and_then(|cell| number_of(cell)),
            decimals: cell(Column::Decimals).and_then(|cell| cell.parse().ok()),
            labels: cell(Column::Labels).and_then(|cell| labels_of(cell)).unwrap_or_default(),
            bits: cell(Column::Bits).and_then(|cell| labels_of(cell)).unwrap_or_default(),
            field: cell(Column::Field).and_then(|cell| field_of(cell)),
            bad: cell(Column::Bad).and_then(|cell| bad_of(cell)).unwrap_or_default(),
            group: cell(Column::Group).cloned().unwrap_or_default(),
        };
        read.wrong = problems.into_iter().flatten().next().or(read.wrong);
        read
    }

    fn factor(
        &mut self,
        scale: Option<&String>,
        divisor: Option<&String>,
        exponent: Option<&String>,
    ) -> Result<(), String> {
        let wrong = |cell: &String| t!("`{wrong}` is not a scale", wrong = cell);
        let number = |cell: &String| number_of(cell).filter(|number| *number != 0.0).ok_or_else(|| wrong(cell));
        let scale = scale.map(number).transpose()?;
        let divisor = divisor.map(number).transpose()?;
        let exponent = exponent.map(|cell| cell.parse::<i8>().map(f64::from).map_err(|_| wrong(cell))).transpose()?;
        // As a person would write it: 0.1, not the nearest to it.
        let by = divisor.map(|by| 1.0 / by).into_iter().chain(exponent.map(power_of_ten)).chain(scale);
        self.scale = by.reduce(|all, one| all * one);
        Ok(())
    }

    /// Without a heading: an address, a type, a unit, a scale and an order are known by their form; the rest is the name.
    pub fn by_form(line: usize, cells: &[String]) -> Row {
        let mut row = Row { line, ..Row::default() };
        // What is sure is one anywhere; a plain number, which may be a page or count the rows, only in front.
        let is_sure = |cell: &&String| {
            let first = first_of(cell);
            is_address(cell) && (of_modicon(first).is_some() || !is_plain(first))
        };
        let sure = cells.iter().find(is_sure);
        row.address = sure.or_else(|| cells.first().filter(|cell| is_address(cell))).cloned();
        let mut words: Vec<&str> = Vec::new();
        for (n, cell) in cells.iter().enumerate() {
            let counts = n == 0 && is_plain(cell);
            if cell.is_empty() || counts || Some(cell) == row.address.as_ref() {
                continue;
            }
            if row.kind.is_none() && kind_of(cell).is_some() {
                row.kind = Some(cell.clone());
            } else if let (None, Some(order)) = (row.order, order_of(cell)) {
                row.order = Some(order);
            } else if let (None, Some(table)) = (row.table, table_of(cell).filter(|_| number_of(cell).is_none())) {
                row.table = Some(table);
            } else if let (None, Some(factor)) = (row.scale, number_of(cell).filter(|number| *number != 0.0)) {
                row.scale = Some(factor);
            } else if row.unit.is_empty() && is_unit(cell) {
                row.unit.clone_from(cell);
            } else {
                words.push(cell);
            }
        }
        row.name = words.join(" ");
        row
    }

    /// The same without its factor, of which it is not known whether it multiplies or is a power of ten.
    pub fn with_undecided_factor(self) -> Row {
        let why = || t!("is its factor a number or a power of ten?").to_owned();
        let wrong = self.wrong.or_else(|| self.scale.map(|_| why()));
        Row { wrong, ..self }
    }

    /// Table and address, as assumed where the row does not say more.
    fn place(&self, assumed: Assumed) -> Option<(Table, u16)> {
        let table = self.table.unwrap_or(assumed.table);
        let is_stated = self.table.is_some() || assumed.is_stated;
        AddressContext { table, is_stated, base: assumed.base }.parse(first_of(self.address.as_ref()?))
    }

    /// Takes it; else why not.
    pub fn named(&self, assumed: Assumed) -> Result<Named, String> {
        let Some(written) = &self.address else { return Err(t!("no address").to_owned()) };
        let found = self.place(assumed);
        let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
        let because = |why: String| format!("{written}: {why}");
        if self.name.is_empty() {
            return Err(t!("{written}: no name", written));
        }
        if let Some(wrong) = &self.wrong {
            return Err(because(wrong.clone()));
        }
        let (kind, order) = match &self.kind {
            _ if table.is_bits() => (DataType::Bool, None),
            None if self.length.is_some_and(|length| length != 1) => {
                let length = self.length.unwrap_or_default();
                return Err(because(t!("{length} registers, and no type", length)));
            }
            None => (DataType::U16, None),
            Some(word) => type_of(word, self.length).map_err(because)?,
        };
        let order = self.order.or(order).unwrap_or(if kind.is_text() || kind.is_half() {
            ByteOrder::Abcd
        } else {
            assumed.order
        });
        let scale = self.scale.unwrap_or(1.0);
        let (decimals, unit) = (decimals_of(scale, kind), unit_of(&self.unit));
        let named = Named::new(table, address, kind, order, &self.name);
        let decimals = decimals.max(decimals_of(self.offset, DataType::U16));
        Ok(self.with_more(Named { scale, offset: self.offset, decimals, unit, ..named }))
    }

    fn with_more(&self, named: Named) -> Named {
        let more = &self.more;
        let is_writable = matches!(named.table, Table::Holding | Table::Coil) && !named.kind.is_text();
        let access = more.access.filter(|_| is_writable).unwrap_or(named.access);
        let is_written = access != Access::Read;
        let field = more.field.filter(|_| named.kind.is_binary() && !named.table.is_bits());
        let named = Named {
            access,
            min: more.min.filter(|_| is_written),
            max: more.max.filter(|_| is_written),
            decimals: more.decimals.unwrap_or(named.decimals),
            field,
            group: more.group.clone(),
            ..named
        };
        let raw = |number: &i128| named.point().raw_number(*number, false).number();
        let bad_if = more.bad.iter().filter_map(raw).collect();
        let bits = more.bits.iter().filter_map(|(bit, label)| Some((u8::try_from(*bit).ok()?, label.clone())));
        let bit_labels = bits.collect();
        let named = Named { bad_if, bit_labels, ..named };
        if more.labels.is_empty() { named } else { named.labelled(more.labels.clone()) }
    }
}

/// A unit among the words of a name: `m³/h`, `degC`, but neither `in` nor `hours`.
fn is_unit(cell: &str) -> bool {
    let is_word = cell == "in" || cell.bytes().all(|byte| byte.is_ascii_lowercase()) && unit_of(cell) != cell;
    is_known_unit(cell) && !is_word
}

fn is_plain(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}
