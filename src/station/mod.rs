//! Assembles the tasks: channels, start and shutdown order; nothing but wiring.

pub mod session;
