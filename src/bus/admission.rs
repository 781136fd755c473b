//! The admission test of a line: can a transaction at a time, earliest deadline first, keep every poll's period?
//!
//! K. Jeffay, D. F. Stanat, C. U. Martel, "On non-preemptive scheduling of periodic and sporadic tasks", RTSS 1991, theorem
//! 4.1: with T1 ≤ … ≤ Tn it can, whatever the phases, if and only if ΣC/T ≤ 1 and for each i ≥ 2 and each L in (T1, Ti)
//! `L ≥ C_i + Σ_{j<i} ⌊(L−1)/T_j⌋·C_j`.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use super::{
    plan::{Block, Wire, cost},
    schedule::{Demand, FACTOR_MAX, WRITE_SHARE},
};
use crate::plant::{
    admission::{Admission, DeadDevice, OverloadInterval, PollWords, Schedulability, Warning},
    def::{DeviceDef, DeviceId, Framing, LineDef, LineId, Parity, PlantDef, Transport},
    device_time::{DeviceTime, SeenTime},
    number::to_u16,
    tag::{Poll, PollClass},
};

/// A device that is given up is probed this often.
const PROBE_EVERY: Duration = Duration::from_secs(30);
/// Units of one load on a line of RS-485, whose drivers carry 32 loads: the master is one of them.
const UNITS_MAX: u16 = 31;
/// Polls that an overload interval names.
const NAMED_MAX: usize = 3;

/// A poll in whole units of time: worst cost and period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Task {
    /// Worst time of a read.
    pub cost: u64,
    /// Period.
    pub period: u64,
}

/// What the test finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Test {
    /// Every period is kept.
    Accept,
    /// More than all the time is wanted.
    TooMuch,
    /// In a span of `length` there is a demand of `demand`, after the task at place `blocker` has just begun.
    OverloadInterval {
        /// L.
        length: u64,
        /// What must be carried in it.
        demand: u64,
        /// Which task is in the way: the dearest whose period is longer than L.
        blocker: usize,
    },
}

/// Share of the time that tasks want.
pub fn utilisation(tasks: &[Task]) -> f64 {
    tasks.iter().map(|task| task.cost as f64 / task.period.max(1) as f64).sum()
}

/// The admission test. The demand without C_i is the same for all i, for a task whose period is not below L adds nothing;
/// so each L is looked at once, with the dearest task whose period is longer. The demand steps only just behind multiples
/// of periods, and between steps L only grows, so those are enough. And where `L·(1 − U) ≥ C_max` nothing can fail.
pub fn test(tasks: &[Task]) -> Test {
    let load = utilisation(tasks);
    if load > 1.0 + 1e-9 {
        return Test::TooMuch;
    }
    // What falls due with each period, and the next multiples of all of them.
    let mut costs: BTreeMap<u64, u64> = BTreeMap::new();
    tasks.iter().for_each(|task| *costs.entry(task.period.max(1)).or_default() += task.cost);
    let mut steps: BTreeMap<u64, u64> = costs.clone();
    let mut next: BTreeMap<u64, Vec<u64>> = costs.keys().map(|period| (*period, vec![*period])).collect();
    let dearest = tasks.iter().map(|task| task.cost).max().unwrap_or(0);
    let (mut demand, mut longer) = (0, by_period(tasks));
    while let Some((multiple, cost)) = steps.pop_first() {
        let length = multiple + 1;
        demand += cost;
        while longer.last().is_some_and(|(period, ..)| *period <= length) {
            longer.pop();
        }
        let Some((_, blocking, blocker)) = longer.last().copied() else { break };
        if length < demand + blocking {
            return Test::OverloadInterval { length, demand: demand + blocking, blocker };
        }
        if length as f64 * (1.0 - load) >= dearest as f64 && load < 1.0 {
            break;
        }
        for period in next.remove(&multiple).unwrap_or_default() {
            *steps.entry(multiple + period).or_default() += costs[&period];
            next.entry(multiple + period).or_default().push(period);
        }
    }
    Test::Accept
}

