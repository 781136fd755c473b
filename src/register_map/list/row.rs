//! The cells of a row by what they hold, and what becomes of them.

use super::{
    cells::{Cells, of_text},
    columns::{Column, Columns, first_of, is_address},
    words::{
        BadNumber, access_of, area, bad_of, bit_field_of, labels_of, length_of, number_of, order_of, poll_of,
        power_of_ten, table_of, type_of, unit_with_factor, width_of, yes_or_no,
    },
};
use crate::{
    plant::{
        address::{AddressBase, AddressContext, in_table, of_modicon},
        tag::{Access, ByteOrder, DataType, Encoding, Poll, Table},
    },
    profile::unit_of,
    register_map::named::{Named, decimals_of},
    t,
    text::translate,
};

/// The cells of a row by what they hold.
#[derive(Debug, Default)]
pub struct Row {
    /// Number of its line.
    pub line: usize,
    /// As written.
    pub address: Option<String>,
    /// How its address counts, as the row states it.
    pub base: Option<AddressBase>,
    pub(super) name: String,
    pub(super) kind: Option<String>,
    /// A column says the types of all rows.
    is_typed: bool,
    signed: Option<bool>,
    length: Option<u16>,
    /// Bits of a number whose type does not say it.
    width: Option<u16>,
    pub(super) scale: Option<f64>,
    offset: f64,
    pub(super) unit: String,
    /// As the row states it.
    pub table: Option<Table>,
    pub(super) order: Option<ByteOrder>,
    /// Unit address, as the row states it.
    pub device: Option<u8>,
    more: More,
    /// Columns that are not used and have something in this row.
    pub unused: Vec<String>,
    /// Why it cannot be taken, whatever else it says.
    pub(super) wrong: Option<String>,
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
    bad: Vec<BadNumber>,
    group: String,
    label: String,
    write_at: Option<(Table, u16)>,
    write_with: Option<u8>,
    poll: Option<Poll>,
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

/// A row that is taken, with what was assumed of it.
pub struct Taken {
    pub named: Named,
    /// Its number is taken as sent, from 0.
    pub is_base_assumed: bool,
    /// Nothing says the order of its registers.
    pub is_order_assumed: bool,
    /// Nothing says its type.
    pub is_type_assumed: bool,
    /// The list says that it is written, but not surely how.
    pub is_write_lost: bool,
}

/// The cells below a heading, by what their columns mean.
struct Reader<'a> {
    columns: &'a Columns,
    row: &'a Cells,
    /// The first reason why the row cannot be taken.
    wrong: Option<String>,
}

