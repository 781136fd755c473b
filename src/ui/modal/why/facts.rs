//! What there is to say about a value, row by row, the most urgent first.

use std::time::Duration;

use ratatui::style::Style;

use super::{Row, bytes};
use crate::{
    bus::{
        evidence::{self, Found},
        explain::{self, Direction, Explained},
    },
    plant::{
        def::{DeviceDef, LineDef, TagId},
        event::{Fault, LineState},
        sample::{Cause, Quality},
        scale,
        snapshot::DeviceState,
        tag::{Access, Decimals, Kind, Order, Poll, TagDef},
        traffic::Exchange,
    },
    ui::{
        Cx,
        modal::faceplate::device_words,
        widgets::{
            text::{age, between, clock, running},
            value,
        },
    },
};

/// All rows about a tag.
pub(super) fn rows(cx: &Cx, tag: TagId, room: u16) -> Vec<Row> {
    let def = cx.def().tag(tag);
    let device = cx.def().device(def.device);
    let exchange = cx.snapshot.evidence[tag.index()].as_deref();
    let found = exchange.and_then(|exchange| evidence::find(def.point, exchange));
    let mut rows = value_rows(cx, def, exchange, found.as_ref());
    rows.push(row("number", number(cx, def, exchange, found.as_ref()), cx.theme.normal()));
    rows.push(row("where", place(cx, def, device), cx.theme.normal()));
    rows.push(row("", point(def), cx.theme.normal()));
    let told = exchange.map(|exchange| exchange_rows(cx, def, exchange, found.as_ref(), room, &mut rows));
    if exchange.is_none() {
        rows.push(row("asked", never_asked(cx, def).to_owned(), cx.theme.normal()));
    }
    rows.extend(device_rows(cx, def, device, exchange));
    rows.extend(poll_rows(cx, def));
    if let (Some(told), Some(exchange)) = (told, exchange) {
        rows.extend(every_byte(cx, exchange, &told, found.as_ref(), room));
    }
    rows
}

fn row(label: &'static str, text: impl Into<String>, style: Style) -> Row {
    Row { label, text: text.into(), style, wraps: true }
}

/// The value with its quality and age, the reason for a doubt, and what to do about it.
fn value_rows(cx: &Cx, def: &TagDef, exchange: Option<&Exchange>, found: Option<&Found>) -> Vec<Row> {
    let sample = cx.snapshot.sample(def.id);
    let shown = value::show(cx, def.id);
    let at = clock(sample.at, &cx.def().time_zone);
    let quality = match sample.quality {
        _ if def.access == Access::Write => "write only: nobody can read it".to_owned(),
        Quality::Good => format!("good, read {} ago at {at}", age(cx.age(def.id))),
        Quality::Uncertain(cause) => {
            format!("uncertain: {}; read {} ago at {at}", cause.words(), age(cx.age(def.id)))
        }
        Quality::Bad(cause) => format!("bad: {}, since {at}", cause.words()),
    };
    let mut rows = vec![row("value", format!("{}  {quality}", shown.with_unit()), shown.style)];
    let Some(cause) = sample.quality.cause().filter(|_| def.access != Access::Write) else { return rows };
    if let Some(because) = because(cx, def, cause, exchange, found) {
        rows.push(row("because", because, cx.theme.normal()));
    }
    if let Some(advice) = advice(cx, def, cause, exchange) {
        rows.push(row("to do", advice, cx.theme.strong()));
    }
    rows
}

