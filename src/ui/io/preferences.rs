//! Reads and writes the file of preferences in the user's configuration folder.

use std::{
    io,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use crate::{
    profile::io::{atomic::write_for_user, config_folder, regular},
    t,
    ui::preferences::{Kept, PreferencesFile},
};

/// A section has some hundred bytes; whatever is larger than this is something else.
const BYTES_MAX: u64 = 1 << 20;

/// The preferences of this account. What is wrong with them stands in the result.
pub fn load() -> PreferencesFile {
    path().map_or_else(|| PreferencesFile::new("", Some(no_folder())), |path| load_from(&path))
}

/// Puts a choice into the file as it is now; another program may have written it meanwhile. Blocks while the disk works.
pub fn keep(user: Option<&str>, chosen: Kept) -> Result<PreferencesFile, String> {
    // Two of this program share the name of the file that is written beside.
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    keep_in(&path().ok_or_else(no_folder)?, user, chosen)
}

fn path() -> Option<PathBuf> {
    Some(config_folder()?.join("preferences.toml"))
}

fn no_folder() -> String {
    t!("there is no home folder").to_owned()
}

fn load_from(path: &Path) -> PreferencesFile {
    let name = path.display().to_string();
    let problem = match read(path) {
        Ok(bytes) => return PreferencesFile::read(&name, &bytes),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => Some(format!("{name}: {error}")),
    };
    PreferencesFile::new(&name, problem)
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    regular::read(path, BYTES_MAX)
}

/// A file with a problem is never written over: what is wrong in it was meant to be something.
fn keep_in(path: &Path, user: Option<&str>, chosen: Kept) -> Result<PreferencesFile, String> {
    let mut file = load_from(path);
    if let Some(problem) = file.problem {
        return Err(problem);
    }
    file.set(user, chosen);
    write_for_user(path, file.text().as_bytes()).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(file)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::fs;

    use super::*;
    use crate::ui::{
        preferences::{Bell, Preferences},
        theme::ThemeName,
    };

    #[test]
    fn choices_are_kept_beside_those_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/preferences.toml");
        let [light, mono] =
            [ThemeName::Light, ThemeName::Mono].map(|theme| Preferences { theme, ..Default::default() });
        keep_in(&path, Some("anna"), Kept::Preferences(light)).unwrap();
        keep_in(&path, None, Kept::Preferences(mono)).unwrap();
        let file = load_from(&path);
        assert_eq!((file.of(Some("anna")), file.of(Some("somchai")), file.problem), (light, mono, None));
    }

    #[test]
    fn a_damaged_file_is_reported_and_never_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("preferences.toml");
        fs::write(&path, "[default]\ntheme = \"pink\"\nbell = \"once an alarm\"\n").unwrap();
        let file = load_from(&path);
        assert_eq!(file.of(None).bell, Bell::Once, "what is right is used");
        assert!(file.problem.is_some_and(|problem| problem.contains("preferences.toml:2:9")));
        assert!(keep_in(&path, None, Preferences::default().into()).unwrap_err().contains("preferences.toml:2:9"));
        assert!(fs::read_to_string(&path).unwrap().contains("pink"));
    }
}
