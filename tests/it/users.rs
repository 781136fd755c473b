//! Users at the terminals of a station: wrong passwords by script, lockout, idle lock, second users, two operators at
//! once. Alarms are seen through all of it.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use sightglass::api::{
    access::{Credentials, SessionRequest},
    plant::{
        Cause, Command, CommandKind, Outcome, PlantDef, Reauthentication, Refusal, RequestRefusal, Role, Snapshot,
    },
    station::Session,
};

use crate::guarded::{Guarded, PASSWORD, login, request, until};

/// Wrong attempts that lock out.
const TRIES: u16 = 3;
/// For how long, plant time: longer than any machine needs for the passwords that must be wrong within it.
const LOCK_OUT: Duration = Duration::from_secs(3_600);

fn strict(def: &mut PlantDef) {
    (def.access.login_attempts_max, def.access.lockout) = (TRIES, LOCK_OUT);
}

/// The reply to a wrong name or password.
fn wait(seconds: u64) -> RequestRefusal {
    RequestRefusal::WrongPassword { wait: seconds }
}

/// Was the password not even checked?
fn is_not_checked(why: &RequestRefusal) -> bool {
    matches!(why, RequestRefusal::NotChecked { .. })
}

/// Tries until he is in, and gives the plant time of it.
async fn login_at_last(guarded: &Guarded, session: &Session, user: &str) -> Timestamp {
    let written = guarded.entries().len();
    while let Err(why) = login(session, user, PASSWORD).await {
        assert!(is_not_checked(&why), "{why}");
        guarded.pass(Duration::from_secs(2)).await;
    }
    guarded.written(written, "the login", |entry| &*entry.action == "login" && &*entry.target == user).await.utc
}

