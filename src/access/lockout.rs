//! Failed logins, counted for each name and each user of the operating system, so that no user locks out another.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

use crate::plant::role::AccessDef;

/// After a wrong password the next one waits a second, after each further one twice as long, but no longer than this.
const DELAY_MAX: Duration = Duration::from_secs(16);
/// Keys that are remembered; those that were quiet longest are forgotten first.
const KEYS_MAX: usize = 1024;
/// One user of the operating system has this many times the attempts of one name for all names together.
const NAMES: u32 = 8;

/// What wrong passwords are counted by.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// The user of the operating system, as the kernel reports it; or one terminal, where a user is logged in already.
    pub origin: Arc<str>,
    /// The [`super::user::key`] of the typed name, known or not; `None` for an invalid name.
    pub account: Option<String>,
    /// Root and the station's own user wait, but are never locked out.
    pub never_locked: bool,
}

/// Lockouts that a failed attempt caused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LockedOut {
    /// This name has just been locked out for this origin.
    pub account: bool,
    /// The origin has just been locked out for all names.
    pub origin: bool,
}

/// All failed attempts that still count.
#[derive(Debug, Default)]
pub struct LoginAttempts {
    counts: BTreeMap<Key, Count>,
}

#[derive(Debug, Clone, Copy)]
struct Count {
    wrong: u16,
    last: Timestamp,
}

impl Count {
    /// No password is checked before.
    fn wait_until(self, key: &Key, rules: &AccessDef) -> Timestamp {
        if rules.login_attempts_max <= self.wrong && !key.never_locked {
            return later(self.last, rules.lockout);
        }
        let doubled = 1u64 << self.wrong.saturating_sub(1).min(8);
        later(self.last, Duration::from_secs(doubled).min(DELAY_MAX))
    }

    /// No failure for the length of a lockout: it no longer counts.
    fn is_over(self, rules: &AccessDef, at: Timestamp) -> bool {
        later(self.last, rules.lockout.max(DELAY_MAX)) <= at
    }
}

impl LoginAttempts {
    /// How long the next password for this key must wait; `None` if it can be checked now.
    pub fn wait(&self, key: &Key, rules: &AccessDef, at: Timestamp) -> Option<Duration> {
        let own = self.counts.get(key).map(|count| count.wait_until(key, rules));
        let until = own.max(self.origin_locked_until(key, rules, at))?;
        Duration::try_from(until.duration_since(at)).ok().filter(|wait| !wait.is_zero())
    }

    /// A successful login resets the count of this key.
    pub fn on_success(&mut self, key: &Key) {
        self.counts.remove(key);
    }

    /// Counts a failed login.
    pub fn on_failure(&mut self, key: &Key, rules: &AccessDef, at: Timestamp) -> LockedOut {
        self.forget(key, rules, at);
        let was_locked = self.origin_locked_until(key, rules, at).is_some();
        let count = self.counts.entry(key.clone()).or_insert(Count { wrong: 0, last: at });
        // An expired lockout resets the count.
        let wrong = if rules.login_attempts_max <= count.wrong && !key.never_locked { 0 } else { count.wrong };
        *count = Count { wrong: wrong.saturating_add(1), last: at };
        let account = rules.login_attempts_max == count.wrong && !key.never_locked;
        LockedOut { account, origin: !was_locked && self.origin_locked_until(key, rules, at).is_some() }
    }

    /// Until when a name is locked out for any origin.
    pub fn locked_until(&self, account: &str, rules: &AccessDef, at: Timestamp) -> Option<Timestamp> {
        let of_account = self.counts.iter().filter(|(key, count)| {
            key.account.as_deref() == Some(account) && rules.login_attempts_max <= count.wrong && !key.never_locked
        });
        of_account.map(|(key, count)| count.wait_until(key, rules)).filter(|until| at < *until).max()
    }

    /// Clears the lockouts of an account: a Supervisor enabled it, or it is another account now.
    pub fn clear(&mut self, account: &str) {
        self.counts.retain(|key, _| key.account.as_deref() != Some(account));
    }

    /// All names together were too many for this origin: until the first of them counts no more.
    fn origin_locked_until(&self, key: &Key, rules: &AccessDef, at: Timestamp) -> Option<Timestamp> {
        let of_origin = |(other, count): &(&Key, &Count)| other.origin == key.origin && !count.is_over(rules, at);
        let counts = || self.counts.iter().filter(of_origin).map(|(_, count)| count);
        let wrong: u32 = counts().map(|count| u32::from(count.wrong)).sum();
        let locked = u32::from(rules.login_attempts_max) * NAMES <= wrong && !key.never_locked;
        let until = |count: &Count| later(count.last, rules.lockout.max(DELAY_MAX));
        if locked { counts().map(until).min() } else { None }
    }

    fn forget(&mut self, new: &Key, rules: &AccessDef, at: Timestamp) {
        self.counts.retain(|_, count| !count.is_over(rules, at));
        if KEYS_MAX <= self.counts.len() && !self.counts.contains_key(new) {
            let quiet = self.counts.iter().min_by_key(|(_, count)| count.last).map(|(key, _)| key.clone());
            quiet.and_then(|key| self.counts.remove(&key));
        }
    }
}

