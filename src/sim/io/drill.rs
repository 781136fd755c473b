//! The task of a trainer: injects faults on command or by a scenario, and evaluates the result.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use jiff::Timestamp;
use tokio::sync::{mpsc, watch};

use super::SimulatorHandle;
use crate::{
    plant::{
        PlantDef, Snapshot,
        command::{CommandId, CommandStatus},
        record::Record,
        time::elapsed,
    },
    sim::{
        drill::{Progress, SimCommand, Status},
        faults::{AvailableFaults, available_faults},
        scenario::{
            FaultEvent, Scenario, ScenarioEvent,
            judge::{DrillResult, Judge},
        },
    },
};

/// Commands that may wait; more are dropped, as `in_force` shows.
const COMMANDS_MAX: usize = 32;
/// Batches of alarm events that may wait for the judge.
const STEPS_MAX: usize = 4096;
/// The number of the terminal by which the operator of a scenario gives commands; real terminals count from 1.
const OPERATOR: u32 = u32::MAX;

/// The alarm events of a station for the judge, and a count of those that were lost.
#[derive(Debug)]
pub struct Journal {
    steps: mpsc::Receiver<Vec<Record>>,
    lost: Arc<AtomicU64>,
}

/// An observer of a station's records, and the journal that it fills. It never waits: events beyond the bound are counted
/// as lost.
pub fn journal() -> (impl Fn(&[Record]) + Send + use<>, Journal) {
    journal_for(STEPS_MAX)
}

fn journal_for(room: usize) -> (impl Fn(&[Record]) + Send + use<>, Journal) {
    let (sender, receiver) = mpsc::channel(room);
    let lost = Arc::<AtomicU64>::default();
    let journal = Journal { steps: receiver, lost: lost.clone() };
    let observe = move |records: &[Record]| {
        let steps: Vec<Record> = records.iter().filter(|record| matches!(record, Record::Alarm(_))).cloned().collect();
        if steps.is_empty() {
            return;
        }
        if let Err(mpsc::error::TrySendError::Full(steps)) = sender.try_send(steps) {
            tracing::error!("alarm events were not evaluated: too many at once");
            lost.fetch_add(steps.len() as u64, Ordering::Relaxed);
        }
    };
    (observe, journal)
}

/// What a terminal holds of a simulation.
#[derive(Debug, Clone)]
pub struct Port {
    /// Commands to the simulation.
    pub commands: mpsc::Sender<SimCommand>,
    /// The simulation as it stands.
    pub status: watch::Receiver<Arc<Status>>,
}

/// What a trainer works with.
#[derive(Debug)]
pub struct Trainer {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// The simulation.
    pub simulator: SimulatorHandle,
    /// What is shown.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Alarm events.
    pub journal: Journal,
    /// The drill, if there is one.
    pub scenario: Option<Arc<Scenario>>,
    /// Takes the commands of the scenario's operator; `None` for a human operator.
    pub operator: Option<mpsc::Sender<CommandStatus>>,
    /// Hide faults and result until the drill is over.
    pub exam: bool,
}

impl Trainer {
    /// Starts the task. It ends when the station does, or in a drill without a person when the drill is over.
    pub fn spawn(self) -> (Port, tokio::task::JoinHandle<Option<DrillResult>>) {
        let (commands, inbox) = mpsc::channel(COMMANDS_MAX);
        let began = self.simulator.clock().now();
        let judge = self.scenario.clone().map(|scenario| Judge::new(scenario, self.def.clone(), began));
        let timeline =
            self.scenario.as_ref().map(|scenario| scenario.timeline(self.operator.is_some())).unwrap_or_default();
        let available: Arc<[AvailableFaults]> = available_faults(&self.def).into();
        let task = Task { timeline: timeline.into(), judge, began, available, trainer: self, commands_sent: 0 };
        let (publish, status) = watch::channel(Arc::new(task.status(Vec::new(), Default::default(), began)));
        let work = tokio::spawn(task.run(inbox, publish));
        (Port { commands, status }, work)
    }
}

struct Task {
    trainer: Trainer,
    timeline: std::collections::VecDeque<ScenarioEvent>,
    judge: Option<Judge>,
    began: Timestamp,
    available: Arc<[AvailableFaults]>,
    commands_sent: u32,
}

