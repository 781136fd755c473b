//! Writing: once, read back, never repeated.

use super::{LinkExit, Task, read::held_by, read_before::ReadBefore};
use crate::{
    bus::{
        codec,
        io::link::{Link, LinkError},
        pdu::Pdu,
        plan,
        schedule::Schedule,
    },
    plant::{
        command::{BusRequest, WriteJob},
        def::{ActionDef, DeviceDef},
        event::{Event, WriteResult},
        exact::Exact,
        fault::Fault,
        line_trouble::LineTrouble,
        scale,
        tag::{Table, TagDef},
        tag_value::TagValue,
    },
};

/// What became of a write.
enum WriteEnd {
    /// It ended, well or not.
    Ended(WriteResult),
    /// The port closed; the result to report, and why it closed.
    PortClosed(WriteResult, LineTrouble),
}

/// What became of the unlock register that a write needs.
enum Unlocked {
    /// The write may be sent.
    Yes,
    /// The write ends without having been sent.
    No(WriteEnd),
}

impl Task<'_> {
    /// Performs a write and reports its result; one that a stop has overtaken waits again and has none yet.
    pub(super) async fn write(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        job: &WriteJob,
    ) -> Result<(), LinkExit> {
        let def = self.def.clone();
        let (id, tag) = (job.id, def.tag(job.tag));
        if job.urgent {
            link.shorten_hold_off();
        }
        // One that is left alone now is not read either, and its write not sent.
        let is_left_alone = schedule.is_down(tag.device) || schedule.is_resting(tag.device, self.clock.now());
        if let Some(seen) = job.over.as_ref().filter(|_| !is_left_alone) {
            match self.read_before(link, tag, job, seen).await? {
                Some(ReadBefore::AsSeen) => {}
                Some(ReadBefore::Ended(result)) => return self.publish_write_result(id, result).await,
                // A stop goes first.
                None => {
                    self.requests.defer(BusRequest::Write(job.clone()));
                    return Ok(());
                }
            }
        }
        let unlocked = match job.unlock {
            Some((unlock_tag, raw)) => self.unlock(link, schedule, def.tag(unlock_tag), raw, job).await?,
            None => Unlocked::Yes,
        };
        let written = match unlocked {
            Unlocked::Yes => self.write_once(link, schedule, job).await,
            Unlocked::No(written) => written,
        };
        let result = match written {
            // It waits again, unless the stop is one of its tag.
            WriteEnd::Ended(WriteResult::Superseded) => {
                self.requests.defer(BusRequest::Write(job.clone()));
                return Ok(());
            }
            WriteEnd::Ended(result) => result,
            WriteEnd::PortClosed(result, why) => {
                self.publish_write_result(id, result).await?;
                return Err(LinkExit::Gone(why));
            }
        };
        // The write of the unlock register is lost where the write of the value was not sent for want of an answer.
        let unanswered =
            matches!(result, WriteResult::NoValidResponse(Fault::Timeout) | WriteResult::NotSent(Fault::Timeout));
        if may_have_effect(&result) {
            self.end_unconfirmed(tag.id).await?;
        }
        self.publish_value(link, schedule, tag, &result).await?;
        match result {
            // A stop may be requested again at once.
            WriteResult::NoValidResponse(fault) | WriteResult::NotRead(fault) if job.verify && !job.urgent => {
                self.defer_read_back(id, tag.id, result, fault).await?;
            }
            result => self.publish_write_result(id, result).await?,
        }
        // It may still be queued here or on the way; closing the connection discards it. A waiting stop does not wait for
        // another connection and follows it on this one.
        let closes = self.settings.transport.has_connection();
        if closes && unanswered && !self.requests.stop_waits() { Err(LinkExit::UsedUp) } else { Ok(()) }
    }

    /// Publishes the value that was read back, or has the value read again that a write has made unknown.
    async fn publish_value(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        tag: &TagDef,
        result: &WriteResult,
    ) -> Result<(), LinkExit> {
        match result {
            WriteResult::ReadBack(held) => {
                self.publish_alone(link, tag, held).await?;
            }
            // The value is unknown until it is read again.
            WriteResult::NotRead(_) | WriteResult::Accepted | WriteResult::Sent | WriteResult::NoValidResponse(_) => {
                schedule.refresh(tag.device, self.clock.now());
            }
            // The unlock register may have changed since it was read.
            WriteResult::Refused(_) if tag.write_unlock.is_some() => schedule.refresh(tag.device, self.clock.now()),
            WriteResult::Refused(_)
            | WriteResult::Held(_)
            | WriteResult::NotSent(_)
            | WriteResult::Superseded
            | WriteResult::ReadBackAfterFault(..) => {}
        }
        Ok(())
    }

    /// Writes the unlock register, reports that and has it read again.
    async fn unlock(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        unlock_tag: &TagDef,
        raw: Exact,
        job: &WriteJob,
    ) -> Result<Unlocked, LinkExit> {
        // An unlock register of another device would be written to an address of this one.
        if unlock_tag.device != self.def.tag(job.tag).device {
            return Ok(Unlocked::No(WriteEnd::Ended(WriteResult::NotSent(Fault::NotANumber))));
        }
        let sent = self.send_value(link, schedule, unlock_tag, &raw.into(), job.urgent).await;
        if let Ok(ended @ (WriteResult::NotSent(_) | WriteResult::Superseded)) = sent {
            return Ok(Unlocked::No(WriteEnd::Ended(ended)));
        }
        let result = sent.clone().unwrap_or(WriteResult::NoValidResponse(Fault::NotConnected));
        self.publish(Event::Unlocked { at: self.clock.now(), id: job.id, unlock_tag: unlock_tag.id, result }).await?;
        schedule.refresh(unlock_tag.device, self.clock.now());
        if sent.as_ref().is_ok_and(may_have_effect) {
            self.end_unconfirmed(unlock_tag.id).await?;
        }
        Ok(match sent {
            Ok(WriteResult::Accepted | WriteResult::Sent) => Unlocked::Yes,
            // A stop is tried all the same: an unlock register without a reply may have arrived.
            Ok(WriteResult::NoValidResponse(_)) if job.urgent => Unlocked::Yes,
            // The value itself was never on the wire.
            Ok(WriteResult::NoValidResponse(fault)) => Unlocked::No(WriteEnd::Ended(WriteResult::NotSent(fault))),
            Ok(refused) => Unlocked::No(WriteEnd::Ended(refused)),
            Err(why) => Unlocked::No(WriteEnd::PortClosed(WriteResult::NotSent(Fault::NotConnected), why)),
        })
    }

    /// Sends one value: accepted, sent to all, refused, without a valid response, not sent, or overtaken by a stop of any tag. `Err`: the port closed.
    async fn send_value(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        tag: &TagDef,
        raw: &TagValue,
        urgent: bool,
    ) -> Result<WriteResult, LineTrouble> {
        let def = self.def.clone();
        let device = def.device(tag.device);
        // A stop is sent in any case: a silent device may still receive it.
        let backed_off = schedule.is_down(tag.device) || schedule.is_resting(tag.device, self.clock.now());
        if backed_off && !urgent {
            return Ok(WriteResult::NotSent(Fault::BackedOff));
        }
        let request = match self.request_for(link, tag, raw).await? {
            Ok(request) => request,
            Err(not_sent) => return Ok(not_sent),
        };
        // A stop does not wait for an unambiguous response: its refusal may then be reported as a missing response.
        let own =
            (urgent && is_clear(link, device)) || (!urgent && self.has_no_outstanding_reply(link, device).await?);
        // Nothing else goes out before a stop that waits.
        if !urgent && self.requests.stop_waits() {
            return Ok(WriteResult::Superseded);
        }
        let sent = self.send_write(link, device, request, urgent && !backed_off).await;
        self.keep_write_gap(link, schedule, device);
        match sent {
            Ok(()) => {
                schedule.answered(None, tag.device, None, self.clock.now());
                let to_all = link.framing().is_broadcast(device.unit);
                Ok(if to_all { WriteResult::Sent } else { WriteResult::Accepted })
            }
            Err(LinkError::Gone(why)) => Err(why),
            Err(LinkError::Fault(Fault::Exception(code))) if own && code.is_refusal() => Ok(WriteResult::Refused(code)),
            Err(LinkError::Fault(fault)) => Ok(WriteResult::NoValidResponse(fault)),
        }
    }

    /// The request that writes a value, or the result where there is none. `Err`: the port closed.
    async fn request_for(
        &mut self,
        link: &mut Link,
        tag: &TagDef,
        raw: &TagValue,
    ) -> Result<Result<Pdu, WriteResult>, LineTrouble> {
        let request = match raw {
            TagValue::Number(raw) if tag.read_modify_write => return self.modified(link, tag, *raw).await,
            TagValue::Number(raw) => write_request(tag, *raw),
            TagValue::Text(text) => text_request(tag, text),
        };
        // A value that the codec cannot hold was refused by the plant before; nothing is sent in any case.
        Ok(request.ok_or(WriteResult::NotSent(Fault::NotANumber)))
    }

    /// Writes once and reads back.
    async fn write_once(&mut self, link: &mut Link, schedule: &mut Schedule, job: &WriteJob) -> WriteEnd {
        let def = self.def.clone();
        let tag = def.tag(job.tag);
        let accepted = match self.send_value(link, schedule, tag, &job.raw, job.urgent).await {
            Ok(accepted @ (WriteResult::Accepted | WriteResult::Sent)) => accepted,
            Ok(ended) => return WriteEnd::Ended(ended),
            // It may or may not have arrived.
            Err(why) => return WriteEnd::PortClosed(WriteResult::NoValidResponse(Fault::NotConnected), why),
        };
        let device = def.device(tag.device);
        // An action such as saving to non-volatile memory wants the device left alone, not the line.
        let is_sent =
            |action: &ActionDef| scale::to_raw(tag, action.value, 0).map(TagValue::Number).as_ref() == Some(&job.raw);
        let is_this = |action: &&ActionDef| action.tag == tag.id && is_sent(action);
        if let Some(action) = device.actions.iter().find(is_this) {
            schedule.hold_off(tag.device, self.clock.now() + action.settle);
        }
        if !job.verify || accepted == WriteResult::Sent {
            return WriteEnd::Ended(accepted);
        }
        let block = plan::single(device, tag);
        WriteEnd::Ended(match self.read_unless_stopped(link, &block, None).await {
            Some(Ok(words)) => match held_by(tag, &block, &words) {
                Some(back) => WriteResult::ReadBack(back),
                None => WriteResult::NotRead(Fault::NotANumber),
            },
            // The device has accepted it; the next request shows that the port is closed.
            Some(Err(LinkError::Gone(_))) => WriteResult::NotRead(Fault::NotConnected),
            Some(Err(LinkError::Fault(fault))) => WriteResult::NotRead(fault),
            None => WriteResult::NotRead(Fault::Timeout),
        })
    }

    /// An exception names no address: only from a unit without outstanding replies is it certainly the response to this
    /// write. `Err`: the port closed.
    async fn has_no_outstanding_reply(&mut self, link: &mut Link, device: &DeviceDef) -> Result<bool, LineTrouble> {
        if is_clear(link, device) {
            return Ok(true);
        }
        match self.requests.unless_stopped(link.loopback(device.unit)).await {
            Some(Ok(())) => Ok(true),
            Some(Err(LinkError::Fault(_))) => Ok(link.outstanding(device.unit).is_clear()),
            Some(Err(LinkError::Gone(why))) => Err(why),
            None => {
                link.abandon();
                Ok(false)
            }
        }
    }

    /// The device is left alone for a while after a write; the others are not, unless it was a broadcast.
    fn keep_write_gap(&self, link: &mut Link, schedule: &mut Schedule, device: &DeviceDef) {
        if device.unit == 0 {
            link.hold_off_plant_time(device.write_gap);
            return;
        }
        let gap = device.write_gap.max(link.request_gap(device.unit));
        if !gap.is_zero() {
            schedule.keep_gap(device.id, self.clock.now() + gap);
            link.set_unit_gap(device.unit, gap);
        }
    }

    /// Sends a write. Unless it `keeps` the line, it waits for its answer no longer than a stop behind it allows.
    async fn send_write(
        &mut self,
        link: &mut Link,
        device: &DeviceDef,
        request: Pdu,
        keeps: bool,
    ) -> Result<(), LinkError> {
        // If the port is lost, the previous exchange, perhaps of another device, is not counted for this one.
        link.last = None;
        let message = request.to(device.unit);
        let sent = link.exchange(&message);
        let sent = if keeps { Some(sent.await) } else { self.requests.unless_stopped(sent).await };
        let Some(sent) = sent else {
            link.abandon();
            return Err(Fault::Timeout.into());
        };
        if let Some(last) = &link.last {
            self.stats.asked(device.id, last.outcome, last.response_time);
        }
        sent.map(drop)
    }
}

