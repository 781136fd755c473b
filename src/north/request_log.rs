//! The list of the latest requests: what is repeated gets its answer again, and nothing is done twice, not even after a restart.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    payload::Message,
    request::{ReplyTo, Request},
};
use crate::plant::{
    command::{NotConfirmed, Outcome},
    exact::Exact,
};

/// This many of the latest are kept after they have expired.
const KEPT: usize = 100;
/// Entries at most. The rate of requests and the time within which they expire keep it below.
const ENTRIES_MAX: usize = 1_000;

/// The requests that were passed on to the plant, oldest first.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RequestLog {
    entries: Vec<Entry>,
}

/// A request that was passed on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    pub id: String,
    pub tag: String,
    pub value: Exact,
    pub expires: Timestamp,
    /// When it came.
    pub at: Timestamp,
    pub reply: ReplyTo,
    /// What the device will hold, once the plant has accepted it.
    pub value_held: Option<Exact>,
    /// `None` while its outcome is awaited.
    pub ended: Option<Ended>,
    /// The number of its command in this run of the station.
    #[serde(skip)]
    pub number: u32,
    /// The client knows that the plant has it.
    #[serde(skip)]
    pub acknowledged: bool,
}

/// How a request ended, in the words of its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ended {
    pub result: RequestResult,
    pub reason: Option<String>,
    /// The audit entry is on disk.
    pub recorded: bool,
    pub at: Timestamp,
}

/// What an answer says of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RequestResult {
    /// The plant has it; another answer follows.
    Accepted,
    /// Read back and equal.
    Verified,
    /// A broadcast is on its way: nothing can confirm it.
    Sent,
    /// Nothing was written.
    Refused,
    /// The device holds another value.
    Failed,
    /// It may have taken effect.
    Unknown,
}

impl Ended {
    /// What an outcome is in an answer; `None` while there is none.
    pub fn from_outcome(outcome: &Outcome, recorded: bool, at: Timestamp) -> Option<Ended> {
        let (result, reason) = match outcome {
            Outcome::Pending => return None,
            Outcome::Verified => (RequestResult::Verified, None),
            Outcome::Unchanged => {
                (RequestResult::Verified, Some("the device already had this value, nothing was written".to_owned()))
            }
            Outcome::Sent => (RequestResult::Sent, Some("no unit answers a broadcast".to_owned())),
            Outcome::Refused(why) => (RequestResult::Refused, Some(why.to_string())),
            Outcome::Failed(fault) => (RequestResult::Failed, Some(fault.to_string())),
            Outcome::NotConfirmed(why) => {
                let result = match why {
                    NotConfirmed::NotApplied(..) | NotConfirmed::Different(_) => RequestResult::Failed,
                    NotConfirmed::NotAnswered(_)
                    | NotConfirmed::NotRead(_)
                    | NotConfirmed::PartlyWritten { .. }
                    | NotConfirmed::PartlyAccepted { .. }
                    | NotConfirmed::StationStopped
                    | NotConfirmed::Reloaded
                    | NotConfirmed::ConnectionLost
                    | NotConfirmed::NoReadBack => RequestResult::Unknown,
                };
                (result, Some(why.to_string()))
            }
        };
        Some(Ended { result, reason, recorded, at })
    }

    /// It may have taken effect, and only the value tells.
    pub fn unknown(why: &str, at: Timestamp) -> Ended {
        let reason = Some(format!("{why}: it may have taken effect, check the value"));
        Ended { result: RequestResult::Unknown, reason, recorded: false, at }
    }
}

impl RequestLog {
    /// A request that was passed on with this id.
    pub fn find(&mut self, id: &str) -> Option<&mut Entry> {
        self.entries.iter_mut().rev().find(|entry| entry.id == id)
    }

    /// Those without an outcome.
    pub fn pending(&mut self) -> impl Iterator<Item = &mut Entry> {
        self.entries.iter_mut().filter(|entry| entry.ended.is_none())
    }

    /// Takes a request in; `false` if there is no room.
    pub fn add(&mut self, request: &Request, reply: ReplyTo, number: u32, now: Timestamp) -> bool {
        let outdated = self.entries.len().saturating_sub(KEPT);
        let mut place = 0..;
        self.entries.retain(|entry| {
            let is_old = place.next().is_some_and(|place| place < outdated);
            !is_old || entry.ended.is_none() || now < entry.expires
        });
        if ENTRIES_MAX <= self.entries.len() {
            return false;
        }
        self.entries.push(Entry {
            id: request.id.clone(),
            tag: request.tag.clone(),
            value: request.value,
            expires: request.expires,
            at: now,
            reply,
            value_held: None,
            ended: None,
            number,
            acknowledged: false,
        });
        true
    }

