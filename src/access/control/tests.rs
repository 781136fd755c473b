//! What a user at a terminal sees of access control: logins, lockouts, locks, roles, reauthentication, in virtual time.
#![allow(clippy::unwrap_used)]

mod live_reads;

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::{
    access::{Credentials, SessionEnd, lockout::Key, user::UserChange},
    plant::{
        command::{Command, CommandId, CommandKind, Refusal},
        def::Reauthentication,
        exact::Exact,
        fixture,
        role::AccessDef,
        time::elapsed,
    },
};

const BOSS: &str = "boss is a wet horse";
const TECH: &str = "tech is a wet horse";
const VIEW: &str = "view is a wet horse";

/// Access control whose jobs are done at once; the hash of a password is the password itself.
struct Bench {
    access: AccessControl,
    now: Timestamp,
    last_ticket: u64,
    last_command: u32,
    /// What was kept by the last save.
    kept: Option<Users>,
    disk_full: bool,
    records: Vec<(String, String, String)>,
}

impl Bench {
    fn new(rules: AccessDef) -> Bench {
        let mut def = fixture::plant();
        def.access = rules;
        def.tags[fixture::SV.index()].reauthenticate = Some(Reauthentication::SecondUser);
        let users = Users::default().with(&UserChange::First { user: "boss".into(), hash: BOSS.into() }).unwrap();
        let add = |users: Users, user: &str, role, hash: &str| {
            let users = users.with(&UserChange::Add { user: user.into(), role, hash: hash.into() }).unwrap();
            users.with(&UserChange::Password { user: user.into(), hash: hash.into(), must_change: false }).unwrap()
        };
        let users = add(users, "tech", Role::Technician, TECH);
        let users = add(users, "view", Role::Viewer, VIEW);
        Bench::of(AccessControl::with_users(Arc::new(def), users, Some("sight".into())))
    }

    fn of(access: AccessControl) -> Bench {
        let now = Timestamp::from_second(1_000_000).unwrap();
        Bench { access, now, last_ticket: 0, last_command: 0, kept: None, disk_full: false, records: Vec::new() }
    }

    fn open(&mut self, terminal: u32, host: &str) -> Vec<Effect> {
        let peer = Peer {
            from: format!("pts/{terminal} from {host}, user panel").into(),
            unix_user: Some("panel".into()),
            in_process: false,
        };
        let effects = self.access.open(terminal, peer, self.now);
        self.work(effects)
    }

    fn later(&mut self, seconds: i64) -> Vec<Effect> {
        self.now += jiff::SignedDuration::from_secs(seconds);
        let effects = self.access.tick(self.now);
        self.work(effects)
    }

    /// Does what is requested beside, and gives what is left.
    fn work(&mut self, effects: Vec<Effect>) -> Vec<Effect> {
        let (mut left, mut to_do) = (Vec::new(), effects);
        while !to_do.is_empty() {
            for effect in std::mem::take(&mut to_do) {
                match effect {
                    Effect::Job(job, PasswordJob::Verify { password, hash }) => {
                        to_do.extend(self.access.on_job_done(
                            job,
                            JobOutcome::Verified(*password.0 == *hash),
                            self.now,
                        ));
                    }
                    Effect::Job(job, PasswordJob::Hash(password)) => {
                        to_do.extend(self.access.on_job_done(job, JobOutcome::Hashed(Ok(password.0)), self.now));
                    }
                    Effect::Save(users) => {
                        let result = if self.disk_full { Err("disk full".to_owned()) } else { Ok(()) };
                        self.kept = Some(users).filter(|_| result.is_ok());
                        to_do.extend(self.access.on_saved(result, self.now));
                    }
                    Effect::Record(record) => {
                        let ActionRecord { by, action, target, outcome, .. } = &record;
                        self.records.push((format!("{by} {action}"), target.to_string(), outcome.to_string()));
                        left.push(Effect::Record(record));
                    }
                    other => left.push(other),
                }
            }
        }
        left
    }

    fn request(&mut self, terminal: u32, request: SessionRequest) -> Result<(), String> {
        self.last_ticket += 1;
        let effects = self.access.on_request(terminal, self.last_ticket, request, self.now);
        let effects = self.work(effects);
        let answers = effects.into_iter().filter_map(|effect| match effect {
            Effect::Reply(ticket, answer) if ticket == self.last_ticket => Some(answer),
            _ => None,
        });
        let answers: Vec<_> = answers.collect();
        assert_eq!(answers.len(), 1, "each request is answered once");
        answers.into_iter().next().unwrap().map_err(|why| why.to_string())
    }

