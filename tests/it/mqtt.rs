//! Data out over MQTT: a broker and a subscriber that we did not write, while broker and station are stopped and killed.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
    time::Instant,
};

use jiff::Timestamp;
use serde_json::Value;
use sightglass::api::{
    access::own_user,
    history::{Answer, Query, Store},
    profile::{self, Search},
};

use crate::support::{Process, TIMEOUT, folder, free_port, have, sightglass, simulated_tank, sockets};

/// Tag, time and value of a sample.
type Row = (String, Timestamp, Option<String>);

pub struct Place {
    folder: tempfile::TempDir,
    sockets: PathBuf,
    pub port: u16,
    devices: String,
    sim: Process,
}

impl Place {
    /// A tank that sends to a broker, and more lines of `[north.mqtt]`.
    pub fn new(more: &str) -> Place {
        let (folder, sockets) = (folder(), sockets());
        let (sim, devices) = simulated_tank();
        let port = free_port();
        let shipped = sightglass().args(["profiles", "tank"]).output().unwrap();
        let rules = format!(
            "\n[[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n\n[north.mqtt]\nhost = \"localhost\"\nport = {port}\n{more}",
            own_user()
        );
        let plant = String::from_utf8(shipped.stdout).unwrap() + &rules;
        fs::write(folder.path().join("tank.toml"), plant).unwrap();
        Place { folder, sockets, port, devices, sim }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A broker that keeps what it has acknowledged for a subscriber that is away.
    pub fn broker(&self, listener: &str) -> Process {
        let broker = Broker { port: self.port, folder: self.folder.path() };
        broker.start(listener)
    }

    fn subscriber(&self) -> Process {
        let mut subscriber = Process::start(
            // It keeps its words back when it writes into a pipe.
            Command::new("stdbuf")
                .args(["-oL", "mosquitto_sub", "-d", "-V", "5", "-q", "1", "-i", "listener", "-c", "-x", "600"])
                .args(["-h", "localhost", "-p"])
                .arg(self.port.to_string())
                .args(["-t", "sightglass/tank/#", "-F", "%t %p"]),
        );
        subscriber.wait_for("Subscribed");
        subscriber
    }

    /// Reads what the subscriber got until now.
    fn catch_up(&self, subscriber: &mut Process, mark: &str) {
        let sent = Command::new("mosquitto_pub")
            .args([
                "-q",
                "1",
                "-h",
                "localhost",
                "-p",
                &self.port.to_string(),
                "-t",
                "sightglass/tank/mark",
                "-m",
                mark,
            ])
            .status()
            .unwrap();
        assert!(sent.success());
        subscriber.wait_for(&format!("sightglass/tank/mark {mark}"));
    }

    /// The devices.
    pub fn simulator(&self) -> &Process {
        &self.sim
    }

    pub fn station(&self) -> Process {
        let mut station = Process::start(
            sightglass()
                .arg("run")
                .arg(self.path("tank.toml"))
                .args(["--port", &format!("L1={}", self.devices), "--history"])
                .arg(self.path("tank.duckdb"))
                .env("XDG_RUNTIME_DIR", &self.sockets)
                .env("XDG_STATE_HOME", self.folder.path()),
        );
        station.wait_for("TIC-1 (unit 1): responding");
        station
    }

    /// Asks the station until it says so.
    pub fn wait_until(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + TIMEOUT;
        loop {
            let output =
                sightglass().args(["status", "--json"]).env("XDG_RUNTIME_DIR", &self.sockets).output().unwrap();
            let status: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
            if is_so(&status) {
                return status;
            }
            assert!(Instant::now() < end, "{what}: {}", status["north"]);
        }
    }

    /// Reloads the plant file with another text in the place of one.
    fn reload(&self, text: &str, other: &str) {
        let plant = fs::read_to_string(self.path("tank.toml")).unwrap();
        assert!(plant.contains(text));
        fs::write(self.path("tank.toml"), plant.replacen(text, other, 1)).unwrap();
        let end = Instant::now() + TIMEOUT;
        loop {
            let output = sightglass().arg("reload").env("XDG_RUNTIME_DIR", &self.sockets).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            if output.status.success() {
                return;
            }
            // Whoever asks for the status again and again is asked to wait.
            assert!(said.contains("attached recently") && Instant::now() < end, "{said}");
        }
    }

    /// Waits until all that was stored before a moment is sent. The numbers do not say it: a deadband keeps values back.
    fn wait_until_sent(&self, moment: Timestamp) {
        self.wait_until("all of before is sent", |status| {
            status["north"]["sent_until"].as_str().and_then(|at| at.parse().ok()) > Some(moment)
        });
    }

    /// Waits until so many rows more are stored.
    fn wait_for_rows(&self, more: u64) {
        let rows = |status: &Value| status["history"]["rows"].as_u64();
        let before = self.wait_until("the history answers", |status| rows(status).is_some());
        self.wait_until("the history goes on", |status| rows(status) > rows(&before).map(|before| before + more));
    }

    /// What is stored.
    fn stored(&self) -> BTreeSet<Row> {
        let def = Arc::new(profile::load(&self.path("tank.toml"), &Search::shipped()).unwrap());
        let store = Store::open_read_only(&self.path("tank.duckdb"), &def).unwrap();
        let query = Query::Samples { epoch: None, from: Timestamp::UNIX_EPOCH, to: Timestamp::now() };
        let Answer::Samples(samples) = store.answer(&query, Timestamp::now()).unwrap() else { panic!("other answer") };
        let row = |(tag, sample): (_, sightglass::api::plant::Sample)| {
            (def.tag(tag).name.clone(), sample.at, sample.value.map(|value| value.to_string()))
        };
        samples.samples.into_iter().map(row).collect()
    }
}

struct Broker<'a> {
    port: u16,
    folder: &'a Path,
}

