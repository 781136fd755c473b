//! The program as scripts see it.

use std::{fs, path::Path, process::Output};

use sightglass::api::{
    history::Store,
    plant::{AlarmEvent, AlarmRecord, Priority, Record, Sample},
    profile::{self, Search},
};

use crate::support::{Process, folder, sightglass};

fn run(args: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = sightglass().args(args).output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[test]
fn help_names_every_command_and_the_exit_codes() {
    let (code, out, _) = run(&["--help"]);
    assert_eq!(code, Some(0));
    for word in ["demo", "run", "sim", "check", "profiles", "report", "alarms", "decode", "Exit codes:"] {
        assert!(out.contains(word), "no `{word}` in:\n{out}");
    }
    let (code, out, _) = run(&["--version"]);
    assert_eq!((code, out.trim()), (Some(0), concat!("sightglass ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn a_missing_plant_is_reported_by_name_with_exit_code_2() {
    for args in [["run", "nowhere.toml"], ["check", "nowhere.toml"]] {
        let (code, _, err) = run(&args);
        assert_eq!(code, Some(2), "{err}");
        assert!(err.contains("nowhere.toml"), "{err}");
    }
    assert_eq!(run(&["demo", "--speed", "fast"]).0, Some(2));
    assert_eq!(run(&["run", "tank", "--port", "L9=/dev/null"]).0, Some(2));
}

#[test]
fn check_prints_the_read_plan_or_every_error() {
    let (code, out, err) = run(&["check", "tank"]);
    assert_eq!(code, Some(0), "{err}");
    for word in ["L1", "TIC-1", "PLC-1", "4 / 0x04", "%"] {
        assert!(out.contains(word), "no `{word}` in:\n{out}");
    }
    let (code, out, err) = run(&["check", "fuji_pxr"]);
    assert!(code == Some(0) && out.contains("31001"), "a device profile alone: {out}{err}");
    let folder = folder();
    let file = folder.path().join("my_pxr.toml");
    let (_, text, _) = run(&["profiles", "fuji_pxr"]);
    fs::write(&file, text.replacen("type = \"int16\"", "type = \"int17\"", 1)).unwrap();
    let (code, _, err) = run(&["check", file.to_str().unwrap()]);
    assert!(code == Some(2) && err.contains("int17") && err.contains("1 problem"), "{err}");
    let file = folder.path().join("bad.toml");
    fs::write(
        &file,
        "title = \"Bad\"\ntime_zone = \"Asia/Bangkok\"\n\n[[line]]\nname = \"L1\"\nmode = \"rtu\"\nport = \"/dev/ttyUSB0\"\nbaud = 9600\nparity = \"X\"\n\n\
         [[device]]\nname = \"TIC-1\"\nprofile = \"fuji_prx\"\nline = \"L1\"\nunit = 1\n",
    )
    .unwrap();
    let (code, _, err) = run(&["check", file.to_str().unwrap()]);
    assert_eq!(code, Some(2), "{err}");
    for word in ["bad.toml:9", "bad.toml:13", "fuji_prx", "fuji_pxr"] {
        assert!(err.contains(word), "no `{word}` in:\n{err}");
    }
}

#[test]
fn an_alarm_without_guidance_warns_and_strict_refuses_it() {
    let folder = folder();
    let file = folder.path().join("plant.toml");
    let (_, text, _) = run(&["profiles", "tank"]);
    let changed = text.replacen("response_time = \"2min\"\n", "", 1);
    assert_ne!(changed, text);
    fs::write(&file, changed).unwrap();
    let file = file.to_str().unwrap();
    let (code, out, err) = run(&["check", file]);
    assert_eq!(code, Some(0), "{err}");
    assert!(
        out.contains("is good") && err.contains("has no `response_time`") && err.contains("1 warning"),
        "{out}{err}"
    );
    let (code, out, err) = run(&["check", "--strict", file]);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{err}");
    assert!(
        err.contains("has no `response_time`") && err.contains("plant.toml:") && err.contains("1 problem"),
        "{err}"
    );
    for plant in ["tank", "inverter", "lab"] {
        assert_eq!(run(&["check", "--strict", plant]).0, Some(0), "{plant}");
    }
}

#[test]
fn the_quality_of_the_alarms_is_reported_in_lines_and_in_json() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    let history = path.to_str().unwrap();
    let (code, _, err) = run(&["alarms", "tank", "--stats", "--history", history]);
    assert!(code == Some(1) && err.contains("no history at"), "{err}");
    assert_eq!(run(&["alarms", "tank"]).0, Some(2));
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let at = |second: i64| {
        "2026-03-02T06:00:00+07:00".parse::<jiff::Timestamp>().unwrap() + jiff::SignedDuration::from_secs(second)
    };
    let raised = |second: i64| {
        Record::Alarm(AlarmRecord {
            at: at(second),
            subject: "TIC-1.PV".into(),
            message: "temperature high".into(),
            priority: Priority::High,
            event: AlarmEvent::Raised,
            value: Some(76.0.into()),
            limit: Some(75.0),
            by: None,
            reason: None,
            until: None,
            first_out: None,
            identity: None,
        })
    };
    let store = Store::open(&path, &def, at(0)).unwrap().store;
    // A station that was there all the time: only time that was watched counts.
    let tag = def.tag_named("TIC-1.PV").unwrap();
    let watched = (0..8 * 6).map(|window| Record::Sample(tag, Sample::good(70.0, at(window * 600))));
    store.append(&watched.chain([raised(60), raised(70), raised(80)]).collect::<Vec<_>>()).unwrap();
    drop(store);
    let shift = ["alarms", "tank", "--stats", "--history", history, "--shift", "morning@2026-03-02"];
    let (code, out, err) = run(&shift);
    assert_eq!(code, Some(0), "{err}");
    for words in ["3 alarms", "alarms per day", "at most 150", "chattering", "temperature high", "insufficient data"] {
        assert!(out.contains(words), "no `{words}` in:\n{out}");
    }
    let (code, out, err) = run(&[&shift[..], &["--json"]].concat());
    assert_eq!(code, Some(0), "{err}");
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((&json["raised"], &json["from"]), (&3.into(), &"2026-03-02T06:00:00+07:00".into()));
    assert_eq!(json["figures"][0]["value"], 9.0, "three in eight hours are nine a day");
}

#[test]
fn shipped_profiles_are_in_the_binary() {
    let (code, out, _) = run(&["profiles"]);
    assert_eq!(code, Some(0));
    for name in ["fuji_pxr", "koyo_dl06", "tank"] {
        assert!(out.contains(name), "no `{name}` in:\n{out}");
    }
    let (code, out, _) = run(&["profiles", "fuji_pxr"]);
    assert_eq!(code, Some(0));
    assert!(out.contains("FUJI") && out.parse::<toml::Table>().is_ok(), "{out}");
    let (code, _, err) = run(&["profiles", "fuji_prx"]);
    assert!(code == Some(2) && err.contains("fuji_pxr"), "{err}");
}

#[test]
fn a_frame_is_reported_in_words() {
    let (code, out, err) = run(&["decode", "01", "03", "03", "EA", "00", "01", "A5", "BA"]);
    assert_eq!(code, Some(0), "{err}");
    for word in
        ["RTU request: unit 1 read holding registers 41003 (0x03EA, 1)", "3 / 0x03", "wire address 1002", "right"]
    {
        assert!(out.contains(word), "no `{word}` in:\n{out}");
    }
    let (code, _, err) = run(&["frame", "01"]);
    assert_eq!((code, err.as_str()), (Some(2), "sightglass: `frame` is now `decode`\n"));
    let (code, out, _) = run(&["decode", "--plant", "tank", "02 06 41 40 FF FF 9D A1"]);
    assert_eq!(code, Some(0));
    assert!(out.contains("writes PLC-1.VY0 = 65535, outputs Y0 to Y17"), "{out}");
    let (code, _, err) = run(&["decode", "01 0G"]);
    assert!(code == Some(2) && err.contains("position 5: `G` is not a hex digit"), "{err}");
}

/// Two good lines and a bad one between them: all are reported, and the exit code says that one was bad.
#[test]
fn frames_of_a_log_come_from_standard_input() {
    let log = "TX 01 03 03 EA 00 02 E5 BB\nhello\nRX 01 03 04 00 C8 FF FE BB BD\n";
    let mut child = sightglass()
        .arg("decode")
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), log.as_bytes()).unwrap();
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    let (out, err) = (String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap());
    assert_eq!(status.code(), Some(2), "{out}{err}");
    assert!(err.contains("line 2: position 1: `h` is not a hex digit") && err.contains("1 of 3 lines"), "{err}");
    // The answer has the addresses of the request before it.
    assert!(out.contains("41004 / 0x03EB") && out.contains("65534 or -2"), "{out}");
    assert!(out.lines().all(|line| line.chars().count() <= 80), "{out}");
}

#[test]
fn the_demo_without_a_terminal_says_so() {
    let (code, _, err) = run(&["demo"]);
    assert_eq!(code, Some(1));
    assert!(err.contains("--headless"), "{err}");
}

/// Three minutes of plant in nine seconds: polled over a real pseudo-terminal, stored, reported. A timeout of the line is not
/// so short in real time that a busy machine misses each of them.
#[test]
fn the_headless_demo_does_the_whole_job() {
    let (folder, started) = (folder(), jiff::Timestamp::now());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (report, history) = (path("reports/demo.csv"), path("demo.duckdb"));
    let (code, out, err) =
        run(&["demo", "--headless", "--for", "3m", "--speed", "20", "--report", &report, "--history", &history]);
    assert_eq!(code, Some(0), "{out}\n{err}");
    for word in ["polls", "values", "alarms", "rows stored", "report written"] {
        assert!(out.contains(word), "no `{word}` in:\n{out}");
    }
    let rows = rows_of(Path::new(&report));
    let pv = rows.iter().find(|row| row.iter().any(|cell| cell == "TIC-1.PV")).expect("PV is in the report");
    let numbers: Vec<f64> = pv.iter().filter_map(|cell| cell.parse().ok()).collect();
    assert!(numbers.iter().any(|value| (20.0..110.0).contains(value)), "a water temperature: {pv:?}");

    // The same period again from the closed store: byte for byte the same.
    let [from, to] = [started - jiff::SignedDuration::from_mins(1), started + jiff::SignedDuration::from_mins(2)];
    let (from, to) = (from.to_string(), to.to_string());
    let again = [path("one.csv"), path("two.csv")];
    for file in &again {
        let (code, _, err) =
            run(&["report", "tank", "--history", &history, "--from", &from, "--to", &to, "--out", file]);
        assert_eq!(code, Some(0), "{err}");
    }
    let one = fs::read_to_string(&again[0]).unwrap();
    assert!(one == fs::read_to_string(&again[1]).unwrap(), "the same period twice gives two files");
    assert!(!one.contains(":00.000"), "times of the record are whole seconds: {one}");
    let (code, out, _) = run(&["report", "tank", "--history", &history, "--from", &from, "--to", &to, "--out", "-"]);
    assert_eq!(code, Some(0));
    assert!(out == one, "standard output and file differ");

    // What ran ahead of time is reported up to its own end, also where that has not come yet here.
    let ahead = (started + jiff::SignedDuration::from_mins(1)).to_string();
    let (code, out, err) = run(&["report", "tank", "--history", &history, "--from", &ahead, "--out", "-"]);
    assert_eq!(code, Some(0), "{err}");
    let pv = out.lines().find(|line| line.starts_with("TIC-1.PV,°C,")).expect("PV is in the report");
    assert!(!pv.contains(",°C,,"), "it has figures: {pv}");
    let export = ["export", "tank", "--history", &history, "--from", &ahead, "--tags", "TIC-1.PV", "--every", "5s"];
    let (code, out, err) = run(&export);
    assert_eq!(code, Some(0), "{err}");
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines[0], "time,TIC-1.PV °C,TIC-1.PV quality");
    assert!(lines.len() > 20, "{out}");
    // A poll that comes 50 ms late is 3 s late for this plant: what is late then says so and has no value.
    let (good, late): (Vec<&str>, Vec<&str>) = lines[1..].iter().partition(|line| line.ends_with(",good"));
    assert!(!good.is_empty() && good.iter().all(|line| !line.contains(",,")), "{out}");
    assert!(late.iter().all(|line| line.contains(",,uncertain: ")), "{out}");
}

#[test]
fn a_history_in_use_is_named_with_its_process() {
    let folder = folder();
    let history = folder.path().join("demo.duckdb");
    let history = history.to_str().unwrap();
    let mut demo = Process::start(sightglass().args(["demo", "--headless", "--for", "1h", "--history", history]));
    demo.wait_for("connected");
    // The line may be connected before the station has begun with its history.
    let err = loop {
        let (code, _, err) = run(&["report", "tank", "--history", history, "--shift", "last", "--out", "-"]);
        if !err.contains("no history at") {
            assert_eq!(code, Some(3), "{err}");
            break err;
        }
    };
    assert!(err.contains(&demo.child.id().to_string()) && err.contains("sightglass"), "{err}");
    demo.signal("TERM");
    assert_eq!(demo.end(), Some(0));
}

/// Rows of a CSV file by a strict reader: every row has the same number of cells.
fn rows_of(path: &Path) -> Vec<csv::StringRecord> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).flexible(false).from_path(path).unwrap();
    reader.records().map(|row| row.unwrap()).collect()
}
