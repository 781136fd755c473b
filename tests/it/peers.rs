//! Our master against slaves that we did not write.

use std::{
    fs,
    io::{Read, Write},
    net::TcpListener,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;
use sightglass::api::access::own_user;

use crate::support::{Cable, Process, folder, free_port, have, libmodbus_server, python, sightglass, sockets};

/// What the slave of `peers/slave.py` holds, as an operator should see it.
const SEEN: [(&str, &str); 8] = [
    ("TIC-1.PV", "-1.5 °C good"),
    ("TIC-1.SV", "70.0 °C good"),
    ("TIC-1.MV", "12.34 % good"),
    ("TIC-1.P", "5.0 % FS good"),
    ("TIC-1.I", "240.0 s good"),
    ("PLC-1.STEP", "HEAT good"),
    ("PLC-1.LT-1", "10.2 cm good"),
    ("PLC-1.RUN", "RUN good"),
];

pub fn slave(python: &Path, kind: &str, place: &str) -> Process {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/slave.py");
    let mut slave = Process::start(Command::new(python).arg(script).args([kind, place]));
    slave.wait_for("ready");
    slave
}

/// Runs the station headless for a while and gives what it says, with what it prints of each tag at the end.
fn station(plant: &Path, port: &str, time: &str) -> Vec<String> {
    station_until(plant, port, &["--for", time], |_| {})
}

/// The same, where it ends in another way.
fn station_until(plant: &Path, port: &str, args: &[&str], end: impl FnOnce(&mut Process)) -> Vec<String> {
    let folder = folder();
    let mut station = Process::start(
        sightglass()
            .arg("run")
            .arg(plant)
            .args(args)
            .args(["--print", "--port", &format!("L1={port}"), "--history"])
            .arg(folder.path().join("history.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    end(&mut station);
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

/// Runs the station until it has read everything, and compares what it prints.
fn check_all_are_read_from(port: &str) {
    let said = station(Path::new("tank"), port, "12s");
    check(&said, &SEEN);
}

#[test]
fn the_station_reads_pymodbus_over_a_serial_line() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "rtu", cable.ends[1].to_str().unwrap());
    check_all_are_read_from(cable.ends[0].to_str().unwrap());
}

#[test]
fn the_station_reads_pymodbus_over_tcp() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    check_all_are_read_from(&format!("127.0.0.1:{port}"));
}

/// Its revision is V2.10.
#[test]
fn pymodbus_says_what_it_is_and_what_it_does_not_have() {
    let Some(python) = python() else { return };
    let folder = folder();
    let row = "table = \"holding\", address = 10, type = \"uint16\", poll = \"fast\"";
    let when = |name, when| format!("{{ name = \"{name}\", {row}, when = \"{when}\" }}");
    let (new, newer) = (when("NEW", "revision >= '2.9'"), when("NEWER", "revision >= '2.11'"));
    let tags = format!("tag = [{{ name = \"N\", {row} }}, {new}, {newer}]\n");
    let head = "vendor = \"none\"\nmodel = \"slave.py\"\nstatus = \"verified\"\nsource = \"slave.py\"\n";
    fs::write(folder.path().join("number.toml"), format!("{head}{tags}")).unwrap();
    for mode in ["tcp", "rtu-over-tcp"] {
        let port = free_port();
        let _slave = slave(&python, mode, &port.to_string());
        let file = folder.path().join("plant.toml");
        fs::write(&file, plant_with(&[WELL], mode)).unwrap();
        let said = station(&file, &format!("127.0.0.1:{port}"), "12s");
        check(&said, &[("WELL.N", "10 good"), ("WELL.NEW", "10 good"), ("WELL.NEWER", "---- bad: not present")]);
    }
}

/// A unit that is well and one for each way to answer wrongly: name, unit and the register that it is asked for, which says
/// what is wrong (`peers/slave.py`).
const WELL: (&str, u8, &str) = ("WELL", 3, "10");
const LATE: (&str, u8, &str) = ("LATE", 4, "210");
const CORRUPT: (&str, u8, &str) = ("CORRUPT", 5, "310");
const SILENT: (&str, u8, &str) = ("SILENT", 6, "410");
const NOISY: (&str, u8, &str) = ("NOISY", 7, "510");
const CUT: (&str, u8, &str) = ("CUT", 8, "610");

/// A plant with these units on one line, in any mode that plant files know.
fn plant_with(units: &[(&str, u8, &str)], mode: &str) -> String {
    let ends = match mode {
        "rtu" | "ascii" => "port = \"/dev/null\"\nbaud = 9600\nparity = \"N\"",
        _ => "host = \"localhost\"",
    };
    let mut text = format!(
        "title = \"Faults\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L1\"\nmode = \"{mode}\"\ntimeout_ms = 300\n{ends}\n"
    );
    for (name, unit, address) in units {
        text += &format!(
            "[[device]]\nname = \"{name}\"\nprofile = \"number\"\nline = \"L1\"\nunit = {unit}\nfast = \"500ms\"\n"
        );
        text += &format!("[[device.tag]]\nname = \"N\"\naddress = {address}\n");
    }
    text
}

/// Lets the station poll units of the slave. Every register there holds its address: no tag may ever be shown with another
/// number, whatever came and when.
fn read_faults(units: &[(&str, u8, &str)], mode: &str, port: &str) -> Vec<String> {
    let folder = folder();
    let file = folder.path().join("faults.toml");
    fs::write(&file, plant_with(units, mode)).unwrap();
    fs::copy(plant("number.toml"), folder.path().join("number.toml")).unwrap();
    // Long enough for a machine that has much else to do.
    let said = station(&file, port, "20s");
    for (name, _, address) in units {
        let seen = printed(&said, &format!("{name}.N"));
        let value = seen.split(' ').next().unwrap();
        assert!(value == *address || value == "----", "{name}: {seen}");
    }
    said
}

/// Compares the beginning of what the station printed of tags.
fn check(said: &[String], expect: &[(&str, &str)]) {
    for (tag, expect) in expect {
        let seen = printed(said, tag);
        assert!(seen.starts_with(expect), "{tag}: {seen}, expected {expect} in:\n{}", said.join("\n"));
    }
}

#[test]
fn a_faulty_answer_is_never_shown_as_a_value() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "rtu", cable.ends[1].to_str().unwrap());
    let said = read_faults(&[WELL, LATE, CORRUPT, SILENT, NOISY, CUT], "rtu", cable.ends[0].to_str().unwrap());
    check(&said, &[("WELL.N", "10 good"), ("NOISY.N", "510 good")]);
    for tag in ["CORRUPT.N", "SILENT.N", "CUT.N"] {
        check(&said, &[(tag, "---- bad: device not responding")]);
    }
    for (unit, why) in [
        ("LATE", "response timeout"),
        ("CORRUPT", "CRC error"),
        ("SILENT", "response timeout"),
        ("CUT", "incomplete response"),
    ] {
        assert!(said.iter().any(|line| line.contains(unit) && line.contains(why)), "{unit} {why}: {}", said.join("\n"));
    }
}

