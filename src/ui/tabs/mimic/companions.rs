//! What stands beside the mimic on a wide screen: alarms, what is not normal, what happened last, and a trend below it.

use std::{cmp::Reverse, collections::BTreeSet};

use super::{
    attention::{needs_action, not_normal, sections},
    may_change, steps, totals,
};
use crate::ui::tabs::{
    alarms::{action_text, event_text},
    prelude::*,
    trends::span::View,
};
use crate::{
    history::Series,
    plant::{
        def::Pen,
        record::{ActionRecord, AlarmRecord},
    },
    report::{Period, ShiftReport},
    ui::{layout::Size, widgets::chart},
};

/// Least and greatest width of the column beside the mimic.
const SIDE: (u16, u16) = (30, 56);
/// The mimic grows by so much at most: what is left is for the companions.
const GROWS: f64 = 1.35;
/// Least rows of the trend below the mimic.
const TREND_MIN: u16 = 9;
/// Rows of the shift: its hours, two lanes, alarms and operators, and a blank one.
const SHIFT: u16 = 6;
/// What the trend shows.
const WINDOW_S: i64 = 3_600;
const PENS_MAX: usize = 3;
/// Rows of a section that may be longer.
const ROWS_MAX: usize = 8;
/// Events that are listed at most, of the last day.
const EVENTS_MAX: usize = 40;
/// This many alarm events are looked through for them: most may be of suppressed alarms.
const SEARCHED_MAX: usize = 500;
const EVENTS_SPAN: SignedDuration = SignedDuration::from_hours(24);
const EVERY_S: f64 = 5.0;
const TREND_EVERY_S: f64 = 10.0;
const SHIFT_EVERY_S: f64 = 60.0;
const TIMEOUT_S: f64 = 30.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    pub picture: Rect,
    /// The column beside it.
    pub side: Option<Rect>,
    /// The trend below it.
    pub trend: Option<Rect>,
    /// The shift below the trend.
    pub shift: Option<Rect>,
}

/// The parts of a tab for a mimic of this nominal size: all of it on a usual screen; on a wide one the mimic keeps its
/// proportions and leaves room beside and below it.
pub fn parts(nominal: (u16, u16), area: Rect) -> Parts {
    let alone = Parts { picture: area, side: None, trend: None, shift: None };
    let room = area.width.saturating_sub(nominal.0.saturating_add(1));
    if !Size::is_wide(area.width) || room < SIDE.0 {
        return alone;
    }
    let grown = |cells: u16| to_u16((f64::from(cells) * GROWS).round());
    let side = area.width.saturating_sub(grown(nominal.0) + 1).clamp(SIDE.0, SIDE.1).min(room);
    let width = area.width - side - 1;
    let high = grown(nominal.1).min(area.height);
    let below = area.height - high;
    let height = if below < TREND_MIN { area.height } else { high };
    let picture = Rect { width, height, ..area };
    let shift = if Size::Overview.least().0 <= area.width && TREND_MIN + SHIFT <= below { SHIFT } else { 0 };
    let bottom = area.y + area.height - shift;
    let trend = (TREND_MIN <= below).then(|| Rect { y: area.y + height, height: below - shift, ..picture });
    let shift = (0 < shift).then_some(Rect { y: bottom, height: shift, ..picture });
    Parts { picture, side: Some(Rect { x: area.x + width + 1, width: side, ..area }), trend, shift }
}

#[derive(Debug, Default)]
pub struct Companions {
    alarms: Answered<Vec<AlarmRecord>>,
    actions: Answered<Vec<ActionRecord>>,
    curves: Answered<Vec<Series>>,
    shift: Answered<Box<ShiftReport>>,
}

