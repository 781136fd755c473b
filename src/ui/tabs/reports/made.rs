//! The reports that the station makes by itself: each with its state, its file and how to fetch it, and the selected one as text.

use super::{Key, Page, Reports};
use crate::ui::tabs::prelude::*;
use crate::{
    history::MadeReports,
    plant::report::{ReportEvent, ReportKey, ReportRecord},
    report::{Period, ShiftReport, automatic::is_given_up, calendar, content, language, text::lines},
};

pub const LIST: &[&[Key]] = &[&[
    Key::change(code(KeyCode::Enter), "text", "the selected report as text", |reports, cx| {
        reports.made.open = reports.made.list.selected(cx).map(|report| opened(cx, &report));
    }),
    Key::change(char('r'), "shifts", "the reports of shifts", |reports, _| reports.page = Page::Report),
]];
pub const TEXT: &[&[Key]] = &[
    &motions!("", |reports: &mut Reports, cx: &ViewContext, motion| reports.made.scroll(cx, motion)),
    &[Key::change(char('r'), "list", "back to the list of automatic reports", |reports, _| reports.made.open = None)],
];

const ROWS: usize = 500;
/// A report over weeks may take its time.
const REPORT_TIMEOUT_S: f64 = 60.0;
/// Columns of a text report.
const WIDTH: u16 = 80;

#[derive(Debug, Default)]
pub struct AutomaticReportsPage {
    pub list: List<AutomaticReports>,
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

impl AutomaticReportsPage {
    /// The keys of the moment.
    pub fn keys(&self) -> &'static [&'static [Key]] {
        if self.open.is_some() { TEXT } else { LIST }
    }

    /// The list, while it is shown.
    pub fn list(&self) -> Option<&dyn ListPage> {
        self.open.is_none().then_some(&self.list as &dyn ListPage)
    }

    /// The same, to change it.
    pub fn list_mut(&mut self) -> Option<&mut dyn ListPage> {
        if self.open.is_none() { Some(&mut self.list) } else { None }
    }

    fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let Some(open) = &mut self.open else { return };
        let count = open.lines(cx).len();
        open.scroll.on(motion, count, usize::from(cx.area.height.saturating_sub(2)).max(1));
    }

    /// Those for the list and for the report that is open.
    pub fn queries(&mut self) -> Queries<'_> {
        let open = self.open.iter_mut().map(|open| &mut open.report as &mut dyn Asked);
        open.chain([&mut self.list.answered as &mut dyn Asked]).collect()
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let tab = Tab::Reports;
        let query = match &mut self.open {
            Some(Opened { period, report, .. }) => {
                let query = Query::Report { period: period.clone() };
                report.ask(cx, tab, SignedDuration::MAX, real(cx, REPORT_TIMEOUT_S), query)
            }
            None => self.list.ask(cx, tab),
        };
        query.into_iter().collect()
    }

    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        match &self.open {
            Some(open) => draw_text(open, cx, &mut canvas),
            None => self.list.view(cx, &mut canvas),
        }
    }
}

/// The reports that the station has made by itself.
#[derive(Debug, Default)]
pub struct AutomaticReports;

impl Listing for AutomaticReports {
    type Answer = MadeReports;
    type Row = ReportRecord;
    type Id = ReportKey;

    const MARKS: bool = true;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a MadeReports>) -> Heading<'a> {
        let empty = match cx.def().report.automatic.is_empty() {
            true => t!("The plant file configures none: see `sightglass help reports`."),
            false => t!("No report was made yet."),
        };
        Heading::new(t!("Automatic reports"), empty)
    }

    fn query(&self, _cx: &ViewContext) -> Option<Query> {
        Some(Query::Reports { limit: ROWS })
    }

    fn rows<'a>(&'a self, _cx: &ViewContext<'a>, made: Option<&'a MadeReports>) -> Vec<Cow<'a, ReportRecord>> {
        made.into_iter().flat_map(|made| &made.reports).map(Cow::Borrowed).collect()
    }

    fn id(report: &ReportRecord) -> ReportKey {
        report.key()
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<ReportRecord>> {
        vec![
            left(24, t!("period"), |_, report: &ReportRecord| report.name.to_string()).by(|a, b| a.from.cmp(&b.from)),
            left(8, t!("format"), |_, report| report.format.to_string()),
            left(21, t!("state"), |_, report| state(report).to_owned()),
            left(13, t!("since"), |cx, report: &ReportRecord| moment(report.at, cx.now, &cx.def().time_zone))
                .by(|a, b| a.at.cmp(&b.at)),
            rest(0, t!("file"), |_, report, _| report.file.rsplit('/').next().unwrap_or_default().to_owned()),
        ]
    }

    fn style(&self, cx: &ViewContext, report: &ReportRecord) -> Style {
        row_style(cx, false, matches!(report.event, ReportEvent::NotMade | ReportEvent::DeliveryFailed))
    }

    fn details(&self, cx: &ViewContext, report: &ReportRecord, made: Option<&MadeReports>) -> Vec<(String, Style)> {
        let why = report.error.as_ref().map(|why| t!("{why}, {n} times", why, n = report.attempts.max(1)));
        let fetch = made.and_then(|made| fetch(made, report)).map(|line| t!("y copies: {line}", line));
        let sha = (!report.sha256.is_empty()).then(|| format!("SHA-256 {}", report.sha256));
        let texts = [(why, cx.theme.trouble()), (fetch, cx.theme.normal()), (sha, cx.theme.dim())];
        texts.into_iter().filter_map(|(text, style)| Some((text?, style))).collect()
    }

    /// The line that fetches the file.
    fn copied(&self, _cx: &ViewContext, report: &ReportRecord, made: Option<&MadeReports>) -> Option<String> {
        Some(made.and_then(|made| fetch(made, report)).unwrap_or_default())
    }
}

fn state(report: &ReportRecord) -> &'static str {
    if is_given_up(report) { t!("NOT DELIVERED") } else { translate(report.event.word()) }
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
