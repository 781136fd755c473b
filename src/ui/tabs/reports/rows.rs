//! The rows of a period: date, time, SV, PV and ER of the record, page by page, with a filter and a jump to a time.

use jiff::{civil, tz::TimeZone};

use super::{Export, Key, Page, Reports};
use crate::report::{self, RecordRow, ShiftReport, record_csv::record_decimals};
use crate::ui::tabs::prelude::*;

pub const KEYS: &[&[Key]] = &[
    &[
        Key::change(code(KeyCode::Left), "earlier", "rows of the previous shift", |reports, cx| reports.step(cx, -1)),
        Key::change(code(KeyCode::Right), "later", "rows of the next shift", |reports, cx| reports.step(cx, 1)),
        Key::new(char('/'), "find", "go to a time, or show only rows with a condition", |reports, _| {
            vec![reports.rows.ask()]
        }),
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
    ],
    &motions!("scroll", |reports: &mut Reports, cx: &ViewContext, motion| {
        reports.rows.on_motion(cx, reports.report.value.as_deref(), motion);
    }),
];

#[derive(Debug, Default)]
pub struct RecordRows {
    conditions: Vec<Condition>,
    scroll: Scroll,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum RecordColumn {
    Sv,
    Pv,
    Er,
}

/// `pv > 60`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Condition {
    column: RecordColumn,
    above: bool,
    limit: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Typed {
    /// A time of day, of the first date that has it.
    Time(civil::Time),
    Instant(civil::DateTime),
    Conditions(Vec<Condition>),
}

fn column_of(word: &str) -> Option<RecordColumn> {
    match word {
        "sv" => Some(RecordColumn::Sv),
        "pv" => Some(RecordColumn::Pv),
        "er" => Some(RecordColumn::Er),
        _ => None,
    }
}

/// Reads `14:05`, `2026-11-26 14:05`, or conditions such as `pv > 60 er < -1`.
fn parse(text: &str) -> Option<Typed> {
    let text = text.trim().to_lowercase();
    // A time of day would be found in a date and time as well.
    if let Ok(instant) = text.parse::<civil::DateTime>() {
        return Some(Typed::Instant(instant));
    }
    if let Ok(time) = text.parse::<civil::Time>() {
        return Some(Typed::Time(time));
    }
    let spaced = text.replace('>', " > ").replace('<', " < ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let condition = |words: &[&str]| match words {
        [column, sign @ (">" | "<"), limit] => {
            let limit = limit.parse::<f64>().ok().filter(|limit| limit.is_finite())?;
            Some(Condition { column: column_of(column)?, above: *sign == ">", limit })
        }
        _ => None,
    };
    words.chunks(3).map(condition).collect::<Option<_>>().map(Typed::Conditions)
}

impl Condition {
    /// What is not known is neither above nor below.
    fn holds(self, row: &RecordRow) -> bool {
        let value = match self.column {
            RecordColumn::Sv => row.sv,
            RecordColumn::Pv => row.pv,
            RecordColumn::Er => row.er,
        };
        value.is_some_and(|value| if self.above { value > self.limit } else { value < self.limit })
    }
}

impl RecordRows {
    /// Another period: its first row.
    pub fn rewind(&mut self) {
        self.scroll = Scroll::default();
    }

