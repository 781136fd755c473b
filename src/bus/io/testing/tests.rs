//! Tools against devices on TCP: slow gateways, and devices that hear nothing at first.

use std::sync::Arc;

use jiff::Timestamp;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::Mutex,
};

use super::*;
use crate::plant::{
    command::CommandId,
    def::LineId,
    diagnostics::{Conclusion, Finding, Scan},
};

const UNITS: &[u8] = &[3, 17, 40];

/// A gateway to these units that takes one request at a time of all its connections, and has no patience of its own: dead units
/// cost `dead` and are refused with exception 0B, or with nothing where that is zero.
async fn gateway(
    mut stream: TcpStream,
    units: &[u8],
    one_at_a_time: Arc<Mutex<()>>,
    dead: Duration,
) -> std::io::Result<()> {
    loop {
        let mut frame = [0; 12];
        stream.read_exact(&mut frame).await?;
        let unit = frame[6];
        let _turn = one_at_a_time.lock().await;
        let answer: &[u8] = match units.contains(&unit) {
            true => &[0, 5, unit, 3, 2, 0, unit],
            false if dead.is_zero() => continue,
            false => {
                tokio::time::sleep(dead).await;
                &[0, 3, unit, 0x83, 0x0B]
            }
        };
        stream.write_all(&[&frame[..4], answer].concat()).await?;
    }
}

/// A line to such a gateway, which serves all connections or lets all but one wait.
async fn line_to(units: &'static [u8], dead: Duration, serves_all: bool) -> LineDef {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let port = listener.local_addr().expect("it listens").port();
    let turn = Arc::new(Mutex::new(()));
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let served = tokio::spawn(gateway(stream, units, turn.clone(), dead));
            if !serves_all {
                // How it ended is the business of the other side.
                let _ = served.await;
            }
        }
    });
    let timeout = Duration::from_millis(40);
    LineDef { timeout, ..LineDef::new(LineId(0), "line", Transport::tcp("127.0.0.1", port)) }
}

/// The units that a scan of 1 to 60 finds behind a gateway that is known not to be deaf.
async fn scanned(line: LineDef) -> Vec<u8> {
    let scan = Diagnostic::Scan(Scan { first: 1, last: 60, serials: Vec::new(), timeout: line.timeout });
    let job = Job::new(CommandId::default(), "test".into(), scan, Timestamp::UNIX_EPOCH);
    let mut bench = Bench::new(&line);
    bench.hearing.hear(None);
    let run = bench.run(job, |_| true).await;
    assert_eq!((run.done, &run.state), (60, &DiagnosticState::Done));
    let unit = |finding: &Finding| if let Finding::Unit { unit, .. } = finding { Some(*unit) } else { None };
    run.findings.iter().filter_map(unit).collect()
}

#[tokio::test]
async fn a_wide_scan_misses_no_unit_behind_a_slow_gateway() {
    assert_eq!(scanned(line_to(UNITS, Duration::ZERO, true).await).await, UNITS);
    // Sixteen at once take longer than the timeout: the answers come late.
    assert_eq!(scanned(line_to(UNITS, Duration::from_millis(10), true).await).await, UNITS);
}

#[tokio::test]
async fn a_wide_scan_misses_no_unit_behind_one_served_connection() {
    for units in [UNITS, &[40]] {
        assert_eq!(scanned(line_to(units, Duration::ZERO, false).await).await, units);
    }
}

#[tokio::test]
async fn a_unit_that_is_asked_late_and_answers_is_not_called_deaf() {
    let mut connection = open(&line_to(UNITS, Duration::ZERO, true).await).await.expect("it accepts");
    connection.opened -= 2 * DEAF_MAX;
    let read = Diagnostic::Read { unit: 3, table: crate::plant::tag::Table::Holding, address: 0, count: 1 };
    let job = Job::new(CommandId::default(), "test".into(), read, Timestamp::UNIX_EPOCH);
    let (step, hearing) = (job.next().cloned().expect("a request"), Hearing::default());
    let (result, _) = connection.step(&hearing, &step).await.expect("it stays open");
    assert!(matches!(result, StepResult::Answer(Ok(_), _)), "{result:?}");
    assert_eq!(hearing.deaf_for(), None);
}

/// A device with unit 1 that loses the first requests of each connection, or answers them all.
async fn deaf(mut stream: TcpStream, lost: u32, framing: Framing) -> std::io::Result<()> {
    let length = if framing == Framing::Mbap { 12 } else { 8 };
    let mut asked = 0;
    loop {
        let mut frame = vec![0; length];
        stream.read_exact(&mut frame).await?;
        let request = frame::unwrap(framing, &frame).expect("a whole request");
        asked += 1;
        if request[0] != 1 || asked <= lost {
            continue;
        }
        let answer = if request[1] == 3 { vec![1, 3, 2, 0, 7] } else { vec![1, request[1] | 0x80, 1] };
        let transaction = u16::from_be_bytes([frame[0], frame[1]]);
        stream.write_all(&frame::wrap(framing, transaction, &answer)).await?;
    }
}

