//! Export of what is seen: values with quality as CSV, the chart as SVG and PNG. Every file is on record before it is
//! written.

use std::{collections::VecDeque, path::PathBuf, sync::Arc};

use super::{picture::picture, *};
use crate::{
    plant::request_refusal::RequestRefusal,
    report::{
        export::{Column, export_csv},
        step_series::HeldValue,
    },
    text::file,
    ui::tabs::Outgoing,
};

/// Rows of a CSV lie on multiples of this.
const STEP_MS: i128 = 100;

/// Files on their way.
#[derive(Debug, Default)]
pub(super) struct Export {
    /// The values of a CSV that are waited for: from, every, count, pens.
    wanted: Option<(Timestamp, Duration, usize, Vec<TagId>)>,
    values: Answered<Vec<Vec<Option<HeldValue>>>>,
    /// Those that wait for their turn; the first is before the station or on its way to the disk.
    files: VecDeque<Outgoing>,
    /// Who has begun it.
    user: Option<Arc<str>>,
    /// What became of the last one.
    pub said: Option<Result<String, String>>,
}

fn user(cx: &ViewContext) -> Option<Arc<str>> {
    cx.session.who.as_ref().map(|who| who.user.clone())
}

impl Export {
    pub(super) fn asked(&mut self) -> &mut dyn Asked {
        &mut self.values
    }

    pub(super) fn is_busy(&self) -> bool {
        self.wanted.is_some() || !self.files.is_empty()
    }

    /// Gives up what another user has begun: it is not recorded as done by the present one.
    fn check_user(&mut self, cx: &ViewContext) {
        if self.user != user(cx) {
            (self.wanted, self.values) = (None, Answered::default());
            self.files.clear();
        }
    }

    /// Asks the station to record the first file.
    fn next(&self) -> Vec<UiAction> {
        self.files.front().map(Outgoing::export_request).into_iter().collect()
    }
}

impl Trends {
    /// Begins a CSV of the values in the view.
    pub(super) fn export_csv(&mut self, cx: &ViewContext) {
        self.export.check_user(cx);
        let view = self.span(cx);
        let tags: Vec<TagId> = self.drawn(cx).iter().map(|(_, pen)| pen.tag).collect();
        if tags.is_empty() || self.export.is_busy() {
            return;
        }
        let step = (view.step().as_millis() + STEP_MS - 1) / STEP_MS * STEP_MS;
        let every = Duration::from_millis(u64::try_from(step.max(STEP_MS)).unwrap_or(u64::MAX));
        let past = view.to.min(cx.present()).duration_since(view.from).as_millis();
        let count = usize::try_from(past / step.max(STEP_MS)).unwrap_or(0);
        (self.export.said, self.export.values, self.export.user) = (None, Answered::default(), user(cx));
        self.export.wanted = (count > 0).then_some((view.from, every, count, tags));
    }

    /// Asks for the values of a CSV.
    pub(super) fn ask_export(&mut self, cx: &ViewContext) -> Option<UiAction> {
        self.export.check_user(cx);
        let (from, every, count, tags) = self.export.wanted.clone()?;
        let query = Query::Values { tags, from, every, count };
        self.export.values.ask(cx, Tab::Trends, SignedDuration::MAX, real(cx, 60.0), query)
    }

    /// The values of a CSV have come: asks the station to record the file.
    pub(super) fn accept_export(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.export.check_user(cx);
        let Some((from, every, _, tags)) = self.export.wanted.take() else { return Vec::new() };
        let Some(values) = self.export.values.value.take() else {
            self.export.said = self.export.values.trouble.take().map(Err);
            return Vec::new();
        };
        let column = |(tag, values): (&TagId, Vec<Option<HeldValue>>)| Column {
            tag: cx.def().tag(*tag).name.clone(),
            unit: cx.snapshot.unit(*tag).to_owned(),
            decimals: cx.snapshot.decimals[tag.index()],
            values,
        };
        let columns: Vec<Column> = tags.iter().zip(values).map(column).collect();
        let csv = || (self.path(cx, "csv"), export_csv(cx.def(), from, every, &columns, cx.def().report.csv));
        let file = file(csv);
        self.send(vec![file])
    }

    /// Exports the chart as it is drawn, as SVG and PNG.
    pub(super) fn export_picture(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.export.check_user(cx);
        if self.export.is_busy() {
            return Vec::new();
        }
        if self.plot != Plot::Time {
            self.export.said = Some(Err(t!("only the chart over time can be exported").to_owned()));
            return Vec::new();
        }
        self.export.user = user(cx);
        // For people, in the language that they read on the screen; the CSV is for programs.
        let page = picture(self, cx);
        let png = page.png().map(|png| (self.path(cx, "png"), png));
        self.send([(self.path(cx, "svg"), page.svg())].into_iter().chain(png).collect())
    }

    fn send(&mut self, files: Vec<(PathBuf, Vec<u8>)>) -> Vec<UiAction> {
        let outgoing = |(path, bytes)| Outgoing { tab: Tab::Trends, path, bytes, new: true };
        self.export.files = files.into_iter().map(outgoing).collect();
        self.export.said = None;
        self.export.next()
    }

    /// The station has put the first file on record, or why not.
    pub(super) fn recorded(&mut self, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        match answer {
            Ok(()) => self.export.files.front().cloned().map(Outgoing::write).into_iter().collect(),
            Err(why) => {
                self.export.files.clear();
                self.export.said = Some(Err(why.to_string()));
                Vec::new()
            }
        }
    }

    /// The first file was written, or why not; then the next one.
    pub(super) fn written(&mut self, cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.export.files.pop_front();
        if result.is_err() {
            self.export.files.clear();
        }
        self.export.said = Some(result.map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()));
        self.export.check_user(cx);
        self.export.next()
    }

    /// `2026-11-25T093600-TIC-1-2026-11-25T101503.csv`: begin of the view, name of the group and time of the export.
    fn path(&self, cx: &ViewContext, extension: &str) -> PathBuf {
        let plain = |c: char| if c.is_alphanumeric() || c == '-' { c } else { '-' };
        let name: String = self.name(cx).chars().map(plain).collect();
        let begin = cx.local(self.span(cx).from, "%Y-%m-%dT%H%M%S");
        let exported = cx.local(cx.present(), "%Y-%m-%dT%H%M%S");
        cx.def().report.folder.join(format!("{begin}-{name}-{exported}.{extension}"))
    }
}
