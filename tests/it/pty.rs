//! The program in a pseudo-terminal: what a person types, what stands on the screen, what is left behind.

use std::{
    io::{Read, Write},
    path::Path,
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    time::Instant,
};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};

use crate::support::{TIMEOUT, folder, sockets};

/// A screen, and the program that draws on it. Both end with the test.
pub struct Terminal {
    child: Box<dyn Child + Send + Sync>,
    pub master: Option<Box<dyn MasterPty + Send>>,
    pub writer: Option<Box<dyn Write + Send>>,
    bytes: Receiver<Vec<u8>>,
    parser: vt100::Parser,
    /// Everything that came, for what must be undone at the end.
    raw: Vec<u8>,
    _folder: tempfile::TempDir,
}

impl Terminal {
    pub fn start(columns: u16, rows: u16, args: &[&str]) -> Terminal {
        Terminal::start_in(columns, rows, args, &sockets())
    }

    /// The same, where stations have their sockets in this folder.
    pub fn start_in(columns: u16, rows: u16, args: &[&str], sockets: &Path) -> Terminal {
        let folder = folder();
        let pair =
            native_pty_system().openpty(PtySize { rows, cols: columns, pixel_width: 0, pixel_height: 0 }).unwrap();
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_sightglass"));
        command.args(args);
        command.env("TERM", "xterm-256color");
        command.env("XDG_STATE_HOME", folder.path());
        command.env("XDG_RUNTIME_DIR", sockets);
        // Reports go into a folder beside the plant.
        command.cwd(folder.path());
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

    pub fn keys(&mut self, keys: &str) {
        let writer = self.writer.as_mut().unwrap();
        writer.write_all(keys.as_bytes()).unwrap();
        writer.flush().unwrap();
    }

    /// Does the screen hold a text, as far as it was read?
    pub fn shows(&self, text: &str) -> bool {
        self.parser.screen().contents().contains(text)
    }

    /// Waits until the screen holds a text.
    pub fn wait_for(&mut self, text: &str) {
        self.wait(text, true);
    }

    /// Waits until the screen holds a text no more.
    pub fn wait_gone(&mut self, text: &str) {
        self.wait(text, false);
    }

    fn wait(&mut self, text: &str, there: bool) {
        let end = Instant::now() + TIMEOUT;
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

    pub fn signal(&self, name: &str) {
        let id = self.child.process_id().unwrap().to_string();
        assert!(std::process::Command::new("kill").args([&format!("-{name}"), &id]).status().unwrap().success());
    }

    /// Reads to the end of the program and gives its exit code.
    pub fn end(&mut self) -> u32 {
        let end = Instant::now() + TIMEOUT;
        loop {
            match self.bytes.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(bytes) => self.take(&bytes),
                Err(RecvTimeoutError::Disconnected) => return self.child.wait().unwrap().exit_code(),
                Err(RecvTimeoutError::Timeout) => panic!("it did not end; {}", self.parser.screen().contents()),
            }
        }
    }

    /// The terminal is as it was: main screen, cursor shown, paste marks off, each undone exactly as often as done.
    pub fn assert_restored(&self) {
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
