//! Users: the login page, the lock, credentials, two operators at once, users and the audit list.

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::{assert_acts_only_on_what_was_drawn, model, screen, sent_kind, type_keys};
use crate::{
    access::{
        Credentials, Durability, SessionRequest, SessionStatus, Who,
        session_request::{SessionRow, UserRow},
    },
    history::{Answer, Query},
    plant::{
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome, Refusal},
        record::{ActionRecord, ChainHash},
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

/// Nobody is in, and nothing may be seen but alarms.
fn closed() -> SessionStatus {
    let banner = "This is the control of the water tank. Only for those who work here; all that is done is recorded.";
    SessionStatus { who: None, view: false, banner: Some(banner.into()), ..(*fixture::session()).clone() }
}

fn person(user: &str, role: Role) -> SessionStatus {
    SessionStatus {
        who: Some(Who { user: user.into(), role, must_change: false }),
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

fn answer(model: &mut Model, answer: Result<(), &str>) {
    let id = QueryId { tab: Tab::Login, number: model.session_lock.last_request };
    update(model, Msg::RequestDone(id, answer.map(|()| Durability::Recorded).map_err(str::to_owned)));
}

fn shows(model: &mut Model, words: &str) {
    let shown = screen(model, 80, 24);
    assert!(shown.contains(words), "\"{words}\" is missing:\n{shown}");
}

#[test]
fn the_login_page_in_every_mood() {
    let first = SessionStatus { first: true, ..closed() };
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
    model.theme = Theme::PLAIN;
    type_keys(&mut model, "anna⏎abc");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.is_ascii(), "{shown}");
    insta::assert_snapshot!("login_plain_80x24", shown);
}

#[test]
fn what_was_granted_and_is_not_on_disk_is_shown_as_not_recorded() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Supervisor));
    let id = QueryId { tab: Tab::Users, number: model.session_lock.last_request };
    update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    assert!(!screen(&mut model, 80, 24).contains("RECORDED"));
    update(&mut model, Msg::RequestDone(id, Ok(Durability::NotRecorded)));
    shows(&mut model, "Done, but NOT RECORDED: the station cannot write to its disk");
}

