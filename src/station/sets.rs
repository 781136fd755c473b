//! The folder of parameter sets: one readable file a set, beside the history of the plant.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    plant::{
        PlantDef, SetWork,
        command::CommandId,
        parameter_set::{ParameterSet, StoredSet, check_name},
    },
    profile::{
        io::{atomic, regular},
        read_set, text_of_set,
    },
};

/// Most sets that are read; an operator can choose among some dozens at most.
const SETS_MAX: usize = 200;
/// A set is some kilobytes; whatever is larger than this is something else.
const BYTES_MAX: u64 = 256 << 10;

/// What was written for whom, and all sets that lie in the folder.
pub type Done = (Option<(CommandId, Result<(), String>)>, Vec<StoredSet>);

/// `DIR/sets/PLANT` beside the history file.
pub fn folder(history: &Path, plant: &str) -> PathBuf {
    history.parent().unwrap_or(Path::new("")).join("sets").join(plant)
}

/// Does the work and reads the folder. Blocks while the disk works.
pub fn work(folder: &Path, def: &PlantDef, work: SetWork) -> Done {
    let written = match work {
        SetWork::Read => None,
        SetWork::Write { command, set, replace } => Some((command, write(folder, def, &set, replace))),
    };
    (written, read_all(folder, def))
}

/// Writes a set: whole or not at all. `Err` says why in words for the operator.
fn write(folder: &Path, def: &PlantDef, set: &ParameterSet, replace: bool) -> Result<(), String> {
    check_name(&set.name)?;
    let path = folder.join(format!("{}.toml", set.name));
    let failed = |error: std::io::Error| format!("{} cannot be written: {error}", path.display());
    fs::create_dir_all(folder).map_err(failed)?;
    let written = atomic::write_placed(&path, text_of_set(set, def).as_bytes(), 0o640, |_, new| {
        // A link fails if the name is taken: no set is replaced between a check and the write.
        if replace { fs::rename(new, &path) } else { fs::hard_link(new, &path) }
    });
    match written {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            Err(format!("there is a set {} already", set.name))
        }
        written => written.map(drop).map_err(failed),
    }
}

/// Every set of the folder, by name; a file that is no set is listed with its problems, as is a folder that
/// cannot be read and the number of sets left out.
fn read_all(folder: &Path, def: &PlantDef) -> Vec<StoredSet> {
    let mut names = match names(folder) {
        Ok(names) => names,
        Err(error) => return vec![unreadable("the folder", format!("{} cannot be read: {error}", folder.display()))],
    };
    names.sort();
    let more = names.len().saturating_sub(SETS_MAX);
    names.truncate(SETS_MAX);
    let read = names.into_iter().map(|(name, path)| StoredSet { set: read(&name, &path, def).map(Arc::new), name });
    let left_out = format!("at most {SETS_MAX} sets are read, by name: move old ones out of {}", folder.display());
    read.chain((more > 0).then(|| unreadable(&format!("… {more} more not read"), left_out))).collect()
}

/// A row in the list that is no set, and why it is there.
fn unreadable(name: &str, why: String) -> StoredSet {
    StoredSet { name: name.to_owned(), set: Err(vec![why]) }
}

/// The files of the folder that may be sets, with the names of these.
fn names(folder: &Path) -> std::io::Result<Vec<(String, PathBuf)>> {
    let entries = match fs::read_dir(folder) {
        // Before the first set is saved there is no folder.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let path = entry?.path();
        let toml = path.extension().is_some_and(|extension| extension == "toml");
        let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
        if toml && !stem.starts_with('.') {
            names.push((stem.to_owned(), path));
        }
    }
    Ok(names)
}

