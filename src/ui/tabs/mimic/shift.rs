//! The shift on one time axis: steps of sequences and programs, alarms and operator actions, with a line at the present.

use super::attention::AttentionRow;
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        def::{Priority, ProgramDef},
        program::ProgramPosition,
        record::{ActionRecord, AlarmEvent, AlarmRecord},
    },
    ui::tabs::reports::period,
};

/// Columns of the names at the left.
const NAMES: u16 = 11;
/// Lanes of sequences and programs that are drawn at most.
const LANES_MAX: usize = 4;
/// Events of a kind that are read.
const EVENTS_MAX: usize = 500;
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 30.0;

/// What the history has answered.
#[derive(Debug, Default)]
pub struct Shift {
    steps: Answered<Vec<Series>>,
    alarms: Answered<Vec<AlarmRecord>>,
    actions: Answered<Vec<ActionRecord>>,
}

/// What a lane shows: a step, or where a program is.
#[derive(Debug, Clone, Copy)]
enum Lane<'a> {
    Sequence(TagId),
    Program(&'a DeviceDef, &'a ProgramDef),
}

impl Lane<'_> {
    fn tag(self) -> TagId {
        match self {
            Lane::Sequence(step) => step,
            Lane::Program(_, program) => program.position,
        }
    }
    fn name(self, cx: &ViewContext) -> String {
        match self {
            Lane::Sequence(step) => cx.def().tag(step).name.clone(),
            Lane::Program(device, _) => device.name.clone(),
        }
    }
    /// The name of a state, and whether something is done in it.
    fn state(self, cx: &ViewContext, value: f64) -> (String, bool) {
        match self {
            Lane::Sequence(step) => (cx.snapshot.format(step, value), value != 0.0),
            Lane::Program(_, program) => match program.place(value) {
                ProgramPosition::Off => (t!("off").to_owned(), false),
                ProgramPosition::Ended => (t!("ended").to_owned(), false),
                ProgramPosition::Ramp(step) => (t!("ramp {step}", step = step + 1), true),
                ProgramPosition::Soak(step) => (t!("soak {step}", step = step + 1), true),
            },
        }
    }
}

/// Sequences first, then programs.
fn lanes<'a>(cx: &ViewContext<'a>) -> Vec<Lane<'a>> {
    let def = cx.def();
    let sequences = def.logic.sequences.iter().map(|sequence| Lane::Sequence(sequence.step));
    let programs = def.devices.iter().filter_map(|device| Some(Lane::Program(device, device.program.as_ref()?)));
    sequences.chain(programs).filter(|lane| def.tag(lane.tag()).is_stored()).collect()
}

/// The running shift, else the running day.
fn span(cx: &ViewContext) -> Option<(Timestamp, Timestamp)> {
    period::at(cx.def(), cx.now).map(|shift| (shift.from, shift.to))
}

impl Shift {
    /// Asks for what is due, for a drawing of so many columns.
    pub fn ask(&mut self, cx: &ViewContext, columns: u16) -> Vec<UiAction> {
        let Some((from, _)) = span(cx) else { return Vec::new() };
        let (to, limit) = (cx.now, EVENTS_MAX);
        let (every, timeout) = (real(cx, EVERY_S), real(cx, TIMEOUT_S));
        let tags: Vec<TagId> = lanes(cx).into_iter().map(Lane::tag).collect();
        let buckets = usize::from(columns).max(1);
        let steps = Query::Series { tags: tags.clone(), from, to, buckets };
        let steps =
            if tags.is_empty() || to <= from { None } else { self.steps.ask(cx, Tab::Mimic, every, timeout, steps) };
        let alarms = self.alarms.ask(cx, Tab::Mimic, every, timeout, Query::Journal { from, to, limit });
        let actions = self.actions.ask(cx, Tab::Mimic, every, timeout, Query::Actions { from, to, limit });
        [steps, alarms, actions].into_iter().flatten().collect()
    }

