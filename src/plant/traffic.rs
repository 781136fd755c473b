//! What went over a line: whole frames or runs of bytes, with time, direction and verdict.

use std::borrow::Cow;

use jiff::Timestamp;

use super::line::Framing;

/// One frame or run of bytes as it went over a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// When it was sent, or its last byte received.
    pub at: Timestamp,
    /// `true` for bytes that we sent.
    pub sent: bool,
    /// The bytes, with check or header.
    pub bytes: Vec<u8>,
    /// How frames are delimited on this line.
    pub framing: Framing,
    /// `ok`, or what was wrong with it.
    pub verdict: Cow<'static, str>,
    /// The unit asked, or that answered; `None` for bytes that tell none.
    pub unit: Option<u8>,
    /// Running number on its line.
    pub number: u64,
}
