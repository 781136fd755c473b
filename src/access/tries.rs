//! Wrong passwords: they are counted for each account and for each place they come from, and too many lock both out for a while.

use std::{collections::BTreeMap, fmt, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

use crate::plant::role::AccessDef;

/// After a wrong password the place waits a second, after each further one twice as long, but no longer than this.
const DELAY_MAX: Duration = Duration::from_secs(16);
/// Places that are remembered; those that were quiet longest are forgotten first.
const ORIGINS_MAX: usize = 512;
/// All places of one user of the operating system together have so many times the tries of one of them.
const PLACES: u16 = 8;

/// Whom an attempt is counted for: the [`super::user::key`] of an account, or `None` for a name that nobody has.
pub type Account<'a> = Option<&'a str>;

/// All wrong tries that still count.
#[derive(Debug, Default)]
pub struct Tries {
    accounts: BTreeMap<String, Count>,
    origins: BTreeMap<Origin, Place>,
    users: BTreeMap<Arc<str>, Count>,
}

/// Where a password comes from.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    /// The user of the operating system: the system says it, nobody can make it up.
    pub user: Arc<str>,
    /// The host, as the terminal says it. One that lies has another one each time, and is stopped by what its user has left.
    pub host: Arc<str>,
}

impl Origin {
    /// One terminal there by itself: where whoever sits at it is asked for his password again.
    pub fn of_seat(&self, terminal: u32) -> Origin {
        Origin { user: format!("{} at terminal {terminal}", self.user).into(), host: self.host.clone() }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} from {}", self.user, self.host)
    }
}

#[derive(Debug, Default)]
struct Count {
    wrong: u16,
    last: Timestamp,
    locked_until: Option<Timestamp>,
}

impl Count {
    /// One more wrong try; `true` if it is one too many, and locks out until then.
    fn one(&mut self, most: u16, until: Timestamp, at: Timestamp) -> bool {
        // A lock-out is not made longer by those who go on: they could shut somebody out for ever.
        if self.locked_until.is_some_and(|until| at < until) {
            return false;
        }
        if self.locked_until.take().is_some() {
            self.wrong = 0;
        }
        (self.wrong, self.last) = (self.wrong.saturating_add(1), at);
        if most <= self.wrong {
            self.locked_until = Some(until);
        }
        most <= self.wrong
    }
}

#[derive(Debug)]
struct Place {
    /// For whom each wrong try was: never more than lock it out.
    wrong: Vec<Option<String>>,
    last: Timestamp,
    wait_until: Timestamp,
    /// A password from here is just being looked at.
    busy: bool,
}

/// What a wrong try has led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LockedOut {
    /// The account has just been locked out.
    pub account: bool,
    /// The place has just been locked out.
    pub origin: bool,
}

impl Tries {
    /// May a password be tried from here now? `Err` is how long to wait. Only one is looked at a time: who is let through
    /// must come back to [`Tries::right`] or [`Tries::wrong`].
    pub fn begin(&mut self, origin: &Origin, rules: &AccessDef, at: Timestamp) -> Result<(), Duration> {
        self.forget(rules, at);
        let user = self.users.get(&origin.user).and_then(|user| user.locked_until).unwrap_or(at);
        let place = self.origins.entry(origin.clone()).or_insert_with(|| Place {
            wrong: Vec::new(),
            last: at,
            wait_until: at,
            busy: false,
        });
        if place.busy {
            return Err(Duration::from_secs(1));
        }
        let until = place.wait_until.max(user);
        if at < until {
            return Err(Duration::try_from(until.duration_since(at)).unwrap_or_default());
        }
        (place.busy, place.last) = (true, at);
        Ok(())
    }

    /// The password could not be looked at.
    pub fn end(&mut self, origin: &Origin) {
        if let Some(place) = self.origins.get_mut(origin) {
            place.busy = false;
        }
    }

    /// The password was right: what was wrong before for this account counts no more.
    pub fn right(&mut self, origin: &Origin, account: &str) {
        self.accounts.remove(account);
        if let Some(place) = self.origins.get_mut(origin) {
            place.busy = false;
            place.wrong.retain(|wrong| wrong.as_deref() != Some(account));
        }
    }

    /// The name or the password was wrong.
    pub fn wrong(&mut self, origin: &Origin, account: Account, rules: &AccessDef, at: Timestamp) -> LockedOut {
        let until = at.saturating_add(span(rules.lock_out)).unwrap_or(Timestamp::MAX);
        let mut locked = LockedOut::default();
        if let Some(account) = account {
            let count = self.accounts.entry(account.to_owned()).or_default();
            locked.account = count.one(rules.tries_max, until, at);
        }
        let user = self.users.entry(origin.user.clone()).or_default();
        locked.origin = user.one(rules.tries_max.saturating_mul(PLACES), until, at);
        if let Some(place) = self.origins.get_mut(origin) {
            place.busy = false;
            place.last = at;
            place.wrong.push(account.map(str::to_owned));
            if usize::from(rules.tries_max) <= place.wrong.len() {
                place.wrong.clear();
                place.wait_until = until;
                locked.origin = true;
            } else {
                let doubled = 1u64 << (place.wrong.len() - 1).min(8);
                let delay = Duration::from_secs(doubled).min(DELAY_MAX);
                place.wait_until = at.saturating_add(span(delay)).unwrap_or(Timestamp::MAX);
            }
        }
        locked
    }

    /// Until when an account is locked out.
    pub fn locked_until(&self, account: &str, at: Timestamp) -> Option<Timestamp> {
        self.accounts.get(account)?.locked_until.filter(|until| at < *until)
    }

