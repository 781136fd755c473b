//! Tab 5: the report of a shift or of any period, as the CSV will have it; the batches; and the CSV.

pub(super) mod period;
mod batches;
mod counters;
mod export;
mod made;
mod rows;
mod view;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

use self::{
    batches::{BatchReports, Batches},
    export::Export,
    made::AutomaticReportsPage,
    rows::RecordRows,
};
use super::Outgoing;
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        def::{CsvDialect, Pen},
        request_refusal::RequestRefusal,
    },
    report::{self, Period, ReportFormat, ShiftReport},
    ui::{tabs::trends::span::View, widgets::chart},
};

type Key = crate::ui::key_table::Key<Reports>;

const KEYS: &[Key] = &[
    Key::change(code(KeyCode::Left), "earlier", "previous shift", |reports, cx| reports.step(cx, -1)),
    Key::change(code(KeyCode::Right), "later", "next shift", |reports, cx| reports.step(cx, 1)),
    Key::change(char('l'), "running", "current shift", |reports, cx| {
        reports.show(period::at(cx.def(), cx.now));
        reports.follow = true;
    }),
    Key::new(char('/'), "period", "any period: from-to, a day, a shift", |_, _| {
        open(Modal::Prompt(Prompt::new(t!("report of a period"), period::FORMS, "")))
    }),
    Key::new(char('e'), "export", "write the report to a file", Reports::export).needs(Role::Technician),
    Key::change(char('f'), "format", "next format: CSV, text, HTML, Excel, Word, …", |reports, _| {
        let place = report::FORMATS.iter().position(|format| format.name() == reports.format.name());
        reports.format = report::FORMATS[place.map_or(0, |place| place + 1) % report::FORMATS.len()];
    }),
    Key::change(char('p'), "preview", "the report as text, as it is written", |reports, cx| {
        (reports.preview, reports.scroll) = (reports.preview.is_none().then(Vec::new), Scroll::default());
        reports.set_preview(cx);
    }),
    Key::change(char('n'), "rows", "date, time, SV, PV and ER, row by row", |reports, _| {
        (reports.page, reports.export) = (Page::Rows, Export::Not);
    }),
    Key::change(char(';'), "", "CSV with , and . or with ; and ,", |reports, cx| {
        (reports.dialect, reports.export) = (reports.dialect.toggled(cx.def().report.csv), Export::Not);
    }),
    Key::change(char('r'), "automatic", "the automatic reports of the station", |reports, _| {
        (reports.page, reports.export) = (Page::Made, Export::Not);
        reports.made.list.answered.query.want();
    }),
    Key::change(char('t'), "tag", "chart of the next tag (110 columns or more)", |reports, _| reports.next_tag(1)),
    Key::change(char('T'), "", "chart of the previous tag", |reports, _| reports.next_tag(-1)),
    Key::change(char('c'), "", "the other columns (narrower than 80)", |reports, _| {
        reports.later_columns = !reports.later_columns;
    }),
    Key::change(char('d'), "", "show or hide the alarm events that were not annunciated", |reports, _| {
        reports.quiet = !reports.quiet;
    }),
    Key::change(char('u'), "", "refresh the figures", |reports, _| reports.report.answered.query.want()),
    Key::new(char('w'), "", "explain its current values", |reports, cx| {
        let rows = reports.report.answered.value.iter().flat_map(|report| &report.tags);
        Why::open(Why::of_all(cx, rows.filter_map(|row| cx.def().tag_named(&row.tag)).collect()))
    }),
];

/// The key of a plant that makes batches.
const BATCHES: &[Key] = &[Key::change(char('b'), "batches", "the list of batches", |reports, _| {
    (reports.page, reports.export) = (Page::Batches, Export::Not);
    reports.batches.list.answered.query.want();
})
.when(|_, cx| Offer::only_if(!cx.def().batches.is_empty()))];
const SCROLL: [Key; 6] = motions!("", Reports::scroll);

/// How often the figures of a running shift are refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 30.0;
/// A report over weeks may take its time.
const TIMEOUT_S: f64 = 60.0;

/// What is shown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Page {
    /// The report of a period: its figures, or the text that it is written as.
    #[default]
    Report,
    /// The rows of its record.
    Rows,
    Batches,
    /// The reports that the station makes by itself.
    Made,
}

