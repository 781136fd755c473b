//! The lines of a plant as its file describes them: what the bytes travel on, how they are framed, how long to wait.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{id::LineId, keyword::keyword_enum};

/// One serial line or TCP endpoint. Serial parameters, mode and timeouts belong to the line, never to a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineDef {
    /// Its place.
    pub id: LineId,
    /// `L1`.
    pub name: String,
    /// How its bytes travel.
    pub transport: Transport,
    /// How long an answer may take, from the last byte of the request.
    pub timeout: Duration,
    /// Least silence before a request, beyond the 3.5 characters of the standard.
    pub gap: Duration,
    /// Silence that ends an answer which is not complete. Frames end by their length first; USB adapters hand bytes over
    /// in batches (16 ms is common) and gateways later still, so this is far more than 3.5 characters.
    pub frame_timeout: Duration,
    /// A connection rests for so long before the first request: the device is deaf for a while (TCP; real time).
    pub connect_delay: Duration,
    /// Time after a broadcast in which devices act on it (serial lines; Modbus over serial line V1.02, 2.4.1: 100–200 ms).
    pub turnaround: Duration,
    /// Another master polls it: it is heard, and nothing is ever sent.
    pub listens: bool,
}

impl LineDef {
    /// A line with the waiting times that suit most: 1 s for an answer, no extra gap.
    pub fn new(id: LineId, name: &str, transport: Transport) -> LineDef {
        LineDef {
            id,
            name: name.to_owned(),
            transport,
            timeout: Duration::from_secs(1),
            gap: Duration::ZERO,
            frame_timeout: Duration::from_millis(50),
            connect_delay: Duration::ZERO,
            turnaround: Duration::from_millis(100),
            listens: false,
        }
    }
}

/// How the bytes of a line travel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Transport {
    /// A serial port.
    Serial {
        /// Path of the port, best `/dev/serial/by-id/…`.
        port: String,
        /// Baud rate, framing and parity.
        serial: Serial,
        /// RTU or ASCII.
        framing: Framing,
        /// Who switches the direction of an RS-485 driver.
        rs485: Rs485,
    },
    /// A host on a network.
    Network {
        /// TCP or UDP.
        protocol: Protocol,
        /// Host name or address.
        host: String,
        /// Port, 502 by default.
        port: u16,
        /// MBAP, or RTU frames as serial servers pass them on.
        framing: Framing,
    },
}

/// What carries frames over a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Protocol {
    /// One connection.
    Tcp,
    /// Datagrams, a frame each; one that is lost is not sent again.
    Udp,
}

impl Transport {
    /// RTU on a serial port.
    pub fn rtu(port: &str, serial: Serial) -> Transport {
        Transport::Serial { port: port.to_owned(), serial, framing: Framing::Rtu, rs485: Rs485::Off }
    }

    /// Modbus TCP.
    pub fn tcp(host: &str, port: u16) -> Transport {
        Transport::Network { protocol: Protocol::Tcp, host: host.to_owned(), port, framing: Framing::Mbap }
    }

    /// `host:502`, `host`, `10.0.0.5:502`, `[::1]:502` or `::1` as host and TCP port; `None` for a port that is none.
    pub fn host_and_port(text: &str) -> Option<(&str, Option<u16>)> {
        if let Some((host, rest)) = text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            return match rest.strip_prefix(':') {
                Some(port) => Some((host, Some(port.parse().ok()?))),
                None => rest.is_empty().then_some((host, None)),
            };
        }
        match text.split_once(':') {
            // More than one colon without brackets is an IPv6 address and nothing else.
            Some((_, rest)) if rest.contains(':') => Some((text, None)),
            Some((host, port)) => Some((host, Some(port.parse().ok()?))),
            None => Some((text, None)),
        }
    }

    /// How frames are delimited and checked.
    pub fn framing(&self) -> Framing {
        match self {
            Transport::Serial { framing, .. } | Transport::Network { framing, .. } => *framing,
        }
    }

    /// Units that answer here: 0 is the broadcast of a serial line and has no response, on TCP it is a unit like others.
    pub fn units(&self) -> std::ops::RangeInclusive<u8> {
        if self.framing() == Framing::Mbap { 0..=255 } else { 1..=247 }
    }

    /// The serial parameters, if it is a serial port.
    pub fn serial(&self) -> Option<Serial> {
        match self {
            Transport::Serial { serial, .. } => Some(*serial),
            Transport::Network { .. } => None,
        }
    }

    /// The protocol, if it is a network.
    pub fn protocol(&self) -> Option<Protocol> {
        match self {
            Transport::Serial { .. } => None,
            Transport::Network { protocol, .. } => Some(*protocol),
        }
    }

    /// Is there a connection, which is opened, may be deaf for a while, and ends?
    pub fn has_connection(&self) -> bool {
        self.protocol() == Some(Protocol::Tcp)
    }

    /// The word for the mode: `RTU`, `ASCII`, `TCP`, `RTU over TCP`.
    pub fn mode(&self) -> &'static str {
        match (self, self.framing()) {
            (Transport::Serial { .. }, Framing::Rtu) => "RTU",
            (Transport::Serial { .. }, _) => "ASCII",
            (Transport::Network { protocol: Protocol::Tcp, .. }, Framing::Mbap) => "TCP",
            (Transport::Network { protocol: Protocol::Tcp, .. }, Framing::Rtu) => "RTU over TCP",
            (Transport::Network { protocol: Protocol::Tcp, .. }, Framing::Ascii) => "ASCII over TCP",
            (Transport::Network { protocol: Protocol::Udp, .. }, Framing::Mbap) => "UDP",
            (Transport::Network { protocol: Protocol::Udp, .. }, Framing::Rtu) => "RTU over UDP",
            (Transport::Network { protocol: Protocol::Udp, .. }, Framing::Ascii) => "ASCII over UDP",
        }
    }
}

