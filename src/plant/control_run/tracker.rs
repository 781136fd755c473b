//! Follows the runs of one controller, and says what must be stored of them.

use std::sync::Arc;

use jiff::Timestamp;

use super::{ControlRun, Figure, LEAST, RunCause, RunDef, RunState, STORED, figures::Figures};
use crate::plant::{
    def::{DeviceDef, PlantDef, ProgramDef},
    exact::digits,
    id::TagId,
    program::ProgramPosition,
    sample::Sample,
    time::elapsed,
};

/// What a tracker looks at.
pub(in crate::plant) struct View<'a> {
    /// The plant.
    pub plant: &'a PlantDef,
    /// The sample of a tag.
    pub sample: &'a dyn Fn(TagId) -> Sample,
    /// Decimals of a tag.
    pub decimals: &'a dyn Fn(TagId) -> u8,
    /// Batches that have just started: place of the rule, and label.
    pub started: &'a [(usize, String)],
    /// Now.
    pub at: Timestamp,
}

impl View<'_> {
    pub(super) fn good(&self, tag: TagId) -> Option<f64> {
        (self.sample)(tag).good_value()
    }
}

/// Follows the runs of one controller. It begins none before [`RunTracker::restore`]: a number must not be given twice.
#[derive(Debug, Clone, Default)]
pub struct RunTracker {
    /// The number of the last run that was stored, once that is known.
    last_number: Option<u32>,
    /// The target and the position of the program when they were last known, and whether the target was at the last update.
    target: Option<f64>,
    position: Option<f64>,
    known: bool,
    /// A batch that started while the target was not known.
    started: Option<String>,
    /// The name of the measurement that begins as soon as the target is known.
    measurement: Option<Arc<str>>,
    open: Option<Open>,
    /// The last run that ended.
    ended: Option<Arc<ControlRun>>,
}

/// A run at work.
#[derive(Debug, Clone)]
struct Open {
    run: ControlRun,
    figures: Figures,
    parameters: Vec<Option<f64>>,
    /// When it was stored last, and with which times.
    stored: Option<(Timestamp, [Figure; 3])>,
}

impl Open {
    fn is_measured_as(&self, label: &str) -> bool {
        self.run.cause == RunCause::Procedure && *self.run.detail == *label
    }
}

impl RunTracker {
    /// Goes on counting after the last run of the history, unless it does already. One that the station before this one left at
    /// work is interrupted.
    pub fn restore(&mut self, latest: Option<ControlRun>) -> Option<ControlRun> {
        if self.is_ready() {
            return None;
        }
        self.last_number = Some(latest.as_ref().map_or(0, |latest| latest.number));
        let latest = latest?;
        let interrupted = latest.interrupted();
        self.ended = Some(Arc::new(interrupted.clone().unwrap_or(latest)));
        interrupted
    }

    /// The run at work, or the last one.
    pub fn shown(&self) -> Option<Arc<ControlRun>> {
        self.open.as_ref().map(|open| Arc::new(open.run.clone())).or_else(|| self.ended.clone())
    }

    /// The station stops: what must be stored of the run at work.
    pub fn stop(&mut self, at: Timestamp) -> Option<ControlRun> {
        self.close(at, RunState::Interrupted)
    }

    /// Begins a run for a procedure with the next update; `false` where none can be recorded yet.
    pub fn begin_measurement(&mut self, label: &Arc<str>) -> bool {
        self.measurement = Some(label.clone()).filter(|_| self.is_ready());
        self.is_ready()
    }

    /// Can runs be recorded?
    pub fn is_ready(&self) -> bool {
        self.last_number.is_some()
    }

    /// Ends the run of a procedure; `None` where there is none that is long enough to be kept.
    pub fn end_measurement(&mut self, at: Timestamp, state: RunState) -> Option<ControlRun> {
        self.measurement = None;
        let is_measured = self.open.as_ref().is_some_and(|open| open.run.cause == RunCause::Procedure);
        if is_measured { self.close(at, state) } else { None }
    }

