//! How alarms stood at an instant, by the events of the journal. `before` is the condition for what was stored until then.

use crate::{
    history::io::stored::Stored,
    plant::record::{AlarmEvent, AlarmRecord},
};

/// The raising events of the alarms that were active at an instant, also of those that were suppressed.
pub fn active_at(before: &str) -> String {
    raised_at(before, |_| false, |event| event.active() == Some(true))
}

/// The raising events of the alarms that were active at an instant and have not been suppressed since.
pub fn standing_at(before: &str) -> String {
    let annunciated = |event| matches!(event, AlarmEvent::Raised | AlarmEvent::CarriedOver);
    raised_at(before, |event| event.ended_by().is_some(), annunciated)
}

/// The alarms whose latest event before an instant is one of these. Events that raise or end an alarm count, and `others`.
fn raised_at(before: &str, others: impl Fn(AlarmEvent) -> bool, is: impl Fn(AlarmEvent) -> bool) -> String {
    let columns = AlarmRecord::columns();
    let (counts, is) = (words(|event| event.active().is_some() || others(event)), words(is));
    format!(
        "SELECT {columns} FROM (
            SELECT *, rowid AS place FROM alarm_journal WHERE {before} AND event IN ({counts})
            QUALIFY row_number() OVER (PARTITION BY subject, message ORDER BY epoch DESC, utc DESC, rowid DESC) = 1)
         WHERE event IN ({is}) ORDER BY utc, place LIMIT ?"
    )
}

/// The events that suppressed an alarm at an instant, each for itself.
pub fn suppressing_at(before: &str) -> String {
    let columns = AlarmRecord::columns();
    let pair = |event: AlarmEvent| Some(format!("('{}', '{}')", event.word(), event.ended_by()?.word()));
    let pairs: Vec<String> = AlarmEvent::ALL.into_iter().filter_map(pair).collect();
    let (pairs, removed) = (pairs.join(", "), AlarmEvent::Removed.word());
    format!(
        "SELECT {columns} FROM (
            SELECT alarm_journal.*, alarm_journal.rowid AS place, suppresses
            FROM alarm_journal, (VALUES {pairs}) AS pair(suppresses, ends)
            WHERE {before} AND event IN (suppresses, ends, '{removed}')
            QUALIFY row_number()
                OVER (PARTITION BY subject, message, suppresses ORDER BY epoch DESC, utc DESC, alarm_journal.rowid DESC) = 1)
         WHERE event = suppresses ORDER BY utc, place LIMIT ?"
    )
}

/// The alarms that have an event at an instant or later, by their names.
pub fn named_since(before: &str) -> String {
    format!("SELECT DISTINCT subject, message FROM alarm_journal WHERE NOT ({before}) LIMIT ?")
}

fn words(is: impl Fn(AlarmEvent) -> bool) -> String {
    let words = AlarmEvent::ALL.into_iter().filter(|event| is(*event)).map(|event| format!("'{}'", event.word()));
    words.collect::<Vec<_>>().join(", ")
}