    fn login(&mut self, terminal: u32, user: &str, password: &str) -> Result<(), String> {
        self.request(terminal, SessionRequest::Login { user: user.into(), password: password.into() })
    }

    /// `None`: nothing reached the plant. `Some(None)`: permitted.
    fn send_command(
        &mut self,
        terminal: u32,
        kind: CommandKind,
        credentials: Option<Credentials>,
    ) -> Option<(CommandStatus, Option<Refusal>)> {
        self.last_command += 1;
        let id = CommandId { terminal, number: self.last_command };
        let command = Command { note: Some("why".into()), ..Command::new(0, id, kind) };
        let effects = self.access.on_command(terminal, command, credentials, self.now);
        let effects = self.work(effects);
        let status = effects.into_iter().find_map(|effect| match effect {
            Effect::Command(status) => Some(status),
            _ => None,
        })?;
        let refused = match &status.outcome {
            crate::plant::command::Outcome::Refused(why) => Some(why.clone()),
            _ => None,
        };
        Some((status, refused))
    }

    fn who(&self, terminal: u32) -> Option<String> {
        self.access.session_status(terminal, self.now).who.map(|who| who.user.to_string())
    }

    fn last(&self) -> (&str, &str, &str) {
        let (by, target, outcome) = self.records.last().unwrap();
        (by, target, outcome)
    }
}

const RUN: CommandKind = CommandKind::Write { tag: fixture::RUN, value: Exact::plain(1.0) };
const SV: CommandKind = CommandKind::Write { tag: fixture::SV, value: Exact::plain(50.0) };

#[test]
fn failed_logins_look_alike_and_the_log_has_the_reason() {
    let mut bench = Bench::new(AccessDef::default());
    for (terminal, (user, password)) in [("nobody", BOSS), ("boss", "guess"), ("tech", "guess")].into_iter().enumerate()
    {
        let terminal = terminal as u32 + 1;
        bench.open(terminal, &format!("10.0.0.{terminal}"));
        let reply = bench.login(terminal, user, password).unwrap_err();
        assert_eq!(reply, "wrong name or password; wait 1 s");
    }
    bench.request(2, SessionRequest::Logout).unwrap_err();
    let why: Vec<_> =
        bench.records.iter().filter(|record| record.0.ends_with("failed")).map(|r| (&*r.1, &*r.2)).collect();
    assert_eq!(
        why,
        [
            ("unknown user", "refused: unknown user"),
            ("boss", "refused: wrong password"),
            ("tech", "refused: wrong password")
        ]
    );
    assert!(bench.records.iter().all(|record| !format!("{record:?}").contains("nobody")), "it may be a password");
}

#[test]
fn five_failures_lock_out_one_system_user_of_one_account() {
    let mut bench = Bench::new(AccessDef { anonymous_view: true, ..AccessDef::default() });
    bench.open(1, "10.0.0.1");
    bench.open(2, "10.0.0.2");
    bench.open(3, "10.0.0.3");
    bench.login(2, "tech", TECH).unwrap();
    for _ in 0..5 {
        bench.login(1, "tech", "guess").unwrap_err();
        bench.later(16);
    }
    let reply = bench.login(1, "tech", TECH).unwrap_err();
    assert!(reply.contains("wait 284 s"), "{reply}");
    assert!(bench.login(3, "TECH", TECH).is_err(), "the right password elsewhere does not help");
    assert!(bench.access.session_status(1, bench.now).may_view, "alarms and process stay to be seen");
    assert_eq!(bench.who(2).as_deref(), Some("tech"));
    assert_eq!(bench.send_command(2, RUN, None).unwrap().1, None, "who is in goes on working");
    bench.request(2, SessionRequest::Lock).unwrap();
    bench.request(2, SessionRequest::Unlock(TECH.into())).unwrap();
    bench.later(300);
    bench.login(1, "tech", TECH).unwrap();
}

