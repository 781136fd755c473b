//! A campaign against the listener: lines of other masters whose bytes are lost, flipped, merged and late, by a seed. Every
//! value that is called good is compared with what the device held.
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod damage;
#[path = "../support/dice.rs"]
mod dice;
mod line;

use std::sync::Arc;

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    bus::listen::{Heard, Listener, Losses, events},
    plant::{
        ByteOrder, DataType, DeviceDef, DeviceId, Event, Framing, LineDef, LineId, Plant, PlantDef, Point, Protocol,
        Rs485, Serial, Table, TagDef, TagId, Transport,
    },
};

use self::{
    damage::Channel,
    line::{REFUSED, World, held},
};
pub use self::{
    damage::Damage,
    line::{Ask, Model, ask},
};

const LINE: LineId = LineId(0);
/// The quality of all values is looked at so often, in microseconds.
const LOOK: u64 = 250_000;
/// And first, once the master's order can be known.
const WARM: u64 = 60_000_000;

/// The lines on which the campaign runs.
pub fn models() -> Vec<Model> {
    let model = |name, baud, cycle: &[Ask]| Model {
        name,
        framing: Framing::Rtu,
        baud,
        cycle: cycle.to_vec(),
        round_ms: 0,
        shuffled: false,
        writes: false,
        batch_ms: 0,
        numbered: false,
        answer_ms: 16,
        timeout_ms: 300,
    };
    let same = [0, 10, 20, 30].map(|address| ask(1, 3, address, 4));
    let rates = [same[0], Ask { every: 5, ..same[1] }, Ask { every: 20, ..same[2] }];
    let units = [ask(1, 3, 0, 4), ask(2, 3, 0, 4), ask(1, 3, 10, 4), ask(2, 3, 10, 4), ask(3, 4, 0, 2)];
    let long = [0, 100, 200].map(|address| ask(1, 3, address, 60));
    let bits = [ask(1, 1, 0, 16), ask(1, 1, 16, 16), ask(1, 2, 0, 16), ask(1, 3, 0, 2), ask(1, 1, 0x300, 24)];
    let refused = [same[0], same[1], ask(1, 3, REFUSED, 4)];
    let (slow, fast) = (Some(9_600), Some(115_200));
    let tcp = |name, framing, cycle: &[Ask]| Model { framing, answer_ms: 8, ..model(name, None, cycle) };
    vec![
        model("RTU, two blocks in turn", slow, &same[..2]),
        Model { round_ms: 1_000, ..model("RTU, four blocks a second", slow, &same) },
        Model { round_ms: 1_000, ..model("RTU, one block a second", slow, &same[..1]) },
        Model { round_ms: 500, ..model("RTU, three rates", slow, &rates) },
        Model { batch_ms: 16, answer_ms: 4, ..model("RTU fast, batches of 16 ms", fast, &same) },
        Model { batch_ms: 16, answer_ms: 4, ..model("RTU fast, batches, two in turn", fast, &same[..2]) },
        Model { batch_ms: 16, answer_ms: 4, round_ms: 200, ..model("RTU fast, batches, three rates", fast, &rates) },
        Model { shuffled: true, ..model("RTU, any order", slow, &same) },
        Model { shuffled: true, batch_ms: 16, answer_ms: 4, ..model("RTU fast, batches, any order", fast, &same) },
        model("RTU, three units", slow, &units),
        model("RTU, bits and registers", slow, &bits),
        Model { round_ms: 1_000, writes: true, ..model("RTU, writes and refusals", slow, &refused) },
        Model { writes: true, batch_ms: 16, answer_ms: 4, ..model("RTU fast, writes, batches", fast, &refused) },
        Model { framing: Framing::Ascii, ..model("ASCII, three blocks in turn", slow, &same[..3]) },
        Model { framing: Framing::Ascii, writes: true, round_ms: 1_000, ..model("ASCII, writes", slow, &refused) },
        Model { timeout_ms: 40, ..model("RTU fast, timeout of 40 ms", fast, &same) },
        model("RTU, long blocks", slow, &long),
        tcp("RTU over TCP, three units", Framing::Rtu, &units),
        Model { round_ms: 200, ..tcp("RTU over TCP, three rates", Framing::Rtu, &rates) },
        Model { numbered: true, ..tcp("TCP, numbered", Framing::Mbap, &units) },
        tcp("TCP, always number 0", Framing::Mbap, &same),
    ]
}

