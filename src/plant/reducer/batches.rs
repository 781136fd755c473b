//! Batches and totals in the reducer: each rule is followed with every change of the plant, and goes on after a restart.

use jiff::Timestamp;

use super::Plant;
use crate::plant::{batch::BatchRecord, id::TagId, record::Record};

impl Plant {
    /// Lets the totals go on from their last stored values, or from 0. Without a call of this they have no value.
    pub fn restore_totals(&mut self, stored: &[(TagId, f64)]) {
        self.image.restore_totals(stored);
    }

    /// Goes on with the batches of the station before this one, which ended at `off`: `latest` are the last records of each
    /// name. Without a call of this no batch is recorded.
    pub fn restore_batches(&mut self, latest: &[BatchRecord], off: Option<Timestamp>) -> Vec<Record> {
        let of_each = self.def.batches.iter().zip(&mut self.batches);
        let resumed = of_each.filter_map(|(def, tracker)| {
            tracker.restore(latest.iter().find(|record| record.batch == def.name).cloned(), off)
        });
        resumed.map(Record::Batch).collect()
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
}
