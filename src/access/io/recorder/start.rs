//! The start of the recorder, however long its disk takes.

use std::{path::Path, sync::mpsc::RecvTimeoutError, time::Duration};

use tokio::sync::{mpsc, watch};

use super::{Handle, Recorded, Recorder, WRITE_GROUPS_MAX};
use crate::{
    access::io::audit_log::Opened,
    bus::io::{clock::Clock, worker},
    history::io::{alarm_file::RestoredAlarms, thread::HistoryInput},
};

/// Opens both files beside a history and starts the thread. A file that cannot be opened is trouble, and no reason not to
/// start; nor is a system that gives no thread: the station goes on, and says that the audit log is not written.
#[cfg(test)]
pub fn start(history_file: &Path, clock: Clock, history: mpsc::Sender<HistoryInput>) -> Handle {
    start_within(Duration::MAX, history_file, clock, history)
}

/// The same, but what the files hold is waited for so long only: a disk that hangs keeps no station from starting. They are
/// written once it responds, and until then the journal has the state of the alarms.
pub fn start_within(max: Duration, history_file: &Path, clock: Clock, history: mpsc::Sender<HistoryInput>) -> Handle {
    let (groups, queue) = mpsc::channel(WRITE_GROUPS_MAX);
    let (status, recorded) = watch::channel(Recorded::default());
    let (sender, opened) = std::sync::mpsc::channel();
    let (path, to_history) = (history_file.to_owned(), history.clone());
    let work = move || {
        let (recorder, found) = Recorder::opened(&path, clock, to_history);
        status.send_replace(recorder.status());
        // Who waits no longer has started without.
        let _ = sender.send(found);
        recorder.run(queue, status)
    };
    let join = worker::spawn("recorder", 1, work);
    let join = join.inspect_err(|error| tracing::error!(%error, "no thread for the audit log")).ok();
    let (opened, alarms) = match opened.recv_timeout(max) {
        Ok(found) => found,
        Err(RecvTimeoutError::Timeout) => {
            tracing::error!(path = %history_file.display(), "the disk does not respond: the station starts without its files");
            (Opened::default(), RestoredAlarms::default())
        }
        Err(RecvTimeoutError::Disconnected) => Recorder::opened(history_file, clock, history).1,
    };
    Handle { groups, recorded, opened, alarms, join }
}
