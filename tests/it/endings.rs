//! Every way in which a terminal or its station can end, in a pseudo-terminal: the terminal is as it was, the exit code tells
//! how it ended, and a terminal whose station goes says so and comes back by itself.

use std::{
    path::{Path, PathBuf},
    process::Command,
    time::{Duration, Instant},
};

use sightglass::api::access::own_user;

use crate::{
    pty::Terminal,
    support::{Process, TIMEOUT, folder, have, sightglass, simulated_tank, sockets},
};

/// What ends a terminal.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// A key, and the answer to its query.
    Key(&'static str),
    Signal(&'static str),
}

const WAYS: [Way; 5] = [Way::Key("q"), Way::Key("\x03"), Way::Signal("INT"), Way::Signal("TERM"), Way::Signal("HUP")];

/// Ends it this way, and measures how long that takes.
fn end(terminal: &mut Terminal, way: Way) -> (u32, Duration) {
    let started = match way {
        Way::Key(key) => {
            terminal.keys(key);
            terminal.wait_for("Quit?");
            terminal.keys("\r");
            Instant::now()
        }
        Way::Signal(name) => {
            terminal.signal(name);
            Instant::now()
        }
    };
    let code = terminal.end();
    (code, started.elapsed())
}

/// A station on simulated devices, where the user who runs the tests is trusted.
struct Place {
    folder: tempfile::TempDir,
    sockets: PathBuf,
    port: String,
    _sim: Process,
}

impl Place {
    fn new() -> Place {
        let (folder, sockets) = (folder(), sockets());
        let (sim, port) = simulated_tank();
        let shipped = sightglass().args(["profiles", "tank"]).output().unwrap();
        let rules = format!("\n[[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n", own_user());
        let plant = String::from_utf8(shipped.stdout).unwrap() + &rules;
        std::fs::write(folder.path().join("tank.toml"), plant).unwrap();
        Place { folder, sockets, port, _sim: sim }
    }

    fn station(&self) -> Process {
        let mut station = Process::start(
            sightglass()
                .arg("run")
                .arg(self.folder.path().join("tank.toml"))
                .args(["--port", &format!("L1={}", self.port)])
                .env("XDG_RUNTIME_DIR", &self.sockets)
                .env("XDG_STATE_HOME", self.folder.path()),
        );
        station.wait_for("TIC-1 (unit 1): responding");
        station
    }

    fn terminal(&self) -> Terminal {
        let mut terminal = Terminal::start_in(100, 30, &[], &self.sockets);
        terminal.wait_for("(Supervisor)");
        terminal
    }

    fn run(&self, args: &[&str]) -> std::process::Output {
        sightglass().args(args).env("XDG_RUNTIME_DIR", &self.sockets).output().unwrap()
    }
}

#[test]
fn one_process_restores_the_terminal_however_it_ends() {
    for way in WAYS {
        let mut terminal = Terminal::start(100, 30, &["demo"]);
        terminal.wait_for("TK-1");
        let (code, took) = end(&mut terminal, way);
        println!("embedded, {way:?}: exit {code} after {} ms", took.as_millis());
        assert_eq!(code, 0, "{way:?}");
        terminal.assert_restored();
    }
}

#[test]
fn an_attached_terminal_is_restored_however_it_ends() {
    let place = Place::new();
    let mut station = place.station();
    for way in WAYS {
        let mut terminal = place.terminal();
        let (code, took) = end(&mut terminal, way);
        println!("attached, {way:?}: exit {code} after {} ms", took.as_millis());
        assert_eq!(code, 0, "{way:?}");
        terminal.assert_restored();
        let status = place.run(&["status"]);
        assert!(status.status.success(), "{way:?}: {}", String::from_utf8_lossy(&status.stderr));
    }
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn a_terminal_reports_a_lost_station_and_reconnects() {
    let place = Place::new();
    let mut station = place.station();
    let mut terminal = place.terminal();
    for kill in [true, false, true] {
        let started = Instant::now();
        if kill {
            station.signal("KILL");
        } else {
            let stopped = place.run(&["stop"]);
            assert!(stopped.status.success(), "{}", String::from_utf8_lossy(&stopped.stderr));
        }
        terminal.wait_for("STATION LOST");
        println!("attached, station gone (killed: {kill}): said after {} ms", started.elapsed().as_millis());
        assert_eq!(station.end(), if kill { None } else { Some(0) });
        station = place.station();
        let again = Instant::now();
        terminal.wait_gone("STATION LOST");
        println!("attached, station started again: back after {} ms", again.elapsed().as_millis());
        terminal.keys("4");
        terminal.wait_for("FUJI");
        terminal.keys("1");
        terminal.wait_for("TK-2");
    }
    // Without its station it can be left as well.
    station.signal("KILL");
    terminal.wait_for("STATION LOST");
    let (code, took) = end(&mut terminal, Way::Key("q"));
    println!("attached, station gone, q: exit {code} after {} ms", took.as_millis());
    assert_eq!(code, 0);
    terminal.assert_restored();
}

/// The far end of the pseudo-terminal goes, as when a window is closed or the connection of SSH is cut.
#[test]
fn a_closed_window_ends_its_terminal_and_not_the_station() {
    if !have("socat", "socat") {
        return;
    }
    let place = Place::new();
    let mut station = place.station();
    for (name, args) in [("attached", ""), ("embedded", "demo")] {
        let screen = place.folder.path().join(name);
        let command = [env!("CARGO_BIN_EXE_sightglass"), args].join(" ");
        let command = format!("EXEC:{},pty,setsid,ctty,raw,echo=0", command.trim());
        let mut window = Process::start(
            Command::new("socat")
                .args([&format!("STDIN,ignoreeof!!OPEN:{},creat,append", screen.display()), &command])
                .env("TERM", "xterm-256color")
                .env("XDG_RUNTIME_DIR", if args.is_empty() { place.sockets.clone() } else { sockets() })
                .env("XDG_STATE_HOME", place.folder.path()),
        );
        until(&format!("{name}: it begins to draw"), || {
            std::fs::read(&screen).is_ok_and(|bytes| String::from_utf8_lossy(&bytes).contains("\x1b[?1049h"))
        });
        let child = child_of(window.child.id());
        window.signal("KILL");
        let started = Instant::now();
        until(&format!("{name}: process {child} ends"), || !is_alive(&child));
        println!("{name}, window closed: ended after {} ms", started.elapsed().as_millis());
        window.end();
    }
    assert!(place.run(&["status"]).status.success());
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

fn child_of(process: u32) -> String {
    let tasks = format!("/proc/{process}/task/{process}/children");
    let children = std::fs::read_to_string(tasks).unwrap();
    children.split_whitespace().next().expect("socat runs it").to_owned()
}

/// A process that has ended stays in the list until its parent reaps it; others may not.
fn is_alive(process: &str) -> bool {
    let stat = std::fs::read_to_string(Path::new("/proc").join(process).join("stat"));
    stat.is_ok_and(|stat| !stat.rsplit(')').next().is_some_and(|rest| rest.trim_start().starts_with('Z')))
}

/// Polls, because a process is only notified of the end of its own children.
fn until(what: &str, so: impl Fn() -> bool) {
    let end = Instant::now() + TIMEOUT;
    while !so() {
        assert!(Instant::now() < end, "never: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
