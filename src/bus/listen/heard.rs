//! What was heard: frames as they came, and how requests ended.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use crate::plant::{fault::Fault, line::Framing, traffic::Frame};

/// What was heard.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// A frame, or a run of bytes that is none.
    Frame(HeardFrame),
    /// A request has ended: with its response, or without.
    Ended(Ended),
}

/// A frame with its role.
#[derive(Debug, Clone, PartialEq)]
pub struct HeardFrame {
    /// As it went over the line; `sent` stands for the master.
    pub frame: Frame,
    /// What it is.
    pub role: Role,
}

/// What a frame is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// The master asks.
    Request,
    /// A unit responds.
    Response {
        /// The request message.
        request: Vec<u8>,
        /// From the last byte of the request to the first of the response; `None` if both came at once.
        time: Option<Duration>,
    },
    /// A response without its request: late, or the request was not heard.
    Unmatched,
    /// No frame.
    Noise,
}

/// How a request of the other master has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// When the response came, or when it was known that none does: with the next request.
    pub at: Timestamp,
    /// How long ago that was when it was known whether the response belongs to the request.
    pub held: Duration,
    /// How the line frames its messages.
    pub framing: Framing,
    /// The request message.
    pub request: Vec<u8>,
    /// The frame behind it that fits it.
    pub response: Option<Arc<[u8]>>,
    /// From the last byte of the request to the first of the response; `None` if both came at once.
    pub time: Option<Duration>,
    /// As a poll would have it. [`Fault::NotHeard`] and [`Fault::Unproven`]: the response is not proven to be its own.
    pub outcome: Result<(), Fault>,
}
