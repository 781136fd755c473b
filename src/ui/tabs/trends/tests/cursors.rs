//! The cursors A and B, and what is measured between them.

use super::{super::cursors::Measured, *};
use crate::plant::sample::{Cause, Quality};

#[test]
fn two_cursors_measure_every_pen_between_them() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("c←←←←←←←←←←b→→→→");
    stand.answer();
    insta::assert_snapshot!(stand.screen());
    let (a, b) = stand.model.tabs.trends.both().expect("both cursors");
    assert!(a < b);
    stand.press("b←");
    assert_eq!(stand.model.tabs.trends.both().map(|(_, b)| b), Some(b), "the arrows move A again");
    stand.press("c");
    assert_eq!((stand.model.tabs.trends.both(), stand.model.tabs.trends.cursor), (None, None));
}

#[test]
fn cursors_that_left_the_view_keep_their_times() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("c←←←←←←←←←←b→→");
    stand.answer();
    let header = |stand: &Stand| stand.screen().lines().nth(5).unwrap_or_default().to_owned();
    let (before, time) = (header(&stand), |header: &str, letter: &str| {
        let words: Vec<String> = header.split_whitespace().map(str::to_owned).collect();
        words.iter().position(|word| word == letter).map(|place| words[place + 1].clone())
    });
    assert!(time(&before, "A").is_some() && time(&before, "B").is_some(), "{before}");
    stand.send(Msg::Key(KeyEvent::new(KeyCode::PageUp, KeyModifiers::NONE)));
    stand.send(Msg::Key(KeyEvent::new(KeyCode::PageUp, KeyModifiers::NONE)));
    stand.answer();
    let after = header(&stand);
    for letter in ["A", "B"] {
        assert_eq!(time(&after, letter), time(&before, letter), "{after}");
    }
}

#[test]
fn the_legend_of_two_cursors_has_names_at_60_columns() {
    let mut stand = Stand::new(Theme::FULL, 60, 20);
    stand.answer();
    stand.press("c←←←←←←←←←←b→→");
    stand.answer();
    let screen = stand.screen();
    for pen in ["● TIC-1.PV", "○ TIC-1.SV", "▲ TIC-1.MV"] {
        assert!(screen.contains(pen), "{screen}");
    }
}

#[test]
fn figures_of_another_interval_are_not_shown() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    stand.press("b←←");
    stand.answer();
    let least = |stand: &Stand| {
        let measured = stand.model.tabs.trends.measured(&stand.model.cx(), TagId(0)).expect("both cursors");
        measured.figures.and_then(|(summary, _)| summary).map(|(min, ..)| min)
    };
    let first = least(&stand).expect("answered");
    stand.press("b←");
    assert_eq!(least(&stand), None, "until the history has answered");
    stand.press("→→→→←←");
    assert!(stand.asked.len() <= 6, "fast keys do not pile up queries");
    stand.answer();
    assert!(least(&stand).is_some_and(|least| least != first), "{first}");
}

#[test]
fn only_good_values_make_a_difference() {
    let good = |value| Some(Sample::good(value, now()).into());
    let doubted = Some(Sample::good(5.0, now()).uncertain(Cause::Stale).into());
    let check = |ends, expect| assert_eq!(Measured { ends, figures: None, counted: None }.difference(), expect);
    check([good(2.0), good(5.0)], Some(3.0.into()));
    check([good(2.0), doubted], None);
    check([None, good(2.0)], None);
    assert!(doubted.is_some_and(|held: crate::report::step_series::HeldValue| held.quality != Quality::Good));
    let measured = Measured { ends: [good(2.0), good(5.0)], figures: None, counted: None };
    assert_eq!(measured.slope(SignedDuration::from_secs(30)), Some(6.0));
    assert_eq!(measured.slope(SignedDuration::from_secs(-30)), Some(-6.0), "the other way round");
    assert_eq!(measured.slope(SignedDuration::ZERO), None);
}
