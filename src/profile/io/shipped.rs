//! The profiles that come with the program: a new device is one more file in `profiles` and no Rust.
//!
//! They are one archive in the binary, of which a file is unpacked when it is asked for.

use std::{
    io::{Cursor, Read},
    path::Path,
    sync::LazyLock,
};

use zip::ZipArchive;

use super::super::plant::Text;

static ARCHIVE: LazyLock<ZipArchive<Cursor<&[u8]>>> = LazyLock::new(|| {
    let bytes: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/profiles.zip"));
    ZipArchive::new(Cursor::new(bytes)).expect("the build writes a good archive")
});

/// The names of the files below a folder, each with the folder that it lies in.
pub fn names(folder: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    paths(folder).filter_map(|path| {
        let above = path.rsplit_once('/')?.0;
        Some((stem(path)?, above.split_once('/').map_or("", |_| above)))
    })
}

/// The text of the file of a name below a folder.
pub fn named(folder: &str, name: &str) -> Option<Text> {
    paths(folder).find(|path| stem(path) == Some(name)).and_then(at)
}

/// The text of the file at a path.
pub fn at(path: &str) -> Option<Text> {
    let mut bytes = Vec::new();
    // The copy has its own place in the same bytes.
    ARCHIVE.clone().by_name(path).ok()?.read_to_end(&mut bytes).ok()?;
    Some(Text { file: format!("profiles/{path}"), bytes })
}

fn paths(folder: &str) -> impl Iterator<Item = &'static str> {
    let all = ARCHIVE.file_names_raw().filter_map(|path| std::str::from_utf8(path).ok());
    all.filter(move |path| Path::new(path).starts_with(folder))
}

fn stem(path: &'static str) -> Option<&'static str> {
    Path::new(path).file_stem()?.to_str()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    #[test]
    fn names_are_unique_over_the_folders_of_devices() {
        let all: Vec<_> = super::names("devices").collect();
        let unique: HashSet<_> = all.iter().map(|(name, _)| name).collect();
        assert!(all.len() >= 150 && unique.len() == all.len(), "{}, {}", all.len(), unique.len());
        assert!(all.iter().all(|(_, folder)| !folder.is_empty()), "each lies in the folder of its kind");
    }
}
