//! Events, limits and lanes of states in and under the chart.

use super::{
    super::{events::EventKind, lanes::is_state},
    *,
};

#[test]
fn events_stand_on_the_time_axis_and_speak_at_the_cursor() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("N");
    assert!(
        stand.screen().contains("n ") && stand.screen().contains("by anna"),
        "the newest first: {}",
        stand.screen()
    );
    stand.press("N");
    assert!(stand.screen().contains("temperature high"));
    insta::assert_snapshot!(stand.screen());
    stand.press("N");
    assert!(stand.screen().contains("TIC-1.SV write"));
    let first = stand.model.tabs.trends.cursor;
    stand.press("N");
    assert_eq!(stand.model.tabs.trends.cursor, first, "there is none before");
    stand.press("n");
    assert!(stand.screen().contains("temperature high"));
}

#[test]
fn more_events_than_are_read_are_said_to_be_missing() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    let records = (0..200).map(|n| action(ago(n), "write", None)).collect();
    stand.model.tabs.trends.events.actions.value = Some(records);
    let marks = stand.model.tabs.trends.marks(&stand.model.cx());
    assert!(marks.iter().any(|mark| mark.kind == EventKind::More));
}

#[test]
fn no_events_is_said_only_when_it_is_known() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    assert!(!stand.screen().contains("no events"), "nothing has been read");
    stand.answer();
    let events = &mut stand.model.tabs.trends.events;
    (events.alarms.value, events.actions.value) = (Some(Vec::new()), Some(Vec::new()));
    assert!(stand.screen().contains("no events"));
    stand.model.tabs.trends.events.actions.value = None;
    stand.model.tabs.trends.events.actions.trouble = Some("disk full".to_owned());
    let screen = stand.screen();
    assert!(!screen.contains("no events") && screen.contains("disk full"), "{screen}");
}

#[test]
fn a_state_is_a_lane_under_the_chart() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    let tags = stand.model.snapshot.def.tags.clone();
    let of = |state: bool| tags.iter().filter(move |tag| is_state(tag) == state);
    stand.model.tabs.trends.values.of.picked = of(false).take(1).chain(of(true).take(2)).map(|tag| tag.id).collect();
    stand.press("gg");
    stand.answer();
    let lanes = stand.model.tabs.trends.lanes(&stand.model.cx());
    assert_eq!((lanes.len(), stand.model.tabs.trends.curved(&stand.model.cx()).len()), (2, 1));
    insta::assert_snapshot!(stand.screen());
}
