//! Stations killed during writes, alarm commands and logins, while shift reports are asked for: whatever was reported as
//! done is in the whole audit log; the alarms are as they were, and the history is completed from the log.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::watch,
};

use sightglass::api::{
    access::{
        Durability, SessionRequest, UserChange, Users,
        audit_log::{self, Check, Entry},
        sealing::{self, VerificationKey},
        users, users_beside,
    },
    attach::connect,
    history::{
        Query, QueryRequest, Store,
        alarm_file::{self, AlarmFile},
    },
    plant::{
        ActiveAlarm, AlarmCommand, AlarmEvent, AlarmId, AlarmRecord, Command, CommandId, CommandKind, Outcome,
        RecordedAction, Role, Snapshot,
    },
    profile::{self, Search},
    report::Period,
    station::{Request, Session},
};

use crate::{
    guarded::{PASSWORD, login},
    support::{Process, TIMEOUT, folder, sightglass, simulated_tank, sockets},
};

/// Rounds, unless `SIGHTGLASS_KILLS` says how many.
const ROUNDS: u64 = 10;
/// Setpoints are written in turn below and above the limit of [`ALARM`], in tenths of a degree, within so many tenths.
const VALUES: [u64; 2] = [500, 610];
const SPREAD: u64 = 90;
/// An alarm that half of the writes raise.
const ALARM: &str = "setpoint above 60";
const ALARM_TOML: &str = r#"
[[alarm]]
tag = "TIC-1.SV"
high = 60.0
deadband = 0.1
on_delay = "0s"
priority = "low"
message = "setpoint above 60"
cause = "a write of this test"
effect = "none"
action = "acknowledge"
"#;

/// In every third round each answer of the devices takes so much longer.
const REPLY: Duration = Duration::from_millis(400);
const SLOW_EVERY: u64 = 3;

/// What was reported to terminals as done before the station was killed.
#[derive(Default)]
struct Reported {
    /// Notes of writes that were verified.
    writes: Vec<String>,
    /// Notes of acknowledgements that were reported as recorded.
    acknowledged: Vec<String>,
    /// The last shelving, and the last acknowledgement, that was reported as recorded, by its number.
    shelved: u32,
    last_acknowledged: u32,
    /// Logins and logouts that were granted and recorded.
    logins: u64,
    logouts: u64,
    /// Shift reports that were answered.
    reports: u64,
}

struct Place {
    folder: tempfile::TempDir,
    sockets: PathBuf,
    /// Where the simulated devices are, and whether they are slow.
    port: String,
    slow: Arc<AtomicBool>,
    /// Verifies the seals of the audit log.
    key: VerificationKey,
    _sim: Process,
}

/// Passes requests on to the devices, and their answers back, which take [`REPLY`] longer while they are slow.
async fn pass_on(listener: TcpListener, devices: String, slow: Arc<AtomicBool>) {
    while let Ok((station, _)) = listener.accept().await {
        let (devices, slow) = (TcpStream::connect(&devices).await.unwrap(), slow.clone());
        tokio::spawn(async move {
            let (mut from_station, mut to_station) = station.into_split();
            let (mut from_devices, mut to_devices) = devices.into_split();
            let answers = async {
                let mut buffer = [0; 512];
                while let Ok(count @ 1..) = from_devices.read(&mut buffer).await {
                    if slow.load(Ordering::Relaxed) {
                        tokio::time::sleep(REPLY).await;
                    }
                    if to_station.write_all(&buffer[..count]).await.is_err() {
                        break;
                    }
                }
            };
            tokio::select! {
                _ = tokio::io::copy(&mut from_station, &mut to_devices) => {}
                () = answers => {}
            }
        });
    }
}

impl Place {
    async fn new() -> Place {
        let (folder, sockets) = (folder(), sockets());
        let (sim, devices) = simulated_tank();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let (port, slow) = (listener.local_addr().unwrap().to_string(), Arc::default());
        tokio::spawn(pass_on(listener, devices, Arc::clone(&slow)));
        let hash: Arc<str> = sightglass::api::access::password::hash(PASSWORD, [3; 16]).unwrap().into();
        let mut all = Users::default();
        for (user, change) in [
            ("sue", UserChange::First { user: "sue".into(), hash: hash.clone() }),
            ("tom", UserChange::Add { user: "tom".into(), role: Role::Technician, hash: hash.clone() }),
        ] {
            all = all.with(&change).unwrap();
            let (user, hash, must_change) = (user.into(), hash.clone(), false);
            all = all.with(&UserChange::Password { user, hash, must_change }).unwrap();
        }
        let text = profile::text_of("tank", &Search::shipped()).unwrap();
        std::fs::write(folder.path().join("tank.toml"), text + ALARM_TOML).unwrap();
        users::write(&users_beside(&folder.path().join("tank.duckdb")), &all).unwrap();
        let key = sealing::make(&audit_log::beside(&folder.path().join("tank.duckdb")), jiff::Timestamp::UNIX_EPOCH);
        Place { folder, sockets, port, slow, key: key.unwrap(), _sim: sim }
    }