#[derive(Debug)]
pub struct Reports {
    page: Page,
    /// The period shown; `None` only at the very ends of the calendar.
    period: Option<Period>,
    /// No period is chosen: the running shift is shown.
    follow: bool,
    /// The report of that very period, and the list of its record.
    report: List<RecordRows>,
    /// The row whose tag has the chart, and its curve.
    charted: usize,
    curve: Answered<Vec<Series>>,
    batches: Batches,
    made: AutomaticReportsPage,
    dialect: CsvDialect,
    format: &'static dyn ReportFormat,
    /// The report as text, while that is shown.
    preview: Option<Vec<String>>,
    export: Export,
    /// The CSV that waits for the station's word.
    outgoing: Option<Outgoing>,
    scroll: Scroll,
    /// On a narrow screen the last columns of the figures are shown.
    later_columns: bool,
    /// Also the events of alarms of which nothing was annunciated.
    quiet: bool,
}

impl TabView for Reports {
    fn new(snapshot: &Snapshot) -> Reports {
        Reports {
            page: Page::Report,
            period: period::at(&snapshot.def, snapshot.at),
            follow: true,
            report: List::default(),
            charted: 0,
            curve: Answered::default(),
            batches: Batches::new(BatchReports),
            made: AutomaticReportsPage::default(),
            dialect: snapshot.def.report.csv,
            format: report::FORMATS[0],
            preview: None,
            export: Export::Not,
            outgoing: None,
            scroll: Scroll::default(),
            later_columns: false,
            quiet: false,
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.follow {
            let running = period::at(cx.def(), cx.now);
            if running != self.period {
                self.show(running);
            }
        }
        self.ask(cx)
    }

    fn queries(&mut self) -> Queries<'_> {
        let own: Queries = vec![&mut self.report.answered, &mut self.curve];
        own.into_iter().chain(self.batches.queries()).chain(self.made.queries()).collect()
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.queries().into_iter().for_each(|asked| asked.on_answer(cx, number, &answer));
        self.set_preview(cx);
        self.batches.follow(cx);
        self.ask(cx)
    }

    fn on_request_done(&mut self, _cx: &ViewContext, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        let Some(outgoing) = self.outgoing.take() else { return Vec::new() };
        match answer {
            Ok(()) => vec![outgoing.write()],
            Err(why) => {
                self.export = Export::Failed(why.to_string());
                Vec::new()
            }
        }
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let typed = period::typed(cx.def(), text, cx.now)?;
        self.show(Some(typed));
        Ok(self.ask(cx))
    }

    fn on_saved(&mut self, _cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.export = result.map_or_else(Export::Failed, Export::Done);
        Vec::new()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        match self.page {
            Page::Report => view::draw(self, cx, frame, area),
            Page::Rows => view::draw_rows(self, cx, frame, area),
            Page::Batches => self.batches.view(cx, frame, area, view::export_words(self, cx, &self.batches_path(cx))),
            Page::Made => self.made.view(cx, frame, area),
        }
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        match self.page {
            Page::Report => None,
            Page::Rows => Some(&self.report),
            Page::Batches => self.batches.shown(),
            Page::Made => self.made.list(),
        }
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        match self.page {
            Page::Report => None,
            Page::Rows => Some(&mut self.report),
            Page::Batches => self.batches.shown_mut(),
            Page::Made => self.made.list_mut(),
        }
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.list_mut(cx).is_some_and(|list| list.back(cx)) {
            return true;
        }
        match self.page {
            Page::Report => self.preview.take().is_some() || self.report.answered.query.cancel(cx),
            Page::Batches if self.batches.overlay.take().is_some() => true,
            Page::Made if self.made.open.take().is_some() => true,
            Page::Rows | Page::Batches | Page::Made => {
                self.page = Page::Report;
                true
            }
        }
    }
}

impl KeyTable for Reports {
    fn keys(&self, _cx: &ViewContext) -> Keys<Reports> {
        Keys::of(match self.page {
            Page::Report => &[KEYS, BATCHES, counters::KEYS, &SCROLL],
            Page::Rows => rows::KEYS,
            Page::Batches => self.batches.keys(),
            Page::Made => self.made.keys(),
        })
    }

