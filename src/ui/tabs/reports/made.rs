//! The reports that the station makes by itself: each with its state, its file and how to fetch it, and the selected one as text.

use super::{Key, Reports};
use crate::ui::tabs::prelude::*;
use crate::{
    history::MadeReports,
    plant::report::{ReportEvent, ReportKey, ReportRecord},
    report::{Period, ShiftReport, automatic::is_given_up, calendar, content, language, text::lines},
};

/// Keys of the list.
pub const LIST: &[&[Key]] = &[
    &motions!("select", |reports: &mut Reports, cx: &ViewContext, motion| reports.made.select(cx, motion)),
    &[
        Key::change(code(KeyCode::Enter), "text", "the selected report as text", |reports, cx| {
            reports.made.open = reports.made.selected().map(|report| opened(cx, report));
        }),
        Key::change(char('r'), "shifts", "the reports of shifts", |reports, _| reports.made.shown = false),
    ],
];
/// Keys of the text.
pub const TEXT: &[&[Key]] = &[
    &motions!("", |reports: &mut Reports, cx: &ViewContext, motion| reports.made.scroll(cx, motion)),
    &[Key::change(char('r'), "list", "back to the list of automatic reports", |reports, _| reports.made.open = None)],
];

/// Rows of the list.
const ROWS: usize = 500;
/// How often the list is refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;
/// A report over weeks may take its time.
const REPORT_TIMEOUT_S: f64 = 60.0;
/// Columns of a text report.
const WIDTH: u16 = 80;

/// State of the page.
#[derive(Debug, Default)]
pub struct Made {
    /// It is shown in place of a report.
    pub shown: bool,
    pub list: Answered<MadeReports>,
    selected: Selected<ReportKey>,
    /// The report that is shown as text, in place of the list.
    pub open: Option<Opened>,
}

/// A report that is shown as text.
#[derive(Debug)]
pub struct Opened {
    period: Period,
    pub report: Answered<Box<ShiftReport>>,
    scroll: Scroll,
}

impl Opened {
    fn lines(&self, cx: &ViewContext) -> Vec<String> {
        let width = cx.area.width.min(WIDTH).into();
        let document = |report: &ShiftReport| content::document(report, cx.def(), language(cx.def()).locale());
        self.report.value.as_ref().map(|report| lines(&document(report), width)).unwrap_or_default()
    }
}

impl Made {
    /// The keys of the moment.
    pub fn keys(&self) -> &'static [&'static [Key]] {
        if self.open.is_some() { TEXT } else { LIST }
    }

    fn rows(&self) -> &[ReportRecord] {
        self.list.value.as_ref().map_or(&[], |made| &made.reports)
    }

    fn place(&self) -> usize {
        self.selected.place(self.rows().iter().map(ReportRecord::key))
    }

    fn selected(&self) -> Option<&ReportRecord> {
        self.rows().get(self.place())
    }

    fn select(&mut self, cx: &ViewContext, motion: Motion) {
        let keys: Vec<_> = self.rows().iter().map(ReportRecord::key).collect();
        self.selected.on(motion, keys, room(cx.area.height));
    }

    fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let Some(open) = &mut self.open else { return };
        let count = open.lines(cx).len();
        open.scroll.on(motion, count, usize::from(cx.area.height.saturating_sub(2)).max(1));
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Vec<UiAction> {
        let number = (Tab::Reports, number);
        let query = match &mut self.open {
            Some(Opened { period, report, .. }) => {
                let query = Query::Report { period: period.clone() };
                report.ask(cx, number, SignedDuration::MAX, real(cx, REPORT_TIMEOUT_S), query)
            }
            None => {
                let query = Query::Reports { limit: ROWS };
                self.list.ask(cx, number, real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
            }
        };
        query.into_iter().collect()
    }

    /// The line that fetches the selected file, to be copied.
    pub fn copied(&self) -> Vec<String> {
        let made = self.list.value.as_ref();
        let line = |report| made.and_then(|made| fetch(made, report));
        self.selected().and_then(line).into_iter().collect()
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        match &self.open {
            Some(open) => draw_text(open, cx, &mut canvas),
            None => self.draw_list(cx, &mut canvas),
        }
    }

    fn draw_list(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let (theme, columns) = (cx.theme, canvas.width());
        let x = canvas.text(1, 0, t!("Automatic reports  "), theme.strong());
        if let Some(trouble) = &self.list.trouble {
            canvas.text(x, 0, &fit(trouble, columns.saturating_sub(x + 1)), theme.trouble());
        }
        let (place, room) = (self.place(), room(canvas.height()));
        let Some(selected) = self.selected() else {
            let waiting = self.list.query.shown_waiting(cx);
            let none = if cx.def().report.automatic.is_empty() {
                t!("The plant file asks for none: see `sightglass help reports`.")
            } else {
                t!("No report was made yet.")
            };
            let words =
                if self.list.value.is_some() { none } else { waiting.as_deref().unwrap_or(t!("collecting data")) };
            wrap(words, columns.saturating_sub(3)).iter().zip(2..).for_each(|(line, y)| {
                canvas.text(2, y, line, theme.dim());
            });
            return;
        };
        let names = [t!("period"), t!("format"), t!("state"), t!("since"), t!("file")];
        canvas.text(1, 1, &fit(&draw::columns(WIDTHS, names), columns), theme.dim());
        for (y, n, report) in on_screen(self.rows(), first(place, self.rows().len(), room), room) {
            let style = match (n == place, has_failed(report)) {
                (true, _) => theme.focus(),
                (false, true) => theme.trouble(),
                (false, false) => theme.normal(),
            };
            canvas.text(0, y + 2, &pad(&format!(" {}", row(cx, report)), columns), style);
        }
        let y = to_u16(room.min(self.rows().len())) + 3;
        let made = self.list.value.as_ref();
        let fetch = made.and_then(|made| fetch(made, selected)).map(|line| t!("y copies: {line}", line));
        let sha = (!selected.sha256.is_empty()).then(|| format!("SHA-256 {}", selected.sha256));
        let why = selected.error.as_ref().map(|why| t!("{why}, {n} times", why, n = selected.attempts.max(1)));
        let details = [(why, theme.trouble()), (fetch, theme.normal()), (sha, theme.dim())];
        let lines = details.into_iter().flat_map(|(text, style)| {
            let lines = wrap(&text.unwrap_or_default(), columns.saturating_sub(2));
            lines.into_iter().filter(|line| !line.is_empty()).map(move |line| (line, style))
        });
        for ((line, style), y) in lines.zip(y..canvas.height()) {
            canvas.text(1, y, &line, style);
        }
    }
}