impl Broker<'_> {
    fn start(&self, listener: &str) -> Process {
        let (port, folder) = (self.port, self.folder.display());
        // Started by root it would become another user, who may not write here; others ignore the line.
        let config = format!(
            "user root\nlistener {port}\npersistence true\npersistence_location {folder}/\nautosave_on_changes true\nautosave_interval 1\n\
             max_queued_messages 0\n{listener}"
        );
        let path = self.folder.join("mosquitto.conf");
        fs::write(&path, config).unwrap();
        let mut broker = Process::start(Command::new("mosquitto").arg("-v").arg("-c").arg(path));
        broker.wait_for("running");
        broker
    }
}

/// The samples of all messages, in the order in which they came.
fn received(lines: &[String]) -> Vec<Row> {
    let messages = lines.iter().filter_map(|line| line.split_once("/samples "));
    let rows = messages.flat_map(|(_, payload)| {
        let message: Value = serde_json::from_str(payload).unwrap();
        message["samples"].as_array().unwrap().clone()
    });
    rows.map(|row| {
        assert_eq!(row["value"].is_null(), row["quality"] == "bad", "{row}");
        let text = |name: &str| row[name].as_str().unwrap().to_owned();
        (text("tag"), text("at").parse().unwrap(), row["value"].as_f64().map(|value| value.to_string()))
    })
    .collect()
}

pub fn have_mosquitto() -> bool {
    have("mosquitto", "mosquitto") && have("mosquitto_sub", "mosquitto-clients")
}

fn sent(status: &Value) -> u64 {
    status["north"]["sent"].as_u64().unwrap_or_default()
}

