<<<<<<< HEAD
//! What one terminal holds of a station: facts coming in, orders and questions going out.
=======
//! What one attached terminal holds of a station: three channels and its name.
>>>>>>> ui

use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use crate::{
    history::Query,
<<<<<<< HEAD
    plant::{Snapshot, command::Order},
};

/// One attached terminal. Dropping it stops nothing.
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
=======
    plant::{command::Order, snapshot::Snapshot},
};

/// One terminal's connection. Dropping it detaches; the station does not notice.
/// The station publishes a snapshot at least every two seconds of real time, changed or not:
/// a terminal that hears nothing for longer calls the station silent and doubts every value.
#[derive(Debug)]
pub struct Session {
    /// The latest snapshot.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Orders to the plant; full means refused, visibly.
    pub orders: mpsc::Sender<Order>,
    /// Questions to the history; full means no answer, visibly.
    pub queries: mpsc::Sender<Query>,
    /// Number of this terminal, for [`crate::plant::command::OrderId`].
    pub terminal: u32,
    /// Who sits at it.
>>>>>>> ui
    pub operator: Arc<str>,
}
