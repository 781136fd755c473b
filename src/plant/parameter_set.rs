//! Named values of a device's settings: captured, compared with a device, and planned as a sequence of writes.

mod plan;
#[cfg(test)]
mod tests;

use crate::t;
use std::{collections::BTreeMap, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    def::{DeviceId, PlantDef, TagId},
    exact::Exact,
    scale,
    tag::TagDef,
    visible::is_control_or_bidi,
};

pub(crate) use plan::{PlannedChange, Problem, plan};

/// The settings of a device under a name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterSet {
    /// `winter`; the stem of its file.
    pub name: String,
    /// The device that it was taken from.
    pub device: String,
    /// The profile of that device: a set fits devices of this profile only.
    pub profile: String,
    /// When it was taken.
    pub saved: Timestamp,
    /// By whom.
    pub by: Arc<str>,
    /// What the values rest on and must be the same in a device that is to take them: tags that choose units.
    pub given: Vec<SetValue>,
    /// The settings, in the order of the profile.
    pub values: Vec<SetValue>,
    /// What the values are measured in, by short name; a tag that is not here has none, or the set is of before they
    /// were kept.
    pub units: BTreeMap<String, String>,
    /// Settings that could not be read when it was taken, by short name.
    pub missing: Vec<String>,
}

/// A value of a tag, by the tag's short name, in its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SetValue {
    /// `SV`.
    pub tag: String,
    /// In the tag's unit; the number of an enumeration.
    pub value: Exact,
}

/// A set in the station's folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredSet {
    /// Its name.
    pub name: String,
    /// The set, or the problems of its file, one a line, with file, line, found and expected.
    pub set: Result<Arc<ParameterSet>, Vec<String>>,
}

/// A parameter set to restore and the changes that the operator confirmed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestoreRequest {
    /// The device that is written.
    pub device: DeviceId,
    /// Label of the origin: `winter`, `copy of TIC-2`.
    pub from: Arc<str>,
    /// The values.
    pub set: Arc<ParameterSet>,
    /// The confirmed changes, in order. If the device needs others by then, nothing is written.
    pub changes: Vec<PlannedChange>,
}

/// The good values by tag, of a snapshot or the process image.
pub type Trusted<'a> = &'a dyn Fn(TagId) -> Option<Exact>;

/// Most characters of a name.
pub const NAME_MAX: usize = 32;

/// A name that can be a file's everywhere, in any language: no path, nothing hidden, not blank at its ends. `Err` says
/// what is expected.
pub fn check_name(name: &str) -> Result<(), String> {
    let barred = |c: char| is_control_or_bidi(c) || "/\\:*?\"<>|".contains(c);
    if name.is_empty() {
        return Err(t!("type a name").to_owned());
    }
    if NAME_MAX < name.chars().count() {
        return Err(t!("at most {most} characters", most = NAME_MAX));
    }
    if name.trim() != name {
        return Err(t!("no space at its beginning or end").to_owned());
    }
    if name.starts_with('.') {
        return Err(t!("no dot at its beginning").to_owned());
    }
    if name.contains(barred) {
        return Err(t!("none of / \\ : * ? \" < > |").to_owned());
    }
    Ok(())
}

/// Captures the settings of a device as a set; unknown settings are listed as missing.
pub fn capture(
    def: &PlantDef,
    device: DeviceId,
    name: &str,
    by: Arc<str>,
    at: Timestamp,
    trusted: Trusted,
) -> ParameterSet {
    let (mut values, mut missing, mut given) = (Vec::new(), Vec::new(), Vec::<SetValue>::new());
    let mut units = BTreeMap::new();
    for tag in def.tags_of(device).filter(|tag| tag.in_sets) {
        let unit = tag.unit_from.as_ref().map(|(from, _)| (def.tag(*from), trusted(*from)));
        // A number that the profile has no word for cannot be checked when it comes back.
        let known = |value: &Exact| tag.enum_labels.is_empty() || tag.label_of(*value).is_some();
        match (trusted(tag.id).filter(known), unit) {
            // A number without its unit is another number.
            (None, _) | (_, Some((_, None))) => missing.push(tag.short.clone()),
            (Some(value), unit) => {
                values.push(SetValue { tag: tag.short.clone(), value });
                let measured_in = tag.unit_by(trusted).filter(|unit| !unit.is_empty());
                units.extend(measured_in.map(|unit| (tag.short.clone(), unit.to_owned())));
                let unit = unit.and_then(|(from, unit)| Some(SetValue { tag: from.short.clone(), value: unit? }));
                given.extend(unit.filter(|unit| !given.contains(unit)));
            }
        }
    }
    let device = def.device(device);
    ParameterSet {
        name: name.to_owned(),
        device: device.name.clone(),
        profile: device.profile.clone(),
        saved: at,
        by,
        given,
        values,
        units,
        missing,
    }
}

/// A setting of a set compared with a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// Its short name.
    pub short: String,
    /// The tag of the device; `None` where it has none of this name.
    pub tag: Option<TagId>,
    /// In the set; `None` if it is not there.
    pub set: Option<Exact>,
    /// The unit of the value of the set, where the set says one.
    pub unit: Option<String>,
    /// In the device; `None` where it is not known.
    pub device: Option<Exact>,
    /// The device would hold the same raw number.
    pub same: bool,
}

/// Every setting of the set or the device, in the order of the profile; names that the device does not have stand last.
pub fn compare(def: &PlantDef, device: DeviceId, set: &ParameterSet, trusted: Trusted) -> Vec<Compared> {
    let in_set = |short: &str| set.values.iter().find(|value| value.tag == short).map(|value| value.value);
    let held = def.tags_of(device).filter(|tag| tag.in_sets || in_set(&tag.short).is_some()).map(|tag| {
        let (wanted, now) = (in_set(&tag.short), trusted(tag.id));
        let unit = set.units.get(&tag.short);
        let measured_alike = unit.is_none_or(|unit| tag.unit_by(trusted) == Some(unit));
        let same = measured_alike && wanted.zip(now).is_some_and(|(wanted, now)| same(tag, wanted, now, trusted));
        Compared { short: tag.short.clone(), tag: Some(tag.id), set: wanted, unit: unit.cloned(), device: now, same }
    });
    let foreign = set.values.iter().filter(|value| def.tags_of(device).all(|tag| tag.short != value.tag));
    let foreign = foreign.map(|value| Compared {
        short: value.tag.clone(),
        tag: None,
        set: Some(value.value),
        unit: set.units.get(&value.tag).cloned(),
        device: None,
        same: false,
    });
    held.chain(foreign).collect()
}

/// Would the device hold the same raw number for both?
fn same(tag: &TagDef, one: Exact, other: Exact, trusted: Trusted) -> bool {
    let raw = |value| tag.scaling_decimals(trusted).and_then(|decimals| scale::to_raw(tag, value, decimals));
    raw(one).zip(raw(other)).map_or(one == other, |(one, other)| scale::same_raw(tag, one, other))
}
