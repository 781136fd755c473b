//! A register list from a manual becomes names: CSV, Markdown, or columns as they are copied from a PDF, recognised by their
//! heading or, without one, by their form. What is not sure is not taken, and said by line.

mod address_forms;
mod base;
pub mod calculated;
pub mod cells;
mod codes;
mod columns;
mod factors;
mod form;
mod formula;
mod headed;
mod halves;
pub mod headings;
mod heat_pump;
mod meanings;
mod neighbours;
mod parts;
mod questions;
mod reader;
mod register_names;
mod row;
mod sections;
mod span;
mod tables;
mod titles;
pub mod words;

use std::collections::BTreeMap;

pub use self::{
    base::{Unclear, base_of},
    columns::{Column, Said},
    questions::Question,
    sections::titled,
};
use self::{
    calculated::Calculated,
    cells::Cells,
    columns::first_of,
    row::{Assumed, Taken},
};
use super::{Format, named::Named};
use crate::{
    plant::{
        address::AddressBase,
        tag::{Access, ByteOrder, Table},
    },
    t,
};

/// What a list does not say itself, or what its reader has decided.
#[derive(Debug, Clone, PartialEq)]
pub struct ListContext {
    /// What the file is; `None`: what it seems.
    pub format: Option<Format>,
    /// Table of an address that names none.
    pub table: Table,
    /// It is said so: a Modicon number of another table is none.
    pub is_table_stated: bool,
    /// How plain numbers count; `None`: that is not said.
    pub base: Option<AddressBase>,
    /// Order of what takes several registers; `None`: that is not said.
    pub order: Option<ByteOrder>,
    /// The unit whose registers are wanted; `None`: the first that the file has.
    pub unit: Option<u8>,
    /// Where the first register of a map without addresses of its own stands.
    pub start: Option<u16>,
    /// Which of several models is meant, in a file that has a value for each, from 0.
    pub variant: Option<usize>,
    /// What columns mean other than it seems, by heading.
    pub means: Said,
}

impl Default for ListContext {
    fn default() -> ListContext {
        ListContext {
            format: None,
            table: Table::Holding,
            is_table_stated: false,
            base: None,
            order: None,
            unit: None,
            start: None,
            variant: None,
            means: Said::new(),
        }
    }
}

/// What was read of a list, and what was not, by line.
#[derive(Debug, Default, PartialEq)]
pub struct List {
    /// In the order of the list.
    pub named: Vec<Named>,
    /// How its plain numbers were read; `None` where it has none.
    pub base: Option<AddressBase>,
    /// The order of what takes several registers and names none.
    pub order: Option<ByteOrder>,
    /// What is calculated from registers.
    pub calculated: Vec<Calculated>,
    /// `line 7: no address`.
    pub problems: Vec<String>,
    /// It is no list at all: why.
    pub refused: Option<String>,
    /// Digits that two registers have, and both.
    pub unclear: Option<Unclear>,
    /// Heading of each column, and what it means.
    pub columns: Vec<(String, Option<Column>)>,
    /// Columns of which only the reader of the list can say what they mean; rows with something in them are left out.
    pub questions: Vec<Question>,
    /// What it is.
    pub format: Option<Format>,
    /// Maker and model, where the file names them.
    pub about: [String; 2],
    /// Connection in the file and unit of the rows that are taken.
    pub station: Option<(usize, u8)>,
    /// What is assumed, or is odd about the file, beside its rows.
    pub warnings: Vec<String>,
    /// It is a list of a known program, in which nothing is assumed of its factors.
    pub is_sure: bool,
    /// What is assumed of rows that are taken, and of how many.
    pub assumed: BTreeMap<String, usize>,
    /// What is not kept of rows that are taken: how often, and in which line first.
    pub notes: BTreeMap<String, (usize, usize)>,
}

impl List {
    /// No list: why.
    pub fn refused(why: String) -> List {
        List { refused: Some(why), ..List::default() }
    }

    /// Adds what the row of a line gave, unless it is of another unit or connection than those that are taken.
    pub fn push_of(
        &mut self,
        context: &ListContext,
        station: Option<(usize, u8)>,
        line: usize,
        named: Result<Named, String>,
    ) {
        let wanted = |of: (usize, u8)| context.unit.is_none_or(|unit| unit == of.1);
        let of_other = |(connection, unit): (usize, u8)| {
            let taken = self.station.unwrap_or((connection, context.unit.unwrap_or(unit)));
            if taken == (connection, unit) {
                return None;
            }
            Some(match taken.1 == unit {
                true => t!("it belongs to another connection with unit {unit}", unit),
                false => {
                    t!(
                        "it belongs to unit {other}, the registers of unit {unit} are taken",
                        other = unit,
                        unit = taken.1
                    )
                }
            })
        };
        let named = match station.and_then(of_other) {
            Some(why) => Err(why),
            None => named,
        };
        if named.is_ok() && self.station.is_none() {
            self.station = station.filter(|of| wanted(*of));
        }
        self.push(&t!("line {number}", number = line), named);
    }

