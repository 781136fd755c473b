//! Reading blocks: one at a time, or over Modbus TCP several (`concurrent`); what came is evaluated and sent to the plant.

use std::{sync::Arc, time::Duration};

use super::{
    LinkExit, Task,
    read::{read_in_sync, text_of, value_of},
};
use crate::{
    bus::{
        backoff::Backoff,
        io::link::{Link, LinkError},
        plan::{self, Block, Wire, may_be_cut},
        schedule::{Failure, Schedule},
        wide_addresses::WideAddresses,
    },
    plant::{
        def::Framing,
        event::Event,
        fault::{Fault, FaultKind},
        line_trouble::LineTrouble,
        time::elapsed,
        traffic::Exchange,
    },
};
use jiff::Timestamp;

/// Requests in a row without any answer after which a TCP connection is opened again …
const UNANSWERED_MAX: u32 = 5;
/// … and twice as many each time that this was in vain, up to this many doublings: the device may be deaf after it was connected.
const DOUBLINGS_MAX: u32 = 3;

/// How a read has ended.
pub(super) struct ReadResult {
    pub began: Timestamp,
    pub ended: Timestamp,
    /// The time of the line that it took.
    pub took: Duration,
    /// The part of it from the first byte of the request to the last of the answer.
    pub on_wire: Duration,
    pub answer: Result<Vec<u16>, Fault>,
    /// The exchange.
    pub exchange: Option<Arc<Exchange>>,
}

