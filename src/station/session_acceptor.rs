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
/// This many of them are kept for root, the user of the station and those that the plant file trusts.
const ATTACH_KEPT: usize = 4;

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

    /// Can one more terminal attach now? `kept`: one for whom places are kept.
    pub fn has_room(&self, kept: bool) -> bool {
        let kept = if kept { 0 } else { ATTACH_KEPT };
        // Closed, it has no room and says so by itself.
        self.attach_requests.is_closed() || kept < self.attach_requests.capacity()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture;

    #[test]
    fn a_crowd_of_one_kind_leaves_places_for_the_other() {
        let (_publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
        let (acceptor, attach_requests, _requests) = SessionAcceptor::new(snapshots);
        let peer = || Peer { from: "test".into(), unix_user: None, in_process: false };
        let crowd = |kept: bool| {
            let mut attached = 0;
            while acceptor.has_room(kept) && attached < 100 {
                acceptor.attach(peer());
                attached += 1;
            }
            attached
        };
        assert_eq!((crowd(false), crowd(true)), (ATTACH_QUEUE_MAX - ATTACH_KEPT, ATTACH_KEPT));
        drop(attach_requests);
        assert!(acceptor.has_room(false), "a station that has ended says so by itself");
    }
}
