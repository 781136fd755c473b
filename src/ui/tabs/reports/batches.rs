//! The list of batches: each with its times, energy and alarms, and what is known of the selected one.

use super::{Export, Key, Reports};
use crate::ui::tabs::{
    overlay::{self, Overlay},
    prelude::*,
};
use crate::{
    plant::batch::Batch,
    report::{self, Period, TagFigures, batch::BatchReport, text::mean_or_difference},
    text::file,
};

/// Keys of the list.
pub const LIST: &[&[Key]] = &[
    &motions!("select", |reports: &mut Reports, cx: &ViewContext, motion| reports.batches.select(cx, motion)),
    &[
        Key::change(code(KeyCode::Enter), "report", "the whole report of its time", |reports, _| {
            if let Some(period) = reports.batches.period() {
                reports.batches.shown = false;
                reports.show(Some(period));
            }
        }),
        Key::new(char('t'), "trend", "the curves of its time", |reports, cx| {
            reports.batches.trend(cx).into_iter().collect()
        }),
        Key::change(char('o'), "overlay", "the curves of the marked batches over each other", |reports, cx| {
            reports.batches.lay_over(cx);
        }),
        Key::change(char(' '), "mark", "mark the batch for the overlay", |reports, _| reports.batches.mark()),
        Key::new(char('e'), "export", "write the list as CSV", Reports::export_batches).needs(Role::Technician),
        Key::change(char('b'), "shifts", "the reports of shifts", |reports, _| {
            (reports.batches.shown, reports.export) = (false, Export::Not);
        }),
    ],
];

/// Keys where batches lie over each other.
pub const OVERLAY: &[&[Key]] = &[&[
    Key::change(code(KeyCode::Left), "", "previous tag", |reports, _| reports.batches.next_tag(-1)),
    Key::change(code(KeyCode::Right), "tag", "next tag", |reports, _| reports.batches.next_tag(1)),
    Key::change(char('o'), "list", "back to the list of batches", |reports, _| reports.batches.overlay = None),
]];

/// Rows of one answer; the command `batches` has all of them.
const ROWS: usize = 50;
/// The list reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24 * 30);
/// How often the list is refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;

/// State of the list.
#[derive(Debug, Default)]
pub struct Batches {
    /// It is shown in place of a report.
    pub shown: bool,
    pub rows: Answered<Vec<BatchReport>>,
    selected: Selected<String>,
    /// Labels of the marked ones.
    marked: Vec<String>,
    /// Some of them over each other, in place of the list.
    pub overlay: Option<Overlay>,
}