    fn before_key(&mut self) {
        self.dismiss();
    }

    #[cfg(test)]
    fn chords() -> key_table::PageChords {
        let pages: [(_, &[&'static [Key]]); 6] = [
            ("reports", &[KEYS, BATCHES, counters::KEYS, &SCROLL]),
            ("rows", rows::KEYS),
            ("batches", batches::LIST),
            ("overlay", batches::OVERLAY),
            ("made", made::LIST),
            ("text", made::TEXT),
        ];
        pages.map(|(name, tables)| (name, Keys::of(tables).chords())).to_vec()
    }
}

impl Reports {
    /// Shows the shift so many further on.
    fn step(&mut self, cx: &ViewContext, by: isize) {
        if let Some(next) = period::step(cx, self.period.as_ref(), by) {
            self.show(Some(next));
        }
    }

    /// The chart is of the tag so many rows further on.
    fn next_tag(&mut self, by: isize) {
        let rows = self.report.answered.value.as_ref().map_or(0, |report| report.tags.len());
        (self.charted, self.curve) = (around(self.charted, by, rows), Answered::default());
    }

    /// Sets the report that is shown as text, if it is wanted.
    fn set_preview(&mut self, cx: &ViewContext) {
        if let (Some(lines), Some(report)) = (&mut self.preview, &self.report.answered.value) {
            let document = report::content::document(report, cx.def(), report::language(cx.def()).locale());
            *lines = report::text::lines(&document, usize::from(cx.area.width.saturating_sub(2)).clamp(60, 120));
        }
    }

    /// Shows another period; figures of the old one must not stand under its name.
    fn show(&mut self, period: Option<Period>) {
        self.preview.iter_mut().for_each(Vec::clear);
        (self.period, self.follow, self.scroll) = (period, false, Scroll::default());
        self.report.rewind();
        (self.export, self.curve, self.report.answered) = (Export::Not, Answered::default(), Answered::default());
    }

    /// The tag that has the chart, and the part of the period that is over, where there is room for it.
    fn chart(&self, cx: &ViewContext) -> Option<(Pen, View)> {
        let free = self.page == Page::Report && self.preview.is_none();
        let room = view::chart_columns(cx).filter(|_| free)?;
        let rows = &self.report.answered.value.as_ref()?.tags;
        let tag = cx.def().tag_named(&rows.get(self.charted)?.tag)?;
        let period = self.period.as_ref()?;
        let view = View::since(period.from, period.to.min(cx.now), chart::dots(cx.theme, room, 1));
        Some((Pen { tag, scale: None }, view))
    }

    fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let rows = usize::from(cx.area.height.saturating_sub(3)).max(1);
        let figures = |report: &ShiftReport| view::lines(cx, report, None, false, self.quiet).len();
        let lines = match (&self.preview, &self.report.answered.value) {
            (Some(lines), _) => lines.len(),
            (None, Some(report)) => figures(report),
            (None, None) => 0,
        };
        self.scroll.on(motion, lines, rows);
    }

    fn is_running(&self, now: Timestamp) -> bool {
        self.period.as_ref().is_some_and(|period| now < period.to)
    }

    fn ask(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        // The past stays as it is; but a report that was read while its shift still ran is not the last word.
        let closed = self.report.answered.value.as_ref().is_some_and(|report| report.until >= report.period.to);
        let every = if closed && !self.is_running(cx.now) { SignedDuration::MAX } else { real(cx, EVERY_S) };
        match self.page {
            Page::Report | Page::Rows => {}
            Page::Batches => return self.batches.ask(cx, Tab::Reports),
            Page::Made => return self.made.ask(cx),
        }
        let Some(period) = self.period.clone() else { return Vec::new() };
        let query = self.report.answered.ask(cx, Tab::Reports, every, real(cx, TIMEOUT_S), Query::Report { period });
        let curve = self.chart(cx).and_then(|(pen, view)| {
            let query = Query::Series { tags: vec![pen.tag], from: view.from, to: view.to, buckets: view.columns };
            self.curve.ask(cx, Tab::Reports, every, real(cx, TIMEOUT_S), query)
        });
        query.into_iter().chain(curve).collect()
    }
}
