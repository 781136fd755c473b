//! The sweep as a pure step machine: block after block, and around what a refused block gives all the same.

use std::collections::VecDeque;

use super::{Ask, Job, Step};
use crate::{
    bus::pdu,
    plant::{
        diagnostics::{Conclusion, DiagnosticState, FINDINGS_MAX, Finding, SweepEnd},
        fault::{ExceptionCode, Fault},
        live::AddressSpan,
        number::{to_u16, to_u32},
        sweep::{Sweep, SweptOutcome, SweptRange},
    },
};

/// Blocks in a row without any answer after which a unit that has never answered is given up.
const SILENT_MAX: u32 = 3;

/// What the request at work is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// A whole block.
    Block,
    /// Single addresses of a refused block.
    Probes,
    /// The rest of the chunks around probes that answered; refused spans are halved.
    Chunks,
}

/// A sweep at work.
#[derive(Debug, Clone)]
pub struct SweepJob {
    sweep: Sweep,
    /// The block at work; its outcomes by address, with that of the first address behind it.
    start: u32,
    outcomes: Vec<Option<SweptOutcome>>,
    /// Was the address itself asked alone and refused as unknown, beside one that answers?
    holes: Vec<AddressSpan>,
    stage: Stage,
    queue: VecDeque<AddressSpan>,
    /// Registers or bits of a block: fewer where the unit gives all of a refused block in parts.
    block: u16,
    /// The request was made twice, and a request that has been answered before is made to see whether the unit still does.
    tries: u8,
    /// A request that was answered, or refused.
    answered: Option<AddressSpan>,
    silent_blocks: u32,
    ranges: Vec<SweptRange>,
    ended: Option<SweepEnd>,
}

impl SweepJob {
    /// Before its first request.
    pub fn new(sweep: Sweep) -> SweepJob {
        let mut job = SweepJob {
            sweep,
            start: u32::from(sweep.first),
            outcomes: Vec::new(),
            holes: Vec::new(),
            stage: Stage::Block,
            queue: VecDeque::new(),
            block: sweep.block(),
            tries: 0,
            answered: None,
            silent_blocks: 0,
            ranges: Vec::new(),
            ended: None,
        };
        job.begin_block();
        job
    }

    /// The next request; `None` when it is done.
    pub fn next(&self) -> Option<AddressSpan> {
        match (self.tries, self.answered) {
            (2, Some(answered)) => Some(answered),
            _ => self.queue.front().copied(),
        }
    }

    /// Addresses that are done.
    pub fn done(&self) -> u32 {
        self.start - u32::from(self.sweep.first)
    }

    /// What the blocks so far have shown, in the order of addresses.
    pub fn ranges(&self) -> &[SweptRange] {
        &self.ranges
    }

    /// Addresses that the unit does not have although it has one close by, since the last call.
    pub fn take_holes(&mut self) -> Vec<AddressSpan> {
        std::mem::take(&mut self.holes)
    }

    /// Handles the outcome of the request that was next.
    pub fn on_outcome(&mut self, outcome: Result<(), Fault>) {
        let Some(span) = self.queue.front().copied() else { return };
        let silent = match outcome {
            Ok(()) => None,
            Err(Fault::Exception(code)) if !code.is_of_gateway() && !is_busy(code) => None,
            Err(fault) => Some(fault),
        };
        match (self.tries, silent) {
            // What was answered before is no longer answered.
            (2, Some(_)) => return self.end_silent(span),
            (2, None) => self.pass_over(self.silent_fault()),
            (tries, Some(fault)) => self.on_silence(tries, fault),
            (_, None) => {
                self.answered = Some(span);
                self.queue.pop_front();
                self.tries = 0;
                self.on_answer(span, outcome);
            }
        }
        while self.queue.is_empty() && self.ended.is_none() && self.start <= u32::from(self.sweep.last) {
            self.next_stage();
        }
    }

    fn on_answer(&mut self, span: AddressSpan, outcome: Result<(), Fault>) {
        match (outcome, self.stage) {
            (Ok(()), _) => self.mark(span, SweptOutcome::Answers),
            (Err(Fault::Exception(code)), Stage::Block)
                if code == ExceptionCode::ILLEGAL_FUNCTION && self.ranges.is_empty() =>
            {
                self.queue.clear();
                self.ended = Some(SweepEnd::NoTable { function: self.sweep.table.read_fc(), code });
            }
            (Err(Fault::Exception(code)), Stage::Chunks) if 1 < span.count => {
                let half = span.count / 2;
                let address = to_u16(u32::from(span.address) + u32::from(half));
                self.queue.push_front(AddressSpan { address, count: span.count - half, ..span });
                self.queue.push_front(AddressSpan { count: half, ..span });
                self.mark(span, SweptOutcome::Refused(code));
            }
            (Err(Fault::Exception(code)), _) => self.mark(span, SweptOutcome::Refused(code)),
            (Err(_), _) => {}
        }
    }

