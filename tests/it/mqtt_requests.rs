//! Requests from outside over MQTT, sent by clients that we did not write: done once, refused with a reason, never done again.

use std::process::Command;

use jiff::{SignedDuration, Timestamp};
use serde_json::{Value, json};

use crate::{
    mqtt::{Place, have_mosquitto},
    support::Process,
};

const AS_MES: &str = "commands_as = \"mes\"\n\n[[access.trusted]]\nuser = \"mes\"\nrole = \"technician\"\n";
const TOPIC: &str = "sightglass/tank/TIC-1/request";

/// A client that sends requests and hears the answers.
struct Client<'a> {
    place: &'a Place,
    answers: Process,
}

impl Client<'_> {
    fn new(place: &Place) -> Client<'_> {
        let mut answers = Process::start(
            Command::new("stdbuf")
                .args(["-oL", "mosquitto_sub", "-d", "-V", "5", "-q", "1", "-h", "localhost", "-p"])
                .arg(place.port.to_string())
                .args(["-t", "sightglass/tank/+/response", "-t", "mes/answers", "-F", "answer %t %D %p"]),
        );
        answers.wait_for("Subscribed");
        Client { place, answers }
    }

    fn publish(&self, topic: &str, payload: &[u8], more: &[&str]) {
        let file = self.place.path("payload");
        std::fs::write(&file, payload).expect("the folder is writable");
        let sent = Command::new("mosquitto_pub")
            .args(["-V", "5", "-q", "1", "-h", "localhost", "-p", &self.place.port.to_string(), "-t", topic, "-f"])
            .arg(file)
            .args(more)
            .status()
            .expect("mosquitto_pub runs");
        assert!(sent.success());
    }

    fn send(&self, request: &Value, more: &[&str]) {
        self.publish(TOPIC, request.to_string().as_bytes(), more);
    }

    /// The next answer that contains this.
    fn answer(&mut self, what: &str) -> Value {
        loop {
            let line = self.answers.wait_for("answer ");
            if line.contains(what) {
                let start = line.find('{').expect("an answer is JSON");
                return serde_json::from_str(&line[start..]).expect("an answer is JSON");
            }
        }
    }

    /// Its outcome, with or without an answer before that says that the plant has it.
    fn outcome(&mut self, what: &str) -> Value {
        loop {
            let answer = self.answer(what);
            if answer["result"] != "accepted" {
                return answer;
            }
        }
    }

    /// The reason for which a message is refused.
    fn refusal(&mut self, topic: &str, payload: &[u8], more: &[&str]) -> String {
        self.publish(topic, payload, more);
        let answer = self.answer("\"result\":\"refused\"");
        answer["reason"].as_str().unwrap_or_default().to_owned()
    }
}

fn request(id: &str, tag: &str, value: impl Into<Value>) -> Value {
    let expires = Timestamp::now() + SignedDuration::from_secs(120);
    let value: Value = value.into();
    json!({ "id": id, "tag": tag, "value": value, "reason": "recipe 7", "expires": expires.to_string() })
}

fn requests_of(status: &Value, key: &str) -> u64 {
    status["north"]["requests"][key].as_u64().unwrap_or_default()
}

fn is_ready(status: &Value) -> bool {
    status["north"]["connected"] == true && status["north"]["requests"]["error"].is_null()
}

