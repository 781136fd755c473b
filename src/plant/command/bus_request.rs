//! What a command asks of a line, and how a write ends there.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::CommandId;
use crate::plant::{
    def::{DeviceId, LineDef, TagId},
    diagnostic_request::Diagnostic,
    exact::Exact,
    fault::{ExceptionCode, Fault},
    id::WriteId,
    tag_value::TagValue,
};

/// A checked write of one tag, as the bus performs it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WriteJob {
    /// Identifies the write in events.
    pub id: WriteId,
    /// The tag to write.
    pub tag: TagId,
    /// The raw number, already unscaled, or the text as the device will show it.
    pub raw: TagValue,
    /// An unlock register to write first (tag and raw number), if the device needs unlocking.
    pub unlock: Option<(TagId, Exact)>,
    /// Read the value back afterwards.
    pub verify: bool,
    /// It switches something off and goes before all that waits, see `crate::plant::interlock::is_stop`.
    pub urgent: bool,
    /// What its author saw, where that was read long ago: it is read first, and nothing is written over anything else.
    pub over: Option<TagValue>,
    /// The decimals by which the number was unscaled, where a register of the device says them: they may be others by now.
    pub unscaled_by: Option<i8>,
}

/// The result of a write on the wire. The plant compares it and decides the outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum WriteResult {
    /// The device accepted it; then it was read back: this raw number, or this text.
    ReadBack(TagValue),
    /// No valid answer, for this reason; read once the unit was in sync again, the device holds this raw number, or this text.
    ReadBackAfterFault(Fault, TagValue),
    /// The device accepted it, but the read-back failed.
    NotRead(Fault),
    /// The device accepted it; the profile excludes a read-back.
    Accepted,
    /// A broadcast has left: no unit answers it.
    Sent,
    /// Nothing was sent: read before it, the tag held this raw number, or this text, and not what its author saw, or already
    /// what was to be written.
    Held(TagValue),
    /// The device refused with an exception.
    Refused(ExceptionCode),
    /// No valid answer: it is not known whether the write took effect.
    NoValidResponse(Fault),
    /// Nothing was sent.
    NotSent(Fault),
    /// Nothing was sent: it still waited when a stop of the same tag came.
    Superseded,
}

/// What the plant asks of a link task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum BusRequest {
    /// Write one tag once, then read it back. Answered by [`crate::plant::event::Event::Wrote`].
    Write(WriteJob),
    /// Read every block of a device as soon as possible.
    Refresh {
        /// Which.
        device: DeviceId,
        /// The command it comes by; `None` for one of the plant itself.
        command: Option<CommandId>,
    },
    /// Open or close the port.
    Connect(bool),
    /// Use these settings from now on.
    Configure(Box<LineDef>),
    /// Start a diagnostic; the one at work is stopped.
    Test {
        /// The command it comes by.
        id: CommandId,
        /// Who requested it.
        by: Arc<str>,
        /// What.
        diagnostic: Diagnostic,
    },
    /// Stop the running diagnostic.
    StopTest,
}
