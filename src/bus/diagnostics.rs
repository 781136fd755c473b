//! Diagnostics of a line as pure step machines: which request is next, and what follows from its response.

pub(in crate::bus) mod identify;
mod loopback;
mod pattern;
mod scan;
mod signal;
mod sweep;
mod write;

use std::{collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::pdu::{self, Pdu};
use crate::plant::{
    command::CommandId,
    def::Serial,
    diagnostics::{
        Conclusion, Diagnostic, DiagnosticRun, DiagnosticState, DiagnosticStep, FINDINGS_MAX, Finding, RegisterWrite,
    },
    fault::Fault,
    line_trouble::LineTrouble,
    live::AddressSpan,
    number::{to_u16, to_u32},
    port_signals::{OutputSignal, PortSignals},
    tag::Table,
    traffic::Exchange,
};

pub use pattern::{tally, tally_of};

/// What is to be sent next.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// With these serial parameters; `None` for the line's own.
    pub serial: Option<Serial>,
    /// The answer may take this long; `None` for the line's own timeout.
    pub timeout: Option<Duration>,
    /// What.
    pub ask: Ask,
}

/// A request, or bytes as they are.
#[derive(Debug, Clone, PartialEq)]
pub enum Ask {
    /// Unit and PDU; the line frames it.
    Message(Vec<u8>),
    /// A whole frame, good or bad.
    Raw(Vec<u8>),
    /// Holds a signal, raised or lowered, until the next look at all of them.
    Hold(OutputSignal, bool),
    /// Puts what was held back as it was.
    PutBack,
}

/// What a step has given.
#[derive(Debug, Clone)]
pub enum StepResult {
    /// The answer to a message, or why there is none, and both as they were on the wire.
    Answer(Result<Vec<u8>, Fault>, Arc<Exchange>),
    /// Every byte that came back, after raw bytes were sent.
    Bytes(Vec<u8>, Option<Duration>),
    /// How the signals of the port stand, or why they cannot be set.
    Signals(Result<PortSignals, LineTrouble>),
}

/// A running diagnostic. Its steps are made one by one: a scan may have thousands.
#[derive(Debug, Clone)]
pub struct Job {
    run: DiagnosticRun,
    /// The step at work, or next.
    step: Option<Step>,
    /// Steps that an answer has called for; they go first.
    queued: VecDeque<Step>,
    /// Steps of the diagnostic itself that have been made.
    made: u32,
    /// How many it has.
    planned: u32,
    /// Units of a scan that gave corrupt bytes, with which settings: each by itself may be a unit, all together are none.
    corrupt_units: Vec<(u8, Option<Serial>, Fault)>,
    /// The response to a write, once it was sent.
    written: Result<(), Fault>,
    sweep: Option<sweep::SweepJob>,
    identify: identify::IdentifyJob,
}

impl Job {
    /// Ready for its first step.
    pub fn new(id: CommandId, by: Arc<str>, diagnostic: Diagnostic, at: Timestamp) -> Job {
        let planned = steps_in(&diagnostic);
        let sweep = match &diagnostic {
            Diagnostic::Sweep(sweep) => Some(sweep::SweepJob::new(*sweep)),
            _ => None,
        };
        let run = DiagnosticRun {
            id,
            by,
            diagnostic,
            started: at,
            done: 0,
            total: planned,
            requests: 0,
            errors: 0,
            now: None,
            state: DiagnosticState::Running,
            findings: Vec::new(),
        };
        let mut job = Job {
            run,
            step: None,
            queued: VecDeque::new(),
            made: 0,
            planned,
            corrupt_units: Vec::new(),
            written: Ok(()),
            sweep,
            identify: identify::IdentifyJob::default(),
        };
        job.advance();
        job.update_now();
        job
    }

    /// How it stands.
    pub fn run(&self) -> &DiagnosticRun {
        &self.run
    }

    /// See [`Diagnostic::is_exclusive`].
    pub fn is_exclusive(&self) -> bool {
        self.run.diagnostic.is_exclusive()
    }

