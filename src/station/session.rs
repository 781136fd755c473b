//! What one attached terminal holds of a station: three channels and its name.

use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use crate::{
    history::Query,
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
    pub operator: Arc<str>,
}
