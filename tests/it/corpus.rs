//! Bytes that fuzzing found worth keeping, read again by the very functions that it calls: see `tests/fuzz/README.md`.

#[path = "../fuzz/src/lib.rs"]
mod targets;

use std::{fs, path::Path};

#[test]
fn bytes_that_fuzzing_kept_are_read_without_harm() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    for (name, read) in targets::TARGETS {
        let files: Vec<_> = fs::read_dir(corpora.join(name)).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(!files.is_empty(), "no corpus of {name}");
        for file in files {
            println!("{}", file.display());
            read(&fs::read(&file).unwrap());
        }
    }
}
