//! The writes that bring a device to a set: only what differs, all limits checked before the first, limits that widen
//! before the values that need them.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{ParameterSet, Trusted, compare, same};
use crate::plant::{
    def::{DeviceId, PlantDef, TagId},
    exact::Exact,
    interlock,
    sample::{Cause, Sample},
    scale,
    tag::TagDef,
};
use crate::t;

/// One write of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlannedChange {
    /// What.
    pub tag: TagId,
    /// In the device when the plan was made.
    pub old: Exact,
    /// From the set.
    pub new: Exact,
}

/// Why a set cannot be written to a device. Nothing is written while there is one.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum Problem {
    /// It was taken from another kind of device.
    #[error("{}", t!("the set is for {set}, this device is {device}", set = .set, device = .device))]
    OtherProfile { set: String, device: String },
    /// The device has no such setting.
    #[error("{}", t!("{what} is not a setting of this device", what = .0))]
    NoSetting(String),
    /// A tag that the set rests on has another value in the device.
    #[error("{}", t!("{tag} is {device} in the device, {set} in the set: the values mean something else", tag = .tag, device = .device, set = .set))]
    OtherGround { tag: String, set: String, device: String },
    /// A value that must be known is not.
    #[error("{}", t!("{what} is unknown now", what = .0))]
    Unknown(String),
    /// It would change how other values are scaled or what they are measured in.
    #[error("{}", t!("{what} differs, and other values depend on it: set it manually first", what = .0))]
    Ground(String),
    /// Outside the limits that the device would then have.
    #[error("{}", t!("{tag} {value} is outside {min} … {max}", tag = .tag, value = .value, min = .min, max = .max))]
    OutOfRange { tag: String, value: Exact, min: String, max: String },
    /// The device would round it, to this.
    #[error("{}", t!("{tag} {value}: the device would store {held}", tag = .tag, value = .value, held = .held))]
    Resolution { tag: String, value: Exact, held: Exact },
    /// Not one of the values of an enumeration.
    #[error("{}", t!("{tag} has no value {value}", tag = .tag, value = .value))]
    NotAChoice { tag: String, value: Exact },
    /// The station would refuse it now.
    #[error("{}", t!("{tag}: interlock: {text}", tag = .tag, text = .text))]
    Interlock { tag: String, text: String },
    /// The limits forbid every sequence.
    #[error("{}", t!("{what}: no sequence of writes stays within the limits", what = .0))]
    NoOrder(String),
}

/// The writes that bring the device to the set, in a sequence in which each is within the limits of its moment; or every
/// reason why not. A setting that is the same is not written; one that is missing in the set stays as it is.
pub fn plan(
    def: &PlantDef,
    device: DeviceId,
    set: &ParameterSet,
    trusted: Trusted,
) -> Result<Vec<PlannedChange>, Vec<Problem>> {
    let own = &def.device(device).profile;
    if *own != set.profile {
        return Err(vec![Problem::OtherProfile { set: set.profile.clone(), device: own.clone() }]);
    }
    let mut problems = other_ground(def, device, set, trusted);
    let mut changes = Vec::new();
    for row in compare(def, device, set, trusted) {
        let Some(new) = row.set else { continue };
        let tag = row.tag.map(|tag| def.tag(tag)).filter(|tag| tag.in_sets);
        match (tag, row.device) {
            (None, _) => problems.push(Problem::NoSetting(row.short)),
            (Some(_), _) if row.same => {}
            // Without the old value the change is unknown.
            (Some(_), None) => problems.push(Problem::Unknown(row.short)),
            (Some(tag), Some(_)) if carries(def, device, tag.id) => problems.push(Problem::Ground(tag.short.clone())),
            (Some(tag), Some(old)) => changes.push(PlannedChange { tag: tag.id, old, new }),
        }
    }
    let after: BTreeMap<TagId, Exact> = changes.iter().map(|change| (change.tag, change.new)).collect();
    let then = |tag: TagId| after.get(&tag).copied().or_else(|| trusted(tag));
    problems.extend(changes.iter().filter_map(|change| unfit(def, change, &then, trusted)));
    if !problems.is_empty() {
        return Err(problems);
    }
    // From here on it is what will be sent: that is confirmed, permitted and recorded.
    for PlannedChange { tag, new, .. } in &mut changes {
        let tag = def.tag(*tag);
        let held = tag.scaling_decimals(trusted).and_then(|decimals| scale::rounded_to_device(tag, *new, decimals));
        *new = held.unwrap_or(*new);
    }
    in_order(def, device, changes, trusted)
        .map_err(|stuck| stuck.iter().map(|change| Problem::NoOrder(def.tag(change.tag).short.clone())).collect())
}

/// What the set rests on and the device has otherwise.
fn other_ground(def: &PlantDef, device: DeviceId, set: &ParameterSet, trusted: Trusted) -> Vec<Problem> {
    let words = |tag: &TagDef, value: Exact| tag.label_of(value).map_or_else(|| value.to_string(), str::to_owned);
    let wrong = set.given.iter().filter_map(|given| {
        let Some(tag) = def.tags_of(device).find(|tag| tag.short == given.tag) else {
            return Some(Problem::NoSetting(given.tag.clone()));
        };
        let now = trusted(tag.id);
        if now.is_some_and(|now| same(tag, given.value, now, trusted)) {
            return None;
        }
        let device = now.map_or_else(|| "unknown".to_owned(), |now| words(tag, now));
        Some(Problem::OtherGround { tag: given.tag.clone(), set: words(tag, given.value), device })
    });
    wrong.chain(other_units(def, device, set, trusted)).collect()
}

