//! How the registers are drawn: a row each, and the selected one below in every meaning.

use super::{
    Registers,
    advice::advice,
    cells::Cell,
    compare, detail,
    layout::{Layout, layout, name_column},
    watch,
};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::interpret,
    plant::{
        address::{AddressBase, TABLES},
        diagnostics::{Diagnostic, DiagnosticState},
        line_state::LineState,
        tag::{ByteOrder, DataType},
    },
    register_map::named::Named,
};

/// Rows of the heading: tables, state, names of the columns.
const HEAD: u16 = 3;
/// Rows of the selected register.
const DETAIL: u16 = 5;
/// With fewer rows than this the registers have all of them.
const DETAIL_FROM: u16 = 14;
/// A change is marked for so long.
const FRESH: SignedDuration = SignedDuration::from_secs(3);

/// Rows of the watch list: at most half of what the registers would have.
fn watched(tab: &Registers, height: u16) -> u16 {
    tab.watch.height().min(height.saturating_sub(HEAD + DETAIL) / 2)
}

/// Registers on a screen of so many rows.
pub fn rows(tab: &Registers, height: u16) -> usize {
    let below = if DETAIL_FROM <= height { DETAIL + watched(tab, height) } else { 0 };
    usize::from(height.saturating_sub(HEAD + below)).max(1)
}

pub fn view(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    heading(tab, cx, canvas);
    let height = canvas.height();
    let room = rows(tab, height);
    let advice = advice(tab, cx);
    if advice.is_empty() {
        columns(tab, cx, canvas);
        for (y, address) in (HEAD..).zip(tab.rows(cx).map(to_u16)) {
            row(tab, cx, canvas, y, address);
        }
    } else {
        canvas.text(2, HEAD, t!("In the order of likelihood:"), cx.theme.normal());
        for (n, line) in (1..).zip(advice.iter().take(room.saturating_sub(1))) {
            canvas.text(4, HEAD + n, &fit_words(line, canvas.width().saturating_sub(5)), cx.theme.normal());
        }
    }
    if DETAIL_FROM <= height {
        let (width, y) = (canvas.width(), HEAD + to_u16(room));
        detail::view(tab, cx, &mut canvas.part(0, y, width, DETAIL));
        watch::view(tab, cx, &mut canvas.part(0, y + DETAIL, width, watched(tab, height)));
    }
}

/// Tables and byte order; then how reading goes.
fn heading(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let mut x = 1;
    for table in TABLES {
        let (word, shown) = (translate(table.word()), table == tab.table);
        let text = if shown { format!("‹{word}›") } else { format!(" {word} ") };
        x = canvas.text(x, 0, &text, if shown { theme.focus() } else { theme.dim() });
    }
    x += 2;
    for order in ByteOrder::ALL {
        let shown = order == tab.order;
        let text = if shown { format!("‹{}›", order.word()) } else { format!(" {} ", order.word()) };
        x = canvas.text(x, 0, &text, if shown { theme.focus() } else { theme.dim() });
    }
    let end = canvas.width().saturating_sub(1);
    match tab.writing.enabled {
        false => canvas.text_right(end, 0, t!("READ ONLY"), theme.dim()),
        true => canvas.text_right(end, 0, t!("WRITING ENABLED"), theme.strong()),
    }
    let (words, well) = state(tab, cx);
    let room = canvas.width().saturating_sub(2);
    canvas.text(1, 1, &fit_words(&words, room), if well { theme.normal() } else { theme.trouble() });
}

/// `unit 1   every 1 s   6.6 ms, 2 requests   214 reads`, or what is wrong; and whether all is well.
pub fn state(tab: &Registers, cx: &ViewContext) -> (String, bool) {
    let unit = tab.unit;
    let line = cx.snapshot.lines.get(tab.line.index());
    let waiting = match line.map(|line| &line.state) {
        Some(LineState::Connected | LineState::NoTraffic) => None,
        Some(LineState::Waiting { why, .. }) => Some(t!("not connected: {why}", why)),
        Some(LineState::Testing) => Some(t!("the line is under test").to_owned()),
        Some(LineState::Connecting | LineState::Disconnected) | None => Some(t!("not connected").to_owned()),
    };
    if let Some(why) = waiting.or_else(|| tab.trouble.clone()) {
        return (t!("unit {unit}   {why}", unit, why), false);
    }
    if tab.paused {
        return (t!("unit {unit}   PAUSED, space resumes", unit), false);
    }
    let Some(last) = &tab.last else { return (t!("unit {unit}   reading", unit), true) };
    let faults = last.parts.iter().filter_map(|part| part.words.as_ref().err());
    if last.parts.iter().all(|part| part.words.is_err())
        && let Some(fault) = faults.into_iter().next()
    {
        return (t!("unit {unit}   {fault}", unit, fault), false);
    }
    let every = tab.period.as_secs_f64();
    if let Some(comparison) = &tab.comparison {
        return (compare::summary(tab, cx, comparison) + &t!("   every {every} s", every), true);
    }
    let reply = last.response_time.map_or(String::new(), |reply| format!("{:.1} ms", reply.as_secs_f64() * 1e3));
    let words = t!(
        "unit {unit}   every {every} s   reply {reply}   requests per read {requests}   reads {reads}",
        unit,
        every,
        reply,
        requests = last.requests,
        reads = tab.reads
    );
    let sweep = line.and_then(|line| line.test.as_ref()).filter(|run| run.state == DiagnosticState::Running);
    if let Some(run) = sweep.filter(|run| matches!(run.diagnostic, Diagnostic::Sweep(_))) {
        return (words + &t!("   map {percent} %", percent = 100 * run.done / run.total.max(1)), true);
    }
    let timeout = cx.def().lines.get(tab.line.index()).map(|line| line.timeout);
    match tab.replies.timeout().filter(|learned| timeout.is_some_and(|timeout| *learned < timeout)) {
        Some(learned) => (words + &t!("   timeout {ms} ms is enough", ms = learned.as_millis()), true),
        None => (words, true),
    }
}

