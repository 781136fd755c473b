//! Which records are dropped when the store fails for long.

use super::*;
use crate::{
    plant::{
        def::{Priority, TagId},
        record::{AlarmEvent, AlarmRecord},
        sample::Sample,
    },
    report::testing::sec,
};

fn sample(at: i64) -> Record {
    Record::Sample(TagId(0), Sample::good(1.0, sec(at)))
}

fn alarm(at: i64) -> Record {
    Record::Alarm(AlarmRecord {
        at: sec(at),
        subject: "TIC-1.PV".into(),
        message: "high".into(),
        priority: Priority::High,
        event: AlarmEvent::Raised,
        value: None,
        limit: None,
        by: None,
        reason: None,
        until: None,
        first_out: None,
    })
}

fn check(mut pending: Vec<Record>, expect: Vec<Record>) {
    let all = pending.len();
    let lost = shed(&mut pending, 4);
    assert_eq!(pending, expect);
    assert_eq!(lost as usize, all - pending.len());
}

#[test]
fn the_oldest_samples_are_dropped_before_alarms() {
    check(vec![], vec![]);
    check((0..4).map(sample).collect(), (0..4).map(sample).collect());
    check((0..5).map(sample).collect(), (2..5).map(sample).collect());
    check(vec![alarm(0), sample(1), sample(2), sample(3), alarm(4)], vec![alarm(0), sample(3), alarm(4)]);
    check(vec![alarm(0), alarm(1), sample(2), alarm(3), alarm(4)], vec![alarm(1), alarm(3), alarm(4)]);
}
