//! The archive over some days, killed at every step that it makes, and at every step of the start after that: what is left
//! behind starts, loses nothing, doubles nothing, and is finished like an archive that was never disturbed. The same where a
//! step fails and the job is tried again.

use std::{
    cell::Cell,
    collections::BTreeSet,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    io,
    os::unix::fs::MetadataExt,
    rc::Rc,
};

use super::{
    archive::{HOUR_S, rows},
    *,
};
use crate::{
    history::{
        ArchiveFile,
        io::{
            archive::{Job, LeftOut},
            disk::testing::seen,
        },
        tiers::Tier,
    },
    plant::def::HistoryDef,
};

const DAY_S: i64 = 24 * HOUR_S;
/// The hours that have samples: the last days of January and the first hour of February.
const HOURS: [i64; 4] = [718, 719, 743, 744];
/// The last 200 s of one and five minutes of another come late.
const LATE: [std::ops::Range<i64>; 2] = [744 * HOUR_S - 200..744 * HOUR_S, 719 * HOUR_S + 600..719 * HOUR_S + 900];

/// Samples that come, and the second until which the archive is worked on after that: hours, days and a month; late
/// samples; the time of the samples is over; that of minutes and hours.
fn parts() -> [(Vec<Record>, i64); 4] {
    let moved = |record: Record| {
        let Record::Sample(tag, sample) = record else { panic!("only samples") };
        let second = sample.at.as_second();
        let hour = HOURS.get((second / HOUR_S) as usize)?;
        let at = sample.at + Duration::from_secs((hour * HOUR_S - second / HOUR_S * HOUR_S) as u64);
        Some((tag, Sample { at, ..sample }))
    };
    let all = rows(HOURS.len() as i64).into_iter().filter_map(moved);
    let is_late = |(_, sample): &(TagId, Sample)| LATE.iter().any(|late| late.contains(&sample.at.as_second()));
    let (late, early): (Vec<_>, Vec<_>) = all.partition(is_late);
    assert!(late.len() > 10, "{}", late.len());
    let [early, late] =
        [early, late].map(|all| all.into_iter().map(|(tag, sample)| Record::Sample(tag, sample)).collect());
    let recorded = 744 * HOUR_S + 1_800;
    [(early, recorded), (late, recorded), (Vec::new(), 38 * DAY_S + DAY_S / 2), (Vec::new(), 70 * DAY_S)]
}

/// The store, as a start finds it.
fn start(db: &Path) -> Store {
    let rule = HistoryDef {
        keep_samples_days: Some(7),
        keep_minutes_days: Some(8),
        keep_hours_days: Some(31),
        disk_free_mib_min: 0,
        ..HistoryDef::default()
    };
    let def = PlantDef { history: rule, ..PlantDef::clone(&def()) };
    let opened = Store::open(db, &Arc::new(def), sec(745 * HOUR_S)).unwrap();
    assert_eq!(opened.trouble, None);
    opened.store
}

fn due(store: &Store, until: i64) -> Option<Job> {
    store.archive_due(sec(until), &LeftOut::default()).unwrap()
}

/// What is stored.
#[derive(Debug, Clone, PartialEq)]
struct State {
    /// Samples, wherever they lie: how many, and the sum of all.
    samples: (usize, u64),
    /// Those that are not archived.
    in_table: u64,
    /// The same of minutes and hours, in the words of the engine.
    formed: Vec<(u64, Option<String>)>,
    files: Vec<ArchiveFile>,
    deleted: Vec<Option<Timestamp>>,
}

fn state(store: &Store) -> State {
    let mut samples = Vec::new();
    let gaps = store.each_stored(sec(700 * HOUR_S), sec(71 * DAY_S), |tag, sample| samples.push((tag, sample)));
    assert_eq!(gaps.unwrap(), []);
    samples.sort_by_key(|(tag, sample): &(u16, Sample)| (*tag, sample.at));
    let mut hasher = DefaultHasher::new();
    for (tag, Sample { value, rest, quality, at }) in &samples {
        (tag, [value, rest].map(|part| part.map(f64::to_bits)), quality.code(), at).hash(&mut hasher);
    }
    let mut files = store.files(None).unwrap();
    files.sort_by(|one, other| one.path.cmp(&other.path));
    let formed = [Tier::Minute, Tier::Hour].map(|tier| {
        let of_tier: Vec<_> = files.iter().filter(|file| file.tier == tier).cloned().collect();
        if of_tier.is_empty() {
            return (0, None);
        }
        let sql = format!(
            "SELECT count(*), sum(hash({}))::VARCHAR FROM {}",
            sql::columns(tier, false),
            store.parquet(&of_tier, false)
        );
        store.db.query_row(&sql, [], |row| Ok((row.get(0)?, row.get(1)?))).unwrap()
    });
    State {
        samples: (samples.len(), hasher.finish()),
        in_table: store.count_rows().unwrap(),
        formed: formed.into(),
        files,
        deleted: Tier::ALL.iter().map(|tier| store.deleted_until(*tier).unwrap()).collect(),
    }
}

