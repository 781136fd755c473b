//! The plant's reducer: event, command or tick in, effects out. The only place where the plant changes.

mod alarms;
mod batches;
mod connection;
mod health;
mod procedures;
mod alarm_metrics;
mod redefine;
mod restore;
mod service;
mod shown;
mod station;
mod writes;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    alarm::{AlarmManager, AlarmMetrics, AlarmMonitor, command::check_note},
    batch::BatchTracker,
    command::{BusRequest, CommandId, CommandKind, CommandStatus, Outcome, Refusal, WriteJob},
    commands::CommandTracker,
    control_run::RunTracker,
    counter_watch::{self, CounterWatch},
    def::{LineDef, LineId, PlantDef, TagId},
    event::Event,
    fault::Fault,
    heard,
    interlock::ActuatorTracker,
    line_minute_tracker::LineMinuteTracker,
    line_state::{DeviceState, LineState},
    line_trouble::LineTrouble,
    north_status::NorthStatus,
    parameter_set::StoredSet,
    procedure::ProcedureRun,
    process_image::ProcessImage,
    process_load::ProcessLoad,
    program::ProgramWatch,
    record::{ActionRecord, Record},
    restore::Restore,
    snapshot::{DeviceStatus, HistoryStatus, LineStatus},
    station_alarms::StationFaults,
    traffic::Exchange,
    tuning::TuningTracker,
};

pub use redefine::Redefined;
pub use restore::SetWork;

/// What the station must do after a change of the plant.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Effects {
    /// Requests for link tasks.
    pub bus: Vec<(LineId, BusRequest)>,
    /// Lines of the history.
    pub records: Vec<Record>,
    /// Settings of a line for the plant file, and the command that requests it.
    pub save: Option<(CommandId, LineDef)>,
    /// Work with the folder of parameter sets.
    pub sets: Option<SetWork>,
}

impl Effects {
    /// Only the records of operator actions.
    fn of_actions(actions: impl IntoIterator<Item = ActionRecord>) -> Effects {
        Effects { records: actions.into_iter().map(Record::Action).collect(), ..Effects::default() }
    }
    /// Sends a write that is permitted, or records the one that is not.
    fn write(&mut self, line: LineId, checked: Result<WriteJob, Box<ActionRecord>>) {
        match checked {
            Ok(job) => self.bus.push((line, BusRequest::Write(job))),
            Err(action) => self.records.push(Record::Action(*action)),
        }
    }
}

/// The state of the plant. The plant task owns it; everything else sees [`Snapshot`](super::snapshot::Snapshot)s.
#[derive(Debug, Clone)]
pub struct Plant {
    def: Arc<PlantDef>,
    at: Timestamp,
    /// The run of the station, identified by its start time in microseconds.
    run: u64,
    image: ProcessImage,
    alarm_manager: AlarmManager,
    /// Counts the alarm events; `alarm_metrics` are its latest.
    alarm_monitor: AlarmMonitor,
    alarm_metrics: AlarmMetrics,
    commands: CommandTracker,
    actuators: ActuatorTracker,
    /// By place in [`PlantDef::batches`].
    batches: Vec<BatchTracker>,
    /// By place in [`PlantDef::runs`].
    runs: Vec<RunTracker>,
    lines: Vec<LineStatus>,
    /// Earlier reports, by [`LineId`].
    line_minutes: Vec<LineMinuteTracker>,
    devices: Vec<DeviceStatus>,
    /// The last request for each tag, by [`TagId`].
    source_frames: Arc<Vec<Option<Arc<Exchange>>>>,
    history: HistoryStatus,
    faults: StationFaults,
    speed: f64,
    /// The content of the folder of parameter sets.
    sets: Arc<Vec<StoredSet>>,
    /// The latest restore of each device that had one.
    restores: Vec<Arc<Restore>>,
    /// Each procedure at work or as it ended last, by [`super::id::ProcedureId`].
    procedures: Vec<Option<Arc<ProcedureRun>>>,
    /// Number of the last command that a restore or a procedure sent.
    last_number: u32,
    /// Auto-tuning and program, by device.
    tunings: Vec<TuningTracker>,
    programs: Vec<ProgramWatch>,
    /// How far the data out has come.
    north: Option<Arc<NorthStatus>>,
    load: Option<ProcessLoad>,
    counters: CounterWatch,
}

