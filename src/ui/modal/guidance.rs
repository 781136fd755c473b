//! What to do about an alarm, whole: the tab below it has less room.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Faceplate, Modal, Next, window};
use crate::{
    plant::def::AlarmId,
    t,
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        modal::confirm::subject,
        tabs::alarms::{guidance, suppressed_words},
        widgets::{
            list::{Motion, Scroll},
            text::{pad, wrap},
        },
    },
};

/// Columns of the names at the left.
const NAMES: u16 = 9;

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
        let hint = |key: &str, label: &str| Hint::new(key, label, "");
        let faceplate = self.faceplate.is_some().then(|| hint("⏎", t!("faceplate")));
        faceplate.into_iter().chain([hint("↑↓", t!("scroll")), hint(t!("Esc"), t!("close"))]).collect()
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if let Some(motion) = Motion::of(event) {
            let rows = self.lines(cx, room(cx.area)).len();
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

    /// Every row, wrapped, with its name before the first line.
    fn lines(&self, cx: &ViewContext, room: u16) -> Vec<(&'static str, String)> {
        let listed = cx.snapshot.alarms.iter().find(|alarm| alarm.id == self.alarm);
        let suppressed = cx.snapshot.suppressed.iter().find(|suppressed| suppressed.id == self.alarm);
        let now = suppressed.map_or(t!("no longer active").to_owned(), |suppressed| suppressed_words(cx, suppressed));
        let mut rows = match listed {
            Some(alarm) => guidance::rows(cx, alarm),
            None => guidance::rows_of_any(cx, self.alarm, now),
        }
        .to_vec();
        let respond = listed.and_then(|alarm| guidance::respond_text(cx, cx.def().alarm(self.alarm), alarm));
        rows.splice(0..0, respond.map(|(words, _)| (t!("time"), words)));
        let lines = |(name, text): (&'static str, String)| {
            let names = std::iter::once(name).chain(std::iter::repeat(""));
            names.zip(wrap(&text, room)).collect::<Vec<_>>()
        };
        rows.into_iter().flat_map(lines).collect()
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let theme = cx.theme;
        let room = room(body);
        let lines = self.lines(cx, room);
        let def = cx.def().alarm(self.alarm);
        let condition = guidance::condition_text(cx, def.id);
        let title = format!("{} {} {} {condition}", theme.priority_tag(def.priority), subject(cx, def.id), def.message);
        let mut canvas = window(cx, frame, body, title.trim_end(), (room + NAMES, lines.len() + 2));
        let rows = canvas.height().saturating_sub(2);
        let first = self.scroll.first(lines.len(), usize::from(rows));
        for (y, (name, text)) in lines.iter().skip(first).take(usize::from(rows)).enumerate() {
            canvas.text(0, y, &pad(name, NAMES), theme.dim());
            canvas.text(NAMES, y, text, theme.normal());
        }
        let keys: Vec<String> = self.hints().iter().map(|hint| format!("{} {}", hint.key, hint.label)).collect();
        canvas.text(0, canvas.height().saturating_sub(1), &theme.enter(&keys.join("   ")), theme.strong());
    }
}

/// Columns for the words of a row.
fn room(body: Rect) -> u16 {
    body.width.saturating_sub(8).min(76).saturating_sub(NAMES).max(1)
}
