//! The reducer of people: what a terminal asks comes in, what is permitted goes out. The only place where rights are decided.

use std::{collections::BTreeMap, sync::Arc};

use jiff::Timestamp;

use super::{OrderRequest, Standing, Who, Wish};
use crate::{
    history::Question,
    plant::{PlantDef, command::Order, record::ActionRecord, role::Role},
};

/// Where a terminal is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Peer {
    /// `pts/3 from 10.0.0.5, user panel`.
    pub from: Arc<str>,
    /// The user of the operating system, as the system says.
    pub unix_user: Option<Arc<str>>,
}

/// What must happen because of what was asked.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Hand this order to the plant, permitted or refused.
    Order(Order),
    /// Put this into the book.
    Record(ActionRecord),
    /// Answer a wish.
    Reply(u64, Result<(), String>),
    /// The standing of this terminal has changed.
    Standing(u32),
    /// End the station.
    Stop,
    /// Take up the plant file anew; the wish is answered when that is done.
    Reload(u64),
    /// This terminal may not stay.
    HangUp(u32, String),
}

/// All that is known of people.
#[derive(Debug)]
pub struct Gate {
    def: Arc<PlantDef>,
    sessions: BTreeMap<u32, Peer>,
}

impl Gate {
    /// Nobody is here yet.
    pub fn new(def: Arc<PlantDef>) -> Gate {
        Gate { def, sessions: BTreeMap::new() }
    }

    /// A terminal has attached.
    pub fn open(&mut self, terminal: u32, peer: Peer, _at: Timestamp) -> Vec<Effect> {
        self.sessions.insert(terminal, peer);
        vec![Effect::Standing(terminal)]
    }

    /// A terminal has gone.
    pub fn close(&mut self, terminal: u32, _at: Timestamp) -> Vec<Effect> {
        self.sessions.remove(&terminal);
        Vec::new()
    }

    /// A terminal gives an order.
    pub fn order(&mut self, terminal: u32, request: OrderRequest, _at: Timestamp) -> Vec<Effect> {
        let Some(peer) = self.sessions.get(&terminal) else { return Vec::new() };
        let by = peer.unix_user.clone().unwrap_or_else(|| "operator".into());
        let OrderRequest { id, command, seen, note, sign: _ } = request;
        vec![Effect::Order(Order { id, by, from: peer.from.clone(), command, seen, note, refused: None })]
    }

    /// May this terminal ask this of the history? `Err` says why not.
    pub fn may_ask(&self, _terminal: u32, _question: &Question) -> Result<(), String> {
        Ok(())
    }

    /// A terminal wishes; the answer goes to the ticket.
    pub fn wish(&mut self, _terminal: u32, ticket: u64, wish: Wish, _at: Timestamp) -> Vec<Effect> {
        match wish {
            Wish::Stop => vec![Effect::Reply(ticket, Ok(())), Effect::Stop],
            Wish::Reload => vec![Effect::Reload(ticket)],
            Wish::Active => vec![Effect::Reply(ticket, Ok(()))],
            _ => vec![Effect::Reply(ticket, Err("not yet".to_owned()))],
        }
    }

    /// Time passes.
    pub fn tick(&mut self, _at: Timestamp) -> Vec<Effect> {
        Vec::new()
    }

    /// How a terminal stands.
    pub fn standing(&self, terminal: u32, _at: Timestamp) -> Standing {
        let user = self.sessions.get(&terminal).and_then(|peer| peer.unix_user.clone());
        let who = user.map(|user| Who { user, role: Role::Supervisor, must_change: false });
        let notice = self.def.access.notice.as_deref().map(Arc::from);
        Standing { who, view: true, notice, ..Standing::default() }
    }
}
