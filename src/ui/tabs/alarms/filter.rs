//! Which alarms the list shows, by priority, state, area and words, and in which order; pure.

use crate::plant::{
    alarm::{ActiveAlarm, AlarmState, manager::subject_name},
    def::{AlarmDef, PlantDef, Priority},
};
use crate::ui::tabs::prelude::*;

/// What may be typed, for the entry window.
pub const FORMS: &str = "words of tag, message, state or user:  TIC-1 high   unack   anna";

/// A filter; what is empty lets everything through.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Filter {
    /// This priority only.
    pub priority: Option<Priority>,
    /// Alarms in this state only.
    pub state: Option<AlarmState>,
    /// Alarms of this area only.
    pub area: Option<String>,
    /// Words that must all be found.
    words: Words,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sort {
    /// By priority, unacknowledged first; first-out groups stand together.
    #[default]
    Urgency,
    /// The latest first.
    Time,
    /// By the name of what they watch.
    Name,
}

impl Sort {
    pub fn next(self) -> Sort {
        match self {
            Sort::Urgency => Sort::Time,
            Sort::Time => Sort::Name,
            Sort::Name => Sort::Urgency,
        }
    }

    /// `latest first`.
    pub fn label(self) -> &'static str {
        match self {
            Sort::Urgency => t!("most urgent first"),
            Sort::Time => t!("latest first"),
            Sort::Name => t!("by tag"),
        }
    }

    /// Sorts alarms that come in order of urgency.
    pub fn sort(self, def: &PlantDef, alarms: &mut [&ActiveAlarm]) {
        match self {
            Sort::Urgency => {}
            Sort::Time => alarms.sort_by_key(|alarm| std::cmp::Reverse(alarm.raised_at)),
            Sort::Name => alarms.sort_by_key(|alarm| subject_name(def, def.alarm(alarm.id).subject)),
        }
    }
}

/// The states that an alarm in the list can be in.
const STATES: [AlarmState; 5] = [
    AlarmState::Unacknowledged,
    AlarmState::Acknowledged,
    AlarmState::ReturnedToNormal,
    AlarmState::LatchedUnacknowledged,
    AlarmState::LatchedAcknowledged,
];

impl Filter {
    /// Takes the words that were typed; none is no filter.
    pub fn type_words(&mut self, text: &str) {
        self.words = Words::parse(text);
    }
    pub fn typed(&self) -> String {
        self.words.to_string()
    }
    /// Lets everything through?
    pub fn is_off(&self) -> bool {
        *self == Filter::default()
    }

    /// The next priority, and all of them after the last.
    pub fn next_priority(&mut self) {
        let all = [Priority::Critical, Priority::High, Priority::Medium, Priority::Low];
        self.priority = after(&all, self.priority.as_ref());
    }
    /// The next state, and all of them after the last.
    pub fn next_state(&mut self) {
        self.state = after(&STATES, self.state.as_ref());
    }
    /// The next area of the plant, and all of them after the last.
    pub fn next_area(&mut self, def: &PlantDef) {
        self.area = area_after(def, self.area.as_ref());
    }

    pub fn holds(&self, cx: &ViewContext, alarm: &ActiveAlarm) -> bool {
        if self.is_off() {
            return true;
        }
        let def = cx.def().alarm(alarm.id);
        self.priority.is_none_or(|priority| priority == def.priority)
            && self.state.is_none_or(|state| state == alarm.state)
            && self.area.as_ref().is_none_or(|area| *area == def.area)
            && self.words.fit(&text_of(cx, alarm, def))
    }

    /// What it asks for: `high  UNACK  area TK-1  "tic"`; empty where it lets everything through.
    pub fn describe(&self) -> String {
        let parts = [
            self.priority.map(|priority| translate(priority.word()).to_owned()),
            self.state.map(|state| translate(state.word()).to_owned()),
            self.area.as_ref().map(|area| t!("area {area}", area)),
            (!self.words.is_empty()).then(|| format!("\"{}\"", self.typed())),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join("  ")
    }
}

pub fn areas(def: &PlantDef) -> Vec<String> {
    let mut areas: Vec<String> = def.alarms.iter().map(|alarm| alarm.area.clone()).collect();
    areas.retain(|area| !area.is_empty());
    areas.sort();
    areas.dedup();
    areas
}

/// The next area, and all of them after the last.
pub fn area_after(def: &PlantDef, area: Option<&String>) -> Option<String> {
    after(&areas(def), area)
}

/// All that is looked through for words: what the view shows, nothing that is hidden.
fn text_of(cx: &ViewContext, alarm: &ActiveAlarm, def: &AlarmDef) -> String {
    let by = alarm.acknowledged.as_ref().and_then(|note| note.by.as_deref()).unwrap_or_default();
    format!(
        "{} {} {} {by}",
        subject_name(cx.def(), def.subject),
        translate(&def.message),
        translate(alarm.state.word())
    )
}

/// The one after `now`, nothing after the last one.
fn after<T: Clone + PartialEq>(all: &[T], now: Option<&T>) -> Option<T> {
    match now {
        None => all.first().cloned(),
        Some(now) => all.iter().skip_while(|other| *other != now).nth(1).cloned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn every_word_and_every_choice_must_fit() {
        let mut fixture = Fixture::alarm();
        fixture.def.alarms[2].area = "TK-1".to_owned();
        let snapshot = fixture.snapshot();
        let check = |set: &dyn Fn(&mut Filter), expect: &[u16], what: &str| {
            let mut filter = Filter::default();
            set(&mut filter);
            let shown = with_cx(&snapshot, |cx| {
                let shown = snapshot.alarms.iter().filter(|alarm| filter.holds(cx, alarm));
                shown.map(|alarm| alarm.id.0).collect::<Vec<_>>()
            });
            assert_eq!(shown, expect, "{what}");
            assert_eq!(filter.is_off(), filter.describe().is_empty(), "what is in force is always written");
        };
        check(&|_| {}, &[0, 3, 2], "no filter");
        check(&|filter| filter.type_words("TIC-1 HIGH"), &[0], "words, whatever their case");
        check(&|filter| filter.type_words("tic-1 low"), &[], "all of them");
        check(&|filter| filter.type_words("unack"), &[0], "a state by its word");
        check(&|filter| filter.type_words("tk-1"), &[], "an area is not shown, and has a key of its own");
        check(&|filter| filter.type_words("process"), &[], "nor is a class");
        check(&|filter| filter.priority = Some(Priority::Medium), &[3], "a priority");
        check(&|filter| filter.state = Some(AlarmState::ReturnedToNormal), &[2], "a state");
        check(&|filter| filter.next_area(&snapshot.def), &[2], "an area");
        check(
            &|filter| {
                filter.next_area(&snapshot.def);
                filter.next_area(&snapshot.def);
            },
            &[0, 3, 2],
            "all areas again",
        );
    }
}
