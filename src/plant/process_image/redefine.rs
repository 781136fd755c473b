//! The values of all tags under another definition: what was read of a register stands for as long as it did before.

use std::sync::Arc;

use jiff::Timestamp;

use super::ProcessImage;
use crate::plant::{
    def::{PlantDef, TagId},
    record::Record,
    redefinition::Redefinition,
    sample::{Cause, Sample},
};

impl ProcessImage {
    /// Goes on under another definition. Returns the ends of the curves that have no tag any more, under the ids of before.
    pub fn redefine(&mut self, def: &Arc<PlantDef>, change: &Redefinition, at: Timestamp) -> Vec<Record> {
        let mut before = std::mem::replace(self, ProcessImage::new(def.clone(), at));
        self.calculator.redefine(&mut before.calculator, change);
        let devices = def.devices.iter().filter_map(|device| Some((device.id, change.device(device.id)?)));
        self.identities.take_over(&before.identities, devices);
        let mut goes_on = vec![false; before.def.tags.len()];
        for tag in &def.tags {
            let Some(was) = change.tag(tag.id) else { continue };
            // The history knows a tag by name and unit.
            let known = before.def.tag(was);
            if tag.is_stored() && (&known.name, &known.unit) == (&tag.name, &tag.unit) {
                goes_on[was.index()] = true;
                self.stored[tag.id.index()] = before.stored[was.index()];
            }
            match change.source(tag.id) {
                Some(was) => self.take_over(tag.id, &before, was),
                None => self.set(tag.id, Sample::bad(Cause::Reloaded, at)),
            }
        }
        let scaled = def.tags.iter().filter(|tag| tag.value_needs().next().is_some());
        def.tags.iter().chain(scaled).for_each(|tag| self.recompute_sample(tag.id));
        let ended = before.def.tags.iter().zip(&before.stored).zip(goes_on);
        let ended = ended.filter(|((_, stored), goes_on)| stored.is_some() && !goes_on);
        ended.map(|((tag, _), _)| Record::Sample(tag.id, Sample::bad(Cause::Reloaded, at))).collect()
    }

    /// Takes what is known of a tag from before.
    fn take_over(&mut self, tag: TagId, before: &ProcessImage, was: TagId) {
        let sample = before.sample(was);
        let (place, from) = (tag.index(), was.index());
        self.raw[place] = before.raw[from];
        self.decimals_seen[place] = before.decimals_seen[from];
        self.heard[place] = before.heard[from];
        self.stated.take_over(tag, &before.stated, was);
        if let Some(text) = &before.texts[from] {
            Arc::make_mut(&mut self.texts)[place] = Some(text.clone());
        }
        // What the plant file stated, and states no more, was never read.
        let unread = sample.is_stated() && self.def.tag(tag).stated.is_none();
        if !unread {
            self.samples[place] = sample;
            self.set(tag, sample);
        }
    }
}
