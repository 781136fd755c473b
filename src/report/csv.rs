//! A report as CSV: RFC 4180, one file, sections of equal width.

use jiff::{Timestamp, tz::TimeZone};

use super::{
    Gap, Period, RecordRow, ShiftReport, SuppressedAlarm, TagFigures,
    alarm_metrics::{self, BadActor, Row},
};
use crate::plant::{
    def::{CsvDialect, PlantDef, Priority},
    record::{ActionRecord, AlarmRecord, AlarmStep},
    tag::Decimals,
};

/// The whole report: facts, tags, what could not be read, alarm counts, suppressed alarms, alarm metrics, alarm list,
/// operator actions, raw record. Every section has a title row, a header row and its rows; every row has as many columns
/// as the widest. The same report gives the same bytes.
pub fn shift_csv(report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
    let zone = &def.time_zone;
    let mut table = Table::default();
    let header = ["plant", "shift", "from", "to", "until", "program", "audit entry", "audit hash"];
    table.section("shift report", &header);
    table.row(vec![
        text(&def.title),
        text(&report.period.name),
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
    table.section("alarm counts", &["priority", "raised", "raised while suppressed"]);
    for priority in [Priority::Critical, Priority::High, Priority::Medium, Priority::Low] {
        let suppressed = report.suppressed.iter().filter(|alarm| alarm.priority == priority);
        let suppressed: u64 = suppressed.map(|alarm| alarm.raised).sum();
        let raised = raised(&report.alarms, priority);
        table.row(vec![plain(priority.word()), plain(raised.to_string()), plain(suppressed.to_string())]);
    }
    table.section("suppressed alarms", &["priority", "subject", "alarm", "raised", "minutes active"]);
    report.suppressed.iter().for_each(|alarm| table.row(suppressed_row(alarm, dialect)));
    table.section("alarm metrics", &["measure", "figure", "target", "limit", "verdict"]);
    alarm_metrics::rows(&report.alarm_metrics).iter().for_each(|row| table.row(metric_row(row, dialect)));
    table.section("alarms to look into", &["kind", "subject", "alarm", "raised"]);
    alarm_metrics::bad_actors(&report.alarm_metrics).iter().for_each(|alarm| table.row(bad_actor_row(alarm)));
    table.section("alarms", &["time", "priority", "subject", "alarm", "step", "value", "limit", "by", "reason"]);
    report.alarms.iter().for_each(|alarm| table.row(alarm_row(alarm, zone, dialect)));
    table.section("operator actions", &["time", "by", "action", "target", "old", "new", "outcome"]);
    report.actions.iter().for_each(|action| table.row(action_row(action, zone)));
    if let Some((name, unit)) = &report.record_of {
        let decimals = record_decimals(report, def);
        let title = if unit.is_empty() { format!("record {name}") } else { format!("record {name} in {unit}") };
        table.section(&title, &RECORD_HEADER);
        report.record.iter().for_each(|row| table.row(record_row(row, zone, decimals, dialect)));
    }
    table.write(dialect)
}

/// The thesis's record alone: date, time with offset, SV, PV, ER = SV − PV; one header row.
pub fn record_csv(report: &ShiftReport, def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
    let decimals = record_decimals(report, def);
    let mut table = Table::default();
    table.row(RECORD_HEADER.iter().map(|word| plain(*word)).collect());
    report.record.iter().for_each(|row| table.row(record_row(row, &def.time_zone, decimals, dialect)));
    table.write(dialect)
}

/// Where the file of a report goes: `2026-11-21-morning.csv`. One of a running shift says until when, so that it is
/// never taken for the whole.
pub fn file_name(def: &PlantDef, period: &Period, until: Timestamp) -> String {
    let local = |at: Timestamp| at.to_zoned(def.time_zone.clone());
    let (from, to) = (local(period.from), local(period.to));
    let word = period.name.split_whitespace().next().unwrap_or("period");
    let running = until < period.to;
    let end = if running { local(until).strftime("-until-%H%M").to_string() } else { String::new() };
    if word == "period" {
        let to = if running { local(until) } else { to };
        return format!("{}-to-{}.csv", from.strftime("%Y-%m-%dT%H%M"), to.strftime("%Y-%m-%dT%H%M"));
    }
    let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
    format!("{}-{}{end}.csv", from.date(), word.chars().map(plain).collect::<String>())
}

/// Alarms of a priority that were raised.
pub fn raised(alarms: &[AlarmRecord], priority: Priority) -> usize {
    alarms.iter().filter(|alarm| alarm.step == AlarmStep::Raised && alarm.priority == priority).count()
}

const RECORD_HEADER: [&str; 5] = ["date", "time", "SV", "PV", "ER"];

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

fn suppressed_row(alarm: &SuppressedAlarm, dialect: CsvDialect) -> Vec<String> {
    vec![
        plain(alarm.priority.word()),
        text(&alarm.subject),
        text(&alarm.text),
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
        plain(row.verdict),
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
        text(&alarm.text),
        plain(alarm.step.word()),
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
    let Some(pv) = pv else { return super::DECIMALS_UNKNOWN };
    match (report.tags.iter().find(|tag| tag.tag == pv.name), pv.decimals) {
        (Some(tag), _) => tag.decimals,
        (None, Decimals::Fixed(decimals)) => decimals,
        (None, Decimals::From(_)) => super::DECIMALS_UNKNOWN,
    }
}

/// Rows of cells, made equally wide when written.
#[derive(Default)]
struct Table(Vec<Vec<String>>);

impl Table {
    fn section(&mut self, title: &str, header: &[&str]) {
        if !self.0.is_empty() {
            self.0.push(Vec::new());
        }
        self.0.push(vec![text(title)]);
        self.0.push(header.iter().map(|word| plain(*word)).collect());
    }

    fn row(&mut self, cells: Vec<String>) {
        self.0.push(cells);
    }

    fn write(self, dialect: CsvDialect) -> Vec<u8> {
        let width = self.0.iter().map(Vec::len).max().unwrap_or(0);
        let widened = |mut row: Vec<String>| {
            row.resize(width, String::new());
            row
        };
        write(self.0.into_iter().map(widened), dialect)
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

/// A cell of our own making: a number, a time, a word.
pub(super) fn plain(cell: impl Into<String>) -> String {
    cell.into()
}

/// A number with fixed decimals; empty if there is none.
pub(super) fn number(value: Option<f64>, decimals: u8, dialect: CsvDialect) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else { return String::new() };
    let digits = format!("{value:.*}", usize::from(decimals));
    // A value that rounds to nothing has no sign.
    let digits = match digits.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => digits,
    };
    localised(digits, dialect)
}

/// A number with as many digits as it has; empty if there is none.
fn shortest(value: Option<f64>, dialect: CsvDialect) -> String {
    value.filter(|value| value.is_finite()).map_or_else(String::new, |value| localised(value.to_string(), dialect))
}

fn localised(digits: String, dialect: CsvDialect) -> String {
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
#[allow(clippy::unwrap_used)]
mod tests;
