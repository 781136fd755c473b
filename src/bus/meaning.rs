//! What a request means in the words of the plant: `writes TIC-1.SV = 5.0 °C, P-DP is 1`.

use super::{codec, frame::Request, wide_addresses::WideAddresses};
use crate::{
    plant::{
        PlantDef, Snapshot,
        def::{DeviceDef, DeviceId, LineId},
        exact::Exact,
        scale,
        tag::{Point, Table, TagDef},
    },
    t,
};

/// Most tags that are named; the others are counted.
const NAMED_MAX: usize = 6;

/// Places that a request reads or writes.
pub(super) struct Span {
    table: Table,
    address: u16,
    count: u16,
    /// What is written there, or was read; a bit is 0 or 1.
    words: Option<Vec<u16>>,
    /// Words that each address holds.
    address_words: u16,
    pub writes: bool,
}

impl Span {
    /// The tags of a device that are at these places, or in part.
    pub fn tags<'a>(&self, def: &'a PlantDef, device: DeviceId) -> impl Iterator<Item = &'a TagDef> {
        let (table, first, end) =
            (self.table, u32::from(self.address), u32::from(self.address) + u32::from(self.count));
        let touched = move |point: Point| {
            let at = u32::from(point.address);
            point.table == table && at < end && first < at + u32::from(point.len())
        };
        def.tags_of(device).filter(move |tag| tag.calculation.is_none() && touched(tag.point))
    }

    /// The words of a point, if all of them are there.
    pub fn words_of(&self, point: Point) -> Option<&[u16]> {
        let each = point.kind.address_words();
        let from = usize::from(point.address.checked_sub(self.address)?) * usize::from(each);
        let words = self.words.as_ref().filter(|_| each == self.address_words)?;
        words.get(from..from + usize::from(point.words()))
    }
}

/// What a request message (unit and PDU) on a line would do, a line each; nothing for a unit that the plant does not have and
/// for a function without addresses.
pub fn of_request(snapshot: &Snapshot, line: LineId, message: &[u8]) -> Vec<String> {
    explain(snapshot, line, message, None)
}

/// What the answer to a request holds.
pub fn of_answer(snapshot: &Snapshot, line: LineId, request: &[u8], answer: &[u8]) -> Vec<String> {
    match answer.get(..2) == request.get(..2) {
        true => explain(snapshot, line, request, Some(answer)),
        false => Vec::new(),
    }
}

fn explain(snapshot: &Snapshot, line: LineId, message: &[u8], answer: Option<&[u8]>) -> Vec<String> {
    let Some(unit) = message.first() else { return Vec::new() };
    if let ([_, 0x07, ..], Some([_, _, status])) = (message, answer) {
        return devices(snapshot, line, *unit).filter_map(|device| states(device, *status)).collect();
    }
    let wide = WideAddresses::of(&snapshot.def, line);
    let spans = spans(wide.request(message), answer).unwrap_or_default();
    let pairs = devices(snapshot, line, *unit).flat_map(|device| spans.iter().map(move |span| (device, span)));
    pairs.flat_map(|(device, span)| lines(snapshot, device, span)).collect()
}

/// `PLC-1: RUN, AUTO`: which of the eight states of function 07 are on; `None` where the profile does not name them.
fn states(device: &DeviceDef, status: u8) -> Option<String> {
    let on = device.exception_status.iter().filter(|(bit, _)| status >> bit & 1 == 1);
    let on = on.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
    let on = if on.is_empty() { t!("no state is on") } else { &on };
    (!device.exception_status.is_empty()).then(|| format!("{}: {on}", device.name))
}

/// The devices that a request reaches: unit 0 of a serial line is all of them.
fn devices(snapshot: &Snapshot, line: LineId, unit: u8) -> impl Iterator<Item = &DeviceDef> {
    let serial = snapshot.def.lines.get(line.index()).is_some_and(|line| line.transport.serial().is_some());
    let reached = move |device: &&DeviceDef| device.line == line && (device.unit == unit || unit == 0 && serial);
    snapshot.def.devices.iter().filter(reached)
}

