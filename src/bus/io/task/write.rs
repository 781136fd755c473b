//! Writing: once, read back, never repeated.

use std::borrow::Cow;

use tokio_modbus::Request;

use super::{Leave, Task, Turn, poll::value_of};
use crate::{
    bus::{
        codec,
        io::link::{Link, Trouble},
        plan,
        schedule::Schedule,
    },
    plant::{
        command::WriteId,
        def::{ActionDef, DeviceDef, Framing},
        event::{Event, Fault, WriteResult},
        scale,
        tag::{Table, TagDef},
    },
};

/// What is to be written: a tag, its raw number, and how.
pub(super) struct Wish<'a> {
    pub tag: &'a TagDef,
    pub raw: f64,
    /// What is written first.
    pub unlock: Option<(&'a TagDef, f64)>,
    /// Read it back afterwards.
    pub verify: bool,
    /// A stop.
    pub urgent: bool,
}

impl Task {
    /// Carries a write and tells how it ended.
    pub(super) async fn write(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        id: WriteId,
        wish: Wish<'_>,
    ) -> Turn {
        let tag = wish.tag;
        let result = match self.write_once(link, schedule, wish).await {
            Ok(result) => result,
            Err(why) => {
                // The port went away under the write: it may or may not have arrived.
                self.tell_wrote(id, WriteResult::Lost(Fault::NotConnected)).await?;
                return Ok(Err(Leave::Lost(why)));
            }
        };
        let tcp = self.settings.transport.serial().is_none();
        let unanswered = tcp && matches!(result, WriteResult::Lost(Fault::Timeout));
        match result {
            WriteResult::ReadBack(raw) => {
                let (device, values) = (tag.device, vec![(tag.id, raw)]);
                let exchange = link.last.clone();
                let reply = exchange.as_ref().and_then(|exchange| exchange.reply).unwrap_or_default();
                self.tell(Event::Read { at: self.clock.now(), device, values, texts: Vec::new(), reply, exchange })
                    .await?;
            }
            // What the device holds now is not known until it is read again.
            WriteResult::NotRead(_) | WriteResult::Accepted | WriteResult::Lost(_) => {
                schedule.refresh(tag.device, self.clock.now());
            }
            WriteResult::Refused(_) | WriteResult::NotSent(_) | WriteResult::Overtaken => {}
        }
        self.tell_wrote(id, result).await?;
        if unanswered {
            // It may still lie in this machine or on the way; a closed connection takes it back.
            return Ok(Err(Leave::Reopen));
        }
        Ok(Ok(()))
    }

    /// Writes once, reads back. `Err` when the port is gone.
    async fn write_once(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        Wish { tag, raw, unlock, verify, urgent }: Wish<'_>,
    ) -> Result<WriteResult, String> {
        let def = self.def.clone();
        let device = def.device(tag.device);
        if schedule.is_down(tag.device) || schedule.is_resting(tag.device, self.clock.now()) {
            return Ok(WriteResult::NotSent(Fault::Resting));
        }
        // A key of another device would be written to an address of this one.
        if unlock.is_some_and(|(key, _)| key.device != tag.device) {
            return Ok(WriteResult::NotSent(Fault::NotANumber));
        }
        for (tag, raw) in unlock.into_iter().chain([(tag, raw)]) {
            // A value that the codec cannot hold was refused by the plant before; nothing is sent in any case.
            let Some(request) = write_request(tag, raw) else { return Ok(WriteResult::NotSent(Fault::NotANumber)) };
            // A stop is not kept waiting for the sake of a clear answer: its refusal may then be told as a loss.
            let own = (urgent && is_clear(link, device)) || (!urgent && self.owes_nothing(link, device).await?);
            match self.send_write(link, device, request).await {
                Ok(()) => schedule.answered(tag.device, self.clock.now()),
                Err(Trouble::Gone(why)) => return Err(why),
                Err(Trouble::Fault(Fault::Exception(code))) if own && code.is_refusal() => {
                    return Ok(WriteResult::Refused(code));
                }
                Err(Trouble::Fault(fault)) => return Ok(WriteResult::Lost(fault)),
            }
        }
        // An action such as saving to non-volatile memory wants the device left alone, not the line.
        let is_this = |action: &&ActionDef| action.tag == tag.id && scale::to_raw(tag, action.value, 0) == Some(raw);
        if let Some(action) = device.actions.iter().find(is_this) {
            schedule.rest(tag.device, self.clock.now() + action.settle);
        }
        if !verify {
            return Ok(WriteResult::Accepted);
        }
        let block = plan::single(device, tag);
        let back = match self.in_step(link, &block).await {
            Ok(()) => self.read_twice(link, &block, None).await,
            Err(trouble) => Err(trouble),
        };
        match back {
            Ok(values) => Ok(match value_of(tag, &block, &values) {
                Some(back) => WriteResult::ReadBack(back),
                None => WriteResult::NotRead(Fault::NotANumber),
            }),
            // The device has accepted it; that the port is gone shows itself at the next request.
            Err(Trouble::Gone(_)) => Ok(WriteResult::NotRead(Fault::NotConnected)),
            Err(Trouble::Fault(fault)) => Ok(WriteResult::NotRead(fault)),
        }
    }

