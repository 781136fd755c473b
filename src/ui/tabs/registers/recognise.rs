//! Which device it looks like: walks its SunSpec models, or asks what the signatures of the device profiles ask, once, behind
//! the values that the window shows, and gives the registers the names of the profile that fits.

use std::sync::Arc;

use super::{ReadFor, Registers};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::{
        live::Retries,
        recognise::{self, Fit},
        sunspec::Walk,
    },
    plant::{
        PlantDef,
        live::{AddressSpan, LiveRead, LiveReading},
    },
    profile::sunspec::profile_text,
    register_map::named::Named,
};

/// The name of the profile that was made of the SunSpec models, until it is saved.
pub const SUNSPEC: &str = "sunspec";
/// Spans that are read with the window for the scaling of names.
const UNSCALED_MAX: usize = 16;

/// How far it is.
#[derive(Debug, Default)]
pub enum Recognition {
    /// Before the first value of the window.
    #[default]
    Waiting,
    /// Its SunSpec models.
    Walking(Walk),
    /// The signature at work, of these.
    Asking { known: Vec<Arc<PlantDef>>, at: usize, retries: Retries },
    /// The profile that fits; `None`: no profile fits.
    Done(Option<Recognised>),
}

#[derive(Debug)]
pub struct Recognised {
    /// Its device is the only one of this plant.
    pub def: Arc<PlantDef>,
    how: How,
    is_taken: bool,
}

#[derive(Debug, Clone, Copy)]
enum How {
    Probes(Fit),
    /// The device has said so many models, and perhaps not all of it was read.
    SunSpec {
        count: usize,
        is_cut: bool,
    },
    /// It was chosen by hand.
    Chosen,
}

impl Recognition {
    /// The profile whose names were taken.
    pub fn applied(&self) -> Option<&Arc<PlantDef>> {
        match self {
            Recognition::Done(Some(Recognised { def, is_taken: true, .. })) => Some(def),
            Recognition::Waiting | Recognition::Walking(_) | Recognition::Asking { .. } | Recognition::Done(_) => None,
        }
    }

    /// What is known so far, in words.
    pub fn words(&self) -> String {
        match self {
            Recognition::Waiting => String::new(),
            Recognition::Walking(walk) => match walk.count() {
                0 => t!("looking for SunSpec").to_owned(),
                count => t!("SunSpec models so far: {count}", count),
            },
            Recognition::Asking { known, at, .. } => {
                t!("recognising, {at} of {count} profiles", at, count = known.len())
            }
            Recognition::Done(None) => t!("not recognised: f chooses a profile").to_owned(),
            Recognition::Done(Some(Recognised { def, how, is_taken })) => {
                let model = def.devices.first().map_or("", |device| device.model.as_str());
                match (how, is_taken) {
                    (How::Probes(Fit { fits, of, .. }), false) => {
                        t!("looks like {model}: {fits} of {of} probes fit", model, fits, of)
                    }
                    (How::Probes(Fit { fits, of, .. }), true) => {
                        t!("names of {model}: {fits} of {of} probes fit", model, fits, of)
                    }
                    (How::Chosen, _) => t!("names of {model}, as chosen", model),
                    (How::SunSpec { count, is_cut: false }, _) => t!("{model}: SunSpec models {count}", model, count),
                    (How::SunSpec { count, is_cut: true }, _) => {
                        t!("{model}: SunSpec models {count}, not all could be read", model, count)
                    }
                }
            }
        }
    }
}

impl Registers {
    /// The next query of the signatures, when the window has had its first value and none is on its way.
    pub(super) fn recognise(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        // A plant file says what its devices are.
        if self.reads == 0 || self.paused || cx.def().lines.is_empty() || !cx.def().is_bench() {
            return Vec::new();
        }
        if matches!(self.recognition, Recognition::Waiting) {
            self.recognition = Recognition::Walking(Walk::default());
        }
        if self.is_on_way(cx, &ReadFor::Recognition) {
            return Vec::new();
        }
        let spans = match &mut self.recognition {
            Recognition::Walking(walk) => walk.next(),
            Recognition::Asking { known, at, .. } => asked_by(known, *at),
            Recognition::Waiting | Recognition::Done(_) => return Vec::new(),
        };
        let Some(spans) = spans else { return self.conclude(cx) };
        let read = LiveRead { line: self.line, unit: self.unit, spans, not_before: None, relearn: false };
        vec![self.send(cx, ReadFor::Recognition, read)]
    }

    /// Takes what was asked. What could not be read does not fit.
    pub(super) fn on_probed(&mut self, cx: &ViewContext, reading: Option<LiveReading>) -> Vec<UiAction> {
        if let Some(reading) = reading {
            self.cells.on_reading(&reading);
        }
        match &mut self.recognition {
            Recognition::Walking(walk) => walk.on_outcomes(&|table, address| self.cells.outcome(table, address)),
            Recognition::Asking { known, at, retries } => {
                let is_lost = asked_by(known, *at).iter().flatten().any(|span| self.cells.is_lost(*span));
                *at += usize::from(!retries.again(is_lost));
            }
            Recognition::Waiting | Recognition::Done(_) => {}
        }
        self.recognise(cx)
    }

