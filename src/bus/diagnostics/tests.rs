//! Diagnostics against a device that is a function from request to response.

use super::*;
use crate::plant::{
    command::{NotConfirmed, Outcome, Refusal},
    def::Framing,
    fault::ExceptionCode,
    line_trouble::LineTrouble,
    tag::{ByteOrder, DataType, Point},
    tag_value::TagValue,
};
use crate::{
    bus::names,
    plant::{
        data_type::Clock,
        diagnostics::{PatternTally, Scan},
        port_signals::SignalTest,
    },
};

/// Runs a diagnostic against a device given as a function from request to answer.
pub(super) fn run(diagnostic: Diagnostic, device: impl Fn(&[u8]) -> Result<Vec<u8>, Fault>) -> DiagnosticRun {
    let id = CommandId { terminal: 1, number: 1 };
    let mut job = Job::new(id, "anna".into(), diagnostic, Timestamp::UNIX_EPOCH);
    for _ in 0..10_000 {
        let Some(next) = job.next() else { return job.run().clone() };
        let result = match next.ask.clone() {
            Ask::Raw(bytes) => StepResult::Bytes(bytes, Some(Duration::from_millis(1))),
            Ask::Hold(..) | Ask::PutBack => panic!("no diagnostic of these tests sets a signal"),
            Ask::Message(request) => answered(device(&request)),
        };
        job.on_result(result);
    }
    panic!("it never ends")
}

fn verdict(run: &DiagnosticRun) -> String {
    match run.findings.last() {
        Some(Finding::Conclusion(conclusion)) => conclusion.to_string(),
        other => panic!("no verdict but {other:?}"),
    }
}

#[test]
fn a_scan_finds_who_answers_and_who_refuses() {
    let scan = Scan { first: 1, last: 20, serials: vec![], timeout: Duration::from_millis(100) };
    let found = run(Diagnostic::Scan(scan), |request| match request[0] {
        3 => Ok(vec![3, 3, 2, 0, 77]),
        17 => Err(Fault::Exception(ExceptionCode(2))),
        18 => Err(Fault::Exception(ExceptionCode(0x0B))),
        _ => Err(Fault::Timeout),
    });
    assert_eq!((found.done, found.total, &found.state), (20, 20, &DiagnosticState::Done));
    let units: Vec<_> = found
        .findings
        .iter()
        .filter_map(|finding| match finding {
            Finding::Unit { unit, reply, .. } => Some((*unit, reply.to_string(), reply.register())),
            _ => None,
        })
        .collect();
    let [register, refused] = ["register 0 = 77", "exception 02, illegal data address"].map(str::to_owned);
    assert_eq!(units, [(3, register, Some(77)), (17, refused, None)]);
    assert_eq!(verdict(&found), "2 answers");
}

#[test]
fn a_scan_over_several_settings_needs_the_line_for_itself() {
    let serials = vec![Serial::USUAL, Serial { baud: 19_200, ..Serial::USUAL }];
    let scan = Scan { first: 1, last: 3, serials, timeout: Duration::from_millis(100) };
    let job =
        Job::new(CommandId { terminal: 1, number: 1 }, "anna".into(), Diagnostic::Scan(scan), Timestamp::UNIX_EPOCH);
    assert!(job.is_exclusive());
    assert_eq!(job.run().total, 6);
}

#[test]
fn a_foreign_unit_that_chatters_is_not_every_unit() {
    let scan = |last| {
        let diagnostic =
            Diagnostic::Scan(Scan { first: 1, last, serials: vec![], timeout: Duration::from_millis(100) });
        run(diagnostic, |request| match request[0] {
            2 => Ok(vec![2, 3, 2, 0, 77]),
            asked => Err(Fault::WrongUnit { got: 99, asked }),
        })
    };
    let units = |run: &DiagnosticRun| run.findings.iter().filter(|found| matches!(found, Finding::Unit { .. })).count();
    assert_eq!(units(&scan(4)), 4, "a few may be units with other settings");
    let many = scan(20);
    assert_eq!((units(&many), verdict(&many).as_str()), (1, "1 answer"));
    let text = many.findings.iter().find_map(|finding| match finding {
        Finding::Failed { what, .. } => Some(what.to_string()),
        _ => None,
    });
    assert_eq!(text.as_deref(), Some("19 addresses: something else talks on this line"));
}

#[test]
fn loopbacks_are_counted() {
    let diagnostic = Diagnostic::Loopback { unit: 1, data: 0xA537, count: 3 };
    let all = run(diagnostic.clone(), |request| Ok(request.to_vec()));
    assert_eq!(verdict(&all), "3 of 3 came back, 12.0 to 12.0 ms");
    let none = run(diagnostic, |_| Err(Fault::Timeout));
    assert_eq!(verdict(&none), "none of 3 came back");
    let diagnostic = Diagnostic::Loopback { unit: 1, data: 0, count: 3 };
    let without = run(diagnostic, |_| Err(Fault::Exception(ExceptionCode(1))));
    assert!(verdict(&without).starts_with("the unit responds"), "{}", verdict(&without));
}