    pub fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.steps, &mut self.alarms, &mut self.actions]
    }

    /// The lanes that are drawn: a program that rests all the time has none.
    fn drawn<'a>(&self, cx: &ViewContext<'a>) -> Vec<Lane<'a>> {
        let series = |lane: Lane| self.steps.value.iter().flatten().find(|series| series.tag == lane.tag());
        let runs = |lane: &Lane| match lane {
            Lane::Sequence(_) => true,
            Lane::Program(..) => {
                value::is_on(cx, lane.tag()) == Some(true)
                    || series(*lane).is_some_and(|series| series.buckets.iter().flatten().any(|b| b.max > 0.0))
            }
        };
        lanes(cx).into_iter().filter(runs).take(LANES_MAX).collect()
    }

    pub fn height(&self, cx: &ViewContext) -> u16 {
        3 + to_u16(self.drawn(cx).len())
    }

    /// Draws it, the lanes first: rows that have no room are left out at the bottom.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let Some((from, to)) = span(cx) else { return };
        let theme = cx.theme;
        let mut axis = Axis { from, to, columns: canvas.width().saturating_sub(NAMES), now: cx.now };
        axis.columns = axis.columns.max(1);
        canvas.text(0, 0, &fit(t!("shift"), NAMES - 1), theme.dim());
        hours(cx, &mut canvas.part(NAMES, 0, axis.columns, 1), axis);
        let mut y = 1;
        for lane in self.drawn(cx) {
            canvas.text(0, y, &fit(&lane.name(cx), NAMES - 1), theme.dim());
            let series = self.steps.value.iter().flatten().find(|series| series.tag == lane.tag());
            steps(cx, &mut canvas.part(NAMES, y, axis.columns, 1), axis, lane, series);
            y += 1;
        }
        canvas.text(0, y, &fit(t!("alarms"), NAMES - 1), theme.dim());
        self.alarms(cx, &mut canvas.part(NAMES, y, axis.columns, 1), axis);
        canvas.text(0, y + 1, &fit(t!("operators"), NAMES - 1), theme.dim());
        self.operators(cx, &mut canvas.part(NAMES, y + 1, axis.columns, 1), axis);
        let now = axis.now();
        for row in 1..canvas.height().min(y + 2) {
            if canvas.is_blank(NAMES + now, row, 1) {
                canvas.glyph(NAMES + now, row, theme.pick('│', '|'), theme.strong());
            }
        }
    }

    /// The priority of the most urgent alarm that was raised in each column.
    fn alarms(&self, cx: &ViewContext, canvas: &mut Canvas, axis: Axis) {
        let Some(alarms) = &self.alarms.value else { return unknown(cx, canvas, self.alarms.trouble.as_deref()) };
        let mut raised: Vec<Option<Priority>> = vec![None; usize::from(axis.columns)];
        for record in alarms.iter().filter(|record| record.event == AlarmEvent::Raised) {
            let Some(cell) = axis.column(record.at).and_then(|x| raised.get_mut(usize::from(x))) else { continue };
            *cell = Some(cell.map_or(record.priority, |urgent| urgent.min(record.priority)));
        }
        for (x, priority) in raised.into_iter().enumerate() {
            if let Some(priority) = priority {
                canvas.text(x, 0, &priority.number().to_string(), cx.theme.severity(priority));
            }
        }
        older(cx, canvas, alarms.len());
    }

    /// What operators did: a mark for each action, and its words where there is room behind it.
    fn operators(&self, cx: &ViewContext, canvas: &mut Canvas, axis: Axis) {
        let Some(actions) = &self.actions.value else { return unknown(cx, canvas, self.actions.trouble.as_deref()) };
        let changes = actions.iter().filter(|row| row.changes_plant() || row.note.is_some());
        // The newest first, so that an older one never covers it.
        for row in changes {
            let Some(x) = axis.column(row.at).filter(|x| canvas.is_blank(*x, 0, 1)) else { continue };
            let mark = if row.note.is_some() { "n" } else { "c" };
            canvas.text(x, 0, mark, cx.theme.strong());
            let what = row.new.as_deref().unwrap_or(&row.action);
            let words = format!("{} {what} {}", row.target, row.by);
            if canvas.is_blank(x + 1, 0, width(&words) + 2) && x + 2 + width(&words) < axis.columns {
                canvas.text(x + 2, 0, &words, cx.theme.normal());
            }
        }
        older(cx, canvas, actions.len());
    }
}

/// Says that older events are not drawn, where there are more than were read.
fn older(cx: &ViewContext, canvas: &mut Canvas, read: usize) {
    if EVENTS_MAX <= read {
        canvas.text(0, 0, "<", cx.theme.trouble());
    }
}

