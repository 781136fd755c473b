//! CSV by RFC 4180: its settings, cells and tables.

use jiff::{Timestamp, tz::TimeZone};

use crate::plant::{
    def::CsvDialect,
    exact::{Exact, digits},
};

impl CsvDialect {
    /// The dialect of a plant with other settings from the command line. The decimal mark follows the separator.
    pub fn with(self, separator: Option<&str>, bom: bool) -> CsvDialect {
        let (separator, decimal) = match separator {
            Some(";") => (';', ','),
            Some(_) => (',', '.'),
            None => (self.separator, self.decimal),
        };
        CsvDialect { separator, decimal, bom: bom || self.bom }
    }

    /// The other of the two common dialects, beside that of the plant. The one with `;` is for spreadsheets, which need
    /// the byte order mark to read `°C`.
    pub fn toggled(self, plant: CsvDialect) -> CsvDialect {
        let other = match plant.separator {
            ';' => CsvDialect::default(),
            _ => CsvDialect { separator: ';', decimal: ',', bom: true },
        };
        if self == plant { other } else { plant }
    }
}

/// A table of equally wide rows.
pub(super) fn write(rows: impl Iterator<Item = Vec<String>>, dialect: CsvDialect) -> Vec<u8> {
    let mut bytes = if dialect.bom { "\u{feff}".as_bytes().to_vec() } else { Vec::new() };
    let mut writer = csv::WriterBuilder::new()
        .delimiter(u8::try_from(dialect.separator).unwrap_or(b','))
        .terminator(csv::Terminator::CRLF)
        .from_writer(&mut bytes);
    for row in rows {
        writer.write_record(row).expect("rows are equally wide and memory does not fail to write");
    }
    writer.flush().expect("memory does not fail to write");
    drop(writer);
    bytes
}

/// A cell of text from outside. A spreadsheet runs a cell that begins with one of these as a formula: an apostrophe
/// before it keeps it text.
pub(super) fn text(cell: &str) -> String {
    match cell.chars().next() {
        Some('=' | '+' | '-' | '@' | '\t' | '\r') => format!("'{cell}"),
        _ => cell.to_owned(),
    }
}

/// A cell that the program makes itself: a number, a time, a word.
pub(super) fn plain(cell: impl Into<String>) -> String {
    cell.into()
}

/// A number with fixed decimals; empty if there is none.
pub(super) fn number(value: Option<impl Into<Exact>>, decimals: u8, dialect: CsvDialect) -> String {
    let Some(value) = value.map(Into::<Exact>::into).filter(|value| value.is_finite()) else { return String::new() };
    localised(digits(value, Some(decimals)), dialect)
}

pub(super) fn localised(digits: String, dialect: CsvDialect) -> String {
    if dialect.decimal == '.' { digits } else { digits.replace('.', &dialect.decimal.to_string()) }
}

/// Percent of a share, cut and not rounded to one decimal: 100.0 is written only if nothing was missing.
pub(super) fn floor_percent(share: f64) -> f64 {
    (share * 1000.0 + 1e-9).floor() / 10.0
}

pub(super) fn iso(zone: &TimeZone, at: Timestamp) -> String {
    at.to_zoned(zone.clone()).strftime("%Y-%m-%dT%H:%M:%S%:z").to_string()
}

pub(super) fn iso_millis(zone: &TimeZone, at: Timestamp) -> String {
    at.to_zoned(zone.clone()).strftime("%Y-%m-%dT%H:%M:%S%.3f%:z").to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decimal_mark_follows_the_separator() {
        let german = CsvDialect { separator: ';', decimal: ',', bom: false };
        assert_eq!(CsvDialect::default().with(Some(";"), false), german);
        assert_eq!(german.with(Some(","), true), CsvDialect { bom: true, ..CsvDialect::default() });
        assert_eq!(german.with(None, false), german);
        assert_eq!(german.toggled(german), CsvDialect::default());
        assert_eq!(CsvDialect::default().toggled(german), german);
    }
}
