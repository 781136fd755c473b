//! Backups as a person makes them: beside a station that records, and in its place.

use std::{fs, os::unix::fs::PermissionsExt, path::Path, process::Command};

use crate::support::{Process, folder, sightglass, simulated_tank, sockets};

/// A home for one station and the commands that speak to it.
struct Home {
    folder: tempfile::TempDir,
    sockets: std::path::PathBuf,
}

impl Home {
    fn command(&self) -> Command {
        let mut command = sightglass();
        command.env("XDG_STATE_HOME", self.folder.path()).env("XDG_RUNTIME_DIR", &self.sockets);
        command.env_remove("STATE_DIRECTORY");
        command
    }

    /// Exit code and all that is said.
    fn history(&self, action: &str, folder: &Path) -> (Option<i32>, String) {
        self.said(self.command().args(["history", action, "tank"]).arg(folder))
    }

    fn said(&self, command: &mut Command) -> (Option<i32>, String) {
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
    }
}

#[test]
fn a_file_is_imported_while_the_station_records() {
    let home = Home { folder: folder(), sockets: sockets() };
    let (_devices, port) = simulated_tank();
    let mut station = Process::start(home.command().args(["run", "tank", "--port", &format!("L1={port}")]));
    station.wait_for("(unit 2): responding");
    let file = home.folder.path().join("day.csv");
    let rows: String = (0..45_000).map(|n| format!("TIC-1.PV,{}Z,{}\n", second(n), n % 100)).collect();
    fs::write(&file, format!("tag,time,value\n{rows}TIC-9.PV,{}Z,1\n", second(0))).unwrap();
    let (code, said) = home.history("import", &file);
    let why = format!("{}: line 45002: found the tag `TIC-9.PV`", file.display());
    assert!(code == Some(2) && said.contains(&why) && said.contains("nothing is imported"), "{said}");
    fs::write(&file, format!("tag,time,value\n{rows}")).unwrap();
    // The user of the station may do so without a login, and look only with one.
    for _ in 0..2 {
        let (code, said) = home.history("import", &file);
        assert!(code == Some(0) && said.contains("imported those of 45000 rows"), "{said}");
    }
    let (code, said) = home.said(home.command().args(["stop", "tank"]));
    assert_eq!((code, station.end()), (Some(0), Some(0)), "{said}");
    let (code, said) = home.history("import", &file);
    assert!(code == Some(0) && said.contains("nothing to import: at each of 45000 rows"), "{said}");
    let (_, overview) = home.said(home.command().args(["history", "tank"]));
    assert!(overview.contains("day.csv"), "{overview}");
    let log = fs::read_to_string(home.folder.path().join("sightglass/tank.audit.jsonl")).unwrap();
    let expect = ["import samples", "permitted", "done: 45000 rows", "done: nothing: a value is stored already"];
    assert!(expect.iter().all(|words| log.contains(words)), "{log}");
}

/// A time on the morning of a day that has passed.
fn second(n: u32) -> String {
    format!("2024-03-20T{:02}:{:02}:{:02}", n / 3_600, n / 60 % 60, n % 60)
}

#[test]
fn a_backup_of_a_running_station_is_restored() {
    let home = Home { folder: folder(), sockets: sockets() };
    let (_devices, port) = simulated_tank();
    let line = format!("L1={port}");
    let mut station = Process::start(home.command().args(["run", "tank", "--port", &line]));
    station.wait_for("(unit 2): responding");
    let to = home.folder.path().join("backup");
    // What a person has lost with the disk, and what is there still.
    let own = |path: &str| home.folder.path().join("sightglass").join(path);
    let (users, set, other) = (own("tank.users.toml"), own("sets/tank/summer.toml"), own("sets/tank/winter.toml"));
    fs::create_dir_all(set.parent().unwrap()).unwrap();
    fs::write(&users, "# none yet\n").unwrap();
    fs::set_permissions(&users, fs::Permissions::from_mode(0o600)).unwrap();
    fs::write(&set, "# summer\n").unwrap();
    fs::write(&other, "# winter\n").unwrap();
    let (code, said) = home.history("backup", &to);
    assert!(code == Some(0) && said.starts_with("backed up to "), "{said}");
    let (code, said) = home.history("restore", &to);
    assert!(code == Some(3) && said.contains("in use by another process: stop its station first"), "{said}");
    let (code, said) = home.said(home.command().args(["history", "compact", "tank"]));
    assert!(code == Some(3) && said.contains("is in use by"), "{said}");
    let (code, said) = home.said(home.command().args(["stop", "tank"]));
    assert_eq!((code, station.end()), (Some(0), Some(0)), "{said}");
    fs::remove_file(&users).unwrap();
    fs::remove_file(&set).unwrap();
    fs::write(&other, "# changed since\n").unwrap();
    let (code, said) = home.history("restore", &to);
    assert!(code == Some(0) && said.contains("; the history before it is in "), "{said}");
    assert!(said.contains("users and parameter sets: 2 files restored, 1 there already and kept"), "{said}");
    let texts = [&users, &set, &other].map(|path| fs::read_to_string(path).unwrap());
    assert_eq!(texts, ["# none yet\n", "# summer\n", "# changed since\n"]);
    assert_eq!(fs::metadata(&users).unwrap().permissions().mode() & 0o777, 0o600);
    // The station goes on, and completes its history from the audit log.
    let mut station = Process::start(home.command().args(["run", "tank", "--port", &line, "--for", "3s"]));
    assert_eq!(station.end(), Some(0));
    let (code, said) = home.said(home.command().args(["audit", "verify", "tank"]));
    assert_eq!(code, Some(0), "{said}");
    let log = fs::read_to_string(home.folder.path().join("sightglass/tank.audit.jsonl")).unwrap();
    let outcomes = |action: &str| -> Vec<String> {
        let entries = log.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let of_action = entries.filter(|entry| entry["action"] == action);
        of_action.map(|entry| entry["outcome"].as_str().unwrap().split(':').next().unwrap().to_owned()).collect()
    };
    assert_eq!(outcomes("back up history"), ["permitted", "done"]);
    assert_eq!(outcomes("restore history"), ["begun", "done"]);
    let (_, said) = home.said(home.command().args(["history", "tank"]));
    assert!(said.contains("stored    "), "{said}");
}

