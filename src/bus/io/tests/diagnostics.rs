//! Line running diagnostic on a line that is polled, or alone on it.

use std::time::Duration;

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    time::Instant,
};

use super::slave::{Line, MS, Mode, SlaveAction, line, plant, until_silent};
use crate::plant::{
    command::{BusRequest, CommandId, WriteId, WriteJob},
    def::{Serial, TagId},
    diagnostics::{Diagnostic, DiagnosticState, Finding, Scan},
    event::{Event, WriteResult},
    line_state::LineState,
    line_trouble::LineTrouble,
    port_signals::{OutputSignal, SignalTest},
};

pub async fn start(line: &Line, diagnostic: Diagnostic) {
    let id = CommandId { terminal: 1, number: 1 };
    line.requests.send(BusRequest::Test { id, by: "anna".into(), diagnostic }).await.expect("the line runs");
}

#[tokio::test(start_paused = true)]
async fn a_line_can_be_closed_while_a_scan_has_it_for_itself() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    line.read(&def).await;
    line.plug(Mode::Rtu, |_, _| SlaveAction::Silent);
    let serials = vec![Serial::USUAL, Serial { baud: 19_200, ..Serial::USUAL }];
    let diagnostic = Diagnostic::Scan(Scan { first: 1, last: 247, serials, timeout: 100 * MS });
    let (id, by) = (CommandId { terminal: 1, number: 1 }, "anna".into());
    line.requests.send(BusRequest::Test { id, by, diagnostic }).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Testing, .. }).then_some(())).await;
    line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Disconnected, .. }).then_some(())).await;
}

/// A port that has no signals: the line is back in service at once, and the operator sees why.
#[tokio::test(start_paused = true)]
async fn a_signal_test_without_signals_fails_and_polls_go_on() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    (0..3).for_each(|_| drop(line.plug(Mode::Rtu, |_, _| SlaveAction::Answer)));
    line.read(&def).await;
    start(&line, Diagnostic::Signal(SignalTest { signal: OutputSignal::Dtr, on: false, seconds: 10 })).await;
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Testing, .. }).then_some(())).await;
    let why = line
        .until(&def, |event| match event {
            Event::Diagnostic { run, .. } => match &run.state {
                DiagnosticState::Failed(why) => Some(why.clone()),
                _ => None,
            },
            _ => None,
        })
        .await;
    assert_eq!(why, LineTrouble::NoSignals);
    line.read(&def).await;
}

/// Bytes that are no request are sent as they are, and whatever comes back is reported.
#[tokio::test(start_paused = true)]
async fn nonsense_is_sent_and_nonsense_is_reported() {
    for mode in [Mode::Rtu, Mode::Tcp] {
        let def = plant(mode);
        let mut line = line(def.clone());
        let (ours, mut theirs) = tokio::io::duplex(4096);
        line.ports.try_send(ours).expect("room for a port");
        tokio::spawn(async move {
            let mut heard = [0; 64];
            while theirs.read(&mut heard).await.is_ok_and(|count| 0 < count) {
                let _ = theirs.write_all(&[0x55, 1, 2, 3, 0xAA, 0, 9]).await;
            }
        });
        let (id, by) = (CommandId { terminal: 1, number: 1 }, "anna".into());
        let diagnostic = Diagnostic::Send(vec![0xFF, 1, 2]);
        line.requests.send(BusRequest::Test { id, by, diagnostic }).await.expect("the line runs");
        let run = line
            .until(&def, |event| match event {
                Event::Diagnostic { run, .. } if run.state != DiagnosticState::Running => Some(run.clone()),
                _ => None,
            })
            .await;
        let is_byte = |found: &Finding| matches!(found, Finding::Bytes { bytes, .. } if bytes.ends_with(&[0, 9]));
        match mode {
            // The poll before it was answered by nonsense too: the stream is out of sync, and the test with it.
            Mode::Tcp => {
                let bytes = "55 01 02 03 AA 00 09".to_owned();
                assert_eq!(run.state, DiagnosticState::Failed(LineTrouble::NoFrame(bytes)))
            }
            _ => assert!(run.findings.iter().any(is_byte), "{mode:?}: {run:?}"),
        }
    }
}

