//! What one terminal holds of a station: facts coming in, requests going out. The same in one process and over the socket.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot, watch};

use crate::{
    access::{Completion, Credentials, Durability, SessionRequest, SessionStatus},
    history::io::QueryRequest,
    plant::{
        Snapshot,
        command::{Command, CommandId, CommandKind},
        request_refusal::RequestRefusal,
    },
};

/// One attached terminal. Dropping it stops nothing.
///
/// The station publishes a snapshot at least every two seconds of real time, changed or not: a terminal that receives
/// nothing for three seconds shows the station as silent and all values as uncertain.
#[derive(Debug, Clone)]
pub struct Session {
    /// The latest snapshot only.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// The status of this session.
    pub status: watch::Receiver<Arc<SessionStatus>>,
    /// Requests; a full queue is a refusal.
    pub requests: mpsc::Sender<(u32, Request)>,
    /// Number of this terminal, the first part of its command ids.
    pub terminal: u32,
}

/// What a terminal asks of its station, with the channel that takes the reply. `attach::ClientMessage` is what of it can be
/// sent over a socket, where a ticket stands for the channel: two types, because a channel cannot be encoded, and a ticket
/// means nothing without its connection.
#[derive(Debug)]
pub enum Request {
    /// A command to the plant. Its outcome is seen in a later snapshot, also that it was not permitted; a command that did not
    /// reach the plant is in the session status, [`SessionStatus::undelivered`].
    Command(Command, Option<Credentials>),
    /// A query to the history.
    Ask(QueryRequest),
    /// A session request.
    SessionRequest(SessionRequest, oneshot::Sender<Result<Completion, RequestRefusal>>),
    /// For the audit log: requests from outside that were refused before one became a command. Never over a socket.
    RecordRefusal {
        /// What was requested.
        what: String,
        /// What became of it.
        outcome: String,
    },
}

impl Session {
    /// Hands a request to the station; `Err` says why not.
    pub fn send(&self, request: Request) -> Result<(), RequestRefusal> {
        if self.status.borrow().gone.is_some() {
            return Err(RequestRefusal::StationGone);
        }
        self.requests.try_send((self.terminal, request)).map_err(|error| match error {
            mpsc::error::TrySendError::Full(_) => RequestRefusal::StationBusy,
            mpsc::error::TrySendError::Closed(_) => RequestRefusal::StationEnded,
        })
    }

    /// Gives a command without note and credentials; its outcome is seen in a later snapshot.
    pub fn send_command(&self, number: u32, kind: CommandKind) -> Result<CommandId, RequestRefusal> {
        let id = CommandId { terminal: self.terminal, number };
        let command = self.snapshots.borrow().command(id, kind);
        self.send(Request::Command(command, None))?;
        Ok(id)
    }

    /// Asks the history.
    pub fn ask(&self, query: QueryRequest) -> Result<(), RequestRefusal> {
        self.send(Request::Ask(query))
    }

    /// Sends a request and waits for the reply.
    pub async fn request(&self, request: SessionRequest) -> Result<Durability, RequestRefusal> {
        self.complete(request).await.map(|completion| completion.durability)
    }

    /// The same, with what was done in words.
    pub async fn complete(&self, request: SessionRequest) -> Result<Completion, RequestRefusal> {
        let (reply, answer) = oneshot::channel();
        self.send(Request::SessionRequest(request, reply))?;
        answer.await.unwrap_or(Err(RequestRefusal::StationStopped))
    }
}
