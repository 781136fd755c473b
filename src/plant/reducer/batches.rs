//! Batches, control runs and totals in the reducer: each is followed with every change of the plant, and goes on after a restart.

use jiff::Timestamp;

use super::Plant;
use crate::plant::{
    PlantDef,
    batch::{self, BatchEvent, BatchRecord},
    control_run::{ControlRun, View},
    id::TagId,
    record::Record,
};

impl Plant {
    /// Lets the totals go on from their last stored values, by the names of their tags, or from 0. Without a call of this they
    /// have no value.
    pub fn restore_totals(&mut self, stored: &[(String, f64)]) {
        let named = |(name, value): &(String, f64)| Some((self.def.tag_named(name)?, *value));
        let stored: Vec<(TagId, f64)> = stored.iter().filter_map(named).collect();
        self.image.restore_totals(&stored);
    }

    /// Goes on with the batches of the station before this one, which ended at `off`: `latest` are the last records of each
    /// name. Without a call of this no batch is recorded. One whose rule is there no more ends.
    pub fn restore_batches(&mut self, latest: &[BatchRecord], off: Option<Timestamp>) -> Vec<Record> {
        let of_each = self.def.batches.iter().zip(&mut self.batches);
        let resumed = of_each.filter_map(|(def, tracker)| {
            tracker.restore(latest.iter().find(|record| record.batch == def.name).cloned(), off)
        });
        let mut records: Vec<BatchRecord> = resumed.collect();
        let is_ruled = |record: &BatchRecord| self.def.batches.iter().any(|def| def.name == record.batch);
        let left = latest.iter().filter(|record| !is_ruled(record));
        records.extend(left.filter_map(|record| batch::removed(record, off.unwrap_or(self.at))));
        records.into_iter().map(Record::Batch).collect()
    }

    /// Goes on counting the runs of each controller after its latest one, and interrupts those that the station before this
    /// one left at work. Without a call of this no run is recorded.
    pub fn restore_runs(&mut self, latest: &[ControlRun]) -> Vec<Record> {
        let plant = &self.def;
        let of_each = plant.runs.iter().zip(&mut self.runs);
        let restored = of_each.filter_map(|(def, tracker)| {
            let name = plant.device(def.controller).name.as_str();
            tracker.restore(latest.iter().find(|run| &*run.controller == name).cloned())
        });
        let mut interrupted: Vec<ControlRun> = restored.collect();
        let is_ruled =
            |run: &ControlRun| plant.runs.iter().any(|def| *plant.device(def.controller).name == *run.controller);
        interrupted.extend(latest.iter().filter(|run| !is_ruled(run)).filter_map(ControlRun::interrupted));
        interrupted.into_iter().map(|run| Record::Run(Box::new(run))).collect()
    }

    pub(super) fn follow_batches(&mut self) -> Vec<Record> {
        let (image, plant, at) = (&self.image, &self.def, self.at);
        let of_each = plant.batches.iter().zip(&mut self.batches);
        let changes = of_each.flat_map(|(def, tracker)| {
            let phase = def.phase.map(|tag| plant.tag(tag));
            tracker.update(def, phase, &|tag| image.sample(tag), at)
        });
        changes.map(Record::Batch).collect()
    }

    /// Follows the runs; `records` are those of now, among which a batch may start.
    pub(super) fn follow_runs(&mut self, records: &[Record]) -> Vec<Record> {
        let (image, plant) = (&self.image, &self.def);
        let started: Vec<(usize, String)> = records.iter().filter_map(|record| started(plant, record)).collect();
        let view = View {
            plant,
            sample: &|tag| image.sample(tag),
            decimals: &|tag| image.shown_decimals(plant.tag(tag)),
            started: &started,
            at: self.at,
        };
        let of_each = plant.runs.iter().zip(&mut self.runs);
        of_each.flat_map(|(def, tracker)| tracker.update(def, &view)).map(|run| Record::Run(Box::new(run))).collect()
    }

    /// Ends the runs at work: the station stops.
    pub(super) fn stop_runs(&mut self) -> Vec<Record> {
        let at = self.at;
        let stopped = self.runs.iter_mut().filter_map(|tracker| tracker.stop(at));
        stopped.map(|run| Record::Run(Box::new(run))).collect()
    }
}

/// The place and the label of a batch whose start was seen.
fn started(plant: &PlantDef, record: &Record) -> Option<(usize, String)> {
    let Record::Batch(record) = record else { return None };
    let place = plant.batches.iter().position(|rule| rule.name == record.batch)?;
    (record.event == BatchEvent::Started).then(|| (place, record.label()))
}
