//! Keys and keywords of earlier versions, each with the name it has now.

use super::diagnostic::Problem;

/// Table as its messages name it (of a keyword: the kind of keyword), old spelling, new spelling.
const RENAMED: &[(&str, &str, &str)] = &[
    ("access", "tries_max", "login_attempts_max"),
    ("access", "lock_out", "lockout"),
    ("a tag", "sign", "reauthenticate"),
    ("reauthenticate", "second person", "second user"),
    ("access", "view", "anonymous_view"),
    ("access", "notice", "banner"),
    ("a fault", "SV-1 stuck shut", "SV-1 stuck closed"),
    ("a fault", "SV-2 stuck shut", "SV-2 stuck closed"),
    ("a line on a serial port", "gap_ms", "request_gap_ms"),
    ("a line on a serial port", "idle_ms", "frame_timeout_ms"),
    ("a line over TCP", "gap_ms", "request_gap_ms"),
    ("a line over TCP", "idle_ms", "frame_timeout_ms"),
    ("limits", "gap_ms", "request_gap_ms"),
    ("limits", "gap_words_max", "gap_registers_max"),
    ("limits", "read_words_max", "read_registers_max"),
    ("limits", "write_words_max", "write_registers_max"),
    ("the scenario", "about", "description"),
    ("the scenario", "ahead", "warm_up"),
    ("an event", "mended", "clear"),
    ("an expectation", "shown_true", "displayed_within"),
    ("an expectation", "give", "tolerance"),
    ("simulate", "wander", "oscillate"),
    ("simulate", "leg", "reactive"),
    ("simulate", "per", "time_base"),
    ("an alarm", "respond", "response_time"),
    ("alarm event", "returned", "RTN"),
    ("alarm event", "raised again", "re-alarmed"),
    ("alarm event", "suppressed", "suppressed by design"),
    ("alarm event", "released", "unsuppressed"),
    ("an alarm", "text", "message"),
    ("an alarm", "note", "ack_comment"),
    ("an interlock", "text", "message"),
    ("an expectation", "text", "message"),
    ("an operator action", "text", "message"),
    ("an expectation", "step", "event"),
    ("the rules for alarms", "burst", "first_out_window"),
    ("a tag", "class", "poll_class"),
    ("the mimic", "item", "picture"),
    ("poll class", "hard", "critical"),
    ("poll class", "soft", "normal"),
    ("poll class", "idle", "background"),
];

/// The name that a key or keyword has now, if it had another one.
pub(super) fn new_name(table: &str, old: &str) -> Option<&'static str> {
    RENAMED.iter().find(|row| row.0 == table && row.1 == old).map(|row| row.2)
}

/// The old names of a key.
pub(super) fn old_names(table: &str, new: &str) -> impl Iterator<Item = &'static str> {
    RENAMED.iter().filter(move |row| row.0 == table && row.2 == new).map(|row| row.1)
}

/// Offers the new name of an old key or keyword, otherwise the nearest of the known ones.
pub(crate) fn offer(problem: &mut Problem, table: &str, word: &str, known: &[&str]) {
    match new_name(table, word) {
        Some(new) => problem.message(format!("`{word}` is now `{new}`")).label(format!("write `{new}`")),
        None => problem.suggest(word, known.iter().copied()),
    };
}

#[cfg(test)]
mod tests {
    use super::{
        super::tests::{METER, PLANT, PLC, load},
        *,
    };

    #[test]
    fn an_old_key_is_answered_with_the_new_one() {
        let plant = PLANT.replace("deadband = 1.0", "respond = \"5 min\"");
        let errors = load(plant.as_bytes(), METER, PLC).expect_err("the key is an old one");
        let lines: Vec<String> = errors.full_lines().collect();
        assert_eq!(lines, ["small.toml:27:1: `respond` is now `response_time` (write `response_time`)"]);
    }

    #[test]
    fn every_renamed_key_of_the_schema_has_its_new_name_there() {
        let schema =
            concat!(include_str!("schema.rs"), include_str!("schema/device.rs"), include_str!("schema/alarm.rs"));
        for (table, old, new) in RENAMED {
            let Some((_, keys)) = schema.split_once(&format!("\"{table}\" {{")) else { continue };
            let keys = keys.split("\n\n").next().expect("a split has a first part");
            assert!(keys.contains(&format!("\"{new}\" ")), "{table} has no `{new}`");
            assert!(!keys.contains(&format!("\"{old}\" ")), "{table} still has `{old}`");
        }
    }
}
