//! Which records are dropped when the store fails for long, and what is said of the archive.

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
        identity: None,
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

#[test]
fn a_failing_archive_and_a_missing_file_are_said_once_each() {
    let mut writer = Writer { damaged: Some("missing of its archive: raw/1".into()), ..Writer::default() };
    writer.archived(Err(HistoryError::Engine("no space left".into())));
    assert!(writer.status().unarchived.as_ref().is_some_and(|words| words.starts_with("it is not archived: ")));
    let damaged = |writer: &Writer| writer.status().damaged.clone().unwrap_or_default();
    writer.archived(Ok(ArchiveOutcome::Idle(Some("missing of its archive: raw/1".into()))));
    assert_eq!((writer.status().unarchived.as_ref(), &*damaged(&writer)), (None, "missing of its archive: raw/1"));
    writer.archived(Ok(ArchiveOutcome::Idle(Some("missing of its archive: m1/2".into()))));
    assert_eq!(damaged(&writer), "missing of its archive: m1/2; missing of its archive: raw/1");
    writer.archived(Ok(ArchiveOutcome::Idle(None)));
    assert_eq!(damaged(&writer), "missing of its archive: raw/1");
}

#[test]
fn what_is_missing_is_known_after_the_log_was_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut writer = Writer::open(folder.path().join("h.duckdb"), Arc::default(), sec(0)).expect("a store");
    assert!(writer.take_restored().is_some_and(|restored| restored.entries.is_some()));
    assert_eq!(writer.unstored(), None, "the log may have more");
    writer.completed();
    assert_eq!(writer.unstored(), Some(0));
}
