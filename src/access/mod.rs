//! Who may: users and their passwords, sessions, rights, lock-out, and the chained book of all that was done.

pub mod gate;
pub mod wish;

pub use gate::{Effect, Gate, Peer};
pub use wish::{OrderRequest, Signature, Standing, Who, Wish};
