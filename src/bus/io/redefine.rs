//! Another definition for a line that runs: it pauses, keeps its port, and goes on.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};

use super::live_reads::LiveRequest;
use crate::plant::{PlantDef, command::BusRequest, def::LineId};

/// Lets a line pause between two requests, so that nothing is said under ids of before once the plant has others.
#[derive(Debug)]
pub struct Redefine {
    /// Answered when it pauses. Dropped: it has failed.
    pub paused: oneshot::Sender<()>,
    /// What it goes on under. Dropped: as before.
    pub next: oneshot::Receiver<LineDefinition>,
}

/// What a line goes on under.
#[derive(Debug)]
pub struct LineDefinition {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// The line in it, with the same settings.
    pub line: LineId,
    /// Requests under its ids.
    pub requests: mpsc::Receiver<BusRequest>,
    /// Live reads of its devices.
    pub live: mpsc::Receiver<LiveRequest>,
}
