//! What a report says: its figures as the sections of a [`Document`], in the language asked for. Names and notes stay
//! as they were recorded.

mod alarms;
mod production;

use std::{sync::Arc, time::Duration};

use jiff::{Timestamp, civil, tz::TimeZone};

use super::{
    Compared, Gap, Outage, Period, PeriodName, ShiftReport, TagFigures, alarm_metrics,
    coarse::{Coarse, Kept},
    control_runs,
    csv::floor_percent,
    document::{Cell, Column, ColumnKind, Content, Document, Fact, Section, Table, Times, plain},
    figures, raised,
    record_csv::record_decimals,
};
use crate::{
    plant::{
        def::{PlantDef, Priority, Section as Kind},
        exact::Exact,
        record::ActionRecord,
        recorded_action::RecordedAction,
    },
    t,
    text::{self, Locale, recorded, translate},
};

/// The report as a document: the sections that the plant file asks for, without those that would be empty.
pub fn document(report: &ShiftReport, def: &PlantDef, locale: Locale) -> Document {
    let in_words = || {
        let section = |kind: &Kind| {
            let content = content(*kind, report, def)?;
            Some(Section { kind: *kind, title: title(*kind, report), content })
        };
        let what = match (def.report.title.as_str(), &report.period.name) {
            ("", PeriodName::Shift { .. }) => t!("Shift report"),
            ("", _) => t!("Report"),
            (own, _) => own,
        };
        let zone = def.time_zone.clone();
        let times = Times::of(&zone, report.period.from, report.until);
        Document {
            logo: def.report.logo.clone(),
            title: text::of_plant(&def.title).to_owned(),
            heading: plain(&format!("{what}: {}", name(&report.period, &zone))),
            locale,
            zone,
            times,
            from: report.period.from,
            until: report.until,
            sections: def.report.sections.iter().filter_map(section).collect(),
        }
    };
    def.texts.within(|| locale.within(in_words))
}

/// The name of a period, its date in words; of a free one its times.
fn name(period: &Period, zone: &TimeZone) -> String {
    let date = |date: civil::Date| text::date(date);
    match &period.name {
        PeriodName::Free => {
            let time = |at: Timestamp| at.to_zoned(zone.clone()).strftime("%Y-%m-%d %H:%M").to_string();
            format!("{} – {}", time(period.from), time(period.to))
        }
        PeriodName::Shift { name, date: day } => format!("{name} {}", date(*day)),
        PeriodName::Day(day) => t!("day {date}", date = date(*day)),
        PeriodName::Week(_) | PeriodName::Month(_) => period.name.to_string(),
        PeriodName::Batch(name) => name.clone(),
    }
}

