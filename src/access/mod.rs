//! Who may: users and their passwords, sessions, rights, lockout, and the audit log.

mod session_end;
pub mod session_request;
pub mod right;
pub mod password;
pub mod audit_log;
pub mod user;
pub mod lockout;
mod rate_limit;
pub mod control;
pub mod sealing;
pub mod io;

pub use control::{AccessControl, Effect, Peer};
pub(crate) use rate_limit::RateLimit;
pub use session_end::SessionEnd;
pub use session_request::{
    Completion, Credentials, Durability, LoggedInUser, Secret, SessionRequest, SessionRow, SessionStatus, UserRow,
};
pub use user::Users;
