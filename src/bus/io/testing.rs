//! Carries the steps of a line diagnostic over a link.

use std::{cell::RefCell, collections::VecDeque, time::Duration};

use futures_util::future::join_all;

use super::{
    clock::Clock,
    link::{Link, LinkError},
    memory::LineMemory,
    transport::Connector,
};
use crate::{
    bus::diagnostics::{Ask, Job, Step, StepResult},
    plant::{
        def::{Framing, LineDef, Transport},
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState},
        event::Fault,
    },
};

/// Connections of a scan over Modbus TCP, each with one request under way: servers that take several requests of one
/// connection at once are few.
pub const SCAN_CONNECTIONS: usize = 16;
/// A gateway has so long to work off what it was asked at once.
const WORK_OFF_MAX: Duration = Duration::from_secs(30);

/// A scan over several connections.
struct WideScan<'a> {
    steps: &'a [Step],
    results: Vec<Option<StepResult>>,
    begun: usize,
    /// Answers came late: what stands behind the connections takes one request at a time.
    one_by_one: bool,
}

impl WideScan<'_> {
    fn begin(&mut self) -> Option<(usize, Step)> {
        let step = self.steps.get(self.begun).filter(|_| !self.one_by_one)?;
        self.begun += 1;
        Some((self.begun - 1, step.clone()))
    }
}

/// The results of a scan over Modbus TCP, as far as units can be asked at once; `None` where one must be asked again, alone.
async fn scan_at_once(line: &LineDef, steps: &[Step], progress: &mut impl FnMut() -> bool) -> Vec<Option<StepResult>> {
    let wide = RefCell::new(WideScan { steps, results: vec![None; steps.len()], begun: 0, one_by_one: false });
    let progress = RefCell::new(progress);
    let connection = || async {
        let mut link = open(line).await?;
        loop {
            let Some((n, next)) = wide.borrow_mut().begin() else { return Some(link) };
            // A unit whose connection fails is asked again, alone.
            let result = step(&mut link, &next).await.ok()?;
            let mut wide = wide.borrow_mut();
            wide.results[n] = Some(result);
            wide.one_by_one |= !link.take_late().is_empty();
            if !(progress.borrow_mut())() {
                wide.begun = steps.len();
            }
        }
    };
    let links = join_all((0..SCAN_CONNECTIONS.min(steps.len())).map(|_| connection())).await;
    let WideScan { mut results, one_by_one, .. } = wide.into_inner();
    if one_by_one {
        // What is still asked would hold up what is asked next.
        let _ = tokio::time::timeout(WORK_OFF_MAX, join_all(links.into_iter().flatten().map(work_off))).await;
        let is_silent = |result: &mut StepResult| matches!(result, StepResult::Answer(Err(Fault::Timeout), _));
        results.iter_mut().for_each(|result| drop(result.take_if(is_silent)));
    }
    results
}

/// A link of its own to a line that is not polled; `None` if it cannot be opened.
pub async fn open(line: &LineDef) -> Option<Link> {
    let opened = Connector::Real(line.transport.clone()).open().await.ok()?;
    Some(Link::new(opened, line, Clock::real(), LineMemory::new(line, Clock::real())))
}

/// Waits for the answers that were given up.
async fn work_off(mut link: Link) {
    while 0 < link.late_awaited() {
        let look = tokio::time::timeout(Duration::from_millis(100), link.listen()).await;
        if matches!(look, Ok(Err(_))) {
            return;
        }
    }
}

/// One step. `Err` only when the port is gone.
pub async fn step(link: &mut Link, step: &Step) -> Result<StepResult, LinkError> {
    match &step.ask {
        Ask::Raw(bytes) => {
            link.send_raw(bytes).await.map(|(bytes, response_time)| StepResult::Bytes(bytes, response_time))
        }
        Ask::Hold(signal, on) => link.hold_signal(*signal, *on).await.map(StepResult::Signals),
        Ask::PutBack => link.put_back_signal().map(StepResult::Signals),
        Ask::Message(message) => {
            let (usual, unanswered) = (link.timeout(), link.unanswered);
            link.set_timeout(step.timeout.unwrap_or(usual));
            // An outstanding reply would be shown as the answer to this.
            if let (true, Some(unit)) = (link.is_ambiguous(message), message.first()) {
                match link.loopback(*unit).await {
                    Ok(()) => {}
                    Err(LinkError::Fault(_)) => drop(link.forget_outstanding(*unit)),
                    Err(gone) => return Err(gone),
                }
            }
            let sent = if link.is_ambiguous(message) {
                Err(LinkError::Fault(Fault::BackedOff))
            } else {
                link.exchange(message).await
            };
            // Absent units are what a scan asks for: they say nothing of the connection.
            link.unanswered = unanswered;
            let answer = match sent {
                Ok(answer) => Ok(Ok(answer)),
                Err(LinkError::Fault(fault)) => Ok(Err(fault)),
                Err(gone) => Err(gone),
            };
            link.set_timeout(usual);
            let exchange = link.last.clone().ok_or(LinkError::Fault(Fault::Timeout))?;
            Ok(StepResult::Answer(answer?, exchange))
        }
    }
}

