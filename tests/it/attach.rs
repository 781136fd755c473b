//! The station's socket: what terminals see through it, what they can do, and what hostile or stuck ones cannot.

use std::{
    io::Write,
    os::unix::{fs::PermissionsExt, net::UnixStream as Plain},
    path::PathBuf,
    sync::Arc,
    time::Duration,
};

use sightglass::api::{
    access::{Completion, Durability, SessionRequest, SessionStatus},
    attach::{
        AttachError, ListenError, SocketFolders, TERMINALS_MAX, connect, listen,
        protocol::{
            self, ClientMessage, HANDSHAKE_BYTES_MAX, Handshake, LENGTH_BYTES, REQUEST_BYTES_MAX,
            SERVER_MESSAGE_BYTES_MAX, ServerMessage, TerminalOrigin,
        },
    },
    history::{HistoryError, Query, QueryRequest},
    plant::{
        AlarmCommand, Cause, Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, PlantDef,
        RequestRefusal, Sample, Snapshot, TagId,
    },
    profile::{self, Search},
    station::{Request, Session, SessionAcceptor},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::UnixStream,
    sync::{oneshot, watch},
    task::JoinHandle,
};

use crate::support::folder;

mod socket;
mod strangers;

/// No terminal waits so long for anything here, in virtual time.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A station without a plant behind it: its snapshots are what a test says.
struct Stand {
    folder: tempfile::TempDir,
    def: Arc<PlantDef>,
    publish: watch::Sender<Arc<Snapshot>>,
    /// May newcomers see the process?
    view: watch::Sender<bool>,
    /// Terminals that are there.
    present: watch::Receiver<usize>,
    /// Requests so far.
    asked: watch::Receiver<usize>,
    tasks: [JoinHandle<()>; 2],
}

impl Stand {
    fn start() -> Stand {
        Stand::start_in(folder())
    }

    fn start_in(folder: tempfile::TempDir) -> Stand {
        let def = profile::load(std::path::Path::new("tank"), &Search::shipped()).unwrap();
        let (publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(def.clone())));
        let (view, may) = watch::channel(true);
        let (count, present) = watch::channel(0);
        let (ask, asked) = watch::channel(0);
        let (acceptor, mut attach_requests, mut requests) = SessionAcceptor::new(snapshots);
        // Between fork and exec a process that another test starts holds a copy of the lock that was just given up.
        let mut tries = 0..100_000;
        let mut listener = loop {
            match (listen(&folder.path().join("tank.sock")), tries.next()) {
                (Err(ListenError::Running { .. }), Some(_)) => std::thread::yield_now(),
                (listener, _) => break listener.unwrap(),
            }
        };
        let serving = tokio::spawn(async move { listener.serve(&acceptor).await });
        let commands = publish.clone();
        let server = tokio::spawn(async move {
            let mut may = may;
            let mut terminals = Vec::new();
            let mut tick = tokio::time::interval(Duration::from_millis(100));
            loop {
                tokio::select! {
                    Some(request) = attach_requests.recv() => {
                        let may_view = *may.borrow();
                        request.status.send_replace(Arc::new(SessionStatus { may_view, banner: Some(request.peer.from), ..SessionStatus::default() }));
                        terminals.push(request.status);
                    }
                    Some((_, request)) = requests.recv() => {
                        answer(request, &commands);
                        ask.send_modify(|count| *count += 1);
                    }
                    Ok(()) = may.changed() => {
                        let may_view = *may.borrow_and_update();
                        for terminal in &terminals {
                            terminal.send_modify(|status| *status = Arc::new(SessionStatus { may_view, ..SessionStatus::clone(status) }));
                        }
                    }
                    _ = tick.tick() => terminals.retain(|terminal| !terminal.is_closed()),
                }
                count.send_replace(terminals.len());
            }
        });
        Stand { folder, def, publish, view, present, asked, tasks: [serving, server] }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("tank.sock")
    }

    async fn session(&self) -> Session {
        connect(&self.path()).await.unwrap()
    }

    /// The first tag has this value from now on.
    fn set(&self, value: f64) {
        self.publish.send_modify(|snapshot| {
            let snapshot = Arc::make_mut(snapshot);
            snapshot.at += jiff::SignedDuration::from_millis(100);
            snapshot.samples[0] = Sample::good(value, snapshot.at);
        });
    }

    async fn until_present(&mut self, count: usize) {
        let reached = tokio::time::timeout(TIMEOUT, self.present.wait_for(|present| *present == count)).await.is_ok();
        assert!(reached, "there are {} terminals, not {count}", *self.present.borrow());
    }

    /// As the station ends, or is killed. Its folder stays.
    async fn end(self) -> tempfile::TempDir {
        for task in self.tasks {
            task.abort();
            let _ = task.await;
        }
        self.folder
    }
}

