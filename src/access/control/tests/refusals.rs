//! Refusals on record: the first of a user each for itself, further ones as a number each minute.

use super::*;

impl Bench {
    /// So many refusals of a user of the operating system. Gives how many of them have an entry of their own.
    fn refuse(&mut self, user: &str, times: usize) -> usize {
        (0..times).filter(|_| self.access.may_record(&user.into(), self.now)).count()
    }
}

#[test]
fn refusals_without_an_entry_are_summed_up_each_minute() {
    let mut bench = Bench::new(AccessDef::default());
    assert_eq!((bench.refuse("quiet", 1), bench.refuse("evil", 21)), (1, 20));
    assert_eq!(bench.later(59), []);
    let effects = bench.later(1);
    let [Effect::Record(entry)] = &effects[..] else { panic!("{effects:?}") };
    assert_eq!((&*entry.from, &*entry.outcome), ("user evil", "refused: 1 requests"));
    assert_eq!(bench.later(60), [], "there were none since");
}

/// As many users as are counted separately, each with a refusal; one has too many to be recorded.
fn crowded() -> Bench {
    let mut bench = Bench::new(AccessDef::default());
    for user in 0..512 {
        let times = if user == 7 { 21 } else { 1 };
        assert_eq!(bench.refuse(&format!("user {user}"), times), times.min(20));
    }
    assert_eq!(bench.access.refusals.len(), 512, "each has a count of its own");
    bench
}

#[test]
fn refusals_of_further_users_share_one_count() {
    let mut bench = crowded();
    bench.now += jiff::SignedDuration::from_secs(59);
    for user in ["late", "later", "user 3"] {
        bench.refuse(user, 1);
    }
    assert_eq!(bench.access.refusals.len(), 513);
    assert!(bench.access.refusals.contains_key("of many users"));
}

#[test]
fn users_whose_refusals_are_all_recorded_make_room() {
    let mut bench = crowded();
    bench.now += jiff::SignedDuration::from_secs(60);
    bench.refuse("late", 1);
    let users: Vec<&str> = bench.access.refusals.keys().map(|user| &**user).collect();
    assert_eq!(users, ["late", "user 7"], "what is not recorded yet stays counted");
}

#[test]
fn a_refusal_of_another_user_gives_no_one_new_entries() {
    let mut bench = Bench::new(AccessDef::default());
    bench.refuse("evil", 1);
    bench.now += jiff::SignedDuration::from_secs(60);
    assert_eq!(bench.refuse("evil", 20), 20);
    bench.refuse("other", 1);
    assert_eq!(bench.refuse("evil", 1), 0);
}
