//! A station in this process whose users must log in, with its socket, its audit log, and a tap on the line behind it.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex},
    time::Duration,
};

use sightglass::api::{
    access::{
        Credentials, Peer, SessionRequest, User, Users,
        audit_log::{self, Check, Entry, Summary},
        password::{SALT_BYTES, hash},
        users, users_beside,
    },
    attach::{connect, listen},
    bus::{Clock, Connector},
    plant::{
        Command, CommandId, CommandKind, CommandStatus, DeviceState, PlantDef, RequestRefusal, Role, Snapshot, TagId,
        Transport,
    },
    profile::{self, Search},
    sim::{Endpoint, Mode, Service, Serving, serve},
    station::{Options, Request, Session, Station, start_guarded},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream, tcp::OwnedReadHalf},
    sync::watch,
    task::JoinHandle,
};

use crate::support::{TIMEOUT, folder};

/// Plant seconds a second, so that no test waits for a lockout.
const SPEED: f64 = 20.0;
/// Everybody's.
pub const PASSWORD: &str = "four wet horses in a tank";

/// A station with users: `vera` looks, `tom` and `tina` are Technicians, `sue` and `lena` Supervisors, and `mia` is a
/// Supervisor who must choose a password of her own first.
pub struct Guarded {
    pub def: Arc<PlantDef>,
    /// What is true, whoever may see it.
    pub truth: watch::Receiver<Arc<Snapshot>>,
    pub tap: Tap,
    pub station: Station,
    clock: Clock,
    audit_log: PathBuf,
    path: PathBuf,
    socket: JoinHandle<()>,
    _simulated: Serving,
    _folder: tempfile::TempDir,
}

impl Guarded {
    /// The shipped tank with other rules, simulated, once it answers.
    pub async fn start(change: impl FnOnce(&mut PlantDef)) -> Guarded {
        let folder = folder();
        let def = profile::load(std::path::Path::new("tank"), &Search::shipped()).unwrap();
        let mut def = Arc::unwrap_or_clone(def);
        change(&mut def);
        let clock = Clock::starting_at(jiff::Timestamp::now(), SPEED);
        let service = Service { mode: Mode::Tcp, ..Service::new(&def.lines[0]) };
        let simulated = serve(&def, clock, &[service]).await.unwrap();
        let Endpoint::Address(device) = simulated.endpoints()[0] else { panic!("not served over TCP") };
        let (tap, port) = Tap::open(device).await;
        def.lines[0].transport = Transport::tcp("127.0.0.1", port);
        let def = Arc::new(def);
        let history = folder.path().join("tank.duckdb");
        users::write(&users_beside(&history), &everybody()).unwrap();
        let connectors = vec![Connector::Real(def.lines[0].transport.clone())];
        let options = Options { def: def.clone(), clock, history: history.clone(), connectors, file: None };
        let station = start_guarded(options).unwrap();
        let path = folder.path().join("tank.sock");
        let (mut listener, acceptor) = (listen(&path).unwrap(), station.acceptor().clone());
        let mut truth = acceptor.snapshots.clone();
        let socket = tokio::spawn(async move { listener.serve(&acceptor).await });
        let sv = def.tag_named("TIC-1.SV").unwrap();
        let known = |snapshot: &Arc<Snapshot>| {
            let answers = snapshot.devices.iter().all(|device| device.state == DeviceState::Responding);
            answers && snapshot.sample(sv).quality.is_good()
        };
        until(&mut truth, "the devices answer", known).await;
        let audit_log = audit_log::beside(&history);
        Guarded { def, truth, tap, station, clock, audit_log, path, socket, _simulated: simulated, _folder: folder }
    }

    /// A file with one sample of a tag, where the station imports files from.
    pub fn place_samples(&self, tag: &str, name: &str) {
        let folder = self.audit_log.with_file_name("tank.import");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join(name), format!("tag,time,value\n{tag},2024-03-20T06:00:00Z,1\n")).unwrap();
    }

    /// A terminal at the socket without a login.
    pub async fn anonymous(&self) -> Session {
        let session = connect(&self.path).await.unwrap();
        assert!(session.status.borrow().who.is_none());
        session
    }

    /// A terminal at the socket where this person has logged in.
    pub async fn person(&self, user: &str) -> Session {
        let mut session = self.anonymous().await;
        login(&session, user, PASSWORD).await.unwrap();
        let there = session.status.wait_for(|status| status.who.as_ref().is_some_and(|who| &*who.user == user));
        tokio::time::timeout(TIMEOUT, there).await.unwrap().unwrap();
        session
    }

    /// A terminal as the socket makes it of a host far away.
    pub fn far(&self, user: &str) -> Session {
        let from = format!("pts/9 from 10.0.0.9, user {user}, process 1").into();
        self.station.acceptor().attach(Peer { from, unix_user: Some(user.into()), in_process: false })
    }

    /// Plant time goes on for so long.
    pub async fn pass(&self, span: Duration) {
        let end = self.clock.now() + jiff::SignedDuration::try_from(span).unwrap();
        until(&mut self.truth.clone(), "time passes", |snapshot| end <= snapshot.at).await;
    }

    /// Gives a command and waits for what becomes of it.
    pub async fn send_command(&self, session: &Session, command: Command) -> CommandStatus {
        self.send_with_credentials(session, command, None).await
    }

    pub async fn send_with_credentials(
        &self,
        session: &Session,
        command: Command,
        credentials: Option<Credentials>,
    ) -> CommandStatus {
        let id = command.id;
        session.send(Request::Command(command, credentials)).unwrap();
        // A terminal without a login is sent no values: the outcome is taken from the unredacted snapshot.
        let mut truth = self.truth.clone();
        let of = |snapshot: &Arc<Snapshot>| {
            snapshot.commands.iter().find(|status| status.command.id == id && !status.is_pending()).cloned()
        };
        let with_outcome = until(&mut truth, &format!("an outcome of {id:?}"), |snapshot| of(snapshot).is_some()).await;
        of(&with_outcome).unwrap()
    }

    pub fn tag(&self, name: &str) -> TagId {
        self.def.tag_named(name).unwrap()
    }

    pub fn value(&self, name: &str) -> Option<f64> {
        self.truth.borrow().sample(self.tag(name)).value
    }

    /// The audit log as it is on disk.
    pub fn entries(&self) -> Vec<Entry> {
        let text = std::fs::read_to_string(&self.audit_log).unwrap();
        let mut check = Check::new(None, &[]);
        // The last line may be half written.
        let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        whole.map(|line| check.line(line.trim_end_matches('\n').as_bytes()).expect("a sound line")).collect()
    }

    /// Waits until the audit log holds such a line behind the first `after`.
    pub async fn written(&self, after: usize, what: &str, is: impl Fn(&Entry) -> bool) -> Entry {
        let mut truth = self.truth.clone();
        let end = tokio::time::Instant::now() + TIMEOUT;
        loop {
            let entries = self.entries();
            if let Some(entry) = entries.iter().skip(after).find(|entry| is(entry)) {
                return entry.clone();
            }
            assert!(tokio::time::Instant::now() < end, "not in the audit log: {what}\n{:#?}", &entries[after..]);
            truth.changed().await.unwrap();
        }
    }

    /// Stops the station; the audit log is whole.
    pub async fn end(self) -> Summary {
        self.station.stop().await;
        self.socket.await.unwrap();
        audit_log::verify(&self.audit_log, &[]).unwrap()
    }
}

