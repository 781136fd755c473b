//! Where the parts of the event page stand, and what is drawn there.

use jiff::Timestamp;
use ratatui::{Frame, layout::Rect};

use super::{EventPage, rows};
use crate::{
    plant::def::LineDef,
    t,
    ui::{
        ViewContext,
        layout::Size,
        tabs::{Tabs, bus, draw},
        widgets::{
            text::{Canvas, clock, fit, fit_words, pad, pad_left, width},
            value,
        },
    },
};

/// Least columns beside the mimic.
const SIDE: u16 = 36;
/// Least rows of the page with a mimic.
const TALL: u16 = 28;
/// Least rows of the journal, with its heading.
const JOURNAL: u16 = 8;
/// Rows of the frames and of the people, with their headings.
const FRAMES: u16 = 7;
const PEOPLE: u16 = 3;
/// Least rows of the page with curves.
const CURVES: u16 = 16;

/// The parts of the page; what has no room is empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Parts {
    mimic: Rect,
    curves: Rect,
    values: Rect,
    journal: Rect,
    frames: Rect,
    people: Rect,
}

/// On a wide screen the mimic stands over journal and frames, and beside it are curves, values and people; below that size
/// all stands in one column, without the mimic.
fn parts(area: Rect, size: Size, mimic: (u16, u16), values: u16) -> Parts {
    let none = Rect { width: 0, height: 0, ..area };
    if size < Size::Wide || area.height < TALL {
        let curves = if area.height < CURVES { 0 } else { area.height * 2 / 5 };
        let (people, frames) = (2, if area.height < CURVES { 3 } else { 4 });
        let (values, rest) = (1, area.height.saturating_sub(1 + curves + people + frames));
        let [values, curves, journal, frames, people] = stack(area, [values, curves, rest, frames, people]);
        return Parts { mimic: none, curves, values, journal, frames, people };
    }
    let least = area.width / 2;
    let columns = mimic.0.clamp(least, area.width.saturating_sub(SIDE + 1).max(least));
    let left = Rect { width: columns, ..area };
    let right = Rect { x: area.x + columns + 1, width: area.width - columns - 1, ..area };
    let picture = mimic.1.min(area.height.saturating_sub(JOURNAL + FRAMES));
    let [mimic, journal, frames] = stack(left, [picture, area.height - picture - FRAMES, FRAMES]);
    let values = values.min(area.height / 4);
    let people = (PEOPLE + 3).min(area.height / 6);
    let [curves, values, people] = stack(right, [area.height - values - people, values, people]);
    Parts { mimic, curves, values, journal, frames, people }
}

/// Parts of these heights, one below the other.
fn stack<const N: usize>(area: Rect, heights: [u16; N]) -> [Rect; N] {
    let mut y = area.y;
    heights.map(|height| {
        let part = Rect { y, height, ..area }.intersection(area);
        y = y.saturating_add(height);
        part
    })
}

impl EventPage {
    /// Draws it; what is compared with now is of the present.
    pub fn view(&self, cx: &ViewContext, present: &ViewContext, tabs: &Tabs, frame: &mut Frame, area: Rect) {
        let room = Rect { width: area.width.saturating_sub(SIDE + 1), height: area.height.saturating_sub(15), ..area };
        let size = if cx.def().mimic.pages.is_empty() { (0, 0) } else { tabs.mimic.size(cx, room) };
        let parts = parts(area, cx.size, size, rows(self.pens.len() + 2));
        if parts.mimic.height > 0 {
            tabs.mimic.draw_page(cx, frame, parts.mimic);
        }
        let buffer = frame.buffer_mut();
        if parts.journal.width < area.width {
            let mut canvas = Canvas::new(buffer, area);
            for y in 0..area.height {
                canvas.text(parts.journal.width, y, cx.theme.pick("┊", "|"), cx.theme.dim());
            }
        }
        self.curves(cx, &mut Canvas::new(buffer, parts.curves));
        self.values(cx, present, &mut Canvas::new(buffer, parts.values));
        self.journal(cx, &mut Canvas::new(buffer, parts.journal));
        frames(cx, present, &mut Canvas::new(buffer, parts.frames));
        self.people(cx, &mut Canvas::new(buffer, parts.people));
    }

