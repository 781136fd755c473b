//! Starts the tasks of a station and stops them in order.

mod begin;
mod delivery;
mod lines;
mod outlet;
mod process_load;
mod reload;
pub(crate) mod report_files;
mod requests;
pub mod reports;

use std::{path::PathBuf, sync::Arc, time::Duration};

use tokio::{
    sync::{mpsc, watch},
    task::JoinHandle,
};

use crate::{
    access::{Peer, io::own_user},
    bus::io::{clock::Clock, transport::Connector, worker::Worker},
    history::io::{
        JobRequest, QueryRequest,
        thread::{self as history, HistoryInput},
    },
    plant::{
        Plant, PlantDef,
        alarm::Succession,
        command::{CommandId, CommandKind, CommandStatus},
        event::Event,
        record::ChainHash,
        snapshot::HistoryStatus,
        station_fault::STATION,
    },
    profile::PlantFile,
};

pub use self::begin::{start, start_guarded, start_observed};
pub use self::reload::Reloaded;
use self::{begin::Guarded, lines::Line, outlet::Outlet, reports::ReportTask};
use super::{
    audit_queue::AuditMessage,
    found::FoundFile,
    plant_task::{self, Inputs, Persistence, PlantTask, RecordObserver},
    session::Session,
    session_acceptor::SessionAcceptor,
    session_server::{self, Outputs, SessionServer},
};

/// Events waiting for the plant; a full queue holds the links back, which is the one place where waiting is right.
const EVENTS: usize = 256;
/// Commands waiting for the plant; a full queue refuses the command.
const COMMANDS_MAX: usize = 64;
/// At the end the safe state of a procedure is waited for so long: a write that gets no answer takes some timeouts.
const SAFE_STATE_MAX: Duration = Duration::from_secs(10);
/// The disk is waited for so long at the end: with the safe state less than systemd waits (`TimeoutStopSec`).
const STOP_MAX: Duration = Duration::from_secs(15);

/// What a station is started with.
#[derive(Debug)]
pub struct Options {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// Plant time.
    pub clock: Clock,
    /// The file of the history.
    pub history: PathBuf,
    /// How each line is opened, by [`LineId`](crate::plant::def::LineId).
    pub connectors: Vec<Connector>,
    /// The file that settings are saved into; `None` for a plant that has none of its own.
    pub file: Option<PlantFile>,
}

/// A running station.
#[derive(Debug)]
pub struct Station {
    acceptor: SessionAcceptor,
    /// Bypasses access control: for a scripted operator.
    pub commands: mpsc::Sender<CommandStatus>,
    /// What terminals request of the station as a whole; to be taken by its owner.
    pub lifecycle: mpsc::Receiver<session_server::LifecycleRequest>,
    /// `None` for a drill, which keeps nothing.
    history: Option<history::Handle>,
    /// The thread of the audit log, which ends before the history.
    audit_writer: Option<Worker<Option<ChainHash>>>,
    /// Login is not required.
    open: bool,
    def: Arc<PlantDef>,
    run: u64,
    clock: Clock,
    /// By [`LineId`](crate::plant::def::LineId).
    lines: Vec<Line>,
    north: Option<Outlet>,
    reports: Option<Outlet>,
    senders: Senders,
    stop: watch::Sender<bool>,
    tasks: Vec<JoinHandle<()>>,
}

/// What tasks that start later send to.
#[derive(Debug)]
struct Senders {
    /// To the plant, which ends when no sender is left.
    events: mpsc::Sender<Event>,
    /// To the audit log, by the plant.
    audit: mpsc::Sender<AuditMessage>,
    /// To the history, and how it stands; `None` for a drill.
    store: Option<(mpsc::Sender<HistoryInput>, watch::Receiver<HistoryStatus>)>,
    queries: mpsc::Sender<(u32, QueryRequest)>,
    history_file: PathBuf,
    plant: mpsc::Sender<plant_task::Reload>,
    sessions: mpsc::Sender<session_server::Reload>,
}

