//! Why a command was refused, or why a write is not confirmed.

use serde::{Deserialize, Serialize};

use crate::{
    plant::{
        alarm::AlarmRefusal,
        fault::{ExceptionCode, Fault},
        parameter_set::Problem,
        request_refusal::RequestRefusal,
        tag_value::TagValue,
        text_value::ExpectedText,
    },
    t,
};

/// Why a command was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum Refusal {
    /// The role does not permit it, or no user is logged in.
    #[error("{0}")]
    NotPermitted(RequestRefusal),
    /// The tag requires a password or a second user, which is missing or wrong.
    #[error("{0}")]
    NotReauthenticated(RequestRefusal),
    /// The value changed after it was shown; this is the present one.
    #[error("{}", t!("it was changed to {what} after it was shown", what = .0))]
    ChangedTo(String),
    /// The command has no expected value; this is the present one.
    #[error("{}", t!("it is {what} now; check and confirm again", what = .0))]
    NotSeen(String),
    /// The profile says read-only.
    #[error("{}", t!("read only"))]
    ReadOnly,
    /// Its line is only listened to.
    #[error("{}", t!("this line only listens: another master polls it"))]
    OnlyListens,
    /// Not a number, or outside the permitted range.
    #[error("{}", t!("outside {min} … {max}", min = .min, max = .max))]
    OutOfRange {
        /// Lowest permitted, as text in the tag's unit; `−∞` if none.
        min: String,
        /// Highest permitted.
        max: String,
    },
    /// The device would round it, to this.
    #[error("{}", t!("the device would store {what}", what = .0))]
    Resolution(String),
    /// A bound or the decimals are not known, so the write cannot be checked.
    #[error("{}", t!("{what} is unknown", what = .0))]
    Unknown(String),
    /// No text that the tag can hold; this is expected.
    #[error("{}", t!("expected {what}", what = .0))]
    NotAText(ExpectedText),
    /// Not one of the values of the enumeration.
    #[error("{}", t!("not one of the values of this tag"))]
    NotAChoice,
    /// The device responded with an exception.
    #[error("{0}")]
    Exception(ExceptionCode),
    /// Nothing was sent: line closed, device in backoff.
    #[error("{0}")]
    NotSent(Fault),
    /// The station's queue to the line is full.
    #[error("{}", t!("line too busy"))]
    Busy,
    /// Another write to this tag is still under way.
    #[error("{}", t!("a write to this tag is under way"))]
    UnderWay,
    /// It still waited when a stop of the same tag came, and would have undone it.
    #[error("{}", t!("cancelled by a stop, nothing was sent"))]
    Superseded,
    /// An interlock of the plant file blocks it now.
    #[error("{}", t!("interlock: {what}", what = .0))]
    Interlock(String),
    /// A parameter set cannot be written to this device: the first reason, and how many others there are.
    #[error("{}", with_others(.0, *.1))]
    NotFit(Box<Problem>, usize),
    /// The confirmed changes are not those that are needed now.
    #[error("{}", t!("the device has changed; check and confirm again"))]
    Changed,
    /// A step of a restore would overwrite another value than the confirmed one.
    #[error("{}", t!("changed since you confirmed"))]
    ChangedSince,
    /// A step of a restore would overwrite an unknown value.
    #[error("{}", t!("unknown now"))]
    NotKnownNow,
    /// The settings of the line changed during a restore.
    #[error("{}", t!("the settings of the line have changed in the meantime"))]
    LineChanged,
    /// The device was not read in time before a restore.
    #[error("{}", t!("the device could not be read within {what} s", what = .0))]
    NotRead(u64),
    /// Stopped by an operator before anything was written.
    #[error("{}", t!("stopped before anything was written"))]
    Stopped,
    /// The settings could not be written into the plant file, or a parameter set into its folder.
    #[error("{}", t!("not saved: {what}", what = .0))]
    NotSaved(String),
    /// A parameter set without a value.
    #[error("{}", t!("not saved: no setting of the device could be read"))]
    NothingToSave,
    /// No line has this name and place.
    #[error("{}", t!("no such line"))]
    NotALine,
    /// One procedure at a time; this one is at work.
    #[error("{}", t!("procedure {what} is running", what = .0))]
    ProcedureAtWork(String),
    /// No control run can be recorded yet, and the procedure measures one.
    #[error("{}", t!("the history is not open: nothing can be measured"))]
    NotMeasurable,
    /// Settings or a test that a line cannot have.
    #[error("{0}")]
    NotValid(String),
    /// The alarm does not accept the command.
    #[error("{0}")]
    Alarm(AlarmRefusal),
    /// It does not count.
    #[error("{}", t!("not a counter"))]
    NotACounter,
    /// Nothing would be corrected by it.
    #[error("{}", t!("not an amount"))]
    NotAnAmount,
}

/// Why a write is not confirmed.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum NotConfirmed {
    /// No valid answer: it may or may not have taken effect.
    #[error("{}", t!("{what}; it may have taken effect", what = .0))]
    NotAnswered(Fault),
    /// No valid answer, for this reason, and the device holds another value.
    #[error("{}", t!("{what}, not applied: the device has {held}", what = .0, held = .1))]
    NotApplied(Fault, TagValue),
    /// Read back, and different.
    #[error("{}", t!("read back {what}", what = .0))]
    Different(TagValue),
    /// Could not be read back.
    #[error("{}", t!("not read back: {what}", what = .0))]
    NotRead(Fault),
    /// Of several writes only some are done: stopped, or at the tag that failed.
    #[error("{}", written_words(*.done, *.all, .failed.as_deref()))]
    PartlyWritten {
        /// Done.
        done: usize,
        /// Out of how many.
        all: usize,
        /// The tag.
        failed: Option<String>,
    },
    /// Of several alarms only some accepted the command.
    #[error("{}", t!("{done} of {count}; {first}", done = .done, count = .count, first = .first))]
    PartlyAccepted {
        /// Done.
        done: usize,
        /// Out of how many.
        count: usize,
        /// Why the first of the others did not.
        first: AlarmRefusal,
    },
    /// The station stopped before the result.
    #[error("{}", t!("the station stopped; it may have taken effect"))]
    StationStopped,
    /// The plant file was reloaded before the result, and with it the line started again.
    #[error("{}", t!("the plant file was reloaded; it may have taken effect"))]
    Reloaded,
    /// The terminal lost the station before the outcome.
    #[error("{}", t!("connection to the station lost; it may have taken effect"))]
    ConnectionLost,
    /// The profile excludes a read-back.
    #[error("{}", t!("accepted, not read back"))]
    NoReadBack,
}

fn with_others(first: &Problem, others: usize) -> String {
    match others {
        0 => first.to_string(),
        more => t!("{first}, and {more} more", first, more),
    }
}

fn written_words(done: usize, all: usize, failed: Option<&str>) -> String {
    match failed {
        Some(at) => t!("{done} of {all} written, then {at} failed", done, all, at),
        None => t!("{done} of {all} written, then stopped", done, all),
    }
}