#[test]
fn patterns_are_counted_and_a_plug_is_recognised() {
    let plug = run(Diagnostic::Pattern { bits: 8, count: 6 }, |_| Err(Fault::Timeout));
    assert!(verdict(&plug).starts_with("every byte came back"), "{}", verdict(&plug));
    let total = PatternTally { sent: 192, received: 192, ..PatternTally::default() };
    let words = "192 bytes sent, 192 received: 0 wrong, 0 missing, 0 more than sent; 0.0 % faults";
    assert_eq!(total.to_string(), words);
    let total = Finding::Conclusion(Conclusion::Patterns(total));
    assert_eq!((plug.done, plug.findings.contains(&total)), (6, true), "{:?}", plug.findings);
}

#[test]
fn an_identification_in_pieces_is_asked_to_its_end() {
    let objects = ["ACME", "PM", "1.0", "http://acme.example"];
    let found = run(Diagnostic::Identify { unit: 1 }, |request| {
        let (code, id) = (request[3], usize::from(request[4]));
        let Some(text) = objects.get(id).filter(|_| code == 1 || 3 <= id) else {
            return Err(Fault::Exception(ExceptionCode(2)));
        };
        let last = id == if code == 1 { 2 } else { 3 };
        let more = if last { [0, 0] } else { [0xFF, id as u8 + 1] };
        let head = [1, 0x2B, 0x0E, code, 0x82, more[0], more[1], 1, id as u8, text.len() as u8];
        Ok(head.into_iter().chain(text.bytes()).collect())
    });
    let names: Vec<_> = found
        .findings
        .iter()
        .filter_map(|finding| match finding {
            Finding::Object { id, text } => Some(format!("{} {text}", names::identity(*id))),
            _ => None,
        })
        .collect();
    assert_eq!(names, ["VendorName ACME", "ProductCode PM", "MajorMinorRevision 1.0", "VendorUrl http://acme.example"]);
}

#[test]
fn a_device_without_identification_is_asked_for_its_server_id() {
    let found = run(Diagnostic::Identify { unit: 1 }, |request| match request[1] {
        0x11 => Ok(vec![1, 0x11, 3, b'X', 0xFF, b'Y']),
        _ => Err(Fault::Exception(ExceptionCode(1))),
    });
    let server = Finding::Object { id: None, text: "X\\xFFY".into() };
    assert!(found.findings.contains(&server), "{:?}", found.findings);
}

#[test]
fn a_block_with_a_hole_is_read_register_by_register() {
    let diagnostic = Diagnostic::Read { unit: 1, table: Table::Holding, address: 10, count: 3 };
    let found = run(diagnostic, |request| {
        let (first, count) = (u16::from(request[3]), u16::from(request[5]));
        if (first..first + count).contains(&11) {
            return Err(Fault::Exception(ExceptionCode(2)));
        }
        Ok([1, 3, 2 * count as u8].into_iter().chain((first..first + count).flat_map(u16::to_be_bytes)).collect())
    });
    let read: Vec<_> = found
        .findings
        .iter()
        .filter_map(|finding| match finding {
            Finding::Values { address, words, .. } => Some((*address, words.clone())),
            _ => None,
        })
        .collect();
    assert_eq!(read, [(10, vec![10]), (12, vec![12])]);
    assert_eq!((found.done, found.total), (4, 4));
}

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

