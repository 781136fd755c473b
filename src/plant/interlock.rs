//! What stands between a command and its effect: interlocks, the mode in which a command is effective, and whether the feedback follows it.

use std::{ops::RangeInclusive, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::interlock_def::{
    ActuatorDef, ControlLogic, InterlockCondition, InterlockDef, InterlockStatus, SequenceDef,
};
use super::{
    def::{ActionDef, PlantDef},
    exact::Exact,
    id::TagId,
    role::Role,
    sample::Sample,
    scale,
    tag::TagDef,
};
use crate::plant::time::elapsed;

/// The values of a command that switch something off: the `off` of an actuator, the zero of a sequence, the actions of its
/// device that are marked as a stop.
pub fn stops<'a>(logic: &'a ControlLogic, actions: &'a [ActionDef], tag: TagId) -> impl Iterator<Item = f64> + 'a {
    let actuators = logic.actuators.iter().map(|actuator| (actuator.command, actuator.off));
    let sequences = logic.sequences.iter().map(|sequence| (sequence.run, 0.0));
    let actions = actions.iter().filter(|action| action.stop).map(|action| (action.tag, action.value));
    actuators.chain(sequences).chain(actions).filter(move |(command, _)| *command == tag).map(|(_, off)| off)
}

/// The interlocks of this value of a command. Here and below `value` is what is asked for, and what is then sent is compared
/// ([`scale::is_sent_as`]); `decimals` are those of [`TagDef::scaling_decimals`], `None` where they are not known: then the strictest
/// of all that are possible counts.
pub fn of_write(def: &PlantDef, tag: TagId, value: Exact, decimals: Option<i8>) -> impl Iterator<Item = &InterlockDef> {
    let written = def.tag(tag);
    let is_meant = move |rule: f64| {
        possible_decimals(written, decimals).any(|decimals| scale::is_sent_as(written, value, rule.into(), decimals))
    };
    def.logic.interlocks.iter().filter(move |lock| lock.tag == tag && is_meant(lock.value))
}

/// The interlock for which this command is certainly without effect and is not to be sent.
pub fn refusal(
    def: &PlantDef,
    tag: TagId,
    value: Exact,
    decimals: Option<i8>,
    sample: impl Fn(TagId) -> Sample,
) -> Option<&InterlockDef> {
    let blocks = |lock: &&InterlockDef| lock.refuse && lock.status(sample(lock.of)) == InterlockStatus::Blocked;
    of_write(def, tag, value, decimals).find(blocks)
}

/// Does this value of a command certainly switch something off?
pub fn is_stop(def: &PlantDef, tag: TagId, value: Exact, decimals: Option<i8>) -> bool {
    let mut ways = sent_by(def.tag(tag), value, decimals).peekable();
    ways.peek().is_some() && ways.all(|decimals| is_stop_by(def, tag, value, decimals))
}

fn is_stop_by(def: &PlantDef, tag: TagId, value: Exact, decimals: i8) -> bool {
    let mut stops = stops(&def.logic, &def.device(def.tag(tag).device).actions, tag);
    stops.any(|off| scale::is_sent_as(def.tag(tag), value, off.into(), decimals))
}

/// By how many decimals the raw number of a tag may be scaled: those that are `known`, else all that its device can announce.
fn possible_decimals(tag: &TagDef, known: Option<i8>) -> RangeInclusive<i8> {
    let (least, most) = tag.decimals.possible();
    match known.filter(|_| tag.decimals.source().is_some()) {
        Some(known) => known..=known,
        None => least..=most,
    }
}

/// The decimals by which a value can be sent at all.
fn sent_by(tag: &TagDef, value: Exact, known: Option<i8>) -> impl Iterator<Item = i8> {
    possible_decimals(tag, known).filter(move |decimals| scale::to_raw(tag, value, *decimals).is_some())
}

/// The least role that may write this value to a tag: that of the action that writes it, else that of the tag. A stop is for
/// everybody who may operate. Decimals that a device announces may change before the write, so that all are considered.
pub fn role_to_write(def: &PlantDef, tag: TagId, value: Exact) -> Role {
    let written = def.tag(tag);
    let role_by = |decimals: i8| {
        if is_stop_by(def, tag, value, decimals) {
            return Role::Technician;
        }
        let is_sent = |action: &&ActionDef| scale::is_sent_as(written, value, action.value.into(), decimals);
        actions_on(def, tag).filter(is_sent).find_map(|action| action.role).unwrap_or(written.role)
    };
    sent_by(written, value, None).map(role_by).max().unwrap_or(written.role)
}

/// The least role that may write any value to a tag.
pub fn least_role_to_write(def: &PlantDef, tag: TagId) -> Role {
    let actions = actions_on(def, tag).filter_map(|action| action.role);
    let mut stops = stops(&def.logic, &def.device(def.tag(tag).device).actions, tag);
    let stop = stops.next().map(|_| Role::Technician);
    actions.chain(stop).fold(def.tag(tag).role, Role::min)
}

fn actions_on(def: &PlantDef, tag: TagId) -> impl Iterator<Item = &ActionDef> {
    def.device(def.tag(tag).device).actions.iter().filter(move |action| action.tag == tag)
}

/// Since when the feedback of each actuator has differed from its command, by its place in [`ControlLogic::actuators`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ActuatorTracker {
    since: Vec<Option<Timestamp>>,
}

