//! A report as plain lines for the terminal: facts, tags, counts.

use super::{
    ReportFormat, ShiftReport, TagFigures,
    csv::{floor_percent, iso},
    raised,
};
use crate::plant::def::{CsvDialect, PlantDef, Priority};

/// The format `text`.
#[derive(Debug)]
pub struct Text;

impl ReportFormat for Text {
    fn name(&self) -> &'static str {
        "text"
    }
    fn about(&self) -> &'static str {
        "a summary"
    }

    fn extension(&self) -> &'static str {
        "txt"
    }

    fn render(&self, report: &ShiftReport, def: &PlantDef, _csv: CsvDialect) -> Vec<u8> {
        shift_text(report, def).into_bytes()
    }
}

/// The report as lines, without alarm list, actions and record; a missing figure is `—`.
fn shift_text(report: &ShiftReport, def: &PlantDef) -> String {
    let zone = &def.time_zone;
    let mut lines = vec![
        format!("{}, {}", def.title, report.period.name),
        format!("{} to {}", iso(zone, report.period.from), iso(zone, report.period.to)),
    ];
    if report.until < report.period.to {
        lines.push(format!("still running: figures until {}", iso(zone, report.until)));
    }
    lines.extend(report.audit.map(|entry| format!("audit log: entry {entry}")));
    for gap in &report.unreadable {
        lines.push(format!("not readable, not counted: {} to {}", iso(zone, gap.from), iso(zone, gap.to)));
    }
    let width = report.tags.iter().map(|tag| tag.tag.chars().count()).max().unwrap_or(0).max(3);
    lines.push(String::new());
    lines.push(format!(
        "{:width$} {:>10} {:>10} {:>10} {:>10} {:>8} {:>7}  unit",
        "tag", "min", "mean/+", "max", "last", "alarm/m", "good %"
    ));
    lines.extend(report.tags.iter().map(|tag| tag_line(tag, width)));
    lines.push(String::new());
    let counts = Priority::ALL.map(|priority| format!("{} {}", raised(&report.alarms, priority), priority.word()));
    lines.push(format!("alarms raised: {}", counts.join(", ")));
    for alarm in &report.suppressed {
        let (subject, minutes) = (&alarm.subject, alarm.active.as_secs_f64() / 60.0);
        let raised = alarm.raised;
        lines.push(format!("suppressed: {subject} {}, active {minutes:.1} min, raised {raised} times", alarm.message));
    }
    lines.push(format!("operator actions: {}", report.actions.len()));
    lines.join("\n") + "\n"
}

fn tag_line(tag: &TagFigures, width: usize) -> String {
    let value = |value: Option<f64>, decimals: u8| match value {
        Some(value) => format!("{value:.*}", usize::from(decimals)),
        None => "—".into(),
    };
    format!(
        "{:width$} {:>10} {:>10} {:>10} {:>10} {:>8.1} {:>7.1}  {}",
        tag.tag,
        value(tag.min, tag.decimals),
        mean_or_difference(tag),
        value(tag.max, tag.decimals),
        value(tag.last, tag.decimals),
        tag.in_alarm.as_secs_f64() / 60.0,
        floor_percent(tag.good),
        tag.unit,
    )
}

/// `54.32`; of a counter `+12.5`, its difference; of neither a dash.
pub fn mean_or_difference(tag: &TagFigures) -> String {
    let decimals = usize::from(tag.decimals);
    match (tag.mean, tag.difference) {
        // A mean has one decimal more than its values.
        (Some(mean), _) => format!("{mean:.*}", decimals + 1),
        (None, Some(difference)) => format!("{difference:+.decimals$}"),
        (None, None) => "—".into(),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{
        plant::record::ChainHash,
        report::{
            Period,
            testing::{THREE, at, named, plant},
        },
    };

    #[test]
    fn a_missing_figure_is_a_dash_and_a_running_shift_says_so() {
        let report = ShiftReport {
            period: Period {
                name: named("morning 2026-11-21"),
                from: at("2026-11-21T06:00+07"),
                to: at("2026-11-21T14:00+07"),
            },
            until: at("2026-11-21T09:00+07"),
            audit: Some(ChainHash { number: 7, hash: [0xA5; 32] }),
            unreadable: Vec::new(),
            batches: Vec::new(),
            tags: vec![TagFigures {
                tag: "TIC-1.PV".into(),
                unit: "°C".into(),
                decimals: 1,
                min: Some(27.0),
                mean: Some(54.321),
                max: Some(71.2),
                last: None,
                difference: None,
                in_alarm: Duration::from_secs(90),
                good: 0.5,
            }],
            suppressed: Vec::new(),
            alarms: Vec::new(),
            alarm_metrics: crate::plant::alarm::PeriodMetrics::default(),
            actions: Vec::new(),
            record: Vec::new(),
            record_of: None,
        };
        let text = shift_text(&report, &plant("Asia/Bangkok", &THREE));
        let expect = "\
Water tank, morning 2026-11-21
2026-11-21T06:00:00+07:00 to 2026-11-21T14:00:00+07:00
still running: figures until 2026-11-21T09:00:00+07:00
audit log: entry 7 a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5

tag             min     mean/+        max       last  alarm/m  good %  unit
TIC-1.PV       27.0      54.32       71.2          —      1.5    50.0  °C

alarms raised: 0 critical, 0 high, 0 medium, 0 low
operator actions: 0
";
        assert_eq!(text, expect);
    }
}
