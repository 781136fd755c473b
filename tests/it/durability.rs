//! Killed, unplugged, locked, damaged.

use sightglass::history::io::store::Store;

use crate::support::{Cable, Process, folder, have, sightglass};

/// Every row whose commit was acknowledged is there after kill -9, and the program starts again, twenty times over.
#[test]
fn killed_twenty_times_while_writing() {
    let folder = folder();
    let history = folder.path().join("demo.duckdb");
    let mut least = 0;
    for round in 0..20 {
        let mut demo = Process::start(
            sightglass()
                .args(["demo", "--headless", "--for", "10h", "--speed", "60", "--log", "-", "--history"])
                .arg(&history),
        );
        // Another moment of the write cycle each time: after the second, third … commit, at once.
        for _ in 0..2 + round % 3 {
            let line = demo.wait_for("committed");
            least = number(&line, "total=");
        }
        demo.signal("KILL");
        assert_eq!(demo.end(), None);
        for line in demo.said.iter().filter(|line| line.contains("committed")) {
            least = least.max(number(line, "total="));
        }
        let store = Store::open_read_only(&history).unwrap();
        let rows = store.count_rows().unwrap();
        assert!(least <= rows, "round {round}: {least} rows were acknowledged, {rows} are there");
    }
}

fn number(line: &str, name: &str) -> u64 {
    let rest = line.split(name).nth(1).unwrap_or_else(|| panic!("no {name} in {line}"));
    rest.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap()
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