/// What the cause does not say by itself: the other tag, the number that means "no value".
fn because(cx: &Cx, def: &TagDef, cause: Cause, exchange: Option<&Exchange>, found: Option<&Found>) -> Option<String> {
    let line = cx.def().device(def.device).line;
    let words_of = |tag: TagId| format!("{} is {}", cx.def().tag(tag).name, value::show(cx, tag).whole());
    match cause {
        Cause::NotConnected => line_words(cx, &cx.snapshot.line(line).state),
        Cause::SensorFault => {
            let raw = found.and_then(|found| found.raw);
            if let Some(raw) = raw.filter(|raw| def.bad_if.iter().any(|bad| *bad as f64 == *raw)) {
                return Some(format!("raw {raw} means \"no value\" for this device"));
            }
            match (exchange.and_then(|exchange| exchange.outcome.err()), def.quality_from) {
                (Some(Fault::NotANumber), _) => Some(words(Fault::NotANumber)),
                (_, Some((word, mask))) => Some(format!("{} (bits 0x{mask:X} mean a fault)", words_of(word))),
                (_, None) => None,
            }
        }
        Cause::Unscaled => match def.decimals {
            Decimals::From(from) => Some(format!("its decimals come from another value: {}", words_of(from))),
            Decimals::Fixed(_) => None,
        },
        Cause::Stale => match def.poll {
            Poll::Every(period) => Some(format!("read every {}, and not for longer than that", span(period))),
            Poll::Once | Poll::Never => Some("it is not read by itself".to_owned()),
        },
        // The verdict on the last answer says it all.
        Cause::Corrupt | Cause::Exception | Cause::Timeout | Cause::DeviceDown => None,
        Cause::NotRead | Cause::OutOfRange | Cause::StationOff => None,
    }
}

/// One sentence: what a technician does.
fn advice(cx: &Cx, def: &TagDef, cause: Cause, exchange: Option<&Exchange>) -> Option<String> {
    let device = cx.def().device(def.device);
    let fault = exchange.and_then(|exchange| exchange.outcome.err());
    let last = cx.snapshot.device(device.id).last_fault.map(|(_, fault)| fault);
    let of = |fault: Fault| Some(evidence::advice(fault).to_owned());
    match cause {
        Cause::NotConnected => match cx.snapshot.line(device.line).state {
            LineState::Disconnected => Some("connect the line again: tab 4, L".to_owned()),
            LineState::Testing => Some("wait for the end of the test, or stop it".to_owned()),
            LineState::Waiting { .. } | LineState::Connecting | LineState::Connected => of(Fault::NotConnected),
        },
        Cause::Timeout | Cause::DeviceDown => of(fault.or(last).unwrap_or(Fault::Timeout)),
        Cause::Corrupt => of(fault.unwrap_or(Fault::Crc { got: 0, computed: 0 })),
        Cause::Exception => fault.or(last).and_then(of),
        Cause::SensorFault if fault == Some(Fault::NotANumber) => of(Fault::NotANumber),
        Cause::SensorFault => Some("check the sensor, its wires and the input range of the device".to_owned()),
        Cause::Unscaled => Some("make the other value good first; w on it says why it is not".to_owned()),
        Cause::Stale => match def.poll {
            Poll::Every(_) => Some("the line may be overloaded: see missed reads below, poll slower".to_owned()),
            Poll::Once | Poll::Never => Some("read it now: tab 4, u".to_owned()),
        },
        Cause::NotRead => match def.poll {
            Poll::Every(_) | Poll::Once => None,
            Poll::Never => Some("read it now: tab 4, u".to_owned()),
        },
        Cause::OutOfRange => Some("compare the value with the range of the device".to_owned()),
        Cause::StationOff => None,
    }
}

