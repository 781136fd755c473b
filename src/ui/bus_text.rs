//! How the bytes and the times of a line are written.

use std::time::Duration;

use super::widgets::text::{width, wrap};
use crate::{bus::frame::hex, plant::def::Framing, t};

/// The bytes as they are written: hex, or the characters of an ASCII frame.
pub fn bytes_text(framing: Framing, bytes: &[u8]) -> String {
    match framing {
        Framing::Ascii => bytes.escape_ascii().to_string(),
        Framing::Rtu | Framing::Mbap => hex(bytes),
    }
}

/// How wide hex bytes are, for windows that break them into rows.
pub fn broken(text: &str, room: u16) -> Vec<String> {
    if text.contains(' ') || width(text) <= room {
        return wrap(text, room);
    }
    let letters: Vec<char> = text.chars().collect();
    letters.chunks(usize::from(room.max(1))).map(|part| part.iter().collect()).collect()
}

/// `45.8 ms`, `300 ms`, `2.5 s`.
pub fn ms(span: Duration) -> String {
    match span.as_secs_f64() {
        seconds @ 120.0.. => t!("{seconds} min", seconds = format!("{:.0}", seconds / 60.0)),
        seconds @ 10.0.. => format!("{seconds:.0} s"),
        seconds @ 1.0.. => format!("{seconds:.1} s"),
        seconds => t!("{tenths} ms", tenths = tenths(seconds * 1e3)),
    }
}

/// Milliseconds without the unit, for tables.
pub fn short_ms(span: Duration) -> String {
    tenths(span.as_secs_f64() * 1e3)
}

fn tenths(ms: f64) -> String {
    if 99.95 <= ms || ms.fract() == 0.0 { format!("{ms:.0}") } else { format!("{ms:.1}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_read_easily() {
        let check = |micros, expect: &str| assert_eq!(ms(Duration::from_micros(micros)), expect);
        check(4_010, "4.0 ms");
        check(300_000, "300 ms");
        check(99_960, "100 ms");
        check(2_500_000, "2.5 s");
        check(70_000_000, "70 s");
        check(1_580_800_000, "26 min");
    }
}
