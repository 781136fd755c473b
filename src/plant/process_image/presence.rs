//! What a device does not have, as another of its values says: it has no value, and that is no trouble.

use std::sync::Arc;

use super::ProcessImage;
use crate::plant::{
    id::TagId,
    sample::{Cause, Quality, Sample},
};

const ABSENT: Quality = Quality::Bad(Cause::NotPresent);

impl ProcessImage {
    /// Does its device say that it does not have it? While it has said nothing the tag is as any other.
    fn is_absent(&self, tag: TagId) -> bool {
        let known = |of: TagId| self.sample(of).exact().filter(|_| self.sample(of).scaling_value().is_some());
        self.def.tag(tag).when.as_ref().is_some_and(|when| when.holds(&known) == Some(false))
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
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        expr::{Compare, Expr},
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
}
