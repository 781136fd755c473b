//! How a station begins: with what its files hold, or without where their disk does not respond.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, TryRecvError},
    },
    time::Duration,
};

use tokio::sync::{mpsc, oneshot, watch};

use super::{Options, Station, Threads, assemble};
use crate::{
    access::{
        AccessControl, Users,
        io::{audit_log::Opened, own_user, recorder, users, users_beside},
    },
    bus::io::worker::{HANG_MAX, within},
    history::{HistoryError, io::thread as history},
    plant::{
        Plant, PlantDef,
        station_fault::{FaultState, StationFault},
    },
    station::{
        audit_queue::AuditQueue,
        found::FoundFile,
        past::Past,
        plant_task::{self, Persistence, RecordObserver, USERS_MISSING},
        session_server::{self, NewUsers},
        sets,
    },
};

/// Each of the files is read for so long at most: an audit log may be large, and its disk slow.
const READ_MAX: Duration = Duration::from_secs(30);
/// How often users that were not read in time are looked for.
const LATE_EVERY: Duration = Duration::from_secs(1);

pub(super) type LateUsers = Receiver<Result<Users, String>>;

/// Access control with users.
pub(super) struct Guarded {
    pub access: AccessControl,
    /// Their file.
    pub path: PathBuf,
    /// Where they come from once the disk responds.
    pub late: Option<LateUsers>,
}

/// Starts history, links and plant; lines are polled whether or not the store opens. No login: root and the
/// user of the station may do everything. For demonstrations.
pub fn start(options: Options) -> Result<Station, HistoryError> {
    start_observed(options, None)
}

/// The same, with an observer of all records.
pub fn start_observed(options: Options, observer: Option<RecordObserver>) -> Result<Station, HistoryError> {
    let max = read_max(&options.history);
    begin(options, observer, None, max)
}

/// The same for a plant with a users file beside its history: login is required.
pub fn start_guarded(options: Options) -> Result<Station, HistoryError> {
    let max = read_max(&options.history);
    let guarded = guard(options.def.clone(), users_beside(&options.history), max);
    begin(options, None, Some(guarded), max)
}

/// Reads the users.
fn guard(def: Arc<PlantDef>, path: PathBuf, max: Duration) -> Guarded {
    let (host, file) = (Some(own_user().into()), path.clone());
    let (read, late) = match within(max, move || users::read(&file).map_err(|error| error.to_string())) {
        Ok(read) => (read, None),
        Err(late) => (Err(format!("{}: the disk does not respond", path.display())), Some(late)),
    };
    let access = match read {
        Ok(users) => AccessControl::with_users(def, users, host),
        // Login is closed: a damaged file is not an empty one. Values and alarms go on.
        Err(error) => {
            tracing::error!(%error, "login is disabled");
            AccessControl::closed(def, &error, host)
        }
    };
    Guarded { access, path, late }
}

/// Access control, the file of its users, and where these still come from; of a station without login, no file.
pub(super) fn access_of(
    guarded: Option<Guarded>,
    def: &Arc<PlantDef>,
) -> (AccessControl, Option<PathBuf>, Option<LateUsers>) {
    match guarded {
        Some(Guarded { access, path, late }) => (access, Some(path), late),
        None => (AccessControl::new(def.clone(), Some(own_user().into())), None, None),
    }
}

/// How long each file of a station may take: nothing where their disk does not even respond.
fn read_max(history: &Path) -> Duration {
    let Some(folder) = history.parent().map(Path::to_path_buf) else { return READ_MAX };
    let made = within(HANG_MAX, move || {
        // A disk that takes nothing is no reason not to poll: the station says what it cannot write, and tries again.
        let _ = fs::create_dir_all(&folder).inspect_err(|error| tracing::error!(%error, folder = %folder.display()));
    });
    if made.is_ok() { READ_MAX } else { Duration::ZERO }
}

/// Takes the users once their disk responds.
pub(super) async fn take_late_users(
    late: LateUsers,
    (sessions, plant): (mpsc::Sender<session_server::Reload>, mpsc::Sender<plant_task::Reload>),
    mut stopped: watch::Receiver<bool>,
) {
    let taken = async move {
        let users = loop {
            let read = late.try_recv();
            match read {
                Err(TryRecvError::Empty) => tokio::time::sleep(LATE_EVERY).await,
                Ok(Ok(users)) => break users,
                Ok(Err(error)) => return tracing::error!(%error, "login stays disabled"),
                Err(TryRecvError::Disconnected) => return,
            }
        };
        // Tasks that have ended go on with nothing.
        let (done, taken) = oneshot::channel();
        let users = Some(NewUsers { before: None, users });
        let _ = sessions.send(session_server::Reload { plant: None, users, done }).await;
        let (done, known) = oneshot::channel();
        let users = taken.await.ok().flatten();
        let _ = plant.send(plant_task::Reload { plant: None, users, done }).await;
        let _ = known.await;
    };
    tokio::select! {
        _ = stopped.wait_for(|stopped| *stopped) => {}
        () = taken => {}
    }
}

fn begin(
    options: Options,
    observer: Option<RecordObserver>,
    guarded: Option<Guarded>,
    max: Duration,
) -> Result<Station, HistoryError> {
    let Options { def, clock, history: path, connectors, file } = options;
    let beside = path.clone();
    let found = within(max, move || FoundFile::open(&beside)).unwrap_or_else(|_| FoundFile::unread(&path));
    let sets = sets::folder(&path, &def.name);
    let mut history = history::start(&path, def.clone(), clock)?;
    let mut plant = Plant::new(def.clone(), clock.now(), clock.speed());
    let (records, store, queries) = (history.records.clone(), history.status.clone(), history.queries.clone());
    let jobs = (history.jobs.clone(), path.clone());
    let recorder = recorder::start_within(max, &path, clock, records.clone());
    let mut audit_queue = AuditQueue::new(&recorder);
    // Without such a file, at the first start or after it was damaged, the journal has the state.
    let from_journal = recorder.alarms.events.is_none();
    let succession = recorder.alarms.events.iter().map(|events| plant.restore(events)).next().unwrap_or_default();
    let file_since = audit_queue.files().plant_file_since(file.as_ref());
    let users = guarded.as_ref().and_then(|guarded| guarded.access.users_digest());
    if let Some(state) = guarded.as_ref().and_then(|guarded| users_fault(&guarded.access, &recorder.opened)) {
        plant.on_fault(StationFault::UsersFile, state);
    }
    audit_queue.put_start(&def.name, file.as_ref(), users, clock.utc());
    let past = Some(Past::new(history.restored.take(), from_journal, recorder.opened.procedure.clone()));
    let (records, audit) = (Some(records), Some(audit_queue));
    let (sets, found) = (Some(sets), Some(found));
    let persistence = Persistence { records, store, past, audit, sets, found, observer, succession, file_since };
    let threads = Threads { queries, jobs, history: Some(history), audit_writer: recorder.join };
    Ok(assemble(def, clock, connectors, plant, file, persistence, threads, guarded))
}

/// What is wrong with the file of users: it is damaged, or it is missing although the audit log knows of users.
fn users_fault(access: &AccessControl, log: &Opened) -> Option<FaultState> {
    if let Some(why) = access.is_closed() {
        return Some(FaultState::Active(why.to_string().into()));
    }
    let no_users = Users::default().digest();
    let had_users = log.users_file.as_ref().is_some_and(|recorded| **recorded != *no_users);
    (had_users && access.users_digest() == Some(no_users)).then(|| FaultState::Occurred(USERS_MISSING.into()))
}
