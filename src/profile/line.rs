//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::Problems,
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
        let Some(parts) = (if mode.tcp { tcp(raw, mode, problems) } else { serial(raw, mode, problems) }) else {
            continue;
        };
        check_name(&parts.name, "line", problems);
        seen.insert(&parts.name.value, parts.name.at, format!("duplicate line `{}`", parts.name.value), problems);
        lines.push(parts.line(LineId(index as u16), problems));
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

/// What both kinds of lines have.
struct Parts {
    name: At<String>,
    transport: Transport,
    timeout_ms: Option<At<u16>>,
    gap_ms: Option<At<u16>>,
    idle_ms: Option<At<u16>>,
    turnaround_ms: Option<At<u16>>,
}

impl Parts {
    fn line(self, id: LineId, problems: &mut Problems) -> LineDef {
        if let Some(short) = self.timeout_ms.filter(|timeout| timeout.value < 10) {
            problems.add(short.at, "no device answers within so little time").label("expected at least 10 ms");
        }
        if let Some(short) = self.idle_ms.filter(|idle| idle.value < 2) {
            problems.add(short.at, "answers come in pieces further apart than this").label("expected at least 2 ms");
        }
        let usual = LineDef::new(id, &self.name.value, self.transport);
        let millis = |written: Option<At<u16>>, usual: Duration| {
            written.map_or(usual, |value| Duration::from_millis(u64::from(value.value)))
        };
        LineDef {
            timeout: millis(self.timeout_ms, usual.timeout),
            gap: millis(self.gap_ms, usual.gap),
            idle: millis(self.idle_ms, usual.idle),
            turnaround: millis(self.turnaround_ms, usual.turnaround),
            ..usual
        }
    }
}

fn serial(raw: Raw, mode: Mode, problems: &mut Problems) -> Option<Parts> {
    let table = SerialTable::of(&[raw], problems);
    if let Some(baud) = table.baud.filter(|baud| !BAUDS.contains(&baud.value)) {
        let problem = problems.add(baud.at, format!("{} is not a usual baud rate", baud.value));
        problem.label("expected 300, 600, 1200 … 9600, 19200, 38400, 57600, 115200 …");
    }
    let ascii = mode.framing == Framing::Ascii;
    if let Some(bits) = table.data_bits.filter(|bits| bits.value != 8 && !(ascii && bits.value == 7)) {
        let (what, expected) =
            if ascii { ("Modbus ASCII sends 7 or 8", "7 or 8") } else { ("Modbus RTU sends 8", "8") };
        problems.add(bits.at, format!("{what} data bits")).label(format!("expected {expected}"));
    }
    if let Some(bits) = table.stop_bits.filter(|bits| !matches!(bits.value, 1 | 2)) {
        problems.add(bits.at, format!("{} stop bits do not exist", bits.value)).label("expected 1 or 2");
    }
    let serial = Serial {
        baud: table.baud.map_or(Serial::USUAL.baud, |baud| baud.value),
        data_bits: table.data_bits.map_or(if ascii { 7 } else { 8 }, |bits| bits.value),
        parity: table.parity.map_or(Parity::None, |parity| parity.value),
        stop_bits: table.stop_bits.map_or(1, |bits| bits.value),
    };
    Some(Parts {
        name: table.name?,
        transport: Transport::Serial {
            port: text(&table.port),
            serial,
            framing: mode.framing,
            rs485: table.rs485.map_or(Rs485::Off, |rs485| rs485.value),
        },
        timeout_ms: table.timeout_ms,
        gap_ms: table.gap_ms,
        idle_ms: table.idle_ms,
        turnaround_ms: table.turnaround_ms,
    })
}

/// Baud rates that ports and devices know.
pub const BAUDS: &[u32] =
    &[300, 600, 1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

fn tcp(raw: Raw, mode: Mode, problems: &mut Problems) -> Option<Parts> {
    let table = TcpTable::of(&[raw], problems);
    let (host, port) = (text(&table.host), table.tcp_port.map_or(502, |port| port.value));
    Some(Parts {
        name: table.name?,
        transport: Transport::Tcp { host, port, framing: mode.framing },
        timeout_ms: table.timeout_ms,
        gap_ms: table.gap_ms,
        idle_ms: table.idle_ms,
        turnaround_ms: None,
    })
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
pub(super) fn name_of(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}
