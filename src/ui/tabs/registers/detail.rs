//! The selected register in every meaning.

use super::{Registers, cells::Cell, view::is_old};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::interpret,
    plant::{
        number::{to_f32, to_u32},
        tag::{ByteOrder, DataType},
    },
    ui::widgets::spark,
};

/// The selected register: what it means with those behind it, and what it has held.
pub fn view(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let address = tab.selected;
    let (modicon, table) = (tab.table.modicon(address), translate(tab.table.word()));
    let columns = canvas.width();
    canvas.run(0, 0, columns, '─', theme.dim());
    let x = canvas.text(
        2,
        0,
        &t!(" {modicon}   {table} {address} / 0x{hex} ", modicon, table, address, hex = format!("{address:04X}")),
        theme.strong(),
    );
    let (recognised, right) = (tab.recognition.words(), columns.saturating_sub(2));
    if let Some((words, trouble)) = tab.writing.last(&tab.names) {
        let words = format!(" {} ", fit_words(&words, columns.saturating_sub(40)));
        canvas.text_right(right, 0, &words, if trouble { theme.trouble() } else { theme.normal() });
    } else if !recognised.is_empty() {
        canvas.text_right(right, 0, &fit(&format!(" {recognised} "), right.saturating_sub(x + 1)), theme.strong());
    }
    let Some(cell) = tab.cells.get(tab.table, address) else { return };
    let old = is_old(tab, cx, cell);
    let normal = if old { theme.trouble() } else { theme.normal() };
    let words = tab.cells.words(tab.table, address, 4);
    if !tab.table.is_bits() {
        let number = |kind, order| {
            interpret::number(kind, order, &words).map_or("–".to_owned(), |value| interpret::short(value, 20))
        };
        let plain = t!(
            "BCD {bcd}   64 bits {long}   double {double}   text {text}",
            bcd = number(DataType::Bcd16, tab.order),
            long = number(DataType::U64, tab.order),
            double = number(DataType::F64, tab.order),
            text = interpret::text(&words)
        );
        let stamps = interpret::stamps(&tab.cells.words(tab.table, address, 6));
        let stamps: Vec<String> = stamps.into_iter().map(|(kind, stamp)| format!("   {kind} {stamp}")).collect();
        let wide = 108 <= columns;
        // The text, last, is the first to give way; on a small screen each has its place beside the byte orders.
        let beside = if wide { width(&stamps.concat()) } else { 0 };
        canvas.text(1, 1, &fit(&plain, columns.saturating_sub(2 + beside)), normal);
        if wide {
            canvas.text_right(columns.saturating_sub(1), 1, &stamps.concat(), normal);
        } else {
            for (y, stamp) in (2..4).zip(stamps.iter().rev()) {
                canvas.text_right(columns.saturating_sub(1), y, stamp, normal);
            }
        }
        // All four where two stand beside each other, else the usual one and the chosen one.
        let other = if tab.order == ByteOrder::Abcd { ByteOrder::Cdab } else { tab.order };
        let orders = if wide { ByteOrder::ALL.to_vec() } else { vec![ByteOrder::Abcd, other] };
        for (n, order) in orders.into_iter().enumerate() {
            let float = interpret::float(order, &words, 12).unwrap_or_else(|| "–".to_owned());
            let (unsigned, signed) = (number(DataType::U32, order), number(DataType::I32, order));
            let text = format!("{}  {unsigned:>11} {signed:>12} {float:>13}", order.word());
            let style = if order == tab.order { normal } else { theme.dim() };
            canvas.text(1 + 60 * (to_u16(n) / 2), 2 + to_u16(n) % 2, &text, style);
        }
    }
    seen(cx, cell, old, canvas);
}

/// `700 now   3 values in 0:42   least 690   greatest 702   mean 697.2  ▁▂▃`.
fn seen(cx: &ViewContext, cell: &Cell, old: bool, canvas: &mut Canvas) {
    let theme = cx.theme;
    if old {
        let why = cell.fault.map_or(t!("not read any more").to_owned(), |fault| fault.to_string());
        let read = if cell.word.is_some() {
            t!(", last read {age} ago", age = text::age(elapsed(cell.at, cx.now)))
        } else {
            String::new()
        };
        canvas.text(1, 4, &fit_words(&(why + &read), canvas.width().saturating_sub(2)), theme.trouble());
        return;
    }
    let values: Vec<f64> = cell.seen.iter().map(|(_, word)| f64::from(*word)).collect();
    let (Some((from, _)), false) = (cell.seen.front(), values.is_empty()) else { return };
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = values.iter().sum::<f64>() / f64::from(to_u32(values.len()));
    let words = t!(
        "read {count} times in {span}   least {least}   greatest {greatest}   mean {mean}",
        count = values.len(),
        span = running(elapsed(*from, cell.at)),
        least,
        greatest,
        mean = interpret::short((f64::from(to_f32(mean) * 10.0)).round() / 10.0, 9)
    );
    let x = canvas.text(1, 4, &words, theme.normal()) + 3;
    let room = usize::from(canvas.width().saturating_sub(x + 1)).min(60);
    let recent: Vec<Option<f64>> = values.iter().rev().take(room).rev().map(|value| Some(value - least)).collect();
    if 4 <= room {
        canvas.text(x, 4, &spark::bars(&recent, (greatest - least).max(1.0), theme.glyphs), theme.normal());
    }
}