impl Companions {
    pub fn ask(&mut self, cx: &ViewContext, parts: &Parts) -> Vec<UiAction> {
        let mut actions = Vec::new();
        let (every, timeout) = (real(cx, EVERY_S), real(cx, TIMEOUT_S));
        if parts.side.is_some() {
            let to = cx.now + SignedDuration::from_secs(1);
            let from = to.checked_sub(EVENTS_SPAN).unwrap_or(to);
            let limit = EVENTS_MAX;
            let query = Query::Journal { from, to, limit: SEARCHED_MAX };
            actions.extend(self.alarms.ask(cx, Tab::Mimic, every, timeout, query));
            let query = Query::Actions { from, to, limit };
            actions.extend(self.actions.ask(cx, Tab::Mimic, every, timeout, query));
            if let Some(shift) = period::at(cx.def(), cx.now) {
                // What the shift has counted after a past moment belongs to a later one.
                let query = Query::Report { period: Period { to: shift.to.min(cx.now), ..shift } };
                actions.extend(self.shift.ask(cx, Tab::Mimic, real(cx, SHIFT_EVERY_S), timeout, query));
            }
        }
        let pens = pens(cx);
        if let (Some(trend), false) = (parts.trend, pens.is_empty()) {
            let (view, tags) = (view(cx, trend), pens.iter().map(|pen| pen.tag).collect());
            let query = Query::Series { tags, from: view.from, to: view.to, buckets: view.columns };
            actions.extend(self.curves.ask(cx, Tab::Mimic, real(cx, TREND_EVERY_S), timeout, query));
        }
        actions
    }

    pub fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.alarms, &mut self.actions, &mut self.curves, &mut self.shift]
    }

    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, parts: &Parts) {
        if let Some(side) = parts.side {
            let mut canvas = Canvas::new(frame.buffer_mut(), Rect { x: side.x - 1, width: side.width + 1, ..side });
            for y in 0..canvas.height() {
                canvas.text(0, y, cx.theme.pick("┊", "|"), cx.theme.dim());
            }
            self.column(cx, &mut canvas.part(2, 0, side.width.saturating_sub(2), side.height));
        }
        if let Some(trend) = parts.trend {
            self.trend(cx, &mut Canvas::new(frame.buffer_mut(), trend));
        }
    }

    fn column(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let (width, dim) = (canvas.width(), cx.theme.dim());
        let mut lists = vec![(t!("needs action"), needs_action(cx)), (t!("not normal"), not_normal(cx))];
        let totals = self.shift.value.as_ref().map_or(Vec::new(), |shift| totals::rows(cx, shift));
        let others =
            [(t!("steps"), steps::rows(cx)), (t!("commands now"), may_change::rows(cx)), (t!("this shift"), totals)];
        lists.extend(others.into_iter().filter(|(_, rows)| !rows.is_empty()));
        let mut y = sections(cx, canvas, ROWS_MAX, &lists);
        canvas.text(0, y, t!("last events"), dim);
        y += 1;
        let events = self.events(cx);
        if events.is_empty() && !self.alarms.value.iter().flatten().any(|record| record.event.is_quiet()) {
            let known = self.alarms.value.is_some() || self.actions.value.is_some();
            canvas.text(0, y, if known { t!("none") } else { t!("collecting data") }, dim);
        }
        let quiet = self.alarms.value.iter().flatten().filter(|record| record.event.is_quiet()).count();
        if 0 < quiet {
            for line in wrap(&t!("{quiet} not annunciated: d in the journal", quiet), width) {
                canvas.text(0, y, &line, dim);
                y += 1;
            }
        }
        for (at, text, style) in events {
            let x = canvas.text(0, y, &pad(&moment(at, cx.now, &cx.def().time_zone), 10), dim);
            for line in wrap(&text, width.saturating_sub(x)) {
                canvas.text(x, y, &line, style);
                y += 1;
            }
        }
    }

    /// What was annunciated of alarms, and actions, newest first.
    fn events(&self, cx: &ViewContext) -> Vec<(Timestamp, String, Style)> {
        let alarms = self.alarms.value.iter().flatten().filter(|record| !record.event.is_quiet()).take(EVENTS_MAX);
        let alarms = alarms.map(|record| (record.at, event_text(cx, record), cx.theme.normal()));
        let one_line = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let actions = self.actions.value.iter().flatten();
        let actions = actions.map(|record| (record.at, one_line(action_text(cx, record)), cx.theme.strong()));
        let mut events: Vec<_> = alarms.chain(actions).collect();
        events.sort_by_key(|(at, ..)| Reverse(*at));
        events
    }

    /// The first group of pens over the last hour.
    fn trend(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let Some(group) = cx.def().trends.first() else { return };
        let (title, view) = (t!("{name}, last hour", name = group.name), view(cx, canvas.area()));
        draw::curves(cx, canvas, &title, (view, None), &pens(cx), self.curves.value.as_deref().unwrap_or_default());
    }
}

