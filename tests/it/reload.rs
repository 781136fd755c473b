//! A plant file reloaded while its station runs: what is as it was keeps running, and what is not says why.

use std::{
    fs,
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};

use sightglass::api::{
    access::own_user,
    attach::connect,
    plant::{Cause, Quality, Snapshot},
    station::Session,
};
use tokio::net::TcpSocket;

use crate::{
    guarded,
    support::{Process, folder, sightglass, sockets},
};

/// A slave over Modbus TCP whose register N holds N.
struct Slave {
    port: u16,
    connections: Arc<AtomicUsize>,
}

impl Slave {
    /// One that answers, or one that never does.
    fn start(answers: bool) -> Slave {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let (port, connections) = (listener.local_addr().unwrap().port(), Arc::new(AtomicUsize::new(0)));
        let count = connections.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                count.fetch_add(1, Ordering::Relaxed);
                std::thread::spawn(move || serve(stream.unwrap(), answers));
            }
        });
        Slave { port, connections }
    }

    fn connections(&self) -> usize {
        self.connections.load(Ordering::Relaxed)
    }
}

/// Answers reads of holding registers until the connection ends.
fn serve(mut stream: TcpStream, answers: bool) {
    let mut head = [0; 7];
    while stream.read_exact(&mut head).is_ok() {
        let mut request = vec![0; usize::from(head[5]) - 1];
        stream.read_exact(&mut request).unwrap();
        if !answers {
            continue;
        }
        let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
        let message: Vec<u8> = match request[0] {
            3 => {
                let values = (word(1)..word(1) + word(3)).flat_map(u16::to_be_bytes);
                [3, 2 * request[4]].into_iter().chain(values).collect()
            }
            8 => request.clone(),
            other => vec![other | 0x80, 1],
        };
        let length = message.len() as u8 + 1;
        let answer = [&head[..4], &[0, length, head[6]], &message[..]].concat();
        // The station has gone.
        if stream.write_all(&answer).is_err() {
            return;
        }
    }
}

/// A station of a plant with two lines, and a terminal at its socket.
struct Station {
    folder: PathBuf,
    sockets: PathBuf,
    process: Process,
    session: Session,
}

/// Lines A and B, each with one device: R1 is read often, R2 once in ten minutes. `title` and `timeout_ms` (of B) may change.
fn plant([a, b]: [u16; 2], title: &str, timeout_ms: u32) -> String {
    let of = |line: &str, port: u16, timeout_ms: u32| {
        format!(
            "[[line]]\nname = \"{line}\"\nmode = \"tcp\"\nhost = \"127.0.0.1\"\ntcp_port = {port}\n\
             timeout_ms = {timeout_ms}\n\
             [[device]]\nname = \"D{line}\"\nline = \"{line}\"\nunit = 1\nfast = \"200ms\"\nslow = \"600s\"\n\
             default = {{ table = \"holding\", type = \"uint16\" }}\n\
             tag = [ {{ name = \"R1\", address = 1, poll = \"fast\" }}, {{ name = \"R2\", address = 200 }} ]\n"
        )
    };
    let access = format!("[[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n", own_user());
    let head = format!("title = \"{title}\"\ntime_zone = \"UTC\"\n");
    [head, of("A", a, 1_000), of("B", b, timeout_ms), access].concat()
}

fn command(folder: &Path, sockets: &Path) -> Command {
    let mut command = sightglass();
    command.current_dir(folder).env("XDG_RUNTIME_DIR", sockets).env("XDG_STATE_HOME", folder.join("state"));
    command
}

fn is_good(snapshot: &Snapshot, tags: &[&str]) -> bool {
    let good = |tag: &&str| snapshot.sample(snapshot.def.tag_named(tag).unwrap()).quality.is_good();
    tags.iter().all(good)
}

fn sample(snapshot: &Snapshot, tag: &str) -> sightglass::api::plant::Sample {
    snapshot.sample(snapshot.def.tag_named(tag).unwrap())
}

