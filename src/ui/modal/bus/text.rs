//! A sheet to read: one frame, byte by byte, or the tags of a block; and what a request and its answer say.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame as Screen, layout::Rect};

use super::{
    super::{Next, window},
    Window,
};
use crate::{
    bus::{dissect, frame::hex, meaning, pdu, wide_addresses::WideAddresses},
    plant::{
        def::{DeviceId, LineId},
        number::to_u16,
        tag::Table,
        traffic::{Exchange, Frame},
    },
    t,
    text::{of_plant, translate},
    ui::{
        ViewContext,
        bus_text::{broken, bytes_text, short_ms},
        widgets::{
            list::Motion,
            rows::{self, Spans, plain},
            text::{age, fit, pad, width, wrap},
            value,
        },
    },
};

/// No text has more rows; the view stops at its last one.
const ROWS_MAX: usize = 400;

/// Rows to read, redrawn with every snapshot.
#[derive(Debug, Clone, PartialEq)]
pub struct TextWindow {
    shown: Shown,
    first: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Shown {
    /// One frame, byte by byte.
    Frame {
        line: String,
        frame: Box<Frame>,
        /// Earlier frames, the latest first: one of them is the request.
        before: Vec<Frame>,
    },
    Block {
        line: LineId,
        device: DeviceId,
        table: Table,
        /// From which address on.
        address: u16,
    },
}

impl TextWindow {
    /// From its first row.
    pub fn new(shown: Shown) -> TextWindow {
        TextWindow { shown, first: 0 }
    }

    pub(super) fn on_key(mut self, event: KeyEvent) -> Next {
        if matches!(event.code, KeyCode::Enter | KeyCode::Char('q')) {
            return Next::Close;
        }
        if let Some(motion) = Motion::from_key(event) {
            self.first = motion.to(self.first, ROWS_MAX, 8);
        }
        Window::Text(self).stay()
    }

