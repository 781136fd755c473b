//! Against programs that we did not write.

use std::{
    fs::OpenOptions,
    io::{Read, Write},
    path::Path,
    process::{Command, Output},
};

use crate::support::{Cable, Process, folder, free_port, have, python, sightglass};

/// What the slave of `peers/slave.py` holds, as an operator should see it.
const SEEN: [(&str, &str); 8] = [
    ("TIC-1.PV", "-1.5 °C"),
    ("TIC-1.SV", "70.0 °C"),
    ("TIC-1.MV", "12.34 %"),
    ("TIC-1.P", "5.0 % FS"),
    ("TIC-1.I", "240.0 s"),
    ("PLC-1.STEP", "HEAT"),
    ("PLC-1.LT-1", "10.2 cm"),
    ("PLC-1.RUN", "RUN"),
];

fn slave(python: &Path, kind: &str, place: &str) -> Process {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/slave.py");
    let mut slave = Process::start(Command::new(python).arg(script).args([kind, place]));
    slave.wait_for("ready");
    slave
}

/// Runs the station headless on a port until it has read everything, and compares what it prints.
fn read_all_from(port: &str) {
    let folder = folder();
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--print", "--for", "12s", "--port", &format!("L1={port}")])
            .arg("--history")
            .arg(folder.path().join("tank.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
    for (tag, value) in SEEN {
        let line = station.said.iter().find(|line| line.split_whitespace().next() == Some(tag));
        let line = line.unwrap_or_else(|| panic!("no {tag} in:\n{}", station.said.join("\n")));
        let words: Vec<&str> = line.split_whitespace().skip(1).collect();
        assert!(words.join(" ").starts_with(&format!("{value} good")), "{line}, expected {value}");
    }
}

#[test]
fn the_station_reads_pymodbus_over_a_serial_line() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "rtu", cable.ends[1].to_str().unwrap());
    read_all_from(cable.ends[0].to_str().unwrap());
}

#[test]
fn the_station_reads_pymodbus_over_tcp() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    read_all_from(&format!("127.0.0.1:{port}"));
}

fn sim(args: &[&str], said: &str) -> (Process, String) {
    let mut sim = Process::start(sightglass().args(["sim", "tank"]).args(args));
    let line = sim.wait_for(said);
    let place = line.rsplit(' ').next().unwrap().to_owned();
    (sim, place)
}

fn mbpoll(args: &[&str]) -> (bool, String) {
    let Output { status, stdout, stderr } = Command::new("mbpoll").args(args).output().unwrap();
    (status.success(), String::from_utf8_lossy(&stdout).into_owned() + &String::from_utf8_lossy(&stderr))
}

#[test]
fn mbpoll_reads_and_writes_the_simulated_plant_over_a_serial_line() {
    if !have("mbpoll", "mbpoll") {
        return;
    }
    let (_sim, path) = sim(&[], "serves");
    let rtu = ["-m", "rtu", "-b", "9600", "-P", "none", "-0", "-1"];
    let call = |args: &[&str]| mbpoll(&[&rtu[..], args].concat());
    // SV in tenths of a degree, then written and read back; Y0 to Y3; an address that does not exist.
    let (ok, out) = call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "1", &path]);
    assert!(ok && out.contains("[1002]: \t700"), "{out}");
    let (ok, out) = call(&["-a", "1", "-t", "4", "-r", "1002", &path, "655"]);
    assert!(ok && out.contains("Written 1 references"), "{out}");
    let (ok, out) = call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "1", &path]);
    assert!(ok && out.contains("[1002]: \t655"), "{out}");
    let (ok, out) = call(&["-a", "2", "-t", "0", "-r", "2048", "-c", "4", &path]);
    assert!(ok && out.contains("[2048]:") && out.contains("[2051]:"), "{out}");
    let (ok, out) = call(&["-a", "1", "-t", "4", "-r", "9000", "-c", "1", &path]);
    assert!(!ok && out.to_lowercase().contains("illegal data address"), "{out}");
}

#[test]
fn mbpoll_reads_the_simulated_plant_over_tcp() {
    if !have("mbpoll", "mbpoll") {
        return;
    }
    let (_sim, place) = sim(&["--tcp", "127.0.0.1:0"], "serves");
    let port = place.rsplit(':').next().unwrap();
    let (ok, out) =
        mbpoll(&["-m", "tcp", "-p", port, "-a", "1", "-0", "-1", "-t", "4", "-r", "1002", "-c", "1", "127.0.0.1"]);
    assert!(ok && out.contains("[1002]: \t700"), "{out}");
}

/// The two exchanges recorded on the real devices, byte for byte.
#[test]
fn the_recorded_exchanges_of_the_thesis() {
    let (_sim, path) = sim(&[], "serves");
    let mut port = OpenOptions::new().read(true).write(true).open(path).unwrap();
    for frame in [[0x01, 0x06, 0x03, 0xEA, 0x00, 0x32, 0x29, 0xAF], [0x02, 0x06, 0x41, 0x40, 0xFF, 0xFF, 0x9D, 0xA1]] {
        port.write_all(&frame).unwrap();
        let mut answer = [0; 8];
        port.read_exact(&mut answer).unwrap();
        assert_eq!(answer, frame);
    }
}
