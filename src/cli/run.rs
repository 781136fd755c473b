//! `sightglass run PLANT` and `sightglass PLANT`: a station on real lines, without or with a terminal.

use std::{path::PathBuf, sync::Arc, time::Duration};

use tokio::{
    signal::unix::{SignalKind, signal},
    sync::{mpsc, oneshot, watch},
    task::JoinHandle,
};

use crate::{
    access::{
        Users,
        io::{users, users_beside},
    },
    attach::io::{find, serve},
    bus::io::{clock::Clock, transport::Connector, worker::spawn_blocking},
    plant::{PlantDef, Snapshot, record::ChainHash},
    profile::PlantFile,
    station::{
        LifecycleRequest, event_log,
        io::{self as station, Reloaded},
    },
    ui,
};

use super::{
    CliError, StationArgs, TerminalArgs, attach, client, in_runtime, init, load_with_file, local, log, paths, say,
    span, status,
};

/// So long an answer takes at most to leave the station before its socket closes.
const ANSWER: Duration = Duration::from_millis(200);

/// Why a station that is one process with its terminal is not reloaded.
const LEAVE: &str = "quit this terminal and start it again";

/// What is said of files that are as they were.
const UNCHANGED: &str = "nothing has changed: everything keeps running";

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = span)]
    duration: Option<Duration>,
    /// At the end print every tag with value, quality and age
    #[arg(long)]
    print: bool,
    #[command(flatten)]
    station: StationArgs,
}

/// Runs the station until a stop request; prints changes to standard output.
pub fn main(args: Args) -> Result<(), CliError> {
    let (def, file) = load_with_file(&args.plant, &args.station)?;
    let def = Arc::new(def);
    let _log = log::start(args.station.log.as_deref(), Some(&paths::history_file(&def, &args.station)))?;
    in_runtime(async {
        let listener = listen(&def)?;
        let clock = Clock::real();
        let mut station = start(&def, clock, paths::history_file(&def, &args.station), file)?;
        let mut lifecycle = station.take_lifecycle();
        let mut serving = Serving::new(listener, station);
        say_plant(&def);
        let snapshots = serving.station.acceptor().snapshots.clone();
        init::ready(&def.title);
        let ended = tokio::select! {
            ended = follow(snapshots.clone(), clock, args.duration) => ended.map(drop),
            () = handle_lifecycle(&mut serving.station, &mut lifecycle, checked(&args)) => Ok(()),
        };
        init::stopping();
        let last = snapshots.borrow().clone();
        drop(snapshots);
        say_anchor(serving.stop().await?);
        ended?;
        if args.print {
            status::tag_lines(&last).iter().for_each(|line| say(line));
        }
        say("stopped");
        Ok(())
    })
}

/// `Water tank: 42 tags on 2 lines`.
fn say_plant(def: &PlantDef) {
    let lines = if def.lines.len() == 1 { "line" } else { "lines" };
    say(&format!("{}: {} tags on {} {lines}", def.title, def.tags.len(), def.lines.len()));
}

/// Loads plant file and users file again, with all that a station would start with: what is refused now changes nothing.
fn checked(args: &Args) -> impl Fn() -> Result<(Reloaded, Users), CliError> + Clone + Send + 'static + use<> {
    let (plant, station) = (args.plant.clone(), args.station.clone());
    move || {
        let (def, file) = load_with_file(&plant, &station)?;
        let users = users::read(&users_beside(&paths::history_file(&def, &station))).map_err(CliError::Users)?;
        let connectors = connectors(&def);
        Ok((Reloaded { def: Arc::new(def), connectors, file, users: None }, users))
    }
}

/// Station and terminal in one process; at the station of this plant, if it runs already.
pub fn with_terminal(plant: &str, args: &StationArgs, terminal: &TerminalArgs) -> Result<(), CliError> {
    let (def, file) = load_with_file(plant, args)?;
    let def = Arc::new(def);
    ui::io::require_terminal()?;
    in_runtime(async {
        if args.history.is_none()
            && let Ok(station) = client::find_station(Some(&def.name)).await
        {
            return attach::attach_to(&station, terminal).await;
        }
        let _log = log::start(args.log.as_deref(), Some(&paths::history_file(&def, args)))?;
        let listener = listen(&def)?;
        let mut station = start(&def, Clock::real(), paths::history_file(&def, args), file)?;
        let mut lifecycle = station.take_lifecycle();
        let mut serving = Serving::new(listener, station);
        let session = serving.station.session(&paths::operator());
        let refuse = || Err(CliError::Usage(LEAVE.to_owned()));
        let result = tokio::select! {
            result = ui::io::run(session, terminal.options(ui::Leaving::Station)) => result,
            () = handle_lifecycle(&mut serving.station, &mut lifecycle, refuse) => Ok(()),
        };
        serving.stop().await?;
        Ok(result?)
    })
}

