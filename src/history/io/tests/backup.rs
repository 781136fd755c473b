//! Backups and what is restored from them: all of it or nothing, whatever ends the program in between.

use std::{collections::BTreeSet, fs, path::Path, sync::Arc, time::Duration};

use tokio::sync::oneshot;

use super::{
    archive::{HOUR_S, archive_all, content, filled, rows},
    *,
};
use crate::{
    bus::io::clock::Clock,
    history::io::{HistoryJob, JobRequest, archive::Steps, backup::read_manifest, restore, thread},
};

const HOURS: i64 = 30;

fn steps() -> impl FnMut(&'static str) -> Result<(), HistoryError> {
    |_| Ok(())
}

/// Fails at a step, as if the program were killed there.
fn killed_at(kill: usize) -> impl FnMut(&'static str) -> Result<(), HistoryError> {
    let mut step = 0;
    move |_| {
        step += 1;
        if step == kill { Err(HistoryError::NotOpen) } else { Ok(()) }
    }
}

/// A history with everything that one has, archived but for its last hours.
fn history(db: &Path) -> Store {
    let store = filled(db, &rows(HOURS));
    store.append(&[Record::Alarm(step(50, "high", AlarmEvent::Raised)), Record::Action(action(60))]).unwrap();
    archive_all(&store, HOURS - 1);
    store
}

fn back_up(store: &Store, to: &Path) -> Result<crate::history::backup::Backup, HistoryError> {
    store.back_up(to, &[], sec(HOURS * HOUR_S), &mut steps())
}

/// All that can be asked of a history.
fn everything(store: &Store) -> (Vec<(u16, Sample)>, Vec<Answer>) {
    let (from, to) = (sec(-1_000), sec(200 * HOUR_S));
    let all = String::new;
    let queries = [
        Query::Journal { from, to, limit: 100 },
        Query::Actions { from, to, limit: 100 },
        Query::Audit { from, to, words: all(), by: all(), action: all(), limit: 100 },
        Query::Series { tags: vec![PV, SV], from: sec(0), to: sec(HOURS * HOUR_S), buckets: 77 },
        Query::Report { period: Period::free(sec(500), sec(20 * HOUR_S)) },
    ];
    let answers = queries.map(|query| store.answer(&query, sec(HOURS * HOUR_S)).unwrap());
    (content(store), answers.into())
}

fn restored(from: &Path, db: &Path) -> PathBuf {
    let sound = restore::verify(from).unwrap();
    let aside = restore::prepare(from, &sound.backup, db, None, &[], sec(0)).unwrap();
    restore::commit(db).unwrap();
    aside
}

fn names(folder: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.path().is_dir() {
            true => names.extend(super::backup::names(&entry.path())),
            false => drop(names.insert(entry.file_name().into_string().unwrap())),
        }
    }
    names
}

#[test]
fn what_is_restored_is_what_was_backed_up() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    let backup = back_up(&store, &to).unwrap();
    assert_eq!((backup.missing.len(), backup.files.len()), (0, store.files(None).unwrap().len() + 2));
    let expect = everything(&store);
    store.append(&[good(PV, HOURS * HOUR_S + 7, 1.0), Record::Action(action(HOURS * HOUR_S))]).unwrap();
    archive_all(&store, HOURS);
    let before = everything(&store);
    drop(store);
    let aside = restored(&to, &db);
    // Who only reads cannot finish it; a station that starts does.
    let why = Store::open_read_only(&db, &def()).err().unwrap().to_string();
    assert!(why.contains("a restore was interrupted"), "{why}");
    let opened = Store::open(&db, &def(), sec(HOURS * HOUR_S)).unwrap();
    assert_eq!(opened.trouble, None);
    assert!(everything(&opened.store) == expect);
    drop(opened);
    // A closed history is backed up without a change to it.
    let closed = Store::open_read_only(&db, &def()).unwrap();
    let again = back_up(&closed, &to).unwrap();
    assert_eq!((again.files.len(), again.until), (backup.files.len(), backup.until));
    drop(closed);
    let kept = Store::open_read_only(&aside.join("tank.duckdb"), &def()).unwrap();
    assert!(everything(&kept) == before, "the history before is set aside as a whole");
    // On another machine nothing was there before.
    let (_three, other) = folder();
    let aside = restored(&to, &other);
    assert!(restore::finish(&other).unwrap().is_some() && !aside.exists());
    assert!(everything(&Store::open_read_only(&other, &def()).unwrap()) == expect);
}

