//! The socket itself: listening, connecting, and where sockets live.

pub mod connect;
pub mod find;
mod pace;
mod pump;
mod connection;
pub mod serve;
mod wire;