#[test]
fn refused_commands_reach_the_plant_as_refused() {
    let roles = [
        (None, Role::Viewer, true),
        (Some(("view", VIEW)), Role::Viewer, true),
        (Some(("tech", TECH)), Role::Technician, false),
    ];
    for (login, _, refused) in roles {
        let mut bench = Bench::new(AccessDef::default());
        bench.open(1, "10.0.0.1");
        if let Some((user, password)) = login {
            bench.login(1, user, password).unwrap();
        }
        let (command, why) = bench.send_command(1, RUN, None).unwrap();
        assert_eq!(why.is_some(), refused, "{login:?} {why:?}");
        assert_eq!(&*command.by, login.map_or("not logged in (panel)", |login| login.0));
        assert_eq!(&*command.from, "pts/1 from 10.0.0.1, user panel");
        let stop = bench.request(1, SessionRequest::Stop);
        assert!(stop.is_err());
        assert!(bench.last().0.ends_with("stop station") && bench.last().2.starts_with("refused: "));
    }
}

#[test]
fn anonymous_queries_need_anonymous_view() {
    let query = Query::Journal { from: Timestamp::MIN, to: Timestamp::MAX, limit: 1 };
    for view in [false, true] {
        let mut bench = Bench::new(AccessDef { anonymous_view: view, ..AccessDef::default() });
        bench.open(1, "here");
        assert_eq!(bench.access.may_ask(1, &query, bench.now).is_ok(), view);
        bench.login(1, "view", VIEW).unwrap();
        assert_eq!(bench.access.may_ask(1, &query, bench.now), Ok(()));
    }
}

#[test]
fn the_audit_trail_is_for_supervisors_and_refusals_are_recorded() {
    let (words, by, action) = (String::new(), String::new(), String::new());
    let query = Query::Audit { from: Timestamp::MIN, to: Timestamp::MAX, words, by, action, limit: 1 };
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "tech", TECH).unwrap();
    let (why, effects) = bench.access.may_ask(1, &query, bench.now).unwrap_err();
    assert_eq!(why, "this needs a supervisor, you are a technician");
    assert!(matches!(&effects[..], [Effect::Record(entry)] if &*entry.by == "tech" && entry.outcome.ends_with(&why)));
    bench.login(1, "boss", BOSS).unwrap();
    assert_eq!(bench.access.may_ask(1, &query, bench.now), Ok(()));
    bench.request(1, SessionRequest::Lock).unwrap();
    assert!(bench.access.may_ask(1, &query, bench.now).unwrap_err().0.contains("locked"));
}

#[test]
fn an_idle_terminal_is_locked_until_the_password_is_entered() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "tech", TECH).unwrap();
    bench.later(850);
    let status = bench.access.session_status(1, bench.now);
    assert_eq!((status.locked, status.locks_in), (false, Some(Duration::from_secs(50))));
    bench.send_command(1, RUN, None).unwrap();
    bench.later(899);
    assert!(!bench.access.session_status(1, bench.now).locked, "a command is a sign of life");
    bench.later(1);
    let status = bench.access.session_status(1, bench.now);
    assert!(status.locked && status.may_view);
    assert!(bench.send_command(1, RUN, None).unwrap().1.is_some());
    assert!(bench.request(1, SessionRequest::Unlock("guess".into())).is_err());
    bench.later(1);
    bench.request(1, SessionRequest::Unlock(TECH.into())).unwrap();
    assert_eq!(bench.send_command(1, RUN, None).unwrap().1, None);
    bench.request(1, SessionRequest::Lock).unwrap();
    bench.login(1, "boss", BOSS).unwrap();
    assert_eq!(bench.who(1).as_deref(), Some("boss"), "another user may unlock the terminal");
}

#[test]
fn a_trusted_system_user_needs_no_password() {
    let trusted = vec![("panel".to_owned(), Role::Technician)];
    let mut bench = Bench::new(AccessDef { trusted, ..AccessDef::default() });
    bench.open(1, "10.0.0.1");
    assert_eq!(bench.who(1).as_deref(), Some("panel"));
    assert_eq!(bench.send_command(1, RUN, None).unwrap().1, None);
    bench.later(5000);
    assert!(!bench.access.session_status(1, bench.now).locked, "there would be no password to unlock it with");
    assert!(bench.request(1, SessionRequest::Lock).is_err());
}

