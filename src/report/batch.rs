//! A batch with the figures of its tags, and the list of batches as CSV.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    Gap, Period, PeriodName, TagFigures,
    csv::{self, floor_percent, iso, number, plain},
    text::mean_or_difference,
};
use crate::plant::{
    batch::Batch,
    def::{CsvDialect, PlantDef},
    energy::{self, Measures},
    exact::{Exact, digits},
};

/// A batch, what its tags did, and the alarms of its time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BatchReport {
    /// The batch.
    pub batch: Batch,
    /// Until when it was computed: its end, or the time of the query.
    pub until: Timestamp,
    /// One row for each tag of its rule, in that order.
    pub tags: Vec<TagFigures>,
    /// Energy in kWh over the time in which its tag was good, and the share of that time, 0–1; `None` without such a tag or
    /// without a good value.
    pub energy: Option<(f64, f64)>,
    /// Alarms that were raised in its time; `None` where there are so many batches that no figures were computed.
    pub alarms: Option<u64>,
    /// Where stored values could not be read: there, none is counted.
    pub unreadable: Vec<Gap>,
    /// Of one that began before the period of a report, what lies of it in the period.
    pub part: Option<Box<BatchReport>>,
}

impl BatchReport {
    /// Without figures.
    pub fn new(batch: Batch, until: Timestamp) -> BatchReport {
        BatchReport { batch, until, tags: Vec::new(), energy: None, alarms: None, unreadable: Vec::new(), part: None }
    }

    /// Its time, as a period to report on.
    pub fn period(&self) -> Period {
        Period { name: PeriodName::Batch(self.batch.label()), from: self.batch.from, to: self.until }
    }
}

/// Energy in kWh from the figures of a power or of an energy counter over `time`, and the share of it that was good.
pub fn energy(figures: &TagFigures, time: Duration) -> Option<(f64, f64)> {
    let hours = time.as_secs_f64() / 3_600.0;
    let kwh = match energy::of_unit(&figures.unit)? {
        Measures::Power(kw) => figures.mean?.near() * kw * hours * figures.good,
        Measures::Energy(kwh) => figures.difference?.near() * kwh,
    };
    Some((kwh, figures.good))
}

/// Columns of a batch itself.
const HEADER: [&str; 9] =
    ["batch", "number", "from", "to", "minutes", "state", "energy kWh", "energy good %", "alarms"];

/// The list of batches: a row each, with a column for every phase and the figures of every tag.
pub fn csv(batches: &[BatchReport], def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
    let (mut phases, mut tags): (Vec<&str>, Vec<(&str, &str, bool)>) = (Vec::new(), Vec::new());
    for report in batches {
        let of_one = report.batch.phases.iter().map(|(phase, _)| &**phase);
        of_one.for_each(|phase| {
            if !phases.contains(&phase) {
                phases.push(phase)
            }
        });
        for tag in &report.tags {
            match tags.iter_mut().find(|(name, ..)| *name == tag.tag) {
                Some((_, _, counts)) => *counts |= tag.difference.is_some(),
                None => tags.push((&tag.tag, &tag.unit, tag.difference.is_some())),
            }
        }
    }
    let mut header: Vec<String> = HEADER.map(plain).into();
    header.push(plain("minutes unknown"));
    header.extend(phases.iter().map(|phase| csv::text(&format!("minutes {phase}"))));
    for (tag, unit, counts) in &tags {
        let of_tag = |figure: &str| csv::text(format!("{tag} {figure} {unit}").trim());
        let mean = if *counts { "difference" } else { "mean" };
        header.extend(["min", mean, "max", "last"].map(of_tag));
        header.push(csv::text(&format!("{tag} good %")));
    }
    let row = |report: &BatchReport| {
        let mut row = own_cells(report, def, dialect);
        row.push(minutes(report.batch.unknown, dialect));
        row.extend(phases.iter().map(|phase| {
            let found = report.batch.phases.iter().find(|(known, _)| **known == **phase);
            found.map_or_else(String::new, |(_, time)| minutes(*time, dialect))
        }));
        for (name, ..) in &tags {
            match report.tags.iter().find(|tag| tag.tag == *name) {
                Some(tag) => row.extend(figures(tag, dialect)),
                None => row.extend(std::iter::repeat_n(String::new(), 5)),
            }
        }
        row
    };
    let rows: Vec<Vec<String>> = batches.iter().map(row).collect();
    csv::write(std::iter::once(header).chain(rows), dialect)
}