    fn plant(&self) -> PathBuf {
        self.folder.path().join("tank.toml")
    }

    fn history(&self) -> PathBuf {
        self.folder.path().join("tank.duckdb")
    }

    fn audit_log(&self) -> PathBuf {
        audit_log::beside(&self.history())
    }

    fn station(&self) -> Process {
        let mut station = Process::start(
            sightglass()
                .arg("run")
                .arg(self.plant())
                .args(["--log", "-", "--port", &format!("L1={}", self.port), "--history"])
                .arg(self.history())
                .env("XDG_RUNTIME_DIR", &self.sockets)
                .env("XDG_STATE_HOME", self.folder.path())
                .env("SIGHTGLASS_LOG", "warn"),
        );
        station.wait_for("TIC-1 (unit 1): responding");
        station
    }

    async fn terminal(&self) -> Session {
        connect(&self.sockets.join("sightglass/tank.sock")).await.unwrap()
    }
}

fn entries(audit_log: &Path) -> Vec<Entry> {
    let text = if audit_log.exists() { std::fs::read_to_string(audit_log).unwrap() } else { String::new() };
    let mut check = Check::new(None, &[]);
    text.lines().filter_map(|line| check.line(line.as_bytes())).collect()
}

/// Logs in, or gives up when the station goes. Passwords of one origin are checked one after the other.
async fn log_in(session: &Session, user: &str) {
    while session.status.borrow().gone.is_none() && login(session, user, PASSWORD).await.is_err() {
        tokio::task::yield_now().await;
    }
}

/// Writes, acknowledges and shelves again and again, each with a note of its own, until the station goes.
async fn act_on(mut session: Session, done: watch::Sender<u64>, round: u64) -> Reported {
    let (mut reported, mut writes) = (Reported::default(), 0);
    log_in(&session, "tom").await;
    let tag = session.snapshots.borrow().def.tag_named("TIC-1.SV").unwrap();
    for number in 1.. {
        let note = format!("action {number} of round {round}");
        let value = (VALUES[writes % 2] + (round * 37 + u64::from(number)) % SPREAD) as f64 / 10.0;
        let id = CommandId { terminal: session.terminal, number };
        let shelve = AlarmCommand::Shelve { alarms: [AlarmId(0)].into(), lasts: Duration::from_secs(1_800) };
        let kind = match to_acknowledge(&session.snapshots.borrow()) {
            Some(acknowledge) => acknowledge,
            None if number % 2 == 0 => CommandKind::Alarm(shelve),
            None => CommandKind::Write { tag, value: value.into() },
        };
        writes += usize::from(kind.written().is_some());
        let command = session.snapshots.borrow().command(id, kind.clone());
        let command = Command { note: Some(note.as_str().into()), ..command };
        if session.send(Request::Command(command, None)).is_err() {
            break;
        }
        let mut outcome = None;
        let ended = session.snapshots.wait_for(|snapshot| {
            let status = snapshot.commands.iter().find(|status| status.command.id == id);
            let ended = status.filter(|status| !status.is_pending() && status.recorded);
            outcome = ended.map(|status| status.outcome.clone());
            outcome.is_some()
        });
        let ended = tokio::time::timeout(TIMEOUT, ended).await;
        assert!(ended.is_ok_and(|ended| ended.is_ok()), "`{note}` never had an outcome");
        match outcome {
            Some(Outcome::Verified) => match kind {
                CommandKind::Alarm(AlarmCommand::Shelve { .. }) => reported.shelved = number,
                CommandKind::Alarm(_) => {
                    reported.last_acknowledged = number;
                    reported.acknowledged.push(note);
                }
                _ => reported.writes.push(note),
            },
            // It had gone, or has refused: too many at once, a value that stood there already.
            Some(_) | None if session.status.borrow().gone.is_some() => break,
            Some(_) | None => {}
        }
        done.send_modify(|done| *done += 1);
    }
    reported
}

