//! Stations killed during writes, shelvings and logins: whatever a terminal was told is in the audit log, which is whole; the
//! alarms are as they were, the station starts again, and its history is completed from the log.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use tokio::sync::watch;

use sightglass::{
    access::{
        OrderRequest, Users, Wish,
        book::{Check, Entry},
        io::{book, users, users_beside},
        user::Change,
    },
    attach::io::connect::connect,
    history::io::{
        alarm_file::{self, AlarmFile},
        store::Store,
    },
    plant::{
        alarm::AlarmCommand,
        command::{Command, OrderId, Outcome},
        def::AlarmId,
        record::AlarmStep,
        role::Role,
    },
    profile::{self, Search},
    station::{Request, Session},
};

use crate::{
    guarded::{PASSWORD, login},
    support::{PATIENCE, Process, folder, sightglass, simulated_tank, sockets},
};

/// Rounds, unless `SIGHTGLASS_KILLS` says how many.
const ROUNDS: u64 = 10;
/// Set values that are written in turn, in tenths of a degree.
const VALUES: std::ops::Range<u64> = 500..700;

/// What terminals were told before the station was killed.
#[derive(Default)]
struct Told {
    /// Notes of writes that were verified.
    writes: Vec<String>,
    /// The last shelving that was told as recorded, by its number.
    shelved: u32,
    /// Logins and logouts that were granted.
    logins: u64,
    logouts: u64,
}

struct Place {
    folder: tempfile::TempDir,
    sockets: PathBuf,
    /// Where the simulated devices are.
    port: String,
    _sim: Process,
}

impl Place {
    fn new() -> Place {
        let (folder, sockets) = (folder(), sockets());
        let (sim, port) = simulated_tank();
        let hash: Arc<str> = sightglass::access::password::hash(PASSWORD, [3; 16]).unwrap().into();
        let mut people = Users::default();
        for (user, change) in [
            ("sue", Change::First { user: "sue".into(), hash: hash.clone() }),
            ("tom", Change::Add { user: "tom".into(), role: Role::Technician, hash: hash.clone() }),
        ] {
            people = people.with(&change).unwrap();
            let (user, hash, must_change) = (user.into(), hash.clone(), false);
            people = people.with(&Change::Password { user, hash, must_change }).unwrap();
        }
        users::write(&users_beside(&folder.path().join("tank.duckdb")), &people).unwrap();
        Place { folder, sockets, port, _sim: sim }
    }

    fn history(&self) -> PathBuf {
        self.folder.path().join("tank.duckdb")
    }

    fn book(&self) -> PathBuf {
        book::beside(&self.history())
    }

    fn station(&self) -> Process {
        let mut station = Process::start(
            sightglass()
                .args(["run", "tank", "--log", "-", "--port", &format!("L1={}", self.port), "--history"])
                .arg(self.history())
                .env("XDG_RUNTIME_DIR", &self.sockets)
                .env("XDG_STATE_HOME", self.folder.path())
                .env("SIGHTGLASS_LOG", "warn"),
        );
        station.wait_for("TIC-1 (unit 1): answers");
        station
    }

    async fn terminal(&self) -> Session {
        connect(&self.sockets.join("sightglass/tank.sock")).await.unwrap()
    }
}

fn entries(book: &Path) -> Vec<Entry> {
    let text = std::fs::read_to_string(book).unwrap();
    let mut check = Check::new(None, &[]);
    text.lines().filter_map(|line| check.line(line.as_bytes())).collect()
}

/// Writes again and again, each with a note of its own, until the station goes.
async fn write_on(mut session: Session, done: watch::Sender<u64>, round: u64) -> (Vec<String>, u32) {
    let (mut told, mut shelved) = (Vec::new(), 0);
    // The place of its terminal counts for its password, so it waits for the other one to be looked at.
    while login(&session, "tom", PASSWORD).await.is_err() {
        if session.standing.borrow().gone.is_some() {
            return (told, shelved);
        }
        tokio::task::yield_now().await;
    }
    let tag = session.snapshots.borrow().def.tag_named("TIC-1.SV").unwrap();
    for number in 1.. {
        let note = format!("write {number} of round {round}");
        let value = (VALUES.start + (round * 37 + u64::from(number)) % (VALUES.end - VALUES.start)) as f64 / 10.0;
        let id = OrderId { terminal: session.terminal, number };
        let shelves = number % 2 == 0;
        let command = match shelves {
            true => Command::Alarm(AlarmCommand::Shelve { alarm: AlarmId(0), lasts: Duration::from_secs(1_800) }),
            false => Command::Write { tag, value },
        };
        let seen = session.snapshots.borrow().seen(&command);
        let order = OrderRequest { seen, note: Some(note.as_str().into()), ..OrderRequest::new(id, command) };
        if session.send(Request::Order(order)).is_err() {
            break;
        }
        let mut outcome = None;
        let ended = session.snapshots.wait_for(|snapshot| {
            let order = snapshot.orders.iter().find(|order| order.id == id);
            let ended = order.filter(|order| order.outcome != Outcome::Pending && order.recorded);
            outcome = ended.map(|order| order.outcome.clone());
            outcome.is_some()
        });
        let ended = tokio::time::timeout(PATIENCE, ended).await;
        assert!(ended.is_ok_and(|ended| ended.is_ok()), "`{note}` never had an outcome");
        match outcome {
            Some(Outcome::Verified) if shelves => shelved = number,
            Some(Outcome::Verified) => told.push(note),
            // It had gone, or has refused: too many at once, a value that stood there already.
            Some(_) | None if session.standing.borrow().gone.is_some() => break,
            Some(_) | None => {}
        }
        done.send_modify(|done| *done += 1);
    }
    (told, shelved)
}

