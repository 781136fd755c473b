//! A station that ends at any of its disk operations, by a kill or by a loss of power, on disks that are full at times: see
//! `tests/crash.py`, which runs any number of seeds.

use std::{path::Path, process::Command};

use super::support::have;

#[test]
fn a_station_that_ends_anywhere_starts_with_all_it_confirmed() {
    if !(have("gcc", "gcc") && have("python3", "python3")) {
        return;
    }
    let program = Path::new(env!("CARGO_BIN_EXE_sightglass"));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/crash.py");
    let seeds = Command::new("python3").arg(script).arg(program.parent().unwrap()).args(["--seeds", "0-3"]).output();
    let seeds = seeds.unwrap();
    let said = [seeds.stdout, seeds.stderr].concat();
    assert!(seeds.status.success(), "{}", String::from_utf8_lossy(&said));
}
