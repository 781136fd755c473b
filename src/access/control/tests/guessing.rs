//! Wrong passwords: who is delayed and locked out, and who never is.

use super::*;
use crate::access::control::jobs::{JOBS_MAX, JOBS_OF_USER_MAX};

impl Bench {
    /// A terminal of this user of the operating system.
    fn open_as(&mut self, terminal: u32, user: &str) {
        let peer =
            Peer { from: format!("script, user {user}").into(), unix_user: Some(user.into()), in_process: false };
        self.access.open(terminal, peer, self.now);
    }

    /// The answer to a login, if there is one yet.
    fn answer(&mut self, terminal: u32, ticket: u64, user: &str, password: &str) -> Option<Result<(), RequestRefusal>> {
        let request = SessionRequest::Login { user: user.into(), password: password.into() };
        let effects = self.access.on_request(terminal, ticket, request, self.now);
        let effects = self.work(effects);
        answer_in(&effects, ticket)
    }
}

fn answer_in(effects: &[Effect], ticket: u64) -> Option<Result<(), RequestRefusal>> {
    effects.iter().find_map(|effect| match effect {
        Effect::Reply(to, answer) if *to == ticket => Some(answer.clone()),
        _ => None,
    })
}

#[test]
fn wrong_passwords_of_one_system_user_lock_no_other_out() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open_as(1, "eve");
    bench.open_as(2, "panel");
    for _ in 0..40 {
        bench.login(1, "boss", "guess").unwrap_err();
        bench.later(16);
    }
    bench.login(2, "boss", BOSS).unwrap();
    let reply = bench.login(1, "boss", BOSS).unwrap_err();
    assert!(reply.starts_with("too many wrong passwords: not checked; wait"), "{reply}");
    let rows = bench.access.session_status(2, bench.now).users;
    assert!(rows.iter().any(|row| &*row.user == "boss" && row.locked_until.is_some()), "a supervisor sees it");
    bench.request(2, SessionRequest::Disable { user: "boss".into(), disabled: false }).unwrap();
    bench.login(1, "boss", BOSS).unwrap();
}

#[test]
fn root_and_the_station_user_are_delayed_never_locked_out() {
    for user in ["root", "sight"] {
        let mut bench = Bench::new(AccessDef { login_attempts_max: 2, ..AccessDef::default() });
        bench.open_as(1, user);
        for _ in 0..60 {
            bench.login(1, "boss", "guess").unwrap_err();
            bench.later(16);
        }
        bench.login(1, "boss", "guess").unwrap_err();
        assert_eq!(bench.answer(1, 7_000, "boss", BOSS), None, "it waits for its turn");
        assert_eq!(answer_in(&bench.later(15), 7_000), None);
        assert_eq!(answer_in(&bench.later(1), 7_000), Some(Ok(())), "{user}");
        assert!(bench.records.iter().all(|record| !record.0.ends_with("lockout")));
    }
}

#[test]
fn six_right_logins_at_once_all_succeed() {
    let mut bench = Bench::new(AccessDef { sessions_max: 30, ..AccessDef::default() });
    let mut begun = Vec::new();
    for terminal in 1..=6 {
        bench.open_as(terminal, "panel");
        let login = SessionRequest::Login { user: "tech".into(), password: TECH.into() };
        begun.extend(bench.access.on_request(terminal, u64::from(terminal), login, bench.now));
    }
    bench.work(begun);
    assert!((1..=6).all(|terminal| bench.who(terminal).as_deref() == Some("tech")));
}

#[test]
fn too_many_logins_at_once_are_refused_as_busy() {
    let mut bench = Bench::new(AccessDef { sessions_max: 60, ..AccessDef::default() });
    let mut reply = Vec::new();
    for terminal in 1..=20 {
        bench.open_as(terminal, "eve");
        for ticket in 0..4 {
            let login = SessionRequest::Login { user: "tech".into(), password: "guess".into() };
            let ticket = u64::from(terminal) * 4 + ticket;
            reply.extend(answer_in(&bench.access.on_request(terminal, ticket, login, bench.now), ticket));
        }
    }
    assert_eq!(reply.len(), 80 - JOBS_OF_USER_MAX);
    assert!(reply.iter().all(|answer| *answer == Err(RequestRefusal::BusyWithLogins)), "{reply:?}");
    assert!(bench.access.jobs.len() + bench.access.waiting.len() <= JOBS_MAX);
    // The others are not touched.
    bench.open_as(30, "panel");
    bench.login(30, "tech", TECH).unwrap();
}