fn pens(cx: &ViewContext) -> Vec<Pen> {
    cx.def().trends.first().map_or(Vec::new(), |group| group.pens.iter().take(PENS_MAX).copied().collect())
}

/// The last hour, in steps that leave the picture as it is most of the time.
fn view(cx: &ViewContext, trend: Rect) -> View {
    let units: BTreeSet<&str> = pens(cx).iter().map(|pen| cx.snapshot.unit(pen.tag)).collect();
    View::live(cx.now, WINDOW_S, chart::dots(cx.theme, trend.width, units.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::{def::Priority, record::AlarmEvent},
        report::testing::shift_report,
        ui::{
            Effect, Msg, QueryId,
            fixture::{Fixture, now},
            tests::{model, screen},
            theme::Theme,
            update,
        },
    };

    #[test]
    fn a_wide_screen_shows_more_and_nothing_wider() {
        let check = |width: u16, height: u16, picture: (u16, u16), side: u16, trend: u16| {
            let parts = parts((80, 18), Rect::new(0, 4, width, height));
            let rows = |part: Option<Rect>| part.map_or(0, |part| part.height);
            let found = ((parts.picture.width, parts.picture.height), parts.side.map_or(0, |side| side.width));
            assert_eq!((found, rows(parts.trend)), ((picture, side), trend), "{width}x{height}");
        };
        check(80, 18, (80, 18), 0, 0);
        check(109, 34, (109, 34), 0, 0);
        check(120, 34, (89, 24), 30, 10);
        check(120, 30, (89, 30), 30, 0);
        check(160, 44, (108, 24), 51, 14);
        check(200, 54, (143, 24), 56, 24);
    }

    #[test]
    fn the_parts_lie_beside_each_other_at_every_size() {
        for (width, height) in (60..260).flat_map(|width| (10..80).map(move |height| (width, height))) {
            let area = Rect::new(0, 4, width, height);
            let parts = parts((80, 18), area);
            let all = [Some(parts.picture), parts.side, parts.trend, parts.shift];
            for (n, part) in all.iter().enumerate() {
                let Some(part) = part else { continue };
                assert_eq!(part.intersection(area), *part, "{parts:?}");
                let apart = |other: &Option<Rect>| other.is_none_or(|other| !other.intersects(*part));
                assert!(all[..n].iter().all(apart), "{parts:?}");
            }
            assert!(parts.side.is_none() || 80 <= parts.picture.width, "the mimic is never cut for them: {parts:?}");
        }
    }

    #[test]
    fn the_companions_show_alarms_events_and_a_trend() {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        let effects = update(&mut model, Msg::Resize(120, 40));
        let asked = effects.into_iter().filter_map(|effect| match effect {
            Effect::Query(id @ QueryId { tab: Some(Tab::Mimic), .. }, query) => Some((id, query)),
            _ => None,
        });
        for (id, query) in asked.collect::<Vec<_>>() {
            let answer = match query {
                Query::Journal { .. } => {
                    let at = now() - SignedDuration::from_secs(41);
                    let event = AlarmEvent::Raised;
                    Answer::Journal(vec![AlarmRecord::new(at, "TIC-1.PV", "temperature high", Priority::High, event)])
                }
                Query::Actions { .. } => Answer::Actions(Vec::new()),
                Query::Report { period } => {
                    assert_eq!(period.to, now(), "what is shown is not counted any further");
                    Answer::Report(Box::new(shift_report()))
                }
                _ => Answer::Series(Vec::new()),
            };
            update(&mut model, Msg::Answer(id, Ok(answer)));
        }
        let shown = screen(&mut model, 120, 40);
        for words in [
            "needs action",
            "00:41  TIC-1.PV",
            "not normal",
            "this shift",
            "PM-1.E +12.50 kWh",
            "last events",
            "14:01:50  ‹2›! TIC-1.PV",
            "last hour",
        ] {
            assert!(shown.contains(words), "{words}: {shown}");
        }
    }
}