impl ActuatorTracker {
    pub(super) fn times(&mut self) -> impl Iterator<Item = &mut Timestamp> {
        self.since.iter_mut().flatten()
    }

    /// As stored values tell it: since the last of the values that it depends on was stored, so never too early.
    pub(super) fn from_stored(logic: &ControlLogic, sample: impl Fn(TagId) -> Sample) -> ActuatorTracker {
        let since = |actuator: &ActuatorDef| {
            let needs = actuator.needs.iter().map(|(tag, _)| *tag);
            let last = needs.chain([actuator.command, actuator.output]).map(|tag| sample(tag).at).max();
            last.filter(|_| logic.differs(actuator, &sample))
        };
        ActuatorTracker { since: logic.actuators.iter().map(since).collect() }
    }

    /// Goes on under another definition, in which a tag is what `was` gives.
    pub(super) fn redefine(
        &mut self,
        before: &ControlLogic,
        logic: &ControlLogic,
        was: impl Fn(TagId) -> Option<TagId>,
    ) {
        let since = |now: &ActuatorDef| {
            let is_it = |own: &ActuatorDef| [now.command, now.output].map(&was) == [own.command, own.output].map(Some);
            before.actuators.iter().zip(&self.since).find(|(own, _)| is_it(own)).and_then(|(_, since)| *since)
        };
        self.since = logic.actuators.iter().map(since).collect();
    }

    /// Notes what differs at `at`, and since when.
    pub fn update(&mut self, logic: &ControlLogic, sample: impl Fn(TagId) -> Sample, at: Timestamp) {
        self.since.resize(logic.actuators.len(), None);
        for (actuator, since) in logic.actuators.iter().zip(&mut self.since) {
            *since = logic.differs(actuator, &sample).then(|| since.unwrap_or(at));
        }
    }