/// The socket of a plant, before anything else: it also keeps a second station of the plant away.
fn listen(def: &PlantDef) -> Result<serve::Listener, CliError> {
    let path = find::SocketFolders::here().socket(&def.name).map_err(CliError::io("cannot create a socket"))?;
    serve::listen(&path).map_err(CliError::from)
}

/// Reloads the files of the station whenever a terminal wants it, until one stops the station. A file with errors is refused, and
/// the station goes on as it is.
async fn handle_lifecycle(
    station: &mut station::Station,
    lifecycle: &mut mpsc::Receiver<LifecycleRequest>,
    load: impl Fn() -> Result<(Reloaded, Users), CliError> + Clone + Send + 'static,
) {
    while let Some((digest, reply, loaded)) = next_reload(lifecycle, load.clone()).await {
        let new = loaded.map(|(new, users)| Reloaded { users: Some((digest, users)), ..new });
        let prepared = match new.and_then(|new| station.prepare_reload(new)) {
            Ok(Some(prepared)) => prepared,
            refused_or_unchanged => {
                // A terminal that has left needs no answer.
                let _ = reply.send(refused_or_unchanged.map(|_| UNCHANGED.to_owned()));
                continue;
            }
        };
        let _ = reply.send(Ok(prepared.summary.clone()));
        init::reloading();
        tokio::select! {
            () = station.end_what_changes(&prepared) => {}
            () = stopped(lifecycle) => break,
        }
        say(&format!("plant file reloaded: {}", prepared.summary));
        station.reload(prepared).await;
        say_plant(station.def());
        init::ready(&station.def().title);
    }
    tokio::time::sleep(ANSWER).await;
}

/// Waits for the next reload and loads what it is about: the digest of the users, who gets the reply, and what was loaded.
/// `None`: the station is to end.
async fn next_reload<T: Send + 'static>(
    lifecycle: &mut mpsc::Receiver<LifecycleRequest>,
    load: impl FnOnce() -> Result<T, CliError> + Send + 'static,
) -> Option<(Option<String>, oneshot::Sender<Result<String, String>>, Result<T, String>)> {
    let LifecycleRequest::Reload(digest, reply) = lifecycle.recv().await? else { return None };
    tokio::select! {
        loaded = loaded(load) => Some((digest, reply, loaded)),
        // The disk of the plant file may hang: the station can be stopped all the same.
        () = stopped(lifecycle) => None,
    }
}

/// Waits for the end of the station while it reloads its files.
async fn stopped(lifecycle: &mut mpsc::Receiver<LifecycleRequest>) {
    while let Some(LifecycleRequest::Reload(_, reply)) = lifecycle.recv().await {
        drop(reply.send(Err("the plant file is already being loaded".to_owned())));
    }
}

/// Loads a plant file beside the station: however long it takes, and even if it fails badly. `Err` says why in words.
async fn loaded<T: Send + 'static>(load: impl FnOnce() -> Result<T, CliError> + Send + 'static) -> Result<T, String> {
    // Drawing many errors takes its time as well.
    let loaded = spawn_blocking(|| load().map_err(|error| error.to_string())).await;
    loaded.unwrap_or_else(|_| Err("the plant file cannot be read, see the log".to_owned()))
}

/// A station and its socket.
struct Serving {
    station: station::Station,
    /// Gives the socket back when the station has ended.
    socket: JoinHandle<serve::Listener>,
}

impl Serving {
    fn new(mut listener: serve::Listener, station: station::Station) -> Serving {
        let acceptor = station.acceptor().clone();
        let socket = tokio::spawn(async move {
            listener.serve(&acceptor).await;
            listener
        });
        Serving { station, socket }
    }

    /// Ends the station and closes its sessions, then its socket: the last record is on disk. Gives the last entry of the audit
    /// log.
    async fn stop(self) -> Result<Option<ChainHash>, CliError> {
        let last = self.station.stop().await;
        let socket = self.socket.await;
        socket.map_err(|error| CliError::Failed(format!("the socket ended badly: {error}"))).map(|_| last)
    }
}

/// A station on the lines of its plant.
fn start(
    def: &Arc<PlantDef>,
    clock: Clock,
    history: PathBuf,
    file: Option<PlantFile>,
) -> Result<station::Station, CliError> {
    let connectors = connectors(def);
    Ok(station::start_guarded(station::Options { def: def.clone(), clock, history, connectors, file })?)
}

/// How each line is opened.
fn connectors(def: &PlantDef) -> Vec<Connector> {
    def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect()
}

