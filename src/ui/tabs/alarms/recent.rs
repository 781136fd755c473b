//! What the journal says of the listed alarms: how each came and went in the last hour, and what was done the last times.

use super::{side, span};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        alarm::{ActiveAlarm, AlarmState, manager::subject_name},
        def::{AlarmDef, Pen, Subject},
        record::{ActionRecord, AlarmEvent, AlarmRecord},
    },
    ui::{layout::Size, tabs::trends::span::View, widgets::chart},
};

/// The ribbons reach back so far.
pub const RIBBON: SignedDuration = SignedDuration::from_hours(1);
const RIBBON_EVERY_S: f64 = 5.0;
/// "The last times" reach back so far.
pub const DAYS: i64 = 30;
const DAYS_EVERY_S: f64 = 60.0;
const CURVE_EVERY_S: f64 = 10.0;
/// Events and actions that are looked through at most.
const EVENTS_MAX: usize = 2_000;
const ACTIONS_MAX: usize = 500;

/// What the history has answered; asked for on wide screens only.
#[derive(Debug, Default)]
pub struct Recent {
    hour: Answered<Vec<AlarmRecord>>,
    alarms: Answered<Vec<AlarmRecord>>,
    actions: Answered<Vec<ActionRecord>>,
    /// The tag that the selected alarm watches, and its curve.
    tag: Option<TagId>,
    curve: Answered<Vec<Series>>,
}

/// How an alarm stood in a cell of its ribbon, the most urgent last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Stood {
    Unknown,
    Normal,
    Acknowledged,
    Unacknowledged,
}

/// An earlier time that an alarm was active.
#[derive(Debug, Clone, PartialEq)]
pub struct Occurrence {
    pub raised_at: Timestamp,
    /// How long it was active; `None` where its end is not on record.
    pub lasted: Option<Duration>,
    /// `anna: relay replaced`, `anna: SV 70.0 → 65.0 °C`.
    pub done: Vec<String>,
}

impl Recent {
    /// Asks for what is due; `selected` is what the selected alarm watches.
    pub fn ask(&mut self, cx: &ViewContext, selected: Option<Subject>) -> Vec<UiAction> {
        if cx.size < Size::Wide {
            return Vec::new();
        }
        let to = cx.now + SignedDuration::from_secs(1);
        let days = SignedDuration::from_hours(24 * DAYS);
        let since = |span| to.checked_sub(span).unwrap_or(to);
        let (hour, from) = (since(RIBBON), since(days));
        let limit = EVENTS_MAX;
        let query = Query::Journal { from: hour, to, limit };
        let hour = span::ask(cx, &mut self.hour, RIBBON_EVERY_S, None, query);
        let query = Query::Journal { from, to, limit };
        let alarms = span::ask(cx, &mut self.alarms, DAYS_EVERY_S, None, query);
        let query = Query::Actions { from, to, limit: ACTIONS_MAX };
        let actions = span::ask(cx, &mut self.actions, DAYS_EVERY_S, None, query);
        let tag = match selected {
            Some(Subject::Tag(tag)) => Some(tag),
            Some(Subject::Device(_) | Subject::Line(_) | Subject::Station) | None => None,
        };
        if tag != self.tag {
            (self.tag, self.curve) = (tag, Answered::default());
        }
        let curve = tag.and_then(|tag| {
            let view = view(cx);
            let query = Query::Series { tags: vec![tag], from: view.from, to: view.to, buckets: view.columns };
            span::ask(cx, &mut self.curve, CURVE_EVERY_S, None, query)
        });
        hour.into_iter().chain(alarms).chain(actions).chain(curve).collect()
    }

    /// Draws the last hour of what the selected alarm watches; nothing where that is no tag.
    pub fn draw_curve(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let Some(tag) = self.tag else { return };
        let series = self.curve.value.as_deref().unwrap_or_default();
        draw::curves(cx, canvas, t!("last hour"), (view(cx), None), &[Pen { tag, scale: None }], series);
    }

