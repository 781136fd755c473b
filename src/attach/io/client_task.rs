//! Feeds a session from the socket, and reconnects when the station has gone.

use std::{collections::HashMap, path::PathBuf, sync::Arc, time::Duration};

use tokio::{
    net::unix::{OwnedReadHalf, OwnedWriteHalf},
    sync::{mpsc, oneshot, watch},
    time::{Instant, sleep_until},
};

use super::{
    connect::{self, AttachError, Connection},
    wire::{self, WireError},
};
use crate::{
    access::{Completion, SessionEnd, SessionStatus},
    attach::{
        assembly::Assembly,
        command_id_map::CommandIdMap,
        protocol::{
            self, ClientMessage, HandshakeReply, REQUEST_BYTES_MAX, SERVER_MESSAGE_BYTES_MAX, ServerMessage,
            TerminalOrigin,
        },
    },
    history::{Answer, HistoryError, io::QueryRequest},
    plant::{PlantDef, Snapshot, command::CommandId, request_refusal::RequestRefusal},
    station::Request,
};

/// First pause before reconnecting; doubled each time.
const PAUSE_MIN: Duration = Duration::from_millis(200);
/// Longest pause.
const PAUSE_MAX: Duration = Duration::from_secs(2);
/// Messages that may wait to be written; more are refused.
const OUT: usize = 64;
/// Messages that may wait to be taken in; more wait in the socket.
const IN: usize = 4;

/// A query or request that waits for its answer.
enum Waiting {
    Ask(oneshot::Sender<Result<Answer, HistoryError>>),
    SessionRequest(oneshot::Sender<Result<Completion, RequestRefusal>>),
}

impl Waiting {
    /// Replies that there will be no answer.
    fn refuse(self, why: RequestRefusal) {
        match self {
            Waiting::Ask(reply) => drop(reply.send(Err(HistoryError::Engine(why.to_string())))),
            Waiting::SessionRequest(reply) => drop(reply.send(Err(why))),
        }
    }
}

/// Sole owner of the socket of a terminal.
pub struct ClientTask {
    path: PathBuf,
    origin: TerminalOrigin,
    id_map: CommandIdMap,
    /// The plant as the station has it; what is published may differ by own commands.
    assembly: Assembly,
    publish: watch::Sender<Arc<Snapshot>>,
    status_sender: watch::Sender<Arc<SessionStatus>>,
    waiting: HashMap<u64, Waiting>,
    last_ticket: u64,
}

/// Why a connection ended.
enum Disconnected {
    /// All handles of the session were dropped.
    Left,
    /// The station has gone.
    Gone(SessionEnd),
}

impl ClientTask {
    /// A task that has published the first snapshot.
    pub fn new(
        path: PathBuf,
        origin: TerminalOrigin,
        id_map: CommandIdMap,
        assembly: Assembly,
        publish: watch::Sender<Arc<Snapshot>>,
        status_sender: watch::Sender<Arc<SessionStatus>>,
    ) -> ClientTask {
        ClientTask { path, origin, id_map, assembly, publish, status_sender, waiting: HashMap::new(), last_ticket: 0 }
    }

    /// Runs until all handles of the session are dropped.
    pub async fn run(mut self, connection: Connection, mut requests: mpsc::Receiver<(u32, Request)>) {
        let mut connection = Some(connection);
        loop {
            let end = match connection.take() {
                Some(Connection { read, write, .. }) => self.serve(read, write, &mut requests).await,
                None => Disconnected::Left,
            };
            let Disconnected::Gone(why) = end else { return };
            tracing::warn!(%why, "the station is disconnected");
            self.update_status(|status| status.gone = Some(why));
            for (_, waiting) in self.waiting.drain() {
                waiting.refuse(RequestRefusal::StationGone);
            }
            self.id_map.on_disconnected();
            self.publish_snapshot();
            connection = self.reconnect(&mut requests).await;
        }
    }

