//! Values as they are read, as CSV: a row for each read, two columns a register, its value and its quality, in the words
//! of [`export`].

pub(crate) mod reader;

use jiff::Timestamp;

use super::{
    csv::{self, plain},
    export,
};
use crate::plant::{def::CsvDialect, sample::Quality};

/// The heading of the times, which are in UTC.
const TIME: &str = "time_utc";

/// The first row, of names and units. A spreadsheet needs the byte order mark to read `°C`; plain names go without.
pub fn heading<'a>(columns: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<u8> {
    let columns = columns.flat_map(|(name, unit)| export::heading(name, unit));
    let cells: Vec<String> = std::iter::once(plain(TIME)).chain(columns).collect();
    let bom = !cells.iter().all(|cell| cell.is_ascii());
    csv::write(std::iter::once(cells), CsvDialect { bom, ..CsvDialect::default() })
}

/// The row of a read: of each register its value as text, which stands there only if it is good, and its quality.
pub fn row(at: Timestamp, cells: impl Iterator<Item = (String, Quality)>) -> Vec<u8> {
    let cells = cells.flat_map(|(value, quality)| {
        let value = if quality.is_good() { value } else { String::new() };
        [value, quality.word()]
    });
    line(std::iter::once(plain(format!("{at:.3}"))).chain(cells))
}

fn line(cells: impl Iterator<Item = String>) -> Vec<u8> {
    csv::write(std::iter::once(cells.collect()), CsvDialect::default())
}