#[test]
fn a_history_survives_kills_and_comes_back_when_set_aside() {
    let home = Home { folder: folder(), sockets: sockets() };
    let (_devices, port) = simulated_tank();
    let line = format!("L1={port}");
    let run = |time: &str| Process::start(home.command().args(["run", "tank", "--port", &line, "--for", time])).end();
    assert_eq!(run("3s"), Some(0));
    let db = home.folder.path().join("sightglass/tank.duckdb");
    let with = |suffix: &str| format!("{}{suffix}", db.display());
    let samples = || {
        let (code, said) = home.said(home.command().args(["sql", "tank", "SELECT count(*) FROM sample"]));
        assert_eq!(code, Some(0), "{said}");
        said.lines().nth(1).unwrap().trim().parse::<u64>().unwrap()
    };
    let first = samples();
    // As many kills as one likes.
    fs::write(with(".opening"), "7").unwrap();
    assert_eq!(run("2s"), Some(0));
    assert!(first <= samples() && !fs::exists(with(".opening")).unwrap());
    let entries = || fs::read_dir(db.parent().unwrap()).unwrap().flatten().map(|entry| entry.file_name());
    assert!(entries().all(|name| !name.to_string_lossy().contains("damaged")));
    // As an earlier version set it aside.
    let before = samples();
    fs::rename(&db, with(".damaged-20261127T120000Z")).unwrap();
    assert_eq!(run("2s"), Some(0));
    let since = samples();
    let restore = ["history", "restore", "tank", "--set-aside"];
    let (code, said) = home.said(home.command().args(restore));
    assert!(code == Some(0) && said.contains("with those recorded since"), "{said}");
    // One more for each curve that had not ended.
    assert!((before + since..=before + since + 200).contains(&samples()), "{before} + {since}: {}", samples());
    let (code, said) = home.said(home.command().args(restore));
    assert!(code == Some(1) && said.contains("nothing sound is set aside"), "{said}");
    assert_eq!(run("1s"), Some(0));
    let (code, said) = home.said(home.command().args(["audit", "verify", "tank"]));
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_full_disk_is_said_and_nothing_is_left_on_it() {
    let Some(disk) = crate::support::SmallDisk::mount() else { return };
    let home = folder();
    let path = home.path().join("tank.duckdb");
    let history = |command: &[&str]| {
        let mut words = sightglass();
        let output = words.arg("history").args(command).arg("--history").arg(&path).output().unwrap();
        (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
    };
    let rows: String = (0..2_000)
        .map(|n| format!("TIC-1.PV,2026-11-20T{:02}:{:02}:00Z,{n}\n", n / 60 % 24, n % 60))
        .take(1_440)
        .collect();
    let file = home.path().join("day.csv");
    fs::write(&file, format!("tag,time,value\n{rows}")).unwrap();
    let (code, said) = history(&["import", "tank", file.to_str().unwrap()]);
    assert!(code == Some(0) && said.contains("imported 1440 rows"), "{said}");
    disk.fill();
    let to = disk.path().join("backup");
    let (code, said) = history(&["backup", "tank", to.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains("MiB free, expected"), "{said}");
    assert!(!to.exists());
    disk.free();
    disk.protect();
    let (code, said) = history(&["backup", "tank", to.to_str().unwrap()]);
    disk.unprotect();
    assert!(code == Some(1) && said.contains("Read-only file system"), "{said}");
    assert!(!to.exists());
    let (code, said) = history(&["backup", "tank", to.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{said}");
}