impl Station {
    async fn start(folder: &Path, text: &str) -> Station {
        let (sockets, folder) = (sockets(), folder.to_owned());
        fs::write(folder.join("both.toml"), text).unwrap();
        let mut process =
            Process::start(command(&folder, &sockets).args(["run", "both.toml", "--history", "h.duckdb"]));
        process.wait_for("tags on 2 lines");
        let session = connect(&sockets.join("sightglass/both.sock")).await.unwrap();
        Station { folder, sockets, process, session }
    }

    /// What a command says, and whether it was done.
    fn call(&self, args: &[&str]) -> (bool, String) {
        let output = command(&self.folder, &self.sockets).args(args).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.success(), String::from_utf8_lossy(&said).into_owned())
    }

    fn reload(&self, text: &str) -> (bool, String) {
        fs::write(self.folder.join("both.toml"), text).unwrap();
        self.call(&["reload"])
    }

    async fn until(&mut self, what: &str, so: impl Fn(&Snapshot) -> bool) -> Arc<Snapshot> {
        guarded::until(&mut self.session.snapshots, what, |snapshot| so(snapshot)).await
    }

    /// Stops it; the qualities that its history holds of a tag, in their order.
    fn stop(mut self, tag: &str) -> Vec<Quality> {
        let (done, said) = self.call(&["stop"]);
        assert!(done, "{said}");
        assert_eq!(self.process.end(), Some(0));
        stored(&self.folder.join("h.duckdb"), tag)
    }
}

/// The qualities that a history holds of a tag, in their order.
fn stored(history: &Path, tag: &str) -> Vec<Quality> {
    let db = duckdb::Connection::open(history).unwrap();
    let rows = "SELECT s.quality FROM sample s JOIN tag t ON t.id = s.tag WHERE t.name = ? ORDER BY s.utc";
    let mut rows = db.prepare(rows).unwrap();
    let rows = rows.query_map([tag], |row| row.get::<_, u8>(0)).unwrap();
    rows.map(|code| Quality::from_code(code.unwrap()).unwrap()).collect()
}

const ALL: [&str; 4] = ["DA.R1", "DA.R2", "DB.R1", "DB.R2"];
const NOT_READ: Quality = Quality::Bad(Cause::NotRead);
const OFF: Quality = Quality::Bad(Cause::StationOff);
const RELOADED: Quality = Quality::Bad(Cause::Reloaded);

#[tokio::test(flavor = "multi_thread")]
async fn an_unchanged_plant_file_changes_nothing() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let text = plant([slaves[0].port, slaves[1].port], "Both", 1_000);
    let mut station = Station::start(folder.path(), &text).await;
    let before = station.until("all values", |now| is_good(now, &ALL)).await;
    let (done, said) = station.reload(&text);
    assert!(done && said.contains("nothing has changed: everything keeps running"), "{said}");
    // A file with an error changes nothing either.
    let (done, said) = station.reload(&text.replace("fast", "fsat"));
    assert!(!done && said.contains("fsat"), "{said}");
    let later = station.until("a later value", |now| before.at < sample(now, "DA.R1").at).await;
    assert_eq!((later.run, sample(&later, "DA.R2")), (before.run, sample(&before, "DA.R2")), "the terminal stays, too");
    assert_eq!(slaves.each_ref().map(Slave::connections), [1, 1]);
    assert_eq!(station.stop("DA.R2"), [NOT_READ, Quality::Good, OFF]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_line_leaves_the_other_as_it_is() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let ports = slaves.each_ref().map(|slave| slave.port);
    let mut station = Station::start(folder.path(), &plant(ports, "Both", 1_000)).await;
    let before = station.until("all values", |now| is_good(now, &ALL)).await;
    let (done, said) = station.reload(&plant(ports, "Both", 900));
    assert!(done && said.contains("line A keeps running, line B starts again"), "{said}");
    let after = station.until("another run", |now| now.run != before.run && is_good(now, &ALL)).await;
    assert_eq!(sample(&after, "DA.R2"), sample(&before, "DA.R2"), "not read again");
    station.until("B is read", |now| after.at < sample(now, "DB.R1").at).await;
    assert_eq!(slaves.each_ref().map(Slave::connections), [1, 2]);
    assert_eq!(station.stop("DB.R2"), [NOT_READ, Quality::Good, OFF], "of the same device: its curve goes on");
    let log = fs::read_to_string(folder.path().join("h.audit.jsonl")).unwrap();
    let count = |what: &str| log.lines().filter(|line| line.contains(what)).count();
    let reloaded = count("done: line A keeps running, line B starts again");
    assert_eq!((count("\"start station\""), reloaded, count("\"plant file\"")), (1, 1, 2), "{log}");
}

