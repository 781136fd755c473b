//! What counters did beside counting, below the figures of a report, and the window that corrects one.

use ratatui::text::{Line, Span};

use super::Reports;
use crate::ui::tabs::prelude::*;
use crate::{
    plant::counter::{self, CounterEvent},
    report::{ShiftReport, counters::CounterRow},
    ui::modal::Correction,
};

/// The key of a plant that counts something.
pub const KEYS: &[key_table::Key<Reports>] = &[key_table::Key::new(
    char('x'),
    "correct",
    "correct what a counter counted, with a reason",
    |reports: &mut Reports, cx| correct(cx, reports.report.answered.value.as_deref(), reports.charted),
)
.needs(Role::Supervisor)
.when(|_, cx| Offer::only_if(of_plant(cx).next().is_some()))];

/// `21:14:07  PM-1.E       replaced       1204.50 → 3.00 kWh, counted 0.00`; of a correction by whom, and why.
pub fn line(cx: &ViewContext, row: &CounterRow, time: String) -> Line<'static> {
    let value = |value: Exact| digits(value, Some(row.decimals));
    let CounterRow { tag, unit, step, note, .. } = row;
    let what = match step.event {
        CounterEvent::Corrected => format!("{} {unit}, {note}", value(step.counted)),
        CounterEvent::FalseReading
        | CounterEvent::Rollover
        | CounterEvent::Reset
        | CounterEvent::Replaced
        | CounterEvent::Held => {
            let counted = t!("counted {counted}", counted = value(step.counted));
            format!("{} {} {} {unit}, {counted}", value(step.old), cx.theme.pick("→", "->"), value(step.new))
        }
    };
    let words = draw::columns([14, 15], [tag, translate(step.event.word())]);
    let room = cx.area.width.saturating_sub(width(&time) + width(&words) + 1);
    Line::from(vec![
        Span::styled(time, cx.theme.dim()),
        Span::styled(format!("{words} {}", fit(&what, room)), cx.theme.normal()),
    ])
}

/// The counters of a plant, as their devices say now.
pub fn of_plant<'a>(cx: &ViewContext<'a>) -> impl Iterator<Item = TagId> + use<'a> {
    let snapshot = cx.snapshot;
    let tags = snapshot.def.tags.iter().filter(|tag| tag.is_stored());
    tags.filter(|tag| counter::counts_in(tag, snapshot.unit(tag.id))).map(|tag| tag.id)
}

/// Opens the window on the tag of a row of the report, if that counts; else on that of the last step.
fn correct(cx: &ViewContext, report: Option<&ShiftReport>, charted: usize) -> Vec<UiAction> {
    let counters: Vec<TagId> = of_plant(cx).collect();
    let named = |name: &str| counters.iter().position(|tag| cx.def().tag(*tag).name == name);
    let row = report.and_then(|report| named(&report.tags.get(charted)?.tag));
    let step = report.and_then(|report| named(&report.counters.last()?.tag));
    let Some(window) = Correction::new(cx.def(), counters, row.or(step).unwrap_or(0)) else { return Vec::new() };
    let kind = window.command_kind(Exact::from(1.0));
    vec![Notice::or(cx, t!("correct a counter"), &kind, Modal::Correction(Box::new(window)))]
}