/// (period, dearest cost of the tasks with at least this period, which one), the longest period first.
fn by_period(tasks: &[Task]) -> Vec<(u64, u64, usize)> {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    order.sort_by_key(|task| std::cmp::Reverse(tasks[*task].period));
    let mut dearest: Option<(u64, usize)> = None;
    let mut longer = Vec::new();
    for task in order {
        if dearest.is_none_or(|(cost, _)| cost < tasks[task].cost) {
            dearest = Some((tasks[task].cost, task));
        }
        let (cost, which) = dearest.expect("just set");
        longer.push((tasks[task].period, cost, which));
    }
    longer
}

/// A periodic poll of a line: its class and device, and how an engineer knows it.
struct Load {
    device: DeviceId,
    class: PollClass,
    words: PollWords,
}

/// Tests the plan of a line, the whole of it and with each device dead, before any device has answered.
pub fn admit(def: &PlantDef, line: LineId, blocks: &[Block]) -> Admission {
    admit_as(def, def.line(line), blocks, &unseen)
}

/// What counts as the time of a device that has not answered yet.
pub fn unseen(device: &DeviceDef) -> DeviceTime {
    DeviceTime::new(&SeenTime::new(device.response_time))
}

/// The same with other settings of the line than those of the plant, and the times that its devices have taken.
pub fn admit_as(
    def: &PlantDef,
    line: &LineDef,
    blocks: &[Block],
    time_of: &dyn Fn(&DeviceDef) -> DeviceTime,
) -> Admission {
    if line.listens {
        return Admission::of_nothing(line.id);
    }
    let loads = loads(def, line, blocks, time_of);
    let all: Vec<&Load> = loads.iter().collect();
    let critical: Vec<&Load> = loads.iter().filter(|load| load.class == PollClass::Critical).collect();
    let utilisation = load_of(&all);
    Admission {
        line: line.id,
        utilisation,
        schedulability: judge(&all, None),
        critical: judge(&critical, None),
        factor: factor(&loads),
        cycle: loads.iter().map(|load| load.words.cost).sum(),
        dead: dead(def, line, blocks, &loads),
        warnings: warnings(def, line, blocks, utilisation),
    }
}

fn loads(def: &PlantDef, line: &LineDef, blocks: &[Block], time_of: &dyn Fn(&DeviceDef) -> DeviceTime) -> Vec<Load> {
    let load = |block: &Block| {
        let Poll::Every(period) = block.poll else { return None };
        let device = def.device(block.device);
        let cost = cost(block, line, device, time_of(device));
        let words = PollWords { name: name_of(def, block), period, cost };
        Some(Load { device: block.device, class: block.class, words })
    };
    blocks.iter().filter_map(load).collect()
}

/// `TIC-1 input 1000–1007`.
fn name_of(def: &PlantDef, block: &Block) -> String {
    let (first, end) = block.range();
    let (device, table) = (&def.device(block.device).name, block.table.word());
    if end == first + 1 {
        format!("{device} {table} {first}")
    } else {
        format!("{device} {table} {first}–{}", end - 1)
    }
}

fn load_of(loads: &[&Load]) -> f64 {
    loads.iter().map(|load| load.words.cost.as_secs_f64() / load.words.period.as_secs_f64()).sum()
}

/// The test in microseconds (costs rounded up), in words. `extra` is one more task, such as the probes of a dead device.
fn judge(loads: &[&Load], extra: Option<&PollWords>) -> Schedulability {
    let polls: Vec<&PollWords> = loads.iter().map(|load| &load.words).chain(extra).collect();
    let micros = |span: Duration| u64::try_from(span.as_nanos().div_ceil(1000)).unwrap_or(u64::MAX);
    let tasks: Vec<Task> =
        polls.iter().map(|poll| Task { cost: micros(poll.cost), period: micros(poll.period) }).collect();
    match test(&tasks) {
        Test::Accept => Schedulability::Fits,
        Test::TooMuch => Schedulability::TooMuch { utilisation: utilisation(&tasks) },
        Test::OverloadInterval { length, demand, blocker } => {
            let span = Duration::from_micros(length);
            let mut due: Vec<PollWords> =
                polls.iter().filter(|poll| poll.period < span).map(|poll| (*poll).clone()).collect();
            due.sort_by_key(|poll| poll.period);
            let more = due.len().saturating_sub(NAMED_MAX);
            due.truncate(NAMED_MAX);
            let (demand, blocker) = (Duration::from_micros(demand), polls[blocker].clone());
            Schedulability::Blocked(OverloadInterval { span, demand, blocker, due, more })
        }
    }
}

