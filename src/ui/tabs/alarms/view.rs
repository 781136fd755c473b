//! How the alarms tab looks: the views and what is in them, the list, what is suppressed, and the guidance below.

use ratatui::style::Modifier;

use super::{Alarms, Page, columns::AlarmColumns, guidance, list::AlarmRow, on_page, side};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{alarm::ActiveAlarm, def::AlarmId},
    ui::{alarm_text::history_text, layout::Size, preferences::Bell},
};

/// Rows above the list: views, filter, headings.
const HEAD: u16 = 3;

pub(super) fn draw(tab: &Alarms, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let top = history_trouble(cx, &mut canvas);
    let (width, height) = (canvas.width(), canvas.height());
    views(tab, cx, &mut canvas.part(0, top, width, 1));
    let mut rest = canvas.part(0, top + 1, width, height.saturating_sub(top + 1));
    match tab.page {
        Page::Active | Page::System => list(tab, cx, &mut rest),
        Page::Suppressed => suppressed(tab, cx, &mut rest),
        Page::Journal => tab.journal.view(cx, &mut rest),
        Page::Metrics => tab.metrics.view(cx, &mut rest),
        Page::Handover => tab.handover.view(cx, &mut rest),
    }
}

/// What is wrong with the history, whole, in at most a third of the tab; returns the rows taken. The header has no room
/// for it.
fn history_trouble(cx: &ViewContext, canvas: &mut Canvas) -> u16 {
    let rows = trouble_rows(cx, canvas.width(), canvas.height());
    draw::lines(canvas, &rows, Scroll::default());
    to_u16(rows.len())
}

fn trouble_rows(cx: &ViewContext, width: u16, height: u16) -> Vec<(String, Style)> {
    let lines = history_text(cx).map(|trouble| wrap(&trouble, width.saturating_sub(2))).unwrap_or_default();
    let lines = lines.into_iter().take(usize::from(height / 3).max(1));
    lines.map(|line| (line, cx.theme.trouble())).collect()
}

/// Rows of a list on a tab of this size.
pub(super) fn room(cx: &ViewContext, width: u16, height: u16) -> usize {
    let height = height.saturating_sub(to_u16(trouble_rows(cx, width, height).len()));
    usize::from(height.saturating_sub(HEAD + below(cx, height))).max(1)
}

/// Rows of the guidance on a tab of this height.
fn guide(height: u16) -> u16 {
    height.saturating_sub(HEAD + 2).min(if height < 28 { 7 } else { 10 })
}

/// Rows below the list of a tab of this height: the guidance where it does not stand beside the list.
fn below(cx: &ViewContext, height: u16) -> u16 {
    match cx.size {
        Size::Tiny | Size::Compact => 0,
        Size::Narrow | Size::Normal => guide(height),
        // The legend.
        Size::Wide | Size::Overview => 1,
    }
}

/// The names of the views, each with how much is in it, and how much of that waits: nothing is hidden in another view.
fn views(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    let count = |page| {
        let (mut all, mut waiting) = (0, 0);
        for alarm in on_page(cx, page) {
            all += 1;
            waiting += usize::from(alarm.state.needs_acknowledgement());
        }
        (all, waiting)
    };
    let counts = Page::ALL.map(|page| match page {
        Page::Active | Page::System => Some(count(page)),
        Page::Suppressed => Some((cx.snapshot.suppressed.len(), 0)),
        Page::Journal | Page::Metrics | Page::Handover => None,
    });
    let names = |word: &str| -> Vec<String> {
        let name = |(page, count): (Page, Option<(usize, usize)>)| match count {
            None => page.title().to_owned(),
            Some((all, 0)) => format!("{} {all}", page.title()),
            Some((all, waiting)) => format!("{} {all} ({waiting}{word})", page.title()),
        };
        Page::ALL.into_iter().zip(counts).map(name).collect()
    };
    let bell = match cx.preferences.bell {
        Bell::Off => "",
        Bell::Once | Bell::Repeated => t!("bell"),
    };
    let room = canvas.width().saturating_sub(2 + width(bell));
    let fits = |names: &Vec<String>| names.iter().map(|name| width(name) + 3).sum::<u16>() <= room + 3;
    // Where there is no room for the word the brackets alone show how many wait.
    let all = Some(names(t!(" unack"))).filter(fits).unwrap_or_else(|| names(""));
    let bar = if fits(&all) { " │ " } else { "│" };
    let mut x = 1;
    // On the smallest screens the shown one alone has room.
    let others = Size::Compact < cx.size;
    for (page, name) in Page::ALL.into_iter().zip(all).filter(|(page, _)| others || *page == tab.page) {
        if x > 1 {
            x = canvas.text(x, 0, bar, cx.theme.dim());
        }
        let style = if page == tab.page { cx.theme.focus() } else { cx.theme.normal() };
        x = canvas.text(x, 0, &name, style);
    }
    let end = canvas.width().saturating_sub(1);
    canvas.text_right(end, 0, bell, cx.theme.strong());
}

fn list(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    let (width, height) = (canvas.width(), canvas.height());
    if cx.size < Size::Wide {
        return list_alone(tab, cx, canvas);
    }
    let beside = side::columns(width);
    list_alone(tab, cx, &mut canvas.part(0, 0, width - beside - 1, height));
    side::view(tab, cx, &mut canvas.part(width - beside - 1, 0, beside + 1, height));
}

