//! The list of batches: each with its times, energy and alarms, and what is known of the selected one.

use super::{Export, Key, Page, Reports};
use crate::ui::tabs::{
    overlay::{Kind, Laid, Laying, Overlaid},
    prelude::*,
};
use crate::{
    plant::{batch::Batch, def::BatchDef},
    report::{self, Period, TagFigures, batch::BatchReport, text::mean_or_difference},
    text::file,
};

pub const LIST: &[&[Key]] = &[&[
    Key::change(code(KeyCode::Enter), "report", "the whole report of its time", |reports, cx| {
        if let Some(period) = reports.batches.period(cx) {
            reports.page = Page::Report;
            reports.show(Some(period));
        }
    }),
    Key::change(char('o'), "overlay", "overlay the curves of the marked batches", |reports, cx| {
        reports.batches.lay_over(cx);
    }),
    Key::new(char('e'), "export", "write the list as CSV", Reports::export_batches).needs(Role::Technician),
    Key::change(char('b'), "shifts", "the reports of shifts", |reports, _| {
        (reports.page, reports.export) = (Page::Report, Export::Not);
    }),
]];

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

pub type Batches = Overlaid<BatchReports>;

/// The batches of the plant, newest first.
#[derive(Debug, Default)]
pub struct BatchReports;

impl Listing for BatchReports {
    type Answer = Vec<BatchReport>;
    type Row = BatchReport;
    type Id = String;

    const MARKS: bool = true;
    const TRENDS: bool = true;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a Vec<BatchReport>>) -> Heading<'a> {
        Heading::new(t!("Batches"), t!("No batch ran yet."))
            .words(t!("last 30 days"), cx.theme.normal())
            .limit(ROWS, t!("the newest {ROWS}; the command `batches` has all", ROWS))
    }

    fn query(&self, cx: &ViewContext) -> Option<Query> {
        let to = cx.now + SignedDuration::from_secs(1);
        Some(Query::Batches { from: to - SPAN, to, limit: ROWS })
    }

    fn rows<'a>(&'a self, _cx: &ViewContext<'a>, batches: Option<&'a Vec<BatchReport>>) -> Vec<Cow<'a, BatchReport>> {
        batches.into_iter().flatten().map(Cow::Borrowed).collect()
    }

    fn id(report: &BatchReport) -> String {
        report.batch.label()
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<BatchReport>> {
        vec![
            left(15, t!("batch"), |_, report| report.batch.label()),
            left(12, t!("begin"), |cx, report: &BatchReport| moment(report.batch.from, cx.now, &cx.def().time_zone))
                .by(|a, b| a.batch.from.cmp(&b.batch.from)),
            right(7, t!("minutes"), |_, report| minutes(report.batch.lasted)),
            left(23, t!("state"), |_, report| state(&report.batch).to_owned()),
            right(8, t!("kWh"), |_, report| report.energy.map_or("–".to_owned(), |(kwh, _)| format!("{kwh:.3}"))),
            right(6, t!("alarms"), |_, report| report.alarms.map_or("–".to_owned(), |alarms| alarms.to_string())),
        ]
    }

    /// Its end, phases and tags.
    fn details(&self, cx: &ViewContext, report: &BatchReport, _: Option<&Vec<BatchReport>>) -> Vec<(String, Style)> {
        details(cx, report).into_iter().map(|text| (text, cx.theme.normal())).collect()
    }

    /// The last row of the page is about the file.
    fn height(&self, cx: &ViewContext) -> u16 {
        cx.area.height.saturating_sub(1)
    }

    fn moment(&self, report: &BatchReport) -> Option<Timestamp> {
        Some(report.batch.from)
    }

    /// The first pen of its rule, over its whole time.
    fn trend(&self, cx: &ViewContext, report: &BatchReport) -> Option<(TagId, (Timestamp, Timestamp))> {
        let tag = *tags(rule(cx, report)?).first()?;
        Some((tag, (report.batch.from, report.batch.until(cx.now))))
    }
}

impl Laying for BatchReports {
    fn laid(report: &BatchReport) -> Laid {
        Laid::new(report.batch.label(), report.batch.from, report.batch.to)
    }

    fn curves(&self, cx: &ViewContext, report: &BatchReport) -> Option<(Kind, Vec<TagId>)> {
        Some((Kind::Batches, tags(rule(cx, report)?)))
    }

    fn are_alike(a: &BatchReport, b: &BatchReport) -> bool {
        a.batch.name == b.batch.name
    }
}

impl Batches {
    /// The keys of the moment.
    pub fn keys(&self) -> &'static [&'static [Key]] {
        if self.overlay.is_some() { OVERLAY } else { LIST }
    }

    fn period(&self, cx: &ViewContext) -> Option<Period> {
        self.list.selected(cx).map(|report| report.period())
    }

    /// Draws it, with a last row about the file.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect, file: (String, Style)) {
        if let Some(overlay) = &self.overlay {
            return overlay.view(cx, frame, area);
        }
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let (width, last) = (canvas.width(), canvas.height().saturating_sub(1));
        canvas.text(1, last, &fit(&file.0, width.saturating_sub(2)), file.1);
        self.list.view(cx, &mut canvas.part(0, 0, width, last));
    }
}

fn rule<'a>(cx: &ViewContext<'a>, report: &BatchReport) -> Option<&'a BatchDef> {
    cx.def().batches.iter().find(|rule| rule.name == report.batch.name)
}

/// The tags of a rule that have curves.
fn tags(rule: &BatchDef) -> Vec<TagId> {
    rule.tags.iter().chain(&rule.energy).chain(&rule.phase).copied().collect()
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
    let tags = report.tags.iter().map(figures);
    [end, phases.join(", ")].into_iter().chain(tags).collect()
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
        let batches = self.batches.list.answered.value.as_deref().unwrap_or_default();
        let bytes = file(|| report::batch::csv(batches, cx.def(), self.dialect));
        let listed = !batches.is_empty();
        self.send(listed.then(|| (self.batches_path(cx), bytes)))
    }
}
