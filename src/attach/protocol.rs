//! What terminal and station say to each other, as bytes: a u32 little-endian length, then a message in postcard.
//!
//! Both begin with a [`Handshake`], which never changes its shape, so that a terminal and a station of different versions
//! can still report it.

use std::sync::Arc;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    access::{Completion, Credentials, SessionRequest, SessionStatus},
    history::{Answer, HistoryError, Query},
    plant::{
        PlantDef, Snapshot,
        command::{Command, CommandId},
        def::LineId,
        line_report::LineReport,
        number::to_u32,
        request_refusal::RequestRefusal,
        visible::is_control_or_bidi,
    },
};

/// The number of this protocol; goes up with every change of a message.
pub const PROTOCOL: u32 = 32;
/// The version of this program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// A rejection that ends so may not be one a moment later: the terminal tries again by itself.
pub const TRY_AGAIN: &str = "; try again in a moment";
/// Longest handshake, bytes.
pub const HANDSHAKE_BYTES_MAX: usize = 4 * 1024;
/// Longest message of a terminal, bytes.
pub const REQUEST_BYTES_MAX: usize = 64 * 1024;
/// Longest message to a terminal, bytes.
pub const SERVER_MESSAGE_BYTES_MAX: usize = 32 * 1024 * 1024;
/// Bytes of the length before each message.
pub const LENGTH_BYTES: usize = 4;
/// Longest word that a terminal says of itself, characters.
const WORD_CHARS_MAX: usize = 64;

/// The beginning of the first message of both sides. Its shape stays the same for ever.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Handshake {
    /// Distinguishes this socket from any other.
    pub magic: [u8; 4],
    /// The protocol that it speaks.
    pub protocol: u32,
    /// The version of its program.
    pub version: String,
    /// Of a station: why the terminal cannot stay, in words for its operator. Nothing follows then.
    pub rejection: Option<String>,
}

/// Where a terminal is, as it says itself; it follows the handshake of a terminal.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TerminalOrigin {
    /// `pts/3`; `None` for a script.
    pub tty: Option<String>,
    /// The address that its SSH connection comes from.
    pub ssh: Option<String>,
    /// `xterm-256color`.
    pub term: Option<String>,
}

/// Follows the handshake of a station that accepts the terminal.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct HandshakeReply {
    /// Which run of the station this is, see [`Snapshot::run`](crate::plant::Snapshot::run): another one counts terminals
    /// from 1 again.
    pub run: u64,
    /// The number of this terminal.
    pub terminal: u32,
    /// The plant. Every snapshot is of this definition.
    pub def: Arc<PlantDef>,
}

/// What a terminal says: what can be sent of [`crate::station::Request`], which carries reply channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ClientMessage {
    /// A command to the plant.
    Command(Box<Command>, Option<Credentials>),
    /// A query to the history.
    Ask {
        /// Comes back with the answer.
        ticket: u64,
        /// The query.
        query: Query,
    },
    /// The answer to a query is not needed any more; none comes, unless it is on its way.
    Cancel {
        /// Of the query.
        ticket: u64,
    },
    /// A request about people or the station.
    SessionRequest {
        /// Comes back with the answer.
        ticket: u64,
        /// The request.
        request: SessionRequest,
    },
}

/// What a station says.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum ServerMessage {
    /// The plant has changed. The definition is that of the handshake, and the line reports come by themselves.
    Snapshot(Arc<Snapshot>),
    /// A line has reported; the report is part of all snapshots that follow. `None` for one that may not be seen any more.
    LineReport(LineId, Option<Arc<LineReport>>),
    /// The session status has changed.
    SessionStatus(Box<SessionStatus>),
    /// What the history says.
    Answer {
        /// Of the query.
        ticket: u64,
        /// The answer.
        answer: Result<Answer, HistoryError>,
    },
    /// What became of a request.
    RequestDone {
        /// Of the request.
        ticket: u64,
        /// Done, or why not.
        answer: Result<Completion, RequestRefusal>,
    },
    /// A command did not reach the plant.
    Undelivered {
        /// Which.
        id: CommandId,
        /// Why.
        why: RequestRefusal,
    },
}

/// Bytes that are no message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProtocolError {
    /// The message is longer than is permitted.
    #[error("a message of {bytes} bytes, expected at most {max}")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// What is permitted.
        max: usize,
    },
    /// Nothing that this protocol knows.
    #[error("{bytes} bytes are not a {expected}")]
    Malformed {
        /// How many there were.
        bytes: usize,
        /// What was expected.
        expected: &'static str,
    },
    /// The other end has another version.
    #[error("{0}")]
    OtherVersion(String),
}

impl Handshake {
    /// Of this program.
    pub fn current() -> Handshake {
        Handshake { magic: *b"sgls", protocol: PROTOCOL, version: VERSION.to_owned(), rejection: None }
    }

    /// Of a station that sends a terminal away.
    pub fn rejected(why: impl Into<String>) -> Handshake {
        Handshake { rejection: Some(why.into()), ..Handshake::current() }
    }
}

