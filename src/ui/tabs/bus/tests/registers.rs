//! Page Registers: the window of the tab of that name, on a device of the plant.

use super::*;
use crate::{
    access::SessionStatus,
    plant::live::{LivePart, LiveRead, LiveReading},
    ui::QueryId,
};

fn asked(effects: Vec<Effect>) -> Option<(QueryId, LiveRead)> {
    effects.into_iter().find_map(|effect| match effect {
        Effect::Query(id, Query::Registers(read)) => Some((id, read)),
        _ => None,
    })
}

/// The page from 41003 on: 700, 701 and so on were read. What it asks next.
fn page() -> (Model, Option<(QueryId, LiveRead)>) {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "R");
    let (id, read) = asked(type_keys(&mut model, "j41003⏎")).expect("it is asked for");
    let span = read.spans[0];
    let part = LivePart { at: now(), span, words: Ok((0..span.count).map(|n| 700 + n).collect()) };
    let reading = LiveReading { began: now(), parts: vec![part], requests: 1, ..LiveReading::default() };
    let next = asked(update(&mut model, Msg::Answer(id, Ok(Answer::Registers(reading)))));
    (model, next)
}

#[test]
fn registers_of_the_device_are_read_live() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "");
    let (id, read) = asked(type_keys(&mut model, "R")).expect("it is asked for");
    assert_eq!((id.tab, read.line, read.unit, read.not_before), (Some(Tab::Bus), L1, 1, None));
    let (mut model, next) = page();
    assert!(next.is_some_and(|(_, read)| read.not_before.is_some()), "again, a period later");
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(format!("registers_{width}x{height}"), screen(&mut model, width, height));
    }
    assert!(asked(type_keys(&mut model, "w")).is_none() && model.modal.is_none(), "nothing is written here");
    let copied = model.tabs.shown().copied(&model.cx());
    assert!(copied[0].starts_with("41003 / 03EA\t02BC\t700\t"), "{copied:?}");
    type_keys(&mut model, "T");
    assert!(screen(&mut model, 80, 24).contains("‹Test›"));
}

#[test]
fn registers_are_not_read_without_the_right() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "");
    model.session = Arc::new(SessionStatus { who: None, ..SessionStatus::clone(&model.session) });
    let effects = type_keys(&mut model, "R");
    assert!(!effects.iter().any(|effect| matches!(effect, Effect::Query(_, Query::Registers(_)))), "{effects:?}");
    assert!(screen(&mut model, 80, 24).contains("needs Technician"));
}