    /// Serves one connection to its end.
    async fn serve(
        &mut self,
        read: OwnedReadHalf,
        write: OwnedWriteHalf,
        requests: &mut mpsc::Receiver<(u32, Request)>,
    ) -> Disconnected {
        let (inbound, mut incoming) = mpsc::channel(IN);
        let (out, outbound) = mpsc::channel(OUT);
        let conversation = async {
            loop {
                self.cancel(&out);
                tokio::select! {
                    Some(message) = incoming.recv() => if let Err(why) = self.on_message(message) { break Disconnected::Gone(SessionEnd::Connection(why)) },
                    request = requests.recv() => match request {
                        Some((_, request)) => self.send(request, &out),
                        None => break Disconnected::Left,
                    },
                }
            }
        };
        let end = tokio::select! {
            end = conversation => end,
            error = receive_messages(read, inbound) => Disconnected::Gone(SessionEnd::Connection(error.to_string())),
            error = send_messages(write, outbound) => Disconnected::Gone(SessionEnd::Connection(error.to_string())),
        };
        // A reply that came just before the end counts.
        while let Ok(message) = incoming.try_recv() {
            if self.on_message(message).is_err() {
                break;
            }
        }
        end
    }

    /// Handles a message of the station.
    fn on_message(&mut self, message: ServerMessage) -> Result<(), String> {
        match message {
            ServerMessage::LineReport(line, report) => {
                self.assembly.on_report(line, report).map_err(|error| error.to_string())?;
            }
            ServerMessage::Snapshot(snapshot) => {
                self.assembly.on_snapshot(Arc::unwrap_or_clone(snapshot)).map_err(|error| error.to_string())?;
                self.publish_snapshot();
            }
            ServerMessage::SessionStatus(session) => {
                for (id, why) in &session.undelivered {
                    self.id_map.on_undelivered(*id, why.clone());
                }
                self.update_status(|status| *status = *session);
            }
            ServerMessage::Answer { ticket, answer } => {
                if let Some(Waiting::Ask(reply)) = self.waiting.remove(&ticket) {
                    // The receiver may have gone.
                    let _ = reply.send(answer);
                }
            }
            ServerMessage::RequestDone { ticket, answer } => {
                if let Some(Waiting::SessionRequest(reply)) = self.waiting.remove(&ticket) {
                    // The receiver may have gone.
                    let _ = reply.send(answer);
                }
            }
            ServerMessage::Undelivered { id, why } => self.on_undelivered(id, why),
        }
        Ok(())
    }

    /// A command that was sent did not reach the plant.
    fn on_undelivered(&mut self, id: CommandId, why: RequestRefusal) {
        self.id_map.on_undelivered(id, why);
        self.update_status(|_| {});
    }

    /// Publishes the session status after a change, with the undelivered commands under the numbers of this terminal.
    fn update_status(&self, change: impl FnOnce(&mut SessionStatus)) {
        self.status_sender.send_modify(|status| {
            let status = Arc::make_mut(status);
            change(status);
            status.undelivered = self.id_map.undelivered();
        });
    }

    /// Publishes the latest snapshot, with what became of own commands.
    fn publish_snapshot(&mut self) {
        let seen = self.id_map.apply(self.assembly.latest());
        self.publish.send_replace(seen);
    }

    /// Sends a request on its way, or refuses it.
    fn send(&mut self, request: Request, out: &mpsc::Sender<Vec<u8>>) {
        match request {
            Request::Command(command, credentials) => {
                let (by, at) = (self.by(), self.assembly.latest().at);
                let command = self.id_map.send(command, by, at);
                let id = command.id;
                if let Err(why) = enqueue(&ClientMessage::Command(Box::new(command), credentials), out) {
                    self.on_undelivered(id, why);
                }
            }
            Request::Ask(QueryRequest { query, reply }) => {
                let ticket = self.ticket();
                self.await_answer(ticket, Waiting::Ask(reply), &ClientMessage::Ask { ticket, query }, out);
            }
            Request::SessionRequest(request, reply) => {
                let ticket = self.ticket();
                self.await_answer(
                    ticket,
                    Waiting::SessionRequest(reply),
                    &ClientMessage::SessionRequest { ticket, request },
                    out,
                );
            }
            Request::RecordRefusal { .. } => {}
        }
    }

    fn await_answer(&mut self, ticket: u64, waiting: Waiting, asked: &ClientMessage, out: &mpsc::Sender<Vec<u8>>) {
        match enqueue(asked, out) {
            Ok(()) => drop(self.waiting.insert(ticket, waiting)),
            Err(why) => waiting.refuse(why),
        }
    }