/// Another period is for the tags that have it: the connection and what is read once stay.
#[tokio::test(flavor = "multi_thread")]
async fn another_period_closes_no_connection() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let ports = slaves.each_ref().map(|slave| slave.port);
    let text = plant(ports, "Both", 1_000);
    let mut station = Station::start(folder.path(), &text).await;
    let before = station.until("all values", |now| is_good(now, &ALL)).await;
    let at = text.find("name = \"DB\"").unwrap();
    let (head, of_b) = text.split_at(at);
    let (done, said) = station.reload(&format!("{head}{}", of_b.replace("200ms", "150ms")));
    assert!(done && said.contains("line A keeps running, line B keeps its connection"), "{said}");
    let after = station.until("another run", |now| now.run != before.run).await;
    assert_eq!(sample(&after, "DB.R2"), sample(&before, "DB.R2"), "not read again");
    station.until("B is read", |now| after.at < sample(now, "DB.R1").at).await;
    assert_eq!(slaves.each_ref().map(Slave::connections), [1, 1]);
    assert_eq!(station.stop("DB.R1"), [NOT_READ, Quality::Good, OFF]);
}

/// Behind a line that goes or comes every line, device and tag has another id.
#[tokio::test(flavor = "multi_thread")]
async fn a_line_that_goes_and_comes_leaves_the_other_as_it_is() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let ports = slaves.each_ref().map(|slave| slave.port);
    let text = plant(ports, "Both", 1_000);
    let mut station = Station::start(folder.path(), &text).await;
    let stored_all = |now: &Snapshot| is_good(now, &ALL) && now.history.committed_at.is_some();
    let before = station.until("all values, and a history", stored_all).await;
    let lines: Vec<usize> = text.match_indices("[[line]]").map(|(at, _)| at).collect();
    let (done, said) = station.reload(&format!("{}{}", &text[..lines[0]], &text[lines[1]..]));
    assert!(done && said.contains("line B keeps running, line A ends"), "{said}");
    let alone = station.until("another run", |now| now.run != before.run).await;
    assert_eq!(sample(&alone, "DB.R2"), sample(&before, "DB.R2"), "not read again");
    station.until("B is read", |now| alone.at < sample(now, "DB.R1").at).await;
    let (done, said) = station.reload(&text);
    assert!(done && said.contains("line A starts, line B keeps running"), "{said}");
    let after = station.until("both", |now| now.run != alone.run && is_good(now, &ALL)).await;
    assert_eq!(sample(&after, "DB.R2"), sample(&before, "DB.R2"));
    station.until("B is read", |now| after.at < sample(now, "DB.R1").at).await;
    assert_eq!(slaves.each_ref().map(Slave::connections), [2, 1]);
    let (history, [a, b]) = (folder.path().join("h.duckdb"), ["DA.R2", "DB.R1"]);
    assert_eq!(station.stop(b), [NOT_READ, Quality::Good, OFF]);
    let of_a = stored(&history, a);
    assert_eq!(of_a, [NOT_READ, Quality::Good, RELOADED, NOT_READ, Quality::Good, OFF]);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_host_has_values_of_its_own() {
    let (folder, slaves) = (folder(), [true, true, true].map(Slave::start));
    let [a, b, other] = slaves.each_ref().map(|slave| slave.port);
    let mut station = Station::start(folder.path(), &plant([a, b], "Both", 1_000)).await;
    let before = station.until("all values", |now| is_good(now, &ALL)).await;
    let (done, said) = station.reload(&plant([a, other], "Other", 1_000));
    assert!(done && said.contains("line A keeps running, line B starts again"), "{said}");
    station.until("the other host", |now| &*now.def.title == "Other" && is_good(now, &ALL)).await;
    assert_eq!(slaves.each_ref().map(Slave::connections), [1, 1, 1]);
    assert!(before.at < station.session.snapshots.borrow().at);
    assert_eq!(station.stop("DB.R2"), [NOT_READ, Quality::Good, RELOADED, Quality::Good, OFF]);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_title_restarts_no_line() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let ports = slaves.each_ref().map(|slave| slave.port);
    let mut station = Station::start(folder.path(), &plant(ports, "Both", 1_000)).await;
    let before = station.until("all values", |now| is_good(now, &ALL)).await;
    let (done, said) = station.reload(&plant(ports, "Another", 1_000));
    assert!(done && said.contains("line A keeps running, line B keeps running"), "{said}");
    let after = station.until("the title", |now| &*now.def.title == "Another").await;
    assert_eq!(sample(&after, "DB.R2"), sample(&before, "DB.R2"));
    station.until("a later value", |now| after.at < sample(now, "DB.R1").at).await;
    assert_eq!(slaves.each_ref().map(Slave::connections), [1, 1]);
    assert_eq!(station.stop("DB.R2"), [NOT_READ, Quality::Good, OFF]);
}

