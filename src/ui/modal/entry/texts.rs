//! Texts and clocks as they are typed.

use super::*;
use crate::{
    plant::data_type::Clock,
    ui::{
        fixture::{Fixture, with_cx},
        keys,
    },
};

fn press(code: KeyCode) -> KeyEvent {
    KeyEvent::new(code, KeyModifiers::NONE)
}

/// What becomes of `typed` where SV is of this type and shows `shown`: the command, or the problem; and what was offered.
fn typed(kind: DataType, confirm: bool, shown: &str, typed: &str) -> (String, Result<CommandKind, String>) {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    fixture.def.tags[sv.index()].point.kind = kind;
    fixture.def.tags[sv.index()].confirm = confirm.then(|| "Write it?".to_owned());
    let mut snapshot = (*fixture.snapshot()).clone();
    Arc::make_mut(&mut snapshot.texts)[sv.index()] = Some(shown.into());
    with_cx(&snapshot, |cx| {
        let entry = Entry::new(cx, sv);
        let offered = entry.line.text();
        let mut next = Next::Stay(Modal::Entry(entry));
        for key in typed.chars().map(KeyCode::Char).chain([KeyCode::Enter]) {
            let Next::Stay(Modal::Entry(entry)) = next else { panic!("it has gone: {next:?}") };
            next = entry.on_key(cx, press(key));
        }
        let said = match next {
            Next::Do(actions) => match actions.as_slice() {
                [UiAction::SendCommand(command, None)] => Ok(command.kind.clone()),
                other => panic!("{other:?}"),
            },
            Next::Stay(Modal::Entry(entry)) => Err(entry.problem.unwrap_or_default()),
            Next::Stay(Modal::Confirm(confirm)) => Err(confirm.verb().to_owned()),
            other => panic!("{other:?}"),
        };
        (offered, said)
    })
}

#[test]
fn a_typed_text_replaces_the_one_that_is_shown() {
    let sv = Fixture::normal().tag("TIC-1.SV");
    let sent = |text: &str| Ok(CommandKind::WriteText { tag: sv, text: text.into(), seen: Some("Line 1".into()) });
    assert!(keys::code(KeyCode::Enter).is(press(KeyCode::Enter)));
    let text = DataType::Text(8);
    assert_eq!(typed(text, false, "Line 1", "Nr. 7"), ("Line 1".to_owned(), sent("Nr. 7")));
    assert_eq!(typed(text, false, "Line 1", ""), ("Line 1".to_owned(), sent("Line 1")));
    let why = Err("expected printable characters in at most 8 bytes, no blank at the end".to_owned());
    assert_eq!(typed(text, false, "Line 1", "Line 1234"), ("Line 1".to_owned(), why));
    assert_eq!(typed(text, true, "Line 1", "Nr. 7").1, Err("write and verify".to_owned()), "it is asked again");
}

#[test]
fn a_clock_offers_no_text_and_is_set_when_it_is_written() {
    let sv = Fixture::normal().tag("TIC-1.SV");
    let shown = "2001-01-01 00:00:00";
    let sent = |text: &str| Ok(CommandKind::WriteText { tag: sv, text: text.into(), seen: Some(shown.into()) });
    let clock = DataType::Clock(Clock::Bcd);
    assert_eq!(typed(clock, false, shown, "now"), (String::new(), sent("now")));
    assert_eq!(typed(clock, false, shown, "2026-11-30 14:05"), (String::new(), sent("2026-11-30 14:05")));
    let why = "expected a date and time such as 2026-11-30 14:05:00, or now".to_owned();
    assert_eq!(typed(clock, false, shown, "14:05"), (String::new(), Err(why)));
}

#[test]
fn a_text_that_changes_while_another_is_typed_is_shown_first() {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    fixture.def.tags[sv.index()].point.kind = DataType::Text(8);
    let shown = |text: &str| {
        let mut snapshot = (*fixture.snapshot()).clone();
        Arc::make_mut(&mut snapshot.texts)[sv.index()] = Some(text.into());
        snapshot
    };
    let entry = with_cx(&shown("Line 1"), |cx| Entry::new(cx, sv));
    let enter = |entry: Entry| with_cx(&shown("Line 9"), |cx| entry.on_key(cx, press(KeyCode::Enter)));
    let Next::Stay(Modal::Entry(entry)) = enter(entry) else { panic!("it is asked again") };
    assert_eq!(entry.problem.as_deref(), Some("changed to Line 9 (was Line 1); ⏎ writes all the same"));
    let Next::Do(actions) = enter(entry) else { panic!("it is written") };
    let seen = Some("Line 9".into());
    let kind = CommandKind::WriteText { tag: sv, text: "Line 1".into(), seen };
    assert!(matches!(&actions[..], [UiAction::SendCommand(command, None)] if command.kind == kind), "{actions:?}");
}
