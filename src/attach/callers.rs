//! Connections by user of the operating system: each has its own places, rate and log lines, so that none keeps out others.

use std::{collections::BTreeMap, time::Duration};

use super::protocol::TRY_AGAIN;
use crate::access::RateLimit;

/// Terminals of all users at once.
pub const TERMINALS_MAX: usize = 64;
/// Terminals of one user at once, except root and the user who runs the station.
const TERMINALS_OF_USER_MAX: usize = TERMINALS_MAX / 2;
/// This many are kept for these two, and for the users that the plant file trusts.
const TERMINALS_KEPT: usize = 4;
/// Connections of one user that have not completed the handshake; one more, and the oldest of them is dropped.
pub const STRANGERS_MAX: usize = 8;
/// The same of all users: the oldest one of the user with the most is dropped.
const STRANGERS_OF_ALL_MAX: usize = 64;
/// Terminals of one user that may attach: this many at once, and one more each time.
const ATTACHES: RateLimit = RateLimit::new(ATTACHES_BURST, Duration::from_millis(125));
const ATTACHES_BURST: u32 = 128;
/// Lines about one user in the log.
const LINES: RateLimit = RateLimit::new(20, Duration::from_secs(2));
/// Lines that were left out are counted, and the count is logged so often.
const COUNT_EVERY: Duration = Duration::from_secs(60);
/// Users that are counted each by itself; further ones share one count.
const USERS_MAX: usize = 256;
/// Stands for all the others.
const OTHERS: u32 = u32::MAX;

#[derive(Debug)]
struct Caller {
    terminals: usize,
    attaches: RateLimit,
    lines: RateLimit,
    unlogged: u64,
    counted: Duration,
}

impl Default for Caller {
    fn default() -> Caller {
        Caller { terminals: 0, attaches: ATTACHES, lines: LINES, unlogged: 0, counted: Duration::ZERO }
    }
}

/// All users that have connected, by uid.
#[derive(Debug)]
pub struct Callers {
    /// Root, and the user who runs the station: the last places are theirs.
    hosts: [u32; 2],
    users: BTreeMap<u32, Caller>,
}

impl Callers {
    /// No connections yet. `own` is the user that the station runs as.
    pub fn new(own: u32) -> Callers {
        Callers { hosts: [0, own], users: BTreeMap::new() }
    }

    /// A connection that has completed the handshake becomes a terminal. Returns the user it is counted for, which [`Callers::detach`]
    /// needs; `Err` says in words for its operator why it may not attach. `trusted`: the plant file lets the user in without a password.
    pub fn attach(&mut self, user: u32, trusted: bool, now: Duration) -> Result<u32, String> {
        let all: usize = self.users.values().map(|caller| caller.terminals).sum();
        // These two can end the station: a limit would only keep their scripts out.
        let host = self.hosts.contains(&user);
        let user = self.counted_as(user, now);
        let caller = self.users.entry(user).or_default();
        if !caller.attaches.try_acquire(now) && !host {
            return Err(format!("too many terminals of this user have attached recently{TRY_AGAIN}"));
        }
        if TERMINALS_OF_USER_MAX <= caller.terminals && !host {
            return Err(format!("this user has {TERMINALS_OF_USER_MAX} terminals, no more can attach"));
        }
        let most = if host || trusted { TERMINALS_MAX } else { TERMINALS_MAX - TERMINALS_KEPT };
        if most <= all {
            return Err(format!("the station has {all} terminals, no more can attach"));
        }
        caller.terminals += 1;
        Ok(user)
    }

    /// Is it root, or the user who runs the station?
    pub fn is_host(&self, user: u32) -> bool {
        self.hosts.contains(&user)
    }

    /// A terminal has gone.
    pub fn detach(&mut self, counted_as: u32) {
        if let Some(caller) = self.users.get_mut(&counted_as) {
            caller.terminals = caller.terminals.saturating_sub(1);
        }
    }

    /// May a line about this user be logged? If not it is counted.
    pub fn may_log(&mut self, user: u32, now: Duration) -> bool {
        let user = self.counted_as(user, now);
        let caller = self.users.entry(user).or_default();
        let some = caller.lines.try_acquire(now);
        if !some {
            caller.unlogged += 1;
        }
        some
    }

    /// Users about whom so many lines were not logged, each at most once a minute.
    pub fn unlogged(&mut self, now: Duration) -> Vec<(u32, u64)> {
        let due = |caller: &Caller| caller.unlogged > 0 && COUNT_EVERY <= now.saturating_sub(caller.counted);
        let callers = self.users.iter_mut().filter(|(_, caller)| due(caller));
        let counts = callers.map(|(user, caller)| {
            caller.counted = now;
            (*user, std::mem::take(&mut caller.unlogged))
        });
        counts.collect()
    }

