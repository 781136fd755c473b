//! User administration, as terminals see it.

use super::*;

#[test]
fn a_supervisor_clears_a_lockout() {
    let mut bench = Bench::new(AccessDef { login_attempts_max: 1, ..AccessDef::default() });
    bench.open(1, "10.0.0.1");
    bench.open(2, "10.0.0.2");
    bench.open(3, "10.0.0.3");
    bench.login(2, "boss", BOSS).unwrap();
    bench.login(1, "tech", "guess").unwrap_err();
    let rows = bench.access.session_status(2, bench.now).users;
    assert!(rows.iter().any(|row| &*row.user == "tech" && row.locked_until.is_some()));
    bench.request(2, SessionRequest::Disable { user: "tech".into(), disabled: false }).unwrap();
    bench.login(3, "tech", TECH).unwrap();
}

#[test]
fn only_the_host_creates_the_first_supervisor_and_only_once() {
    let mut bench =
        Bench::of(AccessControl::with_users(Arc::new(fixture::plant()), Users::default(), Some("sight".into())));
    let first =
        || SessionRequest::FirstSupervisor { user: "anna".into(), password: "a horse in a tank of water".into() };
    bench.open(1, "10.0.0.1");
    assert!(!bench.access.session_status(1, bench.now).needs_first_supervisor);
    bench.request(1, first()).unwrap_err();
    bench.login(1, "anna", "").unwrap_err();
    let peer = Peer { from: "pts/0".into(), unix_user: Some("sight".into()), in_process: false };
    bench.access.open(2, peer, bench.now);
    assert!(bench.access.session_status(2, bench.now).needs_first_supervisor);
    assert!(
        bench.request(2, SessionRequest::FirstSupervisor { user: "anna".into(), password: "short".into() }).is_err()
    );
    bench.request(2, first()).unwrap();
    assert_eq!(bench.who(2).as_deref(), Some("anna"));
    assert!(
        bench
            .request(
                2,
                SessionRequest::FirstSupervisor { user: "bert".into(), password: "a horse in a tank of water".into() }
            )
            .is_err()
    );
    assert!(!bench.access.session_status(2, bench.now).needs_first_supervisor);
}

#[test]
fn a_user_with_a_given_password_must_choose_a_new_one() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.open(2, "10.0.0.2");
    bench.login(1, "boss", BOSS).unwrap();
    let (given, own) = ("given by the boss", "chosen by dora herself");
    bench
        .request(1, SessionRequest::AddUser { user: "dora".into(), role: Role::Supervisor, password: given.into() })
        .unwrap();
    bench.login(2, "dora", given).unwrap();
    assert!(bench.send_command(2, RUN, None).unwrap().1.is_some());
    assert!(bench.request(2, SessionRequest::Stop).is_err());
    bench.request(2, SessionRequest::ChangePassword { old: given.into(), new: given.into() }).unwrap_err();
    bench.request(2, SessionRequest::ChangePassword { old: given.into(), new: own.into() }).unwrap();
    assert_eq!(bench.send_command(2, RUN, None).unwrap().1, None);
    assert_eq!(&*bench.kept.as_ref().unwrap().get("dora").unwrap().hash, own);
}

#[test]
fn a_saved_change_acts_at_once_and_an_unsaved_one_never() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    let changes = [
        SessionRequest::SetRole { user: "tech".into(), role: Role::Viewer },
        SessionRequest::SetRole { user: "tech".into(), role: Role::Technician },
        SessionRequest::Disable { user: "tech".into(), disabled: true },
        SessionRequest::Disable { user: "tech".into(), disabled: false },
        SessionRequest::DeleteUser { user: "tech".into() },
    ];
    for (terminal, change) in changes.into_iter().enumerate() {
        let terminal = terminal as u32 + 2;
        bench.open(terminal, &format!("10.0.0.{terminal}"));
        let came_in = bench.login(terminal, "tech", TECH).is_ok();
        bench.disk_full = true;
        assert!(bench.request(1, change.clone()).is_err());
        assert_eq!(bench.who(terminal).is_some(), came_in, "nothing was changed");
        bench.disk_full = false;
        bench.request(1, change).unwrap();
        assert_eq!(bench.who(terminal), None);
    }
    assert!(
        bench.request(1, SessionRequest::DeleteUser { user: "boss".into() }).is_err(),
        "the last supervisor remains"
    );
    assert_eq!(bench.last(), ("boss delete user", "boss", "refused: at least one enabled supervisor must remain"));
}

#[test]
fn a_change_waits_while_last_logins_are_saved() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    let writing = bench.access.tick(bench.now);
    assert!(matches!(&writing[..], [Effect::Save(users)] if users.get("boss").unwrap().last_login.is_some()));
    let request = |user: &str| SessionRequest::DeleteUser { user: user.into() };
    assert_eq!(bench.access.on_request(1, 71, request("view"), bench.now), [], "not answered yet");
    assert!(bench.request(1, request("tech")).is_err(), "one at a time");
    let effects = bench.access.on_saved(Ok(()), bench.now);
    let effects = bench.work(effects);
    assert!(effects.contains(&Effect::Reply(71, Ok(()))));
    let kept = bench.kept.unwrap();
    assert!(kept.get("view").is_none() && kept.get("tech").is_some());
}

#[test]
fn a_name_known_to_the_operating_system_is_not_added() {
    let trusted = vec![("kiosk".to_owned(), Role::Technician)];
    let mut bench = Bench::new(AccessDef { trusted, ..AccessDef::default() });
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    let password = "given by the boss";
    let add = |user: &str| SessionRequest::AddUser { user: user.into(), role: Role::Viewer, password: password.into() };
    assert_eq!(bench.request(1, add("Kiosk")), Err(RequestRefusal::TrustedUser("Kiosk".to_owned()).to_string()));
    assert_eq!(bench.request(1, add("dora")), Ok(()));
}

/// The terminals whose status is published.
fn published(effects: &[Effect]) -> Vec<u32> {
    let terminals = effects.iter().filter_map(|effect| match effect {
        Effect::SessionStatus(terminal) => Some(*terminal),
        _ => None,
    });
    terminals.collect()
}

#[test]
fn a_session_is_shown_at_its_terminal_and_to_supervisors() {
    let mut bench = Bench::new(AccessDef::default());
    assert_eq!(published(&bench.open(1, "10.0.0.1")), [1]);
    bench.login(1, "boss", BOSS).unwrap();
    bench.open(2, "10.0.0.2");
    bench.login(2, "tech", TECH).unwrap();
    assert_eq!(published(&bench.open(3, "10.0.0.3")), [3, 1], "a technician has no list of sessions");
    assert_eq!(published(&bench.access.close(3, bench.now)), [1]);
    assert_eq!(published(&bench.access.on_request(2, 70, SessionRequest::Lock, bench.now)), [2, 1]);
    assert_eq!(published(&bench.access.on_request(1, 71, SessionRequest::Lock, bench.now)), [1], "once");
    assert_eq!(published(&bench.open(3, "10.0.0.3")), [3], "a locked terminal has no list");
}

#[test]
fn a_damaged_users_file_closes_the_login_and_says_why() {
    let damaged = "line 3: no such role";
    let mut bench = Bench::of(AccessControl::closed(Arc::new(fixture::plant()), damaged, Some("sight".into())));
    bench.open(1, "10.0.0.1");
    let why = RequestRefusal::LoginDisabled(damaged.to_owned()).to_string();
    assert_eq!((bench.login(1, "boss", BOSS), bench.access.users_digest()), (Err(why), None));
}