/// Why the first alarm is shelved, as the next station will find it.
fn shelved_for(history: &Path) -> Option<Arc<str>> {
    let (_, found) = AlarmFile::open(&alarm_file::beside(history), jiff::Timestamp::UNIX_EPOCH);
    assert_eq!(found.trouble, None);
    let steps = found.steps.unwrap_or_default();
    steps.iter().find(|step| step.step == AlarmStep::Shelved).and_then(|step| step.reason.clone())
}

/// Logs in and out again and again until the station goes.
async fn log_in_on(session: Session, done: watch::Sender<u64>) -> Told {
    let mut told = Told::default();
    while session.standing.borrow().gone.is_none() {
        // Refused while the password of the other terminal is looked at.
        if login(&session, "sue", PASSWORD).await.is_ok() {
            told.logins += 1;
            done.send_modify(|done| *done += 1);
            told.logouts += u64::from(session.wish(Wish::Logout).await.is_ok());
        }
        tokio::task::yield_now().await;
    }
    told
}

/// One life of a station: ends with a kill after so many deeds that were answered, and so long after the last of them.
async fn live(place: &Place, round: u64, deeds: u64, late: Duration) -> Told {
    let before = shelved_for(&place.history());
    let mut station = place.station();
    let (done, mut count) = watch::channel(0);
    let session = place.terminal().await;
    let aside = session.snapshots.borrow().aside.iter().find_map(|alarm| alarm.deed.reason.clone());
    assert_eq!(aside, before, "round {round}: the alarms are as they were");
    let writing = tokio::spawn(write_on(session, done.clone(), round));
    let logging = tokio::spawn(log_in_on(place.terminal().await, done));
    let enough = tokio::time::timeout(PATIENCE, count.wait_for(|done| deeds <= *done)).await;
    assert!(enough.is_ok_and(|count| count.is_ok()), "round {round}: nothing goes on; {:?}", station.said);
    // Another moment of whatever is under way each time.
    tokio::time::sleep(late).await;
    station.signal("KILL");
    assert_eq!(station.end(), None);
    let ((writes, shelved), told) = (writing.await.unwrap(), logging.await.unwrap());
    Told { writes, shelved, ..told }
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_a_terminal_was_told_is_in_the_book_of_a_station_that_is_killed_and_starts_again() {
    let rounds = std::env::var("SIGHTGLASS_KILLS").map_or(ROUNDS, |rounds| rounds.parse().unwrap());
    let place = Place::new();
    let mut sum = Told::default();
    for round in 0..rounds {
        let before = entries_or_none(&place.book());
        let told = live(&place, round, 4 + round % 7, Duration::from_micros(round * 1_733 % 40_000)).await;
        let whole = book::verify(&place.book(), &[]).unwrap_or_else(|error| panic!("round {round}: {error}"));
        let all = entries(&place.book());
        assert_eq!(all.len() as u64, whole.entries, "round {round}");
        let lived = &all[before..];
        for note in &told.writes {
            let line = lived.iter().find(|line| &*line.action == "write" && line.note.as_deref() == Some(note));
            assert!(
                line.is_some_and(|line| &*line.outcome == "verified"),
                "round {round}: `{note}` is not in the book: {line:?}"
            );
        }
        let reason = shelved_for(&place.history()).unwrap_or_default();
        let number = |reason: &str| reason.strip_prefix("write ")?.split(' ').next()?.parse::<u32>().ok();
        let kept = number(&reason).filter(|_| reason.ends_with(&format!("of round {round}"))).unwrap_or(0);
        assert!(told.shelved <= kept, "round {round}: shelving {} was told, the file has `{reason}`", told.shelved);
        let count =
            |action: &str| lived.iter().filter(|line| &*line.action == action && &*line.target == "sue").count() as u64;
        let (logins, logouts) = (count("login"), count("logout"));
        assert!(told.logins <= logins, "round {round}: {} logins were granted, {logins} are in the book", told.logins);
        assert!(told.logouts <= logouts, "round {round}: {} logouts, {logouts} in the book", told.logouts);
        sum.writes.extend(told.writes);
        sum.logins += told.logins;
    }
    println!(
        "{rounds} kills: {} writes were told verified and {} logins granted, all of them in the book",
        sum.writes.len(),
        sum.logins
    );
    assert!(!sum.writes.is_empty() && 0 < sum.logins, "nothing was done");
    // What a kill has left is taken up, and a clean end is a clean end.
    let mut station = place.station();
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{:?}", station.said);
    let last = entries(&place.book()).pop().unwrap();
    assert_eq!(&*last.action, "stop station");
    // Each start has completed the history by what the log held before it.
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let seals = Store::open_read_only(&place.history(), &def).unwrap().seals().unwrap();
    let summary = book::verify(&place.book(), &seals).unwrap();
    assert_eq!((summary.compared, seals.len() as u64), (summary.entries.min(5_000), summary.entries.min(5_000)));
}

/// Lines so far; none before the first start.
fn entries_or_none(book: &Path) -> usize {
    if book.exists() { entries(book).len() } else { 0 }
}