/// `RTU /dev/ttyUSB0 9600 8N1` or `TCP host:502`.
impl std::fmt::Display for Transport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Transport::Serial { port, serial, .. } => write!(f, "{} {port} {serial}", self.mode()),
            Transport::Network { host, port, .. } if host.contains(':') => write!(f, "{} [{host}]:{port}", self.mode()),
            Transport::Network { host, port, .. } => write!(f, "{} {host}:{port}", self.mode()),
        }
    }
}

/// How frames are delimited and checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Framing {
    /// Binary, ended by silence, CRC-16.
    Rtu,
    /// `:` hexadecimal digits, LRC, CR LF.
    Ascii,
    /// The header of Modbus TCP, with a transaction id and a length.
    Mbap,
}

impl Framing {
    /// Is what is sent to this unit for all units of the line, of which none answers?
    pub fn is_broadcast(self, unit: u8) -> bool {
        unit == 0 && self != Framing::Mbap
    }
}

/// Serial parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Serial {
    /// Bits a second.
    pub baud: u32,
    /// 7 or 8.
    pub data_bits: u8,
    /// Parity bit.
    pub parity: Parity,
    /// 1 or 2.
    pub stop_bits: u8,
}

impl Serial {
    /// 9600 8N1, the least common denominator of controllers.
    pub const USUAL: Serial = Serial { baud: 9_600, data_bits: 8, parity: Parity::None, stop_bits: 1 };

    /// Bits of one character on the wire: start, data, parity, stop.
    pub fn bits_per_char(self) -> u32 {
        1 + u32::from(self.data_bits) + u32::from(self.parity != Parity::None) + u32::from(self.stop_bits)
    }
    /// Time of one character on the wire.
    pub fn char_time(self) -> Duration {
        Duration::from_nanos(u64::from(self.bits_per_char()) * 1_000_000_000 / u64::from(self.baud))
    }
    /// The silence between frames: 3.5 characters, fixed 1.75 ms above 19200 baud (Modbus serial line V1.02, 2.5.1.1).
    pub fn silent_interval(self) -> Duration {
        if self.baud > 19_200 { Duration::from_micros(1_750) } else { self.char_time() * 7 / 2 }
    }
}

/// `9600 8N1`.
impl std::fmt::Display for Serial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}{}{}", self.baud, self.data_bits, self.parity.word(), self.stop_bits)
    }
}

keyword_enum! {
    /// Parity of a serial character.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Parity: "parity" {
        /// No parity bit.
        None => "N",
        /// Even.
        Even => "E",
        /// Odd.
        Odd => "O",
        /// Always 1.
        Mark => "M",
        /// Always 0.
        Space => "S",
    }
}

keyword_enum! {
    /// Who switches the direction of an RS-485 driver on a serial port.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
    pub enum Rs485: "RS-485 direction control" {
        /// None: RS-232, or an adapter that does it itself.
        #[default]
        Off => "off",
        /// The kernel, by RTS high while sending.
        RtsHigh => "rts-high",
        /// The kernel, by RTS low while sending.
        RtsLow => "rts-low",
    }
}