#[test]
fn a_second_backup_adds_what_is_new() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    let first = back_up(&store, &to).unwrap();
    let later: Vec<Record> = (0..HOUR_S).map(|second| good(PV, 60 * HOUR_S + second, 5.0)).collect();
    store.append(&later).unwrap();
    archive_all(&store, 62);
    // One that was damaged there is copied once more.
    let day = first.files.iter().find(|file| file.path.ends_with("raw/date=1970-01-01/day.parquet")).unwrap();
    fs::write(to.join(day.stored()), "damaged").unwrap();
    let same = first.files.iter().find(|file| file.path.ends_with("m1/date=1970-01-01/day.parquet")).unwrap();
    let written = || fs::metadata(to.join(same.stored())).unwrap().modified().unwrap();
    let before = written();
    let second = back_up(&store, &to).unwrap();
    assert!(second.files.contains(same) && second.files.contains(day));
    assert_eq!(written(), before, "it is not copied again");
    let expect: BTreeSet<String> =
        second.files.iter().map(|file| file.stored().rsplit('/').next().unwrap().to_owned()).collect();
    let mut found = names(&to);
    assert!(found.remove("backup.json"));
    assert_eq!(found, expect, "nothing is left of the first one");
    assert_eq!(restore::verify(&to).unwrap().backup, second);
}

#[test]
fn a_killed_backup_is_never_taken_for_a_whole_one() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    let mut whole = None;
    for round in 0..2 {
        let mut kill = 0;
        loop {
            kill += 1;
            let done = store.write_killed(&to, sec(round), &mut killed_at(kill));
            match (&whole, restore::verify(&to)) {
                (None, Err(why)) if done.is_err() => assert!(why.to_string().contains("it is not a backup"), "{why}"),
                (_, Ok(sound)) => {
                    let expect = done.as_ref().ok().or(whole.as_ref());
                    assert_eq!(Some(&sound.backup), expect, "killed at step {kill}");
                }
                (_, Err(why)) => panic!("{why}"),
            }
            if let Ok(backup) = done {
                whole = Some(backup);
                break;
            }
        }
        assert!(kill > 10, "{kill}");
        store.append(&[good(PV, 60 * HOUR_S + round, 5.0)]).unwrap();
        archive_all(&store, 64);
    }
    let last = back_up(&store, &to).unwrap();
    assert_eq!(names(&to).len(), last.files.len() + 1, "nothing is left of those that were killed");
}

#[test]
fn a_kill_at_any_step_of_a_restore_costs_nothing() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    back_up(&store, &to).unwrap();
    let expect = everything(&store);
    drop(store);
    for kill in 1.. {
        let (_folder, db) = folder();
        let before = filled(&db, &rows(2));
        archive_all(&before, 2);
        let old = content(&before);
        drop(before);
        fs::create_dir_all(db.with_extension("restoring.new").join("half")).unwrap();
        let sound = restore::verify(&to).unwrap();
        let aside = restore::prepare(&to, &sound.backup, &db, None, &[], sec(0)).unwrap();
        assert!(content(&Store::open_read_only(&db, &def()).unwrap()) == old, "before it counts");
        restore::commit(&db).unwrap();
        let steps: Steps = &mut killed_at(kill);
        let finished = restore::finish_in_steps(&db, steps);
        let opened = Store::open(&db, &def(), sec(HOURS * HOUR_S)).unwrap();
        assert_eq!(opened.trouble, None, "killed at step {kill}");
        assert!(everything(&opened.store) == expect, "killed at step {kill}");
        assert!(content(&Store::open_read_only(&aside.join("tank.duckdb"), &def()).unwrap()) == old);
        assert!(!db.with_extension("restoring").exists());
        if finished.is_ok() {
            assert!(kill > 8, "{kill}");
            break;
        }
    }
}