impl<'a> Reader<'a> {
    fn cells(&self, column: Column) -> impl Iterator<Item = &'a str> {
        let (places, row) = (self.columns.places(column).into_iter(), self.row);
        let is_sure = self.columns.is_sure;
        let cells = places
            .filter_map(|place| row.cells.get(place))
            .map(move |cell| if is_sure { of_text(cell) } else { cell.as_str() });
        cells.filter(|cell| !matches!(*cell, "" | "-" | "–"))
    }

    fn text(&self, column: Column) -> Option<&'a str> {
        self.cells(column).next()
    }

    /// What a cell holds; one that does not hold it makes the row wrong, as do two that differ.
    fn read<T: PartialEq>(&mut self, column: Column, of: impl Fn(&str) -> Option<T>) -> Option<T> {
        let mut found = None;
        let cells: Vec<&str> = self.cells(column).collect();
        for cell in cells {
            match (of(cell), &found) {
                (None, _) => self.refuse(unfit(column, cell)),
                (Some(value), None) => found = Some((value, cell)),
                (Some(value), Some((first, other))) if value != *first => {
                    self.refuse(t!("`{other}` and `{cell}` differ: which counts?", other, cell));
                }
                (Some(_), Some(_)) => {}
            }
        }
        found.map(|(value, _)| value)
    }

    fn refuse(&mut self, why: String) {
        self.wrong.get_or_insert(why);
    }

    /// The type; of several columns that one in which it is known.
    fn kind(&mut self) -> Option<String> {
        let all: Vec<&str> = self.cells(Column::Type).collect();
        let known = || all.iter().copied().filter(|cell| type_of(cell, None).is_ok());
        if let Some(other) =
            known().find(|cell| type_of(cell, None).ok() != known().next().and_then(|first| type_of(first, None).ok()))
        {
            let first = known().next().unwrap_or_default();
            self.refuse(t!("`{other}` and `{cell}` differ: which counts?", other = first, cell = other));
        }
        known().next().or(all.first().copied()).map(str::to_owned)
    }

    /// The factor of all columns that have one.
    fn factor(&mut self) -> Option<f64> {
        let number = |cell: &str| number_of(cell).filter(|number| *number != 0.0);
        let power = |cell: &str| cell.parse::<i8>().ok().map(f64::from);
        let scale = self.read(Column::Scale, number);
        let divisor = self.read(Column::Divisor, number).map(|by| 1.0 / by);
        let exponent = self.read(Column::Exponent, power).map(power_of_ten);
        let places = self.read(Column::Places, |cell| power(cell).filter(|places| 0.0 <= *places));
        // As a person would write it: 0.1, not the nearest to it.
        let places = places.map(|places| power_of_ten(-places));
        [divisor, exponent, places, scale].into_iter().flatten().reduce(|all, one| all * one)
    }

    fn more(&mut self) -> More {
        More {
            access: self.read(Column::Access, access_of),
            min: self.read(Column::Min, number_of),
            max: self.read(Column::Max, number_of),
            decimals: self.read(Column::Decimals, |cell| cell.parse().ok()),
            labels: self.read(Column::Labels, labels_of).unwrap_or_default(),
            bits: self.read(Column::Bits, labels_of).unwrap_or_default(),
            field: self.read(Column::Field, bit_field_of),
            bad: self.read(Column::Bad, bad_of).unwrap_or_default(),
            group: self.text(Column::Group).unwrap_or_default().to_owned(),
            label: self.text(Column::Label).unwrap_or_default().to_owned(),
            write_at: self.read(Column::WriteAt, in_table),
            write_with: self.read(Column::WriteWith, |cell| cell.parse().ok()),
            poll: self.read(Column::Poll, poll_of),
        }
    }

    /// Headings of what stands in no column that is used, and of a second name.
    fn unused(&self) -> Vec<String> {
        let names = self.columns.places(Column::Name);
        let first = names
            .iter()
            .find(|place| self.row.cells.get(**place).is_some_and(|cell| !matches!(cell.as_str(), "" | "-" | "–")));
        let is_unused = |n: usize| match self.columns.means[n] {
            None => true,
            Some(Column::Name) => first != Some(&n),
            Some(_) => false,
        };
        let cells = self.row.cells.iter().take(self.columns.means.len()).enumerate();
        let unused = cells.filter(|(n, cell)| is_unused(*n) && !matches!(cell.as_str(), "" | "-" | "–"));
        unused.map(|(n, _)| self.columns.headings[n].clone()).collect()
    }
}

