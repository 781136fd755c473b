//! What every tab shares: header, tab bar, alarm banner, the last command's outcome, and the keys of the moment.

mod header;
mod banner;
mod footer;
mod past;

use crate::t;
use crate::text::translate;
use header::header;
use ratatui::{Frame, layout::Position, style::Style};

use banner::banner;
use footer::Footer;

use super::{
    LastCommand, Model, SILENCE, ViewContext,
    command_text::{command_label, outcome_words},
    keys::{Chord, Hint},
    layout::{Size, layout},
    modal::Modal,
    tabs::Tab,
    widgets::text::{Canvas, clock, fit, fit_words, running, width},
};
use crate::plant::{command::Outcome, def::LineDef, line_state::LineState, number::to_u16};

/// Draws the whole screen.
pub fn view(model: &Model, frame: &mut Frame) {
    let parts = layout(frame.area());
    let present = &super::model_context::present_context(model, frame.area());
    banner(model, present, &mut Canvas::new(frame.buffer_mut(), parts.banner));
    if let Some(least) = model.lacks_room() {
        return too_small(model, present, least, frame);
    }
    header(model, present, &mut Canvas::new(frame.buffer_mut(), parts.header));
    let cx = &super::model_context::context(model, frame.area());
    tab_bar(model, cx, &mut Canvas::new(frame.buffer_mut(), parts.tabs));
    past::rule(model, cx, &mut Canvas::new(frame.buffer_mut(), parts.rule));
    match model.replay.page() {
        Some(page) => page.view(cx, present, &model.tabs, frame, parts.body),
        None => model.tabs.shown().view(cx, frame, parts.body),
    }
    status(model, cx, &mut Canvas::new(frame.buffer_mut(), parts.status));
    if let Some(tour) = &model.tour {
        // The line above the tab says which past is shown; the smallest screen has none.
        let row = if cx.is_past() || parts.rule.is_empty() { parts.status } else { parts.rule };
        tour.view(cx, &mut Canvas::new(frame.buffer_mut(), row));
    }
    Footer::new(model, cx, parts.footer.width).view(cx, &mut Canvas::new(frame.buffer_mut(), parts.footer));
    if let Some(modal) = &model.modal {
        // On the smallest screen a window has all rows below the banner but that of the keys.
        let room = if cx.size <= Size::Compact { parts.body.union(parts.status) } else { parts.body };
        modal.view(cx, frame, room);
    }
}

/// The keys of a screen without a row for the tabs: those that lead to the others, then those of the list.
fn compact_hints(model: &Model, cx: &ViewContext) -> Vec<Hint> {
    let others = Tab::offered(cx).into_iter().filter(|tab| *tab != model.tabs.shown);
    let others = others.map(|tab| Hint::new(tab.number().to_string(), translate(tab.title()), tab.help()));
    others.chain(model.tabs.shown().hints(cx).into_iter().filter(|hint| hint.needs.is_none())).collect()
}

/// All that is left below the banner of a screen of less than this size: its size and how to leave.
fn too_small(model: &Model, cx: &ViewContext, (width, height): (u16, u16), frame: &mut Frame) {
    let area = frame.area();
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let size = t!("too small: {width}x{height}", width = area.width, height = area.height);
    let words = [
        t!("screen {size}, needs {width}x{height}", size, width, height),
        t!("{size}, needs {width}x{height}", size, width, height),
        size,
    ];
    let fits = words.iter().find(|words| super::widgets::text::width(words) <= area.width);
    canvas.text(0, 1, fits.map_or(t!("too small"), String::as_str), cx.theme.normal());
    // The confirmation stands above the size where there are too few rows for both.
    match &model.modal {
        Some(Modal::Confirm(confirm)) if confirm.is_quit() => {
            let y = if area.height > 2 { 2 } else { area.height.saturating_sub(1) };
            canvas.run(0, y, area.width, ' ', cx.theme.normal());
            canvas.text(0, y, &cx.theme.enter(t!("Quit? ⏎ quit  Esc cancel")), cx.theme.strong());
        }
        Some(_) | None => {
            canvas.text(0, 2, t!("q quit"), cx.theme.dim());
        }
    }
}

/// The key of the footer at this place.
pub fn chord_at(model: &Model, at: Position) -> Option<Chord> {
    let parts = layout(model.screen);
    let footer = parts.footer.contains(at).then(|| Footer::new(model, &model.cx(), parts.footer.width));
    footer.and_then(|footer| footer.chord_at(at.x - parts.footer.x))
}

/// The tab whose heading is at this place.
pub fn tab_at(model: &Model, at: Position) -> Option<Tab> {
    let bar = layout(model.screen).tabs;
    let headings = if bar.contains(at) { headings(model, &model.cx(), bar.width) } else { Vec::new() };
    let at_place = headings.into_iter().find(|(x, _, name)| (*x..*x + width(name)).contains(&(at.x - bar.x)));
    at_place.map(|(_, tab, _)| tab)
}

