//! Wrong passwords: counted for each name and each user of the operating system who tried it, so that no user locks out another.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

use crate::plant::role::AccessDef;

/// After a wrong password the next one waits a second, after each further one twice as long, but no longer than this.
const DELAY_MAX: Duration = Duration::from_secs(16);
/// Keys that are remembered; those that were quiet longest are forgotten first.
const KEYS_MAX: usize = 1024;
/// One user of the operating system has so many times the tries of one name for all names together.
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

/// What a wrong try has led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LockedOut {
    /// This name has just been locked out for this origin.
    pub account: bool,
    /// The origin has just been locked out for all names.
    pub origin: bool,
}

/// All wrong tries that still count.
#[derive(Debug, Default)]
pub struct Tries {
    counts: BTreeMap<Key, Count>,
}

#[derive(Debug, Clone, Copy)]
struct Count {
    wrong: u16,
    last: Timestamp,
}

impl Count {
    /// No password is looked at before.
    fn wait_until(self, key: &Key, rules: &AccessDef) -> Timestamp {
        if rules.tries_max <= self.wrong && !key.never_locked {
            return later(self.last, rules.lock_out);
        }
        let doubled = 1u64 << self.wrong.saturating_sub(1).min(8);
        later(self.last, Duration::from_secs(doubled).min(DELAY_MAX))
    }

    /// Quiet for as long as a lock-out lasts: it counts no more.
    fn is_over(self, rules: &AccessDef, at: Timestamp) -> bool {
        later(self.last, rules.lock_out.max(DELAY_MAX)) <= at
    }
}

impl Tries {
    /// How long the next password for this key must wait; `None` if it can be looked at now.
    pub fn wait(&self, key: &Key, rules: &AccessDef, at: Timestamp) -> Option<Duration> {
        let own = self.counts.get(key).map(|count| count.wait_until(key, rules));
        let until = own.max(self.origin_locked_until(key, rules, at))?;
        Duration::try_from(until.duration_since(at)).ok().filter(|wait| !wait.is_zero())
    }

    /// The password was right: what was wrong before for this name counts no more here.
    pub fn right(&mut self, key: &Key) {
        self.counts.remove(key);
    }

    /// The name or the password was wrong.
    pub fn wrong(&mut self, key: &Key, rules: &AccessDef, at: Timestamp) -> LockedOut {
        self.forget(key, rules, at);
        let was_locked = self.origin_locked_until(key, rules, at).is_some();
        let count = self.counts.entry(key.clone()).or_insert(Count { wrong: 0, last: at });
        // A lock-out that is over was the end of these tries.
        let wrong = if rules.tries_max <= count.wrong && !key.never_locked { 0 } else { count.wrong };
        *count = Count { wrong: wrong.saturating_add(1), last: at };
        let account = rules.tries_max == count.wrong && !key.never_locked;
        LockedOut { account, origin: !was_locked && self.origin_locked_until(key, rules, at).is_some() }
    }

    /// Until when a name is locked out for any origin.
    pub fn locked_until(&self, account: &str, rules: &AccessDef, at: Timestamp) -> Option<Timestamp> {
        let of_account = self.counts.iter().filter(|(key, count)| {
            key.account.as_deref() == Some(account) && rules.tries_max <= count.wrong && !key.never_locked
        });
        of_account.map(|(key, count)| count.wait_until(key, rules)).filter(|until| at < *until).max()
    }

    /// A Supervisor ends the lock-outs of a name, or it is another account now.
    pub fn pardon(&mut self, account: &str) {
        self.counts.retain(|key, _| key.account.as_deref() != Some(account));
    }

