//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Unique, check_name},
    reader::{At, Node, Raw, Value, text},
    schema::{SerialTable, TcpTable},
};
use crate::plant::{
    def::{Framing, LineDef, LineId, Parity, Rs485, Serial, Transport},
    line_check::{Key, SettingError, check_settings},
    number::to_u16,
};

/// The lines in the order of the file.
pub(super) fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let mut seen = Unique::default();
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let raw = table.value.clone();
        let Some(mode) = mode(&raw, problems) else { continue };
        let id = LineId(to_u16(index));
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
    /// The line, after every error about a key that is written was added.
    fn line(self, problems: &mut Problems) -> LineDef {
        for SettingError { key, what, expected } in check_settings(&self.line) {
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
        (Key::Gap, table.request_gap_ms.map(|time| time.at)),
        (Key::Idle, table.frame_timeout_ms.map(|time| time.at)),
        (Key::Turnaround, table.turnaround_ms.map(|time| time.at)),
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
        gap: millis(table.request_gap_ms, usual.gap),
        idle: millis(table.frame_timeout_ms, usual.idle),
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
        (Key::Gap, table.request_gap_ms.map(|time| time.at)),
        (Key::Idle, table.frame_timeout_ms.map(|time| time.at)),
    ];
    let (host, port) = (text(&table.host), table.tcp_port.map_or(TCP_PORT, |port| port.value));
    let name = table.name?;
    let usual = LineDef::new(id, &name.value, Transport::Tcp { host, port, framing: mode.framing });
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.request_gap_ms, usual.gap),
        idle: millis(table.frame_timeout_ms, usual.idle),
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

/// The port of Modbus TCP.
pub const TCP_PORT: u16 = 502;

/// Default data bits of a line.
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
