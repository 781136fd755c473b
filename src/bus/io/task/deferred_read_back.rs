//! Writes whose result is not known: what the device holds is read as soon as the unit is in sync, never written again.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::{LinkExit, Task, read::held_by};
use crate::{
    bus::{
        backoff::Backoff,
        io::link::{Link, LinkError},
        plan,
        schedule::Schedule,
    },
    plant::{command::WriteId, def::TagId, event::WriteResult, fault::Fault},
};

/// What cannot be read for so long (plant time) stays unconfirmed.
const DEFER_MAX: SignedDuration = SignedDuration::from_secs(30);

/// A write that was not answered, or not read back. The plant has no more than one of a tag under
/// way, and a stop beside it, which is never one of these.
pub(super) struct Unconfirmed {
    id: WriteId,
    tag: TagId,
    /// How it has ended unless the tag can be read.
    result: WriteResult,
    /// When it is read next, and when that is given up.
    next: Timestamp,
    until: Timestamp,
    backoff: Backoff,
}

impl Task<'_> {
    /// Remembers a write whose result is not known; what was read before it becomes uncertain.
    pub(super) async fn defer_read_back(
        &mut self,
        id: WriteId,
        tag: TagId,
        result: WriteResult,
        fault: Fault,
    ) -> Result<(), LinkExit> {
        let now = self.clock.now();
        let until = now.checked_add(DEFER_MAX).unwrap_or(Timestamp::MAX);
        self.unconfirmed.push(Unconfirmed { id, tag, result, next: now, until, backoff: Backoff::default() });
        self.publish_failure(now, self.def.tag(tag).device, vec![tag], fault, None).await
    }

    /// Is it time to read one of them?
    pub(super) fn is_turn_of_deferred_read_back(&self, now: Timestamp) -> bool {
        self.unconfirmed.iter().any(|write| write.next <= now)
    }

    /// Reads the tag of the first that is due, and publishes the result of its write if it is known now.
    pub(super) async fn deferred_read_back(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
    ) -> Result<(), LinkExit> {
        let now = self.clock.now();
        let Some(index) = self.unconfirmed.iter().position(|write| write.next <= now) else { return Ok(()) };
        let def = self.def.clone();
        let tag = def.tag(self.unconfirmed[index].tag);
        if !self.wait_until_idle(link, schedule, tag.device, false).await? {
            return Ok(());
        }
        let block = plan::single(def.device(tag.device), tag);
        let back = self.read_unless_stopped(link, &block, None).await;
        let at = self.clock.now();
        let held = match back {
            Some(Ok(words)) => held_by(tag, &block, &words),
            Some(Err(LinkError::Fault(_))) => None,
            Some(Err(LinkError::Gone(why))) => return Err(LinkExit::Gone(why)),
            None => return Ok(()),
        };
        let Some(held) = held else {
            let write = &mut self.unconfirmed[index];
            let wait = SignedDuration::try_from(write.backoff.fail()).unwrap_or(DEFER_MAX);
            write.next = at.checked_add(wait).unwrap_or(Timestamp::MAX);
            if write.until < write.next {
                let write = self.unconfirmed.remove(index);
                self.publish_write_result(write.id, write.result).await?;
            }
            return Ok(());
        };
        let response_time = link.last.as_ref().and_then(|exchange| exchange.response_time);
        let known = response_time.filter(|response_time| *response_time > Duration::ZERO);
        schedule.answered(None, tag.device, known, at);
        self.publish_alone(link, tag, &held).await?;
        let write = self.unconfirmed.remove(index);
        let result = match write.result {
            WriteResult::NoValidResponse(fault) => WriteResult::ReadBackAfterFault(fault, held),
            _ => WriteResult::ReadBack(held),
        };
        self.publish_write_result(write.id, result).await
    }

    /// The tag was written again, with or without effect: what it holds now says nothing about an earlier write.
    pub(super) async fn end_unconfirmed(&mut self, tag: TagId) -> Result<(), LinkExit> {
        let ended: Vec<Unconfirmed> = self.unconfirmed.extract_if(.., |write| write.tag == tag).collect();
        for write in ended {
            self.publish_write_result(write.id, write.result).await?;
        }
        Ok(())
    }

    /// The port is left: nothing more can be learned of them in time.
    pub(super) async fn give_up_unconfirmed(&mut self) -> Result<(), LinkExit> {
        for write in std::mem::take(&mut self.unconfirmed) {
            self.publish_write_result(write.id, write.result).await?;
        }
        Ok(())
    }
}
