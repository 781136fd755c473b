//! Who may: users and their passwords, sessions, rights, lockout, and the audit log.

pub mod right;
pub mod session_request;
pub mod password;
pub mod user;
pub mod lockout;
pub mod control;
pub mod audit_log;
pub mod sealing;
pub mod io;

pub use control::{AccessControl, Effect, Peer};
pub use session_request::{Credentials, Durability, Secret, SessionRequest, SessionRow, SessionStatus, UserRow, Who};
pub use user::Users;
