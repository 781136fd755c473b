//! Events for the plant: values read, requests that failed, states of lines, outcomes of writes, faults of the station.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::command::WriteResult;
use super::{
    diagnostics::DiagnosticRun,
    exact::Exact,
    fault::Fault,
    id::{DeviceId, LineId, TagId, WriteId},
    identity::IdentityObject,
    line_report::LineReport,
    line_state::LineState,
    north_status::NorthStatus,
    process_load::ProcessLoad,
    station_fault::{FaultState, StationFault},
    traffic::Exchange,
};

/// A change, mostly from the bus, with the time at which it became true.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// A block was read: raw numbers (typed and ordered, not scaled) of its tags.
    Read {
        /// When the response was complete.
        at: Timestamp,
        /// The device.
        device: DeviceId,
        /// Raw number of every tag in the block.
        values: Vec<(TagId, Exact)>,
        /// Text of every tag in the block that holds text.
        texts: Vec<(TagId, Arc<str>)>,
        /// From the last byte sent to the first byte received.
        response_time: Duration,
        /// The exchange that brought them.
        exchange: Option<Arc<Exchange>>,
    },
    /// A block could not be read.
    Failed {
        /// When the request failed.
        at: Timestamp,
        /// The device.
        device: DeviceId,
        /// The tags without a fresh value.
        tags: Vec<TagId>,
        /// Why.
        fault: Fault,
        /// The exchange, if anything was sent.
        exchange: Option<Arc<Exchange>>,
    },
    /// A device was asked what it is, because a profile has a condition on that.
    Identified {
        /// When it had said all that was asked.
        at: Timestamp,
        /// The device.
        device: DeviceId,
        /// What it says; nothing where it does not tell.
        objects: Vec<(IdentityObject, String)>,
    },
    /// Another master has written these tags, or tried to: they are uncertain until they are read.
    ForeignWrite {
        /// When.
        at: Timestamp,
        /// The tags.
        tags: Vec<TagId>,
        /// Why it is not known to have taken effect.
        fault: Option<Fault>,
    },
    /// A line changed its state.
    Line {
        /// When.
        at: Timestamp,
        /// Which.
        line: LineId,
        /// The new state.
        state: LineState,
    },
    /// The report of a line, about once a second.
    Report {
        /// When.
        at: Timestamp,
        /// Which.
        line: LineId,
        /// Settings, counters, polls, frames.
        report: Arc<LineReport>,
    },
    /// A diagnostic has made progress.
    Diagnostic {
        /// When.
        at: Timestamp,
        /// The line.
        line: LineId,
        /// Its progress.
        run: Arc<DiagnosticRun>,
    },
    /// The unlock register of a write was sent before it: the device now accepts writes, also of others.
    Unlocked {
        /// When.
        at: Timestamp,
        /// The write that needs it.
        id: WriteId,
        /// The unlock register.
        unlock_tag: TagId,
        /// Its result: accepted, refused or without a valid response.
        result: WriteResult,
    },
    /// How far the data out has come, about once a second.
    North {
        /// When.
        at: Timestamp,
        /// The state.
        status: Arc<NorthStatus>,
    },
    /// What the program takes of its computer, every few seconds.
    Load {
        /// When.
        at: Timestamp,
        /// `None` where it cannot be read.
        load: Option<ProcessLoad>,
    },
    /// The station itself has a fault, or no longer has it.
    Station {
        /// When.
        at: Timestamp,
        /// Which.
        fault: StationFault,
        /// Whether it lasts, has occurred or is over.
        state: FaultState,
    },
    /// A write ended on the wire.
    Wrote {
        /// When.
        at: Timestamp,
        /// Which.
        id: WriteId,
        /// Its result.
        result: WriteResult,
    },
}
