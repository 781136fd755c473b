//! The task between terminals and plant: owns the sessions and routes what access control permits.

mod history_jobs;
mod reload;

use std::{collections::BTreeMap, path::PathBuf, sync::Arc, time::Duration};

use tokio::{
    sync::{mpsc, oneshot, watch},
    task::{AbortHandle, JoinSet},
    time::MissedTickBehavior,
};

use super::{
    audit_queue::AuditMessage,
    blocking_jobs::{BlockingJobs, Done},
    session::Request,
    session_acceptor::AttachRequest,
};
use crate::{
    access::{AccessControl, Completion, Durability, Effect, SessionStatus},
    bus::io::{clock::Clock, live_reads::LiveRequest},
    history::{
        Answer, HistoryError, Query,
        io::{JobRequest, QueryRequest},
    },
    plant::{command::CommandStatus, request_refusal::RequestRefusal},
};

pub(super) use reload::{NewPlant, NewUsers, Reload};

/// Requests for the station as a whole that may wait.
pub const LIFECYCLE_REQUESTS_MAX: usize = 4;
/// How often timeouts are checked: idle terminals, ends of lockouts, closed terminals.
const TICK: Duration = Duration::from_millis(500);
/// How long requests from outside have to hand over the refusals that are not on record when the station ends.
const LAST_REFUSALS_MAX: Duration = Duration::from_secs(1);

/// What a terminal has requested of the station as a whole.
#[derive(Debug)]
pub enum LifecycleRequest {
    /// To end.
    Stop,
    /// Reload the plant file, and the users file if its users have another digest than this; what follows, in words, goes to
    /// the sender.
    Reload(Option<String>, oneshot::Sender<Result<String, String>>),
}

/// Where the server sends.
#[derive(Debug)]
pub struct Outputs {
    /// To the plant.
    pub commands: mpsc::Sender<CommandStatus>,
    /// To the history.
    pub queries: mpsc::Sender<(u32, QueryRequest)>,
    /// Live reads, to each line.
    pub live: Vec<mpsc::Sender<LiveRequest>>,
    /// Backups and imports, to the history.
    pub history_jobs: mpsc::Sender<JobRequest>,
    /// The file of the history, beside which its companions lie.
    pub history: PathBuf,
    /// The name of the plant.
    pub plant: String,
    /// To the audit log.
    pub audit: mpsc::Sender<AuditMessage>,
    /// To the owner of the station.
    pub lifecycle: mpsc::Sender<LifecycleRequest>,
}

/// Whether the audit entry of a request that is answered is on its way to the log.
#[derive(Clone, Copy, PartialEq)]
enum EntryDelivery {
    /// There is none.
    None,
    /// It is on its way to the log.
    Sent,
    /// There was no room for it.
    Lost,
}

/// Sole owner of access control.
pub struct SessionServer {
    access: AccessControl,
    clock: Clock,
    outputs: Outputs,
    terminals: BTreeMap<u32, watch::Sender<Arc<SessionStatus>>>,
    /// The session of requests from outside.
    delegate: Option<u32>,
    tickets: BTreeMap<u64, oneshot::Sender<Result<Completion, RequestRefusal>>>,
    /// Reloads whose outcome is awaited, with their tickets.
    reloads: JoinSet<(u64, Result<String, String>)>,
    /// The same of backups and imports.
    history_jobs: JoinSet<(u64, Result<String, String>)>,
    jobs_of_tickets: BTreeMap<u64, AbortHandle>,
    last_ticket: u64,
    jobs: BlockingJobs,
    /// Actions that did not reach the audit log, not reported yet.
    lost: u64,
}

impl SessionServer {
    /// A server without sessions. `users` is the path of the users file.
    pub fn new(access: AccessControl, clock: Clock, outputs: Outputs, users: Option<PathBuf>) -> SessionServer {
        SessionServer {
            access,
            clock,
            outputs,
            terminals: BTreeMap::new(),
            delegate: None,
            tickets: BTreeMap::new(),
            reloads: JoinSet::new(),
            history_jobs: JoinSet::new(),
            jobs_of_tickets: BTreeMap::new(),
            last_ticket: 0,
            jobs: BlockingJobs::new(users),
            lost: 0,
        }
    }