/// Prints what changes until the time is over, a signal comes, or the station ends; gives the last snapshot. Feeds the
/// watchdog of the init system, if there is one, for as long as the lines are polled.
pub async fn follow(
    mut snapshots: watch::Receiver<Arc<Snapshot>>,
    clock: Clock,
    duration: Option<Duration>,
) -> Result<Arc<Snapshot>, CliError> {
    let mut before = snapshots.borrow_and_update().clone();
    let print = |snapshot: &Snapshot, lines: Vec<String>| {
        let time = local(snapshot.at, &snapshot.def);
        lines.iter().for_each(|line| say(&format!("{time} {line}")));
    };
    print(&before, event_log::first(&before));
    let mut anchored = None;
    let mut watchdog = init::Watchdog::new();
    let end = over(clock, duration);
    tokio::pin!(end);
    let stop = signalled();
    tokio::pin!(stop);
    loop {
        tokio::select! {
            () = &mut end => break,
            () = &mut stop => break,
            changed = snapshots.changed() => {
                if changed.is_err() {
                    return Err(CliError::StationGone);
                }
                let after = snapshots.borrow_and_update().clone();
                watchdog.see(&after);
                // Under another definition nothing of before has its place.
                let is_same_plant = Arc::ptr_eq(&before.def, &after.def);
                let lines = if is_same_plant { event_log::changes(&before, &after) } else { event_log::first(&after) };
                print(&after, lines);
                let hour = after.at.as_second().div_euclid(3_600);
                if after.history.audit.is_some() && anchored.replace(hour) != Some(hour) {
                    say_anchor(after.history.audit);
                }
                before = after;
            }
        }
    }
    let last = snapshots.borrow().clone();
    Ok(last)
}

/// Prints the last entry of the audit log, for the journal of the system: whoever changes the log later, and all hashes
/// behind the change, must change the journal as well.
pub fn say_anchor(last: Option<ChainHash>) {
    if let Some(chain_hash) = last {
        say(&format!("audit log: entry {chain_hash}"));
    }
}

/// Returns when a span of plant time is over; never without one.
pub async fn over(clock: Clock, duration: Option<Duration>) {
    match duration {
        Some(duration) => clock.sleep(duration).await,
        None => std::future::pending().await,
    }
}

/// Returns when the process is asked to end.
pub async fn signalled() {
    let wait = |kind| async move {
        match signal(kind) {
            Ok(mut signal) => drop(signal.recv().await),
            // Without a handler the system ends the process by itself.
            Err(_) => std::future::pending().await,
        }
    };
    tokio::select! {
        () = wait(SignalKind::interrupt()) => {}
        () = wait(SignalKind::terminate()) => {}
        () = wait(SignalKind::hangup()) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn an_unreadable_plant_file_leaves_the_station_as_it_is() {
        let panicked = loaded::<()>(|| panic!("a mistake in the loader")).await;
        assert!(panicked.is_err_and(|why| why.contains("see the log")));
        let why = loaded::<()>(|| Err(CliError::Usage("no such plant".to_owned()))).await.err();
        assert_eq!(why.as_deref(), Some("no such plant"));
    }

    #[tokio::test(start_paused = true)]
    async fn a_station_with_an_endless_plant_file_can_be_stopped() {
        let (begun, begins) = std::sync::mpsc::channel();
        // The loader ends with this test, not before.
        let (_end, ends) = std::sync::mpsc::channel::<()>();
        let ends = Arc::new(std::sync::Mutex::new(ends));
        let load = move || {
            begun.send(()).expect("the test waits");
            let _ = ends.lock().expect("one loader").recv();
            Err::<(), _>(CliError::Usage("refused".to_owned()))
        };
        let (sender, mut lifecycle) = mpsc::channel(4);
        let (reply, _answer) = oneshot::channel();
        let (second, refused) = oneshot::channel();
        let terminals = async {
            sender.send(LifecycleRequest::Reload(None, reply)).await.expect("the station listens");
            while begins.try_recv().is_err() {
                tokio::task::yield_now().await;
            }
            sender.send(LifecycleRequest::Reload(None, second)).await.expect("the station listens");
            assert!(refused.await.is_ok_and(|answer| answer.is_err_and(|why| why.contains("already being loaded"))));
            sender.send(LifecycleRequest::Stop).await.expect("the station listens");
        };
        let (next, ()) = tokio::join!(next_reload(&mut lifecycle, load), terminals);
        assert!(next.is_none());
    }

    #[tokio::test]
    async fn what_runs_goes_on_while_a_plant_file_is_loaded() {
        let (begun, begins) = std::sync::mpsc::channel();
        let (end, ends) = std::sync::mpsc::channel::<()>();
        let loading = loaded(move || {
            begun.send(()).expect("the test waits");
            ends.recv().expect("the test ends it");
            Err::<(), _>(CliError::Usage("refused".to_owned()))
        });
        // On the only thread of this test: it could not end what it waits for if the loader ran on it.
        let other = async {
            while begins.try_recv().is_err() {
                tokio::task::yield_now().await;
            }
            end.send(()).expect("the loader waits");
        };
        let (why, ()) = tokio::join!(loading, other);
        assert_eq!(why.err().as_deref(), Some("refused"));
    }
}
