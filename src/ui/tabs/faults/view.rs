//! Draws the faults: a list by target, the selected one described, and actual beside displayed values.

use super::{Faults, open, rows};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::tag::Poll,
    sim::{
        drill::{Progress, Status},
        faults::{FaultTarget, InjectedFault, target::device_at},
        scenario::judge::ExpectationStatus,
    },
    ui::widgets::value::show,
};

const LIST: u16 = 31;
/// Rows that the comparison with the truth has at the least.
const TRUTH_MIN: u16 = 5;

pub(super) fn view(tab: &Faults, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let Some(status) = open(cx) else {
        canvas.text(1, 1, t!("nothing is simulated here"), cx.theme.dim());
        return;
    };
    let mut top = 0;
    if let Some(progress) = &status.scenario {
        heading(cx, progress, &mut canvas.part(0, 0, area.width, 1));
        top = 1;
    }
    let height = area.height.saturating_sub(top);
    if let (true, Some(progress)) = (tab.verdict, &status.scenario) {
        return verdict(cx, progress, &mut canvas.part(1, top, area.width.saturating_sub(2), height));
    }
    list(tab, cx, status, &mut canvas.part(0, top, LIST, height));
    for y in 0..height {
        canvas.glyph(LIST, top + y, '│', cx.theme.dim());
    }
    let mut side = canvas.part(LIST + 2, top, area.width.saturating_sub(LIST + 3), height);
    let all = rows(status);
    if let Some((target, offered)) = all.get(tab.selected.min(all.len().saturating_sub(1))) {
        describe(cx, status, *target, tab.number(status, *target, *offered), &mut side);
    }
}

fn heading(cx: &ViewContext, progress: &Progress, canvas: &mut Canvas) {
    let Progress { elapsed, duration, verdict, .. } = progress;
    let time =
        t!("{running} of {running2}", running = running((*elapsed).min(*duration)), running2 = running(*duration));
    let right = format!("{time}   {}", verdict.summary());
    let room = canvas.width().saturating_sub(width(&right) + 4);
    canvas.text(1, 0, &fit(&verdict.title, room), cx.theme.strong());
    let style = if verdict.over && !verdict.passed() { cx.theme.trouble() } else { cx.theme.normal() };
    canvas.text_right(canvas.width().saturating_sub(1), 0, &right, style);
}

/// All faults by target; the selected row is always in sight.
fn list(tab: &Faults, cx: &ViewContext, status: &Status, canvas: &mut Canvas) {
    let mut lines: Vec<(String, String, Style, bool)> = Vec::new();
    let (mut number, mut selected_line) = (0, 0);
    let last = rows(status).len().saturating_sub(1);
    for available in status.available.iter() {
        lines.push((target_label(cx, available.target), String::new(), cx.theme.dim(), false));
        for fault in &available.faults {
            let selected = number == tab.selected.min(last);
            if selected {
                selected_line = lines.len();
            }
            let active = status.find(available.target, *fault);
            let name = tab.number(status, available.target, *fault).to_string();
            let (state, style) = match active {
                Some(active) => {
                    (t!("ON {running}", running = running(elapsed(active.since, cx.now))), cx.theme.trouble())
                }
                None => (t!("off").to_owned(), cx.theme.normal()),
            };
            lines.push((format!("  {name}"), state, style, selected));
            number += 1;
        }
    }
    let height = usize::from(canvas.height());
    let first = (selected_line + 3).saturating_sub(height).min(lines.len().saturating_sub(height));
    for (y, (name, state, style, selected)) in lines.iter().skip(first).take(height).enumerate() {
        let y = to_u16(y);
        let x = canvas.text(0, y, if *selected { cx.theme.pick("▸", ">") } else { " " }, cx.theme.strong());
        // A heading has no state behind it.
        let room = if state.is_empty() { LIST - 2 } else { LIST - 12 };
        canvas.text(x, y, &pad(name, room), *style);
        canvas.text_right(LIST - 2, y, state, if state == t!("off") { cx.theme.dim() } else { *style });
        if *selected {
            canvas.paint(0, y, LIST, 1, cx.theme.focus());
        }
    }
    if first > 0 {
        canvas.text_right(LIST - 1, 0, cx.theme.pick("↑", "^"), cx.theme.dim());
    }
    if first + height < lines.len() {
        canvas.text(LIST - 1, canvas.height().saturating_sub(1), cx.theme.pick("↓", "v"), cx.theme.dim());
    }
}

fn target_label(cx: &ViewContext, target: FaultTarget) -> String {
    let name = target.name(cx.def());
    match target {
        FaultTarget::Line(_) => t!("{name} line", name),
        FaultTarget::Unit(line, unit) => {
            t!("{name} unit {unit} on {name2}", name, unit, name2 = cx.def().line(line).name)
        }
        FaultTarget::Tag(_) => name,
        FaultTarget::Process => t!("process").to_owned(),
    }
}

