//! The figures of an alarm system as rows and as plain lines: what was measured, its target and limit, how it stands.

use serde::Serialize;

use super::{Period, csv::iso};
use crate::plant::{
    alarm::{
        PeriodMetrics,
        metrics::{METRIC_TARGETS, MetricKind, MetricTarget, Named},
    },
    def::PlantDef,
};
use crate::t;

/// One figure beside its target and limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What was measured, its unit last.
    pub measure: &'static str,
    /// The figure; `None` if it cannot be formed.
    pub value: Option<f64>,
    /// `at most 150`.
    pub target: String,
    /// `at most 300`; empty if there is none.
    pub limit: String,
    /// `good`, `beyond target`, `over limit` or `insufficient data`.
    pub result: &'static str,
    /// Decimals to print.
    #[serde(skip)]
    pub decimals: u8,
}

/// An alarm to investigate, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BadActor {
    /// `frequent`, `chattering` or `fleeting`.
    pub kind: &'static str,
    /// Full name of the tag or device.
    pub subject: String,
    /// `temperature high`.
    pub alarm: String,
    /// Activations in the period, for the frequent ones.
    pub raised: Option<u64>,
}

/// The metrics of a period, as `--json` prints them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlarmMetricsReport {
    /// Name of the plant.
    pub plant: String,
    /// Name of the period.
    pub period: String,
    /// From, with the plant's offset.
    pub from: String,
    /// Up to when there are figures, with the plant's offset.
    pub until: String,
    /// Seconds of it in which a station ran: what the rates are of.
    pub watched_s: u64,
    /// Activations.
    pub raised: u64,
    /// Activations that were not annunciated.
    pub suppressed: u64,
    /// PeriodMetrics against targets and limits.
    pub figures: Vec<Row>,
    /// The alarms to investigate.
    pub alarms: Vec<BadActor>,
}

/// The figures of a period with names and times.
pub fn metrics(figures: &PeriodMetrics, def: &PlantDef, period: &Period) -> AlarmMetricsReport {
    AlarmMetricsReport {
        plant: def.name.clone(),
        period: period.name.to_string(),
        from: iso(&def.time_zone, figures.from),
        until: iso(&def.time_zone, figures.until),
        watched_s: figures.watched.as_secs(),
        raised: figures.annunciated(),
        suppressed: figures.suppressed,
        figures: rows(figures),
        alarms: bad_actors(figures),
    }
}

/// Every figure, in the order of the table of goals.
pub fn rows(figures: &PeriodMetrics) -> Vec<Row> {
    METRIC_TARGETS.iter().map(|goal| row(goal, figures)).collect()
}

/// The most frequent alarms, then those that chattered, then those that were fleeting.
pub fn bad_actors(figures: &PeriodMetrics) -> Vec<BadActor> {
    let bad_actor = |kind, alarm: &Named, raised| BadActor {
        kind,
        subject: alarm.subject.to_string(),
        alarm: alarm.message.to_string(),
        raised,
    };
    let frequent = figures.top.iter().map(|frequent| bad_actor(t!("frequent"), &frequent.alarm, Some(frequent.raised)));
    let chattering = figures.chattering.iter().map(|alarm| bad_actor(t!("chattering"), alarm, None));
    let fleeting = figures.fleeting.iter().map(|alarm| bad_actor(t!("fleeting"), alarm, None));
    frequent.chain(chattering).chain(fleeting).collect()
}

/// The figures as lines for a terminal.
pub fn metrics_text(figures: &PeriodMetrics, def: &PlantDef, period: &Period) -> String {
    let all = metrics(figures, def, period);
    let mut lines = vec![
        format!("{}, alarms of {}", def.title, all.period),
        format!("{} to {}: {} alarms{}{}", all.from, all.until, all.raised, quiet(figures), gaps(figures)),
        String::new(),
        format!("{:35} {:>7}  {:12}  {:12}  {}", "metric", "value", "target", "limit", "result"),
    ];
    lines.extend(all.figures.iter().map(|row| {
        let value = row.value.map_or("—".into(), |value| format!("{value:.*}", usize::from(row.decimals)));
        format!("{:35} {value:>7}  {:12}  {:12}  {}", row.measure, row.target, row.limit, row.result)
    }));
    if !all.alarms.is_empty() {
        lines.push(String::new());
        lines.extend(all.alarms.iter().map(|alarm| {
            let raised = alarm.raised.map(|raised| raised.to_string()).unwrap_or_default();
            format!("{:10} {raised:>6}  {}  {}", alarm.kind, alarm.subject, alarm.alarm)
        }));
    }
    lines.push(String::new());
    lines.push("targets and limits: ISA-18.2, per operator, for periods of 30 days or more".into());
    lines.join("\n")
}

