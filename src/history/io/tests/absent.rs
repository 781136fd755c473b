//! A history that cannot be opened, or that goes away: nothing is lost, and everything is caught up.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
};

use super::{
    super::{thread, writer::PENDING_MAX, writer::Writer},
    PV, SV,
    damage::child,
    def, folder, good, means, open, step,
};
use crate::{
    bus::io::clock::Clock,
    plant::record::{AlarmEvent, Record},
    profile::io::atomic::with_suffix,
    report::testing::sec,
};

/// A writer whose store could not be opened.
fn without_store(db: &Path, why: &str) -> Writer {
    let mut writer = Writer::new(db.to_owned(), def(), sec(0));
    assert!(writer.wants_store());
    let opened = writer.opener(sec(0))();
    writer.opened(opened, sec(0));
    let failing = writer.status().failing.clone().unwrap_or_default();
    assert!(failing.contains(why), "{failing}");
    writer
}

/// Commits once a second until the store is wanted again, then opens it.
fn retry(writer: &mut Writer, from: i64) -> i64 {
    let mut second = from;
    while !writer.wants_store() {
        second += 1;
        assert!(second < from + 10, "it is tried every few seconds");
        writer.commit(sec(second));
    }
    let opened = writer.opener(sec(second))();
    writer.opened(opened, sec(second));
    second
}

#[test]
fn whatever_stands_in_the_way_records_wait_and_are_caught_up() {
    type Way = fn(&Path);
    let ways: [(&str, Way, Way); 3] = [
        ("Is a directory", |db| fs::create_dir_all(db).unwrap(), |db| fs::remove_dir(db).unwrap()),
        (
            "File exists",
            |db| fs::write(db.parent().unwrap(), "a file where the folder should be").unwrap(),
            |db| fs::remove_file(db.parent().unwrap()).unwrap(),
        ),
        (
            "Is a directory",
            |db| fs::create_dir_all(with_suffix(db, ".opening")).unwrap(),
            |db| fs::remove_dir(with_suffix(db, ".opening")).unwrap(),
        ),
    ];
    for (why, block, free) in ways {
        let folder = tempfile::tempdir().unwrap();
        let db = folder.path().join("state").join("tank.duckdb");
        block(&db);
        let mut writer = without_store(&db, why);
        writer.accept(vec![good(PV, 0, 27.0), Record::Alarm(step(0, "high", AlarmEvent::Raised))]);
        let second = retry(&mut writer, 0);
        assert_eq!((writer.status().rows, writer.status().waiting, writer.status().lost), (0, 2, 0), "{why}");
        assert!(writer.status().words().unwrap().starts_with("not recording: 2 records waiting (0 %)"));
        free(&db);
        let second = retry(&mut writer, second);
        assert_eq!((writer.status().rows, writer.status().waiting, writer.status().lost), (2, 0, 0), "{why}");
        assert_eq!((writer.status().words(), writer.take_restored().is_some()), (None, true));
        writer.finish(sec(second));
        assert_eq!(means(&open(&db, 100), PV, 0, 1, 1), [Some(27.0)]);
    }
}

#[test]
fn a_full_buffer_drops_samples_first_and_counts_them() {
    let (folder, db) = folder();
    fs::create_dir(&db).unwrap();
    let mut writer = without_store(&db, "Is a directory");
    writer.accept(vec![Record::Alarm(step(0, "high", AlarmEvent::Raised))]);
    for second in 0..PENDING_MAX as i64 {
        writer.accept(vec![good(SV, second, 1.0)]);
    }
    let status = writer.status().clone();
    assert_eq!(status.waiting + status.lost, PENDING_MAX as u64 + 1);
    assert_eq!((status.waiting, status.waiting_max), (PENDING_MAX as u64 * 3 / 4, PENDING_MAX as u64));
    fs::remove_dir(&db).unwrap();
    retry(&mut writer, 0);
    assert_eq!(writer.store().unwrap().restore().unwrap(), [step(0, "high", AlarmEvent::Raised)]);
    assert_eq!(writer.status().rows, status.waiting);
    drop(folder);
}

