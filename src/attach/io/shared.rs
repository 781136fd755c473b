//! Snapshots on their way to all terminals: each is encoded once, and once more without what an anonymous one may not see.

use std::{sync::Arc, time::Duration};

use tokio::{
    sync::{OnceCell, watch},
    time::Instant,
};

use crate::{
    attach::{
        protocol::{self, ProtocolError, SERVER_MESSAGE_BYTES_MAX, ServerMessage},
        redaction::redact,
    },
    plant::{Snapshot, def::LineId, line_report::LineReport},
};

/// Real time between two snapshots to one terminal.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(250);

/// A message with its length, or why it cannot be sent.
type Encoded = Result<Arc<[u8]>, ProtocolError>;

/// Publishes the snapshots of a station to its connections.
pub struct SnapshotSender(watch::Sender<Arc<SharedSnapshot>>);

/// One connection's end: only the latest snapshot is there, so a slow terminal skips what it missed.
#[derive(Clone)]
pub struct SnapshotReceiver {
    pub latest: watch::Receiver<Arc<SharedSnapshot>>,
    began: Instant,
}

impl SnapshotSender {
    /// Begins with this snapshot.
    pub fn new(snapshot: Arc<Snapshot>) -> (SnapshotSender, SnapshotReceiver) {
        let (sender, latest) = watch::channel(Arc::new(SharedSnapshot::new(snapshot, &[])));
        (SnapshotSender(sender), SnapshotReceiver { latest, began: Instant::now() })
    }

    /// The next one.
    pub fn publish(&self, snapshot: Arc<Snapshot>) {
        self.0.send_modify(|latest| *latest = Arc::new(SharedSnapshot::new(snapshot, &latest.reports)));
    }
}

impl SnapshotReceiver {
    /// When the next snapshot is sent. It is the same instant for all terminals, so that they need the same one.
    pub fn next_at(&self) -> Instant {
        let periods = self.began.elapsed().div_duration_f64(SNAPSHOT_EVERY).floor() + 1.0;
        self.began + SNAPSHOT_EVERY.mul_f64(periods)
    }
}

/// A snapshot, encoded when the first terminal needs it. The line reports are messages of their own.
pub struct SharedSnapshot {
    pub snapshot: Arc<Snapshot>,
    whole: OnceCell<Encoded>,
    redacted: OnceCell<Encoded>,
    /// By line; one that has not changed stays encoded.
    pub reports: Vec<Arc<SharedReport>>,
}

impl SharedSnapshot {
    fn new(snapshot: Arc<Snapshot>, before: &[Arc<SharedReport>]) -> SharedSnapshot {
        let reports = snapshot.lines.iter().zip(0..).map(|(line, id)| match before.get(usize::from(id)) {
            Some(before) if is_same(before.report.as_ref(), line.report.as_ref()) => before.clone(),
            Some(_) | None => {
                Arc::new(SharedReport { line: LineId(id), report: line.report.clone(), encoded: OnceCell::new() })
            }
        });
        let reports = reports.collect();
        SharedSnapshot { snapshot, whole: OnceCell::new(), redacted: OnceCell::new(), reports }
    }

    /// As a terminal gets it that may view the process, or not.
    pub async fn encoded(&self, view: bool) -> Encoded {
        let encode_as = async |snapshot| encode(&ServerMessage::Snapshot(snapshot));
        let encoded = match view {
            true => self.whole.get_or_init(|| encode_as(self.snapshot.clone())).await,
            false => self.redacted.get_or_init(|| encode_as(Arc::new(redact(&self.snapshot)))).await,
        };
        encoded.clone()
    }
}

/// The report of a line, encoded when the first terminal needs it.
pub struct SharedReport {
    line: LineId,
    report: Option<Arc<LineReport>>,
    encoded: OnceCell<Encoded>,
}

impl SharedReport {
    /// What a terminal may see of it.
    pub fn visible(&self, view: bool) -> Option<&Arc<LineReport>> {
        self.report.as_ref().filter(|_| view)
    }

    /// As a terminal gets it that may view the process, or not.
    pub async fn encoded(&self, view: bool) -> Encoded {
        let encode_as = async |report| encode(&ServerMessage::LineReport(self.line, report));
        match view {
            true => self.encoded.get_or_init(|| encode_as(self.report.clone())).await.clone(),
            false => encode_as(None).await,
        }
    }
}

/// Whether both are the very same report.
pub fn is_same(one: Option<&Arc<LineReport>>, other: Option<&Arc<LineReport>>) -> bool {
    one.map(Arc::as_ptr) == other.map(Arc::as_ptr)
}

fn encode(message: &ServerMessage) -> Encoded {
    protocol::encode(message, SERVER_MESSAGE_BYTES_MAX).map(Arc::from)
}