    pub fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.hour, &mut self.alarms, &mut self.actions, &mut self.curve]
    }

    /// The last hour of an alarm in so many cells: `··▄▄██`, blank where it is not known. What the snapshot says of it is never late.
    pub fn ribbon(&self, cx: &ViewContext, alarm: &ActiveAlarm, cells: u16) -> String {
        let records = self.hour.value.as_deref().unwrap_or_default();
        let hour_ago = cx.now.checked_sub(RIBBON).unwrap_or(cx.now);
        // What the journal has not said, or what its limit cut off, is not known.
        let known_from = match &self.hour.value {
            Some(records) => cut_at(records.iter().map(|record| record.at), EVENTS_MAX).unwrap_or(hour_ago),
            None => cx.now,
        };
        let def = cx.def().alarm(alarm.id);
        let name = subject_name(cx.def(), def.subject);
        let is_of = |record: &&AlarmRecord| *record.subject == *name && *record.message == *def.message;
        let earlier = records.iter().rev().filter(is_of).filter(|record| record.at < just_before(alarm.raised_at));
        let acknowledged = alarm.acknowledged.as_ref().map(|note| (note.at, AlarmEvent::Acknowledged));
        let returned = alarm.returned_at.map(|at| (at, AlarmEvent::ReturnedToNormal));
        let now = [Some((alarm.raised_at, AlarmEvent::Raised)), acknowledged, returned];
        let mut steps: Vec<(Timestamp, AlarmEvent)> = earlier.map(|record| (record.at, record.event)).collect();
        steps.extend(now.into_iter().flatten());
        steps.sort_by_key(|(at, _)| *at);
        let signs = cx.theme.pick([' ', '·', '▄', '█'], [' ', '.', '_', '#']);
        let known_from = known_from.min(alarm.raised_at).max(hour_ago);
        let stood = ribbon(&steps, alarm.state, (known_from, cx.now), usize::from(cells));
        stood.into_iter().map(|stood| signs[stood as usize]).collect()
    }

    /// The last events that were annunciated, newest first, and how many others there are; `None` until the history has
    /// answered.
    pub fn events(&self) -> Option<(Vec<&AlarmRecord>, usize)> {
        let events = self.alarms.value.as_deref()?;
        let annunciated: Vec<_> = events.iter().filter(|event| !event.event.is_quiet()).collect();
        let quiet = events.len() - annunciated.len();
        Some((annunciated, quiet))
    }

    /// Since when alarm events and actions are known, where the journal holds more than was looked through.
    pub fn searched_since(&self) -> [Option<Timestamp>; 2] {
        let alarms = self.alarms.value.iter().flatten().map(|record| record.at);
        let actions = self.actions.value.iter().flatten().map(|action| action.at);
        [cut_at(alarms, EVENTS_MAX), cut_at(actions, ACTIONS_MAX)]
    }

    /// How often an alarm was raised before this time, and the last times; `None` until the history has answered.
    pub fn before(&self, cx: &ViewContext, def: &AlarmDef, now: Timestamp) -> Option<(usize, Vec<Occurrence>)> {
        let (records, actions) = (self.alarms.value.as_ref()?, self.actions.value.as_ref()?);
        let name = subject_name(cx.def(), def.subject);
        let of_alarm = records.iter().filter(|record| *record.subject == *name && *record.message == *def.message);
        // What was set on the device of the alarm while it was active.
        let device = super::guidance::journal_of(cx, def.subject);
        let is_process = |action: &&ActionRecord| {
            let rest = action.target.strip_prefix(device);
            let is_of_device = rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            action.is_on_process() && action.new.is_some() && is_of_device
        };
        let of_device: Vec<&ActionRecord> = actions.iter().filter(is_process).collect();
        Some(occurrences(&of_alarm.collect::<Vec<_>>(), &of_device, just_before(now)))
    }
}

/// The last hour, in columns of the panel beside the list.
fn view(cx: &ViewContext) -> View {
    View::live(cx.now, RIBBON.as_secs(), chart::dots(cx.theme, side::columns(cx.area.width), 1))
}

/// The oldest of these times, where a limit cut off those before it.
fn cut_at(times: impl Iterator<Item = Timestamp>, limit: usize) -> Option<Timestamp> {
    let times: Vec<Timestamp> = times.collect();
    times.iter().min().copied().filter(|_| limit <= times.len())
}

/// The journal holds microseconds, a snapshot more digits: what was at this time is not before it.
fn just_before(at: Timestamp) -> Timestamp {
    at.checked_sub(SignedDuration::from_millis(1)).unwrap_or(at)
}

