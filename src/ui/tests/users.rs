//! Users: the login page, the lock, credentials, two operators at once, users and the audit list.

mod changes;
mod login;
mod lists;
mod lock;

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::{assert_acts_only_on_what_was_drawn, model, screen, sent_kind, type_keys};
use crate::{
    access::{
        Credentials, Durability, LoggedInUser, SessionRequest, SessionStatus,
        session_request::{SessionRow, UserRow},
    },
    history::{Answer, Query},
    plant::{
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome, Refusal},
        record::{ActionRecord, ChainHash},
        request_refusal::RequestRefusal,
        role::{Reauthentication, Role},
        sample::Quality,
    },
    ui::{
        Effect, Model, Msg, QueryId,
        fixture::{self, Fixture},
        modal::Modal,
        tabs::Tab,
        theme::Theme,
        update,
    },
};

/// No user is logged in, and nothing may be seen but alarms.
fn closed() -> SessionStatus {
    let banner = "This is the control of the water tank. Only for those who work here; all that is done is recorded.";
    SessionStatus { who: None, may_view: false, banner: Some(banner.into()), ..(*fixture::session()).clone() }
}

fn person(user: &str, role: Role) -> SessionStatus {
    SessionStatus {
        who: Some(LoggedInUser { user: user.into(), role, must_change: false }),
        idle_lock: Some(Duration::from_secs(900)),
        ..(*fixture::session()).clone()
    }
}

fn with(fixture: &Fixture, session: SessionStatus) -> Model {
    let mut model = model(fixture, Theme::FULL);
    update(&mut model, Msg::SessionStatus(Arc::new(session)));
    model
}

fn change_session(model: &mut Model, change: impl FnOnce(&mut SessionStatus)) {
    let mut session = (*model.session).clone();
    change(&mut session);
    update(model, Msg::SessionStatus(Arc::new(session)));
}

fn ctrl(model: &mut Model, c: char) -> Vec<Effect> {
    update(model, Msg::Key(KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL)))
}

fn sent_request(effects: &[Effect]) -> Option<&SessionRequest> {
    effects.iter().find_map(|effect| match effect {
        Effect::SessionRequest(_, request) if *request != SessionRequest::Active => Some(request),
        _ => None,
    })
}

fn answer(model: &mut Model, answer: Result<(), RequestRefusal>) {
    let id = QueryId { tab: Some(Tab::Login), number: model.session_lock.last_request };
    update(model, Msg::RequestDone(id, answer.map(|()| Durability::Recorded)));
}

fn shows(model: &mut Model, words: &str) {
    let shown = screen(model, 80, 24);
    assert!(shown.contains(words), "\"{words}\" is missing:\n{shown}");
}

#[test]
fn the_login_page_in_every_mood() {
    let first = SessionStatus { needs_first_supervisor: true, ..closed() };
    let moods = [
        ("first", Fixture::normal(), first),
        ("normal", Fixture::normal(), closed()),
        ("alarm", Fixture::alarm(), closed()),
        ("in", Fixture::normal(), person("anna", Role::Technician)),
    ];
    for (mood, fixture, session) in moods {
        for (width, height) in [(80, 24), (120, 40)] {
            let mut model = with(&fixture, session.clone());
            type_keys(&mut model, if mood == "in" { "0" } else { "anna⏎abc" });
            insta::assert_snapshot!(format!("login_{mood}_{width}x{height}"), screen(&mut model, width, height));
        }
    }
    let mut model = with(&Fixture::alarm(), closed());
    model.limits = Theme::PLAIN;
    type_keys(&mut model, "anna⏎abc");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.is_ascii(), "{shown}");
    insta::assert_snapshot!("login_plain_80x24", shown);
}

#[test]
fn what_was_granted_and_is_not_on_disk_is_shown_as_not_recorded() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Supervisor));
    let id = QueryId { tab: Some(Tab::Users), number: model.session_lock.last_request };
    update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    assert!(!screen(&mut model, 80, 24).contains("RECORDED"));
    update(&mut model, Msg::RequestDone(id, Ok(Durability::NotRecorded)));
    shows(&mut model, "Done, but NOT RECORDED: the station cannot write to its disk");
}

