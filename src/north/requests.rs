//! The state machine of requests from outside: which are passed on to the plant, and what is answered when.
//!
//! ```text
//!   message ──> readable? known id? valid? within the rate? ──> list on disk ──> command ──> outcome
//!                  └ refused    └ its answer again   └ refused                    └ accepted    └ answer
//! ```
//!
//! A request is on the list, on disk, before its command is sent: after a restart it is known, and never done again.

#[cfg(test)]
mod tests;

use std::time::Duration;

use jiff::Timestamp;
use serde_json::json;

use super::{
    payload::Message,
    refusals::{Refusal, Refusals},
    request::{self, EXPIRES_MAX, Received, ReplyTo, Request},
    request_log::{Ended, Entry, RequestLog},
};
use crate::{
    access::{RateLimit, SessionStatus},
    plant::{
        PlantDef, Snapshot,
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome},
        def::{MqttDef, TagId},
        entry,
        exact::{Exact, digits},
        mqtt_request::{LastMqttRequest, MqttRefusal, MqttRequestStatus, MqttResult},
        time::elapsed,
    },
};

/// Requests passed on.
const RATE: RateLimit = RateLimit::new(10, Duration::from_secs(1));
/// Refusals, and answers given again.
const ANSWERS: RateLimit = RateLimit::new(20, Duration::from_millis(500));
/// Requests without an outcome at most.
const PENDING_MAX: usize = 16;
/// A request without an outcome for so long is answered as unknown; the station follows its command further.
const OUTCOME_MAX: Duration = Duration::from_secs(150);
/// Fits a request that is refused without being read.
const UNREADABLE: &str = "?";

/// Two clocks: one that is never set, and UTC.
#[derive(Debug, Clone, Copy)]
pub struct Now {
    pub plant: Timestamp,
    pub utc: Timestamp,
}

/// The requests from outside of one run of the station.
#[derive(Debug)]
pub struct Requests {
    mqtt: MqttDef,
    log: RequestLog,
    rate: RateLimit,
    answers: RateLimit,
    last_number: u32,
    /// The list was damaged: nothing is taken before, as it may have been done already.
    closed_until: Option<Timestamp>,
    /// Nothing more is passed on.
    is_stopping: bool,
    status: MqttRequestStatus,
    /// What the audit log does not have yet.
    refusals: Refusals,
    /// Times of the commands under way, by number.
    sent: Vec<(u32, Timestamp)>,
}

/// What is to be done about a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// Nothing more.
    None,
    /// Send this.
    Answer(Message),
    /// Write the list, then send this command.
    PassOn(PassOn),
}

/// A request on its way to the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct PassOn {
    /// Of the command.
    pub number: u32,
    tag: TagId,
    value: Exact,
    expected: Option<Exact>,
    expires: Timestamp,
    note: String,
}

impl PassOn {
    /// The command, on the plant as it is now. `Err`: writing the list took so long that it has expired, or the value has more
    /// decimals than its tag.
    pub fn command(self, snapshot: &Snapshot, terminal: u32, now: Now) -> Result<Command, MqttRefusal> {
        let PassOn { number, tag, value, expected, expires, note } = self;
        if expires <= now.utc {
            return Err(MqttRefusal::Expired);
        }
        // No one can be asked what was meant; a value that the device would round is refused by the plant.
        entry::check_decimals(entry::decimals_of(value), snapshot.decimals[tag.index()]).map_err(MqttRefusal::Value)?;
        let command = snapshot.command(CommandId { terminal, number }, CommandKind::Write { tag, value });
        let is_unconditional = expected.is_none();
        let expected_value = expected.or(command.expected_value);
        Ok(Command { expected_value, is_unconditional, note: Some(note.into()), ..command })
    }
}

impl Requests {
    /// `log`: the list of the run before; `Err` if it is damaged.
    pub fn new(mqtt: MqttDef, log: Result<RequestLog, String>, now: Now) -> Requests {
        let user = mqtt.commands_as.clone().unwrap_or_default();
        let closed_until = log.is_err().then(|| now.utc.checked_add(EXPIRES_MAX).unwrap_or(Timestamp::MAX));
        let (log, error) = match log {
            Ok(log) => (log, None),
            Err(why) => (RequestLog::default(), Some(why)),
        };
        let status = MqttRequestStatus { user, error, ..MqttRequestStatus::default() };
        let (rate, answers) = (RATE, ANSWERS);
        let (refusals, sent) = (Refusals::default(), Vec::new());
        let (last_number, is_stopping) = (0, false);
        Requests { mqtt, log, rate, answers, last_number, closed_until, is_stopping, status, refusals, sent }
    }

