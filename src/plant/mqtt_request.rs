//! What became of the requests that came from outside over MQTT, and why one is refused before the plant sees it.

use std::fmt;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::command::Outcome;
use crate::t;

/// The requests from outside since the start.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MqttRequestStatus {
    /// The user as whom they act.
    pub user: String,
    /// Passed on to the plant.
    pub accepted: u64,
    /// Refused, by the station before or by the plant.
    pub refused: u64,
    /// Without an answer: there were too many, or the broker refused it.
    pub unanswered: u64,
    /// The latest.
    pub last: Option<LastMqttRequest>,
    /// Why none is taken, or answered; `None` while all is well.
    pub error: Option<String>,
}

/// The latest request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LastMqttRequest {
    /// When it came, UTC.
    pub at: Timestamp,
    /// Its id, tag and value, as far as they could be read: `4711 TIC-1.SV = 50`.
    pub what: String,
    /// What became of it so far.
    pub result: MqttResult,
}

/// What became of a request so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum MqttResult {
    /// Refused before the plant saw it.
    Refused(MqttRefusal),
    /// With the plant, or its outcome.
    Outcome(Outcome),
    /// The station ended, or lost sight of it, before the outcome.
    Unknown,
}

impl fmt::Display for MqttResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MqttResult::Refused(why) => write!(f, "{}", t!("refused: {why}", why)),
            MqttResult::Outcome(outcome) => write!(f, "{outcome}"),
            MqttResult::Unknown => f.write_str(t!("unknown: it may have taken effect, check the value")),
        }
    }
}

/// Why a request is refused before the plant sees it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum MqttRefusal {
    /// The broker keeps it, and would deliver it again.
    #[error("{}", t!("it is a retained message"))]
    Retained,
    /// More bytes than a request has.
    #[error("{}", t!("it is longer than {max} bytes", max = .0))]
    TooLong(usize),
    /// Not the text of a request.
    #[error("{}", t!("not a request: {why}", why = .0))]
    NotARequest(String),
    /// An id that is empty, too long or not printable.
    #[error("{}", t!("the id must have 1 to {max} printable ASCII characters", max = .0))]
    Id(usize),
    /// Another request had this id.
    #[error("{}", t!("another request had this id"))]
    IdReused,
    /// Where the answer is to go is no topic for answers.
    #[error("{}", t!("the response topic or its correlation data is not permitted"))]
    ResponseTopic,
    /// It came too late.
    #[error("{}", t!("it has expired"))]
    Expired,
    /// It would be valid for too long.
    #[error("{}", t!("it expires later than {max} s from now", max = .0))]
    ExpiresLate(u64),
    /// The plant has no such tag.
    #[error("{}", t!("there is no tag {tag}", tag = .0))]
    UnknownTag(String),
    /// The tag is of another device than the topic.
    #[error("{}", t!("the tag is not of the device of this topic"))]
    OtherDevice,
    /// Not a value that can be typed for the tag.
    #[error("{0}")]
    Value(String),
    /// More than are taken at a time.
    #[error("{}", t!("too many requests, wait a moment"))]
    TooMany,
    /// The list of requests could not be written.
    #[error("{}", t!("it could not be recorded: {why}", why = .0))]
    NotRecorded(String),
    /// The list of requests was damaged: what was done before is not known.
    #[error("{}", t!("the list of earlier requests is damaged, none is accepted before {until}", until = .0))]
    ListDamaged(Timestamp),
    /// It waited when the station was stopped.
    #[error("{}", t!("the station is stopping"))]
    Stopping,
    /// It did not reach the plant.
    #[error("{0}")]
    NotDelivered(String),
}

impl MqttRequestStatus {
    /// `as mes, 3 accepted, 2 refused, 0 unanswered`, and `last at 14:02:30: 4711 TIC-1.SV = 50: verified` if there was one;
    /// `at` gives an instant in words.
    pub fn words(&self, at: impl Fn(Timestamp) -> String) -> Vec<String> {
        let MqttRequestStatus { user, accepted, refused, unanswered, last, error } = self;
        let why = error.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
        let counts = t!(
            "as {user}{why}, {accepted} accepted, {refused} refused, {unanswered} unanswered",
            user,
            why,
            accepted,
            refused,
            unanswered
        );
        let last = last.as_ref().map(|LastMqttRequest { at: came, what, result }| {
            t!("last at {at}: {what}: {result}", at = at(*came), what, result)
        });
        std::iter::once(counts).chain(last).collect()
    }
}
