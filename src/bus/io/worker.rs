//! Work beside the tasks of a station: on a thread with a runtime of its own, or, where the whole station is simulated in
//! virtual time, on the only thread there is, so that one seed gives one run.

use std::{cell::Cell, io, time::Duration};

use tokio::{runtime::Builder, task};

/// Interrupted work that goes on for so long hangs in the disk, which the engine cannot know.
pub const HANG_MAX: Duration = Duration::from_secs(5);

thread_local! {
    static SIMULATED: Cell<bool> = const { Cell::new(false) };
}

/// From now on nothing that this thread starts leaves it.
pub fn simulate() {
    SIMULATED.set(true);
}

/// Work that runs until its queue is closed.
#[derive(Debug)]
pub enum Worker<T> {
    /// On its thread.
    Thread(std::thread::JoinHandle<T>),
    /// Among the tasks of a simulation.
    Task(task::JoinHandle<T>),
}

impl<T: Send + 'static> Worker<T> {
    /// Waits for the end. `None` after a panic, which the panic hook has reported.
    pub async fn ended(self) -> Option<T> {
        match self {
            Worker::Thread(thread) => task::spawn_blocking(|| thread.join()).await.ok()?.ok(),
            Worker::Task(task) => task.await.ok(),
        }
    }

    /// The same for who may block; a task is left alone.
    pub fn join(self) -> Option<T> {
        match self {
            Worker::Thread(thread) => thread.join().ok(),
            Worker::Task(_) => None,
        }
    }
}

/// Starts work with a number of threads for what blocks; an error where the system gives no thread.
pub fn spawn<F>(
    name: &str,
    blocking_threads: usize,
    work: impl FnOnce() -> F + Send + 'static,
) -> io::Result<Worker<F::Output>>
where
    F: Future<Output: Send> + Send + 'static,
{
    if SIMULATED.get() {
        return Ok(Worker::Task(tokio::spawn(work())));
    }
    let runtime = Builder::new_current_thread().enable_time().max_blocking_threads(blocking_threads).build()?;
    let thread = std::thread::Builder::new().name(name.into()).spawn(move || {
        let done = runtime.block_on(work());
        // What hangs in the disk does not keep the station from ending.
        runtime.shutdown_timeout(HANG_MAX);
        done
    });
    thread.map(Worker::Thread)
}

/// [`task::spawn_blocking`], but for a simulation, where nothing goes on meanwhile.
pub fn spawn_blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> task::JoinHandle<T> {
    if SIMULATED.get() { tokio::spawn(async { work() }) } else { task::spawn_blocking(work) }
}
