//! A terminal's own orders over all its connections: the station may number it anew, its operator sees one terminal.

use std::{collections::VecDeque, sync::Arc};

use jiff::Timestamp;

use crate::{
    access::OrderRequest,
    plant::{
        Snapshot,
        command::{NotConfirmed, OrderId, OrderStatus, Outcome, Refusal},
        diagnostics::DiagnosticRun,
    },
};

/// Said of an order that never left this terminal.
pub const GONE: &str = "station has gone";
/// Numbers of earlier connections that are still known as one's own.
const NUMBERS_MAX: usize = 64;
/// Own orders that are remembered; a snapshot has no more.
const ORDERS_MAX: usize = 32;

/// What a terminal remembers of itself.
#[derive(Debug)]
pub struct Own {
    /// The number that its operator's orders have here, for as long as the terminal lives.
    terminal: u32,
    /// Which run of the station gave the numbers below.
    run: u64,
    /// The numbers that the station has given it, the present one last.
    numbers: VecDeque<u32>,
    /// Sent, and their end not seen in a snapshot yet.
    sent: VecDeque<OrderStatus>,
    /// Orders that no snapshot of the station will ever tell the end of.
    lost: VecDeque<OrderStatus>,
    /// The station is there: what its snapshots say of an order under way is still true.
    connected: bool,
}

impl Own {
    /// First connection: the number that the station gives is the one to keep.
    pub fn new(run: u64, terminal: u32) -> Own {
        Own { terminal, run, numbers: [terminal].into(), sent: VecDeque::new(), lost: VecDeque::new(), connected: true }
    }

    /// The number of the terminal as its operator's orders have it.
    pub fn terminal(&self) -> u32 {
        self.terminal
    }

    /// A later connection.
    pub fn welcomed(&mut self, run: u64, terminal: u32) {
        if self.run != run {
            self.run = run;
            self.numbers.clear();
        }
        push(&mut self.numbers, terminal, NUMBERS_MAX);
        self.connected = true;
    }

    /// An order on its way out: with the number that the station knows.
    pub fn send(&mut self, mut request: OrderRequest, by: Arc<str>, at: Timestamp) -> OrderRequest {
        push(&mut self.sent, status(&request, by, at, Outcome::Pending), ORDERS_MAX);
        request.id.terminal = *self.numbers.back().expect("a connection has a number");
        request
    }

    /// An order did not leave this terminal.
    pub fn refuse(&mut self, request: &OrderRequest, by: Arc<str>, at: Timestamp, why: &str) {
        let outcome = Outcome::Refused(Refusal::NotPermitted(why.to_owned()));
        push(&mut self.lost, status(request, by, at, outcome), ORDERS_MAX);
    }

    /// The station says that it did not take an order.
    pub fn undelivered(&mut self, id: OrderId, why: String) {
        if let Some(place) = self.sent.iter().position(|order| order.id.number == id.number)
            && let Some(order) = self.sent.remove(place)
        {
            let outcome = Outcome::Refused(Refusal::NotPermitted(why));
            push(&mut self.lost, OrderStatus { outcome, ..order }, ORDERS_MAX);
        }
    }

    /// The connection has ended: what was sent and not seen may or may not have been done.
    pub fn gone(&mut self) {
        self.connected = false;
        while let Some(order) = self.sent.pop_front() {
            let outcome = Outcome::NotConfirmed(NotConfirmed::ConnectionLost);
            push(&mut self.lost, OrderStatus { outcome, ..order }, ORDERS_MAX);
        }
    }

    /// A snapshot of the station as this terminal is to see it: own orders under the own number, lost ones among them.
    pub fn see(&mut self, snapshot: &Arc<Snapshot>) -> Arc<Snapshot> {
        let told = |number: u32| {
            let own = |order: &&OrderStatus| order.id.number == number && self.numbers.contains(&order.id.terminal);
            snapshot.orders.iter().find(own).map(|order| order.outcome != Outcome::Pending)
        };
        self.sent.retain(|order| told(order.id.number) != Some(true));
        if self.connected {
            // The station remembers it after all: what it says counts again.
            let (known, lost) = self.lost.drain(..).partition(|order| told(order.id.number).is_some());
            let known: VecDeque<OrderStatus> = known;
            let under_way = known.into_iter().filter(|order| told(order.id.number) == Some(false));
            self.sent.extend(under_way.map(|order| OrderStatus { outcome: Outcome::Pending, ..order }));
            self.lost = lost;
        }
        if self.lost.is_empty() && self.numbers.iter().all(|number| *number == self.terminal) {
            return snapshot.clone();
        }
        let mut seen = Snapshot::clone(snapshot);
        for order in &mut seen.orders {
            order.id = self.renumbered(order.id);
        }
        for restore in &mut seen.restores {
            let restore = Arc::make_mut(restore);
            restore.id = self.renumbered(restore.id);
            for step in &mut restore.steps {
                step.order = step.order.map(|id| self.renumbered(id));
            }
        }
        for line in &mut seen.lines {
            if let Some(test) = &line.test {
                line.test =
                    Some(Arc::new(DiagnosticRun { id: self.renumbered(test.id), ..DiagnosticRun::clone(test) }));
            }
        }
        // The last snapshot of a station that has gone shows as under way what nobody will hear the end of.
        let is_lost =
            |id: OrderId| id.terminal == self.terminal && self.lost.iter().any(|lost| lost.id.number == id.number);
        seen.orders.retain(|order| !is_lost(order.id));
        seen.orders.splice(0..0, self.lost.iter().rev().cloned());
        seen.orders.truncate(ORDERS_MAX);
        Arc::new(seen)
    }

    /// All own numbers become the own one; whoever has the own one by chance gets one that is nobody's.
    fn renumbered(&self, id: OrderId) -> OrderId {
        let terminal = if self.numbers.contains(&id.terminal) {
            self.terminal
        } else if id.terminal == self.terminal {
            *self.numbers.back().expect("a connection has a number")
        } else {
            id.terminal
        };
        OrderId { terminal, ..id }
    }
}

fn status(request: &OrderRequest, by: Arc<str>, at: Timestamp, outcome: Outcome) -> OrderStatus {
    let OrderRequest { id, run: _, kind, seen, note, sign: _ } = request.clone();
    OrderStatus { id, by, from: "".into(), note, kind, at, old: seen, outcome, recorded: true }
}

fn push<T>(list: &mut VecDeque<T>, element: T, max: usize) {
    list.push_back(element);
    if max < list.len() {
        list.pop_front();
    }
}

#[cfg(test)]
mod tests;