/// Describes the selected fault above the comparison.
fn describe(cx: &ViewContext, status: &Status, target: FaultTarget, fault: InjectedFault, canvas: &mut Canvas) {
    let (theme, room) = (cx.theme, canvas.width());
    let description = fault.row();
    let mut lines = vec![(format!("{}: {fault}", target.name(cx.def())), theme.strong())];
    let mut paragraph = |head: &str, text: &str| {
        lines.extend(wrap(&format!("{head}{text}"), room).into_iter().map(|line| (line, theme.normal())));
    };
    paragraph("", translate(description.cause));
    paragraph(t!("Symptoms: "), translate(description.symptoms));
    paragraph(t!("Action: "), translate(description.action));

    let truth = compare(cx, status, target);
    let wanted = (to_u16(truth.len()) + 1).min(canvas.height().saturating_sub(to_u16(lines.len()) + 1));
    let below = wanted.max(TRUTH_MIN + 1).min(to_u16(truth.len()) + 1).min(canvas.height() / 2);
    let above = canvas.height().saturating_sub(below);
    for (y, (line, style)) in lines.iter().take(usize::from(above)).enumerate() {
        // The last row that fits says that there is more.
        let cut = to_u16(y) + 1 == above && lines.len() > usize::from(above);
        let line =
            if cut { fit_words(&format!("{line} {}", "x".repeat(usize::from(room))), room) } else { line.clone() };
        canvas.text(0, to_u16(y), &line, *style);
    }
    comparison(cx, &truth, &mut canvas.part(0, above, room, below));
}

/// A tag whose truth is known.
struct Compared {
    tag: TagId,
    truth: String,
    comparison: TruthComparison,
}

/// Comparison of displayed and actual value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum TruthComparison {
    /// Shown as good, and wrong.
    Wrong,
    /// Not shown as good.
    Unknown,
    Same,
}

/// The tags of a target with their truth, the most dangerous first.
fn compare(cx: &ViewContext, status: &Status, target: FaultTarget) -> Vec<Compared> {
    let device = match target {
        FaultTarget::Unit(line, unit) => device_at(cx.def(), line, unit).map(|device| device.id),
        FaultTarget::Tag(tag) => Some(cx.def().tag(tag).device),
        FaultTarget::Line(_) | FaultTarget::Process => None,
    };
    let of_place = |tag: TagId| {
        let def = cx.def().tag(tag);
        def.poll != Poll::Never && device.is_none_or(|device| device == def.device)
    };
    let mut rows: Vec<Compared> = status
        .actual
        .iter()
        .filter(|(tag, _)| of_place(**tag))
        .map(|(tag, truth)| {
            let comparison = match cx.snapshot.sample(*tag).good_value() {
                None => TruthComparison::Unknown,
                Some(shown) if (shown - truth).abs() > allowed(cx, *tag) => TruthComparison::Wrong,
                Some(_) => TruthComparison::Same,
            };
            let text = format!("{} {}", cx.snapshot.format(*tag, *truth), cx.snapshot.unit(*tag));
            Compared { tag: *tag, truth: text.trim_end().to_owned(), comparison }
        })
        .collect();
    rows.sort_by_key(|row| (row.comparison, row.tag));
    rows
}

/// What a value may change between two readings: two hundredths of its range; a state not at all.
fn allowed(cx: &ViewContext, tag: TagId) -> f64 {
    let span = cx.snapshot.range(tag).map_or(0.0, |(low, high)| high - low);
    if cx.def().tag(tag).enum_labels.is_empty() { (0.02 * span).max(0.5) } else { 0.0 }
}

fn comparison(cx: &ViewContext, rows: &[Compared], canvas: &mut Canvas) {
    if rows.is_empty() {
        canvas.text(0, 0, t!("actual values are not known here"), cx.theme.dim());
        return;
    }
    let names = rows.iter().map(|row| width(&cx.def().tag(row.tag).name)).max().unwrap_or(0).clamp(10, 16);
    canvas.text(names + 2, 0, t!("actual"), cx.theme.dim());
    canvas.text(names + 15, 0, t!("displayed"), cx.theme.dim());
    for (y, row) in rows.iter().enumerate() {
        let y = to_u16(y) + 1;
        canvas.text(0, y, &pad(&cx.def().tag(row.tag).name, names), cx.theme.normal());
        canvas.text(names + 2, y, &fit(&row.truth, 10), cx.theme.strong());
        let shown = show(cx, row.tag);
        let (mark, style) = match row.comparison {
            TruthComparison::Wrong => (cx.theme.pick("≠", "#"), cx.theme.trouble()),
            TruthComparison::Unknown => ("?", cx.theme.trouble()),
            TruthComparison::Same => ("=", cx.theme.dim()),
        };
        canvas.text(names + 13, y, mark, style);
        let room = canvas.width().saturating_sub(names + 15);
        canvas.text(names + 15, y, &fit(&shown.whole(), room), shown.style);
    }
}

/// Every expectation of the drill and how it stands.
fn verdict(cx: &ViewContext, progress: &Progress, canvas: &mut Canvas) {
    let (theme, room) = (cx.theme, canvas.width());
    let mut y = 1;
    for row in &progress.verdict.rows {
        let (mark, points, note, style) = match &row.status {
            ExpectationStatus::Open => (theme.pick("○", "o"), 0, t!("open").to_owned(), theme.dim()),
            ExpectationStatus::Met(at) => {
                (theme.pick("●", "+"), row.points, t!("met {running}", running = running(*at)), theme.normal())
            }
            ExpectationStatus::Missed(why) => (theme.pick("✗", "x"), 0, t!("MISSED {why}", why), theme.trouble()),
        };
        canvas.text(0, y, mark, style);
        canvas.text(2, y, &format!("{points:>3}/{:<3}", row.points), theme.normal());
        let lines = wrap(&format!("{}: {note}", row.text), room.saturating_sub(11));
        for line in lines {
            canvas.text(11, y, &line, style);
            y += 1;
        }
    }
    canvas.text(11, y + 1, &progress.verdict.summary(), theme.strong());
    for (n, line) in wrap(&progress.description, room.saturating_sub(11)).into_iter().enumerate() {
        canvas.text(11, y + 3 + to_u16(n), &line, theme.dim());
    }
}
