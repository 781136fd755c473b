//! Reports: the shift calendar, the figures of a shift, and the formats of its report; pure, rows in and bytes out.

mod csv;
pub mod step_series;
pub(crate) mod export;
pub(crate) mod shift;
pub mod curve;
pub(crate) mod typeface;
pub(crate) mod drawing;
pub(crate) mod figures;
pub(crate) mod chart;
pub mod document;
mod html;
pub(crate) mod calendar;
pub mod period_parser;
mod json;
pub mod decimal_mark;
pub(crate) mod value_log;
pub(crate) mod alarm_metrics;
pub mod coarse;
mod xlsx;
pub(crate) mod text;
pub mod batch;
pub(crate) mod automatic;
pub mod control_runs;
mod docx;
mod pdf;
pub mod procedures;
pub(crate) mod shift_csv;
pub(crate) mod record_csv;
pub mod counters;
pub mod content;
mod parquet;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use std::{borrow::Cow, fmt, sync::Arc, time::Duration};

use jiff::{Timestamp, civil};
use serde::{Deserialize, Serialize};

use self::{chart::Chart, document::Document};
use crate::{
    plant::{
        alarm::PeriodMetrics,
        control_run::ControlRun,
        def::{CsvDialect, Paper, PlantDef, Priority},
        exact::Exact,
        record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash},
        report::PeriodKind,
    },
    text::Language,
};

/// A format of the shift report. To add one: a file with this trait, and its module and row of [`FORMATS`] here.
pub trait ReportFormat: std::fmt::Debug + Sync {
    /// The value of `--format`.
    fn name(&self) -> &'static str;

    /// What it holds, for the help.
    fn about(&self) -> &'static str;

    /// The extension of its files.
    fn extension(&self) -> &'static str {
        "csv"
    }

    /// The bytes of its file: the same for the same document. `Err` says why there is none.
    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String>;

    /// A file for each table, by the word of its section, where the format has that.
    fn tables(&self, _document: &Document, _style: &Style) -> Result<Vec<(&'static str, Vec<u8>)>, String> {
        Err(format!("{} is one file: a file for each table is csv or parquet", self.name()))
    }

    /// The name of its file: `2026-11-21-morning.csv`, `2026-W47.csv`; for a running shift with the time up to which it has data:
    /// `2026-11-21-morning-until-0930.csv`.
    fn file_name(&self, def: &PlantDef, period: &Period, until: Timestamp) -> String {
        let local = |at: Timestamp| at.to_zoned(def.time_zone.clone());
        let (from, to) = (local(period.from), local(period.to));
        let running = until < period.to;
        // What is called by a date needs no other: its end is at most a day later.
        let form = if period.name.date().is_some() { "-until-%H%M" } else { "-until-%Y-%m-%dT%H%M" };
        let end = if running { local(until).strftime(form).to_string() } else { String::new() };
        let Some(word) = period.name.word() else {
            let to = if running { local(until) } else { to };
            let (from, to) = (from.strftime("%Y-%m-%dT%H%M"), to.strftime("%Y-%m-%dT%H%M"));
            return format!("{from}-to-{to}.{}", self.extension());
        };
        let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
        let word = word.chars().map(plain).collect::<String>();
        match period.name {
            // These words are dates.
            PeriodName::Week(_) | PeriodName::Month(_) => format!("{word}{end}.{}", self.extension()),
            PeriodName::Free | PeriodName::Shift { .. } | PeriodName::Day(_) | PeriodName::Batch(_) => {
                format!("{}-{word}{end}.{}", from.date(), self.extension())
            }
        }
    }
}

/// Every format of the report; the first is the default.
/// The plant file knows their names as [`crate::plant::report::REPORT_FORMATS`].
pub const FORMATS: [&dyn ReportFormat; 9] = [
    &shift_csv::ShiftCsv,
    &record_csv::RecordCsv,
    &text::Text,
    &html::Html,
    &json::Json,
    &xlsx::Xlsx,
    &docx::Docx,
    &pdf::PdfFile,
    &parquet::Parquet,
];

/// The language of the reports of a plant.
pub fn language(def: &PlantDef) -> Language {
    Language::from_code(&def.report.language).unwrap_or(Language::ENGLISH)
}

