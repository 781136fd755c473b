//! A station on the line of another master, beside a master and a slave that we did not write: it only listens.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};

use serde_json::Value;
use sightglass::access::io::own_user;

use crate::{
    listen::{Tapped, access},
    support::{Process, folder, have, python, sightglass, sockets},
};

/// The status is asked for so often: each takes some time, and it is enough for a line to fall silent on a busy machine.
const LOOKS_MAX: usize = 3_000;

/// A station of a plant file, and the folder of its socket.
struct Station {
    folder: PathBuf,
    sockets: PathBuf,
    process: Process,
}

impl Station {
    fn start(folder: &Path) -> Station {
        let sockets = sockets();
        let process = Process::start(Station::command(folder, &sockets).args(["run", "heard.toml", "--log", "-"]));
        let mut station = Station { folder: folder.to_owned(), sockets, process };
        station.process.wait_for("line L1: listening");
        station
    }

    fn command(folder: &Path, sockets: &Path) -> Command {
        let mut command = sightglass();
        command.current_dir(folder).env("XDG_RUNTIME_DIR", sockets).env("XDG_STATE_HOME", folder.join("state"));
        command
    }

    fn call(&self, args: &[&str]) -> Output {
        Station::command(&self.folder, &self.sockets).args(args).output().unwrap()
    }

    /// Asks for the status until it is `so`; gives it.
    fn until(&self, what: &str, so: impl Fn(&Value) -> bool) -> Value {
        let mut status = Value::Null;
        for _ in 0..LOOKS_MAX {
            status = serde_json::from_slice(&self.call(&["status", "--json"]).stdout).unwrap_or_default();
            if so(&status) {
                return status;
            }
        }
        panic!("{what}: never so, but\n{status:#}")
    }
}

fn tag<'a>(status: &'a Value, name: &str) -> &'a Value {
    let tags = status["tags"].as_array().into_iter().flatten();
    tags.into_iter().find(|tag| tag["name"] == name).unwrap_or(&Value::Null)
}

fn is_good(status: &Value, name: &str, value: f64) -> bool {
    tag(status, name)["value"] == value && tag(status, name)["quality"] == "good"
}

/// mbpoll, which asks for the same again and again until it is dropped.
struct Master {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Master {
    fn start(place: &str) -> Master {
        let (stop, place) = (Arc::new(AtomicBool::new(false)), place.to_owned());
        let stopped = stop.clone();
        let asks = [
            ["-t", "3", "-r", "1000", "-c", "4"],
            ["-t", "4", "-r", "1019", "-c", "1"],
            ["-t", "4", "-r", "1002", "-c", "1"],
        ];
        let thread = std::thread::spawn(move || {
            for ask in asks.iter().cycle() {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                mbpoll(&place, ask);
            }
        });
        Master { stop, thread: Some(thread) }
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn mbpoll(place: &str, args: &[&str]) -> bool {
    let common = ["-m", "rtu", "-b", "9600", "-P", "none", "-0", "-1", "-o", "0.5", "-a", "1"];
    Command::new("mbpoll").args(common).args(args).arg(place).output().unwrap().status.success()
}

fn write_plant(folder: &Path, port: &Path) {
    let text = format!(
        "title = \"Heard\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L1\"\nmode = \"listen\"\nport = \"{}\"\n\
         baud = 9600\nparity = \"N\"\n\
         [[device]]\nname = \"TIC-1\"\nprofile = \"fuji_pxr\"\nline = \"L1\"\nunit = 1\n\
         [[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n",
        port.display(),
        own_user()
    );
    fs::write(folder.join("heard.toml"), text).unwrap();
}

#[test]
fn a_station_follows_the_line_of_mbpoll_and_sends_nothing() {
    let Some(python) = python().filter(|_| have("socat", "socat") && have("mbpoll", "mbpoll")) else { return };
    let folder = folder();
    let line = Tapped::new(folder.path(), &python);
    write_plant(folder.path(), &line.tap.ends[0]);
    let station = Station::start(folder.path());
    let access = access(station.process.child.id(), &line.tap.ends[0]);
    assert!(!access.is_empty() && access.iter().all(|mode| *mode == 0), "it is opened for reading only: {access:?}");
    let place = line.master.ends[0].to_str().unwrap();
    let polls = Master::start(place);
    // What pymodbus holds: 700 with one decimal, which the master reads too.
    station.until("values as in the slave", |status| {
        is_good(status, "TIC-1.PV", 70.0) && is_good(status, "TIC-1.SV", 70.0)
    });
    let status = station.until("its counters", |status| status["lines"][0]["ok"].as_u64() > Some(9));
    assert_eq!(status["lines"][0]["state"], "listening", "{status:#}");

    // Nothing is written here: another master polls.
    let refused = station.call(&["write", "TIC-1.SV", "65"]);
    let said = String::from_utf8_lossy(&[refused.stdout, refused.stderr].concat()).into_owned();
    assert!(!refused.status.success() && said.contains("this line only listens: another master polls it"), "{said}");

    // What the other master writes is seen when it reads it.
    drop(polls);
    assert!(mbpoll(place, &["-t", "4", "-r", "1002", "655"]));
    let polls = Master::start(place);
    station.until("the setpoint of the other master", |status| is_good(status, "TIC-1.SV", 65.5));

    drop(polls);
    let status = station.until("a silent line", |status| status["lines"][0]["state"] == "no traffic heard");
    assert_ne!(tag(&status, "TIC-1.PV")["quality"], "good", "{status:#}");
    station.until("its alarm", |status| status["alarms"].to_string().contains("no traffic heard"));
    station.until("no value", |status| tag(status, "TIC-1.PV")["value"].is_null());

    let _polls = Master::start(place);
    let status = station.until("values again", |status| is_good(status, "TIC-1.PV", 70.0));
    assert_eq!(status["lines"][0]["state"], "listening");
    drop(station);
    let station = Station::start(folder.path());
    station.until("values after a restart", |status| is_good(status, "TIC-1.PV", 70.0));
    assert!(line.sent.try_recv().is_err(), "it has sent something");
}
