//! Jobs that would block the session server: password hashes and the users file, run on threads of their own.

use std::{collections::VecDeque, panic::resume_unwind, path::PathBuf, time::Duration};

use tokio::task::{JoinHandle, JoinSet};

use crate::{
    access::{
        Users,
        control::{JobId, JobOutcome, PasswordJob},
        io::{random, users},
    },
    bus::io::worker::spawn_blocking,
};

/// Passwords that are hashed at the same time, 19 MiB each; access control bounds those that wait.
const AT_ONCE: usize = 2;
/// At the end the file of users is waited for so long.
const SAVING_MAX: Duration = Duration::from_secs(2);

/// Something is done.
#[derive(Debug)]
pub enum Done {
    /// A hash.
    Job(JobId, JobOutcome),
    /// The file of users.
    Saved(Result<(), String>),
}

/// Everything that is being done.
#[derive(Debug)]
pub struct BlockingJobs {
    path: Option<PathBuf>,
    waiting: VecDeque<(JobId, PasswordJob)>,
    working: JoinSet<(JobId, JobOutcome)>,
    /// The jobs that are running, to report one that panics.
    jobs: Vec<(tokio::task::Id, JobId)>,
    saving: Option<JoinHandle<Result<(), String>>>,
}

impl BlockingJobs {
    /// Nothing to do. `path` is the file of users.
    pub fn new(path: Option<PathBuf>) -> BlockingJobs {
        BlockingJobs { path, waiting: VecDeque::new(), working: JoinSet::new(), jobs: Vec::new(), saving: None }
    }

    /// One more hash.
    pub fn put(&mut self, job: JobId, work: PasswordJob) {
        self.waiting.push_back((job, work));
        self.begin();
    }

    /// Writes the users down. Access control never requests it while it is being done.
    pub fn save(&mut self, list: Users) {
        let path = self.path.clone();
        self.saving = Some(spawn_blocking(move || match path {
            Some(path) => users::write(&path, &list),
            None => Err("this station has no users".to_owned()),
        }));
    }

    fn begin(&mut self) {
        while self.working.len() < AT_ONCE
            && let Some((job, work)) = self.waiting.pop_front()
        {
            let hashed = spawn_blocking(move || {
                let outcome = random().map_or_else(JobOutcome::Failed, |salt| work.run(salt));
                (job, outcome)
            });
            let begun =
                self.working.spawn(async { hashed.await.unwrap_or_else(|error| resume_unwind(error.into_panic())) });
            self.jobs.push((begun.id(), job));
        }
    }

    /// Waits for whatever is done next; for ever where nothing is being done. Safe to give up at any time.
    pub async fn next(&mut self) -> Done {
        let done = tokio::select! {
            Some(done) = self.working.join_next_with_id() => Ok(done),
            saved = saved(&mut self.saving) => Err(saved),
            else => std::future::pending().await,
        };
        match done {
            Err(result) => Done::Saved(result),
            Ok(done) => {
                let id = done.as_ref().map_or_else(tokio::task::JoinError::id, |(id, _)| *id);
                let place = self.jobs.iter().position(|(at_work, _)| *at_work == id);
                let job = place.map(|place| self.jobs.swap_remove(place).1);
                self.begin();
                match done {
                    Ok((_, (job, outcome))) => Done::Job(job, outcome),
                    Err(error) => {
                        tracing::error!(%error, "a password check failed");
                        let job = job.expect("every piece of work that is begun is noted");
                        Done::Job(job, JobOutcome::Failed("internal error, see the log".to_owned()))
                    }
                }
            }
        }
    }

    /// What is being written is written to its end, unless the disk hangs; what came of it, if anything was.
    pub async fn end(&mut self) -> Option<Result<(), String>> {
        self.saving.as_ref()?;
        let ended = tokio::time::timeout(SAVING_MAX, saved(&mut self.saving)).await;
        Some(ended.unwrap_or_else(|_| {
            tracing::error!("the disk does not accept the users file: task abandoned");
            Err("the disk does not respond: the file may or may not be written".to_owned())
        }))
    }
}

/// Waits for the end of a save; for ever without one.
async fn saved(saving: &mut Option<JoinHandle<Result<(), String>>>) -> Result<(), String> {
    let Some(work) = saving else { return std::future::pending().await };
    let result = work.await;
    *saving = None;
    result.unwrap_or_else(|error| {
        tracing::error!(%error, "writing the users file failed");
        Err("internal error, see the log".to_owned())
    })
}