    /// Says once that the file has more rows than are read.
    fn warn_cut(&mut self) {
        let words = t!("only the first {count} rows are read", count = cells::ROWS_MAX);
        if !self.warnings.contains(&words) {
            self.warnings.push(words);
        }
    }

    /// Adds another list; its places have this in front.
    pub fn append(&mut self, other: List, place: &str) {
        for named in other.named {
            let at = format!("{place}{}", t!("line {number}", number = named.line));
            self.push(&at, Ok(named));
        }
        self.calculated.extend(other.calculated);
        self.warnings.extend(other.warnings);
        self.problems.extend(other.problems.into_iter().map(|problem| format!("{place}{problem}")));
        self.unclear = self.unclear.take().or(other.unclear);
        self.base = self.base.or(other.base);
        self.order = self.order.or(other.order);
        self.station = self.station.or(other.station);
        for (what, count) in other.assumed {
            *self.assumed.entry(what).or_default() += count;
        }
        for (what, (count, line)) in other.notes {
            self.notes.entry(what).or_insert((0, line)).0 += count;
        }
        self.add_columns(other.columns, other.questions);
    }

    /// Columns of another heading, each once.
    fn add_columns(&mut self, columns: Vec<(String, Option<Column>)>, questions: Vec<Question>) {
        for column in columns {
            if self.columns.iter().all(|(heading, _)| *heading != column.0) {
                self.columns.push(column);
            }
        }
        for question in questions {
            if self.questions.iter().all(|known| known.heading != question.heading) {
                self.questions.push(question);
            }
        }
    }

    /// What is assumed of the rows that are taken, and what of them is not kept, in words.
    pub fn said_of_rows(&self) -> impl Iterator<Item = String> {
        let assumed = |(what, count): (&String, &usize)| t!("assumed: {what} ({count} rows)", what, count = *count);
        let said = |(what, (count, line)): (&String, &(usize, usize))| {
            t!("not kept: `{what}` of {count} rows, first in line {line}", what, count = *count, line = *line)
        };
        self.assumed.iter().map(assumed).chain(self.notes.iter().map(said))
    }

    /// Counts something of a row that is not kept, although the row is.
    pub fn note(&mut self, what: String, line: usize) {
        self.notes.entry(what).or_insert((0, line)).0 += 1;
    }

    /// Adds what a row gave.
    pub fn push(&mut self, place: &str, named: Result<Named, String>) {
        // Each row is compared with all others.
        if cells::ROWS_MAX <= self.named.len() {
            self.warn_cut();
            return;
        }
        let is_beyond = |named: &Named| u32::from(u16::MAX) + 1 < u32::from(named.address) + u32::from(named.count());
        let named = named.and_then(|named| match is_beyond(&named) {
            true => Err(t!("{name}: it ends beyond the last address", name = named.name)),
            false => Ok(named),
        });
        let free = named.and_then(|named| match self.named.iter().find_map(|old| conflict(old, &named)) {
            Some(why) => Err(format!("{}: {why}", named.name)),
            None => Ok(named),
        });
        match free {
            Ok(mut named) => {
                named.name = named.name.split_whitespace().collect::<Vec<_>>().join(" ");
                self.named.push(named);
            }
            Err(why) => self.problems.push(format!("{place}: {why}")),
        }
    }
}

/// Why a register cannot be taken beside another one.
pub fn conflict(old: &Named, new: &Named) -> Option<String> {
    let end = |named: &Named| u32::from(named.address) + u32::from(named.count());
    if old.table != new.table || end(old) <= u32::from(new.address) || end(new) <= u32::from(old.address) {
        return None;
    }
    if (old.address, old.field) == (new.address, new.field) {
        return Some(t!("this address has a name already").to_owned());
    }
    let is_same = (old.address, old.kind, old.order) == (new.address, new.kind, new.order);
    let is_part = |named: &Named| named.point().part().is_some();
    let are_fields = old.count() == 1 && new.count() == 1 && (is_part(old) || is_part(new));
    (!is_same && !are_fields).then(|| t!("it overlaps {name}, which is read as another type", name = old.name))
}

