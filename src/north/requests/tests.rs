//! What a client is answered: once, again, after a restart, in a flood.

use super::*;
use crate::{
    north::{
        payload::tests::mqtt,
        request::tests::{at, json, message},
    },
    plant::{Plant, command::Refusal, fault::Fault, fixture},
};

const TERMINAL: u32 = 7;

fn now(second: i64) -> Now {
    Now { plant: at(second), utc: at(second) }
}

fn requests(log: Result<RequestLog, String>) -> Requests {
    Requests::new(MqttDef { commands_as: Some("mes".into()), ..mqtt() }, log, now(0))
}

fn answer(message: &Message) -> serde_json::Value {
    serde_json::from_slice(&message.payload).expect("JSON")
}

/// Decides on a message and gives `result: reason`, or the number of the command.
fn decide(requests: &mut Requests, received: &Received, second: i64) -> String {
    match requests.on_received(&fixture::shared(), received, now(second)) {
        Decision::None => "nothing".into(),
        Decision::PassOn(request) => format!("command {}", request.number),
        Decision::Answer(message) => {
            let answer = answer(&message);
            let reason = answer["reason"].as_str().map(|why| format!(": {why}")).unwrap_or_default();
            answer["result"].as_str().unwrap_or("no result").to_owned() + &reason
        }
    }
}

fn snapshot(number: u32, outcome: Outcome) -> Snapshot {
    let mut snapshot = Snapshot::blank(fixture::shared());
    let id = CommandId { terminal: TERMINAL, number };
    let command = snapshot.command(id, CommandKind::Write { tag: fixture::SV, value: 50.0.into() });
    let status = CommandStatus { outcome, ..CommandStatus::new(command, "mes", at(0)) };
    snapshot.commands.push(status);
    snapshot
}

fn results(answers: &[Message]) -> Vec<String> {
    answers.iter().map(|message| answer(message)["result"].as_str().unwrap_or_default().to_owned()).collect()
}

#[test]
fn only_a_request_that_names_a_value_minds_what_is_there() {
    let snapshot = Snapshot::blank(fixture::shared());
    for (expected, is_unconditional) in [(None, true), (Some(70.0.into()), false)] {
        let request = PassOn {
            number: 1,
            tag: fixture::SV,
            value: 50.0.into(),
            expected,
            expires: at(60),
            note: "recipe".to_owned(),
        };
        let command = request.command(&snapshot, TERMINAL, now(0)).expect("it is in time");
        assert_eq!((command.is_unconditional, command.expected_value), (is_unconditional, expected));
    }
}

#[test]
fn a_request_is_accepted_once_and_its_outcome_answered_once() {
    let mut requests = requests(Ok(RequestLog::default()));
    let received = message(&json("a", "50"));
    assert_eq!(decide(&mut requests, &received, 0), "command 1");
    assert_eq!(decide(&mut requests, &received, 0), "accepted", "a second delivery is no second command");
    let pending = snapshot(1, Outcome::Pending);
    assert_eq!(results(&requests.on_snapshot(&pending, TERMINAL, now(1))), ["accepted"]);
    assert!(requests.on_snapshot(&pending, TERMINAL, now(1)).is_empty());
    let done = snapshot(1, Outcome::Verified);
    assert_eq!(results(&requests.on_snapshot(&done, TERMINAL, now(2))), ["verified"]);
    assert!(requests.on_snapshot(&done, TERMINAL, now(2)).is_empty());
    assert_eq!(decide(&mut requests, &received, 3), "verified", "it gets its answer again");
    assert_eq!(decide(&mut requests, &received, 1_000), "verified", "even after it has expired");
    let other = message(&json("a", "60"));
    assert_eq!(decide(&mut requests, &other, 1_001), "refused: another request had this id");
    let MqttRequestStatus { accepted, refused, unanswered, .. } = *requests.status();
    assert_eq!((accepted, refused, unanswered), (1, 1, 0));
}

