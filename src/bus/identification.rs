//! When devices are asked what they are, for the conditions of their profiles: once they answer, after each time that they
//! were lost, and once an hour. Pure.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use jiff::Timestamp;

use super::{
    backoff::Backoff,
    diagnostics::identify::{self, IdentifyJob},
};
use crate::plant::{
    PlantDef,
    def::{DeviceDef, DeviceId, LineId},
    fault::Fault,
    identity::IdentityObject,
};

/// Asked again so often: a device may have been updated within one poll.
const EVERY: Duration = Duration::from_secs(3_600);
/// No sooner again where one connection follows another without a fault, as of a device that ends each of them.
const CONNECTED_EVERY: Duration = Duration::from_secs(60);
/// Requests in vain, after which only the hour or a new connection helps.
const TRIES_MAX: u32 = 3;
/// Connections in a row that have ended on such a request, after which it is left for an hour.
const HANGUPS_MAX: u32 = 2;

/// What a device has said of itself.
pub type Objects = Vec<(IdentityObject, String)>;

/// The devices of a line whose profile asks what they are.
#[derive(Debug, Default)]
pub struct Identification {
    devices: BTreeMap<DeviceId, Reading>,
}

/// How far the identification of a device has come.
#[derive(Debug)]
struct Reading {
    unit: u8,
    wanted: BTreeSet<u8>,
    /// It has not answered anything since it was lost: nothing is asked of it.
    is_lost: bool,
    /// Not before.
    from: Timestamp,
    /// When it has said what is wanted, if it has.
    identified_at: Option<Timestamp>,
    next: (u8, u8),
    job: IdentifyJob,
    found: Objects,
    tries: u32,
    hangups: u32,
    backoff: Backoff,
}

impl Reading {
    fn new(device: &DeviceDef, wanted: BTreeSet<u8>) -> Reading {
        let job = IdentifyJob::wanting(wanted.clone());
        Reading {
            unit: device.unit,
            wanted,
            is_lost: true,
            from: Timestamp::MIN,
            identified_at: None,
            next: identify::FIRST,
            job,
            found: Vec::new(),
            tries: 0,
            hangups: 0,
            backoff: Backoff::default(),
        }
    }

    /// From the first request on.
    fn restart(&mut self, from: Timestamp) -> Objects {
        (self.from, self.next, self.tries) = (from, identify::FIRST, 0);
        self.job = IdentifyJob::wanting(self.wanted.clone());
        self.backoff.reset();
        std::mem::take(&mut self.found)
    }
}

impl Identification {
    /// Of the devices of a line, none of which is known.
    pub fn new(def: &PlantDef, line: LineId) -> Identification {
        let framing = def.line(line).transport.framing();
        let of_line = def.devices.iter().filter(|device| device.line == line && !framing.is_broadcast(device.unit));
        let asked = of_line.filter_map(|device| {
            let conditions = def.tags_of(device.id).filter_map(|tag| tag.when.as_ref());
            let wanted: BTreeSet<u8> =
                conditions.flat_map(|when| when.identity_tests()).map(|test| test.object.0).collect();
            (!wanted.is_empty()).then(|| (device.id, Reading::new(device, wanted)))
        });
        Identification { devices: asked.collect() }
    }

    /// A connection was opened: other devices may be at its end.
    pub fn reopened(&mut self, now: Timestamp) {
        for reading in self.devices.values_mut() {
            // It is what ends the connections.
            let from = if HANGUPS_MAX <= reading.hangups { reading.from.max(now) } else { now };
            reading.is_lost = true;
            reading.restart(from);
        }
    }

    /// A connection has taken the place of one that ended without a fault: what was said stands until it is said again.
    pub fn goes_on(&mut self) {
        for reading in self.devices.values_mut().filter(|reading| reading.hangups == 0) {
            let again = reading.identified_at.map(|identified_at| identified_at + CONNECTED_EVERY);
            reading.from = again.map_or(reading.from, |again| reading.from.min(again));
        }
    }

    /// An operator wants to know what a device is: so does its profile, again.
    pub fn ask_again(&mut self, device: DeviceId, now: Timestamp) {
        if let Some(reading) = self.devices.get_mut(&device).filter(|reading| reading.hangups == 0) {
            reading.from = reading.from.min(now);
        }
    }

    /// A device was given up: another one may come back.
    pub fn lost(&mut self, device: DeviceId) {
        if let Some(reading) = self.devices.get_mut(&device) {
            reading.is_lost = true;
        }
    }

    /// A device has answered a poll, and `was_silent` before.
    pub fn answered(&mut self, device: DeviceId, was_silent: bool, now: Timestamp) {
        let Some(reading) = self.devices.get_mut(&device).filter(|reading| reading.is_lost || was_silent) else {
            return;
        };
        if reading.hangups < HANGUPS_MAX {
            reading.restart(now);
        }
        reading.is_lost = false;
    }

    /// When the next device may be asked.
    pub fn from(&self) -> Option<Timestamp> {
        self.devices.values().filter(|reading| !reading.is_lost).map(|reading| reading.from).min()
    }

    /// The device that is due, its unit, and read code and object of the request.
    pub fn due(&self, now: Timestamp) -> Option<(DeviceId, u8, (u8, u8))> {
        let is_due = |reading: &Reading| !reading.is_lost && reading.from <= now;
        let (device, reading) =
            self.devices.iter().filter(|(_, reading)| is_due(reading)).min_by_key(|(_, r)| r.from)?;
        Some((*device, reading.unit, reading.next))
    }

    /// Takes the outcome of the request that was due; what the device says of itself once it has said all, nothing if
    /// it does not tell.
    pub fn on_outcome(&mut self, device: DeviceId, outcome: Result<&[u8], Fault>, now: Timestamp) -> Option<Objects> {
        let reading = self.devices.get_mut(&device)?;
        let is_answer = match outcome {
            Ok(_) => true,
            Err(Fault::Exception(code)) => !code.is_of_gateway(),
            Err(_) => false,
        };
        if !is_answer {
            reading.tries += 1;
            reading.from = now + reading.backoff.fail();
            if TRIES_MAX <= reading.tries {
                // What it was before still stands: nothing says that it is another one.
                reading.identified_at = None;
                reading.restart(now + EVERY);
            }
            return None;
        }
        (reading.hangups, reading.tries) = (0, 0);
        let new = reading.job.on_outcome(reading.next, outcome);
        reading.found.extend(new.into_iter().map(|(id, text)| (IdentityObject(id), text)));
        match reading.job.next_wanted() {
            Some(next) => {
                reading.next = next;
                None
            }
            None => {
                reading.identified_at = (!reading.found.is_empty()).then_some(now);
                Some(reading.restart(now + EVERY))
            }
        }
    }

    /// The connection has ended on the request that was due.
    pub fn hung_up(&mut self, device: DeviceId, now: Timestamp) {
        let Some(reading) = self.devices.get_mut(&device) else { return };
        reading.hangups += 1;
        if HANGUPS_MAX <= reading.hangups {
            reading.from = now + EVERY;
        }
    }
}

#[cfg(test)]
mod tests;