    /// Once more; then, if something was answered before, that; else the block is passed over.
    fn on_silence(&mut self, tries: u8, fault: Fault) {
        let Some(span) = self.queue.front().copied() else { return };
        if tries == 0 {
            self.tries = 1;
            return;
        }
        self.mark(span, SweptOutcome::Silent(fault));
        if self.answered.is_some() {
            self.tries = 2;
            return;
        }
        self.silent_blocks += 1;
        self.pass_over(fault);
        if self.silent_blocks == SILENT_MAX {
            self.finish_block();
            self.ended = Some(SweepEnd::Silent(SILENT_MAX));
        }
    }

    fn silent_fault(&self) -> Fault {
        let silent = |outcome: &Option<SweptOutcome>| match outcome {
            Some(SweptOutcome::Silent(fault)) => Some(*fault),
            Some(SweptOutcome::Answers | SweptOutcome::Refused(_)) | None => None,
        };
        self.outcomes.iter().find_map(silent).unwrap_or(Fault::Timeout)
    }

    /// What is still open in the block is not asked for: every request would take its timeout.
    fn pass_over(&mut self, fault: Fault) {
        for outcome in &mut self.outcomes {
            match outcome {
                Some(SweptOutcome::Answers) => {}
                Some(SweptOutcome::Silent(_) | SweptOutcome::Refused(_)) | None => {
                    *outcome = Some(SweptOutcome::Silent(fault));
                }
            }
        }
        self.queue.clear();
        (self.tries, self.stage) = (0, Stage::Chunks);
    }

    fn end_silent(&mut self, span: AddressSpan) {
        self.pass_over(self.silent_fault());
        let address = span.address;
        self.finish_block();
        self.ended = Some(SweepEnd::FellSilent(address));
    }

    /// Addresses of the block at work.
    fn count(&self) -> usize {
        self.outcomes.len() - 1
    }

    fn mark(&mut self, span: AddressSpan, outcome: SweptOutcome) {
        for address in span.range() {
            if let Some(held) = address.checked_sub(self.start).and_then(|at| self.outcomes.get_mut(at as usize)) {
                *held = Some(outcome);
            }
        }
    }

    fn span(&self, address: u32, count: u32) -> AddressSpan {
        AddressSpan { table: self.sweep.table, address: to_u16(address), count: to_u16(count) }
    }

    fn begin_block(&mut self) {
        let left = u32::from(self.sweep.last) + 1 - self.start;
        let count = left.min(u32::from(self.block));
        self.outcomes = vec![None; count as usize + 1];
        self.queue.push_back(self.span(self.start, count));
        self.stage = Stage::Block;
    }

    /// The queue is empty: what follows in this block, or the next one.
    fn next_stage(&mut self) {
        let refused = |outcome: &Option<SweptOutcome>| matches!(outcome, Some(SweptOutcome::Refused(_)));
        let every = u32::from(self.sweep.every.max(1));
        let count = to_u32(self.count());
        match self.stage {
            Stage::Block if self.outcomes.iter().any(refused) && 1 < count => {
                // With the first behind it: a range may begin right before that.
                let probes = (0..count + u32::from(1 < every))
                    .step_by(every as usize)
                    .filter(|at| self.start + at <= u32::from(self.sweep.last));
                self.queue = probes.map(|at| self.span(self.start + at, 1)).collect();
                self.stage = Stage::Probes;
            }
            Stage::Probes => {
                let answers = |at: u32| self.outcomes.get(at as usize) == Some(&Some(SweptOutcome::Answers));
                let chunks = (0..count).step_by(every as usize).filter(|at| answers(*at) || answers(at + every));
                let rest = |at: u32| self.span(self.start + at + 1, (every - 1).min(count - at - 1));
                self.queue = chunks.map(rest).filter(|span| span.count != 0).collect();
                self.stage = Stage::Chunks;
            }
            Stage::Block | Stage::Chunks => {
                self.finish_block();
                if self.start <= u32::from(self.sweep.last) {
                    self.begin_block();
                }
            }
        }
    }

