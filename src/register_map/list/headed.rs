//! A row below a heading: its cells by what their columns mean.

use super::{
    address_forms,
    cells::Cells,
    codes,
    columns::{Column, Columns, first_of, is_address, span_of},
    factors::of_unit,
    formula::Formula,
    meanings::is_blank,
    reader::{Reader, with_unit},
    row::{Row, differ},
    tables,
    words::{area, length_of, offset_of, order_of, power_of_ten, unit_with_factor, width_of, yes_or_no},
};
use crate::{
    plant::address::{AddressBase, of_modicon},
    profile::unit_of,
    t,
};

/// An address with the last one of its row, if a column has those.
fn with_last(columns: &Columns, row: &Cells, first: String) -> String {
    let place = columns.places(Column::Address).into_iter().next();
    let last = columns.last.and_then(|n| row.cells.get(n)).filter(|cell| !is_blank(cell)).zip(place);
    last.map_or_else(|| first.clone(), |(last, place)| format!("{first}-{}", columns.address(place, last).0))
}

impl Row {
    /// Below a heading.
    pub fn headed(columns: &Columns, row: &Cells) -> Row {
        let mut read = Row { line: row.line, is_sure: columns.is_sure, ..Row::default() };
        if row.is_unclosed {
            return Row::refused(row.line, t!("a quote is never closed").to_owned());
        }
        if row.cells.iter().skip(columns.headings.len()).any(|cell| !cell.is_empty()) {
            let (found, expected) = (row.cells.len(), columns.headings.len());
            return Row::refused(row.line, t!("{found} cells, the heading has {expected}", found, expected));
        }
        let mut reader = Reader { columns, row, wrong: None };
        for question in &columns.open {
            let cell = row.cells.get(question.place).filter(|cell| question.matters(cell));
            cell.into_iter().for_each(|cell| reader.refuse(question.of_cell(cell)));
        }
        if columns.places(Column::Address).is_empty() {
            read.refused = reader.wrong.clone();
        }
        read.take_address(&reader);
        read.name = reader.text(Column::Name).unwrap_or_default().to_owned();
        read.is_typed = columns.means.contains(&Some(Column::Type));
        read.kind = reader.kind();
        read.signed = reader.read(Column::Signed, yes_or_no);
        read.length = reader.read(Column::Length, |cell| length_of(cell, false));
        read.length = read.length.or_else(|| reader.read(Column::Bytes, |cell| length_of(cell, true)));
        if columns.is_iobroker && read.is_typed {
            // The program knows the lengths of all types but texts, and the type where none is stated.
            read.is_register = true;
            let kind = read.kind.get_or_insert_with(|| "uint16be".to_owned());
            read.length = read.length.filter(|_| kind.starts_with("string"));
        }
        read.take_span(&mut reader);
        read.width = reader.read(Column::Width, width_of);
        read.is_tabled = columns.means.iter().flatten().any(|means| matches!(means, Column::Table | Column::Area));
        read.table = reader.read(Column::Table, tables::table_of).or_else(|| reader.read(Column::Area, area));
        read.take_table_of_address(&mut reader);
        read.table_of_list = columns.table_of_iobroker();
        read.device = reader.read(Column::Device, |cell| cell.parse().ok());
        let unit = || reader.text(Column::Address).and_then(address_forms::of_unit).map(|(unit, _)| unit);
        read.device = read.device.or_else(unit);
        read.order = reader.read(Column::Order, order_of);
        read.scale = reader.factor();
        read.offset = reader.read(Column::Offset, offset_of).unwrap_or_default();
        read.is_below_zero = reader.is_below_zero();
        read.take_formula(&mut reader);
        read.more = reader.more();
        read.more.write_with = read.more.write_with.or(Some(16).filter(|_| columns.is_of_manager));
        read.take_writes(&reader);
        read.unused = reader.unused();
        read.read_unit(&mut reader);
        read.take_factor_of_name(&mut reader);
        read.wrong = reader.wrong;
        read
    }

    /// Of two addresses the surest that can be read counts.
    fn take_address(&mut self, reader: &Reader<'_>) {
        let Reader { columns, row, .. } = *reader;
        let written = columns.places(Column::Address).into_iter().filter_map(|place| {
            let cell = row.cells.get(place).filter(|cell| !cell.is_empty())?;
            Some(columns.address(place, cell))
        });
        let written: Vec<(String, Option<AddressBase>)> = written.collect();
        let found = written.iter().find(|(cell, _)| is_address(cell)).or(written.first()).cloned();
        let found = found.map(|(cell, base)| (with_last(columns, row, cell), base));
        self.addresses = written.into_iter().map(|(cell, _)| cell).collect();
        (self.address, self.base) = found.map_or((None, None), |(cell, base)| (Some(cell), base));
        self.base = self.base.filter(|base| {
            // A Modicon number counts from 1 as well, but not as this one.
            *base == AddressBase::Zero || self.address.as_ref().is_none_or(|cell| of_modicon(first_of(cell)).is_none())
        });
    }

