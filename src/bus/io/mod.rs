//! The edge of the bus: ports, sockets, clocks.

pub mod clock;
pub mod worker;
pub mod uart;
pub mod ports;
pub mod network;
pub mod transport;
pub mod datagrams;
pub mod tap;
pub mod hearing;
pub mod signals;
pub mod pause;
pub mod memory;
pub mod wire;
pub mod link;
pub mod testing;
pub mod live_reads;
pub mod redefine;
pub mod requests;
pub mod task;
pub mod listening;

#[cfg(test)]
mod tests;