/// Waits until an announced delay is over.
async fn waited(guarded: &Guarded, seconds: u64) {
    guarded.pass(Duration::from_secs(seconds + 1)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_locked_out_still_sees_alarms_and_others_enter() {
    let guarded = Guarded::start(strict).await;
    let (script, mut looks) = (guarded.far("eve"), guarded.anonymous().await);
    let written = guarded.entries().len();
    for (try_of, reply) in [(1, 1), (2, 2)] {
        assert_eq!(login(&script, "tom", "wrong").await, Err(wait(reply)), "try {try_of}");
        waited(&guarded, reply).await;
    }
    assert_eq!(login(&script, "tom", "wrong").await, Err(wait(LOCK_OUT.as_secs())));
    let locked = guarded.written(written, "the lockout", |entry| &*entry.action == "lockout").await;
    assert_eq!((&*locked.target, &*locked.outcome), ("tom", "done: for 3600 s, system user eve"));
    // Nothing is even looked at: not the right password either.
    let why = login(&script, "tom", PASSWORD).await.unwrap_err();
    assert!(is_not_checked(&why), "{why}");

    // For another user of the system nothing is shut, and for this one no other name is.
    let far = guarded.far("panel");
    login(&far, "tom", PASSWORD).await.unwrap();
    far.request(SessionRequest::Logout).await.unwrap();
    login(&script, "tina", PASSWORD).await.unwrap();
    script.request(SessionRequest::Logout).await.unwrap();

    // The devices fall silent while the script is locked out: its alarm is shown, though no value of the process is.
    guarded.tap.mute();
    // One that has returned may be left of a busy machine.
    let is_alarmed = |snapshot: &Arc<Snapshot>| snapshot.alarms.iter().any(|alarm| alarm.returned_at.is_none());
    let alarmed = until(&mut looks.snapshots, "an alarm", is_alarmed).await;
    let why = login(&script, "tom", PASSWORD).await.unwrap_err();
    assert!(is_not_checked(&why), "it is still locked out when the alarm is there: {why}");
    assert!(alarmed.samples.iter().all(|sample| sample.quality.cause() == Some(Cause::NotAuthorised)));
    assert_eq!(failed_logins(&guarded), ["tom refused: wrong password"; 3], "what was not looked at is no try");
    guarded.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lockout_ends_by_itself_and_not_before() {
    let lockout = Duration::from_secs(20);
    let guarded = Guarded::start(|def| (def.access.login_attempts_max, def.access.lockout) = (1, lockout)).await;
    let script = guarded.far("eve");
    let written = guarded.entries().len();
    assert_eq!(login(&script, "tom", "wrong").await, Err(wait(lockout.as_secs())));
    let locked = guarded.written(written, "the lockout", |entry| &*entry.action == "lockout").await;
    let let_in = login_at_last(&guarded, &script, "tom").await;
    let shut = let_in.duration_since(locked.utc).unsigned_abs();
    assert!(lockout <= shut, "let in after {shut:?}");
    assert_eq!(failed_logins(&guarded), ["tom refused: wrong password"], "what was not looked at is no try");
    guarded.end().await;
}

/// Whose login failed and why, as the audit log has it.
fn failed_logins(guarded: &Guarded) -> Vec<String> {
    let failed = guarded.entries().into_iter().filter(|entry| &*entry.action == "login failed");
    failed.map(|entry| format!("{} {}", entry.target, entry.outcome)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_system_user_who_tries_every_name_is_locked_out() {
    let guarded = Guarded::start(strict).await;
    let script = guarded.far("eve");
    for number in 0..TRIES * 8 {
        let reply = login(&script, &format!("name{number}"), "wrong").await.unwrap_err();
        assert!(matches!(reply, RequestRefusal::WrongPassword { .. }), "{reply}");
    }
    assert!(is_not_checked(&login(&script, "tina", PASSWORD).await.unwrap_err()));
    for user in ["vera", "tom", "sue"] {
        let elsewhere = guarded.person(user).await;
        elsewhere.request(SessionRequest::Logout).await.unwrap();
    }
    guarded.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_failed_login_gets_the_same_answer() {
    let guarded = Guarded::start(strict).await;
    let sue = guarded.person("sue").await;
    sue.request(SessionRequest::Disable { user: "vera".into(), disabled: true }).await.unwrap();
    let attempts = [
        ("nobody-of-this-name", PASSWORD, "unknown user", "unknown user"),
        ("tom", "wrong", "tom", "wrong password"),
        ("vera", PASSWORD, "vera", "disabled"),
        ("not a name\u{1b}[2J", "", "unknown user", "unknown user"),
    ];
    for (number, (user, password, target, why)) in attempts.into_iter().enumerate() {
        let written = guarded.entries().len();
        let script = guarded.far(&format!("user{number}"));
        assert_eq!(login(&script, user, password).await, Err(wait(1)), "{user}");
        let line = guarded.written(written, user, |entry| &*entry.action == "login failed").await;
        assert_eq!((&*line.target, &*line.outcome), (target, &*format!("refused: {why}")), "the audit log knows");
    }
    let text = format!("{:?}", guarded.entries());
    assert!(!text.contains("nobody-of-this-name"), "what is typed as a name may be a password");
    guarded.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_idle_terminal_is_locked_and_still_shows_alarms() {
    let guarded = Guarded::start(|def| def.access.idle_lock = Duration::from_secs(60)).await;
    let mut idle = guarded.person("sue").await;
    let touched = guarded.person("tom").await;
    let mut status = idle.status.clone();
    let locked = async { status.wait_for(|status| status.locked).await.map(drop) };
    let touching = async {
        loop {
            touched.request(SessionRequest::Active).await.unwrap();
            guarded.pass(Duration::from_secs(10)).await;
        }
    };
    tokio::select! {
        locked = locked => locked.unwrap(),
        () = touching => unreachable!("it touches for ever"),
    }
    assert!(!touched.status.borrow().locked, "keys were pressed there");
    assert!(idle.status.borrow().users.is_empty() && idle.status.borrow().may_view, "only looking");

    guarded.tap.mute();
    let alarmed = until(&mut idle.snapshots, "an alarm", |snapshot| !snapshot.alarms.is_empty()).await;
    let acknowledge = request(&idle, 1, alarmed.alarms[0].acknowledge());
    let status = guarded.send_command(&idle, acknowledge.clone()).await;
    assert_eq!(status.outcome, Outcome::Refused(Refusal::NotPermitted(RequestRefusal::Locked)));
    assert_eq!(idle.request(SessionRequest::Unlock("wrong".into())).await, Err(wait(1)));
    while idle.request(SessionRequest::Unlock(PASSWORD.into())).await.is_err() {
        guarded.pass(Duration::from_secs(1)).await;
    }
    let again = request(&idle, 2, acknowledge.kind);
    assert_eq!(guarded.send_command(&idle, again).await.outcome, Outcome::Verified);
    let writes: Vec<_> = guarded.entries().into_iter().filter(|entry| &*entry.who == "sue").collect();
    let words: Vec<String> = writes.iter().map(|entry| format!("{}: {}", entry.action, entry.outcome)).collect();
    for expected in ["lock terminal: done: idle", "unlock failed: refused: wrong password", "unlock terminal: done"] {
        assert!(words.iter().any(|word| word == expected), "{expected}: {words:?}");
    }
    guarded.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tag_for_two_users_is_written_after_the_second_approves() {
    let guarded = Guarded::start(|def| {
        let tag = def.tag_named("TIC-1.SV").unwrap();
        def.tags[tag.index()].reauthenticate = Some(Reauthentication::SecondUser);
    })
    .await;
    let tom = guarded.person("tom").await;
    let tag = guarded.tag("TIC-1.SV");
    let write = |number: u32| request(&tom, number, CommandKind::Write { tag, value: 61.0.into() });
    let credentials =
        |(user, password): (&str, &str)| Credentials { user: Some(user.into()), password: password.into() };
    let refused = [
        (None, RequestRefusal::SecondUser),
        (Some(("TOM", PASSWORD)), RequestRefusal::SecondUserIsFirst),
        (Some(("vera", PASSWORD)), RequestRefusal::ApproverRole { name: "vera".into(), needed: Role::Technician }),
        (Some(("mia", PASSWORD)), RequestRefusal::ApproverMustChange("mia".into())),
        (Some(("sue", "wrong")), wait(1)),
        (Some(("nobody-here", PASSWORD)), wait(1)),
    ];
    for (number, (by, why)) in (1..).zip(refused) {
        let status = guarded.send_with_credentials(&tom, write(number), by.map(credentials)).await;
        assert_eq!(status.outcome, Outcome::Refused(Refusal::NotReauthenticated(why)), "{by:?}");
        waited(&guarded, 2).await;
    }
    assert!(guarded.tap.writes().is_empty(), "something has reached the line: {:?}", guarded.tap.writes());
    let written = guarded.entries().len();
    let written_now = guarded.send_with_credentials(&tom, write(9), Some(credentials(("sue", PASSWORD)))).await;
    assert_eq!(written_now.outcome, Outcome::Verified);
    let line = guarded.written(written, "the write", |entry| &*entry.action == "write").await;
    assert_eq!((&*line.who, line.note.as_deref(), &*line.outcome), ("tom", Some("approved by sue"), "verified"));
    guarded.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_writes_at_once_the_second_finds_the_value_changed() {
    let guarded = Guarded::start(|_| {}).await;
    let (tom, tina) = (guarded.person("tom").await, guarded.person("tina").await);
    let (tag, seen) = (guarded.tag("TIC-1.SV"), guarded.value("TIC-1.SV"));
    let write = |session, number, value: f64, expected: Option<f64>| Command {
        expected_value: expected.map(Into::into),
        ..request(session, number, CommandKind::Write { tag, value: value.into() })
    };
    assert_eq!(guarded.send_command(&tom, write(&tom, 1, 61.0, seen)).await.outcome, Outcome::Verified);
    let second = guarded.send_command(&tina, write(&tina, 1, 62.0, seen)).await;
    let Outcome::Refused(Refusal::ChangedTo(now)) = &second.outcome else { panic!("{:?}", second.outcome) };
    assert!(now.starts_with("61.0"), "{now}");
    assert_eq!(guarded.value("TIC-1.SV"), Some(61.0), "the first one's value stands");
    let line = guarded.written(0, "the refusal", |entry| &*entry.who == "tina" && &*entry.action == "write").await;
    assert!(line.outcome.contains("it was changed to 61.0"), "{}", line.outcome);

    // Once he has looked again it is his.
    assert_eq!(guarded.send_command(&tina, write(&tina, 2, 62.0, Some(61.0))).await.outcome, Outcome::Verified);

    // Both at the very same moment: one of them, never both.
    let seen = Some(62.0);
    let (one, other) = tokio::join!(
        guarded.send_command(&tom, write(&tom, 3, 63.0, seen)),
        guarded.send_command(&tina, write(&tina, 3, 64.0, seen))
    );
    let done = [&one, &other].iter().filter(|status| status.outcome == Outcome::Verified).count();
    assert_eq!(done, 1, "{:?} and {:?}", one.outcome, other.outcome);
    guarded.end().await;
}
