//! Text of others, by every command: whatever a file, an argument or a device says, nothing of it acts on a terminal.

use std::{
    io::{Read, Write},
    net::TcpListener,
    os::unix::fs::PermissionsExt,
    process::Stdio,
};

use sightglass::api::plant::is_control_or_bidi;

use crate::support::{folder, sightglass};

/// Clears the screen, turns the direction of writing, sets the title, moves the cursor.
const EVIL: &str = "a\u{1b}[2J\u{202e}b\u{1b}]0;pwned\u{7}\u{9b}31m\u{2066}\r\u{8}c";

fn check(args: &[&str], input: &str) {
    let mut command = sightglass();
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A command that reads nothing may have ended by now.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    let output = child.wait_with_output().unwrap();
    for said in [output.stdout, output.stderr] {
        let said = String::from_utf8(said).unwrap();
        let raw = said.chars().find(|letter| is_control_or_bidi(*letter) && !matches!(letter, '\n' | '\t'));
        assert_eq!(raw, None, "{args:?} says {said:?}");
    }
}

#[test]
fn no_argument_acts_on_the_terminal_by_any_command() {
    for command in [
        "",
        "demo",
        "run",
        "attach",
        "status",
        "ack",
        "write",
        "audit",
        "stop",
        "reload",
        "systemd-unit",
        "drill",
        "sim",
        "experiments",
        "check",
        "profiles",
        "report",
        "export",
        "history",
        "sql",
        "alarms",
        "decode",
        "scan",
        "probe",
        "loopback",
        "send",
    ] {
        let args: Vec<&str> = [command, EVIL].into_iter().filter(|word| !word.is_empty()).collect();
        check(&args, "");
        check(&[args.as_slice(), &[EVIL, EVIL]].concat(), "");
        check(&[args.as_slice(), &["--history", EVIL, "--log", EVIL, "--port", EVIL, "--out", EVIL]].concat(), "");
    }
}

#[test]
fn no_file_and_no_name_of_one_acts_on_the_terminal() {
    let folder = folder();
    let escaped = EVIL.chars().map(|letter| format!("\\U{:08X}", u32::from(letter))).collect::<String>();
    let key = format!("\"{escaped}\" = 1\ntitle = \"{escaped}\"\ntime_zone = \"{escaped}\"\n");
    let texts = [
        key.clone(),
        format!("{key}[[line]]\nname = \"{escaped}\"\nmode = \"{escaped}\"\n[[device]]\nprofile = \"{escaped}\"\n"),
        format!("title = \"{EVIL}\"\n"),
        format!("# {EVIL}\ntitle = 1\n"),
        format!("{EVIL}\n"),
        format!("vendor = \"{escaped}\"\n[[tag]]\nname = \"{escaped}\"\n"),
    ];
    for (n, text) in texts.iter().enumerate() {
        let path = folder.path().join(format!("{n}{}.toml", EVIL.replace('/', "")));
        std::fs::write(&path, text).unwrap();
        let path = path.to_str().unwrap();
        for args in [
            vec!["check", path],
            vec!["check", "--strict", path],
            vec!["run", path],
            vec![path],
            vec!["sim", path],
            vec!["drill", path],
            vec!["report", path],
            vec!["export", path, "--out", "-"],
            vec!["alarms", path],
            vec!["profiles", path],
            vec!["profile", "import", path, "--format", "list"],
            vec!["profile", "export", path, "--format", "csv"],
        ] {
            check(&args, "");
        }
    }
    check(&["decode"], EVIL);
}

#[test]
fn no_answer_of_a_device_acts_on_the_terminal() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut request = [0; 300];
            while let Ok(12..) = stream.read(&mut request) {
                // The identification of a device: one object.
                let object = EVIL.as_bytes();
                let message = [&[request[6], 0x2B, 0x0E, 1, 1, 0, 0, 1, 0, object.len() as u8], object].concat();
                let header = [request[0], request[1], 0, 0, 0, message.len() as u8];
                if stream.write_all(&[&header[..], &message].concat()).is_err() {
                    break;
                }
            }
        }
    });
    check(&["probe", &address, "--timeout", "100"], "");
    check(&["probe", &address, "--timeout", "100", "--verbose"], "");
    check(&["send", &address, "--timeout", "100", "01 2B 0E 01 00"], "");
    check(&["scan", &address, "--timeout", "20", "--units", "1-2"], "");
}

#[test]
fn what_the_program_writes_is_for_user_and_group_only() {
    let folder = folder();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (history, report, log) = (file("h.duckdb"), file("r.csv"), file("s.log"));
    let args = ["demo", "--headless", "--for", "20s", "--speed", "100"];
    let files = ["--history", &history, "--report", &report, "--log", &log];
    let status = sightglass().args(args).args(files).stdout(Stdio::null()).status().unwrap();
    assert!(status.success());
    let mut found = 0;
    for entry in std::fs::read_dir(folder.path()).unwrap().flatten() {
        let mode = entry.metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o027, 0, "{:?} has mode {mode:o}", entry.file_name());
        found += 1;
    }
    assert!(found >= 3, "{found} files");
}
