//! What becomes of commands that do not reach the plant: the session status says so.

use super::*;
use crate::plant::def::ActionDef;

impl Bench {
    /// The commands of a terminal that did not reach the plant, and why.
    fn undelivered(&self, terminal: u32) -> Vec<(u32, String)> {
        let reply = self.access.session_status(terminal, self.now).undelivered;
        reply.iter().map(|(id, why)| (id.number, why.to_string())).collect()
    }
}

#[test]
fn a_command_with_a_used_number_is_reported_undelivered() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "a");
    bench.login(1, "boss", BOSS).unwrap();
    bench.last_command = 6;
    assert_eq!(bench.send_command(1, RUN, None).unwrap().1, None);
    for last in [6, 3] {
        bench.last_command = last;
        assert!(bench.send_command(1, RUN, None).is_none(), "number {} came after 7", last + 1);
    }
    let reply = bench.undelivered(1);
    assert_eq!(reply.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [7, 4]);
    assert!(reply[0].1.contains("repeats an earlier number"));
    bench.open(2, "b");
    bench.login(2, "boss", BOSS).unwrap();
    bench.last_command = 6;
    assert_eq!(bench.send_command(2, RUN, None).unwrap().1, None, "each terminal counts for itself");
}

#[test]
fn a_command_over_the_rate_limit_is_reported_to_its_terminal() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "a");
    // No user is logged in: 20 refusals, the attach among them, are recorded, the next ones only reported, and from the 41st
    // request on it is too many.
    let reached = (0..60).filter(|_| bench.send_command(1, RUN, None).is_some()).count();
    let reply = bench.undelivered(1);
    assert_eq!((reached, reply.len()), (19, 41));
    assert_eq!(reply[0], (20, "log in first".to_owned()));
    assert_eq!(reply[40], (60, RequestRefusal::TooManyRequests.to_string()));
    for _ in 0..1_000 {
        bench.send_command(1, RUN, None);
    }
    assert_eq!(bench.undelivered(1).len(), 64, "only the latest are remembered");
}

#[test]
fn a_stop_is_never_one_request_too_many() {
    let mut bench = Bench::new(AccessDef::default());
    let mut def = PlantDef::clone(&bench.access.def);
    let device = def.tag(fixture::RUN).device.index();
    let (name, confirm, settle) = ("STOP".into(), String::new(), Duration::ZERO);
    let stop = ActionDef { name, confirm, settle, tag: fixture::RUN, value: 0.0, stop: true, saves: false, role: None };
    def.devices[device].actions.push(stop);
    bench.access.def = Arc::new(def);
    bench.open(1, "a");
    bench.login(1, "tech", TECH).unwrap();
    for _ in 0..100 {
        bench.send_command(1, RUN, None);
    }
    assert!(bench.send_command(1, RUN, None).is_none());
    let off = CommandKind::Write { tag: fixture::RUN, value: 0.0.into() };
    assert_eq!(bench.send_command(1, off, None).unwrap().1, None);
}

#[test]
fn a_tag_with_second_user_is_written_only_with_one() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "10.0.0.1");
    bench.login(1, "tech", TECH).unwrap();
    let credentials = |user: Option<&str>, password: &str| {
        Some(Credentials { user: user.map(str::to_owned), password: password.into() })
    };
    let wrong = RequestRefusal::WrongPassword { wait: 1 };
    let refused = [
        (None, RequestRefusal::SecondUser),
        (credentials(None, TECH), RequestRefusal::SecondUser),
        (credentials(Some("Tech"), TECH), RequestRefusal::SecondUserIsFirst),
        (
            credentials(Some("view"), VIEW),
            RequestRefusal::ApproverRole { name: "view".into(), needed: Role::Technician },
        ),
        (credentials(Some("boss"), "guess"), wrong.clone()),
        (credentials(Some("stranger"), BOSS), wrong),
    ];
    for (credentials, why) in refused {
        let (_, refused) = bench.send_command(1, SV, credentials).unwrap();
        assert_eq!(refused, Some(Refusal::NotReauthenticated(why)));
        bench.later(2);
    }
    let (command, refused) = bench.send_command(1, SV, credentials(Some("BOSS"), BOSS)).unwrap();
    assert_eq!((refused, command.command.note.as_deref()), (None, Some("why; approved by boss")));
}

#[test]
fn a_trusted_account_is_refused_where_a_password_is_needed() {
    let trusted = vec![("panel".to_owned(), Role::Technician)];
    let mut bench = Bench::new(AccessDef { trusted, ..AccessDef::default() });
    let mut def = PlantDef::clone(&bench.access.def);
    def.tags[fixture::RUN.index()].reauthenticate = Some(Reauthentication::Password);
    bench.access.def = Arc::new(def);
    bench.open(1, "10.0.0.1");
    let (_, refused) = bench.send_command(1, RUN, Some(Credentials { user: None, password: TECH.into() })).unwrap();
    let why = RequestRefusal::AccountWithoutPassword;
    assert_eq!(refused, Some(Refusal::NotReauthenticated(why)));
}

#[test]
fn the_station_refuses_a_setting_that_needs_a_supervisor() {
    let mut bench = Bench::new(AccessDef::default());
    let mut def = PlantDef::clone(&bench.access.def);
    def.tags[fixture::RUN.index()].role = Role::Supervisor;
    bench.access.def = Arc::new(def);
    for (user, password, refused) in [("tech", TECH, true), ("boss", BOSS, false)] {
        bench.open(1, "10.0.0.1");
        bench.login(1, user, password).unwrap();
        let why = bench.send_command(1, RUN, None).unwrap().1;
        let not_permitted =
            Refusal::NotPermitted(RequestRefusal::Role { needed: Role::Supervisor, role: Role::Technician });
        assert_eq!(why, refused.then_some(not_permitted), "{user}");
        bench.access.close(1, bench.now);
    }
}