fn columns(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    let (theme, at) = (cx.theme, layout(canvas.width()));
    let base = match tab.base {
        AddressBase::Modicon => t!("Modicon"),
        AddressBase::Zero => t!("from 0"),
        AddressBase::One => t!("from 1"),
    };
    canvas.text(2, 2, &fit(&format!("{base}/{}", t!("wire")), 14), theme.dim());
    if let Some(comparison) = &tab.comparison {
        return compare::columns(tab, cx, comparison, canvas);
    }
    if tab.table.is_bits() {
        canvas.text(17, 2, t!("value"), theme.dim());
        canvas.text(at.age, 2, t!("changed"), theme.dim());
        return;
    }
    canvas.text(17, 2, t!("hex"), theme.dim());
    canvas.text_right(at.unsigned + 6, 2, "uint16", theme.dim());
    canvas.text_right(at.signed + 6, 2, "int16", theme.dim());
    if let Some(bcd) = at.bcd {
        canvas.text_right(bcd + 5, 2, "BCD", theme.dim());
    }
    if let Some(long) = at.long {
        canvas.text_right(long + 12, 2, "uint32", theme.dim());
    }
    canvas.text_right(at.float + 11, 2, &format!("float {}", tab.order.word()), theme.dim());
    let names = (!tab.names.is_empty()).then(|| name_column(&at, canvas.width()));
    if names.is_none_or(|(x, _)| x != at.bits) {
        canvas.text(at.bits, 2, t!("bits"), theme.dim());
    }
    if let Some((x, room)) = names {
        canvas.text(x, 2, &pad(t!("name and value"), room), theme.dim());
    }
    canvas.text(at.text, 2, "Aa", theme.dim());
    canvas.text(at.age, 2, &fit(t!("changed"), canvas.width().saturating_sub(at.age).min(7)), theme.dim());
}

/// An address as the operator wants it, and as it is on the wire.
fn address_text(tab: &Registers, address: u16) -> String {
    let shown = match tab.base {
        AddressBase::Modicon => tab.table.modicon(address),
        AddressBase::Zero => address.to_string(),
        AddressBase::One => (u32::from(address) + 1).to_string(),
    };
    format!("{shown:>6} / {address:04X}")
}

/// Address, hexadecimal and decimal value and time of the selected register.
pub fn copied(tab: &Registers, cx: &ViewContext) -> Vec<String> {
    let cell = tab.cells.get(tab.table, tab.selected);
    let read = cell.and_then(|cell| Some((cell.word?, cell.at)));
    let zone = &cx.def().time_zone;
    let line = |(word, at)| {
        format!("{}\t{word:04X}\t{word}\t{}", address_text(tab, tab.selected).trim(), text::stamp(at, zone))
    };
    read.map(line).into_iter().collect()
}