/// The command to acknowledge [`ALARM`], if it waits for that.
fn to_acknowledge(snapshot: &Snapshot) -> Option<CommandKind> {
    let is_it = |alarm: &&ActiveAlarm| snapshot.def.alarm(alarm.id).message == ALARM;
    let alarm = snapshot.alarms.iter().find(is_it).filter(|alarm| alarm.state.needs_acknowledgement())?;
    Some(alarm.acknowledge())
}

/// Asks for a shift report without pause until the station goes. Counts those that were asked for and those that were answered.
async fn report_on(session: Session, counts: watch::Sender<(u64, u64)>) -> u64 {
    log_in(&session, "tom").await;
    while session.status.borrow().gone.is_none() {
        let to = session.snapshots.borrow().at;
        let period = Period::free(to - jiff::SignedDuration::from_hours(8), to);
        let (reply, answer) = tokio::sync::oneshot::channel();
        if session.ask(QueryRequest { query: Query::Report { period }, reply }).is_ok() {
            counts.send_modify(|(asked, _)| *asked += 1);
            let is_answered = answer.await.is_ok_and(|answer| answer.is_ok());
            counts.send_modify(|(_, answered)| *answered += u64::from(is_answered));
        }
        tokio::task::yield_now().await;
    }
    counts.borrow().1
}

/// The number of an action of this round from its note; 0 for an action of another round.
fn number_in(round: u64, note: Option<Arc<str>>) -> u32 {
    let number = |note: &str| note.strip_prefix("action ")?.split(' ').next()?.parse::<u32>().ok();
    note.filter(|note| note.ends_with(&format!("of round {round}"))).and_then(|note| number(&note)).unwrap_or(0)
}

/// The reason of the last step of this kind, as the next station will find it.
fn reason_of(history: &Path, kind: AlarmEvent, text: Option<&str>) -> Option<Arc<str>> {
    let (_, found) = AlarmFile::open(&alarm_file::beside(history), jiff::Timestamp::UNIX_EPOCH);
    assert_eq!(found.trouble, None);
    let steps = found.events.unwrap_or_default();
    let is_it = |step: &&AlarmRecord| step.event == kind && text.is_none_or(|text| &*step.message == text);
    steps.iter().find(is_it).and_then(|step| step.reason.clone())
}

/// Logs in and out again and again until the station goes. Counts what was granted.
async fn log_in_on(session: Session, granted: watch::Sender<u64>) -> Reported {
    let mut reported = Reported::default();
    while session.status.borrow().gone.is_none() {
        // Refused while the password of the other terminal is looked at.
        let enter = SessionRequest::Login { user: "sue".into(), password: PASSWORD.into() };
        if let Ok(durability) = session.request(enter).await {
            reported.logins += u64::from(durability == Durability::Recorded);
            granted.send_replace(reported.logins);
            reported.logouts += u64::from(session.request(SessionRequest::Logout).await == Ok(Durability::Recorded));
        }
        tokio::task::yield_now().await;
    }
    reported
}

