//! Shifts, and what reports contain.

use std::{path::PathBuf, time::Duration};

use super::{
    automatic_report::{self, Rules},
    diagnostic::Problems,
    names::{Defs, Unique},
    reader::{At, OptionalKey, text},
    schema::{CsvTable, ReportTable, ShiftTable},
};
use crate::{
    plant::def::{CsvDialect, ReportDef, ShiftDef, TrendGroup},
    text::Language,
};

/// The shifts in order of their start.
pub(super) fn shifts(tables: &[At<ShiftTable>], problems: &mut Problems) -> Vec<ShiftDef> {
    let (mut names, mut starts) = (Unique::default(), Unique::default());
    let mut shifts = Vec::new();
    for table in tables.iter().map(|table| &table.value) {
        let (Some(name), Some(start)) = (&table.name, table.start) else { continue };
        names.insert(&name.value, name.at, format!("duplicate shift `{}`", name.value), problems);
        starts.insert(&start.value.to_string(), start.at, "two shifts start at the same time", problems);
        shifts.push(ShiftDef { name: name.value.clone(), start: start.value });
    }
    shifts.sort_by_key(|shift| shift.start);
    shifts
}

/// What reports contain and where they go.
pub(super) fn report(
    table: Option<&ReportTable>,
    defs: &Defs,
    trends: &[TrendGroup],
    rules: &Rules,
    problems: &mut Problems,
) -> ReportDef {
    let mut report = ReportDef::default();
    let Some(table) = table else { return report };
    if let Some(folder) = &table.folder {
        report.folder = PathBuf::from(&folder.value);
    }
    report.tags = table.tags.iter().filter_map(|tag| Some(defs.tag(tag, problems)?.id)).collect();
    if let Some(record) = table.record.as_ref().map(|record| &record.value)
        && let (Some(device), Some(every)) = (&record.device, record.every)
    {
        if every.value < Duration::from_secs(1) {
            problems.add(every.at, "the record has at most one row a second").label("expected 1s or more");
        }
        let id = defs.device(device, problems);
        if id.is_some_and(|id| defs.devices[id.index()].faceplate.is_none()) {
            problems
                .add(device.at, format!("{} is not a controller", device.value))
                .label("it has no faceplate with PV and SV");
        }
        report.record = id.map(|id| (id, every.value));
    }
    if let Some(csv) = &table.csv {
        report.csv = dialect(&csv.value, problems);
    }
    page(table, trends, &mut report, problems);
    report.automatic = automatic_report::automatic(&table.automatic, rules, problems);
    report
}

/// What stands on its pages.
fn page(table: &ReportTable, trends: &[TrendGroup], report: &mut ReportDef, problems: &mut Problems) {
    (report.logo, report.title, report.text) = (text(&table.logo), text(&table.title), text(&table.text));
    report.signatures = table.signatures.iter().map(|name| name.value.clone()).collect();
    report.paper = table.paper.value_or(report.paper);
    if !table.sections.is_empty() {
        let mut known = Unique::default();
        for section in &table.sections {
            known.insert(section.value.word(), section.at, "this section is named twice", problems);
        }
        report.sections = table.sections.iter().map(|section| section.value).collect();
    }
    let names = || trends.iter().map(|group| group.name.as_str()).collect::<Vec<_>>().join(", ");
    for group in &table.curves {
        match trends.iter().position(|known| known.name == group.value) {
            Some(place) => report.curves.push(place),
            None => {
                let label = format!("expected one of {}", names());
                problems.add(group.at, format!("no trend group `{}`", group.value)).label(label);
            }
        }
    }
    if let Some(language) = &table.language {
        match Language::from_code(&language.value) {
            Some(_) => report.language = language.value.clone(),
            None => {
                let codes: Vec<_> = Language::all().map(Language::code).collect();
                let label = format!("expected one of {}", codes.join(", "));
                problems.add(language.at, format!("no language `{}`", language.value)).label(label);
            }
        }
    }
}

fn dialect(table: &CsvTable, problems: &mut Problems) -> CsvDialect {
    let usual = CsvDialect::default();
    let separator = one_of(&table.separator, &[',', ';', '\t'], usual.separator, problems);
    let decimal = one_of(&table.decimal, &['.', ','], usual.decimal, problems);
    if let Some(at) = table.decimal.as_ref().or(table.separator.as_ref()).map(|word| word.at)
        && separator == decimal
    {
        problems.add(at, "separator and decimal are the same").label("the columns would be ambiguous");
    }
    CsvDialect { separator, decimal, bom: table.bom.value_or(usual.bom) }
}

fn one_of(word: &Option<At<String>>, known: &[char], usual: char, problems: &mut Problems) -> char {
    let Some(word) = word else { return usual };
    let found = known.iter().find(|c| word.value == c.to_string());
    if found.is_none() {
        problems
            .add(word.at, format!("{:?} cannot be used here", word.value))
            .label(format!("expected one of {known:?}"));
    }
    found.copied().unwrap_or(usual)
}
