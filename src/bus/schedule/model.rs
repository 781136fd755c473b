//! A line in figures: units that answer after a while or not at all, played in virtual time. What each poll is read of its
//! full rate, and how much of the line's time is used.

use super::{tests::at, *};
use crate::plant::{
    def::TagId,
    tag::{Poll, Table},
};

/// One unit with one poll.
#[derive(Debug, Clone)]
struct Unit {
    period: i64,
    /// What a read takes, ms.
    cost: i64,
    class: PollClass,
    /// It does not answer in this time, ms.
    dead: std::ops::Range<i64>,
}

fn unit(period: i64, cost: i64) -> Unit {
    Unit { period, cost, class: PollClass::Normal, dead: 0..0 }
}

struct Model {
    units: Vec<Unit>,
    schedule: Schedule,
    now: i64,
    /// Good reads, by unit: when they began.
    reads: Vec<Vec<i64>>,
    /// Time that good reads took, from when on: (begin, end).
    busy: Vec<(i64, i64)>,
}

impl Model {
    fn new(units: Vec<Unit>) -> Model {
        let block = |(n, unit): (usize, &Unit)| Block {
            device: DeviceId(n as u16),
            unit: n as u8 + 1,
            table: Table::Holding,
            address: 0,
            count: 10,
            tags: vec![TagId(0)].into(),
            poll: Poll::Every(Duration::from_millis(unit.period as u64)),
            class: unit.class,
            alignment: 1,
            address_words: 1,
        };
        let blocks: Vec<Block> = units.iter().enumerate().map(block).collect();
        let reads = vec![Vec::new(); units.len()];
        Model { schedule: Schedule::new(&blocks, at(0)), units, now: 0, reads, busy: Vec::new() }
    }

    fn play(&mut self, until: i64) {
        while self.now < until {
            let index = match self.schedule.next(at(self.now)) {
                Next::Run(index) => index,
                Next::WaitUntil(at) => {
                    self.now = at.as_millisecond().max(self.now + 1).min(until);
                    continue;
                }
                Next::Idle => return,
            };
            let (unit, started) = (&self.units[index], self.now);
            let (device, dead) = (DeviceId(index as u16), unit.dead.contains(&started));
            let response_timeout = self.schedule.response_timeout(index);
            let took = if dead { response_timeout } else { Duration::from_millis(unit.cost as u64) };
            self.now += took.as_millis() as i64;
            self.schedule.done(index, at(started), at(self.now));
            if dead {
                self.schedule.failed(Some(index), device, Failure::Silence, (at(started), took), at(self.now));
            } else {
                self.schedule.answered(Some(index), device, Some(Duration::from_millis(5)), at(self.now));
                self.schedule.spent(index, took);
                self.reads[index].push(started);
                self.busy.push((started, self.now));
            }
        }
    }

    /// The share of its full rate that a unit has kept in a span.
    fn kept(&self, unit: usize, span: &std::ops::Range<i64>) -> f64 {
        let reads = self.reads[unit].iter().filter(|began| span.contains(began)).count();
        reads as f64 * self.units[unit].period as f64 / (span.end - span.start) as f64
    }

    /// The same of all units that never die.
    fn healthy(&self, span: std::ops::Range<i64>) -> f64 {
        let healthy: Vec<usize> = (0..self.units.len()).filter(|unit| self.units[*unit].dead.is_empty()).collect();
        healthy.iter().map(|unit| self.kept(*unit, &span)).sum::<f64>() / healthy.len() as f64
    }

    /// The share of the time that good reads took.
    fn used(&self, span: std::ops::Range<i64>) -> f64 {
        let within = |(from, to): &(i64, i64)| ((*to).min(span.end) - (*from).max(span.start)).max(0);
        self.busy.iter().map(within).sum::<i64>() as f64 / (span.end - span.start) as f64
    }
}

/// Eight units, 250 ms each, 23 ms a read (10 registers at 19200 baud); some die.
fn eight(dead: &[(usize, i64)]) -> Model {
    let mut units = vec![unit(250, 23); 8];
    for (unit, since) in dead {
        units[*unit].dead = *since..i64::MAX;
    }
    let mut model = Model::new(units);
    model.play(200_000);
    model
}

