//! Tab 5: the report of a shift or of any period, as the CSV will have it; the batches; and the CSV.

pub(super) mod period;
mod batches;
mod counters;
mod export;
mod made;
mod page_keys;
mod rows;
mod view;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

use self::{
    batches::Batches,
    export::Export,
    made::Made,
    page_keys::{Action, table},
    rows::Rows,
};
use super::Outgoing;
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::def::{CsvDialect, Pen},
    report::{self, Period, ReportFormat, ShiftReport},
    ui::{tabs::trends::span::View, widgets::chart},
};

/// How often the figures of a running shift are refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 30.0;
/// A report over weeks may take its time.
const TIMEOUT_S: f64 = 60.0;

/// State of this tab.
#[derive(Debug)]
pub struct Reports {
    /// The period shown; `None` only at the very ends of the calendar.
    period: Option<Period>,
    /// No period is chosen: the running shift is shown.
    follow: bool,
    /// The report of that very period.
    report: Answered<Box<ShiftReport>>,
    /// The row whose tag has the chart, and its curve.
    charted: usize,
    curve: Answered<Vec<Series>>,
    batches: Batches,
    made: Made,
    rows: Rows,
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
    number: u32,
}

impl TabView for Reports {
    fn new(snapshot: &Snapshot) -> Reports {
        Reports {
            period: period::at(&snapshot.def, snapshot.at),
            follow: true,
            report: Answered::default(),
            charted: 0,
            curve: Answered::default(),
            batches: Batches::default(),
            made: Made::default(),
            rows: Rows::default(),
            dialect: snapshot.def.report.csv,
            format: report::FORMATS[0],
            preview: None,
            export: Export::Not,
            outgoing: None,
            scroll: Scroll::default(),
            later_columns: false,
            quiet: false,
            number: 0,
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

    fn awaits(&self, number: u32) -> bool {
        let overlay = self.batches.overlay.as_ref().is_some_and(|overlay| overlay.awaits(number));
        let text = self.made.open.as_ref().is_some_and(|open| open.report.query.awaits(number));
        overlay
            || text
            || self.made.list.query.awaits(number)
            || self.curve.query.awaits(number)
            || self.report.query.awaits(number)
            || self.batches.rows.query.awaits(number)
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.report.on_answer(cx, number, &answer);
        self.set_preview(cx);
        self.curve.on_answer(cx, number, &answer);
        self.batches.on_answer(cx, number, &answer);
        self.made.list.on_answer(cx, number, &answer);
        self.made.open.iter_mut().for_each(|open| open.report.on_answer(cx, number, &answer));
        self.ask(cx)
    }

    fn on_request_done(&mut self, _cx: &ViewContext, answer: Result<(), String>) -> Vec<UiAction> {
        let Some(outgoing) = self.outgoing.take() else { return Vec::new() };
        match answer {
            Ok(()) => vec![outgoing.write()],
            Err(why) => {
                self.export = Export::Failed(why);
                Vec::new()
            }
        }
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        if self.rows.shown {
            self.rows.on_text(cx, self.report.value.as_deref(), text)?;
            return Ok(Vec::new());
        }
        let typed = period::typed(cx.def(), text, cx.now)?;
        self.show(Some(typed));
        Ok(self.ask(cx))
    }

    fn on_saved(&mut self, _cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.export = result.map_or_else(Export::Failed, Export::Done);
        Vec::new()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        if self.made.shown {
            return self.made.view(cx, frame, area);
        }
        if self.rows.shown {
            return view::draw_rows(self, cx, frame, area);
        }
        match self.batches.shown {
            true => self.batches.view(cx, frame, area, view::export_words(self, cx, &self.batches_path(cx))),
            false => view::draw(self, cx, frame, area),
        }
    }

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        self.dismiss();
        if self.made.shown {
            let Some(action) = keys::find(&self.made.keys(), event) else { return Vec::new() };
            self.made.act(cx, action);
            return self.ask(cx);
        }
        if self.rows.shown {
            let action = keys::find(&rows::keys(), event);
            return action.map(|action| self.act_on_rows(cx, action)).unwrap_or_default();
        }
        match (self.batches.shown, &self.batches.overlay) {
            (true, Some(_)) => keys::find(batches::OVERLAY_KEYS, event).map(|action| self.act_on_overlay(cx, action)),
            (true, None) => keys::find(&batches::keys(), event).map(|action| self.act_on_batches(cx, action)),
            (false, _) => keys::find(&table(cx), event).map(|action| self.act(cx, action)),
        }
        .unwrap_or_default()
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.made.shown {
            self.made.shown = self.made.open.take().is_some();
            return true;
        }
        match self.batches.shown {
            true if self.batches.overlay.take().is_some() => true,
            true => self.batches.rows.query.cancel(cx) || std::mem::take(&mut self.batches.shown),
            false => {
                std::mem::take(&mut self.rows.shown) || self.preview.take().is_some() || self.report.query.cancel(cx)
            }
        }
    }

    fn copied(&self, _cx: &ViewContext) -> Vec<String> {
        if self.made.shown { self.made.copied() } else { Vec::new() }
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        if self.made.shown {
            return keys::hints(&self.made.keys());
        }
        if self.rows.shown {
            return keys::hints(&rows::keys());
        }
        match (self.batches.shown, &self.batches.overlay) {
            (true, Some(_)) => keys::hints(batches::OVERLAY_KEYS),
            (true, None) => keys::hints(&batches::keys()),
            (false, _) => keys::hints(&table(cx)),
        }
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        let report = page_keys::all();
        let pages =
            [("batches", keys::chords_of(&batches::keys())), ("overlay", keys::chords_of(batches::OVERLAY_KEYS))];
        let made = [("made", keys::chords_of(&made::list_keys())), ("text", keys::chords_of(&made::text_keys()))];
        let rows = [("rows", keys::chords_of(&rows::keys()))];
        [("reports", keys::chords_of(&report))].into_iter().chain(rows).chain(pages).chain(made).collect()
    }
}

impl Reports {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        match action {
            Action::Shift(by) => {
                if let Some(next) = period::step(cx, self.period.as_ref(), by) {
                    self.show(Some(next));
                }
            }
            Action::Running => {
                self.show(period::at(cx.def(), cx.now));
                self.follow = true;
            }
            Action::Free => {
                return open(Modal::Prompt(Prompt::new(t!("report of a period"), period::FORMS, "")));
            }
            Action::Move(motion) => self.scroll(cx, motion),
            Action::Export => return self.export(cx),
            Action::Format => {
                let place = report::FORMATS.iter().position(|format| format.name() == self.format.name());
                self.format = report::FORMATS[place.map_or(0, |place| place + 1) % report::FORMATS.len()];
            }
            Action::Preview => {
                (self.preview, self.scroll) = (self.preview.is_none().then(Vec::new), Scroll::default());
                self.set_preview(cx);
            }
            Action::Dialect => {
                self.dialect = self.dialect.toggled(cx.def().report.csv);
                self.export = Export::Not;
            }
            Action::Columns => self.later_columns = !self.later_columns,
            Action::Quiet => self.quiet = !self.quiet,
            Action::Refresh => self.report.query.want(),
            Action::Tag(by) => {
                let rows = self.report.value.as_ref().map_or(0, |report| report.tags.len());
                (self.charted, self.curve) = (around(self.charted, by, rows), Answered::default());
            }
            Action::Batches => {
                (self.batches.shown, self.export) = (true, Export::Not);
                self.batches.rows.query.want();
            }
            Action::Made => {
                (self.made.shown, self.export) = (true, Export::Not);
                self.made.list.query.want();
            }
            Action::Correct => return counters::correct(cx, self.report.value.as_deref(), self.charted),
            Action::Rows => (self.rows.shown, self.export) = (true, Export::Not),
            Action::Why => {
                let rows = self.report.value.iter().flat_map(|report| &report.tags);
                return Why::open(Why::of_all(cx, rows.filter_map(|row| cx.def().tag_named(&row.tag)).collect()));
            }
        }
        self.ask(cx)
    }
}

