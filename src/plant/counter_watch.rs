//! The counters of a plant as they are stored: what is not plain counting is an action of the station, on record.

use std::{collections::HashMap, sync::Arc};

use crate::plant::{
    alarm::{AlarmRefusal, command::check_note},
    command::Refusal,
    commands::value_text,
    counter::{Counter, CounterRule, CounterStep, Reading, may_count},
    def::{PlantDef, TagId},
    exact::Exact,
    process_image::ProcessImage,
    record::{ActionRecord, Record},
    recorded_action::RecordedAction,
    station_fault::STATION,
    tag::TagDef,
};

/// Follows every counter by its stored samples, which are what reports are made of.
#[derive(Debug, Clone, Default)]
pub struct CounterWatch(HashMap<TagId, Counter>);

impl CounterWatch {
    /// What some records say of counters beside counting.
    pub fn steps(&mut self, def: &PlantDef, image: &ProcessImage, records: &[Record]) -> Vec<Record> {
        let samples = records.iter().filter_map(|record| match record {
            Record::Sample(tag, sample) if may_count(def.tag(*tag)) => Some((*tag, *sample)),
            _ => None,
        });
        let mut actions = Vec::new();
        for (tag, sample) in samples {
            let Some(value) = sample.good_exact().filter(|value| value.is_finite()) else { continue };
            let of = def.tag(tag);
            let new = || Counter::new(CounterRule::of(of, image.scaling_decimals(of)));
            let counter = self.0.entry(tag).or_insert_with(new);
            let counted = counter.read(Reading { value, at: sample.at, until: sample.at });
            let Some(CounterStep { at, event, old, new, counted }) = counted.step else { continue };
            let text = |value| value_text(image, of, value);
            let action = ActionRecord {
                old: Some(text(old).into()),
                new: Some(text(new).into()),
                note: Some(format!("read at {at:.0}, counted {}", text(counted)).into()),
                ..ActionRecord::new(sample.at, STATION, RecordedAction::Counter, of.name.as_str(), event.word())
            };
            actions.push(Record::Action(action));
        }
        actions
    }
}

/// Can what a tag counted be corrected so? A correction needs a reason.
pub fn check_correction(tag: &TagDef, amount: Exact, reason: Option<&Arc<str>>) -> Result<(), Refusal> {
    if !may_count(tag) {
        return Err(Refusal::NotACounter);
    }
    if !amount.is_finite() || amount == 0.0 {
        return Err(Refusal::NotAnAmount);
    }
    match reason.is_some_and(|reason| !reason.trim().is_empty()) {
        true => check_note(reason).map_err(Refusal::Alarm),
        false => Err(Refusal::Alarm(AlarmRefusal::ReasonNeeded)),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        Plant,
        command::{Command, CommandId, CommandKind, CommandStatus},
        event::Event,
        fixture::{self, PV, SV, TIC},
    };

    fn plant() -> Plant {
        let mut def = fixture::plant();
        let tag = &mut def.tags[PV.index()];
        (tag.counter, tag.deadband) = (Some(true), Some(0.0));
        Plant::new(Arc::new(def), at(0), 1.0)
    }

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn actions(records: Vec<Record>) -> Vec<(String, Option<String>, String)> {
        let action = |record| match record {
            Record::Action(action) => {
                Some((action.action.to_string(), action.new.map(|new| new.to_string()), action.outcome.to_string()))
            }
            _ => None,
        };
        records.into_iter().filter_map(action).collect()
    }

    #[test]
    fn what_is_not_plain_counting_is_on_record_as_it_is_seen() {
        let (mut plant, mut found) = (plant(), Vec::new());
        for (second, raw) in (1..).zip([4_000.0, 4_010.0, 0.0, 4_020.0, 4_020.0, 90.0, 100.0]) {
            let values = vec![(fixture::DP, 0.0.into()), (fixture::FAULT, 0.0.into()), (PV, Exact::from(raw))];
            let (texts, response_time) = (Vec::new(), Duration::ZERO);
            let event = Event::Read { at: at(second), device: TIC, values, texts, response_time, exchange: None };
            found.extend(actions(plant.on_event(event).records));
        }
        let outcomes: Vec<&str> = found
            .iter()
            .map(|(action, _, outcome)| (assert_eq!(action, RecordedAction::Counter.word()), outcome.as_str()).1)
            .collect();
        assert_eq!(outcomes, ["false reading", "replaced"]);
    }

    #[test]
    fn a_correction_needs_a_counter_an_amount_and_a_reason() {
        let mut plant = plant();
        let mut number = 0;
        let mut correct = |tag, amount: f64, reason: Option<&str>| {
            number += 1;
            let kind = CommandKind::CorrectCounter { tag, amount: amount.into() };
            let command = Command::new(0, CommandId { terminal: 1, number }, kind);
            let command = Command { note: reason.map(Into::into), ..command };
            let found = actions(plant.on_command(CommandStatus::new(command, "anna", at(1)), at(1)).records);
            found.into_iter().map(|(_, _, outcome)| outcome).collect::<String>()
        };
        assert_eq!(correct(PV, 12.5, Some("new meter")), "done");
        assert_eq!(correct(PV, -2.0, Some("read by hand")), "done");
        assert_eq!(correct(PV, 12.5, None), "refused: a reason is required");
        assert_eq!(correct(PV, 12.5, Some(" ")), "refused: a reason is required");
        assert_eq!(correct(PV, 0.0, Some("no")), "refused: not an amount");
        assert_eq!(correct(PV, f64::NAN, Some("no")), "refused: not an amount");
        assert_eq!(correct(SV, 1.0, Some("no")), "refused: not a counter");
    }
}