#[test]
fn a_removed_or_replaced_file_is_noticed() {
    for replaced in [false, true] {
        let (folder, db) = folder();
        let mut writer = Writer::open(db.clone(), def(), sec(0)).unwrap();
        writer.accept(vec![good(PV, 0, 27.0)]);
        writer.commit(sec(1));
        let other = folder.path().join("other.duckdb");
        if replaced {
            open(&other, 0).append(&[good(PV, 50, 50.0)]).unwrap();
            fs::rename(&other, &db).unwrap();
        } else {
            fs::remove_file(&db).unwrap();
        }
        writer.accept(vec![good(PV, 2, 28.0)]);
        writer.commit(sec(2));
        assert_eq!(writer.status().waiting, 1, "it is not written into the file that was removed");
        retry(&mut writer, 2);
        assert_eq!((writer.status().rows, writer.status().lost, writer.status().waiting), (2, 0, 0));
        let damaged = writer.status().damaged.clone().unwrap();
        assert!(damaged.contains("removed or replaced"), "{damaged}");
        assert_eq!(means(writer.store().unwrap(), PV, 2, 3, 1), [Some(28.0)]);
        writer.finish(sec(3));
        assert_eq!(means(&open(&db, 100), PV, 2, 3, 1), [Some(28.0)]);
    }
}

#[test]
fn a_log_removed_under_the_station_takes_nothing_with_it() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db.clone(), def(), sec(0)).unwrap();
    writer.accept(vec![good(PV, 0, 27.0)]);
    writer.commit(sec(0));
    fs::remove_file(with_suffix(&db, ".wal")).unwrap();
    writer.accept(vec![good(PV, 1, 28.0)]);
    writer.commit(sec(1));
    // What a kill leaves behind.
    let copy = db.parent().unwrap().join("copy.duckdb");
    for suffix in ["", ".wal", ".last"] {
        let _ = fs::copy(with_suffix(&db, suffix), with_suffix(&copy, suffix));
    }
    assert_eq!(means(&open(&copy, 100), PV, 0, 2, 2), [Some(27.0), Some(28.0)]);
}

#[test]
fn what_a_full_disk_leaves_of_a_new_file_is_no_damage() {
    let (folder, db) = folder();
    fs::write(&db, "").unwrap();
    let writer = Writer::open(db, def(), sec(0)).unwrap();
    assert_eq!(writer.status().damaged, None);
    let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(names.filter(|name| name.contains("damaged")).count(), 0);
}

#[test]
fn a_history_removed_while_the_station_was_off_is_said() {
    let (_folder, db) = folder();
    open(&db, 0).append(&[good(PV, 0, 27.0)]).unwrap();
    fs::remove_file(&db).unwrap();
    let writer = Writer::open(db.clone(), def(), sec(9)).unwrap();
    let damaged = writer.status().damaged.clone().unwrap();
    assert!(damaged.contains("removed or replaced"), "{damaged}");
    drop(writer);
    assert_eq!(Writer::open(db, def(), sec(9)).unwrap().status().damaged, None, "once");
}

#[test]
fn a_history_in_use_is_named_waited_for_and_caught_up() {
    let (_folder, db) = folder();
    let mut holder = child("hold", &db);
    let mut lines = BufReader::new(holder.stdout.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("ready")));
    let handle = thread::start(&db, def(), Clock::starting_at(sec(10), 1.0)).unwrap();
    handle.records.blocking_send(vec![good(PV, 10, 27.0)].into()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut status = handle.status.clone();
    let waiting = runtime.block_on(status.wait_for(|status| status.failing.is_some() && status.waiting == 1));
    let failing = waiting.unwrap().failing.clone().unwrap();
    assert!(failing.contains(&format!("in use by process {}", holder.id())), "{failing}");
    drop(holder.stdin.take());
    holder.wait().unwrap();
    runtime.block_on(status.wait_for(|status| status.rows == 1 && status.failing.is_none())).unwrap();
    handle.stop();
    assert_eq!(means(&open(&db, 100), PV, 10, 11, 1), [Some(27.0)]);
}
