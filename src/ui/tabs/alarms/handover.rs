//! The handover: what the next shift must know, as the plant stands and as the shift has left it, and who took it over.

use super::{journal::action_text, metrics::stale, span};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{command::Outcome, line_state::LineState, record::ActionRecord, recorded_action::RecordedAction},
    report::Period,
    ui::modal::{faceplate::device_text, reason::subject},
};

/// Most actions that are read; the list says when there are more.
const ROWS: usize = 500;
/// How often they are queried again, real time.
const EVERY_S: f64 = 2.0;
/// Bad or uncertain values that are named at most.
const NAMED: usize = 8;
#[derive(Debug, Default)]
pub struct Handover {
    /// The chosen shift; `None` is the running one.
    period: Option<Period>,
    /// Actions of it and of the shift before, newest first.
    pub actions: Answered<Vec<ActionRecord>>,
    scroll: Scroll,
}

impl Handover {
    /// So many shifts later; `0` is the running one.
    pub fn shift(&mut self, cx: &ViewContext, by: isize) {
        let chosen = period::step(cx, self.period(cx).as_ref(), by);
        *self = Handover { period: chosen.filter(|chosen| chosen.to <= cx.now), ..Handover::default() };
    }

    pub fn step(&mut self, cx: &ViewContext, motion: Motion, room: usize) {
        self.scroll.on(motion, self.lines(cx, cx.area.width).len(), room);
    }

    /// An action was done: queries at once what it changed.
    pub fn want(&mut self) {
        self.actions.query.want();
    }

    fn period(&self, cx: &ViewContext) -> Option<Period> {
        self.period.clone().or_else(|| period::at(cx.def(), cx.now))
    }

    /// Asks the history if it is time.
    pub fn ask(&mut self, cx: &ViewContext) -> Option<UiAction> {
        let shown = self.period(cx)?;
        // What the shift before wrote down is for this one.
        let from = period::before(cx.def(), &shown).map_or(shown.from, |before| before.from);
        let to = if cx.is_past() { shown.to.min(cx.now) } else { shown.to };
        let query = Query::Actions { from, to, limit: ROWS };
        span::ask(cx, &mut self.actions, EVERY_S, Some(&shown), query)
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let theme = cx.theme;
        let (width, height) = (canvas.width(), canvas.height());
        let x = canvas.text(1, 0, t!("Handover  "), theme.strong());
        let x = match self.period(cx) {
            Some(shown) => canvas.text(x, 0, &period::words(cx, &shown), theme.normal()),
            None => x,
        };
        let x = match &self.actions.trouble {
            Some(trouble) => canvas.text(x + 2, 0, trouble, theme.trouble()),
            None if self.actions.value.is_none() => canvas.text(x + 2, 0, t!("collecting data"), theme.dim()),
            None => x,
        };
        let mut below = canvas.part(0, 1, width, height.saturating_sub(1));
        let more = draw::lines(&mut below, &self.lines(cx, width), self.scroll);
        if more > 0 {
            let brief = format!(" {more} {}", theme.pick("↓", "v"));
            let words = [t!("{more} more below", more), brief.clone()];
            let fits = words.into_iter().find(|words| x + 1 + text::width(words) < width).unwrap_or(brief);
            canvas.text_right(width.saturating_sub(1), 0, &fits, theme.strong());
        }
    }

