//! The edge of the simulated plant: its clock, its serial line, its TCP port.

mod owner;
mod pty;
mod rtu;
mod serving;
mod tcp;

pub use owner::RigHandle;
pub use pty::{Pty, open_pty};
pub use rtu::serve_rtu;
pub use serving::{Serving, SimError, start_pty, start_tcp};
pub use tcp::serve_tcp;
