//! Page Plan: every block of the read plan with its addresses, its cost and how its reads end.

use super::{LineView, Shown, TextWindow, Window, line::grouped, ms, short_ms};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::pdu,
    plant::{
        admission::Schedulability,
        line_report::{LineReport, PollReport},
        tag::{Poll, Table},
    },
};

pub type Plan = List<Blocks>;

/// The blocks of the read plan of a line.
#[derive(Debug)]
pub struct Blocks {
    pub line: LineId,
}

impl Blocks {
    fn report<'a>(&self, cx: &ViewContext<'a>) -> Option<&'a LineReport> {
        LineView::new(cx, self.line)?.report
    }
}

impl Listing for Blocks {
    type Answer = ();
    type Row = PollReport;
    type Id = (DeviceId, Table, u16);

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        let heading = Heading::new(
            "",
            match cx.def().listens_on(self.line) {
                true => t!("this line only listens: another master polls it"),
                false => t!("nothing is polled on this line yet"),
            },
        );
        let Some(report) = self.report(cx).filter(|report| !report.polls.is_empty()) else { return heading };
        let (summary, over) = summary(report);
        heading.words(summary, row_style(cx, false, over))
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, PollReport>> {
        self.report(cx).into_iter().flat_map(|report| &report.polls).map(Cow::Borrowed).collect()
    }

    fn id(poll: &PollReport) -> (DeviceId, Table, u16) {
        (poll.device, poll.table, poll.address)
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<PollReport>> {
        fn span(span: Option<Duration>) -> String {
            span.map_or("–".to_owned(), short_ms)
        }
        vec![
            Column::words("", |_, poll| if ill(poll) { "!" } else { " " }.to_owned()),
            Column::words(t!("device"), |cx, poll: &PollReport| cx.def().device(poll.device).name.clone()),
            Column::words(t!("function"), |_, poll: &PollReport| {
                let code = poll.table.read_fc();
                format!("{code} / 0x{code:02X}")
            })
            .rank(1),
            Column::words(t!("registers"), |_, poll: &PollReport| {
                pdu::span(poll.table.read_fc(), poll.address, poll.count)
            })
            .by(|a, b| (a.table, a.address).cmp(&(b.table, b.address))),
            Column::words(t!("wire"), |_, poll: &PollReport| format!("0x{:04X}", poll.address))
                .rank(2)
                .by(|a, b| a.address.cmp(&b.address)),
            Column::number(t!("n"), |_, poll: &PollReport| poll.count.to_string()).rank(3),
            Column::number(t!("tags"), |_, poll: &PollReport| poll.tags.len().to_string()).rank(8),
            Column::number(t!("every"), |_, poll| pace(poll)).rank(2),
            Column::number(t!("ms"), |_, poll: &PollReport| short_ms(poll.cost)).rank(4).by(|a, b| a.cost.cmp(&b.cost)),
            Column::number(t!("next"), |cx, poll: &PollReport| {
                poll.next.map_or("–".to_owned(), |next| format!("{:.1}", elapsed(cx.now, next).as_secs_f64()))
            })
            .rank(6)
            .by(|a, b| a.next.cmp(&b.next)),
            Column::number(t!("ok"), |_, poll: &PollReport| grouped(poll.stats.ok))
                .rank(1)
                .by(|a, b| a.stats.ok.cmp(&b.stats.ok)),
            Column::number(t!("failed"), |_, poll: &PollReport| grouped(failed(poll)))
                .rank(1)
                .by(|a, b| failed(a).cmp(&failed(b))),
            Column::number(t!("reply"), |_, poll: &PollReport| span(poll.stats.response_time.last()))
                .rank(3)
                .by(|a, b| a.stats.response_time.last().cmp(&b.stats.response_time.last())),
            Column::number(t!("late"), |_, poll: &PollReport| span(poll.stats.jitter.max()))
                .rank(7)
                .by(|a, b| a.stats.jitter.max().cmp(&b.stats.jitter.max())),
            Column::number(t!("missed"), |_, poll: &PollReport| grouped(poll.stats.missed))
                .rank(9)
                .by(|a, b| a.stats.missed.cmp(&b.stats.missed)),
        ]
    }

    fn style(&self, cx: &ViewContext, poll: &PollReport) -> Style {
        row_style(cx, false, ill(poll))
    }

    fn details(&self, cx: &ViewContext, poll: &PollReport, _: Option<&()>) -> Vec<(String, Style)> {
        let lines = self.report(cx).map_or(Vec::new(), |report| detail(cx, report, poll));
        let styled = |line: String| {
            let style = row_style(cx, false, line.starts_with('!'));
            (line, style)
        };
        lines.into_iter().map(styled).collect()
    }

    /// The pages and the line stand above.
    fn height(&self, cx: &ViewContext) -> u16 {
        cx.area.height.saturating_sub(1)
    }
}

impl Plan {
    /// Device, table and first address of the selected block.
    pub fn block(&self, cx: &ViewContext) -> Option<(DeviceId, Table, u16)> {
        self.selected(cx).map(|poll| Blocks::id(&poll))
    }

    /// The tags of the selected block.
    pub fn open(&self, cx: &ViewContext) -> Option<UiAction> {
        let (device, table, address) = self.block(cx)?;
        let shown = Shown::Block { line: self.of.line, device, table, address };
        Some(Window::Text(TextWindow::new(shown)).open())
    }

    /// Why the values of the selected block are what they are, beginning with one that is not good.
    pub fn why(&self, cx: &ViewContext) -> Vec<UiAction> {
        let tags = self.selected(cx).map(|poll| poll.tags.to_vec());
        Why::open(Why::of_all(cx, tags.unwrap_or_default()))
    }
}

fn failed(poll: &PollReport) -> u64 {
    poll.stats.requests - poll.stats.ok
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
            function = translate(pdu::name(code).unwrap_or_default()),
            span = pdu::span(code, poll.address, poll.count),
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