fn later(at: Timestamp, span: Duration) -> Timestamp {
    at.saturating_add(SignedDuration::try_from(span).unwrap_or(SignedDuration::MAX)).unwrap_or(Timestamp::MAX)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn key(origin: &str, account: &str) -> Key {
        Key { origin: origin.into(), account: Some(account.to_owned()), never_locked: origin == "root" }
    }

    fn at(seconds: i64) -> Timestamp {
        Timestamp::from_second(1_000_000 + seconds).unwrap()
    }

    #[test]
    fn each_failure_delays_longer_and_the_last_locks_out() {
        let (rules, anna) = (AccessDef::default(), key("panel", "anna"));
        let mut attempts = LoginAttempts::default();
        let mut now = 0;
        for (delay, locked) in [(1, false), (2, false), (4, false), (8, false), (300, true)] {
            assert_eq!(attempts.wait(&anna, &rules, at(now)), None, "{delay}");
            let out = attempts.on_failure(&anna, &rules, at(now));
            assert_eq!(out, LockedOut { account: locked, origin: false });
            assert_eq!(attempts.wait(&anna, &rules, at(now)), Some(Duration::from_secs(delay)));
            assert_eq!(attempts.wait(&key("eve", "anna"), &rules, at(now)), None, "others are not touched");
            now += delay as i64;
        }
        assert_eq!(attempts.locked_until("anna", &rules, at(now)), None, "it is over as configured");
        assert_eq!(attempts.wait(&anna, &rules, at(now)), None);
        attempts.on_failure(&anna, &rules, at(now));
        assert_eq!(attempts.wait(&anna, &rules, at(now)), Some(Duration::from_secs(1)), "and counting starts again");
    }

    #[test]
    fn a_lockout_shorter_than_a_delay_is_over_as_configured() {
        let rules = AccessDef { login_attempts_max: 2, lockout: Duration::from_secs(5), ..AccessDef::default() };
        let (anna, mut attempts) = (key("panel", "anna"), LoginAttempts::default());
        for (now, account, wait) in [(0, false, 1), (1, true, 5), (6, false, 1), (7, true, 5)] {
            assert_eq!(attempts.wait(&anna, &rules, at(now)), None, "at {now} s");
            let out = attempts.on_failure(&anna, &rules, at(now));
            assert_eq!(out, LockedOut { account, origin: false }, "at {now} s");
            assert_eq!(attempts.wait(&anna, &rules, at(now)), Some(Duration::from_secs(wait)), "at {now} s");
        }
    }

    #[test]
    fn a_right_password_forgives_wrong_ones_for_the_same_name_only() {
        let rules = AccessDef::default();
        let mut attempts = LoginAttempts::default();
        for name in 0..39 {
            attempts.on_failure(&key("eve", &name.to_string()), &rules, at(0));
        }
        attempts.on_success(&key("eve", "me"));
        assert_eq!(attempts.on_failure(&key("eve", "boss"), &rules, at(0)), LockedOut { account: false, origin: true });
        assert_eq!(attempts.wait(&key("eve", "anybody"), &rules, at(0)), Some(Duration::from_secs(300)));
        attempts.clear("boss");
        assert_eq!(attempts.wait(&key("eve", "anybody"), &rules, at(0)), None);
    }

    #[test]
    fn names_without_end_cost_no_memory_without_end() {
        let rules = AccessDef::default();
        let mut attempts = LoginAttempts::default();
        for name in 0..10_000 {
            attempts.on_failure(&key("root", &name.to_string()), &rules, at(0));
        }
        assert_eq!(attempts.counts.len(), KEYS_MAX);
    }

    proptest! {
        #[test]
        fn no_origin_exceeds_the_attempts_during_a_lockout(
            login_attempts_max in 1u16..8, steps in prop::collection::vec((0usize..2, 0usize..20, 0i64..40), 1..400)
        ) {
            let rules = AccessDef { login_attempts_max, ..AccessDef::default() };
            let (mut attempts, mut now) = (LoginAttempts::default(), 0);
            let mut checked: Vec<(Key, i64)> = Vec::new();
            for (origin, account, later) in steps {
                now += later;
                let key = key(["eve", "mallory"][origin], &account.to_string());
                if attempts.wait(&key, &rules, at(now)).is_none() {
                    attempts.on_failure(&key, &rules, at(now));
                    checked.push((key, now));
                }
            }
            for (place, (key, from)) in checked.iter().enumerate() {
                let inside = || checked[place..].iter().take_while(|(_, t)| *t < from + 300);
                let of_key = inside().filter(|(other, _)| other == key).count();
                let of_origin = inside().filter(|(other, _)| other.origin == key.origin).count();
                prop_assert!(of_key <= usize::from(login_attempts_max), "{of_key} attempts in five minutes");
                prop_assert!(of_origin <= usize::from(login_attempts_max) * NAMES as usize, "{of_origin} attempts in five minutes");
            }
        }
    }
}
