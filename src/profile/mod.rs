//! Profiles: TOML becomes a checked `PlantDef`, or every error at once with file, line and a suggestion.
//!
//! ```text
//!  plant file ─┐                      ┌─ tag ─── address, units
//!              ├─ reader ── schema ── plant ─ line, device
//!  profiles  ──┘  (layers,  (words)   ├─ alarm, lint
//!                 spans)              ├─ mimic, report
//!                                     └─ Arc<PlantDef>   or   diagnostic::Errors
//! ```
//!
//! Only `io` touches files; everything else works on texts.

/// Every key of plant files and profiles, in words.
pub const FORMAT_PAGE: &str = include_str!("../../profiles/README.md");

pub(crate) mod diagnostic;
pub(crate) mod renamed;
pub(crate) mod reader;
mod type_name;
mod raw_pattern;
mod address;
pub(crate) mod names;
mod schema;
mod texts;
mod signature;
pub(crate) mod tag_text;
mod units;
mod expr;
mod tag_keys;
mod batch;
mod north;
mod history;
mod interlock;
mod tag;
mod calculated;
mod condition;
mod device_alarms;
mod alarm;
mod set_file;
mod access;
mod sets;
mod simulate;
mod lint;
mod size;
mod repeat;
mod automatic_report;
mod device;
mod device_line;
mod run;
mod rows;
mod report;
mod program;
mod procedure;
mod picture;
mod mimic;
pub mod line;
mod plant;
mod library;
mod user_profiles;
mod edit;
pub(crate) mod new_plant;
pub(crate) mod sunspec;
pub(crate) mod io;
pub(crate) mod suggested_alarms;

#[cfg(test)]
mod shipped;
#[cfg(test)]
mod tests;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

pub(crate) use self::io::scenario;
pub(crate) use self::raw_pattern::sunspec_marker;
pub use self::{
    diagnostic::{Errors, render},
    io::{PlantFile, Search, list, text_of},
    library::{Card, find_cards},
    set_file::{read_set, text_of_set},
    user_profiles::OwnProfiles,
};
pub(crate) use self::{
    reader::duration as duration_of,
    units::{is_known as is_known_unit, of as unit_of},
};
pub use crate::plant::line_check::{BAUD_RANGE, BAUDS};
use crate::plant::{def::PlantDef, keyword::keyword_enum};

/// Loads a plant, or returns every error in it.
///
/// `plant` is the path of a plant file, or the name of a plant (`tank`) in a configuration folder or in the program.
/// A path such as `profiles/plants/tank.toml` that does not exist on disk but is shipped is taken from the program.
/// Device profiles are looked for beside the plant file, in the folders of `search`, then in the program.
pub fn load(plant: &Path, search: &Search) -> Result<Arc<PlantDef>, Errors> {
    load_with_file(plant, search).map(|(def, _)| def)
}

/// The same, with the file that it was loaded from, to save settings into; `None` for a plant of the program.
pub fn load_with_file(plant: &Path, search: &Search) -> Result<(Arc<PlantDef>, Option<PlantFile>), Errors> {
    load_warned(plant, search).map(|(checked, file)| (checked.plant, file))
}

fn load_warned(plant: &Path, search: &Search) -> Result<(Checked, Option<PlantFile>), Errors> {
    let found = io::plant(plant, search)?;
    let file = found.file();
    let search = found.path.as_deref().map_or_else(|| search.clone(), |path| search.beside(path));
    let names = io::list(&search).into_iter().filter(|listed| listed.kind == Kind::Device).map(|listed| listed.name);
    let library =
        plant::Library { find: &|name| io::device(name, &search), names: names.collect(), is_program: &io::is_program };
    plant::build(&found.name, &found.text, &library)
        .map(|(def, warnings)| (Checked { plant: Arc::new(def), warnings }, file))
}

/// A plant that can be used, and what could be better in its file.
#[derive(Debug)]
pub struct Checked {
    /// The plant.
    pub plant: Arc<PlantDef>,
    /// What the lint found; often nothing.
    pub warnings: Errors,
}

/// Checks a plant file or a device profile, by path or name. A device is checked as the only one of a plant of its own,
/// unit 1 on a serial line of 9600 baud, so that it has a read plan.
pub fn check(file: &Path, search: &Search) -> Result<Checked, Errors> {
    let Some((stem, text)) = io::device_file(file, search) else {
        return load_warned(file, search).map(|(checked, _)| checked);
    };
    check_device(&stem, text)
}

fn check_device(stem: &str, text: plant::Text) -> Result<Checked, Errors> {
    let around = format!(
        "title = \"{stem}\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L1\"\nmode = \"rtu\"\nport = \"/dev/ttyUSB0\"\nbaud = 9600\nparity = \"N\"\n\
         [[device]]\nname = \"D-1\"\nprofile = \"{stem}\"\nline = \"L1\"\nunit = 1\n"
    );
    let plant = plant::Text { file: format!("a plant around {}", text.file), bytes: around.into_bytes() };
    let (file, bytes) = (text.file, text.bytes);
    let find = |_: &str| Ok(Some(plant::Text { file: file.clone(), bytes: bytes.clone() }));
    plant::build(stem, &plant, &plant::Library { find: &find, names: vec![stem.to_owned()], is_program: &|_| true })
        .map(|(def, warnings)| Checked { plant: Arc::new(def), warnings })
}

/// Checks the text of a device profile that is not written yet.
pub(crate) fn check_text(name: &str, text: &str) -> Result<Checked, Errors> {
    check_device(name, plant::Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() })
}

/// The device profiles of the configuration folders and beside a plant file: those that the plant file can name.
pub fn own_profiles(search: &Search, plant: &Path) -> OwnProfiles {
    OwnProfiles { texts: io::own_devices(&search.beside(plant)) }
}

/// The text of a device profile of the program.
fn shipped_device(name: &str) -> Option<plant::Text> {
    io::device(name, &Search::shipped()).ok().flatten()
}

/// The text of the models of SunSpec: see [`sunspec`].
fn sunspec_models() -> &'static str {
    io::sunspec_models()
}

/// The names of all device profiles of the program.
fn shipped_devices() -> impl Iterator<Item = String> {
    io::list(&Search::shipped()).into_iter().filter(|listed| listed.kind == Kind::Device).map(|listed| listed.name)
}

/// Those of the program at a glance.
fn shipped_cards() -> Vec<Card> {
    cards(&Search::shipped())
}

/// All device profiles at a glance, the kinds of device one after the other.
pub fn cards(search: &Search) -> Vec<Card> {
    let devices = list(search).into_iter().filter(|listed| listed.kind == Kind::Device);
    library::cards(devices.map(|listed| {
        let text = io::device(&listed.name, search).ok().flatten();
        (listed, text)
    }))
}

/// A plant or device profile that could be loaded by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Plant or device.
    pub kind: Kind,
    /// `fuji_pxr`.
    pub name: String,
    /// The folder of its kind of device, as `controllers`; empty where it lies in none.
    pub folder: String,
    /// The file it comes from; `None` if it is shipped in the program.
    pub from: Option<PathBuf>,
}

keyword_enum! {
    /// The kinds of profile.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Kind: "kind of profile" {
        /// A whole plant.
        Plant => "plant",
        /// A device.
        Device => "device",
        /// A drill on a simulated plant.
        Scenario => "scenario",
    }
}
