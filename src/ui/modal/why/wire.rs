//! Where the value lives, the request and the answer that brought it, in bytes and in words.

use super::{
    bytes,
    facts::{settings, span},
};
use crate::t;
use crate::ui::modal::sheet::Fact;
use crate::{
    bus::{
        dissect::{self, Direction, Dissection},
        source_frame::TagBytes,
    },
    plant::{
        def::DeviceDef,
        line_state::LineState,
        sample::Cause,
        tag::{Access, ByteOrder, Poll, TagDef},
        time::elapsed,
        traffic::Exchange,
    },
    ui::{
        ViewContext,
        widgets::text::{clock, fit, pad, running},
    },
};

/// Request, answer, verdict; gives both frames in words.
pub(super) fn exchange_rows(
    cx: &ViewContext,
    def: &TagDef,
    exchange: &Exchange,
    found: Option<&TagBytes>,
    room: u16,
    rows: &mut Vec<Fact>,
) -> (Dissection, Dissection) {
    let theme = cx.theme;
    let framing = exchange.framing;
    let request = dissect::dissect(&exchange.request, Some(framing), Some(Direction::Request), None);
    let answer =
        dissect::dissect(&exchange.answer, Some(framing), Some(Direction::Answer), Some(request.message.as_slice()));
    let frame = |bytes: &[u8], marked: Option<&std::ops::Range<usize>>| {
        bytes::abridged(bytes::rows(bytes, framing, marked, room.saturating_sub(2)), theme.ellipsis())
    };
    let hex = |label, text: String, style| Fact { label, text: text.trim_start().to_owned(), style, wraps: false };
    for (n, text) in frame(&exchange.request, None).into_iter().enumerate() {
        rows.push(hex(if n == 0 { t!("request") } else { "" }, text, theme.normal()));
    }
    let at = clock(exchange.at, &cx.def().time_zone);
    // What was good then says nothing of now; of an answer that holds no value there is none newer.
    let quality = cx.snapshot.sample(def.id).quality;
    let holds_none = matches!(quality.cause(), Some(Cause::NotPresent | Cause::SensorFault | Cause::Unscaled));
    let old = !quality.is_good() && !holds_none && exchange.outcome.is_ok();
    rows.push(Fact::new("", t!("{summary}, at {at}", summary = request.summary, at), theme.dim()));
    if exchange.answer.is_empty() {
        let line = settings(cx, def);
        // How long the other master waits is not known.
        let none = if line.listens {
            t!("none heard").to_owned()
        } else {
            t!("none within {span}", span = span(line.timeout))
        };
        rows.push(Fact::new(t!("response"), none, theme.trouble()));
    } else {
        for (n, text) in frame(&exchange.answer, found.map(|found| &found.range)).into_iter().enumerate() {
            rows.push(hex(if n == 0 { t!("response") } else { "" }, text, theme.normal()));
        }
        rows.push(Fact { wraps: false, ..Fact::new("", answer.summary.clone(), theme.dim()) });
    }
    let reply = exchange.response_time.map(|reply| t!(", after {span}", span = span(reply))).unwrap_or_default();
    let tries = if settings(cx, def).listens {
        ""
    } else if 1 < exchange.tries {
        t!(", second attempt: the first response was corrupt")
    } else {
        t!(", first attempt")
    };
    let (verdict, style) = match exchange.outcome {
        Ok(()) if old => {
            let ago = running(elapsed(exchange.at, cx.now));
            (t!("ok {ago} ago, no good response since", ago), theme.trouble())
        }
        Ok(()) => (t!("ok").to_owned(), theme.normal()),
        Err(fault) => (fault.to_string(), theme.trouble()),
    };
    rows.push(Fact::new(t!("result"), format!("{verdict}{reply}{tries}"), style));
    (request, answer)
}

/// Every byte of both frames, one meaning a row: for who scrolls or has a large screen.
pub(super) fn every_byte(
    cx: &ViewContext,
    exchange: &Exchange,
    (request, answer): &(Dissection, Dissection),
    found: Option<&TagBytes>,
    room: u16,
) -> Vec<Fact> {
    let mut rows = Vec::new();
    let frames = [(t!("request"), request, None), (t!("response"), answer, found.map(|found| &found.range))];
    for (label, dissection, marked) in frames.into_iter().take(if exchange.answer.is_empty() { 1 } else { 2 }) {
        let heading = t!("{label}, byte by byte", label);
        rows.push(Fact { label: "", text: heading, style: cx.theme.strong(), wraps: false });
        for field in &dissection.fields {
            let own = marked.is_some_and(|marked| field.range.start < marked.end && marked.start < field.range.end);
            let mark = if own { "▸" } else { " " };
            let text = format!("{mark} {} {} {}", pad(&field.hex, 12), pad(&field.name, 16), field.words);
            let style = if own { cx.theme.strong() } else { cx.theme.normal() };
            // Long fields (a text) are cut: the frame itself stands above.
            rows.push(Fact { label: "", text: fit(&text, room), style, wraps: false });
        }
    }
    rows
}

pub(super) fn never_asked(cx: &ViewContext, def: &TagDef) -> &'static str {
    match (def.access, def.poll, &cx.snapshot.line(cx.def().device(def.device).line).state) {
        _ if cx.is_past() => t!("requests are not kept in the history"),
        (Access::Write, ..) => t!("never: write only"),
        (_, Poll::Never, _) => t!("never: read on request only"),
        (_, _, LineState::NoTraffic) => t!("not yet: not heard so far"),
        (_, _, LineState::Connected) if cx.def().listens_to(def.id) => t!("not yet: not heard so far"),
        (_, _, LineState::Connected) => t!("not yet: not polled so far"),
        (_, _, LineState::Connecting | LineState::Waiting { .. } | LineState::Disconnected | LineState::Testing) => {
            t!("not yet: nothing could be sent")
        }
    }
}

pub(super) fn place(cx: &ViewContext, def: &TagDef, device: &DeviceDef) -> String {
    let line = settings(cx, def);
    t!(
        "{name} {model} unit {unit} on {name2}, {transport}",
        name = device.name,
        model = device.model,
        unit = device.unit,
        name2 = line.name,
        transport = line.transport
    )
}

/// Function, both numbers of the address, type, word order.
pub(super) fn point(def: &TagDef) -> String {
    let point = def.point;
    let function = dissect::function_words(point.table.read_fc());
    let what = match (point.table.is_bits(), point.field) {
        (true, _) => t!("one bit").to_owned(),
        (false, Some((low, 1))) => t!("bit {low} of a word", low),
        (false, Some((low, bits))) => t!("bits {low}–{low2} of a word", low, low2 = low + bits - 1),
        (false, None) => point.kind.to_string(),
    };
    let order = match (point.table.is_bits(), point.order) {
        (true, _) => "",
        (false, ByteOrder::Abcd | ByteOrder::Cdab) if point.kind.words() == 1 => "",
        (false, ByteOrder::Abcd) if def.is_text() => t!(" ABCD (high byte first)"),
        (false, ByteOrder::Abcd) => t!(" ABCD (high word first)"),
        (false, ByteOrder::Cdab) => t!(" CDAB (low word first)"),
        (false, ByteOrder::Badc) if def.is_text() => t!(" BADC (low byte first)"),
        (false, ByteOrder::Badc) => t!(" BADC (bytes swapped)"),
        (false, ByteOrder::Dcba) => t!(" DCBA (little-endian)"),
    };
    let address = point.address;
    format!("{function}  {} / 0x{address:04X}  {what}{order}", point.table.modicon(address))
}
