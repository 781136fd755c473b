//! What the last frame showed: a key acts on the row that its operator saw, or on none.
//!
//! Keys alone change nothing unseen: what they lead to follows from what is on the screen. News do, between two frames; then a
//! key that would act on another row than the drawn one, or on the same in another state, does nothing and says so.

use crossterm::event::{KeyCode, KeyEvent};
use jiff::Timestamp;

use super::{
    Model, UiAction,
    tabs::{Rows, Tab, alarms::actions},
};
use crate::{
    plant::{alarm::ActiveAlarm, def::AlarmId},
    t,
};

/// Shown where a key was ignored.
pub(super) fn changed() -> &'static str {
    t!("The list has changed, press again")
}

/// What a frame showed, as far as a key may mean it that is pressed before the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LastFrame {
    tab: Tab,
    rows: Rows,
    /// The alarm that `a` was for: which, and when it was annunciated.
    alarm: Option<(AlarmId, Timestamp)>,
    /// Something has come from the station since.
    news: bool,
    /// The selection was moved over rows that are not those of the frame: what a key means is unknown.
    selection_unseen: bool,
}

impl Model {
    pub(super) fn note_drawn(&mut self) {
        self.last_frame = Some(self.as_drawn());
    }

    /// The station has sent something that no frame has shown.
    pub(super) fn note_news(&mut self) {
        if let Some(last_frame) = &mut self.last_frame {
            last_frame.news = true;
        }
    }

    /// Is all that a key can mean as it was drawn?
    pub(super) fn is_as_drawn(&self) -> bool {
        self.last_frame
            .is_some_and(|last_frame| !last_frame.news || LastFrame { news: true, ..self.as_drawn() } == last_frame)
    }

    /// A key alone has led to what there is now: it is as good as seen.
    pub(super) fn note_keyed(&mut self) {
        let news = self.last_frame.is_some_and(|last_frame| last_frame.news);
        self.last_frame = Some(LastFrame { news, ..self.as_drawn() });
    }

    fn as_drawn(&self) -> LastFrame {
        let alarm = self.alarm_to_acknowledge().map(|alarm| (alarm.id, alarm.annunciated_at));
        LastFrame {
            tab: self.tabs.shown,
            rows: self.tabs.shown().fingerprint(&self.cx()),
            alarm,
            news: false,
            selection_unseen: false,
        }
    }

    /// May a key of the tab act on the selected row? Else that is said. To move on is always possible.
    pub(super) fn may_act(&mut self, event: KeyEvent) -> bool {
        let moves = matches!(
            event.code,
            KeyCode::Up | KeyCode::Down | KeyCode::PageUp | KeyCode::PageDown | KeyCode::Home | KeyCode::End
        );
        let now = self.tabs.shown().fingerprint(&self.cx());
        let Some(last_frame) = self.last_frame.as_mut().filter(|last_frame| last_frame.news) else { return true };
        if moves {
            last_frame.selection_unseen |= last_frame.tab != self.tabs.shown || last_frame.rows.all != now.all;
            return true;
        }
        let seen = !last_frame.selection_unseen
            && last_frame.tab == self.tabs.shown
            && last_frame.rows.selected == now.selected;
        if !seen {
            self.note = Some(changed().into());
        }
        seen
    }

    /// The alarm that `a` is for as things stand: the one selected on the alarms tab if that can be seen, else the most
    /// urgent unacknowledged, which is the banner's.
    pub(super) fn alarm_to_acknowledge(&self) -> Option<&ActiveAlarm> {
        if self.replay.shown().is_some() {
            return None;
        }
        let selected = self.lists().then(|| self.tabs.alarms.selected(&self.cx())).flatten();
        selected.or_else(|| self.snapshot.alarms.iter().find(|alarm| alarm.state.needs_acknowledgement()))
    }

    /// Is the alarms tab to be seen?
    fn lists(&self) -> bool {
        self.tabs.shown == Tab::Alarms && !self.small()
    }

    /// The alarm that `a` was drawn for, exactly as it was annunciated; `Err` if there is another one by now.
    fn alarm_seen(&self) -> Result<Option<&ActiveAlarm>, &'static str> {
        let now = self.alarm_to_acknowledge();
        let Some(last_frame) = self.last_frame else { return Ok(now) };
        if last_frame.selection_unseen {
            return Err(changed());
        }
        let Some((id, annunciated_at)) = last_frame.alarm else {
            return if now.is_none() { Ok(None) } else { Err(changed()) };
        };
        let seen = |alarm: &&ActiveAlarm| (alarm.id, alarm.annunciated_at) == (id, annunciated_at);
        self.snapshot.alarms.iter().find(seen).map(Some).ok_or_else(changed)
    }
}

/// Acknowledges what `a` is for; says so where that needs none.
pub(super) fn acknowledge(model: &mut Model) -> Vec<UiAction> {
    let cx = model.cx();
    let marked = if model.lists() { model.tabs.alarms.marked(&cx) } else { Vec::new() };
    if !marked.is_empty() && !cx.is_past() {
        // The window names those that it is about.
        return actions::acknowledge_all(&cx, marked.into_iter(), false);
    }
    let (actions, note) = match model.alarm_seen() {
        Ok(Some(alarm)) if alarm.state.needs_acknowledgement() => (actions::acknowledge(&model.cx(), alarm), None),
        Ok(Some(alarm)) if model.lists() => (actions::acknowledged(&model.cx(), alarm), None),
        Ok(_) => (Vec::new(), None),
        Err(why) => (Vec::new(), Some(why)),
    };
    model.note = note.map(Into::into);
    actions
}