    fn filtered<'a>(&self, report: &'a ShiftReport) -> Vec<&'a RecordRow> {
        report.record.iter().filter(|row| self.conditions.iter().all(|condition| condition.holds(row))).collect()
    }

    pub fn on_motion(&mut self, cx: &ViewContext, report: Option<&ShiftReport>, motion: Motion) {
        let count = report.map_or(0, |report| self.filtered(report).len());
        self.scroll.on(motion, count, room(cx.area.height.saturating_sub(1)));
    }

    /// Asks for a time or a condition.
    pub fn ask(&self) -> UiAction {
        let hint = t!("14:05, 2026-11-26 14:05, or pv > 60 er < -1; empty shows all");
        UiAction::Open(Modal::Prompt(Prompt::new(t!("rows of the record"), hint, "")))
    }

    /// Goes to a time, or takes a filter.
    pub fn on_text(&mut self, cx: &ViewContext, report: Option<&ShiftReport>, text: &str) -> Result<(), String> {
        let typed = parse(text).ok_or_else(|| t!("expected 14:05, 2026-11-26 14:05, or pv > 60 er < -1").to_owned())?;
        let rows = report.map(|report| self.filtered(report)).unwrap_or_default();
        let zone: &TimeZone = &cx.def().time_zone;
        let local = |row: &&RecordRow| zone.to_datetime(row.at);
        let place = match typed {
            Typed::Conditions(conditions) => {
                (self.conditions, self.scroll) = (conditions, Scroll::default());
                return Ok(());
            }
            Typed::Time(time) => rows.iter().position(|row| time <= local(row).time()),
            Typed::Instant(instant) => rows.iter().position(|row| instant <= local(row)),
        };
        let place = place.ok_or_else(|| t!("no row of this period is as late as that").to_owned())?;
        let room = room(cx.area.height.saturating_sub(1));
        self.scroll = Scroll::default();
        self.scroll.on(Motion::Rows(isize::try_from(place).unwrap_or(isize::MAX)), rows.len(), room);
        Ok(())
    }

    /// Draws the rows below the title of the report.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, report: &ShiftReport) {
        let theme = cx.theme;
        let rows = self.filtered(report);
        let height = canvas.height();
        let room = room(height);
        let unit = report.record_of.as_ref().map_or("", |(_, unit)| unit.as_str());
        let heading = [t!("date"), t!("time"), "SV", "PV", "ER", unit];
        canvas.text(1, 0, &draw::columns(WIDTHS, heading), theme.dim());
        let decimals = Some(record_decimals(report, cx.def()));
        let number = |value: Option<Exact>| value.map_or("----".to_owned(), |value| digits(value, decimals));
        let first = self.scroll.first(rows.len(), room);
        for (y, _, row) in on_screen(&rows, first, room) {
            let [date, time] = ["%Y-%m-%d", "%H:%M:%S"].map(|format| cx.local(row.at, format));
            let [sv, pv, er] = [row.sv, row.pv, row.er].map(number);
            let line = draw::columns(WIDTHS, [&date, &time, &sv, &pv, &er, ""]);
            let known = row.sv.is_some() && row.pv.is_some();
            canvas.text(1, y + 1, &line, if known { theme.normal() } else { theme.trouble() });
        }
        let (count, all) = (rows.len(), report.record.len());
        let words = match (all, self.conditions.is_empty()) {
            (0, _) => t!("this period has no record").to_owned(),
            (_, true) => t!("{count} rows", count),
            (_, false) => t!("{count} of {all} rows fit the condition; / and ⏎ shows all", count, all),
        };
        canvas.text(1, height.saturating_sub(1), &fit_words(&words, canvas.width().saturating_sub(2)), theme.normal());
    }
}

const WIDTHS: [i16; 6] = [11, 10, -8, -8, -8, 5];

/// Rows between the heading and the last line.
fn room(height: u16) -> usize {
    usize::from(height.saturating_sub(2)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_conditions_are_distinguished() {
        let condition = |column, above, limit| Condition { column, above, limit };
        for (text, expect) in [
            ("14:05", Some(Typed::Time(civil::time(14, 5, 0, 0)))),
            ("2026-11-26 14:05", Some(Typed::Instant(civil::date(2026, 11, 26).at(14, 5, 0, 0)))),
            ("2026-11-26", Some(Typed::Instant(civil::date(2026, 11, 26).at(0, 0, 0, 0)))),
            ("PV>60", Some(Typed::Conditions(vec![condition(RecordColumn::Pv, true, 60.0)]))),
            (
                "er < -1 sv > 2",
                Some(Typed::Conditions(vec![
                    condition(RecordColumn::Er, false, -1.0),
                    condition(RecordColumn::Sv, true, 2.0),
                ])),
            ),
            ("", Some(Typed::Conditions(Vec::new()))),
            ("mv > 3", None),
            ("pv > nan", None),
            ("pv >", None),
            ("25:00", None),
        ] {
            assert_eq!(parse(text), expect, "{text}");
        }
    }

    #[test]
    fn what_is_not_known_fits_no_condition() {
        let row = RecordRow { at: Timestamp::UNIX_EPOCH, sv: Some(70.0.into()), pv: None, er: None };
        let holds = |text: &str| match parse(text) {
            Some(Typed::Conditions(conditions)) => conditions.iter().all(|condition| condition.holds(&row)),
            _ => panic!("{text} is a condition"),
        };
        assert!(holds("sv > 69") && !holds("sv > 70") && !holds("pv > 0") && !holds("pv < 100"));
    }
}
