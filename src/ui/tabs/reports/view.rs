//! The view of the reports tab: which period, its figures, alarms and actions, and what the CSV will be.

use std::{collections::BTreeMap, path::Path};

use ratatui::text::{Line, Span};

use super::{Export, Reports, counters};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        def::Priority,
        record::{ActionRecord, AlarmEvent, AlarmRecord},
    },
    report::{Period, ShiftReport, SuppressedSummary, TagFigures, raised, text::mean_or_difference},
    ui::layout::Size,
};

/// Alarm events and actions listed at most; the CSV has all of them.
const LIST_MAX: usize = 500;

/// Columns of the figures beside a chart.
const FIGURES: u16 = 80;
const CHART_ROWS: u16 = 24;

pub fn draw(reports: &Reports, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let (columns, height) = (canvas.width(), canvas.height());
    let Some(period) = &reports.period else { return };
    draw_title(reports, cx, period, &mut canvas);
    let rows = height.saturating_sub(3);
    let left = columns.saturating_sub(chart_columns(cx).map_or(0, |beside| beside + 1));
    match (&reports.report.answered.value, &reports.preview) {
        (Some(report), Some(lines)) => {
            let first = reports.scroll.first(lines.len(), usize::from(rows + 1));
            for (y, line) in (1..=rows + 1).zip(lines.iter().skip(first)) {
                canvas.text(1, y, line, cx.theme.normal());
            }
            let hidden = lines.len().saturating_sub(first + usize::from(rows + 1));
            draw_export(reports, cx, report, hidden, &mut canvas.part(0, height.saturating_sub(1), columns, 1));
        }
        (Some(report), None) => {
            draw_chart(reports, cx, &mut canvas.part(left, 1, columns - left, rows + 1));
            let cx = &ViewContext { area: Rect { width: left, ..cx.area }, ..*cx };
            let charted = (left < columns).then_some(reports.charted);
            let lines = lines(cx, report, charted, reports.later_columns, reports.quiet);
            let first = reports.scroll.first(lines.len(), usize::from(rows));
            let mut part = canvas.part(0, 2, left, rows);
            let area = part.area();
            for (y, _, line) in on_screen(&lines, first, usize::from(rows)) {
                part.buffer().set_line(area.x, area.y + y, line, area.width);
            }
            let hidden = lines.len().saturating_sub(first + usize::from(rows));
            canvas.text(0, 1, &heading(left, reports.later_columns), cx.theme.dim());
            draw_export(reports, cx, report, hidden, &mut canvas.part(0, height.saturating_sub(1), columns, 1));
        }
        (None, _) => {
            let waiting = reports.report.answered.query.shown_waiting(cx);
            let words =
                reports.report.answered.trouble.as_deref().or(waiting.as_deref()).unwrap_or(t!("collecting data"));
            let style = if reports.report.answered.trouble.is_some() { cx.theme.trouble() } else { cx.theme.dim() };
            canvas.text_centred(height / 2, words, style);
        }
    }
}

/// Draws the rows of the record below the title of the report.
pub fn draw_rows(reports: &Reports, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let (columns, height) = (canvas.width(), canvas.height());
    let Some(period) = &reports.period else { return };
    draw_title(reports, cx, period, &mut canvas);
    reports.report.view(cx, &mut canvas.part(0, 1, columns, height.saturating_sub(2)));
    if let Some(report) = reports.report.answered.value.as_deref().filter(|_| reports.export != Export::Not) {
        draw_export(reports, cx, report, 0, &mut canvas.part(0, height.saturating_sub(1), columns, 1));
    }
}

/// Columns of the chart beside the figures, where there is room for both.
pub fn chart_columns(cx: &ViewContext) -> Option<u16> {
    let free = cx.area.width.saturating_sub(FIGURES);
    (Size::Wide <= cx.size).then_some((free - free / 4).max(30))
}