#[test]
fn a_password_is_sent_and_never_seen_and_a_wrong_one_is_told_with_its_wait() {
    let mut model = with(&Fixture::normal(), closed());
    let effects = type_keys(&mut model, "anna⏎horse 1q?⏎");
    let expect = SessionRequest::Login { user: "anna".to_owned(), password: "horse 1q?".into() };
    assert_eq!(sent_request(&effects), Some(&expect));
    shows(&mut model, "asking the station");
    assert_eq!(type_keys(&mut model, "⏎⏎"), [], "while the answer is awaited");
    assert!(!screen(&mut model, 80, 24).contains("horse") && !format!("{model:?}").contains("horse"));
    answer(&mut model, Err("wrong name or password; wait 8 s"));
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
fn a_password_can_be_shown_and_pasted() {
    let mut model = with(&Fixture::normal(), closed());
    type_keys(&mut model, "anna⏎");
    update(&mut model, Msg::Paste("รหัสผ่าน ยาวพอ\n".to_owned()));
    assert!(screen(&mut model, 80, 24).contains("•••"));
    ctrl(&mut model, 'r');
    shows(&mut model, "ยาวพอ");
    let expect =
        SessionRequest::Login { user: "anna".to_owned(), password: "รหัสผ่าน ยาวพอ".into() };
    assert_eq!(sent_request(&type_keys(&mut model, "⏎")), Some(&expect));
}

#[test]
fn before_a_login_every_other_tab_is_closed_and_alarms_are_seen() {
    let mut model = with(&Fixture::alarm(), closed());
    for keys in ["1", "⇥", "⎋1", "3", "a", "A"] {
        let effects = type_keys(&mut model, keys);
        assert_eq!((model.tabs.shown, sent_kind(&effects), &model.modal), (Tab::Login, None, &None), "{keys}");
    }
    shows(&mut model, "TIC-1.PV temperature high");
    shows(&mut model, "alarms 3");
    update(&mut model, Msg::SessionStatus(Arc::new(person("anna", Role::Technician))));
    assert_eq!(model.tabs.shown, Tab::Mimic);
    change_session(&mut model, |session| (session.who, session.view) = (None, false));
    assert_eq!(model.tabs.shown, Tab::Login);
}

#[test]
fn a_plant_that_lets_everybody_look_shows_the_process_and_nothing_can_be_done() {
    let mut model = with(&Fixture::normal(), SessionStatus { view: true, ..closed() });
    assert_eq!(model.tabs.shown, Tab::Mimic);
    shows(&mut model, "Technician: s r m");
    shows(&mut model, "not logged in");
    type_keys(&mut model, "r");
    shows(&mut model, "needs Technician; no user is logged in");
    type_keys(&mut model, "⎋0");
    assert_eq!(model.tabs.shown, Tab::Login);
    type_keys(&mut model, "⎋");
    assert_eq!(model.tabs.shown, Tab::Mimic);
}

#[test]
fn the_first_supervisor_types_his_password_twice() {
    let check = |keys: &str, expect: Result<&str, &str>| {
        let mut model = with(&Fixture::normal(), SessionStatus { first: true, ..closed() });
        let effects = type_keys(&mut model, keys);
        match expect {
            Ok(password) => {
                let expect = SessionRequest::FirstSupervisor { user: "anna".to_owned(), password: password.into() };
                assert_eq!(sent_request(&effects), Some(&expect), "{keys}");
            }
            Err(words) => {
                assert_eq!(sent_request(&effects), None, "{keys}");
                shows(&mut model, words);
            }
        }
    };
    check("anna⏎correct horse battery⏎correct horse battery⏎", Ok("correct horse battery"));
    check("anna⏎correct horse battery⏎correct horse batteri⏎", Err("the two passwords differ"));
    check("anna⏎short⏎short⏎", Err("5 characters; at least 15"));
    check("⏎correct horse battery⏎correct horse battery⏎", Err("type the name"));
}

#[test]
fn a_password_given_by_somebody_else_is_changed_before_anything() {
    let mut model = with(&Fixture::normal(), closed());
    type_keys(&mut model, "anna⏎given by boris⏎");
    answer(&mut model, Ok(()));
    change_session(&mut model, |session| {
        session.who = Some(Who { user: "anna".into(), role: Role::Technician, must_change: true });
        session.view = true;
    });
    type_keys(&mut model, "1");
    assert_eq!(model.tabs.shown, Tab::Login);
    type_keys(&mut model, "\u{8}");
    let effects = type_keys(&mut model, "correct horse battery⏎correct horse battery⏎");
    let expect = SessionRequest::ChangePassword { old: "given by boris".into(), new: "correct horse battery".into() };
    assert_eq!(sent_request(&effects), Some(&expect));
    answer(&mut model, Ok(()));
    change_session(&mut model, |session| session.who = person("anna", Role::Technician).who);
    assert_eq!(model.tabs.shown, Tab::Mimic);
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
    answer(&mut model, Err("wrong password; wait 2 s"));
    shows(&mut model, "wrong password; wait 2 s");
    change_session(&mut model, |session| session.locked = false);
    assert_eq!(model.tabs.shown, Tab::Mimic);
    shows(&mut model, "new 65");
    let effects = type_keys(&mut model, ".5⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.5 }));
}

#[test]
fn a_form_that_waits_when_the_terminal_is_locked_takes_its_answer() {
    for (answer, left) in
        [(Ok(()), None), (Err("at least one Supervisor must remain"), Some("at least one Supervisor"))]
    {
        let mut model = with(&Fixture::normal(), supervisor());
        let effects = type_keys(&mut model, "7↓r ⏎");
        let Some(Effect::SessionRequest(id, SessionRequest::SetRole { .. })) = effects.last().cloned() else {
            panic!("{effects:?}")
        };
        ctrl(&mut model, 'k');
        change_session(&mut model, |session| session.locked = true);
        update(&mut model, Msg::RequestDone(id, answer.map(|()| Durability::Recorded).map_err(str::to_owned)));
        change_session(&mut model, |session| session.locked = false);
        match left {
            Some(words) => shows(&mut model, words),
            None => assert_eq!(model.modal, None, "the form has done its work"),
        }
    }
}

#[test]
fn a_lock_keeps_a_reauthentication_that_awaits_its_answer() {
    let mut model = with(&reauthenticated(Reauthentication::SecondUser), person("anna", Role::Technician));
    let effects = type_keys(&mut model, "s65⏎boris⏎horse⏎");
    let Some(Effect::Command(command, _)) = effects.last() else { panic!("no command: {effects:?}") };
    let id = command.id;
    change_session(&mut model, |session| session.locked = true);
    update(&mut model, Msg::Undelivered(id, "station too busy"));
    change_session(&mut model, |session| session.locked = false);
    shows(&mut model, "station too busy");
}

#[test]
fn a_locked_terminal_looks_and_does_nothing() {
    let mut model = with(&Fixture::alarm(), person("anna", Role::Technician));
    change_session(&mut model, |session| session.locked = true);
    for keys in ["a", "A", "s", "r", "4⏎f", "4⏎↓⏎"] {
        let effects = type_keys(&mut model, keys);
        assert!(sent_kind(&effects).is_none() && sent_request(&effects).is_none(), "{keys}: {effects:?}");
        assert!(model.modal.as_ref().is_some_and(Modal::is_unlock), "{keys}: {:?}", model.modal);
        type_keys(&mut model, "⎋⎋⎋1");
        assert_eq!((model.tabs.shown, &model.modal), (Tab::Mimic, &None), "{keys}");
    }
    for (keys, tab) in [
        ("3", Tab::Alarms),
        ("v↓", Tab::Alarms),
        ("V/unack⏎", Tab::Alarms),
        ("5", Tab::Reports),
        ("?⎋2", Tab::Trends),
        ("⇥", Tab::Alarms),
    ] {
        type_keys(&mut model, keys);
        assert_eq!((model.tabs.shown, &model.modal), (tab, &None), "{keys}");
    }
    type_keys(&mut model, "a⇥");
    assert_eq!(model.tabs.shown, Tab::Controllers, "below the window too");
    assert!(model.modal.as_ref().is_some_and(Modal::is_unlock));
    type_keys(&mut model, "⎋3");
    type_keys(&mut model, "a");
    ctrl(&mut model, 'o');
    shows(&mut model, "log in as another person than anna");
    let effects = type_keys(&mut model, "boris⏎battery⏎");
    assert_eq!(
        sent_request(&effects),
        Some(&SessionRequest::Login { user: "boris".to_owned(), password: "battery".into() })
    );
    update(&mut model, Msg::SessionStatus(Arc::new(person("boris", Role::Viewer))));
    assert_eq!((model.tabs.shown, &model.modal), (Tab::Mimic, &None));
}

#[test]
fn a_terminal_that_is_locked_on_the_login_page_still_shows_the_process() {
    let mut model = with(&Fixture::alarm(), person("anna", Role::Technician));
    assert_eq!(sent_request(&type_keys(&mut model, "0k")), Some(&SessionRequest::Lock));
    change_session(&mut model, |session| session.locked = true);
    assert_eq!(model.tabs.shown, Tab::Mimic);
    type_keys(&mut model, "3");
    assert_eq!(model.tabs.shown, Tab::Alarms);
}

#[test]
fn the_lock_is_told_beforehand_and_a_key_puts_it_off() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Technician));
    let active = |effects: &[Effect]| {
        effects.iter().filter(|effect| matches!(effect, Effect::SessionRequest(_, SessionRequest::Active))).count()
    };
    let press = |model: &mut Model| update(model, Msg::Key(KeyEvent::new(KeyCode::Right, KeyModifiers::NONE)));
    assert_eq!(active(&press(&mut model)), 1);
    assert_eq!((0..100).map(|_| active(&press(&mut model))).sum::<usize>(), 0, "twice a minute at most");
    change_session(&mut model, |session| session.locks_in = Some(Duration::from_secs(30)));
    for _ in 0..10 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    shows(&mut model, "locks in 25 s: press a key");
    assert_eq!(active(&press(&mut model)), 1);
}

