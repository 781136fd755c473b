//! What was found of devices is tried again: one may have been replaced, or given another program.

use std::{collections::BTreeSet, time::Duration};

use jiff::Timestamp;

use super::{LinkExit, Task};
use crate::{
    bus::{
        io::link::{Link, LinkError},
        pdu::Pdu,
        plan::Block,
        schedule::Schedule,
        wide_addresses::WideAddresses,
    },
    plant::{def::DeviceId, live::AddressSpan, poll_class::PollClass, tag::Poll},
};

/// One request of a line is tried again so often.
const EVERY: Duration = Duration::from_secs(3_600);

/// When a line tries again what its devices have refused, and which of it.
#[derive(Debug)]
pub(super) struct Recheck {
    at: Timestamp,
    /// How many were tried again.
    tried: usize,
    /// Devices of which something was found before the start, until they answer.
    recalled: BTreeSet<DeviceId>,
    /// Devices that may be other ones: they are tried first, and at once.
    first: BTreeSet<DeviceId>,
}

impl Recheck {
    /// `recalled`: what is known of these was found before the start.
    pub fn new(recalled: BTreeSet<DeviceId>, now: Timestamp) -> Recheck {
        Recheck { at: now + EVERY, tried: 0, recalled, first: BTreeSet::new() }
    }

    /// A device has answered, and `was_silent` before.
    pub fn answered(&mut self, device: DeviceId, was_silent: bool) {
        if self.recalled.remove(&device) || was_silent {
            self.first.insert(device);
        }
    }

    /// It is being identified: an operator wants to know what it is.
    pub fn identified(&mut self, device: DeviceId) {
        self.first.insert(device);
    }

    /// Devices have other ids; those without one are other devices.
    pub fn rename(&mut self, renamed: impl Fn(DeviceId) -> Option<DeviceId>) {
        for devices in [&mut self.recalled, &mut self.first] {
            *devices = devices.iter().filter_map(|device| renamed(*device)).collect();
        }
    }

    pub fn is_due(&self, now: Timestamp) -> bool {
        self.at <= now || !self.first.is_empty()
    }
}

impl Task<'_> {
    /// Asks for something that was refused once. An answer shows that the device is another one: all is searched again.
    pub(super) async fn recheck(&mut self, link: &mut Link, schedule: &mut Schedule) -> Result<(), LinkExit> {
        let now = self.clock.now();
        let first = self.recheck.first.pop_first();
        if first.is_none() {
            self.recheck.at = now + EVERY;
        }
        let on_line = self.def.devices.iter().filter(|device| device.line == self.line);
        let wanted = on_line.filter(|device| first.is_none_or(|first| first == device.id));
        let wide = WideAddresses::of(&self.def, self.line);
        let requests: Vec<Block> = wanted
            .flat_map(|device| {
                let lives = |(index, block): &(usize, &Block)| block.device == device.id && schedule.lives(*index);
                let living: Vec<&Block> =
                    self.blocks.iter().enumerate().filter(lives).map(|(_, block)| block).collect();
                let start = |table| living.iter().find(|block| block.table == table).map(|block| block.address);
                let spans =
                    if living.is_empty() { vec![] } else { self.unreadable.refused_requests(device.unit, start) };
                let wide = &wide;
                spans.into_iter().map(move |span| request(device.id, device.unit, span, wide))
            })
            .collect();
        let Some(block) = requests.get(self.recheck.tried % requests.len().max(1)) else { return Ok(()) };
        self.recheck.tried += 1;
        let read = self.read_unless_stopped(link, block, None).await;
        let ended = self.clock.now();
        Self::keep_gap(link, schedule, block, ended);
        match read {
            Some(Ok(_)) => {
                tracing::info!(unit = block.unit, address = block.address, count = block.count, "can be read now");
                self.unreadable.forget(block.unit);
                self.in_flight.forget(block.unit);
                self.allow_in_flight(link);
                self.replan(link, schedule, ended, true);
                Ok(())
            }
            Some(Err(LinkError::Gone(why))) => Err(LinkExit::Gone(why)),
            Some(Err(LinkError::Fault(_))) | None => Ok(()),
        }
    }
}

/// A read of which nothing is shown.
fn request(device: DeviceId, unit: u8, span: AddressSpan, wide: &WideAddresses) -> Block {
    let AddressSpan { table, address, count } = span;
    let address_words = wide.request(&Pdu::read(table, address, count).to(unit)).address_words;
    let (poll, class) = (Poll::Never, PollClass::Background);
    Block { device, unit, table, address, count, tags: [].into(), poll, class, alignment: 1, address_words }
}
