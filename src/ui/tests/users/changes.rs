//! What changes under an operator: the station, the plant file, a refused credential, a row.

use super::*;

#[test]
fn refused_credentials_are_asked_again_in_their_window() {
    let fixture = reauthenticated(Reauthentication::Password);
    let mut model = with(&fixture, person("anna", Role::Technician));
    let effects = type_keys(&mut model, "s65⏎hors⏎");
    let Some(Effect::Command(first, _)) = effects.last() else { panic!("no command: {effects:?}") };
    shows(&mut model, "waiting for the station");
    assert_eq!(type_keys(&mut model, "1q⏎"), [], "while the answer is awaited");
    let outcome_of = |request: &Command, outcome: Outcome| {
        let mut snapshot = fixture.snapshot();
        Arc::make_mut(&mut snapshot).commands = vec![CommandStatus {
            old: Some(70.0.into()),
            outcome,
            ..CommandStatus::new(Command::new(0, request.id, request.kind.clone()), "anna", fixture::now())
        }];
        Msg::Snapshot(snapshot)
    };
    update(
        &mut model,
        outcome_of(first, Outcome::Refused(Refusal::NotReauthenticated(RequestRefusal::WrongPassword { wait: 2 }))),
    );
    shows(&mut model, "wrong name or password; wait 2 s");
    let effects = type_keys(&mut model, "r1q 3a⏎");
    assert_eq!((model.tabs.shown, effects.len()), (Tab::Mimic, 1), "no letter of it was a key: {effects:?}");
    assert!(!screen(&mut model, 80, 24).contains("r1q"));
    let Some(Effect::Command(second, credentials)) = effects.last() else { panic!("no command: {effects:?}") };
    assert_eq!(credentials.as_ref().map(|sign| sign.password.clone()), Some("r1q 3a".into()));
    update(&mut model, outcome_of(second, Outcome::Pending));
    assert_eq!(model.modal, None);
}

#[test]
fn a_station_that_has_gone_is_shown_and_takes_no_commands() {
    let mut model = with(&Fixture::normal(), person("anna", Role::Technician));
    change_session(&mut model, |session| {
        session.gone = Some(crate::access::SessionEnd::Connection("the socket was closed".into()))
    });
    assert!(model.snapshot.samples.iter().all(|sample| !matches!(sample.quality, Quality::Good)));
    for _ in 0..8 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    shows(&mut model, "STATION LOST 4 s: reconnecting");
    shows(&mut model, "alarms not evaluated: station disconnected: the socket was closed");
    type_keys(&mut model, "0");
    assert_eq!(model.tabs.shown, Tab::Login);
    type_keys(&mut model, "4⏎u");
    shows(&mut model, "NOT SENT: the station is disconnected");
    change_session(&mut model, |session| session.gone = None);
    assert!(!screen(&mut model, 80, 24).contains("GONE"));
}

#[test]
fn another_plant_file_rebuilds_everything() {
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

#[test]
fn terminals_that_come_and_go_are_one_row_of_the_audit_list() {
    let mut model = with(&Fixture::normal(), supervisor());
    let query = type_keys(&mut model, "7j").into_iter().find_map(|effect| match effect {
        Effect::Query(id, Query::Audit { .. }) => Some(id),
        _ => None,
    });
    let terminal = |number, what, outcome| action(number, "panel", what, "", ("", ""), outcome);
    let rows = vec![
        action(40, "anna", "write", "TIC-1.SV", ("70.0 °C", "65.0 °C"), "verified"),
        terminal(39, "detach", "done"),
        terminal(38, "attach", "done"),
        terminal(37, "attach", "done"),
        terminal(36, "attach", "refused: too many terminals"),
    ];
    update(&mut model, Msg::Answer(query.expect("a query"), Ok(Answer::Actions(rows))));
    for (width, height) in [(80, 24), (120, 40)] {
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("3 entries since") && shown.contains("attached 2 ×"), "{shown}");
        assert!(shown.contains("refused: too many") && !shown.contains("detach "), "{shown}");
    }
    // Enter shows what is folded, d folds it again.
    type_keys(&mut model, "↓⏎");
    assert!(screen(&mut model, 80, 24).contains("detach ") && model.modal.is_none());
    type_keys(&mut model, "d");
    assert!(screen(&mut model, 80, 24).contains("3 entries since"));
}
