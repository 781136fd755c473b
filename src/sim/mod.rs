//! A world to test against: the water tank, its controller and its PLC as Modbus slaves. Bytes and time move only in [`io`].
//!
//! ```text
//!  tank  <── actuators ── dl06 <── at SV ── pxr <── probe ── tank        one step of 0.1 s in `rig`
//!                          │                 │
//!                        slave ─ pdu::serve ─ slave                       one Modbus server for both devices, which count
//!                                  │
//!                          faults: silent, late, damaged ── io: RTU or ASCII on a pty, TCP, RTU over TCP
//! ```

pub mod tank;
pub mod pdu;
pub mod slave;
pub mod pxr;
pub mod dl06;
pub mod rig;
pub mod experiment;
pub mod model;
pub mod world;
pub mod faults;
pub mod scenario;
pub mod truth;
pub mod drill;
pub mod ascii;
pub mod wire;
pub mod io;