#[test]
fn what_a_role_may_not_is_told_before_it_is_tried() {
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
    assert_eq!((sign.user, sign.password, command.expected_value), (None, "yes n q".into(), Some(70.0)));
    let sign =
        sent(Reauthentication::SecondUser, "s65⏎boris⏎horse⏎").and_then(|(_, sign)| sign).expect("a credentials");
    assert_eq!((sign.user.as_deref(), sign.password), (Some("boris"), "horse".into()));

    let mut model = with(&reauthenticated(Reauthentication::SecondUser), person("anna", Role::Technician));
    type_keys(&mut model, "s65⏎boris⏎abc");
    insta::assert_snapshot!("window_reauthentication_80x24", screen(&mut model, 80, 24));
}

#[test]
fn refused_credentials_are_asked_again_in_their_window() {
    let fixture = reauthenticated(Reauthentication::Password);
    let mut model = with(&fixture, person("anna", Role::Technician));
    let effects = type_keys(&mut model, "s65⏎hors⏎");
    let Some(Effect::Command(first, _)) = effects.last() else { panic!("no command: {effects:?}") };
    shows(&mut model, "asking the station");
    assert_eq!(type_keys(&mut model, "1q⏎"), [], "while the answer is awaited");
    let told = |request: &Command, outcome: Outcome| {
        let mut snapshot = fixture.snapshot();
        Arc::make_mut(&mut snapshot).commands = vec![CommandStatus {
            old: Some(70.0),
            outcome,
            ..CommandStatus::new(Command::new(0, request.id, request.kind.clone()), "anna", fixture::now())
        }];
        Msg::Snapshot(snapshot)
    };
    update(
        &mut model,
        told(first, Outcome::Refused(Refusal::NotReauthenticated("wrong password; wait 2 s".to_owned()))),
    );
    shows(&mut model, "wrong password; wait 2 s");
    let effects = type_keys(&mut model, "r1q 3a⏎");
    assert_eq!((model.tabs.shown, effects.len()), (Tab::Mimic, 1), "no letter of it was a key: {effects:?}");
    assert!(!screen(&mut model, 80, 24).contains("r1q"));
    let Some(Effect::Command(second, credentials)) = effects.last() else { panic!("no command: {effects:?}") };
    assert_eq!(credentials.as_ref().map(|sign| sign.password.clone()), Some("r1q 3a".into()));
    update(&mut model, told(second, Outcome::Pending));
    assert_eq!(model.modal, None);
}

