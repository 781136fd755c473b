//! The state of one attached terminal: its user, its lock, its request rate.

use std::{collections::VecDeque, sync::Arc};

use jiff::Timestamp;

use super::Peer;
use crate::{access::Who, plant::command::CommandId};

/// Requests a second of one terminal that are answered in the long run, and so many at once.
const REQUESTS: (f64, f64) = (20.0, 40.0);
/// Refusals a second of one place that are put on record each by itself, and so many at once.
const REFUSALS: (f64, f64) = (0.5, 20.0);

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
    /// Who sits there.
    pub who: Option<Who>,
    /// Goes up with each login and logout here.
    pub login_number: u64,
    /// He is known without a password, so none can be asked of him.
    pub trusted: bool,
    /// Only looking until the password is given.
    pub locked: bool,
    /// When a key was last pressed.
    pub active: Timestamp,
    /// What it may still ask.
    pub requests: Bucket,
    /// The number of its last command: each has a higher one.
    pub last_command: Option<u32>,
    /// Its latest commands that did not reach the plant, and why.
    pub undelivered: VecDeque<(CommandId, Arc<str>)>,
}

impl SessionState {
    /// A terminal that has just attached.
    pub fn new(peer: Peer, at: Timestamp) -> SessionState {
        let origin = origin(&peer);
        let requests = Bucket::full(REQUESTS, at);
        SessionState {
            peer,
            origin,
            since: at,
            who: None,
            login_number: 0,
            trusted: false,
            locked: false,
            active: at,
            requests,
            last_command: None,
            undelivered: VecDeque::new(),
        }
    }

    /// Who sits there, unless the terminal is locked.
    pub fn acting(&self) -> Option<&Who> {
        self.who.as_ref().filter(|_| !self.locked)
    }

    /// A command that did not reach the plant.
    pub fn undelivered(&mut self, id: CommandId, why: &str) {
        if UNDELIVERED_MAX <= self.undelivered.len() {
            self.undelivered.pop_front();
        }
        self.undelivered.push_back((id, why.into()));
    }

    /// A user has logged in.
    pub fn enter(&mut self, who: Who, at: Timestamp) {
        (self.who, self.locked, self.trusted, self.active) = (Some(who), false, false, at);
        self.login_number += 1;
    }

    /// Nobody sits there any more.
    pub fn leave(&mut self) {
        (self.who, self.locked, self.trusted) = (None, false, false);
        self.login_number += 1;
    }
}

fn origin(peer: &Peer) -> Arc<str> {
    match &peer.unix_user {
        _ if peer.own => "this process".into(),
        Some(user) => user.clone(),
        None => "unknown".into(),
    }
}

/// So much a second, and so much at once.
#[derive(Debug, Clone, Copy)]
pub struct Bucket {
    rate: f64,
    size: f64,
    left: f64,
    at: Timestamp,
}

impl Bucket {
    fn full((rate, size): (f64, f64), at: Timestamp) -> Bucket {
        Bucket { rate, size, left: size, at }
    }

    /// Takes one out; `false` when it is empty.
    pub fn take(&mut self, at: Timestamp) -> bool {
        let since = at.duration_since(self.at).as_secs_f64().max(0.0);
        self.left = (self.left + since * self.rate).min(self.size);
        self.at = self.at.max(at);
        let some = 1.0 <= self.left;
        if some {
            self.left -= 1.0;
        }
        some
    }
}

/// What a place was refused: the first times each on record, then only counted.
#[derive(Debug)]
pub struct Refusals {
    bucket: Bucket,
    /// Not on record yet.
    pub unrecorded: u64,
    /// When refusals were last recorded.
    pub recorded_at: Timestamp,
}

impl Refusals {
    /// Nothing was refused yet.
    pub fn new(at: Timestamp) -> Refusals {
        Refusals { bucket: Bucket::full(REFUSALS, at), unrecorded: 0, recorded_at: at }
    }

    /// One more. `true` if it may be on record by itself; otherwise it is counted.
    pub fn one(&mut self, at: Timestamp) -> bool {
        let some = self.bucket.take(at);
        if !some {
            self.unrecorded += 1;
        }
        some
    }
}
