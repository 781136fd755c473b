//! The rows of a period: date, time, SV, PV and ER of the record.

use std::cmp::Ordering;

use super::{Export, Key, Page};
use crate::report::{self, RecordRow, ShiftReport, record_csv::record_decimals};
use crate::ui::tabs::prelude::*;

pub const KEYS: &[&[Key]] = &[&[
    Key::change(code(KeyCode::Left), "earlier", "rows of the previous shift", |reports, cx| reports.step(cx, -1)),
    Key::change(code(KeyCode::Right), "later", "rows of the next shift", |reports, cx| reports.step(cx, 1)),
    Key::new(char('e'), "export", "write the rows to a CSV file", |reports, cx| {
        let format = report::FORMATS.iter().find(|format| format.name() == "record");
        let chosen = reports.format;
        reports.format = format.copied().unwrap_or(chosen);
        let actions = reports.export(cx);
        reports.format = chosen;
        actions
    })
    .needs(Role::Technician),
    Key::change(char('n'), "report", "the figures of the report", |reports, _| {
        (reports.page, reports.export) = (Page::Report, Export::Not);
    }),
]];

/// The rows of the record of a report.
#[derive(Debug, Default)]
pub struct RecordRows;

/// A row with the decimals of its report.
#[derive(Debug, Clone)]
pub struct Recorded(RecordRow, u8);

impl Listing for RecordRows {
    type Answer = Box<ShiftReport>;
    type Row = Recorded;
    type Id = Timestamp;

    const TRENDS: bool = true;
    const NEWEST_FIRST: bool = false;
    const ACTS: bool = false;

    fn heading<'a>(&self, cx: &ViewContext<'a>, report: Option<&'a Box<ShiftReport>>) -> Heading<'a> {
        let words = match report.map(|report| report.record.len()) {
            None | Some(0) => String::new(),
            Some(count) => t!("{count} rows", count),
        };
        Heading::new("", t!("this period has no record")).words(words, cx.theme.normal()).asked(None, report.is_none())
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, report: Option<&'a Box<ShiftReport>>) -> Vec<Cow<'a, Recorded>> {
        let Some(report) = report else { return Vec::new() };
        let decimals = record_decimals(report, cx.def());
        report.record.iter().map(|row| Cow::Owned(Recorded(*row, decimals))).collect()
    }

    fn id(row: &Recorded) -> Timestamp {
        row.0.at
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<Recorded>> {
        vec![
            left(11, t!("date"), |cx, row: &Recorded| cx.local(row.0.at, "%Y-%m-%d")).by(|a, b| a.0.at.cmp(&b.0.at)),
            left(10, t!("time"), |cx, row: &Recorded| cx.local(row.0.at, "%H:%M:%S")).by(|a, b| a.0.at.cmp(&b.0.at)),
            right(8, "SV", |_, row: &Recorded| number(row, row.0.sv)).by(|a, b| compare(a.0.sv, b.0.sv)),
            right(8, "PV", |_, row: &Recorded| number(row, row.0.pv)).by(|a, b| compare(a.0.pv, b.0.pv)),
            right(8, "ER", |_, row: &Recorded| number(row, row.0.er)).by(|a, b| compare(a.0.er, b.0.er)),
        ]
    }

    fn style(&self, cx: &ViewContext, row: &Recorded) -> Style {
        if row.0.sv.is_some() && row.0.pv.is_some() { cx.theme.normal() } else { cx.theme.trouble() }
    }

    /// The title of the report is above it, and what became of its file below.
    fn height(&self, cx: &ViewContext) -> u16 {
        cx.area.height.saturating_sub(2)
    }

    fn moment(&self, row: &Recorded) -> Option<Timestamp> {
        Some(row.0.at)
    }

    /// A quarter of an hour on each side.
    fn trend(&self, cx: &ViewContext, row: &Recorded) -> Option<(TagId, (Timestamp, Timestamp))> {
        let (device, _) = cx.def().report.record?;
        let pv = cx.def().device(device).faceplate.as_ref()?.pv;
        let around = SignedDuration::from_mins(15);
        Some((pv, (row.0.at.checked_sub(around).ok()?, row.0.at.checked_add(around).ok()?.min(cx.now))))
    }
}

fn number(row: &Recorded, value: Option<Exact>) -> String {
    value.map_or("----".to_owned(), |value| digits(value, Some(row.1)))
}

fn compare(a: Option<Exact>, b: Option<Exact>) -> Ordering {
    let figure = |value: Option<Exact>| value.map_or(f64::INFINITY, |value| value.near());
    figure(a).total_cmp(&figure(b))
}
