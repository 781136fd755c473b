//! One attached terminal: what it asks goes in, what it may see goes out, and neither waits for the other.

use std::{collections::HashMap, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncRead, AsyncWrite},
    sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot},
    task::{AbortHandle, JoinSet},
    time::{Instant, sleep, sleep_until, timeout},
};

use super::{
    shared::{SnapshotReceiver, is_same},
    wire::{self, WireError},
};
use crate::{
    access::{Credentials, RateLimit, SessionRequest, SessionStatus},
    attach::{
        check,
        protocol::{
            self, ClientMessage, HANDSHAKE_BYTES_MAX, Handshake, HandshakeReply, ProtocolError, REQUEST_BYTES_MAX,
            SERVER_MESSAGE_BYTES_MAX, ServerMessage,
        },
    },
    history::{HistoryError, Query, io::QueryRequest},
    plant::{
        PlantDef, Snapshot,
        command::{Command, Outcome},
        line_report::LineReport,
        request_refusal::RequestRefusal,
    },
    station::{Request, Session},
};

/// Messages of one terminal: as fast as a person, so that no terminal fills the queue of all.
const REQUESTS: RateLimit = RateLimit::new(64, Duration::from_millis(20));
/// A terminal that reads nothing for so long is disconnected.
pub const STUCK_MAX: Duration = Duration::from_secs(300);
/// A terminal that does not read the answer to its own query is disconnected after so long: answers may be large.
pub const ANSWER_STUCK_MAX: Duration = Duration::from_secs(30);
/// Queries and requests of one terminal that may wait for their answers.
const IN_FLIGHT_MAX: usize = 16;
/// Queries of one terminal that are before the history, or answered and not taken yet.
const ANSWERS_MAX: usize = 4;
/// So long have replies that are on their way to a terminal which is sent away.
const LAST_REPLIES_MAX: Duration = Duration::from_secs(2);
/// How long a new terminal waits for its first status.
const STATUS_WAIT_MAX: Duration = Duration::from_secs(2);

/// An answer on its way to the terminal. It gives its places in flight back only when it has left.
type Reply = (ServerMessage, Vec<OwnedSemaphorePermit>);

/// Serves a terminal until either side ends; says why it ended.
pub async fn serve<R, W>(read: R, write: W, session: Session, snapshots: SnapshotReceiver) -> ConnectionEnd
where
    R: AsyncRead + Unpin,
    W: AsyncWrite + Unpin,
{
    let (def, run) = {
        let first = &snapshots.latest.borrow().snapshot;
        (first.def.clone(), first.run)
    };
    let (replies, answered) = mpsc::channel(IN_FLIGHT_MAX);
    let in_flight = Arc::new(Semaphore::new(IN_FLIGHT_MAX));
    let asked = Arc::new(Semaphore::new(ANSWERS_MAX));
    let (queries, tickets) = (JoinSet::new(), HashMap::new());
    let (own, places) = (session.clone(), in_flight.clone());
    let inbound = Inbound { session: own, def: def.clone(), replies, in_flight, asked, queries, tickets };
    let sent_reports = vec![None; def.lines.len()];
    let outbound = Outbound { write, session, snapshots, def, sent_reports, places };
    tokio::select! {
        Err(ended) = inbound.run(read) => ended,
        Err(ended) = outbound.run(run, answered) => ended,
        else => ConnectionEnd::StationGone,
    }
}

/// Why a terminal is no longer served.
#[derive(Debug, thiserror::Error)]
pub enum ConnectionEnd {
    /// It closed, or broke the rules.
    #[error("{0}")]
    Wire(#[from] WireError),
    /// It does not read.
    #[error("has received nothing for {0:?}")]
    Stuck(Duration),
    /// It may not stay, or the station has ended.
    #[error("disconnected by the station")]
    SentAway,
    /// The station has ended.
    #[error("the station has stopped")]
    StationGone,
    /// The station has another plant now.
    #[error("the plant file was reloaded")]
    OtherPlant,
}

/// The half that listens.
struct Inbound {
    session: Session,
    def: Arc<PlantDef>,
    replies: mpsc::Sender<Reply>,
    in_flight: Arc<Semaphore>,
    asked: Arc<Semaphore>,
    /// Queries that wait for their answers; they are cancelled when the terminal leaves.
    queries: JoinSet<()>,
    /// The same by their tickets.
    tickets: HashMap<u64, AbortHandle>,
}

impl Inbound {
    /// Takes one message after the other, no faster than a person asks. What waits, waits in the terminal.
    async fn run(mut self, mut read: impl AsyncRead + Unpin) -> Result<std::convert::Infallible, ConnectionEnd> {
        let (mut rate_limit, began) = (REQUESTS, Instant::now());
        loop {
            let bytes = wire::read(&mut read, REQUEST_BYTES_MAX).await?;
            let asked = protocol::decode(&bytes, "message of a terminal").map_err(WireError::from)?;
            sleep(rate_limit.reserve(began.elapsed())).await;
            match asked {
                ClientMessage::Command(command, credentials) => self.send_command(*command, credentials).await,
                ClientMessage::Ask { ticket, query } => self.ask(ticket, query).await,
                ClientMessage::Cancel { ticket } => self.cancel(ticket),
                ClientMessage::SessionRequest { ticket, request } => self.send_request(ticket, request).await,
            }
        }
    }

