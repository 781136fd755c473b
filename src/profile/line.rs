//! The lines of a plant: serial ports and TCP endpoints.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Unique, check_name},
    reader::{At, Node, OptionalKey, Raw, kind_of, text},
    schema::{DeviceTable, ListenFraming, ListenSerialTable, ListenTcpTable, SerialTable, TcpTable, UdpTable},
};
use crate::plant::{
    def::{Framing, LineDef, LineId, Parity, Protocol, Rs485, Serial, Transport},
    keyword::{Keyword, keyword_enum},
    line_check::{BAUD_RANGE, BAUDS, SettingError, check_settings},
    number::to_u16,
};

/// The lines in the order of the file.
pub(super) fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let (mut seen, mut ports) = (Unique::default(), Unique::default());
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let raw = table.value.clone();
        if let Some((_, At { value: Node::Text(port), at })) = raw.table.get("port") {
            ports.insert(port, *at, format!("another line has the port {port}"), problems);
        }
        let Some(mode) = kind_of::<Mode>(&raw, "a line", "mode", problems) else { continue };
        let id = LineId(to_u16(index));
        let Some((protocol, framing)) = mode.transport() else {
            lines.extend(listening(raw, id, &mut seen, problems));
            continue;
        };
        let read = match protocol {
            None => serial,
            Some(Protocol::Tcp) => tcp,
            Some(Protocol::Udp) => udp,
        };
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
        AsciiOverTcp => "ascii-over-tcp",
        Udp => "udp",
        RtuOverUdp => "rtu-over-udp",
        AsciiOverUdp => "ascii-over-udp",
        // Another master polls.
        Listen => "listen",
    }
}

impl ListenFraming {
    fn transport(self) -> (bool, Framing) {
        match self {
            ListenFraming::Rtu => (false, Framing::Rtu),
            ListenFraming::Ascii => (false, Framing::Ascii),
            ListenFraming::Tcp => (true, Framing::Mbap),
            ListenFraming::RtuOverTcp => (true, Framing::Rtu),
            ListenFraming::AsciiOverTcp => (true, Framing::Ascii),
        }
    }
}

impl Mode {
    /// The protocol, if it goes over a network, and its framing; other keys say so of a listening line.
    fn transport(self) -> Option<(Option<Protocol>, Framing)> {
        let (protocol, framing) = match self {
            Mode::Rtu => (None, Framing::Rtu),
            Mode::Ascii => (None, Framing::Ascii),
            Mode::Tcp => (Some(Protocol::Tcp), Framing::Mbap),
            Mode::RtuOverTcp => (Some(Protocol::Tcp), Framing::Rtu),
            Mode::AsciiOverTcp => (Some(Protocol::Tcp), Framing::Ascii),
            Mode::Udp => (Some(Protocol::Udp), Framing::Mbap),
            Mode::RtuOverUdp => (Some(Protocol::Udp), Framing::Rtu),
            Mode::AsciiOverUdp => (Some(Protocol::Udp), Framing::Ascii),
            Mode::Listen => return None,
        };
        Some((protocol, framing))
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
    warn_of_baud(table.baud, problems);
    Some(line)
}

/// A number that was mistyped is seldom a usual one.
fn warn_of_baud(baud: Option<At<u32>>, problems: &mut Problems) {
    if let Some(baud) = baud.filter(|baud| BAUD_RANGE.contains(&baud.value) && !BAUDS.contains(&baud.value)) {
        let problem = problems.warn(baud.at, format!("{} is not a usual baud rate", baud.value));
        problem.label("the driver of the port is asked for it, and may refuse");
    }
}

fn tcp(raw: Raw, framing: Framing, id: LineId, seen: &mut Unique, problems: &mut Problems) -> Option<LineDef> {
    let table = TcpTable::of(&[raw], problems);
    let (host, port) = (text(&table.host), table.tcp_port.value_or(TCP_PORT));
    let name = checked_name(&table.name, seen, problems)?;
    let usual = LineDef::new(id, &name, Transport::Network { protocol: Protocol::Tcp, host, port, framing });
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.request_gap_ms, usual.gap),
        frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout),
        connect_delay: millis(table.connect_delay_ms, usual.connect_delay),
        ..usual
    };
    report_wrong(&line, |key| table.span_of(key), problems);
    Some(line)
}