impl Plant {
    /// A plant without values and connections at `at`. `speed` is plant seconds per real second, for display.
    pub fn new(def: Arc<PlantDef>, at: Timestamp, speed: f64) -> Plant {
        Plant {
            image: ProcessImage::new(def.clone(), at),
            alarm_manager: AlarmManager::new(def.clone()),
            alarm_monitor: AlarmMonitor::running(at),
            alarm_metrics: AlarmMetrics::default(),
            commands: CommandTracker::new(def.clone()),
            actuators: ActuatorTracker::default(),
            batches: vec![BatchTracker::default(); def.batches.len()],
            runs: vec![RunTracker::default(); def.runs.len()],
            lines: vec![LineStatus::default(); def.lines.len()],
            line_minutes: vec![LineMinuteTracker::default(); def.lines.len()],
            devices: vec![DeviceStatus::default(); def.devices.len()],
            source_frames: Arc::new(vec![None; def.tags.len()]),
            history: HistoryStatus::default(),
            faults: StationFaults::default(),
            sets: Arc::default(),
            restores: Vec::new(),
            procedures: vec![None; def.procedures.len()],
            last_number: 0,
            tunings: vec![TuningTracker::default(); def.devices.len()],
            programs: vec![ProgramWatch::default(); def.devices.len()],
            north: None,
            load: None,
            counters: CounterWatch::default(),
            def,
            at,
            run: at.as_microsecond().cast_unsigned(),
            speed,
        }
    }

    /// Applies an event.
    pub fn on_event(&mut self, event: Event) -> Effects {
        let (at, action) = match event {
            Event::Read { at, device, values, texts, response_time, exchange } => {
                if exchange.as_ref().is_some_and(|exchange| exchange.outcome == Err(Fault::Unproven)) {
                    self.image.read_unproven(&values, &texts, at);
                } else {
                    self.image.read(&values, at);
                    self.image.read_texts(&texts, at);
                }
                let tags = values.iter().map(|(tag, _)| *tag).chain(texts.iter().map(|(tag, _)| *tag));
                self.keep_source_frames(tags, exchange);
                let status = &mut self.devices[device.index()];
                status.state = DeviceState::Responding;
                status.response_time = Some(response_time);
                status.ok += 1;
                status.values += (values.len() + texts.len()) as u64;
                (at, None)
            }
            Event::Failed { at, device, tags, fault, exchange } => {
                self.failed(device, &tags, fault, at);
                // What is good still comes from an earlier exchange.
                let image = &self.image;
                let without = tags.into_iter().filter(|tag| !image.sample(*tag).quality.is_good()).collect::<Vec<_>>();
                self.keep_source_frames(without.into_iter(), exchange);
                (at, None)
            }
            Event::Identified { at, device, objects } => {
                self.image.identified(device, objects, at);
                (at, None)
            }
            Event::ForeignWrite { at, tags, fault } => {
                tags.iter().for_each(|tag| self.image.written(*tag, fault, at));
                (at, None)
            }
            Event::Line { at, line, state } => (at, self.line_changed(line, state, at)),
            Event::Report { at, line, report } => {
                let status = &mut self.lines[line.index()];
                status.counters = report.counters;
                status.report = Some(report);
                (at, None)
            }
            Event::Diagnostic { at, line, run } => (at, self.tested(line, run, at)),
            Event::Station { at, fault, state } => {
                self.faults.set(fault, state);
                (at, None)
            }
            Event::North { at, status } => {
                self.north = Some(status);
                (at, None)
            }
            Event::Load { at, load } => {
                self.load = load;
                (at, None)
            }
            Event::Unlocked { at, id, unlock_tag, result } => {
                self.written(unlock_tag, &result, at);
                (at, self.commands.unlocked(id, unlock_tag, &result, &self.image, at))
            }
            Event::Wrote { at, id, result } => (at, self.wrote(id, result, at)),
        };
        let mut effects = self.evaluate(at);
        effects.records.extend(action.map(Record::Action));
        self.advance_work(at, &mut effects);
        self.count_alarms(&effects.records);
        effects
    }