    fn curves(&self, cx: &ViewContext, canvas: &mut Canvas) {
        if canvas.height() == 0 || self.pens.is_empty() {
            return;
        }
        let view = self.window(cx, canvas.width());
        draw::curves(
            cx,
            canvas,
            t!("curves"),
            (view, Some(cx.now)),
            &self.pens,
            self.curves.value.as_deref().unwrap_or_default(),
        );
    }

    /// The values then and now.
    fn values(&self, cx: &ViewContext, present: &ViewContext, canvas: &mut Canvas) {
        let values = self.pens.iter().map(|pen| {
            let name = cx.def().tag(pen.tag).name.as_str();
            (name, value::show(cx, pen.tag), value::show(present, pen.tag))
        });
        if canvas.height() < 3 {
            let mut x = 1;
            for (name, then, _) in values {
                let text = then.with_unit();
                if canvas.width() < x + width(name) + 1 + width(&text) {
                    return;
                }
                x = canvas.text(x, 0, name, cx.theme.dim()) + 1;
                x = canvas.text(x, 0, &text, then.style) + 3;
            }
            return;
        }
        let end = canvas.width().saturating_sub(1);
        let column = (end / 3).min(14);
        heading(cx, canvas, t!("values"));
        canvas.text_right(end.saturating_sub(column), 0, t!("then"), cx.theme.dim());
        canvas.text_right(end, 0, t!("now"), cx.theme.dim());
        for (n, (name, then, now)) in values.enumerate() {
            canvas.text(1, n + 1, &fit(name, end.saturating_sub(2 * column + 2)), cx.theme.normal());
            let then_text = pad_left(&fit(&then.with_unit(), column), column);
            canvas.text_right(end.saturating_sub(column), n + 1, &then_text, then.style);
            canvas.text_right(end, n + 1, &fit(&now.with_unit(), column.saturating_sub(1)), now.style);
        }
    }

    /// The journal around the instant, the last event until then marked.
    fn journal(&self, cx: &ViewContext, canvas: &mut Canvas) {
        heading(cx, canvas, t!("journal, one hour around"));
        let note = match (self.trouble(), self.is_cut()) {
            (Some(trouble), _) => trouble,
            (None, true) => t!("too many events: the oldest are missing"),
            (None, false) => "",
        };
        canvas.text_right(canvas.width().saturating_sub(1), 0, note, cx.theme.trouble());
        let entries = self.entries(cx);
        let room = usize::from(canvas.height().saturating_sub(1));
        if self.alarms.value.is_none() || self.actions.value.is_none() {
            canvas.text(1, 1, t!("collecting data"), cx.theme.dim());
            return;
        }
        let here = entries.partition_point(|entry| entry.at <= cx.now);
        // The instant has a row of its own among the events.
        let count = entries.len() + 1;
        let middle = here.saturating_add_signed(self.scroll).min(count - 1);
        let first = middle.saturating_sub(room / 2).min(count.saturating_sub(room));
        for (y, row) in (first..count).take(room).enumerate() {
            if row == here {
                let mark = cx.theme.pick("▶", ">");
                let text = t!("{mark} {time}  here", mark, time = cx.local(cx.now, "%T%.3f"));
                canvas.text(1, y + 1, &pad(&text, canvas.width().saturating_sub(2)), cx.theme.focus());
                continue;
            }
            let entry = &entries[if row < here { row } else { row - 1 }];
            let x = canvas.text(3, y + 1, &pad(&clock(entry.at, &cx.def().time_zone), 10), cx.theme.dim());
            let text = fit_words(&entry.text, canvas.width().saturating_sub(x + 1));
            canvas.text(x, y + 1, &text, entry.style);
        }
    }