    /// What a formula scales by.
    fn take_formula(&mut self, reader: &mut Reader<'_>) {
        let Some(text) = reader.text(Column::Formula) else { return };
        // A factor besides may be part of it, or not.
        let formula = Formula::of(text).filter(|_| matches!(self.scale, None | Some(1.0)) && self.offset == 0.0);
        match formula {
            Some(formula) => (self.scale, self.power) = (Some(formula.factor), formula.power_at),
            None => reader.refuse(t!("the formula `{formula}` is more than a factor and an offset", formula = text)),
        }
    }

    /// Where and with which functions it is written.
    fn take_writes(&mut self, reader: &Reader<'_>) {
        let Reader { columns, row, .. } = *reader;
        self.writes = codes::writes_of(reader.cells(Column::Table));
        let write = columns.places(Column::WriteAt).into_iter().find_map(|place| Some((place, row.cells.get(place)?)));
        self.write_at = write.filter(|(_, cell)| !is_blank(cell)).map(|(place, cell)| columns.address(place, cell).0);
    }

    /// The table that an address such as `HR5` states.
    fn take_table_of_address(&mut self, reader: &mut Reader<'_>) {
        let cell = |place: usize| Some((reader.row.cells.get(place)?.as_str(), place));
        let mut all = reader.columns.places(Column::Address).into_iter().filter_map(cell);
        let found = all.find_map(|(cell, place)| Some((cell, reader.columns.table_of_address(place, cell)?)));
        let Some((cell, table)) = found else { return };
        match self.table.filter(|of| *of != table) {
            Some(other) => reader.refuse(differ(cell, other.word())),
            None => self.table = Some(table),
        }
    }

    /// The length that a span of addresses states.
    fn take_span(&mut self, reader: &mut Reader<'_>) {
        let Some((cell, span)) = self.address.as_ref().and_then(|cell| Some((cell, span_of(cell)?))) else { return };
        match self.length.filter(|length| *length != span) {
            Some(length) => {
                let (other, cell) = (cell, length.to_string());
                reader.refuse(differ(other, &cell));
            }
            None => self.length = Some(span),
        }
    }

    /// The unit, and a factor that stands in front of it.
    /// `Frequency (0.01 Hz)` says what the last digit is worth; `Voltage (x10)` does not say which way.
    fn take_factor_of_name(&mut self, reader: &mut Reader<'_>) {
        let bracketed =
            self.name.rsplit_once(['(', '[', '（']).and_then(|(_, rest)| Some(rest.split_once([')', ']', '）'])?.0));
        let Some(cell) = bracketed.filter(|_| !reader.columns.is_sure).map(str::to_owned) else { return };
        let is_power = |factor: f64| (1..=6).any(|places| power_of_ten(f64::from(places)) == factor);
        // `*1` leads to a footnote, `x2` may be how many there are.
        let by = cell.strip_prefix(['x', 'X', '×', '*']).and_then(|digits| digits.trim().parse::<f64>().ok());
        if by.is_some_and(is_power) && self.scale.is_none() {
            reader.refuse(t!("`{cell}` in its name: is it a factor or a divisor?", cell));
        }
        // A class of accuracy is no power of ten.
        let is_last_digit = |factor: f64| (1..=6).any(|places| power_of_ten(f64::from(-places)) == factor);
        let Some((factor, unit)) = unit_with_factor(&cell).ok().filter(|(factor, _)| is_last_digit(*factor)) else {
            return;
        };
        match self.scale {
            None => self.scale = Some(factor),
            Some(scale) if scale != factor => reader.refuse(differ(&cell, &scale.to_string())),
            Some(_) => {}
        }
        if self.unit.is_empty() {
            self.unit = unit;
        }
    }

    fn read_unit(&mut self, reader: &mut Reader<'_>) {
        let columns = reader.columns;
        let of_scale = reader.text(Column::Scale).and_then(|cell| Some((cell, with_unit(columns, cell)?.1)));
        let Some(cell) = reader.text(Column::Unit) else {
            self.unit = of_scale.map(|(_, unit)| unit).unwrap_or_default();
            return;
        };
        if let Some((other, _)) = of_scale.filter(|(_, unit)| of_unit(cell).is_ok_and(|(_, other)| *unit != other)) {
            reader.refuse(differ(other, cell));
        }
        if reader.columns.is_sure {
            self.unit = unit_of(cell);
            return;
        }
        match of_unit(cell) {
            Ok((1.0, unit)) => self.unit = unit,
            Ok((_, _)) if self.scale.is_some() => {
                reader.refuse(t!("`{cell}`: its unit has a factor, and it has another", cell));
            }
            Ok((factor, unit)) => (self.scale, self.unit) = (Some(factor), unit),
            Err(why) => reader.refuse(why),
        }
    }
}