    /// An exception names no address: only from a unit that owes nothing is it certainly the answer to what was sent. `Err`
    /// when the port is gone.
    async fn owes_nothing(&self, link: &mut Link, device: &DeviceDef) -> Result<bool, String> {
        if is_clear(link, device) {
            return Ok(true);
        }
        match link.loopback(device.unit).await {
            Ok(()) => Ok(true),
            Err(Trouble::Fault(_)) => Ok(link.debt(device.unit).is_clear()),
            Err(Trouble::Gone(why)) => Err(why),
        }
    }

    async fn send_write(&mut self, link: &mut Link, device: &DeviceDef, request: Request<'_>) -> Result<(), Trouble> {
        let sent = link.call(device.unit, request).await.map(drop);
        link.rest(device.write_gap);
        if let Some(last) = &link.last {
            self.books.asked(device.id, last.outcome, last.reply);
        }
        sent
    }
}

/// Can no answer that a device still owes be taken for the next one?
fn is_clear(link: &Link, device: &DeviceDef) -> bool {
    let broadcast = device.unit == 0;
    link.framing() == Framing::Mbap || broadcast || link.debt(device.unit).is_clear()
}

/// The request that writes a raw number: function 5 or 6 for one, 15 or 16 for more or where the profile says so, 22 for a
/// field of bits, 23 where the profile wants the answer to bring the new value along.
fn write_request(tag: &TagDef, raw: f64) -> Option<Request<'static>> {
    let address = tag.point.address;
    match tag.point.table {
        // A discrete input is written only where the profile names the function for it.
        Table::Discrete if tag.write_fc.is_none() => None,
        Table::Coil | Table::Discrete => Some(match tag.write_fc {
            Some(15) => Request::WriteMultipleCoils(address, Cow::Owned(vec![raw != 0.0])),
            Some(_) | None => Request::WriteSingleCoil(address, raw != 0.0),
        }),
        Table::Holding if tag.point.field.is_some() => {
            let (and, or) = codec::field_masks(tag.point, raw)?;
            Some(Request::MaskWriteRegister(address, and, or))
        }
        Table::Holding => {
            let words = codec::encode(tag.point, raw)?;
            Some(match (words.as_slice(), tag.write_fc) {
                ([word], None | Some(6)) => Request::WriteSingleRegister(address, *word),
                (_, Some(23)) => {
                    Request::ReadWriteMultipleRegisters(address, words.len() as u16, address, Cow::Owned(words))
                }
                _ => Request::WriteMultipleRegisters(address, Cow::Owned(words)),
            })
        }
        Table::Input => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::plant::{
        def::{DeviceId, TagId},
        tag::{Kind, Order, Point},
    };

    /// The bytes of the request after the function code, as tokio-modbus would send them, told by its own words.
    fn request(kind: Kind, field: Option<(u8, u8)>, write_fc: Option<u8>, raw: f64) -> Option<Request<'static>> {
        let point = Point { table: Table::Holding, address: 100, kind, order: Order::Abcd, field };
        write_request(&TagDef { write_fc, ..TagDef::new(TagId(0), DeviceId(0), "D.T", point) }, raw)
    }

    #[test]
    fn each_tag_is_written_by_the_function_that_its_device_has() {
        let one = Request::WriteSingleRegister(100, 7);
        assert_eq!(request(Kind::U16, None, None, 7.0), Some(one.clone()));
        assert_eq!(request(Kind::U16, None, Some(6), 7.0), Some(one));
        let many = |words: Vec<u16>| Request::WriteMultipleRegisters(100, Cow::Owned(words));
        assert_eq!(request(Kind::U16, None, Some(16), 7.0), Some(many(vec![7])));
        assert_eq!(request(Kind::U32, None, None, 65_537.0), Some(many(vec![1, 1])));
        let both = Request::ReadWriteMultipleRegisters(100, 1, 100, Cow::Owned(vec![7]));
        assert_eq!(request(Kind::U16, None, Some(23), 7.0), Some(both));
        let masked = Request::MaskWriteRegister(100, 0xFFCF, 0x0020);
        assert_eq!(request(Kind::U16, Some((4, 2)), Some(22), 2.0), Some(masked));
        assert_eq!(request(Kind::U16, None, None, 65_536.0), None, "what does not fit is not sent");
    }

    #[test]
    fn coils_are_written_one_by_one_unless_the_profile_says_otherwise() {
        let point = Point { table: Table::Coil, address: 5, kind: Kind::Bool, order: Order::Abcd, field: None };
        let coil = TagDef::new(TagId(0), DeviceId(0), "D.C", point);
        assert_eq!(write_request(&coil, 1.0), Some(Request::WriteSingleCoil(5, true)));
        let fifteen = TagDef { write_fc: Some(15), ..coil };
        assert_eq!(write_request(&fifteen, 0.0), Some(Request::WriteMultipleCoils(5, Cow::Owned(vec![false]))));
        let input = TagDef { point: Point { table: Table::Discrete, ..point }, write_fc: None, ..fifteen };
        assert_eq!(write_request(&input, 1.0), None);
        let five = TagDef { write_fc: Some(5), ..input };
        assert_eq!(write_request(&five, 1.0), Some(Request::WriteSingleCoil(5, true)));
    }
}