#[test]
fn a_password_is_never_shown_and_a_wrong_one_has_a_wait() {
    let mut model = with(&Fixture::normal(), closed());
    let effects = type_keys(&mut model, "anna⏎horse 1q?⏎");
    let expect = SessionRequest::Login { user: "anna".to_owned(), password: "horse 1q?".into() };
    assert_eq!(sent_request(&effects), Some(&expect));
    shows(&mut model, "waiting for the station");
    assert_eq!(type_keys(&mut model, "⏎⏎"), [], "while the answer is awaited");
    assert!(!screen(&mut model, 80, 24).contains("horse") && !format!("{model:?}").contains("horse"));
    answer(&mut model, Err(RequestRefusal::WrongPassword { wait: 8 }));
    shows(&mut model, "wait 8 s");
    for _ in 0..6 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    shows(&mut model, "wrong name or password; wait 5 s");
    insta::assert_snapshot!("login_wrong_80x24", screen(&mut model, 80, 24));
    assert_eq!(type_keys(&mut model, "battery⏎"), [], "too early");
    for _ in 0..10 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    shows(&mut model, "try again now");
    let expect = SessionRequest::Login { user: "anna".to_owned(), password: "battery".into() };
    assert_eq!(sent_request(&type_keys(&mut model, "⏎")), Some(&expect));
    ctrl(&mut model, 'r');
    assert!(!screen(&mut model, 80, 24).contains("battery"));
}

#[test]
fn work_waits_while_the_terminal_is_locked() {
    let fixture = Fixture::alarm();
    let mut model = with(&fixture, person("anna", Role::Technician));
    type_keys(&mut model, "s65");
    assert_eq!(sent_request(&ctrl(&mut model, 'k')), Some(&SessionRequest::Lock));
    change_session(&mut model, |session| session.locked = true);
    shows(&mut model, "LOCKED by anna");
    assert_eq!(model.modal, None, "nothing hides the process");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎⎋3a")), None);
    insta::assert_snapshot!("locked_80x24", screen(&mut model, 80, 24));
    assert_eq!(sent_request(&type_keys(&mut model, "horse⏎")), Some(&SessionRequest::Unlock("horse".into())));
    answer(&mut model, Err(RequestRefusal::WrongPassword { wait: 2 }));
    shows(&mut model, "wrong name or password; wait 2 s");
    change_session(&mut model, |session| session.locked = false);
    assert_eq!(model.tabs.shown, Tab::Mimic);
    shows(&mut model, "new 65");
    let effects = type_keys(&mut model, ".5⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.5.into() }));
}

#[test]
fn what_a_role_may_not_is_reported_before_it_is_tried() {
    let mut model = with(&Fixture::normal(), person("tom", Role::Viewer));
    shows(&mut model, "Technician: s r m");
    type_keys(&mut model, "s65");
    shows(&mut model, "needs Technician; tom is Viewer");
    type_keys(&mut model, "⎋r");
    shows(&mut model, "needs Technician; tom is Viewer");
    assert!(!screen(&mut model, 80, 24).contains("7 Users"));
    let mut model = with(&Fixture::normal(), person("anna", Role::Technician));
    assert!(!screen(&mut model, 80, 24).contains("needs"));
}

#[test]
fn a_key_that_tunes_shows_the_supervisor_that_it_needs() {
    let mut fixture = Fixture::normal();
    for name in ["P", "AT", "FIX"] {
        let tag = fixture.tag(&format!("TIC-1.{name}"));
        fixture.def.tags[tag.index()].role = Role::Supervisor;
    }
    let at = |role: Role, keys: &str| {
        let mut model = with(&fixture, person("anna", role));
        type_keys(&mut model, keys);
        screen(&mut model, 80, 24)
    };
    let p = "4⏎/proportional⏎";
    let shown = at(Role::Technician, p);
    assert!(shown.contains("Supervisor: ⏎ T f") && shown.contains("needs Supervisor; "), "{shown}");
    let shown = at(Role::Technician, &format!("{p}⏎5"));
    assert!(shown.contains("needs Supervisor; anna is Technician"), "{shown}");
    let shown = at(Role::Technician, "4⏎/setpoint⏎");
    assert!(shown.contains("⏎ edit") && !shown.contains("needs Supervisor; "), "{shown}");
    let shown = at(Role::Supervisor, p);
    assert!(shown.contains("⏎ edit") && !shown.contains("needs"), "{shown}");
}

fn reauthenticated(kind: Reauthentication) -> Fixture {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    fixture.def.tags[sv.index()].reauthenticate = Some(kind);
    fixture
}

#[test]
fn a_tag_with_reauthentication_gets_credentials() {
    let request = |effects: &[Effect]| {
        effects.iter().find_map(|effect| match effect {
            Effect::Command(command, credentials) => Some((command.clone(), credentials.clone())),
            _ => None,
        })
    };
    let sent = |kind: Reauthentication, keys: &str| -> Option<(Command, Option<Credentials>)> {
        let mut model = with(&reauthenticated(kind), person("anna", Role::Technician));
        request(&type_keys(&mut model, keys))
    };
    assert_eq!(sent(Reauthentication::Password, "s65⏎⏎"), None, "without the password");
    let (command, sign) = sent(Reauthentication::Password, "s65⏎yes n q⏎").expect("a command");
    let sign = sign.expect("a credentials");
    assert_eq!((sign.user, sign.password, command.expected_value), (None, "yes n q".into(), Some(70.0.into())));
    let sign =
        sent(Reauthentication::SecondUser, "s65⏎boris⏎horse⏎").and_then(|(_, sign)| sign).expect("a credentials");
    assert_eq!((sign.user.as_deref(), sign.password), (Some("boris"), "horse".into()));

    let mut model = with(&reauthenticated(Reauthentication::SecondUser), person("anna", Role::Technician));
    type_keys(&mut model, "s65⏎boris⏎abc");
    insta::assert_snapshot!("window_reauthentication_80x24", screen(&mut model, 80, 24));
}

#[test]
fn a_value_that_changes_under_a_window_is_confirmed_again() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, person("boris", Role::Technician));
    type_keys(&mut model, "s68");
    let mut later = fixture.clone();
    later.set("TIC-1.SV", 65.0);
    let mut snapshot = later.snapshot();
    Arc::make_mut(&mut snapshot).commands = vec![CommandStatus {
        old: Some(70.0.into()),
        outcome: Outcome::Verified,
        ..CommandStatus::new(
            Command::new(
                0,
                CommandId { terminal: 2, number: 1 },
                CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.0.into() },
            ),
            "anna",
            fixture::now(),
        )
    }];
    update(&mut model, Msg::Snapshot(snapshot));
    shows(&mut model, "changed to 65.0 °C by anna 14:02:31 (was 70.0)");
    insta::assert_snapshot!("changed_under_you_80x24", screen(&mut model, 80, 24));
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None);
    let effects = type_keys(&mut model, "⏎");
    let Some(Effect::Command(command, _)) = effects.first() else { panic!("no command: {effects:?}") };
    assert_eq!(command.expected_value, Some(65.0.into()), "what was seen when it was confirmed");
}