#[test]
fn a_request_that_expires_while_the_list_is_written_is_not_sent() {
    let passed_on = |second| {
        let mut requests = requests(Ok(RequestLog::default()));
        let received = message(&json("a", "50"));
        let decision = requests.on_received(&fixture::shared(), &received, now(0));
        let Decision::PassOn(request) = decision else { panic!("{decision:?}") };
        request.command(&Snapshot::blank(fixture::shared()), TERMINAL, now(second)).map(|command| command.id.number)
    };
    assert_eq!(passed_on(29), Ok(1));
    assert_eq!(passed_on(30), Err(MqttRefusal::Expired), "the disk took half a minute");
}

#[test]
fn a_value_with_more_decimals_than_its_tag_is_refused() {
    let passed_on = |value: &str| {
        let mut requests = requests(Ok(RequestLog::default()));
        let decision = requests.on_received(&fixture::shared(), &message(&json("a", value)), now(0));
        let Decision::PassOn(request) = decision else { panic!("{decision:?}") };
        let mut snapshot = Snapshot::blank(fixture::shared());
        snapshot.decimals[fixture::SV.index()] = 1;
        request.command(&snapshot, TERMINAL, now(1)).map_err(|why| why.to_string()).map(|command| command.kind)
    };
    let write = |value: f64| Ok(CommandKind::Write { tag: fixture::SV, value: value.into() });
    for (value, expect) in [("50.5", 50.5), ("50.50", 50.5), ("50.000", 50.0), ("5.05e1", 50.5), ("1e2", 100.0)] {
        assert_eq!(passed_on(value), write(expect), "{value}");
    }
    for value in ["50.55", "0.01", "5e-2", "1e-30"] {
        assert_eq!(passed_on(value), Err("at most 1 decimal".to_owned()), "{value}");
    }
}

#[test]
fn a_request_for_a_listening_line_is_refused_by_the_plant() {
    let mut def = fixture::plant();
    def.lines[0].listens = true;
    let mut plant = Plant::new(def.into(), at(0), 1.0);
    let mut requests = requests(Ok(RequestLog::default()));
    decide(&mut requests, &message(&json("a", "50")), 0);
    let status = snapshot(1, Outcome::Pending).commands.remove(0);
    assert!(plant.on_command(status, at(0)).bus.is_empty(), "nothing goes to the line");
    let answers = requests.on_snapshot(&plant.snapshot(), TERMINAL, now(1));
    assert_eq!(results(&answers), ["refused"]);
    assert_eq!(answer(&answers[0])["reason"], Refusal::OnlyListens.to_string());
}

#[test]
fn what_the_plant_refuses_is_answered_with_its_reason() {
    let mut requests = requests(Ok(RequestLog::default()));
    decide(&mut requests, &message(&json("a", "50")), 0);
    let refused = snapshot(1, Outcome::Refused(Refusal::ReadOnly));
    let answers = requests.on_snapshot(&refused, TERMINAL, now(1));
    assert_eq!(answer(&answers[0])["reason"], "read only");
    assert_eq!(requests.status().refused, 1);
    let foreign = snapshot(2, Outcome::Refused(Refusal::ReadOnly));
    decide(&mut requests, &message(&json("b", "50")), 2);
    assert!(requests.on_snapshot(&foreign, TERMINAL + 1, now(2)).is_empty(), "of another terminal");
    let doubtful = snapshot(2, Outcome::NotConfirmed(crate::plant::command::NotConfirmed::NotAnswered(Fault::Timeout)));
    assert_eq!(results(&requests.on_snapshot(&doubtful, TERMINAL, now(3))), ["unknown"]);
}

#[test]
fn after_a_restart_nothing_is_done_again() {
    let mut before = requests(Ok(RequestLog::default()));
    let received = message(&json("a", "50"));
    assert_eq!(decide(&mut before, &received, 0), "command 1");
    let log = serde_json::from_slice(&before.log_bytes()).expect("the file is JSON");
    let mut after = requests(Ok(log));
    let left = after.after_restart(now(1));
    assert_eq!(results(&left), ["unknown"]);
    assert!(answer(&left[0])["reason"].as_str().is_some_and(|why| why.contains("check the value")));
    assert!(decide(&mut after, &received, 2).starts_with("unknown: the station was restarted"));
    assert_eq!(decide(&mut after, &message(&json("b", "50")), 2), "command 1");
}

