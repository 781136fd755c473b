//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Unique, check_name},
    reader::{At, Node, Raw, Value, text},
    schema::{SerialTable, TcpTable},
};
use crate::plant::def::{Framing, LineDef, LineId, Parity, Rs485, Serial, Transport};

/// The lines in the order of the file.
pub(super) fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let mut seen = Unique::default();
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let raw = table.value.clone();
        let Some(mode) = mode(&raw, problems) else { continue };
        let id = LineId(index as u16);
        let written = if mode.tcp { tcp(raw, mode, id, problems) } else { serial(raw, mode, id, problems) };
        let Some(written) = written else { continue };
        let name = &written.name;
        check_name(name, "line", problems);
        seen.insert(&name.value, name.at, format!("duplicate line `{}`", name.value), problems);
        lines.push(written.line(problems));
    }
    lines
}

/// What `mode` says.
#[derive(Debug, Clone, Copy)]
struct Mode {
    tcp: bool,
    framing: Framing,
}

const MODES: [(&str, Mode); 4] = [
    ("rtu", Mode { tcp: false, framing: Framing::Rtu }),
    ("ascii", Mode { tcp: false, framing: Framing::Ascii }),
    ("tcp", Mode { tcp: true, framing: Framing::Mbap }),
    ("rtu-over-tcp", Mode { tcp: true, framing: Framing::Rtu }),
];

/// The mode decides which other keys a line has, so it is looked at first.
fn mode(raw: &Raw, problems: &mut Problems) -> Option<Mode> {
    let words = MODES.map(|(word, _)| word);
    let Some((_, value)) = raw.table.get("mode") else {
        let problem = problems.add(raw.at, "a line needs `mode`").label("missing here");
        problem.help(format!("mode is one of {}", words.join(", ")));
        return None;
    };
    let word = <String as Value>::read(&value.value, value.at, problems)?;
    let found = MODES.iter().find(|(known, _)| *known == word).map(|(_, mode)| *mode);
    if found.is_none() {
        let problem = problems.add(value.at, format!("unknown mode `{word}`"));
        problem.label(format!("expected {}", words.join(", "))).suggest(&word, words);
    }
    found
}

/// The line that a table describes, with the places of its keys.
struct Written {
    line: LineDef,
    name: At<String>,
    spans: Vec<(Key, Span)>,
}

impl Written {
    /// The line, after every complaint about a key that is written was added.
    fn line(self, problems: &mut Problems) -> LineDef {
        for Complaint { key, what, expected } in complaints(&self.line) {
            // What is not written has its usual value, or was reported as missing.
            if let Some((_, at)) = self.spans.iter().find(|(known, _)| *known == key) {
                problems.add(*at, what).label(expected);
            }
        }
        self.line
    }
}

fn serial(raw: Raw, mode: Mode, id: LineId, problems: &mut Problems) -> Option<Written> {
    let table = SerialTable::of(&[raw], problems);
    let ascii = mode.framing == Framing::Ascii;
    let spans = [
        (Key::Port, table.port.as_ref().map(|port| port.at)),
        (Key::Baud, table.baud.map(|baud| baud.at)),
        (Key::DataBits, table.data_bits.map(|bits| bits.at)),
        (Key::StopBits, table.stop_bits.map(|bits| bits.at)),
        (Key::Timeout, table.timeout_ms.map(|time| time.at)),
        (Key::Idle, table.idle_ms.map(|time| time.at)),
    ];
    let serial = Serial {
        baud: table.baud.map_or(Serial::USUAL.baud, |baud| baud.value),
        data_bits: table.data_bits.map_or(usual_data_bits(ascii), |bits| bits.value),
        parity: table.parity.map_or(Parity::None, |parity| parity.value),
        stop_bits: table.stop_bits.map_or(1, |bits| bits.value),
    };
    let transport = Transport::Serial {
        port: text(&table.port),
        serial,
        framing: mode.framing,
        rs485: table.rs485.map_or(Rs485::Off, |rs485| rs485.value),
    };
    let name = table.name?;
    let usual = LineDef::new(id, &name.value, transport);
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.gap_ms, usual.gap),
        idle: millis(table.idle_ms, usual.idle),
        turnaround: millis(table.turnaround_ms, usual.turnaround),
        ..usual
    };
    Some(Written { line, name, spans: known(spans) })
}

fn tcp(raw: Raw, mode: Mode, id: LineId, problems: &mut Problems) -> Option<Written> {
    let table = TcpTable::of(&[raw], problems);
    let spans = [
        (Key::Host, table.host.as_ref().map(|host| host.at)),
        (Key::TcpPort, table.tcp_port.map(|port| port.at)),
        (Key::Timeout, table.timeout_ms.map(|time| time.at)),
        (Key::Idle, table.idle_ms.map(|time| time.at)),
    ];
    let (host, port) = (text(&table.host), table.tcp_port.map_or(TCP_PORT, |port| port.value));
    let name = table.name?;
    let usual = LineDef::new(id, &name.value, Transport::Tcp { host, port, framing: mode.framing });
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.gap_ms, usual.gap),
        idle: millis(table.idle_ms, usual.idle),
        ..usual
    };
    Some(Written { line, name, spans: known(spans) })
}