    /// Takes back what was not passed on after all.
    pub fn remove(&mut self, number: u32) -> Option<Entry> {
        let place = self.entries.iter().rposition(|entry| entry.number == number && entry.ended.is_none())?;
        Some(self.entries.remove(place))
    }

    /// The file.
    pub fn to_bytes(&self) -> Vec<u8> {
        json!(self).to_string().into_bytes()
    }
}

impl Entry {
    /// The same request again, and not another one with its id?
    pub fn is(&self, request: &Request) -> bool {
        self.tag == request.tag && self.value == request.value
    }

    /// What is known of it now.
    pub fn answer(&self) -> Message {
        let ended = self.ended.as_ref();
        let result = ended.map_or(RequestResult::Accepted, |ended| ended.result);
        let payload = json!({
            "id": self.id, "tag": self.tag, "value": self.value_held.unwrap_or(self.value), "result": result,
            "reason": ended.and_then(|ended| ended.reason.as_deref()),
            "recorded": ended.map(|ended| ended.recorded),
            "at": ended.map_or(self.at, |ended| ended.at).to_string(),
        });
        Message::answer(&self.reply, &payload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        north::request::{
            read,
            tests::{at, json, message},
        },
        plant::fault::Fault,
    };

    fn request(id: &str, second: i64) -> Request {
        let request = read(&message(&json(id, "50"))).expect("a request");
        Request { expires: at(second + 600), ..request }
    }

    fn reply() -> ReplyTo {
        ReplyTo { topic: "answers".into(), correlation: Some(vec![0, 255]) }
    }

    #[test]
    fn ids_are_known_until_they_expire_and_the_list_is_bounded() {
        let mut log = RequestLog::default();
        for number in 0..5_000_u32 {
            let second = i64::from(number);
            assert!(log.add(&request(&number.to_string(), second), reply(), number, at(second)), "{number}");
            log.pending().for_each(|entry| entry.ended = Some(Ended::unknown("over", at(second))));
            let oldest = number.saturating_sub(599);
            assert!(log.find(&oldest.to_string()).is_some(), "{oldest} has not expired");
        }
        assert!(log.entries.len() <= 601, "{}", log.entries.len());
    }

    #[test]
    fn a_full_list_takes_no_request() {
        let mut log = RequestLog::default();
        let taken = (0..2_000).filter(|number| log.add(&request(&number.to_string(), 0), reply(), *number, at(0)));
        assert_eq!(taken.count(), ENTRIES_MAX);
    }

    #[test]
    fn the_file_has_what_an_answer_after_a_restart_needs() {
        let mut log = RequestLog::default();
        log.add(&request("a", 0), reply(), 1, at(0));
        let read: RequestLog = serde_json::from_slice(&log.to_bytes()).expect("the file is JSON");
        assert_eq!(read.entries[0], Entry { number: 0, ..log.entries[0].clone() });
        assert_eq!(read.entries[0].reply.correlation, Some(vec![0, 255]));
    }

    #[test]
    fn an_outcome_that_is_in_doubt_is_never_a_failure() {
        let check = |outcome: Outcome, expect: Option<RequestResult>| {
            let found = Ended::from_outcome(&outcome, true, at(0)).map(|ended| ended.result);
            assert_eq!(found, expect, "{outcome:?}");
        };
        check(Outcome::Pending, None);
        check(Outcome::Verified, Some(RequestResult::Verified));
        check(Outcome::Unchanged, Some(RequestResult::Verified));
        check(Outcome::Sent, Some(RequestResult::Sent));
        check(Outcome::NotConfirmed(NotConfirmed::Different(48.0.into())), Some(RequestResult::Failed));
        check(
            Outcome::NotConfirmed(NotConfirmed::NotApplied(Fault::Timeout, 48.0.into())),
            Some(RequestResult::Failed),
        );
        check(Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)), Some(RequestResult::Unknown));
        check(Outcome::NotConfirmed(NotConfirmed::NotRead(Fault::Timeout)), Some(RequestResult::Unknown));
        check(Outcome::NotConfirmed(NotConfirmed::StationStopped), Some(RequestResult::Unknown));
        check(Outcome::NotConfirmed(NotConfirmed::NoReadBack), Some(RequestResult::Unknown));
    }
}
