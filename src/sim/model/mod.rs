//! Devices made from their profiles: addresses, types, limits and refusals of the profile, values that move by its
//! `simulate` words. No Rust per device.
//!
//! ```text
//!  profile ── DeviceDef, TagDef ──> Model: words and bits by address ──> Slave ──> line
//!             Simulate ─> SignalGenerator: one value, in steps of 0.1 s ───┘
//! ```

mod signal;
mod registers;

#[cfg(test)]
mod tests;

use std::{sync::Arc, time::Duration};

use registers::Chart;
pub use registers::Model;
use signal::{SignalGenerator, Step};

use super::slave::Slave;
use crate::plant::{
    PlantDef,
    def::{DeviceId, TagId},
    simulate::{Motion, Simulate},
};

/// Time that a device takes between a request and its answer.
const REPLY_DELAY: Duration = Duration::from_millis(5);
/// Length of a step of the simulation.
const STEP: Duration = Duration::from_millis(100);
/// A value made of others that stand below it is right one step later; no profile goes deeper than this.
const INITIAL_STEPS: usize = 4;

/// The modelled devices of a plant.
#[derive(Debug, Clone, Default)]
pub struct Models {
    devices: Vec<Slave<Model>>,
    /// The model of each tag, by [`TagId`]; `None` for tags of other devices.
    of_tag: Vec<Option<usize>>,
    signals: Vec<Signal>,
    /// Tags that signals depend on, and their last values, by [`TagId`].
    inputs: Vec<TagId>,
    values: Vec<Option<f64>>,
    at: Duration,
    owed: Duration,
}

/// A tag with a `simulate` table.
#[derive(Debug, Clone)]
struct Signal {
    tag: TagId,
    how: Arc<Simulate>,
    generator: SignalGenerator,
    /// The register value after the last step: a different one now was written by a master.
    written: Option<f64>,
}

impl Models {
    /// A model of each of these devices, switched on.
    pub fn new(def: &PlantDef, devices: &[DeviceId]) -> Models {
        let chart = |id: &DeviceId| {
            Slave::new(Model::new(Arc::new(Chart::new(
                def.device(*id),
                def.tags_of(*id).filter(|tag| tag.calculation.is_none()),
            ))))
        };
        let of_tag = def.tags.iter().map(|tag| devices.iter().position(|device| *device == tag.device)).collect();
        let mut models = Models { devices: devices.iter().map(chart).collect(), of_tag, ..Models::default() };
        models.values = vec![None; def.tags.len()];
        for tag in def.tags.iter().filter(|tag| devices.contains(&tag.device)) {
            let Some(how) = &tag.simulate else { continue };
            let idle = || how.motion.as_ref().and_then(|Motion { idle, .. }| *idle);
            let start = how.start.or_else(idle).or(models.value(tag.id)).unwrap_or(0.0);
            let generator = SignalGenerator::new(&tag.name, start);
            let written = models.value(tag.id);
            models.signals.push(Signal { tag: tag.id, how: how.clone(), generator, written });
            models.inputs.extend(how.sources());
        }
        models.inputs.sort_unstable();
        models.inputs.dedup();
        models.initialise();
        models
    }

    /// A model as a unit of its line.
    pub fn unit(&mut self, place: usize) -> Option<&mut Slave<Model>> {
        self.devices.get_mut(place)
    }

    /// The time that a model takes between a request and its answer.
    pub fn reply_delay(&self, _place: usize) -> Duration {
        REPLY_DELAY
    }

    /// Lets plant time pass. What is left over below one step is kept for the next call.
    pub fn advance(&mut self, dt: Duration) {
        if self.signals.is_empty() {
            return;
        }
        self.owed += dt;
        while self.owed >= STEP {
            self.owed -= STEP;
            self.step(STEP);
        }
    }

    /// What the registers hold for a tag, in its unit.
    pub fn value(&self, tag: TagId) -> Option<f64> {
        self.devices.get(self.place(tag)?)?.device.value(tag)
    }

    /// Puts a value into the registers; `false` if they cannot hold it.
    pub fn set_value(&mut self, tag: TagId, value: f64) -> bool {
        let place = self.place(tag);
        place.and_then(|place| self.devices.get_mut(place)).is_some_and(|slave| slave.device.set_value(tag, value))
    }

    /// Computes derived values before the first request.
    fn initialise(&mut self) {
        for _ in 0..INITIAL_STEPS {
            self.step(Duration::ZERO);
        }
    }

    /// Moves every value in the order of the profiles, so that a value made of others above it fits them at once.
    fn step(&mut self, dt: Duration) {
        self.at += dt;
        let step = Step { at: self.at, dt };
        for place in 0..self.inputs.len() {
            let tag = self.inputs[place];
            self.values[tag.index()] = self.value(tag);
        }
        let mut signals = std::mem::take(&mut self.signals);
        for signal in &mut signals {
            let found = self.value(signal.tag);
            if let Some(changed) = found.filter(|_| found != signal.written) {
                signal.generator.exact = changed;
            }
            let shown =
                signal.generator.step(&signal.how, step, &|tag| self.values.get(tag.index()).copied().flatten());
            self.set_value(signal.tag, shown);
            self.values[signal.tag.index()] = Some(shown);
            signal.written = self.value(signal.tag);
        }
        self.signals = signals;
    }

    fn place(&self, tag: TagId) -> Option<usize> {
        self.of_tag.get(tag.index()).copied().flatten()
    }
}
