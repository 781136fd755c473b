//! What others at the same place can do to a user who works there.

use super::*;

#[test]
fn failures_of_others_do_not_block_a_logged_in_user() {
    let mut bench = Bench::new(AccessDef::default());
    for terminal in 1..=3 {
        bench.open(terminal, "10.0.0.5");
    }
    bench.login(1, "tech", TECH).unwrap();
    bench.later(60);
    for _ in 0..400 {
        bench.later(1);
        let _ = bench.login(2, "nobody", "guess");
    }
    assert!(bench.login(3, "nobody", "guess").unwrap_err().contains("not checked"), "only that name is locked out");
    bench.login(3, "boss", BOSS).unwrap();
    bench.request(1, SessionRequest::Lock).unwrap();
    bench.request(1, SessionRequest::Unlock(TECH.into())).unwrap();
    let change = SessionRequest::ChangePassword { old: TECH.into(), new: "another wet horse".into() };
    bench.request(1, change).unwrap();
}

#[test]
fn guesses_at_a_locked_terminal_are_delayed_as_usual() {
    let mut bench = Bench::new(AccessDef { login_attempts_max: 3, ..AccessDef::default() });
    bench.open(1, "10.0.0.5");
    bench.open(2, "10.0.0.5");
    bench.login(1, "tech", TECH).unwrap();
    bench.request(1, SessionRequest::Lock).unwrap();
    for wait in [1, 2, 300] {
        let reply = bench.request(1, SessionRequest::Unlock("guess".into())).unwrap_err();
        assert!(reply.ends_with(&format!("wait {wait} s")), "{reply}");
        bench.later(wait.min(2));
    }
    assert!(bench.request(1, SessionRequest::Unlock(TECH.into())).is_err());
    bench.login(2, "boss", BOSS).unwrap();
    bench.later(300);
    bench.request(1, SessionRequest::Unlock(TECH.into())).unwrap();
}

#[test]
fn a_clock_step_moves_lists_and_keeps_lockouts() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.5");
    bench.open(2, "10.0.0.6");
    bench.login(1, "boss", BOSS).unwrap();
    let years = jiff::SignedDuration::from_hours(24 * 365 * 56);
    assert_eq!(bench.access.follow_clock(years), [Effect::SessionStatus(1), Effect::SessionStatus(2)]);
    assert_eq!(bench.access.follow_clock(years), [], "once");
    bench.login(2, "tech", TECH).unwrap();
    let status = bench.access.session_status(1, bench.now);
    assert!(status.sessions.iter().all(|row| row.since == bench.now + years));
    let tech = status.users.iter().find(|row| &*row.user == "tech").unwrap();
    assert_eq!(tech.last_login, Some(bench.now + years));
}
