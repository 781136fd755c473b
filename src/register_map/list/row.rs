//! The cells of a row by what they hold, and what becomes of them.

use super::{
    columns::{Column, first_of},
    reader::More,
    words::{bad_span, type_of},
};
use crate::{
    plant::{
        address::{AddressBase, AddressContext, of_modicon},
        tag::{Access, ByteOrder, DataType, Encoding, Table},
    },
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
    /// All of its addresses, as written.
    pub addresses: Vec<String>,
    /// It is a row of ioBroker that has a type, which coils and discrete inputs have not.
    pub is_register: bool,
    /// How its address counts, as the row states it.
    pub base: Option<AddressBase>,
    pub(super) name: String,
    pub(super) kind: Option<String>,
    /// A column says the tables of all rows.
    pub is_tabled: bool,
    /// It is a row of a known program, in which nothing is assumed of its factors.
    pub(super) is_sure: bool,
    /// A column says the types of all rows.
    pub(super) is_typed: bool,
    pub(super) signed: Option<bool>,
    /// Its range or least value is below zero.
    pub(super) is_below_zero: bool,
    pub(super) length: Option<u16>,
    /// Bits of a number whose type does not say it.
    pub(super) width: Option<u16>,
    pub(super) scale: Option<f64>,
    pub(super) offset: f64,
    /// Where the power of ten of its formula stands.
    pub(super) power: Option<String>,
    pub(super) unit: String,
    /// As the row states it.
    pub table: Option<Table>,
    /// That of a list with such columns, in a program that has one for each table.
    pub(super) table_of_list: Option<Table>,
    /// Only a title above it says so.
    pub is_titled: bool,
    pub(super) order: Option<ByteOrder>,
    /// Unit address, as the row states it.
    pub device: Option<u8>,
    pub(super) more: More,
    /// Where it is written, as written there.
    pub(super) write_at: Option<String>,
    /// The function codes that write it, of one register and of several.
    pub(super) writes: [Option<u8>; 2],
    /// Columns that are not used and have something in this row.
    pub unused: Vec<String>,
    /// Why it is no row of registers.
    pub(super) refused: Option<String>,
    /// Why it cannot be taken, whatever else it says.
    pub(super) wrong: Option<String>,
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
    /// The number of the first register of a list of ioBroker that counts from there, such as 40001.
    pub alias: Option<u32>,
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
    /// Its bounds are taken as values after its factor.
    pub are_bounds_assumed: bool,
    /// The list says that it is written, but not surely how.
    pub is_write_lost: bool,
}

/// Why a row with two cells that say two things is none.
pub fn differ(other: &str, cell: &str) -> String {
    t!("`{other}` and `{cell}` differ: which counts?", other, cell)
}

/// Why a cell of a column makes its row none.
pub fn unfit(column: Column, cell: &str) -> String {
    if matches!(column, Column::Scale | Column::Divisor | Column::Exponent | Column::Places) {
        return t!("`{wrong}` is not a scale", wrong = cell);
    }
    if matches!(column, Column::Table | Column::Area) {
        return t!("`{table}` is not a table", table = cell);
    }
    if column == Column::Offset {
        return t!("`{offset}` is not an offset", offset = cell);
    }
    if column == Column::Order {
        return t!("`{order}` is not a byte order", order = cell);
    }
    t!("`{cell}` is not understood in the column {column}", cell, column = translate(column.word()))
}

/// Bounds beside a factor are values, unless no raw number would be one of them.
fn check_bounds(named: &Named) -> Result<(), String> {
    let Some((least, most)) = named.point().raw_range().filter(|_| named.scale != 1.0) else { return Ok(()) };
    // A bound may be the nearest round number.
    let (least, most) = (least as f64 - 1.0, most as f64 + 1.0);
    let is_beyond = |bound: &f64| !(least..=most).contains(&((bound - named.offset) / named.scale));
    match named.min.into_iter().chain(named.max).find(is_beyond) {
        Some(bound) => {
            Err(t!("`{bound}` is more than its registers hold after the factor: is it a raw number?", bound))
        }
        None => Ok(()),
    }
}

impl Row {
    /// Nothing of it is known but its line.
    pub fn without_cells(line: usize) -> Row {
        Row { line, ..Row::default() }
    }

    /// It is no row of registers.
    pub fn refused(line: usize, why: String) -> Row {
        Row { refused: Some(why), ..Row::without_cells(line) }
    }

    /// Table and address, as assumed where the row does not say more.
    fn place(&self, written: &str, assumed: Assumed) -> Option<(Table, u16)> {
        let of_list = self.table_of_list.filter(|_| !assumed.is_stated && assumed.alias.is_none());
        let table = self.table.or(of_list).unwrap_or(assumed.table);
        if let Some(first) = assumed.alias.filter(|_| self.is_register) {
            return Some((table, u16::try_from(written.parse::<u32>().ok()?.checked_sub(first)?).ok()?));
        }
        let is_stated = self.table.is_some() || assumed.is_stated;
        let base = self.base.unwrap_or(assumed.base);
        AddressContext { table, is_stated, base }.parse(first_of(written))
    }