fn udp(raw: Raw, framing: Framing, id: LineId, seen: &mut Unique, problems: &mut Problems) -> Option<LineDef> {
    let table = UdpTable::of(&[raw], problems);
    let (host, port) = (text(&table.host), table.udp_port.value_or(TCP_PORT));
    let name = checked_name(&table.name, seen, problems)?;
    let usual = LineDef::new(id, &name, Transport::Network { protocol: Protocol::Udp, host, port, framing });
    let line = LineDef {
        timeout: millis(table.timeout_ms, usual.timeout),
        gap: millis(table.request_gap_ms, usual.gap),
        frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout),
        ..usual
    };
    report_wrong(&line, |key| table.span_of(key), problems);
    Some(line)
}

/// The line of another master: a serial port, or a host that forwards the bytes of both sides.
fn listening(raw: Raw, id: LineId, seen: &mut Unique, problems: &mut Problems) -> Option<LineDef> {
    let is_tcp = raw.table.contains_key("host");
    let line = if is_tcp {
        let table = ListenTcpTable::of(&[raw], problems);
        let (host, port) = (text(&table.host), table.tcp_port.value_or(TCP_PORT));
        let framing = listen_framing(&table.framing, true, problems);
        let name = checked_name(&table.name, seen, problems)?;
        let usual = LineDef::new(id, &name, Transport::Network { protocol: Protocol::Tcp, host, port, framing });
        let line =
            LineDef { frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout), listens: true, ..usual };
        report_wrong(&line, |key| table.span_of(key), problems);
        line
    } else {
        let table = ListenSerialTable::of(&[raw], problems);
        let framing = listen_framing(&table.framing, false, problems);
        let serial = Serial {
            baud: table.baud.value_or(Serial::USUAL.baud),
            data_bits: table.data_bits.value_or(usual_data_bits(framing == Framing::Ascii)),
            parity: table.parity.value_or(Parity::None),
            stop_bits: table.stop_bits.value_or(1),
        };
        let transport = Transport::Serial { port: text(&table.port), serial, framing, rs485: Rs485::Off };
        let name = checked_name(&table.name, seen, problems)?;
        let usual = LineDef::new(id, &name, transport);
        let line =
            LineDef { frame_timeout: millis(table.frame_timeout_ms, usual.frame_timeout), listens: true, ..usual };
        report_wrong(&line, |key| table.span_of(key), problems);
        warn_of_baud(table.baud, problems);
        line
    };
    Some(line)
}

/// Limits are those of requests, and a device on a listening line gets none.
pub(super) fn warn_of_limits(devices: &[At<DeviceTable>], lines: &[LineDef], problems: &mut Problems) {
    for device in devices.iter().map(|table| &table.value) {
        let (Some(limits), Some(name)) = (&device.limits, &device.line) else { continue };
        if lines.iter().any(|line| line.name == name.value && line.listens) {
            let problem = problems.warn(limits.at, format!("{} is on a line that only listens", text(&device.name)));
            problem.label("another master polls it: its limits have no effect");
        }
    }
}

/// RTU on a serial port and Modbus TCP over TCP, unless written otherwise.
fn listen_framing(written: &Option<At<ListenFraming>>, is_tcp: bool, problems: &mut Problems) -> Framing {
    let usual = if is_tcp { Framing::Mbap } else { Framing::Rtu };
    let Some(written) = written else { return usual };
    let (needs_tcp, framing) = written.value.transport();
    if needs_tcp == is_tcp {
        return framing;
    }
    let word = written.value.word();
    let (found, expected) =
        if is_tcp { ("a host", "tcp, rtu-over-tcp or ascii-over-tcp") } else { ("a serial port", "rtu or ascii") };
    problems.add(written.at, format!("framing `{word}` on {found}")).label(format!("expected {expected}"));
    usual
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

/// The word of a mode in the plant file: `rtu`, `ascii`, `tcp`, `rtu-over-tcp`, `udp`, …; `None` for a mode that has none.
pub fn mode_word(transport: &Transport) -> Option<&'static str> {
    let written = (transport.protocol(), transport.framing());
    Mode::ALL.into_iter().find(|mode| mode.transport() == Some(written)).map(Mode::word)
}

/// The words of the modes of lines that are polled.
pub fn polled_modes() -> impl Iterator<Item = &'static str> {
    Mode::ALL.into_iter().filter(|mode| mode.transport().is_some()).map(Mode::word)
}

/// What a mode of the plant file means: the protocol, if it goes over a network, and the framing.
pub fn of_mode_word(word: &str) -> Option<(Option<Protocol>, Framing)> {
    Mode::from_word(word)?.transport()
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
pub(super) fn name_of(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}
