//! A whole station with users: from the first Supervisor to the last line of the audit log.
#![allow(clippy::unwrap_used)]

mod reload;

use std::{path::Path, sync::Arc};

use super::io::{Options, start_guarded};
use crate::{
    access::{
        SessionRequest,
        io::{audit_log, users_beside},
    },
    bus::io::{clock::Clock, transport::Connector},
    history::{Answer, Query, io::QueryRequest},
    plant::{
        command::CommandKind, def::AlarmId, fixture, record::ActionRecord, request_refusal::RequestRefusal,
        station_fault::StationFault,
    },
};

fn options(history: &Path) -> Options {
    let def = Arc::new(fixture::plant());
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    Options { def, clock: Clock::real(), history: history.to_owned(), connectors, file: None }
}

/// The actions in the history, once it holds one of this name.
async fn actions_of(session: &super::Session, action: &str) -> Vec<ActionRecord> {
    let (from, to) = (jiff::Timestamp::MIN, jiff::Timestamp::MAX);
    let mut snapshots = session.snapshots.clone();
    loop {
        let (reply, answer) = tokio::sync::oneshot::channel();
        let all = String::new;
        let query = Query::Audit { from, to, words: all(), by: all(), action: all(), limit: 1_000 };
        session.ask(QueryRequest { query, reply }).unwrap();
        let Answer::Actions(actions) = answer.await.unwrap().unwrap() else { panic!("another answer") };
        if actions.iter().any(|row| &*row.action == action) {
            return actions;
        }
        // The store commits once a second.
        snapshots.changed().await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_action_is_in_the_audit_log_and_in_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    let mut station = start_guarded(options(&history)).unwrap();
    let mut session = station.session("whoever");
    session.status.wait_for(|status| status.needs_first_supervisor).await.unwrap();
    assert!(session.request(SessionRequest::Stop).await.is_err(), "no user is logged in");
    let password = "four wet horses in a tank";
    session.request(SessionRequest::FirstSupervisor { user: "anna".into(), password: password.into() }).await.unwrap();
    session.request(SessionRequest::Lock).await.unwrap();
    assert!(session.request(SessionRequest::Unlock("four wet horses".into())).await.is_err());
    session.request(SessionRequest::Unlock(password.into())).await.unwrap();
    session.request(SessionRequest::Logout).await.unwrap();
    let mut other = station.session("whoever");
    other.status.wait_for(|status| !status.needs_first_supervisor && status.password_chars_min > 0).await.unwrap();
    let command = other.send_command(1, CommandKind::Alarm(crate::plant::alarm::AlarmCommand::Silence)).unwrap();
    let shown =
        |snapshot: &Arc<crate::plant::Snapshot>| snapshot.commands.iter().any(|status| status.command.id == command);
    let snapshot = other.snapshots.wait_for(shown).await.unwrap().clone();
    let line = std::fs::read_to_string(audit_log::beside(&history)).unwrap();
    assert!(line.contains("refused: log in first"), "what a snapshot shows is in the audit log");
    assert_eq!(snapshot.history.trouble, None);
    // What was typed wrong at one terminal is held against that terminal only.
    other.request(SessionRequest::Login { user: "ANNA".into(), password: password.into() }).await.unwrap();
    let rows = actions_of(&other, "unlock failed").await;
    other.request(SessionRequest::Stop).await.unwrap();
    assert!(matches!(station.lifecycle.recv().await, Some(super::LifecycleRequest::Stop)));
    drop((session, other));
    station.stop().await;

    let chain_hashes: Vec<_> = rows.iter().filter_map(|row| row.chain_hash).collect();
    assert_eq!(chain_hashes.len(), rows.len(), "every row is sealed");
    let summary = audit_log::verify(&audit_log::beside(&history), &chain_hashes).unwrap();
    assert!(summary.compared == rows.len() as u64 && summary.entries > summary.compared);
    let text = std::fs::read_to_string(audit_log::beside(&history)).unwrap();
    let actions: Vec<_> = text.lines().map(|line| line.split("\"action\":\"").nth(1).unwrap()).collect();
    assert!(
        actions[0].starts_with("start station") && actions[actions.len() - 1].starts_with("stop station"),
        "{text}"
    );
    assert!(!text.contains("horses"), "a password is never written down");
}

/// Whether the station raises an alarm, and the answers to a login and to a first Supervisor.
async fn without_users(history: &Path) -> (bool, Result<(), RequestRefusal>, Result<(), RequestRefusal>) {
    let mut options = options(history);
    let mut def = fixture::plant();
    let own = def.alarms.len();
    def.alarms.extend((own..).zip(StationFault::ALL).map(|(id, fault)| fault.alarm(AlarmId(id as u16))));
    options.def = Arc::new(def);
    let station = start_guarded(options).unwrap();
    let mut session = station.session("whoever");
    let login = session
        .request(SessionRequest::Login { user: "anna".into(), password: "four wet horses in a tank".into() })
        .await;
    let second: SessionRequest =
        SessionRequest::FirstSupervisor { user: "eve".into(), password: "eight wet horses in a tank".into() };
    let first = session.request(second).await;
    // A tick judges the alarms, whatever they are.
    let at = session.snapshots.borrow().at;
    let ticked = session.snapshots.wait_for(|snapshot| at < snapshot.at).await.unwrap().clone();
    let alarmed =
        ticked.alarms.iter().any(|alarm| ticked.def.alarm(alarm.id).message == StationFault::UsersFile.word());
    drop(session);
    station.stop().await;
    (alarmed, login.map(drop), first.map(drop))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_users_file_closes_only_the_login() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    let users = users_beside(&history);
    let (alarmed, _, first) = without_users(&history).await;
    assert!(!alarmed && first.is_ok(), "a new plant has no users yet: {first:?}");
    let good = std::fs::read(&users).unwrap();
    std::fs::write(&users, &good[..good.len() / 2]).unwrap();
    let (alarmed, login, first) = without_users(&history).await;
    assert!(alarmed, "polling and alarms go on");
    assert!(
        login.is_err_and(|why| matches!(why, RequestRefusal::LoginDisabled(_))),
        "a damaged file is not an empty one"
    );
    assert!(first.is_err_and(|why| matches!(why, RequestRefusal::LoginDisabled(_))), "and no first Supervisor is made");
    assert_eq!(std::fs::read(&users).unwrap(), good[..good.len() / 2], "it is left as it is");
    std::fs::remove_file(&users).unwrap();
    let (alarmed, login, first) = without_users(&history).await;
    assert!(alarmed && login.is_err());
    assert!(first.is_ok(), "by the station's own user: {first:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn records_after_a_clock_step_are_of_the_next_epoch() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(&folder.path().join("fixture.duckdb"));
    // Two years ahead of the system clock, which is as if that was set back as soon as the station runs.
    let years = std::time::Duration::from_secs(2 * 365 * 86_400);
    options.clock.follow_at(std::time::SystemTime::now() + years, std::time::Instant::now()).unwrap();
    let station = start_guarded(options).unwrap();
    let mut session = station.session("whoever");
    session.snapshots.wait_for(|snapshot| snapshot.history.epoch == 1).await.unwrap();
    drop(session);
    station.stop().await;
}