impl Task {
    async fn run(
        mut self,
        mut inbox: mpsc::Receiver<SimCommand>,
        publish: watch::Sender<Arc<Status>>,
    ) -> Option<DrillResult> {
        let clock = self.trainer.simulator.clock();
        loop {
            let event = self
                .timeline
                .front()
                .map(|event| self.began + jiff::SignedDuration::try_from(event.at()).unwrap_or_default());
            tokio::select! {
                // A replay must come to the same end: what is due at one moment happens in this order.
                biased;
                () = clock.sleep_until(event.unwrap_or(self.began)), if event.is_some() => {
                    if let Some(event) = self.timeline.pop_front() {
                        self.perform(event).await;
                    }
                }
                Some(command) = inbox.recv() => {
                    if publish.borrow().is_open() {
                        self.apply_command(command).await;
                    }
                }
                Some(records) = self.trainer.journal.steps.recv() => {
                    if let Some(judge) = self.running() {
                        judge.on_records(&records);
                    }
                    continue;
                }
                changed = self.trainer.snapshots.changed() => {
                    if changed.is_err() {
                        break;
                    }
                }
            }
            let Some(report) = self.trainer.simulator.report().await else { break };
            let snapshot = self.trainer.snapshots.borrow_and_update().clone();
            let lost = self.trainer.journal.lost.load(Ordering::Relaxed);
            if let Some(judge) = self.running() {
                judge.on_lost(lost);
                judge.on_values(&snapshot, &report.actual);
            }
            let status = self.status(report.active, report.actual, clock.now());
            let over = status.scenario.as_ref().is_some_and(|progress| progress.verdict.over);
            publish.send_replace(Arc::new(status));
            if over && self.trainer.operator.is_some() {
                break;
            }
        }
        self.judge.map(|judge| judge.verdict())
    }

    /// The judge, while the drill runs.
    fn running(&mut self) -> Option<&mut Judge> {
        self.judge.as_mut().filter(|judge| !judge.is_over())
    }

    async fn perform(&mut self, event: ScenarioEvent) {
        match event {
            ScenarioEvent::Fault(FaultEvent { target, fault, begins: true, .. }) => {
                self.trainer.simulator.inject(target, fault).await
            }
            ScenarioEvent::Fault(FaultEvent { target, fault, begins: false, .. }) => {
                self.trainer.simulator.clear(target, fault).await
            }
            ScenarioEvent::OperatorStep(step) => {
                let Some(commands) = &self.trainer.operator else { return };
                let snapshot = self.trainer.snapshots.borrow().clone();
                let Some(kind) = step.action.command_kind(&snapshot) else { return };
                self.commands_sent += 1;
                let id = CommandId { terminal: OPERATOR, number: self.commands_sent };
                let command = snapshot.command(id, kind);
                let status = CommandStatus::new(command, "operator of the drill", snapshot.at);
                if commands.try_send(status).is_err() {
                    tracing::error!("the station has not accepted a command of the drill");
                }
            }
        }
    }

    async fn apply_command(&self, command: SimCommand) {
        match command {
            SimCommand::Inject(target, fault) => self.trainer.simulator.inject(target, fault).await,
            SimCommand::Clear(target, fault) => self.trainer.simulator.clear(target, fault).await,
            SimCommand::ClearAll => self.trainer.simulator.clear_all().await,
        }
    }

    fn status(
        &self,
        active: Vec<crate::sim::faults::ActiveFault>,
        actual: crate::sim::scenario::judge::ActualValues,
        now: Timestamp,
    ) -> Status {
        let scenario = self.judge.as_ref().map(|judge| {
            let elapsed = elapsed(self.began, now);
            let Scenario { description, duration, .. } = &**judge.scenario();
            Progress { description: description.clone(), elapsed, duration: *duration, verdict: judge.verdict() }
        });
        Status { available: self.available.clone(), active, actual, exam: self.trainer.exam, scenario }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        fault::Fault,
        fixture::{self, TIC},
        record::AlarmEvent,
    };

    #[test]
    fn only_steps_of_alarms_take_room_and_those_without_are_counted() {
        let (observe, mut journal) = journal_for(1);
        let mut plant = crate::plant::Plant::new(fixture::shared(), Timestamp::UNIX_EPOCH, 1.0);
        let tags = vec![fixture::PV];
        let down = crate::plant::event::Event::Failed {
            at: Timestamp::UNIX_EPOCH,
            device: TIC,
            tags,
            fault: Fault::BackedOff,
            exchange: None,
        };
        let raised = plant.on_event(down).records;
        let is_step = |record: &&Record| matches!(record, Record::Alarm(event) if event.event == AlarmEvent::Raised);
        assert_eq!(raised.iter().filter(is_step).count(), 1, "{raised:?}");
        observe(&[]);
        observe(&raised);
        observe(&raised);
        assert_eq!(journal.steps.try_recv().map(|steps| steps.len()), Ok(1));
        assert!(journal.steps.try_recv().is_err(), "nothing empty was sent");
        assert_eq!(journal.lost.load(Ordering::Relaxed), 1);
    }
}