/// How an alarm stood in each cell of the hour before `now`, from its events, oldest first, and its state now.
fn ribbon(
    steps: &[(Timestamp, AlarmEvent)],
    state: AlarmState,
    (known_from, now): (Timestamp, Timestamp),
    cells: usize,
) -> Vec<Stood> {
    let mut ends = match state {
        AlarmState::Unacknowledged => Stood::Unacknowledged,
        AlarmState::Acknowledged => Stood::Acknowledged,
        AlarmState::Normal
        | AlarmState::ReturnedToNormal
        | AlarmState::LatchedUnacknowledged
        | AlarmState::LatchedAcknowledged
        | AlarmState::Shelved
        | AlarmState::SuppressedByDesign
        | AlarmState::OutOfService => Stood::Normal,
    };
    let from = now.checked_sub(RIBBON).unwrap_or(now);
    let cell = |at: Timestamp| {
        let share = at.duration_since(from).as_secs_f64() / RIBBON.as_secs_f64();
        crate::plant::number::to_usize((share.clamp(0.0, 1.0) * cells as f64).floor()).min(cells.saturating_sub(1))
    };
    let mut stood = vec![Stood::Unknown; cells];
    let mut end = now;
    // Backwards from now: what it is now it has been since the last event.
    for (at, event) in steps.iter().rev().map(|(at, event)| (*at, Some(*event))).chain([(known_from, None)]) {
        for stood in stood.iter_mut().take(cell(end) + 1).skip(cell(at)) {
            *stood = (*stood).max(ends);
        }
        end = at;
        ends = match event {
            Some(AlarmEvent::Raised) | None => Stood::Normal,
            Some(AlarmEvent::Acknowledged) => Stood::Unacknowledged,
            Some(AlarmEvent::ReAlarmed) => Stood::Acknowledged,
            Some(AlarmEvent::ReturnedToNormal | AlarmEvent::Shelved | AlarmEvent::OutOfService) => {
                before_end(steps, at)
            }
            Some(AlarmEvent::SuppressedByDesign | AlarmEvent::Removed) => before_end(steps, at),
            // It had another name.
            Some(AlarmEvent::CarriedOver) => Stood::Unknown,
            Some(AlarmEvent::StepDone | AlarmEvent::StepUndone) => ends,
            Some(
                AlarmEvent::RaisedSuppressed
                | AlarmEvent::ReturnedSuppressed
                | AlarmEvent::Reset
                | AlarmEvent::Unshelved
                | AlarmEvent::Unsuppressed
                | AlarmEvent::InService,
            ) => Stood::Normal,
        };
    }
    stood
}

/// How it stood before it ended at this time: acknowledged if it was in this activation.
fn before_end(steps: &[(Timestamp, AlarmEvent)], at: Timestamp) -> Stood {
    let earlier = steps.iter().rev().filter(|(other, _)| *other < at);
    let last = earlier
        .map(|(_, event)| *event)
        .find(|event| matches!(event, AlarmEvent::Raised | AlarmEvent::Acknowledged | AlarmEvent::ReAlarmed));
    if last == Some(AlarmEvent::Acknowledged) { Stood::Acknowledged } else { Stood::Unacknowledged }
}

