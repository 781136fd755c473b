//! What to do about an alarm, below the list and beside it: its texts, how urgent it is, and where to look.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        alarm::ActiveAlarm,
        def::{AlarmDef, AlarmId, Subject},
        station_fault::STATION,
    },
    ui::{modal::reason::subject, rights},
};

/// Columns of the names at the left, with a blank before and behind them.
pub fn names() -> u16 {
    let names = [t!("now"), t!("cause"), t!("effect"), t!("action"), t!("before"), t!("go to")];
    names.into_iter().map(|name| text::width(name) + 2).max().unwrap_or(0).max(9)
}

/// Is it a row of the action?
pub fn is_of_action(label: &str) -> bool {
    label.is_empty() || label == t!("action")
}

/// The rows of the screen that all of it needs, with its title and the way on.
pub fn height(rows: &[(&str, String)], width: u16) -> u16 {
    let room = width.saturating_sub(names() + 1);
    rows.iter().map(|(_, text)| to_u16(wrap(text, room).len())).sum::<u16>() + 2
}

/// Draws it; for a listed alarm with the keys that act on it, and how long there is to respond.
pub fn view(cx: &ViewContext, id: AlarmId, listed: Option<&ActiveAlarm>, now: String, canvas: &mut Canvas) {
    let def = cx.def().alarm(id);
    let respond = listed.and_then(|alarm| guidance_text::respond_text(cx, def, alarm));
    let style = |overdue| if overdue { cx.theme.trouble() } else { cx.theme.strong() };
    let respond = respond.map(|(words, overdue)| (format!(" {words} "), style(overdue)));
    let cut = title(cx, def, listed, respond, canvas);
    draw(cx, cut.as_deref(), &guidance_text::rows_of_any(cx, id, now, listed), &go_text(cx, def, listed), canvas);
}

/// Which alarm it is about; at the right how long there is to respond. Its whole name, where there was no room for that.
fn title(
    cx: &ViewContext,
    def: &AlarmDef,
    listed: Option<&ActiveAlarm>,
    respond: Option<(String, Style)>,
    canvas: &mut Canvas,
) -> Option<String> {
    let (width, theme) = (canvas.width(), cx.theme);
    canvas.run(0, 0, width, '─', theme.dim());
    let (words, style) = respond.unwrap_or_default();
    let end = width.saturating_sub(1);
    canvas.text_right(end, 0, &words, style);
    // On this tab `a` is for this alarm, which need not be the one of the banner.
    let mine = listed.is_some_and(|alarm| {
        alarm.state.needs_acknowledgement() && rights::missing(cx, &alarm.acknowledge()).is_none()
    });
    let ack = if mine { t!("a ack ") } else { "" };
    let name =
        format!(" {ack}{} {} {}", theme.priority_tag(def.priority), subject(cx, def.id), translate(&def.message));
    let whole = format!("{name} {}", guidance_text::condition_text(cx, def.id));
    let room = end.saturating_sub(text::width(&words) + 3);
    let shown =
        if text::width(whole.trim_end()) <= room { whole.trim_end().to_owned() } else { fit_words(&name, room) };
    canvas.text(1, 0, &format!("{shown} "), theme.strong());
    (room < text::width(&name)).then(|| name.trim_start().to_owned())
}

/// Draws the rows below the title, above them the `name` where the title has it only in part.
fn draw(cx: &ViewContext, name: Option<&str>, rows: &[(&str, String)], go: &str, canvas: &mut Canvas) {
    let theme = cx.theme;
    let (width, height) = (canvas.width(), canvas.height());
    let room = width.saturating_sub(names() + 1);
    let mut y = 1;
    for line in name.iter().flat_map(|name| wrap(name, width.saturating_sub(2))) {
        canvas.text(1, y, &line, theme.strong());
        y += 1;
    }
    // Where there is no room for all of it the action is shown whole, and one line of the others; the least wanted go.
    let free = usize::from(height.saturating_sub(1 + y));
    // More steps than rows end above the last row; the window has all of them.
    let last = height.saturating_sub(1);
    let mut rows: Vec<&(&str, String)> = rows.iter().collect();
    for least in [t!("effect"), t!("cause"), t!("now")] {
        if free < rows.len() {
            rows.retain(|(label, _)| *label != least);
        }
    }
    let lines: Vec<Vec<String>> = rows.iter().map(|(_, text)| wrap(text, room)).collect();
    let whole = lines.iter().map(Vec::len).sum::<usize>() <= free;
    let mut spare = free.saturating_sub(rows.len());
    for ((label, text), lines) in rows.iter().zip(lines) {
        let style = if is_of_action(label) { theme.strong() } else { theme.normal() };
        if y < last {
            canvas.text(1, y, label, theme.dim());
        }
        let shown = match (whole, is_of_action(label)) {
            (true, _) => lines,
            (false, true) => {
                let more = lines.len().saturating_sub(1).min(spare);
                spare -= more;
                lines.into_iter().take(1 + more).collect()
            }
            (false, false) => vec![fit_words(text, room)],
        };
        for line in shown {
            if y < last {
                canvas.text(names(), y, &line, style);
            }
            y += 1;
        }
    }
    canvas.text(1, last, t!("go to"), theme.dim());
    canvas.text(names(), last, &fit_words(go, room), theme.normal());
}

/// The keys that lead from an alarm to what it watches.
pub fn go_text(cx: &ViewContext, def: &AlarmDef, alarm: Option<&ActiveAlarm>) -> String {
    let at =
        alarm.map(|alarm| t!(" at {clock}", clock = clock(alarm.raised_at, &cx.def().time_zone))).unwrap_or_default();
    let journal = t!("j journal of {journal_of}", journal_of = journal_of(cx, def.subject));
    match def.subject {
        Subject::Tag(_) => t!("m mimic   t trend{at}   c controller   {journal}", at, journal),
        Subject::Device(_) => t!("m mimic   c controller   {journal}", journal),
        Subject::Line(_) | Subject::Station => journal,
    }
}

/// What the journal is searched for: the whole device, because its settings are what often makes the alarm of a tag.
pub fn journal_of<'a>(cx: &ViewContext<'a>, subject: Subject) -> &'a str {
    let def = cx.def();
    match subject {
        Subject::Tag(tag) => &def.device(def.tag(tag).device).name,
        Subject::Device(device) => &def.device(device).name,
        Subject::Line(line) => &def.line(line).name,
        Subject::Station => STATION,
    }
}