#[test]
fn a_value_that_changes_under_an_open_window_is_told_at_once_and_asked_again() {
    let fixture = Fixture::normal();
    let mut model = with(&fixture, person("boris", Role::Technician));
    type_keys(&mut model, "s68");
    let mut later = fixture.clone();
    later.set("TIC-1.SV", 65.0);
    let mut snapshot = later.snapshot();
    Arc::make_mut(&mut snapshot).commands = vec![CommandStatus {
        old: Some(70.0),
        outcome: Outcome::Verified,
        ..CommandStatus::new(
            Command::new(
                0,
                CommandId { terminal: 2, number: 1 },
                CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.0 },
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
    assert_eq!(command.expected_value, Some(65.0), "what was seen when it was confirmed");
}

#[test]
fn a_station_that_has_gone_is_shown_and_takes_no_commands() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Technician));
    change_session(&mut model, |session| session.gone = Some("the socket was closed".into()));
    assert!(model.snapshot.samples.iter().all(|sample| !matches!(sample.quality, Quality::Good)));
    for _ in 0..8 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    shows(&mut model, "STATION GONE 4 s: reconnecting");
    shows(&mut model, "alarms not evaluated: station gone, the socket was closed");
    type_keys(&mut model, "0");
    assert_eq!(model.tabs.shown, Tab::Login);
    type_keys(&mut model, "4⏎u");
    shows(&mut model, "NOT SENT: the station has gone");
    change_session(&mut model, |session| session.gone = None);
    assert!(!screen(&mut model, 80, 24).contains("GONE"));
}