fn answer(request: Request, commands: &watch::Sender<Arc<Snapshot>>) {
    match request {
        Request::Command(command, _) => commands.send_modify(|snapshot| {
            let snapshot = Arc::make_mut(snapshot);
            let (at, outcome) = (snapshot.at, Outcome::Verified);
            let status =
                CommandStatus { old: command.expected_value, outcome, ..CommandStatus::new(command, "anna", at) };
            snapshot.commands.insert(0, status);
            snapshot.commands.truncate(32);
        }),
        Request::Ask(query) => drop(query.reply.send(Err(HistoryError::EmptyPeriod))),
        Request::SessionRequest(SessionRequest::Stop, reply) => {
            drop(reply.send(Ok(Completion::new(Durability::Recorded, None))))
        }
        Request::SessionRequest(_, reply) => drop(reply.send(Err(RequestRefusal::BeingSaved))),
        Request::RecordRefusal { .. } => {}
    }
}

/// Waits, in virtual time, until the terminal sees it so.
async fn until(session: &mut Session, what: &str, so: impl Fn(&Snapshot) -> bool) {
    let reached = tokio::time::timeout(TIMEOUT, session.snapshots.wait_for(|snapshot| so(snapshot))).await;
    assert!(reached.is_ok_and(|reached| reached.is_ok()), "never: {what}");
}

async fn sees(session: &mut Session, value: f64) {
    until(session, &format!("the value {value}"), |snapshot| snapshot.samples[0].value == Some(value)).await;
}

async fn until_status(session: &mut Session, what: &str, so: impl Fn(&SessionStatus) -> bool) {
    let reached = tokio::time::timeout(TIMEOUT, session.status.wait_for(|status| so(status))).await;
    assert!(reached.is_ok_and(|reached| reached.is_ok()), "never: {what}");
}

fn of(session: &Session, number: u32) -> Option<Outcome> {
    let id = CommandId { terminal: session.terminal, number };
    session
        .snapshots
        .borrow()
        .commands
        .iter()
        .find(|status| status.command.id == id)
        .map(|status| status.outcome.clone())
}

fn handshake() -> Vec<u8> {
    protocol::encode(&(Handshake::current(), TerminalOrigin::default()), HANDSHAKE_BYTES_MAX).unwrap()
}

fn asked(asked: &ClientMessage) -> Vec<u8> {
    protocol::encode(asked, REQUEST_BYTES_MAX).unwrap()
}

/// Everything until the station closes; it does close, or the test fails.
async fn until_closed(stream: &mut UnixStream) -> Vec<u8> {
    let mut bytes = Vec::new();
    let closed = tokio::time::timeout(TIMEOUT, stream.read_to_end(&mut bytes)).await;
    assert!(closed.is_ok(), "the station never closed");
    bytes
}

async fn next(stream: &mut UnixStream) -> Vec<u8> {
    let mut length = [0; LENGTH_BYTES];
    stream.read_exact(&mut length).await.unwrap();
    let mut bytes = vec![0; protocol::length(length, SERVER_MESSAGE_BYTES_MAX).unwrap()];
    stream.read_exact(&mut bytes).await.unwrap();
    bytes
}

#[tokio::test(start_paused = true)]
async fn a_terminal_sees_the_plant_and_sends_commands() {
    let mut stand = Stand::start();
    stand.set(1.0);
    let mut session = stand.session().await;
    assert_eq!(session.snapshots.borrow().samples[0].value, Some(1.0), "at once");
    let from = session.status.borrow().banner.clone().unwrap();
    assert!(from.contains(&format!("process {}", std::process::id())), "{from}");
    for value in [2.0, 3.0, 4.0] {
        stand.set(value);
        sees(&mut session, value).await;
    }
    let ours = protocol::encode(&**session.snapshots.borrow(), usize::MAX);
    assert_eq!(ours, protocol::encode(&**stand.publish.borrow(), usize::MAX), "all of it, by its bytes");

    session.send_command(7, CommandKind::Alarm(AlarmCommand::Silence)).unwrap();
    until(&mut session, "the command has an outcome", |snapshot| !snapshot.commands.is_empty()).await;
    assert_eq!(of(&session, 7), Some(Outcome::Verified));
    assert_eq!(session.request(SessionRequest::Stop).await, Ok(Durability::Recorded));
    assert_eq!(session.request(SessionRequest::Logout).await, Err(RequestRefusal::BeingSaved));
    let (reply, answer) = oneshot::channel();
    let at = session.snapshots.borrow().at;
    session.ask(QueryRequest { query: Query::Journal { from: at, to: at, limit: 1 }, reply }).unwrap();
    assert_eq!(answer.await.unwrap(), Err(HistoryError::EmptyPeriod));
    drop(session);
    stand.until_present(0).await;
}

