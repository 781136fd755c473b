//! Killed, unplugged, locked, damaged.

use std::path::Path;

use sightglass::{
    history::{HistoryError, io::store::Store},
    profile::{self, Search},
};

use crate::support::{Cable, Process, folder, have, sightglass};

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
/// Somebody's other file, named by mistake, is refused and stays as it is.
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
    station.wait_for("TIC-1 (unit 1): answers");
    for _ in 0..3 {
        sim.signal("KILL");
        sim.end();
        station.wait_for("not connected");
        sim = start_sim();
        station.wait_for("connected");
        station.wait_for("TIC-1 (unit 1): answers");
    }
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
}

/// A cable whose far end is dead: the devices are told to be silent, the line is not.
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
    station.wait_for("TIC-1 (unit 1): not answering");
    station.wait_for("RAISED: TIC-1");
    station.signal("INT");
    assert_eq!(station.end(), Some(0));
}
