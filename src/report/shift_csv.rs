//! The whole shift report as CSV: one file, sections of equal width.

use jiff::tz::TimeZone;

use super::{
    Gap, ReportFormat, ShiftReport, SuppressedSummary, TagFigures,
    alarm_metrics::{self, BadActor, Row},
    batch,
    csv::{Table, floor_percent, iso, iso_millis, number, plain, shortest, text},
    raised, record_csv,
};
use crate::plant::{
    def::{CsvDialect, PlantDef, Priority},
    record::{ActionRecord, AlarmRecord},
};

/// The format `csv`.
#[derive(Debug)]
pub struct ShiftCsv;

impl ReportFormat for ShiftCsv {
    fn name(&self) -> &'static str {
        "csv"
    }
    fn about(&self) -> &'static str {
        "everything"
    }

    fn render(&self, report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
        shift_csv(report, def, dialect)
    }
}

/// The whole report: facts, tags, batches, what could not be read, alarm counts, suppressed alarms, alarm metrics, alarms
/// to investigate, alarm list, operator actions, record. Every section has a title row, a header row and its rows; every row has as many columns
/// as the widest. The same report gives the same bytes.
fn shift_csv(report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
    let zone = &def.time_zone;
    let mut table = Table::default();
    let header = ["plant", "shift", "from", "to", "until", "program", "audit entry", "audit hash"];
    table.section("shift report", &header);
    table.row(vec![
        text(&def.title),
        text(&report.period.name.to_string()),
        plain(iso(zone, report.period.from)),
        plain(iso(zone, report.period.to)),
        plain(iso(zone, report.until)),
        plain(concat!("sightglass ", env!("CARGO_PKG_VERSION"))),
        plain(report.audit.map(|entry| entry.number.to_string()).unwrap_or_default()),
        plain(report.audit.map(|entry| entry.hash_hex()).unwrap_or_default()),
    ]);
    table.section("tags", &["tag", "unit", "min", "mean", "max", "last", "minutes in alarm", "good %", "difference"]);
    report.tags.iter().for_each(|tag| table.row(tag_row(tag, dialect)));
    if !report.unreadable.is_empty() {
        table.section("not readable, not counted", &["from", "to", "why"]);
        for Gap { from, to, why } in &report.unreadable {
            table.row(vec![plain(iso(zone, *from)), plain(iso(zone, *to)), text(why)]);
        }
    }
    if !report.batches.is_empty() {
        batch::add_section(&mut table, &report.batches, def, dialect);
    }
    table.section("alarm counts", &["priority", "raised", "raised while suppressed"]);
    for priority in Priority::ALL {
        let suppressed = report.suppressed.iter().filter(|alarm| alarm.priority == priority);
        let suppressed: u64 = suppressed.map(|alarm| alarm.raised).sum();
        let raised = raised(&report.alarms, priority);
        table.row(vec![plain(priority.word()), plain(raised.to_string()), plain(suppressed.to_string())]);
    }
    table.section("suppressed alarms", &["priority", "subject", "alarm", "raised", "minutes active"]);
    report.suppressed.iter().for_each(|alarm| table.row(suppressed_row(alarm, dialect)));
    table.section("alarm metrics", &["metric", "value", "target", "limit", "result"]);
    alarm_metrics::rows(&report.alarm_metrics).iter().for_each(|row| table.row(metric_row(row, dialect)));
    table.section("alarms to investigate", &["kind", "subject", "alarm", "raised"]);
    alarm_metrics::bad_actors(&report.alarm_metrics).iter().for_each(|alarm| table.row(bad_actor_row(alarm)));
    table.section("alarms", &["time", "priority", "subject", "alarm", "event", "value", "limit", "by", "reason"]);
    report.alarms.iter().for_each(|alarm| table.row(alarm_row(alarm, zone, dialect)));
    table.section("operator actions", &["time", "by", "action", "target", "old", "new", "outcome"]);
    report.actions.iter().for_each(|action| table.row(action_row(action, zone)));
    record_csv::add_section(&mut table, report, def, dialect);
    table.write(dialect)
}

fn tag_row(tag: &TagFigures, dialect: CsvDialect) -> Vec<String> {
    let value = |value: Option<f64>| number(value, tag.decimals, dialect);
    vec![
        text(&tag.tag),
        text(&tag.unit),
        value(tag.min),
        // One more decimal than the device has: a mean is finer than its samples.
        number(tag.mean, tag.decimals.saturating_add(1), dialect),
        value(tag.max),
        value(tag.last),
        number(Some(tag.in_alarm.as_secs_f64() / 60.0), 1, dialect),
        number(Some(floor_percent(tag.good)), 1, dialect),
        value(tag.difference),
    ]
}

fn suppressed_row(alarm: &SuppressedSummary, dialect: CsvDialect) -> Vec<String> {
    vec![
        plain(alarm.priority.word()),
        text(&alarm.subject),
        text(&alarm.message),
        plain(alarm.raised.to_string()),
        number(Some(alarm.active.as_secs_f64() / 60.0), 1, dialect),
    ]
}

fn metric_row(row: &Row, dialect: CsvDialect) -> Vec<String> {
    vec![
        plain(row.measure),
        number(row.value, row.decimals, dialect),
        plain(&row.target),
        plain(&row.limit),
        plain(row.result),
    ]
}

fn bad_actor_row(alarm: &BadActor) -> Vec<String> {
    let raised = alarm.raised.map(|raised| raised.to_string()).unwrap_or_default();
    vec![plain(alarm.kind), text(&alarm.subject), text(&alarm.alarm), plain(raised)]
}

fn alarm_row(alarm: &AlarmRecord, zone: &TimeZone, dialect: CsvDialect) -> Vec<String> {
    vec![
        plain(iso_millis(zone, alarm.at)),
        plain(alarm.priority.word()),
        text(&alarm.subject),
        text(&alarm.message),
        plain(alarm.event.word()),
        shortest(alarm.value, dialect),
        shortest(alarm.limit, dialect),
        text(alarm.by.as_deref().unwrap_or("")),
        text(alarm.reason.as_deref().unwrap_or("")),
    ]
}

fn action_row(action: &ActionRecord, zone: &TimeZone) -> Vec<String> {
    vec![
        plain(iso_millis(zone, action.at)),
        text(&action.by),
        text(&action.action),
        text(&action.target),
        text(action.old.as_deref().unwrap_or("")),
        text(action.new.as_deref().unwrap_or("")),
        text(&action.outcome),
    ]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
