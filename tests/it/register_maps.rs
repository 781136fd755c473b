//! Register maps of others by command: what becomes a profile, what is said, and what is never overwritten.

use std::{fs, io::Write, path::Path, process::Stdio};

use crate::support::{folder, sightglass};

const LIST: &str = "address;name;type;factor;unit\n5;Flow rate;uint16;0.1;m3/h\nx;Broken;uint16;;\n6;Level;int16;;cm\n";

/// Exit code and everything that was said.
fn run(folder: &Path, args: &[&str], input: &[u8]) -> (Option<i32>, String) {
    let mut command = sightglass();
    command.args(args).current_dir(folder).env("XDG_CONFIG_HOME", folder);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A command that refuses its arguments reads nothing.
    let _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

#[test]
fn a_list_becomes_a_profile_that_passes_its_check() {
    let folder = folder();
    fs::write(folder.path().join("My meter.csv"), LIST).unwrap();
    let import = ["profile", "import", "My meter.csv"];
    let (code, said) = run(folder.path(), &import, b"");
    assert_eq!(code, Some(0), "{said}");
    for words in
        ["list, 2 of 3 rows", "line 3: `x` is not an address", "written: my_meter.toml, 2 tags", "sightglass check"]
    {
        assert!(said.contains(words), "no `{words}` in: {said}");
    }
    let (code, said) = run(folder.path(), &["check", "my_meter.toml", "--strict"], b"");
    assert_eq!(code, Some(0), "{said}");
    let text = fs::read_to_string(folder.path().join("my_meter.toml")).unwrap();
    assert!(text.contains("label = \"Flow rate\"") && text.contains("unit = \"m³/h\""), "{text}");
    let (code, said) = run(folder.path(), &import, b"");
    assert!(code == Some(2) && said.contains("my_meter.toml exists"), "never over an existing file: {said}");
    assert_eq!(run(folder.path(), &[&import[..], &["--force"]].concat(), b"").0, Some(0));
}

#[test]
fn a_plant_is_written_only_where_it_is_asked_for() {
    let folder = folder();
    let args = ["profile", "import", "-", "--out", "meter.toml", "--unit", "7"];
    let (code, said) = run(folder.path(), &args, LIST.as_bytes());
    assert_eq!((code, fs::read_dir(folder.path()).unwrap().count()), (Some(0), 1), "{said}");
    let args = [&args[..], &["--force", "--plant", "plant.toml"]].concat();
    let (code, said) = run(folder.path(), &args, LIST.as_bytes());
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = run(folder.path(), &["check", "plant.toml"], b"");
    assert_eq!(code, Some(0), "{said}");
    let plant = fs::read_to_string(folder.path().join("plant.toml")).unwrap();
    assert!(plant.contains("profile = \"meter\"") && plant.contains("unit = 7"), "{plant}");
}

#[test]
fn what_cannot_be_read_or_has_two_readings_writes_nothing() {
    let folder = folder();
    let twice = "address;name;type\n40080;W;int16\n40083;VA;int16\n";
    for (input, words) in [
        (&b""[..], "it is empty"),
        (b"\x7FELF\x00\x00", "it is not text"),
        (b"a: 1\nb: 2\nc:\n  - d: 3\n", "What can be read"),
        (twice.as_bytes(), "holding 79 (--base modicon) or holding 40080 (--base 0)"),
    ] {
        let (code, said) = run(folder.path(), &["profile", "import", "-"], input);
        assert!(code == Some(2) && said.contains(words), "{said}");
    }
    let (code, said) = run(folder.path(), &["profile", "import", "none.csv"], b"");
    assert!(code == Some(1) && said.contains("none.csv"), "{said}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    let (code, said) = run(folder.path(), &["profile", "import", "-", "--base", "0"], twice.as_bytes());
    assert_eq!(code, Some(0), "{said}");
    assert!(fs::read_to_string(folder.path().join("imported.toml")).unwrap().contains("address = 40080"));
}

#[test]
fn an_export_is_imported_again() {
    let folder = folder();
    let (code, said) =
        run(folder.path(), &["profile", "export", "eastron_sdm120", "--format", "csv", "--out", "m.csv"], b"");
    assert!(code == Some(0) && said.contains("tags as csv"), "{said}");
    let (code, said) = run(folder.path(), &["profile", "import", "m.csv"], b"");
    assert_eq!(code, Some(0), "{said}");
    assert!(fs::read_to_string(folder.path().join("m.toml")).unwrap().contains("name = \"V.L1\""));
}

#[test]
fn a_plant_names_its_profile_as_the_file_is_called() {
    let folder = folder();
    for out in ["ME31.toml", "Eastron_SDM120.toml", "own-1.toml"] {
        let import = ["profile", "import", "-", "--out", out, "--plant", "p.toml", "--force"];
        let (code, said) = run(folder.path(), &import, LIST.as_bytes());
        assert_eq!(code, Some(0), "{said}");
        let plant = fs::read_to_string(folder.path().join("p.toml")).unwrap();
        let stem = out.trim_end_matches(".toml");
        assert!(plant.contains(&format!("profile = \"{stem}\"")), "{plant}");
        assert!(said.contains(&format!("written: {out}")), "{said}");
        let (code, said) = run(folder.path(), &["check", "p.toml"], b"");
        assert_eq!(code, Some(0), "{out}: {said}");
    }
    let import = ["profile", "import", "-", "--out", "v1.2.toml", "--plant", "q.toml"];
    let (code, said) = run(folder.path(), &import, LIST.as_bytes());
    assert!(code == Some(2) && said.contains("v1.2.toml: no plant file can name this profile"), "{said}");
    assert!(!folder.path().join("v1.2.toml").exists() && !folder.path().join("q.toml").exists());
}

#[test]
fn a_column_that_may_mean_two_things_is_asked_about() {
    let folder = folder();
    let list = b"address;name;type;Ratio\n5;a;int16;10\n6;b;int16;1\n";
    let import = ["profile", "import", "-"];
    let (code, said) = run(folder.path(), &import, list);
    let words =
        "Ratio (10): factor / divisor? --column \"Ratio=factor\", --column \"Ratio=divisor\", --column \"Ratio=none\"";
    assert!(code == Some(2) && said.contains(words), "{said}");
    let (code, said) = run(folder.path(), &[&import[..], &["--column", "Rate=factor"]].concat(), list);
    assert!(code == Some(2) && said.contains("no column `Rate`: it has address, name, type, Ratio"), "{said}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    let (code, said) = run(folder.path(), &[&import[..], &["--column", "Ratio=divisor"]].concat(), list);
    assert!(code == Some(0) && said.contains("assumed: plain numbers are addresses as sent"), "{said}");
    let text = fs::read_to_string(folder.path().join("imported.toml")).unwrap();
    assert!(text.contains("scale = 0.1"), "{text}");
    let (code, said) = run(folder.path(), &[&import[..], &["--force", "--column", "Ratio=none"]].concat(), list);
    assert!(code == Some(0) && said.contains("not kept: `Ratio` of 2 rows, first in line 2"), "{said}");
}

#[test]
fn what_is_written_is_two_files_and_neither_is_a_pipe() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let args = ["profile", "import", "-", "--out", "a.toml", "--plant", "./a.toml", "--force"];
    let (code, said) = run(folder.path(), &args, LIST.as_bytes());
    assert!(code == Some(2) && said.contains("the profile and the plant file"), "{said}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    let mode = rustix::fs::Mode::from_raw_mode(0o600);
    rustix::fs::mknodat(rustix::fs::CWD, at("pipe.toml"), rustix::fs::FileType::Fifo, mode, 0).unwrap();
    let (code, said) =
        run(folder.path(), &["profile", "import", "-", "--out", "pipe.toml", "--force"], LIST.as_bytes());
    assert!(code == Some(1) && said.contains("not a regular file"), "{said}");
    let (code, said) = run(folder.path(), &["profile", "import", "pipe.toml", "--out", "b.toml"], b"");
    assert!(code == Some(1) && said.contains("not a regular file"), "{said}");
    fs::write(at("file"), "").unwrap();
    let args = ["profile", "import", "-", "--out", "c.toml", "--plant", "file/p.toml"];
    let (code, said) = run(folder.path(), &args, LIST.as_bytes());
    assert!(code == Some(1) && !at("c.toml").exists(), "nothing is left half done: {said}");
}

#[test]
fn a_profile_that_no_plant_can_name_is_checked_and_says_so() {
    let folder = folder();
    let args = ["profile", "import", "-", "--out", "a.b.toml"];
    let (code, said) = run(folder.path(), &args, LIST.as_bytes());
    assert!(code == Some(0) && said.contains("no plant file can name this profile"), "{said}");
    let (code, said) = run(folder.path(), &["check", "a.b.toml"], b"");
    assert_eq!(code, Some(0), "{said}");
}
