//! What a loss of power leaves of a database and its log.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use super::{
    super::{blocks, store::Store},
    PV,
    damage::die_after_writing,
    def, folder, good, means,
};
use crate::{profile::io::atomic::with_suffix, report::testing::sec};

/// Bytes of a block, and of the headers before the first.
const BLOCK: usize = 262_144;
const HEADERS: usize = 3 * PAGE;
const PAGE: usize = 4096;

#[test]
fn a_log_whose_last_commit_never_ended_loses_nothing_else() {
    let (folder, db) = folder();
    die_after_writing(&db);
    let (file, log) = (fs::read(&db).unwrap(), fs::read(with_suffix(&db, ".wal")).unwrap());
    // The disk has the length of an entry and not its bytes, or its beginning and not its end.
    let half = [&log[..], &200u64.to_le_bytes(), &[7; 8], &log[log.len() - 20..], &[0; 180]].concat();
    for (what, torn) in [("zeros", [&log[..], &[0; 400]].concat()), ("half an entry", half)] {
        fs::write(&db, &file).unwrap();
        fs::write(with_suffix(&db, ".wal"), &torn).unwrap();
        let opened = Store::open(&db, &def(), sec(20)).unwrap();
        assert_eq!(opened.trouble, None, "{what}");
        assert!((0..5).all(|second| means(&opened.store, PV, second, second + 1, 1) == [Some(27.0)]), "{what}");
        drop(opened);
        let files = fs::read_dir(folder.path()).unwrap().flatten();
        let aside = files.filter(|file| file.file_name().to_string_lossy().contains("damaged"));
        assert_eq!(aside.count(), 0, "{what}");
    }
}

/// A database and its log in the middle of a checkpoint: of the blocks that it overwrites, all but one page is new.
fn torn_by_a_checkpoint(folder: &Path) -> PathBuf {
    let (db, torn) = (folder.join("tank.duckdb"), folder.join("torn.duckdb"));
    let store = Store::open(&db, &def(), sec(0)).unwrap().store;
    store.append(&[good(PV, 1, 27.0)]).unwrap();
    store.checkpoint().unwrap();
    store.append(&[good(PV, 2, 28.0)]).unwrap();
    store.keep_blocks().unwrap();
    // By another process: closing the file here would end the locks of the engine.
    let copy = |from: PathBuf, to: PathBuf| assert!(Command::new("cp").args([from, to]).status().unwrap().success());
    [".wal", ".blocks", ""].iter().for_each(|of| copy(with_suffix(&db, of), with_suffix(&torn, of)));
    store.checkpoint().unwrap();
    assert!(!with_suffix(&db, ".blocks").exists(), "a checkpoint that has ended needs none");
    drop(store);
    let (mut before, after) = (fs::read(&torn).unwrap(), fs::read(&db).unwrap());
    let mut overwritten = 0;
    for block in (HEADERS..before.len().min(after.len())).step_by(BLOCK) {
        let differ = |at: &usize| before[*at] != after[*at];
        // The checksum leads it; the page that was to be written last is as before.
        let Some(last) = (block..block + BLOCK).rfind(differ).map(|at| block + (at - block) / PAGE * PAGE) else {
            continue;
        };
        before[block..last].copy_from_slice(&after[block..last]);
        overwritten += 1;
    }
    assert!(0 < overwritten);
    fs::write(&torn, before).unwrap();
    torn
}

#[test]
fn power_lost_during_a_checkpoint_costs_nothing() {
    let (folder, _) = folder();
    let torn = torn_by_a_checkpoint(folder.path());
    let files = ["", ".wal", ".blocks"].map(|of| (with_suffix(&torn, of), fs::read(with_suffix(&torn, of)).unwrap()));
    let open = |kept: bool| {
        files.iter().for_each(|(path, bytes)| fs::write(path, bytes).unwrap());
        if !kept {
            fs::remove_file(&files[2].0).unwrap();
        }
        let opened = Store::open(&torn, &def(), sec(20)).unwrap();
        (opened.trouble.clone(), [1, 2].map(|second| means(&opened.store, PV, second, second + 1, 1)))
    };
    assert_eq!(open(true), (None, [vec![Some(27.0)], vec![Some(28.0)]]));
    let (trouble, _) = open(false);
    assert!(trouble.is_some_and(|words| words.contains("damaged")), "without them it is damaged");
}