/// The settings of a line with the serial parameters that a step wants.
pub fn settings_for(line: &LineDef, step: &Step) -> LineDef {
    let mut settings = line.clone();
    if let (Transport::Serial { serial, .. }, Some(wanted)) = (&mut settings.transport, step.serial) {
        *serial = wanted;
    }
    settings
}

/// Runs a diagnostic to its end on a line that is not polled; `progress` sees every step and may stop it by `false`.
pub async fn run(line: &LineDef, mut job: Job, mut progress: impl FnMut(&DiagnosticRun) -> bool) -> DiagnosticRun {
    let mut connector = Connector::Real(line.transport.clone());
    let mut memory = LineMemory::new(line, Clock::real());
    let mut open: Option<(LineDef, Link)> = None;
    let scans = matches!(job.run().diagnostic, Diagnostic::Scan(_)) && line.transport.framing() == Framing::Mbap;
    let mut at_once: VecDeque<Option<StepResult>> = match scans {
        true => {
            let (run, mut done) = (job.run().clone(), 0);
            let mut progress_of = || {
                done += 1;
                progress(&DiagnosticRun { done, ..run.clone() })
            };
            scan_at_once(line, &job.planned_steps(), &mut progress_of).await.into()
        }
        false => VecDeque::new(),
    };
    while let Some(next) = job.next().cloned() {
        let wanted = settings_for(line, &next);
        let mut link = match open.take().filter(|(settings, _)| *settings == wanted) {
            Some((_, link)) => link,
            None => match connector.open_as(&wanted.transport).await {
                Ok(opened) => Link::new(opened, &wanted, Clock::real(), memory.clone()),
                Err(why) => {
                    job.stop(DiagnosticState::Failed(why));
                    break;
                }
            },
        };
        let result = match at_once.pop_front().flatten() {
            Some(result) => Ok(result),
            None => step(&mut link, &next).await,
        };
        match result {
            Ok(result) => job.on_result(result),
            Err(LinkError::Gone(why)) => job.stop(DiagnosticState::Failed(why)),
            Err(LinkError::Fault(fault)) => job.stop(DiagnosticState::Failed(fault.to_string())),
        }
        if !progress(job.run()) {
            job.stop(DiagnosticState::Cancelled);
        }
        memory = link.memory();
        open = Some((wanted, link));
    }
    job.run().clone()
}

#[cfg(test)]
mod tests {
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
        diagnostics::{Finding, Scan},
    };

    const UNITS: [u8; 3] = [3, 17, 40];

    /// A gateway that takes one request at a time of all its connections, and has no patience of its own: dead units cost
    /// `dead` and are refused with exception 0B, or with nothing where that is zero.
    async fn gateway(mut stream: TcpStream, one_at_a_time: Arc<Mutex<()>>, dead: Duration) -> std::io::Result<()> {
        loop {
            let mut frame = [0; 12];
            stream.read_exact(&mut frame).await?;
            let unit = frame[6];
            let _turn = one_at_a_time.lock().await;
            let answer: &[u8] = match UNITS.contains(&unit) {
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

    /// The units that a scan of 1 to 60 finds behind such a gateway.
    async fn scanned(dead: Duration) -> Vec<u8> {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let port = listener.local_addr().expect("it listens").port();
        let turn = Arc::new(Mutex::new(()));
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(gateway(stream, turn.clone(), dead));
            }
        });
        let timeout = Duration::from_millis(40);
        let line = LineDef { timeout, ..LineDef::new(LineId(0), "line", Transport::tcp("127.0.0.1", port)) };
        let scan = Diagnostic::Scan(Scan { first: 1, last: 60, serials: Vec::new(), timeout });
        let job = Job::new(CommandId::default(), "test".into(), scan, Timestamp::UNIX_EPOCH);
        let run = run(&line, job, |_| true).await;
        assert_eq!((run.done, &run.state), (60, &DiagnosticState::Done));
        let unit = |finding: &Finding| if let Finding::Unit { unit, .. } = finding { Some(*unit) } else { None };
        run.findings.iter().filter_map(unit).collect()
    }

    #[tokio::test]
    async fn a_wide_scan_misses_no_unit_behind_a_slow_gateway() {
        assert_eq!(scanned(Duration::ZERO).await, UNITS);
        // Sixteen at once take longer than the timeout: the answers come late.
        assert_eq!(scanned(Duration::from_millis(10)).await, UNITS);
    }
}