    /// Adds the outcomes of the block to the ranges.
    fn finish_block(&mut self) {
        let refined = self.stage == Stage::Chunks;
        let count = self.count();
        let behind = self.outcomes.pop().flatten();
        let outcomes = std::mem::take(&mut self.outcomes);
        if refined {
            self.learn_holes(&outcomes, behind);
            let all = outcomes.iter().all(|outcome| *outcome == Some(SweptOutcome::Answers));
            // Refused as a whole, and given in parts: that was too many at once.
            if all && u16::from(self.sweep.every) < self.block {
                let half = self.block / 2;
                self.block = (half - half % u16::from(self.sweep.every)).max(u16::from(self.sweep.every));
            }
        }
        let every = usize::from(self.sweep.every.max(1));
        for (n, (address, outcome)) in (self.start..).zip(&outcomes).enumerate() {
            let Some(outcome) = *outcome else { continue };
            // A whole block may be refused for its size: what one address gets says why.
            let outcome = match (outcome, outcomes[n - n % every]) {
                (SweptOutcome::Refused(_), Some(asked @ SweptOutcome::Refused(_))) => asked,
                _ => outcome,
            };
            let address = to_u16(address);
            match self.ranges.last_mut() {
                Some(range) if range.outcome == outcome && range.last.checked_add(1) == Some(address) => {
                    range.last = address;
                }
                Some(_) | None => self.ranges.push(SweptRange { first: address, last: address, outcome }),
            }
        }
        self.start += to_u32(count);
        self.outcomes = vec![None];
    }

    /// In chunks with an answer, or in front of one, each address was asked.
    fn learn_holes(&mut self, outcomes: &[Option<SweptOutcome>], behind: Option<SweptOutcome>) {
        let every = usize::from(self.sweep.every.max(1));
        let answers = |outcome: Option<SweptOutcome>| outcome == Some(SweptOutcome::Answers);
        for (n, chunk) in outcomes.chunks(every).enumerate() {
            let next = outcomes.get((n + 1) * every).copied().unwrap_or(behind);
            if every == 1 || chunk.first().is_some_and(|first| answers(*first)) || answers(next) {
                let missing = Some(SweptOutcome::Refused(ExceptionCode::ILLEGAL_ADDRESS));
                let holes = chunk.iter().enumerate().filter(|(_, outcome)| **outcome == missing);
                let span = |at: usize| self.span(self.start + to_u32(n * every + at), 1);
                let holes: Vec<AddressSpan> = holes.map(|(at, _)| span(at)).collect();
                self.holes.extend(holes);
            }
        }
    }

    /// What all of it shows.
    pub fn conclusion(&self) -> Conclusion {
        let of = |wanted: fn(&SweptOutcome) -> bool| {
            let ranges = self.ranges.iter().filter(|range| wanted(&range.outcome));
            ranges.fold((0u32, 0u32), |(count, all), range| (count + 1, all + u32::from(range.last - range.first) + 1))
        };
        let (ranges, answers) = of(|outcome| matches!(outcome, SweptOutcome::Answers));
        let (_, refused) = of(|outcome| matches!(outcome, SweptOutcome::Refused(_)));
        let (_, silent) = of(|outcome| matches!(outcome, SweptOutcome::Silent(_)));
        let (ended, every, cut) = (self.ended, self.sweep.every, FINDINGS_MAX <= self.ranges.len());
        Conclusion::Sweep { ended, ranges, answers, refused, silent, every, cut }
    }
}

impl Job {
    /// How far a sweep is, is counted in addresses.
    pub(super) fn on_swept(&mut self, step: &Step, answer: Result<Vec<u8>, Fault>) {
        let (Ask::Message(request), Some(job)) = (&step.ask, &mut self.sweep) else { return };
        let values = |answer: Vec<u8>| pdu::values_read(&request[1..], answer.get(1..)?);
        job.on_outcome(answer.and_then(|answer| values(answer).map(drop).ok_or(Fault::WrongEcho)));
        self.run.done = job.done();
        // Of the ranges found before only the last one grows.
        self.run.findings.pop();
        let listed = self.run.findings.len();
        let new = job.ranges().iter().skip(listed).take(FINDINGS_MAX - 1 - listed);
        self.run.findings.extend(new.copied().map(Finding::Swept));
        self.advance();
        if self.step.is_none() {
            self.conclude();
            self.run.state = DiagnosticState::Done;
        }
        self.update_now();
    }
}

/// It has the request, or no time for it: of the address this says nothing.
fn is_busy(code: ExceptionCode) -> bool {
    matches!(code.0, 5 | 6)
}

#[cfg(test)]
mod tests;
