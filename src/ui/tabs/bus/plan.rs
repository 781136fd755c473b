//! Page Plan: every block of the read plan with its addresses, its cost and how its reads end.

use super::{
    LineView, Window,
    line::{grouped, ms, short_ms},
    rows::{self, plain},
    window::{Shown, TextWindow},
};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::names,
    plant::{
        admission::Schedulability,
        line_report::{LineReport, PollReport},
        tag::{Poll, Table},
    },
};

/// Rows below the table that describe the selected block.
const DETAIL: u16 = 7;

/// Which block is selected.
#[derive(Debug, Default)]
pub struct Plan {
    selected: usize,
}

impl Plan {
    /// Moves the selection.
    pub fn scroll(&mut self, at: &LineView, motion: Motion, room: usize) {
        self.selected = motion.to(self.selected, at.report.map_or(0, |report| report.polls.len()), room);
    }

    /// The list that keys act on.
    pub fn drawn_rows(&self, at: &LineView) -> Rows {
        let polls = at.report.map_or(&[][..], |report| &report.polls);
        Rows::of(polls.iter().map(|poll| &poll.tags), self.selected)
    }

    /// Device, table and first address of the selected block.
    pub fn place(&self, at: &LineView) -> Option<(DeviceId, Table, u16)> {
        at.report?.polls.get(self.selected).map(|poll| (poll.device, poll.table, poll.address))
    }

    /// The tags of the selected block.
    pub fn open(&self, at: &LineView) -> Option<UiAction> {
        let poll = at.report?.polls.get(self.selected)?;
        let shown = Shown::Block { line: at.id, device: poll.device, table: poll.table, address: poll.address };
        Some(Window::Text(TextWindow::new(shown)).open())
    }

    /// Why the values of the selected block are what they are, beginning with one that is not good.
    pub fn why(&self, cx: &ViewContext, at: &LineView) -> Vec<UiAction> {
        let poll = at.report.and_then(|report| report.polls.get(self.selected));
        Why::open(Why::of_all(cx, poll.map(|poll| poll.tags.to_vec()).unwrap_or_default()))
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
        let theme = cx.theme;
        let Some(report) = at.report.filter(|report| !report.polls.is_empty()) else {
            let words = match at.settings.listens {
                true => t!("this line only listens: another master polls it"),
                false => t!("nothing is polled on this line yet"),
            };
            canvas.text(1, 0, words, theme.normal());
            return;
        };
        let (width, height) = (canvas.width(), canvas.height());
        let (summary, over) = summary(report);
        let style = if over { theme.trouble() } else { theme.normal() };
        canvas.text(1, 0, &fit_words(&summary, width.saturating_sub(14)), style);
        let lines: Vec<_> = report.polls.iter().map(|poll| cells(cx, poll)).collect();
        let (heading, lines) = rows::table(&COLUMNS, &lines, width.saturating_sub(2));
        canvas.text(1, 1, &heading, theme.dim());
        let room = usize::from(height.saturating_sub(2 + DETAIL)).max(1);
        let selected = self.selected.min(lines.len() - 1);
        let first = list::first(selected, lines.len(), room);
        for (y, n) in (first..lines.len()).take(room).enumerate() {
            canvas.text(1, 2 + to_u16(y), &lines[n], row_style(cx, n == selected, ill(&report.polls[n])));
        }
        let below = lines.len().saturating_sub(first + room);
        if 0 < below {
            canvas.text_right(width.saturating_sub(1), 0, &t!(" {below} more ▼", below), theme.strong());
        }
        let bottom = (2 + to_u16(lines.len().min(room))).min(height.saturating_sub(DETAIL - 1));
        let details = detail(cx, report, &report.polls[selected]);
        let style = |line: &str| if line.starts_with('!') { theme.trouble() } else { theme.normal() };
        let rows = details.iter().flat_map(|line| {
            let parts = wrap(line, width.saturating_sub(2));
            parts.into_iter().map(move |part| plain(part, style(line)))
        });
        let mut below = canvas.part(0, bottom + 1, width, height.saturating_sub(bottom + 1));
        rows::draw(cx, &mut below, &rows.collect::<Vec<_>>(), 0);
    }
}