/// `raw 724 (02D4) × 10^-1 = 72.4 °C, decimals from TIC-1.DP`.
fn number(cx: &Cx, def: &TagDef, exchange: Option<&Exchange>, found: Option<&Found>) -> String {
    let scaling = match def.decimals {
        Decimals::From(_) => cx.snapshot.decimals[def.id.index()],
        Decimals::Fixed(_) => 0,
    };
    let from_answer = found.and_then(|found| found.raw);
    // Without an answer that holds it: the number behind the value that is still shown.
    let shown = cx.snapshot.sample(def.id).value.and_then(|value| scale::to_raw(def, value, scaling));
    let hex = found.map(|found| found.words.iter().map(|word| format!(" {word:04X}")).collect::<String>());
    let Some(raw) = from_answer.or(shown) else {
        return match hex {
            Some(hex) => format!("none:{hex} is no {}", kind(def.point.kind)),
            None => "none".to_owned(),
        };
    };
    let hex = hex.filter(|_| !def.point.table.is_bits()).map(|hex| format!(" ({})", hex.trim_start()));
    let mut words = format!("raw {raw}{}", hex.unwrap_or_default());
    if 0 < scaling {
        words += &format!(" × 10^-{scaling}");
    }
    if def.scale != 1.0 {
        words += &format!(" × {}", def.scale);
    }
    if def.offset != 0.0 {
        words += &format!(" {} {}", if def.offset < 0.0 { '−' } else { '+' }, def.offset.abs());
    }
    let result = cx.snapshot.format(def.id, scale::to_value(def, raw, scaling));
    words += &format!(" = {result} {}", cx.snapshot.unit(def.id));
    let mut words = words.trim_end().to_owned();
    match def.decimals {
        Decimals::From(from) => words += &format!(", decimals from {}", cx.def().tag(from).name),
        Decimals::Fixed(_) if def.scale == 1.0 && def.offset == 0.0 && def.labels.is_empty() => words += ", not scaled",
        Decimals::Fixed(_) => {}
    }
    if from_answer.is_none() && exchange.is_some() {
        words += ", earlier answer";
    }
    words
}

fn place(cx: &Cx, def: &TagDef, device: &DeviceDef) -> String {
    let line = settings(cx, def);
    format!("{} {} unit {} on {}, {}", device.name, device.model, device.unit, line.name, line.transport)
}

/// Function, both numbers of the address, type, word order.
fn point(def: &TagDef) -> String {
    let point = def.point;
    let function = explain::function_words(point.table.read_fc());
    let what = match (point.table.is_bits(), point.field) {
        (true, _) => "one bit".to_owned(),
        (false, Some((low, 1))) => format!("bit {low} of a word"),
        (false, Some((low, bits))) => format!("bits {low}–{} of a word", low + bits - 1),
        (false, None) => kind(point.kind).to_owned(),
    };
    let order = match (point.table.is_bits(), point.order) {
        (true, _) => "",
        (false, Order::Abcd) if point.kind.words() == 1 => "",
        (false, Order::Abcd) => " ABCD (high word first)",
        (false, Order::Cdab) => " CDAB (low word first)",
        (false, Order::Badc) => " BADC (bytes swapped)",
        (false, Order::Dcba) => " DCBA (little-endian)",
    };
    let address = point.address;
    format!("{function}  {} / 0x{address:04X}  {what}{order}", point.table.modicon(address))
}

/// The word of a type in the profiles.
fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Bool => "bool",
        Kind::I16 => "int16",
        Kind::U16 => "uint16",
        Kind::I32 => "int32",
        Kind::U32 => "uint32",
        Kind::I64 => "int64",
        Kind::U64 => "uint64",
        Kind::F32 => "float32",
        Kind::F64 => "float64",
        Kind::Bcd16 => "bcd16",
        Kind::Bcd32 => "bcd32",
    }
}

