//! Which automatic report is made, delivered or deleted next; pure. What was done is on record in the history, so that a station
//! that was killed or off goes on where its record ends.
//!
//! ```text
//!   record:  … ├──made──┤├──made──┤                 ╎ now
//!   periods:   ├────────┤├────────┤├────────┤├────────╎───┤
//!                                  └ next     └ then ╎ └ runs
//! ```
//!
//! Each kind of period and format is a sequence of its own: its next report is that of the period in which the end of its last
//! one lies. So each is made once and in order, also if the clock is set back over the end of a period.

use std::{cell::Cell, collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

use super::{FORMATS, Period, ReportFormat, calendar};
use crate::plant::{
    def::PlantDef,
    report::{AutomaticReport, PeriodKind, ReportEvent, ReportKey, ReportRecord},
};

/// So long after its end a period is reported: what was on the way is in the history by then.
const GRACE: SignedDuration = SignedDuration::from_secs(60);
/// A station makes up for reports of periods that ended at most so long ago.
const MAKE_UP_MAX: SignedDuration = SignedDuration::from_hours(62 * 24);
/// The record is read again after so long at the latest.
const REST: SignedDuration = SignedDuration::from_mins(10);
/// Time until the next run of a command that failed so often; after the last one it is not run again.
const DELIVERY_DELAYS_S: [i64; 5] = [10, 60, 300, 900, 3_600];
/// Time until a report that could not be made is tried again; the last one for ever.
const RETRY_DELAYS_S: [i64; 4] = [5, 30, 120, 600];

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub enum Step<'a> {
    /// Make a report.
    Make(Due<'a>),
    /// Run the command for a file.
    Deliver(&'a ReportRecord, &'a AutomaticReport),
    /// Delete a file whose time is over.
    Delete(&'a ReportRecord),
    /// Nothing before this instant.
    Wait(Timestamp),
}

/// A report that is due.
#[derive(Debug, Clone, PartialEq)]
pub struct Due<'a> {
    /// What the plant file says of it.
    pub rule: &'a AutomaticReport,
    /// Of which period.
    pub period: Period,
    /// The name of its format.
    pub format: &'a str,
}

impl Due<'_> {
    /// The sequence that it belongs to.
    pub fn sequence(&self) -> Sequence {
        (self.rule.period, self.format.into())
    }

    /// Its name without the ending `.csv`, and that ending: two formats of one ending have two names.
    pub fn file_name(&self, def: &PlantDef, format: &dyn ReportFormat) -> (String, String) {
        let name = format.file_name(def, &self.period, self.period.to);
        let ending = format!(".{}", format.extension());
        let stem = name.strip_suffix(&ending).unwrap_or(&name).to_owned();
        let is_shared = FORMATS.iter().any(|other| {
            other.extension() == format.extension()
                && other.name() != format.name()
                && format.name() != format.extension()
        });
        (if is_shared { format!("{stem}-{}", format.name()) } else { stem }, ending)
    }
}

/// A kind of period and a format.
pub type Sequence = (PeriodKind, Arc<str>);

/// The last event of each report.
pub type Record = BTreeMap<ReportKey, ReportRecord>;

/// What the station does next: the oldest report that is due, then deliveries, then deletions. `since` is where the history
/// begins; a report that could not be made waits, as `failures` say, and the others go on.
pub fn next_step<'a>(
    def: &'a PlantDef,
    record: &'a Record,
    failures: &Failures,
    since: Option<Timestamp>,
    now: Timestamp,
) -> Step<'a> {
    // The first sample of a new history is soon there.
    let rest = if since.is_some() { REST } else { GRACE };
    let wake = Cell::new(now.checked_add(rest).unwrap_or(Timestamp::MAX));
    // Notes when it is to be looked again.
    let is_due = |at: Timestamp| {
        wake.set(if now < at { wake.get().min(at) } else { wake.get() });
        at <= now
    };
    let sequences = def.report.automatic.iter().flat_map(|rule| rule.formats.iter().map(move |format| (rule, format)));
    let due = sequences.filter_map(|(rule, format)| {
        let period = next_period(def, rule.period, format, record, since?, now)?;
        let due = Due { rule, period, format };
        let at = due.period.to.checked_add(GRACE).ok()?.max(failures.retry_at(&due.sequence()));
        is_due(at).then_some(due)
    });
    // Of those that end together the first in the plant file.
    if let Some(due) = due.min_by_key(|due| due.period.to) {
        return Step::Make(due);
    }
    let mut oldest: Vec<&ReportRecord> = record.values().collect();
    oldest.sort_by_key(|report| report.to);
    let deliver = oldest.iter().find_map(|report| {
        let rule = rule_of(def, report).filter(|rule| !rule.after.is_empty())?;
        let at = deliver_at(report)?;
        (is_due(at) || now < report.at).then_some(Step::Deliver(report, rule))
    });
    let delete = || {
        oldest.iter().find_map(|report| {
            let keep = rule_of(def, report)?.keep?;
            let at = report.to.checked_add(keep).ok().filter(|_| has_file(report))?;
            is_due(at).then_some(Step::Delete(report))
        })
    };
    deliver.or_else(delete).unwrap_or(Step::Wait(wake.get()))
}