/// The curve of the marked tag over the period; the rest of the column is free.
fn draw_chart(reports: &Reports, cx: &ViewContext, canvas: &mut Canvas) {
    let Some((pen, view)) = reports.chart(cx) else { return };
    for y in 0..canvas.height() {
        canvas.text(0, y, cx.theme.pick("┊", "|"), cx.theme.dim());
    }
    let (width, height) = (canvas.width().saturating_sub(1), canvas.height().min(CHART_ROWS));
    let series = reports.curve.value.as_deref().unwrap_or_default();
    let canvas = &mut canvas.part(1, 0, width, height);
    draw::curves(cx, canvas, t!("t next tag"), (view, None), &[pen], series);
    if reports.curve.value.is_none() {
        let words = reports.curve.trouble.as_deref().unwrap_or(t!("collecting data"));
        canvas.text_centred(height / 2, words, cx.theme.dim());
    }
}

/// `▸ morning 2026-11-21   06:00 – 14:00 +07   closed`.
fn draw_title(reports: &Reports, cx: &ViewContext, period: &Period, canvas: &mut Canvas) {
    let (theme, zone) = (cx.theme, &cx.def().time_zone);
    let x = canvas.text(1, 0, theme.pick("▸ ", "> "), theme.dim());
    let x = canvas.text(x, 0, &period::label(&period.name), theme.strong());
    let x = canvas.text(x + 3, 0, &period::span(period, zone), theme.normal());
    let running = reports.is_running(cx.now);
    let until = reports.report.answered.value.as_ref().map_or(cx.now, |report| report.until);
    let state = match (running, &reports.report.answered.value) {
        (true, _) => t!("RUNNING, until now {local}", local = cx.local(until, "%H:%M:%S")),
        (false, Some(report)) if report.until < report.period.to => {
            t!("figures until {local} only", local = cx.local(until, "%H:%M:%S"))
        }
        (false, _) => t!("closed").to_owned(),
    };
    let state = fit_words(&state, canvas.width().saturating_sub(x + 3));
    let x = canvas.text(x + 3, 0, &state, if running { theme.strong() } else { theme.normal() });
    if reports.report.answered.value.is_some() {
        let right = canvas.width().saturating_sub(1);
        match &reports.report.answered.trouble {
            Some(trouble) => canvas.text_right(right, 0, &fit(trouble, right.saturating_sub(x + 2)), theme.trouble()),
            None => {
                let waiting = reports.report.answered.query.shown_waiting(cx).unwrap_or_default();
                canvas.text_right(right, 0, &fit(&waiting, right.saturating_sub(x + 2)), theme.dim());
            }
        }
    }
}

/// What the file is like, and where it went.
fn draw_export(reports: &Reports, cx: &ViewContext, report: &ShiftReport, hidden: usize, row: &mut Canvas) {
    let (theme, dialect) = (cx.theme, reports.dialect);
    let separator = if dialect.separator == ';' { t!("semicolons") } else { t!("commas") };
    let decimal = if dialect.decimal == ',' { t!("decimal comma") } else { t!("decimal point") };
    let bom = if dialect.bom { t!(", BOM") } else { "" };
    let (text, style) = export_words(reports, cx, &reports.path(cx, report));
    let more = t!("   {pick} {hidden} more", pick = theme.pick("↓", t!("down")), hidden);
    let more = if hidden > 0 { more } else { String::new() };
    // The path matters most: the format is written in full where there is room.
    let kinds = match reports.format.extension().ends_with("csv") {
        true => [
            t!("CSV: {separator}, {decimal}{bom}{more}", separator, decimal, bom, more),
            t!(
                "CSV {separator} {decimal}{bom}{more}",
                separator = dialect.separator,
                decimal = dialect.decimal,
                bom,
                more
            ),
            more.trim().to_owned(),
        ],
        false => [format!("{}{more}", reports.format.about()), more.trim().to_owned(), more.trim().to_owned()],
    };
    let end = row.width().saturating_sub(1);
    let fits = |kind: &String| width(&text) + width(kind) + 4 <= end;
    let kind = kinds.iter().find(|kind| fits(kind)).unwrap_or(&kinds[2]);
    row.text(1, 0, &fit(&text, end.saturating_sub(width(kind) + 2)), style);
    row.text_right(end, 0, kind, theme.dim());
}

