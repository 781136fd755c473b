//! Every command, request and query through the socket, by everybody who may be at a terminal: what is let through, what
//! is refused, and that the audit log has it. The tables below are written by hand; the program has its own.

mod commands;

use std::time::Duration;

use jiff::Timestamp;
use sightglass::api::{
    access::{Peer, SessionRequest, audit_log::Entry},
    history::{Query, QueryRequest},
    plant::{AddressSpan, CommandStatus, LineId, LiveRead, Outcome, PlantDef, Refusal, RequestRefusal, Role},
    report::Period,
    station::{self, Session},
};
use tokio::sync::{mpsc, oneshot};

use crate::guarded::{Guarded, PASSWORD, request};
use commands::{commands, of_command};

mod queries;

/// Who sits at the terminal, in the order of the columns below.
const USERS: [&str; 6] = ["nobody", "vera", "tom", "sue", "lena", "mia"];
/// The refusal for each of them; `{}` is the role that is needed.
const WHY: [&str; 6] = [
    "log in first",
    "this needs a {}, you are a viewer",
    "this needs a {}, you are a technician",
    "",
    "this terminal is locked",
    "choose a new password first",
];

/// What is called so in the audit log may be done by whom: no user, Viewer, Technician, Supervisor, Supervisor at a locked
/// terminal, Supervisor who must change the password.
struct Row {
    action: &'static str,
    by: &'static str,
    /// Reading is not an action: only its refusal is recorded.
    is_action: bool,
}

impl Row {
    fn lets(&self, person: usize) -> bool {
        self.by.as_bytes()[person] != b'-'
    }

    /// The refusal for a user without the right.
    fn why(&self, person: usize) -> String {
        WHY[person].replace("{}", if self.by.contains('T') { "technician" } else { "supervisor" })
    }
}

fn row(action: &'static str, by: &'static str) -> Row {
    Row { action, by, is_action: true }
}

fn look(action: &'static str, by: &'static str) -> Row {
    Row { action, by, is_action: false }
}

/// A terminal of this person, as the column says.
async fn sits(guarded: &Guarded, person: usize) -> Session {
    if person == 0 {
        return guarded.anonymous().await;
    }
    let session = guarded.person(USERS[person]).await;
    if USERS[person] == "lena" {
        session.request(SessionRequest::Lock).await.unwrap();
    }
    session
}

fn is_permitted(status: &CommandStatus) -> bool {
    !matches!(status.outcome, Outcome::Refused(Refusal::NotPermitted(_)))
}

