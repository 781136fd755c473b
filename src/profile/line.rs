//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Unique, check_name},
    reader::{At, Node, OptionalKey, Raw, kind_of, text},
    schema::{SerialTable, TcpTable},
};
use crate::plant::{
    def::{Framing, LineDef, LineId, Parity, Rs485, Serial, Transport},
    keyword::keyword_enum,
    line_check::{SettingError, check_settings},
    number::to_u16,
};

/// The lines in the order of the file.
pub(super) fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let mut seen = Unique::default();
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let raw = table.value.clone();
        let Some(mode) = kind_of::<Mode>(&raw, "a line", "mode", problems) else { continue };
        let id = LineId(to_u16(index));
        let (is_tcp, framing) = mode.transport();
        let read = if is_tcp { tcp } else { serial };
        lines.extend(read(raw, framing, id, &mut seen, problems));
    }
    lines
}

keyword_enum! {
    /// What `mode` says: it decides which other keys a line has.
    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Mode: "mode" {
        Rtu => "rtu",
        Ascii => "ascii",
        Tcp => "tcp",
        RtuOverTcp => "rtu-over-tcp",
    }
}

impl Mode {
    /// Whether it goes over TCP, and its framing.
    fn transport(self) -> (bool, Framing) {
        match self {
            Mode::Rtu => (false, Framing::Rtu),
            Mode::Ascii => (false, Framing::Ascii),
            Mode::Tcp => (true, Framing::Mbap),
            Mode::RtuOverTcp => (true, Framing::Rtu),
        }
    }
}

fn serial(raw: Raw, framing: Framing, id: LineId, seen: &mut Unique, problems: &mut Problems) -> Option<LineDef> {
    let table = SerialTable::of(&[raw], problems);
    let ascii = framing == Framing::Ascii;
    let serial = Serial {
        baud: table.baud.value_or(Serial::USUAL.baud),
        data_bits: table.data_bits.value_or(usual_data_bits(ascii)),
        parity: table.parity.value_or(Parity::None),
        stop_bits: table.stop_bits.value_or(1),
    };
    let transport =
        Transport::Serial { port: text(&table.port), serial, framing, rs485: table.rs485.value_or(Rs485::Off) };
    let name = checked_name(&table.name, seen, problems)?;
    let usual = LineDef::new(id, &name, transport);
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.request_gap_ms, usual.gap),
        frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout),
        turnaround: millis(table.turnaround_ms, usual.turnaround),
        ..usual
    };
    report_wrong(&line, |key| table.span_of(key), problems);
    Some(line)
}

fn tcp(raw: Raw, framing: Framing, id: LineId, seen: &mut Unique, problems: &mut Problems) -> Option<LineDef> {
    let table = TcpTable::of(&[raw], problems);
    let (host, port) = (text(&table.host), table.tcp_port.value_or(TCP_PORT));
    let name = checked_name(&table.name, seen, problems)?;
    let usual = LineDef::new(id, &name, Transport::Tcp { host, port, framing });
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.request_gap_ms, usual.gap),
        frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout),
        ..usual
    };
    report_wrong(&line, |key| table.span_of(key), problems);
    Some(line)
}

fn checked_name(name: &Option<At<String>>, seen: &mut Unique, problems: &mut Problems) -> Option<String> {
    let name = name.as_ref()?;
    check_name(name, "line", problems);
    seen.insert(&name.value, name.at, format!("duplicate line `{}`", name.value), problems);
    Some(name.value.clone())
}

/// Reports what is wrong with the keys that are written: the others have their usual values, or were reported as missing.
fn report_wrong(line: &LineDef, span_of: impl Fn(&str) -> Option<Span>, problems: &mut Problems) {
    for SettingError { key, what, expected } in check_settings(line) {
        if let Some(at) = span_of(key) {
            problems.add(at, what).label(expected);
        }
    }
}

fn millis(written: Option<At<u16>>, usual: Duration) -> Duration {
    written.map_or(usual, |value| Duration::from_millis(u64::from(value.value)))
}

/// The port of Modbus TCP.
pub const TCP_PORT: u16 = 502;

/// Default data bits of a line.
pub fn usual_data_bits(ascii: bool) -> u8 {
    if ascii { 7 } else { 8 }
}

/// The word of a mode in the plant file: `rtu`, `ascii`, `tcp`, `rtu-over-tcp`; `None` for a mode that has none.
pub(super) fn mode_word(transport: &Transport) -> Option<&'static str> {
    let written = (matches!(transport, Transport::Tcp { .. }), transport.framing());
    Mode::ALL.into_iter().find(|mode| mode.transport() == written).map(Mode::word)
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
pub(super) fn name_of(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}
