//! Replay: what an operator sees of a past instant, and that nothing is done there.

mod forms;
mod event_page;
mod pages;
mod steps;

use std::time::Duration;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use jiff::{SignedDuration, Timestamp};

use super::{model, screen, sent_kind, type_keys};
use crate::{
    history::{Answer, HistoryError, Query},
    plant::{
        def::Priority,
        past::Past,
        record::{AlarmEvent, AlarmRecord},
    },
    ui::{
        Effect, Model, Msg, QueryId,
        fixture::{Fixture, now},
        modal::Modal,
        tabs::Tab,
        theme::Theme,
        update,
    },
};

fn ago(seconds: i64) -> Timestamp {
    now() - SignedDuration::from_secs(seconds)
}

/// The plant at a past instant: PV had another value, no alarm was active.
fn past(at: Timestamp, pv: f64) -> Answer {
    let mut fixture = Fixture::normal();
    fixture.set("TIC-1.PV", pv);
    let samples = fixture.samples.iter().map(|sample| crate::plant::sample::Sample { at, ..*sample }).collect();
    Answer::Past(Box::new(Past { at, samples, events: Vec::new(), minutes: vec![None] }))
}

fn asked(effects: &[Effect]) -> Vec<(u32, Query)> {
    let of_replay = |effect: &Effect| match effect {
        Effect::Query(QueryId { tab: None, number }, query) => Some((*number, query.clone())),
        _ => None,
    };
    effects.iter().filter_map(of_replay).collect()
}

fn instants(effects: &[Effect]) -> Vec<Timestamp> {
    let instant = |(_, query): (u32, Query)| if let Query::Past { at } = query { Some(at) } else { None };
    asked(effects).into_iter().filter_map(instant).collect()
}

fn answer(model: &mut Model, number: u32, answer: Result<Answer, HistoryError>) -> Vec<Effect> {
    update(model, Msg::Answer(QueryId { tab: None, number }, answer))
}

/// Answers every query for an instant; PV is 50 and a bit.
fn answer_instants(model: &mut Model, effects: &[Effect]) {
    for (number, query) in asked(effects) {
        if let Query::Past { at } = query {
            answer(model, number, Ok(past(at, 50.0)));
        }
    }
}

/// A terminal that shows the plant ten minutes ago.
pub fn replayed(fixture: &Fixture, tab: Tab) -> Model {
    let mut model = model(fixture, Theme::FULL);
    model.tabs.shown = tab;
    let effects = type_keys(&mut model, "@-10m⏎");
    assert_eq!(instants(&effects), [ago(600)], "whole seconds");
    answer_instants(&mut model, &effects);
    model
}

fn tick(model: &mut Model) -> Vec<Effect> {
    update(model, Msg::Tick { silent: Duration::ZERO })
}

fn shown_at(model: &Model) -> Option<Timestamp> {
    model.replay.shown().map(|shown| shown.at)
}

#[test]
fn the_past_is_below_the_rule_and_the_present_above_it() {
    let mut model = replayed(&Fixture::alarm(), Tab::Mimic);
    let shown = screen(&mut model, 80, 24);
    insta::assert_snapshot!("replay_mimic_80x24", shown);
    let rows: Vec<&str> = shown.lines().collect();
    assert!(rows[0].contains("14:02:31"), "the clock is of the present: {}", rows[0]);
    assert!(rows[2].contains("72.4 °C") && !rows[2].contains("a ack"), "so is the banner: {}", rows[2]);
    assert!(rows[3].contains("PAST  2026-11-21 13:52:31  10m00s ago  paused"), "{}", rows[3]);
    assert!(rows[4..22].iter().any(|row| row.contains("50.0 °C")), "the value of then: {shown}");
    assert!(!rows[4..22].iter().any(|row| row.contains("72.4")), "no value of now: {shown}");
    assert!(rows[23].contains("[] event") && rows[23].contains("Esc present"), "{}", rows[23]);
    type_keys(&mut model, "⎋");
    let shown = screen(&mut model, 80, 24);
    assert!(!shown.contains("PAST") && shown.contains("72.4 °C"), "{shown}");
}

