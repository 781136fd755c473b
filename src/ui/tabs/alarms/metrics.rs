//! How good the alarm system is: every metric beside target and limit, and the bad actors.

use super::span;
use crate::ui::tabs::prelude::*;
use crate::{
    plant::alarm::{
        ActiveAlarm, PeriodMetrics,
        metrics::{METRIC_TARGETS, TargetStatus},
    },
    report::{Period, alarm_metrics},
    ui::{modal::reason::subject, theme::Theme},
};

/// How often the figures of a running shift are queried again, real time.
const EVERY_S: f64 = 30.0;
/// An alarm that has been active for longer is stale.
const STALE: Duration = Duration::from_secs(24 * 3_600);
/// Columns of the table; where there are more than twice as many the bad actors stand beside it.
const TABLE: u16 = 80;

#[derive(Debug, Default)]
pub struct Metrics {
    /// The chosen shift; `None` is now: the last 24 hours, from the snapshot.
    period: Option<Period>,
    pub figures: Answered<Box<PeriodMetrics>>,
    scroll: Scroll,
}

impl Metrics {
    /// So many shifts later; `0` is the present.
    pub fn shift(&mut self, cx: &ViewContext, by: isize) {
        // Figures of one period must not stand under the name of another.
        *self = Metrics { period: period::step(cx, self.period.as_ref(), by), ..Metrics::default() };
    }

    pub fn step(&mut self, cx: &ViewContext, motion: Motion, room: usize) {
        self.scroll.on(motion, self.lines(cx, cx.area.width).len(), room);
    }

    /// Asks the history for a chosen shift if it is time.
    pub fn ask(&mut self, cx: &ViewContext) -> Option<UiAction> {
        let period = self.period(cx)?;
        let to = if cx.is_past() { period.to.min(cx.now) } else { period.to };
        let query = Query::AlarmMetrics { from: period.from, to };
        span::ask(cx, &mut self.figures, EVERY_S, Some(&period), query)
    }

    /// The period that the history is asked for: the chosen one; of a past instant the 24 hours before it.
    fn period(&self, cx: &ViewContext) -> Option<Period> {
        let day = || Period::free(cx.now.checked_sub(SignedDuration::from_secs(24 * 3_600)).unwrap_or(cx.now), cx.now);
        self.period.clone().or_else(|| cx.is_past().then(day))
    }

    /// The figures shown: of the chosen shift, or of the last 24 hours.
    fn figures<'a>(&'a self, cx: &ViewContext<'a>) -> Option<&'a PeriodMetrics> {
        match self.period(cx) {
            Some(_) => self.figures.value.as_deref(),
            None => Some(&cx.snapshot.alarm_metrics.day),
        }
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let theme = cx.theme;
        let (width, height) = (canvas.width(), canvas.height());
        if !cx.is_past() {
            let x = canvas.text(1, 0, t!("Now  "), theme.strong());
            let (words, flood) = now_text(cx);
            canvas.text(x, 0, &words, if flood { theme.trouble() } else { theme.normal() });
        }
        let what = match &self.period(cx) {
            None => t!("last 24 hours").to_owned(),
            Some(period) => period::words(cx, period),
        };
        let count = self.figures(cx).map(|figures| match figures.annunciated() {
            1 => t!(": 1 alarm{quiet}", quiet = alarm_metrics::quiet(figures)),
            many => t!(": {many} alarms{quiet}", many, quiet = alarm_metrics::quiet(figures)),
        });
        let wait = if self.figures.trouble.is_none() { t!(": collecting data") } else { "" };
        let x = canvas.text(1, 1, &format!("{what}{}", count.as_deref().unwrap_or(wait)), theme.strong());
        if let Some(trouble) = &self.figures.trouble {
            canvas.text(x + 2, 1, trouble, theme.trouble());
        }
        let side = 2 * TABLE <= width;
        let mut table = canvas.part(0, 2, if side { TABLE - 1 } else { width }, height.saturating_sub(3));
        let more = draw::lines(&mut table, &self.lines(cx, width), self.scroll);
        if side {
            let mut side = canvas.part(TABLE, 2, width - TABLE, height.saturating_sub(3));
            draw::lines(&mut side, &self.bad_actors(cx), Scroll::default());
        }
        let last = height.saturating_sub(1);
        let words = t!("ISA-18.2, per operator, for periods of 30 days or more");
        let more = if more > 0 { t!("{more} more below", more) } else { String::new() };
        let end = width.saturating_sub(1);
        canvas.text(1, last, &fit_words(words, end.saturating_sub(3 + text::width(&more))), theme.dim());
        canvas.text_right(end, last, &more, theme.strong());
    }

