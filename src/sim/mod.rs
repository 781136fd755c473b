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

pub mod tank;
pub mod pdu;
pub mod slave;
pub mod pxr;
pub mod dl06;
pub mod rig;
pub mod experiment;
pub mod model;
pub mod simulator;
pub mod faults;
pub mod scenario;
pub mod ground_truth;
pub mod drill;
pub mod ascii;
pub mod wire;
pub mod io;