    /// Does it ask so much that other requests must not wait for its end?
    pub fn is_long(&self) -> bool {
        matches!(
            self.run.diagnostic,
            Diagnostic::Sweep(_) | Diagnostic::Scan(_) | Diagnostic::Loopback { .. } | Diagnostic::Pattern { .. }
        )
    }

    /// May it take no more of the line's time than live reads?
    pub fn is_sweep(&self) -> bool {
        self.sweep.is_some()
    }

    /// Addresses that a unit turned out not to have, since the last call.
    pub fn take_holes(&mut self) -> Option<(u8, Vec<AddressSpan>)> {
        let Diagnostic::Sweep(sweep) = &self.run.diagnostic else { return None };
        Some((sweep.unit, self.sweep.as_mut()?.take_holes()))
    }

    /// All steps that need no answer of an earlier one.
    pub fn planned_steps(&self) -> Vec<Step> {
        (0..self.planned).map(|n| planned_step(&self.run.diagnostic, n)).collect()
    }

    /// The next step; `None` when it is done or was stopped.
    pub fn next(&self) -> Option<&Step> {
        self.step.as_ref().filter(|_| self.run.state == DiagnosticState::Running)
    }

    /// Stops it.
    pub fn stop(&mut self, state: DiagnosticState) {
        if self.run.state == DiagnosticState::Running {
            self.end_write(&state);
            self.run.state = state;
        }
    }

    /// A write that is not at its end: what is known of it.
    fn end_write(&mut self, state: &DiagnosticState) {
        let Diagnostic::Write(_) = self.run.diagnostic else { return };
        // A test that is cut short does not wait for its response.
        let is_cut = matches!(state, DiagnosticState::Cancelled | DiagnosticState::Failed(LineTrouble::UrgentStop));
        let lost = if is_cut { Fault::Timeout } else { Fault::NotConnected };
        self.found(Finding::Written(write::unfinished(self.made, self.written, lost)));
    }

    /// Handles the result of the step that was next.
    pub fn on_result(&mut self, result: StepResult) {
        let Some(step) = self.step.take() else { return };
        self.run.requests += u32::from(!matches!(result, StepResult::Signals(_)));
        self.run.errors += u32::from(self.is_error(&result));
        self.run.done += 1;
        match (&self.run.diagnostic, result) {
            (_, StepResult::Signals(Ok(signals))) => self.on_signals(signals),
            (_, StepResult::Signals(Err(why))) => self.run.state = DiagnosticState::Failed(why),
            (_, StepResult::Bytes(bytes, response_time)) => self.found(Finding::Bytes { bytes, response_time }),
            (Diagnostic::Scan(_), StepResult::Answer(answer, _)) => self.add_unit(&step, answer),
            (Diagnostic::Sweep(_), StepResult::Answer(answer, _)) => return self.on_swept(&step, answer),
            // It only had an adapter with echo give itself away.
            (Diagnostic::Loopback { .. }, StepResult::Answer(..)) if self.run.done == 1 => {}
            (Diagnostic::Identify { .. }, result @ StepResult::Answer(..)) => self.on_identified(&step, result),
            (Diagnostic::Write(write), StepResult::Answer(answer, exchange)) => {
                let write = write.clone();
                self.found(Finding::Exchange(exchange));
                self.on_written(&write, &step, answer);
            }
            (_, StepResult::Answer(answer, exchange)) => {
                self.found(Finding::Exchange(exchange));
                self.on_response(&step, answer);
            }
        }
        self.run.total = self.run.done + to_u32(self.queued.len()) + (self.planned - self.made);
        self.advance();
        if self.step.is_none() && self.run.state == DiagnosticState::Running {
            self.conclude();
            self.run.state = DiagnosticState::Done;
        }
        self.update_now();
    }