impl Batches {
    /// The keys of the moment.
    pub fn keys(&self) -> &'static [&'static [Key]] {
        if self.overlay.is_some() { OVERLAY } else { LIST }
    }

    fn next_tag(&mut self, by: isize) {
        self.overlay.iter_mut().for_each(|overlay| overlay.next_tag(by));
    }

    /// The batches that are listed, newest first.
    pub fn rows(&self) -> &[BatchReport] {
        self.rows.value.as_deref().unwrap_or_default()
    }

    fn labels(&self) -> impl Iterator<Item = String> + '_ {
        self.rows().iter().map(|report| report.batch.label())
    }

    fn place(&self) -> usize {
        self.selected.place(self.labels())
    }

    /// The period of the selected batch.
    pub fn period(&self) -> Option<Period> {
        self.rows().get(self.place()).map(BatchReport::period)
    }

    pub fn select(&mut self, cx: &ViewContext, motion: Motion) {
        let (labels, room) = (self.labels().collect::<Vec<_>>(), self.room(cx, cx.area.height));
        self.selected.on(motion, labels, room);
    }

    /// The first pen of its rule, over its whole time.
    pub fn trend(&self, cx: &ViewContext) -> Option<UiAction> {
        let report = self.rows().get(self.place())?;
        let rule = cx.def().batches.iter().find(|rule| rule.name == report.batch.name)?;
        let tag = *rule.tags.first().or(rule.energy.as_ref()).or(rule.phase.as_ref())?;
        Some(UiAction::ShowOnTrends(tag, (report.batch.from, report.batch.until(cx.now))))
    }

    /// Marks the selected batch, or no longer.
    pub fn mark(&mut self) {
        let Some(label) = self.labels().nth(self.place()) else { return };
        match self.marked.iter().position(|marked| *marked == label) {
            Some(place) => drop(self.marked.remove(place)),
            None => self.marked.push(label),
        }
    }

    /// Shows the marked batches of the rule of the selected one over each other; where none is marked, it and those before it.
    pub fn lay_over(&mut self, cx: &ViewContext) {
        let Some(selected) = self.rows().get(self.place()).map(|report| report.batch.clone()) else { return };
        let Some(rule) = cx.def().batches.iter().find(|rule| rule.name == selected.name) else { return };
        let alike = || self.rows().iter().map(|report| &report.batch).filter(|batch| batch.name == selected.name);
        let marked: Vec<Batch> = alike().filter(|batch| self.marked.contains(&batch.label())).cloned().collect();
        let latest = || alike().filter(|batch| batch.from <= selected.from).take(overlay::UNMARKED).cloned().collect();
        self.overlay = Overlay::of_batches(rule, if marked.is_empty() { latest() } else { marked });
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Vec<UiAction> {
        let curves = self.overlay.as_mut().map_or(Vec::new(), |overlay| overlay.ask(cx, number));
        let is_listed = self.overlay.as_ref().is_none_or(Overlay::is_running);
        let list = if is_listed { self.ask_list(cx, number) } else { None };
        curves.into_iter().chain(list).collect()
    }

    /// Takes an answer to one of its queries.
    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        let is_list = self.rows.query.awaits(number);
        self.rows.on_answer(cx, number, answer);
        if let Some(overlay) = &mut self.overlay {
            overlay.on_answer(cx, number, answer);
            let listed = self.rows.value.iter().flatten().filter(|_| is_list);
            overlay.follow_batches(listed.map(|report| &report.batch));
        }
    }

    fn ask_list(&mut self, cx: &ViewContext, number: &mut u32) -> Option<UiAction> {
        let to = cx.now + SignedDuration::from_secs(1);
        let query = Query::Batches { from: to - SPAN, to, limit: ROWS };
        self.rows.ask(cx, (Tab::Reports, number), real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
    }

    /// Rows of the list on a tab of this height: the rest is about the selected batch.
    fn room(&self, cx: &ViewContext, height: u16) -> usize {
        let details = self.rows().get(self.place()).map_or(0, |report| details(cx, report).len());
        usize::from(height).saturating_sub(details + 4).max(3)
    }

    /// Draws it, with a last row about the file.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect, file: (String, Style)) {
        if let Some(overlay) = &self.overlay {
            return overlay.view(cx, frame, area);
        }
        let theme = cx.theme;
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let (columns, height) = (canvas.width(), canvas.height());
        let x = canvas.text(1, 0, t!("Batches  "), theme.strong());
        let words = match (&self.rows.trouble, self.rows().len()) {
            (Some(trouble), _) => trouble.clone(),
            (None, ROWS..) => t!("the newest {ROWS}; the command `batches` has all", ROWS),
            (None, _) => t!("last 30 days").to_owned(),
        };
        let style = if self.rows.trouble.is_some() { theme.trouble() } else { theme.normal() };
        canvas.text(x, 0, &fit(&words, columns.saturating_sub(x + 1)), style);
        let names = [t!("batch"), t!("begin"), t!("minutes"), t!("state"), t!("kWh"), t!("alarms")];
        canvas.text(1, 1, &fit(&draw::columns(WIDTHS, names), columns), theme.dim());
        canvas.text(1, height.saturating_sub(1), &fit(&file.0, columns.saturating_sub(2)), file.1);
        if self.rows().is_empty() {
            let waiting = self.rows.query.shown_waiting(cx);
            let words = match self.rows.value {
                Some(_) => t!("No batch ran yet."),
                None => waiting.as_deref().unwrap_or(t!("collecting data")),
            };
            canvas.text(2, 3, words, theme.dim());
            return;
        }
        let (place, room) = (self.place(), self.room(cx, height));
        for (y, n, report) in on_screen(self.rows(), first(place, self.rows().len(), room), room) {
            let style = if n == place { theme.focus() } else { theme.normal() };
            let mark = if self.marked.contains(&report.batch.label()) { theme.pick("■", "*") } else { " " };
            canvas.text(0, y + 2, &pad(&format!("{mark}{}", row(cx, report)), columns), style);
        }
        let y = to_u16(room.min(self.rows().len())) + 2;
        for (line, text) in details(cx, &self.rows()[place]).iter().enumerate() {
            canvas.text(1, y + 1 + to_u16(line), &fit(text, columns.saturating_sub(2)), theme.normal());
        }
    }
}