const COLUMNS: [rows::Column; 15] = [
    rows::words("", 0),
    rows::words("device", 0),
    rows::words("function", 1),
    rows::words("registers", 0),
    rows::words("wire", 2),
    rows::number("n", 3),
    rows::number("tags", 8),
    rows::number("every", 2),
    rows::number("ms", 4),
    rows::number("next", 6),
    rows::number("ok", 1),
    rows::number("failed", 1),
    rows::number("reply", 3),
    rows::number("late", 7),
    rows::number("missed", 9),
];

fn cells(cx: &ViewContext, poll: &PollReport) -> [String; 15] {
    let (code, stats) = (poll.table.read_fc(), &poll.stats);
    let span = |span: Option<Duration>| span.map_or("–".to_owned(), short_ms);
    let next = poll.next.map_or("–".to_owned(), |next| format!("{:.1}", elapsed(cx.now, next).as_secs_f64()));
    [
        if ill(poll) { "!" } else { " " }.to_owned(),
        cx.def().device(poll.device).name.clone(),
        format!("{code} / 0x{code:02X}"),
        names::span(code, poll.address, poll.count),
        format!("0x{:04X}", poll.address),
        poll.count.to_string(),
        poll.tags.len().to_string(),
        pace(poll),
        short_ms(poll.cost),
        next,
        grouped(stats.ok),
        grouped(stats.requests - stats.ok),
        span(stats.response_time.last()),
        span(stats.jitter.max()),
        grouped(stats.missed),
    ]
}

/// `1 s`, `1 s ×1.3` where it is stretched, `left out`.
fn pace(poll: &PollReport) -> String {
    match (poll.shed, poll.factor) {
        (true, _) => t!("skipped").to_owned(),
        (false, factor) if factor < 1.05 => every(poll.poll),
        (false, factor) => format!("{} ×{factor:.1}", every(poll.poll)),
    }
}

/// `1 s`, `once`.
fn every(poll: Poll) -> String {
    match poll {
        Poll::Every(period) if period.subsec_nanos() == 0 => format!("{} s", period.as_secs()),
        Poll::Every(period) => ms(period),
        Poll::Once => t!("once").to_owned(),
        Poll::Never => t!("request").to_owned(),
    }
}

fn ill(poll: &PollReport) -> bool {
    poll.stats.failed_last() && 0 < poll.stats.requests
}

/// Blocks, load, and the schedulability of the admission test; `true` if they do not fit.
fn summary(report: &LineReport) -> (String, bool) {
    let (blocks, admission) = (report.polls.len(), &report.admission);
    let load = admission.utilisation * 100.0;
    let words = t!(
        "{blocks} {plural}, worst-case load {load} %",
        blocks,
        plural = plural(blocks, t!("block"), t!("blocks")),
        load = format!("{load:.0}")
    );
    let refused = match report.refused.len() {
        0 => String::new(),
        count => {
            t!("; {count} {plural} refused by the device", count, plural = plural(count, t!("tag is"), t!("tags are")))
        }
    };
    match &admission.schedulability {
        Schedulability::Fits => (t!("{words}: all periods are kept{refused}", words, refused), false),
        // The worst case is more than the line has; whether it comes to that, the schedule says.
        Schedulability::TooMuch { .. } => match report.strain {
            Some(_) => (t!("! {words}: OVERLOADED, polls skipped{refused}", words, refused), true),
            None => (t!("! {words}: more than the line has{refused}", words, refused), true),
        },
        Schedulability::Blocked(overload) => {
            let blocker = &overload.blocker.name;
            (t!("! {words}: some are delayed by {blocker}{refused}", words, blocker, refused), true)
        }
    }
}

/// `1 block`, `2 blocks`: the word for a count.
pub fn plural<'a>(count: usize, one: &'a str, many: &'a str) -> &'a str {
    if count == 1 { one } else { many }
}