/// Why a cell of a column makes its row none.
fn unfit(column: Column, cell: &str) -> String {
    if matches!(column, Column::Scale | Column::Divisor | Column::Exponent | Column::Places) {
        return t!("`{wrong}` is not a scale", wrong = cell);
    }
    if matches!(column, Column::Table | Column::Area) {
        return t!("`{table}` is no table", table = cell);
    }
    if column == Column::Offset {
        return t!("`{offset}` is not an offset", offset = cell);
    }
    if column == Column::Order {
        return t!("`{order}` is no byte order", order = cell);
    }
    t!("`{cell}` is not understood below {column}", cell, column = translate(column.word()))
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
        let mut reader = Reader { columns, row, wrong: None };
        for question in &columns.open {
            let cell = row.cells.get(question.place).filter(|cell| question.matters(cell));
            cell.into_iter().for_each(|cell| reader.refuse(question.of_cell(cell)));
        }
        // Of two addresses the surest that can be read counts.
        let written = columns.places(Column::Address).into_iter().filter_map(|place| {
            let cell = row.cells.get(place).filter(|cell| !cell.is_empty())?;
            Some(columns.address(place, cell))
        });
        let written: Vec<(String, Option<AddressBase>)> = written.collect();
        let found = written.iter().find(|(cell, _)| is_address(cell)).or(written.first()).cloned();
        (read.address, read.base) = found.map_or((None, None), |(cell, base)| (Some(cell), base));
        read.base = read.base.filter(|base| {
            // A Modicon number counts from 1 as well, but not as this one.
            *base == AddressBase::Zero || read.address.as_ref().is_none_or(|cell| of_modicon(first_of(cell)).is_none())
        });
        read.name = reader.text(Column::Name).unwrap_or_default().to_owned();
        read.is_typed = columns.means.contains(&Some(Column::Type));
        read.kind = reader.kind();
        read.signed = reader.read(Column::Signed, yes_or_no);
        read.length = reader.read(Column::Length, |cell| length_of(cell, false));
        read.length = read.length.or_else(|| reader.read(Column::Bytes, |cell| length_of(cell, true)));
        read.width = reader.read(Column::Width, width_of);
        read.table = reader.read(Column::Table, table_of).or_else(|| reader.read(Column::Area, area));
        read.device = reader.read(Column::Device, |cell| cell.parse().ok());
        read.order = reader.read(Column::Order, order_of);
        if let Some(formula) = reader.text(Column::Formula) {
            reader.refuse(t!("the formula `{formula}` is more than a factor and an offset", formula));
        }
        read.scale = reader.factor();
        read.offset = reader.read(Column::Offset, number_of).unwrap_or_default();
        read.more = reader.more();
        read.unused = reader.unused();
        read.read_unit(&mut reader);
        read.wrong = reader.wrong;
        read
    }

    /// The unit, and a factor that stands in front of it.
    fn read_unit(&mut self, reader: &mut Reader<'_>) {
        let Some(cell) = reader.text(Column::Unit) else { return };
        if reader.columns.is_sure {
            self.unit = unit_of(cell);
            return;
        }
        match unit_with_factor(cell) {
            Ok((1.0, unit)) => self.unit = unit,
            Ok((_, _)) if self.scale.is_some() => {
                reader.refuse(t!("`{cell}`: its unit has a factor, and it has another", cell));
            }
            Ok((factor, unit)) => (self.scale, self.unit) = (Some(factor), unit),
            Err(why) => reader.refuse(why),
        }
    }

    /// Table and address, as assumed where the row does not say more.
    fn place(&self, assumed: Assumed) -> Option<(Table, u16)> {
        let table = self.table.unwrap_or(assumed.table);
        let is_stated = self.table.is_some() || assumed.is_stated;
        let base = self.base.unwrap_or(assumed.base);
        AddressContext { table, is_stated, base }.parse(first_of(self.address.as_ref()?))
    }

    /// Its type and, where the word says it, the order.
    fn kind(&self) -> Result<(DataType, Option<ByteOrder>), String> {
        let whole = match self.signed {
            Some(true) => "int",
            Some(false) => "uint",
            None => "",
        };
        let word = match self.kind.as_deref() {
            None if !whole.is_empty() => whole,
            None if self.is_typed => return Err(t!("no type").to_owned()),
            None if self.width.is_some_and(|bits| bits != 16) => {
                return Err(t!("{bits} bits, and no type", bits = self.width.unwrap_or_default()));
            }
            None if self.length.is_some_and(|length| length != 1) => {
                return Err(t!("{length} registers, and no type", length = self.length.unwrap_or_default()));
            }
            None => return Ok((DataType::U16, None)),
            Some("int" | "INT" | "Int" | "integer" | "Integer" | "INTEGER") if !whole.is_empty() => whole,
            Some(word) => word,
        };
        let sized = self.width.and_then(|bits| type_of(&format!("{word}{bits}"), None).ok());
        let (kind, order) = match sized {
            Some(found) => found,
            None => type_of(word, self.length)?,
        };
        if let Some(bits) = self.width.filter(|bits| *bits != u16::from(kind.bits()) && !kind.is_text()) {
            return Err(t!("`{word}` does not have {bits} bits", word, bits));
        }
        let is_signed = kind.encoding() == Encoding::Signed;
        let is_other = kind.is_binary() && self.signed.is_some_and(|signed| signed != is_signed);
        if is_other {
            return Err(t!("`{word}` is not what its sign says", word));
        }
        Ok((kind, order))
    }

    /// Takes it; else why not.
    pub fn named(&self, assumed: Assumed) -> Result<Taken, String> {
        let Some(written) = &self.address else { return Err(t!("no address").to_owned()) };
        let because = |why: String| format!("{written}: {why}");
        let found = self.place(assumed);
        let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
        if self.name.is_empty() {
            return Err(t!("{written}: no name", written));
        }
        if let Some(wrong) = &self.wrong {
            return Err(because(wrong.clone()));
        }
        let (kind, order) = if table.is_bits() { (DataType::Bool, None) } else { self.kind().map_err(because)? };
        let stated = self.order.or(order);
        let is_in_order = table.is_bits() || kind.is_text() || kind.is_half() || kind.registers() == 1;
        let order = stated.unwrap_or(ByteOrder::Abcd);
        let scale = self.scale.unwrap_or(1.0);
        let decimals = decimals_of(scale, kind).max(decimals_of(self.offset, DataType::U16));
        let named = Named::new(table, address, kind, order, &self.name);
        let named = Named { scale, offset: self.offset, decimals, unit: self.unit.clone(), ..named };
        let is_free = stated.is_none() && !kind.is_text() && !kind.is_half();
        let named = if is_free { named.ordered(assumed.order) } else { named };
        let first = first_of(written);
        let is_plain = first.bytes().all(|byte| byte.is_ascii_digit());
        Ok(Taken {
            named: self.with_more(named).map_err(because)?,
            is_base_assumed: self.base.is_none() && is_plain && of_modicon(first).is_none(),
            is_order_assumed: stated.is_none() && !is_in_order,
            is_type_assumed: !table.is_bits() && self.kind.is_none() && self.signed.is_none(),
            is_write_lost: false,
        })
    }

    fn with_more(&self, mut named: Named) -> Result<Named, String> {
        let more = &self.more;
        named.access = more.access.unwrap_or(named.access);
        if named.access != Access::Read {
            (named.write_at, named.write_fc) = (more.write_at, more.write_with);
        }
        (named.min, named.max) = (more.min, more.max);
        named.decimals = more.decimals.unwrap_or(named.decimals);
        (named.group, named.label, named.poll) = (more.group.clone(), more.label.clone(), more.poll);
        if let Some((low, width)) = more.field {
            // One bit of a register is a bit of its word.
            named.kind = if named.kind == DataType::Bool { DataType::U16 } else { named.kind };
            if named.table.is_bits() || !named.kind.is_binary() || u16::from(named.kind.bits()) < u16::from(low + width)
            {
                return Err(t!("it has no bits {low} to {high}", low, high = low + width - 1));
            }
            named.field = Some((low, width));
        }
        named.bad_if = more.bad.iter().filter_map(|bad| bad.of(named.point())).collect();
        let bits = more.bits.iter().map(|(bit, label)| Some((u8::try_from(*bit).ok()?, label.clone())));
        let bits: Option<_> = bits.collect();
        named.bit_labels = bits.ok_or_else(|| t!("it has no such bit").to_owned())?;
        Ok(if more.labels.is_empty() { named } else { named.labelled(more.labels.clone()) })
    }
}
