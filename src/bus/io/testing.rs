//! Carries the steps of a line diagnostic over a link.

use std::{
    cell::{Cell, RefCell},
    collections::VecDeque,
    time::Duration,
};

use futures_util::future::join_all;
use tokio::time::Instant;

use super::{
    clock::Clock,
    link::{Link, LinkError},
    memory::LineMemory,
    transport::Connector,
};
use crate::{
    bus::{
        diagnostics::{Ask, Job, Step, StepResult},
        frame,
        request_lint::only_reads,
    },
    plant::{
        def::{Framing, LineDef, Transport},
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState},
        fault::Fault,
        line_trouble::LineTrouble,
    },
};

/// Connections of a scan over Modbus TCP, each with one request under way: servers that take several requests of one
/// connection at once are few.
pub const SCAN_CONNECTIONS: usize = 16;
/// A gateway has so long to work off what it was asked at once.
const WORK_OFF_MAX: Duration = Duration::from_secs(30);
/// Some devices lose what they are asked for seconds after they have accepted a connection: until something has come, what
/// changes nothing is asked again for so long. To connect again would begin that time again.
pub const DEAF_MAX: Duration = Duration::from_secs(5);

/// Whether anything has come from a device since it accepted the first connection, and when.
#[derive(Debug, Default)]
pub struct Hearing {
    /// So long after the connection that it came on was accepted.
    heard: Cell<Option<Duration>>,
}

impl Hearing {
    /// A port without connections accepts nothing: what is not answered at once is not there.
    fn of(line: &LineDef) -> Hearing {
        let at_once = (!line.transport.has_connection()).then_some(Duration::ZERO);
        Hearing { heard: Cell::new(at_once) }
    }

    /// May what was sent on a connection so old have been lost?
    fn may_be_lost(&self, age: Duration) -> bool {
        age < self.heard.get().unwrap_or(DEAF_MAX)
    }

    /// Something has come; `deaf`: so long after the connection, to a request that was lost before.
    fn hear(&self, deaf: Option<Duration>) {
        self.heard.set(self.heard.get().or(deaf).or(Some(Duration::ZERO)));
    }

    /// How long the device was deaf, if it was.
    fn deaf_for(&self) -> Option<Duration> {
        self.heard.get().filter(|span| !span.is_zero())
    }
}

/// From a request to the first byte that came.
fn response_time(result: &StepResult) -> Option<Duration> {
    match result {
        StepResult::Answer(_, exchange) => exchange.response_time,
        StepResult::Bytes(_, response_time) => *response_time,
        StepResult::Signals(_) => None,
    }
}

/// An open connection, and since when.
pub struct Connection {
    link: Link,
    opened: Instant,
}

impl Connection {
    fn new(link: Link) -> Connection {
        Connection { link, opened: Instant::now() }
    }

    /// One step, on this connection again while the device may be deaf. `Err` only when the port is gone. The second is whether
    /// an answer came late meanwhile.
    pub async fn step(&mut self, hearing: &Hearing, next: &Step) -> Result<(StepResult, bool), LinkError> {
        let (mut late, mut is_again) = (false, false);
        loop {
            let sent = self.opened.elapsed();
            let result = ask(&mut self.link, next, is_again).await?;
            late |= !self.link.take_late().is_empty();
            if late || !is_silent(&result) {
                hearing.hear((is_again && !late).then(|| sent + response_time(&result).unwrap_or_default()));
            }
            if !is_silent(&result) || !hearing.may_be_lost(sent) || !self.is_harmless(next) {
                return Ok((result, late));
            }
            is_again = true;
        }
    }

    /// May it be asked twice?
    fn is_harmless(&self, step: &Step) -> bool {
        match &step.ask {
            Ask::Message(message) => only_reads(message),
            Ask::Raw(bytes) => frame::unwrap(self.link.framing(), bytes).is_ok_and(|message| only_reads(&message)),
            Ask::Hold(..) | Ask::PutBack => false,
        }
    }
}

/// Has nothing come?
fn is_silent(result: &StepResult) -> bool {
    match result {
        StepResult::Answer(answer, _) => matches!(answer, Err(Fault::Timeout)),
        StepResult::Bytes(bytes, _) => bytes.is_empty(),
        StepResult::Signals(_) => false,
    }
}

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