    /// Accepts a command of an operator.
    pub fn on_command(&mut self, status: CommandStatus, at: Timestamp) -> Effects {
        let status = CommandStatus { at, outcome_at: at, ..status };
        let mut effects = Effects::default();
        if !status.is_pending() {
            let refused = self.commands.complete_at_once(&status, status.outcome.clone(), &self.image);
            effects.records.push(Record::Action(refused));
            self.at = self.at.max(at);
            return effects;
        }
        // A read is not an operator action: it is shown, but not recorded.
        let is_recorded = !matches!(status.command.kind, CommandKind::Refresh(_) | CommandKind::ReadSets);
        if let Some(refusal) = heard::refusal(&self.def, &status.command.kind) {
            let refused = self.commands.complete_at_once(&status, Outcome::Refused(refusal), &self.image);
            effects.records.extend(Some(Record::Action(refused)).filter(|_| is_recorded));
            return self.after_command(effects, at);
        }
        let outcome = match status.command.kind.clone() {
            CommandKind::Write { .. } | CommandKind::WriteText { .. } => {
                self.write_command(&status, at, &mut effects);
                return self.after_command(effects, at);
            }
            CommandKind::Alarm(alarm_command) => Some(self.alarm_command(&status, alarm_command, &mut effects)),
            CommandKind::Refresh(device) => {
                let request = BusRequest::Refresh { device, command: Some(status.command.id) };
                effects.bus.push((self.def.device(device).line, request));
                Some(Outcome::Verified)
            }
            CommandKind::Connect(line, open) => {
                let is_open = self.lines[line.index()].state != LineState::Disconnected;
                if is_open != open {
                    effects.bus.push((line, BusRequest::Connect(open)));
                }
                (is_open == open).then_some(Outcome::Unchanged)
            }
            CommandKind::Configure(_)
            | CommandKind::SaveSettings(_)
            | CommandKind::Test(..)
            | CommandKind::StopTest(_) => self.line_command(&status, &mut effects),
            CommandKind::ReadSets
            | CommandKind::SaveSet { .. }
            | CommandKind::Restore(_)
            | CommandKind::StopRestore(_) => self.set_command(&status, &mut effects),
            CommandKind::StartProcedure(id) => Some(self.start_procedure(id, &status).into()),
            CommandKind::AbortProcedure(id) => Some(self.abort_procedure(id, &status, &mut effects)),
            CommandKind::CorrectCounter { tag, amount } => {
                Some(counter_watch::check_correction(self.def.tag(tag), amount, status.command.note.as_ref()).into())
            }
            CommandKind::HandOver | CommandKind::TakeOver => {
                Some(check_note(status.command.note.as_ref()).map_err(Refusal::Alarm).into())
            }
        };
        match outcome {
            None => self.commands.accept(&status),
            Some(outcome) => {
                let action = self.commands.complete_at_once(&status, outcome, &self.image);
                effects.records.extend(Some(Record::Action(action)).filter(|_| is_recorded));
            }
        }
        self.after_command(effects, at)
    }

    fn after_command(&mut self, mut effects: Effects, at: Timestamp) -> Effects {
        self.at = self.at.max(at);
        self.advance_work(at, &mut effects);
        self.count_alarms(&effects.records);
        effects
    }

    /// A line accepted a request.
    pub fn on_delivered(&mut self, line: LineId, request: &BusRequest) -> Effects {
        Effects::of_actions(self.commands.delivered(line, request, &self.image, self.at))
    }

    /// The record that a write is about to be sent; none for other requests.
    pub fn write_requested_record(&self, request: &BusRequest) -> Option<ActionRecord> {
        self.commands.write_requested_record(request, &self.image)
    }

    /// The station stops: ends all pending commands and the runs at work.
    pub fn on_stop(&mut self) -> Effects {
        let mut effects = Effects::of_actions(self.commands.stop(&self.image, self.at));
        effects.records.extend(self.end_tests(|_| true, &LineTrouble::StationStopped));
        self.stop_procedures(&mut effects);
        effects.records.extend(self.stop_runs());
        effects
    }

    /// The queue to a line was full: the request was not sent.
    pub fn on_undeliverable(&mut self, line: LineId, request: &BusRequest) -> Effects {
        let action = match self.refuse_unread_restore(request) {
            true => None,
            false => self.commands.undeliverable(line, request, &self.image, self.at),
        };
        let mut effects = Effects::of_actions(action);
        self.advance_work(self.at, &mut effects);
        effects
    }

    /// Time passes: values age, delays run out.
    pub fn on_tick(&mut self, at: Timestamp) -> Effects {
        self.image.age(at);
        self.faults.tick();
        let expired = self.commands.expire(at, self.speed, &self.image);
        let minutes = self.minutes(at);
        let mut effects = self.evaluate(at);
        effects.records.extend(minutes);
        effects.records.extend(expired.into_iter().map(Record::Action));
        self.advance_work(at, &mut effects);
        self.count_alarms(&effects.records);
        effects
    }

    /// Takes values as they are, of another time.
    pub(super) fn set_samples(&mut self, samples: &[super::sample::Sample]) {
        self.image.set_all(samples);
    }

    fn line_of(&self, tag: TagId) -> LineId {
        self.def.device(self.def.tag(tag).device).line
    }

    /// Keeps the exchange from which the values of some tags were read, if there was one.
    fn keep_source_frames(&mut self, tags: impl Iterator<Item = TagId>, exchange: Option<Arc<Exchange>>) {
        let Some(exchange) = exchange else { return };
        let source_frames = Arc::make_mut(&mut self.source_frames);
        for tag in tags {
            source_frames[tag.index()] = Some(exchange.clone());
        }
    }

    /// Evaluates the alarms and gathers what must be stored.
    fn evaluate(&mut self, at: Timestamp) -> Effects {
        self.at = self.at.max(at);
        self.image.calculate();
        let asked = self.watch_controllers();
        let image = &self.image;
        self.actuators.update(&self.def.logic, |tag| image.sample(tag), self.at);
        let events = self.evaluate_alarms();
        let mut records = self.image.records(self.at);
        records.extend(self.counters.steps(&self.def, &self.image, &records));
        records.extend(events.into_iter().map(Record::Alarm));
        records.extend(self.follow_batches());
        records.extend(self.follow_runs(&records));
        Effects { bus: asked, records, ..Effects::default() }
    }
}
