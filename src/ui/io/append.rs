//! Writes logs: one thread, so that rows stay in order and a hung disk holds up neither keys nor screen.

use std::{
    collections::HashSet,
    fs::OpenOptions,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, SyncSender, sync_channel},
    thread,
    time::Duration,
};

use tokio::sync::mpsc;

use crate::ui::{Msg, tabs::Tab};

/// Rows that wait for the disk; beyond, they are lost, and said to be.
const ROWS_MAX: usize = 1_000;

struct Row {
    tab: Tab,
    path: PathBuf,
    bytes: Vec<u8>,
    new: bool,
}

/// At the end the rows on their way are waited for so long: a hung disk holds up no one.
const END_MAX: Duration = Duration::from_secs(2);

/// The way to the thread, which begins with the first row.
pub struct Appender {
    rows: Option<SyncSender<Row>>,
    /// Closed when the thread has written its last row.
    ended: Option<Receiver<()>>,
    outbox: mpsc::Sender<(u32, Msg)>,
}

impl Appender {
    /// Failures go to the outbox.
    pub fn new(outbox: mpsc::Sender<(u32, Msg)>) -> Appender {
        Appender { rows: None, ended: None, outbox }
    }

    /// Writes a row behind the others of its file.
    pub fn append(&mut self, tab: Tab, path: PathBuf, bytes: Vec<u8>, new: bool) {
        let outbox = self.outbox.clone();
        let rows = self.rows.get_or_insert_with(|| {
            let (rows, queue) = sync_channel(ROWS_MAX);
            let (end, ended) = sync_channel(1);
            thread::spawn(move || {
                write_rows(&queue, &outbox);
                drop(end);
            });
            self.ended = Some(ended);
            rows
        });
        if rows.try_send(Row { tab, path, bytes, new }).is_err() {
            let why = "the disk does not keep up: rows are lost".to_owned();
            let _ = self.outbox.try_send((0, Msg::LogFailed(tab, why)));
        }
    }
}

impl Drop for Appender {
    fn drop(&mut self) {
        drop(self.rows.take());
        // The thread says nothing; it only lets go.
        let _ = self.ended.take().map(|ended| ended.recv_timeout(END_MAX));
    }
}

fn write_rows(queue: &Receiver<Row>, outbox: &mpsc::Sender<(u32, Msg)>) {
    // A file that failed gets no more rows: it would be another's, or have a gap.
    let mut failed: HashSet<PathBuf> = HashSet::new();
    for Row { tab, path, bytes, new } in queue {
        if failed.contains(&path) {
            continue;
        }
        if let Err(error) = write(&path, &bytes, new) {
            failed.insert(path.clone());
            let why = format!("{}: {error}", path.display());
            // A terminal that has left needs no answer.
            let _ = outbox.blocking_send((0, Msg::LogFailed(tab, why)));
        }
    }
}

/// Each row is with the system when this returns: it outlives the program.
fn write(path: &Path, bytes: &[u8], new: bool) -> io::Result<()> {
    let mut options = OpenOptions::new();
    options.append(true).create_new(new);
    options.open(path)?.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_in_order_and_a_failure_is_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.csv");
        let (outbox, mut inbox) = mpsc::channel(8);
        let mut appender = Appender::new(outbox);
        appender.append(Tab::Registers, path.clone(), b"head\n".to_vec(), true);
        for n in 0..500 {
            appender.append(Tab::Registers, path.clone(), format!("{n}\n").into_bytes(), false);
        }
        // It must not begin a log over this one: its answer comes behind all rows.
        appender.append(Tab::Registers, path.clone(), b"head\n".to_vec(), true);
        let answer = inbox.blocking_recv();
        assert!(matches!(answer, Some((_, Msg::LogFailed(Tab::Registers, _)))), "{answer:?}");
        let text = std::fs::read_to_string(&path).expect("the log");
        let expected: String = std::iter::once("head\n".into()).chain((0..500).map(|n| format!("{n}\n"))).collect();
        assert_eq!(text, expected);
    }
}
