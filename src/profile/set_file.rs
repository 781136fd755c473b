//! The file of a parameter set: written to be read by people, and checked like a profile when it is read.

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, sync::Arc};

use jiff::Timestamp;
use sha2::{Digest, Sha256};

use super::{
    diagnostic::Problems,
    names::{check_held, exact_of},
    reader::{self, At, Choice, Node, Raw, Value, text, toml_tables},
};
use crate::plant::{
    def::PlantDef,
    exact::{Exact, digits},
    parameter_set::{ParameterSet, SetValue},
    tag::{Decimals, TagDef},
    visible::is_control_or_bidi,
};

toml_tables! {
    /// The file of a parameter set.
    SetTable, "the parameter set" {
        need "device" device: String,
        need "profile" profile: String,
        need "saved" saved: Moment,
        need "by" by: String,
        opt "check" check: String,
        list "missing" missing: String,
        opt "units" units: Raw,
        opt "given" given: Raw,
        need "values" values: Raw,
    }
}

/// An instant, as TOML or RFC 3339 writes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment(Timestamp);

impl Value for Moment {
    fn read(value: &Node, at: super::diagnostic::Span, problems: &mut Problems) -> Option<Self> {
        let parsed = match value {
            Node::Text(text) | Node::Time(text) => text.parse().ok(),
            Node::Whole(_) | Node::Number(_) | Node::Flag(_) | Node::Array(_) | Node::Table(_) => None,
        };
        if parsed.is_none() {
            problems.add(at, "not a time").label("expected 2026-11-21T07:02:31Z");
        }
        parsed.map(Moment)
    }
}

/// How the line begins that says what the rest of the file is, after its first line.
const CHECK: &str = "check = ";

/// The line with the digest of all others.
fn check_line(others: &[u8]) -> String {
    let digest: String = Sha256::digest(others).iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    format!("{CHECK}\"{digest}\" # of all other lines: remove this one after a change by hand\n")
}

/// Is the file certainly not as it was written? A cut file may be a good one with fewer settings, and a changed digit is a
/// setting too.
fn is_damaged(bytes: &[u8]) -> bool {
    let lines = || bytes.split_inclusive(|byte| *byte == b'\n');
    let is_check = |line: &&[u8]| line.starts_with(CHECK.as_bytes());
    let others = lines().filter(|line| !is_check(line)).collect::<Vec<_>>().concat();
    lines().find(is_check).is_some_and(|line| line != check_line(&others).as_bytes())
}

/// The text of a set. Units and labels stand beside the values as comments.
pub fn text_of_set(set: &ParameterSet, def: &PlantDef) -> String {
    let tags = tags_of(def, &set.device, &set.profile);
    let find = |short: &str| tags.iter().find(|tag| tag.short == short).copied();
    let mut out = String::from("# A parameter set of sightglass.\n");
    let rows = [("device", &set.device), ("profile", &set.profile)];
    out.extend(rows.map(|(key, words)| format!("{key} = {}\n", quoted(words))));
    out.push_str(&format!("saved = {}\nby = {}\n", set.saved, quoted(&set.by)));
    if !set.missing.is_empty() {
        let names: Vec<String> = set.missing.iter().map(|name| quoted(name)).collect();
        out.push_str("# Could not be read when the set was saved; not written when the set is restored.\n");
        out.push_str(&format!("missing = [{}]\n", names.join(", ")));
    }
    out.push_str(&units_table(set));
    if !set.given.is_empty() {
        out.push_str(
            "\n# Must be the same in a device that uses this set, otherwise the values have another meaning.\n[given]\n",
        );
        out.extend(set.given.iter().map(|value| row(value, find(&value.tag), "")));
    }
    out.push_str("\n[values]\n");
    for value in &set.values {
        let tag = find(&value.tag);
        out.push_str(&row(value, tag, set.units.get(&value.tag).map_or("", String::as_str)));
    }
    let check = check_line(out.as_bytes());
    let first = out.find('\n').map_or(0, |end| end + 1);
    out.insert_str(first, &check);
    out
}

/// Reads a set that is called `name`. `Err` has one line a problem: file, line, column, what was found, what was
/// expected.
pub fn read_set(name: &str, file: &str, bytes: &[u8], def: &PlantDef) -> Result<ParameterSet, Vec<String>> {
    if is_damaged(bytes) {
        return Err(vec![format!(
            "{file} is damaged or was changed: restore it, or check its values and remove its line `check`"
        )]);
    }
    let mut problems = Problems::default();
    let read = reader::parse(file, bytes, &mut problems)
        .map(|raw| SetTable::of(&[raw], &mut problems))
        .and_then(|table| set_of(name, &table, def, &mut problems));
    match problems.finish(read) {
        Ok(Some(set)) => Ok(set),
        Ok(None) => Err(vec![format!("{file} holds no set")]),
        Err(errors) => Err(errors.full_lines().collect()),
    }
}

fn set_of(name: &str, table: &SetTable, def: &PlantDef, problems: &mut Problems) -> Option<ParameterSet> {
    let profile = table.profile.as_ref()?;
    let tags = tags_of(def, &text(&table.device), &profile.value);
    if tags.is_empty() {
        let known = def.devices.iter().map(|device| device.profile.as_str());
        let problem = problems.add(profile.at, format!("no device of this plant has the profile `{}`", profile.value));
        problem.label("expected the profile of a device").suggest(&profile.value, known);
        return None;
    }
    let settings = values(table.values.as_ref()?, &tags, true, problems);
    let given = table.given.as_ref().map_or(Vec::new(), |given| values(given, &tags, false, problems));
    Some(ParameterSet {
        name: name.to_owned(),
        device: text(&table.device),
        profile: profile.value.clone(),
        saved: table.saved?.value.0,
        by: Arc::from(text(&table.by)),
        given,
        values: settings,
        units: table.units.as_ref().map_or(BTreeMap::new(), |units| units_of(units, &tags, problems)),
        missing: table.missing.iter().map(|name| name.value.clone()).collect(),
    })
}

