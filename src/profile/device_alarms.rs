//! The alarms that a profile has for each device of its kind: faults that the maker has defined. The plant file may give each
//! another priority, or none, and its own alarm of the same condition stands instead.

use super::{
    diagnostic::{Problems, Span},
    names::Scope,
    reader::{At, Node, Raw, Value},
    schema::{AlarmTable, Priorities},
};

/// The alarms of a device, as a plant file would write them, with the priorities that its plant file gives them.
pub(super) fn of_device(
    rows: &[At<Raw>],
    priorities: &Option<At<Priorities>>,
    of: &Scope,
    problems: &mut Problems,
) -> Vec<At<AlarmTable>> {
    let own: Vec<_> = priorities.iter().flat_map(|priorities| &priorities.value.0).collect();
    problems.of_row(Some(format!("of {}", of.device)));
    let mut known = Vec::new();
    let mut alarms = Vec::new();
    for row in rows {
        for raw in each(row, of, problems) {
            let called = [text_of(&raw, "id"), text_of(&raw, "message")];
            let called: Vec<String> = called.into_iter().flatten().map(|(text, _)| text).collect();
            let priority = own.iter().find(|(name, _)| called.contains(&name.value)).map(|(_, priority)| priority);
            known.extend(called);
            let mut raw = of_this_device(raw, of.device);
            match priority.map(|priority| (priority.value.0, priority.at)) {
                Some((None, _)) => continue,
                Some((Some(priority), at)) => put(&mut raw, "priority", Node::Text(priority.word().to_owned()), at),
                None => {}
            }
            alarms.push(At { value: AlarmTable::of(&[raw], problems), at: row.at });
        }
    }
    problems.of_row(None);
    for (name, _) in own {
        if !known.contains(&name.value) {
            problems.unknown("alarm", name, known.iter().map(String::as_str));
        }
    }
    alarms
}

/// A row, or with `each` one for each named bit or number of its tag but those in `except`.
fn each(row: &At<Raw>, of: &Scope, problems: &mut Problems) -> Vec<Raw> {
    let mut raw = row.value.clone();
    let except = raw.table.remove("except");
    let Some((_, At { value: each, at })) = raw.table.remove("each") else {
        if let Some((at, _)) = except {
            problems.add(at, "`except` is for `each`").label("leave it out");
        }
        return vec![raw];
    };
    let Some(word) = String::read(&each, at, problems) else { return Vec::new() };
    let key = match word.as_str() {
        "bit" => "bit",
        "code" => "is",
        _ => {
            problems.add(at, format!("unknown each `{word}`")).label("expected \"bit\" or \"code\"");
            return Vec::new();
        }
    };
    let tag = text_of(&raw, "tag").and_then(|(name, at)| {
        let tag = of.names.near(&At { value: name, at }, of.device, problems)?;
        of.tags.get(tag.index())
    });
    let Some(tag) = tag else { return Vec::new() };
    let named: Vec<(i128, &str)> = match key {
        "bit" => tag.bit_labels.iter().map(|(bit, label)| (i128::from(*bit), label.as_str())).collect(),
        _ => tag.enum_labels.iter().map(|(number, label)| (*number, label.as_str())).collect(),
    };
    if named.is_empty() {
        let needed = if key == "bit" { "bits" } else { "enum" };
        problems.add(at, format!("{} names none", tag.name)).label(format!("expected a tag with `{needed}`"));
    }
    let is_left_out = |number: i128| match &except {
        Some((_, At { value: Node::Array(items), .. })) => {
            items.iter().any(|item| matches!(item.value, Node::Whole(left) if left == number))
        }
        _ => false,
    };
    let one = |(number, label): (i128, &str)| {
        let mut raw = raw.clone();
        put(&mut raw, key, Node::Whole(number), at);
        let message = text_of(&raw, "message").map_or_else(|| label.to_owned(), |(text, _)| text.replace("{n}", label));
        put(&mut raw, "message", Node::Text(message), at);
        if let Some((id, _)) = text_of(&raw, "id") {
            put(&mut raw, "id", Node::Text(format!("{id}-{number}")), at);
        }
        raw
    };
    named.into_iter().filter(|(number, _)| !is_left_out(*number)).map(one).collect()
}

/// The names of a profile become those of a plant.
fn of_this_device(mut raw: Raw, device: &str) -> Raw {
    for key in ["tag", "from"] {
        if let Some((text, at)) = text_of(&raw, key) {
            put(&mut raw, key, Node::Text(format!("{device}.{text}")), at);
        }
    }
    if let Some((id, at)) = text_of(&raw, "id") {
        put(&mut raw, "id", Node::Text(format!("{device}.{id}")), at);
    }
    raw
}

fn text_of(raw: &Raw, key: &str) -> Option<(String, Span)> {
    match raw.table.get(key) {
        Some((_, At { value: Node::Text(text), at })) => Some((text.clone(), *at)),
        _ => None,
    }
}

fn put(raw: &mut Raw, key: &str, value: Node, at: Span) {
    raw.table.insert(key.to_owned(), (at, At { value, at }));
}
