//! The simulator: every simulated unit of a plant by line and unit address, and its plant time.
//!
//! ```text
//!  (L1, 1) ── controller ─┐ rig: the tank of `simulation = "tank"`
//!  (L1, 2) ── PLC ────────┘
//!  (L2, 1) ── model ──────┐ models: each device that is no part of the rig, made from its profile
//!  (L2, 2) ── model ──────┘
//! ```

use std::{collections::BTreeMap, time::Duration};

use super::{
    model::{Model, Models},
    rig::{self, Rig, RigDevice},
    slave::{Slave, Unit},
};
use crate::plant::{
    PlantDef,
    def::{DeviceDef, Framing, LineId, TagId},
};

/// The address that means every unit of a serial line.
pub const BROADCAST: u8 = 0;

/// All simulated units of a plant.
#[derive(Debug, Clone, Default)]
pub struct Simulator {
    rig: Option<Rig>,
    models: Models,
    responders: BTreeMap<(LineId, u8), Responder>,
}

/// What answers at an address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Responder {
    Controller,
    Plc,
    Model(usize),
}

/// The plant names a simulated process that this program does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("simulation = \"{0}\" is not known, expected \"tank\" or none")]
pub struct UnknownSimulation(pub String);

impl Simulator {
    /// Simulates a plant: the rig that it names, and for every other device a model made from its profile.
    pub fn new(def: &PlantDef) -> Result<Simulator, UnknownSimulation> {
        let rig = match def.simulation.as_deref() {
            Some(rig::SIMULATION) => {
                Some(rig::decimals(def).map_or_else(Rig::demo, |decimals| Rig::demo().with_decimals(decimals)))
            }
            Some(other) => return Err(UnknownSimulation(other.to_owned())),
            None => None,
        };
        let (mut modelled, mut responders) = (Vec::new(), BTreeMap::new());
        // The broadcast address of a serial line is no device.
        let is_broadcast = |device: &&DeviceDef| {
            device.unit == BROADCAST && def.line(device.line).transport.framing() != Framing::Mbap
        };
        for device in def.devices.iter().filter(|device| !is_broadcast(device)) {
            let responder = match rig::part(def, device.id) {
                Some(RigDevice::Controller) => Responder::Controller,
                Some(RigDevice::Plc) => Responder::Plc,
                None => {
                    modelled.push(device.id);
                    Responder::Model(modelled.len() - 1)
                }
            };
            responders.insert((device.line, device.unit), responder);
        }
        Ok(Simulator { rig, models: Models::new(def, &modelled), responders })
    }

    /// A tank rig alone, at the addresses of the thesis: controller 1 and PLC 2 of the first line.
    pub fn tank(rig: Rig) -> Simulator {
        let responders = BTreeMap::from([((LineId(0), 1), Responder::Controller), ((LineId(0), 2), Responder::Plc)]);
        Simulator { rig: Some(rig), models: Models::default(), responders }
    }

    /// Lets plant time pass for everything.
    pub fn advance(&mut self, dt: Duration) {
        if let Some(rig) = &mut self.rig {
            rig.advance(dt);
        }
        self.models.advance(dt);
    }

