//! The store against damage, a dead station and a second process.

use std::{
    cell::Cell,
    fs,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
};

use super::{
    super::{
        files::{self, SetAside},
        probe::{self, Probe, examine},
        store::Store,
    },
    PV, def, folder, good, means, open, series, step,
};
use crate::{
    history::HistoryError,
    plant::record::{AlarmEvent, Record},
    profile::io::atomic::with_suffix,
    report::testing::sec,
};

#[test]
fn a_report_without_the_station_reads_but_never_creates() {
    let (_folder, db) = folder();
    let missing = Store::open_read_only(&db, &def()).err();
    assert_eq!(missing, Some(HistoryError::Missing { path: db.display().to_string() }));
    assert!(!db.exists());
    // A station that died with a log: the log is read, the file is not changed, the curve ends.
    die_after_writing(&db);
    let (before, log) = (fs::read(&db).unwrap(), fs::read(with_suffix(&db, ".wal")).unwrap());
    let store = Store::open_read_only(&db, &def()).unwrap();
    assert_eq!(means(&store, PV, 0, 60, 3), [Some(27.0), None, None]);
    assert!((series(&store, PV, 0, 10, 1).good - 1.0).abs() < 1e-9);
    drop(store);
    assert_eq!((fs::read(&db).unwrap(), fs::read(with_suffix(&db, ".wal")).unwrap()), (before, log));
}

#[test]
fn a_history_that_is_being_built_is_no_missing_one() {
    let (_folder, db) = folder();
    let built = with_suffix(&db, ".new");
    die_after_writing(&built);
    let left = Store::open_read_only(&db, &def()).err();
    assert_eq!(left, Some(HistoryError::Missing { path: db.display().to_string() }), "left by a station that died");
    let mut holder = holder(&built);
    let error = Store::open_read_only(&db, &def()).err();
    drop(holder.stdin.take());
    holder.wait().unwrap();
    assert!(
        matches!(&error, Some(HistoryError::Locked { path, .. }) if *path == db.display().to_string()),
        "{error:?}"
    );
}

#[test]
fn a_file_that_is_no_database_is_set_aside() {
    for damage in [b"not a database".to_vec(), vec![0; 20_000], vec![0xA5; 20_000]] {
        let (_folder, db) = folder();
        fs::write(&db, &damage).unwrap();
        let opened = Store::open(&db, &def(), sec(0)).unwrap();
        let aside = with_suffix(&db, ".damaged-19700101T000000Z");
        assert_eq!(fs::read(&aside).unwrap(), damage);
        assert!(opened.trouble.unwrap().contains("set aside as"));
        opened.store.append(&[good(PV, 0, 27.0)]).unwrap();
    }
}

#[test]
fn a_file_whose_creation_was_ended_is_no_damage() {
    let (_folder, db) = folder();
    drop(open(&db, 0));
    let whole = fs::read(&db).unwrap();
    for length in [4_096, 8_192, 12_287] {
        let (folder, db) = folder();
        fs::write(&db, &whole[..length]).unwrap();
        let opened = Store::open(&db, &def(), sec(0)).unwrap();
        assert_eq!(opened.trouble, None, "{length}");
        opened.store.append(&[good(PV, 0, 27.0)]).unwrap();
        drop(opened);
        let is_aside = |entry: fs::DirEntry| entry.file_name().to_string_lossy().contains("damaged");
        assert!(!fs::read_dir(folder.path()).unwrap().flatten().any(is_aside), "{length}");
        // One that has held records is no new one.
        fs::write(&db, &whole[..length]).unwrap();
        assert!(Store::open(&db, &def(), sec(0)).unwrap().trouble.unwrap().contains("set aside as"), "{length}");
    }
}

#[test]
fn a_file_cut_or_scribbled_over_is_set_aside() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&(0..20_000).map(|i| good(PV, i, f64::from(i as u32).sqrt())).collect::<Vec<_>>()).unwrap();
    drop(store);
    let whole = fs::read(&db).unwrap();
    let mut scribbled = whole.clone();
    scribbled[4096..12_288].fill(0x5A);
    for damaged in [whole[..whole.len() / 2].to_vec(), whole[..16_384].to_vec(), scribbled] {
        fs::write(&db, &damaged).unwrap();
        // In a process of its own, because DuckDB may end the process.
        let opens = open_until_it_lives(&db);
        assert!(opens <= 3, "{opens} opens");
        let aside = fs::read_dir(db.parent().unwrap())
            .unwrap()
            .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().contains(".damaged-"));
        assert_eq!(aside.count(), 1);
        for entry in fs::read_dir(db.parent().unwrap()).unwrap() {
            fs::remove_file(entry.unwrap().path()).unwrap();
        }
    }
}

