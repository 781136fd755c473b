//! The control runs of a controller in a table to compare them, what is known of the selected one, and some over each other.

use crate::ui::tabs::{
    overlay::{Overlay, UNMARKED},
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
/// How often the list is refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;

/// State of the list.
#[derive(Debug, Default)]
pub struct Runs {
    rows: Answered<Vec<ControlRun>>,
    selected: Selected<u32>,
    /// Numbers of the marked ones.
    marked: Vec<u32>,
    /// Some of them over each other, in place of the list.
    pub overlay: Option<Overlay>,
}

impl Runs {
    fn rows(&self) -> &[ControlRun] {
        self.rows.value.as_deref().unwrap_or_default()
    }

    fn numbers(&self) -> impl Iterator<Item = u32> + '_ {
        self.rows().iter().map(|run| run.number)
    }

    fn place(&self) -> usize {
        self.selected.place(self.numbers())
    }

    pub fn select(&mut self, cx: &ViewContext, motion: Motion) {
        let (numbers, room) = (self.numbers().collect::<Vec<_>>(), self.room(cx, cx.area.height));
        self.selected.on(motion, numbers, room);
    }

    /// The trend of the selected one, over its whole time.
    pub fn trend(&self, cx: &ViewContext, device: DeviceId) -> Option<UiAction> {
        let run = self.rows().get(self.place())?;
        let tag = *rule(cx, device)?.tags.first()?;
        Some(UiAction::ShowOnTrends(tag, (run.from, run.until)))
    }

    /// Marks the selected one for the overlay, or no longer.
    pub fn mark(&mut self) {
        let Some(number) = self.numbers().nth(self.place()) else { return };
        match self.marked.iter().position(|marked| *marked == number) {
            Some(place) => drop(self.marked.remove(place)),
            None => self.marked.push(number),
        }
    }

    /// Shows the marked ones over each other; where none is marked, the selected one and those before it.
    pub fn lay_over(&mut self, cx: &ViewContext, device: DeviceId) {
        let Some(rule) = rule(cx, device) else { return };
        let place = self.place();
        let chosen = self.rows().iter().enumerate().filter(|(n, run)| match self.marked.as_slice() {
            [] => (place..place + UNMARKED).contains(n),
            marked => marked.contains(&run.number),
        });
        let chosen = chosen.map(|(_, run)| (run, figures(run)));
        self.overlay = Overlay::of_runs(rule, chosen).filter(|_| !self.rows().is_empty());
    }

    /// The curves of another tag.
    pub fn next_tag(&mut self, by: isize) {
        self.overlay.iter_mut().for_each(|overlay| overlay.next_tag(by));
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, device: &DeviceDef, number: &mut u32) -> Vec<UiAction> {
        let curves = self.overlay.as_mut().map_or(Vec::new(), |overlay| overlay.ask(cx, number));
        if self.overlay.as_ref().is_some_and(|overlay| !overlay.is_running()) {
            return curves;
        }
        let (to, controller) = (cx.now + SignedDuration::from_secs(1), Some(device.name.clone()));
        let query = Query::ControlRuns { controller, from: to - SPAN, to, limit: ROWS };
        let number = (Tab::Controllers, number);
        let list = self.rows.ask(cx, number, real(cx, EVERY_S), real(cx, TIMEOUT_S), query);
        curves.into_iter().chain(list).collect()
    }

    pub fn awaits(&self, number: u32) -> bool {
        self.rows.query.awaits(number) || self.overlay.as_ref().is_some_and(|overlay| overlay.awaits(number))
    }

    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        let is_list = self.rows.query.awaits(number);
        self.rows.on_answer(cx, number, answer);
        if let Some(overlay) = &mut self.overlay {
            overlay.on_answer(cx, number, answer);
            let listed = self.rows.value.iter().flatten().filter(|_| is_list);
            overlay.follow_runs(listed.map(|run| (run, figures(run))));
        }
    }

    /// Rows of the list on a tab of this height: the rest is about the selected run.
    fn room(&self, cx: &ViewContext, height: u16) -> usize {
        let details = self.rows().get(self.place()).map_or(0, |run| details(cx, run).len());
        usize::from(height).saturating_sub(details + 4).max(3)
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef) {
        let theme = cx.theme;
        let (columns, height) = (canvas.width(), canvas.height());
        let x = canvas.text(1, 0, &t!("Control runs of {name}", name = device.name), theme.strong()) + 2;
        let words = match (&self.rows.trouble, self.rows().len()) {
            (Some(trouble), _) => trouble.clone(),
            (None, ROWS..) => t!("the newest {ROWS}; the command `runs` has all", ROWS),
            (None, _) => t!("last 90 days").to_owned(),
        };
        let style = if self.rows.trouble.is_some() { theme.trouble() } else { theme.normal() };
        canvas.text(x, 0, &fit(&words, columns.saturating_sub(x + 1)), style);
        let unit = self.rows().first().map_or("", |run| &run.unit);
        let names = ["", t!("begin"), t!("setpoint"), t!("at SV"), t!("steady"), t!("over"), t!("offset"), t!("IAE")];
        canvas.text(1, 1, &fit(&draw::columns(WIDTHS, names), columns), theme.dim());
        canvas.text_right(columns.saturating_sub(1), 0, unit, theme.dim());
        if self.rows().is_empty() {
            let waiting = self.rows.query.shown_waiting(cx);
            let words = match self.rows.value {
                Some(_) => t!("No run yet: one begins when the setpoint is changed."),
                None => waiting.as_deref().unwrap_or(t!("collecting data")),
            };
            canvas.text(2, 3, words, theme.dim());
            return;
        }
        let (place, room) = (self.place(), self.room(cx, height));
        for (y, n, run) in on_screen(self.rows(), first(place, self.rows().len(), room), room) {
            let style = if n == place { theme.focus() } else { theme.normal() };
            let mark = if self.marked.contains(&run.number) { theme.pick("■", "*") } else { " " };
            canvas.text(0, y + 2, &pad(&format!("{mark}{}", row(cx, run)), columns), style);
        }
        let y = to_u16(room.min(self.rows().len())) + 2;
        for (line, text) in details(cx, &self.rows()[place]).iter().enumerate() {
            canvas.text(1, y + 1 + to_u16(line), &fit(text, columns.saturating_sub(2)), theme.normal());
        }
    }
}