    /// Every unit by its line.
    pub fn addresses(&self) -> impl Iterator<Item = (LineId, u8)> + '_ {
        self.responders.keys().copied()
    }

    /// The units of a line.
    pub fn units(&self, line: LineId) -> Vec<u8> {
        self.responders.range((line, u8::MIN)..=(line, u8::MAX)).map(|((_, unit), _)| *unit).collect()
    }

    /// Answers a request. `None`: no such unit, a broadcast (which all units of the line obey), an empty request.
    pub fn respond(&mut self, line: LineId, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        if self.is_broadcast(line, unit) {
            self.broadcast(line, pdu, |_| true);
            return None;
        }
        self.count_for_others(line, unit);
        self.unit(line, unit)?.respond(pdu)
    }

    /// Whether the address means every unit of the line: 0, unless a device of Modbus TCP has it for its own.
    pub fn is_broadcast(&self, line: LineId, unit: u8) -> bool {
        unit == BROADCAST && !self.responders.contains_key(&(line, unit))
    }

    /// Every unit of a line that receives a broadcast executes it. There is no response.
    pub fn broadcast(&mut self, line: LineId, pdu: &[u8], receives: impl Fn(u8) -> bool) {
        for unit in self.units(line).into_iter().filter(|unit| receives(*unit)) {
            if let Some(unit) = self.unit(line, unit) {
                unit.serve_broadcast(pdu);
            }
        }
    }

    /// A unit refuses a request with this code, whatever it says.
    pub fn refuse(&mut self, line: LineId, unit: u8, pdu: &[u8], code: u8) -> Option<Vec<u8>> {
        self.count_for_others(line, unit);
        self.unit(line, unit)?.refuse(pdu, code)
    }

    /// The other units of the line count a message that is not theirs.
    pub fn count_for_others(&mut self, line: LineId, unit: u8) {
        for other in self.units(line).into_iter().filter(|other| *other != unit) {
            if let Some(other) = self.unit(line, other) {
                other.on_foreign_message();
            }
        }
    }

    /// Something passed on a line that no unit could read.
    pub fn corrupt(&mut self, line: LineId) {
        for unit in self.units(line) {
            if let Some(unit) = self.unit(line, unit) {
                unit.on_corrupt_message();
            }
        }
    }

    /// The time that a unit takes between a request and its answer.
    pub fn reply_delay(&self, line: LineId, unit: u8) -> Duration {
        match self.responders.get(&(line, unit)) {
            Some(Responder::Controller) => rig::PXR_DELAY,
            Some(Responder::Plc) => rig::DL06_DELAY,
            Some(Responder::Model(index)) => self.models.reply_delay(*index),
            None => Duration::ZERO,
        }
    }

    /// The same with its process at rest; otherwise it is in the middle of work.
    pub fn at_rest(self) -> Simulator {
        Simulator { rig: self.rig.map(|rig| Rig::new().with_decimals(rig.decimals())), ..self }
    }

    /// Whether a unit is the controller of the tank rig.
    pub fn is_controller(&self, line: LineId, unit: u8) -> bool {
        self.responders.get(&(line, unit)) == Some(&Responder::Controller)
    }

    /// The tank rig, if the plant has one.
    pub fn rig(&self) -> Option<&Rig> {
        self.rig.as_ref()
    }

    /// The tank rig, to break its sensor or turn its switches.
    pub fn rig_mut(&mut self) -> Option<&mut Rig> {
        self.rig.as_mut()
    }

    /// What a modelled device has in its registers for a tag, in the tag's unit; `None` for a tag of the rig.
    pub fn value(&self, tag: TagId) -> Option<f64> {
        self.models.value(tag)
    }

    /// Puts a value into the registers of a modelled device, as if the device itself had found it so. `false` if the tag
    /// is not of a model or cannot hold it.
    #[cfg(test)]
    pub fn set_value(&mut self, tag: TagId, value: f64) -> bool {
        self.models.set_value(tag, value)
    }

    fn unit(&mut self, line: LineId, unit: u8) -> Option<&mut dyn Unit> {
        match self.responders.get(&(line, unit))? {
            Responder::Controller => self.rig.as_mut().map(|rig| rig.controller() as &mut dyn Unit),
            Responder::Plc => self.rig.as_mut().map(|rig| rig.plc() as &mut dyn Unit),
            Responder::Model(index) => self.models.unit(*index).map(|slave: &mut Slave<Model>| slave as &mut dyn Unit),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::plant::{
        simulate::Simulate,
        tag::{Access, Table, TagDef},
    };

    const L1: LineId = LineId(0);

    #[test]
    fn a_stranger_and_a_broadcast_get_no_answer() {
        let mut simulator = Simulator::tank(Rig::new());
        for unit in [0, 3, 247] {
            assert_eq!(simulator.respond(L1, unit, &[3, 0, 0, 0, 1]), None);
        }
        assert_eq!(simulator.respond(LineId(1), 1, &[3, 0x03, 0xEA, 0, 1]), None, "the same unit of another line");
    }

    /// The frame that the thesis recorded: SV = 50 °C on a controller that shows whole degrees, 5.0 °C on one with a decimal.
    #[test]
    fn the_recorded_setpoint_is_50_where_p_dp_is_0() {
        let def = crate::profile::load(std::path::Path::new("tank"), &crate::profile::Search::shipped());
        let mut def = Arc::unwrap_or_clone(def.expect("a shipped plant"));
        let decimals = def.tag_named("TIC-1.P-DP").expect("a tag of the controller");
        for (start, raw, sv_c) in [(0.0, [0x00, 0x32], 50.0), (1.0, [0x00, 0x32], 5.0), (0.0, [0x00, 0x46], 70.0)] {
            let simulate = Simulate { start: Some(start), ..Simulate::default() };
            def.tags[decimals.index()].simulate = Some(Arc::new(simulate));
            let simulator = Simulator::new(&def).expect("a known simulation");
            for mut simulator in [simulator.clone(), simulator.at_rest()] {
                let request = [6, 0x03, 0xEA, raw[0], raw[1]];
                assert_eq!(simulator.respond(L1, 1, &request), Some(request.to_vec()));
                simulator.advance(Duration::from_secs(1));
                assert_eq!(simulator.rig().map(|rig| rig.state().sv_c), Some(sv_c), "P-DP {start}");
            }
        }
    }

    /// What a technician asks for with one key, `u`.
    #[test]
    fn a_simulated_device_has_every_register_of_its_profile() {
        for name in ["tank", "lab", "inverter"] {
            let def = crate::profile::load(std::path::Path::new(name), &crate::profile::Search::shipped());
            let def = def.expect("a shipped plant");
            let mut simulator = Simulator::new(&def).expect("a known simulation");
            let readable = |tag: &&TagDef| tag.calculation.is_none() && tag.access != Access::Write;
            for tag in def.tags.iter().filter(readable) {
                let device = def.device(tag.device);
                let code = match tag.point.table {
                    Table::Coil => 1,
                    Table::Discrete => 2,
                    Table::Holding => 3,
                    Table::Input => 4,
                };
                let [high, low] = tag.point.address.to_be_bytes();
                let count = if tag.point.table.is_bits() { 1 } else { tag.point.len() };
                let answer = simulator.respond(device.line, device.unit, &[code, high, low, 0, count as u8]);
                assert!(answer.as_ref().is_some_and(|answer| answer[0] == code), "{name}: {} {answer:?}", tag.name);
            }
        }
    }

    /// 41003 is SV of the controller and plain V memory of the PLC.
    #[test]
    fn a_broadcast_is_obeyed_by_every_unit_of_its_line() {
        let mut simulator = Simulator::tank(Rig::new());
        assert_eq!(simulator.respond(LineId(1), 0, &[16, 0x03, 0xEA, 0, 1, 2, 0x00, 0x09]), None);
        assert_eq!(simulator.respond(L1, 0, &[16, 0x03, 0xEA, 0, 1, 2, 0x01, 0xF4]), None);
        for unit in [1, 2] {
            assert_eq!(simulator.respond(L1, unit, &[3, 0x03, 0xEA, 0, 1]), Some(vec![3, 2, 0x01, 0xF4]));
        }
    }

    #[test]
    fn a_unit_counts_what_passes_on_its_line() {
        let mut simulator = Simulator::tank(Rig::new());
        let counter =
            |simulator: &mut Simulator, which: u8| simulator.respond(L1, 2, &[8, 0, which, 0, 0]).map(|reply| reply[4]);
        for unit in [1, 2, 9, 0] {
            simulator.respond(L1, unit, &[3, 0x03, 0xEA, 0, 1]);
            simulator.respond(LineId(1), unit, &[3, 0x03, 0xEA, 0, 1]);
        }
        simulator.corrupt(L1);
        simulator.corrupt(LineId(1));
        // All four messages and this query; one that was corrupt; unit 2, the broadcast and the three queries.
        assert_eq!(counter(&mut simulator, 0x0B), Some(5));
        assert_eq!(counter(&mut simulator, 0x0C), Some(1));
        assert_eq!(counter(&mut simulator, 0x0E), Some(5));
    }
}
