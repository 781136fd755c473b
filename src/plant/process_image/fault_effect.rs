//! What a failed request means for the values that were asked for, and a device that is gone for all of its values.

use jiff::Timestamp;

use super::ProcessImage;
use crate::plant::{
    def::DeviceId,
    fault::{ExceptionCode, Fault, FaultKind},
    sample::{Cause, Quality, Sample},
};

/// What a fault does to a value.
pub(super) enum FaultEffect {
    /// It may no longer be so.
    Uncertain(Cause),
    /// There is none.
    Gone(Cause),
}

impl Sample {
    /// What is left of it when a request for it has failed.
    pub(crate) fn after(self, fault: Fault, at: Timestamp) -> Sample {
        match effect_of(fault) {
            FaultEffect::Uncertain(cause) => Sample { at, ..self }.uncertain(cause),
            FaultEffect::Gone(cause) => Sample::bad(cause, at),
        }
    }
}

impl ProcessImage {
    /// Everything of a device is gone at once.
    pub fn gone(&mut self, device: DeviceId, cause: Cause, at: Timestamp) {
        let def = self.def.clone();
        // Another one may come back.
        self.identities.forget(device);
        for tag in def.tags_of(device).filter(|tag| tag.calculation.is_none()) {
            if self.sample(tag.id).quality != Quality::Bad(cause) {
                self.drop_value(tag.id, cause, at);
            }
        }
    }

    /// Nothing is heard of a device any more: its values may be others by now.
    pub fn not_heard(&mut self, device: DeviceId) {
        let def = self.def.clone();
        let good = |image: &ProcessImage, tag| image.sample(tag).quality.is_good();
        for tag in def.tags_of(device).filter(|tag| tag.calculation.is_none()) {
            if good(self, tag.id) {
                self.mark_uncertain(tag.id, Cause::NotHeard);
            }
        }
    }
}

/// What a fault means for the values that were asked for.
pub(super) fn effect_of(fault: Fault) -> FaultEffect {
    match fault.kind() {
        FaultKind::Timeout => FaultEffect::Uncertain(Cause::Timeout),
        FaultKind::Corrupt | FaultKind::OutOfSync => FaultEffect::Uncertain(Cause::Corrupt),
        // 05 acknowledge and 06 busy pass; any other exception means that there is no such value.
        FaultKind::Exception(ExceptionCode(0x05 | 0x06)) => FaultEffect::Uncertain(Cause::Exception),
        FaultKind::Exception(_) => FaultEffect::Gone(Cause::Exception),
        FaultKind::NotANumber => FaultEffect::Gone(Cause::SensorFault),
        FaultKind::NotConnected => FaultEffect::Gone(Cause::NotConnected),
        FaultKind::BackedOff => FaultEffect::Gone(Cause::DeviceDown),
        FaultKind::NotHeard => FaultEffect::Uncertain(Cause::NotHeard),
        FaultKind::Unproven => FaultEffect::Uncertain(Cause::Unproven),
    }
}
