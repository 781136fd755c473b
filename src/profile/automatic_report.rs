//! `[[report.automatic]]`: the reports that the station makes by itself.

use std::time::Duration;

use super::{
    diagnostic::Problems,
    names::Unique,
    reader::{At, within},
    schema::AutomaticReportTable,
};
use crate::plant::report::{AutomaticReport, PLACEHOLDERS, PeriodKind, REPORT_FORMATS};

/// The format that has the record of a controller only.
const RECORD: &str = "record";

/// What is needed to check automatic reports.
pub(super) struct Rules<'a> {
    /// The plant has shifts.
    pub shifts: bool,
    /// Is there a program of this name, or at this path?
    pub is_program: &'a dyn Fn(&str) -> bool,
}

/// The automatic reports of a plant file.
pub(super) fn automatic(
    tables: &[At<AutomaticReportTable>],
    rules: &Rules,
    problems: &mut Problems,
) -> Vec<AutomaticReport> {
    let mut known = Unique::default();
    tables.iter().filter_map(|table| one(&table.value, rules, &mut known, problems)).collect()
}

fn one(
    table: &AutomaticReportTable,
    rules: &Rules,
    known: &mut Unique,
    problems: &mut Problems,
) -> Option<AutomaticReport> {
    let period = table.period?;
    if period.value == PeriodKind::Shift && !rules.shifts {
        problems.add(period.at, "this plant has no shifts").label("expected day, week or month, or a [[shift]]");
    }
    if table.formats.is_empty() {
        problems
            .add(table.at, "the report has no format")
            .label(format!("expected formats = [\"{}\"]", REPORT_FORMATS[0]));
    }
    for format in &table.formats {
        if !REPORT_FORMATS.contains(&format.value.as_str()) {
            problems.unknown("format", format, REPORT_FORMATS);
        }
        if format.value == RECORD && matches!(period.value, PeriodKind::Week | PeriodKind::Month) {
            let words = format!("the report of a {} has no record", period.value.word());
            problems.add(format.at, words).label("expected in reports of shifts and days only");
        }
        // One record of each report says whether it was made.
        let words = format!("another automatic report of a {} has the format `{}`", period.value.word(), format.value);
        known.insert(&format!("{} {}", period.value.word(), format.value), format.at, words, problems);
    }
    command(&table.after, rules, problems);
    let keep = table.keep_days.map(|days| within(Some(days), 1..=36_500, 1, problems));
    Some(AutomaticReport {
        period: period.value,
        formats: table.formats.iter().map(|format| format.value.clone()).collect(),
        folder: table.folder.as_ref().map(|folder| folder.value.clone().into()),
        keep: keep.map(|days| Duration::from_secs(u64::from(days) * 86_400)),
        after: table.after.iter().map(|word| word.value.clone()).collect(),
    })
}

/// Checks the command: what stands in braces is known, and its program is there.
fn command(words: &[At<String>], rules: &Rules, problems: &mut Problems) {
    for word in words {
        for (open, _) in word.value.match_indices('{') {
            let rest = &word.value[open + 1..];
            // Braces of other meaning, as of JSON, have no plain word in them.
            let Some(name) = rest.split_once('}').map(|(name, _)| name) else { continue };
            let is_word =
                !name.is_empty() && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
            if is_word && !PLACEHOLDERS.contains(&name) {
                let at = word.at.inside_quotes(open, name.len() + 2);
                let problem = problems.add(at, format!("unknown placeholder {{{name}}}"));
                problem.label("no such placeholder").suggest(name, PLACEHOLDERS);
            }
        }
    }
    if let Some(program) = words.first()
        && !(rules.is_program)(&program.value)
    {
        let problem = problems.warn(program.at, format!("program `{}` not found", program.value));
        problem.label("not in PATH").help("install it before the first report is due, or give its full path");
    }
}