    async fn send_command(&self, command: Command, credentials: Option<Credentials>) {
        let id = command.id;
        let sent = if id.terminal == self.session.terminal {
            check::command(&self.def, &command.kind).map_err(RequestRefusal::Failed)
        } else {
            Err(RequestRefusal::Failed(format!(
                "a command of terminal {}, this is terminal {}",
                id.terminal, self.session.terminal
            )))
        };
        let sent = sent.and_then(|()| self.session.send(Request::Command(command, credentials)));
        if let Err(why) = sent {
            // The terminal may have gone.
            let _ = self.replies.send((ServerMessage::Undelivered { id, why }, Vec::new())).await;
        }
    }

    async fn ask(&mut self, ticket: u64, query: Query) {
        let Ok(place) = self.in_flight.clone().acquire_owned().await else { return };
        let sent = check::query(&self.def, &query);
        let (reply, answer) = oneshot::channel();
        let query = QueryRequest { query, reply };
        let (session, replies, asked) = (self.session.clone(), self.replies.clone(), self.asked.clone());
        while self.queries.try_join_next().is_some() {}
        self.tickets.retain(|_, query| !query.is_finished());
        let query = self.queries.spawn(async move {
            // A query waits here for those before it, so that what comes behind it, a command perhaps, does not.
            let Ok(turn) = asked.acquire_owned().await else { return };
            let sent = sent.and_then(|()| session.ask(query).map_err(|why| why.to_string()));
            // The station closes a terminal when all handles of its session are dropped.
            drop(session);
            let answer = match sent {
                Ok(()) => {
                    answer.await.unwrap_or_else(|_| Err(HistoryError::Engine("the history is closed".to_owned())))
                }
                Err(why) => Err(HistoryError::Engine(why)),
            };
            // The terminal may have gone.
            let _ = replies.send((ServerMessage::Answer { ticket, answer }, vec![place, turn])).await;
        });
        self.tickets.insert(ticket, query);
    }

    /// The history stops working on a query when nothing waits for its answer.
    fn cancel(&mut self, ticket: u64) {
        if let Some(query) = self.tickets.remove(&ticket) {
            query.abort();
        }
    }

    async fn send_request(&self, ticket: u64, request: SessionRequest) {
        let Ok(place) = self.in_flight.clone().acquire_owned().await else { return };
        let (reply, answer) = oneshot::channel();
        let sent = self.session.send(Request::SessionRequest(request, reply));
        let replies = self.replies.clone();
        tokio::spawn(async move {
            let answer = match sent {
                Ok(()) => tokio::select! {
                    answer = answer => answer.unwrap_or(Err(RequestRefusal::StationStopped)),
                    // A job that the terminal has left is cancelled.
                    () = replies.closed() => return,
                },
                Err(why) => Err(why),
            };
            // The terminal may have gone.
            let _ = replies.send((ServerMessage::RequestDone { ticket, answer }, vec![place])).await;
        });
    }
}

/// The half that speaks.
struct Outbound<W> {
    write: W,
    session: Session,
    snapshots: SnapshotReceiver,
    def: Arc<PlantDef>,
    /// The line reports that the terminal has, by line.
    sent_reports: Vec<Option<Arc<LineReport>>>,
    /// All of them are free when no reply is on its way.
    places: Arc<Semaphore>,
}

impl<W: AsyncWrite + Unpin> Outbound<W> {
    /// Speaks until either side ends. Who is sent away, because the plant file is reloaded, gets the replies that are on their
    /// way.
    async fn run(
        mut self,
        run: u64,
        mut answered: mpsc::Receiver<Reply>,
    ) -> Result<std::convert::Infallible, ConnectionEnd> {
        let Err(ended) = self.speak(run, &mut answered).await;
        if matches!(ended, ConnectionEnd::SentAway | ConnectionEnd::OtherPlant) {
            let last = async {
                while self.places.available_permits() < IN_FLIGHT_MAX
                    && let Some((message, _places)) = answered.recv().await
                {
                    self.send(&message).await?;
                }
                Ok::<(), ConnectionEnd>(())
            };
            // A terminal that has left needs no reply.
            let _ = timeout(LAST_REPLIES_MAX, last).await;
        }
        Err(ended)
    }

