//! Our simulated slaves, and those of the benches, against masters that we did not write.

use std::{
    fs::OpenOptions,
    io::{Read, Write},
    net::TcpStream,
    path::Path,
    process::{Command, Output},
    time::{Duration, Instant},
};

use sightglass::api::bus::frame::{with_crc, with_mbap};

use crate::support::{Process, have, python, sightglass};

#[path = "../bench/support/mod.rs"]
mod slaves;

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
fn mbpoll_reads_and_writes_the_simulated_plant_over_serial() {
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
fn modes_and_options_that_do_not_go_together_are_refused() {
    for args in [
        &["--mode", "rtu", "--tcp", "127.0.0.1:0"][..],
        &["--mode", "ascii", "--tcp", "127.0.0.1:0"],
        &["--mode", "tcp", "--link", "/tmp/never-made"],
        &["--mode", "rtu", "--data-bits", "7"],
        &["--mode", "tcp", "--data-bits", "8"],
        &["--data-bits", "9"],
        &["--mode", "udp"],
    ] {
        let status = sightglass().args(["sim", "tank"]).args(args).output().unwrap().status;
        assert_eq!(status.code(), Some(2), "{args:?}");
    }
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

/// What `peers/master.py` understands of the simulated plant, whatever the master and the mode.
const EVERY_MASTER: [&str; 23] = [
    "SV [700]",
    "P I D [50, 2400, 600]",
    "SV in use [700]",
    "SV written [655]",
    "words written [1, 2, 65535]",
    "coil written [0, 0, 1, 0, 0]",
    "coils written [1, 0, 1, 1, 0, 0, 0, 1, 0, 1]",
    "switches [0, 0, 0, 0]",
    "too many words exception 3",
    "no such address exception 2",
    "no such function exception 1",
    "SV above its limit exception 3",
    "measured 10",
    "input, unit, range, decimals [1, 0, 0, 1850, 1]",
    "SV in 0.01 % of the range [3541]",
    "standby [1]",
    "targets of the programme [500, 600, 650, 0]",
    "END cannot be written exception 3",
    "interlocks [0]",
    "fill ['65']",
    "no such V memory exception 2",
    "inputs, outputs, relays as words [2, 2, 2]",
    "a relay in its word 13",
];

/// What pymodbus understands beyond that, in every mode.
const PYMODBUS: [&str; 14] = [
    "echo b'\\xa57'",
    "no queue exception 2",
    "exceptions counted 1",
    "messages counted 3",
    "done 3",
    "log 3 5 80 40 80 40 80 40",
    "status 00000001",
    "server id b'\\x06\\xffD0-06D'",
    "basic b'KOYO' b'D0-06DD1' [0, 1, 2] 0",
    "regular [0, 1, 2, 3, 4, 5] 255 6",
    "rest [6] 0",
    "one {4: b'DirectLOGIC 06 (simulated)'}",
    "not there exception 2",
    "PXR has none exception 1",
];
const CHANGED: [&str; 2] = ["masked [23]", "exchanged [23, 7, 8]"];
const QUEUE: &str = "queue [440, 512]";
const BROADCAST: &str = "broadcast [500] [500]";
const END: &str = "end";

/// Lets a foreign master ask the simulated plant and compares every line it prints.
fn check_asked_by(library: &str, mode: &str, args: &[&str], beyond: &[&str]) {
    let Some(python) = python() else { return };
    let (_sim, place) = sim(&[&["--mode", mode], args].concat(), "serves");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/master.py");
    let mut master = Process::start(Command::new(python).arg(script).args([library, mode, &place]));
    assert_eq!(master.end(), Some(0), "{}", master.said.join("\n"));
    assert_eq!(master.said, [&EVERY_MASTER, beyond, &[END]].concat());
}

#[test]
fn pymodbus_asks_the_simulated_plant_everything_over_tcp() {
    check_asked_by("pymodbus", "tcp", &[], &[&CHANGED[..], &[QUEUE], &PYMODBUS].concat());
}

#[test]
fn pymodbus_asks_the_simulated_plant_everything_in_rtu() {
    check_asked_by("pymodbus", "rtu", &[], &[&CHANGED[..], &PYMODBUS, &[BROADCAST]].concat());
}

#[test]
fn pymodbus_asks_the_simulated_plant_everything_in_rtu_over_tcp() {
    check_asked_by("pymodbus", "rtu-over-tcp", &[], &[&CHANGED[..], &PYMODBUS, &[BROADCAST]].concat());
}

#[test]
fn pymodbus_asks_the_simulated_plant_everything_in_ascii() {
    for bits in ["7", "8"] {
        let beyond = [&CHANGED[..], &[QUEUE], &PYMODBUS, &[BROADCAST]].concat();
        check_asked_by("pymodbus", "ascii", &["--data-bits", bits], &beyond);
    }
}

#[test]
fn minimalmodbus_reads_and_writes_the_simulated_plant() {
    // It waits its whole timeout for the rest of an exception, so the modes are tried side by side.
    let cases = [("rtu", &[][..]), ("ascii", &[]), ("ascii", &["--data-bits", "7"])];
    std::thread::scope(|all| {
        for (mode, args) in cases {
            all.spawn(move || check_asked_by("minimalmodbus", mode, args, &[]));
        }
    });
}

/// Register N holds N, and no answer is over before a line of 9600 baud could have carried it.
#[test]
fn the_paced_slave_is_never_faster_than_its_wire() {
    let (path, slave) = slaves::PacedSlave::start(9600);
    let mut port = OpenOptions::new().read(true).write(true).open(&path).unwrap();
    let mut answer = [0; 25];
    for first in [10_u8, 30] {
        let asked = Instant::now();
        port.write_all(&with_crc(&[1, 3, 0, first, 0, 10])).unwrap();
        port.read_exact(&mut answer).unwrap();
        // 8 + 25 characters of ten bits and a silence of 3.5 characters.
        assert!(asked.elapsed() >= Duration::from_nanos(365 * 1_000_000_000 / 9600), "{:?}", asked.elapsed());
        let values: Vec<u8> = (first..first + 10).flat_map(|value| [0, value]).collect();
        assert_eq!(answer[..], with_crc(&[&[1, 3, 20], &values[..]].concat()));
    }
    // A broadcast has no answer; the request after it has.
    port.write_all(&with_crc(&[0, 6, 0, 1, 0, 1])).unwrap();
    // Sent at once, both would be one frame.
    while slave.heard() < 3 {
        std::thread::yield_now();
    }
    port.write_all(&with_crc(&[7, 6, 0, 1, 0, 9])).unwrap();
    let mut echo = [0; 8];
    port.read_exact(&mut echo).unwrap();
    assert_eq!(echo[..], with_crc(&[7, 6, 0, 1, 0, 9]));
    assert_eq!(slave.served(), 3);
    if !have("mbpoll", "mbpoll") {
        return;
    }
    let place = path.to_str().unwrap();
    let (ok, out) = mbpoll(&[
        "-m", "rtu", "-b", "9600", "-P", "none", "-0", "-1", "-a", "1", "-t", "3", "-r", "500", "-c", "2", place,
    ]);
    assert!(ok && out.contains("[500]: \t500") && out.contains("[501]: \t501"), "{out}");
}

#[test]
fn the_tcp_slave_answers_a_pipeline_in_its_order() {
    let mut client = TcpStream::connect(slaves::TcpSlave::start()).unwrap();
    let (mut requests, mut expect) = (Vec::new(), Vec::new());
    for transaction in 0..5000_u16 {
        let number = transaction.to_be_bytes();
        requests.extend(with_mbap(transaction, &[1, 4, number[0], number[1], 0, 1]));
        expect.extend(with_mbap(transaction, &[1, 4, 2, number[0], number[1]]));
    }
    let mut answers = vec![0; expect.len()];
    let mut writer = client.try_clone().unwrap();
    let sender = std::thread::spawn(move || writer.write_all(&requests));
    client.read_exact(&mut answers).unwrap();
    sender.join().unwrap().unwrap();
    assert!(answers == expect, "answers in the order of the requests, each with its own value");
    // What is no Modbus ends the connection.
    client.write_all(b"GET / HTTP/1.1\r\n").unwrap();
    assert_eq!(client.read(&mut answers).unwrap_or(0), 0);
}
