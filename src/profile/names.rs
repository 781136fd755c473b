//! Which names a plant has, and what a reference by name leads to.

use std::collections::BTreeMap;

use super::{
    diagnostic::{Problems, Span},
    raw_pattern::is_pattern,
    reader::{At, Choice, Node, Value},
};
use crate::plant::{
    def::{DeviceDef, DeviceId, LineDef, LineId, TagId},
    entry,
    exact::{Exact, digits},
    scale,
    tag::{Decimals, Encoding, TagDef},
};

/// The full names of all tags, known before the tags themselves are, since tags refer to each other.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub tags: BTreeMap<String, TagId>,
    /// Devices whose profile could not be read. Their tags are not missing, only unknown: one mistake, one message.
    pub unread: Vec<String>,
}

impl Names {
    /// A tag that is named beside a tag of `device`: `SV-L`, or in full `TIC-1.SV-L`.
    pub fn near(&self, name: &At<String>, device: &str, problems: &mut Problems) -> Option<TagId> {
        let inside = format!("{device}.{}", name.value);
        if let Some(id) = self.tags.get(&inside).or_else(|| self.tags.get(&name.value)) {
            return Some(*id);
        }
        let prefix = format!("{device}.");
        let known = self.tags.keys().filter_map(|full| full.strip_prefix(&prefix));
        let problem = problems.add(name.at, format!("unknown tag `{}` in {device}", name.value));
        problem.label("no tag of this device").suggest(&name.value, known);
        None
    }
    /// A tag by its full name.
    pub fn full(&self, name: &At<String>, problems: &mut Problems) -> Option<TagId> {
        let found = self.tags.get(&name.value).copied();
        let unread = name.value.split_once('.').is_some_and(|(device, _)| self.unread.iter().any(|d| d == device));
        if found.is_none() && !unread {
            let problem = problems.add(name.at, format!("unknown tag `{}`", name.value));
            problem.label("expected DEVICE.TAG").suggest(&name.value, self.tags.keys().map(String::as_str));
        }
        found
    }
}

/// Devices and tags, finished: what alarms, the mimic, trends and reports refer to.
pub(super) struct Defs<'a> {
    pub names: &'a Names,
    pub lines: &'a [LineDef],
    pub devices: &'a [DeviceDef],
    pub tags: &'a [TagDef],
}

impl Defs<'_> {
    /// A tag that holds a number, by its full name.
    pub fn tag(&self, name: &At<String>, problems: &mut Problems) -> Option<&TagDef> {
        let tag = self.names.full(name, problems).map(|id| &self.tags[id.index()])?;
        check_number(name.at, tag, problems);
        Some(tag)
    }
    /// The id of a tag that holds a number and may be left out.
    pub fn tag_id(&self, name: &Option<At<String>>, problems: &mut Problems) -> Option<TagId> {
        name.as_ref().and_then(|name| self.tag(name, problems)).map(|tag| tag.id)
    }
    /// Is a tag on a line that another master polls?
    pub fn listens_to(&self, tag: &TagDef) -> bool {
        let device = self.devices.iter().find(|device| device.id == tag.device);
        device.and_then(|device| self.lines.get(device.line.index())).is_some_and(|line| line.listens)
    }
    /// A line by its name.
    pub fn line(&self, name: &At<String>, problems: &mut Problems) -> Option<LineId> {
        let found = self.lines.iter().find(|line| line.name == name.value).map(|line| line.id);
        if found.is_none() {
            problems.unknown("line", name, self.lines.iter().map(|line| line.name.as_str()));
        }
        found
    }
    /// A device by its name.
    pub fn device(&self, name: &At<String>, problems: &mut Problems) -> Option<DeviceId> {
        let found = self.devices.iter().find(|device| device.name == name.value).map(|device| device.id);
        if found.is_none() && !self.names.unread.contains(&name.value) {
            problems.unknown("device", name, self.devices.iter().map(|device| device.name.as_str()));
        }
        found
    }
}

/// Where the names of one device are looked up.
pub(super) struct Scope<'a> {
    pub names: &'a Names,
    pub tags: &'a [TagDef],
    pub device: &'a str,
}

impl<'a> Scope<'a> {
    /// A tag of the device, or of another one by its full name.
    pub fn tag(&self, name: &At<String>, problems: &mut Problems) -> Option<&'a TagDef> {
        self.names.near(name, self.device, problems).map(|id| &self.tags[id.index()])
    }
    /// The same for a key that may be left out.
    pub fn tag_id(&self, name: &Option<At<String>>, problems: &mut Problems) -> Option<TagId> {
        self.tag(name.as_ref()?, problems).map(|tag| tag.id)
    }
    /// The same for a tag that is written.
    pub fn writable(&self, name: &Option<At<String>>, problems: &mut Problems) -> Option<&'a TagDef> {
        let name = name.as_ref()?;
        let tag = self.tag(name, problems)?;
        check_writable(name, tag, problems);
        Some(tag)
    }
}

/// Reports a tag that is named where a number is written, and cannot take one.
pub(super) fn check_writable(name: &At<String>, tag: &TagDef, problems: &mut Problems) {
    if !tag.writable() {
        problems.add(name.at, format!("{} cannot be written", tag.name)).label("expected access = \"rw\" or \"w\"");
    }
    check_number(name.at, tag, problems);
}

/// Reports a text that is named where a number is needed.
pub(super) fn check_number(name: Span, tag: &TagDef, problems: &mut Problems) {
    if tag.is_text() {
        problems.add(name, format!("{} is a text", tag.name)).label("expected a tag that holds a number");
    }
}