    /// What must be stored of the runs as they stand now.
    pub(in crate::plant) fn update(&mut self, def: &RunDef, view: &View) -> Vec<ControlRun> {
        if self.last_number.is_none() {
            return Vec::new();
        }
        let device = view.plant.device(def.controller);
        let (target, step) = self.target(device, def, view);
        let started = view.started.iter().find(|(place, _)| def.batches.contains(place));
        let batch = started.map(|(_, label)| label.clone()).or_else(|| self.started.take());
        let mut records = Vec::new();
        if let Some((cause, detail, sv)) = self.beginning(target, step, batch.as_deref()) {
            // What was too short to be kept was a setpoint on its way from the one before it.
            let sv_before = match &self.open {
                Some(open) if open.stored.is_none() => open.run.sv_before,
                Some(_) | None => self.target,
            };
            // A step of the setpoint within a measurement is what is measured: from there on, under the same number.
            let measured = self.open.take_if(|open| cause == RunCause::Procedure && open.is_measured_as(&detail));
            records.extend(self.close(view.at, RunState::Ended));
            let next = self.last_number.unwrap_or_default() + 1;
            let (number, place, stored) =
                measured.map_or((next, 0, None), |open| (open.run.number, open.run.place, open.stored));
            let begun = begin(def, device, view, cause, &detail);
            let run = ControlRun { number, place, sv, sv_before, seen: self.known, ..begun };
            let parameters = parameters(device, view).collect();
            self.open = Some(Open { run, figures: Figures::new(view.at), parameters, stored });
        }
        self.started = batch.filter(|_| target.is_none());
        self.known = target.is_some();
        self.target = target.or(self.target);
        if let Some(open) = &mut self.open {
            open.figures.update(&mut open.run, def, target, view);
            open.run.settings_changed |= has_changed(&open.parameters, parameters(device, view));
            // What is measured ends with its procedure.
            let is_over = open.run.cause != RunCause::Procedure && def.duration_max <= open.run.lasted();
            records.extend(match is_over {
                true => self.close(view.at, RunState::Ended),
                false => self.store(view.at),
            });
        }
        records
    }

    /// Cause, detail and setpoint of the run that begins now, if one does.
    fn beginning(
        &mut self,
        target: Option<f64>,
        step: Option<usize>,
        batch: Option<&str>,
    ) -> Option<(RunCause, String, f64)> {
        let sv = target?;
        if let Some(label) = self.measurement.take() {
            return Some((RunCause::Procedure, label.to_string(), sv));
        }
        let changed = self.target.is_some_and(|before| before != sv);
        if let Some(open) = self.open.as_ref().filter(|open| open.run.cause == RunCause::Procedure) {
            return changed.then(|| (RunCause::Procedure, open.run.detail.to_string(), sv));
        }
        match (step, batch, changed) {
            (Some(step), ..) => Some((RunCause::Program, format!("step {}", step + 1), sv)),
            (None, Some(label), _) => Some((RunCause::Batch, label.to_owned(), sv)),
            (None, None, true) => Some((RunCause::Setpoint, String::new(), sv)),
            (None, None, false) => None,
        }
    }

    /// The setpoint that is worked towards, if it is known; and the step of the program that has just begun.
    fn target(&mut self, device: &DeviceDef, def: &RunDef, view: &View) -> (Option<f64>, Option<usize>) {
        let fixed = view.good(def.sv).or_else(|| {
            // The controller still works towards the one that was read last.
            self.target.filter(|target| def.sv_used.is_some_and(|used| view.good(used) == Some(*target)))
        });
        let Some(program) = &device.program else { return (fixed, None) };
        let Some(position) = view.good(program.position) else {
            // A position that was never read says nothing: then only the setpoint counts.
            let unread = self.position.is_none();
            return (fixed.filter(|_| unread), None);
        };
        let before = self.position.replace(position).map(|before| step_of(program, before));
        match (step_of(program, position), before) {
            (None, _) => (fixed, None),
            (Some(step), before) => {
                let begins = before.is_some_and(|before| before != Some(step));
                (view.good(program.steps[step].sv), begins.then_some(step))
            }
        }
    }