/// One life of a station: ends with a kill after so many actions that were answered, so many logins and reports, and so long
/// after the last of them.
async fn live(place: &Place, round: u64, actions: u64, others: u64, late: Duration) -> Reported {
    let before = reason_of(&place.history(), AlarmEvent::Shelved, None);
    let mut station = place.station();
    let ((done, mut count), (counts, mut reports)) = (watch::channel(0), watch::channel((0, 0)));
    let (granted, mut logins) = watch::channel(0);
    let session = place.terminal().await;
    let suppressed = session.snapshots.borrow().suppressed.iter().find_map(|alarm| alarm.note.reason.clone());
    assert_eq!(suppressed, before, "round {round}: the alarms are as they were");
    let reporting = tokio::spawn(report_on(place.terminal().await, counts));
    let logging = tokio::spawn(log_in_on(place.terminal().await, granted));
    let enough = async {
        // Before the actions, of which a terminal may do only so many in a while.
        let others_done = reports.wait_for(|(_, answered)| others <= *answered).await.is_ok()
            && logins.wait_for(|granted| others <= *granted).await.is_ok();
        let acting = tokio::spawn(act_on(session, done, round));
        let all_done = others_done
            && count.wait_for(|done| actions <= *done).await.is_ok()
            && reports.wait_for(|(asked, _)| 0 < *asked).await.is_ok();
        all_done.then_some(acting)
    };
    let enough = tokio::time::timeout(TIMEOUT, enough).await;
    let Ok(Some(acting)) = enough else { panic!("round {round}: nothing goes on; {:?}", station.said) };
    // Another moment of whatever is under way each time.
    tokio::time::sleep(late).await;
    station.signal("KILL");
    assert_eq!(station.end(), None);
    let (reported, logins) = (acting.await.unwrap(), logging.await.unwrap());
    let reports = reporting.await.unwrap();
    Reported { logins: logins.logins, logouts: logins.logouts, reports, ..reported }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_reported_as_done_survives_the_kill_of_a_station() {
    let rounds = std::env::var("SIGHTGLASS_KILLS").map_or(ROUNDS, |rounds| rounds.parse().unwrap());
    let place = Place::new().await;
    let mut sum = Reported::default();
    for round in 0..rounds {
        place.slow.store(round % SLOW_EVERY == 0, Ordering::Relaxed);
        let before = entries(&place.audit_log()).len();
        let late = Duration::from_micros(round * 1_733 % 40_000);
        // The last station lives until it has done something of each kind, however slow the machine is.
        let others = u64::from(round + 1 == rounds);
        let reported = live(&place, round, 2 + round % 5, others, late).await;
        let verified = sealing::verify(&place.audit_log(), &[], &place.key);
        let (whole, sealed, _) = verified.unwrap_or_else(|error| panic!("round {round}: {error}"));
        assert!(round < sealed.seals, "round {round}: each start has its seal, found {}", sealed.seals);
        let all = entries(&place.audit_log());
        assert_eq!(all.len() as u64, whole.entries, "round {round}");
        let lived = &all[before..];
        let writes = reported.writes.iter().map(|note| ["write", note, "verified"]);
        for [action, note, outcome] in writes.chain(reported.acknowledged.iter().map(|n| ["acknowledge", n, "done"])) {
            let line = lived.iter().find(|line| &*line.action == action && line.note.as_deref() == Some(note));
            assert!(
                line.is_some_and(|line| &*line.outcome == outcome),
                "round {round}: `{note}` is not in the audit log: {line:?}"
            );
        }
        let kept = |kind, text| number_in(round, reason_of(&place.history(), kind, text));
        let (shelved, acknowledged) = (kept(AlarmEvent::Shelved, None), kept(AlarmEvent::Acknowledged, Some(ALARM)));
        assert!(reported.shelved <= shelved, "round {round}: shelving {}, the file has {shelved}", reported.shelved);
        let last = reported.last_acknowledged;
        assert!(last <= acknowledged, "round {round}: acknowledgement {last}, the file has {acknowledged}");
        let count =
            |action: &str| lived.iter().filter(|line| &*line.action == action && &*line.target == "sue").count() as u64;
        let (logins, logouts) = (count("login"), count("logout"));
        assert!(
            reported.logins <= logins,
            "round {round}: {} logins were granted, {logins} are in the audit log",
            reported.logins
        );
        assert!(reported.logouts <= logouts, "round {round}: {} logouts, {logouts} in the audit log", reported.logouts);
        sum.writes.extend(reported.writes);
        sum.acknowledged.extend(reported.acknowledged);
        (sum.logins, sum.reports) = (sum.logins + reported.logins, sum.reports + reported.reports);
    }
    let (writes, acknowledged) = (sum.writes.len(), sum.acknowledged.len());
    let (logins, reports) = (sum.logins, sum.reports);
    println!(
        "{rounds} kills; on record: {writes} writes, {acknowledged} acknowledgements, {logins} logins; {reports} reports"
    );
    assert!(0 < writes && 0 < acknowledged && 0 < logins && 0 < reports, "nothing was done");
    // What a kill has left is taken up, and a clean end is a clean end.
    let mut station = place.station();
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{:?}", station.said);
    let actions: Vec<_> = entries(&place.audit_log()).into_iter().map(|entry| entry.action).collect();
    assert!(actions.ends_with(&["stop station".into(), RecordedAction::SealAuditLog.into()]), "{:?}", actions.last());
    // Each start has completed the history by what the log held before it.
    let def = profile::load(&place.plant(), &Search::shipped()).unwrap();
    let chain_hashes = Store::open_read_only(&place.history(), &def).unwrap().chain_hashes().unwrap();
    let summary = audit_log::verify(&place.audit_log(), &chain_hashes).unwrap();
    assert_eq!((summary.compared, chain_hashes.len() as u64), (summary.entries.min(5_000), summary.entries.min(5_000)));
}