/// What a read takes at worst, and what reads have taken.
fn worst_case(report: &LineReport, poll: &PollReport) -> String {
    let span = |span: Option<Duration>| span.map_or("–".to_owned(), short_ms);
    let device = report.device_time(poll.device);
    let device =
        device.map_or(String::new(), |time| t!(" (device {ms}, {source})", ms = ms(time.bound), source = time.source));
    let read = &poll.stats.read_time;
    t!(
        "read at worst {worst}{device}; median {median}, p99 {p99}, max {max} ms; deadline {deadline}, margin {margin} ms",
        worst = ms(poll.cost),
        device,
        median = span(read.median()),
        p99 = span(read.p99()),
        max = span(read.max()),
        deadline = every(poll.poll),
        margin = span(poll.margin())
    )
}

/// All that the table has no room for.
fn detail(cx: &ViewContext, report: &LineReport, poll: &PollReport) -> Vec<String> {
    let (device, code, stats) = (cx.def().device(poll.device), poll.table.read_fc(), &poll.stats);
    let last = poll.address.saturating_add(poll.count.saturating_sub(1));
    let used: u16 = poll.tags.iter().map(|tag| cx.def().tag(*tag).point.len()).sum();
    let over = poll.count.saturating_sub(used);
    let over = if over == 0 { String::new() } else { t!(", {over} gap registers read", over) };
    let span = |span: Option<Duration>| span.map_or("–".to_owned(), short_ms);
    let late = stats
        .jitter
        .max()
        .map_or(t!("no polling delay").to_owned(), |late| t!("polling delay at most {ms}", ms = ms(late)));
    let dead = report.admission.dead_cost(poll.device);
    let dead = dead.map_or(String::new(), |cost| {
        t!("; while {name} does not respond, a probe takes {ms}", name = device.name, ms = ms(cost))
    });
    let mut lines = vec![
        t!(
            "{name} unit {unit}, {code} / 0x{code2} {function}: {span} = wire {address}–{last} (0x{address2}–0x{last2}), {count} {plural}{over}",
            name = device.name,
            unit = device.unit,
            code,
            code2 = format!("{code:02X}"),
            function = translate(names::function(code).unwrap_or_default()),
            span = names::span(code, poll.address, poll.count),
            address = poll.address,
            last,
            address2 = format!("{:04X}", poll.address),
            last2 = format!("{last:04X}"),
            count = poll.tags.len(),
            plural = plural(poll.tags.len(), t!("tag"), t!("tags")),
            over
        ),
        t!(
            "reply {span} ms, p99 {span2}, max {span3}; {late}; missed {grouped}; retries {grouped2}{dead}",
            span = span(stats.response_time.last()),
            span2 = span(stats.response_time.p99()),
            span3 = span(stats.response_time.max()),
            late,
            grouped = grouped(stats.missed),
            grouped2 = grouped(stats.retries),
            dead
        ),
    ];
    lines.push(worst_case(report, poll));
    let fault = poll.tags.iter().find_map(|tag| {
        let exchange = cx.snapshot.source_frames.get(tag.index())?.as_ref()?;
        exchange.outcome.err()
    });
    if let Some(fault) = fault.filter(|_| ill(poll)) {
        let (failed, of) = stats.recent();
        lines.push(t!("! {fault}; {failed} of the last {of} failed", fault, failed, of));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::Fixture;

    #[test]
    fn only_what_is_skipped_is_said_to_be() {
        let mut report = LineReport::new(Fixture::normal().def.lines[0].clone());
        report.admission.schedulability = Schedulability::TooMuch { utilisation: 1.97 };
        let (words, over) = summary(&report);
        assert!(over && words.contains("more than the line has") && !words.contains("skipped"), "{words}");
        report.strain = Some("line overloaded: identification polls skipped".to_owned());
        let (words, over) = summary(&report);
        assert!(over && words.contains("OVERLOADED, polls skipped"), "{words}");
    }
}