#[test]
fn the_station_user_can_stop_it_with_a_lesser_trusted_role() {
    let trusted = vec![("panel".to_owned(), Role::Technician), ("sight".to_owned(), Role::Technician)];
    let mut bench = Bench::new(AccessDef { trusted, ..AccessDef::default() });
    bench.open(1, "10.0.0.1");
    let own = Peer { from: "here".into(), unix_user: Some("sight".into()), in_process: false };
    bench.access.open(2, own, bench.now);
    assert!(bench.request(1, SessionRequest::Stop).is_err());
    assert_eq!(bench.request(2, SessionRequest::Stop), Ok(()));
}

#[test]
fn the_session_limit_exempts_the_stations_own_terminal() {
    let mut bench = Bench::new(AccessDef { sessions_max: 4, ..AccessDef::default() });
    bench.open(1, "a");
    bench.open(2, "b");
    let sent_away = bench.open(3, "c");
    assert!(matches!(sent_away.last(), Some(Effect::HangUp(3, SessionEnd::TooMany { count: 2, .. }))));
    let own = Peer { from: "this process".into(), unix_user: None, in_process: true };
    assert!(bench.access.open(4, own, bench.now).iter().all(|effect| !matches!(effect, Effect::HangUp(..))));
    bench.access.close(1, bench.now);
    assert!(bench.open(5, "c").iter().all(|effect| !matches!(effect, Effect::HangUp(..))));
}

#[test]
fn a_hostile_terminal_floods_neither_plant_nor_audit_log() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "evil");
    let mut commands = 0;
    for _ in 0..600 {
        for _ in 0..100 {
            commands += usize::from(bench.send_command(1, RUN, None).is_some());
        }
        bench.later(1);
    }
    // Ten minutes, 60,000 commands.
    assert!((20..=330).contains(&commands), "{commands}");
    let reply = bench.records.iter().filter(|record| record.0.ends_with("too many requests")).count();
    assert!((9..=10).contains(&reply), "{reply}");
    let mut coming = 0;
    for terminal in 10..2000 {
        coming += bench
            .open(terminal, &format!("evil{terminal}"))
            .iter()
            .filter(|effect| matches!(effect, Effect::Record(_)))
            .count();
        bench.access.close(terminal, bench.now);
    }
    assert!(coming <= 20, "{coming}");
}

#[test]
fn a_demonstration_needs_no_login() {
    let mut bench = Bench::of(AccessControl::new(Arc::new(fixture::plant()), Some("sight".into())));
    let own = Peer { from: "this process".into(), unix_user: Some("anna".into()), in_process: true };
    bench.access.open(1, own, bench.now);
    assert_eq!(bench.who(1).as_deref(), Some("anna"));
    assert_eq!(bench.send_command(1, RUN, None).unwrap().1, None);
    bench.open(2, "10.0.0.1");
    assert!(bench.send_command(2, RUN, None).unwrap().1.is_some(), "only at its own terminal");
}

mod file;
mod users;
mod guessing;
mod late;
mod commands;
mod place;
mod room;
mod delegate;
mod matrix;
mod refusals;
mod idle;

proptest! {
    #[test]
    fn no_login_succeeds_during_a_lockout(
        steps in prop::collection::vec((0u32..4, any::<bool>(), 0i64..60), 1..80), login_attempts_max in 1u16..4
    ) {
        let mut bench = Bench::new(AccessDef { login_attempts_max, ..AccessDef::default() });
        for terminal in 0..4 {
            bench.open(terminal, &format!("10.0.0.{terminal}"));
        }
        // Wrong passwords in a row that were checked, over all terminals, and since when the user is locked out.
        let (mut wrong, mut locked_at) = (0, None::<Timestamp>);
        for (terminal, right, later) in steps {
            bench.later(later);
            if locked_at.is_some_and(|from| elapsed(from, bench.now) >= Duration::from_secs(300)) {
                (wrong, locked_at) = (0, None);
            }
            let key = Key { origin: "panel".into(), account: Some("tech".to_owned()), never_locked: false };
            let checked = bench.access.attempts.wait(&key, &bench.access.def.access, bench.now).is_none();
            let came_in = bench.login(terminal, "tech", if right { TECH } else { "guess" }).is_ok();
            prop_assert_eq!(came_in, right && checked && locked_at.is_none());
            if came_in {
                wrong = 0;
            } else if checked && locked_at.is_none() {
                wrong += 1;
                if wrong == login_attempts_max {
                    locked_at = Some(bench.now);
                }
            }
        }
    }
}