    /// How long one must still wait at this place.
    pub fn wait(&self, origin: &Origin, at: Timestamp) -> Option<Duration> {
        let place = self.origins.get(origin).map(|place| place.wait_until);
        let user = self.users.get(&origin.user).and_then(|user| user.locked_until);
        Duration::try_from(place.max(user)?.duration_since(at)).ok().filter(|wait| !wait.is_zero())
    }

    /// A Supervisor ends the lock-out of an account, or it is another account now.
    pub fn pardon(&mut self, account: &str) {
        self.accounts.remove(account);
    }

    /// Places that have been quiet for as long as a lock-out lasts are as new.
    fn forget(&mut self, rules: &AccessDef, at: Timestamp) {
        let old = at.saturating_sub(span(rules.lock_out.max(DELAY_MAX))).unwrap_or(Timestamp::MIN);
        self.users.retain(|_, user| old < user.last || user.locked_until.is_some_and(|until| at < until));
        self.origins.retain(|_, place| place.busy || at < place.wait_until || old < place.last);
        if ORIGINS_MAX <= self.origins.len() {
            let quiet = self.origins.iter().filter(|(_, place)| !place.busy).min_by_key(|(_, place)| place.last);
            if let Some(origin) = quiet.map(|(origin, _)| origin.clone()) {
                self.origins.remove(&origin);
            }
        }
    }
}

fn span(span: Duration) -> SignedDuration {
    SignedDuration::try_from(span).unwrap_or(SignedDuration::MAX)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn from(host: &str) -> Origin {
        Origin { user: "panel".into(), host: host.into() }
    }

    fn at(seconds: i64) -> Timestamp {
        Timestamp::from_second(1_000_000 + seconds).unwrap()
    }

    #[test]
    fn one_waits_longer_after_each_wrong_password_and_is_locked_out_at_last() {
        let (rules, here) = (AccessDef::default(), from("here"));
        let mut tries = Tries::default();
        let mut now = 0;
        for (delay, locked) in [(1, false), (2, false), (4, false), (8, false), (300, true)] {
            assert_eq!(tries.begin(&here, &rules, at(now)), Ok(()), "{delay}");
            let out = tries.wrong(&here, Some("anna"), &rules, at(now));
            assert_eq!(out, LockedOut { account: locked, origin: locked });
            assert_eq!(tries.begin(&here, &rules, at(now)), Err(Duration::from_secs(delay)));
            now += delay as i64;
        }
        assert_eq!(tries.locked_until("anna", at(now)), None, "it is over as configured");
        assert_eq!(tries.begin(&here, &rules, at(now)), Ok(()));
    }

    #[test]
    fn a_terminal_that_tries_every_account_is_locked_out_though_no_account_is() {
        let (rules, here) = (AccessDef::default(), from("here"));
        let mut tries = Tries::default();
        let names = ["a", "b", "c", "d", "e"];
        for (place, name) in names.iter().enumerate() {
            tries.begin(&here, &rules, at(place as i64 * 20)).unwrap();
            tries.wrong(&here, Some(name), &rules, at(place as i64 * 20));
        }
        assert!(tries.begin(&here, &rules, at(120)).is_err());
        assert!(names.iter().all(|name| tries.locked_until(name, at(120)).is_none()));
        assert_eq!(tries.begin(&from("there"), &rules, at(120)), Ok(()), "other terminals are not touched");
    }

    #[test]
    fn an_own_right_password_does_not_wash_away_the_tries_for_others() {
        let (rules, here) = (AccessDef::default(), from("here"));
        let mut tries = Tries::default();
        for round in 0..5 {
            let now = at(round * 20);
            tries.begin(&here, &rules, now).unwrap();
            tries.wrong(&here, Some("boss"), &rules, now);
            if tries.begin(&here, &rules, at(round * 20 + 19)).is_ok() {
                tries.right(&here, "me");
            }
        }
        assert!(tries.begin(&here, &rules, at(110)).is_err());
    }

    #[test]
    fn a_terminal_that_says_it_is_another_one_each_time_is_locked_out_too() {
        let rules = AccessDef::default();
        let mut tries = Tries::default();
        let host = |n: u32| from(&format!("10.0.0.{n}"));
        let looked_at = (0..1_000).filter(|n| {
            let begun = tries.begin(&host(*n), &rules, at(0)).is_ok();
            begun.then(|| tries.wrong(&host(*n), None, &rules, at(0))).is_some()
        });
        assert_eq!(looked_at.count(), 40);
        assert_eq!(tries.wait(&host(5_000), at(0)), Some(Duration::from_secs(300)));
        let other = Origin { user: "anna".into(), host: "here".into() };
        assert_eq!(tries.begin(&other, &rules, at(0)), Ok(()), "other users of the system are not touched");
        assert_eq!(tries.begin(&from("here"), &rules, at(300)), Ok(()));
    }

    proptest! {
        #[test]
        fn a_script_never_has_more_tries_than_permitted_in_a_lock_out(
            tries_max in 1u16..8, steps in prop::collection::vec((0usize..3, 0usize..3, 0i64..40), 1..200)
        ) {
            let rules = AccessDef { tries_max, ..AccessDef::default() };
            let origins = ["x", "y", "z"].map(from);
            let (mut tries, mut now) = (Tries::default(), 0);
            let mut looked_at: Vec<(usize, i64)> = Vec::new();
            for (origin, account, later) in steps {
                now += later;
                if tries.begin(&origins[origin], &rules, at(now)).is_ok() {
                    tries.wrong(&origins[origin], Some(["a", "b", "c"][account]), &rules, at(now));
                    looked_at.push((origin, now));
                }
            }
            for (origin, from) in &looked_at {
                let inside = looked_at.iter().filter(|(o, t)| o == origin && (*from..*from + 300).contains(t)).count();
                prop_assert!(inside <= usize::from(tries_max), "{inside} tries in five minutes");
            }
        }
    }
}