    /// Is this not what the step was made for? A scan expects silence, a sweep and an identification expect refusals.
    fn is_error(&self, result: &StepResult) -> bool {
        match (&self.run.diagnostic, result) {
            (Diagnostic::Pattern { bits, .. }, StepResult::Bytes(bytes, _)) => {
                *bytes != pattern::bytes(self.run.done, *bits)
            }
            (_, StepResult::Bytes(bytes, _)) => bytes.is_empty(),
            (_, StepResult::Answer(Ok(_), _) | StepResult::Signals(_)) => false,
            (Diagnostic::Loopback { .. }, StepResult::Answer(Err(_), _)) => 0 < self.run.done,
            (Diagnostic::Scan(_), StepResult::Answer(Err(fault), _)) => fault.is_corrupt(),
            (Diagnostic::Sweep(_) | Diagnostic::Identify { .. }, StepResult::Answer(Err(Fault::Exception(_)), _)) => {
                false
            }
            (_, StepResult::Answer(Err(_), _)) => true,
        }
    }

    /// Makes the step that is next.
    fn advance(&mut self) {
        if let (Diagnostic::Sweep(sweep), Some(job)) = (&self.run.diagnostic, &self.sweep) {
            let unit = sweep.unit;
            self.step = job.next().map(|span| step(read(unit, span.table, span.address, span.count)));
            return;
        }
        self.step = self.queued.pop_front().or_else(|| {
            let step = (self.made < self.planned).then(|| planned_step(&self.run.diagnostic, self.made));
            self.made += u32::from(step.is_some());
            step
        });
    }

    fn on_written(&mut self, write: &RegisterWrite, step: &Step, answer: Result<Vec<u8>, Fault>) {
        let Ask::Message(request) = &step.ask else { return };
        let held = || answer.clone().and_then(|answer| write::words_of(request, &answer).ok_or(Fault::WrongEcho));
        let ended = match self.made {
            1 => write::after_first_read(write, held()),
            2 => {
                self.written = answer.map(drop);
                write::after_write(&self.written)
            }
            _ => Some(write::after_read_back(write, self.written, held())),
        };
        if let Some(outcome) = ended {
            self.made = self.planned;
            self.found(Finding::Written(outcome));
        }
    }

    fn on_response(&mut self, step: &Step, answer: Result<Vec<u8>, Fault>) {
        let Ask::Message(request) = &step.ask else { return };
        let answer = match answer {
            Ok(answer) => answer,
            Err(fault) => {
                self.failed(request, fault);
                self.after_failure(fault);
                return;
            }
        };
        let values = answer.get(1..).and_then(|pdu| pdu::values_read(&request[1..], pdu));
        if let Some((table, address, words)) = values {
            self.found(Finding::Values { table, address, words });
        }
    }

    /// A block that does not exist as a whole may exist in parts.
    fn after_failure(&mut self, fault: Fault) {
        match (&self.run.diagnostic, fault) {
            (Diagnostic::Read { unit, table, address, count }, Fault::Exception(code))
                if code.0 == 2 && 1 < *count && self.run.done == 1 =>
            {
                let singles = (0..*count).map(|n| step(read(*unit, *table, address.wrapping_add(n), 1)));
                self.queued.extend(singles);
            }
            _ => {}
        }
    }

    /// The device heard nothing for so long after it had accepted the connection.
    pub fn note_deaf(&mut self, span: Duration) {
        self.found(Finding::Conclusion(Conclusion::Deaf(span)));
    }

    fn failed(&mut self, request: &[u8], fault: Fault) {
        if let Some(what) = request_step(request, None) {
            self.found(Finding::Failed { what, fault });
        }
    }

    fn conclude(&mut self) {
        self.conclude_corrupt_units();
        let conclusion = match &self.run.diagnostic {
            Diagnostic::Loopback { .. } => Some(loopback::conclusion(&self.run.findings, self.run.done - 1)),
            Diagnostic::Scan(scan) => {
                let units = self.run.findings.iter().filter(|found| matches!(found, Finding::Unit { .. })).count();
                Some(Conclusion::Units(units, scan.timeout))
            }
            Diagnostic::Sweep(_) => self.sweep.as_ref().map(sweep::SweepJob::conclusion),
            Diagnostic::Pattern { bits, .. } => {
                let tally = pattern::tally_of(&self.run, *bits);
                self.found(Finding::Conclusion(Conclusion::Patterns(tally)));
                Some(Conclusion::Plug(tally))
            }
            Diagnostic::Signal(test) => signal::conclusion(test, &self.run.findings),
            Diagnostic::Send(_) | Diagnostic::Identify { .. } | Diagnostic::Read { .. } | Diagnostic::Write(_) => None,
        };
        conclusion.into_iter().for_each(|conclusion| self.found(Finding::Conclusion(conclusion)));
    }

