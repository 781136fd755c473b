//! Parameter sets of a device: those that the station keeps, and the other controllers of the same kind to copy from.

use std::sync::Arc;

use crate::plant::parameter_set::{self, Compared, ParameterSet, StoredSet};
use crate::ui::tabs::prelude::*;

/// Where the values to compare with come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A set of the station.
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

/// What is trusted now.
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

/// Draws the list of sources.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, selected: usize) {
    let theme = cx.theme;
    let (end, bottom) = (canvas.width().saturating_sub(1), canvas.height().saturating_sub(1));
    let x = canvas.text(1, 0, &device.name, theme.focus());
    let settings = cx.def().tags_of(device.id).filter(|tag| tag.in_sets).count();
    let words = t!("parameter sets of {model}, {settings} settings", model = device.model, settings);
    canvas.text(x + 2, 0, &fit_words(&words, end.saturating_sub(x + 2)), theme.normal());
    let all = sources(cx, device);
    let names = ["", t!("set or controller"), t!("from"), t!("saved"), t!("by"), t!("values"), t!("differ")];
    canvas.text(1, 2, &draw::columns(COLUMNS, names), theme.dim());
    if all.is_empty() {
        let words = match settings {
            0 => t!("this device has no settings for a set"),
            _ => t!("no sets yet: n saves the current settings"),
        };
        canvas.text(1, 4, words, theme.normal());
    }
    let room = usize::from(bottom.saturating_sub(4)).max(1);
    for (y, n, source) in on_screen(&all, first(selected, all.len(), room), room) {
        let (text, trouble) = row(cx, device, source, n == selected);
        canvas.text(1, y + 3, &fit(&text, end), row_style(cx, n == selected, trouble));
    }
    let words = t!("Sets are files of the station, in the folder sets beside its history; u refreshes the list.");
    canvas.text(1, bottom, &fit_words(words, end), theme.dim());
}

/// Mark, name, from, saved, by, values, how many differ.
const COLUMNS: [i16; 7] = [2, 24, 10, 10, 10, -6, -8];

fn row(cx: &ViewContext, device: &DeviceDef, source: &Source, selected: bool) -> (String, bool) {
    let mark = if selected { cx.theme.pick("▸", ">") } else { "" };
    let counts = |set: &ParameterSet| {
        let rows = parameter_set::compare(cx.def(), device.id, set, &trusted(cx));
        let differ = rows.iter().filter(|row| row.set.is_some() && !row.same).count();
        (set.values.len().to_string(), if differ == 0 { t!("same").to_owned() } else { differ.to_string() })
    };
    match source {
        Source::Set(name) => {
            match cx.snapshot.sets.iter().find(|stored| stored.name == *name).map(|stored| &stored.set) {
                Some(Ok(set)) => {
                    let saved = moment(set.saved, cx.now, &cx.def().time_zone);
                    let (values, differ) = counts(set);
                    (draw::columns(COLUMNS, [mark, name, &set.device, &saved, &set.by, &values, &differ]), false)
                }
                Some(Err(problems)) => {
                    let why = problems.first().map_or("", String::as_str);
                    (format!("{} {} {} {why}", pad(mark, 2), pad(name, 24), cx.theme.pick("✗", "x")), true)
                }
                None => (String::new(), false),
            }
        }
        Source::Device(other) => {
            let Some(set) = source.set(cx) else { return (String::new(), false) };
            let (values, differ) = counts(&set);
            let name = &cx.def().device(*other).name;
            let cells = [mark, &t!("{name} as it is now", name), name, "", "", &values, &differ];
            (draw::columns(COLUMNS, cells), false)
        }
    }
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
            let saved = draw::local(cx, set.saved, "%Y-%m-%d %H:%M");
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
