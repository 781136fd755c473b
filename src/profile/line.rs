//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::Problems,
    names::{Unique, check_name},
    reader::{At, Node, Raw, Value, text},
    schema::{RtuTable, TcpTable},
};
use crate::plant::def::{LineDef, LineId, Parity, Serial, Transport};

/// The lines in the order of the file.
pub(super) fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let mut seen = Unique::default();
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let id = LineId(index as u16);
        let raw = table.value.clone();
        let Some(mode) = mode(&raw, problems) else { continue };
        let (name, transport, timeout, gap) = if mode == "tcp" { tcp(raw, problems) } else { rtu(raw, problems) };
        let Some(name) = name else { continue };
        check_name(&name, "line", problems);
        seen.insert(&name.value, name.at, format!("duplicate line `{}`", name.value), problems);
        if let Some(short) = timeout.filter(|timeout| timeout.value < 10) {
            problems.add(short.at, "no device answers within so little time").label("expected at least 10 ms");
        }
        lines.push(LineDef {
            id,
            name: name.value,
            transport,
            timeout: Duration::from_millis(timeout.map_or(1_000, |timeout| u64::from(timeout.value))),
            gap: Duration::from_millis(gap.map_or(0, |gap| u64::from(gap.value))),
        });
    }
    lines
}

/// The mode decides which other keys a line has, so it is looked at first.
fn mode(raw: &Raw, problems: &mut Problems) -> Option<String> {
    let Some((_, value)) = raw.table.get("mode") else {
        problems.add(raw.at, "a line needs `mode`").label("missing here").help("mode = \"rtu\" or \"tcp\"");
        return None;
    };
    let mode = <String as Value>::read(&value.value, value.at, problems)?;
    let at = value.at;
    if !matches!(mode.as_str(), "rtu" | "tcp") {
        let problem = problems.add(at, format!("unknown mode `{mode}`"));
        problem.label("expected \"rtu\" or \"tcp\"").suggest(&mode, ["rtu", "tcp"]);
        return None;
    }
    Some(mode)
}

type LineParts = (Option<At<String>>, Transport, Option<At<u16>>, Option<At<u16>>);

fn rtu(raw: Raw, problems: &mut Problems) -> LineParts {
    let table = RtuTable::of(&[raw], problems);
    if let Some(baud) = table.baud.filter(|baud| !BAUDS.contains(&baud.value)) {
        let problem = problems.add(baud.at, format!("{} is not a usual baud rate", baud.value));
        problem.label("expected 300, 600, 1200 … 9600, 19200, 38400, 57600, 115200 …");
    }
    if let Some(bits) = table.data_bits.filter(|bits| bits.value != 8) {
        problems.add(bits.at, "Modbus RTU sends 8 data bits").label("expected 8");
    }
    if let Some(bits) = table.stop_bits.filter(|bits| !matches!(bits.value, 1 | 2)) {
        problems.add(bits.at, format!("{} stop bits do not exist", bits.value)).label("expected 1 or 2");
    }
    let serial = Serial {
        baud: table.baud.map_or(9_600, |baud| baud.value),
        data_bits: 8,
        parity: table.parity.map_or(Parity::None, |parity| parity.value),
        stop_bits: table.stop_bits.map_or(1, |bits| bits.value),
    };
    let port = text(&table.port);
    (table.name, Transport::Rtu { port, serial }, table.timeout_ms, table.gap_ms)
}

const BAUDS: &[u32] =
    &[300, 600, 1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

fn tcp(raw: Raw, problems: &mut Problems) -> LineParts {
    let table = TcpTable::of(&[raw], problems);
    let host = text(&table.host);
    let port = table.tcp_port.map_or(502, |port| port.value);
    (table.name, Transport::Tcp { host, port }, table.timeout_ms, table.gap_ms)
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
pub(super) fn name_of(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}
