//! Injected faults: which are active, and their effect on what leaves a device.

pub mod target;
pub mod process;
mod table;
pub mod values;
pub mod syntax;

use std::{collections::BTreeMap, time::Duration};

use jiff::Timestamp;

pub use self::{
    syntax::{InjectedFault, TargetKind},
    target::{AvailableFaults, FaultTarget, available_faults, why_not_applicable},
};
use super::{
    random::{GOLDEN, splitmix64},
    simulator::Simulator,
};
use crate::{
    bus::{ascii, frame::with_crc},
    plant::{
        PlantDef,
        def::{LineId, TagId},
        number::{to_u16, to_usize},
    },
};
use process::process_faults;
use values::{AnswerMemory, Values};

/// The active faults.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    list: Vec<ActiveFault>,
    units: BTreeMap<(LineId, u8), Values>,
    tags: BTreeMap<TagId, ((LineId, u8), Values)>,
    memories: BTreeMap<FaultTarget, AnswerMemory>,
    /// Messages on noisy lines so far: the same drill has the same noise.
    messages: u64,
}

/// A fault that is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActiveFault {
    /// Where.
    pub target: FaultTarget,
    /// What.
    pub fault: InjectedFault,
    /// Since when.
    pub since: Timestamp,
}

/// What leaves a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    unit: u8,
    pdu: Vec<u8>,
    damage: Damage,
    /// Time between the end of the request and the beginning of the answer (plant time).
    pub delay: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Damage {
    None,
    Check,
    Cut,
    /// One bit, chosen by this number.
    Bit(u64),
}

impl Faults {
    /// None yet, in a plant whose values are known.
    pub fn new(def: &PlantDef) -> Faults {
        let address = |device: &crate::plant::def::DeviceDef| (device.line, device.unit);
        let units = def.devices.iter().map(|device| (address(device), Values::of_device(def, device))).collect();
        let tags = def
            .tags
            .iter()
            .map(|tag| (tag.id, (address(def.device(tag.device)), Values::of_tags(std::iter::once(tag)))));
        Faults { units, tags: tags.collect(), ..Faults::default() }
    }

    /// Injects a fault; a fault that it excludes is cleared.
    pub fn inject(&mut self, simulator: &mut Simulator, target: FaultTarget, fault: InjectedFault, since: Timestamp) {
        // The same fault with another number goes on: what is stuck stays.
        let since = self.find(target, fault).map_or(since, |old| old.since);
        self.list.retain(|old| old.target != target || !old.fault.excludes(fault));
        self.list.push(ActiveFault { target, fault, since });
        self.list.sort_by_key(|active| active.target);
        self.arrange(simulator, target, fault, true);
    }

    /// Clears a fault, whatever its parameter.
    pub fn clear(&mut self, simulator: &mut Simulator, target: FaultTarget, fault: InjectedFault) {
        self.list.retain(|old| old.target != target || old.fault.word() != fault.word());
        self.arrange(simulator, target, fault, false);
    }

    /// Clears all faults.
    pub fn clear_all(&mut self, simulator: &mut Simulator) {
        for ActiveFault { target, fault, .. } in std::mem::take(&mut self.list) {
            self.arrange(simulator, target, fault, false);
        }
    }

    /// The active faults, by target.
    pub fn list(&self) -> &[ActiveFault] {
        &self.list
    }

    fn find(&self, target: FaultTarget, fault: InjectedFault) -> Option<&ActiveFault> {
        self.list.iter().find(|active| active.target == target && active.fault.word() == fault.word())
    }

    fn at(&self, target: FaultTarget, kind: TargetKind) -> impl Iterator<Item = InjectedFault> {
        self.list.iter().filter(move |f| f.target == target && f.fault.target_kind() == kind).map(|f| f.fault)
    }

    /// Carries a change into the process, and forgets what is no longer stuck.
    fn arrange(&mut self, simulator: &mut Simulator, target: FaultTarget, fault: InjectedFault, begins: bool) {
        match (target, fault) {
            (_, InjectedFault::Stuck) if !begins => {
                self.memories.entry(target).or_default().let_go();
            }
            (FaultTarget::Unit(line, unit), InjectedFault::SensorBurnout) if simulator.is_controller(line, unit) => {
                if let Some(rig) = simulator.rig_mut() {
                    rig.set_sensor_open(begins);
                }
            }
            (FaultTarget::Process, InjectedFault::Switch(switch)) => {
                if let Some(rig) = simulator.rig_mut() {
                    rig.set_switch(switch as u16, begins);
                }
            }
            (FaultTarget::Process, _) => {
                let process_faults = process_faults(self.at(FaultTarget::Process, TargetKind::Process));
                if let Some(rig) = simulator.rig_mut() {
                    rig.set_process_faults(process_faults);
                }
            }
            _ => {}
        }
    }