/// Sends a stop while no unit answers a scan that waits ten seconds for each unit; gives how long it took, and how the scan ended.
async fn stop_during_scan(serials: Vec<Serial>) -> (Duration, WriteResult, DiagnosticState) {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let script = |_, message: &[u8]| if message[0] == 9 { SlaveAction::Silent } else { SlaveAction::Answer };
    line.plug(Mode::Rtu, script);
    line.read(&def).await;
    line.plug(Mode::Rtu, script);
    start(&line, Diagnostic::Scan(Scan { first: 9, last: 9, serials, timeout: Duration::from_secs(10) })).await;
    until_silent(&mut line, &def).await;
    line.plug(Mode::Rtu, script);
    let asked = Instant::now();
    let stop = BusRequest::Write(WriteJob {
        id: WriteId(1),
        tag: TagId(0),
        raw: 10.0.into(),
        unlock: None,
        verify: true,
        urgent: true,
        over: None,
        unscaled_by: None,
    });
    line.requests.send(stop).await.expect("the line runs");
    let (mut state, mut result) = (None, None);
    while result.is_none() {
        match line.next(&def).await {
            Event::Diagnostic { run, .. } => state = Some(run.state.clone()),
            Event::Wrote { result: ended, .. } => result = Some(ended),
            _ => {}
        }
    }
    (asked.elapsed(), result.expect("reported"), state.expect("reported"))
}

#[tokio::test(start_paused = true)]
async fn a_stop_cuts_a_scan_short_and_goes_out_at_once() {
    let other = Serial { baud: 19_200, ..Serial::USUAL };
    for serials in [Vec::new(), vec![other]] {
        let words = format!("{serials:?}");
        let (after, result, state) = stop_during_scan(serials).await;
        assert_eq!(result, WriteResult::ReadBack(10.0.into()), "{words}");
        assert!(after < 200 * MS, "{words}: after {after:?}");
        assert_eq!(state, DiagnosticState::Failed(LineTrouble::UrgentStop), "{words}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_test_that_waits_is_stopped_at_once() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| if message[0] == 9 { SlaveAction::Silent } else { SlaveAction::Answer });
    start(&line, Diagnostic::Scan(Scan { first: 9, last: 9, serials: Vec::new(), timeout: Duration::from_secs(10) }))
        .await;
    until_silent(&mut line, &def).await;
    let asked = Instant::now();
    line.requests.send(BusRequest::StopTest).await.expect("the line runs");
    let stopped = |event: &Event| match event {
        Event::Diagnostic { run, .. } => Some(run.state.clone()),
        _ => None,
    };
    assert_eq!(line.until(&def, stopped).await, DiagnosticState::Cancelled);
    assert!(asked.elapsed() < 200 * MS, "{:?}", asked.elapsed());
    // What was asked last may still be answered: every value is checked against its address.
    for _ in 0..10 {
        line.read(&def).await;
    }
}

/// A write that is no stop waits for the step, and is neither lost nor sent twice.
#[tokio::test(start_paused = true)]
async fn a_usual_write_waits_for_the_step_of_a_test() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| if message[0] == 9 { SlaveAction::Silent } else { SlaveAction::Answer });
    start(&line, Diagnostic::Scan(Scan { first: 9, last: 9, serials: Vec::new(), timeout: Duration::from_secs(10) }))
        .await;
    until_silent(&mut line, &def).await;
    let write = BusRequest::Write(WriteJob {
        id: WriteId(1),
        tag: TagId(0),
        raw: 10.0.into(),
        unlock: None,
        verify: true,
        urgent: false,
        over: None,
        unscaled_by: None,
    });
    line.requests.send(write).await.expect("the line runs");
    let mut done = None;
    let ended = |event: &Event| match event {
        Event::Diagnostic { run, .. } => {
            done = Some(run.state.clone());
            None
        }
        Event::Wrote { result, .. } => Some(result.clone()),
        _ => None,
    };
    assert_eq!(line.until(&def, ended).await, WriteResult::ReadBack(10.0.into()));
    assert_eq!(done, Some(DiagnosticState::Done));
}
