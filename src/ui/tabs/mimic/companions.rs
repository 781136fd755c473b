//! What stands beside the mimic on a wide screen: alarms, what is not normal, what happened last, and a trend below it.

use std::{cmp::Reverse, collections::BTreeSet};

use crate::ui::tabs::{
    alarms::{action_text, event_text},
    prelude::*,
    trends::span::View,
};
use crate::{
    history::Series,
    plant::{
        alarm::AlarmState,
        def::Pen,
        event::LineState,
        record::{ActionRecord, AlarmRecord},
        sample::Cause,
        snapshot::ActiveAlarm,
    },
    ui::{
        chrome::since,
        layout::Size,
        modal::{
            confirm::subject,
            faceplate::{device_text, line_state_text},
        },
        widgets::chart,
    },
};

/// Least and greatest width of the column beside the mimic.
const SIDE: (u16, u16) = (30, 56);
/// The mimic grows by so much at most: what is left is for the companions.
const GROWS: f64 = 1.35;
/// Least rows of the trend below the mimic.
const TREND_MIN: u16 = 9;
/// What the trend shows.
const WINDOW_S: i64 = 3_600;
/// Pens of the trend.
const PENS_MAX: usize = 3;
/// Rows of a section that may be longer.
const ROWS_MAX: usize = 8;
/// Columns by which the second line of a row stands back.
const INDENT: u16 = 5;
/// Events that are listed at most, of the last day.
const EVENTS_MAX: usize = 40;
const EVENTS_SPAN: SignedDuration = SignedDuration::from_hours(24);
const EVERY_S: f64 = 5.0;
const TREND_EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 30.0;

/// The parts of the tab.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// The mimic.
    pub picture: Rect,
    /// The column beside it.
    pub side: Option<Rect>,
    /// The trend below it.
    pub trend: Option<Rect>,
}

/// The parts of a tab for a mimic of this nominal size: all of it on a usual screen; on a wide one the mimic keeps its
/// proportions and leaves room beside and below it.
pub fn parts(nominal: (u16, u16), area: Rect) -> Parts {
    let alone = Parts { picture: area, side: None, trend: None };
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
    let trend = (TREND_MIN <= below).then(|| Rect { y: area.y + height, height: area.height - height, ..picture });
    Parts { picture, side: Some(Rect { x: area.x + width + 1, width: side, ..area }), trend }
}

/// What the companions have asked for.
#[derive(Debug, Default)]
pub struct Companions {
    alarms: Answered<Vec<AlarmRecord>>,
    actions: Answered<Vec<ActionRecord>>,
    curves: Answered<Vec<Series>>,
}

impl Companions {
    /// Asks for what is due.
    pub fn ask(&mut self, cx: &ViewContext, parts: &Parts, number: &mut u32) -> Vec<UiAction> {
        let mut actions = Vec::new();
        let (every, timeout) = (real(cx, EVERY_S), real(cx, TIMEOUT_S));
        if parts.side.is_some() {
            let to = cx.now + SignedDuration::from_secs(1);
            let from = to.checked_sub(EVENTS_SPAN).unwrap_or(to);
            let limit = EVENTS_MAX;
            let query = Query::Journal { from, to, limit };
            actions.extend(self.alarms.ask(cx, (Tab::Mimic, number), every, timeout, query));
            let query = Query::Actions { from, to, limit };
            actions.extend(self.actions.ask(cx, (Tab::Mimic, number), every, timeout, query));
        }
        let pens = pens(cx);
        if let (Some(trend), false) = (parts.trend, pens.is_empty()) {
            let (view, tags) = (view(cx, trend), pens.iter().map(|pen| pen.tag).collect());
            let query = Query::Series { tags, from: view.from, to: view.to, buckets: view.columns };
            actions.extend(self.curves.ask(cx, (Tab::Mimic, number), real(cx, TREND_EVERY_S), timeout, query));
        }
        actions
    }