/// Values that the device measures in another unit than the set; a tag that chooses units is reported once.
fn other_units<'a>(
    def: &'a PlantDef,
    device: DeviceId,
    set: &'a ParameterSet,
    trusted: Trusted<'a>,
) -> impl Iterator<Item = Problem> + 'a {
    let is_given = |from: TagId| set.given.iter().any(|given| given.tag == def.tag(from).short);
    def.tags_of(device).filter_map(move |tag| {
        let wanted = set.units.get(&tag.short).filter(|_| set.values.iter().any(|value| value.tag == tag.short))?;
        let now = tag.unit_by(trusted);
        if now == Some(wanted) || tag.unit_from.as_ref().is_some_and(|(from, _)| is_given(*from)) {
            return None;
        }
        let device = now.map_or(t!("unknown"), |unit| if unit.is_empty() { t!("none") } else { unit });
        Some(Problem::OtherGround {
            tag: t!("the unit of {tag}", tag = tag.short),
            set: wanted.clone(),
            device: device.to_owned(),
        })
    })
}

/// Do other values get their decimals or their unit from this tag?
fn carries(def: &PlantDef, device: DeviceId, tag: TagId) -> bool {
    def.tags_of(device).any(|other| {
        other.decimals.source() == Some(tag) || other.unit_from.as_ref().is_some_and(|(from, _)| *from == tag)
    })
}

/// Why a value cannot be in the device when all is written.
fn unfit(
    def: &PlantDef,
    change: &PlannedChange,
    then: &dyn Fn(TagId) -> Option<Exact>,
    trusted: Trusted,
) -> Option<Problem> {
    let tag = def.tag(change.tag);
    if !tag.enum_labels.is_empty() && tag.label_of(change.new).is_none() {
        return Some(Problem::NotAChoice { tag: tag.short.clone(), value: change.new });
    }
    let decimals = tag.scaling_decimals(trusted);
    if let Some(lock) = interlock::refusal(def, tag.id, change.new, decimals, |tag| as_sample(trusted(tag))) {
        return Some(Problem::Interlock { tag: tag.short.clone(), text: lock.message.clone() });
    }
    let bounds = match tag.limits(then) {
        Ok(limits) => limits,
        Err(from) => return Some(Problem::Unknown(def.tag(from).short.clone())),
    };
    let Some(decimals) = decimals else {
        return Some(Problem::Unknown(t!("the decimals of {tag}", tag = tag.short)));
    };
    if let Some(raw) = scale::raw_within(tag, change.new, decimals, bounds) {
        let held = scale::to_value(tag, raw, decimals);
        let is_held = scale::is_held(tag, change.new, held);
        let (tag, value) = (tag.short.clone(), change.new);
        return (!is_held).then_some(Problem::Resolution { tag, value, held });
    }
    let (min, max) = scale::bounds_text(tag, bounds, decimals, None);
    Some(Problem::OutOfRange { tag: tag.short.clone(), value: change.new, min, max })
}

/// An interlock needs a good value; its age does not matter.
fn as_sample(trusted: Option<Exact>) -> Sample {
    let at = Timestamp::UNIX_EPOCH;
    trusted.map_or(Sample::bad(Cause::NotRead, at), |value| Sample::good(value, at))
}

/// Picks again and again the first change that is possible now. Values that move up wait for the upper limits that move
/// up before them, and so on: while limits do not bound each other in a ring, one is always possible.
fn in_order(
    def: &PlantDef,
    device: DeviceId,
    mut left: Vec<PlannedChange>,
    trusted: Trusted,
) -> Result<Vec<PlannedChange>, Vec<PlannedChange>> {
    let mut now: BTreeMap<TagId, Exact> = BTreeMap::new();
    let mut sorted = Vec::with_capacity(left.len());
    while !left.is_empty() {
        let value = |tag: TagId| now.get(&tag).copied().or_else(|| trusted(tag));
        let own = |change: &PlannedChange| inside(def.tag(change.tag), change.new, &value);
        let kind = |change: &PlannedChange| {
            let then = |tag: TagId| if tag == change.tag { Some(change.new) } else { value(tag) };
            def.tags_of(device).all(|tag| match trusted(tag.id).and(value(tag.id)) {
                // A value that was outside before is not this change's doing.
                Some(held) if tag.id != change.tag => inside(tag, held, &then) || !inside(tag, held, &value),
                Some(_) | None => true,
            })
        };
        let next = left.iter().position(|change| own(change) && kind(change)).or_else(|| left.iter().position(own));
        let Some(next) = next else { return Err(left) };
        let change = left.remove(next);
        now.insert(change.tag, change.new);
        sorted.push(change);
    }
    Ok(sorted)
}

/// Is the value within the limits as these tags stand? Limits that are not known forbid it.
fn inside(tag: &TagDef, held: Exact, value: &dyn Fn(TagId) -> Option<Exact>) -> bool {
    tag.limits(value).is_ok_and(|(min, max)| scale::is_inside(min, max, held))
}
