//! Killed, unplugged, locked, damaged.

use std::path::{Path, PathBuf};

use jiff::Timestamp;
use sightglass::api::{
    history::{HistoryError, Store},
    plant::{AlarmEvent, StationFault},
    profile::{self, Search},
};

use crate::support::{Cable, Process, SmallDisk, folder, have, sightglass, simulated_tank};

/// Every row whose commit was acknowledged is there after kill -9, and the program starts again, twenty times over.
#[test]
fn killed_twenty_times_while_writing() {
    let folder = folder();
    let history = folder.path().join("demo.duckdb");
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let rows = || match Store::open_read_only(&history, &def) {
        Ok(store) => store.count_rows().unwrap(),
        Err(HistoryError::Missing { .. }) => 0,
        Err(error) => panic!("{error}"),
    };
    for round in 0..20 {
        let before = rows();
        let mut demo = Process::start(
            sightglass()
                .args(["demo", "--headless", "--for", "10h", "--speed", "60", "--log", "-", "--history"])
                .arg(&history),
        );
        // Another moment of the write cycle each time: after the first, second or third commit, at once.
        for _ in 0..1 + round % 3 {
            demo.wait_for("committed");
        }
        demo.signal("KILL");
        assert_eq!(demo.end(), None);
        let acknowledged = demo.said.iter().filter_map(|line| number(line, "total=")).max().unwrap();
        let after = rows();
        assert!(
            0 < acknowledged && before + acknowledged <= after,
            "round {round}: {before} + {acknowledged} > {after}"
        );
    }
}

fn number(line: &str, name: &str) -> Option<u64> {
    line.split(name).nth(1)?.chars().take_while(char::is_ascii_digit).collect::<String>().parse().ok()
}
/// Another file, named by mistake, is refused and stays as it is.
#[test]
fn a_file_that_is_no_history_is_left_alone() {
    let folder = folder();
    let file = folder.path().join("tank.toml");
    std::fs::write(&file, "title = \"mine\"\n").unwrap();
    let mut demo = Process::start(sightglass().args(["demo", "--headless", "--for", "1s", "--history"]).arg(&file));
    assert_eq!(demo.end(), Some(2));
    assert!(demo.said.iter().any(|line| line.contains("is not a history")), "{:?}", demo.said);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "title = \"mine\"\n");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was set aside");
}

