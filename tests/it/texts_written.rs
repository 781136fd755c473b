//! Texts, dates, times and addresses written into a slave that we did not write, and read there by a master that we did not write.

use std::{path::PathBuf, process::Command, str::FromStr};

use jiff::{Timestamp, civil::DateTime, tz::TimeZone};

use crate::{
    one_device::OneDevice,
    peers::slave,
    support::{free_port, have, python},
};

const MAP: &str = r#"
vendor = "A"
model = "Meter"
status = "manual"
source = "Test"
functions = [3, 6, 16]
tag = [
    { name = "PLACE", table = "holding", address = 1000, type = "string(8)", order = "BADC", access = "rw" },
    { name = "CLOCK", table = "holding", address = 1010, type = "clock_words", access = "rw" },
    { name = "UTC", table = "holding", address = 1020, type = "epoch32", order = "CDAB", access = "rw" },
    { name = "TARIFF", table = "holding", address = 1030, type = "time_bcd", access = "rw" },
    { name = "GATEWAY", table = "holding", address = 1040, type = "ipv4", access = "rw" },
]
"#;

/// Registers from an address on, as mbpoll reads them.
fn registers(port: &str, address: u16, count: usize) -> Vec<u16> {
    let (address, count) = (address.to_string(), count.to_string());
    let args =
        ["-m", "tcp", "-p", port, "-a", "1", "-t", "4:hex", "-0", "-1", "-r", &address, "-c", &count, "127.0.0.1"];
    let output = Command::new("mbpoll").args(args).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let words =
        text.lines().filter_map(|line| line.split_once("0x")).map(|(_, hex)| u16::from_str_radix(hex.trim(), 16));
    words.collect::<Result<_, _>>().unwrap_or_else(|why| panic!("{why}: {text}"))
}

#[test]
fn texts_dates_and_addresses_are_written_into_pymodbus() {
    let Some(python): Option<PathBuf> = python().filter(|_| have("mbpoll", "mbpoll")) else { return };
    let port = free_port();
    let _slave = slave(&python, "tcp", &port.to_string());
    let mut plant = OneDevice::start("M", MAP, port);
    let port = port.to_string();
    for (tag, typed, words) in [
        ("M.PLACE", "Line 7", "→ Line 7: verified"),
        (
            "M.PLACE",
            "A long text",
            "M.PLACE: found `A long text`, expected printable characters in at most 8 bytes, no blank at the end",
        ),
        ("M.CLOCK", "2026-02-29 10:00", "M.CLOCK: found `2026-02-29 10:00`, expected a date and time such as"),
        ("M.CLOCK", "2026-02-28 23:59:05", "→ 2026-02-28 23:59:05: verified"),
        ("M.UTC", "2026-11-30 14:05:07", "→ 2026-11-30T07:05:07Z: verified"),
        ("M.TARIFF", "07:30", "→ 07:30: verified"),
        ("M.GATEWAY", "192.168.0.7", "→ 192.168.0.7: verified"),
        ("M.GATEWAY", "192.168.0.7", "→ 192.168.0.7: unchanged, not written"),
    ] {
        let (_, answer) = plant.said(&["write", tag, typed]);
        assert!(answer.contains(words), "{tag} {typed}: {answer}");
    }
    assert_eq!(registers(&port, 1_000, 4), [0x694C, 0x656E, 0x3720, 0]);
    assert_eq!(registers(&port, 1_010, 6), [2026, 2, 28, 23, 59, 5]);
    let seconds = "2026-11-30T07:05:07Z".parse::<Timestamp>().unwrap().as_second();
    assert_eq!(registers(&port, 1_020, 2), [(seconds & 0xFFFF) as u16, (seconds >> 16) as u16]);
    assert_eq!(registers(&port, 1_030, 1), [0x0730]);
    assert_eq!(registers(&port, 1_040, 2), [0xC0A8, 0x0007]);

    // A clock is set by that of the station, in the zone of the plant.
    let before = Timestamp::now();
    let (code, answer) = plant.said(&["write", "M.CLOCK", "now"]);
    assert!(code == Some(0) && answer.contains(": verified"), "{answer}");
    let words = registers(&port, 1_010, 6);
    let text =
        format!("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", words[0], words[1], words[2], words[3], words[4], words[5]);
    let set = DateTime::from_str(&text).unwrap().to_zoned(TimeZone::get("Asia/Bangkok").unwrap()).unwrap().timestamp();
    assert!(before.as_second() <= set.as_second() && set <= Timestamp::now(), "{before} {set}");
    // What was written is on record, not "now", as soon as it is stored.
    let file = plant.plant.to_str().unwrap().to_owned();
    let sql = format!("select count(*) from action where new_value = '{text}' and outcome = 'verified'");
    let mut counts = (0..500).map(|_| plant.said(&["sql", &file, &sql, "--csv"]).1);
    assert!(counts.any(|count| count.lines().nth(1) == Some("1")), "{text}");
    plant.stop();
}
