//! Where sessions begin: terminals, and the requests from outside, ask the session server to attach.

use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};

use tokio::sync::{mpsc, watch};

use super::session::{Request, Session};
use crate::{
    access::{Peer, SessionStatus},
    plant::Snapshot,
};

/// Requests of all terminals that may wait; more are refused.
const REQUESTS: usize = 256;
/// Attach requests that may wait.
const ATTACH_QUEUE_MAX: usize = 16;

/// A terminal asks to attach.
#[derive(Debug)]
pub struct AttachRequest {
    /// Its number.
    pub terminal: u32,
    /// Where it is.
    pub peer: Peer,
    /// The user as whom requests from outside act; `None` for a terminal.
    pub acts_as: Option<Arc<str>>,
    /// Receives its session status; closed when the terminal has gone.
    pub status: watch::Sender<Arc<SessionStatus>>,
}

/// Opens sessions; cheap to clone.
#[derive(Debug, Clone)]
pub struct SessionAcceptor {
    /// The latest snapshot only.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    attach_requests: mpsc::Sender<AttachRequest>,
    requests: mpsc::Sender<(u32, Request)>,
    terminals: Arc<AtomicU32>,
}

impl SessionAcceptor {
    /// The acceptor, and the queues of attach requests and of requests.
    pub fn new(
        snapshots: watch::Receiver<Arc<Snapshot>>,
    ) -> (SessionAcceptor, mpsc::Receiver<AttachRequest>, mpsc::Receiver<(u32, Request)>) {
        let (attach_requests, attach_queue) = mpsc::channel(ATTACH_QUEUE_MAX);
        let (requests, requested) = mpsc::channel(REQUESTS);
        (SessionAcceptor { snapshots, attach_requests, requests, terminals: Arc::default() }, attach_queue, requested)
    }

    /// Attaches a terminal. It has no rights until its first status arrives, which never happens while the attach queue is full.
    pub fn attach(&self, peer: Peer) -> Session {
        self.open(peer, None)
    }

    /// Opens the session of requests from outside, which act as `user`.
    pub fn attach_as(&self, user: &str, from: &str) -> Session {
        self.open(Peer { from: from.into(), unix_user: None, in_process: false }, Some(user.into()))
    }

    fn open(&self, peer: Peer, acts_as: Option<Arc<str>>) -> Session {
        let terminal = self.terminals.fetch_add(1, Ordering::Relaxed) + 1;
        let (status_sender, status) = watch::channel(Arc::new(SessionStatus::default()));
        if let Err(error) =
            self.attach_requests.try_send(AttachRequest { terminal, peer, acts_as, status: status_sender })
        {
            tracing::error!(%error, "a terminal was refused");
        }
        let (snapshots, requests) = (self.snapshots.clone(), self.requests.clone());
        Session { snapshots, status, requests, terminal }
    }
}
