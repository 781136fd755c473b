//! The device profiles of the user, read once, for what may not read files itself: recognition and a new plant file.

use std::{collections::BTreeMap, sync::Arc};

use super::{
    Card, Checked, Errors, Kind, Listed, check_device, library, plant, shipped_cards, shipped_device, shipped_devices,
};
use crate::plant::PlantDef;

/// Their texts by name; a profile of the program that has the same name gives way.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OwnProfiles {
    pub(super) texts: BTreeMap<String, plant::Text>,
}

impl OwnProfiles {
    /// One that lies in the folder that the program was started in.
    pub fn of_text(name: &str, text: &str) -> OwnProfiles {
        let text = plant::Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() };
        OwnProfiles { texts: BTreeMap::from([(name.to_owned(), text)]) }
    }

    /// Adds one that is not on the disk yet; it lies beside the plant file once it is.
    pub fn add(&mut self, name: &str, text: &str) {
        let text = plant::Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() };
        self.texts.insert(name.to_owned(), text);
    }

    /// The text of one of them.
    pub fn text(&self, name: &str) -> Option<&str> {
        std::str::from_utf8(&self.texts.get(name)?.bytes).ok()
    }

    /// The file of a profile that only plant files beside it can name.
    pub fn beside(&self, name: &str) -> Option<&str> {
        self.texts.get(name).map(|text| text.file.as_str()).filter(|file| !file.starts_with('/'))
    }

    /// Files with errors: their devices are not recognised.
    pub fn broken(&self) -> Vec<&str> {
        let is_broken = |(name, text): &(&String, &plant::Text)| check_device(name, (*text).clone()).is_err();
        self.texts.iter().filter(is_broken).map(|(_, text)| text.file.as_str()).collect()
    }

    /// The profiles that say by what their device is recognised, each as the only device of a plant of its name.
    pub fn recognisable(&self) -> Vec<Arc<PlantDef>> {
        // Of a whole library few say it: the others are not even checked.
        let says = |name: &String| self.find(name).is_some_and(|text| text.bytes.windows(9).any(|b| b == b"signature"));
        let plants = self.names().into_iter().filter(says).filter_map(|name| self.device(&name));
        plants.filter(|def| def.devices.iter().any(|device| !device.signature.is_empty())).collect()
    }

    /// Every profile without errors, each as the only device of a plant of its name.
    pub fn all(&self) -> Vec<Arc<PlantDef>> {
        self.names().into_iter().filter_map(|name| self.device(&name)).collect()
    }

    /// All of them at a glance.
    pub fn cards(&self) -> Vec<Card> {
        let own = self.texts.iter().map(|(name, text)| {
            let (kind, folder, from) = (Kind::Device, String::new(), Some(text.file.clone().into()));
            (Listed { kind, name: name.clone(), folder, from }, Some(text.clone()))
        });
        let shipped = shipped_cards().into_iter().filter(|card| !self.texts.contains_key(&card.listed.name));
        shipped.chain(library::cards(own)).collect()
    }

    /// The device of a profile as the only one of a plant; `None` for a profile that there is not, or with errors.
    pub fn device(&self, name: &str) -> Option<Arc<PlantDef>> {
        check_device(name, self.find(name)?).ok().map(|checked| checked.plant)
    }

    /// Checks the text of a plant file that is not written yet.
    pub fn check(&self, name: &str, text: &str) -> Result<Checked, Errors> {
        let library = plant::Library { find: &|name| Ok(self.find(name)), names: self.names(), is_program: &|_| true };
        let text = plant::Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() };
        plant::build(name, &text, &library).map(|(def, warnings)| Checked { plant: Arc::new(def), warnings })
    }

    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = shipped_devices().chain(self.texts.keys().cloned()).collect();
        // Of two that fit as well the last is taken: the user's own.
        names.sort_by_cached_key(|name| (self.texts.contains_key(name), name.clone()));
        names.dedup();
        names
    }

    fn find(&self, name: &str) -> Option<plant::Text> {
        self.texts.get(name).cloned().or_else(|| shipped_device(name))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::profile::{Search, own_profiles, text_of};

    #[test]
    fn profiles_beside_the_plant_and_of_the_user_are_recognised() {
        let root = tempfile::tempdir().unwrap();
        let (here, user) = (root.path().join("here"), root.path().join("user"));
        std::fs::create_dir_all(user.join("devices")).unwrap();
        std::fs::create_dir(&here).unwrap();
        let fuji = text_of("fuji_pxr", &Search::shipped()).unwrap();
        let put = |path: &Path, text: &str| std::fs::write(path, text).unwrap();
        put(&user.join("devices/mine.toml"), &fuji.replace("model = \"PXR\"", "model = \"USER\""));
        put(&here.join("mine.toml"), &fuji.replace("model = \"PXR\"", "model = \"HERE\""));
        let (head, rest) = fuji.split_once("[signature]").unwrap();
        let silent = format!("{head}{}", rest.split_once("]\n\n").unwrap().1);
        put(&here.join("silent.toml"), &silent.replace("model = \"PXR\"", "model = \"SILENT\""));
        put(&here.join("broken.toml"), &fuji.replace("address_base = 0", "address_base = 7"));
        put(&here.join("plant.toml"), "title = \"P\"\ntime_zone = \"UTC\"\n[[line]]\n");
        let own = own_profiles(&Search::folders(vec![user.clone()]), &here.join("plant.toml"));
        let models = |own: &OwnProfiles| -> Vec<String> {
            own.recognisable().iter().map(|def| def.devices[0].model.clone()).collect()
        };
        let shipped = models(&OwnProfiles::default());
        let added: Vec<String> = models(&own).into_iter().filter(|model| !shipped.contains(model)).collect();
        assert_eq!(added, ["FUJI HERE"], "the one beside the plant file wins; without a signature none is recognised");
        assert_eq!(own.recognisable().last().map(|def| def.name.as_str()), Some("mine"), "of two that fit, the own");
        assert_eq!(own.broken(), [here.join("broken.toml").display().to_string()]);
        let plant = "title = \"P\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L1\"\nmode = \"tcp\"\nhost = \"plc\"\n\
                     [[device]]\nname = \"D-1\"\nprofile = \"silent\"\nline = \"L1\"\nunit = 1\n";
        assert!(own.check("p", plant).is_ok());
        assert!(OwnProfiles::default().check("p", plant).is_err());
    }
}