/// Number, begin, setpoint and the figures.
const WIDTHS: [i16; 8] = [-4, 11, 20, -8, -8, -7, -7, -7];

fn rule<'a>(cx: &ViewContext<'a>, device: DeviceId) -> Option<&'a RunDef> {
    cx.def().runs.iter().find(|rule| rule.controller == device)
}

fn row(cx: &ViewContext, run: &ControlRun) -> String {
    let begin = moment(run.from, cx.now, &cx.def().time_zone);
    let value = |value: f64| digits(value, Some(run.decimals));
    let setpoint = match (&*run.detail, run.sv_before) {
        ("", Some(before)) => format!("{} {} {}", value(before), cx.theme.pick("→", ">"), value(run.sv)),
        ("", None) => value(run.sv),
        (detail, _) => format!("{} {detail}", value(run.sv)),
    };
    let [at_sv, steady, over, offset, iae] = figures(run);
    let number = run.number.to_string();
    draw::columns(WIDTHS, [&number, &begin, &fit(&setpoint, 20), &at_sv, &steady, &over, &offset, &iae])
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

/// All of its figures in words, and the parameters it ran with.
fn details(cx: &ViewContext, run: &ControlRun) -> Vec<String> {
    let (label, setpoint, state) = (run.label(), control_runs::setpoint(run), translate(run.state.word()));
    let lasted = control_runs::clock(run.lasted());
    let head = format!("{label}: {setpoint}, {state} {lasted}");
    let seen = (!run.seen).then(|| t!("it began before SV was read").to_owned());
    let changed = if run.settings_changed { t!(" (changed)") } else { "" };
    let settings = (!run.settings.is_empty()).then(|| format!("{}{changed}", run.settings));
    let figures = wrap(&control_runs::figures(run).join(", "), cx.area.width.saturating_sub(4));
    std::iter::once(head).chain(figures).chain(settings).chain(seen).collect()
}