    /// All names together were too many for this origin: until the first of them counts no more.
    fn origin_locked_until(&self, key: &Key, rules: &AccessDef, at: Timestamp) -> Option<Timestamp> {
        let of_origin = |(other, count): &(&Key, &Count)| other.origin == key.origin && !count.is_over(rules, at);
        let counts = || self.counts.iter().filter(of_origin).map(|(_, count)| count);
        let wrong: u32 = counts().map(|count| u32::from(count.wrong)).sum();
        let locked = u32::from(rules.tries_max) * NAMES <= wrong && !key.never_locked;
        let until = |count: &Count| later(count.last, rules.lock_out.max(DELAY_MAX));
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
    fn one_waits_longer_after_each_wrong_password_and_is_locked_out_at_last() {
        let (rules, anna) = (AccessDef::default(), key("panel", "anna"));
        let mut tries = Tries::default();
        let mut now = 0;
        for (delay, locked) in [(1, false), (2, false), (4, false), (8, false), (300, true)] {
            assert_eq!(tries.wait(&anna, &rules, at(now)), None, "{delay}");
            let out = tries.wrong(&anna, &rules, at(now));
            assert_eq!(out, LockedOut { account: locked, origin: false });
            assert_eq!(tries.wait(&anna, &rules, at(now)), Some(Duration::from_secs(delay)));
            assert_eq!(tries.wait(&key("eve", "anna"), &rules, at(now)), None, "others are not touched");
            now += delay as i64;
        }
        assert_eq!(tries.locked_until("anna", &rules, at(now)), None, "it is over as configured");
        assert_eq!(tries.wait(&anna, &rules, at(now)), None);
        tries.wrong(&anna, &rules, at(now));
        assert_eq!(tries.wait(&anna, &rules, at(now)), Some(Duration::from_secs(1)), "and counting starts again");
    }

    #[test]
    fn a_right_password_forgives_wrong_ones_for_the_same_name_only() {
        let rules = AccessDef::default();
        let mut tries = Tries::default();
        for name in 0..39 {
            tries.wrong(&key("eve", &name.to_string()), &rules, at(0));
        }
        tries.right(&key("eve", "me"));
        assert_eq!(tries.wrong(&key("eve", "boss"), &rules, at(0)), LockedOut { account: false, origin: true });
        assert_eq!(tries.wait(&key("eve", "anybody"), &rules, at(0)), Some(Duration::from_secs(300)));
        tries.pardon("boss");
        assert_eq!(tries.wait(&key("eve", "anybody"), &rules, at(0)), None);
    }

    #[test]
    fn names_without_end_cost_no_memory_without_end() {
        let rules = AccessDef::default();
        let mut tries = Tries::default();
        for name in 0..10_000 {
            tries.wrong(&key("root", &name.to_string()), &rules, at(0));
        }
        assert_eq!(tries.counts.len(), KEYS_MAX);
    }

    proptest! {
        #[test]
        fn no_origin_has_more_tries_than_permitted_in_a_lock_out(
            tries_max in 1u16..8, steps in prop::collection::vec((0usize..2, 0usize..20, 0i64..40), 1..400)
        ) {
            let rules = AccessDef { tries_max, ..AccessDef::default() };
            let (mut tries, mut now) = (Tries::default(), 0);
            let mut looked_at: Vec<(Key, i64)> = Vec::new();
            for (origin, account, later) in steps {
                now += later;
                let key = key(["eve", "mallory"][origin], &account.to_string());
                if tries.wait(&key, &rules, at(now)).is_none() {
                    tries.wrong(&key, &rules, at(now));
                    looked_at.push((key, now));
                }
            }
            for (place, (key, from)) in looked_at.iter().enumerate() {
                let inside = || looked_at[place..].iter().take_while(|(_, t)| *t < from + 300);
                let of_key = inside().filter(|(other, _)| other == key).count();
                let of_origin = inside().filter(|(other, _)| other.origin == key.origin).count();
                prop_assert!(of_key <= usize::from(tries_max), "{of_key} tries in five minutes");
                prop_assert!(of_origin <= usize::from(tries_max) * NAMES as usize, "{of_origin} tries in five minutes");
            }
        }
    }
}
