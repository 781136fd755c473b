//! The whole report as CSV: one file with sections of equal width, or a file for each table.

use jiff::tz::TimeZone;

use super::{
    ReportFormat, Style,
    csv::{self, localised, text},
    document::{Cell, Column, ColumnKind, Content, Document, Fact, Section, Table, local, offset},
};
use crate::{
    plant::{def::CsvDialect, exact::digits},
    t,
};

/// The format `csv`.
#[derive(Debug)]
pub struct ShiftCsv;

impl ReportFormat for ShiftCsv {
    fn name(&self) -> &'static str {
        "csv"
    }
    fn about(&self) -> &'static str {
        "everything, a section below the other"
    }

    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        Ok(stacked(document, style.csv))
    }

    fn tables(&self, document: &Document, style: &Style) -> Result<Vec<(&'static str, Vec<u8>)>, String> {
        let file = |section: &Section| {
            let rows = rows_of(document, section, style.csv)?;
            Some((section.kind.word(), csv::write(rows.into_iter(), style.csv)))
        };
        Ok(document.sections.iter().filter_map(file).collect())
    }
}

/// Every section with a title row, a header row and its rows; every row has as many cells as the widest.
fn stacked(document: &Document, dialect: CsvDialect) -> Vec<u8> {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for section in &document.sections {
        let Some(table) = rows_of(document, section, dialect) else { continue };
        if !rows.is_empty() {
            rows.push(Vec::new());
        }
        rows.push(vec![text(&section.title)]);
        rows.extend(table);
    }
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    rows.iter_mut().for_each(|row| row.resize(width, String::new()));
    csv::write(rows.into_iter(), dialect)
}

/// A table with its header row. An instant takes two cells: local time as spreadsheets take it, and its offset.
pub(super) fn table_rows(table: &Table, zone: &TimeZone, dialect: CsvDialect) -> Vec<Vec<String>> {
    let heading = |column: &Column| {
        let offset = column.kind.is_time().then(|| t!("offset").replace('\u{200b}', ""));
        std::iter::once(text(&column.heading)).chain(offset)
    };
    let header = table.columns.iter().flat_map(heading).collect();
    let row = |row: &Vec<Cell>| {
        let cells = row.iter().zip(&table.columns);
        cells.flat_map(|(cell, column)| written(cell, column.kind, zone, dialect)).collect()
    };
    std::iter::once(header).chain(table.rows.iter().map(row)).collect()
}

/// `None` for what has no rows.
fn rows_of(document: &Document, section: &Section, dialect: CsvDialect) -> Option<Vec<Vec<String>>> {
    let zone = &document.zone;
    document.locale.within(|| match &section.content {
        Content::Table(table) => Some(table_rows(table, zone, dialect)),
        Content::Facts(facts) => {
            let fact = |Fact { name, cell, .. }: &Fact| {
                std::iter::once(text(name)).chain(written(cell, cell.kind(), zone, dialect)).collect::<Vec<String>>()
            };
            let mut rows: Vec<Vec<String>> = facts.iter().map(fact).collect();
            rows.iter_mut().for_each(|row| row.resize(3, String::new()));
            Some(rows)
        }
        Content::Charts(_) | Content::Signatures(_) => None,
    })
}

/// A cell as one cell of the file, or as two in a column of instants.
fn written(cell: &Cell, kind: ColumnKind, zone: &TimeZone, dialect: CsvDialect) -> impl Iterator<Item = String> {
    let (first, second) = match cell {
        Cell::Empty => (String::new(), String::new()),
        Cell::Text(words) => (text(words), String::new()),
        Cell::Number(value, decimals) => (localised(digits(*value, *decimals), dialect), String::new()),
        Cell::Time(at) => (local(zone, *at, kind), offset(zone, *at)),
    };
    std::iter::once(first).chain(kind.is_time().then_some(second))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
