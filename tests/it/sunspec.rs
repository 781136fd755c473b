//! SunSpec devices built from every model, and pysunspec2 as an independent reader of them.

use std::{fs, path::Path, process::Command};

use serde_json::Value;

use crate::support::{Process, folder, free_port, sightglass, sunspec};

/// Units of the slave.
const UNITS: std::ops::RangeInclusive<u8> = 1..=13;

#[test]
fn every_point_of_every_model_is_what_pysunspec2_reads() {
    let Some(python) = sunspec() else { return };
    let (port, folder) = (free_port().to_string(), folder());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/sunspec.py");
    let mut slave = Process::start(Command::new(&python).arg(&script).args(["serve", &port, "7"]));
    slave.wait_for("ready 13");
    let mut plant =
        format!("title='S'\ntime_zone='UTC'\n[[line]]\nname='L1'\nmode='tcp'\nhost='127.0.0.1'\ntcp_port={port}\n");
    for unit in UNITS {
        let place = format!("127.0.0.1:{port}");
        let made = sightglass().args(["probe", &place, "--sunspec", "--unit", &unit.to_string()]).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        fs::write(folder.path().join(format!("u{unit}.toml")), made.stdout).unwrap();
        plant += &format!("[[device]]\nname='U{unit}'\nprofile='u{unit}'\nline='L1'\nunit={unit}\n");
    }
    let file = folder.path().join("plant.toml");
    fs::write(&file, plant).unwrap();
    let history = folder.path().join("history.duckdb");
    let station = sightglass()
        .arg("run")
        .arg(&file)
        .args(["--for", "24s", "--print", "--history"])
        .arg(&history)
        .env("XDG_STATE_HOME", folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&station.stdout).into_owned();
    let mut compared = 0;
    for unit in UNITS {
        let read = Command::new(&python).arg(&script).args(["read", &port, &unit.to_string()]).output().unwrap();
        assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
        for row in String::from_utf8_lossy(&read.stdout).lines() {
            let row: Value = serde_json::from_str(row).unwrap();
            let name = format!("U{unit}.{}", row["name"].as_str().unwrap());
            let shown = said.lines().find_map(|line| line.strip_prefix(&name)?.strip_prefix(' ')).map(str::trim);
            let shown = shown.unwrap_or_else(|| panic!("no {name} in:\n{said}"));
            assert!(is_same(shown, &row["seen"]), "{name}: {shown}, pysunspec2 has {}", row["seen"]);
            compared += 1;
        }
    }
    assert!(4_000 < compared, "{compared}");
}

/// `93.25 V  good  0.8 s` against a number, a text or nothing.
fn is_same(shown: &str, seen: &Value) -> bool {
    let Some((value, _)) = shown.split_once("  good") else {
        // An empty text is good.
        return (seen.is_null() || seen == "") && (shown.contains("bad:") || shown.starts_with("good"));
    };
    let value = value.trim();
    let Some(expected) = seen.as_f64() else {
        return seen.as_str() == Some(value.split_whitespace().collect::<Vec<_>>().join(" ").as_str());
    };
    let number = value.split(' ').next().unwrap_or_default();
    let decimals = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let half = 0.501 * 10f64.powi(-i32::try_from(decimals).unwrap());
    number.parse::<f64>().is_ok_and(|number| (number - expected).abs() <= half + 1e-12 * expected.abs())
}
