//! What there is to say about a value, row by row, the most urgent first.

use crate::t;
use std::time::Duration;

use super::{service, value, wire};
use crate::ui::modal::sheet::Fact;
use crate::{
    bus::source_frame,
    plant::{
        def::{LineDef, TagId},
        tag::{Calculation, TagDef},
    },
    ui::ViewContext,
};

pub(super) fn rows(cx: &ViewContext, tag: TagId, room: u16) -> Vec<Fact> {
    let def = cx.def().tag(tag);
    let device = cx.def().device(def.device);
    let exchange = cx.snapshot.source_frames[tag.index()].as_deref();
    let found = exchange.and_then(|exchange| source_frame::find(def.point, exchange));
    let mut rows = value::value_rows(cx, def, exchange, found.as_ref());
    if let Some(calculation) = &def.calculation {
        rows.extend(calculation_rows(cx, calculation));
        return rows;
    }
    let label = if def.is_text() { t!("text") } else { t!("number") };
    rows.push(Fact::new(label, value::number(cx, def, exchange, found.as_ref()), cx.theme.normal()));
    rows.push(Fact::new(t!("address"), wire::place(cx, def, device), cx.theme.normal()));
    rows.push(Fact::new("", wire::point(def), cx.theme.normal()));
    let dissection = exchange.map(|exchange| wire::exchange_rows(cx, def, exchange, found.as_ref(), room, &mut rows));
    if exchange.is_none() {
        rows.push(Fact::new(t!("request"), wire::never_asked(cx, def).to_owned(), cx.theme.normal()));
    }
    rows.extend(service::device_rows(cx, def, device, exchange));
    rows.extend(service::poll_rows(cx, def));
    if let (Some(dissection), Some(exchange)) = (dissection, exchange) {
        rows.extend(wire::every_byte(cx, exchange, &dissection, found.as_ref(), room));
    }
    rows
}

/// What it is calculated from: the expression, and each input as it is now.
fn calculation_rows(cx: &ViewContext, calculation: &Calculation) -> Vec<Fact> {
    let mut rows = vec![Fact::new(t!("expression"), calculation.text.clone(), cx.theme.normal())];
    for (n, input) in calculation.inputs().into_iter().enumerate() {
        let (def, sample) = (cx.def().tag(input), cx.snapshot.sample(input));
        let value = match sample.exact() {
            None => String::new(),
            Some(value) if def.label_of(value).is_some() => format!("{}, ", cx.snapshot.format(input, value)),
            Some(value) => format!("{} {}, ", cx.snapshot.format(input, value), cx.snapshot.unit(input)),
        };
        let style = if sample.quality.is_good() { cx.theme.normal() } else { cx.theme.trouble() };
        let label = if n == 0 { t!("inputs") } else { "" };
        rows.push(Fact::new(label, format!("{}  {value}{}", def.name, sample.quality), style));
    }
    rows
}

pub(super) fn settings<'a>(cx: &ViewContext<'a>, def: &TagDef) -> &'a LineDef {
    let line = cx.def().device(def.device).line;
    cx.snapshot.line(line).report.as_ref().map_or(cx.def().line(line), |report| &report.settings)
}

/// `0.4 ms`, `12 ms`, `1.5 s`, `10 min`.
pub(super) fn span(span: Duration) -> String {
    let ms = span.as_secs_f64() * 1e3;
    match ms {
        ..10.0 => t!("{round} ms", round = (ms * 10.0).round() / 10.0),
        10.0..1_000.0 => t!("{ms} ms", ms = format!("{ms:.0}")),
        1_000.0..100_000.0 => format!("{} s", (ms / 100.0).round() / 10.0),
        _ => t!("{ms} min", ms = format!("{:.0}", ms / 60_000.0)),
    }
}
