//! Who may: users and their passwords, sessions, rights, lock-out, and the chained book of all that was done.

pub mod right;
pub mod wish;
pub mod password;
pub mod user;
pub mod tries;
pub mod gate;
pub mod book;
pub mod sealing;
pub mod io;

pub use gate::{Effect, Gate, Peer};
pub use user::Users;
pub use wish::{Durability, OrderRequest, Secret, SessionRow, Signature, Standing, UserRow, Who, Wish};
