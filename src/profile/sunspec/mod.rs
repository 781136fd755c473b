//! SunSpec: devices that say themselves which models they have. What was found of one becomes a device profile like any
//! other, as text. Pure.
//!
//! Data types, markers and scale factors: SunSpec device information model specification; the models: `profiles/sunspec`.

mod models;
mod poll;
mod text;

pub(crate) use self::{
    models::{Kind, kind_of},
    text::profile_text,
};
use crate::{plant::tag::Table, profile::new_plant::plain_name};

/// `SunS`, with which the models of a device begin.
pub(crate) const MARKER: [u16; 2] = [0x5375, 0x6E53];
/// Where it stands.
pub(crate) const BASES: [u16; 3] = [40_000, 0, 50_000];
/// The model that says who made the device.
pub(crate) const COMMON: u16 = 1;
/// The model behind the last.
pub(crate) const END: u16 = 0xFFFF;

/// The models of a device, in the order of their registers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SunSpecDevice {
    /// Where they are read.
    pub table: Table,
    /// Where the marker stands.
    pub base: u16,
    /// What follows it.
    pub models: Vec<FoundModel>,
    /// There may be more of them, or of what they hold.
    pub is_cut: bool,
}

/// A model, as its device says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FoundModel {
    /// Its number.
    pub id: u16,
    /// The register behind number and length.
    pub address: u16,
    /// Registers from there on.
    pub length: u16,
    /// What they hold; `None` where they could not be read.
    pub words: Vec<Option<u16>>,
}

impl FoundModel {
    /// The register at an address of the wire; `None` outside of it, and where it was not read.
    pub(crate) fn word(&self, address: u32) -> Option<u16> {
        let at = usize::try_from(address.checked_sub(self.address.into())?).ok()?;
        self.words.get(at).copied().flatten()
    }

    /// The address behind its last register.
    pub(crate) fn end(&self) -> u32 {
        u32::from(self.address) + u32::from(self.length)
    }
}

/// The name of the profile of a device, for a plant file that is called so.
pub(crate) fn profile_name(plant: &str) -> String {
    format!("{}_sunspec", plain_name(plant).replace('.', "_"))
}

impl SunSpecDevice {
    /// Maker, model and version, as the device says; empty where it does not.
    pub(crate) fn identity(&self) -> [String; 3] {
        let common = self.models.iter().find(|found| found.id == COMMON);
        // Mn, Md, Opt and Vr, of 16, 16, 8 and 8 registers.
        [(0, 16), (16, 16), (40, 8)].map(|(at, count)| {
            let Some(found) = common.filter(|found| at + count <= usize::from(found.length)) else {
                return String::new();
            };
            let words = found.words.iter().skip(at).take(count).map_while(|word| *word);
            let bytes: Vec<u8> = words.flat_map(u16::to_be_bytes).take_while(|byte| *byte != 0).collect();
            String::from_utf8_lossy(&bytes)
                .chars()
                .filter(|letter| !letter.is_control())
                .collect::<String>()
                .trim()
                .to_owned()
        })
    }
}

#[cfg(test)]
mod tests;