    /// All was read: what it says.
    fn conclude(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match &self.recognition {
            Recognition::Walking(walk) => match walk.found() {
                Some(found) => {
                    let how = How::SunSpec { count: found.models.len(), is_cut: found.is_cut };
                    let text = profile_text(found);
                    self.profiles.add(SUNSPEC, &text);
                    if let Some(def) = self.profiles.device(SUNSPEC) {
                        self.recognition = Recognition::Done(Some(Recognised { def, how, is_taken: false }));
                        // The device itself has said what its registers are.
                        let is_untouched = (self.first, self.selected) == (0, 0) && self.picking.is_none();
                        self.apply_names(cx);
                        return if is_untouched { self.list_values(cx) } else { self.read_now(cx) };
                    }
                    self.ask_signatures(cx)
                }
                None => self.ask_signatures(cx),
            },
            Recognition::Asking { known, .. } => {
                let words = |span: AddressSpan| self.cells.words(span.table, span.address, span.count);
                let best = recognise::best(known, &words);
                let best =
                    best.map(|(def, fit)| Recognised { def: Arc::clone(def), how: How::Probes(fit), is_taken: false });
                self.recognition = Recognition::Done(best);
                Vec::new()
            }
            Recognition::Waiting | Recognition::Done(_) => Vec::new(),
        }
    }

    /// Takes a profile that was chosen by hand, in place of the one before; what its values need is read with the next window.
    pub(super) fn choose_profile(&mut self, cx: &ViewContext, def: Arc<PlantDef>) -> Vec<UiAction> {
        for named in std::mem::take(&mut self.names_of_profile).iter() {
            if self.names.get(named.table, named.address) == Some(named) {
                self.names.remove(named.table, named.address);
            }
        }
        self.recognition = Recognition::Done(Some(Recognised { def, how: How::Chosen, is_taken: false }));
        self.apply_names(cx);
        self.read_now(cx)
    }

    /// All profiles, the one that is in use first, then the one that fits best.
    pub(super) fn ranked(&self) -> Vec<recognise::Ranked> {
        let words = |span: AddressSpan| self.cells.words(span.table, span.address, span.count);
        let mut ranked = recognise::ranking(&self.profiles.all(), &words);
        ranked.sort_by_key(|one| !self.is_in_use(&one.def));
        ranked
    }

    /// Were the names of this profile taken?
    pub(super) fn is_in_use(&self, def: &PlantDef) -> bool {
        self.recognition.applied().is_some_and(|applied| applied.name == def.name)
    }

    fn ask_signatures(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let known = self.profiles.recognisable();
        self.recognition = Recognition::Asking { known, at: 0, retries: Retries::default() };
        self.recognise(cx)
    }

    /// The names, units and scales of the profile that fits; names that are there already stay.
    pub(super) fn apply_names(&mut self, cx: &ViewContext) {
        let Recognition::Done(Some(recognised)) = &mut self.recognition else { return };
        recognised.is_taken = true;
        let def = Arc::clone(&recognised.def);
        self.name_by_profile();
        if let Some(first) = def.tags.first().filter(|_| self.picking.is_none()) {
            (self.table, self.first, self.selected) = (first.point.table, first.point.address, first.point.address);
            self.keep_in_sight(cx);
        }
    }

    /// Calls the registers what the profile that was taken calls them, with the scaling that the device has said by now; a name
    /// that was given by hand stays.
    pub(super) fn name_by_profile(&mut self) {
        let Some(def) = self.recognition.applied().cloned() else { return };
        let mut given = std::mem::take(&mut self.names_of_profile);
        for tag in def.tags.iter().filter(|tag| tag.point.field.is_none() && tag.calculation.is_none()) {
            let before = given.get(tag.point.table, tag.point.address);
            let is_fixed = tag.decimals.source().is_none() && tag.unit_from.is_none();
            let is_settled = |before: &Named| is_fixed || before.name != tag.short;
            if before.is_some_and(is_settled) {
                continue;
            }
            let words = |span: AddressSpan| self.cells.words(span.table, span.address, span.count);
            let named = Named::of_tag(tag, recognise::scaling(&def, tag, &words));
            self.give(&named, before);
            given.put(named);
        }
        self.names_of_profile = given;
    }

    /// Gives a name where no other stands than what was given `before`.
    pub(super) fn give(&mut self, named: &Named, before: Option<&Named>) {
        let held = self.names.get(named.table, named.address);
        if held == before && held != Some(named) {
            self.names.put(named.clone());
            self.watch.restart((named.table, named.address));
        }
    }

    /// What the names of the profile need for their scaling, and what did not come so far.
    pub(super) fn unscaled_spans(&self) -> Vec<AddressSpan> {
        let def = self.recognition.applied();
        let spans = def.and_then(|def| Some(recognise::spans(def, def.devices.first()?))).unwrap_or_default();
        spans.into_iter().filter(|span| self.cells.is_lost(*span)).take(UNSCALED_MAX).collect()
    }
}

/// What a signature asks; `None` behind the last.
fn asked_by(known: &[Arc<PlantDef>], at: usize) -> Option<Vec<AddressSpan>> {
    let def = known.get(at)?;
    Some(recognise::spans(def, def.devices.first()?))
}