/// How the file stands that is or would be written.
pub fn export_words(reports: &Reports, cx: &ViewContext, path: &Path) -> (String, Style) {
    let theme = cx.theme;
    match &reports.export {
        Export::Not => (t!("e writes {display}", display = path.display()), theme.dim()),
        Export::Writing => (t!("writing {display}", display = path.display()), theme.normal()),
        Export::Done(path) => {
            (t!("{pick} written {display}", pick = theme.pick("✓", t!("ok")), display = path.display()), theme.done())
        }
        Export::Failed(why) => (t!("not written: {why}", why), theme.trouble()),
    }
}

/// Widths of the table: tag, unit, then right-aligned figures.
fn widths(width: u16) -> (u16, u16) {
    let wide = width.saturating_sub(80);
    (15 + wide / 4, 9 + wide / 10)
}

/// The columns that are shown: on a narrow screen the first or the last ones.
fn shown_columns(width: u16, later: bool) -> std::ops::Range<usize> {
    match (width, later) {
        (FIGURES.., _) => 0..6,
        (_, false) => 0..4,
        (_, true) => 3..6,
    }
}

fn heading(width: u16, later: bool) -> String {
    let (tag, figure) = widths(width);
    let page = match (width, later) {
        (FIGURES.., _) => "",
        (_, false) => "  c 1/2",
        (_, true) => "  c 2/2",
    };
    let mut text = format!("  {}{}", pad(&format!("{}{page}", t!("tag")), tag), pad(t!("unit"), 7));
    let names = [t!("min"), t!("mean/+"), t!("max"), t!("last"), t!("in alarm"), t!("good")];
    for n in shown_columns(width, later) {
        text.push_str(&pad_left(names[n], figure + u16::from(n == 4)));
    }
    text
}

/// Everything below the heading: figures, counts, alarms, actions.
/// The row whose tag has the chart is marked.
pub fn lines(
    cx: &ViewContext,
    report: &ShiftReport,
    charted: Option<usize>,
    later: bool,
    quiet: bool,
) -> Vec<Line<'static>> {
    let theme = cx.theme;
    let mut lines = Vec::new();
    if report.tags.iter().all(|tag| tag.good == 0.0) {
        let words = t!("  no data: no good value was recorded in this period");
        lines.push(Line::styled(words, theme.trouble()));
    }
    lines.extend(report.tags.iter().enumerate().map(|(n, tag)| figures(cx, tag, charted == Some(n), later)));
    lines.push(Line::default());
    lines.push(counts(cx, report));
    // The CSV has the whole hash.
    let audit = report.audit.map(|entry| fit(&t!("  audit log: entry {entry}", entry), cx.area.width));
    lines.extend(audit.map(|words| Line::styled(words, theme.dim())));
    if report.unstored != Some(0) {
        lines.push(Line::styled(t!("  records not stored yet are missing here"), theme.trouble()));
    }
    for gap in &report.unreadable {
        let time = |at: Timestamp| cx.local(at, "%m-%d %H:%M");
        let words = t!("  not readable, not counted: {time} to {time2}", time = time(gap.from), time2 = time(gap.to));
        lines.push(Line::styled(words, theme.trouble()));
    }
    if let Some((of, _)) = &report.record_of {
        let words = t!("  record of {of}: {count} rows in the file", of, count = report.record.len());
        lines.push(Line::styled(words, theme.normal()));
    }
    // The name of a shift has its day; only a longer period needs the date in every line.
    let short = report.until.duration_since(report.period.from) <= SignedDuration::from_hours(24);
    let form = if short { "%H:%M:%S" } else { "%m-%d %H:%M:%S" };
    let time = |at: Timestamp| format!("  {}  ", cx.local(at, form));
    let listed: Vec<_> = report.alarms.iter().filter(|alarm| quiet || !alarm.event.is_quiet()).collect();
    let alarms_title = match report.alarms.len() - listed.len() {
        0 => t!("alarms").to_owned(),
        hidden => t!("alarms, {hidden} not annunciated hidden, d shows them", hidden),
    };
    let only_hidden = listed.is_empty() && !report.alarms.is_empty();
    let suppressed = report.suppressed.iter().map(|alarm| suppressed_line(cx, alarm));
    let alarms = listed.into_iter().map(|alarm| alarm_line(cx, alarm, time(alarm.at)));
    let actions = report.actions.iter().map(|action| action_line(cx, action, time(action.at)));
    lines.extend(section(cx, t!("suppressed alarms"), suppressed));
    lines.extend(section(cx, &alarms_title, alarms));
    if only_hidden {
        lines.push(Line::styled(format!("  {alarms_title}"), theme.dim()));
    }
    lines.extend(section(cx, t!("operator actions"), actions));
    let steps = report.counters.iter().map(|row| counters::line(cx, row, time(row.step.at)));
    lines.extend(section(cx, t!("counters"), steps));
    lines
}

