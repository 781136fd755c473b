//! The state of one attached terminal: its user, its lock, its request rate.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::Peer;
use crate::{
    access::{LoggedInUser, RateLimit},
    plant::{command::CommandId, request_refusal::RequestRefusal, time::elapsed},
};

/// Requests of one terminal.
const REQUESTS: RateLimit = RateLimit::new(40, Duration::from_millis(50));
/// Refusals of one user of the operating system that get an audit entry each.
const REFUSALS: RateLimit = RateLimit::new(20, Duration::from_secs(2));

/// Commands that did not reach the plant and are remembered for their terminal: as many as may come at once.
const UNDELIVERED_MAX: usize = 64;

/// The session of a terminal.
#[derive(Debug)]
pub struct SessionState {
    /// Where it is.
    pub peer: Peer,
    /// What is counted together: the user of the operating system, as the system says, not what the terminal says of itself.
    pub origin: Arc<str>,
    /// Since when.
    pub since: Timestamp,
    /// The logged-in user.
    pub who: Option<LoggedInUser>,
    /// Goes up with each login and logout here.
    pub login_number: u64,
    /// Known by the operating system, without a password.
    pub trusted: bool,
    /// The user as whom requests from outside act here; `None` for a terminal.
    pub acts_as: Option<Arc<str>>,
    /// Locked until the password is entered.
    pub locked: bool,
    /// When a key was last pressed.
    pub active: Timestamp,
    requests: RateLimit,
    /// The number of its last command: each has a higher one.
    pub last_command: Option<u32>,
    /// Its latest commands that did not reach the plant, and why.
    pub undelivered: VecDeque<(CommandId, RequestRefusal)>,
}

impl SessionState {
    /// A terminal that has just attached.
    pub fn new(peer: Peer, at: Timestamp) -> SessionState {
        let origin = origin(&peer);
        SessionState {
            peer,
            origin,
            since: at,
            who: None,
            login_number: 0,
            trusted: false,
            acts_as: None,
            locked: false,
            active: at,
            requests: REQUESTS,
            last_command: None,
            undelivered: VecDeque::new(),
        }
    }

    /// Takes one request; `false` above the rate limit.
    pub fn accepts_request(&mut self, at: Timestamp) -> bool {
        self.requests.try_acquire(steady(at))
    }

    /// The user, unless the terminal is locked.
    pub fn acting(&self) -> Option<&LoggedInUser> {
        self.who.as_ref().filter(|_| !self.locked)
    }

    /// A command that did not reach the plant.
    pub fn undelivered(&mut self, id: CommandId, why: RequestRefusal) {
        if UNDELIVERED_MAX <= self.undelivered.len() {
            self.undelivered.pop_front();
        }
        self.undelivered.push_back((id, why));
    }

    /// A user has logged in.
    pub fn enter(&mut self, who: LoggedInUser, at: Timestamp) {
        (self.who, self.locked, self.trusted, self.active) = (Some(who), false, false, at);
        self.login_number += 1;
    }

    /// The user has logged out.
    pub fn leave(&mut self) {
        (self.who, self.locked, self.trusted) = (None, false, false);
        self.login_number += 1;
    }
}

fn origin(peer: &Peer) -> Arc<str> {
    match &peer.unix_user {
        _ if peer.in_process => "this process".into(),
        Some(user) => user.clone(),
        None => "unknown".into(),
    }
}

/// The refusals of one user of the operating system: the first have an entry each, further ones are counted.
#[derive(Debug)]
pub struct Refusals {
    limit: RateLimit,
    /// Refusals without an entry.
    pub unrecorded: u64,
    /// When refusals were last recorded.
    pub recorded_at: Timestamp,
}

impl Refusals {
    pub fn new(at: Timestamp) -> Refusals {
        Refusals { limit: REFUSALS, unrecorded: 0, recorded_at: at }
    }

    /// Counts a refusal; `true` if it gets an entry of its own.
    pub fn count(&mut self, at: Timestamp) -> bool {
        let recorded = self.limit.try_acquire(steady(at));
        self.unrecorded += u64::from(!recorded);
        recorded
    }
}

/// The time of the station, as rate limits count it.
fn steady(at: Timestamp) -> Duration {
    elapsed(Timestamp::UNIX_EPOCH, at)
}