#[test]
fn a_request_is_written_once_read_back_and_answered() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let _broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    place.wait_until("it takes requests", |status| status["north"]["requests"]["as"] == "mes" && is_ready(status));
    let mut client = Client::new(&place);

    let first = request("mes-1", "TIC-1.SV", 51.5);
    client.send(
        &first,
        &["-D", "PUBLISH", "response-topic", "mes/answers", "-D", "PUBLISH", "correlation-data", "key-1"],
    );
    let done = client.outcome("mes/answers key-1");
    assert_eq!((&done["result"], &done["value"], &done["recorded"]), (&json!("verified"), &json!(51.5), &json!(true)));

    // The same once more, as QoS 1 may deliver it: its answer, and no second write.
    client.send(&first, &[]);
    assert_eq!(client.answer("mes-1")["result"], "verified");
    client.send(&request("mes-2", "TIC-1.SV", 51.5), &[]);
    let unchanged = client.outcome("mes-2");
    assert_eq!((&unchanged["result"], unchanged["reason"].is_string()), (&json!("verified"), true), "{unchanged}");
    let status = place.wait_until("it is counted", |status| requests_of(status, "accepted") == 2);
    assert_eq!(requests_of(&status, "refused"), 0, "{}", status["north"]);
    let value = |status: &Value| {
        let tags = status["tags"].as_array().cloned().unwrap_or_default();
        tags.into_iter().find(|tag| tag["name"] == "TIC-1.SV").map(|tag| tag["value"].clone())
    };
    place.wait_until("the value is shown", |status| value(status) == Some(json!(51.5)));
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn what_is_no_valid_request_is_refused_and_writes_nothing() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let _broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    place.wait_until("it takes requests", is_ready);
    let mut client = Client::new(&place);
    let mut check = |payload: &[u8], more: &[&str], expect: &str| {
        let found = client.refusal(TOPIC, payload, more);
        assert!(found.contains(expect), "{expect}: {found}");
    };
    let text = |id: &str, tag: &str, value: Value| request(id, tag, value).to_string().into_bytes();
    check(b"on", &[], "not a request");
    check(&[0xff, 0xfe, 0x00], &[], "not a request");
    check(&text("r-1", "TIC-1.SV", json!("hot")), &[], "invalid type: string");
    check(&text("r-2", "TIC-1.SV", json!(null)), &[], "invalid type: null");
    check(&vec![b' '; 5_000], &[], "longer than 4096 bytes");
    check(&text("r-3", "TIC-7.SV", json!(50)), &[], "there is no tag TIC-7.SV");
    check(&text("r-4", "PLC-1.RUN", json!(1)), &[], "not of the device");
    check(
        &text("r-5", "TIC-1.SV", json!(50)),
        &["-D", "PUBLISH", "response-topic", "sightglass/tank/status"],
        "response topic",
    );
    let mut old = request("r-6", "TIC-1.SV", 50);
    old["expires"] = json!((Timestamp::now() - SignedDuration::from_secs(1)).to_string());
    check(old.to_string().as_bytes(), &[], "expired");
    old["expires"] = json!((Timestamp::now() + SignedDuration::from_hours(1)).to_string());
    check(old.to_string().as_bytes(), &[], "expires later than 600 s");
    check(&text("r-7", "TIC-1.SV", json!(50)), &["-r"], "retained");
    // What the plant refuses, as it would refuse it to a person: out of limits, and not for this role.
    check(&text("r-8", "TIC-1.SV", json!(100_000)), &[], "outside");
    check(&text("r-9", "TIC-1.P", json!(7)), &[], "this needs a supervisor, you are a technician");

    // Longer than a packet may be: the broker keeps it to itself, and the connection stays.
    client.publish(TOPIC, &vec![b' '; 100_000], &[]);
    client.send(&request("r-10", "TIC-1.SV", 52), &[]);
    assert_eq!(client.outcome("r-10")["result"], "verified");
    let status = place.wait_until("it is counted", |status| requests_of(status, "refused") == 13);
    assert_eq!(status["north"]["connected"], true);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));

    // What the broker keeps is delivered again after each start, and refused again.
    let mut station = place.station();
    place.wait_until("the retained one is refused", |status| requests_of(status, "refused") == 1);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn a_station_killed_before_the_outcome_answers_unknown() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let _broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    place.wait_until("it takes requests", is_ready);
    let mut client = Client::new(&place);
    // The device falls silent, so the write has no outcome yet.
    place.simulator().signal("STOP");
    let killed = request("k-1", "TIC-1.SV", 53);
    client.send(&killed, &[]);
    assert_eq!(client.answer("k-1")["result"], "accepted");
    station.signal("KILL");
    assert_eq!(station.end(), None);
    place.simulator().signal("CONT");
    // Sent while no station runs: the broker keeps it for no later subscriber.
    client.send(&request("k-2", "TIC-1.SV", 54), &[]);

    let mut station = place.station();
    let answer = client.answer("k-1");
    assert_eq!(answer["result"], "unknown", "{answer}");
    assert!(answer["reason"].as_str().is_some_and(|why| why.contains("check the value")), "{answer}");
    place.wait_until("it takes requests", is_ready);
    client.send(&killed, &[]);
    assert_eq!(client.answer("k-1")["result"], "unknown", "and it is not done again");
    client.send(&request("k-3", "TIC-1.SV", 55), &[]);
    assert_eq!(client.outcome("k-3")["result"], "verified");
    let status = place.wait_until("it is counted", |status| requests_of(status, "accepted") == 1);
    assert_eq!(requests_of(&status, "refused"), 0, "{}", status["north"]);
    assert!(client.answers.said.iter().all(|line| !line.contains("k-2")), "nothing old is done");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn without_the_key_the_station_subscribes_to_nothing() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new("");
    let mut broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    let status = place.wait_until("it is connected", |status| status["north"]["connected"] == true);
    assert!(status["north"]["requests"].is_null(), "{}", status["north"]);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
    broker.signal("TERM");
    broker.end();
    assert!(broker.said.iter().any(|line| line.contains("sightglass-tank")));
    assert!(broker.said.iter().all(|line| !line.contains("SUBSCRIBE from sightglass-tank")), "{:?}", broker.said);
}