/// A station that keeps nothing, for virtual time, where no other thread may take part. Queries to the history
/// are refused.
pub fn start_transient(
    def: Arc<PlantDef>,
    clock: Clock,
    connectors: Vec<Connector>,
    observer: RecordObserver,
) -> Station {
    let plant = Plant::new(def.clone(), clock.now(), clock.speed());
    let (_, store) = watch::channel(HistoryStatus::default());
    let (queries, _) = mpsc::channel(1);
    let (jobs, _) = mpsc::channel(1);
    let persistence = Persistence {
        records: None,
        store,
        past: None,
        audit: None,
        sets: None,
        found: None,
        observer: Some(observer),
        succession: Succession::default(),
        file_since: None,
    };
    let threads = Threads { queries, jobs: (jobs, PathBuf::new()), history: None, audit_writer: None };
    assemble(def, clock, connectors, plant, None, persistence, threads, None)
}

/// What runs beside the tasks.
struct Threads {
    queries: mpsc::Sender<(u32, QueryRequest)>,
    /// To the history, and its file.
    jobs: (mpsc::Sender<JobRequest>, PathBuf),
    history: Option<history::Handle>,
    audit_writer: Option<Worker<Option<ChainHash>>>,
}

/// A task for each line.
fn start_lines(
    def: &Arc<PlantDef>,
    clock: Clock,
    connectors: Vec<Connector>,
    events: &mpsc::Sender<Event>,
    found: Option<&FoundFile>,
) -> Vec<Line> {
    let found = found.map(|found| found.of(def)).unwrap_or_default();
    let started = def.lines.iter().zip(connectors).map(|(line, connector)| {
        let mut started = Line::default();
        started.start(def, line.id, clock, connector, events, &found);
        started
    });
    started.collect()
}

// Everything that a station is made of, each once.
#[allow(clippy::too_many_arguments)]
fn assemble(
    def: Arc<PlantDef>,
    clock: Clock,
    connectors: Vec<Connector>,
    plant: Plant,
    file: Option<PlantFile>,
    persistence: Persistence,
    threads: Threads,
    guarded: Option<Guarded>,
) -> Station {
    let Threads { queries, jobs: (history_jobs, history_file), history, audit_writer } = threads;
    let (stop, stopped) = watch::channel(false);
    let (events, event_queue) = mpsc::channel(EVENTS);
    let (commands, command_queue) = mpsc::channel(COMMANDS_MAX);
    let lines = start_lines(&def, clock, connectors, &events, persistence.found.as_ref());
    let first = plant.snapshot();
    let run = first.run;
    let (publish, snapshots) = watch::channel(Arc::new(first));
    let (acceptor, attach_requests, requests) = SessionAcceptor::new(snapshots);
    let store = persistence.records.clone().map(|records| (records, persistence.store.clone()));
    let links = lines.iter().map(|line| line.requests.clone()).collect();
    let plant_task = PlantTask::new(plant, clock, links, file, persistence, publish);
    let (audit, messages) = mpsc::channel(COMMANDS_MAX);
    let (to_plant, reloads) = mpsc::channel(1);
    let inputs = Inputs { events: event_queue, commands: command_queue, messages, reloads };
    let mut tasks = vec![tokio::spawn(plant_task.run(inputs))];
    if store.is_some() {
        tasks.push(tokio::spawn(process_load::run(clock, events.clone(), stopped.clone())));
    }
    let (lifecycle_sender, lifecycle) = mpsc::channel(session_server::LIFECYCLE_REQUESTS_MAX);
    let outputs = Outputs {
        commands: commands.clone(),
        queries: queries.clone(),
        live: lines.iter().map(|line| line.live.clone()).collect(),
        history_jobs,
        history: history_file.clone(),
        plant: def.name.clone(),
        audit: audit.clone(),
        lifecycle: lifecycle_sender,
    };
    let open = guarded.is_none();
    let (access, users, late) = begin::access_of(guarded, &def);
    let server = SessionServer::new(access.in_run(run), clock, outputs, users);
    let (to_sessions, reloads) = mpsc::channel(1);
    let to = (to_sessions.clone(), to_plant.clone());
    tasks.extend(late.map(|late| tokio::spawn(begin::take_late_users(late, to, stopped.clone()))));
    tasks.push(tokio::spawn(server.run(attach_requests, requests, reloads, stopped)));
    let senders = Senders { events, audit, store, queries, history_file, plant: to_plant, sessions: to_sessions };
    let mut station = Station {
        acceptor,
        commands,
        lifecycle,
        history,
        audit_writer,
        open,
        def,
        run,
        clock,
        lines,
        north: None,
        reports: None,
        senders,
        stop,
        tasks,
    };
    station.start_outlets(false);
    station
}