    /// What is shown.
    pub fn status(&self) -> &MqttRequestStatus {
        &self.status
    }

    /// The list as a file.
    pub fn log_bytes(&self) -> Vec<u8> {
        self.log.to_bytes()
    }

    /// What was under way when the station ended: done or not, it is not done again.
    pub fn after_restart(&mut self, now: Now) -> Vec<Message> {
        let ended = Ended::unknown("the station was restarted before the outcome", now.utc);
        self.log.pending().map(|entry| entry.end(ended.clone())).collect()
    }

    /// Messages for which the queue had no room.
    pub fn on_lost(&mut self, lost: u64) {
        if 0 < lost {
            self.status.refused += lost;
            self.status.unanswered += lost;
            self.refusals.count(Refusal { what: UNREADABLE.into(), why: MqttRefusal::TooMany, count: lost });
        }
    }

    /// An answer for which there was no room.
    pub fn on_answer_lost(&mut self) {
        self.status.unanswered += 1;
    }

    /// Refusals that are to be recorded now.
    pub fn refusals(&mut self, now: Now) -> Vec<Refusal> {
        self.refusals.take(now.plant)
    }

    /// The station ends: what still waits is refused.
    pub fn stop(&mut self) {
        self.is_stopping = true;
    }

    /// All that are not recorded yet: the station ends.
    pub fn last_refusals(&mut self) -> Vec<Refusal> {
        self.refusals.take_all()
    }

    /// They could not be recorded now.
    pub fn on_refusal_not_recorded(&mut self, refusal: Refusal) {
        self.refusals.count(refusal);
    }

    /// The broker has delivered a message.
    pub fn on_received(&mut self, plant: &PlantDef, received: &Received, now: Now) -> Decision {
        let (reply, is_permitted) = request::reply_to(&self.mqtt, received);
        let request = match request::read(received) {
            Ok(request) => request,
            Err(why) => {
                let id = request::id_of(received);
                let shown = id.clone().unwrap_or(UNREADABLE.into());
                return self.refuse((id.as_deref(), shown), &reply, why, now);
            }
        };
        let named = (Some(&*request.id), what(&request));
        if let Some(entry) = self.log.find(&request.id) {
            if !entry.is(&request) {
                return self.refuse(named, &reply, MqttRefusal::IdReused, now);
            }
            if is_permitted {
                entry.reply = reply;
            }
            let answer = entry.answer();
            return self.limited(answer, now);
        }
        let checked = match self.closed_until.filter(|until| now.utc < *until) {
            Some(until) => Err(MqttRefusal::ListDamaged(until)),
            None if self.is_stopping => Err(MqttRefusal::Stopping),
            None if !is_permitted => Err(MqttRefusal::ResponseTopic),
            None => request::check(plant, &self.mqtt, &received.topic, &request, now.utc),
        };
        let number = self.last_number + 1;
        let tag = match checked {
            Ok(tag) if self.has_room(now) && self.log.add(&request, reply.clone(), number, now.utc) => tag,
            Ok(_) => return self.refuse(named, &reply, MqttRefusal::TooMany, now),
            Err(why) => return self.refuse(named, &reply, why, now),
        };
        self.last_number = number;
        self.sent.push((number, now.plant));
        self.status.accepted += 1;
        self.show(named.1, MqttResult::Outcome(Outcome::Pending), now);
        let Request { id, reason, value, expected, expires, .. } = request;
        let reason = reason.map(|reason| format!(": {reason}")).unwrap_or_default();
        let note = format!("request {id}{reason}");
        Decision::PassOn(PassOn { number, tag, value, expected, expires, note })
    }

    fn has_room(&mut self, now: Now) -> bool {
        self.log.pending().count() < PENDING_MAX && self.rate.try_acquire(steady(now))
    }

    /// `named`: its id, if it can be sent back, and what is shown of it.
    fn refuse(&mut self, (id, shown): (Option<&str>, String), reply: &ReplyTo, why: MqttRefusal, now: Now) -> Decision {
        self.on_refused(shown, &why, now);
        self.limited(refusal(id, reply, &why, now), now)
    }

