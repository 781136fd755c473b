//! The edge of the bus: ports, sockets, clocks.

pub mod clock;
