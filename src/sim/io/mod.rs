//! The edge of the simulator: the task that owns it, its serial lines, its TCP ports.

mod drill;
mod line;
mod memory;
mod owner;
mod pty;
mod serving;
mod tcp;

pub use drill::{Port, Trainer, journal};
pub use line::{Wire, serve_line};
pub use memory::in_memory;
pub use owner::{LineHandle, SimulatorHandle};
pub use pty::{Pty, open_pty};
pub use serving::{Endpoint, Mode, Service, Serving, SimError, serve, serve_simulator};
pub use tcp::{TcpFraming, serve_stream, serve_tcp};