/// A line that ends slowly, because its device does not answer, holds nothing but itself.
#[tokio::test(flavor = "multi_thread")]
async fn status_answers_while_a_line_ends() {
    let (folder, slaves) = (folder(), [Slave::start(true), Slave::start(false)]);
    let ports = slaves.each_ref().map(|slave| slave.port);
    let mut station = Station::start(folder.path(), &plant(ports, "Both", 5_000)).await;
    let before = station.until("values of A", |now| is_good(now, &ALL[..2])).await;
    let (done, said) = station.reload(&plant(ports, "Both", 4_900));
    assert!(done && said.contains("line A keeps running, line B starts again"), "{said}");
    while station.session.snapshots.borrow().run == before.run {
        let (done, said) = station.call(&["status"]);
        assert!(done && said.contains("DA"), "{said}");
        let at = station.session.snapshots.borrow().at;
        station.until("A is read meanwhile", |now| at < sample(now, "DA.R1").at).await;
    }
    assert_eq!(slaves[0].connections(), 1);
    assert_eq!(station.stop("DA.R2"), [NOT_READ, Quality::Good, OFF]);
}

/// A host that answers no connection holds nothing either, and may be the one that changes.
#[tokio::test(flavor = "multi_thread")]
async fn an_unreachable_host_holds_no_reload() {
    let (folder, slave) = (folder(), Slave::start(true));
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind(([127, 0, 0, 1], 0).into()).unwrap();
    // Its queue is full: the system answers no further connection.
    let unreachable = socket.listen(0).unwrap();
    let at = unreachable.local_addr().unwrap();
    let _queued = TcpStream::connect(at).unwrap();
    let mut station = Station::start(folder.path(), &plant([slave.port, at.port()], "Both", 1_000)).await;
    let before = station.until("values of A", |now| is_good(now, &ALL[..2])).await;
    let (done, said) = station.reload(&plant([slave.port, at.port()], "Both", 900));
    assert!(done && said.contains("line A keeps running, line B starts again"), "{said}");
    let after = station.until("another run", |now| now.run != before.run).await;
    assert_eq!((sample(&after, "DA.R2"), slave.connections()), (sample(&before, "DA.R2"), 1));
    assert_eq!(station.stop("DA.R2"), [NOT_READ, Quality::Good, OFF]);
}

