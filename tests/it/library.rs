//! The library of device profiles, and every type of the profile language, read back by pymodbus over all of their tags and
//! decoded by rules of its own.

use std::{path::Path, process::Command};

use crate::support::{folder, python};

#[test]
fn every_tag_of_the_library_is_what_pymodbus_reads() {
    let Some(python) = python() else { return };
    let (root, work) = (Path::new(env!("CARGO_MANIFEST_DIR")), folder());
    let read = Command::new(python)
        .arg(root.join("tests/peers/library_master.py"))
        .arg(env!("CARGO_BIN_EXE_sightglass"))
        .args([root.join("profiles/devices"), root.join("tests/peers/every_type.toml")])
        .args(["--passes", "2", "--work"])
        .arg(work.path())
        .envs(["XDG_RUNTIME_DIR", "XDG_STATE_HOME"].map(|place| (place, work.path())))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&read.stdout);
    assert!(read.status.success(), "{said}{}", String::from_utf8_lossy(&read.stderr));
    let sums = said.lines().last().unwrap_or_default();
    let count = |what: &str| -> Option<u32> {
        sums.split(", ").find_map(|part| part.strip_suffix(what)?.strip_suffix(' ')?.parse().ok())
    };
    assert!(count("profiles") > Some(150) && count("compared") > Some(13_000), "{sums}");
    assert_eq!((count("equal"), count("differing")), (count("compared"), None), "{sums}");
}