#[test]
fn every_sample_arrives_through_kills_of_broker_and_station() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new("");
    let broker = place.broker("allow_anonymous true\n");
    let mut subscriber = place.subscriber();
    let mut station = place.station();
    subscriber.expect(r#"status {"state":"online"}"#);
    place.wait_until("samples arrive", |status| sent(status) > 20);

    // A broker that stands still, and goes on.
    broker.signal("STOP");
    place.wait_for_rows(50);
    let stood_still = Timestamp::now();
    broker.signal("CONT");
    place.wait_until_sent(stood_still);

    // A broker that ends, and comes back.
    broker.signal("TERM");
    let mut broker = broker;
    broker.end();
    let gone = place.wait_until("it is noticed", |status| status["north"]["connected"] == false);
    assert!(gone["north"]["error"].is_string(), "{}", gone["north"]);
    place.wait_for_rows(50);
    let _broker = place.broker("allow_anonymous true\n");
    place.wait_until("it is connected again", |status| status["north"]["connected"] == true);

    // A station that is killed: the broker says so, and the next one goes on where it was.
    place.catch_up(&mut subscriber, "before the kill");
    station.signal("KILL");
    assert_eq!(station.end(), None);
    subscriber.wait_for(r#"status {"state":"offline"}"#);
    let mut station = place.station();
    let complete = Timestamp::now();
    place.wait_until_sent(complete);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
    place.catch_up(&mut subscriber, "the end");

    let arrived = received(&subscriber.said);
    let all: BTreeSet<Row> = arrived.iter().cloned().collect();
    let stored: Vec<Row> = place.stored().into_iter().filter(|(_, at, _)| *at < complete).collect();
    let missing: Vec<_> = stored.iter().filter(|row| !all.contains(*row)).collect();
    assert!(
        stored.len() > 100 && missing.is_empty(),
        "{} of {} are missing: {:?}",
        missing.len(),
        stored.len(),
        missing.first()
    );
    let foreign: Vec<_> = all.difference(&place.stored()).cloned().collect();
    assert!(foreign.is_empty(), "what is not stored was sent: {foreign:?}");
    println!("{} samples stored, {} sent, {} of them twice", stored.len(), arrived.len(), arrived.len() - all.len());

    // Who comes later gets what holds, of each device and of the station.
    let retained = Command::new("mosquitto_sub")
        .args(["-h", "localhost", "-p", &place.port.to_string(), "-t", "sightglass/tank/+", "-F", "%t %p", "-C", "3"])
        .output()
        .unwrap();
    let retained = String::from_utf8(retained.stdout).unwrap();
    let state = retained.lines().find_map(|line| line.strip_prefix("sightglass/tank/TIC-1 ")).expect(&retained);
    let state: Value = serde_json::from_str(state).unwrap();
    assert_eq!(state["values"]["TIC-1.SV"]["quality"], "good", "{state}");
}

#[test]
fn a_broker_with_tls_and_passwords_is_trusted_or_an_alarm() {
    if !have_mosquitto() || !have("mosquitto_passwd", "mosquitto") || !have("openssl", "openssl") {
        return;
    }
    let place = Place::new("user = \"plant\"\npassword_file = \"PASSWORD\"\nca_file = \"CA\"\nlag_max = \"15s\"\n");
    let file = |name: &str| place.path(name).display().to_string();
    let plant = fs::read_to_string(place.path("tank.toml")).unwrap();
    let plant = plant.replace("\"PASSWORD\"", &format!("{:?}", file("password")));
    fs::write(place.path("tank.toml"), plant.replace("\"CA\"", &format!("{:?}", file("ca.pem")))).unwrap();
    fs::write(place.path("password"), "wrong\n").unwrap();
    let made = Command::new("openssl")
        .args(["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"])
        .args(["-addext", "basicConstraints=critical,CA:FALSE"])
        .args(["-addext", "subjectAltName=DNS:localhost", "-keyout", &file("key.pem"), "-out", &file("ca.pem")])
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let made = Command::new("mosquitto_passwd").args(["-c", "-b", &file("users"), "plant", "secret"]).status().unwrap();
    assert!(made.success());
    let listener =
        format!("certfile {}\nkeyfile {}\npassword_file {}\n", file("ca.pem"), file("key.pem"), file("users"));
    let _broker = place.broker(&listener);
    let mut station = place.station();
    let is_alarm = |status: &Value| status["alarms"].to_string().contains("data out delayed");
    let refused = place.wait_until("an alarm", is_alarm);
    assert_eq!(refused["north"]["connected"], false);
    let error = refused["north"]["error"].to_string();
    assert!(error.contains("refuses") && !error.contains("wrong"), "{error}");

    fs::write(place.path("password"), "secret\n").unwrap();
    place.wait_until("samples arrive", |status| sent(status) > 20);
    place.wait_until("the alarm clears", |status| {
        let alarms = status["alarms"].as_array().cloned().unwrap_or_default();
        alarms.iter().all(|alarm| alarm["message"] != "data out delayed" || !alarm["returned_at"].is_null())
    });
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn what_the_broker_may_not_take_is_not_skipped() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new("");
    let acl = place.path("acl");
    let listener = format!("allow_anonymous true\nacl_file {}\n", acl.display());
    fs::write(&acl, "topic readwrite sightglass/tank/+\n").unwrap();
    let broker = place.broker(&listener);
    let mut station = place.station();
    let refused = place.wait_until("the station says so", |status| {
        status["north"]["error"].as_str().is_some_and(|error| error.contains("refuses: NotAuthorized"))
    });
    assert_eq!((sent(&refused), &refused["north"]["refused"]), (0, &Value::from(0)), "{}", refused["north"]);
    fs::write(&acl, "topic readwrite sightglass/tank/#\n").unwrap();
    broker.signal("HUP");
    let mut subscriber = place.subscriber();
    let complete = Timestamp::now();
    place.wait_until_sent(complete);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
    place.catch_up(&mut subscriber, "the end");
    let all: BTreeSet<Row> = received(&subscriber.said).into_iter().collect();
    let stored: Vec<Row> = place.stored().into_iter().filter(|(_, at, _)| *at < complete).collect();
    assert!(stored.len() > 50 && stored.iter().all(|row| all.contains(row)), "{} stored", stored.len());
}

#[test]
fn data_out_goes_on_through_a_reload_of_the_plant_file() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new("");
    let _broker = place.broker("allow_anonymous true\n");
    let mut subscriber = place.subscriber();
    let mut station = place.station();
    subscriber.expect(r#"status {"state":"online"}"#);
    let before = place.wait_until("samples arrive", |status| sent(status) > 20);
    place.reload("title = \"", "title = \"Other ");
    place.wait_until("it goes on", |status| sent(status) > sent(&before) + 20);
    place.catch_up(&mut subscriber, "another title");
    assert!(!subscriber.said.iter().any(|line| line.contains("offline")), "the connection is the same");

    // Other tags: another connection, and nothing is missing.
    place.reload("fast = \"1s\"", "fast = \"900ms\"");
    subscriber.wait_for(r#"status {"state":"offline"}"#);
    subscriber.wait_for(r#"status {"state":"online"}"#);
    let complete = Timestamp::now();
    place.wait_until_sent(complete);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{}", station.said.join("\n"));
    place.catch_up(&mut subscriber, "the end");
    let all: BTreeSet<Row> = received(&subscriber.said).into_iter().collect();
    let stored: Vec<Row> = place.stored().into_iter().filter(|(_, at, _)| *at < complete).collect();
    assert!(stored.len() > 40 && stored.iter().all(|row| all.contains(row)), "{} stored", stored.len());
}
