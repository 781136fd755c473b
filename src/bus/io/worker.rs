//! Work beside the tasks of a station: on a thread with a runtime of its own, or, where the whole station is simulated in
//! virtual time, on the only thread there is, so that one seed gives one run.

use std::{
    cell::Cell,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::mpsc::{Receiver, channel},
    time::Duration,
};

use tokio::{
    runtime::{Builder, Runtime},
    task,
};

/// Interrupted work that goes on for so long hangs in the disk, which the engine cannot know.
pub const HANG_MAX: Duration = Duration::from_secs(5);

thread_local! {
    static SIMULATED: Cell<bool> = const { Cell::new(false) };
}

/// From now on nothing that this thread starts leaves it.
pub fn simulate() {
    SIMULATED.set(true);
}

/// A runtime that may get no thread: to drop it among the tasks of another one would be a panic.
struct Unstarted(Option<Runtime>);

impl Drop for Unstarted {
    fn drop(&mut self) {
        self.0.take().into_iter().for_each(Runtime::shutdown_background);
    }
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
            Worker::Thread(thread) => spawn_blocking(|| thread.join()).await.ok()?.ok(),
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
    let mut runtime = Unstarted(Some(runtime));
    let thread = std::thread::Builder::new().name(name.into()).spawn(move || {
        let runtime = runtime.0.take().expect("taken once");
        let done = runtime.block_on(work());
        // What hangs in the disk does not keep the station from ending.
        runtime.shutdown_timeout(HANG_MAX);
        done
    });
    thread.map(Worker::Thread)
}

/// Work with a disk that may hang: what comes of it, or, where that takes longer than `max`, where it will come. The work goes on
/// by itself.
pub fn within<F, T>(max: Duration, work: F) -> Result<T, Receiver<T>>
where
    F: FnOnce() -> T + Send + 'static,
    T: Send + 'static,
{
    if SIMULATED.get() {
        return Ok(work());
    }
    let (give, given) = channel::<F>();
    let (sender, done) = channel();
    let thread = std::thread::Builder::new().name("disk".into()).spawn(move || {
        // Who waits no longer needs no answer.
        let _ = given.recv().map(|work| sender.send(work()));
    });
    if thread.is_err() {
        return Ok(work());
    }
    let _ = give.send(work);
    done.recv_timeout(max).map_err(|_| done)
}

/// [`task::spawn_blocking`], but for a simulation, where nothing goes on meanwhile; nor where the system gives no thread, which would
/// end the task that asks.
pub fn spawn_blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> task::JoinHandle<T> {
    if SIMULATED.get() {
        return tokio::spawn(async { work() });
    }
    let (give, given) = channel();
    let take =
        move || given.recv().map(|work: Box<dyn FnOnce() -> T + Send>| work()).expect("given as soon as it is spawned");
    match catch_unwind(AssertUnwindSafe(|| task::spawn_blocking(take))) {
        Ok(spawned) => {
            let _ = give.send(Box::new(work));
            spawned
        }
        Err(_) => tokio::spawn(async { work() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_that_hangs_is_not_waited_for_and_answers_later() {
        let (release, held) = channel::<()>();
        let work = move || {
            let _ = held.recv();
            7
        };
        let late = within(Duration::from_millis(1), work).expect_err("it waits to be released");
        drop(release);
        assert_eq!(late.recv(), Ok(7));
        assert_eq!(within(Duration::MAX, || 8).ok(), Some(8));
    }

    #[test]
    fn without_a_thread_work_is_done_by_who_asks_for_it() {
        // No system has room for such a stack.
        let runtime = Builder::new_current_thread().thread_stack_size(1 << 46).build().expect("a runtime");
        let own = std::thread::current().id();
        let done_by = runtime.block_on(async { spawn_blocking(|| std::thread::current().id()).await });
        assert_eq!(done_by.expect("no panic"), own);
    }

    #[test]
    fn a_worker_that_gets_no_thread_leaves_who_asks_for_it_alone() {
        let runtime = Builder::new_current_thread().build().expect("a runtime");
        let own = Builder::new_current_thread().build().expect("a runtime");
        let left = catch_unwind(AssertUnwindSafe(|| runtime.block_on(async { drop(Unstarted(Some(own))) })));
        assert!(left.is_ok(), "a runtime that is dropped inside another one panics");
    }
}