/// How often it was raised before `now`, and each of these times; events and actions are newest first.
fn occurrences(records: &[&AlarmRecord], actions: &[&ActionRecord], now: Timestamp) -> (usize, Vec<Occurrence>) {
    let mut all: Vec<Occurrence> = Vec::new();
    for record in records.iter().rev().filter(|record| record.at < now) {
        match (record.event, all.last_mut()) {
            (AlarmEvent::Raised, _) => {
                all.push(Occurrence { raised_at: record.at, lasted: None, done: Vec::new() });
            }
            (event, Some(last)) => {
                if event.ends_annunciation() && last.lasted.is_none() {
                    last.lasted = Some(elapsed(last.raised_at, record.at));
                }
                if let (Some(by), Some(reason)) = (&record.by, &record.reason) {
                    last.done.push(format!("{by}: {reason}"));
                }
            }
            (_, None) => {}
        }
    }
    for occurrence in &mut all {
        let Some(lasted) = occurrence.lasted.and_then(|lasted| SignedDuration::try_from(lasted).ok()) else { continue };
        let end = occurrence.raised_at + lasted;
        let during = actions.iter().rev().filter(|action| occurrence.raised_at <= action.at && action.at <= end);
        occurrence.done.extend(during.map(|action| {
            let new = action.new.as_deref().unwrap_or_default();
            let old = action.old.as_ref().map(|old| format!("{old} → ")).unwrap_or_default();
            format!("{}: {} {old}{new}", action.by, action.target)
        }));
    }
    all.reverse();
    (all.len(), all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::recorded_action::RecordedAction;
    use crate::{
        plant::def::Priority,
        ui::fixture::{Fixture, now, with_cx},
    };

    fn ago(minutes: i64) -> Timestamp {
        now() - SignedDuration::from_mins(minutes)
    }

    #[test]
    fn a_ribbon_shows_how_an_alarm_came_and_went() {
        use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};
        let check_from = |known_from, steps: &[(i64, AlarmEvent)], state, expect: &str| {
            let steps: Vec<_> = steps.iter().map(|(minutes, event)| (ago(*minutes), *event)).collect();
            let signs = ['?', '.', '_', '#'];
            let shown: String =
                ribbon(&steps, state, (known_from, now()), 6).iter().map(|stood| signs[*stood as usize]).collect();
            assert_eq!(shown, expect, "{steps:?}");
        };
        let check = |steps: &[_], state, expect: &str| check_from(ago(60), steps, state, expect);
        check(&[], AlarmState::Acknowledged, "______");
        check(&[(15, Raised)], AlarmState::Unacknowledged, "....##");
        check(&[(55, Raised), (25, Acknowledged)], AlarmState::Acknowledged, "####__");
        check(&[(55, Raised), (45, ReturnedToNormal)], AlarmState::ReturnedToNormal, "##....");
        check(&[(55, Raised), (45, Acknowledged), (15, ReturnedToNormal)], AlarmState::Normal, "##___.");
        // Raised before the hour.
        check(&[(35, ReturnedToNormal)], AlarmState::ReturnedToNormal, "###...");
        // Chattering.
        let steps = [(55, Raised), (54, ReturnedToNormal), (5, Raised), (4, ReturnedToNormal)];
        check(&steps, AlarmState::ReturnedToNormal, "#....#");
        // The journal was read from twenty minutes ago on.
        check_from(ago(20), &[(15, Raised)], AlarmState::Unacknowledged, "????##");
        check_from(ago(25), &[(15, Raised)], AlarmState::Unacknowledged, "???.##");
    }

    #[test]
    fn the_last_times_say_what_was_done() {
        let event = |minutes, event| AlarmRecord::new(ago(minutes), "TIC-1.PV", "high", Priority::High, event);
        let note = |record: AlarmRecord| AlarmRecord {
            by: Some("anna".into()),
            reason: Some("relay replaced".into()),
            ..record
        };
        let records = [
            event(1, AlarmEvent::Raised),
            event(50, AlarmEvent::ReturnedToNormal),
            note(event(55, AlarmEvent::Acknowledged)),
            event(60, AlarmEvent::Raised),
            event(90, AlarmEvent::ReturnedToNormal),
        ];
        let write = ActionRecord {
            old: Some("70.0 °C".into()),
            new: Some("65.0 °C".into()),
            ..ActionRecord::new(ago(52), "tom", RecordedAction::Write, "TIC-1.SV", "verified")
        };
        let (times, all) = occurrences(&records.iter().collect::<Vec<_>>(), &[&write], ago(1));
        assert_eq!(times, 1, "this time and one without a beginning do not count");
        assert_eq!((all[0].raised_at, all[0].lasted), (ago(60), Some(Duration::from_secs(600))));
        assert_eq!(all[0].done, ["anna: relay replaced", "tom: TIC-1.SV 70.0 °C → 65.0 °C"]);
    }

    #[test]
    fn a_search_that_does_not_reach_back_says_so() {
        let mut recent = Recent::default();
        let event = AlarmRecord::new(now(), "TIC-1.PV", "high", Priority::High, AlarmEvent::Raised);
        recent.alarms.value = Some(vec![event.clone(); EVENTS_MAX - 1]);
        assert_eq!(recent.searched_since(), [None; 2]);
        let oldest = AlarmRecord { at: ago(90), ..event };
        recent.alarms.value.iter_mut().for_each(|events| events.push(oldest.clone()));
        assert_eq!(recent.searched_since(), [Some(ago(90)), None]);
        recent.actions.value =
            Some(vec![ActionRecord::new(ago(70), "tom", RecordedAction::Write, "TIC-1.SV", "verified"); ACTIONS_MAX]);
        assert_eq!(recent.searched_since(), [Some(ago(90)), Some(ago(70))]);
    }

    #[test]
    fn only_actions_on_the_device_of_the_alarm_are_named() {
        let fixture = Fixture::alarm();
        let def = &fixture.def.alarms[fixture.alarms[0].id.index()];
        let event = |minutes, event| AlarmRecord::new(ago(minutes), "TIC-1.PV", &def.message, def.priority, event);
        let write = |target: &str| ActionRecord {
            new: Some("65.0".into()),
            ..ActionRecord::new(ago(55), "tom", RecordedAction::Write, target, "verified")
        };
        let mut recent = Recent::default();
        recent.alarms.value = Some(vec![event(50, AlarmEvent::ReturnedToNormal), event(60, AlarmEvent::Raised)]);
        recent.actions.value = Some(["TIC-10.SV", "TIC-1.SV", "TIC-1", "TIC-1-B.SV"].map(write).to_vec());
        with_cx(&fixture.snapshot(), |cx| {
            let (times, all) = recent.before(cx, def, now()).expect("both have answered");
            assert_eq!(
                (times, &*all[0].done),
                (1, ["tom: TIC-1 65.0", "tom: TIC-1.SV 65.0"].map(str::to_owned).as_slice())
            );
        });
    }
}
