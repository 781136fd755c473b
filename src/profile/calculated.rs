//! What calculated tags are, and under which conditions a device has a tag.

use std::sync::Arc;

use super::{diagnostic::Problems, expr, names::Defs, reader::At, tag::Defined};
use crate::plant::{
    calculation,
    calculation_def::OverTime,
    def::TagId,
    expr::Expr,
    identity,
    tag::{Access, Calculation, Poll, TagDef},
};

/// Expressions over tags as they are written, by the tag that has them.
pub(super) struct Exprs {
    calculated: Vec<(TagId, At<String>)>,
    conditions: Vec<(TagId, At<String>)>,
}

impl Exprs {
    /// Those of these tags.
    pub fn of(defined: &[Defined]) -> Exprs {
        let all = |written: fn(&Defined) -> &Option<At<String>>| {
            let rows = defined.iter().filter_map(|defined| Some((defined.tag.id, written(defined).clone()?)));
            rows.collect()
        };
        Exprs { calculated: all(|defined| &defined.expr), conditions: all(|defined| &defined.when) }
    }
}

/// The device of a tag: its name has no dot.
fn device_of(tag: &TagDef) -> Option<&str> {
    tag.name.split_once('.').map(|(device, _)| device)
}

/// Under which conditions devices have their tags: by values that they have in any case.
fn conditions(written: &[(TagId, At<String>)], tags: &mut [TagDef], defs: &Defs, problems: &mut Problems) {
    let mut found = Vec::new();
    for (id, words) in written {
        let tag = &tags[id.index()];
        let Some(when) = expr::of_tag(words, tag, &Defs { tags: &*tags, ..*defs }, problems) else { continue };
        for source in when.tags().into_iter().map(|source| &tags[source.index()]) {
            let is_unread = source.poll == Poll::Never || source.access == Access::Write;
            if written.iter().any(|(of, _)| *of == source.id) {
                let problem = problems.add(words.at, format!("{} has a condition itself", source.name));
                problem.label("expected a tag that the device has in any case");
            } else if source.device != tag.device || source.calculation.is_some() {
                let problem = problems.add(words.at, format!("{} is not read from the same device", source.name));
                problem.label("expected a tag of the device that says what it has");
            } else if is_unread && tag.poll != Poll::Never {
                let problem = problems.add(words.at, format!("{} is never read", source.name));
                problem.label("it decides nothing").help(format!("give {} poll = \"slow\"", source.short));
            }
        }
        check_identification(words, &when, tag, defs, problems);
        found.push((*id, Arc::new(when)));
    }
    for (id, when) in found {
        tags[id.index()].when = Some(when);
    }
}

/// What a device never says decides nothing.
fn check_identification(words: &At<String>, when: &Expr, tag: &TagDef, defs: &Defs, problems: &mut Problems) {
    let Some(device) = defs.devices.get(tag.device.index()).filter(|_| !when.identity_tests().is_empty()) else {
        return;
    };
    if !device.functions.is_empty() && !device.functions.contains(&identity::FUNCTION) {
        let problem = problems.add(words.at, format!("{} has no function 43, by which it would say this", device.name));
        problem.label("expected 43 in `functions`, or a tag that says it");
    } else if defs.lines.get(device.line.index()).is_some_and(|line| line.listens) {
        let problem =
            problems.warn(words.at, format!("{} is not asked for this: nothing is sent on its line", device.name));
        problem.label("the device counts as having it");
    }
}

/// Reads what the calculated tags are, and the conditions of tags, when all tags are known.
pub(super) fn calculate(exprs: Exprs, tags: &mut [TagDef], defs: Defs, problems: &mut Problems) {
    let Exprs { calculated: exprs, conditions: of_tags } = exprs;
    let mut found = Vec::new();
    for (id, words) in &exprs {
        let device = device_of(&tags[id.index()]);
        let calculated = expr::calculated(words, device, &Defs { tags: &*tags, ..defs }, problems);
        found.extend(
            calculated.map(|(over_time, expr)| (*id, Calculation { text: words.value.clone(), over_time, expr })),
        );
    }
    for (id, calculation) in found {
        let tag = &mut tags[id.index()];
        if let Some(OverTime::Total(_)) = calculation.over_time {
            // A report gives how far it went, not its mean.
            tag.counter = tag.counter.or(Some(true));
            if !tag.is_stored()
                && let Some((_, words)) = exprs.iter().find(|(of, _)| *of == id)
            {
                let problem = problems.add(words.at, "a total that is not stored begins at 0 with every start");
                problem.label("expected a tag without store = \"never\"");
            }
        }
        tag.calculation = Some(Arc::new(calculation));
    }
    conditions(&of_tags, tags, &defs, problems);
    let Some(cycle) = calculation::order(tags).1 else { return };
    let at = exprs.iter().find(|(id, _)| cycle.first() == Some(id)).map(|(_, words)| words.at);
    let names: Vec<&str> = cycle.iter().chain(cycle.first()).map(|id| tags[id.index()].name.as_str()).collect();
    if let Some(at) = at {
        problems.add(at, "a calculated tag needs itself").label(names.join(" → "));
    }
}