/// The bytes of a report in the language of its plant.
pub fn render(
    format: &dyn ReportFormat,
    report: &ShiftReport,
    def: &PlantDef,
    style: &Style,
) -> Result<Vec<u8>, String> {
    format.render(&content::document(report, def, language(def).locale()), style)
}

/// How a document is set, where a format leaves a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// CSV.
    pub csv: CsvDialect,
    /// The paper of pages.
    pub paper: Paper,
}

impl Style {
    /// As the plant file has it.
    pub fn of(def: &PlantDef) -> Style {
        Style { csv: def.report.csv, paper: def.report.paper }
    }
}

/// The help of `--format`: every format with what it holds.
pub fn formats_help() -> String {
    let rows = FORMATS.map(|format| format!("{} ({})", format.name(), format.about()));
    format!("What to write: {}", rows.join(", "))
}

/// The format of this name, or the names that there are.
pub fn format(name: &str) -> Result<&'static dyn ReportFormat, String> {
    let known = || FORMATS.map(ReportFormat::name).join(", ");
    FORMATS.into_iter().find(|format| format.name() == name).ok_or_else(|| format!("expected one of {}", known()))
}

/// Alarms of a priority that were raised.
pub fn raised(alarms: &[AlarmRecord], priority: Priority) -> usize {
    alarms.iter().filter(|alarm| alarm.event == AlarmEvent::Raised && alarm.priority == priority).count()
}

/// Decimals to print where the device has not said how many there are.
pub const DECIMALS_UNKNOWN: u8 = 2;

/// What a period is called.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum PeriodName {
    /// A period from any time to any other.
    Free,
    /// A shift.
    Shift {
        /// Its name in the plant file.
        name: String,
        /// The local date of its start.
        date: civil::Date,
    },
    /// A local day.
    Day(civil::Date),
    /// An ISO week, by its Monday.
    Week(civil::Date),
    /// A month, by its first day.
    Month(civil::Date),
    /// The time of a batch: its name and number.
    Batch(String),
}

impl PeriodName {
    /// The local date that the name has.
    pub fn date(&self) -> Option<civil::Date> {
        match self {
            PeriodName::Shift { date, .. } | PeriodName::Day(date) => Some(*date),
            PeriodName::Free | PeriodName::Week(_) | PeriodName::Month(_) | PeriodName::Batch(_) => None,
        }
    }

    /// The kind of period, where it is one of those that follow each other.
    pub fn kind(&self) -> Option<PeriodKind> {
        match self {
            PeriodName::Shift { .. } => Some(PeriodKind::Shift),
            PeriodName::Day(_) => Some(PeriodKind::Day),
            PeriodName::Week(_) => Some(PeriodKind::Week),
            PeriodName::Month(_) => Some(PeriodKind::Month),
            PeriodName::Free | PeriodName::Batch(_) => None,
        }
    }

    /// The word in the name of a file; `None` for a free period, which has its times there.
    fn word(&self) -> Option<Cow<'_, str>> {
        Some(match self {
            PeriodName::Free => return None,
            PeriodName::Shift { name, .. } | PeriodName::Batch(name) => name.into(),
            PeriodName::Day(_) => "day".into(),
            PeriodName::Week(monday) => {
                let week = monday.iso_week_date();
                format!("{}-W{:02}", week.year(), week.week()).into()
            }
            PeriodName::Month(first) => first.strftime("%Y-%m").to_string().into(),
        })
    }
}

/// `morning 2026-11-21`, `day 2026-11-21`, `2026-W47`, `2026-11`, `water-3`, `period`.
impl fmt::Display for PeriodName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.word().unwrap_or("period".into()))?;
        self.date().map_or(Ok(()), |date| write!(f, " {date}"))
    }
}

/// A span of time with a name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Period {
    /// What it is called.
    pub name: PeriodName,
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive; may lie in the future for a running shift.
    pub to: Timestamp,
}

impl Period {
    /// A period from any time to any other.
    pub fn free(from: Timestamp, to: Timestamp) -> Period {
        Period { name: PeriodName::Free, from, to }
    }
}

/// A span of stored values that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gap {
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub to: Timestamp,
    /// What the engine says, with the block.
    pub why: String,
}