/// What a message reads and writes, by its function (V1.1b3, 6); `None` where bytes are missing.
pub(super) fn spans(request: Request, answer: Option<&[u8]>) -> Option<Vec<Span>> {
    let Request { message, address_words } = request;
    let word = |at: usize| Some(u16::from_be_bytes([*message.get(at)?, *message.get(at + 1)?]));
    let read = |table: Table, at: usize| -> Option<Span> {
        let (address, count) = (word(at)?, word(at + 2)?);
        let words = answer.and_then(|answer| unpacked(table, answer.get(3..)?, count.checked_mul(address_words)?));
        Some(Span { table, address, count, words, address_words, writes: false })
    };
    let write = |table: Table, at: usize, words: Option<Vec<u16>>, count: u16| -> Option<Span> {
        Some(Span { table, address: word(at)?, count, words, address_words, writes: true })
    };
    Some(match message.get(1)? {
        0x01 => vec![read(Table::Coil, 2)?],
        0x02 => vec![read(Table::Discrete, 2)?],
        0x03 => vec![read(Table::Holding, 2)?],
        0x04 => vec![read(Table::Input, 2)?],
        0x05 => vec![write(Table::Coil, 2, Some(vec![u16::from(word(4)? == 0xFF00)]), 1)?],
        0x06 => vec![write(Table::Holding, 2, Some(vec![word(4)?]), 1)?],
        0x0F => vec![write(Table::Coil, 2, unpacked(Table::Coil, message.get(7..)?, word(4)?), word(4)?)?],
        0x10 => {
            let words = unpacked(Table::Holding, message.get(7..)?, word(4)?.checked_mul(address_words)?);
            vec![write(Table::Holding, 2, words, word(4)?)?]
        }
        // What comes of a mask hangs on what the register holds by then.
        0x16 => vec![write(Table::Holding, 2, None, 1)?],
        0x17 => {
            let written = unpacked(Table::Holding, message.get(11..)?, word(8)?);
            vec![write(Table::Holding, 6, written, word(8)?)?, read(Table::Holding, 2)?]
        }
        _ => Vec::new(),
    })
}

/// The words of registers, or the bits of coils; `None` if there are fewer.
fn unpacked(table: Table, bytes: &[u8], count: u16) -> Option<Vec<u16>> {
    let count = usize::from(count);
    let words: Vec<u16> = if table.is_bits() {
        bytes.iter().flat_map(|byte| (0..8).map(move |bit| u16::from(byte >> bit & 1))).take(count).collect()
    } else {
        bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).take(count).collect()
    };
    (words.len() == count).then_some(words)
}

fn lines(snapshot: &Snapshot, device: &DeviceDef, span: &Span) -> Vec<String> {
    let mut found: Vec<&TagDef> = span.tags(&snapshot.def, device.id).collect();
    if found.is_empty() {
        let place = span.table.modicon(span.address);
        return match snapshot.def.tags_of(device.id).all(|tag| tag.calculation.is_some()) {
            true => Vec::new(),
            false => vec![t!("{device} has no known tag at {place}", device = device.name, place)],
        };
    }
    let left_out = found.len().saturating_sub(NAMED_MAX);
    found.truncate(NAMED_MAX);
    let mut lines: Vec<String> = match (&span.words, span.writes) {
        (Some(_), true) => found.iter().map(|tag| t!("writes {value}", value = valued(snapshot, tag, span))).collect(),
        (Some(_), false) => found.iter().map(|tag| valued(snapshot, tag, span)).collect(),
        (None, writes) => {
            let names = found.iter().map(|tag| tag.name.as_str()).collect::<Vec<_>>().join(", ");
            vec![if writes { t!("writes bits of {names}", names) } else { t!("reads {names}", names) }]
        }
    };
    if 0 < left_out {
        lines.push(t!("and {left_out} more tags", left_out));
    }
    lines
}

