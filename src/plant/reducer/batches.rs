//! The batches in the reducer: each rule is followed with every change of the plant.

use jiff::Timestamp;

use super::Plant;
use crate::plant::{batch::BatchRecord, record::Record};

impl Plant {
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