/// Checks that a name can be typed, shown and used in `DEVICE.TAG`.
pub(super) fn check_name(name: &At<String>, what: &str, problems: &mut Problems) {
    let plain = |c: char| c.is_alphanumeric() || "-_/#+.".contains(c);
    let dot = what != "tag" && name.value.contains('.');
    if name.value.is_empty() || dot || !name.value.chars().all(plain) {
        let problem = problems.add(name.at, format!("`{}` is not a name for a {what}", name.value));
        problem.label("expected letters, digits, - _ / # +, without spaces");
    }
}

/// Finds names that are used twice, and says where the first one stands.
#[derive(Debug, Default)]
pub(super) struct Unique(BTreeMap<String, Span>);

impl Unique {
    /// `true` if the name is new; else the problem with this message was added.
    pub fn insert(&mut self, name: &str, at: Span, message: impl Into<String>, problems: &mut Problems) -> bool {
        match self.0.get(name) {
            Some(first) => {
                problems.add(at, message).label("again").also(*first, "first here");
                false
            }
            None => {
                self.0.insert(name.to_owned(), at);
                true
            }
        }
    }
}

/// The number that a choice means for a tag, see [`exact_of`]; one that is kept with 15 digits.
pub(crate) fn number_of(choice: &At<Choice>, tag: &TagDef, problems: &mut Problems) -> Option<f64> {
    let exact = exact_of(choice, tag, problems)?;
    f64::read(&Node::Number(exact), choice.at, problems)
}

/// The number that a choice means for a tag: a label of its enumeration, or a number that the tag can hold.
pub(crate) fn exact_of(choice: &At<Choice>, tag: &TagDef, problems: &mut Problems) -> Option<Exact> {
    let labels = || tag.enum_labels.iter().map(|(_, text)| text.as_str());
    let known = match &choice.value {
        Choice::Word(word) => {
            tag.enum_labels.iter().find(|(_, text)| text == word).map(|(number, _)| Exact::whole(*number))
        }
        Choice::Number(number) => Some(as_held(At { value: *number, at: choice.at }, tag, problems))
            .filter(|n| tag.enum_labels.is_empty() || tag.label_of(*n).is_some()),
        Choice::Flag(flag) => Some(f64::from(u8::from(*flag)).into()).filter(|_| has_two_states(tag)),
    };
    if known.is_none() {
        let written = match &choice.value {
            Choice::Word(word) => word.clone(),
            Choice::Number(number) => digits(*number, None),
            Choice::Flag(flag) => flag.to_string(),
        };
        let problem = problems.add(choice.at, format!("`{written}` is not a state of {}", tag.name));
        if tag.enum_labels.is_empty() {
            problem.label("expected a number: the tag has no `enum`");
        } else {
            problem.label("not in its `enum`").suggest(&written, labels());
        }
    }
    known
}

/// A number of a tag that shows its raw number; in hexadecimal it is the pattern of its bits: 0xFFFF of an int16 is -1. A
/// decimal number beyond the type stays one that does not fit.
fn as_held(At { value: number, at }: At<Exact>, tag: &TagDef, problems: &Problems) -> Exact {
    let is_raw = tag.scale == 1.0 && tag.offset == 0.0 && matches!(tag.decimals, Decimals::Fixed(_));
    let is_binary = tag.calculation.is_none() && tag.point.kind.is_binary();
    let meant = || tag.point.raw_number(number.as_whole()?, true).number();
    if is_raw && is_binary && is_pattern(at, problems) { meant().unwrap_or(number) } else { number }
}

/// Can a tag be true or false: a bit, states 0 and 1, or an expression?
fn has_two_states(tag: &TagDef) -> bool {
    let is_bit = tag.point.kind.encoding() == Encoding::Bit || tag.point.field.is_some_and(|(_, bits)| bits == 1);
    let is_flag = |number: i128| (0..=1).contains(&number);
    let labels = !tag.enum_labels.is_empty() && tag.enum_labels.iter().all(|(number, _)| is_flag(*number));
    is_bit || labels || tag.calculation.is_some()
}

/// The same of a value that is to be written, as it is typed for the tag; as the device will hold it.
pub(crate) fn held_number_of(choice: &At<Choice>, tag: &TagDef, problems: &mut Problems) -> Option<f64> {
    let number = number_of(choice, tag, problems)?;
    let Decimals::Fixed(decimals) = tag.decimals else {
        return check_held(choice.at, number.into(), tag, problems).map(|_| number);
    };
    if let Err(why) = entry::check_decimals(entry::decimals_of(number.into()), decimals) {
        let message = format!("{} has more decimals than {}", digits(number, None), tag.name);
        problems.add(choice.at, message).label(format!("expected {why}"));
        return None;
    }
    check_held(choice.at, number.into(), tag, problems).map(Exact::near)
}

/// The value as the device will hold it. Reports one that it cannot hold, or only rounded. Decimals that it announces are not
/// known here: they only make the raw number greater.
pub(super) fn check_held(at: Span, value: Exact, tag: &TagDef, problems: &mut Problems) -> Option<Exact> {
    // A power of ten may make it smaller.
    if tag.decimals.power_source().is_some() {
        return Some(value);
    }
    let Some(held) = scale::rounded_to_device(tag, value, 0) else {
        let message = format!("{} does not fit the register of {}", digits(value, None), tag.name);
        problems.add(at, message).label("expected a value that its type can hold");
        return None;
    };
    if matches!(tag.decimals, Decimals::Fixed(_)) && !scale::is_held(tag, value, held) {
        let message = format!("{} cannot hold {}", tag.name, digits(value, None));
        problems.add(at, message).label(format!("expected the next value that it can hold: {}", digits(held, None)));
    }
    Some(held)
}