    /// Ends the run at work. One that was too short is forgotten.
    fn close(&mut self, at: Timestamp, state: RunState) -> Option<ControlRun> {
        let mut open = self.open.take()?;
        open.figures.pass(&mut open.run, at);
        open.stored?;
        let run = ControlRun { state, place: open.run.place + 1, ..open.run };
        self.ended = Some(Arc::new(run.clone()));
        Some(run)
    }

    /// The run at work, where something has happened, or nothing was stored for a while.
    fn store(&mut self, at: Timestamp) -> Option<ControlRun> {
        let open = self.open.as_mut()?;
        let now = [open.run.at_sv, open.run.steady, open.run.rise];
        let due = match open.stored {
            None => LEAST <= open.run.lasted(),
            Some((stored, times)) => {
                let since = elapsed(stored, at);
                STORED.1 <= since || STORED.0 <= since && times != now
            }
        };
        if !due {
            return None;
        }
        open.run.place += u32::from(open.stored.is_some());
        open.stored = Some((at, now));
        self.last_number = Some(open.run.number);
        Some(open.run.clone())
    }
}

/// A run without number, setpoint and figures.
fn begin(def: &RunDef, device: &DeviceDef, view: &View, cause: RunCause, detail: &str) -> ControlRun {
    let pv = view.plant.tag(def.pv);
    ControlRun {
        controller: device.name.as_str().into(),
        number: 0,
        place: 0,
        state: RunState::Running,
        cause,
        detail: detail.into(),
        seen: true,
        from: view.at,
        until: view.at,
        sv_before: None,
        sv: 0.0,
        pv: None,
        unit: pv.unit_now(view.sample).into(),
        decimals: (view.decimals)(def.pv),
        band: def.band.unwrap_or_default(),
        settings: settings(device, view).into(),
        settings_changed: false,
        at_sv: Figure::NotYet,
        steady: Figure::NotYet,
        rise: Figure::NotYet,
        overshoot: None,
        offset: None,
        iae: 0.0,
        energy: None,
        good: 0.0,
    }
}

/// The step that a program is in, from 0.
fn step_of(program: &ProgramDef, position: f64) -> Option<usize> {
    match program.place(position) {
        ProgramPosition::Ramp(step) | ProgramPosition::Soak(step) => Some(step),
        ProgramPosition::Off | ProgramPosition::Ended => None,
    }
}

/// The tags of the control parameters.
fn parameter_tags(device: &DeviceDef) -> impl Iterator<Item = TagId> + '_ {
    device.faceplate.iter().flat_map(|faceplate| faceplate.tunes.iter().copied().chain(faceplate.mode))
}

fn parameters<'a>(device: &'a DeviceDef, view: &'a View) -> impl Iterator<Item = Option<f64>> + 'a {
    parameter_tags(device).map(|tag| view.good(tag))
}

/// Was a parameter seen to be another one? One that is not known is not.
fn has_changed(before: &[Option<f64>], now: impl Iterator<Item = Option<f64>>) -> bool {
    before.iter().zip(now).any(|pair| matches!(pair, (Some(before), Some(now)) if *before != now))
}

/// `P 5.0, I 240, D 60, PID`.
fn settings(device: &DeviceDef, view: &View) -> String {
    let word = |tag: TagId| {
        let (value, def) = ((view.sample)(tag).good_exact()?, view.plant.tag(tag));
        Some(match def.label_of(value) {
            Some(label) => label.to_owned(),
            None => format!("{} {}", def.short, digits(value, Some((view.decimals)(tag)))),
        })
    };
    parameter_tags(device).filter_map(word).collect::<Vec<_>>().join(", ")
}