/// Request, answer, verdict; gives both frames in words.
fn exchange_rows(
    cx: &Cx,
    def: &TagDef,
    exchange: &Exchange,
    found: Option<&Found>,
    room: u16,
    rows: &mut Vec<Row>,
) -> (Explained, Explained) {
    let theme = cx.theme;
    let framing = exchange.framing;
    let request = explain::explain(&exchange.request, Some(framing), Some(Direction::Request), None);
    let answer =
        explain::explain(&exchange.answer, Some(framing), Some(Direction::Answer), Some(request.message.as_slice()));
    let frame = |bytes: &[u8], marked: Option<&std::ops::Range<usize>>| {
        bytes::telling(bytes::rows(bytes, framing, marked, room.saturating_sub(2)), theme.ellipsis())
    };
    let hex = |label, text: String, style| Row { label, text: text.trim_start().to_owned(), style, wraps: false };
    for (n, text) in frame(&exchange.request, None).into_iter().enumerate() {
        rows.push(hex(if n == 0 { "asked" } else { "" }, text, theme.normal()));
    }
    let at = clock(exchange.at, &cx.def().time_zone);
    rows.push(row("", format!("{}, at {at}", request.summary), theme.dim()));
    if exchange.answer.is_empty() {
        let timeout = settings(cx, def).timeout;
        rows.push(row("answer", format!("none within {}", span(timeout)), theme.trouble()));
    } else {
        for (n, text) in frame(&exchange.answer, found.map(|found| &found.range)).into_iter().enumerate() {
            rows.push(hex(if n == 0 { "answer" } else { "" }, text, theme.normal()));
        }
        rows.push(Row { wraps: false, ..row("", answer.summary.clone(), theme.dim()) });
    }
    let reply = exchange.reply.map(|reply| format!(", after {}", span(reply))).unwrap_or_default();
    let tries = if 1 < exchange.tries { ", second try: the first answer was spoiled" } else { ", first try" };
    let (verdict, style) = match exchange.outcome {
        Ok(()) => ("ok".to_owned(), theme.normal()),
        Err(fault) => (words(fault), theme.trouble()),
    };
    rows.push(row("verdict", format!("{verdict}{reply}{tries}"), style));
    (request, answer)
}

/// Every byte of both frames, one meaning a row: for who scrolls or has a large screen.
fn every_byte(
    cx: &Cx,
    exchange: &Exchange,
    (request, answer): &(Explained, Explained),
    found: Option<&Found>,
    room: u16,
) -> Vec<Row> {
    let mut rows = Vec::new();
    let frames = [("asked", request, None), ("answer", answer, found.map(|found| &found.range))];
    for (label, told, marked) in
        frames.into_iter().filter(|(label, ..)| *label == "asked" || !exchange.answer.is_empty())
    {
        let heading = format!("{label}, byte by byte");
        rows.push(Row { label: "", text: heading, style: cx.theme.strong(), wraps: false });
        for field in &told.fields {
            let own = marked.is_some_and(|marked| field.range.start < marked.end && marked.start < field.range.end);
            let mark = if own { "▸" } else { " " };
            let text = format!("{mark} {:<12} {:<16} {}", field.hex, field.name, field.words);
            let style = if own { cx.theme.strong() } else { cx.theme.normal() };
            // Long fields (a text) are cut: the frame itself stands above.
            let text = text.chars().take(usize::from(room)).collect();
            rows.push(Row { label: "", text, style, wraps: false });
        }
    }
    rows
}

fn never_asked(cx: &Cx, def: &TagDef) -> &'static str {
    match (def.access, def.poll, &cx.snapshot.line(cx.def().device(def.device).line).state) {
        (Access::Write, ..) => "never: it can only be written",
        (_, Poll::Never, _) => "never: it is not read by itself",
        (_, _, LineState::Connected) => "not yet: its turn has not come",
        (_, _, LineState::Connecting | LineState::Waiting { .. } | LineState::Disconnected | LineState::Testing) => {
            "not yet: nothing could be sent"
        }
    }
}

