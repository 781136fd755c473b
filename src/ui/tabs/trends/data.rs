//! What the trends hold: live values, curves of the history, and the queries for them.

use super::*;

impl Trends {
    /// Appends what the snapshot knows to the curves of the shown group.
    pub(super) fn push_live(&mut self, cx: &ViewContext) {
        if cx.is_past() {
            return;
        }
        for pen in self.pens(cx) {
            let sample = cx.snapshot.sample(pen.tag);
            let value = sample.good_exact();
            let at = if value.is_some() { sample.at } else { cx.now };
            self.traces.entry(pen.tag).or_default().push(at, value);
        }
    }

    /// Takes curves of the history in. Figures, and where the day's data begin, are taken only from an answer for what
    /// is shown now; a curve carries its own times and is right in any view.
    pub(super) fn accept_curves(&mut self, cx: &ViewContext, series: Vec<Series>, asked: Timestamp) {
        if !self.curves.is_wanted() {
            self.figures = series.iter().map(|series| (series.tag, figures(series, asked))).collect();
            if self.accumulate && self.end.is_none() {
                self.begin_with(self.span(cx), series.iter().filter_map(first_value).min());
            }
        }
        let sure = asked.checked_sub(real(cx, COMMIT_LAG_S)).unwrap_or(asked);
        let tags: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        for series in series.into_iter().filter(|series| tags.contains(&series.tag)) {
            self.traces.entry(series.tag).or_default().set_past(series, sure);
        }
    }

    /// Lets the view of the day begin with its first value, and asks again where that makes the columns much finer.
    pub(super) fn begin_with(&mut self, view: View, first: Option<Timestamp>) {
        if let Some(first) = first.filter(|first| *first > view.from) {
            self.since = Some(first);
            if first.duration_since(view.from) > view.width() / 20 {
                self.moved();
            }
        }
    }

    pub(super) fn ask(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if let Some(overlay) = &mut self.overlay {
            return overlay.ask(cx);
        }
        let (now, timeout, view) = (cx.present(), real(cx, TIMEOUT_S), self.span(cx));
        let group: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        let rate = real(cx, RATES[self.rate] as f64 / 1_000.0);
        // A curve of wide columns does not change its shape at every update; its newest values come live.
        let often = match view.holds(now) {
            true => rate.max((view.step() / 2).min(real(cx, 30.0))),
            false => real(cx, 60.0),
        };
        let series = |tags: &[TagId], from, to, buckets| Query::Series { tags: tags.to_vec(), from, to, buckets };
        let mut acts = Vec::new();
        if !self.listed && !group.is_empty() {
            let curves = series(&group, view.from, view.to, view.columns);
            acts.extend(self.curves.ask(cx, Tab::Trends, often, timeout, curves));
            acts.extend(self.ask_events(cx, view, often));
        }
        if !self.listed {
            acts.extend(self.ask_between(cx));
            acts.extend(self.ask_export(cx));
            acts.extend(self.ask_response(cx, often.max(real(cx, 2.0))));
        }
        let tags = if self.listed { self.seen(cx) } else { group };
        if self.listed && tags != self.hours_of {
            self.values.answered.query.want();
        }
        self.hours_of.clone_from(&tags);
        let hour = View::ending(cx.now, 3_600, HOUR_COLUMNS);
        if !tags.is_empty() {
            let hours = series(&tags, hour.from, hour.to, HOUR_COLUMNS);
            acts.extend(self.values.answered.ask(cx, Tab::Trends, real(cx, 20.0), timeout, hours));
        }
        acts
    }
}

/// Start of the first column that has a value.
pub(super) fn first_value(series: &Series) -> Option<Timestamp> {
    let first = series.buckets.iter().position(Option::is_some)?;
    series.from.checked_add(series.step * u32::try_from(first).ok()?).ok()
}

/// The figures of a curve up to when it was asked for: what lies after that is neither good nor bad.
pub(super) fn figures(series: &Series, asked: Timestamp) -> Figures {
    let width = series.step.as_secs_f64() * series.buckets.len() as f64;
    let past = asked.duration_since(series.from).as_secs_f64().clamp(0.0, width);
    // The millionth makes up for the rounding of the column's width, lest a whole record reads 99.9 %.
    let good = if past > 0.0 { (series.good * width / past + 1e-6).min(1.0) } else { series.good };
    (series.summary, good)
}
