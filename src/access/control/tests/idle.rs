//! When an idle terminal is locked, and what it is shown before.

use super::*;

#[test]
fn a_request_of_an_unlocked_terminal_is_a_sign_of_life() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "tech", TECH).unwrap();
    bench.later(899);
    bench.request(1, SessionRequest::Active).unwrap();
    bench.later(899);
    assert!(!bench.access.session_status(1, bench.now).locked);
    bench.later(1);
    assert!(bench.access.session_status(1, bench.now).locked);
}

#[test]
fn a_lock_is_announced_from_a_minute_before_it_on() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "tech", TECH).unwrap();
    assert_eq!(bench.later(839), []);
    assert_eq!(bench.later(1), [Effect::SessionStatus(1)]);
    assert_eq!(bench.access.session_status(1, bench.now).locks_in, Some(Duration::from_secs(60)));
}