    pub(super) fn view(&self, cx: &ViewContext, screen: &mut Screen, body: Rect) {
        let room = body.width.saturating_sub(6);
        let (title, rows) = match &self.shown {
            Shown::Frame { line, frame, before } => {
                let dissection = dissect::in_traffic(&wide(cx, line), frame, before.iter());
                let mut rows = frame_rows(cx, frame, &dissection, room);
                rows.extend(
                    means(cx, line, frame, before, &dissection.message)
                        .into_iter()
                        .flat_map(|means| wrap(&means, room))
                        .map(|line| plain(line, cx.theme.strong())),
                );
                (t!("frame {number} on {line}", number = frame.number, line), rows)
            }
            Shown::Block { line, device, table, address } => {
                let (name, modicon) = (&cx.def().device(*device).name, table.modicon(*address));
                let rows = block_rows(cx, *line, *device, *table, *address);
                (t!("tags of {name} from {modicon}", name, modicon), rows)
            }
        };
        let wide = rows.iter().map(|row| row.iter().map(|(text, _)| width(text)).sum::<u16>()).max().unwrap_or(0);
        let mut canvas = window(cx, screen, body, &title, (wide.min(room).max(40) + 1, to_u16(rows.len())));
        rows::draw(cx, &mut canvas, &rows, self.first);
    }
}

/// Which addresses of the line of this name hold 32 bits each.
fn wide(cx: &ViewContext, line: &str) -> WideAddresses {
    let known = cx.def().lines.iter().find(|known| known.name == line);
    known.map_or(WideAddresses::default(), |line| WideAddresses::of(cx.def(), line.id))
}

/// What a frame means for the tags of the plant.
fn means(cx: &ViewContext, line: &str, frame: &Frame, before: &[Frame], message: &[u8]) -> Vec<String> {
    let Some(line) = cx.def().lines.iter().find(|known| known.name == line) else { return Vec::new() };
    match frame.sent {
        true => meaning::of_request(cx.snapshot, line.id, message),
        false => dissect::request_of(&WideAddresses::of(cx.def(), line.id), frame, before.iter())
            .map_or(Vec::new(), |request| meaning::of_answer(cx.snapshot, line.id, &request, message)),
    }
}

/// Every byte of a frame with its name and meaning.
fn frame_rows(cx: &ViewContext, frame: &Frame, dissection: &dissect::Dissection, room: u16) -> Vec<Spans> {
    let theme = cx.theme;
    let at = cx.local(frame.at, "%H:%M:%S%.6f");
    let direction = if frame.sent { t!("TX sent") } else { t!("RX received") };
    let count = frame.bytes.len();
    let mut rows = vec![plain(t!("{at}  {direction}, {count} bytes", at, direction, count), theme.normal())];
    rows.extend(
        broken(&bytes_text(frame.framing, &frame.bytes), room).into_iter().map(|line| plain(line, theme.strong())),
    );
    let good = !frame.result.is_wrong();
    let result = if good { frame.result.to_string() } else { format!("✗ {}", frame.result) };
    rows.push(plain(result, if good { theme.normal() } else { theme.trouble() }));
    if let Some(wrong) = dissection.wrong.as_ref().filter(|wrong| **wrong != frame.result.to_string()) {
        rows.push(plain(format!("! {wrong}"), theme.trouble()));
    }
    rows.extend(dissection_rows(cx, dissection, room));
    rows
}

/// Summary and fields.
pub fn dissection_rows(cx: &ViewContext, dissection: &dissect::Dissection, room: u16) -> Vec<Spans> {
    let theme = cx.theme;
    let mut rows: Vec<Spans> =
        wrap(&dissection.summary, room).into_iter().map(|line| plain(line, theme.strong())).collect();
    let widest = |text: fn(&dissect::Field) -> &str, most| {
        dissection.fields.iter().map(|field| width(text(field))).max().unwrap_or(0).min(most)
    };
    let (bytes, name) = (widest(|field| &field.hex, 17), widest(|field| &field.name, 17));
    for field in &dissection.fields {
        let words = room.saturating_sub(bytes + name + 4).max(12);
        let mut lines = wrap(&field.words, words).into_iter();
        let first = lines.next().unwrap_or_default();
        rows.push(vec![
            (pad(&field.hex, bytes) + "  ", theme.normal()),
            (pad(&field.name, name) + "  ", theme.dim()),
            (first, theme.normal()),
        ]);
        let indent = " ".repeat(usize::from(bytes + name + 4));
        rows.extend(lines.map(|line| plain(indent.clone() + &line, theme.normal())));
    }
    if let Some(also) = &dissection.also {
        rows.extend(wrap(&t!("or: {also}", also), room).into_iter().map(|line| plain(line, theme.dim())));
    }
    rows
}

/// A request and its answer in words.
pub fn exchange_rows(cx: &ViewContext, exchange: &Exchange, room: u16) -> Vec<Spans> {
    let theme = cx.theme;
    let framing = Some(exchange.framing);
    let asked = dissect::message_of(&exchange.request, exchange.framing);
    let request = dissect::dissect(&exchange.request, framing, Some(dissect::Direction::Request), None);
    let row = |direction: &str, bytes: &[u8], words: &str, style| {
        let mut lines = broken(&format!("{direction} {}", bytes_text(exchange.framing, bytes)), room);
        lines.extend(wrap(words, room.saturating_sub(3)).into_iter().map(|line| format!("   {line}")));
        lines.into_iter().map(|line| plain(line, style)).collect::<Vec<Spans>>()
    };
    let mut rows = row("TX", &exchange.request, &request.summary, theme.dim());
    let reply =
        exchange.response_time.map_or(String::new(), |reply| t!("   after {short_ms} ms", short_ms = short_ms(reply)));
    let outcome = exchange.outcome.map_or_else(|fault| format!("✗ {fault}{reply}"), |()| t!("✓ ok{reply}", reply));
    let style = if exchange.outcome.is_ok() { theme.normal() } else { theme.trouble() };
    if !exchange.answer.is_empty() {
        let answer = dissect::dissect(&exchange.answer, framing, Some(dissect::Direction::Answer), asked.as_deref());
        rows.extend(row("RX", &exchange.answer, &answer.summary, style));
    }
    rows.push(plain(outcome, style));
    rows
}

/// The tags of a block as they stand.
fn block_rows(cx: &ViewContext, line: LineId, device: DeviceId, table: Table, address: u16) -> Vec<Spans> {
    let report = cx.snapshot.line(line).report.as_deref();
    let poll = report.and_then(|report| {
        report.polls.iter().find(|poll| (poll.device, poll.table, poll.address) == (device, table, address))
    });
    let Some(poll) = poll else {
        return vec![plain(t!("this block is no longer in the plan"), cx.theme.trouble())];
    };
    let lines: Vec<[String; 5]> = poll
        .tags
        .iter()
        .map(|tag| {
            let def = cx.def().tag(*tag);
            let wire = def.point.address;
            let shown = value::show(cx, *tag);
            let place = format!("{} / 0x{wire:04X}", table.modicon(wire));
            [def.name.clone(), place, shown.with_unit(), fit(&age(cx.age(*tag)), 6), of_plant(&def.label).to_owned()]
        })
        .collect();
    let columns = [
        rows::words(t!("tag"), 0),
        rows::words(t!("address"), 0),
        rows::number(t!("value"), 0),
        rows::number(t!("age"), 2),
        rows::words(t!("what"), 3),
    ];
    let (heading, lines) = rows::table(&columns, &lines, cx.area.width.saturating_sub(8));
    let code = table.read_fc();
    let what = t!(
        "{code} / 0x{code2} {function}: {span} (0x{address}), {count} in one request",
        code,
        code2 = format!("{code:02X}"),
        function = translate(pdu::name(code).unwrap_or_default()),
        span = pdu::span(code, address, poll.count),
        address = format!("{address:04X}"),
        count = poll.count
    );
    let mut rows = vec![plain(what, cx.theme.normal()), plain(heading, cx.theme.dim())];
    rows.extend(poll.tags.iter().zip(lines).map(|(tag, line)| plain(line, value::show(cx, *tag).style)));
    let last = poll.tags.first().and_then(|tag| cx.snapshot.source_frames.get(tag.index())?.clone());
    if let Some(exchange) = last {
        rows.push(Spans::new());
        rows.push(plain(t!("last read: {hex}", hex = hex(&exchange.answer)), cx.theme.dim()));
    }
    rows
}
