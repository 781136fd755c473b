//! The edge of the simulated world: the task that owns it, its serial lines, its TCP ports.

mod line;
mod owner;
mod pty;
mod serving;
mod tcp;

pub use line::{Wire, serve_line};
pub use owner::{LineHandle, WorldHandle};
pub use pty::{Pty, open_pty};
pub use serving::{Mode, Place, Service, Serving, SimError, serve};
pub use tcp::{Speech, serve_stream, serve_tcp};
