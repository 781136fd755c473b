//! A terminal's copy of the plant, from the messages that the station sends of it.

use std::sync::Arc;

use crate::plant::{PlantDef, Snapshot, def::LineId, line_report::LineReport};

/// The latest snapshot and line reports. Starts blank with each connection.
#[derive(Debug)]
pub struct Assembly {
    latest: Arc<Snapshot>,
    reports: Vec<Option<Arc<LineReport>>>,
}

/// A message that is not of this plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a snapshot of another plant")]
pub struct OtherPlant;

impl Assembly {
    /// Nothing is known of the plant yet.
    pub fn new(def: Arc<PlantDef>) -> Assembly {
        Assembly { reports: vec![None; def.lines.len()], latest: Arc::new(Snapshot::blank(def)) }
    }

    /// The latest snapshot.
    pub fn latest(&self) -> &Arc<Snapshot> {
        &self.latest
    }

    /// A line has reported, or its report may not be seen any more. It is part of all following snapshots.
    pub fn on_report(&mut self, line: LineId, report: Option<Arc<LineReport>>) -> Result<(), OtherPlant> {
        *self.reports.get_mut(line.index()).ok_or(OtherPlant)? = report;
        Ok(())
    }

    /// A snapshot as it was decoded: without definition and line reports.
    pub fn on_snapshot(&mut self, mut snapshot: Snapshot) -> Result<(), OtherPlant> {
        let def = &self.latest.def;
        let by_tag =
            [snapshot.samples.len(), snapshot.texts.len(), snapshot.decimals.len(), snapshot.source_frames.len()];
        let by_device = [snapshot.devices.len(), snapshot.tunings.len(), snapshot.programs.len()];
        let fits = by_tag == [def.tags.len(); 4]
            && by_device == [def.devices.len(); 3]
            && snapshot.lines.len() == def.lines.len()
            && snapshot.runs.len() == def.runs.len()
            && snapshot.procedures.len() == def.procedures.len();
        if !fits {
            return Err(OtherPlant);
        }
        snapshot.def = def.clone();
        for (line, report) in snapshot.lines.iter_mut().zip(&self.reports) {
            line.report = report.clone();
        }
        self.latest = Arc::new(snapshot);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