const WIDTHS: [i16; 6] = [15, 12, -7, 23, -8, -6];

fn row(cx: &ViewContext, report: &BatchReport) -> String {
    let batch = &report.batch;
    let begin = moment(batch.from, cx.now, &cx.def().time_zone);
    let kwh = report.energy.map_or("–".to_owned(), |(kwh, _)| format!("{kwh:.3}"));
    let alarms = report.alarms.map_or("–".to_owned(), |alarms| alarms.to_string());
    draw::columns(WIDTHS, [&batch.label(), &begin, &minutes(batch.lasted), state(batch), &kwh, &alarms])
}

/// How it stands, and what of it was not seen.
fn state(batch: &Batch) -> &'static str {
    match (batch.to, batch.seen) {
        (None, (true, _)) => t!("RUNNING"),
        (None, (false, _)) => t!("RUNNING, begin not seen"),
        (Some(_), (true, true)) => t!("ended"),
        (Some(_), (false, true)) => t!("ended, begin not seen"),
        (Some(_), (true, false)) => t!("ended, end not seen"),
        (Some(_), (false, false)) => t!("ended, not seen"),
    }
}

/// Its end, phases and tags.
fn details(cx: &ViewContext, report: &BatchReport) -> Vec<String> {
    let batch = &report.batch;
    let end = match batch.to {
        Some(to) => t!("{name}: end {moment}", name = batch.label(), moment = moment(to, cx.now, &cx.def().time_zone)),
        None => t!("{name}: running", name = batch.label()),
    };
    let phase =
        |(name, time): &(std::sync::Arc<str>, Duration)| t!("{name} {minutes} min", name, minutes = minutes(*time));
    let mut phases: Vec<String> = batch.phases.iter().map(phase).collect();
    if !batch.unknown.is_zero() {
        phases.push(t!("unknown {minutes} min", minutes = minutes(batch.unknown)));
    }
    let phases = wrap(&phases.join(", "), cx.area.width.saturating_sub(4));
    let tags = report.tags.iter().map(figures);
    std::iter::once(end).chain(phases).chain(tags).collect()
}

fn figures(tag: &TagFigures) -> String {
    let value = |value: Option<Exact>| value.map_or("–".to_owned(), |value| digits(value, Some(tag.decimals)));
    t!(
        "{tag} {min} to {max} {unit}   mean/+ {mean}   good {good} %",
        tag = pad(&tag.tag, 16),
        min = pad_left(&value(tag.min), 8),
        max = value(tag.max),
        unit = tag.unit,
        mean = mean_or_difference(tag).replace('—', "–"),
        good = format!("{:.1}", (tag.good * 1_000.0).floor() / 10.0),
    )
}

fn minutes(time: Duration) -> String {
    format!("{:.1}", time.as_secs_f64() / 60.0)
}

impl Reports {
    fn export_batches(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let bytes = file(|| report::batch::csv(self.batches.rows(), cx.def(), self.dialect));
        let listed = !self.batches.rows().is_empty();
        self.send(listed.then(|| (self.batches_path(cx), bytes)))
    }
}
