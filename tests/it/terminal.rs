//! The program as a person sees it, in a pseudo-terminal.

use std::{
    io::{Read, Write},
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    time::Instant,
};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};

use crate::support::{PATIENCE, folder};

struct Terminal {
    child: Box<dyn Child + Send + Sync>,
    master: Option<Box<dyn MasterPty + Send>>,
    writer: Option<Box<dyn Write + Send>>,
    bytes: Receiver<Vec<u8>>,
    parser: vt100::Parser,
    /// Everything that came, for what must be undone at the end.
    raw: Vec<u8>,
    _folder: tempfile::TempDir,
}

impl Terminal {
    fn start(columns: u16, rows: u16, args: &[&str]) -> Terminal {
        let folder = folder();
        let pair =
            native_pty_system().openpty(PtySize { rows, cols: columns, pixel_width: 0, pixel_height: 0 }).unwrap();
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_sightglass"));
        command.args(args);
        command.env("TERM", "xterm-256color");
        command.env("XDG_STATE_HOME", folder.path());
        let child = pair.slave.spawn_command(command).unwrap();
        drop(pair.slave);
        let (sender, bytes) = channel();
        let mut reader = pair.master.try_clone_reader().unwrap();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut buffer) {
                if sender.send(buffer[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        let writer = Some(pair.master.take_writer().unwrap());
        let parser = vt100::Parser::new(rows, columns, 0);
        Terminal { child, master: Some(pair.master), writer, bytes, parser, raw: Vec::new(), _folder: folder }
    }

    fn keys(&mut self, keys: &str) {
        let writer = self.writer.as_mut().unwrap();
        writer.write_all(keys.as_bytes()).unwrap();
        writer.flush().unwrap();
    }

    /// Waits until the screen holds a text.
    fn wait_for(&mut self, text: &str) {
        self.wait(text, true);
    }

    /// Waits until the screen holds a text no more.
    fn wait_gone(&mut self, text: &str) {
        self.wait(text, false);
    }

    fn wait(&mut self, text: &str, there: bool) {
        let end = Instant::now() + PATIENCE;
        while self.parser.screen().contents().contains(text) != there {
            match self.bytes.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(bytes) => self.take(&bytes),
                Err(_) => panic!(
                    "`{text}` never {}; the screen:\n{}",
                    if there { "came" } else { "went" },
                    self.parser.screen().contents()
                ),
            }
        }
    }

    fn take(&mut self, bytes: &[u8]) {
        self.parser.process(bytes);
        self.raw.extend_from_slice(bytes);
    }

    fn signal(&self, name: &str) {
        let id = self.child.process_id().unwrap().to_string();
        assert!(std::process::Command::new("kill").args([&format!("-{name}"), &id]).status().unwrap().success());
    }

    /// Reads to the end of the program and gives its exit code.
    fn end(&mut self) -> u32 {
        let end = Instant::now() + PATIENCE;
        loop {
            match self.bytes.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(bytes) => self.take(&bytes),
                Err(RecvTimeoutError::Disconnected) => return self.child.wait().unwrap().exit_code(),
                Err(RecvTimeoutError::Timeout) => panic!("it did not end; {}", self.parser.screen().contents()),
            }
        }
    }

    /// The terminal is as it was: main screen, cursor shown, paste marks off, each undone exactly as often as done.
    fn assert_restored(&self) {
        let text = String::from_utf8_lossy(&self.raw);
        for (done, undone) in
            [("\x1b[?1049h", "\x1b[?1049l"), ("\x1b[?2004h", "\x1b[?2004l"), ("\x1b[?2026h", "\x1b[?2026l")]
        {
            assert_eq!(text.matches(done).count(), text.matches(undone).count(), "{done:?} and {undone:?}");
        }
        assert!(!self.parser.screen().alternate_screen());
        assert!(!self.parser.screen().hide_cursor());
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn every_tab_opens_and_q_asks_before_leaving() {
    let mut terminal = Terminal::start(80, 24, &["demo", "--speed", "10"]);
    terminal.wait_for("TK-1");
    for (key, text) in [("2", "window"), ("3", "unacknowledged"), ("4", "FUJI"), ("5", "RUNNING"), ("1", "TK-2")] {
        terminal.keys(key);
        terminal.wait_for(text);
    }
    terminal.keys("?");
    terminal.wait_for("every tab");
    terminal.keys("\x1b");
    // Esc and a letter in one go would be Alt and the letter.
    terminal.wait_gone("every tab");
    terminal.keys("q");
    terminal.wait_for("Quit?");
    terminal.keys("\r");
    assert_eq!(terminal.end(), 0);
    terminal.assert_restored();
}

#[test]
fn a_set_value_is_written_and_verified() {
    let mut terminal = Terminal::start(120, 40, &["demo"]);
    terminal.wait_for("70.0");
    terminal.keys("s");
    terminal.wait_for("new");
    terminal.keys("\x15");
    terminal.keys("65.5\r");
    terminal.wait_for("65.5");
    terminal.keys("\r");
    terminal.wait_for("verified");
}

#[test]
fn signals_leave_the_terminal_as_it_was() {
    for signal in ["TERM", "HUP", "INT"] {
        let mut terminal = Terminal::start(80, 24, &["demo"]);
        terminal.wait_for("TK-1");
        terminal.signal(signal);
        terminal.end();
        terminal.assert_restored();
    }
}

#[test]
fn a_closed_session_ends_the_program() {
    let mut terminal = Terminal::start(80, 24, &["demo"]);
    terminal.wait_for("TK-1");
    // Both ends of the master must go: the reader's copy stays in its thread until the program closes its side.
    drop(terminal.writer.take());
    drop(terminal.master.take());
    terminal.signal("HUP");
    terminal.end();
}

#[test]
fn a_tiny_terminal_is_no_reason_to_fall() {
    let mut terminal = Terminal::start(12, 3, &["demo"]);
    terminal.wait_for("too");
    terminal.signal("TERM");
    terminal.end();
    terminal.assert_restored();
}