/// Runs a diagnostic against such a device; what was found, and on how many connections.
async fn at_deaf(diagnostic: Diagnostic, lost: u32, framing: Framing) -> (Vec<Finding>, usize) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let port = listener.local_addr().expect("it listens").port();
    let connections = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let count = connections.clone();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            tokio::spawn(deaf(stream, lost, framing));
        }
    });
    let transport =
        Transport::Network { protocol: crate::plant::def::Protocol::Tcp, host: "127.0.0.1".into(), port, framing };
    let line = LineDef { timeout: Duration::from_millis(60), ..LineDef::new(LineId(0), "line", transport) };
    let job = Job::new(CommandId::default(), "test".into(), diagnostic, Timestamp::UNIX_EPOCH);
    let run = Bench::new(&line).run(job, |_| true).await;
    assert_eq!(run.state, DiagnosticState::Done);
    (run.findings, connections.load(std::sync::atomic::Ordering::Relaxed))
}

#[tokio::test]
async fn a_device_that_is_deaf_after_connect_is_found_and_named() {
    let read = || Diagnostic::Read { unit: 1, table: crate::plant::tag::Table::Holding, address: 0, count: 1 };
    let scan = || Scan { first: 1, last: 3, serials: Vec::new(), timeout: Duration::from_millis(60) };
    let is_deaf = |finding: &Finding| matches!(finding, Finding::Conclusion(Conclusion::Deaf(_)));
    for framing in [Framing::Mbap, Framing::Rtu] {
        let bytes = || Diagnostic::Send(frame::wrap(framing, 1, &[1, 3, 0, 0, 0, 1]));
        for (diagnostic, most) in [(read(), 1), (bytes(), 1), (Diagnostic::Scan(scan()), 3)] {
            let (found, connections) = at_deaf(diagnostic.clone(), 3, framing).await;
            let answers = |finding: &Finding| match finding {
                Finding::Values { .. } | Finding::Unit { unit: 1, .. } => true,
                Finding::Bytes { bytes, .. } => !bytes.is_empty(),
                _ => false,
            };
            assert!(found.iter().any(answers), "{framing:?} {diagnostic:?}: {found:?}");
            assert!(found.iter().any(is_deaf), "{framing:?} {diagnostic:?}: {found:?}");
            assert!(connections <= most, "{framing:?} {diagnostic:?}: {connections} connections");
            let (found, _) = at_deaf(diagnostic, 0, framing).await;
            assert!(found.iter().any(answers) && !found.iter().any(is_deaf), "{framing:?}: {found:?}");
        }
    }
}

#[tokio::test]
async fn what_changes_something_is_never_sent_twice() {
    let write = frame::with_mbap(1, &[1, 6, 0, 0, 0, 1]);
    let (found, _) = at_deaf(Diagnostic::Send(write), 1, Framing::Mbap).await;
    assert_eq!(found, [Finding::Bytes { bytes: Vec::new(), response_time: None }], "a second one would be answered");
}

#[tokio::test]
async fn a_connection_that_the_other_side_closes_is_called_closed() {
    for framing in [Framing::Mbap, Framing::Rtu, Framing::Ascii] {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let port = listener.local_addr().expect("it listens").port();
        tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                let _ = stream.read(&mut [0; 64]).await;
            }
        });
        let transport =
            Transport::Network { protocol: crate::plant::def::Protocol::Tcp, host: "127.0.0.1".into(), port, framing };
        let line = LineDef::new(LineId(0), "line", transport);
        for diagnostic in [
            Diagnostic::Read { unit: 1, table: crate::plant::tag::Table::Holding, address: 0, count: 1 },
            Diagnostic::Loopback { unit: 1, data: 0xA55A, count: 20 },
            Diagnostic::Send(frame::wrap(framing, 1, &[1, 3, 0, 0, 0, 1])),
            Diagnostic::Scan(Scan { first: 1, last: 3, serials: Vec::new(), timeout: line.timeout }),
        ] {
            let job = Job::new(CommandId::default(), "test".into(), diagnostic.clone(), Timestamp::UNIX_EPOCH);
            let run = Bench::new(&line).run(job, |_| true).await;
            assert_eq!(run.state, DiagnosticState::Failed(LineTrouble::Closed), "{framing:?} {diagnostic:?}");
        }
    }
}