    /// Counts a refusal before the plant, shows it and keeps it for the audit log.
    fn on_refused(&mut self, what: String, why: &MqttRefusal, now: Now) {
        self.status.refused += 1;
        self.refusals.count(Refusal { what: what.clone(), why: why.clone(), count: 1 });
        self.show(what, MqttResult::Refused(why.clone()), now);
    }

    fn limited(&mut self, answer: Message, now: Now) -> Decision {
        if self.answers.try_acquire(steady(now)) {
            return Decision::Answer(answer);
        }
        self.status.unanswered += 1;
        Decision::None
    }

    /// A request was not passed on after all: its id may be used again.
    pub fn on_not_passed_on(&mut self, number: u32, why: MqttRefusal, now: Now) -> Option<Message> {
        let entry = self.log.remove(number)?;
        self.status.accepted -= 1;
        self.on_refused(entry.what(), &why, now);
        Some(refusal(Some(&entry.id), &entry.reply, &why, now))
    }

    /// The plant has gone on: what became of the commands.
    pub fn on_snapshot(&mut self, snapshot: &Snapshot, terminal: u32, now: Now) -> Vec<Message> {
        let ours = |status: &&CommandStatus| status.command.id.terminal == terminal;
        let mut answers = Vec::new();
        for status in snapshot.commands.iter().rev().filter(ours) {
            answers.extend(self.on_command(status, now));
        }
        self.sent.retain(|(_, at)| elapsed(*at, now.plant) < OUTCOME_MAX);
        let sent = &self.sent;
        let overdue = self.log.pending().filter(|entry| sent.iter().all(|(number, _)| *number != entry.number));
        answers.extend(overdue.map(|entry| entry.end(Ended::unknown("no outcome yet", now.utc))));
        answers
    }

    fn on_command(&mut self, status: &CommandStatus, now: Now) -> Option<Message> {
        let entry = self.log.pending().find(|entry| entry.number == status.command.id.number)?;
        // What the device will hold, which need not be what was requested.
        entry.value_held = status.command.kind.written().map(|(_, held)| held);
        let Some(ended) = Ended::from_outcome(&status.outcome, status.recorded, now.utc) else {
            let is_news = !std::mem::replace(&mut entry.acknowledged, true);
            return is_news.then(|| entry.answer());
        };
        let (answer, what) = (entry.end(ended), entry.what());
        if matches!(status.outcome, Outcome::Refused(_)) {
            self.status.refused += 1;
        }
        self.show(what, MqttResult::Outcome(status.outcome.clone()), now);
        Some(answer)
    }

    /// The session has changed: commands that did not reach the plant, and whether the user is there.
    pub fn on_session(&mut self, session: &SessionStatus, terminal: u32, now: Now) -> Vec<Message> {
        let user = &self.status.user;
        let missing = session.who.is_none().then(|| format!("{user} is not a user of this station, or is disabled"));
        self.status.error =
            self.closed_until.filter(|until| now.utc < *until).and(self.status.error.take()).or(missing);
        let ours = session.undelivered.iter().filter(|(id, _)| id.terminal == terminal);
        let lost: Vec<_> = ours.map(|(id, why)| (id.number, MqttRefusal::NotDelivered(why.to_string()))).collect();
        lost.into_iter().filter_map(|(number, why)| self.on_not_passed_on(number, why, now)).collect()
    }

    fn show(&mut self, what: String, result: MqttResult, now: Now) {
        self.status.last = Some(LastMqttRequest { at: now.utc, what, result });
    }
}

fn steady(now: Now) -> Duration {
    elapsed(Timestamp::UNIX_EPOCH, now.plant)
}

/// `4711 TIC-1.SV = 50`.
fn what(request: &Request) -> String {
    words(&request.id, &request.tag, request.value)
}

fn words(id: &str, tag: &str, value: Exact) -> String {
    let tag: String = tag.chars().filter(char::is_ascii_graphic).take(40).collect();
    format!("{id} {tag} = {}", digits(value, None))
}

impl Entry {
    fn what(&self) -> String {
        words(&self.id, &self.tag, self.value)
    }

    fn end(&mut self, ended: Ended) -> Message {
        self.ended = Some(ended);
        self.answer()
    }
}

fn refusal(id: Option<&str>, reply: &ReplyTo, why: &MqttRefusal, now: Now) -> Message {
    let payload = json!({ "id": id, "result": "refused", "reason": why.to_string(), "at": now.utc.to_string() });
    Message::answer(reply, &payload)
}
