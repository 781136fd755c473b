//! A station on the line of another master, beside a master and a slave that we did not write: it only listens.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};

use sightglass::api::{
    access::own_user,
    attach::connect,
    plant::{LineState, Snapshot},
    station::Session,
};

use crate::{
    guarded,
    listen::{Tapped, access},
    support::{Process, folder, have, python, sightglass, sockets},
};

/// A station of a plant file, and a terminal at its socket.
struct Station {
    folder: PathBuf,
    sockets: PathBuf,
    process: Process,
    session: Session,
}

impl Station {
    async fn start(folder: &Path) -> Station {
        let sockets = sockets();
        let mut process = Process::start(command(folder, &sockets).args(["run", "heard.toml", "--log", "-"]));
        process.wait_for("line L1: listening");
        let session = connect(&sockets.join("sightglass/heard.sock")).await.unwrap();
        Station { folder: folder.to_owned(), sockets, process, session }
    }

    /// What a command says, and whether it was done.
    fn call(&self, args: &[&str]) -> (bool, String) {
        let output = command(&self.folder, &self.sockets).args(args).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8_lossy(&said).into_owned())
    }

    async fn until(&mut self, what: &str, so: impl Fn(&Snapshot) -> bool) -> Arc<Snapshot> {
        guarded::until(&mut self.session.snapshots, what, |snapshot| so(snapshot)).await
    }
}

fn command(folder: &Path, sockets: &Path) -> Command {
    let mut command = sightglass();
    command.current_dir(folder).env("XDG_RUNTIME_DIR", sockets).env("XDG_STATE_HOME", folder.join("state"));
    command
}

fn value(snapshot: &Snapshot, tag: &str) -> Option<f64> {
    snapshot.sample(snapshot.def.tag_named(tag).unwrap()).good_value()
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
        // No two of one length: values are certain from the second time on, however loaded the computer is.
        let asks = [
            ["-t", "3", "-r", "1000", "-c", "10"],
            ["-t", "4", "-r", "1019", "-c", "1"],
            ["-t", "4", "-r", "1002", "-c", "2"],
        ];
        let thread = std::thread::spawn(move || {
            for ask in asks.iter().cycle() {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                mbpoll(&place, ask, &[]);
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

fn mbpoll(place: &str, args: &[&str], written: &[&str]) -> bool {
    let common = ["-m", "rtu", "-b", "9600", "-P", "none", "-0", "-1", "-o", "0.5", "-a", "1"];
    Command::new("mbpoll").args(common).args(args).arg(place).args(written).output().unwrap().status.success()
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

#[tokio::test]
async fn a_station_follows_the_line_of_mbpoll_and_sends_nothing() {
    let Some(python) = python().filter(|_| have("socat", "socat") && have("mbpoll", "mbpoll")) else { return };
    let folder = folder();
    let line = Tapped::new(folder.path(), &python);
    write_plant(folder.path(), &line.tap.ends[0]);
    let mut station = Station::start(folder.path()).await;
    let access = access(station.process.child.id(), &line.tap.ends[0]);
    assert!(!access.is_empty() && access.iter().all(|mode| *mode == 0), "it is opened for reading only: {access:?}");
    let place = line.master.ends[0].to_str().unwrap();
    let polls = Master::start(place);
    // What pymodbus holds: 700 with one decimal, which the master reads too.
    let as_held = |now: &Snapshot| value(now, "TIC-1.PV") == Some(70.0) && value(now, "TIC-1.SV") == Some(70.0);
    station.until("values as in the slave", as_held).await;
    let now = station.until("its counters", |now| 9 < now.lines[0].counters.ok).await;
    assert_eq!((&now.lines[0].state, now.lines[0].counters.sent_bytes), (&LineState::Connected, 0));

    // Nothing is written here: another master polls.
    let (done, said) = station.call(&["write", "TIC-1.SV", "65"]);
    assert!(!done && said.contains("this line only listens: another master polls it"), "{said}");
    let (_, said) = station.call(&["status"]);
    assert!(said.contains("L1           listening; load") && said.contains(" pairs, "), "{said}");

    // What the other master writes is seen when it reads it.
    drop(polls);
    assert!(mbpoll(place, &["-t", "4", "-r", "1002"], &["655"]));
    let polls = Master::start(place);
    station.until("the setpoint of the other master", |now| value(now, "TIC-1.SV") == Some(65.5)).await;

    drop(polls);
    let now = station.until("a silent line", |now| now.lines[0].state == LineState::NoTraffic).await;
    assert_eq!(value(&now, "TIC-1.PV"), None, "it still stands as good");
    let raised =
        |now: &Snapshot| now.alarms.iter().any(|alarm| &*now.def.alarm(alarm.id).message == "no traffic heard");
    station.until("its alarm", raised).await;
    let pv = now.def.tag_named("TIC-1.PV").unwrap();
    station.until("no value", |now| now.sample(pv).value.is_none()).await;

    let _polls = Master::start(place);
    let now = station.until("values again", |now| value(now, "TIC-1.PV") == Some(70.0)).await;
    assert_eq!(now.lines[0].state, LineState::Connected);
    drop(station);
    let mut station = Station::start(folder.path()).await;
    station.until("values after a restart", |now| value(now, "TIC-1.PV") == Some(70.0)).await;
    assert!(line.sent.try_recv().is_err(), "it has sent something");
}