/// The result of a step that was answered so.
fn answered(answer: Result<Vec<u8>, Fault>) -> StepResult {
    let exchange = Exchange {
        at: Timestamp::UNIX_EPOCH,
        framing: Framing::Mbap,
        outcome: answer.as_ref().map(drop).map_err(|fault| *fault),
        answer: answer.clone().unwrap_or_default().into(),
        request: Vec::new().into(),
        response_time: answer.is_ok().then_some(Duration::from_millis(12)),
        tries: 1,
    };
    StepResult::Answer(answer, Arc::new(exchange))
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

/// Runs a signal test on a port given as a function from what is asked to how its signals stand then.
fn with_signals(test: SignalTest, port: impl Fn(&Ask) -> Result<u32, LineTrouble>) -> DiagnosticRun {
    let id = CommandId { terminal: 1, number: 1 };
    let mut job = Job::new(id, "anna".into(), Diagnostic::Signal(test), Timestamp::UNIX_EPOCH);
    assert!(job.is_exclusive(), "nothing is polled meanwhile");
    while let Some(step) = job.next().cloned() {
        job.on_result(StepResult::Signals(port(&step.ask).map(PortSignals)));
    }
    job.run().clone()
}

#[test]
fn a_signal_is_held_put_back_and_what_followed_is_said() {
    let (rts, cts, dsr) = (0x004, 0x020, 0x100);
    let test = SignalTest { signal: OutputSignal::Rts, on: false, seconds: 2 };
    let joined = with_signals(test, |ask| match ask {
        Ask::Hold(OutputSignal::Rts, false) => Ok(dsr),
        Ask::PutBack => Ok(rts | cts | dsr),
        other => panic!("it sets nothing else: {other:?}"),
    });
    assert_eq!((joined.done, joined.total, &joined.state), (9, 9, &DiagnosticState::Done));
    let ms = Duration::from_millis;
    let at = |after, bits| Finding::Signals { after, signals: PortSignals(bits) };
    assert_eq!(joined.findings[..2], [at(ms(250), dsr), at(ms(2_000), rts | cts | dsr)], "only what is new");
    assert_eq!(verdict(&joined), "RTS was set and put back; with it changed CTS");
    let open = with_signals(test, |ask| Ok(if *ask == Ask::PutBack { rts } else { 0 }));
    assert_eq!(verdict(&open), "RTS was set and put back; no input changed with it");
    let stuck = with_signals(test, |_| Ok(rts));
    assert_eq!(verdict(&stuck), "the port did not set RTS: its driver or adapter has no such output");
}

#[test]
fn a_port_without_signals_ends_the_test_with_the_reason() {
    let test = SignalTest { signal: OutputSignal::Dtr, on: true, seconds: 60 };
    let run = with_signals(test, |_| Err(LineTrouble::NoSignals));
    assert_eq!((run.done, run.state), (1, DiagnosticState::Failed(LineTrouble::NoSignals)));
    assert_eq!(run.findings, []);
}

#[test]
fn the_outcome_of_a_test_counts_its_requests_and_errors() {
    let timeout = |_: &[u8]| Err(Fault::Timeout);
    let refuses = |code| move |_: &[u8]| Err(Fault::Exception(ExceptionCode(code)));
    let echo = |request: &[u8]| Ok(request.to_vec());
    let loopback = Diagnostic::Loopback { unit: 1, data: 0, count: 2 };
    let read = Diagnostic::Read { unit: 1, table: Table::Holding, address: 0, count: 1 };
    let scan = Diagnostic::Scan(Scan { first: 1, last: 3, serials: vec![], timeout: Duration::from_millis(100) });
    let zero = |_: &[u8]| Ok(vec![1, 3, 2, 0, 0]);
    let identify = Diagnostic::Identify { unit: 1 };
    let server = |request: &[u8]| match request[1] {
        0x11 => Ok(vec![1, 0x11, 2, b'X', 0xFF]),
        _ => Err(Fault::Exception(ExceptionCode(1))),
    };
    let write = Diagnostic::Write(RegisterWrite::holding(5, 1, 2));
    let outcomes = [
        run(loopback.clone(), echo),
        run(loopback, timeout),
        run(read.clone(), zero),
        run(read, refuses(2)),
        run(scan.clone(), refuses(1)),
        run(scan, timeout),
        run(identify.clone(), server),
        run(identify, timeout),
        run(write, zero),
        run(Diagnostic::Pattern { bits: 8, count: 4 }, timeout),
    ];
    let texts = outcomes.map(|run| run.outcome_text());
    let expected = [
        "passed: 3 requests, no errors; 2 of 2 came back, 12.0 to 12.0 ms",
        "failed: 3 requests, 2 errors; none of 2 came back",
        "passed: 1 request, no errors",
        "failed: 1 request, 1 error; exception 02, illegal data address",
        "passed: 3 requests, no errors; 3 answers",
        "failed: 3 requests, no errors; no unit answers within 100 ms",
        "passed: 2 requests, no errors",
        "failed: 3 requests, 3 errors; response timeout",
        "failed: 1 request, no errors; refused: it was changed to 0 after it was shown",
        "passed: 4 requests, no errors; 128 bytes sent, 128 received: 0 wrong, 0 missing, 0 more than sent; 0.0 % faults",
    ];
    assert_eq!(texts.each_ref().map(String::as_str), expected);
    let test = SignalTest { signal: OutputSignal::Rts, on: false, seconds: 1 };
    let put_back = with_signals(test, |ask| Ok(if *ask == Ask::PutBack { 0x004 } else { 0 }));
    assert_eq!(put_back.outcome_text(), "passed: RTS was set and put back; no input changed with it");
    assert!(with_signals(test, |_| Ok(0x004)).outcome_text().starts_with("failed: the port did not set RTS"));
}

#[test]
fn what_cannot_be_printed_of_a_device_is_in_hexadecimal() {
    assert_eq!(text_of(b"PXR ~\x7F\x1F\xB0"), "PXR ~\\x7F\\x1F\\xB0");
}
