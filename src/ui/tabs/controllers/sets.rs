//! Parameter sets of a device: those that the station keeps, and the other controllers of the same kind to copy from.

use std::sync::Arc;

use crate::plant::parameter_set::{self, Compared, ParameterSet, StoredSet};
use crate::ui::tabs::prelude::*;

/// Where the values to compare with come from.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Source {
    Set(String),
    /// Another device, as it is now.
    Device(DeviceId),
}

impl Source {
    /// In words: `set winter`, `copy of TIC-2`.
    pub fn words(&self, cx: &ViewContext) -> String {
        match self {
            Source::Set(name) => t!("set {name}", name),
            Source::Device(device) => t!("copy of {name}", name = cx.def().device(*device).name),
        }
    }
    /// Its values as they are now; `None` if it has gone or cannot be used.
    pub fn set(&self, cx: &ViewContext) -> Option<Arc<ParameterSet>> {
        match self {
            Source::Set(name) => {
                let stored = cx.snapshot.sets.iter().find(|stored| stored.name == *name)?;
                stored.set.as_ref().ok().cloned()
            }
            Source::Device(device) => {
                let name = &cx.def().device(*device).name;
                let by: Arc<str> = "".into();
                Some(Arc::new(parameter_set::capture(cx.def(), *device, name, by, cx.now, &trusted(cx))))
            }
        }
    }
}

pub fn trusted<'a>(cx: &'a ViewContext) -> impl Fn(TagId) -> Option<Exact> + 'a {
    |tag| cx.snapshot.sample(tag).good_exact()
}

/// Every source that can be compared with a device: its sets, files that cannot be used, other devices of its profile.
pub fn sources(cx: &ViewContext, device: &DeviceDef) -> Vec<Source> {
    let fits = |stored: &&StoredSet| stored.set.as_ref().map_or(true, |set| set.profile == device.profile);
    let sets = cx.snapshot.sets.iter().filter(fits).map(|stored| Source::Set(stored.name.clone()));
    let twins = cx.def().devices.iter().filter(|other| other.profile == device.profile && other.id != device.id);
    let has = cx.def().tags_of(device.id).any(|tag| tag.in_sets);
    sets.chain(twins.map(|other| Source::Device(other.id)).filter(|_| has)).collect()
}

/// What is wrong with the file of a set, as a window.
pub fn problems(cx: &ViewContext, source: &Source) -> Option<Notice> {
    let Source::Set(name) = source else { return None };
    let stored = cx.snapshot.sets.iter().find(|stored| stored.name == *name)?;
    let problems = stored.set.as_ref().err()?;
    let mut words = vec![t!("{name} cannot be used", name)];
    words.extend(problems.iter().take(8).cloned());
    if problems.len() > 8 {
        words.push(t!("and {count} more", count = problems.len() - 8));
    }
    Some(Notice::new(t!("set {name}", name), words))
}

pub type Sets = List<SetsOf>;

/// What a device can be compared with.
#[derive(Debug)]
pub struct SetsOf {
    pub device: DeviceId,
}

/// A source, of which device the list is, and what can be compared: a set, or what is wrong with its file.
#[derive(Debug, Clone)]
pub struct SourceRow {
    pub source: Source,
    of: DeviceId,
    set: Result<Arc<ParameterSet>, String>,
}

impl SourceRow {
    fn new(cx: &ViewContext, of: DeviceId, source: Source) -> SourceRow {
        let broken = |name: &String| cx.snapshot.sets.iter().find(|stored| stored.name == *name)?.set.as_ref().err();
        let why = match &source {
            Source::Set(name) => broken(name).and_then(|problems| problems.first()).cloned(),
            Source::Device(_) => None,
        };
        SourceRow { set: source.set(cx).ok_or_else(|| why.unwrap_or_default()), source, of }
    }

    /// A word of a set that is kept; nothing of a device as it is now.
    fn kept(&self, word: impl FnOnce(&ParameterSet) -> String) -> String {
        match (&self.source, &self.set) {
            (Source::Set(_), Ok(set)) => word(set),
            (Source::Set(_), Err(_)) | (Source::Device(_), _) => String::new(),
        }
    }

    fn name(&self, cx: &ViewContext) -> String {
        match &self.source {
            Source::Set(name) => name.clone(),
            Source::Device(other) => t!("{name} as it is now", name = cx.def().device(*other).name),
        }
    }

    fn differ(&self, cx: &ViewContext) -> String {
        let Ok(set) = &self.set else { return String::new() };
        let rows = parameter_set::compare(cx.def(), self.of, set, &trusted(cx));
        match rows.iter().filter(|row| row.set.is_some() && !row.same).count() {
            0 => t!("same").to_owned(),
            differ => differ.to_string(),
        }
    }
}

