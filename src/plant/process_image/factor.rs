//! Powers of ten and decimals that a device announces: a value is never scaled by those of another cycle.
//!
//! ```text
//!   one answer        value, power          good at once
//!   two answers       power … value … power good once the power is read again and is the same
//!   power changed     power … value … POWER the value is dropped; the one before stands, as old as it is
//!   decimals changed  value … DECIMALS      bad until the value is read again
//! ```

use jiff::Timestamp;

use super::{ProcessImage, Reading};
use crate::plant::{
    def::TagId,
    exact::Exact,
    sample::{Cause, Sample},
    tag::{Decimals, TagDef},
};

impl ProcessImage {
    /// Takes the raw numbers of one answer; `uncertain` says why they may be none of theirs.
    pub(super) fn read_as(
        &mut self,
        values: &[(TagId, impl Into<Exact> + Copy)],
        uncertain: Option<Cause>,
        at: Timestamp,
    ) {
        let before = self.announced_by(values.iter().map(|(tag, _)| *tag));
        for (tag, raw) in values {
            let reading = Reading { raw: (*raw).into(), at, uncertain, decimals: None };
            match self.def.tag(*tag).decimals.power_source() {
                Some(_) => self.waiting[tag.index()] = Some(reading),
                None => self.raw[tag.index()] = Some(reading),
            }
            self.heard[tag.index()].hear(at);
        }
        let is_in_answer = |tag: TagId| values.iter().any(|(other, _)| *other == tag);
        self.settle_own(at, values.iter().map(|(tag, _)| *tag), &is_in_answer);
        for (tag, _) in values {
            for dependent in self.dependents[tag.index()].clone() {
                self.settle_dependent(dependent, &before, &is_in_answer, at);
                self.recompute_sample(dependent);
            }
        }
    }

    /// A tag was read alone, for a write. What waits for its power of ten is no longer what is shown.
    pub fn read_for_write(&mut self, tag: TagId, at: Timestamp) {
        if let Some(waiting) = self.waiting[tag.index()] {
            self.doubt(tag, Cause::NotReadBack, at);
            self.waiting[tag.index()] = Some(waiting);
        }
    }

    /// Was it read and is not shown yet, because the power of ten that scales it was not read since?
    pub fn is_waiting(&self, tag: TagId) -> bool {
        self.waiting[tag.index()].is_some()
    }

    /// What these tags announce now to the tags that are scaled by them.
    fn announced_by(&self, tags: impl Iterator<Item = TagId>) -> Vec<(TagId, Option<i8>)> {
        let scaled = tags.flat_map(|tag| self.dependents[tag.index()].iter().map(move |of| (tag, *of)));
        let scaled = scaled.filter(|(tag, of)| self.def.tag(*of).decimals.source() == Some(*tag));
        scaled.map(|(_, of)| (of, self.scaling_decimals(self.def.tag(of)))).collect()
    }

    /// The decimals that scale a reading of a tag.
    pub(super) fn decimals_of(&self, tag: &TagDef, reading: Reading) -> Option<i8> {
        match tag.decimals {
            Decimals::PowerFrom(_) => reading.decimals,
            Decimals::Fixed(_) | Decimals::From(_) => self.scaling_decimals(tag),
        }
    }

    /// Makes samples of what an answer holds. What is scaled by a power of ten comes last, and waits for a later answer if this
    /// one has no power for it.
    fn settle_own(
        &mut self,
        at: Timestamp,
        tags: impl Iterator<Item = TagId> + Clone,
        is_in_answer: &impl Fn(TagId) -> bool,
    ) {
        let is_scaled = |image: &ProcessImage, tag: TagId| image.def.tag(tag).decimals.power_source();
        for tag in tags.clone() {
            if is_scaled(self, tag).is_none() {
                self.recompute_sample(tag);
            }
        }
        for tag in tags {
            let Some(source) = is_scaled(self, tag) else { continue };
            let decimals = self.scaling_decimals(self.def.tag(tag));
            if let Some(reading) = &mut self.waiting[tag.index()] {
                reading.decimals = decimals;
            }
            // What the plant file states is of every cycle.
            if is_in_answer(source) || self.sample(source).is_stated() {
                self.raw[tag.index()] = self.waiting[tag.index()].take();
                self.recompute_sample(tag);
            } else if decimals.is_none() && self.raw[tag.index()].is_none() {
                self.set(tag, Sample::bad(Cause::Unscaled, at));
            }
        }
    }

