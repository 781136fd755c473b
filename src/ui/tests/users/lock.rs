//! The lock of a terminal: what it hides, keeps and lets through.

use super::*;

#[test]
fn a_waiting_form_takes_its_answer_under_the_lock() {
    for (answer, left) in
        [(Ok(()), None), (Err(RequestRefusal::LastSupervisor), Some("at least one enabled supervisor"))]
    {
        let mut model = with(&Fixture::normal(), supervisor());
        let effects = type_keys(&mut model, "7↓r ⏎");
        let Some(Effect::SessionRequest(id, SessionRequest::SetRole { .. })) = effects.last().cloned() else {
            panic!("{effects:?}")
        };
        ctrl(&mut model, 'k');
        change_session(&mut model, |session| session.locked = true);
        update(&mut model, Msg::RequestDone(id, answer.map(|()| Durability::Recorded)));
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
    update(&mut model, Msg::Undelivered(id, RequestRefusal::StationBusy));
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
    shows(&mut model, "log in as a user other than anna");
    let effects = type_keys(&mut model, "boris⏎battery⏎");
    assert_eq!(
        sent_request(&effects),
        Some(&SessionRequest::Login { user: "boris".to_owned(), password: "battery".into() })
    );
    update(&mut model, Msg::SessionStatus(Arc::new(person("boris", Role::Viewer))));
    assert_eq!((model.tabs.shown, &model.modal), (Tab::Mimic, &None));
}

#[test]
fn a_terminal_locked_on_the_login_page_shows_the_process() {
    let mut model = with(&Fixture::alarm(), person("anna", Role::Technician));
    assert_eq!(sent_request(&type_keys(&mut model, "0k")), Some(&SessionRequest::Lock));
    change_session(&mut model, |session| session.locked = true);
    assert_eq!(model.tabs.shown, Tab::Mimic);
    type_keys(&mut model, "3");
    assert_eq!(model.tabs.shown, Tab::Alarms);
}

#[test]
fn the_lock_is_reported_beforehand_and_a_key_puts_it_off() {
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
