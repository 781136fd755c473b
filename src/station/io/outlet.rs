//! A task that brings something out of the station by itself: data out, automatic reports.

use tokio::{sync::watch, task::JoinHandle};

use super::{ReportTask, Station, reports, requests};
use crate::north::io::task::{self as north, NorthTask};

/// The task, and how it ends.
#[derive(Debug)]
pub(super) struct Outlet {
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
}

impl Outlet {
    /// Starts a task as soon as the one before it has ended. It ends soon after [`Outlet::stop`].
    pub fn start<F>(before: Option<Outlet>, run: impl FnOnce(watch::Receiver<bool>) -> F + Send + 'static) -> Outlet
    where
        F: Future<Output = ()> + Send,
    {
        let (stop, stopped) = watch::channel(false);
        let task = async move {
            if let Some(before) = before {
                before.end().await;
            }
            run(stopped).await;
        };
        Outlet { stop, task: tokio::spawn(task) }
    }

    /// Lets it end.
    pub fn stop(&self) {
        self.stop.send_replace(true);
    }

    /// Waits for its end.
    pub async fn end(self) {
        self.stop();
        if let Err(error) = self.task.await {
            tracing::error!(%error, "a task of the station failed");
        }
    }
}

impl Station {
    /// Starts what the plant file wants, after what it wanted before; `keeps_north`: the data out goes on as it is.
    pub(super) fn start_outlets(&mut self, keeps_north: bool) {
        let Some((records, history)) = self.senders.store.clone() else { return };
        let (def, clock, queries) = (self.def.clone(), self.clock, self.senders.queries.clone());
        let (events, audit, history_file) =
            (self.senders.events.clone(), self.senders.audit.clone(), self.senders.history_file.clone());
        if !keeps_north && (self.north.is_some() || def.north.mqtt.is_some()) {
            let (def, acceptor, queries, events) =
                (def.clone(), self.acceptor.clone(), queries.clone(), events.clone());
            let history = history.clone();
            self.north = Some(Outlet::start(self.north.take(), move |stopped| async move {
                let Some(mqtt) = def.north.mqtt.clone() else { return };
                let snapshots = acceptor.snapshots.clone();
                let started = requests::start(&mqtt, clock, &acceptor, &history_file, stopped.clone()).await;
                drop(acceptor);
                let (requests, passing_on) = started.unzip();
                let task = NorthTask { def, mqtt, clock, snapshots, queries, history, events, history_file, requests };
                north::run(task, stopped).await;
                if let Some(task) = passing_on
                    && let Err(error) = task.await
                {
                    tracing::error!(%error, "the task of requests from outside failed");
                }
            }));
        }
        if self.reports.is_some() || !def.report.automatic.is_empty() {
            let task = ReportTask { def, clock, queries, records, audit, events, status: history };
            self.reports = Some(Outlet::start(self.reports.take(), move |stopped| async move {
                if !task.def.report.automatic.is_empty() {
                    reports::run(task, stopped).await;
                }
            }));
        }
    }
}
