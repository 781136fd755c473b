//! Why a line is not connected, or a test on it cannot go on: what an operator can do something about, by name.

use serde::{Deserialize, Serialize};

use crate::{plant::fault::Fault, t};

/// English in the log and on record, translated where a terminal shows it. What the operating system says stays in its words.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum LineTrouble {
    /// The path is no port.
    #[error("{}", t!("{path}: no such port ({known})", path = .path, known = known_words(.known)))]
    NoSuchPort {
        /// As the plant file has it.
        path: String,
        /// The ports of this machine.
        known: Vec<String>,
    },
    /// The station may not open the port.
    #[error("{}", t!("{path}: no permission{why}", path = .path, why = owner_words(.owner)))]
    NoPermission {
        /// The port.
        path: String,
        /// Who may.
        owner: PortOwner,
    },
    /// Another program has it, or another line.
    #[error("{}", t!("{path}: in use by {holder}", path = .path, holder = .holder))]
    InUse {
        /// The port.
        path: String,
        /// Who has it.
        holder: PortHolder,
    },
    /// The same for a line that is only listened to.
    #[error("{}", t!("{path}: in use by {holder}: two programs at one port take each other's bytes; listening needs a port of its own", path = .path, holder = .holder))]
    Shared {
        /// The port.
        path: String,
        /// Who has it.
        holder: PortHolder,
    },
    /// A file of another kind.
    #[error("{}", t!("{path}: not a serial port", path = .0))]
    NotSerial(String),
    /// Mark or space parity.
    #[error("{}", t!("{path}: its driver has no parity {parity} ({error})", path = .path, parity = .parity, error = .error))]
    NoParity {
        /// The port.
        path: String,
        /// Which.
        parity: String,
        /// In the words of the system.
        error: String,
    },
    /// RS-485 by the driver.
    #[error("{}", t!("{path}: its driver does not switch the direction of RS-485 ({error}); use rs485 = \"off\"", path = .path, error = .error))]
    NoRs485 {
        /// The port.
        path: String,
        /// In the words of the system.
        error: String,
    },
    /// No response of the host at all.
    #[error("{}", t!("{place}: no connection within {seconds} s", place = .place, seconds = .seconds))]
    NoConnection {
        /// Host and TCP port.
        place: String,
        /// How long was waited.
        seconds: u64,
    },
    /// The host is there.
    #[error("{}", t!("{place}: refused (is the device on, is the TCP port right?)", place = .0))]
    Refused(String),
    /// The host is in no network of this machine.
    #[error("{}", t!("{place}: no route to this address", place = .0))]
    NoRoute(String),
    /// A listening line over UDP.
    #[error("{}", t!("datagrams between others are not heard here: expected a serial port or a mirror over TCP"))]
    DatagramsOfOthers,
    /// The driver does not go on.
    #[error("{}", t!("the port accepts no bytes"))]
    NoBytesAccepted,
    /// An adapter was unplugged.
    #[error("{}", t!("the port is gone"))]
    PortGone,
    /// The same while it is listened to, in the words of the system.
    #[error("{}", t!("the port is gone: {error}", error = .0))]
    PortLost(String),
    /// The end of what is listened to.
    #[error("{}", t!("the port was closed by the other side"))]
    PortClosed,
    /// It has data only.
    #[error("{}", t!("this port has no RTS and DTR: a pseudo-terminal, or a driver without them"))]
    NoSignals,
    /// The end of a connection.
    #[error("{}", t!("closed by the other side"))]
    Closed,
    /// A request was cut off while it was sent.
    #[error("{}", t!("a request was incomplete, the stream is out of sync"))]
    RequestIncomplete,
    /// A response did not come to its end.
    #[error("{}", t!("a response was incomplete, the stream is out of sync"))]
    ResponseIncomplete,
    /// Bytes that begin no frame.
    #[error("{}", t!("received bytes that are not a Modbus TCP frame: {bytes}", bytes = .0))]
    NoFrame(String),
    /// A peer may have forgotten the connection.
    #[error("{}", t!("no answer to {count} requests over this connection", count = .0))]
    Unanswered(u32),
    /// It ended a test.
    #[error("{}", t!("cancelled by an urgent stop"))]
    UrgentStop,
    /// It ended a test.
    #[error("{}", t!("the line was closed"))]
    LineClosed,
    /// A test needs a line that is connected.
    #[error("{}", t!("the line is not connected"))]
    NotConnected,
    /// It ended a test.
    #[error("{}", t!("the plant file was reloaded"))]
    Reloaded,
    /// It ended a test.
    #[error("{}", t!("the station stopped"))]
    StationStopped,
    /// The task of the line has failed.
    #[error("{}", t!("internal error, see the log"))]
    Internal,
    /// The answer of a device ends the port.
    #[error("{0}")]
    Fault(Fault),
    /// In the words of the operating system.
    #[error("{0}")]
    System(String),
}

