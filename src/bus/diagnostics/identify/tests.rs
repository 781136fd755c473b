//! The identification of devices that say more, less and the same again.

use std::cell::RefCell;

use super::super::tests::run;
use crate::{
    bus::frame,
    plant::{
        diagnostics::{Diagnostic, DiagnosticRun, Finding},
        fault::{ExceptionCode, Fault},
        line::Framing,
    },
};

/// What a device is asked for, as read code and object, and what is found.
fn identified(device: impl Fn(u8, u8) -> Result<Vec<u8>, Fault>) -> (Vec<(u8, u8)>, Vec<String>, DiagnosticRun) {
    let asked = RefCell::new(Vec::new());
    let found = run(Diagnostic::Identify { unit: 1 }, |request| {
        let &[_, 0x2B, 0x0E, code, object] = request else { return Err(Fault::Exception(ExceptionCode(1))) };
        asked.borrow_mut().push((code, object));
        let answer = device(code, object)?;
        // As the link does.
        frame::check_answer(Framing::Mbap, request, &answer).map(|()| answer)
    });
    let object = |finding: &Finding| match finding {
        Finding::Object { id: Some(id), text } => Some(format!("{id:02X} {text}")),
        _ => None,
    };
    let objects = found.findings.iter().filter_map(object).collect();
    (asked.into_inner(), objects, found)
}

/// An answer with these objects; `next` is where the list goes on.
fn list(code: u8, conformity: u8, next: Option<u8>, objects: &[(u8, &str)]) -> Result<Vec<u8>, Fault> {
    let more = if next.is_some() { 0xFF } else { 0 };
    let head = [1, 0x2B, 0x0E, code, conformity, more, next.unwrap_or(0), objects.len() as u8];
    let texts = objects.iter().flat_map(|(id, text)| [&[*id, text.len() as u8], text.as_bytes()].concat());
    Ok(head.into_iter().chain(texts).collect())
}

fn refused<T>(code: u8) -> Result<T, Fault> {
    Err(Fault::Exception(ExceptionCode(code)))
}

const ALL: [(u8, &str); 6] = [(0, "ACME"), (1, "PM"), (2, "1.0"), (4, "meter"), (0x80, "serial 0815"), (0x81, "red")];

/// A device with all of them, two at a time. It begins at 0 if it does not have what it is asked to begin with.
fn as_lists(conformity: u8, code: u8, object: u8) -> Result<Vec<u8>, Fault> {
    let last = [2, 6, 0xFF][usize::from(code) - 1];
    let begin = ALL.iter().position(|(id, _)| *id == object).unwrap_or(0);
    let left: Vec<(u8, &str)> = ALL[begin..].iter().filter(|(id, _)| *id <= last).copied().collect();
    list(code, conformity, left.get(2).map(|(id, _)| *id), &left[..left.len().min(2)])
}

const SIX: [&str; 6] = ["00 ACME", "01 PM", "02 1.0", "04 meter", "80 serial 0815", "81 red"];

#[test]
fn each_object_is_found_once_and_extended_ones_are_asked_for() {
    let (asked, objects, _) = identified(|code, object| as_lists(0x03, code, object));
    assert_eq!(objects, SIX);
    let unique: std::collections::BTreeSet<_> = asked.iter().collect();
    assert_eq!(unique.len(), asked.len(), "nothing is asked twice: {asked:02X?}");
    assert!(asked.contains(&(3, 0x80)) && !asked.iter().any(|(code, _)| *code == 4), "{asked:02X?}");
}

#[test]
fn a_device_that_gives_the_same_list_to_all_is_listed_once() {
    // Its level is basic: it gives single objects too, but answers them with its list.
    let (asked, objects, run) = identified(|code, _| list(code, 0x81, None, &[(1, "DRV-11"), (2, "V4.50")]));
    assert_eq!(objects, ["01 DRV-11", "02 V4.50"]);
    assert_eq!(asked, [(1, 0), (2, 3), (4, 0)]);
    let failed = run.findings.iter().filter(|finding| matches!(finding, Finding::Failed { .. })).count();
    assert_eq!(failed, 0, "what was only a question is no failure");
}

#[test]
fn what_no_list_gives_is_asked_for_one_by_one() {
    let single = |conformity: u8, object: u8| match ALL.iter().find(|(id, _)| *id == object) {
        Some(known) => list(4, conformity, None, &[*known]),
        None => refused(2),
    };
    let basic = |conformity: u8| {
        identified(move |code, object| match code {
            1 => as_lists(conformity, 1, object),
            4 => single(conformity, object),
            _ => refused(3),
        })
    };
    let (asked, objects, _) = basic(0x83);
    assert_eq!(objects, SIX);
    assert_eq!(asked.last(), Some(&(4, 0x82)), "until there is no more: {asked:02X?}");
    let (asked, objects, _) = basic(0x03);
    assert_eq!(objects, SIX[..3], "it says that it gives lists only");
    assert!(!asked.iter().any(|(code, _)| *code == 4), "{asked:02X?}");
    // Neither list nor function is refused by what refuses a read code.
    let (_, objects, _) = identified(|code, object| if code == 4 { single(0x83, object) } else { refused(3) });
    assert_eq!(objects, SIX);
}

#[test]
fn an_identification_always_ends() {
    // More at the same place, more at another, more of all.
    for next in [0, 3, 0x80] {
        let (asked, objects, _) = identified(|code, object| list(code, 3, Some(next), &[(object, "x")]));
        assert!(asked.len() < 10 && !objects.is_empty(), "{asked:02X?}");
    }
    let (asked, _, _) = identified(|code, object| list(code, 0x83, Some(object.wrapping_add(1)), &[(object, "x")]));
    assert!(asked.len() < 1_000, "{}", asked.len());
}

#[test]
fn a_device_silent_to_functions_it_does_not_know_is_there() {
    let asked = RefCell::new(Vec::new());
    let silent = run(Diagnostic::Identify { unit: 1 }, |request| {
        asked.borrow_mut().push(request[1]);
        if request[1] == 3 { Ok(vec![1, 3, 2, 0, 7]) } else { Err(Fault::Timeout) }
    });
    assert_eq!(*asked.borrow(), [0x2B, 0x11, 3]);
    let answered = |finding: &Finding| matches!(finding, Finding::Exchange(exchange) if exchange.outcome.is_ok());
    assert!(silent.findings.iter().any(answered), "{:?}", silent.findings);
}