impl Task<'_> {
    /// Reads the block that is due; over Modbus TCP also others that are, and without waiting for their answers.
    pub(super) async fn poll(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: usize,
    ) -> Result<(), LinkExit> {
        self.polls_since_step += 1;
        if link.framing() == Framing::Mbap {
            return self.poll_tcp(link, schedule, index).await;
        }
        let block = self.blocks[index].clone();
        let began = self.clock.now();
        // If only time can resynchronise, nothing is sent.
        link.last = None;
        let timeout = link.timeout();
        link.set_timeout(schedule.response_timeout(index));
        let read = self.read_unless_stopped(link, &block, Some(index)).await;
        link.set_timeout(timeout);
        let ended = self.clock.now();
        let served = schedule.done(index, began, ended);
        self.stats.served(index, served.jitter, served.missed);
        self.note_late(link, schedule);
        Self::keep_gap(link, schedule, &block, ended);
        let answer = match read {
            Some(Ok(answer)) => Ok(answer),
            Some(Err(LinkError::Fault(fault))) => Err(fault),
            Some(Err(LinkError::Gone(why))) => {
                self.cut.push(block);
                return Err(LinkExit::Gone(why));
            }
            // Nothing was learned of the device.
            None => {
                schedule.reschedule(index, ended);
                return Ok(());
            }
        };
        let exchange = link.last.clone();
        let (took, on_wire) = (elapsed(began, ended), link.took());
        let result = ReadResult { began, ended, took, on_wire, answer, exchange };
        self.finish_poll(link, schedule, Some(index), &block, result).await?;
        Ok(())
    }

    /// Answers that had been given up have come: their devices need more time than they used to.
    pub(super) fn note_late(&mut self, link: &mut Link, schedule: &mut Schedule) {
        let late = link.take_late();
        self.stats.late(&self.def, &late);
        for unit in late {
            let on_line = self.def.devices.iter().filter(|device| device.line == self.line && device.unit == unit);
            on_line.for_each(|device| schedule.answered_late(device.id, self.clock.now()));
        }
    }

    /// A peer may have forgotten a connection, or hold it without ever answering: only a new one shows which.
    pub(super) fn check_connection(&mut self, link: &Link) -> Result<(), LinkExit> {
        let most = UNANSWERED_MAX << self.unheard.min(DOUBLINGS_MAX);
        if !self.settings.transport.has_connection() || link.unanswered < most {
            return Ok(());
        }
        self.unheard += u32::from(link.answers() == 0);
        Err(LinkExit::PortFailed(LineTrouble::Unanswered(link.unanswered)))
    }

    pub(super) fn keep_gap(link: &Link, schedule: &mut Schedule, block: &Block, ended: Timestamp) {
        let gap = link.request_gap(block.unit);
        if !gap.is_zero() {
            schedule.keep_gap(block.device, ended + gap);
        }
    }

    /// Evaluates the outcome of a read and publishes it.
    pub(super) async fn finish_poll(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: Option<usize>,
        block: &Block,
        ReadResult { began, ended: at, took, on_wire, answer, exchange }: ReadResult,
    ) -> Result<(), LinkExit> {
        let response_time = exchange.as_ref().and_then(|exchange| exchange.response_time);
        self.count_read(index, block, &answer, on_wire, exchange.as_deref());
        let is_answer = match &answer {
            Ok(_) => true,
            Err(Fault::Exception(code)) => !code.is_of_gateway(),
            Err(_) => false,
        };
        if is_answer {
            let was_down = schedule.answered(index, block.device, response_time, at);
            self.recheck.answered(block.device, was_down);
            self.identification.answered(block.device, was_down, at);
            index.into_iter().for_each(|index| schedule.spent(index, took));
            self.on_block_answered(link, block);
        }
        match answer {
            Ok(values) => {
                self.publish_values(at, block, &values, response_time.unwrap_or_default(), exchange).await?;
                self.bisection.answered(block);
                self.refused_all.remove(&block.unit);
                let disproved = self.unreadable.disproved(block);
                self.replan(link, schedule, at, disproved);
            }
            Err(fault @ Fault::Exception(code)) if is_answer => {
                self.publish_failure(at, block.device, block.tags.to_vec(), fault, exchange).await?;
                let Some(index) = index else { return Ok(()) };
                schedule.reschedule(index, at);
                let its_own = link.outstanding(block.unit).is_clear();
                let parts = (its_own && may_be_cut(code))
                    .then(|| self.bisection.refused(&self.def, &self.unreadable, block))
                    .flatten();
                let Some(parts) = parts else {
                    schedule.on_exception(index, code, at);
                    return Ok(());
                };
                tracing::debug!(address = block.address, count = block.count, %code, "the block is split");
                let mut blocks = self.blocks.clone();
                blocks.splice(index..=index, parts);
                self.use_plan(Some(link), schedule, blocks, at);
                self.replan(link, schedule, at, false);
            }
            Err(fault) => {
                index.into_iter().for_each(|index| schedule.reschedule(index, at));
                self.publish_failure(at, block.device, block.tags.to_vec(), fault, exchange).await?;
                self.on_failure(link, schedule, index, block, fault, (began, took)).await?;
            }
        }
        Ok(())
    }

    /// A read has failed, neither with values nor with an exception of its device.
    async fn on_failure(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: Option<usize>,
        block: &Block,
        fault: Fault,
        (began, took): (Timestamp, Duration),
    ) -> Result<(), LinkExit> {
        let at = self.clock.now();
        if fault == Fault::Timeout {
            self.hangups.outlived(block);
            link.set_alone(!self.hangups.is_clear());
        }
        // It has answered, and is left alone until nothing more can come.
        if let Some(settles_in) = link.settles_in(block.unit).filter(|_| fault == Fault::OutOfSync) {
            schedule.hold_off(block.device, at + self.clock.plant_span(settles_in));
            return Ok(());
        }
        if let (Some(index), Fault::OutOfSync) = (index, fault) {
            // Nothing that it sends within a timeout proves anything.
            schedule.later(index, at + self.clock.plant_span(self.settings.timeout));
        }
        if schedule.failed(index, block.device, failure_of(fault), (began, took), at) {
            let tags = self.def.tags_of(block.device).map(|tag| tag.id).collect();
            self.publish_failure(at, block.device, tags, Fault::BackedOff, None).await?;
            // A search of what it does not have would never end.
            let searched = self.bisection.is_open();
            self.replan(link, schedule, at, searched);
        }
        match index {
            Some(index) if fault == Fault::Timeout => self.try_shorter(link, schedule, index, block).await,
            _ => Ok(()),
        }
    }

    /// A block that was always silent is asked for in part: if that is answered, the device gives no more at once.
    async fn try_shorter(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        index: usize,
        block: &Block,
    ) -> Result<(), LinkExit> {
        let given = self.bisection.given(block);
        let is_asked = self.blocks.get(index) == Some(block) && schedule.may_be_too_long(index);
        let Some(([part, _], _)) = plan::split(&self.def, block).filter(|_| is_asked && given < block.count) else {
            return Ok(());
        };
        match self.read_unless_stopped(link, &part, None).await {
            Some(Ok(_)) => {
                let (now, most) = (self.clock.now(), part.count.max(given));
                tracing::warn!(unit = block.unit, count = block.count, most, "silent when asked for more at once");
                schedule.answered(None, block.device, None, now);
                self.unreadable.limit(block.unit, block.table, most, block.count);
                self.plan_again(link, schedule, now);
                Ok(())
            }
            Some(Err(LinkError::Gone(why))) => Err(LinkExit::Gone(why)),
            Some(Err(LinkError::Fault(_))) | None => Ok(()),
        }
    }

    /// Counts how a read has ended, and what a good one has taken.
    fn count_read(
        &mut self,
        index: Option<usize>,
        block: &Block,
        answer: &Result<Vec<u16>, Fault>,
        on_wire: Duration,
        exchange: Option<&Exchange>,
    ) {
        let Some(exchange) = exchange else { return };
        let outcome = answer.as_ref().map(drop).map_err(|fault| *fault);
        self.stats.polled(index, block.device, outcome, exchange.response_time, exchange.tries);
        if outcome.is_ok() {
            let wire = Wire::new(&self.settings, self.def.device(block.device));
            self.stats.took(index, block, wire, on_wire);
        }
    }

    /// Reads a block once the unit is in sync. `None`: a stop has come, and what was on the wire is given up for it.
    pub(super) async fn read_unless_stopped(
        &mut self,
        link: &mut Link,
        block: &Block,
        index: Option<usize>,
    ) -> Option<Result<Vec<u16>, LinkError>> {
        let mut retried_fault = None;
        let read = if self.requests.stop_waits() {
            None
        } else {
            self.requests.unless_stopped(read_in_sync(&self.blocks, link, block, &mut retried_fault)).await
        };
        // A retry that cures it must not hide it.
        if let Some(fault) = retried_fault {
            self.stats.polled(index, block.device, Err(fault), None, 1);
        }
        if read.is_none() {
            link.abandon();
        }
        read
    }

    /// Plans again when a bisection has ended, or when known unreadable ranges were `wrong`.
    pub(super) fn replan(&mut self, link: &mut Link, schedule: &mut Schedule, at: Timestamp, wrong: bool) {
        if wrong {
            self.bisection.reset();
        }
        let found = self.bisection.conclude(&mut self.unreadable);
        if wrong || found.replan {
            self.plan_again(link, schedule, at);
        }
        // What the unit has not been asked for yet goes first: it may be there.
        for (index, block) in self.blocks.iter().enumerate().filter(|(_, block)| found.disbelieves(block)) {
            let (backoff, until) = self.refused_all.entry(block.unit).or_insert_with(|| (Backoff::for_ports(), at));
            if *until <= at {
                *until = at + backoff.fail();
            }
            schedule.later(index, *until);
        }
    }

    /// Plans with what is known of unreadable ranges and with what operators have asked for.
    pub(super) fn plan_again(&mut self, link: &mut Link, schedule: &mut Schedule, at: Timestamp) {
        self.bisection.restart();
        let blocks = plan::blocks_with_unpolled(&self.def, self.line, &self.unreadable, &self.requested);
        self.use_plan(Some(link), schedule, blocks, at);
    }

    pub(super) fn use_plan(
        &mut self,
        link: Option<&mut Link>,
        schedule: &mut Schedule,
        blocks: Vec<Block>,
        at: Timestamp,
    ) {
        self.stats.replan(&self.blocks, &blocks);
        self.stats.admit(&self.def, &self.settings, &blocks);
        schedule.replan(&blocks, at);
        let wide = WideAddresses::of(&self.def, self.line);
        match link {
            Some(link) => link.expect(&blocks, wide),
            None => {
                self.memory.replies.set_wide(wide);
                self.memory.replies.expect(&blocks);
            }
        }
        self.hangups.keep(&blocks);
        self.blocks = blocks;
    }

    async fn publish_values(
        &mut self,
        at: Timestamp,
        block: &Block,
        values: &[u16],
        response_time: Duration,
        exchange: Option<Arc<Exchange>>,
    ) -> Result<(), LinkExit> {
        let (mut numbers, mut texts, mut corrupt) = (Vec::with_capacity(block.tags.len()), Vec::new(), Vec::new());
        for tag in block.tags.iter().map(|tag| self.def.tag(*tag)) {
            match (value_of(tag, block, values), text_of(tag, block, values)) {
                (Some(value), _) => numbers.push((tag.id, value)),
                (None, Some(text)) => texts.push((tag.id, text)),
                (None, None) => corrupt.push(tag.id),
            }
        }
        self.publish(Event::Read {
            at,
            device: block.device,
            values: numbers,
            texts,
            response_time,
            exchange: exchange.clone(),
        })
        .await?;
        if !corrupt.is_empty() {
            self.publish_failure(at, block.device, corrupt, Fault::NotANumber, exchange).await?;
        }
        Ok(())
    }
}

fn failure_of(fault: Fault) -> Failure {
    match fault.kind() {
        _ if fault == Fault::Hangup => Failure::Hangup,
        FaultKind::Exception(_) => Failure::OfGateway,
        FaultKind::Corrupt | FaultKind::NotANumber => Failure::Corrupt,
        FaultKind::OutOfSync | FaultKind::NotHeard | FaultKind::Unproven => Failure::Doubt,
        FaultKind::Timeout | FaultKind::NotConnected | FaultKind::BackedOff => Failure::Silence,
    }
}
