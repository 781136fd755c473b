//! What is read of one tag beside the polls, before a write and after it.

use super::{
    LinkExit, Task,
    read::{held_by, read_alone},
};
use crate::{
    bus::{io::link::Link, plan},
    plant::{
        tag::{Access, TagDef},
        tag_value::TagValue,
    },
};

impl Task<'_> {
    /// Publishes what a tag holds. The power of ten that scales it is read after it: else what it held before would stand as good
    /// until the next poll of the power, although it is known to be another. Returns the decimals by which it scales now.
    pub(super) async fn publish_alone(
        &mut self,
        link: &mut Link,
        tag: &TagDef,
        held: &TagValue,
    ) -> Result<Option<i8>, LinkExit> {
        self.publish(read_alone(link, tag, held, self.clock.now())).await?;
        let def = self.def.clone();
        let power = tag.decimals.power_source().map(|source| def.tag(source));
        let is_read = |power: &&TagDef| {
            def.device(power.device).line == def.device(tag.device).line
                && power.calculation.is_none()
                && power.stated.is_none()
                && power.access != Access::Write
        };
        let Some(power) = power.filter(is_read) else { return Ok(None) };
        let block = plan::single(def.device(power.device), power);
        // One that is not read leaves the value uncertain; the next request shows that the port is closed.
        if let Some(Ok(words)) = self.read_unless_stopped(link, &block, None).await
            && let Some(held) = held_by(power, &block, &words)
        {
            self.publish(read_alone(link, power, &held, self.clock.now())).await?;
            return Ok(held.number().and_then(|power| tag.decimals.announced(power.near())));
        }
        Ok(None)
    }
}
