//! Password checks and hashes that end after the session or the stored hash has changed.

use super::*;

/// The password that is being checked because of these effects.
fn under_way(effects: &[Effect]) -> JobId {
    let job = effects.iter().find_map(|effect| match effect {
        Effect::Job(job, _) => Some(*job),
        _ => None,
    });
    job.expect("a password is checked")
}

fn two_at_work() -> Bench {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.open(2, "10.0.0.2");
    bench.login(1, "boss", BOSS).unwrap();
    bench.login(2, "tech", TECH).unwrap();
    bench
}

#[test]
fn a_change_of_password_under_way_does_not_undo_a_reset() {
    let mut bench = two_at_work();
    let change = SessionRequest::ChangePassword { old: TECH.into(), new: "mine for ever and ever".into() };
    let job = under_way(&bench.access.on_request(2, 9_000, change, bench.now));
    bench
        .request(1, SessionRequest::ResetPassword { user: "tech".into(), password: "fresh horse for tech".into() })
        .unwrap();
    assert_eq!(bench.who(2), None, "the reset has ended the session");
    // The old password was right when it was checked.
    let effects = bench.access.on_job_done(job, JobOutcome::Verified(true), bench.now);
    let effects = bench.work(effects);
    assert!(matches!(effects[..], [.., Effect::Reply(9_000, Err(_))]), "{effects:?}");
    let tech = bench.access.users.as_ref().unwrap().get("tech").unwrap();
    assert_eq!((&*tech.hash, tech.must_change), ("fresh horse for tech", true));
}

#[test]
fn a_new_password_being_hashed_does_not_undo_a_reset() {
    let mut bench = two_at_work();
    let change = SessionRequest::ChangePassword { old: TECH.into(), new: "mine for ever and ever".into() };
    let verifying = under_way(&bench.access.on_request(2, 9_000, change, bench.now));
    let hashing = under_way(&bench.access.on_job_done(verifying, JobOutcome::Verified(true), bench.now));
    bench
        .request(1, SessionRequest::ResetPassword { user: "tech".into(), password: "fresh horse for tech".into() })
        .unwrap();
    // Logged in again with the password of the reset: the same person, another session.
    bench.login(2, "tech", "fresh horse for tech").unwrap();
    let effects =
        bench.access.on_job_done(hashing, JobOutcome::Hashed(Ok("mine for ever and ever".to_owned())), bench.now);
    bench.work(effects);
    let tech = bench.access.users.as_ref().unwrap().get("tech").unwrap();
    assert_eq!((&*tech.hash, tech.must_change), ("fresh horse for tech", true));
}

#[test]
fn a_login_during_a_password_change_fails_without_counting() {
    let mut bench = two_at_work();
    bench.open(3, "10.0.0.3");
    let login = SessionRequest::Login { user: "tech".into(), password: TECH.into() };
    let job = under_way(&bench.access.on_request(3, 9_000, login, bench.now));
    bench.request(2, SessionRequest::ChangePassword { old: TECH.into(), new: "a new horse for tech".into() }).unwrap();
    let effects = bench.access.on_job_done(job, JobOutcome::Verified(true), bench.now);
    bench.work(effects);
    assert_eq!(bench.who(3), None);
    assert_eq!(bench.last(), ("not logged in (panel) login failed", "tech", "refused: changed meanwhile"));
    bench.login(3, "tech", "a new horse for tech").unwrap();
}

#[test]
fn an_unlock_or_reauthentication_counts_only_in_its_session() {
    let mut bench = two_at_work();
    bench.request(2, SessionRequest::Lock).unwrap();
    let unlock = under_way(&bench.access.on_request(2, 9_000, SessionRequest::Unlock(TECH.into()), bench.now));
    bench.login(2, "tech", TECH).unwrap();
    bench.request(2, SessionRequest::Lock).unwrap();
    let effects = bench.access.on_job_done(unlock, JobOutcome::Verified(true), bench.now);
    bench.work(effects);
    assert!(bench.access.session_status(2, bench.now).locked, "the unlock belonged to the session before");

    bench.login(2, "tech", TECH).unwrap();
    let credentials = Some(Credentials { user: Some("boss".to_owned()), password: BOSS.into() });
    let id = CommandId { terminal: 2, number: 50 };
    let effects = bench.access.on_command(2, Command::new(0, id, SV), credentials, bench.now);
    bench.request(2, SessionRequest::Logout).unwrap();
    let effects = bench.access.on_job_done(under_way(&effects), JobOutcome::Verified(true), bench.now);
    let given = effects.iter().any(|effect| matches!(effect, Effect::Command(status) if status.is_pending()));
    assert!(!given, "{effects:?}");
}
