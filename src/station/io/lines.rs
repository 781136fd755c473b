//! The tasks of the lines: where each takes requests, how it goes on under another definition, and how it ends.

use std::sync::Arc;

use tokio::{
    sync::{mpsc, oneshot, watch},
    task::JoinHandle,
};

use crate::{
    bus::io::{
        clock::Clock,
        live_reads::LiveRequest,
        redefine::{LineDefinition, Redefine},
        requests::Requests,
        transport::Connector,
    },
    plant::{
        PlantDef,
        command::BusRequest,
        def::{DeviceId, LineId},
        event::Event,
        line_finding::DeviceFinding,
    },
    station::{plant_task::KEPT_FOR_STOPS, supervisor},
};

/// Requests waiting for one link; a full queue refuses the command.
const REQUESTS: usize = 16 + KEPT_FOR_STOPS;
/// Live reads waiting for one line; a full queue refuses the query.
const LIVE_MAX: usize = 16;

/// The ends of the queues of a line that its task takes from.
type Queues = (mpsc::Receiver<BusRequest>, mpsc::Receiver<LiveRequest>);

/// The task of a line.
#[derive(Debug)]
pub(super) struct Line {
    /// Where it takes requests.
    pub requests: mpsc::Sender<BusRequest>,
    /// Where it takes live reads.
    pub live: mpsc::Sender<LiveRequest>,
    stop: watch::Sender<bool>,
    /// Both queues, until it is started or goes on.
    queues: Option<Queues>,
    /// Lets it pause for another definition …
    redefines: mpsc::Sender<Redefine>,
    redefine_queue: Option<mpsc::Receiver<Redefine>>,
    /// … and go on under it.
    next: Option<oneshot::Sender<LineDefinition>>,
    /// From its start to its end.
    task: Option<JoinHandle<()>>,
}

impl Default for Line {
    /// One that is not started: requests wait.
    fn default() -> Line {
        let (requests, live, queues) = queues();
        let (redefines, redefine_queue) = mpsc::channel(1);
        let stop = watch::Sender::new(false);
        let (queues, redefine_queue) = (Some(queues), Some(redefine_queue));
        Line { requests, live, stop, queues, redefines, redefine_queue, next: None, task: None }
    }
}

fn queues() -> (mpsc::Sender<BusRequest>, mpsc::Sender<LiveRequest>, Queues) {
    let (requests, request_queue) = mpsc::channel(REQUESTS);
    let (live, live_queue) = mpsc::channel(LIVE_MAX);
    (requests, live, (request_queue, live_queue))
}

impl Line {
    /// Starts it with what was `found` of its devices, or lets it go on if it pauses; nothing if it runs.
    pub fn start(
        &mut self,
        def: &Arc<PlantDef>,
        line: LineId,
        clock: Clock,
        connector: Connector,
        events: &mpsc::Sender<Event>,
        found: &[(DeviceId, DeviceFinding)],
    ) {
        let Some((requests, live)) = self.queues.take() else { return };
        let (def, events, stopped) = (def.clone(), events.clone(), self.stop.subscribe());
        if let Some(next) = self.next.take() {
            // It pauses until then, or the station is ending.
            let _ = next.send(LineDefinition { def, line, requests, live });
        } else if let Some(redefines) = self.redefine_queue.take() {
            let requests = Requests::new(requests).redefined_by(redefines);
            let task = supervisor::run(def, line, clock, connector, events, requests, live, stopped, found.to_vec());
            self.task = Some(tokio::spawn(task));
        }
    }

    /// Lets it pause between two requests, until it is started again. One that cannot has ended. May be given up: then it goes on
    /// as it was.
    pub async fn pause(&mut self) {
        let ((paused, pauses), (next, definition)) = (oneshot::channel(), oneshot::channel());
        let asked = self.redefines.send(Redefine { paused, next: definition }).await;
        if asked.is_ok() && pauses.await.is_ok() {
            self.next = Some(next);
        } else {
            self.stop();
            self.ended().await;
        }
    }

    /// The same line where it pauses, with queues for what is asked under another definition.
    pub fn with_other_queues(self) -> Option<Line> {
        self.next.as_ref()?;
        let (requests, live, queues) = queues();
        Some(Line { requests, live, queues: Some(queues), ..self })
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
