//! Reading a tag before it is written, where what its author saw was read long ago.

use super::{LinkExit, Task, read::held_by};
use crate::{
    bus::{
        io::link::{Link, LinkError},
        plan,
    },
    plant::{command::WriteJob, event::WriteResult, fault::Fault, scale, tag::TagDef, tag_value::TagValue},
};

/// What a tag held before its write.
pub(super) enum ReadBefore {
    /// What the author of the write saw, and not what is to be written.
    AsSeen,
    /// The write ends without having been sent.
    Ended(WriteResult),
}

impl Task<'_> {
    /// Reads a tag before it is written; `None` when a stop came meanwhile.
    pub(super) async fn read_before(
        &mut self,
        link: &mut Link,
        tag: &TagDef,
        job: &WriteJob,
        seen: &TagValue,
    ) -> Result<Option<ReadBefore>, LinkExit> {
        let def = self.def.clone();
        let block = plan::single(def.device(tag.device), tag);
        let ended = |fault| Ok(Some(ReadBefore::Ended(WriteResult::NotSent(fault))));
        let held = match self.read_unless_stopped(link, &block, None).await {
            Some(Ok(words)) => held_by(tag, &block, &words),
            Some(Err(LinkError::Fault(fault))) => return ended(fault),
            // The next request shows that the port is closed.
            Some(Err(LinkError::Gone(_))) => return ended(Fault::NotConnected),
            None => return Ok(None),
        };
        let Some(held) = held else { return ended(Fault::NotANumber) };
        let scaled_by = self.publish_alone(link, tag, &held).await?;
        let is = |other: &TagValue| match (&held, other) {
            (TagValue::Number(held), TagValue::Number(other)) => scale::same_raw(tag, *held, *other),
            (held, other) => held == other,
        };
        // By another power of ten the number would be another value.
        let is_meant = scaled_by.is_none() || scaled_by == job.unscaled_by;
        let may = is_meant && is(seen) && !is(&job.raw);
        Ok(Some(if may { ReadBefore::AsSeen } else { ReadBefore::Ended(WriteResult::Held(held)) }))
    }
}