/// In ASCII a spoiled check is the LRC's, and noise may hold anything but a colon.
#[test]
fn a_faulty_answer_in_ascii_is_never_shown_as_a_value() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "ascii", cable.ends[1].to_str().unwrap());
    let said = read_faults(&[WELL, LATE, CORRUPT, SILENT, NOISY, CUT], "ascii", cable.ends[0].to_str().unwrap());
    check(&said, &[("WELL.N", "10 good"), ("NOISY.N", "510 good")]);
    for tag in ["CORRUPT.N", "SILENT.N", "CUT.N"] {
        check(&said, &[(tag, "---- bad: device not responding")]);
    }
    assert!(said.iter().any(|line| line.contains("CORRUPT") && line.contains("LRC error")), "{}", said.join("\n"));
}

#[test]
fn a_faulty_answer_in_rtu_over_tcp_is_never_shown_as_a_value() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "rtu-over-tcp", &port.to_string());
    let place = format!("127.0.0.1:{port}");
    let said = read_faults(&[WELL, LATE, CORRUPT, SILENT, NOISY, CUT], "rtu-over-tcp", &place);
    check(&said, &[("WELL.N", "10 good"), ("NOISY.N", "510 good")]);
    for tag in ["CORRUPT.N", "SILENT.N", "CUT.N"] {
        check(&said, &[(tag, "---- bad: device not responding")]);
    }
}

