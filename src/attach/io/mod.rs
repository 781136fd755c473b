//! The socket itself: listening, connecting, and where sockets live.

pub mod connect;
pub mod find;
mod client_task;
mod connection;
pub mod serve;
mod shared;
mod wire;