#[test]
fn blocks_of_other_headers_are_never_put_back() {
    let (folder, _) = folder();
    let torn = torn_by_a_checkpoint(folder.path());
    let before = fs::read(&torn).unwrap();
    let kept = fs::read(with_suffix(&torn, ".blocks")).unwrap();
    let mut later = before.clone();
    later[4096 + 8] ^= 1;
    let mut damaged = kept.clone();
    *damaged.last_mut().unwrap() ^= 1;
    for (file, kept) in [(&later, &kept[..]), (&before, &damaged), (&before, &kept[..40]), (&before, &[])] {
        fs::write(&torn, file).unwrap();
        fs::write(with_suffix(&torn, ".blocks"), kept).unwrap();
        assert!(!blocks::put_back(&torn).unwrap());
        assert!(fs::read(&torn).unwrap() == *file);
    }
    fs::write(&torn, &before).unwrap();
    fs::write(with_suffix(&torn, ".blocks"), kept).unwrap();
    assert!(blocks::put_back(&torn).unwrap());
    assert!(fs::read(&torn).unwrap() != before);
}

#[test]
fn a_disk_that_takes_no_blocks_is_waited_for() {
    let (folder, _) = folder();
    let torn = torn_by_a_checkpoint(folder.path());
    let kept = with_suffix(&torn, ".blocks");
    let (aside, before) = (with_suffix(&kept, ".aside"), fs::read(&torn).unwrap());
    // What cannot be read now: a folder, as a disk that fails.
    fs::rename(&kept, &aside).unwrap();
    fs::create_dir(&kept).unwrap();
    let refused = Store::open(&torn, &def(), sec(20)).err().expect("no opening");
    assert!(refused.to_string().contains("last checkpoint"), "{refused}");
    assert!(fs::read(&torn).unwrap() == before, "nothing is set aside");
    fs::remove_dir(&kept).unwrap();
    fs::rename(&aside, &kept).unwrap();
    assert_eq!(Store::open(&torn, &def(), sec(20)).unwrap().trouble, None);
}

#[test]
fn a_cut_of_the_log_that_was_killed_is_ended_later() {
    let (folder, db) = folder();
    die_after_writing(&db);
    let whole = with_suffix(&db, ".cut");
    // It was copied, and perhaps cut, when the station was killed.
    fs::write(&whole, "the log before").unwrap();
    let opened = Store::open(&db, &def(), sec(20)).unwrap();
    assert_eq!((opened.trouble, whole.exists()), (None, false));
    drop(opened.store);
    // Something that was confirmed is missing: the log before is kept.
    let noted = fs::read(with_suffix(&db, ".last")).unwrap();
    let store = Store::open(&db, &def(), sec(30)).unwrap().store;
    store.append(&[good(PV, 31, 1.0)]).unwrap();
    let later = fs::read(with_suffix(&db, ".last")).unwrap();
    assert_ne!(noted, later);
    drop(store);
    fs::write(&whole, "the log before").unwrap();
    let (file, last) = (fs::read(&db).unwrap(), with_suffix(&db, ".last"));
    let store = Store::open(&db, &def(), sec(40)).unwrap().store;
    store.append(&[good(PV, 41, 1.0)]).unwrap();
    let confirmed = fs::read(&last).unwrap();
    drop(store);
    fs::write(&db, file).unwrap();
    fs::write(&last, confirmed).unwrap();
    fs::write(&whole, "the log before").unwrap();
    let trouble = Store::open(&db, &def(), sec(50)).unwrap().trouble.expect("a commit is missing");
    assert!(trouble.contains("its damaged log is set aside as"), "{trouble}");
    let kept = fs::read_dir(folder.path()).unwrap().flatten();
    assert_eq!(kept.filter(|file| file.file_name().to_string_lossy().contains("damaged")).count(), 1);
}
