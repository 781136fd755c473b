//! Why the task of a line leaves its port.

use super::Interrupt;
use crate::{bus::io::link::LinkError, plant::line_trouble::LineTrouble};

/// Why a port is left.
pub(super) enum LinkExit {
    /// An operator closed the line.
    Closed,
    /// The port or connection failed.
    PortFailed(LineTrouble),
    /// It was closed, or sent what is no Modbus.
    Gone(LineTrouble),
    /// The other side allows no more on one connection: the next is opened for what is due next.
    UsedUp,
    /// It is opened again at once, with other settings.
    Reopen,
    /// A diagnostic needs the port for itself.
    Diagnostic,
    /// It is not left, but goes on under another definition.
    Redefined,
    /// The station is ending.
    Shutdown,
}

impl From<Interrupt> for LinkExit {
    fn from(interrupt: Interrupt) -> LinkExit {
        match interrupt {
            Interrupt::Closed => LinkExit::Shutdown,
            Interrupt::Redefined => LinkExit::Redefined,
        }
    }
}

impl From<LinkError> for LinkExit {
    /// Of a request without a caller only the end of the port matters.
    fn from(error: LinkError) -> LinkExit {
        match error {
            LinkError::Gone(why) => LinkExit::Gone(why),
            LinkError::Fault(fault) => LinkExit::PortFailed(LineTrouble::Fault(fault)),
        }
    }
}