    /// Cancels the queries whose answers are not waited for any more. Called with every message of either side.
    fn cancel(&mut self, out: &mpsc::Sender<Vec<u8>>) {
        let given_up = |waiting: &Waiting| matches!(waiting, Waiting::Ask(reply) if reply.is_closed());
        for (ticket, _) in self.waiting.extract_if(|_, waiting| given_up(waiting)) {
            // A station that is too busy for it answers in vain.
            let _ = enqueue(&ClientMessage::Cancel { ticket }, out);
        }
    }

    fn ticket(&mut self) -> u64 {
        self.last_ticket += 1;
        self.last_ticket
    }

    fn by(&self) -> Arc<str> {
        self.status_sender.borrow().who.as_ref().map_or_else(|| "".into(), |who| who.user.clone())
    }

    /// Reconnects to the station; `None` when all handles of the session are dropped.
    async fn reconnect(&mut self, requests: &mut mpsc::Receiver<(u32, Request)>) -> Option<Connection> {
        let mut pause = PAUSE_MIN;
        loop {
            let at = Instant::now() + pause;
            pause = (pause * 2).min(PAUSE_MAX);
            let (path, origin) = (self.path.clone(), self.origin.clone());
            let try_again = async {
                sleep_until(at).await;
                connect::open(&path, &origin).await
            };
            tokio::pin!(try_again);
            let opened = loop {
                tokio::select! {
                    opened = &mut try_again => break opened,
                    request = requests.recv() => self.refuse(request?.1),
                }
            };
            match opened {
                Ok(connection) => {
                    self.start_over(&connection.reply);
                    return Some(connection);
                }
                Err(AttachError::NoStation { .. }) => {}
                // It is there, but does not want this terminal: its operator should know why.
                Err(error) => {
                    self.update_status(|status| status.gone = Some(SessionEnd::Connection(error.to_string())))
                }
            }
        }
    }

    fn refuse(&mut self, request: Request) {
        match request {
            Request::Command(command, _) => {
                self.id_map.refuse(command.id, RequestRefusal::StationGone);
                self.update_status(|_| {});
            }
            Request::Ask(query) => Waiting::Ask(query.reply).refuse(RequestRefusal::StationGone),
            Request::SessionRequest(_, reply) => Waiting::SessionRequest(reply).refuse(RequestRefusal::StationGone),
            Request::RecordRefusal { .. } => {}
        }
    }

    /// Nothing is known of the plant again. A definition that is equal stays the very same.
    fn start_over(&mut self, reply: &HandshakeReply) {
        self.id_map.on_connected(reply.run, reply.terminal);
        let def = &self.assembly.latest().def;
        let def = if is_equal(def, &reply.def) { def.clone() } else { reply.def.clone() };
        self.assembly = Assembly::new(def);
    }
}

fn is_equal(one: &PlantDef, other: &PlantDef) -> bool {
    protocol::encode(one, SERVER_MESSAGE_BYTES_MAX) == protocol::encode(other, SERVER_MESSAGE_BYTES_MAX)
}

fn enqueue(asked: &ClientMessage, out: &mpsc::Sender<Vec<u8>>) -> Result<(), RequestRefusal> {
    let failed = |error: protocol::ProtocolError| RequestRefusal::Failed(error.to_string());
    let bytes = protocol::encode(asked, REQUEST_BYTES_MAX).map_err(failed)?;
    out.try_send(bytes).map_err(|error| match error {
        mpsc::error::TrySendError::Full(_) => RequestRefusal::StationBusy,
        mpsc::error::TrySendError::Closed(_) => RequestRefusal::StationGone,
    })
}

/// Reads to the end of the connection, which may be at any moment.
async fn receive_messages(mut read: OwnedReadHalf, inbound: mpsc::Sender<ServerMessage>) -> WireError {
    loop {
        let message = match connect::next(&mut read).await {
            Ok(message) => message,
            Err(error) => return error,
        };
        if inbound.send(message).await.is_err() {
            return WireError::Closed;
        }
    }
}

async fn send_messages(mut write: OwnedWriteHalf, mut outbound: mpsc::Receiver<Vec<u8>>) -> WireError {
    while let Some(bytes) = outbound.recv().await {
        if let Err(error) = wire::write(&mut write, &bytes).await {
            return error;
        }
    }
    WireError::Closed
}

#[cfg(test)]
mod tests;
