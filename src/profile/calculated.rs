//! What calculated tags are.

use std::sync::Arc;

use super::{diagnostic::Problems, expr, names::Defs, reader::At};
use crate::plant::{
    calculation::{self, OverTime},
    def::TagId,
    tag::{Calculation, TagDef},
};

/// Reads what the calculated tags are, when all tags are known.
pub(super) fn calculate(exprs: Vec<(TagId, At<String>)>, tags: &mut [TagDef], defs: Defs, problems: &mut Problems) {
    let mut found = Vec::new();
    for (id, words) in &exprs {
        // A name of a device has no dot.
        let device = tags[id.index()].name.split_once('.').map(|(device, _)| device);
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
    let Some(cycle) = calculation::order(tags).1 else { return };
    let at = exprs.iter().find(|(id, _)| cycle.first() == Some(id)).map(|(_, words)| words.at);
    let names: Vec<&str> = cycle.iter().chain(cycle.first()).map(|id| tags[id.index()].name.as_str()).collect();
    if let Some(at) = at {
        problems.add(at, "a calculated tag needs itself").label(names.join(" → "));
    }
}
