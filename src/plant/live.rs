//! Live registers: what a technician reads of a unit beside the poll plan, again and again.

use crate::t;
use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    address::{in_table, of_modicon},
    fault::Fault,
    id::LineId,
    tag::Table,
};

/// Most spans of one live read.
pub const SPANS_MAX: usize = 64;
/// Most registers and bits of one live read.
pub const CELLS_MAX: u32 = 4_000;

/// Registers or bits of one table that stand together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct AddressSpan {
    /// Which table.
    pub table: Table,
    /// First address, 0-based.
    pub address: u16,
    /// Registers, or bits.
    pub count: u16,
}

impl AddressSpan {
    /// First address, and the one behind the last.
    pub fn range(self) -> std::ops::Range<u32> {
        u32::from(self.address)..u32::from(self.address) + u32::from(self.count)
    }
}

/// Reads some registers of a unit once, at a moment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LiveRead {
    /// On which line.
    pub line: LineId,
    /// Unit address.
    pub unit: u8,
    /// What, in the order in which it is to be read.
    pub spans: Vec<AddressSpan>,
    /// The line waits until then, by its clock as in [`LiveReading::began`]; `None`: as soon as it has time.
    pub not_before: Option<Timestamp>,
    /// Ask again for what the unit has refused before.
    pub relearn: bool,
}

impl LiveRead {
    /// Can a line carry it? `Err` says why not.
    pub fn check(&self) -> Result<(), String> {
        let cells: u32 = self.spans.iter().map(|span| u32::from(span.count)).sum();
        if self.spans.is_empty() || SPANS_MAX < self.spans.len() || !(1..=CELLS_MAX).contains(&cells) {
            let spans = self.spans.len();
            return Err(t!("{cells} registers in {spans} spans: expected 1 to 4000 in 1 to 64", cells, spans));
        }
        match self.spans.iter().find(|span| span.range().end > 0x1_0000 || span.count == 0) {
            Some(span) => Err(t!("address {last}: the last is 65535", last = span.range().end.saturating_sub(1))),
            None => Ok(()),
        }
    }
}

/// What a live read has found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LiveReading {
    /// When its first request was made, by the line's clock, which no setting of a clock moves.
    pub began: Timestamp,
    /// Each part that was asked, in the order in which it was read.
    pub parts: Vec<LivePart>,
    /// From the last byte sent to the first byte received, of the last request that was answered.
    pub response_time: Option<Duration>,
    /// Requests that it took.
    pub requests: u32,
}

/// Replies without which nothing is said of the timeout.
const REPLIES_MIN: u64 = 20;

/// What the replies so far say of the timeout of their line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReplyTimes {
    /// Replies seen.
    pub count: u64,
    /// The slowest of them.
    pub slowest: Duration,
}

impl ReplyTimes {
    /// Counts a reply.
    pub fn see(&mut self, response_time: Duration) {
        (self.count, self.slowest) = (self.count + 1, self.slowest.max(response_time));
    }

    /// A timeout with a margin: three times the slowest reply in steps of 50 ms, at least 200 ms; `None` after too few.
    pub fn timeout(self) -> Option<Duration> {
        let steps = (self.slowest * 3).as_millis().div_ceil(50).clamp(4, 200);
        (REPLIES_MIN <= self.count).then(|| Duration::from_millis(50) * u32::try_from(steps).unwrap_or(200))
    }
}

/// Part of a live read: what one request brought, or what is known of addresses that were not asked again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LivePart {
    /// When its response was complete, or its request failed, in UTC.
    pub at: Timestamp,
    /// Where.
    pub span: AddressSpan,
    /// A word each; bits are 0 or 1.
    pub words: Result<Vec<u16>, Fault>,
}

/// `holding:1002:10` by wire address, or `41003:10` by Modicon number; without a count, one.
impl std::str::FromStr for AddressSpan {
    type Err = String;

    fn from_str(text: &str) -> Result<AddressSpan, String> {
        let wrong = || t!("found `{text}`, expected TABLE:ADDRESS[:COUNT] such as holding:1002:10, or 41003:10", text);
        let parts: Vec<&str> = text.split(':').collect();
        let (found, count) = match parts.as_slice() {
            [modicon, count @ ..] if modicon.parse::<u32>().is_ok() => (of_modicon(modicon), count),
            [table, address, count @ ..] => (in_table(&format!("{table}:{address}")), count),
            [_] | [] => (None, [].as_slice()),
        };
        let (table, address) = found.ok_or_else(wrong)?;
        let count = match count {
            [] => 1,
            [count] => number(count).ok_or_else(wrong)?,
            _ => return Err(wrong()),
        };
        let most = if table.is_bits() { 2_000 } else { 125 };
        let span = AddressSpan { table, address, count };
        if !(1..=most).contains(&count) || 0x1_0000 < span.range().end {
            return Err(t!(
                "found {count} at {address}, expected 1 to {most} below address 65536",
                count,
                address,
                most
            ));
        }
        Ok(span)
    }
}

/// A decimal number, or hexadecimal with `0x`.
pub fn number(text: &str) -> Option<u16> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(hex) => u16::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timeout_leaves_the_slowest_reply_a_margin() {
        let after = |count, slowest| ReplyTimes { count, slowest: Duration::from_millis(slowest) }.timeout();
        assert_eq!(after(19, 12), None, "too few");
        assert_eq!(after(20, 12), Some(Duration::from_millis(200)));
        assert_eq!(after(20, 130), Some(Duration::from_millis(400)));
        assert_eq!(after(20, 60_000), Some(Duration::from_secs(10)));
    }

    #[test]
    fn a_span_is_read_by_wire_address_or_modicon_number() {
        let parse = |text: &str| text.parse::<AddressSpan>();
        let holding = |address, count| Ok(AddressSpan { table: Table::Holding, address, count });
        assert_eq!(parse("holding:1002:10"), holding(1002, 10));
        assert_eq!(parse("holding:0x3EA"), holding(1002, 1));
        assert_eq!(parse("41003:10"), holding(1002, 10));
        assert_eq!(parse("holding:32080"), holding(32_080, 1));
        assert_eq!(parse("465536"), holding(65_535, 1));
        assert_eq!(parse("31001"), Ok(AddressSpan { table: Table::Input, address: 1000, count: 1 }));
        for wrong in ["", "41003:0", "holding:5:126", "40000", "register:5", "holding", "holding:65535:2", "1:2:3:4"] {
            assert!(parse(wrong).is_err_and(|error| error.contains("expected")), "{wrong}");
        }
    }
}