/// The word of a section, as a title.
fn title(kind: Kind, report: &ShiftReport) -> String {
    if kind == Kind::Record {
        return plain(&record_title(report));
    }
    let word = plain(translate(kind.word()));
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn record_title(report: &ShiftReport) -> String {
    match &report.record_of {
        Some((of, unit)) if unit.is_empty() => t!("Record of {of}", of),
        Some((of, unit)) => t!("Record of {of} in {unit}", of, unit),
        None => t!("Record").to_owned(),
    }
}

/// What a section holds; `None` if that is nothing.
fn content(kind: Kind, report: &ShiftReport, def: &PlantDef) -> Option<Content> {
    let table = |table: Table| (!table.rows.is_empty()).then_some(Content::Table(table));
    match kind {
        Kind::Summary => Some(Content::Facts(summary(report, def))),
        Kind::Handover => table(handover(report)),
        Kind::Values => table(values(&report.tags, def)),
        Kind::Comparison => table(comparison(report, def)),
        Kind::Counters => table(production::counters(&report.counters, def)),
        Kind::Runs => table(production::runs(&report.runs, def)),
        Kind::Curves => (!report.charts.is_empty()).then(|| Content::Charts(report.charts.clone())),
        Kind::Batches => table(production::batches(&report.batches)),
        Kind::ControlRuns => table(control_runs::table(&report.control_runs, &report.run_parts)),
        Kind::Gaps => table(gaps(report)),
        Kind::AlarmCounts => table(alarms::alarm_counts(report)),
        Kind::Suppressed => table(alarms::suppressed(&report.suppressed)),
        Kind::Metrics => table(alarms::metrics(&alarm_metrics::rows(&report.alarm_metrics))),
        Kind::Investigate => table(alarms::bad_actors(&alarm_metrics::bad_actors(&report.alarm_metrics))),
        Kind::Alarms => table(alarms::alarms(&report.alarms)),
        Kind::Actions => table(actions(&report.actions)),
        Kind::Record => table(record(report, def)),
        Kind::Signatures => {
            let lines = &def.report.signatures;
            (!lines.is_empty()).then(|| Content::Signatures(lines.clone()))
        }
        Kind::Provenance => Some(Content::Facts(provenance(report, def))),
    }
}

fn fact(name: &'static str, cell: Cell) -> Fact {
    Fact { id: name, name: plain(translate(name)), cell }
}

fn summary(report: &ShiftReport, def: &PlantDef) -> Vec<Fact> {
    let mut facts = vec![
        fact("plant", Cell::text(text::of_plant(&def.title))),
        fact("period", Cell::text(name(&report.period, &def.time_zone))),
        fact("from", Cell::Time(report.period.from)),
        fact("to", Cell::Time(report.period.to)),
    ];
    if report.until < report.period.to {
        facts.push(fact("still running, figures until", Cell::Time(report.until)));
    }
    if report.unstored != Some(0) {
        let waiting = report.unstored.map_or(Cell::text("?"), |records| Cell::number(Some(records as f64), 0));
        facts.push(fact("records not stored yet, and missing here", waiting));
    }
    let good: f64 = report.tags.iter().map(|tag| tag.good).sum();
    let tags = report.tags.len();
    let share = (tags > 0).then(|| floor_percent(good / tags as f64));
    facts.push(fact("good values %", Cell::number(share, 1)));
    let of = |priority| raised(&report.alarms, priority);
    facts.push(fact("alarms", Cell::count(Priority::ALL.into_iter().map(of).sum())));
    // Not in the list of events: who needs them looks into the journal.
    if let quiet @ 1.. = report.alarms.iter().filter(|alarm| alarm.event.is_quiet()).count() {
        facts.push(fact("alarm events not annunciated", Cell::count(quiet)));
    }
    facts.push(fact("operator actions", Cell::count(report.actions.len())));
    if !def.report.text.is_empty() {
        facts.push(fact("note", Cell::text(&def.report.text)));
    }
    facts
}

/// The notes to the next shift, and who took the plant over.
fn handover(report: &ShiftReport) -> Table {
    let of = |action: &&ActionRecord| action.is(RecordedAction::HandOver) || action.is(RecordedAction::TakeOver);
    let columns = [Column::time("time"), Column::text("by"), Column::text("action"), Column::text("note")];
    Table::new(columns).with(report.actions.iter().filter(of).map(|action| {
        let note = Cell::text(action.note.as_deref().unwrap_or(""));
        vec![
            Cell::Time(action.at),
            Cell::text(&action.by),
            Cell::text(RecordedAction::translated(&action.action)),
            note,
        ]
    }))
}

fn minutes(seconds: Duration) -> Cell {
    Cell::number(Some(seconds.as_secs_f64() / 60.0), 1)
}

/// One decimal more than the values have: a mean is finer than its samples.
fn mean(tag: &TagFigures) -> Cell {
    Cell::number(tag.mean, tag.decimals.saturating_add(1))
}

/// What a tag is: on pages beside its name, in files behind all other columns, so that who counts them counts as before.
fn label(def: &PlantDef, tag: &str) -> Cell {
    let tag = def.tag_named(tag).map(|tag| def.tag(tag)).filter(|tag| tag.label != tag.short);
    Cell::text(tag.map_or("", |tag| text::of_plant(&tag.label)))
}

fn values(tags: &[TagFigures], def: &PlantDef) -> Table {
    let columns = [
        Column::text("tag"),
        Column::text("unit"),
        Column::number("first"),
        Column::number("min"),
        Column::number("mean"),
        Column::number("max"),
        Column::number("last"),
        Column::number("difference"),
        Column::number("minutes in alarm"),
        Column::number("good %"),
        Column::text("label"),
    ];
    Table::new(columns).with(tags.iter().map(|tag| {
        let value = |value: Option<Exact>| Cell::number(value, tag.decimals);
        vec![
            Cell::text(&tag.tag),
            Cell::text(&tag.unit),
            value(tag.first),
            value(tag.min),
            mean(tag),
            value(tag.max),
            value(tag.last),
            value(tag.difference),
            minutes(tag.in_alarm),
            Cell::number(Some(floor_percent(tag.good)), 1),
            label(def, &tag.tag),
        ]
    }))
}

/// Means, and differences of counters, beside those of the periods compared with.
fn comparison(report: &ShiftReport, def: &PlantDef) -> Table {
    let mut table =
        Table::new([Column::text("tag"), Column::text("unit"), Column::text("figure"), Column::number("this period")]);
    for Compared { period, .. } in &report.compared {
        let (id, heading) = (period.name.to_string(), plain(&self::name(period, &def.time_zone)));
        table.columns.push(Column { id: id.clone(), heading, kind: ColumnKind::Number });
        table.columns.push(Column { id: format!("change from {id}"), ..Column::number("change") });
    }
    table.columns.push(Column::text("label"));
    if report.compared.is_empty() {
        return table;
    }
    table.rows = report.tags.iter().map(|tag| compared_row(tag, &report.compared, def)).collect();
    table
}

fn compared_row(tag: &TagFigures, compared: &[Compared], def: &PlantDef) -> Vec<Cell> {
    let counts = tag.difference.is_some();
    let figure = |tag: &TagFigures| if counts { tag.difference } else { tag.mean };
    let cell =
        |value: Option<Exact>| Cell::number(value, if counts { tag.decimals } else { tag.decimals.saturating_add(1) });
    let word = if counts { t!("difference") } else { t!("mean") };
    let [name, unit] = [&tag.tag, &tag.unit].map(Cell::text);
    let mut row = vec![name, unit, Cell::text(word), cell(figure(tag))];
    for Compared { tags, .. } in compared {
        // Where the device chose another unit then, nothing is compared.
        let before = tags.iter().find(|other| other.tag == tag.tag && other.unit == tag.unit).and_then(figure);
        let change = figure(tag).zip(before).map(|(now, before)| now - before);
        row.extend([cell(before), cell(change)]);
    }
    row.push(label(def, &tag.tag));
    row
}

/// Where values are missing: what could not be read, devices that did not answer, times without a station.
fn gaps(report: &ShiftReport) -> Table {
    let columns = [
        Column::time("from"),
        Column::time("to"),
        Column::number("minutes"),
        Column::text("what"),
        Column::text("why"),
    ];
    let row = |from: Timestamp, to: Timestamp, what: &str, why: &str| {
        let lasted = Cell::number(Some(to.duration_since(from).as_secs_f64() / 60.0), 1);
        vec![Cell::Time(from), Cell::Time(to), lasted, Cell::text(what), Cell::text(recorded(why))]
    };
    let unreadable =
        report.unreadable.iter().map(|Gap { from, to, why }| row(*from, *to, t!("not readable, not counted"), why));
    let outages = report.outages.iter().map(|Outage { from, to, what, why }| {
        let why = match why.as_str() {
            figures::NOT_RUNNING => t!("not running"),
            figures::CLOCK_SET_FORWARD => t!("clock set forward"),
            why => translate(why),
        };
        row(*from, *to, what.as_deref().unwrap_or(t!("station")), why)
    });
    let coarse = report.coarse.iter().map(|Coarse { from, to, kept }| {
        let why = match kept {
            Kept::Minutes => t!("deleted by age or for room: figures are those of minutes"),
            Kept::Hours => t!("deleted by age or for room: figures are those of hours"),
            Kept::Nothing => t!("deleted by age or for room: there are no figures"),
        };
        row(*from, *to, t!("samples"), why)
    });
    Table::new(columns).with(unreadable.chain(coarse).chain(outages))
}

fn actions(actions: &[ActionRecord]) -> Table {
    let columns = [
        Column::milliseconds("time"),
        Column::text("by"),
        Column::text("action"),
        Column::text("target"),
        Column::text("old"),
        Column::text("new"),
        Column::text("outcome"),
        Column::text("note"),
    ];
    Table::new(columns).with(actions.iter().map(|action| {
        let text = |text: &Option<Arc<str>>| Cell::text(text.as_deref().unwrap_or(""));
        vec![
            Cell::Time(action.at),
            Cell::text(&action.by),
            Cell::text(RecordedAction::translated(&action.action)),
            Cell::text(&action.target),
            text(&action.old),
            text(&action.new),
            Cell::text(recorded(&action.outcome)),
            text(&action.note),
        ]
    }))
}

/// SV, PV and ER at a fixed interval.
fn record(report: &ShiftReport, def: &PlantDef) -> Table {
    let decimals = record_decimals(report, def);
    let columns = [Column::time("time"), Column::number("SV"), Column::number("PV"), Column::number("ER")];
    Table::new(columns).with(report.record.iter().map(|row| {
        let values = [row.sv, row.pv, row.er].map(|value| Cell::number(value, decimals));
        std::iter::once(Cell::Time(row.at)).chain(values).collect()
    }))
}

/// What made the report, and of what.
fn provenance(report: &ShiftReport, def: &PlantDef) -> Vec<Fact> {
    let mut facts = vec![
        fact("program", Cell::text(concat!("sightglass ", env!("CARGO_PKG_VERSION")))),
        fact("plant file SHA-256", Cell::text(&def.file_sha256)),
        fact("time zone", Cell::text(zone_name(&def.time_zone))),
    ];
    if let Some(entry) = report.audit {
        facts.push(fact("audit entry", Cell::number(Some(entry.number as f64), 0)));
        facts.push(fact("audit hash", Cell::text(entry.hash_hex())));
    }
    facts
}

fn zone_name(zone: &TimeZone) -> String {
    zone.iana_name().unwrap_or("UTC").to_owned()
}