#[test]
fn the_station_reads_pymodbus_over_udp_and_no_faulty_answer() {
    let Some(python) = python() else { return };
    for mode in ["udp", "rtu-over-udp"] {
        let port = free_port();
        let _slave = slave(&python, mode, &port.to_string());
        let said = read_faults(&[WELL, LATE, CORRUPT, SILENT, CUT], mode, &format!("127.0.0.1:{port}"));
        check(&said, &[("WELL.N", "10 good")]);
        for tag in ["CORRUPT.N", "SILENT.N", "CUT.N"] {
            check(&said, &[(tag, "---- bad: device not responding")]);
        }
        assert!(!said.iter().any(|line| line.contains("not connected")), "{}", said.join("\n"));
    }
}

/// What a TCP peer can do short of answering: stay mute, hang up, answer by halves, talk nonsense.
#[test]
fn a_hostile_tcp_peer_costs_values_but_never_shows_a_wrong_one() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let hostile = std::thread::spawn(move || {
        let mut mute = Vec::new();
        for (number, client) in listener.incoming().map_while(Result::ok).enumerate() {
            let mut client = client;
            let mut request = [0; 12];
            match number {
                // Hangs up before it is asked; then in the middle of an answer; then answers no Modbus.
                0 => drop(client),
                1 | 2 => {
                    let _ = client.read_exact(&mut request);
                    let half = if number == 1 {
                        [&request[..4], &[0, 5, 3, 3]].concat()
                    } else {
                        b"HTTP/1.1 400\r\n".to_vec()
                    };
                    let _ = client.write_all(&half);
                }
                // Takes the connection and says nothing, ever.
                3 => mute.push(client),
                // What comes after it is served well until the station leaves.
                _ => {
                    while client.read_exact(&mut request).is_ok() {
                        let answer = [&request[..4], &[0, 5, request[6], 3, 2, 0, 10]].concat();
                        let _ = client.write_all(&answer);
                    }
                    return number;
                }
            }
        }
        0
    });
    let folder = folder();
    let file = folder.path().join("hostile.toml");
    fs::write(&file, plant_with(&[WELL], "tcp")).unwrap();
    fs::copy(plant("number.toml"), folder.path().join("number.toml")).unwrap();
    let said = station_until(&file, &format!("127.0.0.1:{port}"), &[], |station| {
        station.wait_for("WELL (unit 3): responding");
        station.signal("TERM");
    });
    assert_eq!(hostile.join().unwrap(), 4, "{}", said.join("\n"));
    check(&said, &[("WELL.N", "10 good")]);
}

#[test]
fn a_faulty_answer_over_tcp_is_never_shown_as_a_value() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    let said = read_faults(&[WELL, LATE, CORRUPT, SILENT, NOISY], "tcp", &format!("127.0.0.1:{port}"));
    check(&said, &[("WELL.N", "10 good"), ("NOISY.N", "510 good")]);
    check(&said, &[("CORRUPT.N", "---- bad: device not responding"), ("SILENT.N", "---- bad: device not responding")]);
}

/// Its registers hold their address, so the ones from 16706 (0x4142) on read as `ABAC…`, two characters each.
#[test]
fn text_in_registers_is_read() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    let text = |name: &str, kind: &str, order: &str| {
        format!(
            "[[device.tag]]\nname = \"{name}\"\ntable = \"holding\"\naddress = 16706\npoll = \"fast\"\n\
             type = \"{kind}\"\norder = \"{order}\"\n"
        )
    };
    let plant_of = |tags: String| {
        let folder = folder();
        let file = folder.path().join("text.toml");
        fs::write(&file, plant_with(&[WELL], "tcp") + &tags).unwrap();
        fs::copy(plant("number.toml"), folder.path().join("number.toml")).unwrap();
        station(&file, &format!("127.0.0.1:{port}"), "3s")
    };
    check(&plant_of(text("TEXT", "string(5)", "ABCD")), &[("WELL.TEXT", "ABACA good"), ("WELL.N", "10 good")]);
    check(&plant_of(text("TEXT", "string(4)", "BADC")), &[("WELL.TEXT", "BACA good")]);
}