fn figures(cx: &ViewContext, tag: &TagFigures, charted: bool, later: bool) -> Line<'static> {
    let (theme, (name, figure)) = (cx.theme, widths(cx.area.width));
    // A part of a number is another number, and two that touch are one.
    let right = |number: &str| pad_left(&text::whole(number, figure - 1), figure);
    let value =
        |value: Option<Exact>| value.map_or_else(|| right("–"), |value| right(&digits(value, Some(tag.decimals))));
    let mean = mean_or_difference(tag).replace('—', "–");
    let alarm = if tag.in_alarm.is_zero() { "–".to_owned() } else { long(tag.in_alarm) };
    let good =
        if tag.good >= 1.0 { "100 %".to_owned() } else { format!("{:.1} %", (tag.good * 1_000.0).floor() / 10.0) };
    let figures = [
        Span::styled(value(tag.min), theme.normal()),
        Span::styled(right(&mean), theme.normal()),
        Span::styled(value(tag.max), theme.normal()),
        Span::styled(value(tag.last), theme.normal()),
        Span::styled(pad_left(&alarm, figure + 1), if tag.in_alarm.is_zero() { theme.dim() } else { theme.strong() }),
        Span::styled(pad_left(&good, figure), if tag.good < 0.9995 { theme.strong() } else { theme.dim() }),
    ];
    let names = [
        Span::styled(if charted { theme.pick("▸ ", "> ") } else { "  " }, theme.strong()),
        Span::styled(pad(&tag.tag, name - 1), if charted { theme.strong() } else { theme.normal() }),
        Span::styled(format!(" {}", pad(&tag.unit, 7)), theme.dim()),
    ];
    let shown = shown_columns(cx.area.width, later);
    let figures = figures.into_iter().enumerate().filter(|(n, _)| shown.contains(n)).map(|(_, span)| span);
    Line::from_iter(names.into_iter().chain(figures))
}

/// `alarms 3 (high 1, medium 2)   most TIC-1.PV ×2   operator actions 4`.
fn counts(cx: &ViewContext, report: &ShiftReport) -> Line<'static> {
    let priorities = [Priority::Critical, Priority::High, Priority::Medium, Priority::Low];
    let by = priorities.map(|priority| (raised(&report.alarms, priority), translate(priority.word())));
    let total: usize = by.iter().map(|(n, _)| n).sum();
    let parts: Vec<String> = by.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{word} {n}")).collect();
    let mut text = t!("  alarms {total}", total);
    if total > 0 {
        text.push_str(&format!(" ({})", parts.join(", ")));
    }
    let suppressed: u64 = report.suppressed.iter().map(|alarm| alarm.raised).sum();
    if suppressed > 0 {
        text.push_str(&t!(", {suppressed} more while suppressed", suppressed));
    }
    let mut subjects: BTreeMap<&str, usize> = BTreeMap::new();
    for alarm in report.alarms.iter().filter(|alarm| alarm.event == AlarmEvent::Raised) {
        *subjects.entry(&alarm.subject).or_default() += 1;
    }
    if let Some((subject, n)) = subjects.into_iter().max_by_key(|(_, n)| *n).filter(|(_, n)| *n > 1) {
        text.push_str(&t!("   most {subject} {pick}{n}", subject, pick = cx.theme.pick("×", "x"), n));
    }
    text.push_str(&t!("   operator actions {count}", count = report.actions.len()));
    Line::styled(text, cx.theme.normal())
}