fn read(name: &str, path: &Path, def: &PlantDef) -> Result<ParameterSet, Vec<String>> {
    let file = format!("{name}.toml");
    let unreadable = |error: std::io::Error| vec![format!("{file} cannot be read: {error}")];
    let bytes = regular::read(path, BYTES_MAX).map_err(unreadable)?;
    read_set(name, &file, &bytes, def)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::profile::{Search, load};

    const COMMAND: CommandId = CommandId { terminal: 1, number: 1 };

    fn winter(sv: f64) -> ParameterSet {
        let value = crate::plant::parameter_set::SetValue { tag: "SV".into(), value: sv.into() };
        ParameterSet {
            name: "winter".into(),
            device: "TIC-1".into(),
            profile: "fuji_pxr".into(),
            saved: Timestamp::UNIX_EPOCH,
            by: "anna".into(),
            given: Vec::new(),
            values: vec![value],
            units: Default::default(),
            missing: Vec::new(),
        }
    }

    #[test]
    fn a_set_survives_a_restart_and_accidental_saves() {
        let def = load(Path::new("tank"), &Search::shipped()).unwrap();
        let home = tempfile::tempdir().unwrap();
        let folder = folder(&home.path().join("tank.duckdb"), "tank");
        assert_eq!(work(&folder, &def, SetWork::Read), (None, Vec::new()));
        let save = |sv, replace| {
            let work_to_do = SetWork::Write { command: COMMAND, set: Box::new(winter(sv)), replace };
            let (written, sets) = work(&folder, &def, work_to_do);
            let held = sets.first().and_then(|stored| stored.set.as_ref().ok()).map(|set| set.values[0].value.near());
            (written.unwrap().1, held, fs::read_dir(&folder).unwrap().count())
        };
        assert_eq!(save(70.0, false), (Ok(()), Some(70.0), 1));
        assert_eq!(save(75.0, false), (Err("there is a set winter already".into()), Some(70.0), 1));
        assert_eq!(save(75.0, true), (Ok(()), Some(75.0), 1));
    }

    #[test]
    fn a_pipe_in_the_folder_does_not_block() {
        let def = load(Path::new("tank"), &Search::shipped()).unwrap();
        let home = tempfile::tempdir().unwrap();
        let pipe = home.path().join("pipe.toml");
        rustix::fs::mkfifoat(rustix::fs::CWD, pipe, rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR).unwrap();
        let (_, sets) = work(home.path(), &def, SetWork::Read);
        assert_eq!(sets, [unreadable("pipe", "pipe.toml cannot be read: not a regular file".into())]);
    }

    #[test]
    fn unreadable_sets_are_reported() {
        let def = load(Path::new("tank"), &Search::shipped()).unwrap();
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("sets");
        fs::write(&file, "a file where the folder should be").unwrap();
        let (_, sets) = work(&file, &def, SetWork::Read);
        assert_eq!((sets.len(), sets[0].name.as_str()), (1, "the folder"));
        let why = &sets[0].set.as_ref().unwrap_err()[0];
        assert!(why.starts_with(&format!("{} cannot be read: ", file.display())), "{why}");
        for n in 0..SETS_MAX + 37 {
            fs::write(home.path().join(format!("s{n:03}.toml")), "").unwrap();
        }
        let (_, sets) = work(home.path(), &def, SetWork::Read);
        let last = sets.last().map(|stored| stored.name.as_str());
        assert_eq!((sets.len(), last), (SETS_MAX + 1, Some("… 37 more not read")));
    }

    #[test]
    fn a_file_that_is_no_set_is_reported() {
        let def = load(Path::new("tank"), &Search::shipped()).unwrap();
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("a.toml"), "SV = 70").unwrap();
        fs::write(home.path().join("big.toml"), vec![b'#'; BYTES_MAX as usize + 2]).unwrap();
        fs::write(home.path().join("notes.txt"), "not for us").unwrap();
        fs::create_dir(home.path().join("folder.toml")).unwrap();
        fs::write(home.path().join("winter.toml"), text_of_set(&winter(70.0), &def)).unwrap();
        let (_, sets) = work(home.path(), &def, SetWork::Read);
        let good: Vec<(&str, bool)> = sets.iter().map(|stored| (stored.name.as_str(), stored.set.is_ok())).collect();
        assert_eq!(good, [("a", false), ("big", false), ("folder", false), ("winter", true)]);
        let problems = sets[0].set.as_ref().unwrap_err();
        assert!(problems.iter().any(|words| words.contains("a.toml:1:1") && words.contains("SV")), "{problems:?}");
    }
}