fn tab_bar(model: &Model, cx: &ViewContext, canvas: &mut Canvas) {
    for (x, tab, name) in headings(model, cx, canvas.width()) {
        if x > 0 {
            canvas.text(x - 1, 0, "│", cx.theme.dim());
        }
        canvas.text(x, 0, &name, cx.theme.tab(tab == model.tabs.shown));
    }
}

fn headings(model: &Model, cx: &ViewContext, columns: u16) -> Vec<(u16, Tab, String)> {
    let name = |tab: Tab| {
        let count = if tab == Tab::Alarms { cx.snapshot.alarms.len() } else { 0 };
        let count = if count > 0 { format!(" {count}") } else { String::new() };
        format!("{} {}{count}", tab.number(), translate(tab.title()))
    };
    let names: Vec<(Tab, String)> = Tab::offered(cx).into_iter().map(|tab| (tab, name(tab))).collect();
    // Where there is no room for blanks around the names they stand closer; then all but the shown one are cut alike.
    let needs = |blanks: u16| names.iter().map(|(_, name)| width(name) + blanks).sum::<u16>() + to_u16(names.len());
    let blank = if needs(2) <= columns + 1 { " " } else { "" };
    let longest = names.iter().map(|(_, name)| width(name)).max().unwrap_or(0);
    let cut = |most: u16| {
        let cut = |(tab, name): &(Tab, String)| match *tab == model.tabs.shown || *tab == Tab::Alarms {
            true => (*tab, name.clone()),
            false => (*tab, fit(name, most)),
        };
        names.iter().map(cut).collect::<Vec<_>>()
    };
    let fits = |names: &Vec<(Tab, String)>| names.iter().map(|(_, name)| width(name) + 1).sum::<u16>() <= columns + 1;
    let names = (3..=longest).rev().map(cut).find(fits).unwrap_or_else(|| cut(3));
    let heading = |x: &mut u16, (tab, name): (Tab, String)| {
        let (at, name) = (*x, format!("{blank}{name}{blank}"));
        *x += width(&name) + 1;
        Some((at, tab, name))
    };
    names.into_iter().scan(0, heading).collect()
}

fn status(model: &Model, cx: &ViewContext, canvas: &mut Canvas) {
    let length = canvas.width();
    past::line(cx, canvas);
    if let Some(note) = &model.note {
        canvas.text(1, 0, &format!(" {} ", fit_words(note, length.saturating_sub(4))), cx.theme.strong());
    } else if let Some(words) = past::words(model, cx).filter(|_| cx.is_past() || !is_urgent(model)) {
        canvas.text(1, 0, &format!(" {} ", fit_words(&words, length.saturating_sub(4))), cx.theme.strong());
    } else if let Some(pending) = &model.last_command {
        let (text, style) = last_command_label(cx, pending);
        let room = length.saturating_sub(4);
        // The time stays whatever must be cut: an old outcome is not a new one.
        let text = match &pending.status {
            Some(status) if width(&text) > room => {
                let at = clock(status.at, &cx.def().time_zone);
                format!("{at} {}", fit_words(&text, room.saturating_sub(width(&at) + 1)))
            }
            Some(_) | None => fit_words(&text, room),
        };
        canvas.text(1, 0, &format!(" {text} "), style);
    }
}

/// Has the last command an outcome that must be read?
fn is_urgent(model: &Model) -> bool {
    model.last_command.as_ref().is_some_and(LastCommand::is_trouble)
}

/// A command and how it stands: `TIC-1.SV 60.0 → 70.0 °C verified 13:40:02`.
fn last_command_label(cx: &ViewContext, pending: &LastCommand) -> (String, Style) {
    let theme = cx.theme;
    // As the station took it: a write of what the device can hold.
    let (kind, old) =
        pending.status.as_ref().map_or((&pending.command.kind, None), |status| (&status.command.kind, status.old));
    let what = command_label(cx, kind, old);
    let Some(status) = &pending.status else {
        return match &pending.undelivered {
            Some(why) => (t!("{what}  NOT SENT: {why}", what, why), theme.trouble()),
            None => (t!("{what}  sent …", what), theme.normal()),
        };
    };
    let (words, trouble) = match &status.outcome {
        Outcome::Verified => (status.outcome_text(), false),
        outcome => outcome_words(outcome),
    };
    let at = clock(status.at, &cx.def().time_zone);
    let (words, trouble) = match status.recorded || status.is_pending() {
        true => (words, trouble),
        // Done all the same: the disk has not taken it yet.
        false => (t!("{words}, NOT RECORDED", words), true),
    };
    (format!("{what}  {words} {at}"), if trouble { theme.trouble() } else { theme.done() })
}
