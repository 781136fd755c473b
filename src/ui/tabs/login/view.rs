//! The view of the login page: the banner, the form or who is in, and the most urgent alarms, which never hide.

use super::Login;
use crate::text::Locale;
use crate::ui::tabs::prelude::*;
use crate::ui::{
    alarm_text::{alarm_words, counts},
    rights,
};

/// Widest text to be read.
const READ_MAX: u16 = 72;
/// Rows that the alarms have at least, heading included.
const ALARM_ROWS_MIN: u16 = 4;

pub(super) fn draw(login: &Login, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let (width, height) = (canvas.width(), canvas.height());
    let room = width.saturating_sub(6).min(READ_MAX);
    // A low screen has room for the form and the most urgent alarm.
    let least = if height < 14 { 2 } else { ALARM_ROWS_MIN };
    let above = height.saturating_sub(least);
    if least > 2 && cx.theme.has_all_letters() {
        // A user who does not read this language recognises the name of another one.
        let other = Locale::current().language.next().name();
        canvas.text_right(width.saturating_sub(1), 0, &format!("Ctrl-T {other}"), cx.theme.dim());
    }
    let mut part = canvas.part(3, u16::from(least > 2), room, above);
    let form = login.form.as_ref().map_or(0, |form| form.height(cx, room) + 4);
    let mut y = banner(cx, &mut part, above.saturating_sub(form));
    y = match &login.form {
        Some(form) => {
            part.text(0, y, &heading(cx, &form.title()), cx.theme.strong());
            let (width, height) = (part.width(), part.height());
            let mut rest = part.part(0, y + 2, width, height.saturating_sub(y + 2));
            y + 2 + form.draw(cx, &mut rest)
        }
        None => who(login, cx, &mut part, y),
    };
    if let Some(outcome) = &login.outcome {
        let (words, style) = match outcome {
            Ok(words) => (*words, cx.theme.done()),
            Err(why) => (why.as_str(), cx.theme.trouble()),
        };
        part.text(0, y + 1, &fit_words(words, room), style);
        y += 2;
    }
    let top = (y + 2).min(above);
    alarms(cx, &mut canvas.part(0, top, width, height - top));
}

/// The heading of the form; on a locked terminal it names the user who locked it.
fn heading(cx: &ViewContext, title: &str) -> String {
    match &cx.session.who {
        Some(who) if cx.session.locked => t!("{title} as a user other than {user}", title, user = who.user),
        Some(_) | None => title.to_owned(),
    }
}

/// What must be read before a login, in so many rows at the most; returns the row after it.
fn banner(cx: &ViewContext, canvas: &mut Canvas, most: u16) -> u16 {
    let Some(banner) = cx.session.banner.as_ref().filter(|_| cx.session.who.is_none()) else { return 0 };
    let most = usize::from(most.max(1));
    let mut lines: Vec<String> = banner.lines().flat_map(|line| wrap(line, canvas.width())).collect();
    if lines.len() > most {
        lines.truncate(most);
        // That it goes on must be seen; a larger screen shows it.
        lines.last_mut().into_iter().for_each(|line| line.push_str(" …"));
    }
    for (y, line) in lines.iter().enumerate() {
        canvas.text(0, to_u16(y), &fit_words(line, canvas.width()), cx.theme.normal());
    }
    to_u16(lines.len()) + 1
}

/// The user, since when, and its rights; returns the row after it.
fn who(login: &Login, cx: &ViewContext, canvas: &mut Canvas, y: u16) -> u16 {
    let theme = cx.theme;
    let Some(who) = &cx.session.who else { return y };
    let x = canvas.text(0, y, &who.user, theme.strong());
    let x = canvas.text(x + 2, y, rights::title(who.role), theme.normal());
    if let Some((_, since)) = &login.since {
        canvas.text(x + 2, y, &t!("since {clock}", clock = clock(*since, &cx.def().time_zone)), theme.dim());
    }
    let mut y = y + 1;
    for line in wrap(&t!("may {words}", words = rights::words(who.role)), canvas.width()) {
        canvas.text(0, y, &line, theme.normal());
        y += 1;
    }
    let lock = match cx.session.idle_lock {
        Some(idle) => t!("This terminal locks after {running} without a key.", running = running(idle)),
        None => t!("This terminal does not lock automatically.").to_owned(),
    };
    canvas.text(0, y, &lock, theme.dim());
    y + 1
}

/// The most urgent alarms, as many as fit.
fn alarms(cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let all = &cx.snapshot.alarms;
    let width = canvas.width();
    canvas.run(0, 0, width, '─', theme.dim());
    let title = if all.is_empty() {
        t!(" alarms: none ").to_owned()
    } else {
        t!(" alarms {count}  {counts} ", count = all.len(), counts = counts(cx))
    };
    canvas.text(1, 0, &title, theme.dim());
    let rows = usize::from(canvas.height().saturating_sub(1));
    let shown = draw::shown(cx, canvas, all.len(), rows);
    for (y, alarm) in all.iter().take(shown).enumerate() {
        let (y, def) = (to_u16(y) + 1, cx.def().alarm(alarm.id));
        let mark = theme.alarm(def.priority, alarm.state, cx.flash());
        let x = canvas.text(1, y, theme.priority_mark(def.priority), mark) + 1;
        let text = fit_words(&alarm_words(cx, alarm), width.saturating_sub(x));
        canvas.text(x, y, &text, theme.alarm(def.priority, alarm.state, false));
    }
}