    /// Sends the handshake reply, the status, then snapshots, never faster than the terminal reads.
    async fn speak(
        &mut self,
        run: u64,
        answered: &mut mpsc::Receiver<Reply>,
    ) -> Result<std::convert::Infallible, ConnectionEnd> {
        match timeout(STATUS_WAIT_MAX, self.session.status.changed()).await {
            Ok(Ok(())) => {
                let gone = self.session.status.borrow_and_update().gone.clone();
                if let Some(why) = gone {
                    // As the reply to its handshake: it has nothing that a status could be about.
                    let rejection = protocol::encode(&Handshake::rejected(why.to_string()), HANDSHAKE_BYTES_MAX);
                    self.write(&rejection.map_err(WireError::from)?, LAST_REPLIES_MAX).await?;
                    return Err(ConnectionEnd::SentAway);
                }
            }
            Ok(Err(_)) => return Err(ConnectionEnd::SentAway),
            Err(_) => tracing::warn!(terminal = self.session.terminal, "no session status for a terminal"),
        }
        let reply = HandshakeReply { run, terminal: self.session.terminal, def: self.def.clone() };
        let reply = protocol::encode(&(Handshake::current(), reply), SERVER_MESSAGE_BYTES_MAX);
        self.write(&reply.map_err(WireError::from)?, STUCK_MAX).await?;
        self.send_session_status().await?;
        let mut sent = Arc::new(Snapshot::blank(self.def.clone()));
        let (mut due, mut next) = (Some(Instant::now()), Instant::now());
        loop {
            tokio::select! {
                biased;
                Some((message, _places)) = answered.recv() => self.send(&message).await?,
                changed = self.session.status.changed() => {
                    changed.map_err(|_| ConnectionEnd::SentAway)?;
                    self.send_session_status().await?;
                    due = Some(Instant::now());
                }
                changed = self.snapshots.latest.changed() => {
                    changed.map_err(|_| ConnectionEnd::StationGone)?;
                    let snapshot = self.snapshots.latest.borrow_and_update().snapshot.clone();
                    due = Some(if self.has_news_of_own(&sent, &snapshot) { Instant::now() } else { next });
                }
                () = sleep_until(due.unwrap_or(next)), if due.is_some() => {
                    sent = self.send_snapshot().await?;
                    (due, next) = (None, self.snapshots.next_at());
                }
            }
        }
    }

    /// Whether the status of an own command has changed, which is sent at once.
    fn has_news_of_own(&self, sent: &Snapshot, snapshot: &Snapshot) -> bool {
        let terminal = self.session.terminal;
        let own = |snapshot: &'_ Snapshot| -> Vec<(u32, Outcome)> {
            let own = snapshot.commands.iter().filter(|status| status.command.id.terminal == terminal);
            own.map(|status| (status.command.id.number, status.outcome.clone())).collect()
        };
        self.session.status.borrow().may_view && own(sent) != own(snapshot)
    }

    /// Sends the latest snapshot, as far as the terminal may see it, after the line reports that are new.
    async fn send_snapshot(&mut self) -> Result<Arc<Snapshot>, ConnectionEnd> {
        let latest = self.snapshots.latest.borrow_and_update().clone();
        if !Arc::ptr_eq(&latest.snapshot.def, &self.def) {
            return Err(ConnectionEnd::OtherPlant);
        }
        let view = self.session.status.borrow().may_view;
        for (line, report) in latest.reports.iter().enumerate() {
            if !is_same(self.sent_reports[line].as_ref(), report.visible(view)) {
                self.write(&report.encoded(view).await.map_err(WireError::from)?, STUCK_MAX).await?;
                self.sent_reports[line] = report.visible(view).cloned();
            }
        }
        self.write(&latest.encoded(view).await.map_err(WireError::from)?, STUCK_MAX).await?;
        Ok(latest.snapshot.clone())
    }

    async fn send_session_status(&mut self) -> Result<(), ConnectionEnd> {
        let status: SessionStatus = self.session.status.borrow_and_update().as_ref().clone();
        self.send(&ServerMessage::SessionStatus(Box::new(status))).await
    }

    async fn send(&mut self, message: &ServerMessage) -> Result<(), ConnectionEnd> {
        let bytes = match (protocol::encode(message, SERVER_MESSAGE_BYTES_MAX), message) {
            (Err(error @ ProtocolError::TooLong { .. }), ServerMessage::Answer { ticket, .. }) => {
                let answer = Err(HistoryError::Engine(format!("{error}; choose a shorter period")));
                protocol::encode(&ServerMessage::Answer { ticket: *ticket, answer }, SERVER_MESSAGE_BYTES_MAX)
            }
            (bytes, _) => bytes,
        };
        let max = if let ServerMessage::Answer { .. } = message { ANSWER_STUCK_MAX } else { STUCK_MAX };
        self.write(&bytes.map_err(WireError::from)?, max).await
    }

    async fn write(&mut self, bytes: &[u8], max: Duration) -> Result<(), ConnectionEnd> {
        timeout(max, wire::write(&mut self.write, bytes)).await.map_err(|_| ConnectionEnd::Stuck(max))??;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