fn own_cells(report: &BatchReport, def: &PlantDef, dialect: CsvDialect) -> Vec<String> {
    let batch = &report.batch;
    let time = |at: Timestamp| plain(iso(&def.time_zone, at));
    let (kwh, good) = report.energy.unzip();
    vec![
        csv::text(&batch.name),
        plain(batch.number.to_string()),
        time(batch.from),
        batch.to.map(time).unwrap_or_default(),
        minutes(batch.lasted, dialect),
        plain(words(batch)),
        number(kwh, 3, dialect),
        number(good.map(floor_percent), 1, dialect),
        report.alarms.map(|alarms| alarms.to_string()).unwrap_or_default(),
    ]
}

fn figures(tag: &TagFigures, dialect: CsvDialect) -> [String; 5] {
    let value = |value: Option<Exact>| number(value, tag.decimals, dialect);
    let mean = match tag.difference {
        Some(difference) => value(Some(difference)),
        // One more decimal than the device has: a mean is finer than its samples.
        None => number(tag.mean, tag.decimals.saturating_add(1), dialect),
    };
    let good = number(Some(floor_percent(tag.good)), 1, dialect);
    [value(tag.min), mean, value(tag.max), value(tag.last), good]
}

fn minutes(time: Duration, dialect: CsvDialect) -> String {
    number(Some(time.as_secs_f64() / 60.0), 1, dialect)
}

/// The list of batches as lines.
pub fn text(batches: &[BatchReport], def: &PlantDef) -> String {
    if batches.is_empty() {
        return "no batch ran in this time".into();
    }
    let local = |at: Timestamp| at.to_zoned(def.time_zone.clone()).strftime("%F %T").to_string();
    let minutes = |time: Duration| format!("{:.1} min", time.as_secs_f64() / 60.0);
    let mut lines = Vec::new();
    for report in batches {
        let BatchReport { batch, energy, alarms, tags, .. } = report;
        let to = batch.to.map_or_else(|| "…".into(), local);
        let mut facts = vec![minutes(report.batch.lasted), words(batch).into()];
        facts.extend(energy.map(|(kwh, good)| match floor_percent(good) < 100.0 {
            true => format!("{kwh:.3} kWh in {:.1} % of the time", floor_percent(good)),
            false => format!("{kwh:.3} kWh"),
        }));
        facts.extend(alarms.map(|alarms| format!("{alarms} alarms")));
        lines.push(format!("{:20} {} to {to}  {}", batch.label(), local(batch.from), facts.join(", ")));
        let mut phases: Vec<String> =
            batch.phases.iter().map(|(name, time)| format!("{name} {}", minutes(*time))).collect();
        if !batch.unknown.is_zero() {
            phases.push(format!("unknown {}", minutes(batch.unknown)));
        }
        if !phases.is_empty() {
            lines.push(format!("    {}", phases.join(", ")));
        }
        for tag in tags {
            let value = |value: Option<Exact>| value.map_or("—".into(), |value| digits(value, Some(tag.decimals)));
            let (min, max, last) = (value(tag.min), value(tag.max), value(tag.last));
            let (mean, good) = (mean_or_difference(tag), floor_percent(tag.good));
            let unit = &tag.unit;
            lines.push(format!(
                "    {:20} {min} to {max} {unit}, mean/+ {mean}, last {last}, good {good:.1} %",
                tag.tag
            ));
        }
        for Gap { from, to, why } in &report.unreadable {
            lines.push(format!("    not readable, not counted: {} to {}: {why}", local(*from), local(*to)));
        }
    }
    lines.join("\n")
}

/// How a batch stands, and what of it was not seen.
pub fn words(batch: &Batch) -> &'static str {
    match (batch.to, batch.seen) {
        (None, (true, _)) => "running",
        (None, (false, _)) => "running, start not seen",
        (Some(_), (true, true)) => "ended",
        (Some(_), (false, true)) => "ended, start not seen",
        (Some(_), (true, false)) => "ended, end not seen",
        (Some(_), (false, false)) => "ended, start and end not seen",
    }
}
