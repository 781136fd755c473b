//! What the audit log says of the file of users.

use super::*;
use crate::access::audit_log::USERS_FILE;

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
            Effect::Record(record) if &*record.action == USERS_FILE => Some(record),
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