/// By what the schedule will stretch the normal polls.
fn factor(loads: &[Load]) -> Option<f64> {
    let of = |class| load_of(&loads.iter().filter(|load| load.class == class).collect::<Vec<_>>());
    let demand = Demand {
        critical: of(PollClass::Critical),
        normal: of(PollClass::Normal),
        background: of(PollClass::Background),
    };
    if demand.total() <= 1.0 { Some(1.0) } else { Some(demand.factor()).filter(|factor| *factor < FACTOR_MAX) }
}

/// Each device in turn does not answer: its polls are gone, its probes come.
fn dead(def: &PlantDef, line: &LineDef, blocks: &[Block], loads: &[Load]) -> Vec<DeadDevice> {
    let polled = def.devices.iter().filter(|device| blocks.iter().any(|block| block.device == device.id));
    let dead = polled.map(|device| {
        let probe = Wire::new(line, device).failing(line.timeout);
        let words = PollWords { name: format!("the probe of {}", device.name), period: PROBE_EVERY, cost: probe };
        let others: Vec<&Load> = loads.iter().filter(|load| load.device != device.id).collect();
        DeadDevice {
            device: device.id,
            name: device.name.clone(),
            probe,
            utilisation: load_of(&others) + probe.as_secs_f64() / PROBE_EVERY.as_secs_f64(),
            schedulability: judge(&others, Some(&words)),
        }
    });
    dead.collect()
}

fn warnings(def: &PlantDef, line: &LineDef, blocks: &[Block], utilisation: f64) -> Vec<Warning> {
    let serial = line.transport.serial().filter(|serial| (serial.parity, serial.stop_bits) == (Parity::None, 1));
    let answer = |block: &Block| {
        let wire = Wire::new(line, def.device(block.device));
        wire.read(block.table, u32::from(block.count)) - wire.request - wire.turnaround - wire.silent_interval
    };
    let longest = blocks.iter().max_by_key(|block| answer(block)).filter(|block| line.timeout < answer(block));
    let timeout = longest.map(|block| Warning::TimeoutBelowAnswer {
        timeout: line.timeout,
        answer: answer(block),
        poll: name_of(def, block),
    });
    let server = matches!(
        (&line.transport, line.transport.framing()),
        (Transport::Network { .. }, Framing::Rtu | Framing::Ascii)
    );
    let full = (1.0 - WRITE_SHARE..=1.0).contains(&utilisation);
    let warnings = [
        serial.map(|_| Warning::NoParityOneStopBit),
        timeout,
        full.then_some(Warning::NoRoomForWrites { share: WRITE_SHARE }),
        server.then_some(Warning::SerialServer),
        too_many_units(def, line),
    ];
    warnings.into_iter().flatten().collect()
}

/// The units of a serial line against what its devices permit, or else what an RS-485 driver carries.
fn too_many_units(def: &PlantDef, line: &LineDef) -> Option<Warning> {
    line.transport.serial()?;
    let on_line = || def.devices.iter().filter(|device| device.line == line.id && device.unit != 0);
    let units = to_u16(on_line().map(|device| device.unit).collect::<BTreeSet<u8>>().len());
    let (most, device) =
        on_line().map(|device| (device.units_max.unwrap_or(UNITS_MAX), device)).min_by_key(|(most, _)| *most)?;
    let device = device.units_max.map(|_| device.name.clone());
    (most < units).then_some(Warning::TooManyUnits { units, most, device })
}

#[cfg(test)]
#[path = "admission/tests.rs"]
mod tests;
