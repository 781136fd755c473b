//! The edge of the simulated plant: its clock, its serial lines, its TCP port.

mod line;
mod owner;
mod pty;
mod serving;
mod tcp;

pub use line::{Wire, serve_line};
pub use owner::RigHandle;
pub use pty::{Pty, open_pty};
pub use serving::{Mode, Serving, SimError, serial_of, start_pty, start_tcp};
pub use tcp::{Speech, serve_tcp};