fn everybody() -> Users {
    let salt = [7; SALT_BYTES];
    let hash: Arc<str> = hash(PASSWORD, salt).unwrap().into();
    let rows = [
        ("vera", Role::Viewer, false),
        ("tom", Role::Technician, false),
        ("tina", Role::Technician, false),
        ("sue", Role::Supervisor, false),
        ("lena", Role::Supervisor, false),
        ("mia", Role::Supervisor, true),
    ];
    let rows = rows.map(|(name, role, must_change)| User {
        name: name.into(),
        role,
        hash: hash.clone(),
        disabled: false,
        must_change,
        last_login: None,
    });
    Users::new(rows.into()).unwrap()
}

pub async fn login(session: &Session, user: &str, password: &str) -> Result<(), RequestRefusal> {
    session.request(SessionRequest::Login { user: user.into(), password: password.into() }).await.map(drop)
}

/// A command of this terminal.
pub fn request(session: &Session, number: u32, kind: CommandKind) -> Command {
    session.snapshots.borrow().command(CommandId { terminal: session.terminal, number }, kind)
}

/// Waits until a snapshot is so, and gives it.
pub async fn until(
    snapshots: &mut watch::Receiver<Arc<Snapshot>>,
    what: &str,
    so: impl FnMut(&Arc<Snapshot>) -> bool,
) -> Arc<Snapshot> {
    match tokio::time::timeout(TIMEOUT, snapshots.wait_for(so)).await {
        Ok(Ok(snapshot)) => return snapshot.clone(),
        Ok(Err(_)) => {}
        Err(_) => {}
    }
    panic!("never: {what}")
}

/// Between station and devices: hears every request, and can swallow them.
#[derive(Clone, Default)]
pub struct Tap {
    heard: Arc<Mutex<Heard>>,
}

#[derive(Default)]
struct Heard {
    connections: usize,
    functions: Vec<u8>,
    mute: bool,
}

impl Tap {
    /// A tap before this device, and its port.
    async fn open(device: std::net::SocketAddr) -> (Tap, u16) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        let tap = Tap::default();
        let own = tap.clone();
        tokio::spawn(async move {
            while let Ok((station, _)) = listener.accept().await {
                let device = TcpStream::connect(device).await.unwrap();
                own.heard.lock().unwrap().connections += 1;
                let (from_station, mut to_station) = station.into_split();
                let (mut from_device, to_device) = device.into_split();
                tokio::spawn(own.clone().listen(from_station, to_device));
                tokio::spawn(async move { tokio::io::copy(&mut from_device, &mut to_station).await });
            }
        });
        (tap, port)
    }

    /// Passes requests on: seven bytes of header, the length in the last three of which counts the unit, then the function.
    async fn listen(self, mut station: OwnedReadHalf, mut device: tokio::net::tcp::OwnedWriteHalf) {
        let mut header = [0; 7];
        while station.read_exact(&mut header).await.is_ok() {
            let mut pdu = vec![0; usize::from(u16::from_be_bytes([header[4], header[5]])) - 1];
            if station.read_exact(&mut pdu).await.is_err() {
                return;
            }
            let mute = {
                let mut heard = self.heard.lock().unwrap();
                // A raw test may send a header that announces nothing.
                heard.functions.extend(pdu.first());
                heard.mute
            };
            if !mute && device.write_all(&[&header[..], &pdu].concat()).await.is_err() {
                return;
            }
        }
    }

    /// The devices hear nothing from now on.
    pub fn mute(&self) {
        self.heard.lock().unwrap().mute = true;
    }

    /// How often the line was opened.
    pub fn connections(&self) -> usize {
        self.heard.lock().unwrap().connections
    }

    /// The functions of requests that were no mere reading of registers or bits.
    pub fn writes(&self) -> Vec<u8> {
        self.heard.lock().unwrap().functions.iter().copied().filter(|function| !(1..=4).contains(function)).collect()
    }
}