/// What is done to them.
pub fn damages() -> Vec<Damage> {
    let none = Damage::default();
    vec![
        Damage { name: "none", ..none },
        Damage { name: "0.3 % of bytes lost", lost_bytes: 0.003, ..none },
        Damage { name: "3 % of bytes lost", lost_bytes: 0.03, ..none },
        Damage { name: "3 % of frames with flipped bits", flipped: 0.03, ..none },
        Damage { name: "3 % merged with the next", merged: 0.03, ..none },
        Damage { name: "3 % of frames lost whole", lost_frames: 0.03, ..none },
        Damage { name: "10 % of frames lost whole", lost_frames: 0.1, ..none },
        Damage { name: "1 % runs of frames lost", lost_runs: 0.01, ..none },
        Damage { name: "0.05 % runs of frames lost", lost_runs: 0.0005, ..none },
        Damage { name: "3 % chunks lost anywhere", lost_chunks: 0.03, ..none },
        Damage { name: "3 % of frames twice", duplicated: 0.03, ..none },
        Damage { name: "5 % with noise before them", noise: 0.05, ..none },
        Damage { name: "glued, 3 % lost whole", glued: 0.05, lost_frames: 0.03, ..none },
        Damage { name: "glued, 0.3 % of bytes lost", glued: 0.05, lost_bytes: 0.003, ..none },
        Damage { name: "0.3 % glued, 0.3 % lost whole", glued: 0.003, lost_frames: 0.003, ..none },
        Damage { name: "2 % of answers late", late: 0.02, ..none },
        Damage { name: "0.3 % spells of slow answers", slow: 0.003, ..none },
        Damage { name: "2 % late, 3 % lost whole", late: 0.02, lost_frames: 0.03, ..none },
        Damage {
            name: "all of it, 1 % each",
            lost_bytes: 0.001,
            flipped: 0.01,
            merged: 0.01,
            lost_frames: 0.01,
            lost_runs: 0.002,
            lost_chunks: 0.01,
            duplicated: 0.01,
            noise: 0.01,
            late: 0.01,
            slow: 0.001,
            glued: 0.01,
        },
    ]
}

/// What came of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outcome {
    /// Values that devices sent, that were called good, and that were called so wrongly.
    pub sent: u64,
    pub heard: u64,
    pub wrong: u64,
    /// Looks at values, and how many were good.
    pub looks: u64,
    pub good: u64,
}

impl Outcome {
    pub fn add(&mut self, other: Outcome) {
        self.sent += other.sent;
        self.heard += other.heard;
        self.wrong += other.wrong;
        self.looks += other.looks;
        self.good += other.good;
    }

    pub fn good_share(&self) -> f64 {
        self.good as f64 / self.looks.max(1) as f64
    }
}

/// A line that only listens, with a tag for everything that its master reads.
fn plant(model: &Model) -> PlantDef {
    let serial = Serial { baud: model.baud.unwrap_or_default(), ..Serial::USUAL };
    let transport = match model.baud {
        Some(_) => Transport::Serial { port: "heard".into(), serial, framing: model.framing, rs485: Rs485::Off },
        None => Transport::Network { protocol: Protocol::Tcp, host: "heard".into(), port: 502, framing: model.framing },
    };
    let mut def = PlantDef {
        name: "heard".into(),
        lines: vec![LineDef { listens: true, ..LineDef::new(LINE, "L1", transport) }],
        devices: (1..4)
            .map(|unit| DeviceDef { unit: unit as u8, ..DeviceDef::new(DeviceId(unit - 1), &format!("D{unit}"), LINE) })
            .collect(),
        ..PlantDef::default()
    };
    for ask in model.cycle.iter().filter(|ask| ask.address < REFUSED) {
        for address in ask.address..ask.address + ask.count {
            let (table, kind) = match ask.function {
                1 => (Table::Coil, DataType::Bool),
                2 => (Table::Discrete, DataType::Bool),
                3 => (Table::Holding, DataType::U16),
                _ => (Table::Input, DataType::U16),
            };
            let point = Point { table, address, kind, order: ByteOrder::Abcd, field: None };
            let (id, device) = (TagId(def.tags.len() as u16), DeviceId(u16::from(ask.unit) - 1));
            def.tags.push(TagDef::new(id, device, &format!("D{}.T{id:?}", ask.unit), point));
        }
    }
    def
}

