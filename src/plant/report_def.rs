//! What the reports of a plant contain and where they go.

use std::{path::PathBuf, time::Duration};

use serde::{Deserialize, Serialize};

use super::{
    id::{DeviceId, TagId},
    keyword::keyword_enum,
    report::AutomaticReport,
};

/// What reports contain and how they are written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReportDef {
    /// Where reports are written, relative to the working folder.
    pub folder: PathBuf,
    /// Tags in the table; empty means every stored tag with a unit.
    pub tags: Vec<TagId>,
    /// The thesis's raw record (date, time, SV, PV, ER): the controller, and the interval.
    pub record: Option<(DeviceId, Duration)>,
    /// How CSV is written.
    pub csv: CsvDialect,
    /// The line above everything, as of the company; may be empty.
    pub logo: String,
    /// What it is called instead of `Shift report`; may be empty.
    pub title: String,
    /// A paragraph below the summary; may be empty.
    pub text: String,
    /// Its sections in order.
    pub sections: Vec<Section>,
    /// The trend groups whose curves it has, by their places.
    pub curves: Vec<usize>,
    /// Who signs it, line by line.
    pub signatures: Vec<String>,
    /// Its language: a code such as `th`; empty for English.
    pub language: String,
    /// The paper of its pages.
    pub paper: Paper,
    /// Those that the station makes by itself.
    pub automatic: Vec<AutomaticReport>,
}

impl Default for ReportDef {
    /// Everything, in the folder `reports`.
    fn default() -> ReportDef {
        ReportDef {
            folder: "reports".into(),
            tags: Vec::new(),
            record: None,
            csv: CsvDialect::default(),
            logo: String::new(),
            title: String::new(),
            text: String::new(),
            sections: Section::ALL.into(),
            curves: Vec::new(),
            signatures: Vec::new(),
            language: String::new(),
            paper: Paper::A4,
            automatic: Vec::new(),
        }
    }
}

keyword_enum! {
    /// A section of a report, in their usual order.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
    pub enum Section: "section of a report" {
        /// Plant, period, share of good values, counts.
        Summary => "summary",
        /// The note to the next shift, and who took over.
        Handover => "handover",
        /// Figures of every tag.
        Values => "values",
        /// The same against the shift before and that of a week before.
        Comparison => "comparison",
        /// What counters did beside counting.
        Counters => "counters",
        /// Hours and starts of actuators.
        Runs => "run hours",
        /// Curves of trend groups.
        Curves => "curves",
        /// Batches.
        Batches => "batches",
        /// Control runs.
        ControlRuns => "control runs",
        /// Where values are missing, and why.
        Gaps => "gaps",
        /// Alarms by priority.
        AlarmCounts => "alarm counts",
        /// Alarms that were active without being annunciated.
        Suppressed => "suppressed alarms",
        /// How good the alarm system was.
        Metrics => "alarm metrics",
        /// Alarms to investigate.
        Investigate => "alarms to investigate",
        /// Alarm events.
        Alarms => "alarms",
        /// Operator actions.
        Actions => "operator actions",
        /// SV, PV and ER of one controller at a fixed interval.
        Record => "record",
        /// Lines to sign on.
        Signatures => "signatures",
        /// What made the report, of what.
        Provenance => "provenance",
    }
}

keyword_enum! {
    /// Paper.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Paper: "paper" {
        /// 210 by 297 mm.
        A4 => "a4",
        /// 8.5 by 11 inches.
        Letter => "letter",
    }
}

/// How CSV is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CsvDialect {
    /// `,` or `;`.
    pub separator: char,
    /// `.` or `,`; never the separator.
    pub decimal: char,
    /// Write a UTF-8 byte order mark first, for spreadsheets.
    pub bom: bool,
}

impl Default for CsvDialect {
    fn default() -> Self {
        CsvDialect { separator: ',', decimal: '.', bom: false }
    }
}
