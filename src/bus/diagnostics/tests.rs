//! Diagnostics against a device that is a function from request to response.

mod writes;

use super::*;
use crate::plant::{
    command::{NotConfirmed, Outcome, Refusal},
    def::Framing,
    fault::ExceptionCode,
    line_trouble::LineTrouble,
};
use crate::{
    bus::names,
    plant::{
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