    /// Answers a request, unless an active fault answers instead. `None`: nothing comes back.
    pub fn answer(&mut self, simulator: &mut Simulator, line: LineId, unit: u8, request: &[u8]) -> Option<Answer> {
        if self.hit(line).is_some() {
            simulator.corrupt(line);
            return None;
        }
        if simulator.is_broadcast(line, unit) {
            let deaf = |unit| {
                matches!(self.on_the_line(line, unit), Some(InjectedFault::Silent | InjectedFault::Exception(_)))
            };
            simulator.broadcast(line, request, |unit| !deaf(unit));
            return None;
        }
        let late = simulator.reply_delay(line, unit);
        let answer = |pdu, damage, delay| Answer { unit, pdu, damage, delay };
        let mut answer = match self.on_the_line(line, unit) {
            Some(InjectedFault::Silent) => {
                simulator.count_for_others(line, unit);
                return None;
            }
            Some(InjectedFault::Exception(code)) => {
                return simulator.refuse(line, unit, request, code).map(|pdu| answer(pdu, Damage::None, late));
            }
            Some(InjectedFault::Late(by)) => answer(simulator.respond(line, unit, request)?, Damage::None, late + by),
            Some(InjectedFault::BadCrc) => answer(simulator.respond(line, unit, request)?, Damage::Check, late),
            Some(InjectedFault::Cut) => answer(simulator.respond(line, unit, request)?, Damage::Cut, late),
            Some(_) | None => answer(simulator.respond(line, unit, request)?, Damage::None, late),
        };
        answer.pdu = self.corrupt_values(line, unit, request, answer.pdu);
        if let Some(bit) = self.hit(line) {
            answer.damage = Damage::Bit(bit);
        }
        Some(answer)
    }

    fn on_the_line(&self, line: LineId, unit: u8) -> Option<InjectedFault> {
        self.at(FaultTarget::Unit(line, unit), TargetKind::Unit).next()
    }

    fn corrupt_values(&mut self, line: LineId, unit: u8, request: &[u8], mut pdu: Vec<u8>) -> Vec<u8> {
        let targets: Vec<FaultTarget> = self.list.iter().map(|active| active.target).collect();
        let mut targets = targets;
        targets.dedup();
        for target in targets {
            let values = match target {
                FaultTarget::Unit(on, asked) if (on, asked) == (line, unit) => self.units.get(&(on, asked)),
                FaultTarget::Tag(tag) => {
                    self.tags.get(&tag).filter(|(at, _)| *at == (line, unit)).map(|(_, values)| values)
                }
                FaultTarget::Unit(..) | FaultTarget::Line(_) | FaultTarget::Process => None,
            };
            let faults: Vec<InjectedFault> = self.at(target, TargetKind::Value).collect();
            if let (Some(values), false) = (values, faults.is_empty()) {
                pdu = values.corrupt(&faults, self.memories.entry(target).or_default(), request, pdu);
            }
        }
        pdu
    }

    /// Whether noise hits the next message on a line; the number says which bit.
    fn hit(&mut self, line: LineId) -> Option<u64> {
        let Some(InjectedFault::Noise(percent)) = self.at(FaultTarget::Line(line), TargetKind::Line).next() else {
            return None;
        };
        self.messages += 1;
        let number = splitmix64(self.messages.wrapping_mul(GOLDEN));
        (number % 100 < u64::from(percent)).then_some(number / 100)
    }
}

impl Answer {
    /// The bytes on a serial line.
    pub fn rtu(&self) -> Vec<u8> {
        let mut frame = with_crc(&self.message());
        match self.damage {
            Damage::None => {}
            Damage::Check => {
                if let Some(last) = frame.last_mut() {
                    *last ^= 0xFF;
                }
            }
            Damage::Cut => frame.truncate(frame.len() / 2),
            Damage::Bit(which) => flip(&mut frame, which, 8),
        }
        frame
    }

    /// The characters on a line in ASCII mode.
    pub fn ascii(&self) -> Vec<u8> {
        let mut frame = ascii::encode(&self.message());
        match self.damage {
            Damage::None => {}
            Damage::Check => {
                // The last digit of the LRC becomes another one.
                let digit = frame.len() - 3;
                frame[digit] = if frame[digit] == b'0' { b'1' } else { b'0' };
            }
            Damage::Cut => frame.truncate(frame.len() / 2),
            // ASCII has seven bits on many lines; the eighth is not there to be wrong.
            Damage::Bit(which) => flip(&mut frame, which, 7),
        }
        frame
    }

    /// The bytes on a TCP connection. There is no check to corrupt: a wrong transaction number is the nearest thing.
    pub fn tcp(&self, transaction: u16) -> Vec<u8> {
        let transaction = if self.damage == Damage::Check { transaction ^ 0xFF00 } else { transaction };
        let message = self.message();
        let mut frame = transaction.to_be_bytes().to_vec();
        frame.extend_from_slice(&[0, 0]);
        frame.extend_from_slice(&to_u16(message.len()).to_be_bytes());
        frame.extend_from_slice(&message);
        if self.damage == Damage::Cut {
            frame.truncate(frame.len() / 2);
        }
        frame
    }

    fn message(&self) -> Vec<u8> {
        [&[self.unit], &self.pdu[..]].concat()
    }
}

fn flip(frame: &mut [u8], which: u64, bits: u64) {
    let index = to_usize(which / bits) % frame.len().max(1);
    if let Some(byte) = frame.get_mut(index) {
        *byte ^= 1 << (which % bits);
    }
}

#[cfg(test)]
mod tests;