/// Rows of the list on a tab of this height: the rest is about the selected one.
fn room(height: u16) -> usize {
    usize::from(height).saturating_sub(7).max(3)
}

const WIDTHS: [i16; 5] = [24, 8, 21, 13, 0];

fn row(cx: &ViewContext, report: &ReportRecord) -> String {
    let since = moment(report.at, cx.now, &cx.def().time_zone);
    let name = report.file.rsplit('/').next().unwrap_or_default();
    draw::columns(WIDTHS, [&report.name, &report.format, state(report), &since, name])
}

fn state(report: &ReportRecord) -> &'static str {
    if is_given_up(report) { t!("NOT DELIVERED") } else { translate(report.event.word()) }
}

fn has_failed(report: &ReportRecord) -> bool {
    matches!(report.event, ReportEvent::NotMade | ReportEvent::DeliveryFailed)
}

/// The command that fetches a file from this machine.
fn fetch(made: &MadeReports, report: &ReportRecord) -> Option<String> {
    let is_there = match report.event {
        ReportEvent::Made | ReportEvent::Delivered | ReportEvent::DeliveryFailed | ReportEvent::LeftAlone => true,
        ReportEvent::NotMade | ReportEvent::Deleted => false,
    };
    let plain = |letter: char| letter.is_alphanumeric() || "/._-".contains(letter);
    let from = format!("{}:{}", made.host, report.file);
    let word = if report.file.chars().all(plain) { from } else { format!("'{}'", from.replace('\'', "'\\''")) };
    is_there.then(|| format!("scp {word} ."))
}

/// The report of its period; the shifts may have had other times then.
fn opened(cx: &ViewContext, report: &ReportRecord) -> Opened {
    let known = calendar::period_at(cx.def(), report.period, report.from);
    let same = known.filter(|period| (period.from, period.to) == (report.from, report.to));
    let period = same.unwrap_or_else(|| Period::free(report.from, report.to));
    Opened { period, report: Answered::default(), scroll: Scroll::default() }
}

fn draw_text(open: &Opened, cx: &ViewContext, canvas: &mut Canvas) {
    let (theme, columns, height) = (cx.theme, canvas.width(), canvas.height());
    if open.report.value.is_none() {
        let waiting = open.report.query.shown_waiting(cx);
        let words = open.report.trouble.as_deref().or(waiting.as_deref()).unwrap_or(t!("collecting data"));
        canvas.text_centred(height / 2, words, theme.dim());
        return;
    }
    let (lines, rows) = (open.lines(cx), usize::from(height.saturating_sub(2)).max(1));
    let first = open.scroll.first(lines.len(), rows);
    canvas.text(1, 0, &period::words(cx, &open.period), theme.strong());
    for (y, _, line) in on_screen(&lines, first, rows) {
        canvas.text(0, y + 1, &fit(line, columns), theme.normal());
    }
    let hidden = lines.len().saturating_sub(first + rows);
    if 0 < hidden {
        let more = t!("   {pick} {hidden} more", pick = theme.pick("↓", t!("down")), hidden);
        canvas.text_right(columns.saturating_sub(1), height.saturating_sub(1), more.trim(), theme.dim());
    }
}
