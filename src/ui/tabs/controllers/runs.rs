//! The control runs of a controller in a table to compare them, what is known of the selected one, and some over each other.

use crate::ui::tabs::{
    overlay::{Kind, Laid, Laying, Overlaid},
    prelude::*,
};
use crate::{
    plant::control_run::{ControlRun, Figure, RunDef},
    report::control_runs,
};

/// Rows of one answer; the command `runs` has all of them.
const ROWS: usize = 50;
/// The list reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24 * 90);

pub type Runs = Overlaid<ControlRuns>;

#[derive(Debug)]
pub struct ControlRuns {
    pub device: DeviceId,
}

impl ControlRuns {
    fn rule<'a>(&self, cx: &ViewContext<'a>) -> Option<&'a RunDef> {
        cx.def().runs.iter().find(|rule| rule.controller == self.device)
    }
}

impl Listing for ControlRuns {
    type Answer = Vec<ControlRun>;
    type Row = ControlRun;
    type Id = u32;

    const MARKS: bool = true;
    const TRENDS: bool = true;

    fn heading<'a>(&self, cx: &ViewContext<'a>, runs: Option<&'a Vec<ControlRun>>) -> Heading<'a> {
        let name = cx.def().devices.get(self.device.index()).map_or("", |device| &device.name);
        let empty = t!("No run yet: one begins when the setpoint is changed.");
        Heading::new(t!("Control runs of {name}", name), empty)
            .words(t!("last 90 days"), cx.theme.normal())
            .limit(ROWS, t!("the newest {ROWS}; the command `runs` has all", ROWS))
            .right(runs.and_then(|runs| runs.first()).map_or("", |run| &run.unit))
    }

    fn query(&self, cx: &ViewContext) -> Option<Query> {
        let to = cx.now + SignedDuration::from_secs(1);
        let controller = Some(cx.def().devices.get(self.device.index())?.name.clone());
        Some(Query::ControlRuns { controller, from: to - SPAN, to, limit: ROWS })
    }

    fn rows<'a>(&'a self, _cx: &ViewContext<'a>, runs: Option<&'a Vec<ControlRun>>) -> Vec<Cow<'a, ControlRun>> {
        runs.into_iter().flatten().map(Cow::Borrowed).collect()
    }

    fn id(run: &ControlRun) -> u32 {
        run.number
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<ControlRun>> {
        vec![
            right(4, "", |_, run| run.number.to_string()),
            left(11, t!("begin"), |cx, run: &ControlRun| moment(run.from, cx.now, &cx.def().time_zone))
                .by(|a, b| a.from.cmp(&b.from)),
            left(20, t!("setpoint"), |cx, run| fit(&setpoint(cx, run), 20)),
            right(8, t!("at SV"), figure::<0>),
            right(8, t!("steady"), figure::<1>),
            right(7, t!("over"), figure::<2>),
            right(7, t!("offset"), figure::<3>),
            right(7, t!("IAE"), figure::<4>),
        ]
    }

    /// All of its figures in words, and the parameters it ran with.
    fn details(&self, cx: &ViewContext, run: &ControlRun, _: Option<&Vec<ControlRun>>) -> Vec<(String, Style)> {
        let (label, setpoint, state) = (run.label(), control_runs::setpoint(run), translate(run.state.word()));
        let changed = if run.settings_changed { t!(" (changed)") } else { "" };
        let texts = [
            format!("{label}: {setpoint}, {state} {}", control_runs::clock(run.lasted())),
            control_runs::figures(run).join(", "),
            if run.settings.is_empty() { String::new() } else { format!("{}{changed}", run.settings) },
            if run.seen { String::new() } else { t!("it began before SV was read").to_owned() },
        ];
        texts.into_iter().map(|text| (text, cx.theme.normal())).collect()
    }

    fn moment(&self, run: &ControlRun) -> Option<Timestamp> {
        Some(run.from)
    }

    fn trend(&self, cx: &ViewContext, run: &ControlRun) -> Option<(TagId, (Timestamp, Timestamp))> {
        Some((*self.rule(cx)?.tags.first()?, (run.from, run.until)))
    }
}

impl Laying for ControlRuns {
    fn laid(run: &ControlRun) -> Laid {
        Laid::of_run(run, figures(run))
    }

    fn curves(&self, cx: &ViewContext, _run: &ControlRun) -> Option<(Kind, Vec<TagId>)> {
        Some((Kind::Runs, self.rule(cx)?.tags.clone()))
    }
}

fn setpoint(cx: &ViewContext, run: &ControlRun) -> String {
    let value = |value: f64| digits(value, Some(run.decimals));
    match (&*run.detail, run.sv_before) {
        ("", Some(before)) => format!("{} {} {}", value(before), cx.theme.pick("→", ">"), value(run.sv)),
        ("", None) => value(run.sv),
        (detail, _) => format!("{} {detail}", value(run.sv)),
    }
}

fn figure<const N: usize>(_cx: &ViewContext, run: &ControlRun) -> String {
    std::mem::take(&mut figures(run)[N])
}

/// First at SV, steady from, overshoot, offset, IAE; what is a lower bound has a mark.
pub fn figures(run: &ControlRun) -> [String; 5] {
    let time = |figure: Figure| match figure {
        Figure::NotYet if run.is_running() => "…".to_owned(),
        Figure::NotYet => control_runs::reached(None),
        Figure::After(time) => control_runs::reached(Some(time)),
        Figure::Unknown => "?".to_owned(),
    };
    let value = |value: f64| digits(value, Some(run.decimals));
    let bound = if run.is_partial() { ">" } else { "" };
    let over = run.overshoot.map_or("?".to_owned(), |over| format!("{bound}{}", value(over)));
    let offset = run.offset.map_or("?".to_owned(), value);
    [time(run.at_sv), time(run.steady), over, offset, format!("{bound}{}", value(run.iae))]
}