/// Over TCP half an answer puts the whole stream out of sync.
#[test]
fn half_an_answer_over_tcp_is_never_shown_as_a_value() {
    let Some(python) = python() else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    let said = read_faults(&[WELL, CUT], "tcp", &format!("127.0.0.1:{port}"));
    check(&said, &[("CUT.N", "---- bad")]);
    assert!(said.iter().any(|line| line.contains("WELL (unit 3): responding")), "{}", said.join("\n"));
}

/// The fixed values of its unit-test.h, and the deliberate faults of its unit-test-server.c.
#[test]
fn the_station_reads_the_server_of_libmodbus() {
    let Some(_server) = libmodbus_server() else { return };
    let said = station(&plant("libmodbus.toml"), "127.0.0.1:1502", "10s");
    // UT_INPUT_BITS_TAB begins AC DB, the lowest bit first.
    for (bit, expect) in [0, 0, 1, 1, 0, 1, 0, 1, 1, 1].into_iter().enumerate() {
        check(&said, &[(&format!("UT.BIT{bit}"), &format!("{expect} good"))]);
    }
    check(
        &said,
        &[
            ("UT.INPUT", "10 good"),
            ("UT.COIL", "0 good"),
            ("UT.REGISTER", "0 good"),
            ("UT.LATE", "0 good"),
            ("UT.SHORT", "---- bad"),
            ("UT.BUSY", "---- bad"),
            ("UT.NOWHERE", "---- bad: refused by the device"),
        ],
    );
}

/// The same server asked by hand: registers as unit-test.h has them, and its refusal in words.
#[test]
fn raw_asks_the_server_of_libmodbus() {
    for (bytes, expect) in
        [("11 04 01 08 00 01", "RX 00 01 00 00 00 05 11 04 02 00 0A"), ("11 03 01 70 00 01", "exception 06")]
    {
        // It serves one connection and ends.
        let Some(_server) = libmodbus_server() else { return };
        let mut raw = Process::start(sightglass().args(["send", "127.0.0.1:1502"]).args(bytes.split(' ')));
        raw.end();
        assert!(raw.said.iter().any(|line| line.contains(expect)), "{bytes}: {}", raw.said.join("\n"));
    }
}

/// Three devices that take 5, 25 and 60 ms for a response.
#[test]
fn no_read_takes_longer_than_its_worst_case() {
    let Some(python) = python().filter(|_| have("socat", "socat")) else { return };
    let (folder, sockets) = (folder(), sockets());
    let cable = Cable::plug(folder.path());
    let _slave = slave(&python, "rtu", cable.ends[1].to_str().unwrap());
    let file = folder.path().join("paced.toml");
    let trusted = format!("[[access.trusted]]\nuser = \"{}\"\nrole = \"viewer\"\n", own_user());
    fs::write(&file, plant_with(&[("A", 3, "705"), ("B", 4, "725"), ("C", 5, "760")], "rtu") + &trusted).unwrap();
    fs::copy(plant("number.toml"), folder.path().join("number.toml")).unwrap();
    let command = |name: &str| {
        let mut command = sightglass();
        command.arg(name).env("XDG_STATE_HOME", folder.path()).env("XDG_RUNTIME_DIR", &sockets);
        command
    };
    let port = format!("L1={}", cable.ends[0].display());
    let mut station = Process::start(command("run").arg(&file).args(["--port", &port]));
    station.wait_for("A (unit 3): responding");
    // Each takes some milliseconds; the program says its load after five seconds.
    let enough = (0..2_000).any(|_| {
        let status = command("status").arg("--json").output().unwrap();
        let status: Value = serde_json::from_slice(&status.stdout).unwrap_or_default();
        let polls = status["lines"][0]["polls"].as_array().cloned().unwrap_or_default();
        for poll in polls.iter().filter(|poll| !poll["max_ms"].is_null()) {
            let [worst, p99, max] = ["worst_ms", "p99_ms", "max_ms"].map(|key| poll[key].as_f64().unwrap());
            assert!(p99 <= max && max <= worst, "{poll}");
            assert!(poll["address"].as_f64().unwrap() - 700.0 <= max, "{poll}");
        }
        let read = |poll: &Value| 12 <= poll["reads"].as_u64().unwrap_or_default();
        let load = &status["program"]["memory_bytes"];
        polls.len() == 3 && polls.iter().all(read) && load.is_number()
    });
    assert!(enough, "{:?}", station.said);
}