/// Tests say any words.
#[cfg(test)]
impl From<&str> for LineTrouble {
    fn from(words: &str) -> LineTrouble {
        LineTrouble::System(words.to_owned())
    }
}

/// Who may open a port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum PortOwner {
    /// It cannot be seen.
    Unknown,
    /// No user joins the group of root.
    Root,
    /// The members of this group.
    Group(String),
    /// Those of a group without a name.
    Gid(u32),
}

/// Who has a port open.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum PortHolder {
    /// It cannot be seen.
    #[error("{}", t!("another program"))]
    Unknown,
    /// Another line of this station.
    #[error("{}", t!("this program, on another line"))]
    OtherLine,
    /// Commands with their processes.
    #[error("{0}")]
    Programs(String),
}

fn known_words(ports: &[String]) -> String {
    match ports {
        [] => t!("this machine has no serial port").to_owned(),
        ports => t!("found: {ports}", ports = ports.join(", ")),
    }
}

fn owner_words(owner: &PortOwner) -> String {
    match owner {
        PortOwner::Unknown => String::new(),
        PortOwner::Root => t!(": it belongs to root; ask the administrator for access (a udev rule)").to_owned(),
        PortOwner::Group(name) => {
            t!(": it belongs to the group {name} (usermod -aG {name} USER, then log in again)", name)
        }
        PortOwner::Gid(gid) => t!(": it belongs to the group {gid}", gid),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Language;

    #[test]
    fn a_trouble_is_english_in_the_log_and_read_on_a_terminal() {
        let thai = |trouble: &LineTrouble| Language::THAI.locale().within(|| trouble.to_string());
        let path = || "/dev/ttyUSB0".to_owned();
        let held = LineTrouble::InUse { path: path(), holder: PortHolder::Unknown };
        assert_eq!(held.to_string(), "/dev/ttyUSB0: in use by another program");
        let shown = thai(&held);
        assert!(
            shown.starts_with("/dev/ttyUSB0") && !shown.contains("use by") && !shown.contains("program"),
            "{shown}"
        );
        let missing = |known: &[&str]| LineTrouble::NoSuchPort {
            path: path(),
            known: known.iter().map(|port| (*port).to_owned()).collect(),
        };
        assert_eq!(missing(&[]).to_string(), "/dev/ttyUSB0: no such port (this machine has no serial port)");
        assert_eq!(missing(&["a", "b"]).to_string(), "/dev/ttyUSB0: no such port (found: a, b)");
        assert!(!thai(&missing(&["a"])).contains("there are"), "{}", thai(&missing(&["a"])));
        let group = LineTrouble::NoPermission { path: path(), owner: PortOwner::Group("dialout".into()) };
        let english = "/dev/ttyUSB0: no permission: it belongs to the group dialout (usermod -aG dialout USER, then log in again)";
        assert_eq!(group.to_string(), english);
        assert!(!thai(&LineTrouble::NoFrame("55 01".into())).contains("received bytes"), "with what came behind it");
        assert_eq!(thai(&LineTrouble::System("No such device".into())), "No such device");
    }
}