#[test]
fn living_units_keep_their_rate_while_others_die() {
    const DIES: i64 = 60_000;
    let one = eight(&[(3, DIES)]);
    let three = eight(&[(1, DIES), (3, DIES), (6, DIES)]);
    let one_by_one = eight(&[(1, DIES), (3, DIES + 10_000), (4, DIES + 20_000), (6, DIES + 30_000)]);
    let start = eight(&[(3, 0)]);
    let three_at_start = eight(&[(1, 0), (3, 0), (6, 0)]);
    let mut poor = Vec::new();
    for (what, model, since) in [
        ("one", one, DIES),
        ("three", three, DIES),
        ("one after another", one_by_one, DIES),
        ("from the start", start, 0),
        ("three from the start", three_at_start, 0),
    ] {
        for span in [20_000, 60_000] {
            let kept = model.healthy(since..since + span);
            // Three timeouts of a second are 15 % of the first 20 s: no shorter wait tells a dead unit from a slow one.
            let least = if what == "three from the start" && span == 20_000 { 0.83 } else { 0.90 };
            if kept < least {
                poor.push(format!("{what}, first {span} ms: {kept:.3}"));
            }
        }
    }
    assert!(poor.is_empty(), "{poor:#?}");
}

/// Three units are dead from the start, and a fourth one does not answer until a while.
fn late_starter(until: i64) -> i64 {
    let mut units = vec![unit(250, 23); 8];
    for dead in [1, 3, 6] {
        units[dead].dead = 0..i64::MAX;
    }
    units[4].dead = 0..until;
    let mut model = Model::new(units);
    model.play(200_000);
    model.reads[4].first().map_or(i64::MAX, |first| first - until)
}

#[test]
fn a_unit_that_loses_its_first_frame_is_read_beside_dead_ones() {
    // It is asked first after two seconds.
    let found = late_starter(2_100);
    assert!(found < 5_000, "read {found} ms later");
}

#[test]
fn a_unit_that_starts_slowly_is_found_while_others_are_dead() {
    // The later it is up, the longer are the waits between tries, 30 s at most, and some more where the line has no time.
    let found = [3_000, 10_000, 20_000].map(late_starter);
    assert!(found.into_iter().zip([5_000, 45_000, 45_000]).all(|(found, most)| found <= most), "{found:?} ms later");
}

/// Normal units of an overloaded line.
const NORMAL: usize = 24;

#[test]
fn an_overloaded_line_is_used_and_shared_fairly() {
    let mut poor = Vec::new();
    for (demand, critical) in [102, 115, 153, 300].into_iter().flat_map(|demand| [(demand, false), (demand, true)]) {
        // Six units each at 250, 500, 1000 and 2000 ms that want the same share each; and an alarm input of 10 %.
        let mut units: Vec<Unit> = (0..NORMAL).map(|n| unit(250 << (n / 6), 0)).collect();
        let critical_share = if critical { 10 } else { 0 };
        for (n, unit) in units.iter_mut().enumerate() {
            // Whole milliseconds, and what is left over goes to the last of them.
            let wanted = |n: usize| unit.period * (demand - critical_share) * n as i64 / NORMAL as i64 / 100;
            unit.cost = wanted(n + 1) - wanted(n);
        }
        if critical {
            units.push(Unit { class: PollClass::Critical, ..unit(400, 40) });
        }
        let mut model = Model::new(units);
        model.play(300_000);
        let span = 30_000..300_000;
        let used = model.used(span.clone());
        let kept: Vec<f64> = (0..NORMAL).map(|unit| model.kept(unit, &span)).collect();
        let (least, most) =
            kept.iter().fold((f64::MAX, 0.0f64), |(least, most), kept| (least.min(*kept), most.max(*kept)));
        if used < 0.95 || most > 1.1 * least || (critical && model.kept(NORMAL, &span) < 0.999) {
            poor.push(format!("{demand} %: used {used:.3}, kept {least:.3}–{most:.3}"));
        }
    }
    assert!(poor.is_empty(), "{poor:#?}");
}
