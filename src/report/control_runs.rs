//! Control runs as lines, as CSV and as a table of a report.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    csv::{self, floor_percent, iso, number, plain},
    document::{Cell, Column, Table},
};
use crate::{
    plant::{
        control_run::{ControlRun, Figure, WHOLE},
        def::{CsvDialect, PlantDef},
        exact::digits,
    },
    t,
    text::translate,
};

/// Runs of one report; of more, the newest.
pub const RUNS_MAX: usize = 1_000;

/// Columns of the list of runs. Times are in seconds: empty where it did not come to that.
const HEADER: [&str; 26] = [
    "controller",
    "number",
    "from",
    "to",
    "state",
    "cause",
    "detail",
    "begin seen",
    "SV before",
    "SV",
    "PV at begin",
    "unit",
    "band",
    "first at SV s",
    "steady from s",
    "rise s",
    "overshoot",
    "offset",
    "IAE unit min",
    "energy kWh",
    "energy good %",
    "good %",
    "settings",
    "settings changed",
    "minutes",
    "partial",
];

/// What lies of a run in the period of a report that it began before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunPart {
    /// Controller and number: `TIC-1-17`.
    pub run: String,
    /// How long it lasted in the period.
    pub lasted: Duration,
    /// Energy in kWh in the period, and the share of that time in which it was known.
    pub energy: Option<(f64, f64)>,
}

/// The list of runs, a row each.
pub fn csv(runs: &[ControlRun], def: &PlantDef, dialect: CsvDialect) -> Vec<u8> {
    let rows = runs.iter().map(|run| row(run, def, dialect));
    csv::write(std::iter::once(HEADER.map(plain).to_vec()).chain(rows), dialect)
}

fn row(run: &ControlRun, def: &PlantDef, dialect: CsvDialect) -> Vec<String> {
    let time = |at: Timestamp| plain(iso(&def.time_zone, at));
    let value = |value: Option<f64>| number(value, run.decimals, dialect);
    // Finer than its samples: a band is a share, a sum has no digits of its own.
    let fine = |value: Option<f64>| number(value, run.decimals.saturating_add(2), dialect);
    let figure = |figure: Figure| match figure {
        Figure::NotYet => String::new(),
        Figure::After(time) => number(Some(time.as_secs_f64()), 1, dialect),
        Figure::Unknown => plain("unknown"),
    };
    let percent = |share: Option<f64>| number(share.map(floor_percent), 1, dialect);
    let flag = |is: bool| plain(if is { "yes" } else { "no" });
    let (kwh, kwh_good) = run.energy.unzip();
    vec![
        csv::text(&run.controller),
        plain(run.number.to_string()),
        time(run.from),
        time(run.until),
        plain(run.state.word()),
        plain(run.cause.word()),
        csv::text(&run.detail),
        flag(run.seen),
        value(run.sv_before),
        value(Some(run.sv)),
        value(run.pv),
        csv::text(&run.unit),
        fine(Some(run.band)),
        figure(run.at_sv),
        figure(run.steady),
        figure(run.rise),
        value(run.overshoot),
        value(run.offset),
        fine(Some(run.iae)),
        number(kwh, 3, dialect),
        percent(kwh_good),
        percent(Some(run.good)),
        csv::text(&run.settings),
        flag(run.settings_changed),
        number(Some(run.lasted().as_secs_f64() / 60.0), 1, dialect),
        flag(run.is_partial()),
    ]
}