/// The results of a scan over Modbus TCP, as far as units can be asked at once, `None` where one must be asked again, alone;
/// and a connection that is still open.
async fn scan_at_once(
    line: &LineDef,
    steps: &[Step],
    hearing: &Hearing,
    progress: &mut impl FnMut() -> bool,
) -> (Vec<Option<StepResult>>, Option<Connection>) {
    let wide = RefCell::new(WideScan { steps, results: vec![None; steps.len()], begun: 0, one_by_one: false });
    let (progress, stopped) = (RefCell::new(progress), Cell::new(false));
    let scan = || async {
        let (mut connection, mut asked) = (open(line).await?, Vec::new());
        loop {
            let Some((n, next)) = wide.borrow_mut().begin() else { return Some((connection, asked)) };
            // A unit whose connection fails is asked again, alone.
            let (result, late) = connection.step(hearing, &next).await.ok()?;
            asked.push(n);
            let mut wide = wide.borrow_mut();
            wide.results[n] = Some(result);
            wide.one_by_one |= late;
            if !(progress.borrow_mut())() {
                stopped.set(true);
                wide.begun = steps.len();
            }
        }
    };
    let shares = join_all((0..SCAN_CONNECTIONS.min(steps.len())).map(|_| scan())).await;
    let mut shares: Vec<Share> = shares.into_iter().flatten().collect();
    let WideScan { mut results, one_by_one, .. } = wide.into_inner();
    if one_by_one {
        // What is still asked would hold up what is asked next.
        let work = join_all(shares.iter_mut().map(|(connection, _)| work_off(connection)));
        let _ = tokio::time::timeout(WORK_OFF_MAX, work).await;
        results.iter_mut().for_each(|result| drop(result.take_if(|result| is_silent(result))));
    } else if !stopped.get() && 1 < shares.len() {
        doubt_unserved(&mut shares, steps, &mut results, hearing).await;
    }
    // The last one is one that is served.
    shares.sort_by_key(|(_, asked)| asked.iter().any(|n| is_answered(&results[*n])));
    (results, shares.pop().map(|(connection, _)| connection))
}

/// A connection of a scan, and the steps that were taken on it.
type Share = (Connection, Vec<usize>);

fn is_answered(result: &Option<StepResult>) -> bool {
    result.as_ref().is_some_and(|result| !is_silent(result))
}

/// Many devices serve one connection and let the others wait: on a connection that is silent even where a unit has answered on
/// another, or where none has, silence says nothing of a unit.
async fn doubt_unserved(shares: &mut [Share], steps: &[Step], results: &mut [Option<StepResult>], hearing: &Hearing) {
    let known = results.iter().position(is_answered).map(|n| &steps[n]);
    let silent = shares.iter_mut().filter(|(_, asked)| !asked.iter().any(|n| is_answered(&results[*n])));
    let checks = silent.map(|(connection, asked)| async move {
        let served = match known {
            Some(step) => connection.step(hearing, step).await.is_ok_and(|(result, _)| !is_silent(&result)),
            None => false,
        };
        if served { Vec::new() } else { asked.clone() }
    });
    join_all(checks).await.into_iter().flatten().for_each(|n| results[n] = None);
}

/// A connection of its own to a line that is not polled; `None` if it cannot be opened.
pub async fn open(line: &LineDef) -> Option<Connection> {
    let opened = Connector::Real(line.transport.clone()).open().await.ok()?;
    Some(Connection::new(Link::new(opened, line, Clock::real(), LineMemory::new(line, Clock::real()))))
}

/// Waits for the answers that were given up.
async fn work_off(connection: &mut Connection) {
    while 0 < connection.link.late_awaited() {
        let look = tokio::time::timeout(Duration::from_millis(100), connection.link.listen()).await;
        if matches!(look, Ok(Err(_))) {
            return;
        }
    }
}

/// One step. `Err` only when the port is gone.
pub async fn step(link: &mut Link, step: &Step) -> Result<StepResult, LinkError> {
    ask(link, step, false).await
}

