//! Writes without a plant file: sent once, read back, cut short.

use super::*;
use crate::plant::{
    data_type::Clock,
    tag::{ByteOrder, DataType, Point},
    tag_value::TagValue,
};

/// Runs a write of 601 over 700 against a register; the outcome, and how often a write was sent.
fn written(held: &std::cell::Cell<u16>, on_write: impl Fn(u16) -> Result<(), Fault>) -> (Outcome, u32) {
    let write = RegisterWrite::holding(1_002, 700, 601);
    let sent = std::cell::Cell::new(0);
    let done = run(Diagnostic::Write(write), |request| match request[1] {
        3 => Ok([&[1, 3, 2][..], &held.get().to_be_bytes()].concat()),
        6 => {
            assert_eq!(request, [1, 6, 0x03, 0xEA, 0x02, 0x59]);
            sent.set(sent.get() + 1);
            on_write(601).map(|()| request.to_vec())
        }
        _ => Err(Fault::Exception(ExceptionCode(1))),
    });
    let outcome = done.findings.iter().find_map(|finding| match finding {
        Finding::Written(outcome) => Some(outcome.clone()),
        _ => None,
    });
    (outcome.expect("a write ends with its outcome"), sent.get())
}

#[test]
fn a_write_is_sent_once_and_read_back() {
    let held = std::cell::Cell::new(700);
    let obeys = |word| {
        held.set(word);
        Ok(())
    };
    assert_eq!(written(&held, obeys), (Outcome::Verified, 1));
    held.set(702);
    let changed = Outcome::Refused(Refusal::ChangedTo("702".to_owned()));
    assert_eq!(written(&held, obeys), (changed, 0), "another value than the one that was seen");
    held.set(700);
    let refused = Outcome::Refused(Refusal::Exception(ExceptionCode(3)));
    assert_eq!(written(&held, |_| Err(Fault::Exception(ExceptionCode(3)))), (refused, 1));
    let differs = Outcome::NotConfirmed(NotConfirmed::Different(700.0.into()));
    assert_eq!(written(&held, |_| Ok(())), (differs, 1), "accepted and not done");
    let silent = Outcome::NotConfirmed(NotConfirmed::NotApplied(Fault::Timeout, 700.0.into()));
    assert_eq!(written(&held, |_| Err(Fault::Timeout)), (silent, 1), "never repeated");
    let late = |word| {
        held.set(word);
        Err(Fault::Timeout)
    };
    assert_eq!(written(&held, late), (Outcome::Verified, 1), "what it holds counts, not what it said");
    let same = RegisterWrite::holding(5, 7, 7);
    let done = run(Diagnostic::Write(same), |request| match request[1] {
        3 => Ok(vec![1, 3, 2, 0, 7]),
        _ => Err(Fault::Timeout),
    });
    let unknown = Finding::Written(Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)));
    assert!(done.findings.contains(&unknown), "the same value as before proves nothing: {:?}", done.findings);
}

#[test]
fn a_write_that_is_cut_short_says_what_is_known_of_it() {
    let lost = DiagnosticState::Failed(LineTrouble::NotConnected);
    let not_confirmed = |why| Outcome::NotConfirmed(why);
    let read = || Ok(vec![1, 3, 2, 0x02, 0xBC]);
    for (answers, state, expect) in [
        (vec![], lost.clone(), Outcome::Refused(Refusal::NotSent(Fault::NotConnected))),
        (vec![read()], lost.clone(), not_confirmed(NotConfirmed::NotAnswered(Fault::NotConnected))),
        (vec![read()], DiagnosticState::Cancelled, not_confirmed(NotConfirmed::NotAnswered(Fault::Timeout))),
        (vec![read(), Ok(vec![1, 6])], lost.clone(), not_confirmed(NotConfirmed::NotRead(Fault::NotConnected))),
        (vec![read(), Err(Fault::Hangup)], lost, not_confirmed(NotConfirmed::NotAnswered(Fault::Hangup))),
    ] {
        let write = Diagnostic::Write(RegisterWrite::holding(1_002, 700, 601));
        let mut job = Job::new(CommandId { terminal: 1, number: 1 }, "anna".into(), write, Timestamp::UNIX_EPOCH);
        answers.into_iter().for_each(|answer| job.on_result(answered(answer)));
        job.stop(state);
        assert_eq!(job.run().findings.last(), Some(&Finding::Written(expect.clone())));
        assert!(job.run().outcome_text().ends_with(&expect.to_string()), "{}", job.run().outcome_text());
    }
}

#[test]
fn a_clock_is_set_over_whatever_it_shows_and_goes_on() {
    let point = Point {
        table: Table::Holding,
        address: 50,
        kind: DataType::Clock(Clock::Bytes),
        order: ByteOrder::Abcd,
        field: None,
    };
    let check = |shown: [u16; 3], expect: Outcome| {
        let write = RegisterWrite {
            words: vec![0x1A0B, 0x1C11, 0x031D],
            expected: vec![0x1A01, 0x0101, 0x0101],
            clock: Some(point),
            ..RegisterWrite::holding(50, 0, 0)
        };
        let held = std::cell::Cell::new([0x1A01, 0x0101, 0x0109]);
        let done = run(Diagnostic::Write(write), |request| match request[1] {
            3 => Ok([vec![1, 3, 6], held.get().into_iter().flat_map(u16::to_be_bytes).collect()].concat()),
            _ => {
                held.set(shown);
                Ok(request[..6].to_vec())
            }
        });
        assert!(done.findings.contains(&Finding::Written(expect)), "{:?}", done.findings);
    };
    check([0x1A0B, 0x1C11, 0x031D], Outcome::Verified);
    check([0x1A0B, 0x1C11, 0x031E], Outcome::Verified);
    let earlier = TagValue::Text("6667 7185 796".into());
    check([0x1A0B, 0x1C11, 0x031C], Outcome::NotConfirmed(NotConfirmed::Different(earlier)));
}

#[test]
fn writes_of_several_and_of_bits_have_their_functions() {
    let sent = std::cell::RefCell::new(Vec::new());
    let write = |table, words: Vec<u16>, multiple| {
        let expected = vec![0; words.len()];
        let write =
            RegisterWrite { unit: 1, table, address: 5, words, expected: expected.clone(), multiple, clock: None };
        run(Diagnostic::Write(write), |request| match request[1] {
            1 => Ok(vec![1, 1, 2, 0, 0]),
            3 => Ok([vec![1, 3, 2 * expected.len() as u8], vec![0; 2 * expected.len()]].concat()),
            _ => {
                sent.borrow_mut().push(request.to_vec());
                Err(Fault::Timeout)
            }
        });
        sent.borrow_mut().pop().unwrap_or_default()
    };
    assert_eq!(write(Table::Holding, vec![1, 2], false), [1, 16, 0, 5, 0, 2, 4, 0, 1, 0, 2]);
    assert_eq!(write(Table::Holding, vec![7], true), [1, 16, 0, 5, 0, 1, 2, 0, 7]);
    assert_eq!(write(Table::Coil, vec![1, 0, 1, 1, 0, 0, 0, 0, 1], false), [1, 15, 0, 5, 0, 9, 2, 0x0D, 0x01]);
}