fn at(micros: u64) -> Timestamp {
    Timestamp::UNIX_EPOCH + SignedDuration::from_micros(micros as i64)
}

/// The listener and its plant.
struct Judge {
    def: Arc<PlantDef>,
    listener: Listener,
    losses: Losses,
    plant: Plant,
    look_at: u64,
    outcome: Outcome,
}

impl Judge {
    fn hear(&mut self, now: u64, bytes: &[u8]) {
        self.pass(now);
        let heard = self.listener.hear(at(now), bytes);
        self.take(now, &heard);
    }

    /// Time passes without a byte.
    fn pass(&mut self, until: u64) {
        while let Some(silent) = self.listener.silent_at().filter(|silent| *silent <= at(until)) {
            let heard = self.listener.rest(silent);
            self.take(silent.as_microsecond() as u64, &heard);
        }
        while self.look_at <= until {
            self.plant.on_tick(at(self.look_at));
            if WARM <= self.look_at {
                let now = self.plant.snapshot();
                self.outcome.looks += now.samples.len() as u64;
                self.outcome.good += now.samples.iter().filter(|sample| sample.quality.is_good()).count() as u64;
            }
            self.look_at += LOOK;
        }
    }

    fn take(&mut self, now: u64, heard: &[Heard]) {
        let def = self.def.clone();
        for event in heard.iter().flat_map(|heard| events(&def, LINE, at(now), heard)) {
            self.judge(&event);
            let given_up = self.losses.observe(&self.def, &event);
            for event in std::iter::once(event).chain(given_up) {
                self.plant.on_event(event);
            }
        }
    }

    /// Compares what is called good with what the device held within the last seconds.
    fn judge(&mut self, event: &Event) {
        let Event::Read { at, values, exchange, .. } = event else { return };
        if exchange.as_ref().is_some_and(|exchange| exchange.outcome.is_err()) {
            return;
        }
        let second = at.as_second() as u64;
        let holds = |second: u64| {
            values.iter().all(|(tag, raw)| {
                let tag = self.def.tag(*tag);
                let unit = self.def.device(tag.device).unit;
                let function = match tag.point.table {
                    Table::Coil => 1,
                    Table::Discrete => 2,
                    Table::Holding => 3,
                    Table::Input => 4,
                };
                let word = held(unit, function, tag.point.address, second);
                *raw == f64::from(if function < 3 { word & 1 } else { word })
            })
        };
        self.outcome.heard += values.len() as u64;
        if !(second.saturating_sub(6)..=second).any(holds) {
            self.outcome.wrong += values.len() as u64;
        }
    }
}

/// Hears a line until so many values were sent on it.
pub fn run(model: &Model, damage: &Damage, seed: u64, values: u64) -> Outcome {
    let def = Arc::new(plant(model));
    let (mut world, mut channel) = (World::new(model, (damage.late, damage.slow), seed), Channel::default());
    let mut dice = dice::Dice(seed ^ 0x5EED);
    let mut judge = Judge {
        listener: Listener::new(&def.lines[0]),
        losses: Losses::new(&def),
        plant: Plant::new(def.clone(), at(0), 1.0),
        look_at: 0,
        outcome: Outcome::default(),
        def,
    };
    while world.values < values {
        let mut pieces = Vec::new();
        for sent in world.round() {
            channel.pass(&sent, damage, model, &mut dice, &mut pieces);
        }
        pieces.iter().for_each(|(now, bytes)| judge.hear(*now, bytes));
    }
    Outcome { sent: world.values, ..judge.outcome }
}