impl Reports {
    /// Sets the report that is shown as text, if it is wanted.
    fn set_preview(&mut self, cx: &ViewContext) {
        if let (Some(lines), Some(report)) = (&mut self.preview, &self.report.value) {
            let document = report::content::document(report, cx.def(), report::language(cx.def()).locale());
            *lines = report::text::lines(&document, usize::from(cx.area.width.saturating_sub(2)).clamp(60, 120));
        }
    }

    /// Shows another period; figures of the old one must not stand under its name.
    fn show(&mut self, period: Option<Period>) {
        self.preview.iter_mut().for_each(Vec::clear);
        (self.period, self.follow, self.scroll) = (period, false, Scroll::default());
        self.rows.rewind();
        (self.export, self.report, self.curve) = (Export::Not, Answered::default(), Answered::default());
    }

    /// The tag that has the chart, and the part of the period that is over, where there is room for it.
    fn chart(&self, cx: &ViewContext) -> Option<(Pen, View)> {
        let free = !self.batches.shown && !self.made.shown && !self.rows.shown && self.preview.is_none();
        let room = view::chart_columns(cx).filter(|_| free)?;
        let rows = &self.report.value.as_ref()?.tags;
        let tag = cx.def().tag_named(&rows.get(self.charted)?.tag)?;
        let period = self.period.as_ref()?;
        let view = View::since(period.from, period.to.min(cx.now), chart::dots(cx.theme, room, 1));
        Some((Pen { tag, scale: None }, view))
    }

    fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let rows = usize::from(cx.area.height.saturating_sub(3)).max(1);
        let figures = |report: &ShiftReport| view::lines(cx, report, None, false, self.quiet).len();
        let lines = match (&self.preview, &self.report.value) {
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
        let closed = self.report.value.as_ref().is_some_and(|report| report.until >= report.period.to);
        let every = if closed && !self.is_running(cx.now) { SignedDuration::MAX } else { real(cx, EVERY_S) };
        if self.made.shown {
            return self.made.ask(cx, &mut self.number);
        }
        if self.batches.shown {
            return self.batches.ask(cx, &mut self.number);
        }
        let Some(period) = self.period.clone() else { return Vec::new() };
        let number = (Tab::Reports, &mut self.number);
        let query = self.report.ask(cx, number, every, real(cx, TIMEOUT_S), Query::Report { period });
        let curve = self.chart(cx).and_then(|(pen, view)| {
            let query = Query::Series { tags: vec![pen.tag], from: view.from, to: view.to, buckets: view.columns };
            self.curve.ask(cx, (Tab::Reports, &mut self.number), every, real(cx, TIMEOUT_S), query)
        });
        query.into_iter().chain(curve).collect()
    }
}
