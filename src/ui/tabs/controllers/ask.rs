//! The confirmation before a restore: what would be written, and what the profile wants said before any of it is.

use std::sync::Arc;

use super::sets::Source;
use crate::plant::{
    def::PlantDef,
    parameter_set::{ParameterSet, PlannedChange},
    restore::RestoreRequest,
    tag::{Confidence, TagDef},
};
use crate::ui::tabs::prelude::*;

/// The narrowest window has room for this many cells.
const ROOM: u16 = 68;
/// Lines of warnings that a window of 24 rows has room for.
const WARNINGS_MAX: usize = 6;

pub fn confirm_restore(
    cx: &ViewContext,
    device: &DeviceDef,
    source: &Source,
    set: Arc<ParameterSet>,
    changes: Vec<PlannedChange>,
) -> Confirm {
    let from: Arc<str> = source.words(cx).into();
    let count = if changes.len() == 1 { t!("1 value").to_owned() } else { t!("{count} values", count = changes.len()) };
    let prompt = t!(
        "Write {count} to {name}, one after the other, each read back? The first failure stops it.",
        count,
        name = device.name
    );
    let warnings = warnings(cx.def(), &changes);
    let shown = if warnings.len() <= 2 { 6 } else { 4 };
    let mut notes: Vec<String> = changes.iter().take(shown).map(|change| change_text(cx, change)).collect();
    if changes.len() > shown {
        notes.push(t!("… and {count} more, as listed", count = changes.len() - shown));
    }
    if !set.missing.is_empty() {
        notes.push(t!("not in the set, not changed: {names}", names = names(&set.missing, ROOM - 35)));
    }
    notes.extend(warnings);
    let title = format!("{from} → {}", device.name);
    let request = RestoreRequest { device: device.id, from, set, changes };
    Confirm::command(title, prompt, CommandKind::Restore(Box::new(request))).with_notes(notes).with_reauthentication(cx)
}

fn change_text(cx: &ViewContext, change: &PlannedChange) -> String {
    let text = |value| cx.snapshot.format(change.tag, value);
    let (short, unit) = (&cx.def().tag(change.tag).short, cx.snapshot.unit(change.tag));
    format!("{short}  {} → {} {unit}", text(change.old), text(change.new)).trim_end().to_owned()
}

/// What a write of each would be asked with, each text once, as lines that the window has room for.
fn warnings(def: &PlantDef, changes: &[PlannedChange]) -> Vec<String> {
    let tags: Vec<&TagDef> = changes.iter().map(|change| def.tag(change.tag)).collect();
    let unsure = tags.iter().filter(|tag| matches!(tag.confidence, Confidence::Medium | Confidence::Low));
    let unsure: Vec<&str> = unsure.map(|tag| tag.short.as_str()).collect();
    let mut asked: Vec<(&str, Vec<&str>)> = Vec::new();
    for tag in &tags {
        let Some(words) = tag.confirm.as_deref().map(of_plant) else { continue };
        match asked.iter_mut().find(|(other, _)| *other == words) {
            Some((_, shorts)) => shorts.push(&tag.short),
            None => asked.push((words, vec![&tag.short])),
        }
    }
    let marked = (!unsure.is_empty()).then(|| t!("! not verified: {names}", names = names(&unsure, ROOM - 16)));
    let mut lines: Vec<String> = Vec::new();
    let room = WARNINGS_MAX - usize::from(marked.is_some());
    let count = asked.len();
    for (n, (words, shorts)) in asked.into_iter().enumerate() {
        let text = wrap(&format!("{}: {words}", names(&shorts, 30)), ROOM);
        // The last line is kept for how many more there are.
        if room < lines.len() + text.len() + usize::from(n + 1 < count) {
            let tags = count - n;
            lines.push(t!("… and {tags} more that ask for confirmation: see their own windows", tags));
            break;
        }
        lines.extend(text);
    }
    lines.extend(marked);
    lines
}

/// Names in a row, cut to so many cells with how many more there are.
fn names<S: AsRef<str>>(all: &[S], room: u16) -> String {
    let whole = all.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(" ");
    if width(&whole) <= room {
        return whole;
    }
    let mut shown = String::new();
    for (n, name) in all.iter().enumerate() {
        let tail = t!("… and {count} more", count = all.len() - n);
        let longer = format!("{shown}{} ", name.as_ref());
        // A tail that is one name later is not longer than this one.
        if room < width(&longer) + width(&tail) {
            return fit_words(&format!("{shown}{tail}"), room);
        }
        shown = longer;
    }
    shown.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cut_with_how_many_more_there_are() {
        let check = |count: usize, room: u16, expect: &str| {
            let all: Vec<String> = (1..=count).map(|n| format!("SV-{n}")).collect();
            let shown = names(&all, room);
            assert_eq!(shown, expect);
            assert!(width(&shown) <= room, "{shown}");
        };
        check(3, 20, "SV-1 SV-2 SV-3");
        check(9, 30, "SV-1 SV-2 SV-3 … and 6 more");
        check(12, 26, "SV-1 SV-2 … and 10 more");
    }
}
