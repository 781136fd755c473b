//! The steps of counters below the figures, and the window that corrects one.

use super::*;
use crate::{
    access::{LoggedInUser, SessionStatus},
    plant::counter::{CounterEvent, CounterStep},
    report::counters::CounterRow,
};

const FLOW: &str = "PLC-1.FLOW";

/// A plant whose flow is a counter of energy, with a report in which it was replaced and corrected.
fn counted(theme: Theme, width: u16, height: u16) -> Stand {
    let mut fixture = Fixture::normal();
    let tags = fixture.def.tags.iter_mut().filter(|tag| tag.name == FLOW || tag.name == "TIC-1.MV");
    tags.for_each(|tag| (tag.unit, tag.counter) = ("kWh".into(), Some(true)));
    let mut stand = Stand::of(&fixture, theme, width, height);
    for (id, query) in std::mem::take(&mut stand.asked) {
        let Query::Report { period } = query else { continue };
        let row = |minutes, event, [old, new, counted]: [f64; 3], note: &str| {
            let at = period.from + SignedDuration::from_mins(minutes);
            let step = CounterStep { at, event, old: old.into(), new: new.into(), counted: counted.into() };
            CounterRow { tag: FLOW.into(), unit: "kWh".into(), decimals: 1, step, note: note.into() }
        };
        let counters = vec![
            row(7, CounterEvent::Replaced, [1_204.5, 3.0, 0.0], ""),
            row(9, CounterEvent::Corrected, [0.0, 0.0, -2.5], "anna: read by hand"),
        ];
        let report = ShiftReport { counters, ..report(period, true) };
        stand.send(Msg::Answer(id, Ok(Answer::Report(Box::new(report)))));
    }
    stand
}

fn sent(stand: &mut Stand) -> Option<(CommandKind, Option<String>)> {
    let Command { kind, note, .. } = stand.commands.pop()?;
    Some((kind, note.map(|note| note.to_string())))
}

#[test]
fn steps_of_counters_stand_below_the_figures() {
    for (width, height) in [(80, 24), (120, 40)] {
        let mut stand = counted(Theme::FULL, width, height);
        stand.send(Msg::Key(KeyEvent::new(KeyCode::End, KeyModifiers::NONE)));
        let shown = stand.screen();
        for words in ["counters", "14:07:00", "replaced", "1204.5 → 3.0 kWh, counted 0.0", "-2.5 kWh, anna: read by"]
        {
            assert!(shown.contains(words), "no {words} at {width}x{height}:\n{shown}");
        }
    }
}

#[test]
fn a_supervisor_corrects_a_counter_with_a_reason() {
    let mut stand = counted(Theme::FULL, 80, 24);
    let tag = |name: &str| stand.model.snapshot.def.tag_named(name).expect("it is in the fixture");
    let (flow, output) = (tag(FLOW), tag("TIC-1.MV"));
    stand.press("x");
    assert!(stand.screen().contains("correct a counter") && stand.screen().contains(FLOW), "{}", stand.screen());
    // What the station would refuse is said before anything is sent.
    for (keys, why) in [
        ("⏎", "not an amount"),
        ("1..5⏎", "not an amount"),
        ("⌫⌫⌫⌫0⏎", "not an amount"),
        ("⌫-12.5⏎", "a reason is required"),
    ] {
        stand.press(keys);
        assert!(stand.screen().contains(why), "{keys}: {}", stand.screen());
        assert_eq!(sent(&mut stand), None, "{keys}");
    }
    stand.press("new meter⏎");
    let kind = CommandKind::CorrectCounter { tag: flow, amount: (-12.5).into() };
    assert_eq!(sent(&mut stand), Some((kind, Some("new meter".into()))));
    assert!(!stand.screen().contains("correct a counter"));
    // Another counter, the reason first.
    stand.press("x↑←⇥⇥read by hand↑3⏎");
    let kind = CommandKind::CorrectCounter { tag: output, amount: 3.0.into() };
    assert_eq!(sent(&mut stand), Some((kind, Some("read by hand".into()))));
}

#[test]
fn a_correction_looks_the_same_at_both_sizes() {
    for (width, height) in [(80, 24), (120, 40)] {
        let mut stand = counted(Theme::FULL, width, height);
        stand.press("x-12.5⇥new meter");
        insta::assert_snapshot!(format!("a_correction_at_{width}x{height}"), stand.screen());
    }
}

#[test]
fn only_a_supervisor_is_asked_for_an_amount() {
    let mut stand = counted(Theme::FULL, 80, 24);
    let session = (*stand.model.session).clone();
    let who = session.who.map(|who| LoggedInUser { role: Role::Technician, ..who });
    stand.send(Msg::SessionStatus(Arc::new(SessionStatus { who, ..session })));
    stand.press("x5⏎");
    let shown = stand.screen();
    assert!(shown.contains("upervisor") && !shown.contains("amount "), "{shown}");
    assert_eq!(sent(&mut stand), None);
}

#[test]
fn a_plant_that_counts_nothing_has_no_key_for_it() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    stand.press("x");
    assert!(!stand.screen().contains("correct a counter"));
}
