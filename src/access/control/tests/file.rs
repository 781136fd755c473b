//! What the audit log says of the file of users.

use super::*;
use crate::plant::recorded_action::RecordedAction;

#[test]
fn user_changes_are_chained_and_a_login_changes_nothing() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "a");
    let start = bench.access.users_digest().unwrap();
    bench.login(1, "boss", BOSS).unwrap();
    bench.later(1);
    assert_eq!(bench.access.users_digest().unwrap(), start);
    let mut last = start;
    for role in [Role::Technician, Role::Viewer] {
        let effects = bench.access.on_request(1, 99, SessionRequest::SetRole { user: "tech".into(), role }, bench.now);
        let effects = bench.work(effects);
        let file = effects.iter().find_map(|effect| match effect {
            Effect::Record(record) if record.is(RecordedAction::UsersFile) => Some(record),
            _ => None,
        });
        let now = bench.access.users_digest().unwrap();
        let Some(file) = file else {
            assert_eq!(now, last, "nothing has changed");
            continue;
        };
        assert_eq!((file.old.as_deref(), file.new.as_deref()), (Some(&*last), Some(&*now)));
        last = now;
    }
    assert_eq!(bench.kept.as_ref().unwrap().digest(), last, "as it is on disk");
}

#[test]
fn a_reload_is_on_record_and_answered_when_it_is_done() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    let effects = bench.access.on_request(1, 70, SessionRequest::Reload, bench.now);
    let [Effect::Record(entry), Effect::Reload(70, Some(_))] = &effects[..] else { panic!("{effects:?}") };
    assert_eq!((&*entry.action, &*entry.outcome), ("reload", "permitted"));
}

#[test]
fn a_backup_is_on_record_before_it_and_after_it() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    for (ticket, done, outcome) in [(70, Ok("2 files"), "done: 2 files"), (71, Err("disk full"), "failed: disk full")] {
        let done = done.map(str::to_owned).map_err(str::to_owned);
        let request = SessionRequest::Backup { folder: "/backup".into() };
        let effects = bench.access.on_request(1, ticket, request, bench.now);
        let [Effect::Record(entry), Effect::Backup(..)] = &effects[..] else { panic!("{effects:?}") };
        assert_eq!((&*entry.target, &*entry.outcome), ("/backup", "permitted"));
        let effects = bench.access.on_history_job_done(ticket, done.clone(), bench.now);
        let [Effect::Record(entry), reply] = &effects[..] else { panic!("{effects:?}") };
        assert_eq!((&*entry.by, &*entry.target, &*entry.outcome), ("boss", "/backup", outcome));
        assert_eq!(*reply, Effect::Reply(ticket, done.clone().map(drop).map_err(RequestRefusal::Failed)));
        assert_eq!(bench.access.on_history_job_done(ticket, done, bench.now), [], "once");
    }
}

#[test]
fn an_export_that_failed_after_it_was_on_record_is_too() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "boss", BOSS).unwrap();
    for (sha256, new, outcome) in [(Ok("5f"), Some("5f"), "done"), (Err("disk full"), None, "failed: disk full")] {
        let sha256 = sha256.map(str::to_owned).map_err(str::to_owned);
        let request = SessionRequest::Exported { file: "/shift.csv".into(), sha256 };
        let effects = bench.access.on_request(1, 70, request, bench.now);
        let [Effect::Record(entry), Effect::Reply(70, Ok(()))] = &effects[..] else { panic!("{effects:?}") };
        assert_eq!((&*entry.action, &*entry.target, entry.new.as_deref()), ("export", "/shift.csv", new));
        assert_eq!(&*entry.outcome, outcome);
    }
}
