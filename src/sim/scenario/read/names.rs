//! Names of a scenario in its plant: tags, values, alarms, or what was probably meant.

use crate::{
    plant::{
        PlantDef,
        alarm::manager::subject_name,
        def::{AlarmDef, AlarmId, Condition, Subject, TagId},
    },
    profile::{
        diagnostic::Problems,
        names::number_of,
        reader::{At, Choice},
    },
};

/// A tag by its full name.
pub(super) fn tag(name: &At<String>, def: &PlantDef, problems: &mut Problems) -> Option<TagId> {
    let known = def.tags.iter().map(|tag| tag.name.as_str());
    unknown(def.tag_named(&name.value), "tag", name, known, problems)
}

/// A number that a tag can have, or the word for it.
pub(super) fn value(
    value: &Option<At<Choice>>,
    name: &At<String>,
    tag: TagId,
    def: &PlantDef,
    problems: &mut Problems,
) -> Option<f64> {
    match value {
        Some(value) => number_of(value, def.tag(tag), problems),
        None => {
            problems.add(name.at, "which value?").label("needs `value`");
            None
        }
    }
}

/// The alarm of a tag or device; `text` tells several of one tag apart.
pub(super) fn alarm(
    subject: &At<String>,
    words: &Option<At<String>>,
    def: &PlantDef,
    problems: &mut Problems,
) -> Option<AlarmId> {
    let name = |subject: Subject| subject_name(def, subject);
    let of_subject: Vec<_> = def.alarms.iter().filter(|alarm| name(alarm.subject) == subject.value).collect();
    let mut known: Vec<&str> = def.alarms.iter().map(|alarm| name(alarm.subject)).collect();
    known.dedup();
    unknown(of_subject.first(), "alarm of", subject, known.into_iter(), problems)?;
    // The name of a device alone means "not responding", as in every file from before it could also be slow.
    let usual = |alarm: &AlarmDef| alarm.condition != Condition::SlowerThanStated;
    let fits = |alarm: &&&AlarmDef| words.as_ref().map_or_else(|| usual(alarm), |words| words.value == alarm.message);
    let found: Vec<_> = of_subject.iter().filter(fits).collect();
    let texts = || of_subject.iter().map(|alarm| alarm.message.as_str());
    match (found.as_slice(), words) {
        ([one], _) => Some(one.id),
        ([], Some(words)) => {
            let problem = problems.add(words.at, format!("{} has no alarm `{}`", subject.value, words.value));
            problem.label("no such alarm").suggest(&words.value, texts());
            None
        }
        _ => {
            let all = texts().map(|text| format!("`{text}`")).collect::<Vec<_>>().join(", ");
            let problem = problems.add(subject.at, format!("{} has several alarms", subject.value));
            problem.label("select one by `message`").help(format!("text is one of {all}"));
            None
        }
    }
}

/// What was found, or a problem that offers the nearest known name.
pub(super) fn unknown<'a, T>(
    found: Option<T>,
    what: &str,
    name: &At<String>,
    known: impl Iterator<Item = &'a str>,
    problems: &mut Problems,
) -> Option<T> {
    if found.is_none() {
        let known: Vec<&str> = known.collect();
        let problem = problems.add(name.at, format!("unknown {what} `{}`", name.value));
        problem.label("not in this plant").suggest(&name.value, known);
    }
    found
}