#[test]
fn a_log_torn_at_any_length_never_keeps_the_station_down() {
    let (_folder, db) = folder();
    die_after_writing(&db);
    let (file, log) = (fs::read(&db).unwrap(), fs::read(with_suffix(&db, ".wal")).unwrap());
    assert!(log.len() > 100, "the child left a log");
    let cuts = [0, 1, 7, 20, log.len() / 3, log.len() / 2, log.len() - 9, log.len() - 1];
    let torn = cuts.map(|cut| log[..cut].to_vec());
    let flipped = [30, log.len() / 2, log.len() - 20].map(|at| {
        let mut log = log.clone();
        log[at] ^= 0xFF;
        log
    });
    for torn in torn.into_iter().chain(flipped) {
        fs::write(&db, &file).unwrap();
        fs::write(with_suffix(&db, ".wal"), &torn).unwrap();
        let opens = open_until_it_lives(&db);
        assert!(opens <= 3, "{opens} opens");
        // What a checkpoint had brought into the file is still there, whatever happened to the log.
        let store = Store::open(&db, &def(), sec(20)).unwrap().store;
        assert!((0..5).all(|second| means(&store, PV, second, second + 1, 1) == [Some(27.0)]));
    }
}

#[test]
fn only_files_that_fail_by_themselves_are_set_aside() {
    let (_folder, db) = folder();
    die_after_writing(&db);
    let log = with_suffix(&db, ".wal");
    let killed = || Probe::Obstacle(HistoryError::Engine("opening it was ended by signal 9".into()));
    let crash = || Probe::Damaged("signal 6".into());
    let files = || [&db, &log].map(|path| fs::read(path).ok());
    let examine = |probe: &dyn Fn(&Path) -> Probe| examine(&db, sec(0), probe).map(|proven| proven.map(|p| p.part));
    let before = files();
    // What ends processes from outside proves nothing, however often; nor does one crash.
    for _ in 0..10 {
        assert!(matches!(examine(&|_| killed()), Err(HistoryError::Engine(_))));
    }
    let once = Cell::new(false);
    assert_eq!(examine(&|_| if once.replace(true) { Probe::Sound } else { crash() }), Ok(None));
    // A copy of the log opens; a kill while the copy is tried.
    let tries = Cell::new(0);
    let count = || tries.replace(tries.get() + 1);
    assert_eq!(examine(&|_| if count() < 2 { crash() } else { Probe::Sound }), Ok(None));
    assert_eq!(files(), before);
    tries.set(0);
    assert!(examine(&|_| if count() < 3 { crash() } else { killed() }).is_err());
    assert_eq!(files(), before);
    assert_eq!(fs::read_dir(db.parent().unwrap()).unwrap().count(), 3, "file, log and last commit");
    // Whatever is tried with the log fails: it is the log.
    assert_eq!(examine(&|db| if files::has_log(db) { crash() } else { Probe::Sound }), Ok(Some(SetAside::Log)));
    assert_eq!(files(), [before[0].clone(), None]);
    assert_eq!(fs::read(with_suffix(&db, ".damaged-19700101T000000Z.wal")).ok(), before[1]);
    // The file with it: they stay together.
    fs::write(&log, before[1].as_ref().unwrap()).unwrap();
    assert_eq!(examine(&|_| crash()), Ok(Some(SetAside::Everything)));
    let aside = with_suffix(&db, ".damaged-19700101T000000Z-2");
    assert_eq!([&aside, &with_suffix(&aside, ".wal")].map(|path| fs::read(path).ok()), before);
    assert_eq!(files(), [None, None]);
}