    fn counted_as(&mut self, user: u32, now: Duration) -> u32 {
        let is_new = |users: &BTreeMap<u32, Caller>| USERS_MAX <= users.len() && !users.contains_key(&user);
        if is_new(&self.users) {
            let rests = |caller: &Caller| caller.attaches.is_full(now) && caller.lines.is_full(now);
            self.users.retain(|_, caller| caller.terminals > 0 || caller.unlogged > 0 || !rests(caller));
        }
        if is_new(&self.users) { OTHERS } else { user }
    }
}

/// Which of these connections without a handshake, the oldest first, makes room for another of this user.
pub fn makes_room(strangers: &[u32], user: u32) -> Option<usize> {
    let count = |user: u32| strangers.iter().filter(|stranger| **stranger == user).count();
    let crowd = match count(user) < STRANGERS_MAX {
        false => Some(user),
        true if strangers.len() < STRANGERS_OF_ALL_MAX => None,
        true => strangers.iter().copied().max_by_key(|stranger| count(*stranger)),
    };
    strangers.iter().position(|stranger| Some(*stranger) == crowd)
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVE: u32 = 1_001;
    const PANEL: u32 = 1_002;

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn pending_connections_push_out_only_the_same_user() {
        let mut strangers = vec![PANEL; 3];
        for _ in 0..1_000 {
            if let Some(place) = makes_room(&strangers, EVE) {
                assert_eq!(strangers.remove(place), EVE);
            }
            strangers.push(EVE);
        }
        assert_eq!(strangers.len(), 3 + STRANGERS_MAX);
        for user in 2_000..2_100 {
            if let Some(place) = makes_room(&strangers, user) {
                strangers.remove(place);
            }
            strangers.push(user);
            assert!(strangers.len() <= STRANGERS_OF_ALL_MAX);
        }
        assert!(strangers.contains(&PANEL), "the user with the most makes room");
    }

    #[test]
    fn endless_attaches_of_one_user_keep_no_other_user_out() {
        let mut callers = Callers::new(500);
        let attached = (0..10_000).filter(|_| callers.attach(EVE, false, seconds(1)).is_ok()).count();
        assert_eq!(attached, TERMINALS_OF_USER_MAX);
        let rest = TERMINALS_MAX - TERMINALS_OF_USER_MAX - TERMINALS_KEPT;
        for (user, trusted, most) in [(PANEL, false, rest), (PANEL, true, 1), (500, false, TERMINALS_KEPT - 1)] {
            let wanted = if trusted { 1 } else { 100 };
            assert_eq!((0..wanted).filter(|_| callers.attach(user, trusted, seconds(2)).is_ok()).count(), most);
        }
        (0..8).for_each(|_| callers.detach(PANEL));
        assert_eq!(callers.attach(0, false, seconds(3)), Ok(0));
        // Attaching and leaving again and again.
        callers.detach(EVE);
        let quick = (0..10_000).filter(|_| {
            let attached = callers.attach(EVE, false, seconds(100)).is_ok();
            attached.then(|| callers.detach(EVE)).is_some()
        });
        assert_eq!(quick.count(), ATTACHES_BURST as usize);
        let why = callers.attach(EVE, true, seconds(100)).expect_err("its rate is used up");
        assert!(why.ends_with(TRY_AGAIN), "its client tries again: {why}");
        // A script of root that asks for the status again and again is not a flood.
        (0..1_000).for_each(|_| {
            let root = callers.attach(0, false, seconds(100)).expect("root is let in");
            callers.detach(root);
        });
    }

    #[test]
    fn log_lines_of_one_user_are_limited_and_the_rest_counted() {
        let mut callers = Callers::new(500);
        let mut logged = 0;
        for second in 0..600 {
            logged += (0..1_000).filter(|_| callers.may_log(EVE, seconds(second))).count();
        }
        assert!((300..=330).contains(&logged), "{logged}");
        assert!(callers.may_log(PANEL, seconds(600)));
        assert_eq!(callers.unlogged(seconds(600)), [(EVE, 600_000 - logged as u64)]);
        assert_eq!(callers.unlogged(seconds(601)), []);
    }

    #[test]
    fn the_memory_for_users_is_bounded() {
        let mut callers = Callers::new(500);
        for user in 1_000..10_000 {
            callers.may_log(user, seconds(1));
        }
        assert_eq!(callers.users.len(), USERS_MAX + 1);
    }
}