impl Listing for SetsOf {
    type Answer = ();
    type Row = SourceRow;
    type Id = Source;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        let settings = cx.def().tags_of(self.device).filter(|tag| tag.in_sets).count();
        let empty = match settings {
            0 => t!("this device has no settings for a set"),
            _ => t!("no sets yet: n saves the current settings"),
        };
        let Some(device) = cx.def().devices.get(self.device.index()) else { return Heading::new("", empty) };
        let words = t!("parameter sets of {model}, {settings} settings", model = device.model, settings);
        Heading::new(&device.name, empty).words(words, cx.theme.normal())
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, SourceRow>> {
        let Some(device) = cx.def().devices.get(self.device.index()) else { return Vec::new() };
        sources(cx, device).into_iter().map(|source| Cow::Owned(SourceRow::new(cx, self.device, source))).collect()
    }

    fn id(row: &SourceRow) -> Source {
        row.source.clone()
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<SourceRow>> {
        vec![
            left(26, t!("set or controller"), |cx, row| row.name(cx)),
            left(10, t!("from"), |_, row| row.set.as_ref().map_or(String::new(), |set| set.device.to_string())),
            left(10, t!("saved"), |cx, row: &SourceRow| row.kept(|set| moment(set.saved, cx.now, &cx.def().time_zone)))
                .by(|a, b| saved_at(a).cmp(&saved_at(b))),
            left(10, t!("by"), |_, row| row.kept(|set| set.by.to_string())),
            right(6, t!("values"), |_, row| row.set.as_ref().map_or(String::new(), |set| set.values.len().to_string())),
            right(8, t!("differ"), |cx, row| row.differ(cx)),
        ]
    }

    fn words(&self, cx: &ViewContext, row: &SourceRow) -> Option<String> {
        let why = row.set.as_ref().err()?;
        Some(format!("{} {} {why}", pad(&row.name(cx), 26), cx.theme.pick("✗", "x")))
    }

    fn style(&self, cx: &ViewContext, row: &SourceRow) -> Style {
        row_style(cx, false, row.set.is_err())
    }

    fn foot(&self, cx: &ViewContext) -> Option<(String, Style)> {
        let words = t!("Sets are files of the station, in the folder sets beside its history; u refreshes the list.");
        Some((words.to_owned(), cx.theme.dim()))
    }
}

fn saved_at(row: &SourceRow) -> Option<Timestamp> {
    row.set.as_ref().ok().map(|set| set.saved)
}

/// What a set would hold that was taken now, for the prompt for its name.
pub fn save_hint(cx: &ViewContext, device: DeviceId) -> String {
    let set = parameter_set::capture(cx.def(), device, "", "".into(), cx.now, &trusted(cx));
    match set.missing.as_slice() {
        [] => t!("all {count} settings, for example: winter", count = set.values.len()),
        missing => {
            let names = fit_words(&missing.join(" "), 40);
            t!("{count} settings; unknown now and omitted: {names}", count = set.values.len(), names)
        }
    }
}

/// The confirmation before a set is written over: whose it is, for it may be of another kind of device.
pub fn replace_text(cx: &ViewContext, there: &StoredSet) -> String {
    let name = &there.name;
    match &there.set {
        Ok(set) => {
            let saved = cx.local(set.saved, "%Y-%m-%d %H:%M");
            let (device, profile, by) = (&set.device, &set.profile, &set.by);
            t!(
                "The set {name} exists already: of {device}, profile {profile}, saved {saved} by {by}. Replace it?",
                name,
                device,
                profile,
                saved,
                by
            )
        }
        Err(_) => t!("The file {name}.toml exists already and is not a valid set. Replace it?", name),
    }
}

/// What the set says, in the set's own unit.
pub fn shown_of_set(cx: &ViewContext, row: &Compared) -> String {
    match (row.tag, row.set, &row.unit) {
        (Some(tag), Some(value), Some(unit)) => format!("{} {unit}", cx.snapshot.format(tag, value)),
        _ => shown(cx, row, row.set),
    }
}

/// A value of a comparison, as the device would show it.
pub fn shown(cx: &ViewContext, row: &Compared, value: Option<Exact>) -> String {
    match (row.tag, value) {
        (_, None) => "–".to_owned(),
        (Some(tag), Some(value)) => {
            format!("{} {}", cx.snapshot.format(tag, value), cx.snapshot.unit(tag)).trim_end().to_owned()
        }
        (None, Some(value)) => value.to_string(),
    }
}

/// Lines of at most this width, the first ones of a long text.
pub fn some_lines(words: &[String], room: u16, most: usize) -> Vec<String> {
    let lines: Vec<String> = words.iter().flat_map(|words| wrap(words, room)).collect();
    let more = lines.len().saturating_sub(most);
    let mut lines: Vec<String> = lines.into_iter().take(most).collect();
    if more > 0
        && let Some(last) = lines.last_mut()
    {
        let tail = t!(" … {more} more lines", more);
        *last = fit(last, room.saturating_sub(width(&tail))) + &tail;
    }
    lines
}