fn millis(written: Option<At<u16>>, usual: Duration) -> Duration {
    written.map_or(usual, |value| Duration::from_millis(u64::from(value.value)))
}

fn known<const N: usize>(spans: [(Key, Option<Span>); N]) -> Vec<(Key, Span)> {
    spans.into_iter().filter_map(|(key, span)| Some((key, span?))).collect()
}

/// A setting of a line, for complaints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// Path of a serial port.
    Port,
    /// Baud rate.
    Baud,
    /// Bits of a character.
    DataBits,
    /// Stop bits.
    StopBits,
    /// Host name or address.
    Host,
    /// TCP port.
    TcpPort,
    /// Longest wait for an answer.
    Timeout,
    /// Extra silence before a request.
    Gap,
    /// Silence that ends an answer.
    Idle,
}

/// What is wrong with a setting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Complaint {
    /// Which setting.
    pub key: Key,
    /// `9601 is not a usual baud rate`.
    pub what: String,
    /// `expected 1 or 2`.
    pub expected: &'static str,
}

/// Everything that is wrong with a line: what the plant file and the form of the terminal both hold to.
pub fn complaints(line: &LineDef) -> Vec<Complaint> {
    let mut all = Vec::new();
    let mut check = |wrong: bool, key: Key, what: String, expected: &'static str| {
        if wrong {
            all.push(Complaint { key, what, expected });
        }
    };
    match &line.transport {
        Transport::Serial { port, serial, framing, .. } => {
            let Serial { baud, data_bits, parity: _, stop_bits } = *serial;
            let (who, expected) = match framing {
                Framing::Ascii => ("Modbus ASCII sends 7 or 8", "expected 7 or 8"),
                Framing::Rtu | Framing::Mbap => ("Modbus RTU sends 8", "expected 8"),
            };
            let fits = data_bits == 8 || (data_bits == 7 && *framing == Framing::Ascii);
            check(port.trim().is_empty(), Key::Port, "a serial line needs a port".into(), "expected /dev/…");
            let unusual = format!("{baud} is not a usual baud rate");
            let usual = "expected 300, 600, 1200 … 9600, 19200, 38400, 57600, 115200 …";
            check(!BAUDS.contains(&baud), Key::Baud, unusual, usual);
            check(!fits, Key::DataBits, format!("{who} data bits"), expected);
            let wrong = !matches!(stop_bits, 1 | 2);
            check(wrong, Key::StopBits, format!("{stop_bits} stop bits do not exist"), "expected 1 or 2");
        }
        Transport::Tcp { host, port, framing: _ } => {
            let named = !host.trim().is_empty();
            check(!named, Key::Host, "a TCP line needs a host".into(), "expected a name or an address");
            // More than one colon is an address of IPv6.
            let with_port = host.matches(':').count() == 1;
            check(with_port, Key::Host, format!("`{host}` is no host"), "expected it alone, the port is tcp_port");
            check(*port == 0, Key::TcpPort, "there is no TCP port 0".into(), "expected 1 to 65535, usually 502");
        }
    }
    let ms = |span: Duration| span.as_millis();
    let short = "no device answers within so little time";
    check(ms(line.timeout) < 10, Key::Timeout, short.into(), "expected at least 10 ms");
    check(MILLIS_MAX < ms(line.timeout), Key::Timeout, "nobody waits so long".into(), "expected at most 65535 ms");
    check(MILLIS_MAX < ms(line.gap), Key::Gap, "nobody rests so long".into(), "expected at most 65535 ms");
    let short = "answers come in pieces further apart than this";
    check(ms(line.idle) < 2, Key::Idle, short.into(), "expected at least 2 ms");
    all
}

/// Baud rates that ports and devices know.
pub const BAUDS: &[u32] =
    &[300, 600, 1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

/// The port of Modbus TCP.
pub const TCP_PORT: u16 = 502;

/// Longest time that a plant file can say.
const MILLIS_MAX: u128 = 65_535;

/// Data bits that a line has if nobody says how many.
pub fn usual_data_bits(ascii: bool) -> u8 {
    if ascii { 7 } else { 8 }
}

/// The word of a mode in the plant file: `rtu`, `ascii`, `tcp`, `rtu-over-tcp`; `None` for a mode that has none.
pub(super) fn mode_word(transport: &Transport) -> Option<&'static str> {
    let (tcp, framing) = (matches!(transport, Transport::Tcp { .. }), transport.framing());
    MODES.iter().find(|(_, mode)| (mode.tcp, mode.framing) == (tcp, framing)).map(|(word, _)| *word)
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
pub(super) fn name_of(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}
