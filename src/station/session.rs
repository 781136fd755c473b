//! What one terminal holds of a station: facts coming in, orders and questions going out.

use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use crate::{
    history::io::Query,
    plant::{Snapshot, command::Order},
    sim::io::Port,
};

/// One attached terminal. Dropping it stops nothing.
///
/// The station publishes a snapshot at least every two seconds of real time, changed or not: a terminal that hears
/// nothing for longer calls the station silent and doubts every value.
#[derive(Debug, Clone)]
pub struct Session {
    /// The latest snapshot only.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Orders; a full queue is a refusal.
    pub orders: mpsc::Sender<Order>,
    /// Questions to the history; a full queue is a refusal.
    pub queries: mpsc::Sender<Query>,
    /// Number of this terminal, the first part of its order ids.
    pub terminal: u32,
    /// Who sits there.
    pub operator: Arc<str>,
    /// The simulation behind the plant; a real plant has none.
    pub drill: Option<Port>,
}
