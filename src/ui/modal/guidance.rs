//! What to do about an alarm, whole: the tab below it has less room.

pub(crate) mod text;

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Faceplate, Modal, Next, Notice,
    sheet::{Fact, Sheet},
    view_keys, window,
};
use crate::{
    plant::{alarm::AlarmCommand, command::CommandKind, def::AlarmId},
    t,
    text::translate,
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        layout::Size,
        modal::reason::subject,
        rights,
        widgets::list::{Motion, Scroll},
    },
};

/// Least columns of the names at the left.
const LABELS_MIN: u16 = 9;

#[derive(Debug, Clone, PartialEq)]
pub struct Guidance {
    alarm: AlarmId,
    /// The faceplate of what the alarm watches, which Enter opens.
    faceplate: Option<Faceplate>,
    scroll: Scroll,
    /// The step of the action that Space ticks.
    step: usize,
}

impl Guidance {
    /// From the top.
    pub fn new(alarm: AlarmId, faceplate: Option<Faceplate>) -> Guidance {
        Guidance { alarm, faceplate, scroll: Scroll::default(), step: 0 }
    }

    pub fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let faceplate = self.faceplate.is_some().then(|| Hint::in_window("⏎", t!("faceplate")));
        let ticks = self.tick(cx).is_some_and(|kind| rights::missing(cx, &kind).is_none());
        let steps = cx.def().alarm(self.alarm).guidance.steps().count();
        let step = (ticks && 1 < steps).then(|| Hint::in_window("←→", t!("step")));
        let tick = ticks.then(|| Hint::in_window(t!("Space"), t!("tick")));
        step.into_iter()
            .chain(tick)
            .chain(faceplate)
            .chain([Hint::in_window("↑↓", t!("scroll")), Hint::in_window(t!("Esc"), t!("close"))])
            .collect()
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if let Some(motion) = Motion::from_key(event) {
            let rows = self.sheet(cx, cx.area).len();
            self.scroll.on(motion, rows, usize::from(cx.area.height.saturating_sub(4)));
        }
        let last = cx.def().alarm(self.alarm).guidance.steps().count().saturating_sub(1);
        match event.code {
            KeyCode::Left => self.step = self.step.saturating_sub(1),
            KeyCode::Right => self.step = (self.step + 1).min(last),
            KeyCode::Char(' ') => {
                let Some(kind) = self.tick(cx) else { return Next::Stay(Modal::Guidance(Box::new(self))) };
                if let Some(why) = rights::missing(cx, &kind) {
                    return Next::Stay(Modal::Notice(Notice::new(t!("tick"), vec![why])));
                }
                // The next step is what is done next.
                if matches!(kind, CommandKind::Alarm(AlarmCommand::Tick { done: true, .. })) {
                    self.step = (self.step + 1).min(last);
                }
                return Next::Both(Modal::Guidance(Box::new(self)), vec![UiAction::Command(kind)]);
            }
            KeyCode::Enter if keys::code(KeyCode::Enter).is(event) => {
                return match self.faceplate {
                    Some(faceplate) => Next::Do(vec![UiAction::Open(Modal::Faceplate(faceplate))]),
                    None => Next::Close,
                };
            }
            KeyCode::Char('q') => return Next::Close,
            _ => {}
        }
        Next::Stay(Modal::Guidance(Box::new(self)))
    }

    /// The command that ticks the selected step, or takes its tick back; none in the past and for an alarm that is not listed.
    fn tick(&self, cx: &ViewContext) -> Option<CommandKind> {
        let alarm = cx.snapshot.alarms.iter().find(|alarm| alarm.id == self.alarm)?;
        let text = cx.def().alarm(self.alarm).guidance.steps().nth(self.step)?;
        let step = u8::try_from(self.step).ok()?;
        let writes = !cx.is_past() && Size::Compact < cx.size;
        writes.then(|| alarm.tick(step, alarm.step(text).is_none()))
    }

    fn sheet(&self, cx: &ViewContext, body: Rect) -> Sheet {
        let listed = cx.snapshot.alarms.iter().find(|alarm| alarm.id == self.alarm);
        let suppressed = cx.snapshot.suppressed.iter().find(|suppressed| suppressed.id == self.alarm);
        let now =
            suppressed.map_or(t!("no longer active").to_owned(), |suppressed| text::suppressed_words(cx, suppressed));
        let rows = match listed {
            Some(alarm) => text::rows(cx, alarm),
            None => text::rows_of_any(cx, self.alarm, now, None),
        };
        let respond = listed.and_then(|alarm| text::respond_text(cx, cx.def().alarm(self.alarm), alarm));
        let rows = respond.map(|(words, _)| (t!("time"), words)).into_iter().chain(rows).collect::<Vec<_>>();
        let first = rows.iter().position(|(label, _)| *label == t!("action")).unwrap_or(rows.len());
        let selected = self.tick(cx).map(|_| first + self.step);
        let style = |n| if selected == Some(n) { cx.theme.strong() } else { cx.theme.normal() };
        let mark = |n| if selected == Some(n) { cx.theme.pick("▸ ", "> ") } else { "" };
        let row = |(n, (label, text)): (usize, (_, String))| Fact::new(label, format!("{}{text}", mark(n)), style(n));
        let rows = rows.into_iter().enumerate().map(row).collect();
        Sheet::new(rows, columns(body), LABELS_MIN)
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let sheet = self.sheet(cx, body);
        let def = cx.def().alarm(self.alarm);
        let condition = text::condition_text(cx, def.id);
        let tag = cx.theme.priority_tag(def.priority);
        let title = format!("{tag} {} {} {condition}", subject(cx, def.id), translate(&def.message));
        let mut canvas = window(cx, frame, body, title.trim_end(), (columns(body), sheet.len() + 2));
        let (width, rows) = (canvas.width(), canvas.height().saturating_sub(2));
        let first = self.scroll.first(sheet.len(), usize::from(rows));
        sheet.view(cx.theme, &mut canvas.part(0, 0, width, rows), first);
        view_keys(cx, &mut canvas, &self.hints(cx));
    }
}

fn columns(body: Rect) -> u16 {
    body.width.saturating_sub(8).clamp(LABELS_MIN + 1, 76)
}
