//! Requests from outside act as a user of the station, with no more rights and only while that user has them.

use super::*;

const MES: u32 = 9;

fn bench(user: &str, rules: AccessDef) -> Bench {
    let mut bench = Bench::new(rules);
    let effects = bench.access.open_delegate(MES, &user.into(), "MQTT broker:1883, tank/+/request", bench.now);
    bench.work(effects);
    bench
}

fn refused(bench: &mut Bench, kind: CommandKind) -> Option<String> {
    let (status, refused) = bench.send_command(MES, kind, None).expect("it is on record");
    assert_eq!(&*status.from, "MQTT broker:1883, tank/+/request");
    refused.map(|why| why.to_string())
}

#[test]
fn requests_have_the_rights_of_their_user() {
    let mut tech = bench("tech", AccessDef::default());
    assert_eq!(tech.last(), ("tech login", "tech", "done: named by the plant file"));
    assert_eq!(refused(&mut tech, RUN), None);
    let mut view = bench("view", AccessDef::default());
    assert_eq!(refused(&mut view, RUN).as_deref(), Some("this needs a technician, you are a viewer"));
    let trusted = AccessDef { trusted: vec![("mes".into(), Role::Technician)], ..AccessDef::default() };
    assert_eq!(refused(&mut bench("mes", trusted), RUN), None);
}

#[test]
fn a_tag_that_needs_a_second_user_is_not_for_requests() {
    let mut boss = bench("boss", AccessDef::default());
    assert_eq!(refused(&mut boss, SV).as_deref(), Some("this tag requires a second user"));
}

#[test]
fn a_user_that_does_not_exist_may_nothing() {
    let mut bench = bench("mes", AccessDef::default());
    assert_eq!(bench.last(), ("not logged in login", "mes", "refused: no such user"));
    let expect = "mes is not a user of this station, or is disabled";
    assert_eq!(refused(&mut bench, RUN).as_deref(), Some(expect));
}

#[test]
fn disabling_the_user_ends_its_requests_at_once() {
    let mut bench = bench("tech", AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "boss", BOSS).unwrap();
    bench.request(1, SessionRequest::Disable { user: "tech".into(), disabled: true }).unwrap();
    assert!(refused(&mut bench, RUN).is_some_and(|why| why.contains("is disabled")));
    bench.request(1, SessionRequest::Disable { user: "tech".into(), disabled: false }).unwrap();
    bench.later(1);
    assert_eq!(bench.who(MES).as_deref(), Some("tech"));
    bench.request(1, SessionRequest::SetRole { user: "tech".into(), role: Role::Viewer }).unwrap();
    assert!(refused(&mut bench, RUN).is_some_and(|why| why.contains("needs a technician")));
}

#[test]
fn a_refusal_before_the_plant_is_on_record_of_requests_only() {
    let mut bench = bench("tech", AccessDef::default());
    let effects = bench.access.record_refusal(MES, "\u{1b}[2J", "refused: \u{202e}not a request", bench.now);
    bench.work(effects);
    assert_eq!(bench.last(), ("tech request from outside", " [2J", "refused:  not a request"));
    bench.open(1, "here");
    assert!(bench.access.record_refusal(1, "?", "refused", bench.now).is_empty(), "a terminal");
}

#[test]
fn requests_are_never_locked_and_take_no_place_of_a_terminal() {
    let mut bench = bench("tech", AccessDef { sessions_max: 8, ..AccessDef::default() });
    bench.later(100_000);
    assert_eq!(refused(&mut bench, RUN), None, "no key is pressed, and no idle lock comes");
    for terminal in 20..100 {
        bench.open(terminal, "10.0.0.5");
    }
    assert_eq!(bench.who(MES).as_deref(), Some("tech"));
}

/// The terminals that are sent away.
fn sent_away(effects: &[Effect]) -> Vec<(u32, SessionEnd)> {
    let gone = effects.iter().filter_map(|effect| match effect {
        Effect::HangUp(terminal, why) => Some((*terminal, why.clone())),
        _ => None,
    });
    gone.collect()
}

#[test]
fn another_plant_sends_away_terminals_and_requests_unless_kept() {
    for (keep, gone) in [(true, &[1][..]), (false, &[1, MES])] {
        let mut bench = bench("tech", AccessDef::default());
        bench.open(1, "here");
        let effects = bench.access.redefine(bench.access.def.clone(), 2, keep, bench.now);
        let expect: Vec<_> = gone.iter().map(|terminal| (*terminal, SessionEnd::PlantReloaded)).collect();
        assert_eq!(sent_away(&effects), expect, "kept: {keep}");
    }
}

#[test]
fn users_changed_by_hand_are_taken_if_nothing_changed_here() {
    let mut bench = bench("tech", AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "boss", BOSS).unwrap();
    let own = bench.access.users.clone().unwrap();
    let before = own.digest();
    let users = own.with(&UserChange::Disable("tech".into(), true)).unwrap();
    assert_eq!(bench.access.take_users(Some("another"), users.clone(), bench.now), None, "changed here");
    assert_eq!(bench.access.take_users(Some(&before), own, bench.now), None, "the same users");
    let saving = bench.access.tick(bench.now);
    assert!(matches!(&saving[..], [Effect::Save(_)]));
    assert_eq!(bench.access.take_users(Some(&before), users.clone(), bench.now), None, "a change is being saved");
    bench.access.on_saved(Ok(()), bench.now);
    let effects = bench.access.take_users(Some(&before), users, bench.now).unwrap();
    assert_eq!(sent_away(&effects), [(1, SessionEnd::UsersReloaded)]);
    assert!(
        refused(&mut bench, RUN).is_some_and(|why| why.contains("is disabled")),
        "requests stay, with the rights of now"
    );
    let mut without = Bench::of(AccessControl::new(bench.access.def.clone(), None));
    assert_eq!(without.access.take_users(None, Users::default(), without.now), None, "in a demonstration");
}
