//! Logging in: what is closed before it, and the passwords that must be chosen.

use super::*;

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
    change_session(&mut model, |session| (session.who, session.may_view) = (None, false));
    assert_eq!(model.tabs.shown, Tab::Login);
}

#[test]
fn the_first_user_is_asked_for_only_where_nothing_may_be_seen() {
    for (may_view, expect) in [(true, false), (false, true)] {
        let first = SessionStatus { needs_first_supervisor: true, may_view, ..closed() };
        let model = with(&Fixture::normal(), first);
        assert_eq!(model.tabs.shown == Tab::Login, expect, "{may_view}");
    }
    // As a terminal hears it: closed until the station has said what may be seen.
    let mut model = with(&Fixture::normal(), SessionStatus { needs_first_supervisor: true, ..closed() });
    change_session(&mut model, |session| session.may_view = true);
    assert_eq!(model.tabs.shown, Tab::Mimic);
}

#[test]
fn an_anonymous_view_shows_the_process_and_takes_no_action() {
    let mut model = with(&Fixture::normal(), SessionStatus { may_view: true, ..closed() });
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
        let mut model = with(&Fixture::normal(), SessionStatus { needs_first_supervisor: true, ..closed() });
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
    check("⏎correct horse battery⏎correct horse battery⏎", Err("required: name"));
}

#[test]
fn a_password_set_by_another_user_is_changed_before_anything() {
    let mut model = with(&Fixture::normal(), closed());
    type_keys(&mut model, "anna⏎given by boris⏎");
    answer(&mut model, Ok(()));
    change_session(&mut model, |session| {
        session.who = Some(LoggedInUser { user: "anna".into(), role: Role::Technician, must_change: true });
        session.may_view = true;
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