/// Files and folders below the archive, by their path from there.
fn paths(folder: &Path) -> BTreeSet<PathBuf> {
    fn below(folder: &Path, all: &mut BTreeSet<PathBuf>) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            all.insert(entry.path());
            below(&entry.path(), all);
        }
    }
    let mut all = BTreeSet::new();
    below(folder, &mut all);
    all.iter().map(|path| path.strip_prefix(folder).unwrap().to_owned()).collect()
}

/// What lies on the disk, and when each of it was written; a file that says only that it is being opened is nothing.
fn disk(folder: &Path) -> Vec<(PathBuf, u64, (i64, i64))> {
    let of = |path: PathBuf| {
        let there = fs::metadata(folder.join(&path)).unwrap();
        (path, there.len(), (there.mtime(), there.mtime_nsec()))
    };
    paths(folder).into_iter().filter(|path| path.extension().is_none_or(|ending| ending != "opening")).map(of).collect()
}

/// Nothing lies in the archive but what the manifest names, and the names of tags.
fn assert_no_orphan(store: &Store, what: &str) {
    let known: Vec<PathBuf> = store.files(None).unwrap().iter().map(|file| file.path.clone().into()).collect();
    let folders = known.iter().filter_map(|path| path.parent()).map(Path::to_owned);
    let kept = Tier::ALL.iter().map(|tier| tier.word().into()).chain(["tag.parquet".into()]);
    let expect: BTreeSet<PathBuf> = folders.chain(kept).chain(known.clone()).collect();
    let found = paths(&store.archive_folder());
    let orphans: Vec<_> = found.difference(&expect).collect();
    assert!(orphans.is_empty(), "{what}: {orphans:?}");
    assert!(known.iter().all(|path| found.contains(path)), "{what}: {known:?}");
}

/// The folder of a database, as it lies on the disk at this moment; what is not whole yet lacks its second half.
fn copied(db: &Path) -> (tempfile::TempDir, PathBuf) {
    fn copy(from: &Path, to: &Path) {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
            let (from, to) = (entry.path(), to.join(entry.file_name()));
            if from.is_dir() {
                copy(&from, &to);
                continue;
            }
            let bytes = fs::copy(&from, &to).unwrap();
            if from.extension().is_some_and(|ending| ending == "new") {
                fs::File::options().write(true).open(&to).unwrap().set_len(bytes / 2).unwrap();
            }
        }
    }
    let (folder, copied) = folder();
    copy(db.parent().unwrap(), folder.path());
    (folder, copied)
}

/// A job of the archive as an undisturbed run does it.
#[derive(Clone)]
struct Step {
    until: i64,
    before: State,
    after: State,
}

/// What a start has found after a kill in a job: nothing is lost, nothing double, nothing left over.
fn found(store: &Store, job: &Step, what: &str) -> State {
    let found = state(store);
    let [before, after] = [&job.before.samples, &job.after.samples];
    assert!([before, after].contains(&&found.samples), "{what}: {:?}, expected {before:?} or {after:?}", found.samples);
    assert_no_orphan(store, what);
    found
}

/// Starts what a kill in a job has left behind, where the start is killed at each of its steps too, and finishes the job.
fn resume(db: &Path, job: &Step, what: &str, kills: &Rc<Cell<usize>>) {
    let (_folder, db) = copied(db);
    let (own, again, kills) = (db.clone(), job.clone(), Rc::clone(kills));
    let (named, mut before) = (what.to_owned(), disk(db.parent().unwrap()));
    let kill = move |step: &'static str| {
        kills.set(kills.get() + 1);
        let now = disk(own.parent().unwrap());
        if std::mem::replace(&mut before, now.clone()) != now {
            let (_folder, own) = copied(&own);
            found(&start(&own), &again, &format!("{named}, and at its start before `{step}`"));
        }
        Ok(())
    };
    let store = seen(kill, || start(&db));
    if found(&store, job, what) != job.after {
        store.archive(&due(&store, job.until).unwrap_or_else(|| panic!("{what}: nothing is due"))).unwrap();
        assert_eq!(state(&store), job.after, "{what}");
        assert_no_orphan(&store, what);
    }
}

