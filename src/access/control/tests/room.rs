//! Who gets a seat when many want one.

use super::*;

impl Bench {
    /// A terminal of this user comes. Gives the terminals that were sent away because of it.
    fn comes(&mut self, terminal: u32, user: &str) -> Vec<u32> {
        let peer =
            Peer { from: format!("script, user {user}").into(), unix_user: Some(user.into()), in_process: false };
        let effects = self.access.open(terminal, peer, self.now);
        let gone = effects.into_iter().filter_map(|effect| match effect {
            Effect::HangUp(terminal, _) => Some(terminal),
            _ => None,
        });
        gone.collect()
    }
}

#[test]
fn one_user_of_the_operating_system_cannot_take_all_seats() {
    let mut bench = Bench::new(AccessDef { sessions_max: 8, ..AccessDef::default() });
    let sent_away: Vec<u32> = (1..=20).flat_map(|terminal| bench.comes(terminal, "script")).collect();
    assert_eq!(sent_away, (5..=20).collect::<Vec<_>>(), "half of them are left for others");
    let sent_away: Vec<u32> = (21..=25).flat_map(|terminal| bench.comes(terminal, "panel")).collect();
    assert_eq!(sent_away, [24, 25], "one is kept");
    assert!(bench.comes(30, "root").is_empty(), "for those who run the station");
    assert_eq!(bench.comes(31, "sight"), [31], "and no more than that");
}

#[test]
fn a_long_idle_anonymous_session_makes_room() {
    let mut bench = Bench::new(AccessDef { sessions_max: 4, idle_lock: Duration::ZERO, ..AccessDef::default() });
    bench.comes(1, "panel");
    bench.comes(2, "panel");
    bench.login(1, "tech", TECH).unwrap();
    bench.later(599);
    assert_eq!(bench.comes(3, "panel"), [3]);
    bench.later(1);
    assert_eq!(bench.comes(4, "panel"), [2], "not the one in use");
    assert_eq!(bench.comes(5, "panel"), [5]);
    assert_eq!(bench.who(1).as_deref(), Some("tech"));
}

#[test]
fn the_stations_own_terminal_comes_and_goes_without_an_entry() {
    let mut bench = Bench::new(AccessDef::default());
    let entries = |effects: Vec<Effect>| effects.iter().filter(|effect| matches!(effect, Effect::Record(_))).count();
    for (in_process, expect) in [(true, 0), (false, 1)] {
        let peer = Peer { from: "pts/1".into(), unix_user: Some("panel".into()), in_process };
        let comes = entries(bench.access.open(1, peer, bench.now));
        assert_eq!((comes, entries(bench.access.close(1, bench.now))), (expect, expect));
    }
}

#[test]
fn who_finds_no_seat_learns_whose_terminals_have_them() {
    for (user, words) in [
        (Some("script"), "script has 4 terminals, no more can attach"),
        (None, "4 terminals are attached, no more can attach"),
    ] {
        assert_eq!(SessionEnd::TooMany { count: 4, user: user.map(str::to_owned) }.to_string(), words);
    }
}
