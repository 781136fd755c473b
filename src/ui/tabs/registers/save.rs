//! Keeps what has a name as a plant file: the same device with mimic, alarms, history and reports.

use std::{path::PathBuf, sync::Arc};

use super::{Asking, Registers, preview, recognise::SUNSPEC};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        PlantDef,
        def::LineDef,
        exact::Exact,
        tag::{Access, Decimals, TagDef},
    },
    profile::{
        new_plant::{NewAlarm, NewDevice, NewPlant, of_interest, plain_name, usual_shifts},
        suggested_alarms::{plausible_alarms, suggested_alarms},
        sunspec,
    },
    register_map::{self, named::Named},
    ui::Effect,
};

impl Registers {
    /// Asks for the file, where there is something to keep.
    pub(super) fn ask_save(&mut self) -> Vec<UiAction> {
        if self.names.is_empty() {
            let words =
                t!("Nothing has a name yet: take those of the device with ⏎, or load a list from its manual with N.");
            return vec![UiAction::Open(Modal::Notice(Notice::new(t!("save"), vec![words.to_owned()])))];
        }
        self.asking = Asking::Save;
        let hint = t!("a new plant file; an existing file is never overwritten");
        vec![UiAction::Open(Modal::Prompt(Prompt::new(t!("save as plant file"), hint, "bench.toml")))]
    }

    /// Writes the plant file, which was loaded before as a check.
    pub(super) fn save(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let mut path = PathBuf::from(text);
        path.set_extension("toml");
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        if stem.is_empty() || text.is_empty() {
            return Err(t!("expected the name of a file such as bench.toml").to_owned());
        }
        let here = path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
        let beside = |def: &Arc<PlantDef>| self.profiles.beside(&def.name);
        let applied = self.recognition.applied();
        // What was made of the models of the device is not on the disk yet, and goes beside the plant file.
        let made =
            applied.filter(|def| def.name == SUNSPEC).and_then(|_| self.profiles.text(SUNSPEC)).map(str::to_owned);
        if let Some(profile) = applied.and_then(beside).filter(|_| !here && made.is_none()) {
            return Err(t!("{profile} would not be found from there: save the plant file beside it", profile));
        }
        let mut plant = self.new_plant(cx, &stem).ok_or_else(|| t!("there is no line").to_owned())?;
        let Some(made) = made else {
            let bytes = plant.text(&self.profiles)?.into_bytes();
            return Ok(vec![save_new(vec![(path, bytes)])]);
        };
        let name = sunspec::profile_name(&stem);
        let mut profiles = self.profiles.clone();
        profiles.add(&name, &made);
        plant.devices.iter_mut().filter_map(|device| device.profile.as_mut()).for_each(|of| of.0.clone_from(&name));
        let bytes = plant.text(&profiles)?.into_bytes();
        let profile = path.with_file_name(format!("{name}.toml"));
        Ok(vec![save_new(vec![(profile, made.into_bytes()), (path, bytes)])])
    }

    /// Files were written, or not.
    pub(super) fn on_written(&self, result: Result<PathBuf, String>) -> Vec<UiAction> {
        vec![outcome(result, self.asking == Asking::Profile)]
    }

    fn new_plant(&self, cx: &ViewContext, stem: &str) -> Option<NewPlant> {
        let def = cx.def();
        let line = LineDef { name: "L1".to_owned(), ..def.lines.get(self.line.index())?.clone() };
        let profile = self.recognition.applied();
        let mut taken: Vec<String> = Vec::new();
        let tags = self.names.iter().filter(|named| !profile.is_some_and(|profile| is_of(named, &profile.tags)));
        let tags = tags.map(|named| {
            let is_written = self.writing.has_written(self.unit, named.table, named.address);
            let tag = tag_of(named, &taken);
            let tag = if is_written { TagDef { access: Access::ReadWrite, ..tag } } else { tag };
            taken.push(tag.short.clone());
            tag
        });
        let device = NewDevice {
            name: plain_name(stem).replace('.', "_"),
            line: 0,
            unit: self.unit,
            controller: profile.is_some_and(|profile| profile.devices.iter().any(|device| device.faceplate.is_some())),
            tags: tags.collect(),
            unpolled: Vec::new(),
            profile: profile.map(|profile| (profile.name.clone(), of_interest(&profile.tags))),
        };
        Some(NewPlant {
            title: def.title.clone(),
            time_zone: def.time_zone.iana_name().unwrap_or("UTC").to_owned(),
            lines: vec![(line, self.replies)],
            alarms: self.alarms_of(&device, profile),
            devices: vec![device],
            shifts: usual_shifts(),
        })
    }
}

