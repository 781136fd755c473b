//! The loop on a real terminal: this test program runs itself on a pty, once for every way out.

mod pictures;

use std::{
    io::{Read, Write},
    sync::mpsc as plain,
};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use rustix::process::{Pid, Signal, kill_process};
use tokio::sync::watch;

use super::*;
use crate::access::{LoggedInUser, SessionStatus};
use crate::{plant::role::Role, station::Request};
use crate::{
    plant::{
        alarm::AlarmCommand,
        command::{Command, CommandKind},
    },
    ui::fixture::Fixture,
};

/// Set for the process on the pty.
const CHILD: &str = "SIGHTGLASS_UI_CHILD";
/// No wait in these tests is longer.
const TIMEOUT: Duration = Duration::from_secs(30);

/// What runs on the pty: a terminal on a plant driven by keys: `a` panics a task, `A` spoils the snapshot.
/// Without the variable there is nothing to run.
#[test]
fn on_the_pty() {
    if std::env::var_os(CHILD).is_none() {
        return;
    }
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    runtime.block_on(async {
        let (publish, snapshots) = watch::channel(Fixture::alarm().snapshot());
        let (requests, mut taken) = mpsc::channel(8);
        let who = LoggedInUser { user: "tech1".into(), role: Role::Supervisor, must_change: false };
        let (_reported, status) =
            watch::channel(Arc::new(SessionStatus { who: Some(who), may_view: true, ..SessionStatus::default() }));
        tokio::spawn(async move {
            while let Some((_, request)) = taken.recv().await {
                let Request::Command(Command { kind, .. }, _) = request else { continue };
                let mut snapshot = Arc::unwrap_or_clone(Fixture::alarm().snapshot());
                match kind {
                    CommandKind::Alarm(AlarmCommand::Acknowledge { .. }) => {
                        let panicked = tokio::spawn(async { panic!("a task of the station") }).await;
                        assert!(panicked.is_err());
                        snapshot.alarms = Arc::default();
                    }
                    _ => snapshot.samples.clear(),
                }
                publish.send_replace(Arc::new(snapshot));
            }
        });
        let session = Session { snapshots, status, requests, terminal: 1 };
        run(session, Options { theme: Theme::FULL, ..Options::new(Leaving::Station) })
            .await
            .expect("left by its operator or a signal");
    });
}

/// A terminal program on a pty, and all that it has sent.
struct Pty {
    child: Box<dyn Child + Send + Sync>,
    keys: Box<dyn Write + Send>,
    sent: plain::Receiver<Vec<u8>>,
    seen: Vec<u8>,
    _master: Box<dyn MasterPty + Send>,
}

impl Pty {
    /// A terminal that announces nothing.
    fn start() -> Pty {
        let mut pty = Pty::open();
        pty.wait_for("Water tank");
        pty
    }

    fn open() -> Pty {
        let size = PtySize { rows: 24, cols: 80, pixel_width: 0, pixel_height: 0 };
        let pair = native_pty_system().openpty(size).expect("a pty");
        let mut command = CommandBuilder::new(std::env::current_exe().expect("this program"));
        command.args(["--exact", "ui::io::tests::on_the_pty", "--nocapture"]);
        command.env(CHILD, "1");
        command.env_remove("TMUX");
        command.env_remove("STY");
        command.env("TERM", "xterm-256color");
        command.env("RUST_BACKTRACE", "0");
        let child = pair.slave.spawn_command(command).expect("the program starts");
        drop(pair.slave);
        let mut reader = pair.master.try_clone_reader().expect("a reader");
        let keys = pair.master.take_writer().expect("a writer");
        let (send, sent) = plain::channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut bytes) {
                if send.send(bytes[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        Pty { child, keys, sent, seen: Vec::new(), _master: pair.master }
    }
    /// Waits until the words stand on the screen, or were sent as they are.
    fn wait_for(&mut self, words: &str) {
        self.wait_for_times(words, 1);
    }
    /// Waits until it was sent so often; once is enough where the screen shows it.
    fn wait_for_times(&mut self, words: &str, times: usize) {
        let deadline = Instant::now() + TIMEOUT;
        loop {
            let mut screen = vt100::Parser::new(24, 80, 0);
            screen.process(&self.seen);
            let sent = String::from_utf8_lossy(&self.seen).matches(words).count();
            if times <= sent || times == 1 && screen.screen().contents().contains(words) {
                return;
            }
            match self.sent.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(bytes) => self.seen.extend(bytes),
                Err(_) => panic!("{words} never came; seen: {}", screen.screen().contents()),
            }
        }
    }
    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).expect("the pty takes keys");
    }
    fn signal(&self, signal: Signal) {
        let pid = self.child.process_id().and_then(|pid| Pid::from_raw(pid as i32)).expect("the child runs");
        kill_process(pid, signal).expect("the child runs");
    }
    /// Waits for the end; the terminal must be as it was, and restored once.
    fn ends_restored(&mut self, words: &str) {
        self.wait_for(words);
        while let Ok(bytes) = self.sent.recv_timeout(TIMEOUT) {
            self.seen.extend(bytes);
        }
        self.child.wait().expect("the child has ended");
        let seen = String::from_utf8_lossy(&self.seen);
        for sequence in ["\x1b[?1049l", "\x1b[?25h", "\x1b[?2004l"] {
            assert_eq!(seen.matches(sequence).count(), 1, "{sequence:?} in {seen}");
        }
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        // Only a failed test leaves a child behind.
        let _ = self.child.kill();
    }
}

#[test]
fn every_way_out_restores_the_terminal_once() {
    const PASSED: &str = "test result: ok";
    let mut pty = Pty::start();
    pty.press("q");
    pty.wait_for("Quit?");
    pty.press("\r");
    pty.ends_restored(PASSED);
    for signal in [Signal::TERM, Signal::HUP] {
        let mut pty = Pty::start();
        pty.signal(signal);
        pty.ends_restored(PASSED);
    }
    // A panic of the terminal itself: its message is readable, on the screen that was there before.
    let mut pty = Pty::start();
    pty.press("A");
    pty.wait_for("Acknowledge 2 alarms?");
    pty.press("\r");
    pty.ends_restored("index out of bounds");
    let seen = String::from_utf8_lossy(&pty.seen).into_owned();
    assert!(seen.find("\x1b[?1049l") < seen.find("index out of bounds"), "{seen}");
}

#[test]
fn a_panic_elsewhere_leaves_the_screen_alone() {
    let mut pty = Pty::start();
    pty.press("a");
    pty.wait_for("no alarms");
    let seen = String::from_utf8_lossy(&pty.seen);
    assert!(!seen.contains("a task of the station") && !seen.contains("\x1b[?1049l"), "{seen}");
    pty.press("\x03");
    pty.wait_for("Quit?");
    pty.press("y");
    pty.ends_restored("test result: ok");
}

#[test]
fn a_saved_report_is_whole_and_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("reports/morning.csv");
    assert_eq!(files::save(&path, b"a,b\n", true).expect("a writable folder"), path);
    assert!(files::save(&path, b"c\n", true).is_err(), "it is there already");
    assert_eq!(std::fs::read(&path).expect("the report"), b"a,b\n");
    assert_eq!(std::fs::read_dir(folder.path().join("reports")).expect("the folder").count(), 1);
}