/// Is it this person, as the audit log has it? Without a login it names the user of the operating system.
fn is_by(line: &Entry, person: usize) -> bool {
    if person == 0 { line.who.starts_with("not logged in (") } else { &*line.who == USERS[person] }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_command_is_permitted_or_refused_as_the_table_says() {
    let guarded = Guarded::start(|_| {}).await;
    let before = (guarded.tap.writes(), guarded.tap.connections());
    // Those who may nothing first, so that the line shows what came of it.
    for person in [0, 1, 4, 5, 2, 3] {
        if person == 2 {
            let after = (guarded.tap.writes(), guarded.tap.connections());
            assert_eq!(after, before, "something that was refused has reached the line");
        }
        let session = sits(&guarded, person).await;
        for (number, kind) in (1..).zip(commands(&guarded.def, person)) {
            let row = of_command(&guarded.def, &kind);
            let said = format!("{kind:?} by {}", USERS[person]);
            // So slow that each refusal is on record by itself.
            guarded.pass(Duration::from_secs(2)).await;
            let written = guarded.entries().len();
            let status = guarded.send_command(&session, request(&session, number, kind)).await;
            assert_eq!(is_permitted(&status), row.lets(person), "{said}: {:?}", status.outcome);
            if !row.lets(person) {
                let Outcome::Refused(Refusal::NotPermitted(why)) = &status.outcome else {
                    panic!("{said}: {status:?}")
                };
                assert_eq!(why.to_string(), row.why(person), "{said}");
            }
            if row.is_action || !row.lets(person) {
                let line = guarded.written(written, &said, |entry| &*entry.action == row.action).await;
                assert!(is_by(&line, person), "{said}: {line:?}");
                assert_eq!(*line.outcome, status.outcome_text(), "{said}");
                assert!(line.from.contains(&format!("process {}", std::process::id())), "{}", line.from);
            }
        }
    }
    assert!(guarded.tap.writes().contains(&6), "what was permitted has reached the line: {:?}", guarded.tap.writes());
    assert!(before.1 < guarded.tap.connections());
    guarded.end().await;
}

/// What comes of a request: done, or words that its answer holds, for each column.
type Answers = [&'static str; 6];

const DONE: &str = "";
const LOG_IN: &str = "log in first";
const LOCKED: &str = "this terminal is locked";
const CHANGE: &str = "choose a new password first";
const NOT_VIEWER: &str = "you are a viewer";
const NOT_TECHNICIAN: &str = "you are a technician";
const SUPERVISOR: Answers = [LOG_IN, NOT_VIEWER, NOT_TECHNICIAN, DONE, LOCKED, CHANGE];
/// Whoever has started the station can end it anyway, logged in or not: these tests run as the same user.
const HOST: Answers = [DONE, NOT_VIEWER, NOT_TECHNICIAN, DONE, LOCKED, CHANGE];

/// A new request does not compile until it has a row here; put it into [`requests`] as well. The word is that of the audit log; an
/// empty one is not put on record by itself.
fn of_request(request: &SessionRequest) -> (&'static str, Answers) {
    const SHORT: &str = "has 5 characters";
    match request {
        SessionRequest::Login { .. } => ("login", [DONE; 6]),
        SessionRequest::Logout => ("logout", ["no user is logged in here", DONE, DONE, DONE, DONE, DONE]),
        SessionRequest::Lock => ("lock terminal", [LOG_IN, DONE, DONE, DONE, "already locked", DONE]),
        SessionRequest::Unlock(_) => {
            ("unlock terminal", ["not locked", "not locked", "not locked", "not locked", DONE, "not locked"])
        }
        SessionRequest::Active => ("", [DONE; 6]),
        SessionRequest::FirstSupervisor { .. } => ("add user", ["users already exist"; 6]),
        SessionRequest::ChangePassword { .. } => ("change password", ["log in", SHORT, SHORT, SHORT, "unlock", SHORT]),
        SessionRequest::AddUser { .. } => ("add user", SUPERVISOR),
        SessionRequest::SetRole { .. } => ("set role", SUPERVISOR),
        SessionRequest::Disable { disabled: true, .. } => ("disable user", SUPERVISOR),
        SessionRequest::Disable { disabled: false, .. } => ("enable user", SUPERVISOR),
        SessionRequest::DeleteUser { .. } => ("delete user", SUPERVISOR),
        SessionRequest::ResetPassword { .. } => ("reset password", SUPERVISOR),
        SessionRequest::Exported { .. } => ("export", [LOG_IN, NOT_VIEWER, DONE, DONE, LOCKED, CHANGE]),
        SessionRequest::Backup { .. } => ("back up history", HOST),
        SessionRequest::Import { .. } => ("import samples", HOST),
        SessionRequest::Stop => ("stop station", HOST),
        SessionRequest::Reload => ("reload", HOST),
    }
}

fn requests() -> Vec<SessionRequest> {
    let (user, password) = (|name: &str| name.to_owned(), || PASSWORD.into());
    let other = || "five dry horses on a hill".into();
    vec![
        SessionRequest::Login { user: user("vera"), password: password() },
        SessionRequest::Logout,
        SessionRequest::Lock,
        SessionRequest::Unlock(password()),
        SessionRequest::Active,
        SessionRequest::FirstSupervisor { user: user("eve"), password: other() },
        SessionRequest::ChangePassword { old: password(), new: "short".into() },
        SessionRequest::AddUser { user: user("paul"), role: Role::Viewer, password: other() },
        SessionRequest::SetRole { user: user("paul"), role: Role::Technician },
        SessionRequest::Disable { user: user("paul"), disabled: true },
        SessionRequest::Disable { user: user("paul"), disabled: false },
        SessionRequest::ResetPassword { user: user("paul"), password: other() },
        SessionRequest::DeleteUser { user: user("paul") },
        SessionRequest::Exported { file: user("shift.csv"), sha256: Ok(user("00")) },
        SessionRequest::Backup { folder: user(crate::support::sockets().join("backup").to_str().unwrap()) },
        SessionRequest::Import { file: user("samples.csv") },
        SessionRequest::Reload,
        SessionRequest::Stop,
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_request_is_granted_or_refused_as_the_table_says() {
    let mut guarded = Guarded::start(|_| {}).await;
    let mut asked = std::mem::replace(&mut guarded.station.lifecycle, mpsc::channel(1).1);
    // What the command line does on a lifecycle request, without carrying it out.
    let heard = tokio::spawn(async move {
        let mut heard = Vec::new();
        while let Some(request) = asked.recv().await {
            match request {
                station::LifecycleRequest::Reload(_, reply) => {
                    heard.push("reload");
                    reply.send(Ok(String::new())).unwrap();
                }
                station::LifecycleRequest::Stop => heard.push("stop"),
            }
        }
        heard
    });
    guarded.place_samples("TIC-1.PV", "samples.csv");
    for request in requests() {
        let (action, answers) = of_request(&request);
        for person in 0..USERS.len() {
            let session = sits(&guarded, person).await;
            guarded.pass(Duration::from_secs(8)).await;
            let written = guarded.entries().len();
            let said = format!("{request:?} by {}", USERS[person]);
            let answer = session.request(request.clone()).await.map(drop);
            match (&answer, answers[person]) {
                (Ok(()), DONE) => {}
                (Err(why), expected) if expected != DONE && why.to_string().contains(expected) => {}
                (_, expected) => panic!("{said}: {answer:?}, expected {expected:?}"),
            }
            // Who is not there cannot leave, and what is not locked is not unlocked: that is no refusal of a right.
            let is_own = matches!(request, SessionRequest::Logout | SessionRequest::Lock | SessionRequest::Unlock(_));
            if action.is_empty() || is_own && answer.is_err() {
                continue;
            }
            let line = guarded.written(written, &said, |entry| &*entry.action == action).await;
            let refused = answer.as_ref().err().map(|why| format!("refused: {why}"));
            assert_eq!(line.outcome.starts_with("refused"), answer.is_err(), "{said}: {line:?}");
            let is_right = refused.is_none_or(|refused| is_by(&line, person) && *line.outcome == refused);
            assert!(is_right, "{said}: {line:?}");
            assert!(line.from.contains("user "), "{}", line.from);
        }
    }
    // Another user of the operating system who has not logged in either.
    let from = "pts/7, user stranger, process 1".into();
    let peer = Peer { from, unix_user: Some("stranger".into()), in_process: false };
    let stranger = guarded.station.acceptor().attach(peer);
    for request in [SessionRequest::Reload, SessionRequest::Stop] {
        let (action, _) = of_request(&request);
        assert_eq!(stranger.request(request).await, Err(RequestRefusal::LogInFirst));
        // Not the last entry: the end of the terminals before is recorded when the station notices it.
        let entries = guarded.entries();
        let line = entries.iter().rev().find(|entry| &*entry.action == action).expect("sent once it is there");
        assert_eq!((&*line.who, &*line.outcome), ("not logged in (stranger)", "refused: log in first"));
    }
    drop(stranger);
    guarded.end().await;
    assert_eq!(heard.await.unwrap(), ["reload", "reload", "stop", "stop"], "once by a Supervisor, once by its starter");
}