#[test]
fn nothing_is_done_in_the_past() {
    let letters = (' '..='~').chain(['⏎', '↑', '↓', '←', '→']);
    let keys: Vec<String> =
        letters.flat_map(|letter| [letter.into(), format!("{letter}⏎y"), format!("⏎{letter}⏎y")]).collect();
    for tab in [Tab::Mimic, Tab::Trends, Tab::Alarms, Tab::Controllers, Tab::Bus] {
        for keys in &keys {
            let mut model = replayed(&Fixture::alarm(), tab);
            screen(&mut model, 80, 24);
            let effects = type_keys(&mut model, keys);
            assert_eq!(sent_kind(&effects), None, "{tab:?} {keys:?}");
            let form = model.modal.as_ref().filter(|modal| crate::ui::replay::gives_command(modal));
            assert_eq!(form, None, "{tab:?} {keys:?}");
            let done = |effect: &Effect| matches!(effect, Effect::Extension(_) | Effect::Quit);
            // Two of them in a row are the question whether to leave and its answer.
            let quits = keys.contains('q');
            assert!(quits || !effects.iter().any(done), "{tab:?} {keys:?}: {effects:?}");
        }
    }
}

#[test]
fn a_command_is_refused_with_the_way_back() {
    for (tab, keys) in [(Tab::Mimic, "s"), (Tab::Mimic, "a"), (Tab::Alarms, "A"), (Tab::Controllers, "⏎T")] {
        let mut model = replayed(&Fixture::alarm(), tab);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        let is_said = shown.contains("This is the past: no commands. Esc returns to the present");
        assert!(is_said && model.modal.is_none(), "{tab:?} {keys}: {shown}");
    }
}

#[test]
fn an_instant_is_shown_when_it_is_there() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "@13:02⏎");
    let query = asked(&effects);
    assert_eq!(instants(&effects), [ago(3_631)]);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("reading the history") && !shown.contains("PAST"), "until then the present: {shown}");
    answer(&mut model, query[0].0, Err(HistoryError::NotKept { at: ago(3_631), first: ago(60), last: now() }));
    let shown = screen(&mut model, 80, 24);
    assert!(
        !shown.contains("PAST") && shown.contains("no data: the history begins 2026-11-21 14:01:31"),
        "why not: {shown}"
    );
    // An older answer shows nothing.
    let older = asked(&type_keys(&mut model, "@-5m⏎"));
    type_keys(&mut model, "@-6m⏎");
    answer(&mut model, older[0].0, Ok(past(ago(300), 50.0)));
    assert_eq!(shown_at(&model), None);
}

#[test]
fn what_was_typed_wrongly_is_said() {
    for (typed, expect) in [
        ("-", "expected 03:12"),
        ("-x", "expected 03:12"),
        ("tomorrow", "expected 03:12"),
        ("2030-01-01 00:00", "lies in the future"),
    ] {
        let mut model = model(&Fixture::normal(), Theme::FULL);
        let effects = type_keys(&mut model, &format!("@{typed}⏎"));
        let shown = screen(&mut model, 80, 24);
        assert!(instants(&effects).is_empty() && shown.contains(expect), "{typed}: {shown}");
    }
}

#[test]
fn enter_alone_goes_to_what_is_selected() {
    let raised = Fixture::alarm().alarms[0].raised_at;
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    assert_eq!(instants(&type_keys(&mut model, "@⏎")), [raised], "the alarm");
    let mut model = super::model(&Fixture::alarm(), Theme::FULL);
    assert_eq!(instants(&type_keys(&mut model, "@⏎")), [], "nothing is selected on the mimic");
    assert!(model.modal.is_some());
}

#[test]
fn steps_lead_from_where_it_is_to_the_present_at_most() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    for (key, expect) in [("<", 660), (">", 600), (",", 601), (".", 600)] {
        let effects = type_keys(&mut model, key);
        assert_eq!(instants(&effects), [ago(expect)], "{key}");
        answer_instants(&mut model, &effects);
        assert_eq!(shown_at(&model), Some(ago(expect)), "{key}");
    }
    let effects = type_keys(&mut model, "@-10s⏎");
    answer_instants(&mut model, &effects);
    assert_eq!(instants(&type_keys(&mut model, ">")), [now()]);
}