/// The cable is pulled and plugged again: values go bad at once and come back by themselves.
#[test]
fn an_unplugged_port_comes_back() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let link = folder.path().join("ttyA");
    let start_sim = || {
        let mut sim = Process::start(sightglass().args(["sim", "tank", "--link"]).arg(&link));
        sim.wait_for("serves");
        sim
    };
    let mut sim = start_sim();
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--port", &format!("L1={}", link.display()), "--history"])
            .arg(folder.path().join("tank.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    station.wait_for("TIC-1 (unit 1): responding");
    for _ in 0..3 {
        sim.signal("KILL");
        sim.end();
        station.wait_for("not connected");
        sim = start_sim();
        station.wait_for("connected");
        station.wait_for("TIC-1 (unit 1): responding");
    }
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
}

/// A cable whose far end is dead: the devices are reported as not responding, the line is not.
#[test]
fn a_mute_line_is_not_a_missing_one() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--port", &format!("L1={}", cable.ends[0].display()), "--history"])
            .arg(folder.path().join("tank.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    station.wait_for("line L1: connected");
    station.wait_for("TIC-1 (unit 1): not responding");
    station.wait_for("RAISED: TIC-1");
    station.signal("INT");
    assert_eq!(station.end(), Some(0));
}

/// What stands in the way of a station whose files all lie on one small disk.
struct Outage {
    begin: fn(&SmallDisk),
    end: fn(&SmallDisk),
    /// What the operator reads of it.
    words: &'static str,
    /// The alarms that it raises.
    faults: &'static [StationFault],
}

const FULL: Outage = Outage {
    begin: SmallDisk::fill,
    end: SmallDisk::free,
    words: "history: the disk is full",
    faults: &[StationFault::NotRecording, StationFault::DiskSpace],
};
const PROTECTED: Outage = Outage {
    begin: SmallDisk::protect,
    end: SmallDisk::unprotect,
    words: "history: the disk is read-only",
    faults: &[StationFault::NotRecording],
};

/// A station, with its log beside its history as it is installed, or on standard error.
fn station_on(disk: &SmallDisk, port: &str, log: &[&str]) -> Process {
    let port = format!("L1={port}");
    Process::start(sightglass().args(["run", "tank", "--port", &port]).args(log).env("XDG_STATE_HOME", disk.path()))
}

/// While the outage lasts: its alarms are raised, the line is polled, and the loss of a device is alarmed. Then it ends, and
/// all that waited is stored. Returns when it ended, and the devices that answer now.
fn survive(station: &mut Process, sim: Process, port: &str, disk: &SmallDisk, outage: &Outage) -> (Timestamp, Process) {
    station.expect(outage.words);
    outage.faults.iter().for_each(|fault| station.expect(&format!("RAISED: station {}", fault.word())));
    station.expect("TIC-1 (unit 1): responding");
    drop(sim);
    station.wait_for("line L1: not connected");
    station.wait_for("RAISED: TIC-1 not responding");
    let mut sim = Process::start(sightglass().args(["sim", "tank", "--tcp", port]));
    sim.wait_for(" on 127.0.0.1:");
    station.wait_for("TIC-1 (unit 1): responding");
    let ended = Timestamp::now();
    (outage.end)(disk);
    station.wait_for("history: recovered");
    let lost: Vec<&String> = station.said.iter().filter(|line| line.contains("lost")).collect();
    assert!(lost.is_empty(), "{lost:?}");
    (ended, sim)
}

/// What was recorded between two instants: samples, raised alarms of the station, and rows that are there twice.
fn recorded(disk: &SmallDisk, from: Timestamp, to: Timestamp) -> (u64, u64, u64) {
    let db = duckdb::Connection::open(history_on(disk)).unwrap();
    let within =
        format!("utc BETWEEN make_timestamp({}) AND make_timestamp({})", from.as_microsecond(), to.as_microsecond());
    let count = |sql: &str| db.query_row(sql, [], |row| row.get(0)).unwrap();
    let (raised, station) = (AlarmEvent::Raised.word(), StationFault::NotRecording.word());
    let samples = count(&format!("SELECT count(*) FROM sample WHERE {within}"));
    let steps = count(&format!(
        "SELECT count(*) FROM alarm_journal WHERE {within} AND event = '{raised}' AND message = '{station}'"
    ));
    let twice = count(
        "SELECT (SELECT count(*) - count(DISTINCT (utc, tag, value, quality)) FROM sample)
              + (SELECT count(*) - count(DISTINCT (utc, subject, message, event)) FROM alarm_journal)
              + (SELECT count(number) - count(DISTINCT number) FROM operator_action)",
    );
    (samples, steps, twice)
}

fn history_on(disk: &SmallDisk) -> PathBuf {
    disk.path().join("sightglass/tank.duckdb")
}

/// The disk takes nothing when the station starts, and is mended while it runs.
fn check_an_outage_at_the_start(outage: &Outage) {
    let Some(disk) = SmallDisk::mount() else { return };
    (outage.begin)(&disk);
    let (sim, port) = simulated_tank();
    let began = Timestamp::now();
    let mut station = station_on(&disk, &port, &[]);
    let (ended, _sim) = survive(&mut station, sim, &port, &disk, outage);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
    let (samples, steps, twice) = recorded(&disk, began, ended);
    assert!(0 < samples && steps == 1 && twice == 0, "{samples} samples, {steps} alarms, {twice} rows twice");
    let mut verify = sightglass();
    verify.args(["audit", "verify", "tank"]).env("XDG_STATE_HOME", disk.path());
    let verified = verify.output().unwrap();
    assert!(verified.status.success(), "{verified:?}");
}

/// The same for a station that has recorded before, and is killed after. A disk that is read-only is noticed with the first
/// checkpoint, some seconds after the start: until then what is open is written.
fn check_an_outage_in_the_middle(outage: &Outage) {
    let Some(disk) = SmallDisk::mount() else { return };
    let (sim, port) = simulated_tank();
    let mut station = station_on(&disk, &port, &["--log", "-"]);
    station.wait_for("committed");
    (outage.begin)(&disk);
    let began = Timestamp::now();
    let (ended, _sim) = survive(&mut station, sim, &port, &disk, outage);
    station.wait_for("committed");
    station.signal("KILL");
    assert_eq!(station.end(), None);
    let (samples, steps, twice) = recorded(&disk, began, ended);
    assert!(0 < samples && steps == 1 && twice == 0, "{samples} samples, {steps} alarms, {twice} rows twice");
    let committed = station.said.iter().filter_map(|line| number(line, "total=")).max().unwrap();
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let rows = Store::open_read_only(&history_on(&disk), &def).unwrap().count_rows().unwrap();
    assert!(committed <= rows, "{committed} rows were said to be committed, {rows} are there");
}

#[test]
fn a_disk_that_is_full_at_the_start_costs_no_record() {
    check_an_outage_at_the_start(&FULL);
}

#[test]
fn a_disk_that_fills_up_costs_no_record() {
    check_an_outage_in_the_middle(&FULL);
}

#[test]
fn a_disk_that_is_read_only_at_the_start_costs_no_record() {
    check_an_outage_at_the_start(&PROTECTED);
}

#[test]
fn a_disk_that_becomes_read_only_costs_no_record() {
    check_an_outage_in_the_middle(&PROTECTED);
}

/// A station under a limit of the shell, from its first answer to SIGTERM: its exit code.
fn end_of_limited(limit: &str) -> Option<i32> {
    let (state, sockets) = (folder(), crate::support::sockets());
    let (_devices, port) = simulated_tank();
    let program = sightglass();
    let run = format!("ulimit {limit}; exec {} run tank --port L1={port} --log -", program.get_program().display());
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", &run]).env("XDG_STATE_HOME", state.path()).env("XDG_RUNTIME_DIR", &sockets);
    let mut station = Process::start(shell.env_remove("STATE_DIRECTORY"));
    station.wait_for("(unit 2): responding");
    station.signal("TERM");
    let files = std::fs::read_dir(state.path().join("sightglass")).unwrap().flatten();
    let aside = files.filter(|file| file.file_name().to_string_lossy().contains("damaged")).count();
    assert_eq!(aside, 0, "{limit}");
    station.end()
}

#[test]
fn without_descriptors_or_memory_polling_goes_on() {
    // Descriptors, then address space in KiB.
    for limit in ["-n 24", "-n 20", "-n 18", "-v 450000"] {
        assert_eq!(end_of_limited(limit), Some(0), "{limit}");
    }
}