/// A message with its length before it. The first one of either side is a pair: a handshake, and what follows it.
pub fn encode<T: Serialize>(message: &T, max: usize) -> Result<Vec<u8>, ProtocolError> {
    let mut bytes = postcard::to_extend(message, vec![0; LENGTH_BYTES]).expect("our messages are plain data");
    let length = bytes.len() - LENGTH_BYTES;
    if max < length {
        return Err(ProtocolError::TooLong { bytes: length, max });
    }
    bytes[..LENGTH_BYTES].copy_from_slice(&to_u32(length).to_le_bytes());
    Ok(bytes)
}

/// The length of the message that follows.
pub fn length(bytes: [u8; LENGTH_BYTES], max: usize) -> Result<usize, ProtocolError> {
    let length = u32::from_le_bytes(bytes) as usize;
    if length <= max { Ok(length) } else { Err(ProtocolError::TooLong { bytes: length, max }) }
}

/// The message in these bytes, which are all of it.
pub fn decode<T: DeserializeOwned>(bytes: &[u8], expected: &'static str) -> Result<T, ProtocolError> {
    match postcard::take_from_bytes(bytes) {
        Ok((message, [])) => Ok(message),
        Ok(_) | Err(_) => Err(ProtocolError::Malformed { bytes: bytes.len(), expected }),
    }
}

/// Where the terminal is that has sent this first message.
pub fn client_handshake(bytes: &[u8]) -> Result<TerminalOrigin, ProtocolError> {
    let (handshake, rest) = parse_handshake(bytes, "handshake of a terminal")?;
    if let Some(why) = other_version((&handshake.version, handshake.protocol), (VERSION, PROTOCOL)) {
        return Err(ProtocolError::OtherVersion(why));
    }
    decode(rest, "handshake of a terminal")
}

/// Parses the first message of a station: its handshake reply, or why it refuses.
pub fn handshake_reply(bytes: &[u8]) -> Result<Result<HandshakeReply, String>, ProtocolError> {
    let (handshake, rest) = parse_handshake(bytes, "handshake of a station")?;
    if let Some(why) = handshake.rejection {
        return Ok(Err(one_line(&why, 4 * WORD_CHARS_MAX)));
    }
    if let Some(why) = other_version((VERSION, PROTOCOL), (&handshake.version, handshake.protocol)) {
        return Err(ProtocolError::OtherVersion(why));
    }
    // Of the same version, but not of the same build.
    let other_build =
        |_| ProtocolError::OtherVersion(format!("the station is another build of version {VERSION}: restart it"));
    Ok(Ok(decode(rest, "handshake of a station").map_err(other_build)?))
}

fn parse_handshake<'a>(bytes: &'a [u8], expected: &'static str) -> Result<(Handshake, &'a [u8]), ProtocolError> {
    match postcard::take_from_bytes::<Handshake>(bytes) {
        Ok((handshake, rest)) if handshake.magic == Handshake::current().magic => Ok((handshake, rest)),
        Ok(_) | Err(_) => Err(ProtocolError::Malformed { bytes: bytes.len(), expected }),
    }
}

/// Two versions of the program do not talk: what one of them calls a value might be another to the other.
fn other_version(terminal: (&str, u32), station: (&str, u32)) -> Option<String> {
    (terminal != station).then(|| {
        let (version, protocol) = (word(terminal.0), terminal.1);
        let (stations, speaks) = (word(station.0), station.1);
        format!(
            "this terminal is version {version} (protocol {protocol}), the station is version {stations} (protocol \
             {speaks}): both must be the same version; restart the older one after an update"
        )
    })
}

impl TerminalOrigin {
    /// With no word longer than a station takes.
    pub fn short(self) -> TerminalOrigin {
        let short = |text: Option<String>| text.map(|text| word(&text));
        TerminalOrigin { tty: short(self.tty), ssh: short(self.ssh), term: short(self.term) }
    }

    /// `pts/3 from 10.0.0.5, user panel, process 123`: what the terminal says, without what could disturb a screen, and
    /// what the system says.
    pub fn words(&self, unix_user: Option<&str>, process: Option<u32>) -> String {
        let said = |text: &Option<String>| {
            let word = word(text.as_deref().unwrap_or_default());
            (!word.is_empty()).then_some(word)
        };
        let mut words = said(&self.tty).unwrap_or_else(|| "no terminal".to_owned());
        if let Some(ssh) = said(&self.ssh) {
            words += &format!(" from {ssh}");
        }
        if let Some(user) = unix_user {
            words += &format!(", user {}", word(user));
        }
        if let Some(process) = process {
            words += &format!(", process {process}");
        }
        words
    }
}

/// Text from the other end on one line: only visible characters, and not too many.
fn one_line(text: &str, chars_max: usize) -> String {
    text.chars().filter(|letter| !is_control_or_bidi(*letter)).take(chars_max).collect()
}

/// One word of it, without a comma: what says where it is must not be able to say who it is.
fn word(text: &str) -> String {
    one_line(text, WORD_CHARS_MAX).replace(',', ".")
}

#[cfg(test)]
mod tests;
