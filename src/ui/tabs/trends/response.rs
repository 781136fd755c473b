//! The answer of a controller to the last step of its setpoint in the view, with its figures.

use ratatui::{text::Line, widgets::Widget};

use super::{legend::signed_time, view::share, *};
use crate::{
    plant::{
        def::Faceplate,
        step_response::{Loop, SETTLED, StepResponse, step_response},
    },
    ui::widgets::chart::{Chart, Curve, Limit},
};

/// Columns of the view that it is computed from.
const COLUMNS: usize = 2_000;
/// Rows of figures under the chart.
const ROWS: u16 = 4;

/// SV and PV of the controller, as the history has them.
#[derive(Debug, Default)]
pub(super) struct Response {
    /// View and tags that the answer is about.
    about: Option<(View, [TagId; 2])>,
    curves: Answered<Vec<Series>>,
    /// SV and PV of the last answer, and their last step; the step is `None` where there was none.
    found: Option<([Trace; 2], Option<StepResponse>, Duration)>,
}

impl Response {
    pub(super) fn asked(&mut self) -> &mut dyn Asked {
        &mut self.curves
    }

    /// The curves have come.
    pub(super) fn find(&mut self) {
        let curves = self.curves.value.take().filter(|_| !self.curves.query.is_wanted());
        self.found = curves.and_then(|curves| <[Series; 2]>::try_from(curves).ok()).map(|curves| {
            let (found, step) = (last_step(&curves), curves[1].step);
            let trace = |series| {
                let mut trace = Trace::default();
                trace.set_past(series, Timestamp::MAX);
                trace
            };
            (curves.map(trace), found, step)
        });
    }
}

/// The last step of SV and the answer of PV.
fn last_step([sv, pv]: &[Series; 2]) -> Option<StepResponse> {
    let lasts = |series: &Series| series.buckets.iter().map(|bucket| bucket.map(|b| b.last.near())).collect::<Vec<_>>();
    step_response(Loop { from: pv.from, step: pv.step, sv: &lasts(sv), pv: &lasts(pv) })
}

impl Trends {
    /// The controller of the selected pen: that of its device.
    fn controller<'a>(&self, cx: &ViewContext<'a>) -> Option<(&'a DeviceDef, &'a Faceplate)> {
        let pen = self.pens(cx).get(self.selected).copied()?;
        let device = cx.def().devices.get(cx.def().tag(pen.tag).device.index())?;
        Some((device, device.faceplate.as_ref()?))
    }

    /// Asks for SV and PV of the controller while its response is shown.
    pub(super) fn ask_response(&mut self, cx: &ViewContext, often: SignedDuration) -> Option<UiAction> {
        let (_, face) = self.controller(cx).filter(|_| self.plot == Plot::Response)?;
        let is_stored = |tag: &TagId| cx.def().tag(*tag).is_stored();
        let tags = [face.sv_used.filter(is_stored).unwrap_or(face.sv), face.pv];
        let view = self.span(cx);
        let asked = self.response.about.replace((view, tags));
        if asked.is_none_or(|(_, asked)| asked != tags) {
            self.response.found = None;
        }
        if asked != self.response.about {
            self.response.curves.query.want();
        }
        let every = if view.holds(cx.present()) { often } else { SignedDuration::MAX };
        let query = Query::Series { tags: tags.to_vec(), from: view.from, to: view.to, buckets: COLUMNS };
        self.response.curves.ask(cx, Tab::Trends, every, real(cx, TIMEOUT_S), query)
    }
}

