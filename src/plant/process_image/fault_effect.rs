//! What a failed request means for the values that were asked for.

use jiff::Timestamp;

use crate::plant::{
    fault::{ExceptionCode, Fault, FaultKind},
    sample::{Cause, Sample},
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
