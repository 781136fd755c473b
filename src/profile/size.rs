//! How much a plant file may ask for.

use super::{
    diagnostic::Problems,
    reader::{At, Node, Raw},
};

/// Most tags of a plant, those of its profiles with them; an id has 16 bits, and a terminal plant is far from it.
pub(super) const TAGS_MAX: usize = 20_000;
/// Most tables of each kind in a plant file.
const MOST: [(&str, usize); 9] = [
    ("line", 64),
    ("device", 2_000),
    ("alarm", 10_000),
    ("interlock", 10_000),
    ("expect", 10_000),
    ("trend", 1_000),
    ("batch", 100),
    ("run", 2_000),
    ("shift", 100),
];

/// Looks how much a plant file asks for, before anything is made of it.
pub(super) fn is_of_size(raw: &Raw, problems: &mut Problems) -> bool {
    for (key, most) in MOST {
        let Some((_, At { value: Node::Array(rows), .. })) = raw.table.get(key) else { continue };
        if let Some(first) = rows.get(most) {
            let message = format!("{} times [[{key}]] is too much", rows.len());
            problems.add(first.at, message).label(format!("expected at most {most}"));
            return false;
        }
    }
    true
}