/// Reads a list.
pub fn parse(text: &str, context: &ListContext) -> List {
    let separator = cells::separator(text, &context.means);
    of_cells(&cells::rows(text, separator, &context.means), separator.is_some(), context)
}

/// Reads rows of cells, which a separator or the cells of a table keep apart.
pub fn of_cells(all: &[Cells], is_separated: bool, context: &ListContext) -> List {
    let mut list = List::default();
    if cells::ROWS_MAX <= all.len() {
        list.warn_cut();
    }
    let (all, sections) = sections::split(all, is_separated);
    let all = &all[..];
    let mut rows = match parts::rows(all, is_separated, context, &mut list) {
        Ok(rows) => rows,
        Err(why) => return List::refused(why),
    };
    sections::assign(&mut rows, &sections, context.is_table_stated, context.base);
    if matches!(context.base, None | Some(AddressBase::Modicon)) {
        base::assign_to_coils(&mut rows, context.base.is_some());
    }
    let stated = Some(context.table).filter(|_| context.is_table_stated);
    let written = rows.iter().filter(|row| row.base.is_none());
    let written: Vec<(&str, Option<Table>)> =
        written.filter_map(|row| Some((first_of(row.address.as_ref()?), row.table.or(stated)))).collect();
    let alias = base::alias_of(&rows, context);
    let (base, unclear) = match context.base {
        None if alias.is_some() => (AddressBase::Modicon, None),
        None if base::is_sent(&rows) => (AddressBase::Zero, None),
        _ => base_of(&written, context),
    };
    list.unclear = unclear;
    list.base = base::read_as(&written, base);
    let order =
        context.order.unwrap_or(if heat_pump::is_list(list.columns.iter().map(|(heading, _)| heading.as_str())) {
            ByteOrder::Cdab
        } else {
            ByteOrder::Abcd
        });
    list.order = Some(order);
    let table = alias.filter(|_| !context.is_table_stated).map_or(context.table, |(table, _)| table);
    let alias = alias.map(|(_, first)| first);
    let assumed = Assumed { table, is_stated: context.is_table_stated, base, order, alias };
    for row in rows {
        let taken = row.named(assumed).map(|taken| with_sure_writes(taken, context));
        let count = list.named.len();
        let what = taken.as_ref().map(|taken| assumptions(taken, context, list.is_sure)).unwrap_or_default();
        let named = taken.map(|taken| Named { line: row.line, ..taken.named });
        list.push_of(context, row.device.map(|unit| (0, unit)), row.line, named);
        if count < list.named.len() {
            what.into_iter().for_each(|what| *list.assumed.entry(what).or_default() += 1);
            row.unused.into_iter().for_each(|heading| list.note(heading, row.line));
        }
    }
    list.warnings.extend(halves::warnings(&list.named));
    list
}

/// Nothing is written where the place of a register or the order of its words is only assumed, or where nothing can be.
fn with_sure_writes(taken: Taken, context: &ListContext) -> Taken {
    let Taken { named, is_base_assumed, is_order_assumed, .. } = &taken;
    let is_assumed = *is_base_assumed && context.base.is_none() || *is_order_assumed && context.order.is_none();
    let is_fixed =
        matches!(named.table, Table::Discrete | Table::Input) && named.write_at.is_none() && named.write_fc.is_none();
    let is_write_lost = named.access != Access::Read && (is_assumed || is_fixed);
    let access = if is_write_lost { Access::Read } else { named.access };
    Taken { named: Named { access, ..taken.named }, is_write_lost, ..taken }
}

/// What neither the list nor its reader has said of a row.
fn assumptions(taken: &Taken, context: &ListContext, is_sure: bool) -> Vec<String> {
    let Taken { named, is_base_assumed, is_order_assumed, is_type_assumed, are_bounds_assumed, is_write_lost } = taken;
    let is_scaled_twice = named.offset != 0.0 && named.scale != 1.0;
    let all = [
        (*is_base_assumed && context.base.is_none(), t!("plain numbers are addresses as sent, from 0").to_owned()),
        (*is_order_assumed && context.order.is_none(), t!("byte order {order}", order = named.order.word())),
        (*is_type_assumed, t!("type uint16").to_owned()),
        (*is_write_lost, t!("read only: where or how it is written is uncertain").to_owned()),
        (*are_bounds_assumed && !is_sure, t!("bounds are values after the factor").to_owned()),
        (is_scaled_twice && !is_sure, t!("the offset is added after the factor").to_owned()),
    ];
    all.into_iter().filter(|(is, _)| *is).map(|(_, what)| what).collect()
}

#[cfg(test)]
mod tests;
