//! `sightglass new` asks which device profile a unit has: its own models, the likeliest, or one that is searched by words.

use std::{collections::BTreeSet, sync::Arc};

use super::{
    CliError,
    prompt::{ask_until, selection},
    recognition::{FoundKind, sunspec_words},
    say,
};
use crate::{
    bus::recognise::Ranked,
    plant::{
        PlantDef,
        tag::{Access, Poll, TagDef},
    },
    profile::{
        Card, OwnProfiles, find_cards,
        sunspec::{SunSpecDevice, profile_text},
    },
};

/// Profiles that are listed of those that fit a search.
const FOUND_MAX: usize = 10;
/// Profiles that nearly fit and are named with the reason why they do not.
const NEAR_MAX: usize = 3;

/// The profile of a unit; `None`: it has none. What was made of its models is added to the profiles, and its name to `made`.
pub async fn ask_profile(
    unit: u8,
    kind: &FoundKind,
    profiles: &mut OwnProfiles,
    made: &mut Vec<String>,
    names: impl Iterator<Item = String>,
) -> Result<Option<Arc<PlantDef>>, CliError> {
    let usual = match kind {
        FoundKind::SunSpec(device) => sunspec(unit, device, profiles, made, names),
        FoundKind::Other(ranked) => likeliest(unit, ranked),
    };
    ask_until("  profile, words to search for one, or none", &usual, |answer| chosen(answer, profiles)).await
}

/// Makes the profile of a device that says what it has; gives its name.
fn sunspec(
    unit: u8,
    device: &SunSpecDevice,
    profiles: &mut OwnProfiles,
    made: &mut Vec<String>,
    mut names: impl Iterator<Item = String>,
) -> String {
    say(&sunspec_words(unit, device));
    let name = names.find(|name| profiles.text(name).is_none()).unwrap_or_else(|| "sunspec".to_owned());
    profiles.add(&name, &profile_text(device));
    made.push(name.clone());
    name
}

/// The profile that fits; else says why those that nearly do not.
fn likeliest(unit: u8, ranked: &[Ranked]) -> String {
    if let Some(Ranked { def, fit, .. }) = ranked.first().filter(|best| best.fit.is_enough()) {
        say(&format!("unit {unit}: looks like {}, {} of {} probes fit", model_of(def), fit.fits, fit.of));
        return def.name.clone();
    }
    say(&format!("unit {unit}: not recognised"));
    for Ranked { def, fit, misses } in ranked.iter().filter(|ranked| 0 < ranked.fit.fits).take(NEAR_MAX) {
        let why = misses.first().map_or_else(|| "too few different numbers".to_owned(), ToString::to_string);
        say(&format!("  not {} ({}): {} of {} probes fit; {why}", def.name, model_of(def), fit.fits, fit.of));
    }
    "none".to_owned()
}

/// A profile by its name; words are searched for, and what was found is said.
fn chosen(answer: &str, profiles: &OwnProfiles) -> Result<Option<Arc<PlantDef>>, String> {
    if answer == "none" {
        return Ok(None);
    }
    if let Some(def) = profiles.device(answer) {
        return Ok(Some(def));
    }
    let found = find_cards(profiles.cards(), answer);
    if found.is_empty() {
        return Err(format!("no device profile fits `{answer}`; `sightglass profiles` lists them"));
    }
    let width = found.iter().map(|card| card.listed.name.len()).max().unwrap_or_default();
    let row = |Card { listed, vendor, model, .. }: &Card| format!("    {:width$}  {vendor} {model}", listed.name);
    let rows: Vec<String> = found.iter().take(FOUND_MAX).map(row).collect();
    Err(format!("{}\n  type the name of one", rows.join("\n")))
}

fn model_of(def: &PlantDef) -> String {
    def.devices.first().map(|device| device.model.clone()).unwrap_or_default()
}

/// Which models of a device are kept, and whether these are all; the tags of the others are never read.
pub async fn kept_models(def: &PlantDef) -> Result<(Vec<TagDef>, bool), CliError> {
    let mut names: Vec<String> = Vec::new();
    for tag in &def.tags {
        if !names.contains(&tag.group) {
            names.push(tag.group.clone());
        }
    }
    for (n, name) in names.iter().enumerate() {
        let count = def.tags.iter().filter(|tag| tag.group == *name).count();
        say(&format!("  {:>3} {name:24} values {count}", n + 1));
    }
    let chosen = ask_until("  models to keep", "all", |answer| selection(answer, &names)).await?;
    let kept: BTreeSet<&str> = chosen.iter().filter_map(|at| names.get(*at)).map(String::as_str).collect();
    let is_kept =
        |tag: &&TagDef| tag.access != Access::Write && tag.poll != Poll::Never && kept.contains(tag.group.as_str());
    let tags = def.tags.iter().filter(is_kept);
    Ok((tags.cloned().collect(), kept.len() == names.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_find_a_profile_by_name_model_or_kind() {
        let profiles = OwnProfiles::of_text("mine", "vendor = 'ACME'\nmodel = 'Nine'\n");
        let found = |words: &str| chosen(words, &profiles).expect_err("names to choose from");
        assert!(found("sdm 630").contains("eastron_sdm630") && !found("sdm 630").contains("fuji_pxr"));
        assert!(found("meters socomec").contains("socomec_countis_e3x"));
        assert!(
            found("acme").lines().any(|row| row.contains("mine") && row.ends_with("ACME Nine")),
            "{}",
            found("acme")
        );
        assert!(found("qqqq zzzz").contains("no device profile fits"));
        assert!(chosen("fuji_pxr", &profiles).is_ok_and(|def| def.is_some()));
    }

    #[test]
    fn a_profile_that_nearly_fits_says_which_probe_does_not() {
        use crate::bus::recognise::{Expected, Miss};
        let missed = |read| Miss { tag: "P-DP".into(), read, expected: Expected::Ranges(vec![(0.0, 0.0), (1.0, 9.0)]) };
        assert_eq!(missed(Some(77.0)).to_string(), "P-DP is 77, expected 0, 1…9");
        assert_eq!(missed(None).to_string(), "P-DP cannot be read");
    }
}
