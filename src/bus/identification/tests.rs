//! When a device is asked what it is.

use std::sync::Arc;

use super::*;
use crate::plant::{
    expr::{Compare, Expr},
    fault::ExceptionCode,
    fixture,
    identity::IdentityTest,
};

const U1: DeviceId = DeviceId(0);
const FIRST: Option<(u8, u8)> = Some(identify::FIRST);

/// The first device has a tag only with this object.
fn asking(object: u8) -> Identification {
    let mut def = fixture::plant();
    let (object, compare) = (IdentityObject(object), Compare::AtLeast);
    let test = IdentityTest { device: U1, object, compare, with: "2".to_owned() };
    let tag = def.tags.iter_mut().find(|tag| tag.device == U1).expect("a tag");
    tag.when = Some(Arc::new(Expr::Identity(test)));
    Identification::new(&def, def.devices[0].line)
}

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a time")
}

fn due(identification: &Identification, second: i64) -> Option<(u8, u8)> {
    identification.due(at(second)).map(|(_, _, next)| next)
}

fn answer(code: u8, conformity: u8, objects: &[(u8, &str)]) -> Vec<u8> {
    let mut message = vec![1, 0x2B, 0x0E, code, conformity, 0, 0, objects.len() as u8];
    for (id, text) in objects {
        message.extend([&[*id, text.len() as u8], text.as_bytes()].concat());
    }
    message
}

#[test]
fn a_device_is_asked_once_it_answers_and_again_when_it_was_lost() {
    let mut all = asking(2);
    assert_eq!(due(&all, 5), None, "it has answered nothing");
    all.answered(U1, false, at(5));
    assert_eq!((due(&all, 5), all.from()), (FIRST, Some(at(5))));
    let said = all.on_outcome(U1, Ok(&answer(1, 1, &[(0, "A"), (1, "B"), (2, "2.10")])), at(6));
    assert!(said.is_some_and(|said| said.contains(&(IdentityObject(2), "2.10".to_owned()))));
    assert_eq!((due(&all, 3_000), due(&all, 3_606)), (None, FIRST), "it may be updated");
    all.answered(U1, false, at(7));
    assert_eq!(due(&all, 7), None, "it was not lost");
    all.lost(U1);
    assert_eq!(due(&all, 9_000), None, "it is not asked while it is silent");
    all.answered(U1, true, at(9));
    assert_eq!(due(&all, 9), FIRST);
    all.reopened(at(20));
    assert_eq!(due(&all, 20), None);
    all.answered(U1, false, at(21));
    assert_eq!(due(&all, 21), FIRST);
}

#[test]
fn no_more_is_asked_than_the_objects_that_count() {
    for (object, requests) in
        [(2, vec![(1, 0), (4, 2)]), (5, vec![(1, 0), (2, 3), (4, 5)]), (0x80, vec![(1, 0), (3, 0x80), (4, 0x80)])]
    {
        let mut all = asking(object);
        all.answered(U1, false, at(0));
        let mut asked = Vec::new();
        let said = loop {
            let (code, from) = due(&all, 0).expect("a request");
            asked.push((code, from));
            if let Some(said) = all.on_outcome(U1, Ok(&answer(code, 0x83, &[(0, "A")])), at(0)) {
                break said;
            }
        };
        assert_eq!((asked, said.len()), (requests, 1), "of object {object}");
    }
}

#[test]
fn a_list_that_never_ends_is_given_up() {
    let mut all = asking(0xFF);
    all.answered(U1, false, at(0));
    let mut count = 0;
    while let Some((code, from)) = due(&all, 0) {
        count += 1;
        let mut message = answer(code, 0x83, &[(from, "x")]);
        (message[5], message[6]) = (0xFF, from.wrapping_add(1));
        all.on_outcome(U1, Ok(&message), at(0));
    }
    assert!((2..=12).contains(&count), "{count}");
}

#[test]
fn a_refusal_is_final_and_silence_is_tried_three_times() {
    let refused = Fault::Exception(ExceptionCode::ILLEGAL_FUNCTION);
    let mut all = asking(2);
    all.answered(U1, false, at(0));
    assert_eq!(all.on_outcome(U1, Err(refused), at(1)), Some(Vec::new()));
    assert_eq!(due(&all, 3_000), None);
    all.reopened(at(3_000));
    all.answered(U1, false, at(3_000));
    for (silent, next) in [(3_000, 3_001), (3_001, 3_003), (3_003, 6_603)] {
        assert_eq!(due(&all, silent), FIRST);
        assert_eq!(all.on_outcome(U1, Err(Fault::Timeout), at(silent)), None);
        assert_eq!((due(&all, next - 1), due(&all, next)), (None, FIRST), "after {silent}");
    }
}

#[test]
fn what_ends_connections_is_not_asked_on_each_of_them() {
    let mut all = asking(2);
    for second in 0..2 {
        all.reopened(at(second));
        all.answered(U1, false, at(second));
        assert_eq!(due(&all, second), FIRST);
        all.hung_up(U1, at(second));
    }
    all.reopened(at(2));
    all.answered(U1, false, at(2));
    assert_eq!((due(&all, 3_000), due(&all, 3_601)), (None, FIRST));
}

#[test]
fn a_connection_after_another_asks_once_a_minute() {
    let mut all = asking(2);
    all.answered(U1, false, at(0));
    all.on_outcome(U1, Ok(&answer(1, 1, &[(2, "2.10")])), at(0));
    all.goes_on();
    assert_eq!((due(&all, 59), due(&all, 60)), (None, FIRST));
}