#[test]
fn folders_that_are_no_place_for_a_backup_are_refused() {
    let ((one, db), (two, other)) = (folder(), folder());
    let store = history(&db);
    let refused = |to: &Path| back_up(&store, to).unwrap_err().to_string();
    assert!(refused(one.path()).contains("the history itself lies here"));
    assert!(refused(&db.with_extension("archive").join("raw")).contains("the history itself lies here"));
    assert!(refused(&two.path().join("none/deeper")).contains("No such file"));
    assert!(refused(&db).contains("found a file, expected a folder"));
    fs::write(two.path().join("notes.txt"), "mine").unwrap();
    assert!(refused(two.path()).contains("it has other files (notes.txt)"));
    // That of another history, and one that is being written.
    back_up(&filled(&other, &rows(1)), &two.path().join("other")).unwrap();
    assert!(refused(&two.path().join("other")).contains("it has the backup of another history"));
    let busy = two.path().join("busy");
    fs::create_dir(&busy).unwrap();
    let lock = fs::File::open(&busy).unwrap();
    lock.lock().unwrap();
    assert!(refused(&busy).contains("another backup is being written to it"));
    drop(lock);
    // A failure in between leaves nothing behind.
    let place = two.path().join("place");
    store.back_up(&place, &[], sec(0), &mut killed_at(5)).unwrap_err();
    assert!(!place.exists());
}

#[test]
fn damage_is_named_and_never_restored() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    let hour = store.files(None).unwrap().into_iter().next_back().unwrap();
    fs::remove_file(store.archive_folder().join(&hour.path)).unwrap();
    let backup = back_up(&store, &to).unwrap();
    assert_eq!(backup.missing, std::slice::from_ref(&hour.path));
    assert!(backup.summary().contains(&hour.path));
    restore::verify(&to).unwrap();
    for file in &backup.files {
        let path = to.join(file.stored());
        let good = fs::read(&path).unwrap();
        let mut bytes = good.clone();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, bytes).unwrap();
        let why = restore::verify(&to).unwrap_err().to_string();
        assert!(why.contains("1 of its") && why.ends_with(&file.path), "{why}");
        fs::write(&path, good).unwrap();
    }
    let manifest = fs::read_to_string(to.join("backup.json")).unwrap();
    let outside = manifest.replace("archive/raw/", "archive/../");
    fs::write(to.join("backup.json"), outside).unwrap();
    assert!(restore::verify(&to).unwrap_err().to_string().contains("which no backup has"));
    fs::write(to.join("backup.json"), "{").unwrap();
    assert!(read_manifest(&to).unwrap_err().to_string().contains("it is not the manifest of a backup"));
}

#[test]
fn a_backup_while_records_come_is_of_one_instant() {
    let ((_one, db), (_two, to)) = (folder(), folder());
    let store = history(&db);
    let copy = store.try_clone().unwrap();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let commits = std::thread::scope(|scope| {
        let (stop, to) = (&stop, &to);
        let backups = scope.spawn(move || {
            for _ in 0..5 {
                let backup = back_up(&copy, to).unwrap();
                let found = Store::peek(&to.join(backup.files[0].stored())).unwrap();
                let number = found.last_commit().number;
                // Two rows a commit, the last one of the last commit.
                let sql = "SELECT count(*), max(value) FROM sample WHERE utc >= make_timestamp(432000000000)";
                let row = |row: &duckdb::Row| Ok((row.get::<_, u64>(0)?, row.get::<_, Option<f64>>(1)?));
                let (count, last) = found.db.query_row(sql, [], row).unwrap();
                assert_eq!((count % 2, last.unwrap_or(number as f64)), (0, number as f64));
            }
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        });
        let mut commits = 0;
        while !stop.load(std::sync::atomic::Ordering::Relaxed) && !backups.is_finished() {
            let number = store.last_commit().number + 1;
            let at = 120 * HOUR_S + number as i64;
            store.append(&[good(PV, at, number as f64), good(SV, at, 0.0)]).unwrap();
            commits += 1;
        }
        commits
    });
    assert!(commits > 10, "{commits}");
}

#[test]
fn a_backup_waits_until_the_history_is_open() {
    let (folder, db) = folder();
    let (commit_every, answer) = (Duration::from_millis(1), Arc::new(Store::answer));
    let handle = thread::start_with(&db, def(), Clock::starting_at(sec(10), 1.0), commit_every, answer).unwrap();
    let (reply, done) = oneshot::channel();
    let job = HistoryJob::Backup { to: folder.path().join("backup"), companions: Vec::new() };
    handle.jobs.blocking_send(JobRequest { job, reply }).unwrap();
    let said = done.blocking_recv().unwrap();
    assert!(said.is_ok(), "{said:?}");
    handle.stop();
}
