//! What a plant has made and how long it ran: counters, run hours and batches as tables.

use std::{sync::Arc, time::Duration};

use super::{label, minutes};
use crate::{
    plant::{counter::CounterEvent, def::PlantDef},
    report::{
        RunFigures,
        batch::{self, BatchReport},
        control_runs::of_part,
        counters::CounterRow,
        csv::floor_percent,
        document::{Cell, Column, Table},
    },
    text::translate,
};

/// What counters did beside counting.
pub fn counters(rows: &[CounterRow], def: &PlantDef) -> Table {
    let columns = [
        Column::time("time"),
        Column::text("tag"),
        Column::text("event"),
        Column::number("old"),
        Column::number("new"),
        Column::number("counted"),
        Column::text("unit"),
        Column::text("note"),
        Column::text("label"),
    ];
    Table::new(columns).with(rows.iter().map(|CounterRow { tag, unit, decimals, step, note }| {
        let value = |value| Cell::number(Some(value), *decimals);
        let is_read = step.event != CounterEvent::Corrected;
        let [old, new] = [step.old, step.new].map(|shown| if is_read { value(shown) } else { Cell::Empty });
        let event = Cell::text(translate(step.event.word()));
        let (counted, [name, unit, note]) = (value(step.counted), [tag, unit, note].map(Cell::text));
        vec![Cell::Time(step.at), name, event, old, new, counted, unit, note, label(def, tag)]
    }))
}

pub fn runs(runs: &[RunFigures], def: &PlantDef) -> Table {
    let columns = [
        Column::text("actuator"),
        Column::number("hours on"),
        Column::number("starts"),
        Column::number("good %"),
        Column::text("label"),
    ];
    Table::new(columns).with(runs.iter().map(|run| {
        let hours = run.on.map(|on| on.as_secs_f64() / 3_600.0);
        let good = Cell::number(Some(floor_percent(run.good)), 1);
        vec![Cell::text(&run.tag), Cell::number(hours, 2), Cell::number(run.starts, 0), good, label(def, &run.tag)]
    }))
}

/// The batches, each with what lies of it in the period; of one that began before it, with the whole beside that.
pub fn batches(batches: &[BatchReport]) -> Table {
    let columns = [
        Column::text("batch"),
        Column::number("number"),
        Column::time("from"),
        Column::time("to"),
        Column::number("minutes"),
        Column::text("state"),
        Column::number("energy kWh"),
        Column::number("energy good %"),
        Column::number("alarms"),
        Column::text("phases, minutes"),
        Column::number("whole minutes"),
        Column::number("whole energy kWh"),
    ];
    Table::new(columns).with(batches.iter().map(|report| {
        let (batch, whole) = (&report.batch, report.part.as_ref().map(|_| report));
        let part = report.part.as_deref().unwrap_or(report);
        let (kwh, good) = part.energy.unzip();
        let phase = |(name, time): &(Arc<str>, Duration)| format!("{name} {:.1}", time.as_secs_f64() / 60.0);
        let phases: Vec<String> = part.batch.phases.iter().map(phase).collect();
        vec![
            Cell::text(&batch.name),
            Cell::number(Some(f64::from(batch.number)), 0),
            Cell::Time(batch.from),
            batch.to.map_or(Cell::Empty, Cell::Time),
            minutes(part.batch.lasted),
            Cell::text(of_part(translate(batch::words(batch)), whole.is_some())),
            Cell::number(kwh, 3),
            Cell::number(good.map(floor_percent), 1),
            Cell::number(part.alarms.map(|alarms| alarms as f64), 0),
            Cell::text(phases.join(" | ")),
            whole.map_or(Cell::Empty, |whole| minutes(whole.batch.lasted)),
            Cell::number(whole.and_then(|whole| whole.energy).map(|(kwh, _)| kwh), 3),
        ]
    }))
}
