//! Reading blocks over Modbus TCP: several requests are under way at once, and each answer is taken as it comes.

use std::sync::Arc;

use jiff::Timestamp;
use tokio::time::Instant;

use super::{LinkExit, Task, poll::ReadResult, read::parse};
use crate::{
    bus::{
        io::{
            link::{Ended as Answered, Link},
            requests::STOP_WAIT,
        },
        plan::Block,
        schedule::{Next, Schedule},
    },
    plant::{def::DeviceId, fault::Fault, time::elapsed},
};

/// A read that is under way over Modbus TCP.
pub(super) struct UnderWay {
    /// Its transaction.
    id: u16,
    /// Where its block stood in the plan.
    index: usize,
    block: Block,
    began: Timestamp,
    /// What was wrong with the answer to its first try, if this is the second.
    misfit: Option<Fault>,
    /// Others that were under way when it was sent.
    beside: usize,
}

impl Task<'_> {
    /// Sends what is due over Modbus TCP, as far as there is room. If there is none for more, waits for an answer.
    pub(super) async fn poll_tcp(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        first: usize,
    ) -> Result<(), LinkExit> {
        let now = self.clock.now();
        let mut next = Next::Run(first);
        let full = loop {
            let Next::Run(index) = next else { break false };
            // After a write, say, or a read-back.
            if let Some(left) = link.gap_left(self.blocks[index].unit) {
                schedule.keep_gap(self.blocks[index].device, now + left);
                next = schedule.next(now);
                continue;
            }
            if !link.has_room(self.blocks[index].unit) {
                break true;
            }
            self.begin(link, schedule, (index, self.blocks[index].clone()), now, None);
            schedule.begin(index, now);
            if link.is_full() {
                break true;
            }
            next = schedule.next(now);
        };
        self.send(link, schedule, full).await
    }

    /// Sends what was submitted, and waits for an answer if there is no room for more; all of it is given up for a stop.
    async fn send(&mut self, link: &mut Link, schedule: &mut Schedule, full: bool) -> Result<(), LinkExit> {
        let sent = async {
            link.flush().await?;
            if full { link.wait_for_answer().await } else { Ok(()) }
        };
        let sent = self.requests.unless_stopped(sent).await;
        if sent.is_none() {
            self.give_up_reads(link, schedule);
        }
        sent.unwrap_or(Ok(())).map_err(LinkExit::from)
    }

    /// What is under way is read later: a stop cannot wait for it.
    fn give_up_reads(&mut self, link: &mut Link, schedule: &mut Schedule) {
        link.give_up_all();
        let now = self.clock.now();
        for UnderWay { index, block, began, .. } in std::mem::take(&mut self.under_way) {
            if let Some(index) = self.place_of(index, &block) {
                let served = schedule.done(index, began, now);
                self.stats.served(index, served.jitter, served.missed);
                schedule.reschedule(index, now);
            }
        }
    }

    fn begin(
        &mut self,
        link: &mut Link,
        schedule: &Schedule,
        (index, block): (usize, Block),
        began: Timestamp,
        misfit: Option<Fault>,
    ) {
        let response_timeout = schedule.response_timeout(index);
        let id = link.submit(&block.request(), response_timeout);
        let beside = self.under_way.len();
        self.under_way.push(UnderWay { id, index, block, began, misfit, beside });
    }

    /// Takes what has come of the requests under way.
    pub(super) async fn receive_replies(&mut self, link: &mut Link, schedule: &mut Schedule) -> Result<(), LinkExit> {
        for Answered { id, answer, at, mut exchange } in link.take_ended() {
            let Some(place) = self.under_way.iter().position(|read| read.id == id) else { continue };
            let UnderWay { index, block, began, misfit, beside, .. } = self.under_way.swap_remove(place);
            let index = self.place_of(index, &block);
            let answer = answer.and_then(|answer| parse(&block, &answer));
            if let (Err(fault), Some(index), None) = (&answer, index, misfit)
                && fault.is_corrupt()
                && link.has_room(block.unit)
                && link.gap_left(block.unit).is_none()
            {
                // A retry that cures it must not hide it.
                self.stats.polled(Some(index), block.device, Err(*fault), None, 1);
                let misfit = Some(*fault);
                self.begin(link, schedule, (index, block), self.clock.now(), misfit);
                continue;
            }
            Arc::make_mut(&mut exchange).tries = if misfit.is_some() { 2 } else { 1 };
            let ended = self.clock.at(at);
            let device = self.def.device(block.device);
            // It has taken one of the places that there are.
            let places = u32::from(device.limits.in_flight_max.max(1));
            let took = elapsed(began, ended) / places;
            let on_wire = self.clock.plant_span(exchange.response_time.unwrap_or_default()) / places;
            let lost = answer.as_ref().is_err_and(|fault| *fault == Fault::Timeout);
            self.note_fate(link, &block, beside, lost && index.is_some_and(|index| schedule.lives(index)));
            if let Some(index) = index {
                let served = schedule.done(index, began, ended);
                self.stats.served(index, served.jitter, served.missed);
                Self::keep_gap(link, schedule, &block, ended);
            }
            let outcome = ReadResult { began, ended, took, on_wire, answer, exchange: Some(exchange) };
            self.finish_poll(link, schedule, index, &block, outcome).await?;
        }
        self.note_late(link, schedule);
        self.send(link, schedule, false).await
    }

    /// Waits until nothing of a device is under way, so that no value that was read before what comes next is shown after it.
    /// For an `urgent` one what does not end soon is given up; another one gives way to a stop: `false`.
    pub(super) async fn wait_until_idle(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        device: DeviceId,
        urgent: bool,
    ) -> Result<bool, LinkExit> {
        let (unit, until) = (self.def.device(device).unit, Instant::now() + STOP_WAIT);
        while !link.is_free(unit) {
            let answer = link.wait_for_answer();
            let waited = match urgent {
                true => tokio::time::timeout_at(until, answer).await.ok(),
                false => self.requests.unless_stopped(answer).await,
            };
            let Some(waited) = waited else {
                self.give_up_reads(link, schedule);
                return Ok(urgent);
            };
            if let Err(error) = waited {
                return Err(LinkExit::from(error));
            }
            self.receive_replies(link, schedule).await?;
        }
        Ok(true)
    }

    /// The connection is gone: what was under way on it, and what was wrong with the answer to its first try.
    pub(super) fn cut_off(&mut self, schedule: &mut Schedule) -> Vec<(Block, Option<Fault>)> {
        let now = self.clock.now();
        let mut cut: Vec<_> = std::mem::take(&mut self.cut).into_iter().map(|block| (block, None)).collect();
        for UnderWay { index, block, began, misfit, .. } in std::mem::take(&mut self.under_way) {
            if let Some(index) = self.place_of(index, &block) {
                let served = schedule.done(index, began, now);
                self.stats.served(index, served.jitter, served.missed);
            }
            cut.push((block, misfit));
        }
        let places = cut.iter().filter_map(|(block, _)| self.blocks.iter().position(|planned| planned == block));
        places.for_each(|index| schedule.cut(index, now));
        cut
    }

    /// Where a block stands that stood at `planned_at`: another answer may have changed the plan meanwhile.
    fn place_of(&self, planned_at: usize, block: &Block) -> Option<usize> {
        if self.blocks.get(planned_at).is_some_and(|planned| planned == block) {
            return Some(planned_at);
        }
        self.blocks.iter().position(|planned| planned == block)
    }
}
