//! The page of one device: heading, faceplate, parameter table, what the selected parameter means, the last write.

use super::{
    faceplate,
    table::{ParameterTable, default_text, differs},
};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::ne107::{Reason, Signal},
    ui::{
        command_text::{command_label, outcome_words},
        layout::Size,
        modal::faceplate::{device_text, retry_text},
        rights,
    },
};

/// The faceplate beside the table needs this many rows.
const PANEL_ROWS: u16 = 24;
/// Columns of the faceplate beside the table.
const PANEL: u16 = 36;

pub fn view(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, table: &ParameterTable, trend: Option<&Series>) {
    heading(cx, device, canvas);
    let (wide, high) = (canvas.width(), canvas.height());
    if device.faceplate.is_some() && Size::is_wide(wide) && PANEL_ROWS <= high {
        faceplate::panel(cx, &mut canvas.part(1, 2, PANEL, high.saturating_sub(2)), device, trend);
        let left = PANEL + 3;
        below(cx, &mut canvas.part(left, 1, wide.saturating_sub(left), high.saturating_sub(1)), device, table);
    } else {
        let strip = faceplate::strip_height(cx, device);
        faceplate::strip(cx, &mut canvas.part(0, 1, wide, strip), device, trend);
        let top = 1 + strip;
        below(cx, &mut canvas.part(0, top, wide, high.saturating_sub(top)), device, table);
    }
}

/// The table, what the selected parameter means, and the last write.
fn below(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, table: &ParameterTable) {
    let (wide, high) = (canvas.width(), canvas.height());
    let (end, bottom) = (wide.saturating_sub(1), high.saturating_sub(1));
    let words = if high > 16 { 2 } else { 1 };
    let hidden = table.view(cx, &mut canvas.part(0, 0, wide, bottom.saturating_sub(words)), device.id);
    if let Some(tag) = table.tag(cx, device.id) {
        let y = bottom.saturating_sub(words);
        let meaning = of_plant(if tag.meaning.is_empty() { &tag.label } else { &tag.meaning });
        // The default first: it must not be what a narrow screen cuts off.
        let default = default_text(cx, tag).map_or(String::new(), |default| t!("default {default}; ", default));
        let x = canvas.text(1, y, &tag.name, cx.theme.strong()) + 2;
        let needs =
            Some(rights::to_write(cx, [tag.id])).filter(|role| tag.writable() && rights::lacks(cx, *role).is_some());
        let needs = needs.map_or(String::new(), |role| t!("needs {title}; ", title = rights::title(role)));
        // Of a text the list shows no more than of a number.
        let whole = cx.snapshot.text(tag.id).filter(|text| tag.is_text() && !text.is_empty());
        let whole = whole.map_or(String::new(), |text| format!("{text}; "));
        let text = format!("{needs}{default}{whole}{meaning}");
        let lines = wrap(&text, end.saturating_sub(x));
        for (n, line) in lines.iter().enumerate().take(usize::from(words)) {
            let cut = n + 1 == usize::from(words) && lines.len() > n + 1;
            let line = if cut { format!("{line} …") } else { line.clone() };
            canvas.text(x, y + to_u16(n), &fit_words(&line, end.saturating_sub(x)), cx.theme.normal());
        }
    }
    let more = match (hidden, table.filter.to_string().as_str()) {
        (0, "") => String::new(),
        (n, "") => t!("{n} more ▼", n),
        (0, filter) => t!("only \"{filter}\", Esc shows all", filter),
        (n, filter) => t!("only \"{filter}\", {n} more ▼", filter, n),
    };
    let differ = cx.def().tags_of(device.id).filter(|tag| differs(cx, tag)).count();
    let more = if table.defaults {
        let mark = cx.theme.pick("≠", "#");
        t!("{mark} {differ} differ from default  {more}", mark, differ, more).trim_end().to_owned()
    } else {
        more
    };
    canvas.text_right(end, bottom, &more, cx.theme.normal());
    if let Some((words, trouble)) = last_write(cx, device.id) {
        let room = end.saturating_sub(width(&more) + 3);
        let style = if trouble { cx.theme.trouble() } else { cx.theme.dim() };
        canvas.text(1, bottom, &fit_words(&words, room), style);
    }
}

fn heading(cx: &ViewContext, device: &DeviceDef, canvas: &mut Canvas) {
    let theme = cx.theme;
    let count = cx.def().devices.len();
    let x = canvas.text(1, 0, &format!("‹ {} ›", device.name), theme.focus());
    let line = &cx.def().line(device.line).name;
    // On a narrow screen whether it answers counts for more than what it is for.
    let least = if cx.snapshot.device(device.id).diagnosis.is_some() { 100 } else { 80 };
    let title = if canvas.width() < least { String::new() } else { format!("{}  ", of_plant(&device.title)) };
    let words = t!("{model}  {title}unit {unit}  {line}", model = device.model, title, unit = device.unit, line);
    let x = canvas.text(x + 2, 0, &words, theme.normal());
    let (words, style) = status_text(cx, device.id);
    let (end, place) = (canvas.width().saturating_sub(1), format!("{}/{count}", device.id.0 + 1));
    let room = end.saturating_sub(x + 2 + width(&place) + 1);
    canvas.text(x + 2, 0, &fit_words(&words, room), style);
    canvas.text_right(end, 0, &place, theme.dim());
}

/// How a device stands: mark of NE 107, its word and its reason.
pub fn status_text(cx: &ViewContext, device: DeviceId) -> (String, Style) {
    let (theme, status) = (cx.theme, cx.snapshot.device(device));
    match (status.diagnosis, status.state) {
        (Some(reason), _) => {
            let signal = reason.signal();
            let retry = if reason == Reason::Down { retry_text(cx, device) } else { String::new() };
            (format!("{} {}: {reason}{retry}", signal_mark(signal), translate(signal.label())), theme.trouble())
        }
        (None, DeviceState::Responding) => (format!("✓ {}", device_text(cx, device)), theme.normal()),
        (None, DeviceState::Unknown) => (format!("? {}", device_text(cx, device)), theme.dim()),
        (None, DeviceState::Failing(_) | DeviceState::Down { .. }) => {
            (format!("✗ {}", device_text(cx, device)), theme.trouble())
        }
    }
}

/// The letter of NE 107 with a shape of its own.
pub fn signal_mark(signal: Signal) -> String {
    let shape = match signal {
        Signal::Failure => '✗',
        Signal::FunctionCheck => '▼',
        Signal::OutOfSpecification => '?',
        Signal::Maintenance => '◆',
    };
    format!("{shape}{}", signal.word())
}

/// The latest write to this device and its outcome, and whether that is a worry.
fn last_write(cx: &ViewContext, device: DeviceId) -> Option<(String, bool)> {
    let to_device = |tag| cx.def().tag(tag).device == device;
    let status = cx.snapshot.commands.iter().find(|status| status.command.kind.written_tag().is_some_and(to_device))?;
    let (words, trouble) = outcome_words(&status.outcome);
    let what = command_label(cx, &status.command.kind, status.old);
    Some((
        t!(
            "last: {what}  {words} {clock} by {by}",
            what,
            words,
            clock = clock(status.at, &cx.def().time_zone),
            by = status.by
        ),
        trouble,
    ))
}