    fn lines(&self, cx: &ViewContext, width: u16) -> Vec<(String, Style)> {
        let theme = cx.theme;
        let room = width.saturating_sub(4);
        let mut lines = self.note_lines(cx, room);
        let mut section = |title: &str, rows: Vec<String>, worry: bool| {
            let style = if worry && !rows.is_empty() { theme.strong() } else { theme.dim() };
            let title = if rows.is_empty() { t!("{title}: none", title) } else { format!("{title}: {}", rows.len()) };
            lines.push((title, style));
            let rows = rows.into_iter().map(|row| (format!("  {}", fit_words(row.trim_start(), room)), theme.normal()));
            lines.extend(rows);
        };
        section(
            t!("suppressed"),
            cx.snapshot.suppressed.iter().map(|suppressed| guidance_text::suppressed_words(cx, suppressed)).collect(),
            true,
        );
        section(t!("abnormal: manual, disabled, under test"), unusual(cx), true);
        section(t!("bad or uncertain values"), doubtful(cx), true);
        if let Some(actions) = &self.actions.value {
            let from = self.period(cx).map_or(Timestamp::MIN, |shown| shown.from);
            let of = |keep: fn(&ActionRecord) -> bool| {
                let rows = actions.iter().filter(|row| from <= row.at && keep(row));
                folded(cx, rows.map(|row| (row.at, action_text(cx, row).trim_start().to_owned())))
            };
            section(t!("failed in this shift"), of(|row| has_failed(row) && ActionRecord::changes_plant(row)), true);
            section(t!("changed in this shift"), of(|row| !has_failed(row) && ActionRecord::changes_plant(row)), false);
            if actions.len() >= ROWS {
                section(t!("the oldest actions are omitted"), Vec::new(), true);
            }
        }
        lines
    }

    /// The last note, and who has taken over since.
    fn note_lines(&self, cx: &ViewContext, room: u16) -> Vec<(String, Style)> {
        let theme = cx.theme;
        let when = |row: &ActionRecord| moment(row.at, cx.now, &cx.def().time_zone);
        let actions = self.actions.value.as_deref().unwrap_or_default();
        let note = actions.iter().enumerate().find(|(_, row)| row.is(RecordedAction::HandOver) && !has_failed(row));
        let Some((n, note)) = note else {
            let answered = self.actions.value.is_some();
            let words = if answered { t!("No handover recorded for this shift or the one before.") } else { "" };
            return vec![(words.to_owned(), theme.normal())];
        };
        let mut lines = vec![(t!("handed over {when} by {by}", when = when(note), by = note.by), theme.strong())];
        let text = note.note.as_deref().unwrap_or(t!("without a note"));
        lines.extend(wrap(text, room).into_iter().map(|line| (format!("  {line}"), theme.normal())));
        let taken = actions[..n].iter().rev().find(|row| row.is(RecordedAction::TakeOver) && !has_failed(row));
        lines.push(match taken {
            Some(row) => (t!("taken over {when} by {by}", when = when(row), by = row.by), theme.strong()),
            None if is_own(cx, note) => {
                (t!("not taken over yet: another user takes over with o").to_owned(), theme.trouble())
            }
            None => (t!("not taken over yet: o takes over").to_owned(), theme.trouble()),
        });
        lines
    }

    /// Did the current user hand over, with no take-over since?
    pub fn is_own(&self, cx: &ViewContext) -> bool {
        let last = |row: &&ActionRecord| {
            (row.is(RecordedAction::HandOver) || row.is(RecordedAction::TakeOver)) && !has_failed(row)
        };
        let actions = self.actions.value.as_deref().unwrap_or_default();
        actions.iter().find(last).is_some_and(|row| row.is(RecordedAction::HandOver) && is_own(cx, row))
    }
}

fn is_own(cx: &ViewContext, row: &ActionRecord) -> bool {
    cx.session.who.as_ref().is_some_and(|who| who.user == row.by)
}

/// Each row with its time; those that are alike once, at the time of the newest, with their count.
fn folded(cx: &ViewContext, rows: impl Iterator<Item = (Timestamp, String)>) -> Vec<String> {
    let mut kinds: Vec<(Timestamp, String, usize)> = Vec::new();
    for (at, words) in rows {
        match kinds.iter_mut().find(|(_, other, _)| *other == words) {
            Some((_, _, count)) => *count += 1,
            None => kinds.push((at, words, 1)),
        }
    }
    let row = |(at, words, count): (Timestamp, String, usize)| {
        let at = moment(at, cx.now, &cx.def().time_zone);
        let dot = cx.theme.pick("·", ".");
        let times = if 1 < count { format!("{count}{}", cx.theme.pick("×", "x")) } else { dot.to_owned() };
        format!("{at} {times} {}", words.trim_start_matches(dot).trim_start())
    };
    kinds.into_iter().map(row).collect()
}