fn supervisor() -> SessionStatus {
    let row = |user: &str, role, disabled, must_change| UserRow {
        user: user.into(),
        role,
        disabled,
        locked_until: None,
        must_change,
        last_login: Some(fixture::now()),
    };
    let until = fixture::now() + jiff::SignedDuration::from_secs(240);
    let users = vec![
        row("anna", Role::Supervisor, false, false),
        UserRow { locked_until: Some(until), ..row("boris", Role::Technician, false, false) },
        UserRow { last_login: None, ..row("สมชาย", Role::Viewer, false, true) },
        row("tom", Role::Technician, true, false),
    ];
    let session = |terminal, user: Option<&str>, locked| SessionRow {
        terminal,
        user: user.map(Arc::from),
        from: "pts/3 from 10.0.0.5, user panel".into(),
        since: fixture::now(),
        locked,
    };
    let sessions = vec![session(1, Some("anna"), false), session(2, Some("tom"), true), session(3, None, false)];
    SessionStatus { users: Arc::new(users), sessions: Arc::new(sessions), ..person("anna", Role::Supervisor) }
}

#[test]
fn the_users_and_what_can_be_done_with_them() {
    let mut model = with(&Fixture::normal(), supervisor());
    type_keys(&mut model, "7");
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(format!("users_{width}x{height}"), screen(&mut model, width, height));
    }
    let check = |keys: &str, expect: SessionRequest| {
        let mut model = with(&Fixture::normal(), supervisor());
        let effects = type_keys(&mut model, keys);
        assert_eq!(sent_request(&effects), Some(&expect), "{keys}");
        let id = QueryId { tab: Some(Tab::Users), number: model.session_lock.last_request };
        update(&mut model, Msg::RequestDone(id, Err(RequestRefusal::LastSupervisor)));
        shows(&mut model, "at least one enabled supervisor");
        update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    };
    let user = "boris".to_owned();
    let password = || "correct horse battery".into();
    check("7↓r ⏎", SessionRequest::SetRole { user: user.clone(), role: Role::Supervisor });
    check("7↓d⏎", SessionRequest::Disable { user: user.clone(), disabled: false });
    check("7↓↓d⏎", SessionRequest::Disable { user: "สมชาย".to_owned(), disabled: true });
    check("7↓xboris⏎", SessionRequest::DeleteUser { user: user.clone() });
    check(
        "7↓pcorrect horse battery⏎correct horse battery⏎",
        SessionRequest::ResetPassword { user: user.clone(), password: password() },
    );
    check(
        "7n↑→↓jane⏎correct horse battery⏎correct horse battery⏎",
        SessionRequest::AddUser { user: "jane".to_owned(), role: Role::Supervisor, password: password() },
    );
    let mut model = with(&Fixture::normal(), supervisor());
    assert_eq!(sent_request(&type_keys(&mut model, "7↓xboriss⏎")), None, "another name deletes no user");
    for (keys, own) in [("7d", true), ("7x", true), ("7↓↓d", false), ("7↓x", false)] {
        let mut model = with(&Fixture::normal(), supervisor());
        type_keys(&mut model, keys);
        assert_eq!(screen(&mut model, 80, 24).contains("This is you"), own, "{keys}");
    }
}