/// Does all jobs, each by `work`, which is given how it goes undisturbed.
fn all_jobs(mut work: impl FnMut(&Store, &Path, &Job, &Step)) -> usize {
    let (([_plain, _folder], [plain, db]), mut count) = (two_folders(), 0);
    let (plain, store) = (start(&plain), start(&db));
    for (rows, until) in parts() {
        for store in [&plain, &store] {
            store.append(&rows).unwrap();
        }
        while let Some(job) = due(&plain, until) {
            let before = state(&plain);
            plain.archive(&job).unwrap();
            let step = Step { until, before, after: state(&plain) };
            work(&store, &db, &due(&store, until).unwrap(), &step);
            assert_eq!(nameless(state(&store)), nameless(step.after), "{job:?}");
            count += 1;
        }
    }
    assert_eq!(state(&store).files, [], "the time of all is over");
    count
}

fn two_folders() -> ([tempfile::TempDir; 2], [PathBuf; 2]) {
    let ((one, first), (two, second)) = (folder(), folder());
    ([one, two], [first, second])
}

#[test]
fn a_kill_at_every_step_loses_and_doubles_nothing() {
    let [kills, again] = [0, 0].map(|none| Rc::new(Cell::new(none)));
    let jobs = all_jobs(|store, db, job, step| {
        let (db, step, kills, again) = (db.to_owned(), step.clone(), Rc::clone(&kills), Rc::clone(&again));
        let (archive, name) = (store.archive_folder(), format!("{job:?}"));
        let (mut before, mut disk_before) = (paths(&archive), Vec::new());
        let kill = move |next: &'static str| {
            let (now, disk_now) = (paths(&archive), disk(db.parent().unwrap()));
            // A folder counts with what lies in it.
            let leaves = |all: Vec<&PathBuf>| {
                all.iter().filter(|path| !all.iter().any(|other| *path != other && other.starts_with(path))).count()
            };
            let [new, gone] =
                [now.difference(&before), before.difference(&now)].map(|changed| leaves(changed.collect()));
            assert!(new <= 1 && gone <= 1, "{name}: more than one change before `{next}`: {:?}", &now ^ &before);
            before = now;
            kills.set(kills.get() + 1);
            // What was only synced, and a folder that was there, leave the same behind.
            if std::mem::replace(&mut disk_before, disk_now.clone()) == disk_now {
                return Ok(());
            }
            resume(&db, &step, &format!("{name}, killed before `{next}`"), &again);
            Ok(())
        };
        seen(kill, || store.archive(job)).unwrap();
        assert_no_orphan(store, "undisturbed");
    });
    let seen = (jobs, kills.get(), again.get());
    assert!(
        jobs > 15 && kills.get() > 10 * jobs && again.get() > 0,
        "jobs, kills, more at the start after one: {seen:?}"
    );
}

#[test]
fn a_job_that_failed_at_any_step_is_done_by_the_next_try() {
    let mut failures = 0;
    let jobs = all_jobs(|store, db, job, step| {
        for number in 1.. {
            let left = Rc::new(Cell::new(number));
            let counted = Rc::clone(&left);
            let fail = move |_: &'static str| {
                counted.set(counted.get() - 1);
                if counted.get() == 0 { Err(io::Error::from(io::ErrorKind::StorageFull)) } else { Ok(()) }
            };
            let tried = seen(fail, || store.archive(job));
            failures += usize::from(left.get() <= 0);
            // What is not removed any more fails no job.
            if tried.is_ok() {
                break;
            }
            assert_eq!(state(store).samples, step.before.samples, "{job:?}: {tried:?} at step {number}");
        }
        let (_folder, db) = copied(db);
        let other = start(&db);
        assert_eq!(nameless(state(&other)), nameless(step.after.clone()), "{job:?}");
        assert_no_orphan(&other, &format!("{job:?}"));
    });
    assert!(jobs > 15 && failures > 5 * jobs, "{jobs} jobs, {failures} failures");
}

/// A file that could not be renamed or removed lies there until the next start, and has its name.
fn nameless(mut state: State) -> State {
    state.files.iter_mut().for_each(|file| file.path.clear());
    state.files.sort_by_key(|file| (file.tier, file.from, file.rows));
    state
}