#[test]
fn a_damaged_list_closes_until_all_requests_have_expired() {
    let mut requests = requests(Err("tank.mqtt-requests: expected value".into()));
    assert_eq!(requests.status().error.as_deref(), Some("tank.mqtt-requests: expected value"));
    let found = decide(&mut requests, &message(&json("a", "50")), 1);
    assert!(found.starts_with("refused: the list of earlier requests is damaged"), "{found}");
    let later = json("b", "50").replace(&at(30).to_string(), &at(700).to_string());
    assert_eq!(decide(&mut requests, &message(&later), 600), "command 1");
}

#[test]
fn a_flood_is_refused_then_not_even_answered() {
    let mut requests = requests(Ok(RequestLog::default()));
    let found: Vec<String> =
        (0..100).map(|n| decide(&mut requests, &message(&json(&format!("id{n}"), "50")), 0)).collect();
    let count = |start: &str| found.iter().filter(|found| found.starts_with(start)).count();
    assert_eq!((count("command"), count("refused: too many"), count("nothing")), (10, 20, 70));
    requests.on_lost(5);
    let [refusal] = &requests.refusals(now(0))[..] else { panic!("one entry for all of them") };
    assert_eq!(refusal.outcome(), "refused: 95 requests, the last: too many requests, wait a moment");
    let MqttRequestStatus { accepted, refused, unanswered, .. } = *requests.status();
    assert_eq!((accepted, refused, unanswered), (10, 95, 75));
    assert_eq!(decide(&mut requests, &message(&json("next", "50")), 1), "command 11", "one more a second");
}

#[test]
fn what_waits_when_the_station_stops_is_refused_and_recorded() {
    let mut requests = requests(Ok(RequestLog::default()));
    let done = message(&json("a", "50"));
    decide(&mut requests, &done, 0);
    requests.stop();
    assert_eq!(decide(&mut requests, &message(&json("b", "50")), 1), "refused: the station is stopping");
    assert!(decide(&mut requests, &done, 1).starts_with("accepted"), "of a command under way it says so");
    let [refusal] = &requests.last_refusals()[..] else { panic!("one entry") };
    assert_eq!(refusal.outcome(), "refused: the station is stopping");
}

#[test]
fn what_is_shown_of_a_request_is_short() {
    let mut requests = requests(Ok(RequestLog::default()));
    decide(&mut requests, &message(&json("a", "-1e308")), 0);
    assert_eq!(requests.status().last.as_ref().map(|last| last.what.as_str()), Some("a TIC-1.SV = -1e308"));
}

#[test]
fn not_more_than_sixteen_wait_for_their_outcome() {
    let mut requests = requests(Ok(RequestLog::default()));
    let found = (0..20).map(|n| decide(&mut requests, &message(&json(&format!("id{n}"), "50")), n));
    assert_eq!(found.filter(|found| found.starts_with("command")).count(), PENDING_MAX);
    let answers = requests.on_snapshot(&Snapshot::blank(fixture::shared()), TERMINAL, now(200));
    assert_eq!(results(&answers), ["unknown"; PENDING_MAX], "none has an outcome after so long");
}

#[test]
fn an_id_that_did_not_reach_the_plant_can_be_used_again() {
    let mut requests = requests(Ok(RequestLog::default()));
    let received = message(&json("a", "50"));
    decide(&mut requests, &received, 0);
    let id = CommandId { terminal: TERMINAL, number: 1 };
    let who = Some(crate::access::LoggedInUser {
        user: "mes".into(),
        role: crate::plant::role::Role::Technician,
        must_change: false,
    });
    let session = SessionStatus {
        who,
        undelivered: vec![(id, crate::plant::request_refusal::RequestRefusal::StationBusy)],
        ..Default::default()
    };
    let answers = requests.on_session(&session, TERMINAL, now(1));
    assert_eq!(answer(&answers[0])["reason"], "station too busy");
    assert_eq!(requests.status().error, None);
    assert!(requests.on_session(&session, TERMINAL, now(1)).is_empty());
    assert_eq!(decide(&mut requests, &received, 2), "command 2");
    requests.on_session(&SessionStatus::default(), TERMINAL, now(3));
    assert!(requests.status().error.as_ref().is_some_and(|why| why.contains("mes is not a user")));
}
