//! The tasks of the lines: where each takes requests, and how it ends.

use std::sync::Arc;

use tokio::{
    sync::{mpsc, watch},
    task::JoinHandle,
};

use crate::{
    bus::io::{clock::Clock, live_reads::LiveRequest, transport::Connector},
    plant::{PlantDef, command::BusRequest, def::LineId, event::Event},
    station::{plant_task::KEPT_FOR_STOPS, supervisor},
};

/// Requests waiting for one link; a full queue refuses the command.
const REQUESTS: usize = 16 + KEPT_FOR_STOPS;
/// Live reads waiting for one line; a full queue refuses the query.
const LIVE_MAX: usize = 16;

/// The task of a line.
#[derive(Debug)]
pub(super) struct Line {
    /// Where it takes requests.
    pub requests: mpsc::Sender<BusRequest>,
    /// Where it takes live reads.
    pub live: mpsc::Sender<LiveRequest>,
    stop: watch::Sender<bool>,
    /// Both queues, until it is started.
    queues: Option<(mpsc::Receiver<BusRequest>, mpsc::Receiver<LiveRequest>)>,
    /// From its start to its end.
    task: Option<JoinHandle<()>>,
}

impl Default for Line {
    /// One that is not started: requests wait.
    fn default() -> Line {
        let (requests, request_queue) = mpsc::channel(REQUESTS);
        let (live, live_queue) = mpsc::channel(LIVE_MAX);
        Line { requests, live, stop: watch::Sender::new(false), queues: Some((request_queue, live_queue)), task: None }
    }
}

impl Line {
    /// Starts it, unless it runs.
    pub fn start(
        &mut self,
        def: &Arc<PlantDef>,
        id: LineId,
        clock: Clock,
        connector: Connector,
        events: &mpsc::Sender<Event>,
    ) {
        let Some((requests, live)) = self.queues.take() else { return };
        let (def, events, stopped) = (def.clone(), events.clone(), self.stop.subscribe());
        let task = supervisor::run(def, id, clock, connector, events, requests, live, stopped);
        self.task = Some(tokio::spawn(task));
    }

    /// Lets it end.
    pub fn stop(&self) {
        self.stop.send_replace(true);
    }

    /// Waits for its end. May be given up and called again.
    pub async fn ended(&mut self) {
        if let Some(task) = &mut self.task
            && let Err(error) = task.await
        {
            tracing::error!(%error, "the task of a line failed");
        }
        self.task = None;
    }
}