#[test]
fn playing_fetches_ahead_and_waits_for_what_comes_late() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    let effects = type_keys(&mut model, "***");
    // Three presses are ×60: half a minute each half second. What was fetched for the slower paces is given up.
    let ahead: Vec<_> = asked(&effects).split_off(6);
    assert_eq!(instants(&effects)[6..], [ago(570), ago(540), ago(510)]);
    assert!(tick(&mut model).is_empty(), "nothing has come: it waits, and asks for no more");
    assert_eq!(shown_at(&model), Some(ago(600)));
    answer(&mut model, ahead[1].0, Ok(past(ago(540), 51.0)));
    tick(&mut model);
    assert_eq!(shown_at(&model), Some(ago(600)), "never past one that is missing");
    answer(&mut model, ahead[0].0, Ok(past(ago(570), 51.0)));
    assert_eq!(instants(&tick(&mut model)), [ago(480)], "one is shown, one more fetched");
    assert_eq!(shown_at(&model), Some(ago(570)));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("playing ×60"), "{shown}");
    // A step pauses.
    type_keys(&mut model, ".");
    assert!(screen(&mut model, 80, 24).contains("paused"));
}

#[test]
fn playing_ends_at_the_present_and_at_an_error() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    let effects = type_keys(&mut model, "@-40s⏎");
    answer_instants(&mut model, &effects);
    let effects = type_keys(&mut model, "***");
    assert_eq!(instants(&effects)[6..], [ago(10), now()], "the last step is a short one");
    answer_instants(&mut model, &effects);
    tick(&mut model);
    assert!(tick(&mut model).is_empty());
    assert_eq!((shown_at(&model), model.replay.speed()), (Some(now()), 0));
    let effects = type_keys(&mut model, "@-40s⏎");
    answer_instants(&mut model, &effects);
    let effects = type_keys(&mut model, "*");
    let failed = asked(&effects)[0].0;
    answer(&mut model, failed, Err(HistoryError::Engine("the disk is gone".into())));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("paused") && shown.contains("the disk is gone"), "{shown}");
}

fn raised(at: Timestamp) -> AlarmRecord {
    AlarmRecord::new(at, "TIC-1.PV", "temperature high", Priority::High, AlarmEvent::Raised)
}

/// Answers a search with the alarm events that lie in its span, newest first, at most as many as it asked for.
fn answer_search(model: &mut Model, effects: &[Effect], events: &[AlarmRecord]) -> Vec<Effect> {
    let mut next = Vec::new();
    for (number, query) in asked(effects) {
        let found = match query {
            Query::Journal { from, to, limit } => {
                let mut rows: Vec<_> =
                    events.iter().filter(|event| from <= event.at && event.at < to).cloned().collect();
                rows.sort_by_key(|row| std::cmp::Reverse(row.at));
                rows.truncate(limit);
                Answer::Journal(rows)
            }
            Query::Actions { .. } => Answer::Actions(Vec::new()),
            other => panic!("no search: {other:?}"),
        };
        next.extend(answer(model, number, Ok(found)));
    }
    next
}

/// Where a key for the next event leads, whatever number of searches that takes.
fn found(model: &mut Model, key: &str, events: &[AlarmRecord]) -> Option<Timestamp> {
    let mut effects = type_keys(model, key);
    for _ in 0..40 {
        if let [at] = instants(&effects)[..] {
            answer_instants(model, &effects);
            return Some(at);
        }
        if asked(&effects).is_empty() {
            return None;
        }
        effects = answer_search(model, &effects, events);
    }
    panic!("the search does not end")
}

#[test]
fn the_nearest_event_is_found_however_far_and_many() {
    let events: Vec<AlarmRecord> = [9_000_000, 90_000, 5_000, 601, 600, 599, 30].map(|s| raised(ago(s))).to_vec();
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    for expect in [601, 5_000, 90_000, 9_000_000] {
        assert_eq!(found(&mut model, "[", &events), Some(ago(expect)));
    }
    assert_eq!(found(&mut model, "[", &events), None);
    assert!(screen(&mut model, 80, 24).contains("no earlier event within a year"));
    for expect in [90_000, 5_000, 601, 600, 599, 30] {
        assert_eq!(found(&mut model, "]", &events), Some(ago(expect)));
    }
    assert_eq!(found(&mut model, "]", &events), None);
    assert!(screen(&mut model, 80, 24).contains("no later event"));
    // A flood: the oldest of too many rows would be missing.
    let flood: Vec<AlarmRecord> = (0..5_000).map(|n| raised(ago(500) + SignedDuration::from_millis(n * 10))).collect();
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    assert_eq!(found(&mut model, "]", &flood), Some(ago(500)));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.lines().nth(22).is_some_and(|row| row.contains("TIC-1.PV temperature high  raised")), "{shown}");
    assert_eq!(found(&mut model, "]", &flood), Some(ago(500) + SignedDuration::from_millis(10)));
}

