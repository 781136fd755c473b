//! A value never travels alone: number, quality and time are one thing.

use crate::{t, text::translate};
use std::fmt;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    exact::Exact,
    keyword::{Keyword, keyword_enum},
};

/// Quality of a value, as in OPC UA. Ordered: `Good < Uncertain < Bad`, so `max` is "the worst of".
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Quality {
    /// Read in time and complete; the device says nothing against it.
    Good,
    /// The last known value, shown with its age: it may no longer be so.
    Uncertain(Cause),
    /// There is no value.
    Bad(Cause),
}

keyword_enum! {
    /// Why a value is not good. The discriminant is what the history stores: never renumber.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    #[repr(u8)]
    pub enum Cause: "cause" {
        /// Nothing has been read since the station started.
        NotRead = 1 => "not read yet",
        /// The device did not answer the last request in time.
        Timeout = 2 => "response timeout",
        /// The answer did not survive the line (CRC, length, wrong unit or function).
        Corrupt = 3 => "corrupt response",
        /// The device refused the request with an exception.
        Exception = 4 => "refused by the device",
        /// Older than three (uncertain) or ten (bad) poll periods.
        Stale = 5 => "stale",
        /// The device has stopped answering.
        DeviceDown = 6 => "device not responding",
        /// The port or connection is gone or was closed by the operator.
        NotConnected = 7 => "line not connected",
        /// The device itself says that the measurement failed (status word, sentinel value).
        SensorFault = 8 => "sensor fault",
        /// A value that this one needs (decimals, unit, range) is not known.
        Unscaled = 9 => "scale unknown",
        /// The calculation has no result: a division by zero, or a number that is too large.
        Undefined = 10 => "calculation undefined",
        /// The station was not running.
        StationOff = 11 => "station not running",
        /// There is a value, but no user who may see it is logged in here. Never stored.
        NotAuthorised = 12 => "not authorised: log in",
        /// It was stored, but the file is damaged there. Never stored.
        Unreadable = 13 => "history damaged",
        /// The history does not keep it, see [`StorePolicy`](super::tag::StorePolicy). Never stored.
        NotStored = 14 => "not stored",
        /// Written since it was read, and not read back.
        NotReadBack = 15 => "written, not read back",
        /// The master of a line that is only listened to has not read it for too long.
        NotHeard = 16 => "not heard",
        /// It is not read from the device: the plant file states it.
        Stated = 17 => "stated in the plant file",
        /// The plant file was reloaded, and has other registers for it.
        Reloaded = 18 => "plant file reloaded",
        /// The master of a line that is only listened to was heard reading it for the first time.
        Unproven = 19 => "heard, not proven",
        /// It is read on request only, and that was some time ago or never.
        OnRequest = 20 => "read on request",
        /// The device says that it does not have it: what a profile makes depend on another value.
        NotPresent = 21 => "not present",
    }
}

impl Cause {
    /// Is it that the device did not answer, or could not be asked?
    pub fn is_of_connection(self) -> bool {
        matches!(
            self,
            Cause::Timeout | Cause::Corrupt | Cause::Stale | Cause::DeviceDown | Cause::NotConnected | Cause::NotHeard
        )
    }

    /// Can a stored sample have it?
    pub fn is_stored(self) -> bool {
        match self {
            Cause::NotAuthorised | Cause::Unreadable | Cause::NotStored => false,
            Cause::NotRead
            | Cause::Timeout
            | Cause::Corrupt
            | Cause::Exception
            | Cause::Stale
            | Cause::DeviceDown
            | Cause::NotConnected
            | Cause::SensorFault
            | Cause::Unscaled
            | Cause::Undefined
            | Cause::StationOff
            | Cause::NotReadBack
            | Cause::NotHeard
            | Cause::Stated
            | Cause::Reloaded
            | Cause::Unproven
            | Cause::OnRequest
            | Cause::NotPresent => true,
        }
    }
}

/// `good`, `uncertain: stale`, `bad: response timeout`.
impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Quality::Good => f.write_str(t!("good")),
            Quality::Uncertain(cause) => f.write_str(&t!("uncertain: {cause}", cause = translate(cause.word()))),
            Quality::Bad(cause) => f.write_str(&t!("bad: {cause}", cause = translate(cause.word()))),
        }
    }
}

impl Quality {
    /// As files have it, in whatever language the screen is: `good`, `uncertain: stale`, `bad: response timeout`.
    pub fn word(self) -> String {
        match self {
            Quality::Good => "good".to_owned(),
            Quality::Uncertain(cause) => format!("uncertain: {}", cause.word()),
            Quality::Bad(cause) => format!("bad: {}", cause.word()),
        }
    }

    /// What [`Quality::word`] has written.
    pub fn from_word(word: &str) -> Option<Quality> {
        match word.split_once(": ") {
            Some(("uncertain", cause)) => Cause::from_word(cause).map(Quality::Uncertain),
            Some(("bad", cause)) => Cause::from_word(cause).map(Quality::Bad),
            Some(_) => None,
            None => (word == "good").then_some(Quality::Good),
        }
    }