#[tokio::test(start_paused = true)]
async fn values_are_withheld_before_a_login_and_after_a_logout() {
    let stand = Stand::start();
    stand.view.send_replace(false);
    stand.set(1.0);
    let mut session = stand.session().await;
    let hidden = |snapshot: &Snapshot| snapshot.samples[0].quality.cause() == Some(Cause::NotAuthorised);
    assert!(hidden(&session.snapshots.borrow()));
    stand.view.send_replace(true);
    sees(&mut session, 1.0).await;
    stand.view.send_replace(false);
    until(&mut session, "nothing is seen any more", hidden).await;
    assert!(session.snapshots.borrow().samples.iter().all(|sample| sample.value.is_none()));
}

#[tokio::test(start_paused = true)]
async fn a_stuck_terminal_costs_only_itself_and_is_disconnected() {
    let mut stand = Stand::start();
    let mut stuck = UnixStream::connect(stand.path()).await.unwrap();
    stuck.write_all(&handshake()).await.unwrap();
    let mut quick = stand.session().await;
    stand.until_present(2).await;
    let started = tokio::time::Instant::now();
    let mut value = 0.0;
    // Every snapshot is another long text, so that the socket of the stuck one is full soon.
    while *stand.present.borrow() == 2 {
        value += 1.0;
        stand.publish.send_modify(|snapshot| {
            let texts = Arc::make_mut(&mut Arc::make_mut(snapshot).texts);
            texts[1] = Some(format!("{value}").repeat(20_000).into());
        });
        stand.set(value);
        sees(&mut quick, value).await;
        assert!(started.elapsed() < Duration::from_secs(600), "the stuck one is there for ever");
    }
    assert!(Duration::from_secs(290) < started.elapsed(), "it was disconnected after {:?}", started.elapsed());
    assert!(1_000.0 < value, "the quick one has seen {value} snapshots meanwhile");
    stand.until_present(1).await;
}

#[tokio::test(start_paused = true)]
async fn a_terminal_shows_a_lost_station_at_once_and_reconnects() {
    let stand = Stand::start();
    stand.set(1.0);
    let mut session = stand.session().await;
    let folder = stand.end().await;
    until_status(&mut session, "gone", |status| status.gone.is_some()).await;
    assert_eq!(session.send_command(1, CommandKind::Alarm(AlarmCommand::Silence)), Err(RequestRefusal::StationGone));
    assert_eq!(session.request(SessionRequest::Stop).await, Err(RequestRefusal::StationGone));
    assert_eq!(session.snapshots.borrow().samples[0].value, Some(1.0), "the last snapshot stays");

    let mut stand = Stand::start_in(folder);
    let other = stand.session().await;
    stand.set(2.0);
    until_status(&mut session, "back", |status| status.gone.is_none()).await;
    sees(&mut session, 2.0).await;
    session.send_command(2, CommandKind::Alarm(AlarmCommand::Silence)).unwrap();
    until(&mut session, "the command has an outcome", |snapshot| !snapshot.commands.is_empty()).await;
    assert_eq!(of(&session, 2), Some(Outcome::Verified), "under the number that the terminal has always had");
    drop((session, other));
    stand.until_present(0).await;
}

#[tokio::test(start_paused = true)]
async fn a_command_in_flight_is_uncertain_when_the_station_goes() {
    let stand = Stand::start();
    let mut session = stand.session().await;
    // The station takes it and dies before it replies.
    stand.tasks[1].abort();
    session.send_command(1, CommandKind::Alarm(AlarmCommand::Silence)).unwrap();
    tokio::task::yield_now().await;
    let _folder = stand.end().await;
    until_status(&mut session, "gone", |status| status.gone.is_some()).await;
    if session.status.borrow().undelivered.is_empty() {
        until(&mut session, "an outcome", |snapshot| !snapshot.commands.is_empty()).await;
        assert_eq!(of(&session, 1), Some(Outcome::NotConfirmed(NotConfirmed::ConnectionLost)));
    }
}

#[tokio::test(start_paused = true)]
async fn another_plant_after_a_restart_comes_with_its_own_definition() {
    let stand = Stand::start();
    let mut session = stand.session().await;
    let before = session.snapshots.borrow().def.clone();
    let folder = stand.end().await;
    until_status(&mut session, "gone", |status| status.gone.is_some()).await;
    let stand = Stand::start_in(folder);
    until_status(&mut session, "back", |status| status.gone.is_none()).await;
    stand.set(5.0);
    sees(&mut session, 5.0).await;
    assert!(Arc::ptr_eq(&before, &session.snapshots.borrow().def), "an equal definition is the same");

    // Reloaded with another title: the terminal is disconnected, and comes back to the new one.
    let mut def = PlantDef::clone(&stand.def);
    def.title = "Another".to_owned();
    stand.publish.send_replace(Arc::new(Snapshot::blank(Arc::new(def))));
    until(&mut session, "the other plant", |snapshot| snapshot.def.title == "Another").await;
}