fn row(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas, y: u16, address: u16) {
    let (theme, at) = (cx.theme, layout(canvas.width()));
    let selected = address == tab.selected;
    let cell = tab.cells.get(tab.table, address);
    let fresh = cell.is_some_and(|cell| is_fresh(cx, cell));
    let mark = match (selected, fresh) {
        (true, _) => ">",
        (false, true) => "*",
        (false, false) => " ",
    };
    canvas.text(0, y, mark, theme.strong());
    let place = if selected { theme.focus() } else { theme.dim() };
    canvas.text(1, y, &address_text(tab, address), place);
    if let Some(comparison) = &tab.comparison {
        return compare::row(tab, cx, comparison, canvas, (y, address));
    }
    let Some((cell, word)) = cell.and_then(|cell| cell.word.map(|word| (cell, word))) else {
        let why = match cell {
            Some(cell) if cell.is_hole() => t!("----   no such address").to_owned(),
            Some(Cell { fault: Some(fault), .. }) => format!("----   {fault}"),
            Some(_) | None => "----".to_owned(),
        };
        canvas.text(17, y, &why, theme.dim());
        return;
    };
    let old = is_old(tab, cx, cell);
    let style = match (old, fresh) {
        (true, _) => theme.trouble(),
        (false, true) => theme.strong(),
        (false, false) => theme.normal(),
    };
    let doubt = if old { "?" } else { "" };
    if tab.table.is_bits() {
        canvas.text(17, y, &format!("{word}{doubt}"), style);
    } else {
        numbers(tab, canvas, y, address, (&format!("{word:04X}{doubt}"), word), style, &at);
    }
    let age = |since: Timestamp| text::age(elapsed(since, cx.now));
    let since = if old { Some(cell.at) } else { cell.changed };
    let words = match (since, fresh && !old) {
        (Some(_), true) => t!("now").to_owned(),
        (Some(since), false) => age(since),
        (None, _) => String::new(),
    };
    canvas.text(at.age, y, &fit(&words, 6), style);
    if let Some(named) = tab.names.get(tab.table, address) {
        let (value, _) = named_text(tab, cx, named);
        let (x, room) = name_column(&at, canvas.width());
        canvas.text(x, y, &pad(&format!("{}  {value}", named.name), room), style);
    } else if let Some((kind, order)) = tab.cells.marked(tab.table, address)
        && at.hint < canvas.width()
    {
        let order = order.word();
        let words = match kind {
            DataType::F32 => t!("likely float {order}", order),
            _ => t!("likely counter {order}", order),
        };
        canvas.text(at.hint, y, &words, theme.dim());
    }
}

fn numbers(
    tab: &Registers,
    canvas: &mut Canvas,
    y: u16,
    address: u16,
    (hex, word): (&str, u16),
    style: Style,
    at: &Layout,
) {
    let words = tab.cells.words(tab.table, address, 2);
    canvas.text(17, y, hex, style);
    canvas.text_right(at.unsigned + 6, y, &word.to_string(), style);
    canvas.text_right(at.signed + 6, y, &word.cast_signed().to_string(), style);
    if let Some(x) = at.bcd {
        let bcd = interpret::number(DataType::Bcd16, tab.order, &[word]).map(|value| interpret::short(value, 4));
        canvas.text_right(x + 5, y, bcd.as_deref().unwrap_or("–"), style);
    }
    let long = interpret::number(DataType::U32, tab.order, &words).map(|value| interpret::short(value, 11));
    if let Some(x) = at.long {
        canvas.text_right(x + 12, y, long.as_deref().unwrap_or("–"), style);
    }
    let float = interpret::float(tab.order, &words, 10);
    canvas.text_right(at.float + 11, y, float.as_deref().unwrap_or("–"), style);
    canvas.text(at.bits, y, &bits(word), style);
    canvas.text(at.text, y, &interpret::text(&[word]), style);
}

fn bits(word: u16) -> String {
    [word >> 12, word >> 8 & 15, word >> 4 & 15, word & 15].map(|four| format!("{four:04b}")).join(" ")
}

/// Does the unit perhaps hold something else by now? Nothing came, or for too long.
pub fn is_old(tab: &Registers, cx: &ViewContext, cell: &Cell) -> bool {
    cell.fault.is_some() || is_past(tab, cx, cell.at)
}

/// Is a moment so long ago that what was read then may be something else by now?
pub fn is_past(tab: &Registers, cx: &ViewContext, at: Timestamp) -> bool {
    let line = cx.snapshot.lines.get(tab.line.index());
    let connected = line.is_some_and(|line| line.state == LineState::Connected);
    !connected || is_long_ago(tab, cx, at)
}

/// Was it read so long ago that reads are missing since?
pub fn is_long_ago(tab: &Registers, cx: &ViewContext, at: Timestamp) -> bool {
    let limit = tab.period.max(tab.took) * 3 + SignedDuration::from_secs(2);
    limit < cx.now.duration_since(at)
}

/// A named value, and whether it is good: `70.0 °C`, `70.0 °C?` for an old one, `----` for none, `700 raw` where it is not
/// known by which power of ten it is multiplied.
pub fn named_text(tab: &Registers, cx: &ViewContext, named: &Named) -> (String, bool) {
    let words = tab.cells.held(named.table, named.address, named.count());
    let scaled = tab.cells.scaled(named);
    let Some(text) = words.and_then(|words| scaled.text(&words)) else { return ("----".to_owned(), false) };
    if scaled.power_at.is_some() {
        return (text, false);
    }
    let mut cells = (0..named.count()).filter_map(|n| tab.cells.get(named.table, named.address.checked_add(n)?));
    if cells.any(|cell| is_old(tab, cx, cell)) { (format!("{text}?"), false) } else { (text, true) }
}

fn is_fresh(cx: &ViewContext, cell: &Cell) -> bool {
    cell.changed.is_some_and(|changed| cx.now.duration_since(changed) <= FRESH)
}