    /// `true` only for [`Quality::Good`].
    pub fn is_good(self) -> bool {
        self == Quality::Good
    }

    /// `true` for [`Quality::Bad`].
    pub fn is_bad(self) -> bool {
        matches!(self, Quality::Bad(_))
    }

    /// The cause, unless good.
    pub fn cause(self) -> Option<Cause> {
        match self {
            Quality::Good => None,
            Quality::Uncertain(cause) | Quality::Bad(cause) => Some(cause),
        }
    }

    /// The one-byte form that the history stores: 0 good, 64 + cause uncertain, 128 + cause bad
    /// (the two top bits as in OPC UA severity: 00 good, 01 uncertain, 10 bad).
    pub fn code(self) -> u8 {
        match self {
            Quality::Good => 0,
            Quality::Uncertain(cause) => 64 + cause as u8,
            Quality::Bad(cause) => 128 + cause as u8,
        }
    }

    /// The quality of a stored code; `None` for a number that no version wrote.
    pub fn from_code(code: u8) -> Option<Quality> {
        let cause = |n: u8| Cause::ALL.into_iter().find(|cause| *cause as u8 == n);
        match code {
            0 => Some(Quality::Good),
            64..=127 => cause(code - 64).map(Quality::Uncertain),
            128..=191 => cause(code - 128).map(Quality::Bad),
            _ => None,
        }
    }
}

/// A value with its quality and the instant at which the device gave it; of what is stored again, or is not good, that at
/// which the station says so.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// In the tag's unit; bits are 0 or 1, enumerations their number. `None` exactly when the quality is bad; a tag that
    /// holds text never has a number, its text stands in the snapshot.
    pub value: Option<f64>,
    /// What `value` lacks of the number, see [`Sample::exact`]; `None` for nearly all.
    pub rest: Option<f64>,
    /// Its quality.
    pub quality: Quality,
    /// When the answer arrived; for a value never read, when that was found.
    pub at: Timestamp,
}

impl Sample {
    /// A good value.
    pub fn good(value: impl Into<Exact>, at: Timestamp) -> Sample {
        Sample::new(Some(value.into()), Quality::Good, at)
    }

    /// A value, if there is one, with its quality.
    pub fn new(value: Option<Exact>, quality: Quality, at: Timestamp) -> Sample {
        Sample { value: value.map(Exact::near), rest: value.and_then(Exact::rest), quality, at }
    }

    /// No value, and why.
    pub fn bad(cause: Cause, at: Timestamp) -> Sample {
        Sample::new(None, Quality::Bad(cause), at)
    }

    /// The value with all its digits: what is shown, stored, compared and sent on.
    pub fn exact(self) -> Option<Exact> {
        self.value.map(|value| Exact::of_parts(value, self.rest))
    }

    /// The last value kept, as uncertain; a sample without a value becomes bad.
    pub fn uncertain(self, cause: Cause) -> Sample {
        match self.value {
            Some(_) => Sample { quality: Quality::Uncertain(cause), ..self },
            None => Sample { quality: Quality::Bad(cause), ..self },
        }
    }

    /// The value only if it is good.
    pub fn good_value(self) -> Option<f64> {
        self.value.filter(|_| self.quality.is_good())
    }

    /// The value with all its digits, only if it is good.
    pub fn good_exact(self) -> Option<Exact> {
        self.exact().filter(|_| self.quality.is_good())
    }

    /// The value only if others may be scaled by it: it is good, the plant file states it, or what was heard may be it, and then
    /// they are no better.
    pub fn scaling_value(self) -> Option<f64> {
        self.value.filter(|_| self.quality.is_good() || self.is_stated() || self.is_unproven())
    }

    /// Does the plant file say so, and not the device?
    pub fn is_stated(self) -> bool {
        self.quality == Quality::Uncertain(Cause::Stated)
    }

    /// May it be what another request was answered with?
    pub fn is_unproven(self) -> bool {
        self.quality == Quality::Uncertain(Cause::Unproven)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quality_survives_its_stored_code_and_its_word() {
        let all = Cause::ALL.into_iter().flat_map(|c| [Quality::Uncertain(c), Quality::Bad(c)]);
        for quality in all.chain([Quality::Good]) {
            assert_eq!(Quality::from_code(quality.code()), Some(quality));
            assert_eq!(Quality::from_word(&quality.word()), Some(quality));
        }
        assert_eq!(Quality::from_code(63), None);
        assert_eq!(Quality::from_code(255), None);
    }

    #[test]
    fn an_uncertain_value_is_kept_and_a_missing_one_stays_missing() {
        let at = Timestamp::UNIX_EPOCH;
        assert_eq!(Sample::good(1.5, at).uncertain(Cause::Timeout).value, Some(1.5));
        assert_eq!(Sample::bad(Cause::NotRead, at).uncertain(Cause::Timeout).quality, Quality::Bad(Cause::Timeout));
        assert_eq!(Sample::good(1.5, at).uncertain(Cause::Stale).good_value(), None);
    }
}
