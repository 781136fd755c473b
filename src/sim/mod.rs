//! The simulator: every device of a plant as a Modbus slave, to test and to train against. Bytes and time move only in [`io`].
//!
//! ```text
//!  tank  <── actuators ── dl06 <── at SV ── pxr <── probe ── tank        one step of 0.1 s in `rig`: the water tank
//!  model <── `simulate` of the profile, for every device that is no part of the rig
//!                                  │
//!                               slave ─ pdu::serve                       one Modbus server for all, which counts
//!                                  │
//!                           simulator: (line, unit) ─> slave             `faults` corrupt what is measured, done or answered
//!                                  │
//!                               io: RTU or ASCII on a pty, TCP, RTU over TCP; each line at a place of its own
//!
//!  scenario ─> drill: faults at their times, operator actions, and a judge over journal, snapshots and `ground_truth`
//!  experiment: the six of the thesis, on the rig alone
//! ```

pub(crate) mod tank;
pub mod pdu;
pub(crate) mod slave;
pub(crate) mod pxr;
pub(crate) mod dl06;
mod process_faults;
pub mod rig;
pub(crate) mod experiment;
mod random;
pub(crate) mod model;
pub mod simulator;
#[cfg(test)]
mod library;
pub mod faults;
pub(crate) mod scenario;
pub(crate) mod ground_truth;
pub(crate) mod drill;
pub(crate) mod ascii;
pub mod wire;
pub mod io;
