//! Stored values at a fixed interval as CSV: one row an instant, two columns a tag, its value and its quality.

use std::time::Duration;

use jiff::Timestamp;

use super::{
    csv::{self, iso_millis, number, plain, text},
    step_series::HeldValue,
};
use crate::plant::def::{CsvDialect, PlantDef};
use crate::plant::time::instant_of_grid;

/// A tag to export.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// `TIC-1.PV`.
    pub tag: String,
    /// `°C`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// What stood at the end of each interval; `None` where nothing was stored.
    pub values: Vec<Option<HeldValue>>,
}

/// The table: time with offset, then of each tag the value, with its unit in the header, and the quality: `good`,
/// `bad: response timeout`, or `none` where nothing was stored. A value that is not good is left out. The first row is one
/// interval after `from`: a value belongs to the instant at which it was known.
pub fn export_csv(
    def: &PlantDef,
    from: Timestamp,
    every: Duration,
    columns: &[Column],
    dialect: CsvDialect,
) -> Vec<u8> {
    let head = |column: &Column| heading(&column.tag, &column.unit);
    let cells = |column: &Column, row: usize| {
        let stood = column.values.get(row).copied().flatten();
        let good = stood.filter(|stood| stood.quality.is_good()).and_then(|stood| stood.value);
        let quality = stood.map_or_else(|| "none".to_owned(), |stood| stood.quality.word());
        [number(good, column.decimals, dialect), plain(quality)]
    };
    let header = std::iter::once(plain("time")).chain(columns.iter().flat_map(head)).collect();
    let count = columns.iter().map(|column| column.values.len()).max().unwrap_or(0);
    let rows = (0..count).map_while(|row| {
        let at = plain(iso_millis(&def.time_zone, instant_of_grid(from, every, row + 1)?));
        Some(std::iter::once(at).chain(columns.iter().flat_map(|column| cells(column, row))).collect())
    });
    csv::write(std::iter::once(header).chain(rows), dialect)
}

/// The headings of the two columns of a tag.
pub(super) fn heading(tag: &str, unit: &str) -> [String; 2] {
    let value = if unit.is_empty() { text(tag) } else { text(&format!("{tag} {unit}")) };
    [value, text(&format!("{tag}{QUALITY}"))]
}

/// What makes a heading that of a quality.
pub const QUALITY: &str = " quality";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::sample::{Cause, Sample},
        report::testing::{THREE, at, plant, sec},
    };

    #[test]
    fn every_cell_has_its_quality_and_only_good_values_are_written() {
        let def = plant("Asia/Bangkok", &THREE);
        let good = |value| Some(HeldValue::from(Sample::good(value, sec(0))));
        let column = |tag: &str, unit: &str, values: &[Option<HeldValue>]| Column {
            tag: tag.into(),
            unit: unit.into(),
            decimals: 1,
            values: values.to_vec(),
        };
        let doubted = Some(HeldValue::from(Sample::good(20.0, sec(0)).uncertain(Cause::Stale)));
        let bad = Some(HeldValue::from(Sample::bad(Cause::Timeout, sec(0))));
        let columns = [column("TIC-1.PV", "°C", &[good(20.04), bad]), column("=RUN", "", &[doubted, None])];
        let from = at("2026-11-21T06:00+07");
        let german = CsvDialect { separator: ';', decimal: ',', bom: false };
        let bytes = export_csv(&def, from, Duration::from_millis(1_500), &columns, german);
        let expect = "time;TIC-1.PV °C;TIC-1.PV quality;'=RUN;'=RUN quality\r\n\
            2026-11-21T06:00:01.500+07:00;20,0;good;;uncertain: stale\r\n\
            2026-11-21T06:00:03.000+07:00;;bad: response timeout;;none\r\n";
        assert_eq!(String::from_utf8(bytes).as_deref(), Ok(expect));
    }
}
