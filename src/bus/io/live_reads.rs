//! The live reads of one line: they wait until they are due, and each is answered once.

use tokio::sync::{mpsc, oneshot};

use super::clock::Clock;
use crate::{
    bus::{live::LiveJob, plan::UnreadableRanges},
    plant::live::{LiveRead, LiveReading},
};

/// A live read with the place for its answer. A dropped answer means: the line has ended, or no longer waits for it.
#[derive(Debug)]
pub struct LiveRequest {
    /// What is read.
    pub read: LiveRead,
    /// Where the answer goes.
    pub reply: oneshot::Sender<LiveReading>,
}

/// The live reads of a line that have not been answered. They outlive a task that panics.
#[derive(Debug)]
pub struct LiveReads {
    queue: mpsc::Receiver<LiveRequest>,
    waiting: Vec<LiveRequest>,
    /// The one at work.
    pub(super) job: Option<(LiveJob, LiveRequest)>,
}

impl LiveReads {
    /// All of `queue`.
    pub fn new(queue: mpsc::Receiver<LiveRequest>) -> LiveReads {
        LiveReads { queue, waiting: Vec::new(), job: None }
    }

    /// Answers none of them: the line only listens.
    pub fn drop_all(&mut self) {
        while self.queue.try_recv().is_ok() {}
        self.waiting.clear();
    }

    /// Begins the read that is due longest, unless one is at work. `true`: one is at work.
    pub fn begin(&mut self, known: &mut UnreadableRanges, clock: Clock) -> bool {
        while let Ok(request) = self.queue.try_recv() {
            self.waiting.push(request);
        }
        // A read whose terminal has moved on is not wanted any more.
        self.waiting.retain(|request| !request.reply.is_closed());
        self.job.take_if(|(_, request)| request.reply.is_closed());
        let now = clock.now();
        let due =
            self.waiting.iter().enumerate().filter(|(_, request)| request.read.not_before.is_none_or(|at| at <= now));
        let first = due.min_by_key(|(_, request)| request.read.not_before).map(|(index, _)| index);
        if self.job.is_none()
            && let Some(first) = first
        {
            let request = self.waiting.remove(first);
            self.job = Some((LiveJob::new(&request.read, known, clock.to_utc(now), now), request));
        }
        self.job.is_some()
    }

    /// Waits until a read is due or has come; may be dropped before.
    pub async fn due(&mut self, clock: Clock) {
        if self.job.is_some() {
            return;
        }
        let next = self.waiting.iter().map(|request| request.read.not_before.unwrap_or_default()).min();
        tokio::select! {
            biased;
            () = clock.sleep_until_if_any(next) => {}
            request = self.queue.recv() => match request {
                Some(request) => self.waiting.push(request),
                // The station is ending.
                None => std::future::pending().await,
            }
        }
    }
}