/// The figures of a period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShiftReport {
    /// Which period.
    pub period: Period,
    /// Up to when data were there: the end of the period, or earlier for a running shift.
    pub until: Timestamp,
    /// The last entry of the audit log before `until`: whoever changes the log later must change every copy of the report.
    pub audit: Option<ChainHash>,
    /// Records that waited for the disk of the history when the report was made: whatever they say of the period is
    /// missing. `None` where the history did not say in time how many.
    pub unstored: Option<u64>,
    /// Where stored values could not be read: there, none is counted.
    pub unreadable: Vec<Gap>,
    /// One row a tag.
    pub tags: Vec<TagFigures>,
    /// The same of earlier periods to compare with.
    pub compared: Vec<Compared>,
    /// What counters did beside counting, in order of time.
    pub counters: Vec<counters::CounterRow>,
    /// One row an actuator.
    pub runs: Vec<RunFigures>,
    /// When devices did not answer, and when no station ran.
    pub outages: Vec<Outage>,
    /// Where samples are not kept any more.
    pub coarse: Vec<coarse::Coarse>,
    /// The curves of trend groups.
    pub charts: Vec<Chart>,
    /// The batches that ran in the period, newest first.
    pub batches: Vec<batch::BatchReport>,
    /// The control runs in the period, newest first.
    pub control_runs: Vec<ControlRun>,
    /// Of those that cross an edge of the period, what lies in it.
    pub run_parts: Vec<control_runs::RunPart>,
    /// Alarms that were active while they were suppressed, shelved or out of service.
    pub suppressed: Vec<SuppressedSummary>,
    /// Alarm events in the period, oldest first.
    pub alarms: Vec<AlarmRecord>,
    /// How good the alarm system was in the period.
    pub alarm_metrics: PeriodMetrics,
    /// Operator actions in the period, oldest first.
    pub actions: Vec<ActionRecord>,
    /// The record of one controller at a fixed interval: the data log of the thesis.
    pub record: Vec<RecordRow>,
    /// Name and unit of the controller of `record`.
    pub record_of: Option<(String, String)>,
}

/// Figures of one tag over a period; `None` where there was no good value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TagFigures {
    /// `TIC-1.PV`.
    pub tag: String,
    /// `°C`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// First good value.
    pub first: Option<Exact>,
    /// Least good value.
    pub min: Option<Exact>,
    /// Time-weighted mean over good time.
    pub mean: Option<Exact>,
    /// Greatest good value.
    pub max: Option<Exact>,
    /// Last good value.
    pub last: Option<Exact>,
    /// Of a counter (energy, volume, pieces): by how much it has counted up. It has no mean.
    pub difference: Option<Exact>,
    /// Time in which an alarm of this tag was active.
    pub in_alarm: Duration,
    /// Share of the period with a good value, 0–1.
    pub good: f64,
}

/// The figures of an earlier period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// Which.
    pub period: Period,
    /// One row a tag.
    pub tags: Vec<TagFigures>,
}

/// How long an actuator was on, and how often it was switched on; `None` where its state was never known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunFigures {
    /// Its output: `PLC-1.P-1`.
    pub tag: String,
    /// Time in which it was on.
    pub on: Option<Duration>,
    /// Changes from off to on.
    pub starts: Option<f64>,
    /// Share of the period in which its state was known, 0–1.
    pub good: f64,
}

/// A time without values, and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outage {
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub to: Timestamp,
    /// The device; `None` is the station.
    pub what: Option<String>,
    /// `not responding`.
    pub why: String,
}

/// An alarm that was active without being annunciated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SuppressedSummary {
    /// Full name of the tag or device.
    pub subject: Arc<str>,
    /// `temperature high`.
    pub message: Arc<str>,
    /// Its priority.
    pub priority: Priority,
    /// Activations in the period that were not annunciated.
    pub raised: u64,
    /// Time in the period in which it was active and not annunciated.
    pub active: Duration,
}

/// One row of the record: `er = sv − pv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RecordRow {
    /// When.
    pub at: Timestamp,
    /// Setpoint in use, if good.
    pub sv: Option<Exact>,
    /// Process value, if good.
    pub pv: Option<Exact>,
    /// SV − PV, if both are good.
    pub er: Option<Exact>,
}