impl Station {
    /// Opens sessions.
    pub fn acceptor(&self) -> &SessionAcceptor {
        &self.acceptor
    }

    /// The plant as it is defined now.
    pub fn def(&self) -> &Arc<PlantDef> {
        &self.def
    }

    /// Takes out what terminals request of the station as a whole: it is reloaded while its owner waits for more.
    pub fn take_lifecycle(&mut self) -> mpsc::Receiver<session_server::LifecycleRequest> {
        std::mem::replace(&mut self.lifecycle, mpsc::channel(1).1)
    }

    /// Attaches a terminal of this very process.
    pub fn session(&self, operator: &str) -> Session {
        // The given name counts only without login.
        let user = if self.open { operator.to_owned() } else { own_user() };
        self.acceptor.attach(Peer { from: "this process".into(), unix_user: Some(user.into()), in_process: true })
    }

    /// Aborts the procedure at work while there are lines that its safe state is written over. Where that takes too long, it
    /// ends as interrupted.
    async fn abort_procedure(&self) {
        let mut snapshots = self.acceptor.snapshots.clone();
        let snapshot = snapshots.borrow().clone();
        let Some((procedure, _)) = snapshot.procedure_at_work() else { return };
        // Commands of the plant itself count from 1.
        let id = CommandId { terminal: 0, number: 0 };
        let command = snapshot.command(id, CommandKind::AbortProcedure(procedure));
        let aborted = async {
            // A plant that has ended has ended its procedure.
            let _ = self.commands.send(CommandStatus::new(command, STATION, snapshot.at)).await;
            let _ = snapshots.wait_for(|snapshot| snapshot.procedure_at_work().is_none()).await;
        };
        if tokio::time::timeout(SAFE_STATE_MAX, aborted).await.is_err() {
            tracing::warn!("the safe state of the running procedure was not written in time");
        }
    }

    /// Writes the safe state of a procedure at work, stops downstream and waits until the last record is on disk. Gives the last
    /// entry of the audit log.
    ///
    /// What a disk that hangs holds up is left behind after `STOP_MAX`: a station can always be ended.
    pub async fn stop(self) -> Option<ChainHash> {
        self.abort_procedure().await;
        tokio::time::timeout(STOP_MAX, self.end()).await.unwrap_or_else(|_| {
            tracing::error!("the disk hangs: the station ends, and its last records may be lost");
            None
        })
    }

    async fn end(self) -> Option<ChainHash> {
        // The links may have ended already.
        self.lines.iter().for_each(Line::stop);
        let outlets = [self.north, self.reports];
        outlets.iter().flatten().for_each(Outlet::stop);
        let _ = self.stop.send(true);
        drop((self.acceptor, self.commands, self.lifecycle, self.senders));
        for mut line in self.lines {
            line.ended().await;
        }
        for outlet in outlets.into_iter().flatten() {
            outlet.end().await;
        }
        for task in self.tasks {
            if let Err(error) = task.await {
                tracing::error!(%error, "a task of the station failed");
            }
        }
        // The last records are on their way; each thread ends when it has stored them, the audit log before the history.
        let last = match self.audit_writer {
            Some(audit_writer) => audit_writer.ended().await.flatten(),
            None => None,
        };
        if let Some(history) = self.history {
            history.ended().await;
        }
        last
    }
}