#[test]
fn another_plant_file_builds_everything_anew() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Technician));
    type_keys(&mut model, "2");
    type_keys(&mut model, "1s65");
    update(&mut model, Msg::Snapshot(Fixture::normal().snapshot()));
    assert!(matches!(model.modal, Some(Modal::Entry(_))), "an equal one changes nothing");
    let mut other = Fixture::normal();
    other.def.title = "Another tank".to_owned();
    update(&mut model, Msg::Snapshot(other.snapshot()));
    shows(&mut model, "The plant file changed");
    shows(&mut model, "Another tank");
    assert_eq!((model.plants, sent_kind(&type_keys(&mut model, "⏎"))), (1, None));
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
        let id = QueryId { tab: Tab::Users, number: model.session_lock.last_request };
        update(&mut model, Msg::RequestDone(id, Err("at least one Supervisor must remain".to_owned())));
        shows(&mut model, "at least one Supervisor must remain");
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
        "7njane⏎→⏎correct horse battery⏎correct horse battery⏎",
        SessionRequest::AddUser { user: "jane".to_owned(), role: Role::Supervisor, password: password() },
    );
    let mut model = with(&Fixture::normal(), supervisor());
    assert_eq!(sent_request(&type_keys(&mut model, "7↓xboriss⏎")), None, "another name deletes nobody");
    for (keys, own) in [("7d", true), ("7x", true), ("7↓↓d", false), ("7↓x", false)] {
        let mut model = with(&Fixture::normal(), supervisor());
        type_keys(&mut model, keys);
        assert_eq!(screen(&mut model, 80, 24).contains("This is you"), own, "{keys}");
    }
}

fn action(number: u64, by: &str, action: &str, target: &str, change: (&str, &str), outcome: &str) -> ActionRecord {
    let told = |text: &str| (!text.is_empty()).then(|| Arc::from(text));
    ActionRecord {
        at: fixture::now() - jiff::SignedDuration::from_secs(60 * (40 - number as i64)),
        by: by.into(),
        from: "pts/3 from 10.0.0.5, user panel".into(),
        action: action.into(),
        target: target.into(),
        old: told(change.0),
        new: told(change.1),
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
    let (_, words, by, ..) = {
        let effects = type_keys(&mut model, "bto⏎");
        // The query on its way is answered first; the new one follows at once.
        assert_eq!(asked(&effects), None);
        let id = QueryId { tab: Tab::Users, number: query.0.number + 1 };
        update(&mut model, Msg::Answer(id, Ok(Answer::Actions(Vec::new()))));
        asked(&update(&mut model, Msg::Tick { silent: Duration::ZERO })).expect("a query")
    };
    assert_eq!((words.as_str(), by.as_str()), ("pump", "to"));
}

#[test]
fn keys_for_users_act_only_on_the_user_that_was_drawn() {
    type Change = fn(&mut Vec<UserRow>);
    let removed: Change = |users| users.retain(|row| &*row.user != "boris");
    let other_state: Change = |users| users[1].disabled = true;
    for (change, keys) in [(removed, ["r", "d", "p", "x"]), (other_state, ["r", "d", "p", "x"])] {
        for key in keys {
            let mut model = with(&Fixture::normal(), supervisor());
            type_keys(&mut model, "7↓");
            let change = |model: &mut Model| {
                change_session(model, |session| change(Arc::make_mut(&mut session.users)));
            };
            assert_acts_only_on_what_was_drawn(&mut model, change, key);
        }
    }
}

#[test]
fn an_audit_entry_is_opened_only_as_it_was_drawn() {
    let mut model = with(&Fixture::normal(), supervisor());
    let asked = |effects: &[Effect]| {
        effects.iter().find_map(|effect| match effect {
            Effect::Query(id, Query::Audit { .. }) => Some(*id),
            _ => None,
        })
    };
    let row = |number| action(number, "anna", "write", "TIC-1.SV", ("70.0 °C", "65.0 °C"), "verified");
    let first = asked(&type_keys(&mut model, "7j")).expect("a query");
    update(&mut model, Msg::Answer(first, Ok(Answer::Actions(vec![row(37), row(36)]))));
    let mut later = (*Fixture::normal().snapshot()).clone();
    later.at += jiff::SignedDuration::from_secs(11);
    let again = asked(&update(&mut model, Msg::Snapshot(Arc::new(later)))).expect("the list is read again");
    let newer = |model: &mut Model| {
        update(model, Msg::Answer(again, Ok(Answer::Actions(vec![row(38), row(37), row(36)]))));
    };
    assert_acts_only_on_what_was_drawn(&mut model, newer, "⏎");
}
