//! What a device does not have, as another of its values or its identification says: it has no value, and that is no trouble.

use std::sync::Arc;

use jiff::Timestamp;

use super::ProcessImage;
use crate::plant::{
    exact::Exact,
    expr::Expr,
    id::{DeviceId, TagId},
    identity::{IdentityObject, IdentityTest},
    sample::{Cause, Quality, Sample},
};

const ABSENT: Quality = Quality::Bad(Cause::NotPresent);

impl ProcessImage {
    /// A device has said of itself what of it is asked; nothing where it does not tell.
    pub fn identified(&mut self, device: DeviceId, objects: Vec<(IdentityObject, String)>, at: Timestamp) {
        if !self.identities.set(device, objects) {
            return;
        }
        let def = self.def.clone();
        let asks = |when: &Arc<Expr>| !when.identity_tests().is_empty();
        for tag in def.tags_of(device).filter(|tag| tag.when.as_ref().is_some_and(asks)) {
            let has_changed = (self.sample(tag.id).quality == ABSENT) != self.is_absent(tag.id);
            match has_changed && self.raw[tag.id.index()].is_none() {
                true => self.set(tag.id, Sample::bad(Cause::NotRead, at)),
                false => self.recompute_sample(tag.id),
            }
        }
    }

    /// Does a condition hold, by the values that count and by what devices say of themselves? `None`: it is not known.
    pub fn holds(&self, condition: &Expr, value: &impl Fn(TagId) -> Option<Exact>) -> Option<bool> {
        let said = |test: &IdentityTest| test.holds(self.identities.said(test.device, test.object)?);
        condition.holds_for(value, &said)
    }

    /// Does its device say that it does not have it? While it has said nothing the tag is as any other.
    fn is_absent(&self, tag: TagId) -> bool {
        let known = |of: TagId| self.sample(of).exact().filter(|_| self.sample(of).scaling_value().is_some());
        self.def.tag(tag).when.as_ref().is_some_and(|when| self.holds(when, &known) == Some(false))
    }

    /// The sample of a tag, whatever was read or failed at its place; none where its device does not have it.
    pub(super) fn if_present(&mut self, tag: TagId, sample: Sample) -> Sample {
        if !self.is_absent(tag) {
            return sample;
        }
        if self.texts[tag.index()].is_some() {
            Arc::make_mut(&mut self.texts)[tag.index()] = None;
        }
        Sample::bad(Cause::NotPresent, sample.at)
    }

    /// What it depends on was read, and it has no reading itself.
    pub(super) fn look_for(&mut self, tag: TagId) {
        let was_absent = self.sample(tag).quality == ABSENT;
        if was_absent != self.is_absent(tag) {
            let sources = self.def.tag(tag).value_needs().map(|of| self.sample(of).at);
            let at = sources.max().unwrap_or(self.sample(tag).at);
            self.set(tag, Sample::bad(Cause::NotRead, at));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        expr::Compare,
        fault::Fault,
        fixture::{self, DP, PV},
    };

    /// PV is there while DP is 2 or more.
    fn image() -> ProcessImage {
        let mut def = fixture::plant();
        let tag = &mut def.tags[PV.index()];
        (tag.when, tag.quality_from) = (Some(Arc::new(Expr::test(DP, Compare::AtLeast, 2.0))), None);
        tag.decimals = crate::plant::tag::Decimals::Fixed(0);
        ProcessImage::new(Arc::new(def), Timestamp::UNIX_EPOCH)
    }

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a time")
    }

    #[test]
    fn what_the_device_does_not_have_is_neither_stale_nor_failed() {
        let mut image = image();
        image.read(&[(PV, 70.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Good, "the device has said nothing yet");
        image.read(&[(DP, 1.0)], at(2));
        assert_eq!((image.sample(PV).quality, image.sample(PV).value), (ABSENT, None));
        image.read(&[(PV, 71.0)], at(3));
        image.age(at(1_000));
        assert_eq!(image.sample(PV).quality, ABSENT, "read or not");
        image.read(&[(DP, 1.0)], at(1_000));
        image.failed(&[PV], Fault::Timeout, at(1_001));
        image.failed(&[PV], Fault::Exception(crate::plant::fault::ExceptionCode::ILLEGAL_ADDRESS), at(1_002));
        assert_eq!(image.sample(PV).quality, ABSENT, "refused or not");
        image.read(&[(DP, 2.0)], at(1_003));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotRead), "there again");
        image.read(&[(PV, 72.0)], at(1_004));
        assert_eq!(image.sample(PV).good_value(), Some(72.0));
    }

    #[test]
    fn what_was_never_read_is_absent_once_the_device_says_so() {
        let mut image = image();
        image.read(&[(DP, 0.0)], at(1));
        assert_eq!(image.sample(PV).quality, ABSENT);
        image.read(&[(DP, 3.0)], at(2));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotRead));
    }

    /// PV is there from revision 2.10 on.
    fn image_by_revision() -> (ProcessImage, DeviceId) {
        let mut def = fixture::plant();
        let device = def.tags[PV.index()].device;
        let (object, compare) = (IdentityObject::of("revision").expect("an object"), Compare::AtLeast);
        let test = IdentityTest { device, object, compare, with: "2.10".to_owned() };
        let tag = &mut def.tags[PV.index()];
        (tag.when, tag.quality_from) = (Some(Arc::new(Expr::Identity(test))), None);
        tag.decimals = crate::plant::tag::Decimals::Fixed(0);
        (ProcessImage::new(Arc::new(def), Timestamp::UNIX_EPOCH), device)
    }

    #[test]
    fn the_identification_of_a_device_says_what_it_has() {
        let (mut image, device) = image_by_revision();
        let says = |text: &str| vec![(IdentityObject::of("revision").expect("an object"), text.to_owned())];
        image.read(&[(PV, 70.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Good, "not read: as any other");
        image.identified(device, says("V2.9"), at(2));
        assert_eq!((image.sample(PV).quality, image.sample(PV).value), (ABSENT, None));
        image.failed(&[PV], Fault::Exception(crate::plant::fault::ExceptionCode::ILLEGAL_ADDRESS), at(3));
        assert_eq!(image.sample(PV).quality, ABSENT, "refused or not");
        image.identified(device, says("V2.10"), at(4));
        assert_eq!((image.sample(PV).quality, image.sample(PV).at), (Quality::Bad(Cause::NotRead), at(4)), "updated");
        image.read(&[(PV, 71.0)], at(5));
        assert_eq!(image.sample(PV).good_value(), Some(71.0));
        image.identified(device, says("2.9"), at(6));
        image.gone(device, Cause::DeviceDown, at(7));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::DeviceDown), "another one may come back");
        image.read(&[(PV, 72.0)], at(8));
        assert_eq!(image.sample(PV).good_value(), Some(72.0));
    }

    #[test]
    fn what_a_device_does_not_tell_decides_nothing() {
        for objects in
            [vec![], vec![(IdentityObject(2), "Rev A".to_owned())], vec![(IdentityObject(1), "9".to_owned())]]
        {
            let (mut image, device) = image_by_revision();
            image.identified(device, vec![(IdentityObject(2), "2.9".to_owned())], at(1));
            assert_eq!(image.sample(PV).quality, ABSENT);
            image.identified(device, objects.clone(), at(2));
            image.read(&[(PV, 72.0)], at(3));
            assert_eq!(image.sample(PV).good_value(), Some(72.0), "{objects:?}");
        }
    }
}
