//! The rows of a device: those of its profile, changed by those of the plant file, each on the defaults of the profile.

use super::{
    diagnostic::{Problems, Span},
    names::Unique,
    reader::{At, Node, OptionalKey, Raw},
    repeat::all_rows,
    schema::{DeviceTable, ProfileFile},
};

/// One tag before it is defined: a plant file's keys lie on the profile's, which lie on the profile's defaults.
pub(super) struct Row {
    pub short: String,
    /// Which of a repeat it is.
    pub repeat: Option<String>,
    pub layers: Vec<Raw>,
}

/// The rows of a device. A `[[device.tag]]` with the name of a profile's tag changes it, any other is a new tag.
pub(super) fn rows(device: &DeviceTable, profile: &ProfileFile, problems: &mut Problems) -> Vec<Row> {
    let default = profile.default.as_ref().map(|default| default.value.clone());
    let mut rows = Vec::new();
    let scheme = profile.scheme.value_or(Default::default());
    for (tags, repeats) in [(&profile.tags, &profile.repeats), (&device.tags, &device.repeats)] {
        let mut seen = Unique::default();
        for (tag, repeat) in all_rows(tags, repeats, scheme, problems) {
            let (short, at) = short_name(&tag.value);
            if !short.is_empty() && !seen.insert(&short, at, format!("duplicate tag `{short}`"), problems) {
                continue;
            }
            let raw = tag.value;
            match rows.iter_mut().find(|row: &&mut Row| row.short == short && !short.is_empty()) {
                Some(row) => row.layers.insert(0, raw),
                None => rows.push(Row { short, repeat, layers: std::iter::once(raw).chain(default.clone()).collect() }),
            }
        }
    }
    rows
}

/// The name of a row and where it stands; empty if it has none, which is reported when the row is read.
fn short_name(raw: &Raw) -> (String, Span) {
    match raw.table.get("name") {
        Some((_, At { value: Node::Text(name), at })) => (name.clone(), *at),
        _ => (String::new(), raw.at),
    }
}