    /// How long the feedback of the actuator in this place has differed from its command, once that is longer than its travel takes.
    pub fn feedback_mismatch(&self, logic: &ControlLogic, place: usize, at: Timestamp) -> Option<Duration> {
        let since = (*self.since.get(place)?)?;
        let travel = logic.actuators.get(place)?.travel?;
        let lasts = elapsed(since, at);
        (travel <= lasts).then_some(lasts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sample::Cause;

    const AUTO: TagId = TagId(0);
    const COMMAND: TagId = TagId(1);
    const OUTPUT: TagId = TagId(2);
    const LEVEL: TagId = TagId(3);

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn good(value: f64) -> Sample {
        Sample::good(value, at(0))
    }

    fn bad() -> Sample {
        Sample::bad(Cause::Timeout, at(0))
    }

    fn logic(refuse: bool) -> ControlLogic {
        let message = "no heating below 5 cm".to_owned();
        let lock =
            InterlockDef { tag: COMMAND, value: 1.0, of: LEVEL, when: InterlockCondition::Below(5.0), message, refuse };
        let travel = Some(Duration::from_secs(5));
        let actuator = ActuatorDef { output: OUTPUT, command: COMMAND, off: 0.0, needs: vec![(AUTO, 0.0)], travel };
        ControlLogic { interlocks: vec![lock], actuators: vec![actuator], sequences: Vec::new() }
    }

    #[test]
    fn an_interlock_blocks_what_it_says_and_nothing_else() {
        use InterlockStatus::{Blocked, Free, Unknown};
        for (when, sample, expect) in [
            (InterlockCondition::Below(5.0), good(4.9), Blocked),
            (InterlockCondition::Below(5.0), good(5.0), Free),
            (InterlockCondition::Above(20.0), good(20.1), Blocked),
            (InterlockCondition::Above(20.0), good(20.0), Free),
            (InterlockCondition::Is(1.0), good(1.0), Blocked),
            (InterlockCondition::Is(1.0), good(0.0), Free),
            (InterlockCondition::Bit(2), good(4.0), Blocked),
            (InterlockCondition::Bit(2), good(3.0), Free),
            (InterlockCondition::Bit(0), good(-1.0), Blocked),
            (InterlockCondition::Bit(15), good(-32_768.0), Blocked),
            (InterlockCondition::Bit(14), good(-32_768.0), Free),
            (InterlockCondition::Bit(200), good(4.0), Free),
            (InterlockCondition::Below(5.0), bad(), Unknown(Cause::Timeout)),
            (InterlockCondition::Below(5.0), good(1.0).uncertain(Cause::Stale), Unknown(Cause::Stale)),
        ] {
            let lock = InterlockDef { when, ..logic(true).interlocks[0].clone() };
            assert_eq!(lock.status(sample), expect, "{when:?} {sample:?}");
        }
    }

    #[test]
    fn only_what_is_certainly_blocked_is_refused() {
        let check = |refuse, value, level: Sample, refused: bool| {
            let def = PlantDef { logic: logic(refuse), ..crate::plant::fixture::plant() };
            assert_eq!(
                refusal(&def, COMMAND, Exact::plain(value), Some(0), |_| level).is_some(),
                refused,
                "{value} at {level:?}"
            );
        };
        check(true, 1.0, good(4.0), true);
        check(true, 1.0, good(6.0), false);
        check(true, 0.0, good(4.0), false);
        check(true, 1.0, bad(), false);
        check(false, 1.0, good(4.0), false);
    }

    #[test]
    fn a_feedback_mismatch_is_reported_after_the_travel_time() {
        let check = |auto: Sample, command: Sample, output: Sample, level: Sample, expect: Option<u64>| {
            let (logic, mut watch) = (logic(true), ActuatorTracker::default());
            let sample = |tag: TagId| [auto, command, output, level][tag.index()];
            watch.update(&logic, sample, at(10));
            assert_eq!(watch.feedback_mismatch(&logic, 0, at(14)), None, "it may still travel");
            watch.update(&logic, sample, at(15));
            assert_eq!(watch.feedback_mismatch(&logic, 0, at(15)).map(|span| span.as_secs()), expect);
        };
        let (on, off, high) = (good(1.0), good(0.0), good(9.0));
        check(off, on, off, high, Some(5));
        check(off, off, on, high, Some(5));
        check(off, on, on, high, None);
        check(on, on, off, high, None);
        check(bad(), on, off, high, None);
        check(off, bad(), off, high, None);
        check(off, on, bad(), high, None);
        check(off, on, off, good(1.0), None);
        check(off, on, off, bad(), Some(5));
    }

    #[test]
    fn a_feedback_mismatch_that_ends_starts_over() {
        let (logic, mut watch) = (logic(true), ActuatorTracker::default());
        for (second, output, expect) in [(0, 0.0, None), (5, 0.0, Some(5)), (6, 1.0, None), (7, 0.0, None)] {
            let sample = |tag: TagId| [good(0.0), good(1.0), good(output), good(9.0)][tag.index()];
            watch.update(&logic, sample, at(second));
            assert_eq!(
                watch.feedback_mismatch(&logic, 0, at(second)).map(|span| span.as_secs()),
                expect,
                "at {second} s"
            );
        }
    }

    #[test]
    fn a_feedback_mismatch_goes_on_under_other_ids_and_names() {
        let (before, mut watch) = (logic(true), ActuatorTracker::default());
        watch.update(&before, |tag| [good(0.0), good(1.0), good(0.0), good(9.0)][tag.index()], at(0));
        let moved = |actuator: &ActuatorDef| ActuatorDef { output: TagId(8), command: TagId(9), ..actuator.clone() };
        let other = ActuatorDef { output: AUTO, ..before.actuators[0].clone() };
        let logic = ControlLogic { actuators: vec![other, moved(&before.actuators[0])], ..before.clone() };
        let was = |tag: TagId| (8 <= tag.0).then_some(if tag.0 == 8 { OUTPUT } else { COMMAND });
        watch.redefine(&before, &logic, was);
        let lasts = [0, 1].map(|place| watch.feedback_mismatch(&logic, place, at(7)).map(|span| span.as_secs()));
        assert_eq!(lasts, [None, Some(7)]);
    }
}
