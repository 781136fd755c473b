//! Live reads: one request a turn, when the line has nothing else to do or polls have had their share.

use jiff::Timestamp;

use super::{LinkExit, Task, read::read_in_sync, test::POLLS_BETWEEN};
use crate::{
    bus::{
        io::link::{Link, LinkError},
        plan::Block,
        schedule::Next,
    },
    plant::{
        def::DeviceId,
        fault::Fault,
        live::AddressSpan,
        tag::{Poll, PollClass},
        time::elapsed,
    },
};

impl Task<'_> {
    pub(super) fn is_turn_of_live_read(&mut self, next: Next) -> bool {
        let idle = !matches!(next, Next::Run(_));
        let share = self.live_from() <= self.clock.now();
        share && (idle || POLLS_BETWEEN <= self.polls_since_step) && self.live.begin(&mut self.unreadable, self.clock)
    }

    /// From when on a live read may have the line: a request to a silent unit holds up the polls that become due meanwhile,
    /// so it has its share also of idle time, unless there are no polls.
    pub(super) fn live_from(&self) -> Timestamp {
        if self.blocks.is_empty() { Timestamp::MIN } else { self.live_budget.allows_from() }
    }

    /// One request of the live read that is due, and its answer after the last.
    pub(super) async fn live_step(&mut self, link: &mut Link) -> Result<(), LinkExit> {
        (self.polls_since_step, self.stepped) = (0, false);
        let Some((job, request)) = &mut self.live.job else { return Ok(()) };
        if let Some(span) = job.next() {
            let unit = request.read.unit;
            let own = self.def.devices.iter().find(|device| device.line == self.line && device.unit == unit);
            let block = block_of(own.map_or(DeviceId(0), |device| device.id), unit, span);
            let (mut retried_fault, started) = (None, self.clock.now());
            link.last = None;
            let read = self.requests.unless_stopped(read_in_sync(&self.blocks, link, &block, &mut retried_fault)).await;
            let ended = self.clock.now();
            self.live_budget.spent(elapsed(started, ended), ended);
            let words = match read {
                Some(Ok(words)) => Ok(words),
                Some(Err(LinkError::Fault(fault))) => Err(fault),
                Some(Err(LinkError::Gone(why))) => {
                    // Made again, it might end the next connection as well.
                    job.on_outcome(&mut self.unreadable, self.clock.utc(), Err(Fault::Hangup));
                    return Err(LinkExit::Gone(why));
                }
                // A stop comes first; the request is made again.
                None => {
                    link.abandon();
                    return Ok(());
                }
            };
            job.on_outcome(&mut self.unreadable, self.clock.utc(), words);
        }
        if job.next().is_none()
            && let Some((job, request)) = self.live.job.take()
        {
            let response_time = link.last.as_ref().and_then(|exchange| exchange.response_time);
            // A terminal that has left needs no answer.
            let _ = request.reply.send(job.finish(response_time));
        }
        Ok(())
    }
}

/// A span as a block without tags.
fn block_of(device: DeviceId, unit: u8, AddressSpan { table, address, count }: AddressSpan) -> Block {
    let (tags, poll, class) = ([].into(), Poll::Once, PollClass::Background);
    Block { device, unit, table, address, count, tags, poll, class, alignment: 1, address_words: 1 }
}
