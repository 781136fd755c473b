//! What went over a line: frames as bytes, requests with their answers. The source frame of every value.

use std::{collections::VecDeque, fmt, sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{fault::Fault, line::Framing};
use crate::t;

/// Frames that a line remembers.
pub const FRAMES_MAX: usize = 1_000;

/// One frame or run of bytes as it went over a line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frame {
    /// When.
    pub at: Timestamp,
    /// `true` for bytes that we sent.
    pub sent: bool,
    /// The bytes as they were on the wire.
    pub bytes: Arc<[u8]>,
    /// How the line frames its messages.
    pub framing: Framing,
    /// What became of it.
    pub result: FrameResult,
    /// The unit that was asked or has answered, if that is known.
    pub unit: Option<u8>,
    /// Running number on its line, from 1.
    pub number: u64,
}

/// What became of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameResult {
    /// It was sent.
    Sent,
    /// A response that fits its request.
    Good,
    /// Received after bytes that an operator typed: nothing was expected of it.
    Unchecked,
    /// Corrupt, late or dropped: what is wrong with it.
    Wrong(FrameFault),
}

/// What is wrong with a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum FrameFault {
    /// It is no valid response.
    #[error("{0}")]
    NoResponse(Fault),
    /// The response to a request that was given up.
    #[error("{}", t!("late, dropped"))]
    Late,
    /// Nothing was expected.
    #[error("{}", t!("unexpected, dropped"))]
    Unexpected,
    /// A response whose request was not heard.
    #[error("{}", t!("a response without request"))]
    WithoutRequest,
    /// Bytes between frames.
    #[error("{}", t!("no frame"))]
    NoFrame,
    /// The stream ended within it.
    #[error("{}", t!("cut short"))]
    CutShort,
    /// Bytes of a TCP connection that begin no frame.
    #[error("{}", t!("no MBAP header"))]
    NoHeader,
    /// The adapter gives back what it sends.
    #[error("{}", t!("echo of the adapter"))]
    Echo,
}

impl FrameResult {
    /// Is something wrong with the frame?
    pub fn is_wrong(&self) -> bool {
        matches!(self, FrameResult::Wrong(_))
    }
}

impl fmt::Display for FrameResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameResult::Sent => f.write_str(t!("sent")),
            FrameResult::Good => f.write_str(t!("ok")),
            FrameResult::Unchecked => f.write_str(t!("received")),
            FrameResult::Wrong(why) => why.fmt(f),
        }
    }
}

/// The latest frames of a line, oldest first. Cheap to clone: a snapshot carries it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(from = "Vec<Frame>", into = "Vec<Frame>")]
pub struct Frames {
    chunks: VecDeque<Arc<[Frame]>>,
    count: usize,
}

impl Frames {
    /// Appends newer frames; the oldest beyond [`FRAMES_MAX`] are dropped.
    pub fn extend(&mut self, newer: Vec<Frame>) {
        if newer.is_empty() {
            return;
        }
        self.count += newer.len();
        self.chunks.push_back(newer.into());
        while let Some(oldest) = self.chunks.front().filter(|oldest| FRAMES_MAX <= self.count - oldest.len()) {
            self.count -= oldest.len();
            self.chunks.pop_front();
        }
    }

    /// All of them, oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Frame> {
        self.chunks.iter().flat_map(|chunk| chunk.iter())
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Has nothing gone over the line yet?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// How they are kept in pieces is private.
impl PartialEq for Frames {
    fn eq(&self, other: &Frames) -> bool {
        self.count == other.count && self.iter().eq(other.iter())
    }
}

impl From<Vec<Frame>> for Frames {
    fn from(frames: Vec<Frame>) -> Frames {
        let mut all = Frames::default();
        all.extend(frames);
        all
    }
}

impl From<Frames> for Vec<Frame> {
    fn from(frames: Frames) -> Vec<Frame> {
        frames.iter().cloned().collect()
    }
}

/// A request and what came back: why a value is what it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exchange {
    /// When the request was sent.
    pub at: Timestamp,
    /// How the line frames its messages.
    pub framing: Framing,
    /// The request as it was on the wire.
    pub request: Arc<[u8]>,
    /// The answer as it was on the wire; empty if none came.
    pub answer: Arc<[u8]>,
    /// `Ok`, or what was wrong.
    pub outcome: Result<(), Fault>,
    /// From the last byte sent to the first byte received; `None` if none came.
    pub response_time: Option<Duration>,
    /// 1, or 2 if a corrupt answer was asked for again.
    pub tries: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_frames_are_kept_and_the_oldest_let_go() {
        let frame = |number| Frame {
            at: Timestamp::UNIX_EPOCH,
            sent: true,
            bytes: [1].into(),
            framing: Framing::Rtu,
            result: FrameResult::Sent,
            unit: Some(1),
            number,
        };
        let mut frames = Frames::default();
        for second in 0..50u64 {
            frames.extend((second * 30..second * 30 + 30).map(frame).collect());
            let numbers: Vec<u64> = frames.iter().map(|frame| frame.number).collect();
            assert_eq!(numbers.len(), frames.len());
            assert_eq!(numbers.last(), Some(&(second * 30 + 29)));
            assert!(numbers.is_sorted());
            assert!(frames.len() < FRAMES_MAX + 30);
        }
        assert!(FRAMES_MAX <= frames.len());
    }
}