/// An alarm of DA.R1, which is always 1.
fn with_alarm(text: &str, message: &str) -> String {
    let alarm = "[[alarm]]\ntag = \"DA.R1\"\nhigh = 0.5\ndeadband = 0.1\non_delay = \"0s\"\npriority = \"high\"\n";
    format!("{text}{alarm}message = \"{message}\"\n")
}

/// The alarm events of a history: message, event, reason.
fn journal(history: &Path) -> Vec<String> {
    let db = duckdb::Connection::open(history).unwrap();
    let rows =
        "SELECT message || '|' || event || '|' || coalesce(reason, '') FROM alarm_journal WHERE subject = 'DA.R1'
        ORDER BY utc, rowid";
    let mut rows = db.prepare(rows).unwrap();
    let rows = rows.query_map([], |row| row.get::<_, String>(0)).unwrap();
    rows.map(Result::unwrap).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn no_alarm_leaves_without_an_event() {
    let (folder, slaves) = (folder(), [true, true].map(Slave::start));
    let ports = slaves.each_ref().map(|slave| slave.port);
    let text = plant(ports, "Both", 1_000);
    let mut station = Station::start(folder.path(), &with_alarm(&text, "over")).await;
    let before = station.until("the alarm", |now| !now.alarms.is_empty() && is_good(now, &ALL)).await;
    fs::write(folder.path().join("other.toml"), &text).unwrap();
    let (done, said) = station.call(&["check", "other.toml", "--against", "both"]);
    assert!(done && said.contains("against both: alarm DA.R1 over (UNACK) ends"), "{said}");
    // The same register by another name has the same alarm.
    fs::write(folder.path().join("other.toml"), with_alarm(&text, "over").replace("R1", "FLOW")).unwrap();
    let (done, said) = station.call(&["check", "other.toml", "--against", "both"]);
    assert!(done && said.contains("against both: alarm DA.R1 over (UNACK) goes on as DA.FLOW over"), "{said}");
    // Another message is the same alarm.
    let (done, said) = station.reload(&with_alarm(&text, "too high"));
    assert!(done && said.contains("alarm DA.R1 over (UNACK) goes on as DA.R1 too high"), "{said}");
    let after = station.until("another run", |now| now.run != before.run && !now.alarms.is_empty()).await;
    assert_eq!((after.alarms[0].raised_at, after.alarms[0].times), (before.alarms[0].raised_at, 1));
    let (done, said) = station.call(&["stop"]);
    assert!(done, "{said}");
    assert_eq!(station.process.end(), Some(0));
    let history = folder.path().join("h.duckdb");
    let so_far = [
        "over|raised|",
        "over|removed with the plant file|goes on as DA.R1 too high",
        "too high|carried over|was DA.R1 over",
    ];
    assert_eq!(journal(&history), so_far);
    // The next station has another plant file: the same alarm by another name, then none.
    let mut station = Station::start(folder.path(), &with_alarm(&text, "far too high")).await;
    let restarted = station.until("the alarm", |now| !now.alarms.is_empty()).await;
    assert_eq!(restarted.alarms[0].raised_at, before.alarms[0].raised_at, "since it was raised");
    assert!(station.call(&["stop"]).0 && station.process.end() == Some(0));
    let mut station = Station::start(folder.path(), &text).await;
    station.until("values", |now| is_good(now, &ALL) && now.history.committed_at.is_some()).await;
    assert!(station.call(&["stop"]).0 && station.process.end() == Some(0));
    let then = [
        "too high|removed with the plant file|goes on as DA.R1 far too high",
        "far too high|carried over|was DA.R1 too high",
        "far too high|removed with the plant file|",
    ];
    assert_eq!(journal(&history), [&so_far[..], &then].concat());
}