    /// Keeps a finding; the last place is for what is concluded from all of them.
    fn found(&mut self, finding: Finding) {
        let room = if matches!(finding, Finding::Conclusion(_)) { FINDINGS_MAX } else { FINDINGS_MAX - 1 };
        if self.run.findings.len() < room {
            self.run.findings.push(finding);
        }
    }

    fn update_now(&mut self) {
        self.run.now = match self.step.as_ref().map(|step| (&step.ask, step.serial)) {
            Some((Ask::Message(request), serial)) => request_step(request, serial),
            Some((Ask::Raw(_), _)) => Some(DiagnosticStep::Bytes),
            Some((Ask::Hold(..) | Ask::PutBack, _)) | None => None,
        };
    }
}

/// How many steps a diagnostic has before any answer calls for more.
fn steps_in(diagnostic: &Diagnostic) -> u32 {
    match diagnostic {
        Diagnostic::Send(_) | Diagnostic::Read { .. } | Diagnostic::Identify { .. } => 1,
        Diagnostic::Loopback { count, .. } => 1 + u32::from(*count),
        Diagnostic::Pattern { count, .. } => u32::from(*count),
        Diagnostic::Write(_) => write::STEPS,
        Diagnostic::Scan(scan) => scan::steps_in(scan),
        Diagnostic::Sweep(sweep) => sweep.addresses(),
        Diagnostic::Signal(test) => test.looks() + 1,
    }
}

/// Step `n` of a diagnostic, from 0.
fn planned_step(diagnostic: &Diagnostic, n: u32) -> Step {
    match diagnostic {
        Diagnostic::Send(bytes) => Step { serial: None, timeout: None, ask: Ask::Raw(bytes.clone()) },
        Diagnostic::Pattern { bits, .. } => {
            Step { serial: None, timeout: None, ask: Ask::Raw(pattern::bytes(n, *bits)) }
        }
        // An adapter that gives back what it sends would pass every loopback. A read cannot be answered by itself: the link
        // knows such an adapter from then on.
        Diagnostic::Loopback { unit, .. } if n == 0 => step(read(*unit, Table::Holding, 0, 1)),
        Diagnostic::Loopback { unit, data, .. } => step(Pdu::loopback(data.wrapping_add(to_u16(n) - 1)).to(*unit)),
        Diagnostic::Identify { unit } => identify::first(*unit),
        Diagnostic::Write(write) => write::step_of(write, n),
        Diagnostic::Read { unit, table, address, count } => step(read(*unit, *table, *address, *count)),
        Diagnostic::Scan(scan) => scan::step_of(scan, n),
        Diagnostic::Signal(test) => signal::step_of(test, n),
        // Each of its steps follows from the response to the one before.
        Diagnostic::Sweep(sweep) => step(read(sweep.unit, sweep.table, sweep.first, sweep.block())),
    }
}

fn step(message: Vec<u8>) -> Step {
    Step { serial: None, timeout: None, ask: Ask::Message(message) }
}

fn read(unit: u8, table: Table, address: u16, count: u16) -> Vec<u8> {
    Pdu::read(table, address, count).to(unit)
}

/// What a request asks; `None` of none.
fn request_step(request: &[u8], serial: Option<Serial>) -> Option<DiagnosticStep> {
    let [unit, function, ..] = *request else { return None };
    Some(DiagnosticStep::Request { unit, function, serial })
}

/// Text of a device: what cannot be printed is shown as hexadecimal digits.
fn text_of(bytes: &[u8]) -> String {
    let printable = |byte: &u8| (0x20..0x7F).contains(byte);
    bytes
        .iter()
        .map(|byte| if printable(byte) { char::from(*byte).to_string() } else { format!("\\x{byte:02X}") })
        .collect()
}

#[cfg(test)]
mod tests;
