//! Logs of registers that `sightglass open` writes and shows: what is on disk when the program is killed.

use std::{
    io::{Read, Write},
    net::{Ipv4Addr, TcpListener, TcpStream},
};

use crate::{
    pty::Terminal,
    support::{folder, sightglass},
};

/// A unit whose every register holds 700. Gives its address.
fn unit() -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            std::thread::spawn(move || serve(stream));
        }
    });
    address
}

/// Answers reads of Modbus TCP, until the other end goes.
fn serve(mut stream: TcpStream) {
    let mut request = [0; 12];
    while stream.read_exact(&mut request).is_ok() {
        let words = request[11];
        let head = [&request[..4], &[0, 3 + 2 * words, request[6], request[7], 2 * words]].concat();
        if stream.write_all(&[head, [2, 0xBC].repeat(usize::from(words))].concat()).is_err() {
            break;
        }
    }
}

#[test]
fn rows_of_a_log_outlive_a_killed_program() {
    let folder = folder();
    let log = folder.path().join("bench.csv");
    let path = log.to_str().unwrap();
    let unit = unit();
    let args = ["open", &unit, "--log", path, "--every", "500ms", "--watch", "SV=41003 int16 0.1 °C"];
    let mut terminal = Terminal::start(80, 24, &args);
    terminal.wait_for(" 4 rows ");
    terminal.signal("KILL");
    terminal.end();
    let text = std::fs::read_to_string(&log).unwrap();
    let mut rows = text.lines();
    assert_eq!(rows.next(), Some("\u{feff}time_utc,SV °C,SV quality"));
    let rows: Vec<&str> = rows.collect();
    // The last one shown may still have been on its way to the disk.
    assert!(rows.len() >= 3 && rows.iter().all(|row| row.ends_with("Z,70.0,good")), "{text}");

    // It is not written over, and not mixed with another one.
    let output = sightglass().args(args).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && said.contains("already exists"), "{said}");
    assert_eq!(std::fs::read_to_string(&log).unwrap(), text);
}

#[test]
fn a_log_is_shown_again_and_a_damaged_line_is_named() {
    let folder = folder();
    let log = folder.path().join("bench.csv");
    let row = |n: usize| format!("2026-11-23T14:00:{n:02}.000Z,{}.5,good\r\n", 60 + n);
    let rows: String = (0..40).map(row).collect();
    let text = format!("time_utc,SV °C,SV quality\r\n{}", rows.replace("79.5", "7x.5"));
    std::fs::write(&log, &text).unwrap();
    let mut terminal = Terminal::start(120, 40, &["open", log.to_str().unwrap()]);
    terminal.wait_for("bench.csv: line 21, SV: found `7x.5`");
    terminal.keys("\x1b");
    terminal.wait_gone("found `7x.5`");
    for shown in ["40 rows, DAMAGED: 1", "end of the log", "99.5 °C", "60.5"] {
        terminal.wait_for(shown);
    }
    // Its keys neither write to it nor leave it.
    terminal.keys("Rc");
    terminal.wait_for("at 14:00:");
    terminal.keys("q");
    terminal.wait_for("The log stays as it is");
    terminal.keys("\r");
    assert_eq!(terminal.end(), 0);
    assert_eq!(std::fs::read_to_string(&log).unwrap(), text);

    let output = sightglass().args(["open", "none.csv"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && said.contains("none.csv: No such file"), "{said}");
}

#[test]
fn a_log_says_in_the_end_how_many_rows_it_has() {
    let folder = folder();
    let log = folder.path().join("bench.csv");
    let args = ["open", &unit(), "--log", log.to_str().unwrap(), "--every", "500ms", "--watch", "T=31001:2,int16,°C"];
    let mut terminal = Terminal::start(120, 40, &args);
    terminal.wait_for(" 3 rows ");
    terminal.keys("q");
    terminal.wait_for("Quit?");
    terminal.keys("\r");
    terminal.wait_for("rows written:");
    assert_eq!(terminal.end(), 0);
    let text = std::fs::read_to_string(&log).unwrap();
    assert!(text.starts_with("\u{feff}time_utc,T1 °C,T1 quality,T2 °C,T2 quality\r\n"), "{text}");
}