    pub fn awaits(&self, number: u32) -> bool {
        [&self.alarms.query, &self.actions.query, &self.curves.query].iter().any(|query| query.awaits(number))
    }

    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        self.alarms.on_answer(cx, number, answer);
        self.actions.on_answer(cx, number, answer);
        self.curves.on_answer(cx, number, answer);
    }

    /// Draws them.
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
        let mut y = 0;
        for (title, rows) in [(t!("alarms"), alarms(cx)), (t!("not normal"), not_normal(cx))] {
            canvas.text(0, y, title, dim);
            y += 1;
            if rows.is_empty() {
                canvas.text(0, y, t!("none"), dim);
                y += 1;
            }
            for (text, style) in rows.iter().take(ROWS_MAX) {
                for (n, line) in wrap(text, width.saturating_sub(INDENT)).into_iter().enumerate() {
                    canvas.text(if n == 0 { 0 } else { INDENT }, y, &line, *style);
                    y += 1;
                }
            }
            if let more @ 1.. = rows.len().saturating_sub(ROWS_MAX) {
                canvas.text(0, y, &t!("and {more} more", more), cx.theme.normal());
                y += 1;
            }
            y += 1;
        }
        canvas.text(0, y, t!("last events"), dim);
        y += 1;
        let events = self.events(cx);
        if events.is_empty() {
            let known = self.alarms.value.is_some() || self.actions.value.is_some();
            canvas.text(0, y, if known { t!("none") } else { t!("collecting data") }, dim);
        }
        for (at, text, style) in events {
            let x = canvas.text(0, y, &pad(&moment(at, cx.now, &cx.def().time_zone), 10), dim);
            for line in wrap(&text, width.saturating_sub(x)) {
                canvas.text(x, y, &line, style);
                y += 1;
            }
        }
    }

    /// Alarm events and actions, newest first.
    fn events(&self, cx: &ViewContext) -> Vec<(Timestamp, String, Style)> {
        let alarms = self.alarms.value.iter().flatten();
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

/// The active alarms, in order of urgency.
fn alarms(cx: &ViewContext) -> Vec<(String, Style)> {
    let row = |alarm: &ActiveAlarm| {
        let def = cx.def().alarm(alarm.id);
        let (mark, since) = (cx.theme.priority_mark(def.priority), running(elapsed(since(alarm), cx.now)));
        let text = format!("{mark} {since}  {} {}", subject(cx, alarm.id), def.message);
        (text, cx.theme.alarm(def.priority, alarm.state, cx.flash()))
    };
    cx.snapshot.alarms.iter().map(row).collect()
}

/// Has a value of this cause been asked for in vain? What is not polled or stored is as it should be.
fn is_trouble(cause: Cause) -> bool {
    match cause {
        Cause::Timeout
        | Cause::Corrupt
        | Cause::Exception
        | Cause::Stale
        | Cause::SensorFault
        | Cause::Unscaled
        | Cause::Undefined
        | Cause::Unreadable => true,
        Cause::NotRead
        | Cause::NotReadBack
        | Cause::DeviceDown
        | Cause::NotConnected
        | Cause::StationOff
        | Cause::NotAuthorised
        | Cause::NotStored => false,
    }
}

/// Lines and devices that are not well, values that are bad or uncertain beside them, and how many alarms are suppressed.
fn not_normal(cx: &ViewContext) -> Vec<(String, Style)> {
    let (def, snapshot, trouble) = (cx.def(), cx.snapshot, cx.theme.trouble());
    let lines = def.lines.iter().filter(|line| snapshot.line(line.id).state != LineState::Connected);
    let lines = lines.map(|line| (format!("{}  {}", line.name, line_state_text(cx, line.id)), trouble));
    let well = |device: &DeviceDef| snapshot.device(device.id).state == DeviceState::Responding;
    let devices = def.devices.iter().filter(|device| !well(device));
    let devices = devices.map(|device| (format!("{}  {}", device.name, device_text(cx, device.id)), trouble));
    // What the state of its device does not explain.
    let values = def.tags.iter().filter(|tag| well(def.device(tag.device)));
    let values = values.filter(|tag| snapshot.sample(tag.id).quality.cause().is_some_and(is_trouble)).map(|tag| {
        let shown = value::show(cx, tag.id);
        (format!("{}  {} {}", tag.name, shown.text, shown.note), shown.style)
    });
    let suppressed = snapshot.suppressed.iter().filter(|alarm| alarm.state != AlarmState::SuppressedByDesign);
    let suppressed = match suppressed.count() {
        0 => None,
        many => Some((t!("{many} alarms suppressed by operators", many), cx.theme.normal())),
    };
    lines.chain(devices).chain(values).chain(suppressed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::{
            def::Priority,
            record::AlarmEvent,
            sample::{Quality, Sample},
        },
        ui::{
            Effect, Msg, QueryId,
            fixture::{Fixture, now, with_cx},
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
        check(160, 44, (108, 24), 51, 20);
        check(200, 54, (143, 24), 56, 30);
    }

    #[test]
    fn the_parts_lie_beside_each_other_at_every_size() {
        for (width, height) in (60..260).flat_map(|width| (10..80).map(move |height| (width, height))) {
            let area = Rect::new(0, 4, width, height);
            let parts = parts((80, 18), area);
            let all = [Some(parts.picture), parts.side, parts.trend];
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
    fn what_is_not_normal_is_listed_once() {
        let rows = |fixture: &Fixture| {
            let rows = with_cx(&fixture.snapshot(), not_normal);
            rows.into_iter().map(|(text, _)| text).collect::<Vec<_>>()
        };
        assert!(rows(&Fixture::normal()).is_empty());
        let mut stale = Fixture::normal();
        let pv = stale.tag("TIC-1.PV");
        stale.samples[pv.index()] = Sample { quality: Quality::Uncertain(Cause::Stale), ..stale.samples[pv.index()] };
        let shown = rows(&stale);
        assert!(shown.len() == 1 && shown[0].starts_with("TIC-1.PV  64.2?"), "{shown:?}");
        // The line and its devices explain their values.
        let down = rows(&Fixture::line_down());
        assert!(down.len() == 3 && down[0].contains("not connected"), "{down:?}");
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
                _ => Answer::Series(Vec::new()),
            };
            update(&mut model, Msg::Answer(id, Ok(answer)));
        }
        let shown = screen(&mut model, 120, 40);
        for words in ["alarms", "00:41  TIC-1.PV", "not normal", "last events", "14:01:50  ‹2›! TIC-1.PV", "last hour"]
        {
            assert!(shown.contains(words), "{words}: {shown}");
        }
    }
}
