//! What the last frame showed: news that came after it are not acknowledged unseen.

use jiff::Timestamp;

use super::{
    Act, Model,
    tabs::{Tab, alarms::deeds},
};
use crate::plant::{def::AlarmId, snapshot::ActiveAlarm};

/// What a frame showed, as far as a key may mean it that is pressed before the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// The tab.
    tab: Tab,
    /// The alarm that `a` was for: which, and when it was raised.
    alarm: Option<(AlarmId, Timestamp)>,
}

impl Model {
    /// A frame was drawn.
    pub(super) fn note_drawn(&mut self) {
        let alarm = self.alarm_to_acknowledge().map(|alarm| (alarm.id, alarm.raised_at));
        self.drawn = Some(Drawn { tab: self.tabs.shown, alarm });
    }

    /// The alarm that `a` is for as things stand: the one selected on the alarms tab if that can be seen, else the most
    /// urgent unacknowledged, which is the banner's.
    pub(super) fn alarm_to_acknowledge(&self) -> Option<&ActiveAlarm> {
        let selected = self.lists().then(|| self.tabs.alarms.selected(&self.cx())).flatten();
        selected.or_else(|| self.snapshot.alarms.iter().find(|alarm| alarm.state.needs_acknowledgement()))
    }

    /// Is the alarms tab to be seen?
    fn lists(&self) -> bool {
        self.tabs.shown == Tab::Alarms && !self.small()
    }

    /// The alarm that whoever presses `a` has seen: news that came after the last frame are not acknowledged unseen.
    fn alarm_seen(&self) -> Option<&ActiveAlarm> {
        match self.drawn {
            Some(Drawn { tab, .. }) if tab == self.tabs.shown && self.lists() && self.tabs.alarms.is_chosen() => {
                self.alarm_to_acknowledge()
            }
            Some(Drawn { alarm, .. }) => {
                let (id, raised_at) = alarm?;
                self.snapshot.alarms.iter().find(|alarm| (alarm.id, alarm.raised_at) == (id, raised_at))
            }
            None => self.alarm_to_acknowledge(),
        }
    }
}

/// Acknowledges what `a` is for; says so where that needs none.
pub(super) fn acknowledge(model: &Model) -> Vec<Act> {
    match model.alarm_seen() {
        Some(alarm) if alarm.state.needs_acknowledgement() => deeds::acknowledge(&model.cx(), alarm),
        Some(alarm) if model.lists() => deeds::acknowledged(&model.cx(), alarm),
        Some(_) | None => Vec::new(),
    }
}