    /// Takes to a tag what an answer says of how it is scaled, where the answer does not hold the tag itself.
    fn settle_dependent(
        &mut self,
        of: TagId,
        before: &[(TagId, Option<i8>)],
        is_in_answer: &impl Fn(TagId) -> bool,
        at: Timestamp,
    ) {
        let def = self.def.clone();
        let tag = def.tag(of);
        let is_scale = tag.decimals.source().is_some_and(is_in_answer);
        if !is_scale || is_in_answer(of) {
            return;
        }
        let now = self.scaling_decimals(tag);
        if let Decimals::PowerFrom(_) = tag.decimals {
            let known = self.waiting[of.index()].take().filter(|waiting| waiting.decimals == now || now.is_none());
            if let Some(waiting) = known {
                self.raw[of.index()] = Some(Reading { decimals: now, ..waiting });
            }
            return;
        }
        let was = before.iter().find(|(tag, _)| *tag == of).and_then(|(_, decimals)| *decimals);
        if was.is_some() && now.is_some() && was != now {
            self.drop_value(of, Cause::Unscaled, at);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::plant::{
        fixture::{self, DP, FAULT, PV, SV},
        sample::Quality,
        tag::Decimals,
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// PV and SV are scaled by a power of ten in DP.
    fn image() -> ProcessImage {
        let mut def = fixture::plant();
        for tag in [PV, SV] {
            def.tags[tag.index()].decimals = Decimals::PowerFrom(DP);
            def.tags[tag.index()].quality_from = None;
        }
        ProcessImage::new(Arc::new(def), at(0))
    }

    #[test]
    fn powers_of_ten_scale_to_both_sides() {
        for (power, value) in [(-1.0, 72.4), (0.0, 724.0), (1.0, 7_240.0), (10.0, 7.24e12), (-10.0, 7.24e-8)] {
            let mut image = image();
            image.read(&[(PV, 724.0), (DP, power)], at(1));
            assert_eq!(image.sample(PV), Sample::good(value, at(1)), "10^{power}");
        }
        for power in [-32_768.0, 11.0, -11.0, 0.5] {
            let mut image = image();
            image.read(&[(PV, 724.0), (DP, power)], at(1));
            assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "10^{power} is none");
        }
    }

    #[test]
    fn a_value_waits_for_the_power_of_its_own_cycle() {
        let mut image = image();
        image.read(&[(DP, 0.0)], at(1));
        image.read(&[(PV, 41.0)], at(1));
        assert_eq!(image.sample(PV).value, None, "not yet");
        image.read(&[(DP, 0.0)], at(2));
        assert_eq!(image.sample(PV), Sample::good(41.0, at(1)), "as old as its own reading");
        // The device now counts in tens.
        image.read(&[(PV, 4.0)], at(3));
        assert_eq!(image.sample(PV), Sample::good(41.0, at(1)), "never 4 for 40");
        image.read(&[(DP, 1.0)], at(3));
        assert_eq!(image.sample(PV), Sample::good(41.0, at(1)), "never 410 either");
        image.read(&[(PV, 4.0)], at(4));
        image.read(&[(DP, 1.0)], at(4));
        assert_eq!(image.sample(PV), Sample::good(40.0, at(4)));
        image.read(&[(PV, 5.0)], at(5));
        image.read(&[(DP, -32_768.0)], at(5));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "not implemented any more");
    }

    #[test]
    fn what_was_read_for_a_write_and_waits_is_not_shown_as_good() {
        let mut image = image();
        image.read(&[(SV, 50.0), (DP, 0.0)], at(1));
        image.read(&[(SV, 60.0)], at(2));
        assert_eq!((image.sample(SV), image.is_waiting(SV)), (Sample::good(50.0, at(1)), true), "as after any poll");
        image.read_for_write(SV, at(2));
        assert_eq!(image.sample(SV).quality, Quality::Uncertain(Cause::NotReadBack));
        assert_eq!(image.good_raw(SV), None, "nothing to compare with");
        image.read(&[(DP, 0.0)], at(3));
        assert_eq!((image.sample(SV), image.is_waiting(SV)), (Sample::good(60.0, at(2)), false));
        image.read_for_write(SV, at(3));
        assert_eq!(image.sample(SV), Sample::good(60.0, at(2)), "nothing waits");
    }

    #[test]
    fn a_power_that_never_comes_is_named() {
        let mut image = image();
        image.read(&[(PV, 41.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled));
    }

    #[test]
    fn what_waits_is_gone_with_its_device() {
        let mut image = image();
        image.read(&[(DP, 0.0)], at(1));
        image.read(&[(PV, 41.0)], at(1));
        image.gone(fixture::TIC, Cause::NotConnected, at(2));
        image.read(&[(DP, 0.0)], at(3));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotConnected));
    }

    #[test]
    fn other_decimals_make_what_was_read_before_bad() {
        let mut image = ProcessImage::new(fixture::shared(), at(0));
        image.read(&[(PV, 724.0), (DP, 1.0), (FAULT, 0.0)], at(1));
        image.read(&[(DP, 0.0)], at(2));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "never 724 for 72.4");
        image.read(&[(PV, 72.0)], at(3));
        assert_eq!(image.sample(PV), Sample::good(72.0, at(3)));
        image.read(&[(PV, 724.0), (DP, 1.0)], at(4));
        assert_eq!(image.sample(PV), Sample::good(72.4, at(4)), "both of one answer");
    }

    proptest! {
        /// A device changes its power of ten at any time; it shows 1,000,000 all the time.
        #[test]
        fn a_change_of_the_power_never_gives_a_spike(steps in prop::collection::vec(0..4_u8, 1..40)) {
            let mut image = image();
            let mut power = -5;
            for (second, step) in (1..).zip(steps) {
                let (raw, announced) = (10_f64.powi(6 - power), f64::from(power));
                match step {
                    0 => power = (power + 1).min(6),
                    1 => image.read(&[(PV, raw)], at(second)),
                    2 => image.read(&[(DP, announced)], at(second)),
                    _ => image.read(&[(DP, announced), (PV, raw)], at(second)),
                }
                let sample = image.sample(PV);
                prop_assert!(sample.value.is_none_or(|value| value == 1e6), "{sample:?} after step {second}");
            }
        }
    }
}
