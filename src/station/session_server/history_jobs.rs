//! Backups and imports on their way to the history and back; who leaves cancels what was asked for.

use tokio::sync::{mpsc, oneshot};

use super::SessionServer;
use crate::{
    bus::io::worker::spawn_blocking,
    history::{
        HistoryError,
        io::{HistoryJob, JobRequest, import},
    },
    station::companions,
};

impl SessionServer {
    pub(super) fn import(&mut self, ticket: u64, name: &str) {
        let job = HistoryJob::Import { file: import::folder(&self.outputs.history).join(name) };
        let jobs = self.outputs.history_jobs.clone();
        self.spawn_job(ticket, done_by_history(jobs, job));
    }

    pub(super) fn back_up(&mut self, ticket: u64, folder: String) {
        let (history, plant) = (self.outputs.history.clone(), self.outputs.plant.clone());
        let jobs = self.outputs.history_jobs.clone();
        self.spawn_job(ticket, async move {
            let companions = spawn_blocking(move || companions::companions(&history, &plant)).await.unwrap_or_default();
            done_by_history(jobs, HistoryJob::Backup { to: folder.into(), companions }).await
        });
    }

    fn spawn_job(&mut self, ticket: u64, job: impl Future<Output = Result<String, String>> + Send + 'static) {
        let job = self.history_jobs.spawn(async move { (ticket, job.await) });
        self.jobs_of_tickets.insert(ticket, job);
    }

    /// Who has left waits for no answer any more; a backup or an import that is not awaited is cancelled.
    pub(super) fn forget_closed_tickets(&mut self) {
        self.tickets.retain(|_, reply| !reply.is_closed());
        self.jobs_of_tickets.retain(|_, job| !job.is_finished());
        let left = self.jobs_of_tickets.extract_if(.., |ticket, _| !self.tickets.contains_key(ticket));
        for (ticket, job) in left.collect::<Vec<_>>() {
            // The history sees that its answer is not awaited.
            job.abort();
            let why = Err("cancelled: who asked for it has left".to_owned());
            let effects = self.access.on_history_job_done(ticket, why, self.clock.now());
            self.apply_effects(effects);
        }
    }
}

/// Waits for the outcome of a job, in words.
async fn done_by_history(jobs: mpsc::Sender<JobRequest>, job: HistoryJob) -> Result<String, String> {
    let (reply, done) = oneshot::channel();
    // Refused by dropping the reply.
    let _ = jobs.try_send(JobRequest { job, reply });
    done.await.unwrap_or(Err(HistoryError::NotOpen)).map_err(|error| error.to_string())
}