    /// The table, and below it the bad actors unless they stand beside it.
    fn lines(&self, cx: &ViewContext, width: u16) -> Vec<(String, Style)> {
        let Some(figures) = self.figures(cx) else { return Vec::new() };
        let head = line(cx.theme, [t!("metric"), t!("value"), t!("target"), t!("limit"), t!("result")]);
        let mut lines = vec![(head, cx.theme.dim())];
        for (goal, row) in METRIC_TARGETS.iter().zip(alarm_metrics::rows(figures)) {
            let value = row.value.map_or("–".into(), |value| format!("{value:.*}", usize::from(row.decimals)));
            let text = line(cx.theme, [translate(row.measure), &value, &row.target, &row.limit, translate(row.result)]);
            let style = match goal.verdict(figures) {
                TargetStatus::Good => cx.theme.normal(),
                TargetStatus::Beyond => cx.theme.strong(),
                TargetStatus::Over => cx.theme.trouble(),
                TargetStatus::InsufficientData => cx.theme.dim(),
            };
            lines.push((text, style));
        }
        if width < 2 * TABLE {
            lines.push((String::new(), cx.theme.normal()));
            lines.extend(self.bad_actors(cx));
        }
        lines
    }

    /// The most frequent alarms and their share, those that chattered, were fleeting, or have been active for a day.
    fn bad_actors(&self, cx: &ViewContext) -> Vec<(String, Style)> {
        let Some(figures) = self.figures(cx) else { return Vec::new() };
        let all = figures.annunciated().max(1) as f64;
        let mut lines = vec![(t!("alarms to investigate").to_owned(), cx.theme.dim())];
        let style = cx.theme.normal();
        for bad_actor in alarm_metrics::bad_actors(figures) {
            let share = bad_actor.raised.map(|raised| format!("{raised:>5} {:>3.0} %", raised as f64 * 100.0 / all));
            let share = share.unwrap_or_default();
            let text = format!("{} {share:11}  {}  {}", pad(bad_actor.kind, 10), bad_actor.subject, bad_actor.alarm);
            lines.push((fit_words(&text, TABLE), style));
        }
        if self.period.is_none() {
            lines.extend(stale(cx).map(|alarm| {
                let (since, name) = (running(elapsed(alarm.raised_at, cx.now)), subject(cx, alarm.id));
                let text = format!(
                    "{} {since:11}  {name}  {}",
                    pad(t!("stale"), 10),
                    translate(&cx.def().alarm(alarm.id).message)
                );
                (fit_words(&text, TABLE), style)
            }));
        }
        if lines.len() == 1 {
            lines.push((t!("none").to_owned(), style));
        }
        lines
    }
}

/// Alarms that have been active for a day.
pub fn stale<'a>(cx: &ViewContext<'a>) -> impl Iterator<Item = &'a ActiveAlarm> {
    let (now, alarms) = (cx.now, &cx.snapshot.alarms);
    alarms.iter().filter(move |alarm| alarm.state.is_active() && STALE < elapsed(alarm.raised_at, now))
}

/// The rates of this moment, and whether there is a flood.
fn now_text(cx: &ViewContext) -> (String, bool) {
    let metrics = &cx.snapshot.alarm_metrics;
    let flood = match metrics.flood_since {
        Some(since) => t!("FLOOD since {clock}", clock = clock(since, &cx.def().time_zone)),
        None => t!("no flood").to_owned(),
    };
    let words = t!(
        "last 10 min {last_10_min}   last hour {last_hour}   {flood}",
        last_10_min = metrics.last_10_min,
        last_hour = metrics.last_hour,
        flood
    );
    (words, metrics.flood_since.is_some())
}

fn line(theme: &Theme, [measure, figure, target, limit, verdict]: [&str; 5]) -> String {
    let sign = |bound: &str| {
        let bound = bound.replace("at most", theme.pick("≤", "<=")).replace("at least", theme.pick("≥", ">="));
        pad(&bound.replace("below", "<"), 7)
    };
    format!("{}  {} {} {verdict}", draw::columns([33, -8], [measure, figure]), sign(target), sign(limit))
}
