//! The record alone as CSV: time, offset, SV in use, PV, ER = SV − PV; one header row.

use super::{
    DECIMALS_UNKNOWN, ReportFormat, ShiftReport, Style, csv,
    document::{Content, Document},
    shift_csv::table_rows,
};
use crate::plant::{
    def::{PlantDef, Section},
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
        "time, SV, PV and ER as CSV"
    }

    /// Its file may lie beside that of `csv`.
    fn extension(&self) -> &'static str {
        "record.csv"
    }

    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        let section = document.sections.iter().find(|section| section.kind == Section::Record);
        let Some(Content::Table(table)) = section.map(|section| &section.content) else {
            return Err("the report has no record: [report] record names its controller".into());
        };
        let rows = document.locale.within(|| table_rows(table, &document.zone, style.csv));
        Ok(csv::write(rows.into_iter(), style.csv))
    }
}

/// Decimals of the recorded controller: those of its PV, as the report has them.
pub(crate) fn record_decimals(report: &ShiftReport, def: &PlantDef) -> u8 {
    let pv =
        def.report.record.and_then(|(device, _)| def.device(device).faceplate.as_ref()).map(|face| def.tag(face.pv));
    let Some(pv) = pv else { return DECIMALS_UNKNOWN };
    match (report.tags.iter().find(|tag| tag.tag == pv.name), pv.decimals) {
        (Some(tag), _) => tag.decimals,
        (None, Decimals::Fixed(decimals)) => decimals,
        (None, Decimals::From(_) | Decimals::PowerFrom(_)) => DECIMALS_UNKNOWN,
    }
}
