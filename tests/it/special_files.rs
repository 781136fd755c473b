//! Pipes and devices where the station expects files, and files of its user that are none of samples: nothing waits for them,
//! and nothing of them is shown.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use sightglass::api::{access::SessionRequest, attach::connect};

use crate::support::{Process, folder, sightglass, simulated_tank, sockets};

struct Home {
    folder: tempfile::TempDir,
    sockets: PathBuf,
    port: String,
    _devices: Process,
}

impl Home {
    fn new() -> Home {
        let (devices, port) = simulated_tank();
        Home { folder: folder(), sockets: sockets(), port: format!("L1={port}"), _devices: devices }
    }

    fn command(&self) -> Command {
        let mut command = sightglass();
        command.env("XDG_STATE_HOME", self.folder.path()).env("XDG_RUNTIME_DIR", &self.sockets);
        command.env_remove("STATE_DIRECTORY");
        command
    }

    fn station(&self) -> Process {
        let mut station = Process::start(self.command().args(["run", "tank", "--port", &self.port]));
        station.wait_for("(unit 2): responding");
        station
    }

    fn own(&self, name: &str) -> PathBuf {
        self.folder.path().join("sightglass").join(name)
    }

    fn socket(&self) -> PathBuf {
        self.sockets.join("sightglass/tank.sock")
    }
}

fn pipe(path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

fn end(station: &mut Process) -> Option<i32> {
    station.signal("TERM");
    station.end()
}

#[test]
fn a_station_starts_and_ends_whatever_its_files_are() {
    let today = jiff::Timestamp::now().strftime("sightglass.%Y-%m-%d.log").to_string();
    let beside = ["tank.users.toml", "tank.alarms.state", "tank.audit.jsonl", "tank.audit.key", "tank.found.toml"];
    let of_history = ["tank.duckdb", "tank.duckdb.wal", "tank.duckdb.last", "tank.duckdb.opening", "tank.audit.head"];
    let home = Home::new();
    for name in beside.into_iter().chain(of_history).chain(["tank.archive/tag.parquet", &today]) {
        let path = home.own(name);
        fs::remove_file(&path).unwrap_or_default();
        pipe(&path);
        // It polls, answers and ends; what it lacks is said in its status.
        assert_eq!(end(&mut home.station()), Some(0), "{name}");
        fs::remove_file(&path).unwrap();
    }
    assert_eq!(end(&mut home.station()), Some(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_station_imports_nothing_but_what_lies_in_its_folder() {
    let home = Home::new();
    let mut station = home.station();
    let folder = home.own("tank.import");
    fs::create_dir(&folder).unwrap();
    let secret = "argon2id-secret-of-the-station";
    for name in ["secret", "tank.audit.key", "tank.users.toml"] {
        fs::write(home.own(name), format!("{secret},{secret}\n{secret}\n")).unwrap();
    }
    fs::write(folder.join("secret.csv"), format!("{secret}\n{secret}\n")).unwrap();
    std::os::unix::fs::symlink(home.own("secret"), folder.join("link.csv")).unwrap();
    pipe(&folder.join("pipe.csv"));
    fs::write(folder.join("day.csv"), "tag,time,value\nTIC-1.PV,2024-03-20T06:00:00Z,50\n").unwrap();
    let session = connect(&home.socket()).await.unwrap();
    let import = async |file: String| session.request(SessionRequest::Import { file }).await.map(drop);
    let own = |name: &str| home.own(name).display().to_string();
    for (file, expect) in [
        (own("secret"), "expected the name of a file in the import folder"),
        (own("tank.audit.key"), "expected the name of a file in the import folder"),
        ("../tank.users.toml".into(), "expected the name of a file in the import folder"),
        ("/etc/shadow".into(), "expected the name of a file in the import folder"),
        ("/dev/zero".into(), "expected the name of a file in the import folder"),
        ("secret.csv".into(), "line 1: column 1 is none of samples"),
        ("link.csv".into(), "link.csv: "),
        ("pipe.csv".into(), "not a regular file"),
        ("none.csv".into(), "No such file"),
    ] {
        let why = import(file.clone()).await.unwrap_err().to_string();
        assert!(why.contains(expect) && !why.contains(secret), "{file}: {why}");
    }
    assert_eq!(import("day.csv".into()).await, Ok(()));
    drop(session);
    let log = fs::read_to_string(home.own("tank.audit.jsonl")).unwrap();
    assert!(log.contains("import samples") && !log.contains(secret), "{log}");
    assert_eq!(end(&mut station), Some(0));
}