/// How the device stands, how fast it answers, what went wrong last; and its line, if that is not well.
fn device_rows(cx: &Cx, def: &TagDef, device: &DeviceDef, exchange: Option<&Exchange>) -> Vec<Row> {
    let theme = cx.theme;
    let status = cx.snapshot.device(device.id);
    let line = cx.snapshot.line(device.line);
    let tally = line.report.as_ref().and_then(|report| report.device(device.id));
    let mut text = device_words(cx, device.id);
    if let Some(p99) = tally.and_then(|tally| tally.reply.p99()) {
        text += &format!(", 99 % within {}", span(p99));
    }
    if let Some((failed, of)) = tally.map(|tally| tally.recent()).filter(|(failed, _)| 0 < *failed) {
        text += &format!(", {failed} of the last {of} failed");
    }
    let well = matches!(status.state, DeviceState::Answering | DeviceState::Unknown);
    let mut rows = vec![row("device", text, if well { theme.normal() } else { theme.trouble() })];
    rows.extend(status.diagnosis.map(|reason| {
        let signal = reason.signal();
        row("", format!("{} {}: {reason}", signal.letter(), signal.word()), theme.trouble())
    }));
    // What stands above already is not said again.
    let told = cx.snapshot.sample(def.id).quality.cause() == Some(Cause::NotConnected);
    rows.extend(line_words(cx, &line.state).filter(|_| !told).map(|words| row("line", words, theme.trouble())));
    let verdict = exchange.and_then(|exchange| exchange.outcome.err());
    if let Some((at, fault)) = status.last_fault.filter(|(_, fault)| Some(*fault) != verdict) {
        let ago = age(between(at, cx.now));
        rows.push(row("", format!("last fault {ago} ago: {}", words(fault)), theme.dim()));
    }
    rows
}

/// When it is read, with whom, and whether that works out.
fn poll_rows(cx: &Cx, def: &TagDef) -> Vec<Row> {
    let line = cx.snapshot.line(cx.def().device(def.device).line);
    let Some(poll) = line.report.as_ref().and_then(|report| report.poll_of(def.id)) else { return Vec::new() };
    let period = match poll.poll {
        Poll::Every(period) => format!("every {}", span(period)),
        Poll::Once => "once, and on refresh".to_owned(),
        Poll::Never => "never by itself".to_owned(),
    };
    let next = poll.next.map(|next| match between(cx.now, next) {
        Duration::ZERO => ", due now".to_owned(),
        wait => format!(", next in {}", span(wait)),
    });
    let mut text = format!("{period}{}, {} missed", next.unwrap_or_default(), poll.tally.missed);
    if let Some(p99) = poll.tally.jitter.p99() {
        text += &format!(", jitter {}", span(p99));
    }
    text += &format!(", costs {}", span(poll.cost));
    vec![row("poll", text, if poll.tally.missed == 0 { cx.theme.normal() } else { cx.theme.trouble() })]
}

/// What is the matter with a line; `None` while it is connected.
fn line_words(cx: &Cx, state: &LineState) -> Option<String> {
    match state {
        LineState::Connected => None,
        LineState::Connecting => Some("being connected".to_owned()),
        LineState::Disconnected => Some("disconnected by an operator".to_owned()),
        LineState::Testing => Some("a test has it for itself".to_owned()),
        LineState::Waiting { why, retry_at } => {
            Some(format!("not connected: {why}; tried again in {}", running(between(cx.now, *retry_at))))
        }
    }
}

fn settings<'a>(cx: &Cx<'a>, def: &TagDef) -> &'a LineDef {
    let line = cx.def().device(def.device).line;
    cx.snapshot.line(line).report.as_ref().map_or(cx.def().line(line), |report| &report.settings)
}

fn words(fault: Fault) -> String {
    fault.to_string()
}

/// `0.4 ms`, `12 ms`, `1.5 s`, `10 min`.
fn span(span: Duration) -> String {
    let ms = span.as_secs_f64() * 1e3;
    match ms {
        ..10.0 => format!("{} ms", (ms * 10.0).round() / 10.0),
        10.0..1_000.0 => format!("{ms:.0} ms"),
        1_000.0..100_000.0 => format!("{} s", (ms / 100.0).round() / 10.0),
        _ => format!("{:.0} min", ms / 60_000.0),
    }
}