/// Disconnected lines and devices, sequences in manual, actuators that do not follow their command.
fn unusual(cx: &ViewContext) -> Vec<String> {
    let (def, snapshot) = (cx.def(), cx.snapshot);
    let zone = &def.time_zone;
    let lines = def.lines.iter().flat_map(|line| {
        let status = snapshot.line(line.id);
        let state = match status.state {
            LineState::Disconnected => Some(t!("disconnected by an operator").to_owned()),
            LineState::Testing => Some(t!("in use by a test").to_owned()),
            LineState::Waiting { .. } | LineState::Connecting => {
                status.lost_since.map(|since| t!("not connected since {clock}", clock = clock(since, zone)))
            }
            LineState::NoTraffic => {
                status.lost_since.map(|since| t!("no traffic heard since {clock}", clock = clock(since, zone)))
            }
            LineState::Connected => None,
        };
        let tried = status.settings_before.as_ref().map(|_| t!("settings under test, not saved").to_owned());
        state.into_iter().chain(tried).map(|words| format!("{} {words}", line.name))
    });
    let devices = def.devices.iter().filter_map(|device| {
        let status = snapshot.device(device.id);
        let words = match (status.state, status.diagnosis) {
            (DeviceState::Down { .. }, _) => device_text(cx, device.id),
            (DeviceState::Unknown | DeviceState::Responding | DeviceState::Failing(_), reason) => {
                let signal = reason?.signal();
                format!("{} {}", signal.word(), translate(signal.label()))
            }
        };
        Some(format!("{} {words}", device.name))
    });
    let sequences = def.logic.sequences.iter().filter_map(|sequence| {
        let (tag, auto) = sequence.auto?;
        let now = snapshot.sample(tag).good_value().filter(|now| *now != auto)?;
        Some(format!("{} {}", def.tag(tag).name, snapshot.format(tag, now)))
    });
    let stubborn = def.logic.actuators.iter().enumerate().filter_map(|(n, actuator)| {
        let lasts = snapshot.actuators.feedback_mismatch(&def.logic, n, cx.now)?;
        Some(t!(
            "{name} has not followed its command for {running}",
            name = def.tag(actuator.output).name,
            running = running(lasts)
        ))
    });
    let unknown = cx.is_past().then(|| t!("tests and settings: not kept in the history").to_owned());
    lines.chain(devices).chain(sequences).chain(stubborn).chain(unknown).collect()
}

/// Values that are not good, and alarms that have been active for a day.
fn doubtful(cx: &ViewContext) -> Vec<String> {
    let polled = cx.def().tags.iter().filter(|tag| tag.is_stored());
    let bad: Vec<String> = polled
        .filter(|tag| !cx.snapshot.sample(tag.id).quality.is_good())
        .map(|tag| format!("{} {}", tag.name, value::show(cx, tag.id).whole()))
        .collect();
    let more = bad.len().saturating_sub(NAMED);
    let stale = stale(cx).map(|alarm| {
        let lasts = running(elapsed(alarm.raised_at, cx.now));
        t!(
            "{subject} {message} active for {lasts}",
            subject = subject(cx, alarm.id),
            message = translate(&cx.def().alarm(alarm.id).message),
            lasts
        )
    });
    let more = (more > 0).then(|| t!("… and {more} more values", more));
    bad.into_iter().take(NAMED).chain(more).chain(stale).collect()
}

fn has_failed(row: &ActionRecord) -> bool {
    Outcome::is_failure(&row.outcome)
}