impl Registers {
    /// Those that the profile suggests, and limits beyond what was read of the rest.
    fn alarms_of(&self, device: &NewDevice, profile: Option<&Arc<PlantDef>>) -> Vec<NewAlarm> {
        let of_profile = profile.map(|profile| suggested_alarms(&device.name, &profile.tags)).unwrap_or_default();
        let seen = |tag: &TagDef| {
            let (table, address) = (tag.point.table, tag.point.address);
            let named = self.cells.scaled(self.names.get(table, address)?);
            let now = self.cells.held(table, address, named.count()).and_then(|words| named.value(&words));
            let cell = self.cells.get(table, address).filter(|_| named.count() == 1);
            let before = cell.into_iter().flat_map(|cell| &cell.seen).filter_map(|(_, word)| named.value(&[*word]));
            let values = before.chain(now).map(Exact::near);
            values.fold(None, |range: Option<(f64, f64)>, value| {
                Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
            })
        };
        of_profile.into_iter().chain(plausible_alarms(&device.name, &device.tags, &seen)).collect()
    }

    /// Shows a register list before it is taken; or says why it is none.
    pub(super) fn load_list(&mut self, cx: &ViewContext, bytes: &[u8]) -> Vec<UiAction> {
        self.preview(cx, bytes).unwrap_or_else(|why| vec![no_list(why)])
    }
}

impl Registers {
    /// Asks for the file of a profile of the list that is shown.
    pub(super) fn ask_profile(&mut self) -> Vec<UiAction> {
        self.asking = Asking::Profile;
        let hint = t!("a new device profile; an existing file is never overwritten");
        vec![UiAction::Open(Modal::Prompt(Prompt::new(t!("save as device profile"), hint, "device.toml")))]
    }

    /// Writes all of the list as a device profile, which was checked before; says what was left out.
    pub(super) fn save_profile(&mut self, text: &str) -> Result<Vec<UiAction>, String> {
        let mut path = PathBuf::from(text);
        path.set_extension("toml");
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        if stem.is_empty() || text.is_empty() {
            return Err(t!("expected the name of a file such as bench.toml").to_owned());
        }
        let list = self.preview.as_ref().map(preview::Preview::list).ok_or_else(|| t!("it is empty").to_owned())?;
        let written = register_map::profile::written(list, &plain_name(&stem), t!("a list"))?;
        let mut actions = vec![save_new(vec![(path, written.text.into_bytes())])];
        if !written.problems.is_empty() {
            actions.push(UiAction::Open(Modal::Notice(Notice::list(t!("save as device profile"), written.problems))));
        }
        Ok(actions)
    }
}

/// Writes files that are not there yet.
fn save_new(files: Vec<(PathBuf, Vec<u8>)>) -> UiAction {
    UiAction::Do(Effect::SaveNew { tab: Tab::Registers, files })
}

pub fn no_list(why: String) -> UiAction {
    UiAction::Open(Modal::Notice(Notice::new(t!("load a register list"), vec![why])))
}

/// What became of the file.
fn outcome(result: Result<PathBuf, String>, is_profile: bool) -> UiAction {
    let words = match result {
        Ok(path) if is_profile => vec![
            t!("saved {path}", path = path.display()),
            t!(
                "sightglass check {file} says what is in it; a plant file beside it names it as profile.",
                file = path.display()
            ),
        ],
        Ok(path) => vec![
            t!("saved {path}", path = path.display()),
            t!(
                "sightglass {file} is then the same device with mimic, alarms, history and reports.",
                file = path.display()
            ),
        ],
        Err(why) => vec![t!("nothing was saved").to_owned(), why],
    };
    UiAction::Open(Modal::Notice(Notice::new(t!("save"), words)))
}

/// Is it called so by the profile?
fn is_of(named: &Named, tags: &[TagDef]) -> bool {
    let same = |tag: &TagDef| (tag.point.table, tag.point.address) == (named.table, named.address);
    tags.iter().any(|tag| same(tag) && tag.short == named.name)
}

/// A tag of its own with a name that no other has.
fn tag_of(named: &Named, taken: &[String]) -> TagDef {
    let plain = plain_name(&named.name);
    let short = if taken.contains(&plain) { format!("{plain}_{}", named.address) } else { plain };
    named.tag(&short)
}

/// The decimals of a tag that [`Named::tag`] has made.
pub fn decimals(tag: &TagDef) -> u8 {
    if let Decimals::Fixed(decimals) = tag.decimals { decimals } else { 0 }
}
