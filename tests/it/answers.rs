//! What the station says in words of its own, which a terminal knows by their texts in `text/answers.rs`: each of them stands
//! in the code that says it.

use std::{fs, path::Path};

use crate::texts::{sources, texts};

/// The terminal knows answers of the station by their texts: each stands in the code that gives it.
#[test]
fn every_known_answer_is_one_of_the_station() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root.join("access"), &mut files);
    ["plant", "bus/io"].iter().for_each(|folder| sources(&root.join(folder), &mut files));
    let station: String = files.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    for answer in &texts()["text/answers"] {
        let literals = answer.split('{').filter_map(|part| part.rsplit('}').next());
        for piece in literals.flat_map(|literal| literal.split("; ")) {
            assert!(piece.is_empty() || station.contains(piece), "{answer:?}: {piece:?} is in no file of the station");
        }
    }
}
