//! What to do about an alarm, whole: the tab below it has less room.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{
    Faceplate, Modal, Next,
    sheet::{Row, Sheet},
    view_keys, window,
};
use crate::{
    plant::def::AlarmId,
    t,
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        modal::confirm::subject,
        tabs::alarms::{guidance, suppressed_words},
        widgets::list::{Motion, Scroll},
    },
};

/// Least columns of the names at the left.
const LABELS_MIN: u16 = 9;

/// The window.
#[derive(Debug, Clone, PartialEq)]
pub struct Guidance {
    alarm: AlarmId,
    /// The faceplate of what the alarm watches, which Enter opens.
    faceplate: Option<Faceplate>,
    scroll: Scroll,
}

impl Guidance {
    /// From the top.
    pub fn new(alarm: AlarmId, faceplate: Option<Faceplate>) -> Guidance {
        Guidance { alarm, faceplate, scroll: Scroll::default() }
    }

    /// The keys of the moment.
    pub fn hints(&self) -> Vec<Hint> {
        let faceplate = self.faceplate.is_some().then(|| Hint::in_window("⏎", t!("faceplate")));
        faceplate
            .into_iter()
            .chain([Hint::in_window("↑↓", t!("scroll")), Hint::in_window(t!("Esc"), t!("close"))])
            .collect()
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if let Some(motion) = Motion::from_key(event) {
            let rows = self.sheet(cx, cx.area).len();
            self.scroll.on(motion, rows, usize::from(cx.area.height.saturating_sub(4)));
        }
        match event.code {
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

    fn sheet(&self, cx: &ViewContext, body: Rect) -> Sheet {
        let listed = cx.snapshot.alarms.iter().find(|alarm| alarm.id == self.alarm);
        let suppressed = cx.snapshot.suppressed.iter().find(|suppressed| suppressed.id == self.alarm);
        let now = suppressed.map_or(t!("no longer active").to_owned(), |suppressed| suppressed_words(cx, suppressed));
        let rows = match listed {
            Some(alarm) => guidance::rows(cx, alarm),
            None => guidance::rows_of_any(cx, self.alarm, now),
        };
        let respond = listed.and_then(|alarm| guidance::respond_text(cx, cx.def().alarm(self.alarm), alarm));
        let rows = respond.map(|(words, _)| (t!("time"), words)).into_iter().chain(rows);
        let rows = rows.map(|(label, text)| Row::new(label, text, cx.theme.normal())).collect();
        Sheet::new(rows, columns(body), LABELS_MIN)
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let sheet = self.sheet(cx, body);
        let def = cx.def().alarm(self.alarm);
        let condition = guidance::condition_text(cx, def.id);
        let tag = cx.theme.priority_tag(def.priority);
        let title = format!("{tag} {} {} {condition}", subject(cx, def.id), def.message);
        let mut canvas = window(cx, frame, body, title.trim_end(), (columns(body), sheet.len() + 2));
        let (width, rows) = (canvas.width(), canvas.height().saturating_sub(2));
        let first = self.scroll.first(sheet.len(), usize::from(rows));
        sheet.view(cx.theme, &mut canvas.part(0, 0, width, rows), first);
        view_keys(cx, &mut canvas, &self.hints());
    }
}

/// Columns of the window.
fn columns(body: Rect) -> u16 {
    body.width.saturating_sub(8).clamp(LABELS_MIN + 1, 76)
}