/// The period of the next report of a sequence: that in which the last one on record ends, or the history begins.
fn next_period(
    def: &PlantDef,
    kind: PeriodKind,
    format: &str,
    record: &Record,
    since: Timestamp,
    now: Timestamp,
) -> Option<Period> {
    // What ends after now was made before the clock was set back.
    let of_sequence = |report: &&ReportRecord| report.period == kind && *report.format == *format && report.to <= now;
    let made = record.values().filter(of_sequence).map(|report| report.to).max();
    let earliest = now.checked_sub(MAKE_UP_MAX).unwrap_or(Timestamp::MIN).max(since);
    let mut period = calendar::period_at(def, kind, made.map_or(earliest, |made| made.max(earliest)))?;
    // Made, and then the clock was set back and has come here again.
    while record.contains_key(&(kind, period.from, format.into())) {
        period = calendar::period_at(def, kind, period.to)?;
    }
    Some(period)
}

fn rule_of<'a>(def: &'a PlantDef, report: &ReportRecord) -> Option<&'a AutomaticReport> {
    let is_its = |rule: &&AutomaticReport| {
        rule.period == report.period && rule.formats.iter().any(|format| **format == *report.format)
    };
    def.report.automatic.iter().find(is_its)
}

/// When the command is to run for a report; `None` where it has run, or has failed too often.
fn deliver_at(report: &ReportRecord) -> Option<Timestamp> {
    match report.event {
        ReportEvent::Made => Some(report.at),
        ReportEvent::DeliveryFailed => {
            let failed = usize::try_from(report.attempts.max(1) - 1).ok()?;
            report.at.checked_add(SignedDuration::from_secs(*DELIVERY_DELAYS_S.get(failed)?)).ok()
        }
        ReportEvent::NotMade | ReportEvent::Delivered | ReportEvent::Deleted | ReportEvent::LeftAlone => None,
    }
}

/// Whether the station has a file of it.
fn has_file(report: &ReportRecord) -> bool {
    match report.event {
        ReportEvent::Made | ReportEvent::Delivered | ReportEvent::DeliveryFailed => true,
        ReportEvent::NotMade | ReportEvent::Deleted | ReportEvent::LeftAlone => false,
    }
}

/// How the delivery of a report stands that has a command: pending, delivered, or given up.
pub fn is_given_up(report: &ReportRecord) -> bool {
    report.event == ReportEvent::DeliveryFailed && deliver_at(report).is_none()
}

/// The argument with its placeholders filled in.
pub fn filled(word: &str, report: &ReportRecord, plant: &str) -> String {
    let values = [
        ("{file}", &*report.file),
        ("{name}", &*report.name),
        ("{period}", report.period.word()),
        ("{format}", &*report.format),
        ("{sha256}", &*report.sha256),
        ("{plant}", plant),
    ];
    let mut text = String::new();
    let mut rest = word;
    while let Some(open) = rest.find('{') {
        text.push_str(&rest[..open]);
        rest = &rest[open..];
        let value = values.iter().find(|(name, _)| rest.starts_with(name));
        // A value is not searched for placeholders in its turn.
        let (piece, length) = value.map_or(("{", 1), |(name, value)| (*value, name.len()));
        text.push_str(piece);
        rest = &rest[length..];
    }
    text + rest
}

/// Reports that could not be made, by their sequence.
#[derive(Debug, Default)]
pub struct Failures(BTreeMap<Sequence, Failure>);

#[derive(Debug)]
struct Failure {
    attempts: usize,
    retry_at: Timestamp,
    why: String,
}

impl Failures {
    fn retry_at(&self, sequence: &Sequence) -> Timestamp {
        self.0.get(sequence).map_or(Timestamp::MIN, |failure| failure.retry_at)
    }

    /// A report could not be made; it is tried again after a growing time.
    pub fn fail(&mut self, sequence: Sequence, why: String, now: Timestamp) {
        let attempts = self.attempts(&sequence) + 1;
        let delay = RETRY_DELAYS_S[attempts.min(RETRY_DELAYS_S.len()) - 1];
        let retry_at = now.checked_add(SignedDuration::from_secs(delay)).unwrap_or(now);
        self.0.insert(sequence, Failure { attempts, retry_at, why });
    }

    /// How often a report was tried.
    pub fn attempts(&self, sequence: &Sequence) -> usize {
        self.0.get(sequence).map_or(0, |failure| failure.attempts)
    }

    /// A report was made.
    pub fn clear(&mut self, sequence: &Sequence) {
        self.0.remove(sequence);
    }

    /// What is wrong, for the operator: a report that is not made, or the last one that was not delivered.
    pub fn words(&self, def: &PlantDef, record: &Record) -> Option<String> {
        let failed = self.0.iter().next().map(|((kind, format), failure)| {
            format!("report of a {} as {format} not made: {}", kind.word(), failure.why)
        });
        let last = record
            .values()
            .filter(|report| rule_of(def, report).is_some_and(|rule| !rule.after.is_empty()))
            .filter(|report| report.event == ReportEvent::Delivered || is_given_up(report))
            .max_by_key(|report| report.at);
        let undelivered = last.filter(|report| is_given_up(report)).map(|report| {
            let why = report.error.as_deref().unwrap_or("no reason given");
            format!("{} ({}) not delivered: {why}", report.name, report.format)
        });
        failed.or(undelivered)
    }
}

/// How long a command may run.
pub const COMMAND_TIME_MAX: Duration = Duration::from_secs(120);

#[cfg(test)]
mod tests;