/// The same; `is_again`: it was not answered, and nothing else was asked since.
async fn ask(link: &mut Link, step: &Step, is_again: bool) -> Result<StepResult, LinkError> {
    match &step.ask {
        Ask::Raw(bytes) => {
            link.send_raw(bytes).await.map(|(bytes, response_time)| StepResult::Bytes(bytes, response_time))
        }
        Ask::Hold(signal, on) => link.hold_signal(*signal, *on).await.map(StepResult::Signals),
        Ask::PutBack => link.put_back_signal().map(StepResult::Signals),
        Ask::Message(message) => {
            let (usual, unanswered) = (link.timeout(), link.unanswered);
            link.set_timeout(step.timeout.unwrap_or(usual));
            // An outstanding reply would be shown as the answer to this, unless it is one.
            let is_ambiguous = |link: &Link| !is_again && link.is_ambiguous(message);
            if let (true, Some(unit)) = (is_ambiguous(link), message.first()) {
                match link.loopback(*unit).await {
                    Ok(()) => {}
                    Err(LinkError::Fault(_)) => drop(link.forget_outstanding(*unit)),
                    Err(gone) => return Err(gone),
                }
            }
            let sent =
                if is_ambiguous(link) { Err(LinkError::Fault(Fault::BackedOff)) } else { link.exchange(message).await };
            // Absent units are what a scan asks for: they say nothing of the connection.
            link.unanswered = unanswered;
            link.set_timeout(usual);
            let answer = match sent {
                Ok(answer) => Ok(answer),
                Err(LinkError::Fault(fault)) => Err(fault),
                Err(gone) => return Err(gone),
            };
            let exchange = link.last.clone().ok_or(LinkError::Fault(Fault::Timeout))?;
            Ok(StepResult::Answer(answer, exchange))
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

/// A line that is not polled: what is tried on it one after another uses one connection.
pub struct Bench {
    line: LineDef,
    connector: Connector,
    memory: LineMemory,
    hearing: Hearing,
    open: Option<(LineDef, Connection)>,
}

impl Bench {
    /// Nothing is open yet.
    pub fn new(line: &LineDef) -> Bench {
        Bench {
            line: line.clone(),
            connector: Connector::Real(line.transport.clone()),
            memory: LineMemory::new(line, Clock::real()),
            hearing: Hearing::of(line),
            open: None,
        }
    }

    /// The path of its serial port.
    pub fn port(&self) -> Option<&str> {
        match &self.line.transport {
            Transport::Serial { port, .. } => Some(port),
            Transport::Network { .. } => None,
        }
    }

    /// Runs a diagnostic to its end; `progress` sees every step and may stop it by `false`.
    pub async fn run(&mut self, mut job: Job, mut progress: impl FnMut(&DiagnosticRun) -> bool) -> DiagnosticRun {
        let mut deaf_for = self.hearing.deaf_for();
        let mut at_once = self.scan_at_once(&job, &mut progress).await;
        while let Some(next) = job.next().cloned() {
            let mut connection = match self.connect(&next).await {
                Ok(connection) => connection,
                Err(why) => {
                    job.stop(DiagnosticState::Failed(why));
                    break;
                }
            };
            let result = match at_once.pop_front().flatten() {
                Some(result) => Ok(result),
                None => connection.step(&self.hearing, &next).await.map(|(result, _)| result),
            };
            match result {
                Ok(result) => job.on_result(result),
                Err(LinkError::Gone(why)) => job.stop(DiagnosticState::Failed(why)),
                Err(LinkError::Fault(fault)) => job.stop(DiagnosticState::Failed(LineTrouble::Fault(fault))),
            }
            if let Some(span) = self.hearing.deaf_for().filter(|span| deaf_for.replace(*span).is_none()) {
                job.note_deaf(span);
            }
            if !progress(job.run()) {
                job.stop(DiagnosticState::Cancelled);
            }
            self.memory = connection.link.memory();
            self.open = Some((settings_for(&self.line, &next), connection));
        }
        job.run().clone()
    }

    /// The connection for a step: the one that is open, if it has the settings.
    async fn connect(&mut self, step: &Step) -> Result<Connection, LineTrouble> {
        let wanted = settings_for(&self.line, step);
        if let Some((_, connection)) = self.open.take().filter(|(settings, _)| *settings == wanted) {
            return Ok(connection);
        }
        let opened = self.connector.open_as(&wanted.transport).await?;
        Ok(Connection::new(Link::new(opened, &wanted, Clock::real(), self.memory.clone())))
    }

    /// The results of a scan over several connections, and one of these to go on with; none for any other diagnostic, and on a
    /// connection that is already open.
    async fn scan_at_once(
        &mut self,
        job: &Job,
        progress: &mut impl FnMut(&DiagnosticRun) -> bool,
    ) -> VecDeque<Option<StepResult>> {
        let (run, steps) = (job.run().clone(), job.planned_steps());
        let is_tcp = self.line.transport.framing() == Framing::Mbap;
        if !is_tcp || self.open.is_some() || steps.len() < 2 || !matches!(run.diagnostic, Diagnostic::Scan(_)) {
            return VecDeque::new();
        }
        let mut done = 0;
        let mut progress = || {
            done += 1;
            progress(&DiagnosticRun { done, ..run.clone() })
        };
        let (results, connection) = scan_at_once(&self.line, &steps, &self.hearing, &mut progress).await;
        self.open = connection.map(|connection| (settings_for(&self.line, &steps[0]), connection));
        results.into()
    }
}

#[cfg(test)]
mod tests;
