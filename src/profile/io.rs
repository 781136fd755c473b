//! Finds and reads plant files and device profiles: beside the plant file, in configuration folders, or in the binary.

pub mod atomic;
pub mod regular;
mod save;
mod shipped;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    sync::LazyLock,
};

use super::{Kind, Listed, diagnostic::Errors, plant::Text};

pub use save::PlantFile;

/// A profile is some kilobytes; whatever is larger than this is something else.
const BYTES_MAX: u64 = 4 << 20;

/// The user's configuration folder: `$XDG_CONFIG_HOME/sightglass`, else `~/.config/sightglass`.
pub fn config_folder() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    // The XDG rules say that a relative path is to be ignored.
    let config = set("XDG_CONFIG_HOME").filter(|path| path.is_absolute());
    let config = config.or_else(|| set("HOME").map(|home| home.join(".config")));
    config.map(|config| config.join("sightglass"))
}

/// Configuration folders that are looked into before the shipped profiles, the first one first.
///
/// In each, a device profile is `devices/NAME.toml`, `NAME.toml` or `devices/FOLDER/NAME.toml`, a plant is
/// `plants/NAME.toml`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Search {
    folders: Vec<PathBuf>,
}

impl Search {
    /// The user's configuration folder, then `/etc/sightglass`.
    pub fn usual() -> Search {
        Search { folders: config_folder().into_iter().chain([PathBuf::from("/etc/sightglass")]).collect() }
    }
    /// Only what comes with the program and lies beside the plant file.
    pub fn shipped() -> Search {
        Search::default()
    }
    /// These folders, the first one first.
    #[cfg(test)]
    pub fn folders(folders: Vec<PathBuf>) -> Search {
        Search { folders }
    }
    /// The same, with the plant file's own folder in front.
    pub(super) fn beside(&self, plant: &Path) -> Search {
        let own = plant.parent();
        // A folder `plants` has its devices in the folder `devices` next to it.
        let sibling = own.filter(|own| own.ends_with("plants")).and_then(Path::parent);
        let front = own.into_iter().chain(sibling).map(Path::to_path_buf);
        Search { folders: front.chain(self.folders.iter().cloned()).collect() }
    }
}

/// A plant file that was found.
pub(super) struct FoundPlant {
    /// The stem of the file.
    pub name: String,
    /// Its text.
    pub text: Text,
    /// Where it lies; `None` for a shipped one.
    pub path: Option<PathBuf>,
}

impl FoundPlant {
    /// The file on disk, to save settings into.
    pub fn file(&self) -> Option<PlantFile> {
        Some(PlantFile::new(self.path.as_deref()?, &self.text.bytes))
    }
}

/// Reads the plant file that an argument means: a path, or the name of a plant.
pub(super) fn plant(argument: &Path, search: &Search) -> Result<FoundPlant, Errors> {
    find(Kind::Plant, argument, search)
}

/// Reads the scenario that an argument means: a path, or the name of a scenario. Gives its name and text.
pub(crate) fn scenario(argument: &Path, search: &Search) -> Result<(String, Text), Errors> {
    find(Kind::Scenario, argument, search).map(|found| (found.name, found.text))
}

fn find(kind: Kind, argument: &Path, search: &Search) -> Result<FoundPlant, Errors> {
    let folder = folder_of(kind);
    let name = argument.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let by_name = argument.to_str().filter(|name| plain(name)).map(|name| format!("{name}.toml"));
    let in_folders = by_name.iter().flat_map(|file| search.folders.iter().map(move |f| f.join(folder).join(file)));
    let path = std::iter::once(argument.to_path_buf()).chain(in_folders).find(|path| path.is_file());
    if let Some(path) = path {
        let file = path.display().to_string();
        let bytes =
            read(&path).map_err(|why| Errors::unreadable(format!("{file} cannot be read: {why}"), String::new()))?;
        return Ok(FoundPlant { name, text: Text { file, bytes }, path: Some(path) });
    }
    let inside = match &by_name {
        Some(_) => shipped::named(folder, &name),
        None => argument.strip_prefix("profiles").ok().and_then(|inside| shipped::at(inside.to_str()?)),
    };
    match inside {
        Some(text) => Ok(FoundPlant { name, text, path: None }),
        None => Err(missing(kind, argument, &name, search)),
    }
}

fn missing(kind: Kind, argument: &Path, name: &str, search: &Search) -> Errors {
    let word = kind.word();
    let what = if argument.exists() { "is not a file" } else { "does not exist" };
    let known: Vec<String> = list(search).into_iter().filter(|l| l.kind == kind).map(|l| l.name).collect();
    let near = known.iter().find(|known| strsim::damerau_levenshtein(known, name) <= 1);
    let help = match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("give the path of a {word} file, or one of the known {word}s: {}", known.join(", ")),
    };
    Errors::unreadable(format!("the {word} file {} {what}", argument.display()), help)
}

/// Reads the device profile of a name: the first folder that has it wins, the shipped one comes last.
pub(super) fn device(name: &str, search: &Search) -> Result<Option<Text>, String> {
    if !plain(name) {
        return Ok(None);
    }
    match path_of(name, &places(Kind::Device, search)) {
        Some(path) => {
            let bytes = read(&path).map_err(|why| format!("{}: {why}", path.display()))?;
            Ok(Some(Text { file: path.display().to_string(), bytes }))
        }
        None => Ok(shipped::named("devices", name)),
    }
}

