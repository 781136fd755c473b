//! What a line may be set to: held to by the plant file, the form of the terminal, the socket and the reducer alike.

use std::time::Duration;

use super::line::{Framing, LineDef, Protocol, Serial, Transport};
use crate::t;

/// Shortest time that an answer may take: no device is faster, and less would be all timeouts.
pub const TIMEOUT_MIN: Duration = Duration::from_millis(10);
/// Longest time that an answer may take: gateways over radio need so long.
pub const TIMEOUT_MAX: Duration = Duration::from_secs(60);
/// Longest time that anything else on a line may wait: for so long nothing goes over it.
pub const WAIT_MAX: Duration = Duration::from_secs(10);

/// What is wrong with a setting.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingError {
    /// As the plant file calls it: `baud`.
    pub key: &'static str,
    /// `9601 is not a usual baud rate`.
    pub what: String,
    /// `expected 1 or 2`.
    pub expected: &'static str,
}

/// Can a line have these settings? `Err` says why not.
pub fn valid(line: &LineDef) -> Result<(), String> {
    match check_settings(line).into_iter().next() {
        Some(SettingError { what, expected, .. }) => Err(format!("{what}; {expected}")),
        None => Ok(()),
    }
}

/// Everything that is wrong with a line: the first error is the one to show where there is room for one.
pub fn check_settings(line: &LineDef) -> Vec<SettingError> {
    let mut all = Vec::new();
    let mut check = |wrong: bool, key: &'static str, what: String, expected: &'static str| {
        if wrong {
            all.push(SettingError { key, what, expected });
        }
    };
    check_transport(&line.transport, &mut check);
    let known = match &line.transport {
        Transport::Serial { framing, .. } => *framing != Framing::Mbap,
        Transport::Network { .. } => true,
    };
    check(
        !known,
        "mode",
        t!("{mode} is not a line mode", mode = line.transport.mode()),
        t!("expected RTU, ASCII or TCP"),
    );
    let short = t!("too short: no device responds within this time");
    check(line.timeout < TIMEOUT_MIN, "timeout_ms", short.into(), t!("expected at least 10 ms"));
    let long = t!("too long: the line is blocked for this time");
    check(TIMEOUT_MAX < line.timeout, "timeout_ms", long.into(), t!("expected at most 60000 ms"));
    for (key, span) in [
        ("request_gap_ms", line.gap),
        ("frame_timeout_ms", line.frame_timeout),
        ("turnaround_ms", line.turnaround),
        ("connect_delay_ms", line.connect_delay),
    ] {
        check(WAIT_MAX < span, key, long.into(), t!("expected at most 10000 ms"));
    }
    let short = t!("too short: responses may arrive in fragments");
    check(
        line.frame_timeout < Duration::from_millis(2),
        "frame_timeout_ms",
        short.into(),
        t!("expected at least 2 ms"),
    );
    all
}

/// What is wrong with a port or an address.
fn check_transport(transport: &Transport, check: &mut impl FnMut(bool, &'static str, String, &'static str)) {
    match transport {
        Transport::Serial { port, serial, framing, .. } => {
            let Serial { baud, data_bits, parity: _, stop_bits } = *serial;
            let (who, expected) = match framing {
                Framing::Ascii => (t!("Modbus ASCII sends 7 or 8"), t!("expected 7 or 8")),
                Framing::Rtu | Framing::Mbap => (t!("Modbus RTU sends 8"), t!("expected 8")),
            };
            let fits = data_bits == 8 || (data_bits == 7 && *framing == Framing::Ascii);
            check(port.trim().is_empty(), "port", t!("a serial line needs a port").into(), t!("expected /dev/…"));
            let impossible = t!("{baud} baud is out of range", baud);
            let usual = t!("expected 50 to 4000000, usually 9600, 19200, 38400 or 115200");
            check(!BAUD_RANGE.contains(&baud), "baud", impossible, usual);
            check(!fits, "data_bits", t!("{who} data bits", who), expected);
            let wrong = !matches!(stop_bits, 1 | 2);
            check(wrong, "stop_bits", t!("{stop_bits} stop bits are not possible", stop_bits), t!("expected 1 or 2"));
        }
        Transport::Network { protocol, host, port, framing: _ } => {
            let (key, word) = match protocol {
                Protocol::Tcp => ("tcp_port", "TCP"),
                Protocol::Udp => ("udp_port", "UDP"),
            };
            let named = !host.trim().is_empty();
            check(!named, "host", t!("a {word} line needs a host", word), t!("expected a name or an address"));
            // More than one colon is an address of IPv6.
            let with_port = host.matches(':').count() == 1;
            check(
                with_port,
                "host",
                t!("`{host}` is not a host", host),
                t!("expected the host alone: its port goes into tcp_port or udp_port"),
            );
            check(*port == 0, key, t!("{word} port 0 does not exist", word), t!("expected 1 to 65535, usually 502"));
        }
    }
}

impl Serial {
    /// Can a port have these parameters? Which of them a framing needs is another query.
    pub fn is_usual(self) -> bool {
        BAUD_RANGE.contains(&self.baud) && matches!(self.data_bits, 7 | 8) && matches!(self.stop_bits, 1 | 2)
    }
}

/// Baud rates that a driver may be asked for; it refuses what it cannot do.
pub const BAUD_RANGE: std::ops::RangeInclusive<u32> = 50..=4_000_000;
/// Baud rates that most ports and devices know.
pub const BAUDS: &[u32] =
    &[300, 600, 1_200, 2_400, 4_800, 9_600, 14_400, 19_200, 28_800, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];