fn action(number: u64, by: &str, action: &str, target: &str, change: (&str, &str), outcome: &str) -> ActionRecord {
    let optional = |text: &str| (!text.is_empty()).then(|| Arc::from(text));
    ActionRecord {
        at: fixture::now() - jiff::SignedDuration::from_secs(60 * (40 - number as i64)),
        by: by.into(),
        from: "pts/3 from 10.0.0.5, user panel".into(),
        action: action.into(),
        target: target.into(),
        old: optional(change.0),
        new: optional(change.1),
        outcome: outcome.into(),
        note: None,
        chain_hash: Some(ChainHash { number, hash: [0xA5; 32] }),
    }
}

#[test]
fn the_audit_list_is_searched_by_the_history_and_read_whole() {
    let mut model = with(&Fixture::normal(), supervisor());
    let asked = |effects: &[Effect]| {
        effects.iter().find_map(|effect| match effect {
            Effect::Query(id, Query::Audit { words, by, action, limit, .. }) => {
                Some((*id, words.clone(), by.clone(), action.clone(), *limit))
            }
            _ => None,
        })
    };
    let query = asked(&type_keys(&mut model, "7j")).expect("a query");
    let rows = vec![
        action(38, "anna", "write", "TIC-1.SV", ("70.0 °C", "65.0 °C"), "verified"),
        action(37, "tom", "write", "PLC-1.PUMP", ("OFF", "ON"), "refused: needs technician"),
        action(36, "unknown user", "login failed", "", ("", ""), "refused: wrong name or password"),
        ActionRecord {
            note: Some("countersigned by boris".into()),
            ..action(35, "anna", "add user", "tom", ("", "technician"), "done")
        },
    ];
    update(&mut model, Msg::Answer(query.0, Ok(Answer::Actions(rows))));
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(format!("audit_{width}x{height}"), screen(&mut model, width, height));
    }
    type_keys(&mut model, "↓⏎");
    insta::assert_snapshot!("window_audit_entry_80x24", screen(&mut model, 80, 24));
    let (_, words, by, action, _) = asked(&type_keys(&mut model, "⎋/pump⏎")).expect("a query");
    assert_eq!((words.as_str(), by.as_str(), action.as_str()), ("pump", "", ""));
    // The next search goes out at once, and an answer to the older one is not shown.
    let (_, words, by, ..) = asked(&type_keys(&mut model, "bto⏎")).expect("a query");
    let older = QueryId { tab: Some(Tab::Users), number: query.0.number + 1 };
    update(&mut model, Msg::Answer(older, Ok(Answer::Actions(Vec::new()))));
    assert!(screen(&mut model, 80, 24).contains("collecting data"));
    assert_eq!((words.as_str(), by.as_str()), ("pump", "to"));
}

#[test]
fn without_users_no_key_for_one_is_offered() {
    let mut model =
        with(&Fixture::normal(), SessionStatus { users: Arc::default(), ..person("sue", Role::Supervisor) });
    type_keys(&mut model, "7");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("No users:"), "{shown}");
    let footer = shown.lines().last().unwrap_or_default();
    assert!(footer.contains("audit log") && !footer.contains("role"), "{footer}");
}