/// The device profile that an argument of `check` means: a file without lines and devices of its own, or a known name.
pub(super) fn device_file(argument: &Path, search: &Search) -> Option<(String, Text)> {
    if !argument.is_file() {
        let name = argument.to_str().filter(|name| plain(name))?;
        return device(name, search).ok().flatten().map(|text| (name.to_owned(), text));
    }
    // Whatever a file is called: its name stands in a plant that is made around it.
    let letter = |c: char| if plain(c.encode_utf8(&mut [0; 4])) { c } else { '_' };
    let stem = argument.file_stem()?.to_str()?.chars().map(letter).collect();
    let bytes = read(argument).ok()?;
    let words = String::from_utf8_lossy(&bytes).into_owned();
    let has = |key: &str| words.lines().any(|line| line.trim_start().starts_with(key));
    let is_plant = has("[[line]]") || has("[[device]]") || has("time_zone");
    let is_device = !is_plant && (has("[[tag]]") || has("tag =") || has("vendor") || has("[link]"));
    is_device.then(|| (stem, Text { file: argument.display().to_string(), bytes }))
}

/// The device profiles on disk by name, each from the first folder that has it; what cannot be read is left out.
pub(super) fn own_devices(search: &Search) -> BTreeMap<String, Text> {
    let places = places(Kind::Device, search);
    let files = names_in(&places).into_iter().filter_map(|name| Some((path_of(&name, &places)?, name)));
    files.filter_map(|(path, name)| Some((name, device_file(&path, search)?.1))).collect()
}

/// The models of SunSpec: see [`super::sunspec`].
pub(super) fn sunspec_models() -> &'static str {
    static MODELS: LazyLock<String> = LazyLock::new(|| {
        let text = shipped::at("sunspec/models.txt").expect("it is packed");
        String::from_utf8(text.bytes).expect("it is text")
    });
    &MODELS
}

/// The names of all plants, device profiles and scenarios, with where each comes from.
pub fn list(search: &Search) -> Vec<Listed> {
    let mut all = Vec::new();
    for kind in Kind::ALL {
        let places = places(kind, search);
        // Whatever lies in the folder itself may be something else than a profile.
        let listed: Vec<PathBuf> = places.iter().filter(|place| !search.folders.contains(place)).cloned().collect();
        let shipped: BTreeMap<&str, &str> = shipped::names(folder_of(kind)).collect();
        let mut names = names_in(&listed);
        names.extend(shipped.keys().map(|name| String::from(*name)));
        for name in names {
            let from = path_of(&name, &places);
            let folder = match &from {
                Some(path) => {
                    path.parent().filter(|folder| folder.parent().is_some_and(|above| listed.contains(&above.into())))
                }
                None => shipped.get(name.as_str()).map(Path::new),
            };
            let folder = folder.and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
            all.push(Listed { kind, folder, from, name });
        }
    }
    all
}

/// The text of a plant or profile by its name.
pub fn text_of(name: &str, search: &Search) -> Option<String> {
    let named = |kind| find(kind, Path::new(name), search).ok().map(|found| found.text);
    let other = || plain(name).then(|| named(Kind::Plant).or_else(|| named(Kind::Scenario))).flatten();
    let text = device(name, search).ok().flatten().or_else(other)?;
    Some(String::from_utf8_lossy(&text.bytes).into_owned())
}

/// Is there a program that can be run by this name, in a folder of `PATH`, or at this path?
pub(super) fn is_program(name: &str) -> bool {
    let runs = |path: PathBuf| path.is_file() && rustix::fs::access(&path, rustix::fs::Access::EXEC_OK).is_ok();
    match name.contains('/') {
        true => runs(name.into()),
        false => std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).any(|path| runs(path.join(name))),
    }
}

fn folder_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Plant => "plants",
        Kind::Device => "devices",
        Kind::Scenario => "scenarios",
    }
}

/// The folders on disk that files of a kind lie in, the first one first.
fn places(kind: Kind, search: &Search) -> Vec<PathBuf> {
    let of = |base: &PathBuf| {
        let own = base.join(folder_of(kind));
        let others = match kind {
            Kind::Device => [vec![base.clone()], folders_in(&own)].concat(),
            Kind::Plant | Kind::Scenario => Vec::new(),
        };
        [vec![own], others].concat()
    };
    search.folders.iter().flat_map(of).collect()
}

fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = entries(folder).filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    // The empty path is the folder that the program was started in.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.read_dir().into_iter().flatten().flatten().map(|entry| entry.path())
}

fn names_in(places: &[PathBuf]) -> BTreeSet<String> {
    places.iter().flat_map(|place| entries(place)).filter_map(|path| stem(&path)).collect()
}

/// Where the file of a name lies on disk.
fn path_of(name: &str, places: &[PathBuf]) -> Option<PathBuf> {
    let file = format!("{name}.toml");
    places.iter().map(|place| place.join(&file)).find(|path| path.is_file())
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    regular::read(path, BYTES_MAX).map_err(|error| error.to_string())
}

fn stem(path: &Path) -> Option<String> {
    let toml = path.extension().is_some_and(|extension| extension == "toml");
    path.file_stem().filter(|_| toml).map(|stem| stem.to_string_lossy().into_owned())
}

/// A name, not a path: nothing that could lead out of the folders.
fn plain(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-')
}