/// A heading and its lines, at most [`LIST_MAX`] of them; nothing where there is none.
fn section<'a>(cx: &ViewContext, title: &str, rows: impl ExactSizeIterator<Item = Line<'a>>) -> Vec<Line<'a>> {
    let rule = cx.theme.pick("─", "-");
    let rest = usize::from(cx.area.width.saturating_sub(width(title) + 5));
    let heading = Line::styled(format!(" {rule} {title} {}", rule.repeat(rest)), cx.theme.dim());
    let more = rows.len().saturating_sub(LIST_MAX);
    let mut lines: Vec<Line> = rows.take(LIST_MAX).collect();
    if !lines.is_empty() {
        lines.insert(0, heading);
    }
    if 0 < more {
        lines.push(Line::styled(t!("  and {n} more in the file", n = more), cx.theme.dim()));
    }
    lines
}

/// An alarm that was active without being annunciated, and for how long.
fn suppressed_line(cx: &ViewContext, alarm: &SuppressedSummary) -> Line<'static> {
    let (theme, room) = (cx.theme, cx.area.width.saturating_sub(46).clamp(12, 41));
    let active = t!("active {long}, raised {raised}", long = long(alarm.active), raised = alarm.raised);
    Line::from(vec![
        Span::styled(format!("  {}", theme.priority_mark(alarm.priority)), theme.dim()),
        Span::styled(
            format!(" {} {} {active}", pad(&alarm.subject, 12), pad(translate(&alarm.message), room)),
            theme.normal(),
        ),
    ])
}

/// One step of an alarm. An acknowledgement shows who, the other steps the value.
fn alarm_line(cx: &ViewContext, alarm: &AlarmRecord, time: String) -> Line<'static> {
    let theme = cx.theme;
    let value = |value: Exact| match cx.def().tag_named(&alarm.subject) {
        Some(tag) => format!("{} {}", value::number(cx, tag, value), cx.snapshot.unit(tag)),
        None => format!("{value}"),
    };
    let active = alarm.event == AlarmEvent::Raised;
    let style = if active { theme.normal() } else { theme.dim() };
    let detail = match (&alarm.by, alarm.value) {
        (Some(by), _) => t!("by {by}", by),
        (None, Some(number)) => pad_left(value(number).trim(), 10),
        (None, None) => String::new(),
    };
    let half = cx.area.width.saturating_sub(68 + width(&time)) / 2;
    let (text, event) = (21 + half.min(20), 13 + half.min(10));
    let words = draw::columns(
        [12, text.cast_signed(), event.cast_signed()],
        [&alarm.subject, translate(&alarm.message), translate(alarm.event.word())],
    );
    let mark = if active { theme.severity(alarm.priority) } else { theme.dim() };
    Line::from(vec![
        Span::styled(time, theme.dim()),
        Span::styled(theme.priority_mark(alarm.priority), mark),
        Span::styled(format!(" {words} {detail}"), style),
    ])
}

/// One operator action; where it is too long, its outcome is kept.
fn action_line(cx: &ViewContext, action: &ActionRecord, time: String) -> Line<'static> {
    let room = cx.area.width.saturating_sub(width(&time) + 1);
    let outcome = fit(&action.outcome, room / 2);
    let text = format!("{} {} {} {}", pad(&action.by, 8), action.action, action.target, draw::change(cx, action));
    let text = fit(&text, room.saturating_sub(width(&outcome) + 2));
    Line::from(vec![
        Span::styled(time, cx.theme.dim()),
        Span::styled(text, cx.theme.normal()),
        Span::styled(format!("  {outcome}"), cx.theme.strong()),
    ])
}

/// Hours, minutes, seconds: `00:00:41`.
fn long(span: Duration) -> String {
    let seconds = span.as_secs();
    format!("{:02}:{:02}:{:02}", seconds / 3_600, seconds / 60 % 60, seconds % 60)
}
