//! What a batch is.

use super::{
    diagnostic::Problems,
    expr,
    names::{Defs, Unique, check_name},
    reader::At,
    schema::BatchTable,
};
use crate::plant::{
    def::{BatchDef, TagId},
    energy::{self, Measures},
};

/// All rules of a plant file.
pub(super) fn batches(tables: &[At<BatchTable>], defs: &Defs, problems: &mut Problems) -> Vec<BatchDef> {
    let mut names = Unique::default();
    tables.iter().filter_map(|table| batch(&table.value, &mut names, defs, problems)).collect()
}

fn batch(table: &BatchTable, names: &mut Unique, defs: &Defs, problems: &mut Problems) -> Option<BatchDef> {
    let (name, start, end) = (table.name.as_ref()?, table.start.as_ref()?, table.end.as_ref()?);
    check_name(name, "batch", problems);
    names.insert(&name.value, name.at, format!("duplicate batch `{}`", name.value), problems);
    let phase = table.phase.as_ref().and_then(|phase| stored(phase, defs, problems));
    let tags = table.tags.iter().filter_map(|tag| stored(tag, defs, problems)).collect();
    let energy = table.energy.as_ref().and_then(|name| energy_tag(name, defs, problems)).map(|(tag, _)| tag);
    let [start, end] = [start, end].map(|words| expr::expr(words, defs, problems));
    Some(BatchDef { name: name.value.as_str().into(), start: start?, end: end?, phase, energy, tags })
}

/// A power or a counter of energy.
pub(super) fn energy_tag(name: &At<String>, defs: &Defs, problems: &mut Problems) -> Option<(TagId, Measures)> {
    let tag = stored(name, defs, problems)?;
    let unit = &defs.tags[tag.index()].unit;
    let measures = energy::of_unit(unit);
    if measures.is_none() {
        problems
            .add(name.at, format!("{} has the unit `{unit}`", name.value))
            .label(format!("expected one of {}", energy::UNITS.join(", ")));
    }
    measures.map(|measures| (tag, measures))
}

/// A tag that the history has.
pub(super) fn stored(name: &At<String>, defs: &Defs, problems: &mut Problems) -> Option<TagId> {
    let tag = defs.tag(name, problems)?;
    if !tag.is_stored() {
        problems.add(name.at, format!("{} is not stored", tag.name)).label("expected a tag without store = \"never\"");
    }
    Some(tag.id)
}