/// May a write with this result have changed its tag?
fn may_have_effect(result: &WriteResult) -> bool {
    !matches!(
        result,
        WriteResult::Refused(_) | WriteResult::Held(_) | WriteResult::NotSent(_) | WriteResult::Superseded
    )
}

/// Can no outstanding reply be taken for the next one?
fn is_clear(link: &Link, device: &DeviceDef) -> bool {
    device.unit == 0 || link.outstanding(device.unit).is_clear()
}

/// The request that writes a text: function 16, or 6 for one register.
fn text_request(tag: &TagDef, text: &str) -> Option<Pdu> {
    let words = codec::encode_text(tag.write_point(), text)?;
    (tag.write_point().table == Table::Holding).then(|| write_words(tag, &words))
}

/// The request that writes a raw number: function 5 or 6 for one, 15 or 16 for more or where the profile says so, 22 for
/// a field of bits, 23 where the profile wants the new value in the response.
fn write_request(tag: &TagDef, raw: Exact) -> Option<Pdu> {
    let point = tag.write_point();
    let address = point.address;
    match point.table {
        // A discrete input is written only where the profile names the function for it.
        Table::Discrete if tag.write_fc.is_none() => None,
        Table::Coil | Table::Discrete => Some(match tag.write_fc {
            Some(15) => Pdu::write_coils(address, &[u16::from(raw != 0.0)]),
            Some(_) | None => Pdu::write_coil(address, raw != 0.0),
        }),
        Table::Holding if point.part().is_some() => {
            let (and, or) = codec::field_masks(point, raw)?;
            Some(Pdu::mask_write(address, and, or))
        }
        Table::Holding => Some(write_words(tag, &codec::encode(point, raw)?)),
        Table::Input => None,
    }
}

fn write_words(tag: &TagDef, words: &[u16]) -> Pdu {
    let point = tag.write_point();
    match (words, tag.write_fc) {
        ([word], None | Some(6)) => Pdu::write_register(point.address, *word),
        (words, Some(23)) => Pdu::write_and_read(point.address, words),
        (words, _) => Pdu::write_addresses(point.address, point.kind.address_words(), words),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