/// `TIC-1.SV = 5.0 °C, P-DP is 1`: the value, and what it hangs on.
fn valued(snapshot: &Snapshot, tag: &TagDef, span: &Span) -> String {
    let name = &tag.name;
    let Some(own) = span.words_of(tag.point) else { return t!("part of {name}", name) };
    if let Some(text) = codec::decode_text(tag.point, own) {
        return format!("{name} = {text}");
    }
    let Some(raw) = codec::decode(tag.point, own).filter(|raw| !tag.is_bad(*raw)) else {
        return t!("{name} = no value", name);
    };
    let known = |tag| snapshot.sample(tag).scaling_value();
    let source = tag.decimals.source().map(|source| snapshot.def.tag(source).short.as_str());
    let Some(decimals) = tag.scaling_decimals(known) else {
        let source = source.unwrap_or_default();
        return t!("{name} = {raw} without its decimal point: {source} is not known", name, raw, source);
    };
    let value = scale::to_value(tag, raw, decimals);
    let shown = format!("{} {}", snapshot.format(tag.id, value), snapshot.unit(tag.id));
    let mut text = format!("{name} = {}", shown.trim_end());
    if let Some(source) = source {
        let decimals = if tag.decimals.power_source().is_some() { -decimals } else { decimals };
        text += &t!(", {source} is {decimals}", source, decimals);
    } else if tag.enum_labels.is_empty() && tag.unit.is_empty() && !tag.label.is_empty() {
        text += &format!(", {}", tag.label);
    }
    if span.writes {
        text += &warning(snapshot, tag, value);
    }
    text
}