#[test]
fn answers_of_the_present_do_not_stay_in_the_past() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    let mut pending = type_keys(&mut model, "j");
    let of_tab = |effects: &[Effect]| {
        let of_journal = |effect: &Effect| match effect {
            Effect::Query(id @ QueryId { tab: Some(Tab::Alarms), .. }, Query::Journal { to, .. }) => Some((*id, *to)),
            _ => None,
        };
        effects.iter().find_map(of_journal).expect("the journal is asked for")
    };
    let (first, _) = of_tab(&pending);
    update(&mut model, Msg::Answer(first, Ok(Answer::Journal(vec![raised(ago(5))]))));
    assert!(screen(&mut model, 80, 24).contains("temperature high"));
    let effects = type_keys(&mut model, "@-10m⏎");
    for (number, query) in asked(&effects) {
        if let Query::Past { at } = query {
            pending = answer(&mut model, number, Ok(past(at, 50.0)));
        }
    }
    let shown = screen(&mut model, 80, 24);
    assert!(!shown.contains("temperature high") && shown.contains("collecting data"), "{shown}");
    let (then, to) = of_tab(&pending);
    assert_eq!(to, ago(599), "the journal until then");
    update(&mut model, Msg::Answer(then, Ok(Answer::Journal(vec![raised(ago(700))]))));
    assert!(screen(&mut model, 80, 24).contains("temperature high"));
    type_keys(&mut model, "⎋");
    assert!(!screen(&mut model, 80, 24).contains("temperature high"), "nor the other way round");
}

#[test]
fn the_cursor_of_the_trends_goes_with_the_replay() {
    let mut model = replayed(&Fixture::normal(), Tab::Trends);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("at 13:52:31"), "{shown}");
    let effects = type_keys(&mut model, "←");
    let to = instants(&effects);
    assert!(to[0] < ago(600) && ago(630) < to[0], "a cell earlier: {to:?}");
    answer_instants(&mut model, &effects);
    type_keys(&mut model, "b");
    assert!(model.tabs.trends.both().is_some());
    type_keys(&mut model, "⎋");
    assert_eq!(model.tabs.trends.both(), None, "no cursor is left that arrows would move unseen");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("live ●") && !shown.contains("at 13:5"), "{shown}");
}

#[test]
fn a_tab_without_a_past_leads_out_of_it_or_is_not_there() {
    let mut model = replayed(&Fixture::normal(), Tab::Users);
    assert_eq!(model.tabs.shown, Tab::Mimic);
    type_keys(&mut model, "7");
    assert_eq!((model.tabs.shown, shown_at(&model)), (Tab::Mimic, Some(ago(600))));
    // A session that ends shows the login page, of the present.
    let gone = crate::access::SessionStatus::default();
    update(&mut model, Msg::SessionStatus(std::sync::Arc::new(gone)));
    assert_eq!((model.tabs.shown, shown_at(&model)), (Tab::Login, None));
}

#[test]
fn another_plant_file_ends_the_replay() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    let mut other = Fixture::normal();
    other.def.name = "another plant".into();
    update(&mut model, Msg::Snapshot(other.snapshot()));
    assert_eq!(shown_at(&model), None);
}

#[test]
fn looking_into_a_value_of_then_is_possible() {
    let mut model = replayed(&Fixture::alarm(), Tab::Mimic);
    type_keys(&mut model, "→w");
    assert!(matches!(model.modal, Some(Modal::Why(_))), "{:?}", model.modal);
    update(&mut model, Msg::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE)));
    assert_eq!((&model.modal, shown_at(&model)), (&None, Some(ago(600))), "Esc closes the window first");
}
