//! Stored values at a fixed interval as CSV: one row an instant, one column a tag.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::csv::{Table, iso_millis, number, plain, text};
use crate::plant::def::{CsvDialect, PlantDef};

/// A tag to export.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// `TIC-1.PV`.
    pub tag: String,
    /// `°C`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// The good value that stood at the end of each interval; a gap is a gap.
    pub values: Vec<Option<f64>>,
}

/// The table: time with offset, then the tags with their units in the header. The first row stands one interval after
/// `from`: a value belongs to the instant that it was known at.
pub fn export_csv(
    def: &PlantDef,
    from: Timestamp,
    every: Duration,
    columns: &[Column],
    dialect: CsvDialect,
) -> Vec<u8> {
    let mut table = Table::default();
    let head = |column: &Column| match column.unit.is_empty() {
        true => text(&column.tag),
        false => text(&format!("{} {}", column.tag, column.unit)),
    };
    table.row(std::iter::once(plain("time")).chain(columns.iter().map(head)).collect());
    let rows = columns.iter().map(|column| column.values.len()).max().unwrap_or(0);
    for row in 0..rows {
        let Some(at) = instant(from, every, row + 1) else { break };
        let cells =
            columns.iter().map(|column| number(column.values.get(row).copied().flatten(), column.decimals, dialect));
        table.row(std::iter::once(plain(iso_millis(&def.time_zone, at))).chain(cells).collect());
    }
    table.write(dialect)
}

/// Each instant is computed from the start, so that no rounding adds up.
fn instant(from: Timestamp, every: Duration, count: usize) -> Option<Timestamp> {
    let nanos = i128::try_from(every.as_nanos()).ok()?.checked_mul(count as i128)?;
    from.checked_add(SignedDuration::from_nanos_i128(nanos)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{THREE, at, plant};

    #[test]
    fn a_gap_is_an_empty_cell_and_times_carry_their_offset() {
        let def = plant("Asia/Bangkok", &THREE);
        let column = |tag: &str, unit: &str, values: &[Option<f64>]| Column {
            tag: tag.into(),
            unit: unit.into(),
            decimals: 1,
            values: values.to_vec(),
        };
        let columns = [column("TIC-1.PV", "°C", &[Some(20.04), None]), column("=RUN", "", &[None, Some(1.0)])];
        let from = at("2026-11-21T06:00+07");
        let german = CsvDialect { separator: ';', decimal: ',', bom: false };
        let bytes = export_csv(&def, from, Duration::from_millis(1_500), &columns, german);
        let expect = "time;TIC-1.PV °C;'=RUN\r\n\
            2026-11-21T06:00:01.500+07:00;20,0;\r\n2026-11-21T06:00:03.000+07:00;;1,0\r\n";
        assert_eq!(String::from_utf8(bytes).as_deref(), Ok(expect));
    }
}
