//! The record alone as CSV: date, time with offset, SV in use, PV, ER = SV − PV; one header row.

use jiff::tz::TimeZone;

use super::{
    DECIMALS_UNKNOWN, RecordRow, ReportFormat, ShiftReport,
    csv::{Table, number, plain},
};
use crate::plant::{
    def::{CsvDialect, PlantDef},
    tag::Decimals,
};

/// The format `record`.
#[derive(Debug)]
pub struct RecordCsv;

impl ReportFormat for RecordCsv {
    fn name(&self) -> &'static str {
        "record"
    }
    fn about(&self) -> &'static str {
        "date, time, SV, PV and ER as CSV"
    }

    fn render(&self, report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
        let mut table = Table::default();
        table.row(RECORD_HEADER.iter().map(|word| plain(*word)).collect());
        add_rows(&mut table, report, def, dialect);
        table.write(dialect)
    }
}

/// The record as the last section of the whole report.
pub(super) fn add_section(table: &mut Table, report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) {
    let Some((name, unit)) = &report.record_of else { return };
    let title = if unit.is_empty() { format!("record {name}") } else { format!("record {name} in {unit}") };
    table.section(&title, &RECORD_HEADER);
    add_rows(table, report, def, dialect);
}

fn add_rows(table: &mut Table, report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) {
    let decimals = record_decimals(report, def);
    report.record.iter().for_each(|row| table.row(record_row(row, &def.time_zone, decimals, dialect)));
}

const RECORD_HEADER: [&str; 5] = ["date", "time", "SV", "PV", "ER"];

fn record_row(row: &RecordRow, zone: &TimeZone, decimals: u8, dialect: CsvDialect) -> Vec<String> {
    let local = row.at.to_zoned(zone.clone());
    vec![
        plain(local.strftime("%Y-%m-%d").to_string()),
        plain(local.strftime("%H:%M:%S%.f%:z").to_string()),
        number(row.sv, decimals, dialect),
        number(row.pv, decimals, dialect),
        number(row.er, decimals, dialect),
    ]
}

/// Decimals of the recorded controller: those of its PV, as the report has them.
fn record_decimals(report: &ShiftReport, def: &PlantDef) -> u8 {
    let pv =
        def.report.record.and_then(|(device, _)| def.device(device).faceplate.as_ref()).map(|face| def.tag(face.pv));
    let Some(pv) = pv else { return DECIMALS_UNKNOWN };
    match (report.tags.iter().find(|tag| tag.tag == pv.name), pv.decimals) {
        (Some(tag), _) => tag.decimals,
        (None, Decimals::Fixed(decimals)) => decimals,
        (None, Decimals::From(_)) => DECIMALS_UNKNOWN,
    }
}