#[test]
fn refusals_before_the_plant_are_on_record_in_bounds() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let _broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    place.wait_until("it takes requests", is_ready);
    let client = Client::new(&place);
    for _ in 0..12 {
        client.publish(TOPIC, b"on", &[]);
    }
    client.send(&request("a-1", "TIC-7.SV", 50), &[]);
    place.wait_until("they are counted", |status| requests_of(status, "refused") == 13);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
    let log = std::fs::read_to_string(place.path("tank.audit.jsonl")).expect("the audit log");
    let entries: Vec<_> = log.lines().filter(|line| line.contains("request from outside")).collect();
    assert_eq!(entries.len(), 3, "{entries:?}");
    assert!(entries[2].contains("refused: 11 requests, the last: not a request"), "the rest, at the end: {entries:?}");
    assert!(entries[0].contains("not a request") && entries[1].contains("there is no tag TIC-7.SV"), "{entries:?}");
}

#[test]
fn a_broker_that_refuses_answers_is_said_until_it_takes_one() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let acl = place.path("acl");
    std::fs::write(&acl, "topic readwrite sightglass/tank/#\n").expect("the folder is writable");
    let _broker = place.broker(&format!("allow_anonymous true\nacl_file {}\n", acl.display()));
    let mut station = place.station();
    place.wait_until("it takes requests", is_ready);
    let mut client = Client::new(&place);
    client.send(&request("a-1", "TIC-1.SV", 51), &["-D", "PUBLISH", "response-topic", "mes/answers"]);
    let said = |status: &Value| {
        let error = status["north"]["requests"]["error"].as_str().unwrap_or_default();
        error.contains("refuses answers on mes/answers: NotAuthorized")
    };
    let status = place.wait_until("it is said", said);
    assert!(requests_of(&status, "unanswered") >= 1, "{}", status["north"]);
    // Some brokers end the connection of who publishes what they refuse: what is sent before it is back is not delivered.
    let second = request("a-2", "TIC-1.SV", 52);
    place.wait_until("it takes the next one", |status| {
        client.send(&second, &[]);
        requests_of(status, "accepted") == 2
    });
    assert_eq!(client.outcome("a-2")["result"], "verified");
    place.wait_until("it is over", is_ready);
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn a_broker_that_refuses_the_subscription_is_said() {
    const PLUGIN: &str = "/usr/lib/x86_64-linux-gnu/mosquitto_dynamic_security.so";
    if !have_mosquitto() || !std::path::Path::new(PLUGIN).exists() {
        return;
    }
    let place = Place::new(AS_MES);
    let rules = place.path("rules.json");
    let may =
        json!({ "publishClientSend": true, "publishClientReceive": true, "subscribe": false, "unsubscribe": true });
    std::fs::write(&rules, json!({ "defaultACLAccess": may }).to_string()).expect("the folder is writable");
    let listener = format!("allow_anonymous true\nplugin {PLUGIN}\nplugin_opt_config_file {}\n", rules.display());
    let _broker = place.broker(&listener);
    let mut station = place.station();
    let status = place.wait_until("it is said", |status| {
        let error = status["north"]["requests"]["error"].as_str().unwrap_or_default();
        error.contains("the broker delivers no requests") && error.contains("NotAuthorized")
    });
    assert_eq!(status["north"]["connected"], true, "values go out nevertheless");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}

#[test]
fn answers_wait_for_a_broker_that_is_restarted() {
    if !have_mosquitto() {
        return;
    }
    let place = Place::new(AS_MES);
    let mut broker = place.broker("allow_anonymous true\n");
    let mut station = place.station();
    place.wait_until("it takes requests", is_ready);
    let mut client = Client::new(&place);
    place.simulator().signal("STOP");
    client.send(&request("b-1", "TIC-1.SV", 53), &[]);
    assert_eq!(client.answer("b-1")["result"], "accepted");
    broker.signal("TERM");
    broker.end();
    place.simulator().signal("CONT");
    place.wait_until("it has its outcome", |status| status["north"]["requests"]["last"]["result"] != "pending");
    drop(client);
    // The station may be first, so this broker keeps the answer for no subscriber: what it was given stands in its words.
    let mut broker = place.broker("allow_anonymous true\n");
    broker.wait_for("'sightglass/tank/TIC-1/response'");
    place.wait_until("it takes requests", is_ready);
    let mut client = Client::new(&place);
    client.send(&request("b-2", "TIC-1.SV", 54), &[]);
    assert_eq!(client.outcome("b-2")["result"], "verified");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
}