/// The list of runs as lines.
pub fn text(runs: &[ControlRun], def: &PlantDef) -> String {
    if runs.is_empty() {
        return "no control run in this time".into();
    }
    let local = |at: Timestamp| at.to_zoned(def.time_zone.clone()).strftime("%F %T").to_string();
    let lines = runs.iter().flat_map(|run| {
        let begin = if run.seen { "" } else { ", begin not seen" };
        let head = format!(
            "{:12} {}  {}  {} for {}{begin}",
            run.label(),
            local(run.from),
            setpoint(run),
            run.state.word(),
            clock(run.lasted())
        );
        let settings = match (&*run.settings, run.settings_changed) {
            ("", false) => None,
            ("", true) => Some("    settings changed meanwhile".to_owned()),
            (settings, false) => Some(format!("    {settings}")),
            (settings, true) => Some(format!("    {settings}, changed meanwhile")),
        };
        [Some(head), Some(format!("    {}", figures(run).join(", "))), settings].into_iter().flatten()
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// `setpoint 27.0 → 70.0 °C`, `program step 2, 70.0 °C`, `batch hot-water-3, 70.0 °C`.
pub fn setpoint(run: &ControlRun) -> String {
    let value = |value: f64| digits(value, Some(run.decimals));
    let (cause, sv, unit) = (translate(run.cause.word()), value(run.sv), &run.unit);
    let detail = run.detail.strip_prefix("step ").unwrap_or(&run.detail);
    match (detail, run.sv_before) {
        ("", Some(before)) => format!("{cause} {} → {sv} {unit}", value(before)),
        ("", None) => format!("{cause} {sv} {unit}"),
        (detail, _) => format!("{cause} {detail}, {sv} {unit}"),
    }
}

/// The figures in words: `first at SV 12:45`, `steady from 17:46`, …
pub fn figures(run: &ControlRun) -> Vec<String> {
    let (running, unit) = (run.is_running(), &run.unit);
    let value = |value: f64| digits(value, Some(run.decimals));
    // Of a time without good values a sum or an extreme is a lower bound.
    let least = |is_bound: bool| if is_bound { t!("at least ") } else { "" };
    let bound = least(run.is_partial());
    let at_sv = match (run.at_sv, running) {
        (Figure::After(time), _) => t!("at SV {time}", time = clock(time)),
        (Figure::Unknown, _) => t!("at SV, time unknown").to_owned(),
        (Figure::NotYet, true) => t!("not yet at SV").to_owned(),
        (Figure::NotYet, false) => t!("never at SV").to_owned(),
    };
    let steady = match (run.steady, running) {
        (Figure::After(time), _) => t!("steady from {time}", time = clock(time)),
        (Figure::Unknown, _) => t!("steady, time unknown").to_owned(),
        (Figure::NotYet, true) => t!("not yet steady").to_owned(),
        (Figure::NotYet, false) => t!("never steady").to_owned(),
    };
    let overshoot = run.overshoot.map(|over| t!("overshoot {bound}{value} {unit}", bound, value = value(over), unit));
    let offset = match run.offset {
        Some(offset) => t!("offset {value} {unit}", value = value(offset), unit),
        None => t!("offset unknown").to_owned(),
    };
    let rise = match run.rise {
        Figure::After(time) => Some(t!("rise {time}", time = clock(time))),
        Figure::Unknown => Some(t!("rise unknown").to_owned()),
        Figure::NotYet => None,
    };
    let iae = format!("IAE {bound}{} {unit} min", value(run.iae));
    let energy = run.energy.map(|(kwh, good)| format!("{}{kwh:.3} kWh", least(good < WHOLE)));
    let good = run.is_partial().then(|| t!("good {percent} %", percent = format!("{:.1}", floor_percent(run.good))));
    [Some(at_sv), Some(steady), overshoot, Some(offset), rise, Some(iae), energy, good].into_iter().flatten().collect()
}

/// When something was reached: `12:45`, `never`.
pub fn reached(time: Option<Duration>) -> String {
    time.map_or_else(|| t!("never").to_owned(), clock)
}

/// `12:45`, `1:02:45`.
pub fn clock(time: Duration) -> String {
    let (hours, minutes, seconds) = (time.as_secs() / 3_600, time.as_secs() / 60 % 60, time.as_secs() % 60);
    if hours == 0 { format!("{minutes}:{seconds:02}") } else { format!("{hours}:{minutes:02}:{seconds:02}") }
}

/// The runs as a table of a report.
pub(super) fn table(runs: &[ControlRun], parts: &[RunPart]) -> Table {
    let columns = [
        Column::text("run"),
        Column::time("from"),
        Column::number("minutes"),
        Column::text("state"),
        Column::text("setpoint"),
        Column::number("first at SV, min"),
        Column::number("steady from, min"),
        Column::number("rise, min"),
        Column::number("overshoot"),
        Column::number("final offset"),
        Column::number("IAE, unit min"),
        Column::number("energy kWh"),
        Column::number("energy good %"),
        Column::number("good %"),
        Column::text("settings"),
        Column::number("whole minutes"),
        Column::number("whole energy kWh"),
    ];
    let minutes = |time: Duration| Cell::number(Some(time.as_secs_f64() / 60.0), 1);
    let figure = |figure: Figure| match figure {
        Figure::NotYet => Cell::Empty,
        Figure::After(time) => Cell::number(Some(time.as_secs_f64() / 60.0), 2),
        Figure::Unknown => Cell::text(t!("unknown")),
    };
    Table::new(columns).with(runs.iter().map(|run| {
        let part = parts.iter().find(|part| part.run == run.label());
        let (lasted, energy) = part.map_or((run.lasted(), run.energy), |part| (part.lasted, part.energy));
        let (kwh, kwh_good) = energy.unzip();
        let changed = if run.settings_changed { t!(" (changed)") } else { "" };
        vec![
            Cell::text(run.label()),
            Cell::Time(run.from),
            minutes(lasted),
            Cell::text(of_part(translate(run.state.word()), part.is_some())),
            Cell::text(setpoint(run)),
            figure(run.at_sv),
            figure(run.steady),
            figure(run.rise),
            Cell::number(run.overshoot, run.decimals),
            Cell::number(run.offset, run.decimals),
            Cell::number(Some(run.iae), run.decimals.saturating_add(1)),
            Cell::number(kwh, 3),
            Cell::number(kwh_good.map(floor_percent), 1),
            Cell::number(Some(floor_percent(run.good)), 1),
            Cell::text(format!("{}{changed}", run.settings)),
            part.map_or(Cell::Empty, |_| minutes(run.lasted())),
            Cell::number(part.and(run.energy).map(|(kwh, _)| kwh), 3),
        ]
    }))
}

/// A state, and that only a part lies in the period.
pub(super) fn of_part(state: &str, is_part: bool) -> String {
    if is_part { t!("{state}, part", state) } else { state.to_owned() }
}