/// Draws PV and SV since shortly before the step, the band of 2 %, and the figures.
pub(super) fn draw_response(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (theme, height) = (cx.theme, canvas.height());
    let centred = |canvas: &mut Canvas, text: &str| canvas.text_centred(height / 2, text, theme.dim());
    let Some((device, _)) = trends.controller(cx) else {
        return centred(canvas, t!("select a pen of a controller"));
    };
    let Some((_, tags)) = trends.response.about else { return };
    let Some((traces, found, step)) = &trends.response.found else {
        return centred(canvas, trends.response.curves.trouble.as_deref().unwrap_or(t!("reading the history")));
    };
    let Some(found) = found else {
        return centred(canvas, t!("no step of the setpoint in this window: choose a longer one"));
    };
    let unit = cx.snapshot.unit(tags[1]);
    let curve = |n: usize, pen| Curve::new(&traces[n], pen, unit, cx.snapshot.decimals[tags[1].index()]);
    let before = found.until.duration_since(found.at) / 10;
    let span = (found.at - before, found.until + before / 2, found.until);
    let band = (found.sv.1 - found.sv.0).abs() * SETTLED;
    let limit = |value, high, text: &str| Limit { curve: 0, value, high, text: text.to_owned() };
    let number = |value: f64| cx.snapshot.format(tags[1], value);
    let word = |at, text: String| (at, Line::styled(text, theme.normal()));
    let mut cursors = vec![word(found.at, t!("SV step").to_owned())];
    cursors.extend(found.rise.map(|(_, end)| word(end, t!("90 %").to_owned())));
    cursors.extend(found.peak.map(|(at, value)| word(at, t!("peak {value}", value = number(value)))));
    cursors.extend(found.settled.map(|at| word(at, t!("settled").to_owned())));
    cursors.sort_by_key(|(at, _)| *at);
    let chart = Chart {
        zone: Some(&cx.def().time_zone),
        cursors,
        limits: vec![limit(found.sv.1 + band, true, "+2 %"), limit(found.sv.1 - band, false, "-2 %")],
        ..Chart::new(theme, span, vec![curve(1, 0), Curve { dashed: true, ..curve(0, 1) }])
    };
    let area = canvas.part(0, 0, canvas.width(), height.saturating_sub(ROWS)).area();
    chart.render(area, canvas.buffer());
    for (y, line) in (0..).zip(figures(cx, device, tags[1], found, *step)) {
        let y = height.saturating_sub(ROWS) + y;
        canvas.text(
            1,
            y,
            &fit(&line, canvas.width().saturating_sub(2)),
            if y + ROWS == height { theme.strong() } else { theme.normal() },
        );
    }
}

fn figures(cx: &ViewContext, device: &DeviceDef, pv: TagId, found: &StepResponse, step: Duration) -> [String; 4] {
    let (unit, arrow) = (cx.snapshot.unit(pv), cx.theme.pick("→", "->"));
    let number = |value: f64| cx.snapshot.format(pv, value);
    let since = |at: Timestamp| signed_time(at.duration_since(found.at));
    let none = || t!("not yet").to_owned();
    let decimals = usize::from(cx.snapshot.decimals[pv.index()]) + 1;
    let peak = found.peak.map(|(at, value)| {
        t!(
            "{percent} %: {value} {unit} after {time}",
            percent = format!("{:.1}", found.overshoot),
            value = number(value),
            unit,
            time = since(at)
        )
    });
    let rise = found.rise.map(|(begin, end)| signed_time(end.duration_since(begin)));
    [
        t!(
            "{name}  setpoint {from} {arrow} {to} {unit} at {time}, from {pv}, observed for {observed}",
            name = device.name,
            from = number(found.sv.0),
            arrow,
            to = number(found.sv.1),
            unit,
            time = clock(found.at, &cx.def().time_zone),
            pv = number(found.pv),
            observed = since(found.until)
        ),
        t!("overshoot {peak}", peak = peak.unwrap_or_else(|| t!("none").to_owned())),
        t!(
            "rise time 10–90 % {rise}   settling time 2 % {settled}   resolution {step}",
            rise = rise.unwrap_or_else(none),
            settled = found.settled.map_or_else(none, since),
            step = format!("{:.1} s", step.as_secs_f64())
        ),
        t!(
            "IAE {iae} {unit} min   good {good}",
            iae = format!("{:.decimals$}", found.iae),
            unit,
            good = share(found.good)
        ),
    ]
}