#[test]
fn one_system_user_who_guesses_at_all_names_is_stopped() {
    let mut bench = Bench::new(AccessDef { sessions_max: 60, ..AccessDef::default() });
    bench.open_as(1, "eve");
    let mut checked = 0;
    for name in 0..200 {
        let reply = bench.login(1, &format!("name{name}"), "guess").unwrap_err();
        checked += usize::from(reply.starts_with("wrong name or password"));
        bench.later(1);
    }
    assert_eq!(checked, 40);
    let locked = bench.records.iter().filter(|record| record.0.ends_with("lockout"));
    assert_eq!(locked.map(|record| &*record.1).collect::<Vec<_>>(), ["system user eve"]);
    bench.open_as(2, "panel");
    bench.login(2, "boss", BOSS).unwrap();
    bench.later(300);
    bench.login(1, "boss", BOSS).unwrap();
}

#[test]
fn an_unknown_name_is_delayed_and_locked_like_a_known_one() {
    let replies = ["tech", "nobody"].map(|name| {
        let mut bench = Bench::new(AccessDef { login_attempts_max: 3, ..AccessDef::default() });
        bench.open_as(1, "eve");
        let mut replies = Vec::new();
        for _ in 0..10 {
            replies.push(bench.login(1, name, "guess").unwrap_err());
            bench.later(1);
        }
        replies
    });
    assert_eq!(replies[0], replies[1]);
}

#[test]
fn a_terminal_that_hangs_up_early_has_used_its_attempt() {
    let mut bench = Bench::new(AccessDef { login_attempts_max: 2, ..AccessDef::default() });
    for terminal in 1..=2 {
        bench.open(terminal, "evil");
        let request = SessionRequest::Login { user: "tech".into(), password: "guess".into() };
        let effects = bench.access.on_request(terminal, 1, request, bench.now);
        bench.access.close(terminal, bench.now);
        bench.work(effects);
        bench.later(2);
    }
    bench.open(3, "other");
    assert!(bench.login(3, "tech", TECH).is_err());
}

#[test]
fn the_last_places_for_logins_are_kept_for_the_host() {
    let mut bench = Bench::new(AccessDef::default());
    let mut busy = |terminal, user, count: u64| {
        bench.open_as(terminal, user);
        let refused = (0..count).filter(|ticket| {
            let login = SessionRequest::Login { user: "tech".into(), password: "guess".into() };
            let effects = bench.access.on_request(terminal, *ticket, login, bench.now);
            answer_in(&effects, *ticket) == Some(Err(RequestRefusal::BusyWithLogins))
        });
        refused.count()
    };
    assert_eq!((busy(1, "eve", 24), busy(2, "mallory", 24)), (0, 0));
    assert_eq!(busy(3, "panel", 10), 2, "56 are for everyone");
    assert_eq!(busy(4, "root", 10), 2, "8 more for who runs the station");
    assert_eq!(bench.access.jobs.len() + bench.access.waiting.len(), JOBS_MAX);
}

#[test]
fn a_wait_is_said_in_seconds_after_which_it_is_over() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open_as(1, "eve");
    assert!(bench.login(1, "tech", "guess").unwrap_err().ends_with("wait 1 s"));
    bench.now += jiff::SignedDuration::from_nanos(999_999_999);
    assert_eq!(bench.login(1, "tech", TECH), Err(RequestRefusal::NotChecked { wait: 1 }.to_string()));
    bench.now += jiff::SignedDuration::from_nanos(1);
    assert_eq!(bench.login(1, "tech", TECH), Ok(()));
}