fn unknown(cx: &ViewContext, canvas: &mut Canvas, trouble: Option<&str>) {
    canvas.text(0, 0, &fit_words(trouble.unwrap_or(t!("collecting data")), canvas.width()), cx.theme.dim());
}

/// A stretch of time on so many columns.
#[derive(Debug, Clone, Copy)]
struct Axis {
    from: Timestamp,
    to: Timestamp,
    columns: u16,
    now: Timestamp,
}

impl Axis {
    fn column(self, at: Timestamp) -> Option<u16> {
        let share = at.duration_since(self.from).as_secs_f64() / self.to.duration_since(self.from).as_secs_f64();
        let x = to_u16((share * f64::from(self.columns)).floor().max(0.0));
        ((0.0..1.0).contains(&share)).then_some(x.min(self.columns - 1))
    }
    fn now(self) -> u16 {
        self.column(self.now).unwrap_or(self.columns - 1)
    }
    /// The middle of a column.
    fn at(self, x: u16) -> Option<Timestamp> {
        let share = (f64::from(x) + 0.5) / f64::from(self.columns);
        let since = SignedDuration::from_secs_f64(self.to.duration_since(self.from).as_secs_f64() * share);
        self.from.checked_add(since).ok()
    }
}

/// Full hours where they stand; fewer where there is no room for all.
fn hours(cx: &ViewContext, canvas: &mut Canvas, axis: Axis) {
    let span = axis.to.duration_since(axis.from).as_hours().max(1);
    let each = [1, 2, 3, 4, 6, 12].into_iter().find(|each| span / each * 6 <= i64::from(axis.columns)).unwrap_or(24);
    let (mut free, now) = (0, axis.now());
    for x in 0..axis.columns {
        let (Some(at), Some(before)) = (axis.at(x), x.checked_sub(1).map_or(Some(axis.from), |x| axis.at(x))) else {
            continue;
        };
        let hour = |at: Timestamp| i64::from(at.to_zoned(cx.def().time_zone.clone()).hour());
        let begins = x == 0 || hour(at) != hour(before);
        let label = cx.local(at, "%H:00");
        let covers_now = (x..=x + width(&label)).contains(&now);
        if begins && hour(at) % each == 0 && free <= x && !covers_now {
            free = canvas.text(x, 0, &label, cx.theme.dim()) + 1;
        }
    }
    canvas.glyph(now, 0, cx.theme.pick('▼', 'v'), cx.theme.strong());
}

/// The states of a lane up to now, each with its name where it begins: `▏HEAT━━━━━▏HOLD━━━▏IDLE┈┈`.
fn steps(cx: &ViewContext, canvas: &mut Canvas, axis: Axis, lane: Lane, series: Option<&Series>) {
    let theme = cx.theme;
    let bucket = |at: Timestamp| {
        let series = series?;
        let into = at.duration_since(series.from).as_secs_f64() / series.step.as_secs_f64().max(1e-6);
        let n = crate::plant::number::to_usize(into.max(0.0));
        series.buckets.get(n).copied().flatten().map(|bucket| bucket.last)
    };
    let now = axis.now();
    let state = |x: u16| if x == now { cx.snapshot.sample(lane.tag()).good_exact() } else { bucket(axis.at(x)?) };
    let states: Vec<Option<Exact>> = (0..=now).map(state).collect();
    let mut x = 0;
    for part in states.chunk_by(|a, b| a == b) {
        let length = to_u16(part.len());
        match part[0] {
            None => canvas.run(x, 0, length, theme.pick('╌', '~'), theme.dim()),
            Some(value) => {
                let (name, active) = lane.state(cx, value.near());
                let style = if active { theme.normal() } else { theme.dim() };
                let (on, off) = (theme.pick('━', '#'), theme.pick('┈', '.'));
                canvas.run(x, 0, length, if active { on } else { off }, style);
                canvas.glyph(x, 0, theme.pick('▏', '|'), theme.strong());
                if width(&name) < length {
                    canvas.text(x + 1, 0, &name, if active { theme.strong() } else { theme.dim() });
                }
            }
        }
        x += length;
    }
}

pub fn end(cx: &ViewContext) -> Option<AttentionRow> {
    let (_, to) = span(cx).filter(|_| !cx.def().shifts.is_empty())?;
    let left = running(elapsed(cx.now, to));
    Some((t!("{left}  shift ends {at}", left, at = cx.local(to, "%H:%M")), cx.theme.normal()))
}