    /// Why its address is none.
    fn no_place(&self, written: &str) -> String {
        let other = self.table.filter(|of| of_modicon(first_of(written)).is_some_and(|(table, _)| table != *of));
        other.map_or_else(|| t!("`{written}` is not an address", written), |table| differ(written, table.word()))
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
            None if self.is_below_zero => return Ok((DataType::I16, None)),
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
            return Err(t!("`{word}` contradicts its sign", word));
        }
        Ok((kind, order))
    }

    /// A bit, as only the digits of its address or a title say, has no type of more bits.
    fn check_bit(&self, assumed: Assumed) -> Result<(), String> {
        let is_by_digits = self.is_titled || self.table.is_none() && !assumed.is_stated;
        let Some(word) = self.kind.as_ref().filter(|_| is_by_digits) else { return Ok(()) };
        match type_of(word, self.length) {
            Ok((kind, _)) if kind != DataType::Bool && self.is_titled => {
                let table = self.table.unwrap_or(assumed.table).word();
                Err(t!("`{word}` is more than a bit, and the title above says {table}", word, table))
            }
            Ok((kind, _)) if kind != DataType::Bool => Err(t!("`{word}` does not have {bits} bits", word, bits = 1)),
            Err(why) if self.is_register => Err(why),
            Ok(_) | Err(_) => Ok(()),
        }
    }

    /// Takes it; else why not.
    pub fn named(&self, assumed: Assumed) -> Result<Taken, String> {
        let Some(written) = &self.address else {
            return Err(self.refused.clone().unwrap_or_else(|| t!("no address").to_owned()));
        };
        let because = |why: String| format!("{written}: {why}");
        let found = self.place(written, assumed);
        let (table, address) = found.ok_or_else(|| self.no_place(written))?;
        if self.name.is_empty() {
            return Err(t!("{written}: no name", written));
        }
        if let Some(wrong) = &self.wrong {
            return Err(because(wrong.clone()));
        }
        if table.is_bits() {
            self.check_bit(assumed).map_err(because)?;
        }
        let (kind, order) = if table.is_bits() { (DataType::Bool, None) } else { self.kind().map_err(because)? };
        let power = self.power.as_ref().map(|text| {
            let place = self.place(text, assumed).filter(|(of, _)| *of == table);
            place.ok_or_else(|| t!("`{written}` is not an address", written = text))
        });
        let power_at = power.transpose().map_err(because)?.map(|(_, address)| address);
        let stated = self.order.or(order);
        let is_in_order = table.is_bits() || kind.is_text() || kind.is_half() || kind.registers() == 1;
        let order = stated.unwrap_or(ByteOrder::Abcd);
        let scale = self.scale.unwrap_or(1.0);
        let decimals = decimals_of(scale, kind).max(decimals_of(self.offset, DataType::U16));
        let named = Named::new(table, address, kind, order, &self.name);
        let named = Named { scale, offset: self.offset, decimals, unit: self.unit.clone(), power_at, ..named };
        let is_free = stated.is_none() && !kind.is_text() && !kind.is_half();
        let named = if is_free { named.ordered(assumed.order) } else { named };
        let first = first_of(written);
        let is_plain = first.bytes().all(|byte| byte.is_ascii_digit()) && assumed.alias.is_none();
        let named = self.with_more(named, assumed).map_err(because)?;
        if !self.is_sure {
            check_bounds(&named).map_err(because)?;
        }
        Ok(Taken {
            are_bounds_assumed: named.scale != 1.0 && named.min.or(named.max).is_some(),
            named,
            is_base_assumed: self.base.is_none() && is_plain && of_modicon(first).is_none_or(|(of, _)| of != table),
            is_order_assumed: stated.is_none() && !is_in_order,
            is_type_assumed: !table.is_bits() && self.kind.is_none() && self.signed.is_none(),
            is_write_lost: false,
        })
    }

    /// Where it is written, if that is another place: no device writes the tables that are only read.
    fn place_of_writes(&self, named: &Named, assumed: Assumed) -> Result<Option<(Table, u16)>, String> {
        let Some(written) = &self.write_at else { return Ok(None) };
        let table = match named.table {
            Table::Coil | Table::Discrete => Table::Coil,
            Table::Input | Table::Holding => Table::Holding,
        };
        let is_stated = self.table.is_some() || assumed.is_stated;
        let base = self.base.unwrap_or(assumed.base);
        let place = AddressContext { table, is_stated, base }.parse(first_of(written));
        let place = place.filter(|(of, _)| of.is_bits() == table.is_bits());
        let place = place.ok_or_else(|| t!("`{written}` is not an address", written))?;
        Ok(Some(place).filter(|place| *place != (named.table, named.address)))
    }

    fn with_more(&self, mut named: Named, assumed: Assumed) -> Result<Named, String> {
        let more = &self.more;
        let write_at = self.place_of_writes(&named, assumed)?;
        let (one, many) = (self.writes[0].filter(|_| named.count() == 1), self.writes[1]);
        let is_written = one.or(many).is_some() || self.write_at.is_some();
        let by_code = is_written.then_some(Access::ReadWrite);
        named.access = more.access.or(by_code).unwrap_or(named.access);
        let by_many = many.filter(|_| one.is_none() && named.count() == 1);
        if named.access != Access::Read {
            (named.write_at, named.write_fc) = (write_at, more.write_with.or(by_many));
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
        named.bad_if = more.bad.iter().filter_map(|bad| bad_span(*bad, named.point())).collect();
        let bits = more.bits.iter().map(|(bit, label)| Some((u8::try_from(*bit).ok()?, label.clone())));
        let bits: Option<_> = bits.collect();
        named.bit_labels = bits.ok_or_else(|| t!("it does not have this bit").to_owned())?;
        Ok(if more.labels.is_empty() { named } else { named.labelled(more.labels.clone()) })
    }
}
