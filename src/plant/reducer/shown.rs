//! What everything outside sees of the plant.

use std::sync::Arc;

use jiff::SignedDuration;

use super::Plant;
use crate::plant::{
    PlantDef,
    control_run::RunTracker,
    program::ProgramWatch,
    snapshot::{LineStatus, Snapshot},
};

impl Plant {
    /// The definition of the plant.
    pub fn def(&self) -> &Arc<PlantDef> {
        &self.def
    }

    /// Every line as it stands.
    pub fn lines(&self) -> &[LineStatus] {
        &self.lines
    }

    /// The plant as of its last event, command or tick.
    pub fn snapshot(&self) -> Snapshot {
        let lists = self.alarm_manager.lists();
        Snapshot {
            at: self.at,
            run: self.run,
            stepped: SignedDuration::ZERO,
            def: self.def.clone(),
            samples: self.image.samples.clone(),
            texts: self.image.texts.clone(),
            identities: self.image.identities.clone(),
            decimals: self.def.tags.iter().map(|tag| self.image.shown_decimals(tag)).collect(),
            source_frames: self.source_frames.clone(),
            lines: self.lines.clone(),
            devices: self.diagnosed(),
            alarms: lists.active.clone(),
            suppressed: lists.suppressed.clone(),
            sound: lists.sound,
            annunciations: self.alarm_manager.annunciations(),
            alarm_metrics: self.alarm_metrics.clone(),
            commands: self.commands.shown(),
            actuators: self.actuators.clone(),
            history: self.history.clone(),
            station: self.faults.details.clone(),
            sets: self.sets.clone(),
            restores: self.restores.clone(),
            tunings: self.tunings.iter().map(|tracker| tracker.tuning.clone()).collect(),
            programs: self.programs.iter().map(ProgramWatch::elapsed).collect(),
            runs: self.runs.iter().map(RunTracker::shown).collect(),
            procedures: self.procedures.clone(),
            north: self.north.clone(),
            load: self.load,
            speed: self.speed,
        }
    }
}