/// What is unusual about a write: a tag that is only read, a value out of its limits.
fn warning(snapshot: &Snapshot, tag: &TagDef, value: Exact) -> String {
    if !tag.writable() {
        return t!(" (the plant file only reads it)").to_owned();
    }
    match snapshot.bounds(tag.id) {
        Some((min, max)) if !scale::is_inside(Some(min), Some(max), value) => {
            let [min, max] = [min, max].map(|limit| snapshot.format(tag.id, limit));
            t!(" (outside {min} … {max})", min, max)
        }
        Some(_) | None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use std::{path::Path, time::Duration};

    use jiff::Timestamp;

    use super::*;
    use crate::{
        plant::{
            Plant,
            event::Event,
            tag::{ByteOrder, DataType},
        },
        profile::{self, Search},
    };

    const L1: LineId = LineId(0);

    /// The tank of the thesis, whose controller has said this many decimals.
    fn tank(decimals: Option<f64>) -> Snapshot {
        let def = profile::load(Path::new("tank"), &Search::shipped()).expect("a shipped plant");
        let at = Timestamp::UNIX_EPOCH;
        let tag = |name: &str| def.tag_named(name).expect("a tag of the tank");
        let known = decimals.map(|decimals| {
            [("TIC-1.P-DP", decimals), ("TIC-1.P-F", 0.0), ("TIC-1.SV-L", 0.0), ("TIC-1.SV-H", 1200.0)]
        });
        let values = known.iter().flatten().map(|(name, raw)| (tag(name), (*raw).into())).collect();
        let device = def.devices[0].id;
        let mut plant = Plant::new(def.clone(), at, 1.0);
        let response_time = Duration::from_millis(12);
        plant.on_event(Event::Read { at, device, values, texts: Vec::new(), response_time, exchange: None });
        plant.snapshot()
    }

    #[test]
    fn the_recorded_exchanges_say_what_they_write() {
        let check = |decimals, message: &[u8], expect: &[&str]| {
            assert_eq!(of_request(&tank(decimals), L1, message), expect, "{message:02X?}, P-DP {decimals:?}");
        };
        let sv = &[1, 6, 0x03, 0xEA, 0x00, 0x32];
        check(Some(1.0), sv, &["writes TIC-1.SV = 5.0 °C, P-DP is 1"]);
        check(Some(0.0), sv, &["writes TIC-1.SV = 50 °C, P-DP is 0"]);
        check(None, sv, &["writes TIC-1.SV = 50 without its decimal point: P-DP is not known"]);
        let all_outputs = &[2, 6, 0x41, 0x40, 0xFF, 0xFF];
        let vy0 = "writes PLC-1.VY0 = 65535, outputs Y0 to Y17 (the plant file only reads it)";
        check(None, all_outputs, &[vy0]);
    }

    #[test]
    fn each_function_says_what_it_reads_or_writes() {
        let check = |message: &[u8], expect: &[&str]| {
            assert_eq!(of_request(&tank(Some(1.0)), L1, message), expect, "{message:02X?}");
        };
        check(&[2, 5, 0x0C, 0x01, 0xFF, 0x00], &["writes PLC-1.AUTO = AUTO"]);
        check(&[2, 15, 0x0C, 0x00, 0, 2, 1, 0b01], &["writes PLC-1.RUN = RUN", "writes PLC-1.AUTO = MANUAL"]);
        let block = &[1, 16, 0x03, 0xEA, 0, 2, 4, 0x02, 0xBC, 0, 1];
        check(block, &["writes TIC-1.SV = 70.0 °C, P-DP is 1", "writes TIC-1.STBY = STANDBY"]);
        check(&[1, 22, 0x03, 0xEA, 0, 0, 0, 1], &["writes bits of TIC-1.SV"]);
        check(&[1, 3, 0x03, 0xEA, 0, 2], &["reads TIC-1.SV, TIC-1.STBY"]);
        check(&[1, 6, 0x03, 0xEA, 0x05, 0xDC], &["writes TIC-1.SV = 150.0 °C, P-DP is 1 (outside 0.0 … 120.0)"]);
        check(&[1, 6, 0x07, 0xD0, 0, 1], &["TIC-1 has no known tag at 42001"]);
        check(&[9, 6, 0x03, 0xEA, 0, 1], &[]);
        check(&[1, 8, 0, 0, 0, 0], &[]);
        check(&[1, 16, 0x03], &[]);
        check(&[], &[]);
        let many = of_request(&tank(None), L1, &[1, 3, 0x03, 0xE8, 0, 60]);
        assert!(many[0].starts_with("reads ") && many[1].starts_with("and "), "{many:?}");
        // All devices of a serial line obey a broadcast.
        let all = of_request(&tank(Some(1.0)), L1, &[0, 6, 0x03, 0xEA, 0, 50]);
        assert_eq!(all, ["writes TIC-1.SV = 5.0 °C, P-DP is 1", "PLC-1 has no known tag at 41003"]);
    }

    #[test]
    fn the_states_of_function_07_have_the_names_of_the_plant_file() {
        let states = |status| of_answer(&tank(None), L1, &[2, 7], &[2, 7, status]);
        assert_eq!(states(0b0000_0011), ["PLC-1: RUN, AUTO"]);
        assert_eq!(states(0b1000_0000), ["PLC-1: SEQ.FAULT"]);
        assert_eq!(states(0), ["PLC-1: no state is on"]);
        assert_eq!(of_answer(&tank(None), L1, &[1, 7], &[1, 7, 255]), [""; 0], "the controller has no such states");
    }

    #[test]
    fn an_answer_says_what_was_read() {
        let answer = |answer: &[u8]| of_answer(&tank(Some(1.0)), L1, &[1, 3, 0x03, 0xEA, 0, 2], answer);
        let read = ["TIC-1.SV = 5.0 °C, P-DP is 1", "TIC-1.STBY = STANDBY"];
        assert_eq!(answer(&[1, 3, 4, 0, 50, 0, 1]), read);
        assert_eq!(answer(&[1, 0x83, 2]), [""; 0], "a refusal holds nothing");
        assert_eq!(answer(&[1, 3, 2, 0, 50]), ["reads TIC-1.SV, TIC-1.STBY"], "a short answer holds no values");
    }

    #[test]
    fn of_addresses_that_hold_32_bits_each_has_its_own_two_words() {
        let words = Some(vec![1, 2, 3, 4, 5, 6]);
        let span = Span { table: Table::Holding, address: 100, count: 3, words, address_words: 2, writes: false };
        let point = |address, kind| Point { table: Table::Holding, address, kind, order: ByteOrder::Abcd, field: None };
        assert_eq!(span.words_of(point(101, DataType::EnronU32)), Some(&[3, 4][..]));
        assert_eq!(span.words_of(point(103, DataType::EnronU32)), None);
        assert_eq!(span.words_of(point(101, DataType::U32)), None, "it would be two addresses");
    }
}
