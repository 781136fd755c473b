//! Which tags are alarm inputs, which process values and which identification, as far as the plant file shows.

use super::{
    def::{AlarmDef, Subject},
    id::TagId,
    poll_class::PollClass,
    tag::{Poll, TagDef},
};

/// The class of each tag, by [`TagId`]: critical if an alarm watches it, compares with it or needs it for such a tag; background
/// if it is read once; else normal. What is `written` for a tag in a file stands above all that.
pub fn classes(tags: &[TagDef], alarms: &[AlarmDef], written: &[Option<PollClass>]) -> Vec<PollClass> {
    let mut critical = vec![false; tags.len()];
    let mut found: Vec<TagId> = alarms.iter().flat_map(inputs).collect();
    while let Some(tag) = found.pop() {
        if !std::mem::replace(&mut critical[tag.index()], true) {
            found.extend(tags[tag.index()].needs());
        }
    }
    let of = |tag: &TagDef| match (written.get(tag.id.index()).copied().flatten(), tag.poll) {
        (Some(class), _) => class,
        (None, _) if critical[tag.id.index()] => PollClass::Critical,
        (None, Poll::Once) => PollClass::Background,
        (None, Poll::Every(_) | Poll::Never) => PollClass::Normal,
    };
    tags.iter().map(of).collect()
}

/// The tags that an alarm reads by itself. A device that does not answer is noticed by any poll.
fn inputs(alarm: &AlarmDef) -> impl Iterator<Item = TagId> {
    let subject = match alarm.subject {
        Subject::Tag(tag) => Some(tag),
        Subject::Device(_) | Subject::Line(_) | Subject::Station => None,
    };
    let enabling = alarm.enabled_when.iter().flat_map(|expr| expr.tags());
    subject.into_iter().chain(alarm.condition.reference()).chain(enabling)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::def::Condition;
    use crate::plant::fixture::{self, DP, FAULT, PV, RUN, SV};

    #[test]
    fn what_an_alarm_needs_is_hard_and_identification_is_idle() {
        let mut def = fixture::plant();
        let of = |def: &crate::plant::PlantDef, written: &[Option<PollClass>], tag: TagId| {
            classes(&def.tags, &def.alarms, written)[tag.index()]
        };
        for (tag, class) in [
            (PV, PollClass::Critical),
            (DP, PollClass::Critical),
            (FAULT, PollClass::Critical),
            (SV, PollClass::Normal),
        ] {
            assert_eq!(of(&def, &[], tag), class, "{tag:?}");
        }
        def.alarms[0].condition = Condition::Deviation { from: SV, limit: 5.0, deadband: 1.0 };
        assert_eq!(of(&def, &[], SV), PollClass::Critical, "PV is compared with it");
        def.tags[RUN.index()].poll = Poll::Once;
        assert_eq!(of(&def, &[], RUN), PollClass::Background);
        def.tags[DP.index()].poll = Poll::Once;
        assert_eq!(of(&def, &[], DP), PollClass::Critical, "read once, but nothing can be evaluated without it");
        assert_eq!(of(&def, &[Some(PollClass::Normal)], PV), PollClass::Normal, "the engineer knows better");
    }
}
