//! Which device it looks like: asks what the signatures of the device profiles ask, once, behind the values that the
//! window shows, and gives the registers the names of the profile that fits.

use std::sync::Arc;

use super::{LOST_AFTER, Registers};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::recognise::{self, Fit},
    plant::{
        PlantDef,
        live::{AddressSpan, LiveRead, LiveReading},
        tag::TagDef,
    },
    register_map::named::Named,
};

/// How far it is.
#[derive(Debug, Default)]
pub enum Recognition {
    /// Before the first value of the window.
    #[default]
    Waiting,
    /// The signature at work, of these; number and steady time of its read.
    Asking { known: Vec<Arc<PlantDef>>, at: usize, on_way: Option<(u32, Timestamp)> },
    /// The profile that fits, and whether its names were taken; `None`: no profile fits.
    Done(Option<(Arc<PlantDef>, Fit, bool)>),
}

impl Recognition {
    /// Is this its read?
    pub fn awaits(&self, number: u32) -> bool {
        matches!(self, Recognition::Asking { on_way: Some((own, _)), .. } if *own == number)
    }

    /// The profile whose names were taken.
    pub fn applied(&self) -> Option<&Arc<PlantDef>> {
        match self {
            Recognition::Done(Some((def, _, true))) => Some(def),
            Recognition::Waiting | Recognition::Asking { .. } | Recognition::Done(_) => None,
        }
    }

    /// What is known so far, in words.
    pub fn words(&self) -> String {
        match self {
            Recognition::Waiting => String::new(),
            Recognition::Asking { known, at, .. } => {
                t!("recognising, {at} of {count} profiles", at, count = known.len())
            }
            Recognition::Done(None) => t!("not recognised").to_owned(),
            Recognition::Done(Some((def, Fit { fits, of, .. }, taken))) => {
                let model = def.devices.first().map_or("", |device| device.model.as_str());
                match taken {
                    false => t!("looks like {model}: {fits} of {of} probes fit", model, fits, of),
                    true => t!("names of {model}: {fits} of {of} probes fit", model, fits, of),
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
            let known = self.profiles.recognisable();
            self.recognition = Recognition::Asking { known, at: 0, on_way: None };
        }
        let now = cx.steady();
        let Recognition::Asking { known, at, on_way } = &mut self.recognition else { return Vec::new() };
        if on_way.is_some_and(|(_, sent)| now.duration_since(sent) < LOST_AFTER) {
            return Vec::new();
        }
        let Some(spans) = known.get(*at).and_then(|def| Some(recognise::spans(def, def.devices.first()?))) else {
            let words = |span: AddressSpan| self.cells.words(span.table, span.address, span.count);
            let best = recognise::best(known, &words).map(|(def, fit)| (Arc::clone(def), fit, false));
            self.recognition = Recognition::Done(best);
            return Vec::new();
        };
        self.number = self.number.wrapping_add(1);
        *on_way = Some((self.number, now));
        let read = LiveRead { line: self.line, unit: self.unit, spans, not_before: None, relearn: false };
        vec![UiAction::query(self.tab, self.number, Query::Registers(read))]
    }

    /// Takes what a signature has asked. What could not be read does not fit.
    pub(super) fn on_probed(&mut self, cx: &ViewContext, reading: Option<LiveReading>) -> Vec<UiAction> {
        if let Recognition::Asking { at, on_way, .. } = &mut self.recognition {
            (*at, *on_way) = (*at + 1, None);
        }
        if let Some(reading) = reading {
            self.cells.on_reading(&reading);
        }
        self.recognise(cx)
    }

    /// The names, units and scales of the profile that fits; names that are there already stay.
    pub(super) fn apply_names(&mut self, cx: &ViewContext) {
        let Recognition::Done(Some((def, _, taken))) = &mut self.recognition else { return };
        *taken = true;
        let def = Arc::clone(def);
        for tag in def.tags.iter().filter(|tag| tag.point.field.is_none() && tag.calculation.is_none()) {
            if self.names.get(tag.point.table, tag.point.address).is_none() {
                let named = self.named(&def, tag);
                self.names.put(named);
            }
        }
        if let Some(first) = def.tags.first() {
            (self.table, self.first, self.selected) = (first.point.table, first.point.address, first.point.address);
            self.keep_in_sight(cx);
        }
    }

    fn named(&self, def: &PlantDef, tag: &TagDef) -> Named {
        let words = |span: AddressSpan| self.cells.words(span.table, span.address, span.count);
        Named::of_tag(tag, recognise::scaling(def, tag, &words))
    }
}