    fn people(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let acted = self.acted().into_iter().map(|(name, count)| format!("{name} ({count})"));
        let acted = acted.collect::<Vec<_>>().join(", ");
        let acted = if acted.is_empty() { "–".to_owned() } else { acted };
        let logged_in = match (self.logged_in(), self.logins.query.is_on_way() || self.detached.query.is_on_way()) {
            (Some(sessions), _) if sessions.is_empty() => "–".to_owned(),
            (Some(sessions), _) => {
                let name = |(user, from): &(String, String)| format!("{user} {from}").trim().to_owned();
                sessions.iter().map(name).collect::<Vec<_>>().join(", ")
            }
            (None, true) => t!("collecting data").to_owned(),
            (None, false) => t!("the audit log is for a Supervisor").to_owned(),
        };
        let mut y = 0;
        if canvas.height() > 2 {
            heading(cx, canvas, t!("users"));
            y = 1;
        }
        let room = canvas.width().saturating_sub(2);
        let acted = t!("acted within 5 min: {acted}", acted);
        let logged_in = t!("logged in: {logged_in}", logged_in);
        for text in [logged_in, acted] {
            let lines = canvas.height().saturating_sub(y + u16::from(y <= 1));
            let wrapped = crate::ui::widgets::text::wrap(&text, room);
            let most = usize::from(lines.max(1)).min(2);
            for (n, line) in wrapped.iter().take(most).enumerate() {
                let line = if n + 1 == most && most < wrapped.len() {
                    fit_words(&format!("{line} …"), room)
                } else {
                    line.clone()
                };
                canvas.text(1, y, &line, cx.theme.normal());
                y += 1;
            }
        }
    }
}

fn heading(cx: &ViewContext, canvas: &mut Canvas, text: &str) {
    canvas.run(0, 0, canvas.width(), cx.theme.pick('╌', '-'), cx.theme.dim());
    canvas.text(1, 0, &format!(" {text} "), cx.theme.dim());
}

/// The frames around the instant, as long as the line remembers them.
fn frames(cx: &ViewContext, present: &ViewContext, canvas: &mut Canvas) {
    let Some((line, frames)) = kept(cx.now, present) else {
        heading(cx, canvas, t!("frames"));
        let oldest = present.snapshot.lines.iter().filter_map(|line| line.report.as_ref()?.frames.iter().next());
        let oldest = oldest.map(|frame| frame.at).min();
        let text = match oldest {
            Some(oldest) if cx.now < oldest => {
                t!("frames no longer kept: the oldest is from {at}", at = super::super::stamp(cx, oldest))
            }
            Some(_) | None => t!("no frames of that time").to_owned(),
        };
        canvas.text(1, 1, &fit_words(&text, canvas.width().saturating_sub(2)), cx.theme.dim());
        return;
    };
    heading(cx, canvas, &t!("frames of {line}", line = line.name));
    let (columns, rows) = (canvas.width(), canvas.height().saturating_sub(1));
    bus::frames_around(cx, (line.id, frames), cx.now, &mut canvas.part(0, 1, columns, rows));
}

/// The line whose kept frames reach to an instant, that with the latest frame until then.
fn kept<'a>(at: Timestamp, present: &'a ViewContext) -> Option<(&'a LineDef, &'a crate::plant::traffic::Frames)> {
    let lines = present.snapshot.def.lines.iter().zip(&present.snapshot.lines);
    let reaching = lines.filter_map(|(def, line)| {
        let frames = &line.report.as_ref()?.frames;
        let before = frames.iter().rev().find(|frame| frame.at <= at)?.at;
        frames.iter().next_back().filter(|last| at <= last.at)?;
        Some((before, def, frames))
    });
    reaching.max_by_key(|(before, ..)| *before).map(|(_, def, frames)| (def, frames))
}