/// The rows of a table of values, in the order of the profile.
fn values(table: &At<Raw>, tags: &[&TagDef], settings: bool, problems: &mut Problems) -> Vec<SetValue> {
    let mut found = Vec::new();
    for (short, (at, node)) in &table.value.table {
        let Some(place) = tags.iter().position(|tag| tag.short == *short) else {
            let problem = problems.add(*at, format!("unknown setting `{short}`"));
            problem.label("expected a setting of the device").suggest(short, tags.iter().map(|tag| tag.short.as_str()));
            continue;
        };
        if settings && !tags[place].in_sets {
            let problem = problems.add(*at, format!("`{short}` is not a setting"));
            problem.label("expected a setting, not a command or a measurement: leave it out");
            continue;
        }
        let Some(value) = Choice::read(&node.value, node.at, problems) else { continue };
        let value = exact_of(&At { value, at: node.at }, tags[place], problems);
        // Whether it can hold one whose decimals it announces is known when the set is compared with it.
        let is_known = matches!(tags[place].decimals, Decimals::Fixed(_));
        let value = value.filter(|value| !is_known || check_held(node.at, *value, tags[place], problems).is_some());
        found.extend(value.map(|value| (place, SetValue { tag: short.clone(), value })));
    }
    found.sort_by_key(|(place, _)| *place);
    found.into_iter().map(|(_, value)| value).collect()
}

/// The tags of the device that a set was taken from; where the plant has no such device, those of all devices of the
/// profile, each name once: a plant file may add tags to one device of a profile and not to the other.
fn tags_of<'a>(def: &'a PlantDef, device: &str, profile: &str) -> Vec<&'a TagDef> {
    let alike = || def.devices.iter().filter(|device| device.profile == profile);
    let own = alike().find(|other| other.name == device);
    let mut tags: Vec<&TagDef> = Vec::new();
    for tag in own.into_iter().chain(alike().filter(|_| own.is_none())).flat_map(|device| def.tags_of(device.id)) {
        if tags.iter().all(|other| other.short != tag.short) {
            tags.push(tag);
        }
    }
    tags
}

/// `"°C" = ["SV", "SV-H"]` for each unit.
fn units_table(set: &ParameterSet) -> String {
    if set.units.is_empty() {
        return String::new();
    }
    let mut out =
        String::from("\n# Units of the values. A device that uses this set must have the same units.\n[units]\n");
    let mut units: Vec<&String> = set.units.values().collect();
    units.sort();
    units.dedup();
    for unit in units {
        let named = set.values.iter().filter(|value| set.units.get(&value.tag) == Some(unit));
        let named: Vec<String> = named.map(|value| quoted(&value.tag)).collect();
        out.push_str(&format!("{} = [{}]\n", quoted(unit), named.join(", ")));
    }
    out
}

/// The unit of each setting that the table names.
fn units_of(table: &At<Raw>, tags: &[&TagDef], problems: &mut Problems) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for (unit, (at, node)) in &table.value.table {
        let Node::Array(names) = &node.value else {
            problems.add(*at, format!("`{unit}` does not say what is measured in it")).label("expected [\"SV\", …]");
            continue;
        };
        for name in names {
            let Some(short) = String::read(&name.value, name.at, problems) else { continue };
            if tags.iter().all(|tag| tag.short != short) {
                let problem = problems.add(name.at, format!("unknown setting `{short}`"));
                let known = tags.iter().map(|tag| tag.short.as_str());
                problem.label("expected a setting of the device").suggest(&short, known);
            } else if found.insert(short.clone(), unit.clone()).is_some() {
                problems.add(name.at, format!("`{short}` has two units")).label("expected each setting once");
            }
        }
    }
    found
}

/// `SV = 70   # °C, setpoint`.
fn row(value: &SetValue, tag: Option<&TagDef>, unit: &str) -> String {
    let label = tag.and_then(|tag| tag.label_of(value.value));
    // A label that two numbers share would come back as the first of them.
    let label = label
        .filter(|label| tag.is_some_and(|tag| tag.enum_labels.iter().filter(|(_, other)| other == label).count() == 1));
    let written = label.map_or_else(|| number(value.value), quoted);
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let key = if value.tag.chars().all(bare) && !value.tag.is_empty() { value.tag.clone() } else { quoted(&value.tag) };
    let words = tag.map_or("", |tag| tag.label.as_str());
    let note = [unit, words].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join(", ");
    let note: String = note.chars().filter(|c| !is_control_or_bidi(*c)).collect();
    format!("{:<24}# {note}", format!("{key} = {written}")).trim_end_matches("# ").trim_end().to_owned() + "\n"
}

/// A number that TOML reads back as the same one.
fn number(exact: Exact) -> String {
    if exact.rest().is_some() {
        return digits(exact, None);
    }
    let value = exact.near();
    if value.fract() == 0.0 && value.abs() < 1e15 { format!("{value:.0}") } else { format!("{value:?}") }
}

/// A TOML string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if is_control_or_bidi(c) => out.push_str(&format!("\\u{:04X}", u32::from(c))),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