#[test]
fn a_sound_history_survives_any_number_of_kills() {
    let (_folder, db) = folder();
    open(&db, 0).append(&[good(PV, 0, 27.0)]).unwrap();
    let guard = with_suffix(&db, ".opening");
    for kills in ["1", "2", "3", "4294967295"] {
        fs::write(&guard, kills).unwrap();
        assert_eq!(means(&open(&db, 0), PV, 0, 1, 1), [Some(27.0)], "{kills}");
        assert!(!guard.exists());
    }
    // Where nothing can be known it stays as it is, and so does the suspicion.
    fs::write(&guard, "3").unwrap();
    let aside = with_suffix(&db, ".elsewhere");
    fs::rename(&db, &aside).unwrap();
    fs::create_dir(&db).unwrap();
    assert!(Store::open(&db, &def(), sec(0)).is_err());
    assert!(guard.exists() && db.is_dir());
    fs::remove_dir(&db).unwrap();
    fs::rename(&aside, &db).unwrap();
    assert_eq!(means(&open(&db, 0), PV, 0, 1, 1), [Some(27.0)]);
}

/// A process that has the file open.
fn holder(db: &Path) -> Child {
    let mut holder = child("hold", db);
    let mut ready = String::new();
    let mut lines = BufReader::new(holder.stdout.take().unwrap());
    while !ready.contains("ready") {
        ready.clear();
        assert_ne!(lines.read_line(&mut ready).unwrap(), 0, "the child ended");
    }
    holder
}

#[test]
fn a_second_process_learns_who_has_the_file() {
    let (_folder, db) = folder();
    let mut holder = holder(&db);
    let expect = format!("process {} (", holder.id());
    let refused = [Store::open(&db, &def(), sec(0)).err(), Store::open_read_only(&db, &def()).err()];
    drop(holder.stdin.take());
    holder.wait().unwrap();
    for error in refused {
        match error {
            Some(HistoryError::Locked { path, by }) => {
                assert_eq!(path, db.display().to_string());
                assert!(by.starts_with(&expect), "{by}");
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(!with_suffix(&db, ".opening").exists());
    open(&db, 0);
}

// What follows runs in child processes: this test program again, with one helper test and a job in the environment.

const JOB: &str = "SIGHTGLASS_TEST_JOB";
pub(super) const FILE: &str = "SIGHTGLASS_TEST_FILE";

pub(super) fn child(job: &str, db: &Path) -> Child {
    let mut command = job_command(job, db);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
}

fn job_command(job: &str, db: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "history::io::tests::damage::job_of_a_child_process", "--nocapture"]);
    command.env(JOB, job).env(FILE, db);
    command
}

/// What this test program is started with to open a history as [`probe`](super::super::probe) does.
pub(in super::super) fn probe_command(db: &Path) -> Command {
    job_command("probe", db)
}

/// A child commits a few seconds of records and dies without closing anything.
pub(super) fn die_after_writing(db: &Path) {
    assert!(!child("write and die", db).wait().unwrap().success());
}

/// Starts processes until one opens the store and stores something; returns how many it took.
fn open_until_it_lives(db: &Path) -> usize {
    (1..=5).find(|_| child("open", db).wait().unwrap().success()).expect("one of five opens is good")
}

/// Does a job if the environment names one; in an ordinary run it checks that none is named.
#[test]
fn job_of_a_child_process() {
    let Ok(job) = std::env::var(JOB) else {
        assert_eq!(std::env::var(FILE).ok(), None);
        return;
    };
    let db = PathBuf::from(std::env::var(FILE).unwrap());
    if super::flips::job(&job) {
        return;
    }
    if job == "probe" {
        let _ = probe::child(&db);
        return;
    }
    let store = Store::open(&db, &def(), sec(20)).unwrap().store;
    match job.as_str() {
        "write and die" => {
            for second in 0..10 {
                if second == 5 {
                    store.checkpoint().unwrap();
                }
                store
                    .append(&[good(PV, second, 27.0), Record::Alarm(step(second, "high", AlarmEvent::Raised))])
                    .unwrap();
            }
            std::process::abort();
        }
        "open" => store.append(&[good(PV, 20, 28.0)]).unwrap(),
        "hold" => {
            let mut out = std::io::stdout();
            writeln!(out, "\nready").and_then(|()| out.flush()).unwrap();
            let mut rest = String::new();
            std::io::stdin().read_line(&mut rest).unwrap();
        }
        other => panic!("no such job: {other}"),
    }
}