/// How many were not annunciated.
pub fn quiet(figures: &PeriodMetrics) -> String {
    match figures.suppressed {
        0 => String::new(),
        many => format!(", {many} more while suppressed"),
    }
}

/// How much of the span was watched, if not all of it.
fn gaps(figures: &PeriodMetrics) -> String {
    let (watched, whole) = (figures.watched.as_secs(), figures.until.duration_since(figures.from).as_secs());
    let minutes = watched / 60;
    match i64::try_from(watched).is_ok_and(|watched| watched < whole) {
        true => format!("; a station ran for {} h {:02} min", minutes / 60, minutes % 60),
        false => String::new(),
    }
}

fn row(goal: &MetricTarget, figures: &PeriodMetrics) -> Row {
    let decimals = if goal.measure.kind() == MetricKind::Count { 0 } else { 1 };
    Row {
        measure: goal.words,
        value: figures.value(goal.measure),
        target: goal.target.to_string(),
        limit: goal.limit.map(|limit| limit.to_string()).unwrap_or_default(),
        result: goal.verdict(figures).word(),
        decimals,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{
        plant::alarm::metrics::Frequent,
        report::testing::{THREE, at, named, plant},
    };

    /// Eight hours with 24 alarms, six of them of one that chatters.
    pub fn figures() -> PeriodMetrics {
        let name = |subject: &str, text: &str| Named { subject: subject.into(), message: text.into() };
        let high = name("TIC-1.PV", "temperature high");
        PeriodMetrics {
            from: at("2026-11-21T06:00+07"),
            until: at("2026-11-21T14:00+07"),
            by_priority: [0, 6, 3, 15],
            windows: 48,
            watched: Duration::from_secs(8 * 3_600),
            windows_over: 1,
            most: 12,
            flood: Duration::from_secs(600),
            top: vec![
                Frequent { alarm: name("=PLC-1", "not responding"), raised: 18 },
                Frequent { alarm: high.clone(), raised: 6 },
            ],
            chattering: vec![high],
            fleeting: Vec::new(),
            stale: 0,
            suppressed: 0,
        }
    }

    #[test]
    fn a_metric_stands_beside_its_target_and_none_is_a_dash() {
        let period = Period {
            name: named("morning 2026-11-21"),
            from: at("2026-11-21T06:00+07"),
            to: at("2026-11-21T14:00+07"),
        };
        let text = metrics_text(&figures(), &plant("Asia/Bangkok", &THREE), &period);
        let expect = "\
Water tank, alarms of morning 2026-11-21
2026-11-21T06:00:00+07:00 to 2026-11-21T14:00:00+07:00: 24 alarms

metric                                value  target        limit         result
alarms per day                         72.0  at most 150   at most 300   good
alarms per hour                         3.0  at most 6     at most 12    good
alarms per 10 min                       0.5  at most 1     at most 2     good
10-min windows above 10 (%)             2.1  below 1                     beyond target
peak in a 10-min window                  12  at most 10                  beyond target
time in flood (%)                       2.1  below 1                     beyond target
share of the 10 most frequent (%)     100.0  at most 5                   beyond target
chattering alarms                         1  at most 0                   beyond target
fleeting alarms                           0  at most 0                   good
active over 24 h (peak)                   0  below 5                     good
priority critical (%)                   0.0  below 1                     good
priority high (%)                      25.0  at most 5                   beyond target
priority medium (%)                    12.5  at most 15                  good
priority low (%)                       62.5  at least 80                 beyond target

frequent       18  =PLC-1  not responding
frequent        6  TIC-1.PV  temperature high
chattering         TIC-1.PV  temperature high

targets and limits: ISA-18.2, per operator, for periods of 30 days or more";
        assert_eq!(text, expect);
        let short = PeriodMetrics { watched: std::time::Duration::from_secs(5_460), ..figures() };
        let short = metrics_text(&short, &plant("Asia/Bangkok", &THREE), &period);
        assert!(short.contains(": 24 alarms; a station ran for 1 h 31 min\n"), "{short}");
        let none = metrics_text(&PeriodMetrics::default(), &plant("Asia/Bangkok", &THREE), &period);
        assert!(
            none.contains("alarms per day                            —  at most 150   at most 300   insufficient data"),
            "{none}"
        );
    }
}
