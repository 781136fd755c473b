//! Our master against slaves that we did not write.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::support::{Cable, Process, folder, free_port, have, libmodbus_server, python, sightglass};

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

/// Runs the station headless for a while and gives what it says, with what it prints of each tag at the end.
fn station(plant: &str, port: &str, time: &str) -> Vec<String> {
    let folder = folder();
    let mut station = Process::start(
        sightglass()
            .args(["run", plant, "--print", "--for", time, "--port", &format!("L1={port}")])
            .arg("--history")
            .arg(folder.path().join("history.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
    std::mem::take(&mut station.said)
}

/// `value unit quality` of a tag, as the station printed it.
fn printed(said: &[String], tag: &str) -> String {
    let line = said.iter().find(|line| line.split_whitespace().next() == Some(tag));
    let line = line.unwrap_or_else(|| panic!("no {tag} in:\n{}", said.join("\n")));
    line.split_whitespace().skip(1).collect::<Vec<_>>().join(" ")
}

fn plant(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(name)
}

/// A plant file of ours with its line in another mode, in this folder.
fn in_mode(plant: &Path, mode: &str, folder: &Path) -> PathBuf {
    let text = fs::read_to_string(plant).unwrap();
    let (before, after) = text.split_once("[[line]]").unwrap();
    let after = after.split_once("\n\n").unwrap().1;
    let ends = match mode {
        "rtu" | "ascii" => "port = \"/dev/null\"\nbaud = 9600\nparity = \"N\"",
        _ => "host = \"localhost\"",
    };
    let line = format!("[[line]]\nname = \"L1\"\nmode = \"{mode}\"\ntimeout_ms = 300\n{ends}");
    let file = folder.join("plant.toml");
    fs::write(&file, format!("{before}{line}\n\n{after}")).unwrap();
    fs::copy(plant.with_file_name("number.toml"), folder.join("number.toml")).unwrap();
    file
}

/// Runs the station until it has read everything, and compares what it prints.
fn read_all_from(port: &str) {
    let said = station("tank", port, "12s");
    for (tag, value) in SEEN {
        let seen = printed(&said, tag);
        assert!(seen.starts_with(&format!("{value} good")), "{tag}: {seen}, expected {value}");
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

/// One unit for each way to answer wrongly, and one that is well, on one line.
#[test]
fn a_faulty_answer_is_never_shown_as_a_value() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "rtu", cable.ends[1].to_str().unwrap());
    let said = read_faults("rtu", cable.ends[0].to_str().unwrap());
    for (tag, expect) in [
        ("WELL.N", "10 good"),
        ("SPOILED.N", "---- bad: device not answering"),
        ("SILENT.N", "---- bad: device not answering"),
        ("NOISY.N", "510 good"),
        ("CUT.N", "---- bad: device not answering"),
    ] {
        assert!(printed(&said, tag).starts_with(expect), "{tag}: {}", printed(&said, tag));
    }
    for (unit, why) in
        [("LATE", "no answer in time"), ("SPOILED", "CRC error"), ("SILENT", "no answer in time"), ("CUT", "cut short")]
    {
        assert!(said.iter().any(|line| line.contains(unit) && line.contains(why)), "{unit} {why}: {}", said.join("\n"));
    }
}

#[test]
fn a_faulty_answer_over_tcp_is_never_shown_as_a_value() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    let said = read_faults("tcp", &format!("127.0.0.1:{port}"));
    println!("{}", said.join("\n"));
    assert!(printed(&said, "SPOILED.N").starts_with("---- bad"), "{}", said.join("\n"));
    assert!(printed(&said, "SILENT.N").starts_with("---- bad"), "{}", said.join("\n"));
}

/// Lets the station poll the units 3 to 8 of the slave. Every register there holds its address: no tag may ever be shown with
/// another number, whatever came and when.
fn read_faults(mode: &str, port: &str) -> Vec<String> {
    let folder = folder();
    let said = station(in_mode(&plant("faults.toml"), mode, folder.path()).to_str().unwrap(), port, "15s");
    for (tag, address) in
        [("WELL", "10"), ("LATE", "210"), ("SPOILED", "310"), ("SILENT", "410"), ("NOISY", "510"), ("CUT", "610")]
    {
        let seen = printed(&said, &format!("{tag}.N"));
        let value = seen.split(' ').next().unwrap();
        assert!(value == address || value == "----", "{tag}: {seen}");
    }
    said
}

/// The fixed values of its unit-test.h, and the deliberate faults of its unit-test-server.c.
#[test]
fn the_station_reads_the_server_of_libmodbus() {
    let Some(_server) = libmodbus_server() else { return };
    let said = station(plant("libmodbus.toml").to_str().unwrap(), "127.0.0.1:1502", "10s");
    // UT_INPUT_BITS_TAB begins AC DB, the lowest bit first.
    for (bit, expect) in [0, 0, 1, 1, 0, 1, 0, 1, 1, 1].into_iter().enumerate() {
        let seen = printed(&said, &format!("UT.BIT{bit}"));
        assert!(seen.starts_with(&format!("{expect} good")), "bit {bit}: {seen}");
    }
    for (tag, expect) in [
        ("INPUT", "10 good"),
        ("COIL", "0 good"),
        ("REGISTER", "0 good"),
        ("LATE", "0 good"),
        ("SHORT", "---- bad"),
        ("BUSY", "---- bad"),
        ("NOWHERE", "---- bad: refused by the device"),
    ] {
        let seen = printed(&said, &format!("UT.{tag}"));
        assert!(seen.starts_with(expect), "{tag}: {seen}");
    }
}
