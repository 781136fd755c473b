//! The whole rig: tank, controller and PLC wired together, in steps of 0.1 s.

use std::time::Duration;

use super::dl06::sequence::Step;
use super::dl06::{Dl06, Outputs, SCAN};
use super::process_faults::ProcessFaults;
use super::pxr::{DECIMALS_AT, Pxr, SAMPLE, Sensor};
use super::slave::Slave;
use super::tank::{AMBIENT_C, Actuators, Readings, Tank};
use crate::plant::{PlantDef, def::DeviceId, number::to_u8};

/// The name by which a plant selects the rig.
pub const SIMULATION: &str = "tank";

/// Time that a device takes between a request and its answer.
pub(super) const PXR_DELAY: Duration = Duration::from_millis(5);
pub(super) const DL06_DELAY: Duration = Duration::from_millis(3);

/// Profiles of the devices that the rig brings with it: the first device with such a profile is the rig's.
const CONTROLLER: &str = "fuji_pxr";
const PLC: &str = "koyo_dl06";

/// What a device of the plant is in the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigDevice {
    /// Its temperature controller.
    Controller,
    /// Its PLC.
    Plc,
}

/// What a device is in the rig of its plant; `None` for every other device, and where the plant has no rig.
pub fn part(def: &PlantDef, device: DeviceId) -> Option<RigDevice> {
    let first = |profile: &str| def.devices.iter().find(|other| other.profile == profile).map(|other| other.id);
    match Some(device) {
        _ if def.simulation.as_deref() != Some(SIMULATION) => None,
        one if one == first(CONTROLLER) => Some(RigDevice::Controller),
        one if one == first(PLC) => Some(RigDevice::Plc),
        _ => None,
    }
}

/// The decimals that the plant file gives the rig's controller at its start.
pub fn decimals(def: &PlantDef) -> Option<u8> {
    let controller = def.devices.iter().find(|device| part(def, device.id) == Some(RigDevice::Controller))?;
    let tag = def.tags_of(controller.id).find(|tag| (tag.point.table, tag.point.address) == DECIMALS_AT)?;
    tag.simulate.as_ref()?.start.map(to_u8)
}

/// Scans of the PLC, which are the inner steps, per sample of the controller.
#[expect(clippy::cast_possible_truncation, reason = "a constant of two digits")]
const SCANS_PER_SAMPLE: u32 = (SAMPLE.as_millis() / SCAN.as_millis()) as u32;

/// The simulated plant.
#[derive(Debug, Clone)]
pub struct Rig {
    tank: Tank,
    pxr: Slave<Pxr>,
    plc: Slave<Dl06>,
    sensor_open: bool,
    process_faults: ProcessFaults,
    moving: Actuators,
    owed: Duration,
    steps: u32,
}

/// The actual state of the rig, independent of devices and wire: for tests and training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigState {
    /// Water at the probe in °C.
    pub probe_c: f64,
    /// The controller's process value in °C.
    pub pv_c: f64,
    /// The controller's setpoint in use in °C.
    pub sv_c: f64,
    /// The controller's output in percent.
    pub mv_percent: f64,
    /// Levels, volumes, flows and power.
    pub readings: Readings,
    /// The PLC's outputs.
    pub outputs: Outputs,
    /// The PLC's step.
    pub step: Step,
    /// Whether the sequence has failed.
    pub fault: bool,
    /// How often the controller saved its settings.
    pub saves: u32,
    /// What really moves, whatever the outputs say.
    pub moving: Actuators,
}

impl Rig {
    /// At rest: all water cold in TK-2, PLC stopped, controller in operation.
    pub fn new() -> Rig {
        Rig::filled(0.0)
    }

    /// In the middle of work: running in automatic with TK-1 nearly full, so that something moves at once.
    pub fn demo() -> Rig {
        let mut rig = Rig::filled(4.7);
        rig.plc.device.start();
        rig
    }

    /// At rest, with this many litres in TK-1 already.
    pub fn filled(control_l: f64) -> Rig {
        let (pxr, plc) = (Slave::new(Pxr::new(AMBIENT_C)), Slave::new(Dl06::new()));
        Rig {
            tank: Tank::new(control_l, AMBIENT_C),
            pxr,
            plc,
            sensor_open: false,
            process_faults: ProcessFaults::default(),
            moving: Actuators::default(),
            owed: Duration::ZERO,
            steps: 0,
        }
    }

    /// The same with a controller that shows this many decimals.
    pub fn with_decimals(mut self, decimals: u8) -> Rig {
        self.pxr.device.start_with_decimals(decimals);
        self
    }

    /// The decimals that the controller shows.
    pub fn decimals(&self) -> u8 {
        self.pxr.device.decimals()
    }

    /// Lets plant time pass. What is left over below one step is kept for the next call.
    pub fn advance(&mut self, dt: Duration) {
        self.owed += dt;
        while self.owed >= SCAN {
            self.owed -= SCAN;
            self.step();
        }
    }

    /// The controller as a unit of its line.
    pub fn controller(&mut self) -> &mut Slave<Pxr> {
        &mut self.pxr
    }

    /// The PLC as a unit of its line.
    pub fn plc(&mut self) -> &mut Slave<Dl06> {
        &mut self.plc
    }

    /// Breaks or repairs the wire of the temperature sensor.
    pub fn set_sensor_open(&mut self, open: bool) {
        self.sensor_open = open;
    }

    /// Breaks parts of the process, and repairs all others.
    pub fn set_process_faults(&mut self, process_faults: ProcessFaults) {
        self.process_faults = process_faults;
    }

    /// Turns a panel switch X0–X3 of the PLC.
    pub fn set_switch(&mut self, switch: u16, on: bool) {
        self.plc.device.set_switch(switch, on);
    }

    /// The actual state.
    pub fn state(&self) -> RigState {
        RigState {
            probe_c: self.tank.probe_c(),
            pv_c: self.pxr.device.pv_c(),
            sv_c: self.pxr.device.sv_c(),
            mv_percent: self.pxr.device.mv_percent(),
            readings: self.tank.readings(),
            outputs: self.plc.device.outputs(),
            step: self.plc.device.step(),
            fault: self.plc.device.fault(),
            saves: self.pxr.device.saves(),
            moving: self.moving,
        }
    }

    fn step(&mut self) {
        let readings = self.tank.readings();
        if self.steps.is_multiple_of(SCANS_PER_SAMPLE) {
            let sensor = if self.sensor_open { Sensor::Open } else { Sensor::Pt100(self.tank.probe_c()) };
            self.pxr.device.sample(sensor, readings.heater_w);
        }
        self.plc.device.scan(self.pxr.device.at_sv(), &readings);
        let wanted = self.plc.device.actuators(&readings, self.pxr.device.mv_percent());
        self.moving = self.process_faults.apply(wanted);
        self.tank.step(SCAN.as_secs_f64(), &self.moving);
        self.tank.spill(SCAN.as_secs_f64(), self.process_faults.leak_l_per_min);
        self.steps = self.steps.wrapping_add(1);
    }
}

impl Default for Rig {
    fn default() -> Rig {
        Rig::new()
    }
}

#[cfg(test)]
mod tests;