fn list_alone(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let (width, height) = (canvas.width(), canvas.height());
    let rows = tab.rows(cx);
    let all = tab.of_page(cx).count();
    let place = tab.place(&rows);
    let below = below(cx, height + 1);
    let room = usize::from(height.saturating_sub(HEAD - 1 + below)).max(1);
    let first = first(place, rows.len(), room);
    filter_line(tab, cx, (&rows, all, first, room), canvas);
    let columns = AlarmColumns::new(&rows[first.min(rows.len())..], cx, room, width);
    canvas.text(1, 1, &columns.headings(), theme.dim());
    if rows.is_empty() {
        let words = match all {
            0 if tab.page == Page::System => t!("No active system alarms. j: journal."),
            0 => t!("No active alarms. j: journal."),
            _ => t!("No alarm matches the filter. Esc: show all."),
        };
        canvas.text(6.min(width / 10), 3, words, theme.normal());
        return;
    }
    for (y, n, row) in on_screen(&rows, first, room) {
        let y = y + 2;
        let priority = cx.def().alarm(row.alarm.id).priority;
        let style = theme.alarm(priority, row.alarm.state, false);
        let style = if n == place { style.patch(theme.focus()).fg(style.fg.unwrap_or_default()) } else { style };
        // A reversed full block is an empty one.
        let [before, bars, behind] = columns.cells(tab, cx, row);
        let x = canvas.text(1, y, &before, style);
        let x = canvas.text(x, y, &bars, style.remove_modifier(Modifier::REVERSED));
        canvas.text(x, y, &behind, style);
        if n != place {
            let mark = format!("{}{}", theme.priority_mark(priority), theme.state_mark(row.alarm.state));
            canvas.text(1, y, &mark, theme.alarm(priority, row.alarm.state, cx.flash()));
        }
        if tab.marked.contains(&row.alarm.id) {
            canvas.text(0, y, theme.pick("►", ">"), theme.strong());
        }
    }
    if columns.has_ribbon() {
        let words = theme.pick(
            t!("last 60 minutes: ▄ acknowledged █ unacknowledged"),
            t!("last 60 minutes: _ acknowledged # unacknowledged"),
        );
        canvas.text(1, height - 1, &fit_words(words, width - 2), theme.dim());
    }
    if below > 1 {
        let (used, selected) = (2 + to_u16(rows.len().min(room)), rows[place].alarm);
        let now = guidance_text::now_text(cx, selected);
        guidance_below(cx, canvas, (used, below), selected.id, Some(selected), now);
    }
}

/// The guidance below a list that uses so many rows: rows that it leaves empty are given to it, as far as it needs them.
fn guidance_below(
    cx: &ViewContext,
    canvas: &mut Canvas,
    (used, least): (u16, u16),
    alarm: AlarmId,
    listed: Option<&ActiveAlarm>,
    now: String,
) {
    let (width, height) = (canvas.width(), canvas.height());
    let needs = guidance::height(&guidance_text::rows_of_any(cx, alarm, now.clone(), listed), width);
    let rows = least.max(needs.min(height.saturating_sub(used)));
    guidance::view(cx, alarm, listed, now, &mut canvas.part(0, height.saturating_sub(rows), width, rows));
}

/// The filter in force, how many it shows of how many, and what is above and below the rows that are seen.
fn filter_line(
    tab: &Alarms,
    cx: &ViewContext,
    (rows, all, first, room): (&[AlarmRow], usize, usize, usize),
    canvas: &mut Canvas,
) {
    let theme = cx.theme;
    let folded: usize = rows.iter().filter(|row| row.folded).map(|row| row.more).sum();
    let shown = rows.len() + folded;
    let end = canvas.width().saturating_sub(1);
    let below = rows.len().saturating_sub(first + room);
    let more = match (first, below) {
        (0, 0) => String::new(),
        (0, below) => t!("{below} more below", below),
        (above, 0) => t!("{above} more above", above),
        (above, below) => t!("{above} above, {below} more below", above, below),
    };
    let mut words = Vec::new();
    if !tab.filter.is_off() {
        let describe = tab.filter.describe();
        words.push(t!("FILTER {describe}: {shown} of {all} shown, Esc shows all", describe, shown, all));
    }
    if folded > 0 {
        let arrow = theme.pick("→", "Right");
        words.push(t!("{folded} grouped, {arrow}: expand", folded, arrow));
    }
    if let marked @ 1.. = tab.marked.len() {
        words.insert(0, t!("{marked} marked, Esc: none", marked));
    }
    if tab.filter.is_off() && words.is_empty() && all > 0 {
        let sorted = match rows.iter().any(|row| row.first || row.under) {
            true => t!("grouped under the first-out alarm"),
            false => tab.sort.label(),
        };
        words.push(t!("{all} shown, {sorted}", all, sorted));
    }
    let room = end.saturating_sub(3 + width(&more));
    let style = if tab.filter.is_off() && tab.marked.is_empty() { theme.dim() } else { theme.strong() };
    canvas.text(1, 0, &fit_words(&words.join("   "), room), style);
    canvas.text_right(end, 0, &more, theme.strong());
}

fn suppressed(tab: &Alarms, cx: &ViewContext, canvas: &mut Canvas) {
    tab.suppressed.view(cx, canvas);
    let Some(alarm) = tab.suppressed.selected(cx) else { return };
    let (used, least) = (tab.suppressed.used(cx), guide_of_suppressed(cx));
    guidance_below(cx, canvas, (used, least), alarm.id, None, guidance_text::suppressed_words(cx, &alarm));
}

/// Rows below the views.
pub(super) fn body(cx: &ViewContext) -> u16 {
    let above = trouble_rows(cx, cx.area.width, cx.area.height).len();
    cx.area.height.saturating_sub(1 + to_u16(above))
}

/// Rows of the guidance below the suppressed alarms, at least.
pub(super) fn guide_of_suppressed(cx: &ViewContext) -> u16 {
    guide(body(cx) + 1).min(6)
}