    /// Runs until the station stops.
    pub async fn run(
        mut self,
        mut attach_requests: mpsc::Receiver<AttachRequest>,
        mut requests: mpsc::Receiver<(u32, Request)>,
        mut reloaded: mpsc::Receiver<Reload>,
        mut stopped: watch::Receiver<bool>,
    ) {
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            tokio::select! {
                biased;
                () = has_stopped(&mut stopped) => break,
                Some(request) = attach_requests.recv() => {
                    self.terminals.insert(request.terminal, request.status);
                    let (terminal, peer, now) = (request.terminal, request.peer, self.clock.now());
                    let effects = match &request.acts_as {
                        Some(user) => {
                            self.delegate = Some(terminal);
                            self.access.open_delegate(terminal, user, &peer.from, now)
                        }
                        None => self.access.open(terminal, peer, now),
                    };
                    self.apply_effects(effects);
                }
                done = self.jobs.next() => {
                    let effects = match done {
                        Done::Job(job, outcome) => self.access.on_job_done(job, outcome, self.clock.now()),
                        Done::Saved(result) => self.access.on_saved(result, self.clock.now()),
                    };
                    self.apply_effects(effects);
                }
                Some(Ok((ticket, answer))) = self.reloads.join_next() => {
                    self.reply(ticket, answer.map(Some).map_err(RequestRefusal::Failed), EntryDelivery::Sent);
                }
                Some(Ok((ticket, done))) = self.history_jobs.join_next() => {
                    let effects = self.access.on_history_job_done(ticket, done, self.clock.now());
                    self.apply_effects(effects);
                }
                Some((terminal, request)) = requests.recv() => self.on_session_message(terminal, request),
                // Behind what was asked of the plant as it was.
                Some(reload) = reloaded.recv() => self.reload(reload, &mut requests).await,
                _ = tick.tick() => {
                    let gone: Vec<u32> =
                        self.terminals.iter().filter(|(_, end)| end.is_closed()).map(|(id, _)| *id).collect();
                    for terminal in gone {
                        self.terminals.remove(&terminal);
                        let effects = self.access.close(terminal, self.clock.now());
                        self.apply_effects(effects);
                    }
                    if self.lost > 0 && self.outputs.audit.try_send(AuditMessage::Lost(self.lost)).is_ok() {
                        self.lost = 0;
                    }
                    self.forget_closed_tickets();
                    let mut effects = self.access.follow_clock(self.clock.behind_utc());
                    effects.extend(self.access.tick(self.clock.now()));
                    self.apply_effects(effects);
                }
            }
        }
        self.end(requests).await;
    }

    /// Completes what the audit log must have: nothing else is begun any more.
    async fn end(mut self, mut requests: mpsc::Receiver<(u32, Request)>) {
        if self.delegate_left().await {
            while let Ok((terminal, request)) = requests.try_recv() {
                if matches!(request, Request::RecordRefusal { .. }) {
                    self.on_session_message(terminal, request);
                }
            }
        }
        // The users are written by now, so the audit log must say so.
        if let Some(result) = self.jobs.end().await {
            let mut effects = self.access.on_saved(result, self.clock.now());
            effects.retain(|effect| matches!(effect, Effect::Record(_) | Effect::Reply(..)));
            self.apply_effects(effects);
        }
    }

    /// Waits until requests from outside have handed over their last refusals, if there are any.
    async fn delegate_left(&self) -> bool {
        let Some(delegate) = self.delegate.and_then(|terminal| self.terminals.get(&terminal)) else { return false };
        // A task that hangs does not keep the station from going on.
        let _ = tokio::time::timeout(LAST_REFUSALS_MAX, delegate.closed()).await;
        true
    }

    fn on_session_message(&mut self, terminal: u32, request: Request) {
        let now = self.clock.now();
        match request {
            Request::Command(command, credentials) => {
                let effects = self.access.on_command(terminal, command, credentials, now);
                self.apply_effects(effects);
            }
            Request::Ask(query) => match self.access.may_ask(terminal, &query.query, now) {
                Ok(()) => self.ask(terminal, query),
                Err((why, effects)) => {
                    self.apply_effects(effects);
                    // A terminal that has left needs no answer.
                    let _ = query.reply.send(Err(HistoryError::Engine(why)));
                }
            },
            Request::SessionRequest(request, reply) => {
                self.last_ticket += 1;
                self.tickets.insert(self.last_ticket, reply);
                let effects = self.access.on_request(terminal, self.last_ticket, request, now);
                self.apply_effects(effects);
            }
            Request::RecordRefusal { what, outcome } => {
                let effects = self.access.record_refusal(terminal, &what, &outcome, now);
                self.apply_effects(effects);
            }
        }
    }

    /// Hands a permitted query to the history, or to the line whose registers it reads.
    fn ask(&self, terminal: u32, QueryRequest { query, reply }: QueryRequest) {
        let refuse = |reply: oneshot::Sender<_>, why: &str| {
            // A terminal that has left needs no answer.
            let _ = reply.send(Err(HistoryError::Engine(why.to_owned())));
        };
        const BUSY: &str = "too busy, try again";
        let read = match query {
            Query::Registers(read) => read,
            query => {
                if let Err(error) = self.outputs.queries.try_send((terminal, QueryRequest { query, reply })) {
                    refuse(error.into_inner().1.reply, BUSY);
                }
                return;
            }
        };
        let Some(line) = self.outputs.live.get(read.line.index()) else { return refuse(reply, "no such line") };
        if let Err(why) = read.check() {
            return refuse(reply, &why);
        }
        let (to_line, answer) = oneshot::channel();
        if line.try_send(LiveRequest { read, reply: to_line }).is_err() {
            return refuse(reply, BUSY);
        }
        let mut reply = reply;
        tokio::spawn(async move {
            let answer = tokio::select! {
                answer = answer => answer,
                // The line drops what its terminal no longer waits for.
                () = reply.closed() => return,
            };
            let _ = reply
                .send(answer.map(Answer::Registers).map_err(|_| HistoryError::Engine("the line has ended".into())));
        });
    }

    fn apply_effects(&mut self, effects: Vec<Effect>) {
        // An answer follows its entry on the way to the log.
        let mut entry = EntryDelivery::None;
        let mut answers = Vec::new();
        for effect in effects {
            match effect {
                Effect::Command(status) => {
                    if let Err(error) = self.outputs.commands.try_send(status) {
                        tracing::error!(%error, "a command did not reach the plant");
                        let (mpsc::error::TrySendError::Full(status) | mpsc::error::TrySendError::Closed(status)) =
                            error;
                        let effects = self.access.undelivered(status.command.id, RequestRefusal::StationBusy);
                        self.apply_effects(effects);
                    }
                }
                Effect::Record(action) => {
                    let sent = self.outputs.audit.try_send(AuditMessage::Entry(action));
                    if let Err(error) = &sent {
                        tracing::error!(%error, "an action did not reach the audit log");
                        self.lost += 1;
                    }
                    entry = if sent.is_ok() && entry != EntryDelivery::Lost {
                        EntryDelivery::Sent
                    } else {
                        EntryDelivery::Lost
                    };
                }
                Effect::Reply(ticket, answer) => answers.push((ticket, answer)),
                Effect::SessionStatus(terminal) => {
                    if let Some(end) = self.terminals.get(&terminal) {
                        end.send_replace(Arc::new(self.access.session_status(terminal, self.clock.now())));
                    }
                }
                Effect::Job(job, work) => self.jobs.put(job, work),
                Effect::Save(users) => self.jobs.save(users),
                Effect::Stop => self.send_lifecycle(LifecycleRequest::Stop),
                Effect::Reload(ticket, users) => {
                    let (reply, answer) = oneshot::channel();
                    let ended = || Err("not reloaded: the station is stopping or too busy".to_owned());
                    self.reloads.spawn(async move { (ticket, answer.await.unwrap_or_else(|_| ended())) });
                    self.send_lifecycle(LifecycleRequest::Reload(users, reply));
                }
                Effect::Backup(ticket, folder) => self.back_up(ticket, folder),
                Effect::Import(ticket, file) => self.import(ticket, &file),
                Effect::HangUp(terminal, why) => {
                    // The audit log holds it, in bounded rate; attempts without end must not fill this one.
                    tracing::debug!(terminal, %why, "a terminal was disconnected");
                    if let Some(end) = self.terminals.remove(&terminal) {
                        end.send_replace(Arc::new(SessionStatus { gone: Some(why), ..SessionStatus::default() }));
                    }
                }
            }
        }
        for (ticket, answer) in answers {
            self.reply(ticket, answer.map(|()| None), entry);
        }
    }

    fn reply(&mut self, ticket: u64, answer: Result<Option<String>, RequestRefusal>, entry: EntryDelivery) {
        let Some(reply) = self.tickets.remove(&ticket) else { return };
        // A terminal that has left needs no answer.
        let (reply, answer, durability) = match entry {
            EntryDelivery::None => (reply, answer, Durability::Recorded),
            EntryDelivery::Lost => (reply, answer, Durability::NotRecorded),
            EntryDelivery::Sent => {
                match self
                    .outputs
                    .audit
                    .try_send(AuditMessage::Reply(reply, answer))
                    .map_err(|error| error.into_inner())
                {
                    Err(AuditMessage::Reply(reply, answer)) => (reply, answer, Durability::NotRecorded),
                    Ok(()) | Err(_) => return,
                }
            }
        };
        let _ = reply.send(answer.map(|summary| Completion::new(durability, summary)));
    }

    fn send_lifecycle(&mut self, request: LifecycleRequest) {
        if let Err(error) = self.outputs.lifecycle.try_send(request) {
            tracing::error!(%error, "a lifecycle request was lost");
        }
    }
}

async fn has_stopped(stopped: &mut watch::Receiver<bool>) {
    // A station that is gone has stopped.
    let _ = stopped.wait_for(|stopped| *stopped).await;
}
